"""The most telling limit of a refused pair, in numba: `Report.headline`.

What is broken at the samples comes first, of that what no other speed would mend, then
the largest excess there: over the intervals between samples as a whole, which
`validate` and the kernels have in common, wherever else they cut a motion. Where
nothing is broken at a sample the intervals are halved evenly until something is.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

import numpy as np

from omniplan.batch.chords import HIGH, LOW
from omniplan.batch.kernel import kernel
from omniplan.batch.kinds import (
    BOUND,
    KIND,
    PARALLEL,
    SIGN,
    SLIP,
)
from omniplan.batch.motions import LANES, enclose
from omniplan.batch.refine import (
    KEPT,
    NO,
    STACK,
    YES,
    angle_error,
    largest,
    load,
    one_row,
    swing_halves,
)
from omniplan.batch.rows import SETTLING
from omniplan.batch.swings import is_wide
from omniplan.judging.violations import FINEST
from omniplan.report import SHAPE_LIMITS, TIE
from omniplan.standing.standstill import BETWEEN

__all__ = ["FINEST", "NOWHERE", "count_faults", "headline", "is_driven", "told"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

CLASSES = len(SHAPE_LIMITS)
"""Number of the last class: limits that driving slower mends."""
NOWHERE, UNTOLD = -1, -2
"""Instead of a row: none is broken where it was looked; `validate` has to tell."""
MAX_ROUNDS = 1 << 12
"""So often parts are halved for one row, sixteen at a time, before `validate` is asked.
"""
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
        best = _keep(s, k, knot_of[b, k], begin, end, best, place)
    return best


@kernel(inline="always")
def _keep(
    s: Array, k: int, knot: int, begin: float, end: float, best: float, place: Array
) -> float:
    """Take what a lane reaches if it is more, or as much and earlier."""
    low, t0 = s[LOW + k], s[START + k]
    if low <= KEPT or low < best * (1 - TIE):
        return best
    middle = (t0 + s[END + k]) / 2
    if middle <= begin or middle >= end:
        return best
    if low > best * (1 + TIE) or t0 < place[1]:
        place[0], place[1], place[2] = knot, t0, s[END + k]
    return float(max(best, low))


@kernel()
def _between_samples(
    blocks: Array, knot_of: Array, those_blocks: Array, knots: Array, form: int,
    rows: Array, r: int, vehicle: Array, tolerances: Array, s: Array, stack: Array,
    knot_at: Array, begin: float, end: float, level: int, best: float, place: Array,
) -> float:  # fmt: skip
    """Largest utilisation of a row where intervals are cut in 2^level parts.

    Blocks of whole intervals, of which those of `those_blocks` count; otherwise as
    `_at_samples`. What keeps the limit for sure is not cut further. -1 if that takes
    too many parts.
    """
    wide, rounds = is_wide(rows[r, KIND]), 0
    view = s.reshape(-1, LANES)
    depths, those = stack[STACK:], knot_at[STACK:]
    for b in range(blocks.shape[0]):
        if not those_blocks[b]:
            continue
        load(blocks, b, s, wide)
        one_row(s, rows, r, vehicle, tolerances, YES)
        waiting = 0
        for k in range(LANES):
            if s[HIGH + k] > KEPT:
                stack[waiting, 0], stack[waiting, 1] = s[START + k], s[END + k]
                stack[waiting, 2], knot_at[waiting] = 0, knot_of[b, k]
                waiting += 1
        while waiting > 0:
            rounds += 1
            if rounds > MAX_ROUNDS or waiting + LANES > STACK:
                return -1.0
            taken = min(waiting, LANES // 2)
            waiting -= taken
            for i in range(taken):
                t0, t1 = stack[waiting + i, 0], stack[waiting + i, 1]
                depths[i, 2], those[i] = stack[waiting + i, 2] + 1, knot_at[waiting + i]
                half = (t0 + t1) / 2
                enclose(knots[those[i]], form, t0, half, view, 2 * i)
                enclose(knots[those[i]], form, half, t1, view, 2 * i + 1)
            if wide:
                swing_halves(knots, form, those, view, taken, s)
            one_row(s, rows, r, vehicle, tolerances, YES)
            for k in range(2 * taken):
                if depths[k // 2, 2] == level:
                    best = _keep(s, k, those[k // 2], begin, end, best, place)
                elif s[HIGH + k] > KEPT:
                    stack[waiting, 0], stack[waiting, 1] = s[START + k], s[END + k]
                    stack[waiting, 2], knot_at[waiting] = (
                        depths[k // 2, 2],
                        those[k // 2],
                    )
                    waiting += 1
    return best


@kernel()
def _at_samples(
    blocks: Array, knot_of: Array, plain: Array, wholes: Array, whole_knot: Array,
    rows: Array, r: int, vehicle: Array, tolerances: Array, s: Array, highs: Array,
    skipped: Array, begin: float, end: float, best: float, floor: float, place: Array,
) -> float:  # fmt: skip
    """Largest utilisation of a row at the samples; 0 if none breaks the limit.

    Only in the intervals whose middle is between two times, if it is more than `best`,
    and where it may be more than `floor`. `place` gets knot, start and end of the first
    of the intervals.
    """
    count, wide = blocks.shape[0], is_wide(rows[r, KIND])
    error = angle_error(rows, r)
    floor, others = max(KEPT, floor), 0.0
    for b in range(count):
        bound = skipped[r, b]
        most = bound if bound >= 0.0 else largest(highs, (r * count + b) * LANES)
        if not plain[b]:
            others = max(others, most)
            continue
        if most + error <= max(floor, best * (1 - TIE)):
            continue
        load(blocks, b, s, wide)
        one_row(s, rows, r, vehicle, tolerances, SETTLING)
        best = _keep_largest(s, knot_of, b, begin, end, best, place)
    # What the intervals of other blocks reach, their parts do not exceed.
    is_less = others + error <= max(floor, best * (1 - TIE))
    for b in range(0 if is_less else wholes.shape[0]):
        load(wholes, b, s, wide)
        one_row(s, rows, r, vehicle, tolerances, SETTLING)
        best = _keep_largest(s, whole_knot, b, begin, end, best, place)
    return best


@kernel()
def _has_broken(
    s: Array, rows: Array, r: int, vehicle: Array, tolerances: Array, begin: float,
    end: float,
) -> bool:  # fmt: skip
    """Return whether a row is broken at a sample of some interval of a block.

    Arc tangents are needed only where the quick ones leave that open.
    """
    error = angle_error(rows, r)
    one_row(s, rows, r, vehicle, tolerances, NO)
    is_open = False
    for k in range(LANES):
        middle = (s[START + k] + s[END + k]) / 2
        if begin < middle < end and s[LOW + k] + error > KEPT:
            if s[LOW + k] - error > KEPT:
                return True
            is_open = True
    if not is_open:
        return False
    one_row(s, rows, r, vehicle, tolerances, SETTLING)
    for k in range(LANES):
        middle = (s[START + k] + s[END + k]) / 2
        if begin < middle < end and s[LOW + k] > KEPT:
            return True
    return False


@kernel()
def _breaks(
    blocks: Array, plain: Array, wholes: Array, rows: Array, r: int, vehicle: Array,
    tolerances: Array, s: Array, highs: Array, skipped: Array, begin: float, end: float,
) -> bool:  # fmt: skip
    """Return whether `_at_samples` finds a row broken, without how much it is."""
    count, wide = blocks.shape[0], is_wide(rows[r, KIND])
    error = angle_error(rows, r)
    others = 0.0
    for b in range(count):
        bound = skipped[r, b]
        most = bound if bound >= 0.0 else largest(highs, (r * count + b) * LANES)
        if not plain[b]:
            others = max(others, most)
            continue
        if most + error <= KEPT:
            continue
        load(blocks, b, s, wide)
        if _has_broken(s, rows, r, vehicle, tolerances, begin, end):
            return True
    for b in range(0 if others + error <= KEPT else wholes.shape[0]):
        load(wholes, b, s, wide)
        if _has_broken(s, rows, r, vehicle, tolerances, begin, end):
            return True
    return False


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
def count_faults(
    blocks: Array, samples: tuple[Array, ...], rows: Array, vehicle: Array,
    tolerances: Array, s: Array, highs: Array, skipped: Array, high: Array, ends: Array,
    pieces: int, by_piece: Array,
) -> None:  # fmt: skip
    """Count the limits that pieces break at the samples, as `standstill` does.

    Only where both representations break some: the first column of `by_piece`. Limits
    that hold for both count for neither.
    """
    plain, wholes, _, _ = samples
    for p in range(pieces):
        if by_piece[p, 0, 0] == 0.0 or by_piece[p, 1, 0] == 0.0:
            continue
        by_piece[p, 0, 0] = by_piece[p, 1, 0] = 0.0
        begin, end = _window(blocks, ends, pieces, p)
        common = False
        for r in range(rows.shape[0]):
            error = angle_error(rows, r)
            sign = rows[r, SIGN]
            if high[r] + error <= KEPT or (sign == 0 and common):
                continue
            if not _breaks(
                blocks, plain, wholes, rows, r, vehicle, tolerances, s, highs, skipped,
                begin, end,
            ):  # fmt: skip
                continue
            if sign != 0:
                by_piece[p, 0 if sign > 0 else 1, 0] += 1.0
            else:
                common = True
        for side in range(2):
            if by_piece[p, side, 0] == 0.0 and not common:
                by_piece[p, side, 0] = BETWEEN


@kernel()
def _most_telling(
    blocks: Array, knot_of: Array, knots: Array, form: int, samples: tuple[Array, ...],
    rows: Array, order: Array, vehicle: Array, tolerances: Array, s: Array,
    highs: Array, skipped: Array, stack: Array, knot_at: Array, high: Array,
    place: Array, ends: Array, pieces: int, signs: Array, level: int,
) -> tuple[int, float]:  # fmt: skip
    """Return the row to tell where intervals are cut in 2^level parts."""
    n, steers = rows.shape[0], vehicle[3] > 0
    there, spot = place[n], place[n + 1]
    plain, wholes, whole_knot, all_wholes = samples
    for c in range(CLASSES + 1):
        which, most, reached = NOWHERE, 0.0, 0.0
        for r in range(n):
            error = angle_error(rows, r)
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
                if level == 0:
                    best = _at_samples(
                        blocks, knot_of, plain, wholes, whole_knot, rows, r, vehicle,
                        tolerances, s, highs, skipped, begin, end, best, floor, spot,
                    )  # fmt: skip
                    continue
                best = _between_samples(
                    blocks, knot_of, plain, knots, form, rows, r, vehicle, tolerances,
                    s, stack, knot_at, begin, end, level, best, spot,
                )  # fmt: skip
                if best >= 0.0:
                    best = _between_samples(
                        wholes, whole_knot, all_wholes, knots, form, rows, r, vehicle,
                        tolerances, s, stack, knot_at, begin, end, level, best, spot,
                    )  # fmt: skip
                if best < 0.0:
                    return UNTOLD, 0.0
            ratio = told(rows, r, best)
            if best <= KEPT or (which >= 0 and ratio < most * (1 - TIE)):
                continue
            first = which < 0 or ratio > most * (1 + TIE)
            if first or order[r, 1] < order[which, 1]:
                which, reached = r, best
                for i in range(3):
                    there[i] = spot[i]
            most = max(most, ratio)
        if which >= 0:
            return which, reached
    return NOWHERE, 0.0


@kernel()
def headline(
    blocks: Array, knot_of: Array, knots: Array, form: int, samples: tuple[Array, ...],
    rows: Array, order: Array, vehicle: Array, tolerances: Array, s: Array,
    highs: Array, skipped: Array, stack: Array, knot_at: Array, high: Array,
    place: Array, ends: Array, pieces: int, signs: Array, finest: int,
) -> tuple[int, float]:  # fmt: skip
    """Return the row that tells why a pair is refused, and what it reaches.

    `NOWHERE` if no limit is broken at the samples, nor where intervals are halved
    `finest` times; `UNTOLD` if that takes too many parts. `place` gets, behind the
    rows, knot, start and end of an interval.

    Parameters
    ----------
    samples
        Which blocks hold whole intervals between samples, the other intervals as
        blocks, the knots of those, and true for each of them.
    order : (r, 2) int
        Class of each row, and its place in the alphabet.
    high : (r,) float
        What each row never exceeds.
    ends, pieces, signs
        First and last part of the pieces, and the representation of each.
    finest : int
    """
    for level in range(finest + 1):
        which, reached = _most_telling(
            blocks, knot_of, knots, form, samples, rows, order, vehicle, tolerances, s,
            highs, skipped, stack, knot_at, high, place, ends, pieces, signs, level,
        )  # fmt: skip
        if which != NOWHERE:
            return which, reached
    return NOWHERE, 0.0
