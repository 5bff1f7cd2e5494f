"""How directions swing over parts of splines, in numba: `judging.swing` lane by lane.

Only fleets with limits on steering accelerations need it, so it is kept apart from the
enclosures of `motions`.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from omniplan.batch.chords import SWUNG
from omniplan.batch.kernel import kernel
from omniplan.batch.kinds import KIND, OFF_LINE, OWN_RANGE, SWING
from omniplan.batch.motions import FIELDS, LANES, OWN, SWING_FIELDS, TWISTS

__all__ = ["is_swinging", "is_wide", "load_swings", "swing_into", "widened"]

Array = Any  # numba infers the types; mypy cannot look into the kernels


@kernel()
def is_wide(kind: float) -> bool:
    """Return whether a kind of row asks for more than the enclosures."""
    return bool(kind >= SWING and kind != OWN_RANGE and kind != OFF_LINE)


@kernel()
def is_swinging(rows: Array) -> bool:
    """Return whether some row asks for more than the enclosures."""
    found = False
    for r in range(rows.shape[0]):
        found |= is_wide(rows[r, KIND])
    return found


@kernel()
def _factored(
    a: float, b: float, c: float, span: float, starts: bool, ends: bool
) -> tuple[float, float, float]:
    """Return the derivative of a cubic without its roots at rest, as `factored` has it.

    Coefficients, highest power first.
    """
    if starts and ends:
        return 0.0, 0.0, 3 * a
    if starts:
        return 0.0, 3 * a, 2 * b
    if ends:
        return 0.0, 3 * a, 3 * a * span + 2 * b
    return 3 * a, 2 * b, c


@kernel()
def swing_into(
    knot: Array, form: int, t0: float, t1: float, out: Array, row: int, lane: int
) -> None:
    """Write what `Swing.directions` tells of a part into a lane, from a row on.

    Rows: of both ends the twist over its factor (2), its first and second derivative
    (2 each), and the same of ω; then bounds on the first to fourth derivative of v and
    on the first and second of ω; 1 if all this is known. Twists that are linear between
    samples may bend suddenly: of those nothing is told, as if they never swung. Of
    Omni-Curve-Parameters the first two rows get |v_n| at both ends instead.

    Parameters
    ----------
    knot : (KNOT,) float
    form : {TWISTS, POSES, OWN}
    t0, t1 : float, s
    out : (..., LANES) float
    row, lane : int
    """
    for i in range(SWING_FIELDS):
        out[row + i, lane] = 0.0
    if form == OWN:
        for i in range(2):
            at = (t0 if i == 0 else t1) - knot[12]
            out[row + i, lane] = abs(knot[4] + at * knot[5])
        return
    if form == TWISTS:
        out[row, lane] = out[row + 9, lane] = 1.0
        return
    span, starts, ends = knot[13] - knot[12], knot[16] > 0.0, knot[17] > 0.0
    ax, bx, cx = _factored(knot[0], knot[1], knot[2], span, starts, ends)
    ay, by, cy = _factored(knot[4], knot[5], knot[6], span, starts, ends)
    aq, bq, cq = _factored(knot[8], knot[9], knot[10], span, starts, ends)
    px, py = knot[14], knot[15]
    s0, s1, w1, w2, q1 = 0.0, 0.0, 0.0, 0.0, 0.0
    s2, t3 = 2 * math.hypot(ax, ay), abs(6 * knot[8])
    for end in range(2):
        h = (t0 if end == 0 else t1) - knot[12]
        x0, y0, o0 = (ax * h + bx) * h + cx, (ay * h + by) * h + cy, (aq * h + bq) * h
        x1, y1, o1 = 2 * ax * h + bx, 2 * ay * h + by, 2 * aq * h + bq
        x2, y2, o2 = 2 * ax, 2 * ay, 2 * aq
        o0 += cq
        theta = ((knot[8] * h + knot[9]) * h + knot[10]) * h + knot[11]
        turn = (3 * knot[8] * h + 2 * knot[9]) * h + knot[10]
        bend = 6 * knot[8] * h + 2 * knot[9]
        # P, P' - jθ'P and P'' - 2jθ'P' - (jθ'' + θ'²)P, turned by e^{-jθ}
        ux, uy = x1 + turn * y0, y1 - turn * x0
        wx = x2 + 2 * turn * y1 + bend * y0 - turn * turn * x0
        wy = y2 - 2 * turn * x1 - bend * x0 - turn * turn * y0
        c, s = math.cos(theta), math.sin(theta)
        at = row + 9 * end
        out[at, lane], out[at + 1, lane] = (
            c * x0 + s * y0 + o0 * py, c * y0 - s * x0 - o0 * px,
        )  # fmt: skip
        out[at + 2, lane], out[at + 3, lane] = (
            c * ux + s * uy + o1 * py, c * uy - s * ux - o1 * px,
        )  # fmt: skip
        out[at + 4, lane], out[at + 5, lane] = (
            c * wx + s * wy + o2 * py, c * wy - s * wx - o2 * px,
        )  # fmt: skip
        out[at + 6, lane], out[at + 7, lane], out[at + 8, lane] = o0, o1, o2
        s0, s1 = max(s0, math.hypot(x0, y0)), max(s1, math.hypot(x1, y1))
        w1, w2, q1 = max(w1, abs(turn)), max(w2, abs(bend)), max(q1, abs(o1))
    bent = (t1 - t0) ** 2 / 8
    s0, w1 = s0 + bent * s2, w1 + bent * t3
    # |dᵏ/dtᵏ e^{-jθ}|, with θ⁗ = 0
    e2, e3 = w2 + w1**2, t3 + 3 * w1 * w2 + w1**3
    e4 = 3 * w2**2 + 4 * w1 * t3 + 6 * w1**2 * w2 + w1**4
    arm, q2 = math.hypot(px, py), 2 * abs(aq)
    out[row + 18, lane] = s1 + w1 * s0 + arm * q1
    out[row + 19, lane] = s2 + 2 * w1 * s1 + e2 * s0 + arm * q2
    out[row + 20, lane] = 3 * w1 * s2 + 3 * e2 * s1 + e3 * s0
    out[row + 21, lane] = 6 * e2 * s2 + 4 * e3 * s1 + e4 * s0
    out[row + 22, lane], out[row + 23, lane], out[row + 24, lane] = q1, q2, 1.0


@njit(cache=True)
def widened(blocks: Array, knot_of: Array, knots: Array, form: int) -> Array:
    """Return the blocks of a motion with how directions swing below the enclosures."""
    wide = np.empty((blocks.shape[0], FIELDS + SWING_FIELDS, LANES))
    wide[:, :FIELDS] = blocks
    for b in range(blocks.shape[0]):
        for k in range(LANES):
            swing_into(
                knots[knot_of[b, k]], form, blocks[b, 15, k], blocks[b, 16, k],
                wide[b], FIELDS, k,
            )  # fmt: skip
    return wide


@kernel()
def load_swings(blocks: Array, b: int, s: Array) -> None:
    """Copy how directions swing over a block into the scratch array."""
    for i in range(SWING_FIELDS):
        for k in range(LANES):
            s[SWUNG + i * LANES + k] = blocks[b, FIELDS + i, k]
