"""Looking up whether pieces of constant κ_n are permitted, in numba.

All kernels read one flat table of float64 (`omniplan.sampling.intervals` fills it): the
quickest call from Python is one with a single array.

For maintainers: numba caches by the caller's file; after a change of `exact_row` delete
``omniplan/sampling/__pycache__/*.nb?``.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

from numba import njit

from configspace.exact import LINE_TOLERANCE
from omniplan.sampling.exact_row import is_turn_permitted

__all__ = [
    "FIRST_SECTOR",
    "FREE_INDEX",
    "HEADER",
    "KAPPA_G",
    "KNOWN",
    "LINE",
    "LINE_BETA",
    "PLANE",
    "ROWS",
    "SECTORS",
    "SHAPE",
    "SHUT_INDEX",
    "TRANSLATING",
    "are_pieces_permitted",
    "is_move_permitted",
    "is_piece_permitted",
]

Array = Any  # numba infers the types; mypy cannot look into the kernels

# The first six numbers are the two poses that `is_move_permitted` judges.
KAPPA_G, SHAPE, LINE_BETA, ROWS, FREE_INDEX, SHUT_INDEX = 6, 7, 8, 9, 10, 11
FIRST_SECTOR, SECTORS, KNOWN, HEADER = 12, 13, 14, 15
"""Places in the table; the indices point at ``ROWS + 1`` places of intervals."""

PLANE, LINE, TRANSLATING = 0, 1, 2
"""Shapes of a space: all β and κ_n, one β, or κ_n = 0 only."""

_TWO_PI = 2 * math.pi
_NO_WAY = 1e-12
"""Below this length, m, or turn, rad, a move is none: rounding."""


@njit(cache=True)
def is_piece_permitted(table: Array, kappa_n: float, beta: float, turn: float) -> bool:
    """Return whether κ_n is permitted at all β from `beta` to ``beta + turn``.

    Parameters
    ----------
    table : (n,) float
    kappa_n : float, 1, [-2, 2]
    beta : float, rad
    turn : float, rad
        Of either sign and any size.
    """
    if turn < 0:
        beta, turn = beta + turn, -turn
    c = min(1.0, 2.0 - abs(kappa_n))
    if c <= 0:  # a pole: all β are one configuration
        beta, turn = table[LINE_BETA], 0.0
    if table[SHAPE] == LINE:
        apart = _wrapped(beta + 0.5 * turn - table[LINE_BETA])
        if abs(apart) + 0.5 * turn > LINE_TOLERANCE:
            return False
        beta, turn = table[LINE_BETA], 0.0
    row = 0
    if table[SHAPE] == TRANSLATING:
        if abs(kappa_n) > LINE_TOLERANCE:
            return False
    else:
        rows = table[ROWS]
        row = int(min(max((kappa_n + 2.0) * (rows / 4.0), 0.0), rows - 1.0))
    place = _wrapped(beta)
    free, shut = int(table[FREE_INDEX]) + row, int(table[SHUT_INDEX]) + row
    if c > 0:
        if _is_inside(table, free, place, turn):
            return True
        if _is_meeting(table, shut, place, turn):
            return False
    else:  # each cell around the pole holds it
        if table[free + 1] > table[free]:
            return True
        if _is_closed(table, shut):
            return False
    if table[KNOWN] == 0:
        return False
    first, count = int(table[FIRST_SECTOR]), int(table[SECTORS])
    s = min(1.0, max(-1.0, kappa_n))
    return bool(is_turn_permitted(table, first, count, c, s, beta, turn))


@njit(cache=True, inline="always")
def _wrapped(angle: float) -> float:
    """Return the angle in [-π, π)."""
    return angle - _TWO_PI * math.floor(angle * (1 / _TWO_PI) + 0.5)


@njit(cache=True, inline="always")
def _last_from(table: Array, low: int, high: int, place: float) -> int:
    """Return which interval is the last that starts at `place` or before; low - 2."""
    count = (high - low) // 2
    left, right = 0, count
    while left < right:
        middle = (left + right) // 2
        if table[low + 2 * middle] <= place:
            left = middle + 1
        else:
            right = middle
    return low + 2 * (left - 1)


@njit(cache=True)
def _is_inside(table: Array, row: int, place: float, turn: float) -> bool:
    """Return whether one interval of a row holds the turn."""
    low, high = int(table[row]), int(table[row + 1])
    if low == high:
        return False
    at = _last_from(table, low, high, place)
    if at >= low and place + turn <= table[at + 1]:
        return True
    return bool(place + _TWO_PI + turn <= table[high - 1])  # across the seam


@njit(cache=True)
def _is_meeting(table: Array, row: int, place: float, turn: float) -> bool:
    """Return whether the turn meets an interval of a row."""
    low, high = int(table[row]), int(table[row + 1])
    if low == high:
        return False
    at = _last_from(table, low, high, place)
    if at >= low and place <= table[at + 1]:
        return True
    if at + 2 < high and table[at + 2] <= place + turn:
        return True
    if table[low] + _TWO_PI <= place + turn:
        return True
    return bool(place + _TWO_PI <= table[high - 1])


@njit(cache=True)
def _is_closed(table: Array, row: int) -> bool:
    """Return whether one interval of a row is the whole circle."""
    low, high = int(table[row]), int(table[row + 1])
    return bool(high > low and table[low + 1] - table[low] > _TWO_PI)


@njit(cache=True)
def is_move_permitted(table: Array) -> bool:
    """Return whether the move between the table's first two poses is permitted.

    Position and heading are linear, the heading the shorter way round, as the spaces
    SO(2) and SE(2) of OMPL interpolate it. Either representation will do.
    """
    dx, dy = table[3] - table[0], table[4] - table[1]
    turn = table[5] - table[2]
    if turn > math.pi:
        turn -= _TWO_PI
    elif turn < -math.pi:
        turn += _TWO_PI
    length, rotation = math.sqrt(dx * dx + dy * dy), abs(turn) / table[KAPPA_G]
    if length <= _NO_WAY:
        if abs(turn) <= _NO_WAY:
            return True
        length = 0.0
    kappa_n = 2.0 - length / rotation if rotation >= length else rotation / length
    if turn < 0:
        kappa_n = -kappa_n
    beta = math.atan2(dy, dx) - table[2]
    if is_piece_permitted(table, kappa_n, beta, -turn):
        return True
    return bool(is_piece_permitted(table, -kappa_n, beta + math.pi, -turn))


@njit(cache=True)
def are_pieces_permitted(
    table: Array, kappa_n: Array, beta: Array, turn: Array, out: Array
) -> None:
    """Write whether each of many pieces is permitted; see `is_piece_permitted`."""
    for i in range(out.size):
        out[i] = is_piece_permitted(table, kappa_n[i], beta[i], turn[i])
