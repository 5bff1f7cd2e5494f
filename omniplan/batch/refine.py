"""All parts of a motion under all rows of a vehicle, and halving where one is open.

Rows are told apart: what keeps a limit on all parts needs no second look, and where
parts must be halved it is for one row only.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

from typing import Any

import numpy as np

from omniplan.batch.chords import HIGH, LOW, SWUNG
from omniplan.batch.coarse import PER_BLOCK, screen
from omniplan.batch.kernel import kernel
from omniplan.batch.kinds import BOUND, KIND, RANGE, RANGE_ERROR, SIGN
from omniplan.batch.motions import FIELDS, LANES, enclose
from omniplan.batch.rows import evaluate
from omniplan.batch.swings import is_swinging, is_wide, load_swings, swing_into
from omniplan.judging.proof import RESOLUTION, ROUNDING, SHARPNESS

__all__ = [
    "HALVES",
    "KEPT",
    "NO",
    "STACK",
    "YES",
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


@kernel()
def load(blocks: Array, b: int, s: Array) -> None:
    """Copy the enclosures of a block into the scratch array."""
    block = blocks.reshape(blocks.shape[0], -1)[b]
    for k in range(FIELDS * LANES):  # one loop is vector code, two are not
        s[k] = block[k]


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
def _first_block(tops: Array, rows: Array, blocks: int, most: Array) -> int:
    """Return the block in which most may be reached; `most` is scratch."""
    groups = tops.shape[1]
    for g in range(groups):
        most[g] = -1.0
    for r in range(rows.shape[0]):
        if rows[r, SIGN] != 0:
            continue
        for g in range(groups):
            top = tops[r, g] if tops[r, g] < np.inf else -1.0
            most[g] = top if top > most[g] else most[g]
    at = 0
    for g in range(1, PER_BLOCK * blocks):
        at = g if most[g] > most[at] else at
    return at // PER_BLOCK


@kernel()
def _choose_rows(
    tops: Array, b: int, blocks: int, worst: float, done: Array, wanted: Array,
    skipped: Array, high: Array,
) -> bool:  # fmt: skip
    """Mark the rows that may exceed `worst` in a block; keep the bounds of the others.

    Whatever may break its limit is marked, too, unless it is a row of one
    representation that is broken already: `done`. Returns whether there is any.
    """
    some = False
    limit = worst if worst < KEPT else KEPT
    for r in range(tops.shape[0]):
        top = tops[r, PER_BLOCK * b]
        for g in range(PER_BLOCK * b + 1, PER_BLOCK * (b + 1)):
            top = tops[r, g] if tops[r, g] > top else top
        far = (top > limit) & (done[r] == 0.0)
        some |= far
        wanted[r] = 1.0 if far else 0.0
        skipped[r * blocks + b] = EVALUATED if far else top
        rest = 0.0 if far else top
        high[r] = rest if rest > high[r] else high[r]
    return some


@kernel(inline="always")
def sweep(
    blocks: Array, groups: Array, rows: Array, vehicle: Array, tolerances: Array,
    s: Array, tops: Array, wanted: Array, done: Array, most: Array, highs: Array,
    skipped: Array, low: Array, high: Array, at: Array,
) -> None:  # fmt: skip
    """Largest `LOW` and `HIGH` of every row over all parts.

    Where a row cannot reach more than some row that counts in any case does elsewhere,
    nor its limit, the bound of its group has to do, which `skipped` gets. So it has
    where a row of one representation is broken anyway: `low` is reached somewhere then,
    but perhaps not the largest. `at` gets the block in which `low` is reached of a row
    that counts in any case.
    """
    n_rows, n_blocks = rows.shape[0], blocks.shape[0]
    bounds = tops[:n_rows]
    u = s.reshape(-1, LANES)
    screen(groups, rows, vehicle, tolerances, u, bounds)
    for r in range(n_rows):
        low[r], high[r], at[r], done[r] = 0.0, 0.0, 0, 0.0
    start = _first_block(bounds, rows, n_blocks, highs)
    for k in range(2 * LANES * n_rows):
        most[k] = 0.0
    worst, swings = 0.0, is_swinging(rows)
    for i in range(n_blocks):
        b = start if i == 0 else (i - 1 if i <= start else i)
        if not _choose_rows(bounds, b, n_blocks, worst, done, wanted, skipped, high):
            continue
        load(blocks, b, s)
        if swings:
            load_swings(blocks, b, s)
        evaluate(s, rows, NO, n_rows, vehicle, tolerances, NO, wanted, most, highs, b,
            n_blocks,
        )  # fmt: skip
        for r in range(n_rows):
            if wanted[r] == 0.0:
                continue
            reached = largest(most, 2 * LANES * r)
            if rows[r, SIGN] == 0:
                worst = reached if reached > worst else worst
            elif reached - RANGE_ERROR / rows[r, BOUND] > KEPT:
                done[r] = 1.0
            if reached > low[r]:
                low[r], at[r] = reached, b
    for r in range(n_rows):
        top = largest(most, 2 * LANES * r + LANES)
        high[r] = top if top > high[r] else high[r]


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
    for k in range(LANES):
        t = times[0] if k == 0 else times[1]
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
    view = s.reshape(-1, LANES)
    # What `sweep` found on every part.
    parts = r * blocks.shape[0] * LANES
    error = RANGE_ERROR / rows[r, BOUND] if rows[r, KIND] == RANGE else 0.0
    for b in range(first // LANES, (last - 1) // LANES + 1):
        at = parts + b * LANES
        bound = skipped[r * blocks.shape[0] + b]
        most = bound if bound >= 0.0 else largest(highs, at)
        if most + error <= threshold and not reaching:
            high = most if most > high else high
            continue
        if reaching or is_proof or bound >= 0.0:
            load(blocks, b, s)
            if is_wide(rows[r, KIND]):
                load_swings(blocks, b, s)
            one_row(s, rows, r, vehicle, tolerances, NO)
            if bound >= 0.0:
                for k in range(LANES):
                    highs[at + k] = s[HIGH + k]
                skipped[r * blocks.shape[0] + b] = EVALUATED
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
        one_row(s, rows, r, vehicle, tolerances, YES if is_proof else NO)
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
