"""Solids between two heights, seen from above.

A point of the floor is in the shadow if the vertical line through it meets the solid
within the slab. Going up from there one either leaves the solid through a face in the
slab, or reaches the upper height inside. So the shadow is the union of the faces that
lie in the slab, cut off at its heights, and of the section at the upper height: exact,
but for the rounding of the cuts.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Protocol

import numpy as np
import numpy.typing as npt
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from configspace import InvalidInput, Problem
from omniplan.obstacles.polygons import Area, Geometries, joined, polygonal
from omniplan.samples import MAX_VALUE

__all__ = ["Mesh", "shadow"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


class Mesh(Protocol):
    """A triangle mesh, such as ``trimesh.Trimesh``."""

    @property
    def vertices(self) -> npt.ArrayLike:
        """(n, 3) m."""
        ...

    @property
    def faces(self) -> npt.ArrayLike:
        """(m, 3) indices of vertices, counter-clockwise seen from outside."""
        ...


def shadow(name: str, mesh: Mesh, heights: tuple[float, float]) -> Area:
    """Return the projection of what lies between two heights.

    Parameters
    ----------
    name : str
        What the mesh is, for errors.
    mesh : Mesh
    heights : (float, float), m
        Lower and upper height.

    Returns
    -------
    area : polygon
        Empty if nothing of the solid is between the heights.

    Raises
    ------
    InvalidInput
        If the mesh is open or not finite or the heights are not in order.
    """
    low, high = _checked_heights(heights)
    vertices, faces = _checked_mesh(name, mesh)
    z = vertices[:, 2][faces]
    inside = (z.max(axis=1) >= low) & (z.min(axis=1) <= high)
    near = vertices[faces[inside]]
    whole = (near[..., 2] >= low).all(axis=1) & (near[..., 2] <= high).all(axis=1)
    cut = (_clipped(_clipped(t, 2, low, 1), 2, high, -1) for t in near[~whole])
    areas = [
        *shapely.polygons(near[whole][..., :2]),
        *(shapely.polygons(each[:, :2]) for each in cut if len(each) > 2),
    ]
    flat = _array(areas)
    # Upright faces have no area; they are the border of what is found elsewhere.
    flat = flat[shapely.area(flat) > 0] if flat.size else flat
    return polygonal(shapely.union(joined(flat), _section(vertices, faces, high)))


def _checked_heights(heights: tuple[float, float]) -> tuple[float, float]:
    low, high = (float(x) for x in heights)
    if not -MAX_VALUE <= low < high <= MAX_VALUE:
        allowed = "two finite heights, the lower one first"
        raise InvalidInput(Problem("heights", f"({low:g}, {high:g}) m", allowed))
    return low, high


def _checked_mesh(name: str, mesh: Mesh) -> tuple[FloatArray, IntArray]:
    """Return corners merged where they are equal, and faces; or raise."""
    if not (hasattr(mesh, "vertices") and hasattr(mesh, "faces")):
        allowed = "a trimesh.Trimesh, or anything with vertices and faces"
        raise InvalidInput(Problem(name, repr(mesh)[:60], allowed))
    vertices = np.asarray(mesh.vertices, dtype=np.float64).reshape(-1, 3)
    faces = np.asarray(mesh.faces, dtype=np.int64).reshape(-1, 3)
    if not len(faces):
        raise InvalidInput(Problem(name, "a mesh without faces", "a closed solid"))
    bad = np.flatnonzero(~(np.abs(vertices) <= MAX_VALUE).all(axis=1))
    if bad.size:
        given = f"vertex {bad[0]} at {tuple(vertices[bad[0]].tolist())}"
        allowed = f"finite numbers of at most {MAX_VALUE:g} m"
        raise InvalidInput(Problem(name, given, allowed))
    if _open_sides(vertices, faces)[0].size:
        # Files such as STL repeat a corner for every face.
        vertices, index = np.unique(vertices, axis=0, return_inverse=True)
        faces = index.reshape(-1)[faces]
        faces = faces[(faces != np.roll(faces, -1, axis=1)).all(axis=1)]
    lone, n_lone = _open_sides(vertices, faces)
    if lone.size:
        x, y, z = vertices[lone].mean(axis=0).tolist()
        given = f"an open mesh: {n_lone} side(s) without one other face at them, "
        allowed = "a closed solid whose faces are all turned outwards"
        raise InvalidInput(
            Problem(name, f"{given}one at ({x:g}, {y:g}, {z:g})", allowed)
        )
    return vertices, faces


def _open_sides(vertices: FloatArray, faces: IntArray) -> tuple[IntArray, int]:
    """Return a side that does not belong to just two faces, one each way; how many."""
    sides, n = _sides(faces), len(vertices)
    there, count = np.unique(sides[:, 0] * n + sides[:, 1], return_counts=True)
    back = np.unique(sides[:, 1] * n + sides[:, 0])
    odd = np.concatenate([np.setxor1d(there, back), there[count > 1]])
    if not odd.size:
        return odd, 0
    return np.array([odd[0] // n, odd[0] % n]), odd.size


def _sides(faces: IntArray) -> IntArray:
    """Return the directed sides of faces, (3 m, 2), face by face."""
    return np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)


def _clipped(polygon: FloatArray, axis: int, level: float, side: int) -> FloatArray:
    """Return the part of a convex polygon (n, 3) on one side of a level."""
    if not len(polygon):
        return polygon
    over = side * (polygon[:, axis] - level)
    kept = []
    for i in range(len(polygon)):
        a, b = polygon[i - 1], polygon[i]
        if over[i - 1] * over[i] < 0:
            kept.append(a + (b - a) * (over[i - 1] / (over[i - 1] - over[i])))
        if over[i] >= 0:
            kept.append(b)
    return np.array(kept).reshape(-1, 3)


def _section(vertices: FloatArray, faces: IntArray, level: float) -> Area:
    """Return the horizontal section: of bodies, without their cavities."""
    links = coo_array(
        (np.ones(3 * len(faces)), _sides(faces).T), shape=(len(vertices),) * 2
    )
    _, body = connected_components(links, directed=False)
    solid: list[Area] = []
    hollow: list[Area] = []
    for each in np.unique(body[faces[:, 0]]):
        own = faces[body[faces[:, 0]] == each]
        rings = list(_loops(vertices, own, level))
        if rings:
            filled = shapely.make_valid(
                shapely.polygons(rings), method="structure", keep_collapsed=False
            )
            area = polygonal(functools.reduce(shapely.symmetric_difference, filled))
            (solid if _volume(vertices, own) > 0 else hollow).append(area)
    cavities = joined(_array(hollow))
    return polygonal(shapely.difference(joined(_array(solid)), cavities))


def _array(areas: list[Area]) -> Geometries:
    found = np.empty(len(areas), dtype=np.object_)
    found[:] = areas
    return found


def _volume(vertices: FloatArray, faces: IntArray) -> float:
    a, b, c = (vertices[faces[:, i]] - vertices[faces[0, 0]] for i in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def _loops(
    vertices: FloatArray, faces: IntArray, level: float
) -> Iterator[shapely.LinearRing]:
    """Yield the closed lines in which a closed surface meets a level.

    Corners at the level count as above it, so a face is met in two sides or in none,
    and every side that is met belongs to two faces: lines close without tolerance.
    """
    sides = _sides(faces)
    above = vertices[:, 2] >= level
    down = above[sides[:, 0]] & ~above[sides[:, 1]]
    up = ~above[sides[:, 0]] & above[sides[:, 1]]
    # One way of every face leads from the side going up to the one going down, which
    # its neighbour sees going up.
    n = len(vertices)
    enter, leave = sides[up], sides[down]
    next_of = dict(
        zip(
            (enter[:, 0] * n + enter[:, 1]).tolist(),
            (leave[:, 1] * n + leave[:, 0]).tolist(),
            strict=True,
        )
    )
    low, high = vertices[enter[:, 0]], vertices[enter[:, 1]]
    share = (level - low[:, 2]) / (high[:, 2] - low[:, 2])
    places = low[:, :2] + share[:, None] * (high[:, :2] - low[:, :2])
    place_of = dict(zip(next_of, places, strict=True))
    while next_of:
        first, at = next(iter(next_of.items()))
        ring = [place_of[first]]
        del next_of[first]
        while at != first:
            ring.append(place_of[at])
            at = next_of.pop(at)
        ring.append(ring[0])
        if len(ring) > 3:
            yield shapely.linearrings(ring)
