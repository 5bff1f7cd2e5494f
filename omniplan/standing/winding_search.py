"""Choosing how often winding wheels have turned, piece by piece.

A dynamic programme over the full turns k that a wheel's followed angle differs by from
its direction. Given what is driven and which way is taken at every standstill, wheels
do not depend on each other. At a standstill a wheel may also unwind: it turns by full
turns on its own, from rest to rest and before or after the way.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from omniplan.judging.rows import WindingWheel
from omniplan.standing.turn_time import rest_to_rest
from omniplan.standing.ways import Way
from omniplan.standing.winding import Sweep

__all__ = ["SHORT_REST", "Track", "Unwinding"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

TURN = 2 * math.pi
SLACK = 1e-11
"""Rounding of angles that are added up, rad."""
SHORT_REST = 0.5
"""What a standstill that is too short counts, where a broken limit counts 1."""


@dataclass(frozen=True)
class Unwinding:
    """What one wheel does at one standstill, besides the way."""

    turns: int
    """Full turns by which it ends elsewhere than the way leads; with sign."""
    time: float
    """s; infinite if the way leads past a stop however the wheel is unwound."""


@dataclass(frozen=True)
class _Step:
    """What led to the present piece, for every k."""

    parent: IntArray
    """Row of the best k of the piece before."""
    turns: IntArray
    time: FloatArray


@dataclass(frozen=True)
class Track:
    """The best way to wind one wheel up to a piece, for every k it may have there."""

    wheel: WindingWheel
    sweep: Sweep
    """Over the present piece."""
    k: IntArray
    """(n,) full turns: the angle at the start of the piece is in range."""
    cost: FloatArray
    """(n,) of all pieces and standstills so far."""
    before: tuple[Track, ...] = ()
    """Of the piece before."""
    step: _Step | None = None

    @classmethod
    def begin(cls, wheel: WindingWheel, sweep: Sweep) -> Track:
        """Return the track of the first piece: any k may be chosen."""
        least = math.ceil((wheel.least - sweep.start - SLACK) / TURN)
        largest = math.floor((wheel.largest - sweep.start + SLACK) / TURN)
        k = np.arange(least, largest + 1)
        angle = sweep.start + TURN * k
        over = np.maximum(
            wheel.least - angle - sweep.low, angle + sweep.high - wheel.largest
        )
        # Among what fits the one that keeps furthest away from the stops.
        used = (over + wheel.half) / wheel.half
        broken = np.where(over > SLACK, 1.0 + 1e-5 * np.minimum(over, 1e3), 0.0)
        return cls(wheel, sweep, k, broken + 1e-7 * np.clip(used, 0.0, 1.0))

    @property
    def least(self) -> float:
        """Cost of the best choice."""
        return float(self.cost.min())

    def then(self, way: Way, wheel: int, after: Sweep, rest: float) -> Track:
        """Return the track of the next piece, past a standstill.

        Parameters
        ----------
        way : Way
            That is taken.
        wheel : int
            Row of this wheel among the sweeps of the way.
        after : Sweep
            Over the next piece.
        rest : float, s
            Time at the standstill.
        """
        fresh = Track.begin(self.wheel, after)
        turned = way.sweeps[wheel]
        end = self.sweep.start + self.sweep.turn
        shift = round((end + turned.turn - after.start) / TURN)
        total = fresh.k[None, :] - self.k[:, None] - shift
        ends: FloatArray = end + TURN * self.k.astype(np.float64)
        turns, moves = self._full_turns(ends, turned, total)
        # Infinitely fast wheels take no time, but cannot pass a stop either.
        fits = np.isfinite(turns)
        turns = np.where(fits, turns, 0.0)
        each = rest_to_rest(
            turns * (TURN / moves), self.wheel.rate, self.wheel.acceleration
        )
        time = np.where(fits, moves * each, np.inf)
        # Beside a way that takes too long already, unwinding is no mistake of its own.
        spare = rest - way.time if way.time <= rest else np.inf
        price = np.where((time > spare) | np.isinf(time), SHORT_REST, 0.0)
        price += 1e-6 * np.minimum(time + turns, 1e3)
        sums = self.cost[:, None] + price
        parent = np.argmin(sums, axis=0)
        pick = parent, np.arange(fresh.k.size)
        step = _Step(parent, total[pick], time[pick])
        return replace(fresh, cost=fresh.cost + sums[pick], before=(self,), step=step)

    def _full_turns(
        self, angle: FloatArray, way: Sweep, total: IntArray
    ) -> tuple[FloatArray, IntArray]:
        """Return how many full turns a wheel makes, (n, n'), and in how many moves.

        Those before the way must bring it to where the way stays in range; the sum is
        given. Turns are infinite if none fit. Two moves, before and after the way, take
        longest if they are alike, which is what is reckoned with.
        """
        least = np.ceil((self.wheel.least - angle - way.low - SLACK) / TURN)
        most = np.floor((self.wheel.largest - angle - way.high + SLACK) / TURN)
        detour = np.maximum(
            least[:, None] - np.maximum(total, 0), np.minimum(total, 0) - most[:, None]
        )
        turns = np.abs(total) + 2 * np.maximum(detour, 0.0)
        before, after = (
            (least[:, None] <= k) & (k <= most[:, None])
            for k in (total, np.zeros_like(total))
        )
        moves = np.where(before | after, 1, 2)
        return np.where((least <= most)[:, None], turns, np.inf), moves

    def line(self) -> list[Track]:
        """Return the tracks of all pieces, from the first to this one."""
        tracks = [self]
        while tracks[-1].before:
            tracks.append(tracks[-1].before[0])
        return tracks[::-1]

    def unwound(self) -> tuple[tuple[int, ...], tuple[Unwinding, ...]]:
        """Return the best k of every piece and what happens at every standstill."""
        row = int(np.argmin(self.cost))
        track, k, unwindings = self, [int(self.k[row])], []
        while track.step is not None:
            step = track.step
            unwindings.append(Unwinding(int(step.turns[row]), float(step.time[row])))
            row, (track,) = int(step.parent[row]), track.before
            k.append(int(track.k[row]))
        return tuple(k[::-1]), tuple(unwindings[::-1])
