"""All parts of a motion under all rows of a vehicle, and halving where one is open.

Rows are told apart: what keeps a limit on all parts needs no second look, and where
parts must be halved it is for one row only.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

from typing import Any

import numpy as np

from omniplan.batch.chords import HIGH, LOW, SWUNG
from omniplan.batch.coarse import screen
from omniplan.batch.kernel import kernel
from omniplan.batch.kinds import BOUND, KIND, RANGE, RANGE_ERROR, SIGN
from omniplan.batch.motions import FIELDS, LANES, enclose
from omniplan.batch.rows import SETTLING, evaluate
from omniplan.batch.swings import is_swinging, is_wide, load_swings, swing_into
from omniplan.judging.proof import RESOLUTION, ROUNDING, SHARPNESS
from omniplan.report import SHAPE_LIMITS

__all__ = [
    "HALVES",
    "KEPT",
    "NO",
    "STACK",
    "YES",
    "angle_error",
    "describe",
    "load",
    "one_row",
    "refine",
    "sweep",
    "swing_halves",
]

Array = Any  # numba infers the types; mypy cannot look into the kernels

DEEP = 3
"""Halvings whose enclosures are kept for the next vehicle ..."""
HALVES = 2 ** (DEEP + 1) - 2
"""... so many per part."""
STACK = 1024
"""Parts that may wait for being halved; behind them is room for those in work."""
NO, YES = np.int64(0), np.int64(1)
"""Not plain numbers: for each of those numba would compile a variant of its own."""
EVALUATED = -1.0
"""Instead of the bound of a group: the parts were evaluated one by one."""
KEPT = 1 + ROUNDING
"""The largest utilisation that keeps a limit."""
CLASSES = len(SHAPE_LIMITS)
"""Number of the last class of rows: those that driving slower mends."""
NEARLY = 0.9
"""Rows that may reach this share of the largest bound are looked at first."""
UNSEEN, SEEN, BROKEN = 0.0, 1.0, 2.0
"""Of rows: evaluated nowhere, somewhere, or of one representation and broken there."""


@kernel()
def load(blocks: Array, b: int, s: Array, swings: bool) -> None:
    """Copy the enclosures of a block into the scratch array, and how directions swing.

    The latter only if `swings`.
    """
    flat, at = blocks.flat, b * blocks.shape[1] * LANES
    for k in range(FIELDS * LANES):  # one loop is vector code, two are not
        s[k] = flat[at + k]
    if swings:
        load_swings(blocks, b, s)


@kernel(inline="always")
def angle_error(rows: Array, r: int) -> float:
    """Return how far the quick arc cosine may put the utilisation of a row off."""
    return RANGE_ERROR / rows[r, BOUND] if rows[r, KIND] == RANGE else 0.0


@kernel()
def largest(values: Array, at: int) -> float:
    """Return the largest of the lanes from `at` on."""
    a, b, c, d = values[at], values[at + 1], values[at + 2], values[at + 3]
    for k in range(at + 4, at + LANES, 4):
        a = values[k] if values[k] > a else a
        b = values[k + 1] if values[k + 1] > b else b
        c = values[k + 2] if values[k + 2] > c else c
        d = values[k + 3] if values[k + 3] > d else d
    a, b = (a if a > c else c), (b if b > d else d)
    return float(a if a > b else b)


@kernel()
def _highest(crest: Array, blocks: int) -> tuple[int, float]:
    """Return the block in which most may be reached, and how much, as far as known."""
    start, most = 0, 0.0
    for b in range(blocks):
        if crest[b, 1] > most:
            start, most = b, crest[b, 1]
    return start, most


@kernel()
def _choose_rows(
    rows: Array, order: Array, b: int, worst: float, state: Array, chosen: Array,
    skipped: Array,
) -> int:  # fmt: skip
    """Choose the rows that are worth evaluating over a block; return how many.

    Those that may exceed `worst`, and, unless driving slower mends it, those that may
    break their limit: `headline` has to tell all of these. None of one representation
    that is broken already.
    """
    count = 0
    limit = worst if worst < KEPT else KEPT
    for r in range(rows.shape[0]):
        top = skipped[r, b]
        mends = (rows[r, SIGN] == 0) & (order[r, 0] == CLASSES)
        far = (top > (worst if mends else limit)) & (state[r] < BROKEN)
        skipped[r, b] = EVALUATED if far else top
        chosen[count] = r
        count += 1 if far else 0
    return count


@kernel(inline="always")
def sweep(
    blocks: Array, groups: Array, rows: Array, order: Array, vehicle: Array,
    tolerances: Array, s: Array, crest: Array, chosen: Array, state: Array,
    most: Array, highs: Array, skipped: Array, low: Array, high: Array,
) -> None:  # fmt: skip
    """Largest `LOW` and `HIGH` of every row over all parts.

    Where a row cannot reach more than some row that counts in any case does elsewhere,
    nor its limit, the bound of its block has to do, which `skipped` gets. So it has
    where a row of one representation is broken anyway: `low` is reached somewhere then,
    but perhaps not the largest.
    """
    n_rows, n_blocks = rows.shape[0], blocks.shape[0]
    screen(groups, rows, vehicle, tolerances, skipped, crest)
    start, top = _highest(crest, n_blocks)
    for r in range(n_rows):
        low[r], high[r], state[r] = 0.0, 0.0, UNSEEN
    worst, swings = 0.0, is_swinging(rows)
    for i in range(n_blocks + 1):
        # First what may be the worst of all: then little else is worth a look.
        b, least = (start, NEARLY * top) if i == 0 else (i - 1, worst)
        if crest[b, 0] <= least:
            continue
        count = _choose_rows(rows, order, b, least, state, chosen, skipped)
        if count == 0:
            continue
        load(blocks, b, s, swings)
        for j in range(count):
            r = int(chosen[j])
            if state[r] == UNSEEN:
                for k in range(2 * LANES):
                    most[2 * LANES * r + k] = 0.0
                state[r] = SEEN
        evaluate(s, rows, NO, count, vehicle, tolerances, NO, chosen, most, highs, b,
            n_blocks,
        )  # fmt: skip
        for j in range(count):
            r = int(chosen[j])
            reached = largest(most, 2 * LANES * r)
            if rows[r, SIGN] == 0:
                worst = reached if reached > worst else worst
            elif reached - RANGE_ERROR / rows[r, BOUND] > KEPT:
                state[r] = BROKEN
            low[r] = reached if reached > low[r] else low[r]
    for r in range(n_rows):
        most_left = 0.0
        for b in range(n_blocks):
            rest = skipped[r, b]
            most_left = rest if rest > most_left else most_left
        if state[r] != UNSEEN:
            top = largest(most, 2 * LANES * r + LANES)
            most_left = top if top > most_left else most_left
        high[r] = most_left


@kernel(inline="always")
def one_row(
    s: Array, rows: Array, r: int, vehicle: Array, tolerances: Array, exact: int
) -> None:
    """Evaluate one row on the enclosures in the scratch array."""
    evaluate(s, rows, r, r + 1, vehicle, tolerances, exact, s, s, s, NO, NO)


@kernel()
def _halve(
    knot: Array, form: int, t0: float, t1: float, depth: int, node: int, wide: int,
    halves: tuple[Array, Array], view: Array, lane: int,
) -> None:  # fmt: skip
    """Write the enclosures of both halves of a part into two lanes.

    They do not depend on the vehicle: those of the first `DEEP` halvings are kept for
    the next. `node` is the number of the first half at its depth, where there are
    `wide` 2^depth.
    """
    kept, is_known = halves
    half = (t0 + t1) / 2
    if depth > DEEP:
        enclose(knot, form, t0, half, view, lane)
        enclose(knot, form, half, t1, view, lane + 1)
        return
    at = wide * (2**depth - 2) + node
    if is_known[at]:
        for i in range(FIELDS):
            view[i, lane], view[i, lane + 1] = kept[at, i], kept[at + 1, i]
        return
    enclose(knot, form, t0, half, view, lane)
    enclose(knot, form, half, t1, view, lane + 1)
    for i in range(FIELDS):
        kept[at, i], kept[at + 1, i] = view[i, lane], view[i, lane + 1]
    is_known[at] = True


@kernel()
def swing_halves(
    knots: Array, form: int, those: Array, view: Array, taken: int, s: Array
) -> None:
    """Write how directions swing over the halves of parts."""
    whole = s.reshape(-1, LANES)
    for k in range(2 * taken):
        swing_into(
            knots[those[k // 2]], form, view[15, k], view[16, k], whole,
            SWUNG // LANES, k,
        )  # fmt: skip


@kernel()
def describe(
    knot: Array, form: int, row: Array, vehicle: Array, tolerances: Array,
    s: Array, times: tuple[float, float],
) -> int:  # fmt: skip
    """Evaluate a row at two times, in the first lanes; return at which it is worse.

    Parameters
    ----------
    knot : (KNOT,) float
    form : bool
    row : (1, PARAMETERS) float
    vehicle, tolerances
        As for `evaluate`.
    s : (ROOM,) float
        Scratch.
    times : two floats, s
    """
    view = s.reshape(-1, LANES)
    for k in range(2):  # what is in the other lanes does not matter
        t = times[k]
        enclose(knot, form, t, t, view, k)
        if is_wide(row[0, KIND]):
            swing_into(knot, form, t, t, view, SWUNG // LANES, k)
    one_row(s, row, NO, vehicle, tolerances, YES)
    return 1 if s[LOW + 1] > s[LOW] else 0


@kernel()
def refine(
    blocks: Array, knot_of: Array, count: int, knots: Array, form: int,
    rows: Array, r: int, vehicle: Array, tolerances: Array, s: Array, highs: Array,
    skipped: Array, halves: tuple[Array, Array], stack: Array, knot_at: Array,
    first: int, last: int, threshold: float, halvings: int, reaching: int,
    place: Array,
) -> tuple[float, float, bool]:  # fmt: skip
    """Halve parts first to last - 1 while one row may exceed the threshold on them.

    Returns what is reached and what is never exceeded, and whether that is settled: at
    a threshold of `KEPT` whether the limit is kept or broken; at another one always.
    `place` gets knot and time of what is reached; on parts that may not exceed the
    threshold only if `reaching`.
    """
    is_proof = threshold == KEPT
    low, high = 0.0, 0.0
    waiting = 0
    # What `sweep` found on every part.
    parts = r * blocks.shape[0] * LANES
    error = angle_error(rows, r)
    for b in range(first // LANES, (last - 1) // LANES + 1):
        at = parts + b * LANES
        bound = skipped[r, b]
        most = bound if bound >= 0.0 else largest(highs, at)
        if most + error <= threshold and not reaching:
            high = most if most > high else high
            continue
        if reaching or is_proof or bound >= 0.0:
            load(blocks, b, s, is_wide(rows[r, KIND]))
            one_row(s, rows, r, vehicle, tolerances, NO)
            if bound >= 0.0:
                for k in range(LANES):
                    highs[at + k] = s[HIGH + k]
                skipped[r, b] = EVALUATED
        else:
            for k in range(LANES):
                s[LOW + k] = 0.0
        for k in range(LANES):
            if not first <= b * LANES + k < last:
                continue
            if s[LOW + k] - error > low:
                low = s[LOW + k] - error
                place[0] = knot_of[b, k]
                place[1], place[2] = blocks[b, 15, k], blocks[b, 16, k]
            most = highs[at + k]
            if most + error <= threshold:
                high = max(high, most)
            elif waiting < STACK:
                stack[waiting, 0], stack[waiting, 1] = (
                    blocks[b, 15, k],
                    blocks[b, 16, k],
                )
                stack[waiting, 2], stack[waiting, 3] = 0, b * LANES + k
                knot_at[waiting] = knot_of[b, k]
                waiting += 1
            else:
                high = np.inf
    if waiting == 0:
        high = max(high, low)
        return low, high, not is_proof or low > KEPT or high <= KEPT
    view = s.reshape(-1, LANES)
    halved, those = stack[STACK:], knot_at[STACK:]
    while waiting > 0:
        if is_proof and (low > KEPT or high > KEPT):
            break
        if not is_proof:
            threshold = max(threshold, low * (1 + SHARPNESS))
        taken = min(waiting, LANES // 2)
        base = waiting - taken
        for i in range(taken):
            j = base + i
            halved[i, 0], halved[i, 1] = stack[j, 2] + 1, stack[j, 3]
            those[i] = knot_at[j]
            _halve(
                knots[knot_at[j]], form, stack[j, 0], stack[j, 1], int(halved[i, 0]),
                int(2 * halved[i, 1]), blocks.shape[0] * LANES, halves, view, 2 * i,
            )  # fmt: skip
        if is_wide(rows[r, KIND]):
            swing_halves(knots, form, those, view, taken, s)
        one_row(s, rows, r, vehicle, tolerances, SETTLING if is_proof else NO)
        off = 0.0 if is_proof else error  # of the quick arc cosine
        waiting = base
        for k in range(2 * taken):
            depth, t0, t1 = halved[k // 2, 0], view[15, k], view[16, k]
            reached, most = s[LOW + k] - off, s[HIGH + k] + off
            if reached > low:
                low = reached
                place[0], place[1], place[2] = those[k // 2], t0, t1
            is_fine = depth >= halvings or most - reached <= RESOLUTION
            if most <= threshold or is_fine or waiting >= STACK:
                high = max(high, most)
            else:
                stack[waiting, 0], stack[waiting, 1] = t0, t1
                stack[waiting, 2] = depth
                stack[waiting, 3] = 2 * halved[k // 2, 1] + k % 2
                knot_at[waiting] = those[k // 2]
                waiting += 1
    if low > KEPT:
        return low, max(low, high), True
    high = max(high, low)
    return low, high, not is_proof or high <= KEPT
