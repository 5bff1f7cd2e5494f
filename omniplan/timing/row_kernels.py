"""The rows of a timing at places of a path: what of every limit is used, in numba.

Along the splines of a path, u being its parameter, every limit of the vehicle is a
strip of ``a ü + b u̇²``; `omniplan.timing.rows` tells which there are, this module
computes a and b from the derivatives of the path by u.

The plain NumPy twin is in the tests.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from omniplan.timing.rows import RowKind

__all__ = ["evaluate_rows", "rows_along"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

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
