"""Does the vehicle hit something: at a pose, along a move, along a trajectory.

"Free" is proved: at a pose by the distance of the footprint, between poses by the
enclosures of `omniplan.obstacles.sweep`, halved until every part is either free or too
short to be told from a hit (`UNDECIDED`), which counts as one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import shapely

from configspace import Problem
from omniplan.errors import InvalidTrajectory
from omniplan.motion import PoseMotion, motion_of
from omniplan.obstacles.asked import (
    checked_bounds,
    checked_clearance,
    not_finite,
    walls,
)
from omniplan.obstacles.broad import Broad
from omniplan.obstacles.footprint import Body, Footprint, footprint_of
from omniplan.obstacles.hit import Hit
from omniplan.obstacles.obstacles import Obstacles
from omniplan.obstacles.polygons import Geometries
from omniplan.obstacles.sweep import (
    MAX_TURN,
    ConstantSpeed,
    Course,
    Parts,
    Splines,
    Swept,
    Way,
    corners_at,
    hulls_between,
    swept_by,
)
from omniplan.trajectory import Trajectory, timed

__all__ = ["CollisionChecker"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
Pose = tuple[float, float, float]

TOUCH = 1e-9
"""What is nearer than the clearance and this touches, m: room for rounding."""
UNDECIDED = 1e-4
"""A part of a motion in which no point moves farther is not cut any more, m."""
_CHUNK = 1024
_QUARTERS = np.linspace(0, 1, 5)
# Types of shapely know no array of distances.
_dwithin: Any = shapely.dwithin


class CollisionChecker:
    """Collision checks of one vehicle among obstacles.

    Parameters
    ----------
    body : Vehicle, PermissibleSpace, or (n, 2) float, m
        The vehicle, with a footprint; or the footprint as a polygon in the frame of K.
    obstacles : Obstacles, optional
    clearance : float, m, ≥ 0
        Distance to keep from everything. Touching is a hit.
    bounds : (x0, y0, x1, y1) float, m, optional
        The footprint keeps inside; its border is like a wall.

    Raises
    ------
    InvalidInput
        If the vehicle has no footprint, or a number is not finite or not in order.

    Notes
    -----
    Poses and moves are those of K, trajectories those of their own reference point.
    Not to be asked by several threads at once: GEOS builds its indices when they are
    first needed.

    Examples
    --------
    >>> hall = Obstacles.from_polygons({"wall": [[2, -5], [3, -5], [3, 5], [2, 5]]})
    >>> checker = CollisionChecker([[1, 1], [-1, 1], [-1, -1], [1, -1]], hall)
    >>> checker.is_free((0.5, 0, 0)), checker.is_free((1, 0, 0))
    (True, False)
    >>> checker.distance((0.5, 0, 0))
    0.5
    """

    def __init__(
        self,
        body: Body,
        obstacles: Obstacles | None = None,
        clearance: float = 0.0,
        bounds: Sequence[float] | None = None,
    ) -> None:
        self.obstacles = Obstacles() if obstacles is None else obstacles
        self.clearance = checked_clearance(clearance)
        self.bounds = None if bounds is None else checked_bounds(bounds)
        self._in_file, self._k = footprint_of(body)
        self.footprint = self._in_file.moved(-self._k)
        """In the frame of K."""
        self._limit = self.clearance + TOUCH
        self._ball = self.footprint.radius + self._limit
        self._parts = self.footprint.parts
        border = walls(self.bounds)
        pieces = np.concatenate([self.obstacles.pieces, border])
        self._owner = np.concatenate([self.obstacles.owner, np.full(len(border), -1)])
        self._broad = Broad(pieces, 3 * self._ball)

    def is_free(self, pose: Sequence[float] | FloatArray) -> bool:
        """Return whether the footprint keeps the clearance at a pose.

        Parameters
        ----------
        pose : (3,) float, m, m, rad
            (x, y, θ) of K.
        """
        x, y, theta = pose
        if not math.isfinite(x + y + theta):
            raise not_finite(pose)
        nearby = self._broad.at(x, y)
        if nearby.gap > self._ball:
            return True
        turn, place = complex(math.cos(theta), math.sin(theta)), complex(x, y)
        for part in self._parts:
            corners = (part * turn + place).view(np.float64).reshape(-1, 2)
            hull = shapely.convex_hull(shapely.linearrings(corners))
            if True in shapely.dwithin(nearby.pieces, hull, self._limit).tolist():
                return False
        return True

    def are_free(self, poses: npt.ArrayLike) -> BoolArray:
        """Return whether the footprint keeps the clearance at each of many poses.

        Parameters
        ----------
        poses : (n, 3) float, m, m, rad

        Returns
        -------
        free : (n,) bool
        """
        at = np.asarray(poses, dtype=np.float64).reshape(-1, 3)
        if not np.isfinite(at).all():
            raise not_finite(at[~np.isfinite(at).all(axis=1)][0])
        return ~self._touching(self.footprint, at)

    def distance(self, pose: Sequence[float] | FloatArray) -> float:
        """Return the distance of the footprint to the nearest obstacle, m; 0 if hit.

        The border of the bounds counts as an obstacle. Infinite if there is none.
        """
        x, y, theta = (float(value) for value in pose)
        if not math.isfinite(x + y + theta):
            raise not_finite(pose)
        return self._nearest(self.footprint, (x, y, theta))[0]

    def hit_at(self, pose: Sequence[float] | FloatArray) -> Hit | None:
        """Return what the vehicle hits at a pose, if anything."""
        if self.is_free(pose):
            return None
        x, y, theta = (float(value) for value in pose)
        return self._hit(self.footprint, (x, y, theta))

    def is_motion_free(self, motion: Way) -> bool:
        """Return whether the footprint keeps the clearance all along a motion of K.

        Parameters
        ----------
        motion : Move, or alike
            Whatever has ``start``, ``goal``, ``length``, ``turn`` and ``poses(u)`` and
            has constant speed and yaw rate over u.

        Returns
        -------
        free : bool
            True is proved for every pose in between. Where the proof would have to
            look at parts in which no point moves by `UNDECIDED`, the answer is False.
        """
        x0, y0, theta0 = (float(value) for value in motion.start)
        x1, y1, theta1 = (float(value) for value in motion.goal)
        turn, length = float(motion.turn), float(motion.length)
        if not math.isfinite(x0 + y0 + theta0 + x1 + y1 + theta1 + turn + length):
            raise not_finite((x0, y0, theta0))
        # No point of K's way is farther from the middle than half its length.
        ball = length / 2 + self._ball
        if ball <= self._broad.reach:
            nearby = self._broad.at((x0 + x1) / 2, (y0 + y1) / 2)
            if nearby.gap > ball:
                return True
            pieces = nearby.pieces
        else:
            # Nor farther from the chord than the ellipse around both ends is high.
            chord = math.hypot(x1 - x0, y1 - y0)
            room = math.sqrt(max(length**2 - chord**2, 0.0)) / 2
            room += self._ball + 1e-6 + 1e-6 * length
            pieces = self._broad.in_box(
                min(x0, x1) - room,
                min(y0, y1) - room,
                max(x0, x1) + room,
                max(y0, y1) + room,
            )
        if len(pieces) and abs(turn) <= MAX_TURN:
            start, goal = (x0, y0, theta0), (x1, y1, theta1)
            pieces = self._in_the_way(pieces, start, goal, length, turn)
        if not len(pieces):
            return True
        return self._is_course_free(ConstantSpeed(motion), pieces)

    def _is_course_free(self, course: Course, pieces: Geometries) -> bool:
        """Return whether no pose touches any of the pieces, the only ones near.

        Every part is cut into four. Their ends are tested first, as most motions that
        are not free are found there.
        """
        stack = [course.parts()]
        while stack:
            parts = stack.pop()
            if len(parts) > _CHUNK:
                stack.append(parts[_CHUNK:])
                parts = parts[:_CHUNK]
            rows = len(parts)
            at = parts.a[:, None] + (parts.b - parts.a)[:, None] * _QUARTERS
            poses = course.poses(at.ravel())
            corners = [corners_at(part, poses) for part in self._parts]
            for each in corners:
                if _dwithin(pieces[:, None], _hulls(each), self._limit).any():
                    return False
            quarters = Parts(
                at[:, :-1].ravel(), at[:, 1:].ravel(), np.repeat(parts.knot, 4)
            )
            ends = poses.reshape(rows, 5, 3)
            ends_of = ends[:, :-1].reshape(-1, 3), ends[:, 1:].reshape(-1, 3)
            excess = course.excess(quarters, ends_of, self.footprint.radius)
            touched = np.zeros(len(quarters), dtype=bool)
            width = 2 * excess
            for each in corners:
                edge = each.reshape(rows, 5, -1)
                first, last = (
                    x.reshape(rows * 4, -1) for x in (edge[:, :-1], edge[:, 1:])
                )
                hulls = hulls_between(first, last)
                near = _dwithin(pieces[:, None], hulls, self._limit + excess)
                touched |= near.any(axis=0)
                width = np.maximum(width, np.abs(last - first).max(axis=1) + 2 * excess)
            if (width[touched] <= UNDECIDED).any():
                return False
            if touched.any():
                stack.append(quarters[touched])
        return True

    def _in_the_way(
        self, pieces: Geometries, start: Pose, goal: Pose, length: float, turn: float
    ) -> Geometries:
        """Return the pieces that the enclosure of a whole motion touches."""
        (x0, y0, theta0), (x1, y1, theta1) = start, goal
        chord = (x1 - x0) ** 2 + (y1 - y0) ** 2
        lost = 1e-15 * (abs(x0) + abs(y0) + length) * length
        radius = self.footprint.radius
        excess = 0.5 * math.sqrt(max(length**2 - chord, 0.0) + lost)
        excess += radius / 8 * turn**2
        turns = np.array(
            [[complex(math.cos(a), math.sin(a))] for a in (theta0, theta1)]
        )
        places = np.array([[complex(x0, y0)], [complex(x1, y1)]])
        touched = np.zeros(len(pieces), dtype=bool)
        for part in self._parts:
            corners = (part * turns + places).view(np.float64).reshape(-1, 2)
            hull = shapely.convex_hull(shapely.linearrings(corners))
            touched |= shapely.dwithin(pieces, hull, self._limit + excess)
        return pieces[touched]

    def first_hit(self, motion: Way) -> Hit | None:
        """Return where a motion of K first comes nearer than the clearance.

        Parameters
        ----------
        motion : Move, or alike

        Returns
        -------
        hit : Hit or None
            None if and only if `is_motion_free`.
        """
        if self.is_motion_free(motion):
            return None
        course = ConstantSpeed(motion)
        u = self._first(course, self.footprint)
        if u is None:  # undecided: the two ways of cutting may differ by a hair
            shares = np.linspace(0, 1, 101)
            distances = [self.distance(pose) for pose in course.poses(shares)]
            u = float(shares[np.argmin(distances)])
        x, y, theta = course.poses(np.array([u]))[0].tolist()
        return self._hit(self.footprint, (x, y, theta), u=u)

    def first_hit_of_trajectory(self, trajectory: Trajectory) -> Hit | None:
        """Return where a trajectory first comes nearer than the clearance.

        Parameters
        ----------
        trajectory : Trajectory
            Of poses, of any reference point. Proved along its splines, those that
            `omniplan.validate` judges.

        Returns
        -------
        hit : Hit or None

        Raises
        ------
        InvalidTrajectory
            If the trajectory has no poses: nobody knows where it is.
        """
        course, footprint = self._course_of(trajectory)
        t = self._first(course, footprint)
        if t is None:
            return None
        x, y, theta = course.poses(np.array([t]))[0].tolist()
        u = (t - float(trajectory.t[0])) / trajectory.duration
        return self._hit(footprint, (x, y, theta), u=u, t=t)

    def swept(self, motion: Way | Trajectory) -> Swept:
        """Return the area the footprint sweeps over.

        Parameters
        ----------
        motion : Move or alike, or Trajectory of poses

        Returns
        -------
        swept : Swept
            Its border is off by less than 0.2 mm.
        """
        if isinstance(motion, Trajectory):
            return swept_by(*self._course_of(motion))
        return swept_by(ConstantSpeed(motion), self.footprint)

    def swept_area(self, motion: Way | Trajectory) -> float:
        """Return the size of the area the footprint sweeps over, m²."""
        return self.swept(motion).area

    def _course_of(self, trajectory: Trajectory) -> tuple[Splines, Footprint]:
        motion = motion_of(timed(trajectory), is_own=False)
        if not isinstance(motion, PoseMotion):
            raise InvalidTrajectory(
                Problem(
                    trajectory.name,
                    f"samples of {trajectory.form}, which tell no place",
                    "a trajectory of poses",
                )
            )
        point = complex(*trajectory.reference_point)
        return Splines(motion), self._in_file.moved(-point)

    def _first(
        self,
        course: Course,
        footprint: Footprint,
    ) -> float | None:
        """Return where a course first touches something."""
        stack, found = [course.parts()], math.inf
        while stack:
            parts = stack.pop()
            parts = parts[parts.a < found]
            if not len(parts):
                continue
            if len(parts) > _CHUNK:
                stack.append(parts[_CHUNK:])
                parts = parts[:_CHUNK]
            parts, width = self._not_free(course, footprint, parts)
            begins, ends = (
                self._touching(footprint, course.poses(at)) for at in (parts.a, parts.b)
            )
            is_short = width <= UNDECIDED
            found = min(
                found,
                parts.a[begins | is_short].min(initial=math.inf),
                parts.b[ends].min(initial=math.inf),
            )
            stack.append(parts[~begins & ~is_short].halved())
        return None if found == math.inf else float(found)

    def _not_free(
        self,
        course: Course,
        footprint: Footprint,
        parts: Parts,
    ) -> tuple[Parts, FloatArray]:
        """Return the parts that are not proved free, and how far points move."""
        ends = course.poses(parts.a), course.poses(parts.b)
        excess = course.excess(parts, ends, footprint.radius)
        touched = np.zeros(len(parts), dtype=bool)
        width = np.zeros(len(parts))
        for part in footprint.parts:
            first, last = (corners_at(part, poses) for poses in ends)
            width = np.maximum(width, np.abs(last - first).max(axis=1))
            hulls = hulls_between(first, last)
            touched |= self._within(hulls, self._limit + excess)
        return parts[touched], (width + 2 * excess)[touched]

    def _touching(self, footprint: Footprint, poses: FloatArray) -> BoolArray:
        """Return which poses (n, 3) touch something."""
        touched = np.zeros(len(poses), dtype=bool)
        for part in footprint.parts:
            corners = corners_at(part, poses)
            touched |= self._within(_hulls(corners), self._limit)
        return touched

    def _within(self, shapes: Geometries, distance: npt.ArrayLike) -> BoolArray:
        """Return which shapes (n,) have a piece within a distance."""
        touched = np.zeros(len(shapes), dtype=bool)
        touched[self._broad.near(shapes, distance)[0]] = True
        return touched

    def _nearest(self, footprint: Footprint, pose: Pose) -> tuple[float, int, Pose]:
        """Return the least distance, the piece, and its nearest place (x, y, 0)."""
        best: tuple[float, int, Pose] = (math.inf, -1, pose)
        for part in footprint.parts:
            hull = _hulls(corners_at(part, np.array([pose])))[0]
            index = self._broad.tree.nearest(hull)
            if index is None:
                continue
            piece = self._broad.pieces[index]
            distance = float(shapely.distance(piece, hull))
            if distance < best[0]:
                line = shapely.get_coordinates(shapely.shortest_line(piece, hull))
                best = (distance, int(index), (*line[0].tolist(), 0.0))
        return best

    def _hit(
        self, footprint: Footprint, pose: Pose, u: float = 0.0, t: float | None = None
    ) -> Hit:
        distance, piece, (x, y, _) = self._nearest(footprint, pose)
        index = int(self._owner[piece])
        return Hit(
            obstacle="bounds" if index < 0 else self.obstacles.names[index],
            index=index,
            pose=pose,
            place=(x, y),
            distance=distance,
            clearance=self.clearance,
            u=u,
            t=t,
        )


def _hulls(corners: npt.NDArray[np.complex128]) -> Geometries:
    xy = corners.view(np.float64).reshape(*corners.shape, 2)
    return np.asarray(shapely.convex_hull(shapely.linearrings(xy)))
