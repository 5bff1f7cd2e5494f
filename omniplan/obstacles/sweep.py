"""What a footprint sweeps over, enclosed piece by piece.

On a part [a, b] of a motion every point of the footprint keeps within an *excess* ε of
the straight line between its two end places, walked evenly. Those lines all lie in the
convex hull of the (convex) footprint at a and at b, so what is swept lies within ε of
that hull. The hull is too large by as much as the turn times the size of the footprint;
the excess shrinks with the square of the part:

*A motion at constant speed.* K's way has the length ℓ and the chord c. By Stewart's
theorem K keeps within ``√(u (1 - u) (ℓ² - c²)) ≤ ½ √(ℓ² - c²)`` of the even walk; a
corner at distance r turns about K by Δθ, which adds ``r Δθ²/8``.

*Splines.* ``Δt²/8 · max|ẍ|`` with ``|ẍ| ≤ |p̈| + r (|θ̈| + θ̇²)``; p̈ and θ̈ are linear
in time, so their ends bound them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt
import shapely

from omniplan.motion import PoseMotion
from omniplan.obstacles.footprint import Footprint
from omniplan.obstacles.polygons import Area, Geometries, joined, rings_of

__all__ = [
    "MAX_TURN",
    "ConstantSpeed",
    "Course",
    "Parts",
    "Splines",
    "Swept",
    "Way",
    "corners_at",
    "hulls_between",
    "swept_by",
]

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
IntArray = npt.NDArray[np.int64]

MAX_TURN = 0.5
"""Parts that turn by more are cut before anything is asked, rad."""
DETAIL = 5e-5
"""Swept areas are drawn with an excess of at most this, m."""


class Way(Protocol):
    """A motion from pose to pose at constant speed, such as `planning.moves.Move`."""

    @property
    def start(self) -> FloatArray:
        """(3,) m, m, rad."""
        ...

    @property
    def goal(self) -> FloatArray:
        """(3,) m, m, rad; the heading is that of the start plus `turn`."""
        ...

    @property
    def length(self) -> float:
        """Length of K's way, m."""
        ...

    @property
    def turn(self) -> float:
        """Change of the heading, rad."""
        ...

    def poses(self, u: FloatArray, /) -> FloatArray:
        """Return the poses (n, 3) at u (n,) from 0 to 1."""
        ...


@dataclass(frozen=True)
class Parts:
    """Parts of a motion, from a to b each, in order; knots tell splines apart."""

    a: FloatArray
    b: FloatArray
    knot: IntArray

    def __len__(self) -> int:
        return len(self.a)

    def __getitem__(self, chosen: slice | npt.NDArray[np.bool_]) -> Parts:
        return Parts(self.a[chosen], self.b[chosen], self.knot[chosen])

    def halved(self) -> Parts:
        """Return two halves of every part, in order."""
        half = (self.a + self.b) / 2
        a = np.stack([self.a, half], axis=-1).ravel()
        b = np.stack([half, self.b], axis=-1).ravel()
        return Parts(a, b, np.repeat(self.knot, 2))


class Course(Protocol):
    """A motion whose sweep can be enclosed."""

    def parts(self) -> Parts:
        """Return parts that together are all of it."""
        ...

    def poses(self, at: FloatArray) -> FloatArray:
        """Return the poses (n, 3)."""
        ...

    def excess(
        self, parts: Parts, ends: tuple[FloatArray, FloatArray], radius: float
    ) -> FloatArray:
        """Return ε of every part, m, for corners up to a radius from the pose.

        `ends` are the poses (n, 3) at the beginnings and ends of the parts.
        """
        ...


class ConstantSpeed:
    """A motion at constant speed, over u from 0 to 1."""

    def __init__(self, way: Way) -> None:
        self.way = way
        self.length = float(way.length)
        self.turn = float(way.turn)

    def parts(self) -> Parts:
        """Return the whole of it, or parts that turn by at most `MAX_TURN`."""
        n = max(1, math.ceil(abs(self.turn) / MAX_TURN))
        edges = np.linspace(0, 1, n + 1)
        return Parts(edges[:-1], edges[1:], np.zeros(n, dtype=np.int64))

    def poses(self, at: FloatArray) -> FloatArray:
        """Return the poses (n, 3)."""
        return self.way.poses(at)

    def excess(
        self, parts: Parts, ends: tuple[FloatArray, FloatArray], radius: float
    ) -> FloatArray:
        """Return ε of every part, m."""
        share = parts.b - parts.a
        length = share * self.length
        step = ends[1][:, :2] - ends[0][:, :2]
        size = float(np.abs(ends[0][:, :2]).max()) + self.length
        # What rounding of the end places may have taken off the difference.
        lost = 1e-15 * size * length
        rest = np.maximum(length**2 - (step**2).sum(axis=1), 0.0) + lost
        return np.asarray(0.5 * np.sqrt(rest) + radius / 8 * (share * self.turn) ** 2)


class Splines:
    """The motion of a trajectory of poses, over its time."""

    def __init__(self, motion: PoseMotion) -> None:
        self.motion = motion

    def parts(self) -> Parts:
        """Return the intervals between the samples."""
        found = self.motion.intervals()
        return Parts(found.t0, found.t1, found.knot.astype(np.int64))

    def poses(self, at: FloatArray) -> FloatArray:
        """Return the poses (n, 3)."""
        return self.motion.poses_at(at)

    def excess(
        self, parts: Parts, ends: tuple[FloatArray, FloatArray], radius: float
    ) -> FloatArray:
        """Return ε of every part, m."""
        dt = parts.b - parts.a
        place = self.motion.position[:, parts.knot]
        heading = self.motion.heading[:, parts.knot]
        h = np.stack([parts.a, parts.b]) - self.motion.t[parts.knot]
        p2 = np.abs(6 * place[0] * h + 2 * place[1]).max(axis=0)
        h2 = np.abs(6 * heading[0] * h + 2 * heading[1]).max(axis=0)
        h1 = np.abs((3 * heading[0] * h + 2 * heading[1]) * h + heading[2]).max(axis=0)
        # The rate bends between its ends by its own second derivative.
        h1 = h1 + dt**2 / 8 * np.abs(6 * heading[0])
        return np.asarray(dt**2 / 8 * (p2 + radius * (h2 + h1**2)))


def corners_at(part: ComplexArray, poses: FloatArray) -> ComplexArray:
    """Return the corners (n, m) of a part of a footprint at poses (n, 3)."""
    place = poses[:, 0] + 1j * poses[:, 1]
    turned = np.exp(1j * poses[:, 2])[:, None] * part
    return np.asarray(turned + place[:, None])


def hulls_between(first: ComplexArray, last: ComplexArray) -> Geometries:
    """Return the convex hulls (n,) of corners (n, m) at both ends of parts."""
    corners = np.concatenate([first, last], axis=-1)
    xy = corners.view(np.float64).reshape(*corners.shape, 2)
    return np.asarray(shapely.convex_hull(shapely.linearrings(xy)))


@dataclass(frozen=True, eq=False)
class Swept:
    """The area a footprint sweeps over."""

    polygon: Area

    @property
    def area(self) -> float:
        """Area, m²; each place counts once."""
        return float(self.polygon.area)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Least x and y, largest x and y, m."""
        x0, y0, x1, y1 = self.polygon.bounds
        return x0, y0, x1, y1

    @cached_property
    def rings(self) -> tuple[FloatArray, ...]:
        """Closed rings (n, 2), m: outer ones counter-clockwise, holes clockwise."""
        return rings_of(self.polygon)


def swept_by(course: Course, footprint: Footprint) -> Swept:
    """Return what a footprint sweeps over, its border off by less than 0.2 mm.

    What is new between two poses is swept by the sides of the footprint: a quadrangle
    each, but for the excess. (The hull of both poses is larger where the body turns.)

    Parameters
    ----------
    course : Course
    footprint : Footprint
    """
    parts = course.parts()
    shapes: list[Geometries] = []
    while len(parts):
        ends = course.poses(parts.a), course.poses(parts.b)
        is_fine = course.excess(parts, ends, footprint.radius) <= DETAIL
        for part in footprint.parts:
            first, last = (corners_at(part, poses[is_fine]) for poses in ends)
            # The end of a part is the beginning of the next, but for the last one.
            shapes += [_placed(first), _placed(last[-1:]), _between(first, last)]
        parts = parts[~is_fine].halved()
    return Swept(joined(np.concatenate(shapes)))


def _placed(corners: ComplexArray) -> Geometries:
    """Return polygons (n,) of corners (n, m)."""
    xy = np.ascontiguousarray(corners).view(np.float64)
    return np.asarray(shapely.polygons(xy.reshape(*corners.shape, 2)))


def _between(first: ComplexArray, last: ComplexArray) -> Geometries:
    """Return what the sides of polygons (n, m) sweep over from first to last."""
    sides = np.stack(
        [first, np.roll(first, -1, axis=1), np.roll(last, -1, axis=1), last], axis=-1
    )
    # A side that turns about one of its points makes two triangles.
    return np.asarray(
        shapely.make_valid(
            _placed(sides.reshape(-1, 4)), method="structure", keep_collapsed=False
        )
    )
