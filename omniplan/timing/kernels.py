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
from omniplan.timing.rows import FIRST_RATE, RowKind

__all__ = ["evaluate_rows", "rows_along", "sweep", "time_jobs"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

X_MAX = 1e8
"""No faster than this, (m/s)²: where nothing bounds the speed."""
TINY = 1e-200
"""Stands for a factor of 0, so that what it divides is no bound."""
REST = 1e-9
"""Below this speed per u̇ a point counts as standing."""

_SIZE, _COMPONENT, _YAW = int(RowKind.SIZE), int(RowKind.COMPONENT), int(RowKind.YAW)
_LATERAL, _STEER_RATE = int(RowKind.LATERAL), int(RowKind.STEER_RATE)
_BESIDE, _REVERSE = int(RowKind.BESIDE), int(RowKind.REVERSE)
_PATH_SPEED = int(RowKind.PATH_SPEED)
_PATH_YAW, _PATH_POINT = int(RowKind.PATH_YAW), int(RowKind.PATH_POINT)
_SIZE_RATE = int(RowKind.SIZE_RATE)
_SIZE_UP, _SIZE_DOWN = int(RowKind.SIZE_UP), int(RowKind.SIZE_DOWN)
_COMPONENT_RATE = int(RowKind.COMPONENT_RATE)
_ALONG, _STEER_ACC = int(RowKind.ACCELERATION_ALONG), int(RowKind.STEER_ACCELERATION)
_SAMPLING, _BESIDE_RATE = int(RowKind.SAMPLING), int(RowKind.BESIDE_RATE)
_FAST = {"nnan", "nsz", "reassoc", "contract"}
"""Reductions in any order; infinite values are meant, NaN never comes up."""


@njit(cache=True, inline="always", error_model="numpy")
def _is_one_sided(kind: int) -> bool:
    return kind in (_SIZE_UP, _SIZE_DOWN, _ALONG)


@njit(cache=True, error_model="numpy")
def evaluate_rows(
    table: Array,
    position: Array,
    heading: Array,
    knot: int,
    h: float,
    point: complex,
    caps: Array,
    sigma: float,
    max_change: float,
    j: int,
    end: int,
    a: Array,
    b: Array,
) -> None:
    """Fill in ``a[j, end]`` and ``b[j, end]`` of ``a ü + b x`` at a place of a path.

    Of rows that bound x alone b is the load and a is 0.
    """
    kinds, points, turns, levers, couplings, scales = table
    c3, c2, c1 = position[0, knot], position[1, knot], position[2, knot]
    p1 = (3 * c3 * h + 2 * c2) * h + c1
    p2, p3 = 6 * c3 * h + 2 * c2, 6 * c3
    h3, h2, h1 = heading[0, knot], heading[1, knot], heading[2, knot]
    theta = ((h3 * h + h2) * h + h1) * h + heading[3, knot]
    t1 = (3 * h3 * h + 2 * h2) * h + h1
    t2, t3 = 6 * h3 * h + 2 * h2, 6 * h3
    e = complex(math.cos(theta), -math.sin(theta))
    # Velocity of the frame's origin per u̇ and its derivatives by u.
    v0 = e * p1 - 1j * t1 * point
    v1 = e * (p2 - 1j * t1 * p1) - 1j * t2 * point
    v2 = e * (p3 - 2j * t1 * p2 - 1j * t2 * p1 - t1 * t1 * p1) - 1j * t3 * point
    for r in range(a.shape[2]):
        kind, scale = kinds[r], scales[r]
        wx, wy = points[r].real, points[r].imag
        nx, ny = turns[r].real, -turns[r].imag
        a[j, end, r] = 0.0
        if kind == _YAW:
            b[j, end, r] = (t1 * scale) ** 2
            continue
        if kind == _SAMPLING:
            a[j, end, r], b[j, end, r] = 1 / max_change, 0.0
            continue
        if kind == _PATH_YAW:
            b[j, end, r] = (t1 / caps[1, knot]) ** 2
            continue
        if kind == _PATH_SPEED:
            b[j, end, r] = (p1.real**2 + p1.imag**2) / caps[0, knot] ** 2
            continue
        gx, gy = v0.real - t1 * wy, v0.imag + t1 * wx
        if kind == _COMPONENT:
            b[j, end, r] = ((gx * nx + gy * ny) * scale) ** 2
            continue
        square = gx * gx + gy * gy
        if kind == _SIZE:
            b[j, end, r] = square * scale**2
            continue
        if kind == _PATH_POINT:
            b[j, end, r] = square / caps[0, knot] ** 2
            continue
        if kind == _REVERSE:
            on_line = nx != 0.0 or ny != 0.0
            backward = gx * nx + gy * ny < 0 if on_line else sigma < 0
            b[j, end, r] = square * scale**2 if backward else 0.0
            continue
        if kind == _LATERAL:
            b[j, end, r] = abs(t1) * math.sqrt(square) * scale
            continue
        dx, dy = v1.real - t2 * wy, v1.imag + t2 * wx
        if kind == _COMPONENT_RATE:
            a[j, end, r] = (gx * nx + gy * ny) * scale
            b[j, end, r] = (dx * nx + dy * ny) * scale
            continue
        if kind == _ALONG:
            a[j, end, r] = (gx * nx + gy * ny) * scale
            b[j, end, r] = ((dx - t1 * gy) * nx + (dy + t1 * gx) * ny) * scale
            continue
        along = dx * gx + dy * gy
        if kind in (_SIZE_RATE, _SIZE_UP, _SIZE_DOWN):
            side = -scale if kind == _SIZE_DOWN else scale
            size = math.sqrt(square)
            a[j, end, r] = size * side
            if size > REST:
                b[j, end, r] = along / size * side
            else:  # through rest a speed declines and grows by |g'| x
                b[j, end, r] = math.sqrt(dx * dx + dy * dy) * scale
            continue
        # A wheel that stands on its centre of rotation is no matter of speed.
        square = max(square, REST * REST)
        inverse = 1.0 / square
        alpha1 = (dy * gx - dx * gy) * inverse
        if kind == _STEER_RATE:
            b[j, end, r] = (alpha1 * scale) ** 2
        elif kind == _BESIDE:
            rolls = math.sqrt(square) - sigma * (t1 + alpha1) * levers[r]
            b[j, end, r] = ((abs(rolls) + abs(alpha1) * couplings[r]) * scale) ** 2
        else:
            ex, ey = v2.real - t3 * wy, v2.imag + t3 * wx
            bend = ey * gx - ex * gy
            alpha2 = (bend - 2 * alpha1 * along) * inverse
            if kind == _STEER_ACC:
                a[j, end, r] = alpha1 * scale
                b[j, end, r] = alpha2 * scale
                continue
            size, lever, share = math.sqrt(square), sigma * levers[r], couplings[r]
            a[j, end, r] = (size - (t1 + alpha1) * lever + alpha1 * share) * scale
            rise = along / size - (t2 + alpha2) * lever + alpha2 * share
            b[j, end, r] = rise * scale


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


@njit(cache=True, error_model="numpy")
def rows_along(
    table: Array,
    position: Array,
    heading: Array,
    point: complex,
    caps: Array,
    knot: Array,
    h: Array,
    sigma: float,
) -> tuple[Array, Array]:
    """Return a and b of every row at many places of one path, (n, rows).

    Parameters
    ----------
    knot, h : (n,) the polynomial of each place and where on it
    """
    shape = (knot.size, 1, table[0].size)
    a, b = np.empty(shape), np.empty(shape)
    for j in range(knot.size):
        evaluate_rows(
            table,
            position,
            heading,
            knot[j],
            h[j],
            point,
            caps,
            sigma,
            np.inf,
            j,
            0,
            a,
            b,
        )
    return a[:, 0], b[:, 0]
