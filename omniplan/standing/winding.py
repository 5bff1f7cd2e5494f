"""Steering angles followed through a motion, for wheels that can wind on.

A wheel with a finite range of more than a full turn may point in any direction, but not
turn the same way for ever: its angle has to be followed (spec/omni-curve §1, fact 6).
Where the velocity of a wheel is proved not to vanish over a part of a motion, its
enclosure lies in an open half-plane. So the angle turns by exactly ``arg(b ā)`` from
end to end, and what is between leaves these angles by `Chord.spread` at most.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from omniplan.judging.chords import Chord, ends_moving
from omniplan.judging.proof import RESOLUTION, ROUNDING, Parts, Piece
from omniplan.judging.rows import Judge, WindingWheel
from omniplan.motion import Enclosure

__all__ = [
    "Anchor",
    "Sweep",
    "joined",
    "straddling",
    "sweeps_of",
    "unsettled",
    "wound",
]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]

TURN = 2 * math.pi


@dataclass(frozen=True)
class Sweep:
    """How a steering angle moves over a stretch of a motion, rad."""

    start: float
    """Direction at the start, any of those that differ by full turns."""
    turn: float = 0.0
    """From the start to the end, followed."""
    low: float = 0.0
    """Never further below the start than this, ≤ 0."""
    high: float = 0.0
    """Never further above the start than this, ≥ 0."""
    t: float = 0.0
    """The moment of the start, s; of a way at a standstill 0."""

    def opposite(self) -> Sweep:
        """Return the sweep of the other representation: the wheel half a turn on."""
        return replace(self, start=self.start + math.pi)


@dataclass(frozen=True)
class Anchor:
    """Where the winding wheels of a piece stand at one moment each."""

    times: tuple[float, ...]
    """Of every winding wheel, s: where a part starts over which it is followed."""
    angles: tuple[float, ...]
    """Followed steering angle of every winding wheel at its moment, rad."""


@dataclass(frozen=True)
class _Course:
    """The direction of a wheel's velocity over m parts, followed; lost at zeros."""

    start: FloatArray
    """(m,) rad, from any origin."""
    end: FloatArray
    spread: FloatArray
    lost: BoolArray
    """(m,) whether the velocity may vanish, so that nothing is known."""
    heading0: FloatArray
    """(m,) rad, in (-π, π]: the direction in representation +1."""
    heading1: FloatArray

    @classmethod
    def of(cls, part: Enclosure, wheel: WindingWheel) -> _Course:
        chord = Chord.of(part, wheel.contact)
        end = np.cumsum(np.angle(chord.b * chord.a.conj()))
        start = np.concatenate([[0.0], end[:-1]])
        headings = (np.angle(part.sign * u) for u in (chord.a, chord.b))
        return cls(start, end, chord.spread(), chord.near <= 0, *headings)

    def rows(self, piece: Piece) -> slice:
        """Return the parts from the first to the last over which it is followed.

        A part that begins or ends at rest may be among those of the piece if another
        limit is broken there. Of zero there is no direction.
        """
        rows = slice(piece.first, piece.last + 1)
        known = np.flatnonzero(~self.lost[rows])
        if not known.size:
            return rows
        return slice(piece.first + int(known[0]), piece.first + int(known[-1]) + 1)

    def sweep(self, piece: Piece, t0: FloatArray) -> Sweep:
        """Return the sweep over a piece; `t0` (m,) are the starts of the parts."""
        rows = self.rows(piece)
        origin = self.start[rows.start]
        start, end = self.start[rows] - origin, self.end[rows] - origin
        return Sweep(
            start=float(self.heading0[rows.start]),
            turn=float(end[-1]),
            low=float((np.minimum(start, end) - self.spread[rows]).min()),
            high=float((np.maximum(start, end) + self.spread[rows]).max()),
            t=float(t0[rows.start]),
        )


def sweeps_of(
    parts: Parts, pieces: Sequence[Piece], wheels: Sequence[WindingWheel]
) -> list[tuple[Sweep, ...]]:
    """Return the sweep of every wheel over every piece, in representation +1.

    Parameters
    ----------
    parts : Parts
        Without `unsettled` ones.
    pieces : sequence of Piece
    wheels : sequence of WindingWheel
    """
    courses = [_Course.of(parts.enclosure, wheel) for wheel in wheels]
    t0 = parts.spans.t0
    return [tuple(course.sweep(piece, t0) for course in courses) for piece in pieces]


def joined(sweeps: Iterable[Sweep]) -> Sweep:
    """Return one stretch after the other as one; the start is that of the first."""
    whole: Sweep | None = None
    for sweep in sweeps:
        if whole is None:
            whole = sweep
            continue
        whole = Sweep(
            whole.start,
            whole.turn + sweep.turn,
            min(whole.low, whole.turn + sweep.low),
            max(whole.high, whole.turn + sweep.high),
            whole.t,
        )
    return whole or Sweep(0.0)


def unsettled(parts: Parts, wheels: Sequence[WindingWheel]) -> BoolArray:
    """Return the parts over which a wheel may wind further than it is known to.

    Halved until there are none left, they tell the extremes of every sweep to within
    the resolution of a proof.

    Parameters
    ----------
    parts : Parts
    wheels : sequence of WindingWheel
    """
    need = np.zeros(parts.stands.shape, dtype=bool)
    for wheel in wheels:
        course = _Course.of(parts.enclosure, wheel)
        least = np.minimum(course.start, course.end)
        largest = np.maximum(course.start, course.end)
        for piece in parts.pieces():
            rows = course.rows(piece)
            allowed = RESOLUTION * wheel.half
            beyond = largest[rows] + course.spread[rows] - largest[rows].max()
            below = least[rows].min() - least[rows] + course.spread[rows]
            need[rows] |= (np.maximum(beyond, below) > allowed) & ~course.lost[rows]
    return need


def wound(
    parts: Parts,
    judge: Judge,
    sign: IntArray,
    piece: IntArray,
    anchors: Sequence[Anchor],
    floor: float,
) -> Parts:
    """Return the parts with what the winding wheels use of their steering ranges.

    Parameters
    ----------
    parts : Parts
    judge : Judge
    sign : (m,) int, {-1, 1}
        The representation that is driven.
    piece : (m,) int
        The piece each part belongs to.
    anchors : sequence of Anchor
        One per piece.
    floor : float, m/s
        At this |v_s| or below the vehicle stands.
    """
    part = parts.enclosure
    body = Chord.of(part, judge.reference)
    moving = [v > 0 for v in ends_moving(part, body, judge.kappa_g, floor)]
    low = {s: ratios.copy() for s, ratios in parts.low.items()}
    high = {s: ratios.copy() for s, ratios in parts.high.items()}
    angles: dict[int, tuple[FloatArray, FloatArray]] = {}
    for i, wheel in enumerate(judge.winding_wheels):
        course = _Course.of(part, wheel)
        flip = np.where(sign < 0, math.pi, 0.0)
        known = ~parts.stands
        shift = np.zeros(flip.shape)
        for p, anchor in enumerate(anchors):
            at = int(np.searchsorted(parts.spans.t0, anchor.times[i]))
            here = piece == p
            shift[here] = anchor.angles[i] - course.start[at]
            # Past the centre of rotation on the wheel the angle is not known.
            gone = np.flatnonzero(here & known & course.lost)
            if gone.size:
                known[gone[0] :] &= ~here[gone[0] :]
        ends = (
            _snapped(course.start + shift, course.heading0 + flip),
            _snapped(course.end + shift, course.heading1 + flip),
        )
        asides = [np.abs(end - wheel.middle) for end in ends]
        reached = np.maximum(
            *(np.where(m, aside, 0.0) for m, aside in zip(moving, asides, strict=True))
        )
        most = np.maximum(*asides) + course.spread
        for s in low:
            low[s][:, wheel.column] = np.where(known, reached / wheel.half, 0.0)
            high[s][:, wheel.column] = np.where(known, most / wheel.half, 0.0)
        angles[wheel.column] = ends
    return replace(parts, low=low, high=high, angles=angles)


def straddling(parts: Parts, wheels: Sequence[WindingWheel]) -> BoolArray:
    """Return the parts over which a wheel runs into a stop, or may do so.

    Parameters
    ----------
    parts : Parts
        From `wound`.
    wheels : sequence of WindingWheel
    """
    need = np.zeros(parts.stands.shape, dtype=bool)
    ratios = parts.high[1]
    for wheel in wheels:
        ends = [np.abs(a - wheel.middle) for a in parts.angles[wheel.column]]
        is_within = np.minimum(*ends) <= wheel.half
        need |= (ratios[:, wheel.column] > 1 + ROUNDING) & is_within
    return need


def _snapped(angle: FloatArray, direction: FloatArray) -> FloatArray:
    """Return the angle of a direction that is nearest to one that was added up."""
    return np.asarray(direction + TURN * np.rint((angle - direction) / TURN))
