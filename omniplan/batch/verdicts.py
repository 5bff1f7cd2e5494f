"""Verdicts on pairs of a motion and a vehicle, in numba.

The same proof as in `proof` and `standstill`, told apart by rows: what a row may reach
at most over all parts either keeps the limit, or the parts in question are halved until
it is decided. A pair is left to `validate` (`UNCLEAR`) where the configuration has to
change at a standstill, or a limit can neither be proved kept nor broken.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from omniplan.batch.chords import LOW, NA, ROOM
from omniplan.batch.motions import FIELDS, LANES, enclose
from omniplan.batch.pieces import MAX_PIECES, angle_of, choose, pieces_of
from omniplan.batch.refine import HALVES, KEPT, NO, STACK, YES, one_row, refine, sweep
from omniplan.batch.rows import (
    ANGLE,
    BOUND,
    KIND,
    PARALLEL,
    RANGE,
    RANGE_ERROR,
    SIGN,
    SINGULAR,
    SLIP,
)
from omniplan.judging.proof import MAX_HALVINGS, SHARPENING_HALVINGS, SHARPNESS

__all__ = ["REFUSED", "UNCLEAR", "VALID", "judge_pairs"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

UNCLEAR, VALID, REFUSED = 0, 1, 2
"""What is said of a pair; unclear ones are left to `validate`."""

PROVING, SHARPENING = np.int64(MAX_HALVINGS), np.int64(SHARPENING_HALVINGS)
LEAST_WORST = 0.05
"""Utilisations below this are not sharpened, as in `Proof.sharpen`."""


@njit(cache=True)
def _told(rows: Array, r: int, ratio: float) -> float:
    """Value over bound as reports have it: of slip the angles, not their sines."""
    if rows[r, KIND] == SLIP or rows[r, KIND] == PARALLEL:
        return math.asin(min(ratio * rows[r, BOUND], 1.0)) / math.asin(rows[r, BOUND])
    return ratio


@njit(cache=True, inline="always")
def _describe(
    knots: Array, is_pose: bool, rows: Array, r: int, vehicle: Array,
    tolerances: Array, s: Array, place: Array, sign: float, out: Array,
) -> None:  # fmt: skip
    """Write time, value and bound of a row at the worse end of a part."""
    view = s[: FIELDS * LANES].reshape(FIELDS, LANES)
    knot = knots[int(place[0])]
    for k in range(LANES):
        t = place[1] if k == 0 else place[2]
        enclose(knot, is_pose, t, t, view, k)
    one_row(s, rows, r, vehicle, tolerances, YES)
    k = 1 if s[LOW + 1] > s[LOW] else 0
    out[0] = place[1 + k]
    ratio = s[LOW + k]
    if rows[r, KIND] == SINGULAR:
        out[1], out[2] = s[NA + k], 0.0
    elif rows[r, KIND] == RANGE:
        aside = angle_of(s, k, False, sign, rows[r, ANGLE])
        out[1], out[2] = (
            rows[r, ANGLE] + aside,
            rows[r, ANGLE] + math.copysign(rows[r, BOUND], aside),
        )
    elif rows[r, KIND] == SLIP or rows[r, KIND] == PARALLEL:
        out[2] = math.asin(rows[r, BOUND])
        out[1] = _told(rows, r, ratio) * out[2]
    else:
        out[1], out[2] = ratio * rows[r, BOUND], rows[r, BOUND]


@njit(cache=True, inline="always")
def _settled(
    blocks: Array, knot_of: Array, count: int, knots: Array, is_pose: bool, rows: Array,
    vehicle: Array, tolerances: Array, s: Array, highs: Array, skipped: Array,
    halves: tuple[Array, Array], stack: Array, knot_at: Array, low: Array, high: Array,
    place: Array, ends: Array, pieces: int, by_piece: Array,
) -> bool:  # fmt: skip
    """Decide every row that holds for both representations, and each by pieces.

    `low`, `high` and `place` (r, ...) get what is known of a row over all parts;
    `by_piece` (p, 2, 3) per piece and representation the number of limits that are
    broken, then what is reached and never exceeded in it. False if some row stays open.
    """
    broken = False
    for r in range(rows.shape[0]):
        if rows[r, SIGN] == 0 and low[r] > KEPT:
            broken = True
    for r in range(rows.shape[0]):
        if rows[r, SIGN] != 0 or high[r] <= KEPT:
            continue
        # A broken pair is refused whatever else is open.
        if broken:
            continue
        low[r], high[r], is_clear = refine(
            blocks, knot_of, count, knots, is_pose, rows, r, vehicle, tolerances, s,
            highs, skipped, halves, stack, knot_at, NO, count, KEPT, PROVING, NO,
            place[r],
        )  # fmt: skip
        if low[r] > KEPT:
            broken = True
        elif not is_clear and not broken:
            return False
    by_piece[:pieces] = 0.0
    for r in range(rows.shape[0]):
        if rows[r, SIGN] == 0:
            continue
        side = 0 if rows[r, SIGN] > 0 else 1
        error = RANGE_ERROR / rows[r, BOUND] if rows[r, KIND] == RANGE else 0.0
        for p in range(pieces):
            known = high[r] + error <= KEPT or low[r] - error > KEPT
            if pieces == 1 and known:
                reached, most, is_clear = low[r], high[r], True
            else:
                reached, most, is_clear = refine(
                    blocks, knot_of, count, knots, is_pose, rows, r, vehicle,
                    tolerances, s, highs, skipped, halves, stack, knot_at, ends[p, 0],
                    ends[p, 1], KEPT, PROVING, YES, place[r],
                )  # fmt: skip
            if not is_clear and not broken:
                return False
            if reached > KEPT:
                by_piece[p, side, 0] += 1
            by_piece[p, side, 1] = max(by_piece[p, side, 1], reached)
            by_piece[p, side, 2] = max(by_piece[p, side, 2], most)
    return True


@njit(cache=True, inline="always")
def _judge(
    blocks: Array, groups: Array, knot_of: Array, count: int, knots: Array,
    is_pose: bool, rows: Array, order: Array, vehicle: Array, tolerances: Array,
    room: tuple[Array, ...], out: Array,
) -> tuple[int, int]:  # fmt: skip
    """Return the verdict on one pair, and the row that tells it.

    `out` gets the margin, then time, value and bound of the row that refuses.
    """
    (
        s, tops, wanted, done, most, highs, skipped, halves, low, high, at, place,
        stack, knot_at, ends, by_piece, signs,
    ) = room  # fmt: skip
    n_rows = rows.shape[0]
    pieces = 1
    ends[0, 0], ends[0, 1], signs[0] = 0, count, 0
    if vehicle[3] > 0:
        pieces = pieces_of(blocks, count, vehicle, tolerances, s, ends)
        if pieces < 0:
            return UNCLEAR, -1
    sweep(
        blocks, groups, rows, vehicle, tolerances, s, tops, wanted, done, most, highs,
        skipped, low, high, at,
    )  # fmt: skip
    place[:n_rows, 0] = -1.0
    if not _settled(
        blocks, knot_of, count, knots, is_pose, rows, vehicle, tolerances, s, highs,
        skipped, halves, stack, knot_at, low, high, place, ends, pieces, by_piece,
    ):  # fmt: skip
        return UNCLEAR, -1
    if vehicle[3] > 0 and not choose(
        blocks, rows, s, ends, pieces, by_piece, tolerances[3], signs
    ):
        return UNCLEAR, -1
    is_valid = True
    for r in range(n_rows):
        if rows[r, SIGN] == 0 and low[r] > KEPT:
            is_valid = False
    for p in range(pieces):
        if vehicle[3] > 0 and by_piece[p, signs[p], 0] > 0:
            is_valid = False
    if is_valid:
        which = _margin(
            blocks, knot_of, count, knots, is_pose, rows, vehicle, tolerances, s, highs,
            skipped, halves, stack, knot_at, low, high, place, ends, pieces, signs, out,
        )  # fmt: skip
        return VALID, which
    verdict: tuple[int, int] = _refusal(
        blocks, knot_of, count, knots, is_pose, rows, order, vehicle, tolerances, s,
        highs, skipped, halves, stack, knot_at, low, at, place, ends, pieces, signs,
        out,
    )  # fmt: skip
    return verdict


@njit(cache=True)
def _is_driven(sign: float, pieces: int, signs: Array, steers: bool, p: int) -> bool:
    """Whether a row of one representation holds in a piece."""
    return steers and (sign > 0) == (signs[p] == 0) if p < pieces else False


@njit(cache=True, inline="always")
def _margin(
    blocks: Array, knot_of: Array, count: int, knots: Array, is_pose: bool, rows: Array,
    vehicle: Array, tolerances: Array, s: Array, highs: Array, skipped: Array,
    halves: tuple[Array, Array], stack: Array, knot_at: Array, low: Array, high: Array,
    place: Array, ends: Array, pieces: int, signs: Array, out: Array,
) -> int:  # fmt: skip
    """Write the margin of a valid pair, sharpened; return the row it belongs to."""
    worst, steers = 0.0, vehicle[3] > 0
    for r in range(rows.shape[0]):
        if rows[r, SIGN] == 0:
            worst = max(worst, low[r])
    largest, which = 0.0, -1
    for r in range(rows.shape[0]):
        sign = rows[r, SIGN]
        for p in range(pieces if sign != 0 else 1):
            if sign != 0 and not _is_driven(sign, pieces, signs, steers, p):
                continue
            limit = max(worst, LEAST_WORST) * (1 + SHARPNESS)
            whole = sign == 0 or pieces == 1
            most = high[r]
            if most > limit or not whole:
                first, last = (NO, count) if sign == 0 else (ends[p, 0], ends[p, 1])
                reached, most, _ = refine(
                    blocks, knot_of, count, knots, is_pose, rows, r, vehicle,
                    tolerances, s, highs, skipped, halves, stack, knot_at, first, last,
                    limit, SHARPENING, NO, place[r],
                )  # fmt: skip
                worst = max(worst, reached)
            if most > largest:
                largest, which = most, r
    out[0] = max(1 - largest, -1e6)
    return which


@njit(cache=True, inline="always")
def _refusal(
    blocks: Array, knot_of: Array, count: int, knots: Array, is_pose: bool, rows: Array,
    order: Array, vehicle: Array, tolerances: Array, s: Array, highs: Array,
    skipped: Array, halves: tuple[Array, Array], stack: Array, knot_at: Array,
    low: Array, at: Array, place: Array, ends: Array, pieces: int, signs: Array,
    out: Array,
) -> tuple[int, int]:  # fmt: skip
    """Write what refuses a pair and the margin; return the verdict and the row."""
    steers = vehicle[3] > 0
    worst, which, rank, told = 0.0, -1, 0, 0.0
    there = np.empty(3)
    for r in range(rows.shape[0]):
        sign = rows[r, SIGN]
        for p in range(pieces if sign != 0 else 1):
            if sign != 0 and not _is_driven(sign, pieces, signs, steers, p):
                continue
            reached = low[r]
            if sign != 0 and (pieces > 1 or low[r] > KEPT):
                reached, _, _ = refine(
                    blocks, knot_of, count, knots, is_pose, rows, r, vehicle,
                    tolerances, s, highs, skipped, halves, stack, knot_at, ends[p, 0],
                    ends[p, 1], np.inf, NO, YES, place[r],
                )  # fmt: skip
            worst = max(worst, reached)
            if reached <= KEPT:
                continue
            ratio = _told(rows, r, reached)
            first = which < 0 or order[r] < rank
            if first or (order[r] == rank and ratio > told):
                which, rank, told = r, order[r], ratio
                there[:] = place[r]
    if which < 0:
        return UNCLEAR, -1
    if there[0] < 0:
        refine(
            blocks, knot_of, count, knots, is_pose, rows, which, vehicle, tolerances, s,
            highs, skipped, halves, stack, knot_at, at[which] * LANES,
            min(count, (at[which] + 1) * LANES), np.inf, NO, YES, there,
        )  # fmt: skip
    out[0] = max(1 - worst, -1e6)
    _describe(
        knots, is_pose, rows, which, vehicle, tolerances, s, there,
        1.0 if rows[which, SIGN] >= 0 else -1.0, out[1:],
    )  # fmt: skip
    return REFUSED, which


@njit(cache=True, nogil=True)
def judge_pairs(
    motions: tuple[Array, ...], start: int, stop: int, fleet: tuple[Array, ...],
    tolerances: Array, status: Array, which: Array, numbers: Array,
) -> None:  # fmt: skip
    """Judge motions start to stop - 1 for all vehicles of a fleet.

    Without a parallel loop, which would have all of this compiled twice: threads may
    each take some of the motions.

    Parameters
    ----------
    motions
        Blocks, knot_of, first, count, knots, is_pose of `Motions`; `groups_of` them.
    start, stop : int
    fleet : bodies, rows, order, first of `Fleet`
    tolerances : (4,) float
        Standstill in m/s, sine of the slip angle, slip speed in m/s, alignment in rad.
    status : (m, n) uint8
        `UNCLEAR`, `VALID` or `REFUSED`.
    which : (m, n) int32
        The row that refuses a pair, or that the margin of a valid one belongs to; -1
        if there is none.
    numbers : (m, n, 4) float
        Margin; of a refused pair also time in s, value and bound.
    """
    blocks, knot_of, first, count, knots, is_pose, groups, first_group = motions
    bodies, rows, order, first_row = fleet
    most = 1
    for v in range(bodies.shape[0]):
        most = max(most, first_row[v + 1] - first_row[v])
    for n in range(start, stop):
        wide = LANES * (first[n + 1] - first[n])
        of_motion = groups[first_group[n] : first_group[n + 1]]
        room = (
            np.zeros(ROOM),
            np.empty(LANES * most * of_motion.shape[0]),
            np.empty(most),
            np.empty(most),
            np.empty(2 * LANES * most),
            np.empty(wide * most),
            np.empty(wide // LANES * most),
            (np.empty((HALVES * wide, FIELDS)), np.zeros(HALVES * wide, np.bool_)),
            np.empty(most),
            np.empty(most),
            np.empty(most, np.int64),
            np.empty((most, 3)),
            np.empty((STACK, 4)),
            np.empty(STACK, np.int64),
            np.empty((MAX_PIECES, 2), np.int64),
            np.empty((MAX_PIECES, 2, 3)),
            np.empty(MAX_PIECES, np.int64),
        )
        for v in range(bodies.shape[0]):
            a, b = first_row[v], first_row[v + 1]
            status[n, v], which[n, v] = _judge(
                blocks[first[n] : first[n + 1]], of_motion, knot_of[first[n]
                : first[n + 1]], count[n], knots, is_pose[n], rows[a:b], order[a:b],
                bodies[v], tolerances, room, numbers[n, v],
            )  # fmt: skip
            if which[n, v] >= 0:
                which[n, v] += a
