"""Connecting two poses by moves that the vehicle is permitted to drive.

What is tried depends on how freely the vehicle moves:

==========================  ========================================================
keeps its heading           the straight move, two crab moves
turns on the spot           the straight move, one arc, turn and translate, and turn,
                            drive along its axis, turn
neither                     the straight move, one arc, Reeds-Shepp words at several
                            directions of travel, with the least radius permitted there
only moves as it turns      the straight move with full turns more
bound to a line             what of the above keeps to its line
==========================  ========================================================

Permission comes first, as it costs least; collisions are looked for afterwards.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TypeAlias

import numpy as np

from configspace.kernels import BLOCKED
from omniplan.planning.moves import NO_WAY, Move
from omniplan.planning.patterns import (
    SHORT,
    TURNLESS,
    Frame,
    Word,
    Zigzag,
    words_between,
    zigzags_between,
)
from omniplan.planning.permits import Drive, Permits

__all__ = ["Chain", "Connector", "Pose", "chain_time"]

Pose: TypeAlias = tuple[float, float, float]
Leg: TypeAlias = tuple[Drive, ...]
"""The representations of one move, at least one."""
Chain: TypeAlias = tuple[Leg, ...]
"""Moves one after the other."""

SPARE = 2e-3
"""By this share radii are larger than the least one, so that splines keep the limit."""
SCAN = 400
"""Steps in which the least radius is looked for."""
USEFUL = 0.15
"""Smaller radii than this share of 1/κ_g are not looked at: they are slow."""
CRABS = (0.0, 0.35, 0.7, 1.0)
"""Directions of travel at which words are tried, as shares of the largest |β|."""
WIDER = (1.0, 1.7, 3.0)
"""Radii that are tried, in least ones: larger ones are quicker."""
ALL_SIDES = math.pi / 2 - 0.01
"""Who crabs so far to both sides, forwards and backwards, needs no zigzags, rad."""
MOST_PATTERNS = 10
"""So many patterns between two poses are tried."""


class Connector:
    """Finds moves between poses for one vehicle.

    Parameters
    ----------
    permits : Permits
    keeps_heading : bool
        Whether to look only for moves without a turn.
    """

    def __init__(self, permits: Permits, *, keeps_heading: bool = False) -> None:
        self.permits = permits
        space = permits.space
        self.is_translating = space.is_translating or keeps_heading
        self.line = space.line_beta
        self.spins = not self.is_translating and all(
            permits.drives(Move.straight((0, 0, 0), (0, 0, turn))) for turn in (1, -1)
        )
        self.frames = () if space.is_translating else tuple(self._frames())
        self._whirl = math.inf
        if not self.frames and self.line is None and not self.is_translating:
            self._whirl = self._least_whirl()

    @property
    def is_stuck(self) -> bool:
        """Whether every cell of the space is blocked: that is a proof."""
        return bool((self.permits.space.tables.state == BLOCKED).all())

    @property
    def radius(self) -> float | None:
        """Radius of the search's distance, m; None where a straight one is apt."""
        if self.spins or self.is_translating or not self.frames:
            return None
        if self.line is None and self._crab_range > math.pi / 3:
            return None
        return self.frames[0].radius

    def quick(self, a: Pose, b: Pose) -> Chain | None:
        """Return the first chain that is permitted, collisions not looked for.

        Parameters
        ----------
        a, b : (float, float, float), m, m, rad
        """
        for moves in self._few(a, b):
            chain = self._permitted(moves)
            if chain is not None:
                return chain
        return None

    def thorough(self, a: Pose, b: Pose) -> list[tuple[float, Chain]]:
        """Return all chains that are permitted and their times, the quickest first.

        Parameters
        ----------
        a, b : (float, float, float), m, m, rad
        """
        chains = [self._permitted(moves) for moves in self._many(a, b)]
        if self.frames and not self.spins:  # none of the many patterns may be as quick
            chains.append(self.quick(a, b))
        timed = [(chain_time(self.permits, c), c) for c in chains if c is not None]
        return sorted(timed, key=lambda pair: pair[0])

    def _permitted(self, moves: Sequence[Move]) -> Chain | None:
        legs = []
        for move in moves:
            drives = self.permits.drives(move)
            if not drives:
                return None
            legs.append(drives)
        return tuple(legs)

    def _few(self, a: Pose, b: Pose) -> Iterator[tuple[Move, ...]]:
        if self.is_translating:
            yield from self._without_turn(a, b)
            return
        if self.line is None:
            yield _kept(Move.straight(a, b))
            yield _kept(Move.arc(a, b))
            yield from self._whirls(a, b)
        if self.spins:
            if self.line is None:
                yield _turn_first(a, b)
                yield _turn_last(a, b)
            yield min(_driven(a, b, self.line or 0.0), key=_turned)
        elif self.frames:
            for pattern in self._patterns(a, b, self.frames[:1]):
                yield pattern.moves(a)

    def _many(self, a: Pose, b: Pose) -> Iterator[tuple[Move, ...]]:
        if self.is_translating:
            yield from self._without_turn(a, b)
            return
        turn = math.remainder(b[2] - a[2], 2 * math.pi)
        if self.line is None:
            yield _kept(Move.straight(a, b))
            yield from self._whirls(a, b)
            other = turn - math.copysign(2 * math.pi, turn)
            yield _kept(Move.straight(a, b, turn=other))
        yield _kept(Move.arc(a, b))
        if self.spins:
            if self.line is None:
                yield _turn_first(a, b)
                yield _turn_last(a, b)
            yield from _driven(a, b, self.line or 0.0)
        if self.spins and self.line is None:
            return
        frames = [
            Frame(frame.beta, frame.radius * wider)
            for wider in WIDER
            for frame in self.frames
        ]
        for pattern in self._patterns(a, b, frames):
            yield pattern.moves(a)

    def _without_turn(self, a: Pose, b: Pose) -> Iterator[tuple[Move, ...]]:
        """Yield the straight move and, for who cannot crab to all sides, zigzags."""
        b = (b[0], b[1], a[2])
        yield _kept(Move.straight(a, b))
        if self.line is None and 0 < self._crab_range < ALL_SIDES:
            speed = self._speed
            zigzags = zigzags_between(a, b, self._crab_range, 0.0, speed)
            for zigzag in sorted(zigzags, key=lambda pattern: pattern.price):
                yield zigzag.moves(a)

    def _whirls(self, a: Pose, b: Pose) -> Iterator[tuple[Move, ...]]:
        """Yield straight moves with so many full turns that all of it is permitted."""
        if math.isinf(self._whirl):
            return
        turn = math.remainder(b[2] - a[2], 2 * math.pi)
        least = self._whirl * math.dist(a[:2], b[:2])
        turns = [
            turn + side * 2 * math.pi * (more + max(math.ceil(short), 0))
            for side in (1, -1)
            for short in [(least - side * turn) / (2 * math.pi)]
            for more in (0, 1)
        ]
        for whole in sorted(turns, key=abs):
            yield _kept(Move.straight(a, b, turn=whole))

    def _least_whirl(self) -> float:
        """Return the least curvature at which all β are permitted, 1/m; else inf."""
        for k in np.linspace(0.0, 2.0, SCAN + 1).tolist():
            if any(
                self.permits.v_max(side * k, 0.0, 2 * math.pi, reverse=reverse) > 0
                for side in (1, -1)
                for reverse in (False, True)
            ):
                return float(
                    self.permits.kappa_g * (k if k < 1 else 1 / max(2 - k, 1e-9))
                )
        return math.inf

    def _patterns(
        self, a: Pose, b: Pose, frames: Sequence[Frame]
    ) -> list[Word | Zigzag]:
        """Return Reeds-Shepp words and zigzags, those that take least time first."""
        found: list[Word | Zigzag] = []
        for frame in frames:
            found += words_between(a, b, frame, self._speed)[:MOST_PATTERNS]
        if self.line is None and self._crab_range > 0:
            angle, radius = self._crab_range, self.frames[0].radius
            found += zigzags_between(a, b, angle, radius, self._speed)
        return sorted(found, key=lambda pattern: pattern.price)[:MOST_PATTERNS]

    @cached_property
    def _speed(self) -> float:
        """The speed straight ahead, m/s: what way is compared with time at."""
        return self.permits.v_max(0.0, self.frames[0].beta, self.frames[0].beta)

    @property
    def _crab_range(self) -> float:
        return max((abs(frame.beta) for frame in self.frames), default=0.0)

    def _frames(self) -> Iterator[Frame]:
        """Yield directions of travel with their radii, straight ahead first."""
        if self.line is not None:
            betas = [self.line]
        else:
            widest = self._widest()
            betas = [0.0, *(s * share * widest for share in CRABS[1:] for s in (1, -1))]
        for beta in betas:
            radius = self._radius(beta)
            if math.isfinite(radius):
                yield Frame(beta, radius)

    def _widest(self) -> float:
        """Return up to which |β| both sides can be driven without turning, rad."""
        beta = np.linspace(0.0, np.pi / 2, SCAN)
        space, zero = self.permits.space, np.zeros(SCAN)
        both = [space.v_max(zero, s * beta, reachable_only=True) > 0 for s in (1, -1)]
        shut = np.flatnonzero(~(both[0] & both[1]))
        return float(beta[max(int(shut[0]) - 1, 0)] if shut.size else beta[-1])

    def _radius(self, beta: float) -> float:
        """Return a small radius at a direction of travel, m; inf if there is none.

        The least one to both sides, but no smaller than is of use.
        """
        limit = min(self._sharpest(beta, side) for side in (1, -1))
        kappa_g = self.permits.kappa_g
        if limit <= 0:
            return math.inf
        curvature = limit if limit < 1 else 1 / max(2 - limit, 1e-9)
        least = 1.0 if self.spins else USEFUL
        return max((1 + SPARE) / curvature, least) / kappa_g

    def _sharpest(self, beta: float, side: int) -> float:
        """Return up to which |κ_n| all curvatures to one side are permitted."""
        speed = self.permits.v_max
        inner, outer = 0.0, 2.0
        for k in np.linspace(0.0, 2.0, SCAN + 1).tolist():
            if speed(side * k, beta, beta) <= 0:
                outer = k
                break
            inner = k
        for _ in range(20):
            middle = (inner + outer) / 2
            free = speed(side * middle, beta, beta) > 0
            inner, outer = (middle, outer) if free else (inner, middle)
        return inner


def chain_time(permits: Permits, chain: Chain) -> float:
    """Return the estimated time of a chain, s, its best representations chosen.

    Parameters
    ----------
    permits : Permits
    chain : Chain
        Nothing: 0.
    """
    if not chain:
        return 0.0
    best = [(drive.duration, drive) for drive in chain[0]]
    for leg in chain[1:]:
        best = [
            (
                drive.duration
                + min(so_far + _joint(permits, last, drive) for so_far, last in best),
                drive,
            )
            for drive in leg
        ]
    return min(time for time, _ in best)


def _joint(permits: Permits, before: Drive, after: Drive) -> float:
    """Return the time between two moves; negative if the vehicle need not stop."""
    if permits.is_steady(before, after):
        return -2 * min(before.ramp, after.ramp)
    return permits.steering_time(before.goal, after.start)


def _kept(*moves: Move) -> tuple[Move, ...]:
    """Return the moves that move."""
    return tuple(m for m in moves if m.length > SHORT or abs(m.turn) > TURNLESS)


def _spin(at: Pose, heading: float) -> Move:
    return Move.straight(at, (at[0], at[1], heading))


def _turn_first(a: Pose, b: Pose) -> tuple[Move, ...]:
    first = _spin(a, b[2])
    return _kept(first, Move.straight(first.goal, b))


def _turn_last(a: Pose, b: Pose) -> tuple[Move, ...]:
    first = Move.straight(a, (b[0], b[1], a[2]))
    return _kept(first, _spin((b[0], b[1], a[2]), b[2]))


def _driven(a: Pose, b: Pose, beta: float) -> list[tuple[Move, ...]]:
    """Return turn, drive along β or against it, turn."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    if math.hypot(dx, dy) <= NO_WAY:
        return [_kept(_spin(a, b[2]))]
    found = []
    for aside in (0.0, math.pi):
        heading = math.atan2(dy, dx) - beta - aside
        first = _spin(a, heading)
        turned = (a[0], a[1], float(first.goal[2]))
        drive = Move.straight(turned, (b[0], b[1], turned[2]))
        last = _spin((b[0], b[1], turned[2]), b[2])
        found.append(_kept(first, drive, last))
    return found


def _turned(moves: Sequence[Move]) -> float:
    return sum(abs(move.turn) for move in moves)


def joined(chains: Sequence[Chain]) -> Chain:
    """Return chains as one."""
    return tuple(itertools.chain.from_iterable(chains))
