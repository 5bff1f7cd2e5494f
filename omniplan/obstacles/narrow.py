"""The narrow phase: proofs that a footprint keeps away from pieces.

At a pose the distance of the footprint decides. Between poses the enclosures of
`omniplan.obstacles.sweep` do; parts are cut until each is either free or too short to
be told from a hit (`UNDECIDED`), which counts as one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import shapely

from omniplan.obstacles.broad import Broad
from omniplan.obstacles.footprint import Footprint
from omniplan.obstacles.polygons import Geometries
from omniplan.obstacles.sweep import Course, Parts, corners_at, hulls_between

__all__ = ["UNDECIDED", "Narrow"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
Pose = tuple[float, float, float]

UNDECIDED = 1e-4
"""A part of a motion in which no point moves farther is not cut any more, m."""
_CHUNK = 1024
_QUARTERS = np.linspace(0, 1, 5)
# Types of shapely know no array of distances.
_dwithin: Any = shapely.dwithin


@dataclass(frozen=True, eq=False)
class Narrow:
    """Which poses and motions of a footprint come nearer to pieces than a limit."""

    broad: Broad
    limit: float
    """m."""

    def is_course_free(
        self, course: Course, footprint: Footprint, pieces: Geometries
    ) -> bool:
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
            corners = [corners_at(part, poses) for part in footprint.parts]
            for each in corners:
                if _dwithin(pieces[:, None], _hulls(each), self.limit).any():
                    return False
            quarters = Parts(
                at[:, :-1].ravel(), at[:, 1:].ravel(), np.repeat(parts.knot, 4)
            )
            ends = poses.reshape(rows, 5, 3)
            ends_of = ends[:, :-1].reshape(-1, 3), ends[:, 1:].reshape(-1, 3)
            excess = course.excess(quarters, ends_of, footprint.radius)
            touched = np.zeros(len(quarters), dtype=bool)
            width = 2 * excess
            for each in corners:
                edge = each.reshape(rows, 5, -1)
                first, last = (
                    x.reshape(rows * 4, -1) for x in (edge[:, :-1], edge[:, 1:])
                )
                hulls = hulls_between(first, last)
                near = _dwithin(pieces[:, None], hulls, self.limit + excess)
                touched |= near.any(axis=0)
                width = np.maximum(width, np.abs(last - first).max(axis=1) + 2 * excess)
            if (width[touched] <= UNDECIDED).any():
                return False
            if touched.any():
                stack.append(quarters[touched])
        return True

    def in_the_way(
        self,
        footprint: Footprint,
        pieces: Geometries,
        ends: tuple[Pose, Pose],
        length: float,
        turn: float,
    ) -> Geometries:
        """Return the pieces that the enclosure of a whole motion touches."""
        (x0, y0, theta0), (x1, y1, theta1) = ends
        chord = (x1 - x0) ** 2 + (y1 - y0) ** 2
        lost = 1e-15 * (abs(x0) + abs(y0) + length) * length
        radius = footprint.radius
        excess = 0.5 * math.sqrt(max(length**2 - chord, 0.0) + lost)
        excess += radius / 8 * turn**2
        turns = np.array(
            [[complex(math.cos(a), math.sin(a))] for a in (theta0, theta1)]
        )
        places = np.array([[complex(x0, y0)], [complex(x1, y1)]])
        touched = np.zeros(len(pieces), dtype=bool)
        for part in footprint.parts:
            corners = (part * turns + places).view(np.float64).reshape(-1, 2)
            hull = shapely.convex_hull(shapely.linearrings(corners))
            touched |= shapely.dwithin(pieces, hull, self.limit + excess)
        return pieces[touched]

    def first(self, course: Course, footprint: Footprint) -> float | None:
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
                self.touching(footprint, course.poses(at)) for at in (parts.a, parts.b)
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
            touched |= self._within(hulls, self.limit + excess)
        return parts[touched], (width + 2 * excess)[touched]

    def touching(self, footprint: Footprint, poses: FloatArray) -> BoolArray:
        """Return which poses (n, 3) touch something."""
        touched = np.zeros(len(poses), dtype=bool)
        for part in footprint.parts:
            corners = corners_at(part, poses)
            touched |= self._within(_hulls(corners), self.limit)
        return touched

    def _within(self, shapes: Geometries, distance: npt.ArrayLike) -> BoolArray:
        """Return which shapes (n,) have a piece within a distance."""
        touched = np.zeros(len(shapes), dtype=bool)
        touched[self.broad.near(shapes, distance)[0]] = True
        return touched

    def nearest(self, footprint: Footprint, pose: Pose) -> tuple[float, int, Pose]:
        """Return the least distance, the piece, and its nearest place (x, y, 0)."""
        best: tuple[float, int, Pose] = (math.inf, -1, pose)
        for part in footprint.parts:
            hull = _hulls(corners_at(part, np.array([pose])))[0]
            index = self.broad.tree.nearest(hull)
            if index is None:
                continue
            piece = self.broad.pieces[index]
            distance = float(shapely.distance(piece, hull))
            if distance < best[0]:
                line = shapely.get_coordinates(shapely.shortest_line(piece, hull))
                best = (distance, int(index), (*line[0].tolist(), 0.0))
        return best


def _hulls(corners: npt.NDArray[np.complex128]) -> Geometries:
    xy = corners.view(np.float64).reshape(*corners.shape, 2)
    return np.asarray(shapely.convex_hull(shapely.linearrings(xy)))
