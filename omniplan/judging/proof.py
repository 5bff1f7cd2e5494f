"""Halving the parts of a motion until every limit is decided on every part."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from omniplan.judging.chords import Chord, ends_moving, speed_of
from omniplan.judging.rows import Judge, Row, Tolerances
from omniplan.motion import Enclosure, Intervals, Motion

__all__ = ["Parts", "Piece", "Proof", "refused"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
SignArray = npt.NDArray[np.int64]
IntArray = npt.NDArray[np.int64]
Bounds: TypeAlias = dict[int, FloatArray]

ROUNDING = 1e-12
"""A limit counts as kept up to this relative excess: the rounding of float64."""
RESOLUTION = 1e-6
"""Parts are halved until low and high utilisation differ by less than this ..."""
MAX_HALVINGS = 24
"""... or this often ..."""
MAX_PARTS = 30_000
"""... or until there are so many more than there were; what is undecided then is
refused."""
AT_ONCE = 64
"""Of so many new parts or fewer the halves are judged as well."""
SHARPNESS = 1e-3
"""How sharply the worst utilisation is determined, relative ..."""
SHARPENING_HALVINGS = 10
"""... unless that takes more halvings than this."""


@dataclass(frozen=True)
class Piece:
    """What lies between two standstills: parts first to last."""

    first: int
    last: int


@dataclass(frozen=True)
class Parts:
    """The m parts of a motion and what is known about them."""

    spans: Intervals
    enclosure: Enclosure
    stands: BoolArray
    """(m,) whether the vehicle stands all over a part."""
    low: Bounds
    """(m, rows) utilisation that is reached, per representation."""
    high: Bounds
    """(m, rows) utilisation that is never exceeded."""
    angles: dict[int, tuple[FloatArray, FloatArray]] = field(default_factory=dict)
    """Followed steering angles at both ends, (m,) rad, by the row of the wheel's range;
    of wheels that can wind on, once it is chosen how they start."""

    def pieces(self) -> list[Piece]:
        """Return the runs of parts on which the vehicle moves."""
        moving = np.flatnonzero(~self.stands)
        if not moving.size:
            return []
        breaks = np.flatnonzero(np.diff(moving) > 1)
        firsts = moving[np.concatenate([[0], breaks + 1])]
        lasts = moving[np.concatenate([breaks, [moving.size - 1]])]
        return [Piece(int(a), int(b)) for a, b in zip(firsts, lasts, strict=True)]

    def merged(self, others: Parts, spans: Intervals, order: IntArray) -> Parts:
        """Return parts of both: these and then the others, in a new order.

        Parameters
        ----------
        others : Parts
            Of the same motion.
        spans : Intervals
            Of the parts in their new order, (n,).
        order : (n,) int
            Indices into all of them.
        """

        def picked(ours: Bounds, theirs: Bounds) -> Bounds:
            return {s: np.concatenate([ours[s], theirs[s]])[order] for s in ours}

        return Parts(
            spans,
            self.enclosure.merged(others.enclosure, order),
            np.concatenate([self.stands, others.stands])[order],
            picked(self.low, others.low),
            picked(self.high, others.high),
        )

    def taken(self, spans: Intervals, rows: IntArray) -> Parts:
        """Return some of the parts.

        Parameters
        ----------
        spans : Intervals
            Of those.
        rows : (n,) int
        """
        return Parts(
            spans,
            self.enclosure.rows(rows),
            self.stands[rows],
            {s: low[rows] for s, low in self.low.items()},
            {s: high[rows] for s, high in self.high.items()},
        )

    def picked(self, sign: SignArray) -> tuple[FloatArray, FloatArray]:
        """Return low and high of the representation chosen for each part.

        Parameters
        ----------
        sign : (m,) int, {-1, 1}
        """
        if len(self.low) == 1:
            return self.low[1], self.high[1]
        forward = (sign > 0)[:, None]
        return (
            np.where(forward, self.low[1], self.low[-1]),
            np.where(forward, self.high[1], self.high[-1]),
        )


def refused(low: FloatArray, high: FloatArray, rows: Sequence[Row]) -> BoolArray:
    """Return which limits are broken, or may be on parts that surely break none.

    Parameters
    ----------
    low, high : (m, rows) float
        Utilisations of the parts, decided.
    rows : sequence of Row

    Returns
    -------
    refused : (m, rows) bool
    """
    broken = low > 1 + ROUNDING
    # Where one limit is surely broken the others were not pursued to the end.
    open_ = (high > 1 + ROUNDING) & ~broken.any(axis=1, keepdims=True)
    # With the centre of rotation on a wheel nothing more can be said of the wheel.
    open_ &= np.isfinite(high) | np.array([row.bound == 0 for row in rows], dtype=bool)
    return np.asarray(broken | open_, dtype=bool)


class Proof:
    """Parts of one motion under one judge, refined step by step."""

    def __init__(
        self,
        motion: Motion,
        judge: Judge,
        tolerances: Tolerances,
        max_parts: int | None = None,
        *,
        cuts: Sequence[BoolArray] = (),
        checkpoint: Callable[[], None] | None = None,
    ) -> None:
        """Take a motion and who judges it.

        Parameters
        ----------
        motion : Motion
        judge : Judge
        tolerances : Tolerances
        max_parts : int, optional
            How many more parts there may be than the motion has intervals.
        cuts : sequence of (m,) bool
            Which parts are halved to begin with, one after the other: `cuts` of a proof
            of the same motion at another speed.
        checkpoint : callable, optional
            Called before parts are judged; what it raises ends the proof.
        """
        self._max_parts = MAX_PARTS if max_parts is None else max_parts
        self.motion, self._judge, self._tolerances = motion, judge, tolerances
        self.is_own = motion.is_own
        ambiguous = judge.needs_configuration and not motion.is_own
        self.signs: tuple[int, ...] = (1, -1) if ambiguous else (1,)
        self._free_at_rest = np.array([row.is_free_at_rest for row in judge.rows])
        self._is_shape = np.array([row.scaling == "none" for row in judge.rows])
        self._checkpoint = checkpoint
        self._ahead: _Ahead | None = None
        spans = self._whole = motion.intervals()
        self._step = spans.t1 - spans.t0
        self.cuts: list[BoolArray] = []
        """Which parts were halved, one after the other."""
        if cuts and cuts[0].size == spans.t0.size:
            self.cuts += cuts
        for need in self.cuts:
            spans = spans.halved(need)
        self.parts = self.evaluate(spans)
        if not self.cuts:
            self.first = self.parts

    @cached_property
    def first(self) -> Parts:
        """The intervals of the motion, uncut."""
        return self.evaluate(self._whole)

    def evaluate(self, spans: Intervals) -> Parts:
        """Return what is known of parts of the motion.

        Parameters
        ----------
        spans : Intervals
        """
        if self._checkpoint is not None:
            self._checkpoint()
        part = self.motion.enclose(spans)
        body = Chord.of(part, self._judge.reference)
        speed = speed_of(part, body, self._judge.kappa_g)[1] * part.scale_high
        stands = (speed <= self._tolerances.standstill) & (not self.motion.is_own)
        low, high = {}, {}
        for sign, bounds in self._judge.utilisations(part, self.signs).items():
            low[sign], high[sign] = bounds
            # At rest the wheels may stand anyhow; how they turn is judged apart.
            if stands.any():
                for each in bounds:
                    each[np.ix_(stands, self._free_at_rest)] = 0.0
        return Parts(spans, part, stands, low, high)

    def decide(self) -> None:
        """Halve parts until every representation is proved or broken on them."""
        self._halve(self._undecided, MAX_HALVINGS)

    def _undecided(self, parts: Parts) -> BoolArray:
        need = np.zeros(parts.stands.shape, dtype=bool)
        for sign in self.signs:
            low, high = parts.low[sign], parts.high[sign]
            broken = low > 1 + ROUNDING
            with np.errstate(invalid="ignore"):
                is_open = (high > 1 + ROUNDING) & ~broken & (high - low > RESOLUTION)
            # A part that breaks one limit is refused whatever the others say. But what
            # slower driving mends must not hide what it does not: that decides which
            # representation is driven.
            need |= is_open.any(axis=1) & ~broken.any(axis=1)
            shape_open = is_open[:, self._is_shape].any(axis=1)
            need |= shape_open & ~broken[:, self._is_shape].any(axis=1)
        return need

    def separate(self) -> None:
        """Halve parts beside a moment of rest until one of them stands all along.

        A motion may pass through rest without pausing there. What lies before and
        after are two pieces, wherever parts are halved for the sake of a limit.
        """
        if not self.is_own:
            self._halve(self._beside_rest, MAX_HALVINGS)

    def _beside_rest(self, parts: Parts) -> BoolArray:
        e, kappa_g = parts.enclosure, self._judge.kappa_g
        body = Chord.of(e, self._judge.reference)
        starts, ends = ends_moving(e, body, kappa_g, self._tolerances.standstill)
        rests = (ends[:-1] == 0) & (starts[1:] == 0)
        rests &= ~parts.stands[:-1] & ~parts.stands[1:]
        need = np.zeros(parts.stands.shape, dtype=bool)
        need[:-1] |= rests
        need[1:] |= rests
        return need

    def sharpen(self, sign_of: Callable[[Intervals], SignArray]) -> None:
        """Halve the parts that may hold the worst utilisation, until it is sharp.

        Parameters
        ----------
        sign_of : callable
            The representation chosen for each part.
        """
        scales = np.array([row.scaling != "none" for row in self._judge.rows])

        def blunt(parts: Parts) -> BoolArray:
            low, high = parts.picked(sign_of(parts.spans))
            finite = np.isfinite(high) & np.isfinite(low)
            low = np.where(finite, low, 0.0)
            # What can be driven faster is compared among itself: it sets the factor.
            worst = np.where(
                scales,
                low[:, scales].max(initial=0.05),
                low[:, ~scales].max(initial=0.05),
            )
            return np.asarray((finite & (high > worst * (1 + SHARPNESS))).any(axis=1))

        self._halve(blunt, SHARPENING_HALVINGS)

    def refine(
        self, wanted: Callable[[Parts], BoolArray], halvings: int = MAX_HALVINGS
    ) -> None:
        """Halve parts as long as they are wanted finer.

        Parameters
        ----------
        wanted : callable
            From parts to (m,) bool.
        halvings : int
            At most this often.
        """
        self._halve(wanted, halvings)

    def _halve(self, wanted: Callable[[Parts], BoolArray], halvings: int) -> None:
        smallest = self._step / 2**halvings
        while True:
            need = wanted(self.parts)
            spans = self.parts.spans
            need &= spans.t1 - spans.t0 > smallest[spans.knot]
            more = need.size + np.count_nonzero(need) - self._step.size
            if not need.any() or more > self._max_parts:
                return
            self.cuts.append(need)
            self.parts = self._halved(need)

    def _halved(self, need: BoolArray) -> Parts:
        """Return the parts with those of `need` cut in two; the others are kept."""
        spans, halves = self.parts.spans, np.where(need, 2, 1)
        # Both halves of part i count as part i; new ones follow after all old ones.
        origin = np.repeat(np.arange(need.size), halves)
        is_new = need[origin]
        order = np.where(is_new, need.size + np.cumsum(is_new) - 1, origin)
        spans = spans.halved(need)
        new = Intervals(spans.knot[is_new], spans.t0[is_new], spans.t1[is_new])
        return self.parts.merged(self._halves(need, new, is_new), spans, order)

    def _halves(self, need: BoolArray, new: Intervals, is_new: BoolArray) -> Parts:
        """Return the new halves, which may have been judged in the last round.

        Where few parts are judged it hardly takes longer to judge more of them at once,
        so their own halves are judged with them: those that are halved again have
        mostly just been made.
        """
        ahead, self._ahead = self._ahead, None
        if ahead is not None:
            rows = ahead.first[need]
            if (rows >= 0).all():
                return ahead.parts.taken(new, np.stack([rows, rows + 1], -1).ravel())
        if new.t0.size > AT_ONCE:
            return self.evaluate(new)
        quarters = new.halved(np.ones(new.t0.shape, dtype=bool))
        both = self.evaluate(new.joined(quarters))
        first = np.full(is_new.shape, -1)
        first[is_new] = new.t0.size + 2 * np.arange(new.t0.size)
        self._ahead = _Ahead(both, first)
        return both.taken(new, np.arange(new.t0.size))


@dataclass(frozen=True, eq=False)
class _Ahead:
    """Halves that were judged before it was known whether they are needed."""

    parts: Parts
    first: IntArray
    """(m,) where the two halves of each part are, -1: nowhere."""
