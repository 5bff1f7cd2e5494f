"""Many twists against one space, at the speed of memory: the kernels.

A first pass without branches puts every twist on the cube of `batch_surface` and
compares with two thresholds; it is cut into loops that the compiler turns into vector
code. What lies between the thresholds is decided in float64: most of it by the table
of the space, read quickly, the rest exactly.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, prange

from configspace.threads import RELEASES_LOCK
from omniplan.batch.narrow import narrow
from omniplan.batch.prefetch import prefetch
from omniplan.batch.settle import settle

__all__ = ["check", "check_parallel"]

Array = Any  # numba infers the types; mypy cannot look into the kernels
F, I32, U, B = np.float32, np.int32, np.uint32, np.uint8

PART = 2048
"""Twists that go through the loops together: their scratch arrays stay in L1."""
CHUNK = 16 * PART
"""Twists per task of a thread."""
TINY, HUGE = F(1e-30), F(1e15)
"""Outside of these a float32 may not be divided by safely: settled in float64."""
ZERO, ONE = F(0), F(1)
NEVER, FAR = F(-1), F(np.inf)
"""Instead of a threshold: settle it; refuse it."""
OPEN = 2
STRIDE = 16
"""Twists whose successors are asked for together ..."""
LINE = 64
"""... by lines of the cache, bytes."""
ANY_OPEN = np.uint64(0x0202020202020202)
"""`OPEN` in each of eight codes."""


@njit(cache=True, error_model="numpy")
def _cells_of_cube(
    twists: Array, cell: Array, q: Array, to_x: float, to_y: float, to_z: float,
    scale: float, half: float, side: int, signed: int,
) -> None:  # fmt: skip
    """Cell and threshold of flat twists; -1 for what is not compared in float32."""
    top, face = F(side - I32(1)), side * side
    faces_z, faces_behind = I32(2) * face, signed * face
    for k in range(cell.size):
        omega = F(twists[3 * k + 2])
        x = F(twists[3 * k]) + omega * to_x
        y = F(twists[3 * k + 1]) + omega * to_y
        z = omega * to_z
        ax, ay, az = abs(x), abs(y), abs(z)
        on_x = ax > ay
        xy_size = ax if on_x else ay
        on_z = az > xy_size
        m = az if on_z else xy_size
        xy, yx = (x if on_x else y), (y if on_x else x)
        lead, first, second = (
            (z if on_z else xy),
            (x if on_z else yx),
            (y if on_z else z),
        )
        fine = (m > TINY) & (m < HUGE)
        r = half / (lead if fine else ONE)
        # Comparisons in this order turn NaN into a cell, too.
        u, v = first * r + half, second * r + half
        u = u if u > ZERO else ZERO
        u = u if u < top else top
        v = v if v > ZERO else ZERO
        v = v if v < top else top
        before = I32(0) if on_x else face
        before = faces_z if on_z else before
        behind = faces_behind if lead < ZERO else I32(0)
        cell[k] = before + behind + I32(u) * side + I32(v)
        q[k] = m * scale if fine else NEVER


@njit(cache=True, error_model="numpy")
def _cells_of_square(
    twists: Array, cell: Array, q: Array, to_plane: Array,
    scale: float, half: float, side: int, sine2: float, slip: float, guard: float,
) -> None:  # fmt: skip
    """Like `_cells_of_cube`; -1 also where slip is not surely within its tolerance.

    `to_plane` are three linear forms: the two that move the vehicle and the slip.
    """
    a0, a1, a2 = to_plane[0, 0], to_plane[0, 1], to_plane[0, 2]
    b0, b1, b2 = to_plane[1, 0], to_plane[1, 1], to_plane[1, 2]
    c0, c1, c2 = to_plane[2, 0], to_plane[2, 1], to_plane[2, 2]
    top = F(side - I32(1))
    for k in range(cell.size):
        vx, vy, omega = F(twists[3 * k]), F(twists[3 * k + 1]), F(twists[3 * k + 2])
        x = vx * a0 + vy * a1 + omega * a2
        y = vx * b0 + vy * b1 + omega * b2
        aside = abs(vx * c0 + vy * c1 + omega * c2)
        ax, ay = abs(x), abs(y)
        on_x = ax > ay
        m = ax if on_x else ay
        lead, other = (x if on_x else y), (y if on_x else x)
        fine = (m > TINY) & (m < HUGE)
        r = half / (lead if fine else ONE)
        u = other * r + half
        u = u if u > ZERO else ZERO
        u = u if u < top else top
        face = I32(0) if on_x else I32(1)
        behind = I32(2) if lead < ZERO else I32(0)
        cell[k] = (face + behind) * side + I32(u)
        # v_s is at least m; slip beyond m would make `a` less exact than the guard.
        room = aside + guard * (aside + m)
        inside = (aside <= m) & ((room <= slip) | (room * room <= sine2 * m * m))
        # And its square is at most 2 m² + aside².
        rest = aside - guard * (aside + m)
        most = sine2 * (F(2) * m * m + aside * aside)
        outside = (rest > slip) & (rest * rest > most)
        threshold = m * scale if inside else NEVER
        threshold = FAR if outside else threshold
        q[k] = threshold if fine else NEVER


@njit(cache=True, error_model="numpy")
def _look(table: Array, cell: Array, found: Array, ahead: Array) -> None:
    """Look cells up, and ask for the twists that come next meanwhile."""
    for first in range(0, cell.size - STRIDE + 1, STRIDE):
        for at in range(0, 3 * STRIDE, LINE // ahead.itemsize):
            prefetch(ahead, 3 * first + at)
        for k in range(first, first + STRIDE):
            found[k] = table[U(cell[k])]
    for k in range(cell.size // STRIDE * STRIDE, cell.size):
        found[k] = table[U(cell[k])]


@njit(cache=True, error_model="numpy")
def _decide(found: Array, q: Array, codes: Array) -> None:
    """0 refused, 1 permitted, `OPEN` between the thresholds."""
    for k in range(found.size):
        low, high = F(I32(found[k] & U(0xFFFF))), F(I32(found[k] >> U(16)))
        above = ((q[k] > high) & (high < F(65535))) | (q[k] == FAR)
        code = B(1) if q[k] <= low else B(OPEN)
        code = B(0) if above else code
        codes[k] = code if q[k] >= ZERO else B(OPEN)


@njit(cache=True)
def _collect(codes: Array, words: Array, count: int, open_: Array) -> int:
    """Write which of the first `count` codes are `OPEN`; return how many.

    `words` are the same codes, eight at a time. `open_` needs room for eight more.
    """
    waiting = np.int64(0)
    for w in range((count + 7) // 8):
        if words[w] & ANY_OPEN:
            for k in range(8 * w, 8 * w + 8):
                open_[waiting] = k
                waiting += np.int64(codes[k] >> 1)
    # Beyond the end may be codes of the part before.
    while waiting > 0 and open_[waiting - 1] >= count:
        waiting -= 1
    return int(waiting)


@njit(cache=True)
def _hand_over(codes: Array, out: Array) -> None:
    """Copy; assigning slices takes several times as long."""
    for k in range(codes.size):
        out[k] = codes[k]


@njit(cache=True, nogil=RELEASES_LOCK)
def check(
    twists: Array, out: Array, table: Array, grid: tuple[float, ...],
    forms: tuple[Array, ...], point: tuple[float, ...], bound: tuple[float, ...],
    tables: tuple[Array, ...], loads: tuple[Array, ...], sectors: tuple[Array, ...],
    is_exact: bool,
) -> int:  # fmt: skip
    """Decide flat twists into `out`; return the first row that is not finite, or -1.

    Parameters
    ----------
    twists : (3 n,) float32 or float64, m/s, m/s, rad/s
    out : (n,) uint8
        0 or 1.
    table, grid
        Of a `Surface`: scale, half the side, side, signed; and the guard.
    forms : (3,) float32, (3, 3) float32
        Shifts to K and 1/κ_g; the linear forms of a bound vehicle.
    point : x and y of K in m, κ_g in 1/m
    bound
        Line-mobile? translating? the line in rad, sine of the slip angle, slip speed.
    tables, loads, sectors, is_exact
        Of a `Sheet`.
    """
    scale, half, side, signed, guard = grid
    shift, to_plane = forms
    is_bound = bound[0] + bound[1] > 0
    n = out.size
    cell, q, found = np.empty(PART, I32), np.empty(PART, F), np.empty(PART, U)
    codes, open_ = np.zeros(PART, B), np.empty(PART + 8, I32)
    words = codes.view(np.uint64)
    room = (np.empty(PART), np.empty(PART), np.empty(PART))
    for start in range(0, n, PART):
        stop = min(n, start + PART)
        count = stop - start
        part = twists[3 * start : 3 * stop]
        if is_bound:
            _cells_of_square(
                part, cell[:count], q[:count], to_plane, F(scale), F(half), I32(side),
                F(bound[3] * bound[3]), F(bound[4]), F(guard),
            )  # fmt: skip
        else:
            _cells_of_cube(
                part, cell[:count], q[:count], shift[0], shift[1], shift[2],
                F(scale), F(half), I32(side), I32(signed),
            )  # fmt: skip
        next_ = 3 * min(stop, n - count)
        ahead = twists[next_ : next_ + 3 * count]
        _look(table, cell[:count], found[:count], ahead)
        _decide(found[:count], q[:count], codes[:count])
        waiting = _collect(codes, words, count, open_)
        if waiting > 0 and not is_bound:
            waiting = narrow(part, open_, waiting, codes, point, tables, room)
        if waiting > 0:
            bad = settle(
                part, open_, waiting, codes, point, bound, tables, loads, sectors,
                is_exact,
            )  # fmt: skip
            if bad >= 0:
                return int(start + bad)
        _hand_over(codes[:count], out[start:stop])
    return -1


@njit(cache=True, parallel=True, nogil=RELEASES_LOCK)
def check_parallel(
    twists: Array, out: Array, table: Array, grid: tuple[float, ...],
    forms: tuple[Array, ...], point: tuple[float, ...], bound: tuple[float, ...],
    tables: tuple[Array, ...], loads: tuple[Array, ...], sectors: tuple[Array, ...],
    is_exact: bool,
) -> int:  # fmt: skip
    """Like `check`, in chunks over all threads."""
    n = out.size
    chunks = -(-n // CHUNK)
    bad = np.full(chunks, -1, np.int64)
    for chunk in prange(chunks):
        start, stop = chunk * CHUNK, min(n, (chunk + 1) * CHUNK)
        at = check(
            twists[3 * start : 3 * stop], out[start:stop], table, grid, forms, point,
            bound, tables, loads, sectors, is_exact,
        )  # fmt: skip
        if at >= 0:
            bad[chunk] = start + at
    for at in bad:
        if at >= 0:
            return int(at)
    return -1
