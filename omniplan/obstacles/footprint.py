"""The vehicle's outline on the ground."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
import shapely

from configspace import InvalidInput, PermissibleSpace, Problem, Vehicle
from omniplan.obstacles.polygons import Geometries, checked_polygon, convex_parts

__all__ = ["Body", "Footprint", "footprint_of"]

ComplexArray = npt.NDArray[np.complex128]
Body: TypeAlias = Vehicle | PermissibleSpace | npt.ArrayLike


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
    if isinstance(body, Vehicle):
        name, corners, k = body.name, body.footprint, body.reference
    elif isinstance(body, PermissibleSpace):
        name, corners = body.name, body.header.footprint
        k = complex(*body.header.reference)
    else:
        return _footprint("footprint", body), 0j
    if not corners:
        # Wheels tell nothing of the body around them: a guess could be too small.
        allowed = (
            "give footprint in the vehicle file, or the polygon in the frame of K "
            "in place of the vehicle"
        )
        raise InvalidInput(Problem(f"vehicle {name}: footprint", "none", allowed))
    return _footprint(f"vehicle {name}: footprint", corners), k


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
