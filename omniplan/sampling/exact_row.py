"""Whether a turn of β at one very κ_n is permitted, in closed form.

At constant κ_n, ``z = c e^{jβ} + s b`` of a steered wheel runs around a circle. It
meets the border of its steering range where ``Im(z e^{-jα}) = 0`` on the side of the
border, and the border of its singular zone where ``turning_excess`` vanishes, which is
``A cos ψ + B sin ψ = C`` for each of four pairs of signs. A turn that starts inside and
meets no border stays inside.

The kernels read one flat table, as a call with one array is the quickest from Python:
see `omniplan.sampling.intervals` for what stands in it.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

from numba import njit

from configspace.omni_curve import POLE

__all__ = ["SECTOR_SIZE", "is_point_permitted", "is_turn_permitted"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

SECTOR_SIZE = 7
"""Numbers per `SectorRow`: Re b, Im b, middle, half, κ share, β share, pole arm."""

_NEAR = 1e-7
"""A turn that comes as near to a border, rad, is refused: it is not decided."""
_TWO_PI = 2 * math.pi
_STILL = 1e-12
"""|z| up to which a wheel counts as standing, as in `configspace.exact`."""


@njit(cache=True)
def is_point_permitted(
    table: Array, first: int, count: int, c: float, s: float, beta: float, room: float
) -> bool:
    """Return whether all wheels permit one configuration, with `room` to spare.

    Parameters
    ----------
    table : (n,) float
    first, count : int
        Where the sectors begin and how many there are.
    c, s : float, 1
    beta : float, rad
    room : float, rad
        Distance to keep from the stops; the singular zone grows as much, relatively.
    """
    ex, ey = math.cos(beta), math.sin(beta)
    for i in range(count):
        at = first + SECTOR_SIZE * i
        bx, by = table[at], table[at + 1]
        x, y = c * ex + s * bx, c * ey + s * by
        square = x * x + y * y
        if square < _STILL * _STILL:
            return False
        half = table[at + 3]
        if half < math.inf:
            turned = math.atan2(y, x) - table[at + 2]
            turned = (turned + math.pi) % _TWO_PI - math.pi
            if abs(turned) > half - room + 1e-14:
                return False
        asked = _asked(table, at, c, s, ex, ey)
        if asked > square * (1 - room + 1e-14):
            return False
    return True


@njit(cache=True, inline="always")
def _asked(table: Array, at: int, c: float, s: float, ex: float, ey: float) -> float:
    """Return what the guaranteed rates need of |z|²; see `exact.turning_excess`."""
    kappa_share, beta_share = table[at + 4], table[at + 5]
    if kappa_share == 0 and beta_share == 0:
        return 0.0
    bx, by = table[at], table[at + 1]
    across = table[at + 6]
    if c > POLE:
        across = abs(ey * bx - ex * by)
    along = ex * bx + ey * by
    asked: float = kappa_share * across + beta_share * abs(c * (c + s * along))
    return asked


@njit(cache=True)
def is_turn_permitted(
    table: Array, first: int, count: int, c: float, s: float, beta: float, turn: float
) -> bool:
    """Return whether all wheels permit all β from `beta` to ``beta + turn``.

    What comes within `_NEAR` of a border is refused, so "yes" holds in spite of
    rounding; a turn of no size is decided exactly.

    Parameters
    ----------
    table : (n,) float
    first, count : int
    c, s : float, 1
    beta : float, rad
    turn : float, rad, ≥ 0
    """
    if turn == 0 or c <= POLE:
        return bool(is_point_permitted(table, first, count, c, s, beta, 0.0))
    if not is_point_permitted(table, first, count, c, s, beta, _NEAR):
        return False
    for i in range(count):
        at = first + SECTOR_SIZE * i
        if _meets_still_point(table, at, c, s, beta, turn):
            return False
        if table[at + 3] < math.inf:
            if _meets_stop(table, at, c, s, beta, turn, -1.0):
                return False
            if _meets_stop(table, at, c, s, beta, turn, 1.0):
                return False
        has_zone = table[at + 4] > 0 or table[at + 5] > 0
        if has_zone and _meets_zone(table, at, c, s, beta, turn):
            return False
    return True


@njit(cache=True, inline="always")
def _is_passed(root: float, beta: float, turn: float) -> bool:
    """Return whether the turn comes to `root`, or next to it."""
    return (root - beta + _NEAR) % _TWO_PI <= turn + 2 * _NEAR


@njit(cache=True)
def _meets_still_point(
    table: Array, at: int, c: float, s: float, beta: float, turn: float
) -> bool:
    """Return whether the wheel comes to stand: z = 0 on the way."""
    bx, by = s * table[at], s * table[at + 1]
    if abs(math.hypot(bx, by) - c) > _NEAR * c:
        return False
    return bool(_is_passed(math.atan2(-by, -bx), beta, turn))


@njit(cache=True)
def _meets_stop(
    table: Array, at: int, c: float, s: float, beta: float, turn: float, side: float
) -> bool:
    """Return whether the wheel comes to one end of its range.

    ``c sin(β - α) + s Im(b e^{-jα}) = 0`` and ``Re(z e^{-jα}) ≥ 0``.
    """
    alpha = table[at + 2] + side * table[at + 3]
    ax, ay = math.cos(alpha), math.sin(alpha)
    bx, by = s * table[at], s * table[at + 1]
    sine = -(by * ax - bx * ay) / c
    if abs(sine) > 1 + 1e-9:
        return False
    bend = math.asin(max(-1.0, min(1.0, sine)))
    ahead = bx * ax + by * ay
    reach = c * math.cos(bend)
    if ahead + reach >= -_NEAR and _is_passed(alpha + bend, beta, turn):
        return True
    behind = alpha + math.pi - bend
    return bool(ahead - reach >= -_NEAR and _is_passed(behind, beta, turn))


@njit(cache=True)
def _meets_zone(
    table: Array, at: int, c: float, s: float, beta: float, turn: float
) -> bool:
    """Return whether the wheel comes to the border of its singular zone.

    With ψ = β - arg b: ``k |b| |sin ψ| + q c |c + s |b| cos ψ|`` equals
    ``c² + s² |b|² + 2 c s |b| cos ψ`` there (k, q: the shares of κ_n and β).
    """
    size = math.hypot(table[at], table[at + 1])
    base = math.atan2(table[at + 1], table[at])
    k, q = table[at + 4] * size, table[at + 5] * c
    lever = s * size
    square = c * c + lever * lever
    for over in (-1.0, 1.0):
        along, rest = q * over * lever - 2 * c * lever, square - q * over * c
        for side in (-1.0, 1.0):
            across = k * side
            largest = math.hypot(along, across)
            if abs(rest) > largest * (1 + 1e-9) or largest == 0:
                continue
            middle = math.atan2(across, along)
            swing = math.acos(max(-1.0, min(1.0, rest / largest)))
            for psi in (middle - swing, middle + swing):
                if side * math.sin(psi) < -_NEAR:
                    continue
                if over * (c + lever * math.cos(psi)) < -_NEAR:
                    continue
                if _is_passed(base + psi, beta, turn):
                    return True
    return False
