"""The most telling limit of a refused pair, in numba: `Report.headline`.

What no other speed would mend comes first, then the largest excess at the samples: over
the intervals between samples as a whole, which `validate` and the kernels have in
common, wherever else they cut a motion.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

import numpy as np

from omniplan.batch.chords import LOW
from omniplan.batch.kernel import kernel
from omniplan.batch.kinds import (
    BOUND,
    KIND,
    PARALLEL,
    RANGE,
    RANGE_ERROR,
    SIGN,
    SINGULAR,
    SLIP,
)
from omniplan.batch.motions import LANES
from omniplan.batch.refine import KEPT, NO, YES, largest, load, one_row, refine
from omniplan.batch.swings import is_wide, load_swings
from omniplan.judging.proof import MAX_HALVINGS
from omniplan.report import SHAPE_LIMITS, TIE

__all__ = ["NOWHERE", "headline", "is_driven", "told"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

CLASSES = len(SHAPE_LIMITS)
"""Number of the last class: limits that driving slower mends."""
NOWHERE, UNTOLD = -1, -2
"""Instead of a row: none is broken at a sample; `validate` has to tell."""
PROVING = np.int64(MAX_HALVINGS)
START, END = 15 * LANES, 16 * LANES
"""Where the scratch array has the times of a block."""


@kernel()
def told(rows: Array, r: int, ratio: float) -> float:
    """Value over bound as reports have it: of slip the angles, not their sines."""
    if rows[r, KIND] == SLIP or rows[r, KIND] == PARALLEL:
        return math.asin(min(ratio * rows[r, BOUND], 1.0)) / math.asin(rows[r, BOUND])
    return ratio


@kernel()
def is_driven(sign: float, pieces: int, signs: Array, steers: bool, p: int) -> bool:
    """Whether a row of one representation holds in a piece."""
    return steers and (sign > 0) == (signs[p] == 0) if p < pieces else False


@kernel()
def _keep_largest(
    s: Array, knot_of: Array, b: int, begin: float, end: float, best: float,
    place: Array,
) -> float:  # fmt: skip
    """Take what a block reaches in its intervals from `begin` to `end`; the largest."""
    for k in range(LANES):
        low, t0 = s[LOW + k], s[START + k]
        if low <= KEPT or low < best * (1 - TIE):
            continue
        middle = (t0 + s[END + k]) / 2
        if middle <= begin or middle >= end:
            continue
        if low > best * (1 + TIE) or t0 < place[1]:
            place[0], place[1], place[2] = knot_of[b, k], t0, s[END + k]
        best = max(best, low)
    return best


@kernel()
def _at_samples(
    blocks: Array, knot_of: Array, samples: tuple[Array, ...], rows: Array, r: int,
    vehicle: Array, tolerances: Array, s: Array, highs: Array, skipped: Array,
    begin: float, end: float, best: float, floor: float, place: Array,
) -> float:  # fmt: skip
    """Largest utilisation of a row at the samples; 0 if none breaks the limit.

    Only in the intervals whose middle is between two times, if it is more than `best`,
    and where it may be more than `floor`. `place` gets knot, start and end of the first
    of the intervals.
    """
    plain, wholes, whole_knot = samples
    count, wide = blocks.shape[0], is_wide(rows[r, KIND])
    error = RANGE_ERROR / rows[r, BOUND] if rows[r, KIND] == RANGE else 0.0
    floor, others = max(KEPT, floor), 0.0
    for b in range(count):
        bound = skipped[r * count + b]
        most = bound if bound >= 0.0 else largest(highs, (r * count + b) * LANES)
        if not plain[b]:
            others = max(others, most)
            continue
        if most + error <= max(floor, best * (1 - TIE)):
            continue
        load(blocks, b, s)
        if wide:
            load_swings(blocks, b, s)
        one_row(s, rows, r, vehicle, tolerances, YES)
        best = _keep_largest(s, knot_of, b, begin, end, best, place)
    # What the intervals of other blocks reach, their parts do not exceed.
    is_less = others + error <= max(floor, best * (1 - TIE))
    for b in range(0 if is_less else wholes.shape[0]):
        load(wholes, b, s)
        if wide:
            load_swings(wholes, b, s)
        one_row(s, rows, r, vehicle, tolerances, YES)
        best = _keep_largest(s, whole_knot, b, begin, end, best, place)
    return best


@kernel()
def _window(blocks: Array, ends: Array, pieces: int, p: int) -> tuple[float, float]:
    """Return the times between which a piece is driven, rests split in halves."""
    begin, end = -np.inf, np.inf
    if p > 0:
        a, b = ends[p - 1, 1] - 1, ends[p, 0]
        begin = blocks[a // LANES, 16, a % LANES] + blocks[b // LANES, 15, b % LANES]
    if p + 1 < pieces:
        a, b = ends[p, 1] - 1, ends[p + 1, 0]
        end = blocks[a // LANES, 16, a % LANES] + blocks[b // LANES, 15, b % LANES]
    return begin / 2, end / 2


@kernel()
def headline(
    blocks: Array, knot_of: Array, count: int, knots: Array, form: int,
    samples: tuple[Array, ...], rows: Array, order: Array, vehicle: Array,
    tolerances: Array, s: Array, highs: Array, skipped: Array,
    halves: tuple[Array, Array], stack: Array, knot_at: Array, high: Array,
    place: Array, ends: Array, pieces: int, signs: Array,
) -> tuple[int, float]:  # fmt: skip
    """Return the row that tells why a pair is refused, and what it reaches.

    `NOWHERE` if no limit is broken at a sample, though one that driving slower mends
    may be between them; `UNTOLD` if it depends on what else is broken between samples
    only, which is left to `validate`. `place` gets, behind the rows, knot, start and
    end of an interval.

    Parameters
    ----------
    samples
        Which blocks hold whole intervals between samples, the other intervals as
        blocks, and the knots of those.
    order : (r, 2) int
        Class of each row, and its place in the alphabet.
    high : (r,) float
        What each row never exceeds.
    ends, pieces, signs
        First and last part of the pieces, and the representation of each.
    """
    n, steers = rows.shape[0], vehicle[3] > 0
    there, spot = place[n], place[n + 1]
    for c in range(CLASSES + 1):
        which, most, reached, is_open = -1, 0.0, 0.0, False
        for r in range(n):
            error = RANGE_ERROR / rows[r, BOUND] if rows[r, KIND] == RANGE else 0.0
            if order[r, 0] != c or high[r] + error <= KEPT:
                continue
            is_slip = rows[r, KIND] == SLIP or rows[r, KIND] == PARALLEL
            floor = 0.0 if is_slip or c == 0 else most * (1 - 2 * TIE)
            sign, best = rows[r, SIGN], 0.0
            for p in range(pieces if sign != 0 else 1):
                if sign != 0 and not is_driven(sign, pieces, signs, steers, p):
                    continue
                begin, end = (-np.inf, np.inf)
                if sign != 0:
                    begin, end = _window(blocks, ends, pieces, p)
                best = _at_samples(
                    blocks, knot_of, samples, rows, r, vehicle, tolerances, s, highs,
                    skipped, begin, end, best, floor, spot,
                )  # fmt: skip
            ratio = told(rows, r, best)
            is_open |= best <= KEPT
            if best <= KEPT or (which >= 0 and ratio < most * (1 - TIE)):
                continue
            first = which < 0 or ratio > most * (1 + TIE)
            if first or order[r, 1] < order[which, 1]:
                which, reached = r, best
                for i in range(3):
                    there[i] = spot[i]
            most = max(most, ratio)
        if which >= 0:
            # Of wheels on their singular point none tells more than another.
            return (which, reached) if c > 0 or not is_open else (UNTOLD, reached)
        if c == CLASSES:
            break
        for r in range(n if is_open else 0):
            if order[r, 0] != c or high[r] <= KEPT:
                continue
            sign = rows[r, SIGN]
            for p in range(pieces if sign != 0 else 1):
                if sign != 0 and not is_driven(sign, pieces, signs, steers, p):
                    continue
                first, last = (NO, count) if sign == 0 else (ends[p, 0], ends[p, 1])
                low, top, is_clear = refine(
                    blocks, knot_of, count, knots, form, rows, r, vehicle, tolerances,
                    s, highs, skipped, halves, stack, knot_at, first, last, KEPT,
                    PROVING, NO, spot,
                )  # fmt: skip
                on_wheel = rows[r, KIND] == SINGULAR and top == np.inf
                if low > KEPT or not (is_clear or on_wheel):
                    return UNTOLD, 0.0
    return NOWHERE, 0.0
