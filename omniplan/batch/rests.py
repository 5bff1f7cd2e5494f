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

from omniplan.batch.chords import FAST, LOW, SWUNG, V0, body
from omniplan.batch.kinds import ANGLE, KIND, OWN_RANGE, SINGULAR, ZONE
from omniplan.batch.motions import FIELDS, KNOT, LANES, OWN, enclose
from omniplan.batch.refine import YES, one_row
from omniplan.batch.ways import change_time, direction_of, least_time
from omniplan.standing.rest import CUTS, DEEPEST

__all__ = ["CHANGES", "CLEAR", "OPEN", "change_at", "edge_at"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

CLEAR, OPEN = 1.0, 2.0
"""Whether it is known what a change takes, or left to `validate`."""
CHANGES = 5
"""Numbers per change: `CLEAR` or `OPEN`, the time it takes and the time there is, s;
the middle of the standstill, s; the wheel that turns furthest, by its number."""
NEARLY = 1e-9
"""Relative rounding of times."""
OUT = 1 + 1e-3
"""Utilisation that no rounding explains."""


@njit(cache=True, _nrt=True)
def _cut(a: float, b: float, i: int) -> float:
    """Return the i-th of the times at which an interval is cut evenly."""
    return a + (b - a) * i / CUTS if i < CUTS else b


@njit(cache=True, _nrt=True)
def _standing(
    knot: Array, form: int, a: float, b: float, is_start: bool, vehicle: Array,
    tolerances: Array, s: Array,
) -> int:  # fmt: skip
    """Count the parts of [a, b] that stand, one after the other, beside a standstill.

    Those at its end if the standstill begins there, else those at its start.
    """
    view = s[: FIELDS * LANES].reshape(FIELDS, LANES)
    count = 0
    for block in range(CUTS // LANES):
        first = CUTS - (block + 1) * LANES if is_start else block * LANES
        for k in range(LANES):
            t0, t1 = _cut(a, b, first + k), _cut(a, b, first + k + 1)
            enclose(knot, form, t0, t1, view, k)
        body(s, vehicle[0], vehicle[1], vehicle[2], tolerances[0])
        for k in range(LANES):
            if s[FAST + (LANES - 1 - k if is_start else k)] > tolerances[0]:
                return count
            count += 1
    return count


@njit(cache=True, _nrt=True)
def _at(
    knot: Array, form: int, t: float, vehicle: Array, tolerances: Array, s: Array,
    out: Array,
) -> bool:  # fmt: skip
    """Write a time, the velocity of K and ω then; return whether the vehicle stands."""
    view = s[: FIELDS * LANES].reshape(FIELDS, LANES)
    for k in range(LANES):
        enclose(knot, form, t, t, view, k)
    body(s, vehicle[0], vehicle[1], vehicle[2], tolerances[0])
    w = s[V0 + 2 * LANES]
    out[0], out[3] = t, w
    out[1] = s[V0] - w * vehicle[1]
    out[2] = s[V0 + LANES] + w * vehicle[0]
    return bool(s[FAST] <= tolerances[0])


@njit(cache=True, _nrt=True)
def edge_at(
    knots: Array, number: int, ends: tuple[int, int], form: int, is_start: bool,
    vehicle: Array, tolerances: Array, s: Array, out: Array,
) -> bool:  # fmt: skip
    """Find where a standstill begins or ends, as `standing.rest.edge_of` does.

    Parameters
    ----------
    knots : (k, KNOT) float
    number : int
        The knot that the piece beside the standstill ends in, or begins in.
    ends : two ints
        First and last knot of the motion.
    form : {TWISTS, POSES}
    is_start : bool
        Whether the standstill begins there.
    vehicle : (BODY,) float
    tolerances : (4,) float
    s : (ROOM,) float
        Scratch.
    out : (4,) float
        Time, s; velocity of K, m/s; ω, rad/s.

    Returns
    -------
    bool
        False if the vehicle does not stand at the sample there.
    """
    a, b = knots[number, 12], knots[number, 13]
    if not _at(
        knots[number], form, b if is_start else a, vehicle, tolerances, s, out
    ):  # fmt: skip
        return False
    level, is_known = 0, False
    while True:
        knot = knots[number]
        count = _standing(knot, form, a, b, is_start, vehicle, tolerances, s)
        was_known = is_known
        if count == CUTS:
            edge = a if is_start else b
            if level > 0 or number == (ends[0] if is_start else ends[1]):
                break
            number += -1 if is_start else 1
            is_known = True
            a, b = knots[number, 12], knots[number, 13]
            continue
        is_known |= count > 0
        row = CUTS - 1 - count if is_start else count
        t0, t1 = _cut(a, b, row), _cut(a, b, row + 1)
        edge = t1 if is_start else t0
        if (was_known and level > 0) or level == DEEPEST:
            break
        a, b = t0, t1
        level += 1
    _at(knots[number], form, edge, vehicle, tolerances, s, out)
    return True


@njit(cache=True, _nrt=True)
def _configuration(
    rest: Array, sign: float, vehicle: Array, tolerances: Array
) -> tuple[float, float]:
    """Return (κ_n, β) of a representation; of a vehicle bound to a line on it."""
    x, y, q = sign * rest[1], sign * rest[2], sign * rest[3] / vehicle[2]
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
def _is_out(
    corners: Array, own_rows: Array, vehicle: Array, tolerances: Array, s: Array
) -> bool:
    """Return whether the wheels cannot stand as one of the corners asks, for sure.

    Then no search finds a way.
    """
    view = s[: FIELDS * LANES].reshape(FIELDS, LANES)
    s[SWUNG : SWUNG + 2 * LANES] = 0.0  # v_n = 0
    knot, still = np.zeros(KNOT), tolerances.copy()
    still[0] = -1.0  # a configuration is one even where the vehicle stands
    for k in range(LANES):
        kappa_n, beta = corners[k % 2]
        knot[0], knot[2] = kappa_n, beta
        knot[6] = 1.0 if abs(kappa_n) < 1 else 0.0
        knot[7] = -1.0 if kappa_n < 0 else 1.0
        knot[8], knot[9], knot[10] = vehicle[2], vehicle[0], vehicle[1]
        enclose(knot, OWN, 0.0, 0.0, view, k)
    for r in range(own_rows.shape[0]):
        if own_rows[r, KIND] != OWN_RANGE and own_rows[r, KIND] != ZONE:
            continue
        one_row(s, own_rows, r, vehicle, still, YES)
        if max(s[LOW], s[LOW + 1]) > OUT:
            return True
    return False


@njit(cache=True, _nrt=True)
def change_at(
    knots: Array, numbers: tuple[int, int], ends: tuple[int, int], form: int,
    signs: tuple[float, float], own_rows: Array, rows: Array, vehicle: Array,
    tolerances: Array, s: Array, out: Array,
) -> None:  # fmt: skip
    """Write what changing the configuration at a standstill takes: see `CHANGES`.

    Parameters
    ----------
    knots : (k, KNOT) float
    numbers : two ints
        The knots in which the motion comes to rest and leaves it.
    ends : two ints
        First and last knot of the motion.
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
    edges = np.empty((2, 4))
    for i in range(2):
        if not edge_at(
            knots, numbers[i], ends, form, i == 0, vehicle, tolerances, s, edges[i]
        ):  # fmt: skip
            return
    rest = edges[1, 0] - edges[0, 0]
    corners = np.empty((2, 2))
    for i in range(2):
        at = _configuration(edges[i], signs[i], vehicle, tolerances)
        corners[i, 0], corners[i, 1] = at
    wheel, turn = _furthest(own_rows, vehicle, corners)
    out[2], out[3], out[4] = rest, (edges[0, 0] + edges[1, 0]) / 2, wheel
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
    elif time > rest * (1 + NEARLY):
        # A search might find a quicker way, unless the wheels cannot be so quick.
        least = least_time(own_rows, rows, vehicle, corners, 0, 1, True)
        needless = time < math.inf and least > rest * (1 + NEARLY)
        if time == math.inf:
            needless = _is_out(corners, own_rows, vehicle, tolerances, s)
        if needless or vehicle[4] == 0.0:
            out[0] = CLEAR
