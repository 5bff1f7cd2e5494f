"""Time-optimal path parameterisation: the hot loops of `timing.fastest`, in numba.

Reachability analysis (TOPP-RA). On a grid ``u_0 < ... < u_n`` with ``x = u̇²`` and
constant ``ü`` over each interval, ``x_{j+1} = x_j + 2 Δ_j ü_j``. With (x_j, x_{j+1}) as
the two unknowns of an interval, every limit at its start and at its end is a strip
``low ≤ P x_{j+1} + Q x_j ≤ 1``. Standing still keeps every limit, so the controllable
sets are ``[0, K_j]``: a backward sweep finds each K_j by a linear programme of two
variables, a forward sweep then takes the largest x_{j+1} within K_{j+1}.

The plain NumPy twin is in the tests.

References
----------
H. Pham, Q.-C. Pham, "A New Approach to Time-Optimal Path Parameterization Based on
Reachability Analysis", IEEE T-RO 34(3), 2018, algorithms 1 and 2.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit, prange

from configspace.threads import RELEASES_LOCK
from omniplan.timing.row_kernels import evaluate_rows
from omniplan.timing.rows import FIRST_RATE, RowKind

__all__ = ["sweep", "time_jobs"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

X_MAX = 1e8
"""No faster than this, (m/s)²: where nothing bounds the speed."""
TINY = 1e-200
"""Stands for a factor of 0, so that what it divides is no bound."""

_SIZE_UP, _SIZE_DOWN = int(RowKind.SIZE_UP), int(RowKind.SIZE_DOWN)
_ALONG = int(RowKind.ACCELERATION_ALONG)
_FAST = {"nnan", "nsz", "reassoc", "contract"}
"""Reductions in any order; infinite values are meant, NaN never comes up."""


@njit(cache=True, inline="always", error_model="numpy")
def _is_one_sided(kind: int) -> bool:
    return kind in (_SIZE_UP, _SIZE_DOWN, _ALONG)


@njit(cache=True, error_model="numpy", fastmath=_FAST)
def _most(slope: Array, top: Array, j: int, k_next: float, x: float) -> float:
    """Return the largest x_{j+1} that x_j permits."""
    most = k_next
    for r in range(top.shape[1]):
        most = min(most, top[j, r] + slope[j, r] * x)
    return most


@njit(cache=True, error_model="numpy", fastmath=_FAST)
def _least(slope: Array, bottom: Array, j: int, x: float) -> float:
    """Return the least x_{j+1} that x_j permits."""
    least = 0.0
    for r in range(bottom.shape[1]):
        least = max(least, bottom[j, r] + slope[j, r] * x)
    return least


@njit(cache=True, error_model="numpy")
def _largest(
    slope: Array, top: Array, bottom: Array, j: int, k_next: float, cap: float
) -> float:
    """Return the largest x_j ≤ cap from which some x_{j+1} in [0, k_next] is left.

    What is left is a gap that is concave in x_j and not negative at 0; Newton's
    method from above ends at its zero after as many steps as it has faces at most.
    """
    x = cap
    for _ in range(2 * slope.shape[1] + 4):
        most = _most(slope, top, j, k_next, x)
        least = _least(slope, bottom, j, x)
        if least <= most + 1e-14 * (abs(least) + abs(most)):
            return x
        # The faces that meet too late.
        m0, m1, most = k_next, 0.0, k_next
        l0, l1, least = 0.0, 0.0, 0.0
        for r in range(slope.shape[1]):
            tilt = slope[j, r] * x
            if top[j, r] + tilt < most:
                m0, m1, most = top[j, r], slope[j, r], top[j, r] + tilt
            if bottom[j, r] + tilt > least:
                l0, l1, least = bottom[j, r], slope[j, r], bottom[j, r] + tilt
        # Both faces are open at 0, so that they only fail to meet, or do not meet
        # sooner, where rounding alone tells them apart.
        if l1 <= m1:
            return x
        reached = (m0 - l0) / (l1 - m1)
        if reached >= x * (1 - 1e-13):
            return x
        x = max(reached, 0.0)
    return 0.0


@njit(cache=True, error_model="numpy")
def sweep(slope: Array, top: Array, bottom: Array, cap: Array, x: Array) -> int:
    """Fill in x on the grid, from rest to rest; return the interval that stops it.

    Parameters
    ----------
    slope, top, bottom : (n, rows)
        ``bottom + slope x_j ≤ x_{j+1} ≤ top + slope x_j``, bottom ≤ 0 ≤ top
    cap : (n + 1,) largest x
    x : (n + 1,) out

    Returns
    -------
    interval : int
        -1 if there is a way through, else the first that cannot be passed.
    """
    n = cap.size - 1
    x[n] = 0.0
    for j in range(n - 1, -1, -1):
        x[j] = _largest(slope, top, bottom, j, x[j + 1], cap[j])
    stuck = -1
    x[0] = 0.0
    for j in range(n):
        x[j + 1] = max(_most(slope, top, j, x[j + 1], x[j]), 0.0)
        if x[j] + x[j + 1] <= 0.0 and stuck < 0:
            stuck = j
    return stuck


@njit(cache=True, error_model="numpy")
def _set_lines(
    a: Array,
    b: Array,
    low: Array,
    step: Array,
    slope: Array,
    top: Array,
    bottom: Array,
) -> None:
    """Fill in what the rows leave x_{j+1}, at the start and the end of each interval.

    With ``ü = (x_{j+1} - x_j) / 2Δ`` a row is ``low ≤ p x_{j+1} + q x_j ≤ 1``; b goes
    with x_j at the start of the interval and with x_{j+1} at its end.
    """
    rates = low.size
    first = a.shape[2] - rates
    for j in range(step.size):
        half = 0.5 / step[j]
        for r in range(rates):
            p = a[j, 0, first + r] * half
            q = b[j, 0, first + r] - p
            inverse = 1.0 / (p if p != 0.0 else TINY)
            slope[j, r] = -q * inverse
            top[j, r] = max(inverse, low[r] * inverse)
            bottom[j, r] = min(inverse, low[r] * inverse)
        for r in range(rates):
            q = -a[j, 1, first + r] * half
            p = b[j, 1, first + r] - q
            inverse = 1.0 / (p if p != 0.0 else TINY)
            slope[j, rates + r] = -q * inverse
            top[j, rates + r] = max(inverse, low[r] * inverse)
            bottom[j, rates + r] = min(inverse, low[r] * inverse)


@njit(cache=True, error_model="numpy")
def _use(
    table: Array,
    a: Array,
    b: Array,
    step: Array,
    x: Array,
    limiting: Array,
    share: Array,
) -> float:
    """Fill in which row is used most at every node, and how much; return the time."""
    n, m, time = step.size, a.shape[2], 0.0
    limiting[:], share[:] = -1, 0.0
    for j in range(n):
        change = (x[j + 1] - x[j]) / (2 * step[j])
        time += 2 * step[j] / (math.sqrt(x[j]) + math.sqrt(x[j + 1]))
        for end in range(2):
            at = j + end
            for r in range(m):
                used = a[j, end, r] * change + b[j, end, r] * x[at]
                if used < 0.0 and not _is_one_sided(table[0][r]):
                    used = -used
                if used > share[at]:
                    share[at], limiting[at] = used, r
    return time


@njit(cache=True, error_model="numpy")
def _time_job(
    table: Array,
    position: Array,
    heading: Array,
    point: complex,
    caps: Array,
    knot: Array,
    h0: Array,
    h1: Array,
    tight: Array,
    sigma: float,
    max_change: float,
    x: Array,
    limiting: Array,
    share: Array,
) -> tuple[int, float]:
    """Time one piece in one representation; see `time_jobs`."""
    n, m = knot.size, table[0].size
    if max_change == np.inf:  # the last row
        m -= 1
    first = 0
    while first < m and table[0][first] < FIRST_RATE:
        first += 1
    size = (n, 2 * (m - first))
    slope, top, bottom = np.empty(size), np.empty(size), np.empty(size)
    a, b = np.empty((n, 2, m)), np.empty((n, 2, m))
    step, cap, low = h1 - h0, np.full(n + 1, X_MAX), np.full(m - first, -1.0)
    for r in range(first, m):
        if _is_one_sided(table[0][r]):
            low[r - first] = -np.inf
    for j in range(n):
        for end in range(2):
            if end == 0 and j > 0 and knot[j] == knot[j - 1]:
                for r in range(m):
                    a[j, 0, r], b[j, 0, r] = a[j - 1, 1, r], b[j - 1, 1, r]
                continue
            evaluate_rows(
                table,
                position,
                heading,
                knot[j],
                h1[j] if end else h0[j],
                point,
                caps,
                sigma,
                max_change,
                j,
                end,
                a,
                b,
            )
            weight = tight[j + end] ** 2
            for r in range(m):
                a[j, end, r] *= weight
                b[j, end, r] *= weight
            load = 1.0 / X_MAX
            for r in range(first):
                load = max(load, b[j, end, r])
            cap[j + end] = min(cap[j + end], 1.0 / load)
    _set_lines(a, b, low, step, slope, top, bottom)
    stuck: int = sweep(slope, top, bottom, cap, x)
    return stuck, _use(table, a, b, step, x, limiting, share)


@njit(cache=True, parallel=True, nogil=RELEASES_LOCK, error_model="numpy")
def time_jobs(
    table: Array,
    position: Array,
    heading: Array,
    point: Array,
    caps: Array,
    knot: Array,
    h0: Array,
    h1: Array,
    tight: Array,
    first: Array,
    piece: Array,
    sigma: Array,
    max_change: Array,
    x: Array,
    limiting: Array,
    share: Array,
    stuck: Array,
    duration: Array,
) -> None:
    """Time pieces of paths in parallel.

    Parameters
    ----------
    table : tuple of arrays
        kind, point, turn, lever, coupling, scale of `RowTable`.
    position, heading : (4, knots) cubic coefficients of all pieces
    point : (pieces,) the reference points of the paths
    caps : (2, knots) caps of the paths on speed and yaw rate
    knot, h0, h1 : (intervals,) the polynomial of each grid interval and where on it
    tight : (jobs, nodes) ≥ 1, how many times more slowly the limits must be kept
    first : (pieces + 1,) the first interval of each piece
    piece, sigma, max_change : (jobs,) what to time, in which representation, max |ü|
    x, limiting, share : (jobs, nodes) out: u̇², the row used most, and by how much
    stuck : (jobs,) out: the interval that cannot be passed, -1 if all can
    duration : (jobs,) out, s

    Nodes of a piece start at ``first + piece``; rows of `tight`, `x`, `limiting` and
    `share` are as long as the longest piece has nodes.
    """
    for job in prange(piece.size):
        k = piece[job]
        begin, end = first[k], first[k + 1]
        nodes = end - begin + 1
        stuck[job], duration[job] = _time_job(
            table,
            position,
            heading,
            point[k],
            caps,
            knot[begin:end],
            h0[begin:end],
            h1[begin:end],
            tight[job, :nodes],
            sigma[job],
            max_change[job],
            x[job, :nodes],
            limiting[job, :nodes],
            share[job, :nodes],
        )
