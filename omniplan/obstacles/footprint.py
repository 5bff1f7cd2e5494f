"""The vehicle's outline on the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry import Polygon

from configspace import InvalidInput, PermissibleSpace, Problem, Vehicle
from omniplan.obstacles.polygons import Geometries, checked_polygon, convex_parts

__all__ = ["Body", "Footprint", "footprint_of", "require_body_of"]

ComplexArray = npt.NDArray[np.complex128]
Body: TypeAlias = Vehicle | PermissibleSpace | npt.ArrayLike
Corners: TypeAlias = Sequence[tuple[float, float]]

_SAME = 1e-9
"""Reference points that agree to this are the same, m."""


@dataclass(frozen=True, eq=False)
class Footprint:
    """Convex parts of an outline, in the frame of the point that poses describe."""

    parts: tuple[ComplexArray, ...]
    """Corners ``x + j y`` of every convex part, m."""

    @cached_property
    def radius(self) -> float:
        """Largest distance of any point from the described point, m."""
        return max(float(np.abs(part).max()) for part in self.parts)

    def moved(self, by: complex) -> Footprint:
        """Return the footprint with another origin: all corners moved."""
        return Footprint(tuple(part + by for part in self.parts))


def footprint_of(body: Body) -> tuple[Footprint, complex]:
    """Return the footprint in the frame of the vehicle file, and K in that frame.

    Parameters
    ----------
    body : Vehicle, PermissibleSpace, or (n, 2) float, m
        A bare polygon is taken to be in the frame of K.

    Raises
    ------
    InvalidInput
        If the vehicle has no footprint or the polygon cannot be used.
    """
    known = _known(body)
    if known is None:
        return _footprint("footprint", body), 0j
    name, corners, k = known
    if not corners:
        # Wheels tell nothing of the body around them: a guess could be too small.
        allowed = (
            "give footprint in the vehicle file, or the polygon in the frame of K "
            "in place of the vehicle"
        )
        raise InvalidInput(Problem(f"vehicle {name}: footprint", "none", allowed))
    return _footprint(f"vehicle {name}: footprint", corners), k


def require_body_of(body: Body, space: PermissibleSpace) -> None:
    """Raise InvalidInput if a body is that of another vehicle than a space.

    A bare polygon may be anybody's.
    """
    theirs, ours = _known(body), _known(space)
    if body is space or theirs is None or ours is None:
        return
    is_same = abs(theirs[2] - ours[2]) <= _SAME and (
        shapely.equals(Polygon(theirs[1]), Polygon(ours[1]))
        if ours[1]
        else theirs[0] == ours[0]  # a space that tells no footprint
    )
    if not is_same:
        given = (
            f"checks vehicle {theirs[0]}, whose footprint or reference point differs"
        )
        allowed = f"a CollisionChecker of vehicle {ours[0]}"
        raise InvalidInput(Problem("checker", given, allowed))


def _known(body: Body) -> tuple[str, Corners, complex] | None:
    """Return name, corners and K of a vehicle or a space, in the vehicle file's frame.

    None for a polygon.
    """
    if isinstance(body, Vehicle):
        return body.name, body.footprint or (), body.reference
    if isinstance(body, PermissibleSpace):
        k = complex(*body.header.reference)
        return body.name, body.header.footprint, k
    return None


def _footprint(where: str, corners: object) -> Footprint:
    polygon = checked_polygon(where, corners)
    if len(shapely.get_parts(polygon)) > 1:
        raise InvalidInput(Problem(where, "several polygons", "a single one"))
    return Footprint(
        tuple(map(_open_ring, convex_parts(shapely.get_parts(polygon)[0])))
    )


def _open_ring(part: Geometries) -> ComplexArray:
    xy = shapely.get_coordinates(part)[:-1]
    return np.ascontiguousarray(xy[:, 0] + 1j * xy[:, 1])
