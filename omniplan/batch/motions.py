"""Many trajectories as flat arrays, with the enclosures of `motion`, in numba.

A trajectory is cut at its samples, and towards rest ever finer: there the direction of
a velocity is known only on parts that are short against the time to rest. None of it
depends on a vehicle.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from omniplan.batch.kernel import kernel
from omniplan.motion import OmniCurveMotion, PoseMotion, TwistMotion, motion_of
from omniplan.trajectory import Trajectory

__all__ = [
    "FIELDS",
    "KNOT",
    "LANES",
    "Knots",
    "Motions",
    "enclose",
    "knots_of",
    "motions_of",
    "parts_of",
]

Array = Any  # numba infers the types; mypy cannot look into the kernels
FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

LANES = 16
"""Parts that the loops of `rows` treat at once."""
FIELDS = 21
"""Numbers per part: see `enclose`."""
SWING_FIELDS = 25
"""Numbers per part of how directions swing: see `swings`."""
KNOT = 18
"""Numbers per knot: twelve coefficients, start and end in s, the point in m, whether it
starts and whether it ends at rest. Of own Omni-Curve-Parameters κ_n, β and v_n with
their rates, whether |κ_n| ≤ 1, the sign of κ_n, κ_g and K instead of the coefficients
and the point."""

REST = 2e-4
"""Parts that are slower than this are not cut further, m/s."""
STEEP = 0.55
"""A part is cut while one end is slower than this share of the other."""
MAX_CUTS = 40
"""Cuts per part, at most."""
TURNING = 0.5
"""Metres that one radian counts in that comparison."""
TWISTS, POSES, OWN = 0, 1, 2
"""What the samples are; own ones are (κ_n, β, v_n) of the vehicle that is judged."""


@dataclass(frozen=True, eq=False)
class Motions:
    """The motions of n trajectories of poses or twists."""

    blocks: FloatArray
    """(b, FIELDS, LANES): parts by blocks; the last part of a motion fills its last."""
    knot_of: IntArray
    """(b, LANES): the knot each part belongs to."""
    first: IntArray
    """(n + 1,): first block of every motion."""
    count: IntArray
    """(n,): parts of every motion."""
    knots: FloatArray
    """(k, KNOT)."""
    forms: IntArray
    """(n,): `TWISTS`, `POSES` or `OWN`."""
    is_plain: npt.NDArray[np.bool_]
    """(b,): whether all parts of a block are intervals that are not cut."""
    wholes: FloatArray
    """(w, FIELDS, LANES): the intervals of the other blocks as a whole, likewise."""
    whole_knot: IntArray
    """(w, LANES): their knots."""
    first_whole: IntArray
    """(n + 1,): first block of these of every motion."""

    @property
    def arrays(self) -> tuple[Any, ...]:
        """What `judge_pairs` takes of it."""
        return (
            self.blocks,
            self.knot_of,
            self.first,
            self.count,
            self.knots,
            self.forms,
        )

    @property
    def samples(self) -> tuple[Any, ...]:
        """What `judge_pairs` takes of the intervals between the samples."""
        return self.is_plain, self.wholes, self.whole_knot, self.first_whole


@dataclass(frozen=True, eq=False)
class Knots:
    """The polynomials of n trajectories between their samples."""

    knots: FloatArray
    """(k, KNOT)."""
    first: IntArray
    """(n + 1,): first knot of every motion."""
    forms: IntArray
    """(n,): `TWISTS`, `POSES` or `OWN`."""


def knots_of(trajectories: Sequence[Trajectory], *, is_own: bool = False) -> Knots:
    """Return the polynomials of trajectories as flat arrays.

    Parameters
    ----------
    trajectories : sequence of Trajectory
        Of poses or twists.
    is_own : bool
        They are in Omni-Curve-Parameters instead, for their own vehicle.
    """
    knots, spans, forms = [], [0], []
    for trajectory in trajectories:
        table, form = _knots_of(trajectory, is_own)
        knots.append(table)
        spans.append(spans[-1] + len(table))
        forms.append(form)
    return Knots(
        np.concatenate(knots), np.array(spans), np.array(forms, dtype=np.int64)
    )


def motions_of(trajectories: Sequence[Trajectory], *, is_own: bool = False) -> Motions:
    """Return the parts of trajectories.

    Parameters
    ----------
    trajectories : sequence of Trajectory
    is_own : bool
        As for `knots_of`.
    """
    return parts_of(knots_of(trajectories, is_own=is_own))


def parts_of(knots: Knots) -> Motions:
    """Return the parts of motions; other threads may run meanwhile.

    Parameters
    ----------
    knots : Knots
    """
    flat, first_knot, forms = knots.knots, knots.first, knots.forms
    count = _count_parts(flat, first_knot, forms)
    first = np.concatenate([[0], np.cumsum(-(-count // LANES))])
    blocks = np.empty((int(first[-1]), FIELDS, LANES))
    knot_of = np.empty((int(first[-1]), LANES), np.int64)
    _fill_parts(flat, first_knot, forms, first, blocks, knot_of)
    is_plain, wholes, whole_knot, first_whole = _wholes_of(
        flat, forms, first, blocks, knot_of
    )
    return Motions(
        blocks,
        knot_of,
        first,
        count,
        flat,
        forms,
        is_plain,
        wholes,
        whole_knot,
        first_whole,
    )


def _knots_of(trajectory: Trajectory, is_own: bool) -> tuple[FloatArray, int]:
    """Return the polynomials between the samples, (m, KNOT), and what they are of."""
    motion = motion_of(trajectory, is_own=is_own)
    if isinstance(motion, OmniCurveMotion):
        return _legs_of(motion), OWN
    if isinstance(motion, PoseMotion):
        t, point = motion.t, motion.point
        table = np.zeros((t.size - 1, KNOT))
        table[:, 0:4] = motion.position.real.T
        table[:, 4:8] = motion.position.imag.T
        table[:, 8:12] = motion.heading.T
        table[:, 14:16] = point.real, point.imag
        if motion.rest is not None:
            table[:, 16:] = motion.rest.T
    else:
        assert isinstance(motion, TwistMotion)
        t = motion.t
        table = np.zeros((t.size - 1, KNOT))
        for column, values in ((0, motion.v.real), (4, motion.v.imag)):
            table[:, column], table[:, column + 1] = values[:-1], values[1:]
        table[:, 8], table[:, 9] = motion.omega[:-1], motion.omega[1:]
    table[:, 12], table[:, 13] = t[:-1], t[1:]
    return table, POSES if isinstance(motion, PoseMotion) else TWISTS


def _legs_of(motion: OmniCurveMotion) -> FloatArray:
    """Return the straight legs between the samples and the kinks."""
    t, samples = motion.t, motion.samples
    table = np.zeros((t.size - 1, KNOT))
    table[:, 0:6:2] = samples[:-1]
    table[:, 1:6:2] = np.diff(samples, axis=0) / np.diff(t)[:, None]
    middle = (samples[:-1, 0] + samples[1:, 0]) / 2
    table[:, 6], table[:, 7] = np.abs(middle) < 1, np.where(middle < 0, -1.0, 1.0)
    table[:, 8] = motion.kappa_g
    table[:, 9], table[:, 10] = motion.reference.real, motion.reference.imag
    table[:, 12], table[:, 13] = t[:-1], t[1:]
    return table


@kernel()
def _at(knot: Array, t: float, out: Array, v: int, v_dot: int, lane: int) -> Any:
    """Write v, ω and v̇, ω̇ of a spline; return the sizes of its first derivatives."""
    h = t - knot[12]
    x1 = (3 * knot[0] * h + 2 * knot[1]) * h + knot[2]
    y1 = (3 * knot[4] * h + 2 * knot[5]) * h + knot[6]
    x2, y2 = 6 * knot[0] * h + 2 * knot[1], 6 * knot[4] * h + 2 * knot[5]
    h0 = ((knot[8] * h + knot[9]) * h + knot[10]) * h + knot[11]
    h1 = (3 * knot[8] * h + 2 * knot[9]) * h + knot[10]
    h2 = 6 * knot[8] * h + 2 * knot[9]
    c, s = math.cos(h0), math.sin(h0)
    px, py = knot[14], knot[15]
    # e^{-jθ} p' - jθ' point and its derivative
    out[v, lane] = c * x1 + s * y1 + h1 * py
    out[v + 1, lane] = c * y1 - s * x1 - h1 * px
    out[v + 2, lane] = h1
    bx, by = x2 + h1 * y1, y2 - h1 * x1
    out[v_dot, lane] = c * bx + s * by + h2 * py
    out[v_dot + 1, lane] = c * by - s * bx - h2 * px
    out[v_dot + 2, lane] = h2
    return math.hypot(x1, y1), math.hypot(x2, y2)


@kernel()
def _second(knot: Array, t: float, out: Array, lane: int) -> None:
    """Write the second derivatives of v and ω of a spline."""
    h = t - knot[12]
    x1 = (3 * knot[0] * h + 2 * knot[1]) * h + knot[2]
    y1 = (3 * knot[4] * h + 2 * knot[5]) * h + knot[6]
    x2, y2 = 6 * knot[0] * h + 2 * knot[1], 6 * knot[4] * h + 2 * knot[5]
    h0 = ((knot[8] * h + knot[9]) * h + knot[10]) * h + knot[11]
    h1 = (3 * knot[8] * h + 2 * knot[9]) * h + knot[10]
    h2, h3 = 6 * knot[8] * h + 2 * knot[9], 6 * knot[8]
    x = 6 * knot[0] + 2 * h1 * y2 + h2 * y1 - h1 * h1 * x1
    y = 6 * knot[4] - 2 * h1 * x2 - h2 * x1 - h1 * h1 * y1
    c, s = math.cos(h0), math.sin(h0)
    out[17, lane] = c * x + s * y + h3 * knot[15]
    out[18, lane] = c * y - s * x - h3 * knot[14]
    out[19, lane] = h3


@kernel()
def _leg_at(knot: Array, t: float, out: Array, v: int, v_dot: int, lane: int) -> Any:
    """Write the direction of a leg in (κ_n, β) and its change; return c and e^{jβ}."""
    h = t - knot[12]
    kappa_n, beta, side = knot[0] + h * knot[1], knot[2] + h * knot[3], knot[7]
    gentle, kappa_g, kx, ky = knot[6] > 0.0, knot[8], knot[9], knot[10]
    c, s = (1.0, kappa_n) if gentle else (2.0 - abs(kappa_n), side)
    c_dot, s_dot = (0.0, knot[1]) if gentle else (-side * knot[1], 0.0)
    x, y = math.cos(beta), math.sin(beta)
    w, e = s * kappa_g, s_dot * kappa_g
    out[v, lane], out[v + 1, lane], out[v + 2, lane] = c * x + w * ky, c * y - w * kx, w
    turn = knot[3] * c
    out[v_dot, lane] = c_dot * x - turn * y + e * ky
    out[v_dot + 1, lane] = c_dot * y + turn * x - e * kx
    out[v_dot + 2, lane] = e
    return c, x, y


@kernel()
def _enclose_leg(knot: Array, t0: float, t1: float, out: Array, lane: int) -> None:
    """Write the enclosure of a part of a leg, as `OmniCurveMotion` has it."""
    c0, x, y = _leg_at(knot, t0, out, 0, 6, lane)
    c1, _, _ = _leg_at(knot, t1, out, 3, 9, lane)
    slope = 0.0 if knot[6] > 0.0 else -knot[7] * knot[1]
    turn, most = knot[3], max(c0, c1)
    out[12, lane] = 2 * abs(slope * turn) + most * turn * turn
    out[13, lane] = 0.0
    along, across = -c0 * turn * turn, 2 * slope * turn  # of e^{jβ} and j e^{jβ}
    out[17, lane], out[18, lane] = along * x - across * y, along * y + across * x
    out[19, lane] = 0.0
    out[20, lane] = 3 * abs(slope) * turn * turn + most * abs(turn) ** 3
    out[14, lane], out[15, lane], out[16, lane] = t1 - t0, t0, t1


@kernel()
def enclose(
    knot: Array, form: int, t0: float, t1: float, out: Array, lane: int
) -> None:
    """Write the enclosure of one part, as `Motion.enclose` has it, into a lane.

    Rows of `out`: v0 (2), ω0, v1 (2), ω1, v̇0 (2), ω̇0, v̇1 (2), ω̇1, bounds on |v̈| and
    |ω̈|, Δt, start and end; then v̈ at the start (2), ω̈ and a bound on the next
    derivative of v. ω̈ is constant over a part.

    Parameters
    ----------
    knot : (KNOT,) float
    form : {TWISTS, POSES, OWN}
    t0, t1 : float, s
    out : (FIELDS, LANES) float
    lane : int
    """
    if form == OWN:
        _enclose_leg(knot, t0, t1, out, lane)
        return
    dt = t1 - t0
    if form == POSES:
        s0, b0 = _at(knot, t0, out, 0, 6, lane)
        s1, b1 = _at(knot, t1, out, 3, 9, lane)
        p3 = 6 * math.hypot(knot[0], knot[4])
        h3 = 6 * abs(knot[8])
        p1 = max(s0, s1) + dt * dt / 8 * p3
        p2 = max(b0, b1)
        h1 = max(abs(out[2, lane]), abs(out[5, lane])) + dt * dt / 8 * h3
        h2 = max(abs(out[8, lane]), abs(out[11, lane]))
        arm = math.hypot(knot[14], knot[15])
        q = p3 + 2 * h1 * p2 + h2 * p1 + h1 * h1 * p1
        v_ddot = q + h3 * arm
        # d/dt (e^{-jθ} q) = e^{-jθ} (q' - jθ'q) with q as in `PoseMotion.enclose`
        third = h1 * q + 3 * h2 * p2 + 2 * h1 * p3 + h3 * p1
        out[20, lane] = third + 2 * h1 * h2 * p1 + h1 * h1 * p2
        _second(knot, t0, out, lane)
    else:
        span = knot[13] - knot[12]
        f0, f1 = (t0 - knot[12]) / span, (t1 - knot[12]) / span
        for i in range(3):
            first, last = knot[4 * i], knot[4 * i + 1]
            out[i, lane] = (1 - f0) * first + f0 * last
            out[3 + i, lane] = (1 - f1) * first + f1 * last
            out[6 + i, lane] = out[9 + i, lane] = (last - first) / span
        v_ddot, h3 = 0.0, 0.0
        out[17:21, lane] = 0.0
    out[12, lane], out[13, lane], out[14, lane] = v_ddot, h3, dt
    out[15, lane], out[16, lane] = t0, t1


@kernel()
def _cuts(knot: Array, form: int, times: Array, room: Array) -> int:
    """Write the times at which an interval is cut; return the number of parts."""
    times[0] = knot[12]
    end, count = knot[13], 1
    times[1] = end
    at = 0
    while at < count:
        if count >= MAX_CUTS:
            break
        enclose(knot, form, times[at], times[at + 1], room, 0)
        v0 = math.hypot(room[0, 0], room[1, 0]) + TURNING * abs(room[2, 0])
        v1 = math.hypot(room[3, 0], room[4, 0]) + TURNING * abs(room[5, 0])
        if max(v0, v1) <= REST or min(v0, v1) >= STEEP * max(v0, v1):
            at += 1
            continue
        for k in range(count, at, -1):
            times[k + 1] = times[k]
        times[at + 1] = (times[at] + times[at + 2]) / 2
        count += 1
    return count


@njit(cache=True, nogil=True)
def _count_parts(knots: Array, first_knot: Array, forms: Array) -> Array:
    count = np.zeros(forms.size, np.int64)
    times, room = np.empty(MAX_CUTS + 2), np.empty((FIELDS, LANES))
    for n in range(forms.size):
        for k in range(first_knot[n], first_knot[n + 1]):
            count[n] += _cuts(knots[k], forms[n], times, room)
    return count


@njit(cache=True, nogil=True)
def _fill_parts(
    knots: Array, first_knot: Array, forms: Array, first: Array, blocks: Array,
    knot_of: Array,
) -> None:  # fmt: skip
    times, room = np.empty(MAX_CUTS + 2), np.empty((FIELDS, LANES))
    for n in range(forms.size):
        at = first[n] * LANES
        for k in range(first_knot[n], first_knot[n + 1]):
            count = _cuts(knots[k], forms[n], times, room)
            for i in range(count):
                block, lane = at // LANES, at % LANES
                enclose(knots[k], forms[n], times[i], times[i + 1], blocks[block], lane)
                knot_of[block, lane] = k
                at += 1
        while at < first[n + 1] * LANES:
            block, lane = at // LANES, at % LANES
            blocks[block, :, lane] = blocks[block, :, lane - 1]
            knot_of[block, lane] = knot_of[block, lane - 1]
            at += 1


@njit(cache=True, nogil=True)
def _wholes_of(
    knots: Array, forms: Array, first: Array, blocks: Array, knot_of: Array
) -> tuple[Array, Array, Array, Array]:
    """Return which blocks are plain, and the intervals of the others."""
    is_plain = np.ones(blocks.shape[0], np.bool_)
    first_whole = np.zeros(forms.size + 1, np.int64)
    those = np.empty(blocks.shape[0] * LANES, np.int64)
    for n in range(forms.size):
        at, last = first_whole[n] * LANES, -1
        for b in range(first[n], first[n + 1]):
            for k in range(LANES):
                knot = knots[knot_of[b, k]]
                if blocks[b, 15, k] > knot[12] or blocks[b, 16, k] < knot[13]:
                    is_plain[b] = False
            for k in range(0 if is_plain[b] else LANES):
                if knot_of[b, k] != last:
                    those[at] = last = knot_of[b, k]
                    at += 1
        while at % LANES > 0:
            those[at] = last
            at += 1
        first_whole[n + 1] = at // LANES
    count = first_whole[-1]
    wholes = np.empty((count, FIELDS, LANES))
    for n in range(forms.size):
        for i in range(first_whole[n] * LANES, first_whole[n + 1] * LANES):
            knot = knots[those[i]]
            block, lane = wholes[i // LANES], i % LANES
            enclose(knot, forms[n], knot[12], knot[13], block, lane)
    whole_knot = those[: count * LANES].copy().reshape(count, LANES)
    return is_plain, wholes, whole_knot, first_whole
