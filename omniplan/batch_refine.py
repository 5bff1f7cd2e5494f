"""All parts of a motion under all rows of a vehicle, and halving where one is open.

Rows are told apart: what keeps a limit on all parts needs no second look, and where
parts must be halved it is for one row only.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from omniplan.batch_chords import HIGH, LOW
from omniplan.batch_motions import FIELDS, LANES, enclose
from omniplan.batch_rows import BOUND, KIND, RANGE, RANGE_ERROR, evaluate
from omniplan.proof import RESOLUTION, ROUNDING, SHARPNESS

__all__ = ["KEPT", "NO", "STACK", "YES", "load", "one_row", "refine", "sweep"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

STACK = 1024
"""Parts that may wait for being halved."""
NO, YES = np.int64(0), np.int64(1)
"""Not plain numbers: for each of those numba would compile a variant of its own."""
KEPT = 1 + ROUNDING
"""The largest utilisation that keeps a limit."""


@njit(cache=True)
def load(blocks: Array, b: int, s: Array) -> None:
    """Copy the enclosures of a block into the scratch array."""
    for i in range(FIELDS):
        for k in range(LANES):
            s[i * LANES + k] = blocks[b, i, k]


@njit(cache=True, inline="always")
def sweep(
    blocks: Array, rows: Array, vehicle: Array, tolerances: Array, s: Array,
    most: Array, highs: Array, low: Array, high: Array,
) -> None:  # fmt: skip
    """Largest `LOW` and `HIGH` of every row over all parts."""
    n_rows = rows.shape[0]
    most[: 2 * LANES * n_rows] = 0.0
    for b in range(blocks.shape[0]):
        load(blocks, b, s)
        evaluate(s, rows, NO, n_rows, vehicle, tolerances, NO, most, highs, b,
            blocks.shape[0],
        )  # fmt: skip
    for r in range(n_rows):
        low[r], high[r] = 0.0, 0.0
        for k in range(2 * LANES * r, 2 * LANES * r + LANES):
            low[r], high[r] = max(low[r], most[k]), max(high[r], most[k + LANES])


@njit(cache=True, inline="always")
def one_row(
    s: Array, rows: Array, r: int, vehicle: Array, tolerances: Array, exact: int
) -> None:
    """Evaluate one row on the enclosures in the scratch array."""
    evaluate(s, rows, r, r + 1, vehicle, tolerances, exact, s, s, NO, NO)


@njit(cache=True)
def refine(
    blocks: Array, knot_of: Array, count: int, knots: Array, is_pose: bool,
    rows: Array, r: int, vehicle: Array, tolerances: Array, s: Array, highs: Array,
    stack: Array, knot_at: Array, first: int, last: int, threshold: float,
    halvings: int, reaching: int, place: Array,
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
    view = s[: FIELDS * LANES].reshape(FIELDS, LANES)
    # What `sweep` found on every part.
    parts = r * blocks.shape[0] * LANES
    error = RANGE_ERROR / rows[r, BOUND] if rows[r, KIND] == RANGE else 0.0
    for b in range(first // LANES, (last - 1) // LANES + 1):
        most = 0.0
        for k in range(LANES):
            most = max(most, highs[parts + b * LANES + k])
        if most + error <= threshold and not reaching:
            high = max(high, most)
            continue
        if reaching or is_proof:
            load(blocks, b, s)
            one_row(s, rows, r, vehicle, tolerances, NO)
        else:
            s[LOW : LOW + LANES] = 0.0
        for k in range(LANES):
            if not first <= b * LANES + k < last:
                continue
            if s[LOW + k] - error > low:
                low = s[LOW + k] - error
                place[0] = knot_of[b, k]
                place[1], place[2] = blocks[b, 15, k], blocks[b, 16, k]
            at = highs[parts + b * LANES + k]
            if at + error <= threshold:
                high = max(high, at)
            elif waiting < STACK:
                stack[waiting, 0], stack[waiting, 1] = (
                    blocks[b, 15, k],
                    blocks[b, 16, k],
                )
                stack[waiting, 2], knot_at[waiting] = 0, knot_of[b, k]
                waiting += 1
            else:
                high = np.inf
    while waiting > 0:
        if is_proof and (low > KEPT or high > KEPT):
            break
        if not is_proof:
            threshold = max(threshold, low * (1 + SHARPNESS))
        taken = min(waiting, LANES // 2)
        base = waiting - taken
        for i in range(LANES // 2):
            j = base + min(i, taken - 1)
            t0, t1 = stack[j, 0], stack[j, 1]
            half = (t0 + t1) / 2
            knot = knots[knot_at[j]]
            enclose(knot, is_pose, t0, half, view, 2 * i)
            enclose(knot, is_pose, half, t1, view, 2 * i + 1)
        one_row(s, rows, r, vehicle, tolerances, YES)
        depths = stack[base : base + taken, 2].copy()
        those = knot_at[base : base + taken].copy()
        waiting = base
        for k in range(2 * taken):
            depth, t0, t1 = depths[k // 2] + 1, view[15, k], view[16, k]
            reached, most = s[LOW + k], s[HIGH + k]
            if reached > low:
                low = reached
                place[0], place[1], place[2] = those[k // 2], t0, t1
            is_fine = depth >= halvings or most - reached <= RESOLUTION
            if most <= threshold or is_fine or waiting >= STACK:
                high = max(high, most)
            else:
                stack[waiting, 0], stack[waiting, 1] = t0, t1
                stack[waiting, 2], knot_at[waiting] = depth, those[k // 2]
                waiting += 1
    if low > KEPT:
        return low, max(low, high), True
    high = max(high, low)
    return low, high, not is_proof or high <= KEPT
