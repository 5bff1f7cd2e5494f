"""What happens at a standstill between two pieces of a motion, in numba.

As `standing.standstill` has it: where the vehicle comes to rest and leaves it, how far
the wheels must turn from one configuration to the other, and whether there is time.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from omniplan.batch.chords import FAST, NA, NB, V0, V1, body
from omniplan.batch.kinds import ANGLE, KIND, OWN_RANGE, SINGULAR
from omniplan.batch.motions import FIELDS, LANES, POSES, enclose
from omniplan.batch.ways import change_time, direction_of, least_time
from omniplan.judging.proof import MAX_HALVINGS

__all__ = ["CHANGES", "CLEAR", "OPEN", "change_at"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

CLEAR, OPEN = 1.0, 2.0
"""Whether it is known what a change takes, or left to `validate`."""
CHANGES = 5
"""Numbers per change: `CLEAR` or `OPEN`, the time it takes and the time there is, s;
the middle of the standstill, s; the wheel that turns furthest, by its number."""
REST = 1e-9
"""Slower than this the splines of poses are at rest, m/s."""
NEARLY = 1e-9
"""Relative rounding of times."""


@njit(cache=True, _nrt=True)
def _rest(
    knot: Array, form: int, at_end: bool, vehicle: Array, tolerances: Array, s: Array,
    out: Array,
) -> bool:  # fmt: skip
    """Find where a motion comes to rest before the end of a knot, or starts after it.

    The interval is halved towards the rest until the vehicle is taken to stand over
    what is left. `out` gets that time and the most that it may be off by, if the parts
    of `validate` are cut finer there, infinite if not known; then the velocity of K and
    ω. Returns whether this is known.
    """
    view = s[: FIELDS * LANES].reshape(FIELDS, LANES)
    start, end = knot[12], knot[13]
    t0, t1, found = start, end, False
    for _ in range(MAX_HALVINGS):
        if at_end:
            t0 = (t0 + t1) / 2
        else:
            t1 = (t0 + t1) / 2
        for k in range(LANES):
            enclose(knot, form, t0, t1, view, k)
        body(s, vehicle[0], vehicle[1], vehicle[2], tolerances[0])
        if s[FAST] <= tolerances[0]:
            found = True
            break
    last = s[NB] if at_end else s[NA]
    omega = s[V1 + 2 * LANES] if at_end else s[V0 + 2 * LANES]
    speed = max(last, abs(omega) / vehicle[2])
    if not found or speed > (REST if form == POSES else 0.0):
        return False
    at = V0 if at_end else V1
    w = s[at + 2 * LANES]
    out[2] = s[at] - w * vehicle[1]
    out[3] = s[at + LANES] + w * vehicle[0]
    out[4] = w
    out[0] = t0 if at_end else t1
    # How far from the rest the vehicle may still be so slow.
    size, far = t1 - t0, t1 - t0
    while True:
        far *= 2
        if far > end - start:
            out[1] = math.inf
            return True
        t = end - far if at_end else start + far
        for k in range(LANES):
            enclose(knot, form, t, t, view, k)
        body(s, vehicle[0], vehicle[1], vehicle[2], tolerances[0])
        if s[FAST] > tolerances[0]:
            break
    out[1] = far - size
    return True


@njit(cache=True, _nrt=True)
def _configuration(
    rest: Array, sign: float, vehicle: Array, tolerances: Array
) -> tuple[float, float]:
    """Return (κ_n, β) of a representation; of a vehicle bound to a line on it."""
    x, y, q = sign * rest[2], sign * rest[3], sign * rest[4] / vehicle[2]
    p, size = math.hypot(x, y), abs(q)
    kappa_n = 0.0
    if size < p:
        kappa_n = size / p
    elif size > 0.0:
        kappa_n = 2.0 - p / size
    beta = math.atan2(y, x) if p > 0.0 else 0.0
    line = vehicle[5]
    if not math.isnan(line):
        for i in range(2):
            near = line + i * math.pi
            near = math.atan2(math.sin(near), math.cos(near)) if i else near
            off = math.atan2(math.sin(beta - near), math.cos(beta - near))
            if abs(off) <= math.asin(tolerances[1]):
                beta = near
                break
    return (-kappa_n if q < 0 else kappa_n), beta


@njit(cache=True, _nrt=True)
def _furthest(own_rows: Array, vehicle: Array, corners: Array) -> tuple[int, float]:
    """Return which wheel must turn furthest from corner to corner, and by how much."""
    wheel, most, number = -1, 0.0, -1
    for r in range(own_rows.shape[0]):
        if own_rows[r, KIND] != SINGULAR:
            continue
        number += 1
        x0, y0 = direction_of(own_rows[r], vehicle, corners[0, 0], corners[0, 1])
        x1, y1 = direction_of(own_rows[r], vehicle, corners[1, 0], corners[1, 1])
        a, b = math.atan2(y0, x0), math.atan2(y1, x1)
        ranged = r + 1 < own_rows.shape[0] and own_rows[r + 1, KIND] == OWN_RANGE
        if ranged:
            middle = own_rows[r + 1, ANGLE]
            a = math.atan2(math.sin(a - middle), math.cos(a - middle))
            b = math.atan2(math.sin(b - middle), math.cos(b - middle))
        turn = b - a
        if not ranged:
            turn = math.atan2(math.sin(turn), math.cos(turn))
        if wheel < 0 or abs(turn) > most:
            wheel, most = number, abs(turn)
    return wheel, most


@njit(cache=True, _nrt=True)
def change_at(
    before: Array, after: Array, form: int, signs: tuple[float, float], own_rows: Array,
    rows: Array, vehicle: Array, tolerances: Array, s: Array, out: Array,
) -> None:  # fmt: skip
    """Write what changing the configuration at a standstill takes: see `CHANGES`.

    Parameters
    ----------
    before, after : (KNOT,) float
        The knots in which the motion comes to rest and leaves it.
    form : {TWISTS, POSES}
    signs : two floats, {-1, 1}
        The representations before and after.
    own_rows, rows : (..., PARAMETERS) float
        Of the vehicle's own Omni-Curve-Parameters, and of other motions.
    vehicle : (BODY,) float
    tolerances : (4,) float
    s : (ROOM,) float
        Scratch.
    out : (CHANGES,) float
    """
    out[0] = OPEN
    out[1:] = 0.0
    ends = np.empty((2, 5))
    if not _rest(before, form, True, vehicle, tolerances, s, ends[0]):
        return
    if not _rest(after, form, False, vehicle, tolerances, s, ends[1]):
        return
    rest = ends[1, 0] - ends[0, 0]
    longest = rest + ends[0, 1] + ends[1, 1]
    corners = np.empty((2, 2))
    for i in range(2):
        at = _configuration(ends[i], signs[i], vehicle, tolerances)
        corners[i, 0], corners[i, 1] = at
    wheel, turn = _furthest(own_rows, vehicle, corners)
    out[2], out[3], out[4] = rest, (ends[0, 0] + ends[1, 0]) / 2, wheel
    if abs(turn - tolerances[3]) <= 1e-6 * tolerances[3]:
        return
    if turn <= tolerances[3]:
        out[0] = CLEAR
        return
    time = change_time(
        (corners[0, 0], corners[0, 1]), (corners[1, 0], corners[1, 1]), own_rows, rows,
        vehicle, tolerances, s,
    )  # fmt: skip
    out[1] = time
    if time <= rest * (1 - NEARLY):
        out[0] = CLEAR
    elif time > longest * (1 + NEARLY):
        # A search might find a quicker way, unless the wheels cannot be so quick.
        least = least_time(own_rows, rows, vehicle, corners, 0, 1, True)
        needless = time < math.inf and least > longest * (1 + NEARLY)
        if needless or vehicle[4] == 0.0:
            out[0] = CLEAR
