"""Groups of eight parts of a motion: lines near all velocities, for sixteen at once.

What `coarse` bounds rows by. None of it depends on a vehicle.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from omniplan.batch.kernel import kernel
from omniplan.batch.motions import LANES, TURNING, Motions

__all__ = ["PER_ROW", "groups_of"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

GROUP = 8
"""Parts per group; half a block."""
PER_BLOCK = LANES // GROUP
PER_ROW = LANES // PER_BLOCK
"""Blocks per row of groups: first the first groups of all of them, then the second."""
COMPARABLE = 0.5
"""The direction over a part is known if one end is no slower than this share of the
other: all parts but the slowest are cut until it is so."""
# Of v, of its change, and of v over its size: (vx, vy, ω) at both ends of a line, how
# far each is off it, how far (vx, vy) is off it. Then how fast the parts are of which
# the direction is not known, and how fast they turn.
VELOCITY, CHANGE, HEADING = 0, 10 * LANES, 20 * LANES
END, OFF, RADIUS = 3 * LANES, 6 * LANES, 9 * LANES
STILL, STILL_TURN = 30 * LANES, 31 * LANES
FIELDS = 32
SCRATCH = 27
"""Fields behind them that `coarse` writes to."""
GROUP_ROOM = (FIELDS + SCRATCH) * LANES
"""Numbers per row of groups."""
ROUNDING = 1e-9
"""By so much, relative, all bounds are wider: it covers float64 arithmetic."""


def groups_of(motions: Motions) -> tuple[npt.NDArray[np.float64], Array]:
    """Return the groups of all motions, and where those of each begin.

    Parameters
    ----------
    motions : Motions

    Returns
    -------
    groups : (c, GROUP_ROOM) float
        The last block of a motion fills its last row.
    first : (n + 1,) int
    """
    blocks = np.diff(motions.first)
    first = np.concatenate([[0], np.cumsum(-(-blocks // PER_ROW))])
    groups = np.zeros((int(first[-1]), GROUP_ROOM))
    _fill_groups(motions.blocks, motions.first, first, groups)
    return groups, first


@njit(cache=True, nogil=True)
def _fill_groups(blocks: Array, first: Array, first_group: Array, out: Array) -> None:
    ends, slack = np.empty((2 * GROUP, 4)), np.empty(2)
    for n in range(first.size - 1):
        last = first[n + 1] - first[n] - 1
        for g in range(LANES * (first_group[n + 1] - first_group[n])):
            row, to = g // LANES, g % LANES
            block = min(row * PER_ROW + to % PER_ROW, last)
            lane = to // PER_ROW * GROUP
            part = blocks[first[n] + block, :, lane : lane + GROUP]
            into = out[first_group[n] + row]
            _ends_of(part, 0, ends)
            slack[0], slack[1] = _bends(part, 0.125, 2)
            _enclose(ends, 2 * GROUP, slack, into[VELOCITY:], to)
            _ends_of(part, 6, ends)
            slack[0], slack[1] = _bends(part, 0.5, 1)
            _enclose(ends, 2 * GROUP, slack, into[CHANGE:], to)
            count = _headings_of(part, ends, slack, into, to)
            _enclose(ends, count, slack, into[HEADING:], to)


@kernel()
def _ends_of(part: Array, field: int, out: Array) -> None:
    """Write values at both ends of all parts, and the times of these."""
    for k in range(GROUP):
        for end in range(2):
            for i in range(3):
                out[2 * k + end, i] = part[field + 3 * end + i, k]
            out[2 * k + end, 3] = part[15 + end, k]


@kernel()
def _bends(part: Array, share: float, power: int) -> tuple[float, float]:
    """Return what v and ω between the ends of a part may be off their chords by."""
    bend, turn = 0.0, 0.0
    for k in range(GROUP):
        step = share * part[14, k] ** power
        bend, turn = max(bend, step * part[12, k]), max(turn, step * part[13, k])
    return bend, turn


@kernel()
def _headings_of(
    part: Array, ends: Array, slack: Array, out: Array, lane: int
) -> int:  # fmt: skip
    """Write velocities over their sizes at the ends of parts; return how many ends.

    Only of parts with ends of comparable sizes: between these a velocity over a size
    between theirs is between the values at the ends, but for what it is off its chord.
    Of the other parts `out` gets how fast they are.
    """
    count, still, turning = 0, 0.0, 0.0
    slack[0], slack[1] = 0.0, 0.0
    for k in range(GROUP):
        step = 0.125 * part[14, k] ** 2
        bend, turn = step * part[12, k], step * part[13, k]
        p = math.hypot(part[0, k], part[1, k])
        q = math.hypot(part[3, k], part[4, k])
        w0, w1 = abs(part[2, k]), abs(part[5, k])
        a, b = p + TURNING * w0, q + TURNING * w1
        least, most = min(a, b), max(a, b)
        if not least > COMPARABLE * most:
            still = max(still, (max(p, q) + bend) * (1 + ROUNDING))
            turning = max(turning, (max(w0, w1) + turn) * (1 + ROUNDING))
            continue
        for end in range(2):
            size = b if end else a
            for i in range(3):
                ends[count, i] = part[3 * end + i, k] / size
            ends[count, 3] = part[15 + end, k]
            count += 1
        slack[0], slack[1] = max(slack[0], bend / least), max(slack[1], turn / least)
    out[STILL + lane], out[STILL_TURN + lane] = still, turning
    return count


@kernel()
def _enclose(ends: Array, count: int, slack: Array, out: Array, lane: int) -> None:
    """Write a line over time near the first `count` ends, and how far they are off it.

    What lies between two ends is no farther off but for the slack: of (x, y), of ω.
    Without ends there is nothing to be off; the radius tells that by -1.
    """
    if count == 0:
        for i in range(10):
            out[i * LANES + lane] = 0.0
        out[RADIUS + lane] = -1.0
        return
    t0, span = ends[0, 3], ends[count - 1, 3] - ends[0, 3]
    per = 1.0 / (span if span > 0.0 else 1.0)
    shift_x, shift_y, sizes = 0.0, 0.0, 0.0
    for i in range(3):
        first, step = ends[0, i], ends[count - 1, i] - ends[0, i]
        least, most, size = np.inf, -np.inf, 0.0
        for k in range(count):
            off = ends[k, i] - (first + (ends[k, 3] - t0) * per * step)
            least, most = min(least, off), max(most, off)
            size = max(size, abs(ends[k, i]))
        shift = (least + most) / 2
        more = slack[1] if i == 2 else slack[0]
        out[i * LANES + lane] = first + shift
        out[END + i * LANES + lane] = first + step + shift
        out[OFF + i * LANES + lane] = (most - least) / 2 + more + ROUNDING * size
        if i == 0:
            shift_x = shift
        elif i == 1:
            shift_y = shift
        sizes += size if i < 2 else 0.0
    radius = 0.0
    for k in range(count):
        f = (ends[k, 3] - t0) * per
        x = ends[k, 0] - (1 - f) * ends[0, 0] - f * ends[count - 1, 0] - shift_x
        y = ends[k, 1] - (1 - f) * ends[0, 1] - f * ends[count - 1, 1] - shift_y
        radius = max(radius, math.sqrt(x * x + y * y))
    out[RADIUS + lane] = radius + slack[0] + ROUNDING * (sizes + radius)
