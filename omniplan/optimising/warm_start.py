"""From a trajectory or a path to the motion that a solver starts with."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from configspace import PermissibleSpace, Problem
from omniplan.errors import InvalidTrajectory
from omniplan.motion import PoseMotion, stops_of
from omniplan.optimising.setting import Guess, Leg
from omniplan.path import Path
from omniplan.proving import prove
from omniplan.samples import HEADING_LENGTH
from omniplan.timing.path_motion import PathPiece, pieces_of
from omniplan.trajectory import Trajectory

__all__ = [
    "Course",
    "courses_of",
    "guess_of",
    "leg_through",
    "merged",
    "moved",
    "rounded",
    "signs_of",
    "splines_of",
]

FloatArray = npt.NDArray[np.float64]

DENSE = 400
"""Poses by which the course between two stops is known."""
STILL = 1e-4
"""A way shorter than this is none, m."""
RAMP = 0.2
"""Share of its time in which a motion that is under way is brought from rest."""
UNHURRIED = 0.3
"""Share of the slowest speed limit at which a path without times is thought driven."""
LEAST, MOST = 8, 120
"""Numbers of intervals of a leg."""
TOGETHER = 3
"""So many times the number of intervals of the longest leg all may have."""
ROUND = 0.15
"""Share of the time of a leg by which a corner without a stop is rounded."""
CUSP = math.radians(120)
"""A motion that leaves a stop at a larger angle is a cusp, rad."""


@dataclass(frozen=True, eq=False)
class Course:
    """Poses of K between two stops, densely, from rest to rest."""

    t: FloatArray
    """(m,) s, from 0."""
    poses: FloatArray
    """(m, 3) m, m, rad, the heading unwrapped."""

    @property
    def duration(self) -> float:
        """Duration, s."""
        return float(self.t[-1])

    def directions(self) -> tuple[FloatArray, FloatArray]:
        """Return where it leaves to and where it comes from, (3,) m, turn scaled."""
        near = max(len(self.t) // 20, 1)
        scale = [1.0, 1.0, HEADING_LENGTH]
        return (
            (self.poses[near] - self.poses[0]) * scale,
            (self.poses[-1] - self.poses[-1 - near]) * scale,
        )


def courses_of(
    motion: Trajectory | Path, reference: complex, top_speed: float
) -> tuple[list[Course], list[float]]:
    """Return the courses of K between the stops of a motion, and its waits there, s.

    Parameters
    ----------
    motion : Trajectory or Path
        A trajectory of poses; of a path the times are invented.
    reference : complex, m
        K in the vehicle file's frame.
    top_speed : float, m/s
        Of the vehicle, for a path.

    Raises
    ------
    InvalidTrajectory
        If a trajectory is not one of poses, or does not move.
    """
    if isinstance(motion, Path):
        made = [_of_piece(p, reference, top_speed) for p in pieces_of(motion)]
        return made, [0.0] * (len(made) - 1)
    if motion.form != "poses":
        given = f"samples of the form {motion.form}"
        raise InvalidTrajectory(
            Problem(motion.name, given, "a path or a trajectory of poses")
        )
    return _of_trajectory(motion, reference)


def _of_piece(piece: PathPiece, reference: complex, top_speed: float) -> Course:
    u = np.linspace(piece.u[0], piece.u[-1], DENSE + 1)
    poses = moved(piece.poses_at(u), reference - piece.point)
    t = (u - u[0]) / (UNHURRIED * top_speed)
    return _rested(Course(t, poses), starts=False, ends=False)


def _of_trajectory(
    trajectory: Trajectory, reference: complex
) -> tuple[list[Course], list[float]]:
    point = complex(*trajectory.reference_point)
    motion = PoseMotion(trajectory.t, trajectory.samples, point)
    assert motion.rest is not None
    stop = stops_of(trajectory.samples)
    rows = sorted({0, len(stop) - 1, *np.flatnonzero(stop).tolist()})
    courses: list[Course] = []
    waits: list[float] = []
    pause = 0.0
    for first, last in itertools.pairwise(rows):
        t = np.linspace(trajectory.t[first], trajectory.t[last], DENSE + 1)
        poses = moved(motion.poses_at(t), reference - point)
        if _length(poses) < STILL:
            pause += float(t[-1] - t[0])
            continue
        if courses:
            waits.append(pause)
        pause = 0.0
        starts, ends = bool(motion.rest[0, first]), bool(motion.rest[1, last - 1])
        courses.append(_rested(Course(t - t[0], poses), starts=starts, ends=ends))
    if not courses:
        given, allowed = "the same pose throughout", "a trajectory that moves"
        raise InvalidTrajectory(Problem(trajectory.name, given, allowed))
    return courses, waits


def _length(poses: FloatArray) -> float:
    steps = np.diff(poses, axis=0) * [1.0, 1.0, HEADING_LENGTH]
    return float(np.linalg.norm(steps, axis=1).sum())


def moved(poses: FloatArray, offset: complex) -> FloatArray:
    """Return the poses of another point of the body, `offset` away in its frame."""
    place = poses[:, 0] + 1j * poses[:, 1] + np.exp(1j * poses[:, 2]) * offset
    return np.stack([place.real, place.imag, poses[:, 2]], axis=-1)


def _rested(course: Course, *, starts: bool, ends: bool) -> Course:
    """Return a course that starts and ends at rest where it did not, on the same way.

    There its clock is started or stopped gradually.
    """
    ramps = [0.0 if at_rest else RAMP * course.duration for at_rest in (starts, ends)]
    if not any(ramps):
        return course
    whole = course.duration + sum(ramps) / 2
    now = np.linspace(0.0, whole, len(course.t))
    then = now.copy()
    if ramps[0]:
        then = np.where(now < ramps[0], now**2 / (2 * ramps[0]), now - ramps[0] / 2)
    if ramps[1]:
        left = whole - now
        end = course.duration - left**2 / (2 * ramps[1])
        then = np.where(left < ramps[1], end, then)
    poses = np.stack(
        [np.interp(then, course.t, column) for column in course.poses.T], axis=-1
    )
    return Course(now, poses)


def merged(
    courses: Sequence[Course], signs: Sequence[int], *, turns_anywhere: bool
) -> list[list[int]]:
    """Return which courses may be driven as one, without the stops between them.

    Parameters
    ----------
    courses : sequence of Course
    signs : sequence of {1, -1}
        Their representations: v_s changes its sign only at rest.
    turns_anywhere : bool
        Whether the vehicle may reverse without standing: it has neither wheels that
        point somewhere nor an axle.
    """
    groups = [[0]]
    for i, (before, after) in enumerate(itertools.pairwise(courses)):
        come, leave = before.directions()[1], after.directions()[0]
        size = float(np.linalg.norm(come) * np.linalg.norm(leave))
        is_cusp = float(come @ leave) < math.cos(CUSP) * size
        if turns_anywhere or (signs[i] == signs[i + 1] and not is_cusp):
            groups[-1].append(i + 1)
        else:
            groups.append([i + 1])
    return groups


def rounded(courses: Sequence[Course]) -> Course:
    """Return one course along several, corners rounded, from rest to rest."""
    if len(courses) == 1:
        return courses[0]
    starts = np.cumsum([0.0, *(course.duration for course in courses)])
    t = np.concatenate([c.t + at for c, at in zip(courses, starts, strict=False)])
    poses = np.concatenate([course.poses for course in courses])
    t, first = np.unique(t, return_index=True)
    poses = poses[first]
    fine = np.linspace(0.0, t[-1], DENSE + 1)
    even = np.stack([np.interp(fine, t, column) for column in poses.T], axis=-1)
    shortest = min(course.duration for course in courses)
    reach = max(int(ROUND * shortest / fine[1]), 1)
    # Ends continued as odd functions, so that they stay where they are.
    before = 2 * even[0] - even[reach:0:-1]
    after = 2 * even[-1] - even[-2 : -reach - 2 : -1]
    wide = np.concatenate([before, even, after])
    window = np.ones(2 * reach + 1) / (2 * reach + 1)
    smooth = np.stack(
        [np.convolve(column, window, mode="valid") for column in wide.T], axis=-1
    )
    return _rested(Course(fine, smooth), starts=False, ends=False)


def guess_of(
    courses: Sequence[Course], waits: Sequence[float], intervals: int
) -> Guess:
    """Return the motion along courses, with knots evenly in time.

    Parameters
    ----------
    courses : sequence of Course
    waits : sequence of float, s
    intervals : int
        Of the longest course; the others have fewer, and all together at most
        `TOGETHER` times as many, but for `LEAST` of each.
    """
    whole = sum(course.duration for course in courses)
    longest = max(*(course.duration for course in courses), whole / TOGETHER)
    legs = []
    for course in courses:
        share = course.duration / longest
        n = int(np.clip(math.ceil(intervals * share), LEAST, MOST))
        t = np.linspace(0.0, course.duration, n + 1)
        dense = CubicSpline(course.t, course.poses, bc_type="clamped")
        legs.append(leg_through(np.full(n, course.duration / n), dense(t)))
    return Guess(tuple(legs), tuple(waits))


def splines_of(leg: Leg) -> CubicSpline:
    """Return the C² splines through a leg's knots, at rest at both ends."""
    t = np.concatenate([[0.0], np.cumsum(leg.h)])
    return CubicSpline(t, leg.poses, bc_type="clamped")


def leg_through(h: FloatArray, poses: FloatArray) -> Leg:
    """Return the leg whose splines go through poses."""
    bare = Leg(h, poses, np.zeros_like(poses))
    spline = splines_of(bare)
    return Leg(h, poses, np.asarray(spline(spline.x, 1)))


def signs_of(
    trajectory: Trajectory, middles: Sequence[float], space: PermissibleSpace
) -> tuple[int, ...]:
    """Return in which representation a trajectory is driven at some times.

    Parameters
    ----------
    trajectory : Trajectory
    middles : sequence of float, s
    space : PermissibleSpace
    """
    proved = prove(trajectory, space)
    spans, signs = proved.parts.spans, proved.choice.sign_of(proved.parts.spans)
    rows = np.searchsorted(spans.t0, np.asarray(middles), side="right") - 1
    return tuple(int(signs[row]) for row in np.clip(rows, 0, len(signs) - 1))
