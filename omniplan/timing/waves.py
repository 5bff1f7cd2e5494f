"""A way in time as a cubic spline: what turns a profile into a C² motion.

The fastest profile switches from full acceleration to full braking at once; a C² spline
through samples of it would overshoot. So u̇(t) is replaced by the quadratic B-spline
whose coefficients are its values amid the steps (Schoenberg's operator): u̇ and ü are
then weighted means of those nearby, so constant limits are kept by themselves, whatever
the steps, and constant ü stays as it is. At both ends u(t) is continued as an even
function: the motion starts with full acceleration and takes no longer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from omniplan.timing.solver import PieceProfile

__all__ = ["Wave", "graded", "spaced", "wave_of"]

FloatArray = npt.NDArray[np.float64]

GRADE = 0.25
"""By this share of itself a step may differ from the next."""


@dataclass(frozen=True, eq=False)
class Wave:
    """u(t) as a cubic spline, from rest to rest."""

    t: FloatArray
    """(n,) s, the knots, from 0 on."""
    u: FloatArray
    """(n,) m."""
    speed: FloatArray
    """(n,) u̇, m/s."""
    change: FloatArray
    """(n,) ü, m/s²; linear in between."""

    def at(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return u, u̇ and ü at times t, (m,)."""
        k = np.searchsorted(self.t, t, side="right") - 1
        k = np.clip(k, 0, self.t.size - 2)
        h = t - self.t[k]
        jerk = self.jerk[k]
        change = self.change[k]
        u = self.u[k] + h * (self.speed[k] + h * (change / 2 + h * jerk / 6))
        return u, self.speed[k] + h * (change + h * jerk / 2), change + h * jerk

    @property
    def jerk(self) -> FloatArray:
        """(n - 1,) third derivative of every step, m/s³."""
        return np.asarray(np.diff(self.change) / np.diff(self.t))

    def passes(self, places: FloatArray) -> FloatArray:
        """Return when places strictly inside are passed, (m,) s; by halving."""
        k = np.clip(np.searchsorted(self.u, places, side="right") - 1, 0, None)
        k = np.minimum(k, self.u.size - 2)
        low, high = self.t[k], self.t[k + 1]
        for _ in range(50 if places.size else 0):
            middle = (low + high) / 2
            is_before = self.at(middle)[0] < places
            low = np.where(is_before, middle, low)
            high = np.where(is_before, high, middle)
        return np.asarray((low + high) / 2)


def graded(t: FloatArray, step: FloatArray) -> FloatArray:
    """Return steps asked for at times, (n,), made smaller where they change too fast.

    Parameters
    ----------
    t, step : (n,) float, s
    """
    slope = GRADE * t
    rising = np.minimum.accumulate(step - slope) + slope
    falling = np.minimum.accumulate((step + slope)[::-1])[::-1] - slope
    return np.minimum(rising, falling)


def spaced(t: FloatArray, step: FloatArray, least: int = 4) -> FloatArray:
    """Return knots from the first to the last time that are steps apart, (m,) s.

    Parameters
    ----------
    t : (n,) float, s
    step : (n,) float, s
        Wanted at those times, graded.
    least : int
        Number of steps at least.
    """
    dt = np.diff(t)
    slope = np.diff(step) / dt
    # ∫ dt / step, the step being linear in between: g t / step = log1p(g t / step₀).
    rise = slope * dt / step[:-1]
    is_flat = np.abs(rise) < 1e-6
    slope = np.where(is_flat, 1.0, slope)
    counts = np.where(is_flat, dt / step[:-1], np.log1p(rise) / slope)
    passed = np.concatenate([[0.0], np.cumsum(counts)])
    n = max(int(np.ceil(passed[-1] - 1e-9)), least)
    at = np.linspace(0.0, passed[-1], n + 1)
    k = np.clip(np.searchsorted(passed, at, side="right") - 1, 0, t.size - 2)
    since = at - passed[k]
    bent = np.where(is_flat[k], 0.0, slope[k] * since)
    grown = np.where(is_flat[k], since, np.expm1(bent) / slope[k])
    found = t[k] + step[k] * grown
    found[-1] = t[-1]
    return np.asarray(found)


def wave_of(profile: PieceProfile, t: FloatArray) -> Wave:
    """Return the spline of a profile with knots t.

    Parameters
    ----------
    profile : PieceProfile
    t : (n,) float, s
        From 0 to the profile's duration, n > 3.
    """
    h = np.diff(t)
    middle = (t[1:] + t[:-1]) / 2
    mean = np.interp(middle, profile.times, np.sqrt(profile.x))
    # Speed is odd about both ends.
    mean = np.concatenate([-mean[:1], mean, -mean[-1:]])
    step = np.concatenate([h[:1], h, h[-1:]])
    change = 2 * np.diff(mean) / (step[:-1] + step[1:])
    speed = mean[:-1] * step[1:] + mean[1:] * step[:-1]
    speed = speed / (step[:-1] + step[1:])
    speed[[0, -1]] = 0.0
    gone = h * (speed[:-1] + h * (2 * change[:-1] + change[1:]) / 6)
    u = np.concatenate([[0.0], np.cumsum(gone)])
    # Means of a speed are a little less where it peaks.
    first, length = profile.u[0], profile.u[-1] - profile.u[0]
    stretch = length / u[-1]
    u = first + u * stretch
    u[-1] = profile.u[-1]
    return Wave(t, u, speed * stretch, change * stretch)
