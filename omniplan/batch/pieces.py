"""What lies between standstills, and which representation is driven there, in numba.

As in `standstill`; see `rests` for changes of the wheels at rest.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

import numpy as np

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
from omniplan.batch.kernel import kernel
from omniplan.batch.kinds import ANGLE, AT, KIND, RANGE, SINGULAR
from omniplan.batch.motions import LANES, enclose
from omniplan.batch.refine import load
from omniplan.batch.rests import CHANGES, CLEAR, OPEN, change_at
from omniplan.standing.winding_search import SHORT_REST

__all__ = ["MAX_PIECES", "angle_of", "choose", "pieces_of"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

ROUNDS = 6
"""So often what may stand is cut in sixteen parts."""
MAX_PIECES = 24
"""Motions with more pieces between standstills are left to `validate`."""


@kernel()
def _moves(
    knot: Array, form: int, t0: float, t1: float, vehicle: Array, tolerances: Array,
    s: Array,
) -> bool:  # fmt: skip
    """Return whether the vehicle surely moves all over a part.

    What may stand is cut again, as one stretch.
    """
    view = s.reshape(-1, LANES)
    for _ in range(ROUNDS):
        for k in range(LANES):
            enclose(
                knot, form, t0 + (t1 - t0) * k / LANES,
                t0 + (t1 - t0) * (k + 1) / LANES, view, k,
            )  # fmt: skip
        body(s, vehicle[0], vehicle[1], vehicle[2], tolerances[0])
        first, last = LANES, -1
        for k in range(LANES):
            if s[SLOW + k] <= tolerances[0]:
                first, last = min(first, k), k
        if last < 0:
            return True
        t0, t1 = view[15, first], view[16, last]
    return False


@kernel()
def pieces_of(
    blocks: Array, knot_of: Array, knots: Array, form: int, count: int, vehicle: Array,
    tolerances: Array, s: Array, ends: Array,
) -> int:  # fmt: skip
    """Write first and last part of every piece; -1 if they are not clear.

    Not clear is a motion that may stand for a moment without coming to rest, which
    depends on where parts are cut.
    """
    pieces = 0
    stood, leaving, arriving = True, True, False
    for b in range(blocks.shape[0]):
        load(blocks, b, s, False)
        body(s, vehicle[0], vehicle[1], vehicle[2], tolerances[0])
        for k in range(min(LANES, count - b * LANES)):
            if s[STANDS + k] > 0:
                stood, leaving, arriving = True, True, False
                continue
            v0 = max(s[NA + k], abs(s[V0 + 2 * LANES + k]) / vehicle[2])
            v1 = max(s[NB + k], abs(s[V1 + 2 * LANES + k]) / vehicle[2])
            is_slow = s[SLOW + k] <= tolerances[0]
            if is_slow and v0 > tolerances[0] and v1 > tolerances[0]:
                t0, t1 = s[15 * LANES + k], s[16 * LANES + k]
                is_slow = not _moves(
                    knots[knot_of[b, k]], form, t0, t1, vehicle, tolerances, s
                )
                load(blocks, b, s, False)
                body(s, vehicle[0], vehicle[1], vehicle[2], tolerances[0])
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


@kernel()
def angle_of(s: Array, lane: int, at_end: bool, sign: float, middle: float) -> float:
    """Direction of a wheel at an end of a part, aside of the middle of its range."""
    x, y = (s[BX + lane], s[BY + lane]) if at_end else (s[AX + lane], s[AY + lane])
    angle = math.atan2(sign * y, sign * x) - middle
    return math.atan2(math.sin(angle), math.cos(angle))


@kernel()
def _continues(
    blocks: Array, rows: Array, s: Array, last: int, first: int, before: float,
    after: float, alignment: float,
) -> bool:  # fmt: skip
    """Whether all wheels surely stand alike before and after a standstill."""
    worst = 0.0
    for r in range(rows.shape[0]):
        if rows[r, KIND] != SINGULAR:
            continue
        x, y = rows[r, AT], rows[r, AT + 1]
        # The row of the range follows that of the singular point.
        ranged = r + 1 < rows.shape[0] and rows[r + 1, KIND] == RANGE
        middle = rows[r + 1, ANGLE] if ranged else 0.0
        load(blocks, last // LANES, s, False)
        chord(s, x, y)
        a = angle_of(s, last % LANES, True, before, middle)
        load(blocks, first // LANES, s, False)
        chord(s, x, y)
        b = angle_of(s, first % LANES, False, after, middle)
        turn = b - a
        if not ranged:
            turn = math.atan2(math.sin(turn), math.cos(turn))
        worst = max(worst, abs(turn))
    return worst <= alignment / 2


@kernel(inline="always")
def _price(change: Array, is_turned: bool) -> float:
    """Return what a change costs beside broken limits, as in `standstill`.

    What is not known costs as little as it may.
    """
    price = 1e-9 if is_turned else 0.0
    if change[0] == CLEAR:
        price += SHORT_REST if change[1] > change[2] else 0.0
        price += min(change[1], 1e3) * 1e-6
    return price


@kernel()
def choose(
    blocks: Array, knot_of: Array, knots: Array, form: int, rows: Array,
    own_rows: Array, vehicle: Array, tolerances: Array, s: Array, ends: Array,
    pieces: int, by_piece: Array, changes: Array, signs: Array,
) -> bool:  # fmt: skip
    """Choose the representation of every piece as `choose_configurations` does.

    Among those with the least broken limits the one with the least cost of what happens
    at the standstills between: `changes` (pieces, 2, 2, CHANGES) gets that, by the
    representations before and after. False if it is not known.
    """
    whole = knot_of[0, 0], knot_of[knot_of.shape[0] - 1, LANES - 1]
    # Cost and path (a bit per piece, 1 backwards) per last sign.
    cost, path = (np.inf, np.inf), (np.int64(0), np.int64(0))
    for p in range(pieces):
        least = min(by_piece[p, 0, 0], by_piece[p, 1, 0])
        new_cost, new_path = (np.inf, np.inf), (np.int64(0), np.int64(0))
        for after in range(2):
            if by_piece[p, after, 0] > least:
                continue
            best, kept = (0.0, np.int64(after)) if p == 0 else (np.inf, np.int64(0))
            # First where the wheels stay as they are: that costs nearly nothing.
            for turn in range(4 if p > 0 else 0):
                before, stays = turn % 2, turn < 2
                if cost[before] == np.inf:
                    continue
                last, first = ends[p - 1, 1] - 1, ends[p, 0]
                change = changes[p - 1, before, after]
                own = 1.0 - 2.0 * before, 1.0 - 2.0 * after
                if stays:
                    goes_on = _continues(
                        blocks, rows, s, last, first, own[0], own[1], tolerances[3]
                    )
                    for i in range(CHANGES):
                        change[i] = 0.0
                    change[0] = CLEAR if goes_on else OPEN
                    if not goes_on:
                        continue
                elif change[0] == CLEAR:
                    continue
                else:
                    # A wheel turns by at least what counts as alike.
                    floor = 0.9e-6 * tolerances[3] * vehicle[6]
                    if cost[before] + _price(change, before != after) + floor > best:
                        continue
                    change_at(
                        knots,
                        (
                            knot_of[last // LANES, last % LANES],
                            knot_of[first // LANES, first % LANES],
                        ),
                        whole, form, own, own_rows, rows, vehicle, tolerances, s,
                        change,
                    )  # fmt: skip
                price = cost[before] + _price(change, before != after)
                way = 2 * path[before] + after
                if price < best or (price == best and way < kept):
                    best, kept = price, way
            is_first = after == 0
            new_cost = (best, new_cost[1]) if is_first else (new_cost[0], best)
            new_path = (kept, new_path[1]) if is_first else (new_path[0], kept)
        cost, path = new_cost, new_path
    if cost[0] == np.inf and cost[1] == np.inf:
        return False
    last = 0
    if cost[1] < cost[0] or (cost[1] == cost[0] and path[1] < path[0]):
        last = 1
    for p in range(pieces):
        signs[p] = (path[last] >> (pieces - 1 - p)) & 1
    for p in range(pieces - 1):
        if changes[p, signs[p], signs[p + 1], 0] != CLEAR:
            return False
    return True
