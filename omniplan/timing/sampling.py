"""From a speed profile on a grid to poses whose splines keep the limits.

A profile becomes a C² motion as a B-spline in time (see `waves`). Where limits change
within a few of its steps the means may break them: there the steps are made shorter,
and where they are short enough the limits are tightened, and the piece is timed again.

A steering acceleration also depends on the third derivatives of the pose. Those of a
spline through samples are right only where the true ones change slowly: the path's own
jumps are rounded off (see `rounding`), and steps in which they change much get more
samples. Next to rest they are off by a share of the time since then: there samples
follow each other in shares of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from omniplan.timing.path_motion import PathPiece
from omniplan.timing.rounding import STAIRS
from omniplan.timing.solver import PieceProfile, TimingProblem
from omniplan.timing.waves import Wave, graded, spaced, wave_of

__all__ = ["PieceSampler", "SampledPiece"]

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
EXACT = 0.01
"""Share of a limit on the steering acceleration by which samples may miss it ..."""
MOST = 48
"""... unless a step needs more samples than this."""
SINCE_REST = 0.025
"""Share of the time since rest, or until it, that a sample may take ..."""
BLUR = 1e-14
"""... but not less time than lets rounding, of third derivatives so much over the cube
of a sample's time per metre from the origin, be a share `BLURRED` of the limit."""
BLURRED = 0.02
WINDOW = 6.0
"""Steps before and after a knot of the path over which its jump is rounded off ..."""
JUMPS = 0.01, 0.15
"""... with no cubics, few or many, as the jump is a share of the limit, and ..."""
STILL = 1e-8
"""Way per step at least, m: shorter ones would count as standing."""
SLOWEST = 1e-3
"""Paces and pulls count as this at least, m/s and m/s², or a share."""


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
        self._samples: _Windows | None = None
        if problem.bounds_steering_acceleration:
            self._samples = _Windows.of(problem, piece, profile, dt)
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
        self._step = np.full(self.u.size, dt)
        self._tight = np.ones(self.u.size)
        self._finer, self._steeper = FINER, STEEPER

    @property
    def _given(self) -> PathPiece:
        return self._problem.pieces[self._piece]

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
        if self._samples is None:
            return SampledPiece(wave.t, wave.u, self._given, excess)
        turn, lever = (np.interp(wave.u, self.u, gain) for gain in self._gain)
        blur = self._far * lever
        step = np.diff(wave.t)
        samples = np.maximum(
            _samples_per_step(wave, turn), self._samples.per_step(wave)
        )
        # Next to a long sample a short one shares its error, many times over.
        middle = (wave.t[1:] + wave.t[:-1]) / 2
        samples = np.ceil(step / graded(middle, step / samples) - 1e-9).astype(np.int64)
        # A third derivative is blurred by `blur / h³` per u̇.
        pace = np.minimum(wave.speed[1:], wave.speed[:-1])
        pace = np.maximum(pace, self._dt * SLOWEST)
        least = np.cbrt(np.maximum(blur[1:], blur[:-1]) / pace)
        most = np.clip(step / least, 1, MOST).astype(np.int64)
        t = _divided(wave.t, np.minimum(samples, most))
        last = t[-1]
        for end in (0, -1):
            pull = abs(float(wave.change[end]))
            t = _from_rest(t, pull, float(blur[end]))
            t = (last - t)[::-1]
        u = wave.at(t)[0]
        u[[0, -1]] = wave.u[[0, -1]]
        return SampledPiece(t, u, self._given, excess)


@dataclass(frozen=True, eq=False)
class _Windows:
    """Where jumps of a path's third derivative are rounded off."""

    knots: FloatArray
    """(k,) m."""
    reach: FloatArray
    """(k,) m, before and after a knot."""
    jump: FloatArray
    """(k,) by which share of the limit the steering acceleration would jump."""

    @classmethod
    def of(
        cls, problem: TimingProblem, piece: int, profile: PieceProfile, dt: float
    ) -> _Windows:
        given = problem.pieces[piece]
        knots = given.u[1:-1]
        pace = np.sqrt(np.interp(knots, profile.u, profile.x))
        pace = np.maximum(pace, SLOWEST * pace.max(initial=0.0))
        _, lever = problem.steering_gain(piece, knots)
        rise = np.abs(np.diff(given.position[0]))
        rise += problem.farthest_from(given.point) * np.abs(np.diff(given.heading[0]))
        return cls(knots, WINDOW * dt * pace, 6 * rise * lever * pace**2)

    @property
    def stairs(self) -> IntArray:
        """(k,) cubics per window."""
        return np.array([0, *STAIRS])[np.searchsorted(JUMPS, self.jump)]

    def per_step(self, wave: Wave) -> IntArray:
        """Return how many samples every step needs for the sake of jumps, (n - 1,)."""
        wanted = np.ones(wave.t.size - 1)
        count = self.stairs
        for knot, reach, stairs in zip(self.knots, self.reach, count, strict=True):
            if stairs:
                first = np.searchsorted(wave.u, knot - reach, side="right") - 1
                last = np.searchsorted(wave.u, knot + reach)
                part = slice(max(int(first), 0), int(last))
                gone = np.diff(wave.u[part.start : last + 1])
                needed = gone / (2 * reach) * stairs * 1.5
                wanted[part] = np.maximum(wanted[part], needed)
        return np.ceil(wanted).astype(np.int64)


def _leap(wave: Wave) -> FloatArray:
    """Return by how much ü changes in each step and those beside it, (n - 1,)."""
    leap = np.abs(np.diff(wave.change))
    wide = np.concatenate([[0.0, 0.0], leap, [0.0, 0.0]])
    return np.asarray(np.max([wide[i : i + leap.size] for i in range(5)], axis=0))


def _caps_change(piece: PathPiece) -> BoolArray:
    """Return at which of the inner knots a cap changes."""
    caps = np.stack([piece.max_speed, piece.max_yaw_rate])
    return np.asarray((caps[:, 1:] != caps[:, :-1]).any(axis=0), dtype=bool)


def _samples_per_step(wave: Wave, turn: FloatArray) -> IntArray:
    """Return how many samples steering accelerations need in each of n - 1 steps.

    Within a step the fourth derivative of a pose is about ``4 p'' u̇ u⃛ + 3 p'' ü²``.
    A cubic spline leaves it out, so α̈ is off by half a sample of what `turn` makes of
    ``4 u⃛ + 3 ü²/u̇``.

    Parameters
    ----------
    wave : Wave
    turn : (n,) s²/m, as of `TimingProblem.steering_gain`
    """
    h = np.diff(wave.t)
    # Near rest what is left of a step counts as its time so far.
    least = np.abs(wave.change[:-1]) * h / 2
    speed = np.maximum((wave.speed[1:] + wave.speed[:-1]) / 2, least)
    pull = np.maximum(np.abs(wave.change[1:]), np.abs(wave.change[:-1])) ** 2
    pull = pull / np.maximum(speed, 1e-300)
    off = np.maximum(turn[1:], turn[:-1]) * (2 * np.abs(wave.jerk) + 1.5 * pull) * h
    return np.clip(np.ceil(off / EXACT), 1, MOST).astype(np.int64)


def _divided(t: FloatArray, samples: IntArray) -> FloatArray:
    """Return times that cut every step into equal parts."""
    step = np.repeat(np.arange(samples.size), samples)
    first = np.cumsum(samples) - samples
    since = (np.arange(step.size) - first[step]) / samples[step]
    return np.append(t[step] + since * np.diff(t)[step], t[-1])


def _from_rest(t: FloatArray, pull: float, blur: float) -> FloatArray:
    """Return sample times with finer ones after the start.

    A steering acceleration is off by the share of the time since rest that a sample
    takes, and by what rounding makes of it.

    Parameters
    ----------
    t : (n,) float, s
        From 0 on.
    pull : float, m/s²
        ü at the start.
    blur : float, m s²
        Over u̇ and the cube of a sample's time: how much rounding counts.
    """
    pull = max(pull, SLOWEST)
    least = (BLURRED * blur / pull) ** 0.25
    added = [0.0, max(least, math.sqrt(2 * STILL / pull))]
    while added[-1] < t[-1] / 3:
        step = max(SINCE_REST * added[-1], least)
        k = int(np.searchsorted(t, added[-1] + step * 0.5))
        if t[k] - added[-1] <= step * 1.5 and t[k + 1] - t[k] <= step:
            return np.concatenate([added, t[k:]])
        added.append(added[-1] + step)
    return t
