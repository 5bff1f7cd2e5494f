"""Does the vehicle hit something: at a pose, along a move, along a trajectory.

"Free" is proved: most places by one look at a map of distances that fills as it is
asked (`omniplan.obstacles.broad`), the others by the distance of the footprint and
enclosures of what it sweeps (`omniplan.obstacles.narrow`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import shapely

from configspace import InvalidInput, PermissibleSpace, Problem
from omniplan.errors import InvalidTrajectory
from omniplan.motion import PoseMotion, motion_of
from omniplan.obstacles.asked import (
    checked_bounds,
    checked_clearance,
    checked_poses,
    is_pose,
    not_a_motion,
    not_a_pose,
    walls,
)
from omniplan.obstacles.broad import Broad
from omniplan.obstacles.footprint import (
    Body,
    Footprint,
    footprint_of,
    require_body_of,
)
from omniplan.obstacles.hit import Hit
from omniplan.obstacles.narrow import Narrow
from omniplan.obstacles.obstacles import Obstacles
from omniplan.obstacles.open_floor import OpenFloor
from omniplan.obstacles.sweep import (
    MAX_TURN,
    ConstantSpeed,
    Splines,
    Swept,
    Way,
    swept_by,
)
from omniplan.samples import MAX_VALUE
from omniplan.trajectory import Trajectory, timed

__all__ = ["CollisionChecker"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
Pose = tuple[float, float, float]

TOUCH = 1e-9
"""What is nearer than the clearance and this touches, m: room for rounding."""


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
        self._body = body
        if not isinstance(obstacles, Obstacles | None):
            allowed = "Obstacles, such as Obstacles.from_polygons makes"
            raise InvalidInput(Problem("obstacles", type(obstacles).__name__, allowed))
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
        self._broad = Broad(pieces, 3 * self._ball, self._ball)
        self._narrow = Narrow(self._broad, self._limit)

    @property
    def open_floor(self) -> OpenFloor:
        """Where it is known to be free whatever the heading, for whoever asks often.

        It grows as poses are asked for.
        """
        return self._broad.open_floor

    def require_body_of(self, space: PermissibleSpace) -> None:
        """Raise InvalidInput if this checks another vehicle than that of a space.

        A checker made of a polygon may check any vehicle.
        """
        require_body_of(self._body, space)

    def with_clearance(self, clearance: float) -> CollisionChecker:
        """Return a checker that keeps another distance from the same things.

        Parameters
        ----------
        clearance : float, m, ≥ 0
        """
        return CollisionChecker(self._body, self.obstacles, clearance, self.bounds)

    def is_free(self, pose: Sequence[float] | FloatArray) -> bool:
        """Return whether the footprint keeps the clearance at a pose.

        Parameters
        ----------
        pose : (3,) float, m, m, rad
            (x, y, θ) of K.
        """
        try:
            x, y, theta = pose
            is_right = is_pose(x, y, theta)
        except (TypeError, ValueError) as error:
            raise not_a_pose(pose) from error
        if not is_right:
            raise not_a_pose(pose)
        if (x, y) in self._broad.open_floor:
            return True
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

    def is_line_clear(self, x0: float, y0: float, x1: float, y1: float) -> bool:
        """Return whether a straight move is free whatever the headings, at a glance.

        True is proved, as by `is_motion_free`; False says nothing.

        Parameters
        ----------
        x0, y0, x1, y1 : float, m
            From where to where K moves.
        """
        limit = MAX_VALUE
        if not (-limit <= x0 <= limit and -limit <= y0 <= limit):
            raise not_a_pose((x0, y0))
        if not (-limit <= x1 <= limit and -limit <= y1 <= limit):
            raise not_a_pose((x1, y1))
        return self._broad.is_clear(x0, y0, x1, y1, self._ball)

    def are_free(self, poses: npt.ArrayLike) -> BoolArray:
        """Return whether the footprint keeps the clearance at each of many poses.

        Parameters
        ----------
        poses : (n, 3) float, m, m, rad

        Returns
        -------
        free : (n,) bool
        """
        return ~self._narrow.touching(self.footprint, checked_poses(poses))

    def distance(self, pose: Sequence[float] | FloatArray) -> float:
        """Return the distance of the footprint to the nearest obstacle, m; 0 if hit.

        The border of the bounds counts as an obstacle. Infinite if there is none.
        """
        try:
            x, y, theta = (float(value) for value in pose)
        except (TypeError, ValueError) as error:
            raise not_a_pose(pose) from error
        if not is_pose(x, y, theta):
            raise not_a_pose(pose)
        return self._narrow.nearest(self.footprint, (x, y, theta))[0]

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
        try:
            x0, y0, theta0 = (float(value) for value in motion.start)
            x1, y1, theta1 = (float(value) for value in motion.goal)
            turn, length = float(motion.turn), float(motion.length)
        except (AttributeError, TypeError, ValueError) as error:
            raise not_a_motion(motion) from error
        if not (is_pose(x0, y0, theta0) and math.isfinite(turn + length)):
            raise not_a_pose((x0, y0, theta0))
        if not is_pose(x1, y1, theta1):
            raise not_a_pose((x1, y1, theta1))
        # K keeps so near to the chord: the ellipse around both ends is no higher.
        chord = math.hypot(x1 - x0, y1 - y0)
        room = math.sqrt(max(length**2 - chord**2, 0.0)) / 2
        room += self._ball + 1e-6 + 1e-6 * length
        if self._broad.is_clear(x0, y0, x1, y1, room):
            return True
        # Nor is any point of its way farther from the middle than half its length.
        if length / 2 + self._ball <= self._broad.reach:
            pieces = self._broad.at((x0 + x1) / 2, (y0 + y1) / 2).pieces
        else:
            pieces = self._broad.in_box(
                min(x0, x1) - room,
                min(y0, y1) - room,
                max(x0, x1) + room,
                max(y0, y1) + room,
            )
        if len(pieces) and abs(turn) <= MAX_TURN:
            ends = (x0, y0, theta0), (x1, y1, theta1)
            pieces = self._narrow.in_the_way(self.footprint, pieces, ends, length, turn)
        if not len(pieces):
            return True
        course = ConstantSpeed(motion)
        return self._narrow.is_course_free(course, self.footprint, pieces)

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
        u = self._narrow.first(course, self.footprint)
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
        t = self._narrow.first(course, footprint)
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
        try:
            course = ConstantSpeed(motion)
        except (AttributeError, TypeError) as error:
            raise not_a_motion(motion) from error
        return swept_by(course, self.footprint)

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

    def _hit(
        self, footprint: Footprint, pose: Pose, u: float = 0.0, t: float | None = None
    ) -> Hit:
        distance, piece, (x, y, _) = self._narrow.nearest(footprint, pose)
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
