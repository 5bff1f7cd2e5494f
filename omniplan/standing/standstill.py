"""Which of its two representations each piece of a motion is driven in.

A piece is what lies between two standstills. Within it the configuration is continuous
and v_s keeps its sign; at a standstill the wheels may be brought into another
configuration, inside the space and in the time there is. Wheels that can wind on are
followed throughout: how often each has turned at the start is chosen as well.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from configspace import PermissibleSpace
from configspace.omni_curve import curvature_of_ratio
from omniplan.judging.proof import ROUNDING, Parts, Piece, Proof, refused
from omniplan.judging.rows import Judge, Row, Tolerances
from omniplan.motion import Intervals
from omniplan.standing.reach import is_apart
from omniplan.standing.rest import Edge, edge_of
from omniplan.standing.ways import Change, Changer, Configuration, Way
from omniplan.standing.winding import Anchor, Sweep, sweeps_of, unsettled
from omniplan.standing.winding_search import SHORT_REST, Track

__all__ = ["Apart", "Choice", "Reconfiguration", "Standstill", "choose_configurations"]

UNREACHABLE = 0.75
"""What a piece that is apart counts where a broken limit counts 1: of two refusals the
one of a permitted configuration tells more."""
BETWEEN = 0.875
"""What a piece counts that breaks limits between the samples only."""
ROUNDED = 1e-3
"""Slower than this share of what counts as standing no direction is told."""
MAX_LABELS = 8
"""So many ways to have come to a piece are kept for each representation."""


@dataclass(frozen=True)
class Reconfiguration:
    """Getting from one configuration to another at a standstill."""

    start: Configuration
    """(κ_n, β) before, 1 and rad."""
    goal: Configuration
    """(κ_n, β) after, 1 and rad."""
    time: float
    """Time it takes, s; infinite if no way inside the space was found."""
    wheel: int
    """The wheel that turns furthest or unwinds longest, -1 if unknown."""
    turn: float
    """By how much that wheel turns, full turns that it unwinds included, rad."""


@dataclass(frozen=True)
class Standstill:
    """A stretch at rest between two pieces, and what happens there."""

    t0: float
    t1: float
    change: Reconfiguration
    between: tuple[float, float]
    """End and start of the parts on which the vehicle moves, s: between t0 and t1, or
    a little beyond, depending on where the motion is cut."""

    @property
    def is_short(self) -> bool:
        """Whether there is less time than the wheels need."""
        return self.change.time > self.t1 - self.t0


@dataclass(frozen=True)
class Apart:
    """A piece for sure in another component of the space than straight ahead."""

    t0: float
    t1: float
    start: Configuration


@dataclass(frozen=True)
class Choice:
    """The representation of every piece."""

    signs: tuple[int, ...]
    standstills: tuple[Standstill, ...]
    """Between consecutive pieces."""
    anchors: tuple[Anchor, ...] = ()
    """Where the winding wheels stand, one per piece; none if no wheel winds."""
    apart: tuple[Apart, ...] = ()

    def piece_of(self, spans: Intervals) -> npt.NDArray[np.int64]:
        """Return the piece of each part."""
        cuts = [sum(stop.between) / 2 for stop in self.standstills]
        return np.searchsorted(cuts, (spans.t0 + spans.t1) / 2)

    def sign_of(self, spans: Intervals) -> npt.NDArray[np.int64]:
        """Return the representation of each part."""
        return np.asarray(np.array(self.signs)[self.piece_of(spans)])


@dataclass(frozen=True)
class _Option:
    """One piece in one representation."""

    cost: float
    """Number of limits that are broken."""
    sweeps: tuple[Sweep, ...]


@dataclass(frozen=True)
class _Label:
    """One way to have come to a piece."""

    signs: tuple[int, ...]
    ways: tuple[Way, ...]
    cost: float
    """Without that of the winding wheels."""
    tracks: tuple[Track, ...]

    @property
    def total(self) -> float:
        return self.cost + sum(track.least for track in self.tracks)

    @property
    def preference(self) -> tuple[float, tuple[int, ...]]:
        """Order by cost; among equals driving forwards comes first."""
        return self.total, tuple(-sign for sign in self.signs)

    def is_no_better(self, other: _Label) -> bool:
        """Return whether another label is as good, however it goes on."""
        return other.cost <= self.cost and all(
            bool((theirs.cost <= ours.cost).all())
            for theirs, ours in zip(other.tracks, self.tracks, strict=True)
        )


def choose_configurations(
    proof: Proof,
    judge: Judge,
    space: PermissibleSpace,
    tolerances: Tolerances,
    *,
    allow_unreachable: bool = False,
) -> Choice:
    """Choose representations with the fewest violations, then the shortest waits.

    Parameters
    ----------
    proof : Proof
        Decided; refined until it is known how far wheels wind.
    judge : Judge
    space : PermissibleSpace
    tolerances : Tolerances
    allow_unreachable : bool
        Whether pieces may lie in another component than straight ahead.
    """
    wheels = judge.winding_wheels
    proof.refine(lambda parts: unsettled(parts, wheels))
    parts, pieces = proof.parts, proof.parts.pieces()
    if not pieces:
        return Choice((1,), ())

    @cache
    def lost(i: int, sign: int) -> bool:
        """Return whether a piece is refused for where it lies."""
        if allow_unreachable:
            return False
        return is_apart(parts, pieces[i], sign, judge, space)

    if not judge.needs_configuration:
        return Choice(
            (1,), (), (), _apart(parts, pieces, [1] * len(pieces), judge, lost)
        )
    options = _options(proof, judge, pieces, lost, sweeps_of(parts, pieces, wheels))
    changer = _Changes(
        proof, pieces, judge, Changer(judge, space, tolerances), tolerances
    )
    best = _best(options, changer, judge)
    return Choice(
        best.signs,
        _standstills(best, changer, judge),
        _anchors(best) if wheels else (),
        _apart(parts, pieces, best.signs, judge, lost),
    )


def _options(
    proof: Proof,
    judge: Judge,
    pieces: Sequence[Piece],
    lost: Callable[[int, int], bool],
    sweeps: Sequence[tuple[Sweep, ...]],
) -> list[dict[int, _Option]]:
    """Return the representations of every piece that are worth a look.

    Only the best of a piece can be part of the best sequence that is valid, and looking
    for ways between configurations is dear.
    """
    parts, whole, options = proof.parts, proof.motion.intervals(), []
    gaps = itertools.pairwise(pieces)
    cuts = [(parts.spans.t1[a.last] + parts.spans.t0[b.first]) / 2 for a, b in gaps]
    piece_of = np.searchsorted(cuts, (whole.t0 + whole.t1) / 2)
    for i, (piece, swept) in enumerate(zip(pieces, sweeps, strict=True)):
        rows, own = slice(piece.first, piece.last + 1), piece_of == i
        broken = {s: _faults(proof, s, rows, own, judge.rows) for s in proof.signs}
        costs: dict[int, float] = {}
        for sign in sorted(broken, key=broken.__getitem__):
            # Where it lies takes time to find out, and may not matter any more.
            if broken[sign] <= min(costs.values(), default=np.inf):
                costs[sign] = broken[sign] + lost(i, sign) * UNREACHABLE
        least = min(costs.values())
        turned = {1: swept, -1: tuple(sweep.opposite() for sweep in swept)}
        options.append(
            {
                s: _Option(costs[s], turned[s])
                for s in proof.signs
                if costs.get(s) == least
            }
        )
    return options


def _faults(
    proof: Proof,
    sign: int,
    piece: slice,
    own: npt.NDArray[np.bool_],
    rows: Sequence[Row],
) -> float:
    """Return what a piece costs that breaks limits: their number, at the samples.

    What else is broken between them depends on where the motion was cut. `own` are the
    intervals between samples that belong to the piece.
    """
    parts = proof.parts
    if not refused(parts.low[sign][piece], parts.high[sign][piece], rows).any():
        return 0.0
    at_samples = proof.first.low[sign][own] > 1 + ROUNDING
    return float(at_samples.any(axis=0).sum()) or BETWEEN


class _Changes:
    """What may happen at the standstills between pieces."""

    def __init__(
        self,
        proof: Proof,
        pieces: Sequence[Piece],
        judge: Judge,
        changer: Changer,
        tolerances: Tolerances,
    ) -> None:
        self._proof, self._parts, self._pieces = proof, proof.parts, pieces
        self._judge, self._changer, self._tolerances = judge, changer, tolerances
        self._known: dict[tuple[int, int, int], Change] = {}
        self._edges: dict[int, tuple[Edge, Edge]] = {}

    def between(self, i: int) -> tuple[float, float]:
        """Return end and start of the moving parts around standstill i, s."""
        spans = self._parts.spans
        before, after = self._pieces[i], self._pieces[i + 1]
        return float(spans.t1[before.last]), float(spans.t0[after.first])

    def rest(self, i: int) -> tuple[float, float]:
        """Return start and end of the standstill after piece i, s."""
        start, end = self._edges_of(i)
        return start.t, end.t

    def time_for(self, i: int, way: Way) -> float:
        """Return the time there is for a way at standstill i, s.

        Where the wheels stay as they are it does not matter.
        """
        if way.time == 0 and not way.sweeps:
            return 0.0
        t0, t1 = self.rest(i)
        return t1 - t0

    def change(self, i: int, before: int, after: int) -> Change:
        """Return the change after piece i between two representations."""
        key = i, before, after
        if key not in self._known:
            judge = self._judge
            start, end = self._moving_edges(i)
            near = (
                _configuration(start, before, judge),
                _configuration(end, after, judge),
            )
            is_clear = self._is_clear(start) and self._is_clear(end)
            if not (is_clear and self._changer.stays(*near)):
                start, end = self._edges_of(i)
            self._known[key] = self._changer.change(
                _configuration(start, before, judge),
                _configuration(end, after, judge),
                end.t - start.t,
            )
        return self._known[key]

    def _is_clear(self, at: Edge) -> bool:
        """Return whether the wheels' directions are more than rounding there.

        A part that is refused may begin or end in the rest itself.
        """
        body = abs(at.v + 1j * at.omega * self._judge.reference)
        speed = max(body, abs(at.omega) / self._judge.kappa_g)
        return speed > ROUNDED * self._tolerances.standstill

    def _moving_edges(self, i: int) -> tuple[Edge, Edge]:
        """Return where the moving parts around standstill i end and begin."""
        before, after = self._pieces[i], self._pieces[i + 1]
        start = _edge(self._parts, before.last, at_end=True)
        return start, _edge(self._parts, after.first, at_end=False)

    def _edges_of(self, i: int) -> tuple[Edge, Edge]:
        """Return where standstill i begins and ends."""
        if i not in self._edges:
            knots = self._parts.spans.knot
            rows = self._pieces[i].last, self._pieces[i + 1].first
            found = [
                edge_of(
                    self._proof.motion,
                    self._judge,
                    self._tolerances.standstill,
                    int(knots[row]),
                    is_start=is_start,
                )
                or moving
                for row, moving, is_start in zip(
                    rows, self._moving_edges(i), (True, False), strict=True
                )
            ]
            self._edges[i] = found[0], found[1]
        return self._edges[i]


def _best(
    options: Sequence[dict[int, _Option]], changes: _Changes, judge: Judge
) -> _Label:
    """Return the best sequence of representations and ways (dynamic programme)."""
    wheels = judge.winding_wheels
    labels = [
        _Label(
            (sign,),
            (),
            option.cost,
            tuple(map(Track.begin, wheels, option.sweeps)),
        )
        for sign, option in options[0].items()
    ]
    for i, present in enumerate(options[1:]):
        labels = [
            kept
            for sign, option in present.items()
            for kept in _kept(
                _extended(label, way, sign, option, changes.time_for(i, way))
                for label in _worthwhile(labels, sign, i, changes, judge)
                for way in changes.change(i, label.signs[-1], sign).ways
            )
        ]
    return min(labels, key=lambda label: label.preference)


def _worthwhile(
    labels: list[_Label], sign: int, i: int, changes: _Changes, judge: Judge
) -> list[_Label]:
    """Return the labels that may lead best to a piece in one representation.

    To go on as the wheels stand costs nothing, and to turn them always something; what
    that is takes time to find out.
    """
    same = [label for label in labels if label.signs[-1] == sign]
    if judge.winding_wheels or not same or len(labels) == 1:
        return labels
    if changes.change(i, sign, sign).ways[0].time > 0:
        return labels
    least = min(label.cost for label in same)
    return [label for label in labels if label in same or label.cost < least]


def _extended(
    label: _Label, way: Way, sign: int, option: _Option, rest: float
) -> _Label:
    """Return a label with one more standstill and piece."""
    price = SHORT_REST if way.time > rest else 0.0
    # Far below one violation: among equals the wheels turn least.
    price += min(way.time, 1e3) * 1e-6 + (label.signs[-1] != sign) * 1e-9
    tracks = tuple(
        track.then(way, i, sweep, rest)
        for i, (track, sweep) in enumerate(
            zip(label.tracks, option.sweeps, strict=True)
        )
    )
    return _Label(
        (*label.signs, sign),
        (*label.ways, way),
        label.cost + price + option.cost,
        tracks,
    )


def _kept(labels: Iterable[_Label]) -> list[_Label]:
    """Return the labels of one representation that may be the best in the end.

    Without winding wheels that is one. To keep only some of many is safe: they are all
    possible, and what is left out can only make a verdict too strict.
    """
    kept: list[_Label] = []
    for label in sorted(labels, key=lambda label: label.preference):
        if not any(label.is_no_better(other) for other in kept):
            kept.append(label)
        if len(kept) == MAX_LABELS:
            break
    return kept


def _standstills(
    best: _Label, changes: _Changes, judge: Judge
) -> tuple[Standstill, ...]:
    unwindings = [track.unwound()[1] for track in best.tracks]
    found = []
    for i, ((before, after), way) in enumerate(
        zip(itertools.pairwise(best.signs), best.ways, strict=True)
    ):
        change = changes.change(i, before, after)
        wheel, turn, extra = change.wheel, change.turn, 0.0
        for j, unwinding in enumerate(each[i] for each in unwindings):
            if unwinding.time > extra:
                extra = unwinding.time
                wheel = judge.winding_wheels[j].index
                turn = way.sweeps[j].turn + 2 * np.pi * unwinding.turns
        made = Reconfiguration(change.start, change.goal, way.time + extra, wheel, turn)
        between = changes.between(i)
        t0, t1 = changes.rest(i) if made.time > 0 else between
        found.append(Standstill(t0, t1, made, between))
    return tuple(found)


def _anchors(best: _Label) -> tuple[Anchor, ...]:
    """Return where the winding wheels stand where every piece starts."""
    times, angles = [], []
    for track in best.tracks:
        turns, _ = track.unwound()
        sweeps = [step.sweep for step in track.line()]
        times.append([sweep.t for sweep in sweeps])
        angles.append(
            [s.start + 2 * np.pi * k for s, k in zip(sweeps, turns, strict=True)]
        )
    pieces = zip(zip(*times, strict=True), zip(*angles, strict=True), strict=True)
    return tuple(Anchor(*piece) for piece in pieces)


def _apart(
    parts: Parts,
    pieces: Sequence[Piece],
    signs: Sequence[int],
    judge: Judge,
    lost: Callable[[int, int], bool],
) -> tuple[Apart, ...]:
    return tuple(
        Apart(
            float(parts.spans.t0[piece.first]),
            float(parts.spans.t1[piece.last]),
            _configuration(_edge(parts, piece.first, at_end=True), sign, judge),
        )
        for i, (piece, sign) in enumerate(zip(pieces, signs, strict=True))
        if lost(i, sign)
    )


def _edge(parts: Parts, index: int, *, at_end: bool) -> Edge:
    """Return one end of a part and the twist there."""
    e, spans = parts.enclosure, parts.spans
    v, omega, t = (e.v1, e.omega1, spans.t1) if at_end else (e.v0, e.omega0, spans.t0)
    own = float(e.sign[index])
    return Edge(float(t[index]), own * complex(v[index]), own * float(omega[index]))


def _configuration(at: Edge, sign: int, judge: Judge) -> Configuration:
    """Return (κ_n, β) of a twist in one representation."""
    body = sign * (at.v + 1j * at.omega * judge.reference)
    q = sign * at.omega / judge.kappa_g
    kappa_n = float(np.clip(curvature_of_ratio(abs(body), q), -2.0, 2.0))
    return kappa_n, float(np.angle(body)) if abs(body) > 0 else 0.0
