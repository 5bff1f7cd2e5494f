"""From a speed profile on a grid to poses whose splines keep the limits.

The fastest profile switches from full acceleration to full braking at once; a C² spline
through samples of it would overshoot. So u(t) is replaced by the uniform cubic B-spline
whose control points are ``u(t_k)``: its u̇ and ü are weighted means of those nearby, so
it keeps constant limits by itself, it is C², and a cubic spline through its samples
gives it back. At both ends u(t) is continued as an even function: the motion starts
with full acceleration and takes no longer.

Where limits change within a few samples the means may break them. There the limits are
tightened and the piece is timed again, a few times over.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from omniplan.timing_solver import PieceProfile, TimingProblem

__all__ = ["SampledPiece", "sample_piece"]

FloatArray = npt.NDArray[np.float64]

RAMP = 2
"""Steps in which u̇ may come up from rest where nothing else bounds ü."""
MARGIN = 5e-4
"""By how much the limits are made tighter, so that keeping them can be proved."""
ROUNDS = 8
"""How often a piece is timed again."""
LOSS = 2e-3
"""With more loss of time than this ..."""
DOUBLINGS = 3
"""... the number of steps is doubled, this often at most."""
STILL = 1e-8
"""``length / steps²`` at least, m: shorter steps would count as standing."""
SHORTEST = 1e-5
"""Least step, s."""


@dataclass(frozen=True, eq=False)
class SampledPiece:
    """Samples of one piece, from rest to rest."""

    t: FloatArray
    """(n,) s, from the start of the piece, uniform."""
    u: FloatArray
    """(n,) m, from the start of the path."""
    excess: float
    """By how much time had to be stretched for all limits to hold; ≤ 1: they do."""


def sample_piece(
    problem: TimingProblem,
    piece: int,
    profile: PieceProfile,
    steps: int,
    tight: FloatArray | None = None,
) -> SampledPiece:
    """Return samples of the fastest way along one piece that keep its limits.

    Parameters
    ----------
    problem : TimingProblem
    piece : int
    profile : PieceProfile
        That of the piece in the representation to drive, with a way through.
    steps : int
        Number of steps in time.
    tight : (n,) float, ≥ 1, optional
        How much more slowly to pass every node of the profile.
    """
    tight = np.ones(profile.u.size) if tight is None else tight
    length = problem.pieces[piece].length
    most = int(min(math.sqrt(length / STILL), profile.duration / SHORTEST))
    best: SampledPiece | None = None
    for finer in range(DOUBLINGS + 1):
        count = max(min(steps * 2**finer, most), 4)
        found = _fitted(problem, piece, profile, count, tight)
        if best is None or _price(found) < _price(best):
            best = found
        if _price(best) < (1 + LOSS) * profile.duration or count == most:
            break
    assert best is not None
    return best


def _fitted(
    problem: TimingProblem,
    piece: int,
    profile: PieceProfile,
    count: int,
    tight: FloatArray,
) -> SampledPiece:
    """Return the best samples that tightening the limits leads to."""
    ramp = RAMP * profile.duration / count
    max_change = float(np.sqrt(profile.x.max())) / ramp
    tight = tight * (1 + MARGIN)
    best: SampledPiece | None = None
    for _ in range(ROUNDS):
        (found,) = problem.solve(
            [piece], [profile.sigma], max_change=[max_change], tight=[tight]
        )
        sampled, place, factor = _smooth(problem, piece, found, count)
        if best is None or _price(sampled) < _price(best):
            best = sampled
        if sampled.excess <= 1:
            break
        tight = tight * _spread(found, place, factor, float(sampled.t[1]))
    assert best is not None
    return best


def _price(sampled: SampledPiece) -> float:
    """Return the duration once the whole piece is slowed down to keep its limits."""
    return float(sampled.t[-1]) * max(sampled.excess, 1.0)


def _smooth(
    problem: TimingProblem,
    piece: int,
    profile: PieceProfile,
    count: int,
) -> tuple[SampledPiece, FloatArray, FloatArray]:
    """Return samples, and where between them time is too short by which factor."""
    t = np.linspace(0.0, profile.duration, count + 1)
    dt = float(t[1])
    c = _u_at(profile, t)
    first, last = float(profile.u[0]), float(profile.u[-1])
    c = np.concatenate([[2 * first - c[1]], c, [2 * last - c[-2]]])
    c[0], c[-1] = 2 * c[1] - c[0], 2 * c[-2] - c[-1]  # even about both ends
    u = (c[:-2] + 4 * c[1:-1] + c[2:]) / 6
    # Means of an even function leave the ends by a little.
    stretch = (last - first) / (u[-1] - u[0])
    c = first + (c - u[0]) * stretch
    u = first + (u - u[0]) * stretch
    u[[0, -1]] = first, last
    rise = np.diff(c) / dt
    change = np.diff(rise) / dt
    speed = (rise[1:] + rise[:-1]) / 2
    between = (rise[:-2] + 6 * rise[1:-1] + rise[2:]) / 8
    middle = (c[:-3] + 23 * c[1:-2] + 23 * c[2:-1] + c[3:]) / 48
    place = np.concatenate([u, middle])
    factor = problem.slowdowns(
        piece,
        profile.sigma,
        place,
        np.concatenate([speed, between]),
        np.concatenate([change, (change[1:] + change[:-1]) / 2]),
    )
    # Something must be left for the proof between the samples.
    factor = factor * (1 + MARGIN / 2)
    return SampledPiece(t, u, float(factor.max())), place, factor


def _u_at(profile: PieceProfile, t: FloatArray) -> FloatArray:
    """Return u at times t, ü being constant over each interval of the grid."""
    times, speed = profile.times, np.sqrt(profile.x)
    j = np.clip(np.searchsorted(times, t, side="right") - 1, 0, times.size - 2)
    s = t - times[j]
    change = (speed[j + 1] - speed[j]) / (times[j + 1] - times[j])
    u = profile.u[j] + s * (speed[j] + s * change / 2)
    return np.asarray(np.minimum(u, profile.u[-1]))


def _spread(
    profile: PieceProfile, place: FloatArray, factor: FloatArray, dt: float
) -> FloatArray:
    """Return by how much to tighten the limits at every node of the grid."""
    times = profile.times
    worst = np.ones(profile.u.size)
    for at in np.flatnonzero(factor > 1):
        t = float(np.interp(place[at], profile.u, times))
        low = np.searchsorted(times, t - 2 * dt)
        high = np.searchsorted(times, t + 2 * dt, side="right")
        part = slice(max(int(low) - 1, 0), int(high) + 1)
        worst[part] = np.maximum(worst[part], factor[at] * (1 + MARGIN / 4))
    return worst
