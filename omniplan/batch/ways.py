"""The time that wheels need from one configuration to another at rest, in numba.

As `standing.ways` has it, without a search: the straight way in both directions of β,
the way through pure translation and those through the poles, each proved by the rows of
a vehicle's own Omni-Curve-Parameters.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from omniplan.batch.chords import (
    AX,
    AY,
    BEND,
    BX,
    BY,
    DAX,
    DAY,
    DBX,
    DBY,
    DT,
    FAR,
    HIGH,
    J3,
    LOW,
    NA,
    NB,
    NEAR,
    SWUNG,
)
from omniplan.batch.kinds import (
    AT,
    BOUND,
    KIND,
    OFFSET,
    RATE,
    SHARE,
    SINGULAR,
    STEERING,
    SWING,
)
from omniplan.batch.motions import FIELDS, KNOT, LANES, OWN, enclose
from omniplan.batch.pace import pace_time, rest_to_rest
from omniplan.batch.refine import KEPT, YES, one_row
from omniplan.judging.proof import MAX_HALVINGS, RESOLUTION
from omniplan.standing.ways import RATE_HALVINGS, SLOW

__all__ = ["change_time", "direction_of", "least_time"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

MAX_CORNERS = 8
MAX_KNOTS = 24
MAX_PARTS = 512
"""Ways that need more parts to be proved are left to `validate`."""
PIECES = 2**RATE_HALVINGS


@njit(cache=True, _nrt=True)
def direction_of(row: Array, vehicle: Array, kappa_n: float, beta: float) -> Any:
    """Return the velocity of a wheel in a configuration."""
    size = abs(kappa_n)
    c, s = (1.0, kappa_n) if size < 1.0 else (2.0 - size, math.copysign(1.0, kappa_n))
    w = s * vehicle[2]
    x, y = row[AT] - vehicle[0], row[AT + 1] - vehicle[1]
    return c * math.cos(beta) - w * y, c * math.sin(beta) + w * x


@njit(cache=True, _nrt=True)
def _turn(row: Array, vehicle: Array, corners: Array, i: int, j: int) -> float:
    """Return by how much a wheel turns at least between two corners, rad."""
    ax, ay = direction_of(row, vehicle, corners[i, 0], corners[i, 1])
    bx, by = direction_of(row, vehicle, corners[j, 0], corners[j, 1])
    return abs(math.atan2(by * ax - bx * ay, bx * ax + by * ay))


@njit(cache=True, _nrt=True)
def _limits(own_rows: Array, rows: Array, r: int) -> tuple[float, float]:
    """Return the largest rate at rest and acceleration of the wheel of row r.

    That of its singular point; its other rows follow.
    """
    rate, swing = math.inf, math.inf
    for i in range(r + 1, own_rows.shape[0]):
        kind = own_rows[i, KIND]
        if kind == SINGULAR:
            break
        if kind == RATE:
            rate = min(rate, own_rows[i, BOUND])
        elif kind == STEERING:
            rate = min(rate, own_rows[i, BOUND] / own_rows[i, OFFSET])
    for i in range(rows.shape[0]):
        same = rows[i, AT] == own_rows[r, AT] and rows[i, AT + 1] == own_rows[r, AT + 1]
        if same and rows[i, KIND] == SWING:
            swing = rows[i, BOUND]
    return rate, swing


@njit(cache=True, _nrt=True)
def least_time(
    own_rows: Array, rows: Array, vehicle: Array, corners: Array, i: int, j: int,
    swings: bool,
) -> float:  # fmt: skip
    """Return the time that the wheels need at least between two corners, s.

    Parameters
    ----------
    own_rows, rows : (..., PARAMETERS) float
        Of the vehicle's own Omni-Curve-Parameters, and of other motions.
    vehicle : (BODY,) float
    corners : (n, 2) float
        κ_n and β.
    i, j : int
        Corners.
    swings : bool
        Whether they rest at both.
    """
    most = 0.0
    for r in range(own_rows.shape[0]):
        if own_rows[r, KIND] != SINGULAR:
            continue
        rate, swing = _limits(own_rows, rows, r)
        turn = _turn(own_rows[r], vehicle, corners, i, j)
        most = max(most, rest_to_rest(turn, rate, swing if swings else math.inf))
    return most


@njit(cache=True, _nrt=True)
def _knots_of(corners: Array, count: int, vehicle: Array, knots: Array) -> int:
    """Write the straight legs between corners, cut at |κ_n| = 1; return how many."""
    n = 0
    for i in range(count - 1):
        start, end = i * SLOW, (i + 1) * SLOW
        k0, k1, b0, b1 = (
            corners[i, 0], corners[i + 1, 0], corners[i, 1], corners[i + 1, 1],
        )  # fmt: skip
        t, kappa_n, beta = start, k0, b0
        first = -1.0 if k1 > k0 else 1.0
        for level in (first, -first, math.nan):
            until, to_k, to_b = end, k1, b1
            if not math.isnan(level):
                if (k0 - level) * (k1 - level) >= 0:
                    continue
                f = (k0 - level) / (k0 - k1)
                until, to_k, to_b = start + f * SLOW, level, b0 + f * (b1 - b0)
                if not t < until < end:
                    continue
            knot = knots[n]
            knot[:] = 0.0
            span = until - t
            knot[0], knot[1] = kappa_n, (to_k - kappa_n) / span
            knot[2], knot[3] = beta, (to_b - beta) / span
            middle = (kappa_n + to_k) / 2
            knot[6] = 1.0 if abs(middle) < 1 else 0.0
            knot[7] = -1.0 if middle < 0 else 1.0
            knot[8], knot[9], knot[10] = vehicle[2], vehicle[0], vehicle[1]
            knot[12], knot[13] = t, until
            t, kappa_n, beta = until, to_k, to_b
            n += 1
    return n


@njit(cache=True, _nrt=True)
def _state(
    own_rows: Array, vehicle: Array, tolerances: Array, s: Array, lanes: int,
    is_open: Array,
) -> bool:  # fmt: skip
    """Mark the lanes that need halving; return whether none is surely refused."""
    for k in range(lanes):
        is_open[k] = False
    for r in range(own_rows.shape[0]):
        if own_rows[r, KIND] == SHARE:
            continue
        one_row(s, own_rows, r, vehicle, tolerances, YES)
        for k in range(lanes):
            low, high = s[LOW + k], s[HIGH + k]
            if low > KEPT or (high > KEPT and high - low <= RESOLUTION):
                return False
            is_open[k] |= high > KEPT
    return True


@njit(cache=True, _nrt=True)
def _proved(
    knots: Array, count: int, own_rows: Array, vehicle: Array, tolerances: Array,
    s: Array, parts: Array, knot_of: Array,
) -> int:  # fmt: skip
    """Cut legs until they are proved; returns the number of parts.

    0 if they leave the space, -1 if that takes too many parts. `parts` (n, 3) gets
    start, end and halvings, in order of time.
    """
    view = s[: FIELDS * LANES].reshape(FIELDS, LANES)
    s[SWUNG : SWUNG + 2 * LANES] = 0.0  # v_n = 0
    n = count
    is_new, is_open = np.zeros(MAX_PARTS, np.bool_), np.zeros(LANES, np.bool_)
    for i in range(count):
        parts[i, 0], parts[i, 1], parts[i, 2] = knots[i, 12], knots[i, 13], 0
        knot_of[i], is_new[i] = i, True
    those, halved = np.empty(LANES, np.int64), np.zeros(MAX_PARTS, np.bool_)
    while True:
        lanes, some = 0, 0
        halved[:n] = False
        for i in range(n + 1):
            if i < n and is_new[i]:
                those[lanes] = i
                enclose(knots[knot_of[i]], OWN, parts[i, 0], parts[i, 1], view, lanes)
                lanes += 1
            if lanes == LANES or (i == n and lanes > 0):
                for k in range(lanes, LANES):
                    view[:, k] = view[:, 0]
                if not _state(own_rows, vehicle, tolerances, s, lanes, is_open):
                    return 0
                for k in range(lanes):
                    if is_open[k] and parts[those[k], 2] >= MAX_HALVINGS:
                        return 0
                    halved[those[k]] = is_open[k]
                    some += is_open[k]
                lanes = 0
        if some == 0:
            return n
        if n + some > MAX_PARTS:
            return -1
        at = n + some - 1
        for i in range(n - 1, -1, -1):  # from the back, so that nothing is lost
            t0, t1, depth, knot = parts[i, 0], parts[i, 1], parts[i, 2], knot_of[i]
            if halved[i]:
                middle = (t0 + t1) / 2
                parts[at, 0], parts[at, 1], parts[at, 2] = middle, t1, depth + 1
                parts[at - 1, 0], parts[at - 1, 1] = t0, middle
                parts[at - 1, 2] = depth + 1
                knot_of[at], knot_of[at - 1] = knot, knot
                is_new[at], is_new[at - 1] = True, True
                at -= 2
            else:
                parts[at, 0], parts[at, 1], parts[at, 2] = t0, t1, depth
                knot_of[at], is_new[at] = knot, False
                at -= 1
        n += some


@njit(cache=True, error_model="numpy", _nrt=True)
def _largest_rate(s: Array, k: int) -> float:
    """Return the bound on |α̇| of `turning`, for a wheel that `rate` has looked at."""
    near, dt, bend = s[NEAR + k], s[DT + k], s[BEND + k]
    if not near > 0.0:
        return math.inf
    n0 = abs(s[DAY + k] * s[AX + k] - s[DAX + k] * s[AY + k])
    n1 = abs(s[DBY + k] * s[BX + k] - s[DBX + k] * s[BY + k])
    steep = (max(n0, n1) + dt / 2 * bend * s[FAR + k]) / (near * near)
    gain = max(
        math.hypot(s[DAX + k], s[DAY + k]), math.hypot(s[DBX + k], s[DBY + k])
    ) + min(dt / 2 * bend, dt * dt / 8 * s[J3 + k])  # fmt: skip
    l1, l2, l3 = gain / near, bend / near, s[J3 + k] / near
    third = l3 + 3 * l1 * l2 + 2 * l1**3
    swung = min(dt / 2 * (l2 + l1 * l1), dt * dt / 8 * third)
    bent = max(n0 / s[NA + k] ** 2, n1 / s[NB + k] ** 2) + swung
    most: float = steep if steep < bent else bent
    return most


@njit(cache=True, _nrt=True)
def _leg_time(
    corners: Array, count: int, own_rows: Array, rows: Array, vehicle: Array,
    tolerances: Array, s: Array,
) -> float:  # fmt: skip
    """Return the time along straight pieces, from rest to rest; NaN if not known."""
    knots, knot_of = np.empty((MAX_KNOTS, KNOT)), np.empty(MAX_PARTS, np.int64)
    parts = np.empty((MAX_PARTS, 3))
    n = _knots_of(corners, count, vehicle, knots)
    n = _proved(knots, n, own_rows, vehicle, tolerances, s, parts, knot_of)
    if n <= 0:
        return math.inf if n == 0 else math.nan
    view = s[: FIELDS * LANES].reshape(FIELDS, LANES)
    share, ds = np.zeros(n * PIECES), np.empty(n * PIECES)
    for first in range(0, n * PIECES, LANES):
        i = first // PIECES
        t0, step = parts[i, 0], (parts[i, 1] - parts[i, 0]) / PIECES
        for k in range(LANES):
            j = first % PIECES + k
            start, end = t0 + j * step, t0 + (j + 1) * step
            enclose(knots[knot_of[i]], OWN, start, end, view, k)
            ds[first + k] = step
        for r in range(own_rows.shape[0]):
            if own_rows[r, KIND] == RATE or own_rows[r, KIND] == STEERING:
                one_row(s, own_rows, r, vehicle, tolerances, YES)
                is_rate = own_rows[r, KIND] == RATE
                lever = 1.0 if is_rate else own_rows[r, OFFSET]
                for k in range(LANES):
                    used = _largest_rate(s, k) * lever / own_rows[r, BOUND]
                    share[first + k] = max(share[first + k], used)
    time: float = pace_time(
        knots, knot_of[:n], parts[:n], rows, vehicle, share, ds, PIECES
    )
    return time


@njit(cache=True, _nrt=True)
def _add(corners: Array, count: int, kappa_n: float, beta: float) -> int:
    """Append a corner unless it repeats the last one; return how many there are."""
    last = count - 1
    if count > 0 and corners[last, 0] == kappa_n and corners[last, 1] == beta:
        return count
    corners[count, 0], corners[count, 1] = kappa_n, beta
    return count + 1


@njit(cache=True, _nrt=True)
def change_time(
    start: tuple[float, float], goal: tuple[float, float], own_rows: Array, rows: Array,
    vehicle: Array, tolerances: Array, s: Array,
) -> float:  # fmt: skip
    """Return the time of the quickest of the simple ways, s.

    Parameters
    ----------
    start, goal : (float, float), 1 and rad
    own_rows, rows : (..., PARAMETERS) float
        Of the vehicle's own Omni-Curve-Parameters, and of other motions.
    vehicle : (BODY,) float
    tolerances : (4,) float
    s : (ROOM,) float
        Scratch.

    Returns
    -------
    float
        Infinite if none of them is inside the space, NaN if that is not known.
    """
    k0, b0, k1, b1 = start[0], start[1], goal[0], goal[1]
    still = tolerances.copy()
    still[0] = -1.0  # a configuration is one even where the vehicle stands
    short = math.atan2(math.sin(b1 - b0), math.cos(b1 - b0))
    best, is_known = math.inf, True
    first, second = np.empty((MAX_CORNERS, 2)), np.empty((MAX_CORNERS, 2))
    for way in range(6):
        n, m = 0, 0
        if way < 4:
            turn = short - math.copysign(2 * math.pi, short) if way % 2 else short
            if way < 2:
                for f in range(4):
                    first[n, 0] = k0 + (k1 - k0) * f / 3
                    first[n, 1] = b0 + turn / 3 * f
                    n += 1
            elif k0 == 0 and k1 == 0:
                continue  # the straight way
            else:
                n = _add(first, n, k0, b0)
                for f in range(4):
                    n = _add(first, n, 0.0, b0 + turn / 3 * f)
                n = _add(first, n, k1, b0 + turn)
        else:
            pole = 2.0 if way == 4 else -2.0
            n = _add(first, _add(first, n, k0, b0), pole, b0)
            m = _add(second, _add(second, m, pole, b1), k1, b1)
        least = 0.0
        for i in range(n - 1):
            least += least_time(own_rows, rows, vehicle, first, i, i + 1, False)
        for i in range(m - 1):
            least += least_time(own_rows, rows, vehicle, second, i, i + 1, False)
        if least * (1 - 1e-9) >= best:
            continue
        time = 0.0
        if n > 1:
            time = _leg_time(first, n, own_rows, rows, vehicle, still, s)
        if m > 1 and time < best:
            time += _leg_time(second, m, own_rows, rows, vehicle, still, s)
        is_known &= not math.isnan(time)
        best = time if time < best else best
    return best if is_known else math.nan
