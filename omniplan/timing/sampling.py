"""From a speed profile on a grid to poses whose splines keep the limits.

A profile becomes a C² motion as a B-spline in time (see `waves`). Where limits change
within a few of its steps the means may break them: there the steps are made shorter,
and where they are short enough the limits are tightened, and the piece is timed again.

A steering acceleration also depends on the third derivatives of the pose: the path's
own jumps of those are rounded off (see `rounding`), and more samples are taken where
they change much (see `swing_times`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from omniplan.motion import starts_at_rest
from omniplan.timing.path_motion import PathPiece
from omniplan.timing.solver import PieceProfile, TimingProblem
from omniplan.timing.swing_times import (
    BLUR,
    BLURRED,
    EXACT,
    MOST,
    SLOWEST,
    STILL,
    Windows,
    swing_times,
)
from omniplan.timing.waves import Wave, graded, spaced, wave_of

__all__ = ["DWELL", "PieceSampler", "SampledPiece"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

RAMP = 2
"""Steps in which u̇ may come up from rest where nothing else bounds ü."""
STEEPER = 3
"""How often they are halved ..."""
WORTH = 2e-3
"""... if that gains more than this share of time."""
MARGIN = 5e-4
"""By how much the limits are made tighter, so that keeping them can be proved."""
ROUNDS = 12
"""How often a piece is timed again ..."""
FINER = 5
"""... and for how many of these steps may be made shorter ..."""
COARSE = 1e-3
"""... where limits are broken by more than this share ..."""
AT_ONCE = 0.1
"""... but not to less than this share of themselves at once ..."""
SHORTEST = 1 / 64, 1e-5
"""... nor in all, or to less than so many seconds."""
AROUND = 2
"""So many steps before and after a place are dealt with like it."""
TURN = np.radians(30)
"""By so much the heading may turn in a step, or the way round would not be clear."""
CLEARLY = 0.1
"""Where the parabola through the first samples has more than this share of the first
step's speed in the beginning, there are more of them: a reader has to see the rest."""
DWELL = 1e-4
"""Time at rest, s, so that a pose is repeated and cannot be taken for a passing one."""


@dataclass(frozen=True, eq=False)
class SampledPiece:
    """Samples of one piece, from rest to rest."""

    t: FloatArray
    """(n,) s, from the start of the piece."""
    u: FloatArray
    """(n,) m, from the start of the path."""
    path: PathPiece
    """What was sampled: the piece, or the same with rounded jumps."""
    excess: float
    """By how much time had to be stretched for all limits to hold; ≤ 1: they do."""

    @property
    def price(self) -> float:
        """The duration once all of it is slowed down to keep its limits, s."""
        return float(self.t[-1]) * max(self.excess, 1.0)


class PieceSampler:
    """Samples the fastest way along one piece so that they keep its limits.

    What was learnt is kept: where steps are short and where limits are tightened.
    """

    def __init__(
        self, problem: TimingProblem, piece: int, profile: PieceProfile, steps: int
    ) -> None:
        """Take the profile of a piece, with a way through.

        Parameters
        ----------
        problem : TimingProblem
        piece : int
        profile : PieceProfile
            In the representation to drive.
        steps : int
            Number of steps in time at least.
        """
        self._sigma = profile.sigma
        length = problem.pieces[piece].length
        most = min(math.sqrt(length / STILL), profile.duration / SHORTEST[1])
        dt = profile.duration / max(min(steps, int(most)), 4)
        self._max_change = float(np.sqrt(profile.x.max())) / (RAMP * dt)
        self._problem, self._piece, self._dt = problem, piece, dt
        self._samples: Windows | None = None
        if problem.bounds_steering_acceleration:
            self._samples = Windows.of(problem, piece, profile, dt)
            problem = problem.rounded(piece, self._samples.reach, self._samples.stairs)
            (first,) = problem.solve([0], [self._sigma], max_change=[self._max_change])
            self._problem, self._piece = problem.refined([[first]]), 0
        self.u = self._problem.nodes(self._piece)
        self._gain = np.zeros((2, self.u.size))
        pace = np.sqrt(np.interp(self.u, profile.u, profile.x))
        self._least = np.full(
            self.u.size, max(SHORTEST[0] * dt, profile.duration / most)
        )
        self._finest = np.zeros(self.u.size)
        if self._samples is not None:
            self._gain = np.stack(self._problem.steering_gain(self._piece, self.u))
            self._far = np.abs(self._given.poses_at(self._given.u)).max()
            self._far *= BLUR / BLURRED
            blur = self._far * self._gain[1] / np.maximum(pace, SLOWEST * pace.max())
            self._finest = np.cbrt(blur)
            self._least = np.maximum(self._least, self._finest)
        self._step = np.minimum(dt, self._turning_times(profile))
        self._tight = np.ones(self.u.size)
        self._finer, self._steeper = FINER, STEEPER

    @property
    def _given(self) -> PathPiece:
        return self._problem.pieces[self._piece]

    def _turning_times(self, profile: PieceProfile) -> FloatArray:
        """Return how long the heading takes for as much as a step may turn, (n,) s."""
        turned = np.abs(np.diff(self._given.poses_at(profile.u)[:, 2]))
        with np.errstate(divide="ignore"):
            longest = TURN * np.diff(profile.times) / turned
        beside = np.minimum(np.append(longest, np.inf), np.insert(longest, 0, np.inf))
        shortest = np.minimum(beside, profile.duration)
        return np.asarray(np.interp(self.u, profile.u, shortest))

    def steps_at(self, times: FloatArray) -> FloatArray:
        """Return how long the steps are where nodes are passed at times, (n,) s."""
        return graded(times, self._step)

    def sampled(self, weight: FloatArray | None = None) -> SampledPiece:
        """Return the best samples that shorter steps and tighter limits lead to.

        Parameters
        ----------
        weight : (n,) float, ≥ 1, optional
            How much more slowly to pass every node `u`.
        """
        weight = np.ones(self.u.size) if weight is None else weight
        best: SampledPiece | None = None
        for _ in range(ROUNDS):
            found = self._found(weight)
            t = spaced(found.times, graded(found.times, self._step))
            wave = wave_of(found, t)
            place, factor = self._judged(wave)
            one = self._samples_of(wave, float(factor.max()))
            if best is None or one.price < best.price:
                best = one
            if one.excess <= 1:
                break
            self._react(found, wave, place, factor)
        assert best is not None
        return best

    def _found(self, weight: FloatArray) -> PieceProfile:
        """Return the profile with limits so tight; ramps as steep as is worth it."""
        tight = [self._tight * weight * (1 + MARGIN)]
        job, sign = [self._piece], [self._sigma]
        while True:
            (found,) = self._problem.solve(
                job, sign, max_change=[self._max_change], tight=tight
            )
            if self._steeper < 1 or not self._problem.is_ramp(found):
                return found
            (free,) = self._problem.solve(job, sign, tight=tight)
            if found.duration < free.duration * (1 + WORTH):
                self._steeper = 0
                return found
            self._steeper -= 1
            self._max_change *= 2
            self._step, self._least = self._step / 2, self._least / 2

    def _judged(self, wave: Wave) -> tuple[FloatArray, FloatArray]:
        """Return places, and by which factor time is too short there."""
        t = (wave.t[1:] + wave.t[:-1]) / 2
        between = wave.at(t)
        # A cap changes at a knot: both sides of it count.
        knots = self._given.u[1:-1][_caps_change(self._given)]
        _, slow, bent = wave.at(wave.passes(knots))
        first = wave.u[0]
        place = np.concatenate([wave.u, between[0], np.nextafter(knots, first), knots])
        factor = self._problem.slowdowns(
            self._piece,
            self._sigma,
            place,
            np.concatenate([wave.speed, between[1], slow, slow]),
            np.concatenate([wave.change, between[2], bent, bent]),
        )
        # Something must be left for the proof between the samples.
        return place, factor * (1 + MARGIN / 2)

    def _react(
        self, found: PieceProfile, wave: Wave, place: FloatArray, factor: FloatArray
    ) -> None:
        """Shorten the steps, or tighten the limits, where they are broken."""
        times = found.times
        steps = graded(times, self._step)
        tight, shorter = np.ones(times.size), self._step.copy()
        bad = np.flatnonzero(factor > 1)
        when = np.interp(place[bad], found.u, times)
        step, least = (np.interp(when, times, x) for x in (steps, self._least))
        over = factor[bad]
        if self._samples is not None:
            # So many samples have to find room where ü changes.
            leap = _leap(wave)[np.searchsorted(wave.t, when).clip(1) - 1]
            gain, finest = (
                np.interp(place[bad], self.u, x) for x in (self._gain[0], self._finest)
            )
            samples = np.clip(2 * gain * leap / EXACT, 1, MOST)
            least = np.maximum(least, samples * finest)
        is_coarse = (step > 1.5 * least) & (over > 1 + COARSE) & (self._finer > 0)
        wanted = step * np.clip(COARSE / (over - 1), AT_ONCE, 0.5)
        low = np.searchsorted(times, when - AROUND * step) - 1
        high = np.searchsorted(times, when + AROUND * step, side="right") + 1
        low = np.maximum(low, 0)
        for i in range(bad.size):
            part = slice(low[i], high[i])
            if is_coarse[i]:
                shorter[part] = np.minimum(shorter[part], max(wanted[i], least[i]))
            else:
                more = over[i] * (1 + MARGIN / 4)
                tight[part] = np.maximum(tight[part], more)
        self._finer -= bool(is_coarse.any())
        self._step, self._tight = shorter, self._tight * tight

    def _samples_of(self, wave: Wave, excess: float) -> SampledPiece:
        t = wave.t
        if self._samples is not None:
            turn, lever = (np.interp(wave.u, self.u, gain) for gain in self._gain)
            slowest = self._dt * SLOWEST
            t = swing_times(wave, self._samples, turn, self._far * lever, slowest)
        t = self._resting(wave, t)
        u = wave.at(np.clip(t, wave.t[0], wave.t[-1]))[0]
        u[[0, -1]] = wave.u[[0, -1]]
        return SampledPiece(t - t[0], u, self._given, excess)

    def _resting(self, wave: Wave, t: FloatArray) -> FloatArray:
        """Return sample times with more of them at rest, so that it is seen.

        A slow pace may be reached within one step. Seen from three samples alone such
        a motion does not start at rest, nor would a spline through them. So the step is
        halved; one too short for that is left as it is, and a dwell comes before it.
        """
        for order in (1, -1):
            while True:
                ends = t[::order][:3]
                u = wave.at(ends)[0]
                if starts_at_rest(order * ends, self._given.poses_at(u), CLEARLY):
                    break
                step, way = ends[1] - ends[0], abs(u[1] - u[0])
                if way < 4 * STILL or abs(step) < 2 * SHORTEST[1]:
                    beyond = ends[:1] - order * DWELL
                    t = np.concatenate([beyond, t][::order])
                    break
                t = np.insert(t, order, ends[0] + step / 2)
        return t


def _leap(wave: Wave) -> FloatArray:
    """Return by how much ü changes in each step and those beside it, (n - 1,)."""
    leap = np.abs(np.diff(wave.change))
    wide = np.concatenate([[0.0, 0.0], leap, [0.0, 0.0]])
    return np.asarray(np.max([wide[i : i + leap.size] for i in range(5)], axis=0))


def _caps_change(piece: PathPiece) -> BoolArray:
    """Return at which of the inner knots a cap changes."""
    caps = np.stack([piece.max_speed, piece.max_yaw_rate])
    return np.asarray((caps[:, 1:] != caps[:, :-1]).any(axis=0), dtype=bool)
