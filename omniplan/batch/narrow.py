"""What thresholds leave open, a second time: the table of a space, read quickly.

Between the thresholds of `batch_surface` and the exact formulas of `batch_settle` lies
what most open twists need: the interpolated load of the right cell, with an arc tangent
by polynomial. Its error moves the place in the table a little, and the load by no more
than the nodes of the cell differ, so most twists are surely below or above; the rest,
and what lies near the border of a part of a cell, stays open.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

from numba import njit

from configspace.kernels import BLOCKED, FREE

__all__ = ["narrow"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

ANGLE_ERROR = 3e-8
"""How far `arc_tangent` may be off, rad; its source says 2e-8."""
PLACE_ERROR = 1e-12
"""What covers the rounding of a place in the table, relative to its size."""
GUARD = 1e-9
"""What covers the rounding of a load, relative."""
TINY, HUGE = 1e-60, 1e60
"""Squares of speeds outside of these are left open."""


@njit(cache=True, error_model="numpy")
def arc_tangent(y: float, x: float) -> float:
    """Return atan2(y, x) to `ANGLE_ERROR` (Abramowitz and Stegun 4.4.49)."""
    ax, ay = abs(x), abs(y)
    small, large = (ay if ay < ax else ax), (ax if ay < ax else ay)
    t = small / (large if large > 0.0 else 1.0)
    q = t * t
    p = 0.0028662257 * q - 0.0161657367
    p = p * q + 0.0429096138
    p = p * q - 0.0752896400
    p = p * q + 0.1065626393
    p = p * q - 0.1420889944
    p = p * q + 0.1999355085
    p = p * q - 0.3333314528
    angle = (p * q + 1.0) * t
    angle = math.pi / 2 - angle if ay > ax else angle
    angle = math.pi - angle if x < 0.0 else angle
    return -angle if y < 0.0 else angle


@njit(cache=True, error_model="numpy")
def _places(xs: Array, ys: Array, zs: Array, rows: float, columns: float) -> None:
    """Turn twists of K into places in the table, forwards, and v_s²."""
    for k in range(xs.size):
        x, y, z = xs[k], ys[k], zs[k]
        size, turn = math.sqrt(x * x + y * y), abs(z)
        fast = size if size > turn else turn
        slow = turn if size > turn else size
        ratio = slow / (fast if fast > 0.0 else 1.0)
        kappa_n = ratio if size > turn else 2.0 - ratio
        kappa_n = -kappa_n if z < 0.0 else kappa_n
        xs[k] = (kappa_n + 2.0) * (rows / 4)
        ys[k] = (arc_tangent(y, x) + math.pi) * (columns / (2 * math.pi))
        zs[k] = fast * fast + 0.0 * (x + y + z)  # NaN is handed on


@njit(cache=True, error_model="numpy")
def narrow(
    twists: Array, open_: Array, count: int, codes: Array, point: tuple[float, ...],
    tables: tuple[Array, ...], room: tuple[Array, ...],
) -> int:  # fmt: skip
    """Decide most of the open twists; return how many stay open.

    Not for vehicles bound to a line, nor those that cannot turn.

    Parameters
    ----------
    twists : (3 n,) float32 or float64
    open_ : (m,) int
        Which of them; of the first `count` those that stay open are moved up front.
    count : int
    codes : (n,) uint8
        Gets 0 or 1.
    point : x and y of K in m, κ_g in 1/m
    tables
        Of a `Sheet`.
    room : three (m,) float
    """
    load, state, parts = tables
    rx, ry, kappa_g = point
    rows, columns = state.shape
    xs, ys, zs = room[0][:count], room[1][:count], room[2][:count]
    for k in range(count):
        i = open_[k]
        omega = float(twists[3 * i + 2])
        xs[k] = float(twists[3 * i]) - omega * ry
        ys[k] = float(twists[3 * i + 1]) + omega * rx
        zs[k] = omega / kappa_g
    _places(xs, ys, zs, float(rows), float(columns))
    off = ANGLE_ERROR * columns / (2 * math.pi) + PLACE_ERROR * (rows + columns)
    left = 0
    for k in range(count):
        square = zs[k]
        is_open = not TINY < square < HUGE  # so is NaN
        is_permitted = False
        for backwards in (0, 1):
            if is_open or is_permitted:
                break
            at, across = xs[k], ys[k]
            if backwards:
                at = rows - at
                across += columns / 2 if across < columns / 2 else -columns / 2
            row = min(max(int(at), 0), rows - 1)
            column = min(max(int(across), 0), columns - 1)
            fk, fb = at - row, across - column
            i, j = int(4 * fk), int(4 * fb)
            aside_k, aside_b = 4 * fk - i, 4 * fb - j
            near = min(min(aside_k, 1 - aside_k), min(aside_b, 1 - aside_b))
            if near <= 4 * off:
                is_open = True
                break
            kind = state[row, column]
            if kind == BLOCKED:
                continue
            if kind != FREE and (parts[row, column] >> (4 * i + j)) & 1 == 0:
                is_open = True
                break
            back = backwards if load.shape[0] > 1 else 0
            a, b = float(load[back, row, column]), float(load[back, row, column + 1])
            c = float(load[back, row + 1, column])
            d = float(load[back, row + 1, column + 1])
            below, above = a + fb * (b - a), c + fb * (d - c)
            most = below + fk * (above - below)
            spread = abs(b - a) + abs(d - c) + abs(c - a) + abs(d - b)
            error = off * spread + GUARD * most
            if square * (most + error) <= 1.0:
                is_permitted = True
            elif not square * (most - error) > 1.0:
                is_open = True
        codes[open_[k]] = 1 if is_permitted else 0
        if is_open and not is_permitted:
            open_[left] = open_[k]
            left += 1
    return left
