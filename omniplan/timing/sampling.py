"""From a speed profile on a grid to poses whose splines keep the limits.

The fastest profile switches from full acceleration to full braking at once; a C² spline
through samples of it would overshoot. So u(t) is replaced by the uniform cubic B-spline
whose control points are ``u(t_k)``: its u̇ and ü are weighted means of those nearby, so
it keeps constant limits by itself, it is C², and a cubic spline through its samples
gives it back. At both ends u(t) is continued as an even function: the motion starts
with full acceleration and takes no longer.

A steering acceleration also depends on the third derivatives of the pose. Those of a
spline through samples are right only where the true ones change slowly: the path's own
jumps are rounded off (see `rounding`), and steps in which they change much get more
samples. Next to rest they are off by a share of the time since then: there samples
follow each other in shares of it.

Where limits change within a few samples the means may break them. There the limits are
tightened and the piece is timed again, a few times over.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from omniplan.timing.path_motion import PathPiece
from omniplan.timing.solver import PieceProfile, TimingProblem

__all__ = ["SampledPiece", "sample_piece"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

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
EXACT = 0.01
"""Share of a limit on the steering acceleration by which samples may miss it ..."""
MOST = 48
"""... unless a step needs more samples than this."""
SINCE_REST = 0.05
"""Share of the time since rest, or until it, that a sample may take ..."""
BLUR = 1e-14
"""... but not less time than lets rounding, of third derivatives so much over the cube
of a sample's time per metre from the origin, be a share `BLURRED` of the limit."""
BLURRED = 0.02
WINDOW = 6.0
"""Steps before and after a knot of the path over which its jump is rounded off."""
IN_WINDOW = 4
"""Least number of samples in a step there."""
WORTH = 5e-4
"""Twice as many steps must gain more than this share of time."""
STILL = 1e-8
"""``length / steps²`` at least, m: shorter steps would count as standing."""
SHORTEST = 1e-5
"""Least step, s."""
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
    most = _most_steps(problem, piece, profile)
    best: SampledPiece | None = None
    for finer in range(DOUBLINGS + 1):
        count = max(min(steps * 2**finer, most), 4)
        found = _fitted(problem, piece, profile, count, tight)
        gain = math.inf if best is None else _price(best) - _price(found)
        if gain > WORTH * profile.duration:
            best = found
        elif finer > 1:  # once may be by chance
            break
        assert best is not None
        if _price(best) < (1 + LOSS) * profile.duration or count == most:
            break
    assert best is not None
    return best


def _most_steps(problem: TimingProblem, piece: int, profile: PieceProfile) -> int:
    length = problem.pieces[piece].length
    return int(min(math.sqrt(length / STILL), profile.duration / SHORTEST))


def _fitted(
    problem: TimingProblem,
    piece: int,
    profile: PieceProfile,
    count: int,
    tight: FloatArray,
) -> SampledPiece:
    """Return the best samples that tightening the limits leads to."""
    sigma, dt = profile.sigma, profile.duration / count
    max_change = float(np.sqrt(profile.x.max())) / (RAMP * dt)
    reach = np.zeros(0)
    if problem.bounds_steering_acceleration:
        knots = problem.pieces[piece].u[1:-1]
        pace = np.sqrt(np.interp(knots, profile.u, profile.x))
        reach = WINDOW * dt * np.maximum(pace, SLOWEST * pace.max(initial=0.0))
        problem, piece = problem.rounded(piece, reach), 0
        (first,) = problem.solve([0], [sigma], max_change=[max_change])
        problem = problem.refined([[first]])
        tight = np.interp(problem.nodes(0), profile.u, tight)
    tight = tight * (1 + MARGIN)
    best: SampledPiece | None = None
    for _ in range(ROUNDS):
        (found,) = problem.solve(
            [piece], [sigma], max_change=[max_change], tight=[tight]
        )
        sampled, place, factor = _smooth(problem, piece, found, count, reach)
        if best is None or _price(sampled) < _price(best):
            best = sampled
        if sampled.excess <= 1:
            break
        tight = tight * _spread(found, place, factor, found.duration / count)
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
    reach: FloatArray,
) -> tuple[SampledPiece, FloatArray, FloatArray]:
    """Return samples, and where between them time is too short by which factor.

    `reach` tells how far about its inner knots the path was rounded off.
    """
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
    given = problem.pieces[piece]
    knots = given.u[1:-1][_caps_change(given)]
    at = _at_knots(c, u, knots)
    k = np.minimum(at.astype(np.int64), count - 1)
    h = at - k
    slow = (1 - h) ** 2 * rise[k] + (1 + 2 * h * (1 - h)) * rise[k + 1]
    slow = (slow + h**2 * rise[k + 2]) / 2
    bent = (1 - h) * change[k] + h * change[k + 1]
    # A cap changes at a knot: both sides of it count.
    place = np.concatenate([u, middle, np.nextafter(knots, first), knots])
    factor = problem.slowdowns(
        piece,
        profile.sigma,
        place,
        np.concatenate([speed, between, slow, slow]),
        np.concatenate([change, (change[1:] + change[:-1]) / 2, bent, bent]),
    )
    # Something must be left for the proof between the samples.
    factor = factor * (1 + MARGIN / 2)
    if problem.bounds_steering_acceleration:
        turn, lever = problem.steering_gain(piece, u)
        samples = _samples_per_step(c, dt, turn)
        samples[_is_rounded(given, u, reach)] *= IN_WINDOW
        far = float(np.abs(given.poses_at(u)).max()) * BLUR / BLURRED
        blur = far * lever
        # A third derivative is blurred by `blur / h³` per u̇.
        pace = np.maximum(np.minimum(speed[1:], speed[:-1]), dt * SLOWEST)
        least = np.cbrt(np.maximum(blur[1:], blur[:-1]) / pace)
        most = np.clip(dt / least, 1, MOST).astype(np.int64)
        s = _spaced(np.minimum(samples, most))
        s = _from_rest(s, dt, float(change[0]), float(blur[0]))
        pull, over = float(-change[-1]), float(blur[-1])
        s = count - _from_rest((count - s)[::-1], dt, pull, over)[::-1]
        t, u = s * dt, _spline_at(c, s)
        u[[0, -1]] = first, last
    return SampledPiece(t, u, given, float(factor.max())), place, factor


def _caps_change(piece: PathPiece) -> BoolArray:
    """Return at which of the inner knots a cap changes."""
    caps = np.stack([piece.max_speed, piece.max_yaw_rate])
    return np.asarray((caps[:, 1:] != caps[:, :-1]).any(axis=0), dtype=bool)


def _at_knots(c: FloatArray, u: FloatArray, knots: FloatArray) -> FloatArray:
    """Return where the B-spline, which grows, takes inner knots; by halving."""
    k = np.searchsorted(u, knots, side="right") - 1
    low = np.clip(k, 0, u.size - 2).astype(np.float64)
    high = low + 1
    for _ in range(50):
        middle = (low + high) / 2
        is_before = _spline_at(c, middle) < knots
        low, high = np.where(is_before, middle, low), np.where(is_before, high, middle)
    return np.asarray((low + high) / 2)


def _is_rounded(piece: PathPiece, u: FloatArray, reach: FloatArray) -> BoolArray:
    """Return which of the steps between u, (n,), lie where the path was rounded off."""
    stairs = np.diff(piece.u) < 2 * reach.max(initial=0.0)
    k = np.clip(np.searchsorted(piece.u, u, side="right") - 1, 0, stairs.size - 1)
    is_within = stairs[k] & (reach.size > 0)
    return np.asarray(is_within[1:] | is_within[:-1], dtype=bool)


def _samples_per_step(c: FloatArray, dt: float, turn: FloatArray) -> IntArray:
    """Return how many samples steering accelerations need in each of n - 1 steps.

    Within a step the fourth derivative of a pose is about ``4 p'' u̇ u⃛ + 3 p'' ü²``.
    A cubic spline leaves it out, so α̈ is off by half a sample of ``α' (4 u⃛ + 3 ü²/u̇)``.

    Parameters
    ----------
    c : (n + 2,) m, control points
    dt : float, s
    turn : (n,) s²/m, largest |α'| over the limit on α̈
    """
    rise = np.diff(c) / dt
    change = np.diff(rise) / dt
    jerk = np.abs(np.diff(change)) / dt
    # Near rest what is left of a step counts as its time so far.
    speed = np.maximum(rise[1:-1], np.abs(change[:-1]) * dt / 2)
    pull = np.maximum(np.abs(change[1:]), np.abs(change[:-1])) ** 2
    pull = pull / np.maximum(speed, 1e-300)
    off = np.maximum(turn[1:], turn[:-1]) * (2 * jerk + 1.5 * pull) * dt
    return np.clip(np.ceil(off / EXACT), 1, MOST).astype(np.int64)


def _spaced(samples: IntArray) -> FloatArray:
    """Return sample times, counted in steps, from how many a step has."""
    step = np.repeat(np.arange(samples.size), samples)
    first = np.cumsum(samples) - samples
    since = (np.arange(step.size) - first[step]) / samples[step]
    return np.append(step + since, float(samples.size))


def _from_rest(s: FloatArray, dt: float, pull: float, blur: float) -> FloatArray:
    """Return sample times with finer ones after the start, counted in steps.

    Parameters
    ----------
    s : (n,) float
        From 0 on.
    dt : float, s
    pull : float, m/s²
        ü at the start.
    blur : float, m s²
        Over u̇ and the cube of a sample's time: how much rounding counts.
    """
    pull = max(pull, SLOWEST)
    first = max((blur / pull) ** 0.25, math.sqrt(2 * STILL / pull))
    added = [0.0]
    while added[-1] < s[-1] / 3:
        t = max(added[-1] * dt, first)
        step = max(SINCE_REST * t, (blur / (pull * t)) ** (1 / 3)) / dt
        if len(added) == 1:
            step = first / dt
        k = int(np.searchsorted(s, added[-1] + step * 0.5))
        if s[k] - added[-1] <= step * 1.5 and s[k + 1] - s[k] <= step:
            return np.concatenate([added, s[k:]])
        added.append(added[-1] + step)
    return s


def _spline_at(c: FloatArray, s: FloatArray) -> FloatArray:
    """Return a uniform cubic B-spline, s counted in steps from its start."""
    k = np.minimum(s.astype(np.int64), c.size - 4)
    h = s - k
    return np.asarray(
        (
            (1 - h) ** 3 * c[k]
            + (3 * h**3 - 6 * h**2 + 4) * c[k + 1]
            + (-3 * h**3 + 3 * h**2 + 3 * h + 1) * c[k + 2]
            + h**3 * c[k + 3]
        )
        / 6
    )


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
