"""Polygons as they come from outside: checked before they are used."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry import MultiPolygon, Polygon

from configspace import InvalidInput, Problem
from omniplan.samples import MAX_VALUE

__all__ = [
    "Area",
    "Geometries",
    "checked_polygon",
    "convex_parts",
    "joined",
    "polygonal",
    "rings_of",
]

FloatArray = npt.NDArray[np.float64]
Geometries = npt.NDArray[np.object_]
Area: TypeAlias = Polygon | MultiPolygon

_AREA = 1e-12
"""A smaller area is none, m²."""


def checked_polygon(where: str, given: object) -> Area:
    """Return a polygon, or raise.

    Parameters
    ----------
    where : str
        What the polygon is, for the error.
    given : (n, 2) float, m, or shapely polygon
        Corners in either direction, the first one may be repeated at the end. Only a
        shapely polygon can have holes.

    Raises
    ------
    InvalidInput
        If a number is not finite or too large, if the polygon has fewer than three
        corners or no area, or if it crosses itself: with the place.
    """
    if isinstance(given, Polygon | MultiPolygon):
        polygon: Area = shapely.force_2d(given)
        _reject_large(where, shapely.get_coordinates(polygon))
    else:
        corners = _corners(where, given)
        _reject_large(where, corners)
        polygon = Polygon(corners)
    if polygon.is_empty:
        raise _invalid(where, "an empty polygon", "at least three corners")
    # That is invalid as well, but "self-intersection" would say less.
    if shapely.convex_hull(polygon).area < _AREA:
        raise _invalid(where, "a polygon without an area", "corners around an area")
    reason = str(shapely.is_valid_reason(polygon))
    if reason != "Valid Geometry":
        # GEOS says "Self-intersection[1 2]".
        what, _, place = reason.partition("[")
        given_ = f"{what.lower()} at ({', '.join(place.rstrip(']').split())})"
        allowed = "a polygon that neither crosses nor touches itself"
        raise _invalid(where, given_, allowed)
    return polygon


def _reject_large(where: str, corners: FloatArray) -> None:
    bad = np.flatnonzero(~(np.abs(corners) <= MAX_VALUE).all(axis=1))
    if bad.size:
        x, y = corners[bad[0]]
        allowed = f"finite numbers of at most {MAX_VALUE:g} m"
        raise _invalid(f"{where}: corner {bad[0]}", f"({x:g}, {y:g})", allowed)


def _corners(where: str, given: Any) -> FloatArray:
    allowed = "corners (n, 2) in m, n of at least 3"
    try:
        found = np.array(given)
        # Words and truth values could be read as numbers.
        if found.size and found.dtype.kind not in "iuf":
            raise TypeError("not numbers")
        corners = found.astype(np.float64)
    except (TypeError, ValueError) as error:
        raise _invalid(where, repr(given)[:60], allowed) from error
    if corners.ndim != 2 or corners.shape[1] != 2:
        raise _invalid(where, f"an array of shape {corners.shape}", allowed)
    if len(corners) and np.array_equal(corners[0], corners[-1]):
        corners = corners[:-1]
    if len(corners) < 3:
        raise _invalid(where, f"{len(corners)} corner(s)", allowed)
    return corners


def _invalid(where: str, given: str, allowed: str) -> InvalidInput:
    return InvalidInput(Problem(where, given, allowed))


def convex_parts(polygon: Polygon) -> Geometries:
    """Return convex polygons whose union is the polygon, exactly."""
    hull = shapely.convex_hull(polygon)
    if abs(hull.area - polygon.area) <= 1e-12 * hull.area:
        return np.array([hull], dtype=np.object_)
    return _triangles(polygon)


def _triangles(polygon: Polygon) -> Geometries:
    """Return triangles between the corners; the polygon itself if that fails."""
    found = shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))
    if abs(shapely.area(found).sum() - polygon.area) <= 1e-9 * polygon.area:
        return np.asarray(found, dtype=np.object_)
    return np.array([polygon], dtype=np.object_)


def joined(pieces: Geometries) -> Area:
    """Return the union of polygons."""
    return polygonal(shapely.union_all(pieces))


def polygonal(shape: shapely.Geometry) -> Area:
    """Return a shape without what has no area: lines and points."""
    if isinstance(shape, Polygon | MultiPolygon):
        return shape
    parts = shapely.get_parts(shape)
    return MultiPolygon([part for part in parts if isinstance(part, Polygon)])


def rings_of(polygon: Area) -> tuple[FloatArray, ...]:
    """Return the closed rings of a polygon, (n, 2) each; outer ones before holes."""
    rings = shapely.get_rings(shapely.get_parts(shapely.orient_polygons(polygon)))
    return tuple(shapely.get_coordinates(ring) for ring in rings)
