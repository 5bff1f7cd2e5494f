"""Verdicts on pairs of a motion and a vehicle, in numba.

The same proof as in `proof` and `standstill`, told apart by rows: what a row may reach
at most over all parts either keeps the limit, or the parts in question are halved until
it is decided. A pair is left to `validate` (`UNCLEAR`) where a limit can neither be
proved kept nor broken, or a change of configuration at a standstill asks for a search.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from omniplan.batch.chords import LOW, NA, ROOM
from omniplan.batch.groups import PER_ROW
from omniplan.batch.headline import FINEST, count_faults, headline, is_driven, told
from omniplan.batch.kernel import kernel
from omniplan.batch.kinds import (
    ANGLE,
    BOUND,
    KIND,
    OWN_RANGE,
    PARALLEL,
    RANGE,
    SIGN,
    SINGULAR,
    SLIP,
)
from omniplan.batch.motions import FIELDS, LANES
from omniplan.batch.pieces import MAX_PIECES, angle_of, choose, pieces_of
from omniplan.batch.reaches import mark_lost
from omniplan.batch.refine import (
    HALVES,
    KEPT,
    NO,
    STACK,
    YES,
    angle_error,
    describe,
    refine,
    sweep,
)
from omniplan.batch.rests import CHANGES
from omniplan.batch.swings import is_swinging, widened
from omniplan.judging.proof import MAX_HALVINGS, SHARPENING_HALVINGS, SHARPNESS
from omniplan.report import SHAPE_LIMITS
from omniplan.standing.standstill import UNREACHABLE

__all__ = ["REFUSED", "UNCLEAR", "VALID", "judge_pairs"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

UNCLEAR, VALID, REFUSED = 0, 1, 2
"""What is said of a pair; unclear ones are left to `validate`."""

PROVING, SHARPENING = np.int64(MAX_HALVINGS), np.int64(SHARPENING_HALVINGS)
STANDING = np.int64(SHAPE_LIMITS.index("RECONFIGURATION"))
BEYOND = np.int64(SHAPE_LIMITS.index("UNREACHABLE"))
"""Rank of what is told of a standstill that is too short, and of a piece that is apart.
"""
LEAST_WORST = 0.05
"""Utilisations below this are not sharpened, as in `Proof.sharpen`."""


@kernel(inline="always")
def _describe(
    knots: Array, form: int, rows: Array, r: int, vehicle: Array,
    tolerances: Array, s: Array, place: Array, sign: float, out: Array,
) -> None:  # fmt: skip
    """Write time, value and bound of a row at the worse end of a part."""
    k = describe(
        knots[int(place[0])], form, rows[r : r + 1], vehicle, tolerances, s,
        (place[1], place[2]),
    )  # fmt: skip
    out[0] = place[1 + k]
    ratio = s[LOW + k]
    if rows[r, KIND] == SINGULAR:
        out[1], out[2] = s[NA + k], 0.0
    elif rows[r, KIND] == RANGE or rows[r, KIND] == OWN_RANGE:
        aside = angle_of(s, k, False, sign, rows[r, ANGLE])
        out[1], out[2] = (
            rows[r, ANGLE] + aside,
            rows[r, ANGLE] + math.copysign(rows[r, BOUND], aside),
        )
    elif rows[r, KIND] == SLIP or rows[r, KIND] == PARALLEL:
        out[2] = math.asin(rows[r, BOUND])
        out[1] = told(rows, r, ratio) * out[2]
    else:
        out[1], out[2] = ratio * rows[r, BOUND], rows[r, BOUND]


@kernel(inline="always")
def _settled(
    blocks: Array, knot_of: Array, count: int, knots: Array, form: int, rows: Array,
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
            blocks, knot_of, count, knots, form, rows, r, vehicle, tolerances, s,
            highs, skipped, halves, stack, knot_at, NO, count, KEPT, PROVING, NO,
            place[r],
        )  # fmt: skip
        if low[r] > KEPT:
            broken = True
        elif not is_clear and not broken:
            return False
    for p in range(pieces):
        for side in range(2):
            for i in range(3):
                by_piece[p, side, i] = 0.0
    for r in range(rows.shape[0]):
        if rows[r, SIGN] == 0:
            continue
        side = 0 if rows[r, SIGN] > 0 else 1
        error = angle_error(rows, r)
        for p in range(pieces):
            known = high[r] + error <= KEPT or low[r] - error > KEPT
            if pieces == 1 and known:
                reached, most, is_clear = low[r], high[r], True
            else:
                reached, most, is_clear = refine(
                    blocks, knot_of, count, knots, form, rows, r, vehicle,
                    tolerances, s, highs, skipped, halves, stack, knot_at, ends[p, 0],
                    ends[p, 1], KEPT, PROVING, YES, place[r],
                )  # fmt: skip
            if not is_clear and (not broken or rows[r, KIND] == RANGE):
                return False
            if reached > KEPT:
                by_piece[p, side, 0] += 1
            by_piece[p, side, 1] = max(by_piece[p, side, 1], reached)
            by_piece[p, side, 2] = max(by_piece[p, side, 2], most)
    return True


@kernel(inline="always")
def _judge(
    blocks: Array, groups: Array, knot_of: Array, count: int, knots: Array,
    form: int, samples: tuple[Array, ...], rows: Array, order: Array, own_rows: Array,
    cells: Array, vehicle: Array, tolerances: Array, room: tuple[Array, ...],
    out: Array,
) -> tuple[int, int]:  # fmt: skip
    """Return the verdict on one pair, and the row that tells it.

    `out` gets the margin, then time, value and bound of the row that refuses.
    """
    (
        s, crest, chosen, state, most, highs, skipped, halves, low, high, place, stack,
        knot_at, ends, by_piece, signs, changes,
    ) = room  # fmt: skip
    n_rows = rows.shape[0]
    pieces = 1
    ends[0, 0], ends[0, 1], signs[0] = 0, count, 0
    if vehicle[3] > 0:
        pieces = pieces_of(
            blocks, knot_of, knots, form, count, vehicle, tolerances, s, ends
        )
        if pieces < 0:
            return UNCLEAR, -1
    sweep(
        blocks, groups, rows, order, vehicle, tolerances, s, crest, chosen, state, most,
        highs, skipped, low, high,
    )  # fmt: skip
    for r in range(n_rows):
        place[r, 0] = -1.0
    if not _settled(
        blocks, knot_of, count, knots, form, rows, vehicle, tolerances, s, highs,
        skipped, halves, stack, knot_at, low, high, place, ends, pieces, by_piece,
    ):  # fmt: skip
        return UNCLEAR, -1
    if vehicle[3] > 0:
        count_faults(
            blocks, samples, rows, vehicle, tolerances, s, highs, skipped, high, ends,
            pieces, by_piece,
        )  # fmt: skip
    if vehicle[7] > 0 and not mark_lost(
        blocks, knot_of, knots, rows, cells, vehicle, ends, pieces, low, by_piece
    ):
        return UNCLEAR, -1
    if vehicle[3] > 0 and not choose(
        blocks, knot_of, knots, form, rows, own_rows, vehicle, tolerances, s, ends,
        pieces, by_piece, changes, signs,
    ):  # fmt: skip
        return UNCLEAR, -1
    keeps, apart = True, -1
    for r in range(n_rows):
        if rows[r, SIGN] == 0 and low[r] > KEPT:
            keeps = False
    for p in range(pieces):
        faults = by_piece[p, signs[p], 0] if vehicle[3] > 0 else 0.0
        if faults == UNREACHABLE:
            apart = p if apart < 0 else apart
        elif faults > 0:
            keeps = False
    short, used = _shortest(changes, signs, pieces)
    is_valid, which = keeps and used <= 1, -1
    out[0] = 1.0
    if is_valid:
        which = _margin(
            blocks, knot_of, count, knots, form, rows, vehicle, tolerances, s, highs,
            skipped, halves, stack, knot_at, low, high, place, ends, pieces, signs, out,
        )  # fmt: skip
    elif not keeps:
        # What stands for a whole piece or a standstill comes before what is broken
        # between samples only.
        finest = FINEST if apart < 0 and not 1 < used < np.inf else 0
        which = _refusal(
            blocks, knot_of, knots, form, samples, rows, order, vehicle, tolerances, s,
            highs, skipped, stack, knot_at, low, high, place, ends, pieces, by_piece,
            signs, finest, out,
        )  # fmt: skip
        if which < 0 and finest > 0:
            return UNCLEAR, -1
    if used > 1 - out[0]:
        out[0] = max(1 - used, -1e6)
        which = 2 * n_rows + 1 if is_valid else which
    if apart >= 0 and (is_valid or which < 0 or order[which, 0] > BEYOND):
        part = ends[apart, 0]
        out[1], out[3] = blocks[part // LANES, 15, part % LANES], 0.0
        return REFUSED, 2 * n_rows
    if used > 1:
        change = changes[short, signs[short], signs[short + 1]]
        told: tuple[int, int] = _too_short(rows, order, change, used, which, out)
        return told
    return (VALID if is_valid else REFUSED), which


@kernel()
def _shortest(changes: Array, signs: Array, pieces: int) -> tuple[int, float]:
    """Return the standstill that is used most, and its share of the time there is."""
    short, used, telling = -1, 0.0, 0.0
    for p in range(pieces - 1):
        change = changes[p, signs[p], signs[p + 1]]
        share = change[1] / max(change[2], 1e-9) if change[1] > 0.0 else 0.0
        # A time that is too long tells more than that no way was found.
        tells = share if share < np.inf else 1 + 1e-12
        if tells > telling:
            short, used, telling = p, share, tells
    return short, used


@kernel()
def _too_short(
    rows: Array, order: Array, change: Array, used: float, which: int, out: Array
) -> tuple[int, int]:
    """Write that the wheels have too little time, unless something else tells more."""
    n_rows, is_proved = rows.shape[0], used < np.inf
    if which >= 0 and (order[which, 0] < STANDING or not is_proved):
        return REFUSED, which
    out[1], out[3] = change[3], change[2]
    out[2] = change[1] if is_proved else np.nan
    wheel = np.int64(change[4])
    for r in range(n_rows):
        if rows[r, KIND] == SINGULAR:
            if wheel == 0:
                return REFUSED, n_rows + r
            wheel -= 1
    return REFUSED, 2 * n_rows + 1


@kernel(inline="always")
def _margin(
    blocks: Array, knot_of: Array, count: int, knots: Array, form: int, rows: Array,
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
            if sign != 0 and not is_driven(sign, pieces, signs, steers, p):
                continue
            limit = max(worst, LEAST_WORST) * (1 + SHARPNESS)
            whole = sign == 0 or pieces == 1
            most = high[r]
            if most > limit or not whole:
                first, last = (NO, count) if sign == 0 else (ends[p, 0], ends[p, 1])
                reached, most, _ = refine(
                    blocks, knot_of, count, knots, form, rows, r, vehicle,
                    tolerances, s, highs, skipped, halves, stack, knot_at, first, last,
                    limit, SHARPENING, NO, place[r],
                )  # fmt: skip
                worst = max(worst, reached)
            if most > largest:
                largest, which = most, r
    out[0] = max(1 - largest, -1e6)
    return which


@kernel(inline="always")
def _refusal(
    blocks: Array, knot_of: Array, knots: Array, form: int, samples: tuple[Array, ...],
    rows: Array, order: Array, vehicle: Array, tolerances: Array, s: Array,
    highs: Array, skipped: Array, stack: Array, knot_at: Array, low: Array, high: Array,
    place: Array, ends: Array, pieces: int, by_piece: Array, signs: Array, finest: int,
    out: Array,
) -> int:  # fmt: skip
    """Write the margin and what refuses a pair; return the row of `headline`."""
    which: int
    which, worst = headline(
        blocks, knot_of, knots, form, samples, rows, order, vehicle, tolerances, s,
        highs, skipped, stack, knot_at, high, place, ends, pieces, signs, finest,
    )  # fmt: skip
    for r in range(rows.shape[0]):
        if rows[r, SIGN] == 0:
            worst = max(worst, low[r])
    for p in range(pieces if vehicle[3] > 0 else 0):
        worst = max(worst, by_piece[p, signs[p], 1])
    out[0] = max(1 - worst, -1e6)
    if which >= 0:
        _describe(
            knots, form, rows, which, vehicle, tolerances, s, place[rows.shape[0]],
            1.0 if rows[which, SIGN] >= 0 else -1.0, out[1:],
        )  # fmt: skip
    return which


@kernel()
def _judge_motion(
    blocks: Array, groups: Array, knot_of: Array, count: int, knots: Array, form: int,
    samples: tuple[Array, ...], fleet: tuple[Array, ...], tolerances: Array,
    room: tuple[Array, ...], status: Array, which: Array, numbers: Array,
) -> None:  # fmt: skip
    """Judge one motion for all vehicles."""
    bodies, rows, order, first_row, own_rows, first_own, cells, first_cell = fleet
    for v in range(bodies.shape[0]):
        a, b = first_row[v], first_row[v + 1]
        c, d = first_own[v], first_own[v + 1]
        e, f = first_cell[v], first_cell[v + 1]
        status[v], which[v] = _judge(
            blocks, groups, knot_of, count, knots, form, samples, rows[a:b], order[a:b],
            own_rows[c:d], cells[e:f], bodies[v], tolerances, room, numbers[v],
        )  # fmt: skip
        # Numbers of `Fleet.told`: rows, then their wheels at rest, then what has none.
        if which[v] >= 2 * (b - a):
            which[v] += 2 * (rows.shape[0] - (b - a))
        elif which[v] >= b - a:
            which[v] += rows.shape[0] - (b - a) + a
        elif which[v] >= 0:
            which[v] += a


@njit(cache=True, nogil=True)
def judge_pairs(
    motions: tuple[Array, ...], fleet: tuple[Array, ...], tolerances: Array,
    status: Array, which: Array, numbers: Array,
) -> None:  # fmt: skip
    """Judge motions for all vehicles of a fleet.

    Without a parallel loop, which would have all of this compiled twice: threads may
    each take some of the motions.

    Parameters
    ----------
    motions
        `Motions.arrays` and `Motions.samples`; `groups_of` them.
    fleet : `arrays` of `Fleet`
    tolerances : (4,) float
        Standstill in m/s, sine of the slip angle, slip speed in m/s, alignment in rad.
    status : (m, n) uint8
        `UNCLEAR`, `VALID` or `REFUSED`.
    which : (m, n) int32
        What refuses a pair, or what the margin of a valid one belongs to, by its number
        in `Fleet.told`; -1 if there is none.
    numbers : (m, n, 4) float
        Margin; of a refused pair also time in s, value and bound.
    """
    blocks, knot_of, first, count, knots, forms, samples, groups, first_group = motions
    is_plain, wholes, whole_knot, first_whole = samples
    rows, first_row = fleet[1], fleet[3]
    most, swings = 1, is_swinging(rows)
    for v in range(first_row.size - 1):
        most = max(most, first_row[v + 1] - first_row[v])
    for n in range(forms.size):
        wide = LANES * (first[n + 1] - first[n])
        parts = blocks[first[n] : first[n + 1]]
        uncut = slice(first_whole[n], first_whole[n + 1])
        others, their_knot = wholes[uncut], whole_knot[uncut]
        if swings:
            parts = widened(parts, knot_of[first[n] : first[n + 1]], knots, forms[n])
            others = widened(others, their_knot, knots, forms[n])
        all_others = np.ones(others.shape[0], np.bool_)
        of_samples = (is_plain[first[n] : first[n + 1]], others, their_knot, all_others)
        of_motion = groups[first_group[n] : first_group[n + 1]]
        room = (
            np.zeros(ROOM),
            np.empty((PER_ROW * of_motion.shape[0], 2)),
            np.empty(most + 1),
            np.empty(most),
            np.empty(2 * LANES * most),
            np.empty(wide * most),
            np.empty((most, PER_ROW * of_motion.shape[0])),
            (np.empty((HALVES * wide, FIELDS)), np.zeros(HALVES * wide, np.bool_)),
            np.empty(most),
            np.empty(most),
            np.empty((most + 2, 3)),
            np.empty((STACK + LANES, 4)),
            np.empty(STACK + LANES, np.int64),
            np.empty((MAX_PIECES, 2), np.int64),
            np.empty((MAX_PIECES, 2, 3)),
            np.empty(MAX_PIECES, np.int64),
            np.empty((MAX_PIECES, 2, 2, CHANGES)),
        )
        _judge_motion(
            parts, of_motion, knot_of[first[n] : first[n + 1]], count[n], knots,
            forms[n], of_samples, fleet, tolerances, room, status[n], which[n],
            numbers[n],
        )  # fmt: skip
