"""When to sample a motion so that its steering accelerations come out right.

They depend on the third derivatives of the pose. Those of a spline through samples are
right only where the true ones change slowly: steps in which they change much get more
samples. Next to rest they are off by a share of the time since then: there samples
follow each other in shares of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from omniplan.timing.rounding import STAIRS
from omniplan.timing.solver import PieceProfile, TimingProblem
from omniplan.timing.waves import Wave, graded

__all__ = [
    "BLUR",
    "BLURRED",
    "EXACT",
    "MOST",
    "SLOWEST",
    "STILL",
    "Windows",
    "swing_times",
]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

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
"""... with no cubics, few or many, as the jump is a share of the limit."""
STILL = 1e-8
"""Way per step at least, m: shorter ones would count as standing."""
SLOWEST = 1e-3
"""Paces and pulls count as this at least, m/s and m/s², or a share."""


@dataclass(frozen=True, eq=False)
class Windows:
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
    ) -> Windows:
        """Return those of a piece that is passed like that, in steps of dt, s."""
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


def swing_times(
    wave: Wave, windows: Windows, turn: FloatArray, blur: FloatArray, slowest: float
) -> FloatArray:
    """Return when to sample a wave, knots of it included, (m,) s.

    Parameters
    ----------
    wave : Wave
        With n knots.
    windows : Windows
    turn : (n,) float, s²/m
        As of `TimingProblem.steering_gain`.
    blur : (n,) float, m s²
        What rounding makes of a steering acceleration is this over u̇ and the cube of a
        sample's time, as a share of what it may be.
    slowest : float, m/s
        Paces count as this at least.
    """
    step = np.diff(wave.t)
    samples = np.maximum(_samples_per_step(wave, turn), windows.per_step(wave))
    # Next to a long sample a short one shares its error, many times over.
    middle = (wave.t[1:] + wave.t[:-1]) / 2
    samples = np.ceil(step / graded(middle, step / samples) - 1e-9).astype(np.int64)
    # A third derivative is blurred by `blur / h³` per u̇.
    pace = np.minimum(wave.speed[1:], wave.speed[:-1])
    pace = np.maximum(pace, slowest)
    least = np.cbrt(np.maximum(blur[1:], blur[:-1]) / pace)
    most = np.clip(step / least, 1, MOST).astype(np.int64)
    t = _divided(wave.t, np.minimum(samples, most))
    last = t[-1]
    for end in (0, -1):
        pull = abs(float(wave.change[end]))
        t = _from_rest(t, pull, float(blur[end]))
        t = (last - t)[::-1]
    return t


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
