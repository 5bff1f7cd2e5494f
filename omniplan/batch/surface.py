"""The lookup surface of a space: what is permitted, over the directions of a twist.

Every load grows with the square of the twist. So per direction there is one threshold:
slower is permitted, faster is not. Directions are taken on the cube
``max(|vx|, |vy|, |ω| / κ_g) = 1``: a face and two ratios by one division, no root, no
arc tangent. For every cell of a face two thresholds on ``m = max(...)`` are kept in 16
bits each: up to ``low`` all of the cell is permitted, above ``high`` none of it, in one
representation or the other. What lies between is settled exactly (`batch_settle`).

A vehicle bound to a line, or one that cannot turn, has two degrees of freedom: there
the square takes the place of the cube.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from configspace import PermissibleSpace
from configspace.kernels import BLOCKED, FREE

__all__ = ["Surface", "surface_of"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

SIDE = 180
"""Cells along a side of a face: the three of a cube fit into 400 kB."""
LINE_SIDE = 8192
"""Cells along a side of the square."""
LAST = 65534
"""The largest threshold in 16 bits; one more means: never refused unseen."""
FLOAT32 = 4e-6
"""What covers float32 arithmetic, relative to m; times ``1 + κ_g |K|``."""
ROUNDING = 1e-9
"""What covers float64 arithmetic of a box of cells."""


@dataclass(frozen=True, eq=False)
class Surface:
    """Thresholds over directions; read-only."""

    table: npt.NDArray[np.uint32]
    """Flat: ``low + 2**16 high`` per cell; face, or face and sign, comes first."""
    scale: float
    """Thresholds per m, s/m."""
    side: int
    """Cells along a side."""
    signed: int
    """Faces to skip where the leading component is negative; 0 if that is alike."""


def surface_of(space: PermissibleSpace) -> Surface:
    """Return the lookup surface of a space.

    Parameters
    ----------
    space : PermissibleSpace
    """
    t = space.tables
    tables = (t.load, t.v_hi, t.state, t.parts)
    knows = space.vehicle is not None
    reach = 1 + space.kappa_g * float(np.hypot(*space.header.reference))
    guard = min(FLOAT32 * reach, 0.5)
    if space.is_translating or space.line_beta is not None:
        thresholds = _over_square(tables, knows, space.is_translating, guard, LINE_SIDE)
        side, signed = LINE_SIDE, 2
    else:
        # Both signs of a twist are alike unless driving backwards has its own limits.
        signs, side = (1, SIDE) if len(t.load) == 1 else (2, SIDE * 7 // 10 // 2 * 2)
        signed = 3 if signs == 2 else 0
        thresholds = _over_cube(tables, knows, guard, side, signs)
    low, high = thresholds[0] * (1 - 4 * guard), thresholds[1] * (1 + 4 * guard)
    finite = high[np.isfinite(high)]
    scale = LAST / max(float(finite.max(initial=0.0)), 1e-6)
    floor = np.floor(np.minimum(low * scale, LAST)).astype(np.uint32)
    ceiling = np.ceil(np.minimum(high * scale, LAST + 1)).astype(np.uint32)
    table = floor | (ceiling << np.uint32(16))
    table.flags.writeable = False
    return Surface(table, scale, side, signed)


@njit(cache=True)
def _curvature(p: float, q: float) -> float:
    """κ_n of a translation speed p ≥ 0 and a rotation speed q, in units of v_s."""
    size = abs(q)
    if size < p:
        return q / p
    if size == 0:
        return 0.0
    return math.copysign(2 - p / size, q)


@njit(cache=True)
def _box(
    tables: tuple[Array, ...],
    knows: bool,
    back: int,
    k0: float,
    k1: float,
    m0: float,
    m1: float,
) -> tuple[float, float]:
    """Least and largest v_max over a box given in cells, the columns not wrapped.

    0 is the least where some of it is not free.
    """
    load, v_hi, state, parts = tables
    rows, columns = state.shape
    back = min(back, load.shape[0] - 1)
    worst, best = 0.0, 0.0
    free = True
    for k in range(max(math.floor(k0), 0), min(math.floor(k1), rows - 1) + 1):
        f0, f1 = max(k0 - k, 0.0), min(k1 - k, 1.0)
        for wide in range(math.floor(m0), math.floor(m1) + 1):
            m = wide % columns
            g0, g1 = max(m0 - wide, 0.0), min(m1 - wide, 1.0)
            if state[k, m] == BLOCKED:
                free = False
                continue
            least, most = np.inf, 0.0
            for f in (f0, f1):
                for g in (g0, g1):
                    below = (1 - g) * load[back, k, m] + g * load[back, k, m + 1]
                    above = (1 - g) * load[back, k + 1, m]
                    above += g * load[back, k + 1, m + 1]
                    at = (1 - f) * below + f * above
                    least, most = min(least, at), max(most, at)
            if state[k, m] == FREE:
                worst = max(worst, most)
                best = max(best, 1 / math.sqrt(least) if least > 0 else np.inf)
                continue
            some = knows
            for i in range(int(4 * f0), min(int(4 * f1), 3) + 1):
                for j in range(int(4 * g0), min(int(4 * g1), 3) + 1):
                    if (parts[k, m] >> (4 * i + j)) & 1 == 1:
                        some = True
                    else:
                        free = False
            worst = max(worst, most)
            if some:  # interpolated loads are those of free parts only
                best = max(best, v_hi[back, k, m])
    least_speed = 0.0
    if free:
        least_speed = 1 / math.sqrt(worst) if worst > 0 else np.inf
    return least_speed * (1 - ROUNDING), best * (1 + ROUNDING)


@njit(cache=True)
def _cone(x0: float, x1: float, y0: float, y1: float) -> tuple[float, float]:
    """Least and largest direction over a rectangle, rad; all if it holds the origin."""
    if x0 <= 0 <= x1 and y0 <= 0 <= y1:
        return -np.pi, np.pi
    cx, cy = (x0 + x1) / 2, (y0 + y1) / 2
    least, most = 0.0, 0.0
    for x in (x0, x1):
        for y in (y0, y1):
            turn = math.atan2(cx * y - cy * x, cx * x + cy * y)
            least, most = min(least, turn), max(most, turn)
    middle = math.atan2(cy, cx)
    return middle + least, middle + most


@njit(cache=True)
def _both_ways(
    tables: tuple[Array, ...], knows: bool, low: Array, high: Array
) -> tuple[float, float]:
    """Thresholds on m over a box of (x, y, z) with max(|x|, |y|, |z|) = 1."""
    rows, columns = tables[2].shape
    near = math.hypot(
        max(low[0], -high[0], 0.0), max(low[1], -high[1], 0.0)
    )  # of the rectangle from the origin
    far = math.hypot(max(-low[0], high[0]), max(-low[1], high[1]))
    z0, z1 = low[2], high[2]
    kappa0 = _curvature(far if z0 >= 0 else near, z0) - ROUNDING
    kappa1 = _curvature(near if z1 >= 0 else far, z1) + ROUNDING
    beta0, beta1 = _cone(low[0], high[0], low[1], high[1])
    slowest = max(near, max(z0, -z1, 0.0))
    fastest = max(far, max(-z0, z1))
    per_kappa, per_beta = rows / 4, columns / (2 * np.pi)
    surely, perhaps = 0.0, 0.0
    for back in (0, 1):
        k0, k1 = (kappa0, kappa1) if back == 0 else (-kappa1, -kappa0)
        if rows == 1:  # one that cannot turn
            a, b = 0.0, 0.0
        else:
            a, b = (max(k0, -2.0) + 2) * per_kappa, (min(k1, 2.0) + 2) * per_kappa
        turn = np.pi + back * np.pi
        m0 = (beta0 + turn) * per_beta - ROUNDING * columns
        m1 = (beta1 + turn) * per_beta + ROUNDING * columns
        least, most = _box(tables, knows, back, a, b, m0, m1)
        surely, perhaps = max(surely, least), max(perhaps, most)
    return surely / fastest, perhaps / slowest


@njit(cache=True, nogil=True)
def _over_cube(
    tables: tuple[Array, ...], knows: bool, guard: float, side: int, signs: int
) -> tuple[Array, Array]:
    """Thresholds of every cell of the faces x, y, z, then of -x, -y, -z."""
    surely = np.empty(signs * 3 * side * side)
    perhaps = np.empty(signs * 3 * side * side)
    for line in range(signs * 3 * side):
        face = line // side % 3
        lead = 1.0 if line // side < 3 else -1.0
        i = line % side
        low, high = np.empty(3), np.empty(3)
        u0, u1 = 2 * i / side - 1 - guard, 2 * (i + 1) / side - 1 + guard
        for j in range(side):
            v0, v1 = 2 * j / side - 1 - guard, 2 * (j + 1) / side - 1 + guard
            first = 1 if face == 0 else 0
            second = 1 if face == 2 else 2
            low[face], high[face] = lead, lead
            # The ratios are to the leading component, sign included.
            low[first], high[first] = (
                min(lead * u0, lead * u1),
                max(lead * u0, lead * u1),
            )
            low[second] = min(lead * v0, lead * v1)
            high[second] = max(lead * v0, lead * v1)
            at = line * side + j
            surely[at], perhaps[at] = _both_ways(tables, knows, low, high)
    return surely, perhaps


@njit(cache=True)
def _on_line(
    tables: tuple[Array, ...], knows: bool, low: Array, high: Array
) -> tuple[float, float]:
    """Thresholds over a box of (x, z), x along the line of a line-mobile vehicle."""
    per_kappa = tables[2].shape[0] / 4
    surely, perhaps = np.inf, 0.0
    for back in (0, 1):
        x0, x1 = (low[0], high[0]) if back == 0 else (-high[0], -low[0])
        if x1 < 0:  # β would be off the line
            continue
        near, far = max(x0, 0.0), x1
        z0, z1 = (low[1], high[1]) if back == 0 else (-high[1], -low[1])
        k0 = _curvature(far if z0 >= 0 else near, z0) - ROUNDING
        k1 = _curvature(near if z1 >= 0 else far, z1) + ROUNDING
        a, b = (max(k0, -2.0) + 2) * per_kappa, (min(k1, 2.0) + 2) * per_kappa
        least, most = _box(tables, knows, back, a, b, 0.0, 0.0)
        slowest = max(near, max(z0, -z1, 0.0))
        fastest = max(far, max(-z0, z1))
        # Where both signs of v_s are in the box each holds for some of it only.
        surely, perhaps = min(surely, least / fastest), max(perhaps, most / slowest)
    return surely, perhaps


@njit(cache=True, nogil=True)
def _over_square(
    tables: tuple[Array, ...], knows: bool, translating: bool, guard: float, side: int
) -> tuple[Array, Array]:
    """Thresholds of every cell of the sides x, y (or z), then of -x, -y (or -z)."""
    surely, perhaps = np.empty(4 * side), np.empty(4 * side)
    for at in range(4 * side):
        face = at // side % 2
        lead = 1.0 if at // side < 2 else -1.0
        i = at % side
        ends = (
            lead * (2 * i / side - 1 - guard),
            lead * (2 * (i + 1) / side - 1 + guard),
        )
        low, high = np.zeros(3), np.zeros(3)
        low[face], high[face] = lead, lead
        low[1 - face], high[1 - face] = min(ends), max(ends)
        if translating:
            surely[at], perhaps[at] = _both_ways(tables, knows, low, high)
        else:
            surely[at], perhaps[at] = _on_line(tables, knows, low, high)
    return surely, perhaps
