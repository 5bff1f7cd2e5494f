"""Rounding corners: where the wheels can follow, a vehicle need not stop.

A stop of a route lies between two pieces. From a pose before it to one after it a
quintic in (x, y, θ) leads that keeps position, direction and bend at both ends; of a
vehicle bound to a line only x and y are blended, and the heading follows the way. If
that is permitted, free and quicker than stopping, steering and going on, the stop is
gone. A cusp stays.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.interpolate import BPoly, CubicSpline

from configspace.omni_curve import from_twist
from omniplan.judging.rows import Tolerances
from omniplan.planning.moves import Move
from omniplan.planning.permits import Configuration, Permits
from omniplan.planning.route import Route
from omniplan.planning.task import Task
from omniplan.samples import HEADING_LENGTH, locked
from omniplan.timing.path_motion import pieces_of
from omniplan.timing.shape import shape_of
from omniplan.timing.solver import TimingProblem

__all__ = ["is_free", "rounded_off", "timed"]

FloatArray = npt.NDArray[np.float64]

SHARES = (0.5, 0.25, 0.1)
"""How much of the shorter piece is given away at a corner; tried in turn."""
LONGEST = 2.0
"""No more than this, in the metres of `Path.parameter`."""
SHORTEST = 0.02
"""Less is not worth it, likewise."""
POSES = 16
"""Poses of a blend."""
CUSP = -0.3
"""Directions whose product is below this are a cusp."""
GRID = 60
"""Grid intervals for the time of a piece."""
FILLED, CLOSE = 0.2, 5e-3
"""Poses of what stays are at most, and the first ones at least, so far apart, m."""
SLOWEST = 1e-3
"""Where K moves by less per metre of the path's parameter it turns on the spot."""
GAIN = 0.02
"""A stop vanishes if that saves this, s."""


@dataclass(frozen=True, eq=False)
class _Piece:
    """What lies between two stops, and how long it takes."""

    poses: FloatArray
    u: FloatArray
    """(n,) m, as `Path.parameter`."""
    times: dict[int, float]
    """Per representation that is permitted: s, from rest to rest."""
    ends: dict[int, tuple[Configuration, Configuration]]

    @property
    def is_turn(self) -> bool:
        """Whether K stays where it is."""
        return float(np.ptp(self.poses[:, :2], axis=0).max()) < SLOWEST

    @cached_property
    def spline(self) -> CubicSpline:
        """The poses over u."""
        return CubicSpline(self.u, self.poses)

    def filled(self, low: float, high: float) -> FloatArray:
        """Return the poses between two places, both included and none far apart."""
        inner = self.u[(self.u > low + CLOSE) & (self.u < high - CLOSE)]
        places = [np.array([low])]
        for x, y in itertools.pairwise([low, *inner.tolist(), high]):
            count = max(math.ceil((y - x) / FILLED), 1)
            places.append(x + np.arange(1, count + 1) / count * (y - x))
        return np.asarray(self.spline(np.concatenate(places)), dtype=np.float64)


def rounded_off(task: Task, permits: Permits, route: Route) -> tuple[Route, float]:
    """Return a route with fewer stops that is quicker, or the same, and its time.

    The time is that of the optimum on a coarse grid, s, with the wheels turning at
    stops as quickly as each can by itself; infinite where that is not known.

    Parameters
    ----------
    task : Task
    permits : Permits
    route : Route
    """
    corners = _Corners(task, permits)
    parts = _parts(route)
    known = [None if task.budget.is_late else corners.piece(part) for part in parts]
    done, driven, i = parts[:1], known[:1], 1
    while i < len(parts):
        last, merged, used = driven[-1], None, 1
        if last is not None and not task.budget.is_late:
            merged, used = corners.without_stops(last, known[i : i + 2])
        if merged is None:
            done.append(_going_on(done[-1], parts[i]))
            driven.append(known[i])
        else:
            done[-1] = merged.poses
            driven[-1] = merged
        i += used
    stops = np.cumsum([len(part) - 1 for part in done[:-1]]).tolist()
    poses = np.concatenate([done[0], *(part[1:] for part in done[1:])])
    return Route(locked(poses), tuple(stops)), corners.with_stops(driven)


def timed(task: Task, permits: Permits, route: Route) -> float:
    """Return the time of a route as `rounded_off` does, s; inf if not permitted.

    Parameters
    ----------
    task : Task
    permits : Permits
    route : Route
    """
    corners = _Corners(task, permits)
    return corners.with_stops([corners.piece(part) for part in _parts(route)])


def is_free(task: Task, poses: FloatArray) -> bool:
    """Return whether the arcs from pose to pose meet nothing.

    Parameters
    ----------
    task : Task
    poses : (n, 3) float, m, m, rad
    """
    for a, b in itertools.pairwise(poses):
        task.budget.check()
        if task.checker is not None and not task.checker.is_motion_free(Move.arc(a, b)):
            return False
    return True


def _parts(route: Route) -> list[FloatArray]:
    """Return the poses from stop to stop."""
    cuts = [0, *route.stops, len(route.poses) - 1]
    return [route.poses[a : b + 1] for a, b in itertools.pairwise(cuts)]


def _going_on(before: FloatArray, after: FloatArray) -> FloatArray:
    """Return poses with full turns added to go on from others without a jump."""
    turns = np.rint((before[-1, 2] - after[0, 2]) / (2 * np.pi))
    shift = np.array([0.0, 0.0, 2 * np.pi * turns])
    return np.asarray(after + shift, dtype=np.float64)


class _Corners:
    """Makes pieces and blends and tells what they are worth."""

    def __init__(self, task: Task, permits: Permits) -> None:
        self._task, self._permits = task, permits
        self._line = task.space.line_beta

    def piece(self, poses: FloatArray) -> _Piece | None:
        """Return a piece with its times; None if it cannot be driven in one go."""
        self._task.budget.check()
        space, reference = self._task.space, self._task.vehicle.reference
        point = reference.real, reference.imag
        path = Route(poses, ()).to_path("piece", point)
        found = pieces_of(path)
        if len(found) != 1:
            return None
        shape = shape_of(found[0], space, Tolerances())
        signs = [sign for sign, fault in shape.faults.items() if fault is None]
        if not signs:
            return None
        problem = TimingProblem(found, self._task.vehicle, GRID)
        profiles = problem.solve([0] * len(signs), signs)
        times = {
            sign: profile.duration
            for sign, profile in zip(signs, profiles, strict=True)
            if math.isfinite(profile.duration)
        }
        return _Piece(poses, path.parameter, times, shape.ends) if times else None

    def without_stops(
        self, before: _Piece, then: list[_Piece | None]
    ) -> tuple[_Piece | None, int]:
        """Return one piece in place of several, if that is quicker, and how many.

        A turn on the spot may be left out, with the stops before and after it.
        """
        first = then[0]
        if first is None:
            return None, 1
        if len(then) > 1 and then[1] is not None and first.is_turn:
            worth = self.with_stops((before, first, then[1]))
            merged = self._merged(before, then[1], worth)
            if merged is not None:
                return merged, 2
        worth = self.with_stops((before, first))
        return self._merged(before, first, worth), 1

    def _merged(self, before: _Piece, after: _Piece, worth: float) -> _Piece | None:
        """Return one piece in place of two, if it takes less than a time."""
        size = min(before.u[-1], after.u[-1])
        for share in SHARES:
            self._task.budget.check()
            length = min(share * float(size), LONGEST)
            if length < SHORTEST:
                return None
            poses = self._blended(before, after, length)
            if poses is None or not is_free(self._task, poses):
                continue
            head = before.filled(0.0, float(before.u[-1]) - length)
            tail = _going_on(poses, after.filled(length, float(after.u[-1])))
            piece = self.piece(np.concatenate([head[:-1], poses, tail[1:]]))
            if piece is not None and min(piece.times.values()) < worth - GAIN:
                return piece
        return None

    def with_stops(self, pieces: Sequence[_Piece | None]) -> float:
        """Return the time of pieces with stops between them, s; inf without one."""
        sure = [piece for piece in pieces if piece is not None]
        if len(sure) < len(pieces):
            return math.inf
        return self._with_stops(sure)

    def _with_stops(self, pieces: Sequence[_Piece]) -> float:
        best = {pieces[0].ends[sign][1]: time for sign, time in pieces[0].times.items()}
        for piece in pieces[1:]:
            best = {
                piece.ends[sign][1]: time
                + min(
                    so_far + self._permits.steering_time(at, piece.ends[sign][0])
                    for at, so_far in best.items()
                )
                for sign, time in piece.times.items()
            }
        return min(best.values())

    def _blended(
        self, before: _Piece, after: _Piece, length: float
    ) -> FloatArray | None:
        """Return the poses of a blend that is permitted."""
        low, high = float(before.u[-1]) - length, length
        ends = []
        for spline, at in ((before.spline, low), (after.spline, high)):
            ends.append(np.stack([spline(at), spline(at, 1), spline(at, 2)]))
        turns = np.rint((ends[0][0, 2] - ends[1][0, 2]) / (2 * np.pi))
        ends[1][0, 2] += 2 * np.pi * turns  # the shorter way round
        if self._line is None:
            scale = np.array([1.0, 1.0, HEADING_LENGTH])
            if _aligned(ends[0][1] * scale, ends[1][1] * scale) < CUSP:
                return None
            poses, rates = _quintic(ends[0], ends[1], scale)
        else:
            ways = [_over_length(end) for end in ends]
            if ways[0] is None or ways[1] is None:
                return None
            if _aligned(ways[0][1], ways[1][1]) < CUSP:
                return None
            places, tangents = _quintic(ways[0], ways[1], np.ones(2))
            poses, rates = _headed(places, tangents, ends[0][0, 2], ends[1][0, 2])
        return poses if self._is_permitted(poses, rates) else None

    def _is_permitted(self, poses: FloatArray, rates: FloatArray) -> bool:
        """Return whether the poses' twists are permitted in a representation."""
        v = (rates[:, 0] + 1j * rates[:, 1]) * np.exp(-1j * poses[:, 2])
        twists = np.stack([v.real, v.imag, rates[:, 2]], axis=-1)
        line, kappa_g = self._line, self._permits.kappa_g
        for sign in (1, -1):
            kappa_n, beta, _ = from_twist(twists, kappa_g, sign)
            if line is not None:
                if np.cos(beta - line).min() < 0:
                    continue
                beta = np.full_like(beta, line)
            speeds = (
                self._permits.v_max(k, b, b, reverse=sign < 0)
                for k, b in zip(kappa_n.tolist(), beta.tolist(), strict=True)
            )
            if all(speed > 0 for speed in speeds):
                return True
        return False


def _aligned(a: FloatArray, b: FloatArray) -> float:
    """Return the cosine between two directions."""
    size = float(np.linalg.norm(a)) * float(np.linalg.norm(b))
    return float(a @ b) / max(size, 1e-12)


def _over_length(end: FloatArray) -> FloatArray | None:
    """Return place, tangent and bend over the length of K's way; None if it rests."""
    speed = float(np.hypot(*end[1, :2]))
    if speed < SLOWEST:
        return None
    return np.stack([end[0, :2], end[1, :2] / speed, end[2, :2] / speed**2])


def _quintic(
    a: FloatArray, b: FloatArray, scale: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return values and first derivatives of the quintic between two ends.

    Parameters
    ----------
    a, b : (3, d) float
        Value, first and second derivative over a length.
    scale : (d,) float
        What each value counts in that length.
    """
    w = np.linspace(0.0, 1.0, POSES + 1)
    length = float(np.linalg.norm((b[0] - a[0]) * scale))
    for _ in range(3):
        quintic = BPoly.from_derivatives([0.0, length], np.stack([a, b]))
        values = quintic(w * length)
        length = float(np.linalg.norm(np.diff(values, axis=0) * scale, axis=1).sum())
    quintic = BPoly.from_derivatives([0.0, length], np.stack([a, b]))
    return quintic(w * length), quintic.derivative()(w * length)


def _headed(
    places: FloatArray, tangents: FloatArray, first: float, last: float
) -> tuple[FloatArray, FloatArray]:
    """Return poses along a way whose heading follows it, and their derivatives."""
    course = np.unwrap(np.arctan2(tangents[:, 1], tangents[:, 0]))
    heading = first + course - course[0]
    heading[-1] = last + 2 * np.pi * np.rint((heading[-1] - last) / (2 * np.pi))
    steps = np.hypot(*np.diff(places, axis=0).T)
    bend = np.gradient(heading, np.concatenate([[0.0], np.cumsum(steps)]))
    bend *= np.hypot(*tangents.T)
    poses = np.concatenate([places, heading[:, None]], axis=1)
    return poses, np.concatenate([tangents, bend[:, None]], axis=1)
