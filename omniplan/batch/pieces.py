"""What lies between standstills, and which representation is driven there, in numba.

As in `standstill`, but without any change of the wheels at rest.
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
    BX,
    BY,
    NA,
    NB,
    SLOW,
    STANDS,
    V0,
    V1,
    body,
    chord,
)
from omniplan.batch.motions import LANES
from omniplan.batch.refine import load
from omniplan.batch.rows import ANGLE, AT, KIND, RANGE, SINGULAR

__all__ = ["MAX_PIECES", "angle_of", "choose", "pieces_of"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

MAX_PIECES = 24
"""Motions with more pieces between standstills are left to `validate`."""


@njit(cache=True)
def pieces_of(
    blocks: Array, count: int, vehicle: Array, tolerances: Array, s: Array, ends: Array
) -> int:
    """Write first and last part of every piece; -1 if they are not clear.

    Not clear is a motion that may stand for a moment without coming to rest, which
    depends on where parts are cut.
    """
    pieces = 0
    stood, leaving, arriving = True, True, False
    for b in range(blocks.shape[0]):
        load(blocks, b, s)
        body(s, vehicle[0], vehicle[1], vehicle[2], tolerances[0])
        for k in range(min(LANES, count - b * LANES)):
            if s[STANDS + k] > 0:
                stood, leaving, arriving = True, True, False
                continue
            v0 = max(s[NA + k], abs(s[V0 + 2 * LANES + k]) / vehicle[2])
            v1 = max(s[NB + k], abs(s[V1 + 2 * LANES + k]) / vehicle[2])
            is_slow = s[SLOW + k] <= tolerances[0]
            # Slow it may be as long as it leaves a standstill or comes to one.
            leaving = leaving and is_slow and v1 >= v0
            if arriving and not (is_slow and v1 <= v0):
                return -1
            arriving = arriving or (is_slow and not leaving and not stood)
            if arriving and v1 > v0:
                return -1
            if stood:
                if pieces == MAX_PIECES:
                    return -1
                ends[pieces, 0] = b * LANES + k
                pieces += 1
            ends[pieces - 1, 1] = b * LANES + k + 1
            stood = False
    return pieces


@njit(cache=True)
def angle_of(s: Array, lane: int, at_end: bool, sign: float, middle: float) -> float:
    """Direction of a wheel at an end of a part, aside of the middle of its range."""
    x, y = (s[BX + lane], s[BY + lane]) if at_end else (s[AX + lane], s[AY + lane])
    angle = math.atan2(sign * y, sign * x) - middle
    return math.atan2(math.sin(angle), math.cos(angle))


@njit(cache=True)
def _continues(
    blocks: Array, rows: Array, s: Array, last: int, first: int, before: float,
    after: float, alignment: float,
) -> int:  # fmt: skip
    """Whether all wheels stand alike before and after a standstill; -1 if nearly so."""
    worst = 0.0
    for r in range(rows.shape[0]):
        if rows[r, KIND] != SINGULAR:
            continue
        x, y = rows[r, AT], rows[r, AT + 1]
        # The row of the range follows that of the singular point.
        ranged = r + 1 < rows.shape[0] and rows[r + 1, KIND] == RANGE
        middle = rows[r + 1, ANGLE] if ranged else 0.0
        load(blocks, last // LANES, s)
        chord(s, x, y)
        a = angle_of(s, last % LANES, True, before, middle)
        load(blocks, first // LANES, s)
        chord(s, x, y)
        b = angle_of(s, first % LANES, False, after, middle)
        turn = b - a
        if not ranged:
            turn = math.atan2(math.sin(turn), math.cos(turn))
        worst = max(worst, abs(turn))
    if worst <= 0.9 * alignment:
        return 1
    return 0 if worst > 1.1 * alignment else -1


@njit(cache=True)
def choose(
    blocks: Array, rows: Array, s: Array, ends: Array, pieces: int, by_piece: Array,
    alignment: float, signs: Array,
) -> bool:  # fmt: skip
    """Choose the representation of every piece as `choose_configurations` does.

    Among those with the least broken limits, without a change of the wheels at any
    standstill; False if there is no such way.
    """
    # Cost (changes of sign) and path (a bit per piece, 1 backwards) per last sign.
    cost, path = np.full(2, np.inf), np.zeros(2, np.int64)
    for p in range(pieces):
        least = min(by_piece[p, 0, 0], by_piece[p, 1, 0])
        new_cost, new_path = np.full(2, np.inf), np.zeros(2, np.int64)
        for after in range(2):
            if by_piece[p, after, 0] > least:
                continue
            if p == 0:
                new_cost[after], new_path[after] = 0.0, after
                continue
            for before in range(2):
                if cost[before] == np.inf:
                    continue
                goes_on = _continues(
                    blocks, rows, s, ends[p - 1, 1] - 1, ends[p, 0],
                    1.0 - 2.0 * before, 1.0 - 2.0 * after, alignment,
                )  # fmt: skip
                if goes_on < 0:
                    return False
                if goes_on == 0:
                    continue
                price = cost[before] + (1.0 if before != after else 0.0)
                way = 2 * path[before] + after
                better = price < new_cost[after]
                if better or (price == new_cost[after] and way < new_path[after]):
                    new_cost[after], new_path[after] = price, way
        cost, path = new_cost, new_path
    if cost[0] == np.inf and cost[1] == np.inf:
        return False
    last = 0
    if cost[1] < cost[0] or (cost[1] == cost[0] and path[1] < path[0]):
        last = 1
    for p in range(pieces):
        signs[p] = (path[last] >> (pieces - 1 - p)) & 1
    return True
