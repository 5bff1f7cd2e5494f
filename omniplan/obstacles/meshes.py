"""Solids between two heights, seen from above.

A point of the floor is in the shadow if the vertical line through it meets the solid
within the slab. Going up from there one either leaves the solid through a face in the
slab, or reaches the upper height inside. So the shadow is the union of the faces that
lie in the slab, cut off at its heights, and of the section at the upper height: exact,
but for the rounding of the cuts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from shapely.geometry import LinearRing, Polygon

from configspace import InvalidInput, Problem
from omniplan.obstacles.polygons import Area, Geometries, joined, polygonal
from omniplan.samples import MAX_VALUE

__all__ = ["Mesh", "shadow"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


_ASKED = 64
"""So many faces of a body turned inside out are asked whether they are in a solid."""


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
        If the mesh is open, turned inside out, no triangles or not finite, or the
        heights are not in order.
    """
    low, high = _checked_heights(heights)
    vertices, faces = _checked_mesh(name, mesh)
    solids = _solids(name, vertices, _bodies(len(vertices), faces))
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
    return polygonal(shapely.union(joined(flat), _section(vertices, solids, high)))


def _checked_heights(heights: tuple[float, float]) -> tuple[float, float]:
    allowed = "two finite heights, the lower one first"
    try:
        low, high = (float(x) for x in heights)
    except (TypeError, ValueError) as error:
        raise InvalidInput(Problem("heights", repr(heights)[:60], allowed)) from error
    if not -MAX_VALUE <= low < high <= MAX_VALUE:
        raise InvalidInput(Problem("heights", f"({low:g}, {high:g}) m", allowed))
    return low, high


def _checked_mesh(name: str, mesh: Mesh) -> tuple[FloatArray, IntArray]:
    """Return corners merged where they are equal, and faces; or raise."""
    if not (hasattr(mesh, "vertices") and hasattr(mesh, "faces")):
        allowed = "a trimesh.Trimesh, or anything with vertices and faces"
        raise InvalidInput(Problem(name, repr(mesh)[:60], allowed))
    vertices, faces = _arrays(name, mesh)
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


def _arrays(name: str, mesh: Mesh) -> tuple[FloatArray, IntArray]:
    """Return vertices (n, 3) and faces (m, 3), or raise."""
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    for what, found, kinds, allowed in (
        ("vertices", vertices, "iuf", "numbers (n, 3)"),
        ("faces", faces, "iu", "triangles: indices of vertices (m, 3)"),
    ):
        if not found.size:
            continue
        is_right = found.ndim == 2 and found.shape[1] == 3
        if not is_right or found.dtype.kind not in kinds:
            given = f"{what} of shape {found.shape}, {found.dtype}"
            raise InvalidInput(Problem(name, given, allowed))
    vertices = vertices.astype(np.float64).reshape(-1, 3)
    faces = faces.astype(np.int64).reshape(-1, 3)
    bad = np.flatnonzero(((faces < 0) | (faces >= len(vertices))).any(axis=1))
    if bad.size:
        given = f"face {bad[0]} of vertices {faces[bad[0]].tolist()}"
        allowed = f"indices of vertices from 0 to {len(vertices) - 1}"
        raise InvalidInput(Problem(name, given, allowed))
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


def _bodies(n: int, faces: IntArray) -> list[IntArray]:
    """Return the faces of every body: of vertices that hang together, of n."""
    links = coo_array((np.ones(3 * len(faces)), _sides(faces).T), shape=(n, n))
    _, body = connected_components(links, directed=False)
    order = np.argsort(body[faces[:, 0]], kind="stable")
    begins = np.flatnonzero(np.diff(body[faces[order, 0]])) + 1
    return np.split(faces[order], begins)


class _Solid(NamedTuple):
    """A body and the cavities in it."""

    faces: IntArray
    cavities: list[IntArray]


def _solids(
    name: str, vertices: FloatArray, bodies: Sequence[IntArray]
) -> list[_Solid]:
    """Return the bodies with their cavities: those turned inside out, or raise.

    A cavity is one of the smallest solid around it; what stands in it stays. One that
    only several solids together surround is filled up.
    """
    volumes = [_volume(vertices, own) for own in bodies]
    corners = [vertices[own].reshape(-1, 3) for own in bodies]
    low = np.array([each.min(axis=0) for each in corners])
    high = np.array([each.max(axis=0) for each in corners])
    found = {i: _Solid(own, []) for i, own in enumerate(bodies) if volumes[i] >= 0}
    for i, own in enumerate(bodies):
        if i in found:
            continue
        middles = vertices[own[:: len(own) // _ASKED + 1]].mean(axis=1)
        meets = ((low <= high[i]) & (high >= low[i])).all(axis=1)
        meets[i] = False
        turns = {
            k: _winding(vertices[bodies[k]], middles)
            for k in np.flatnonzero(meets).tolist()
        }
        total = np.sum([np.zeros(len(middles)), *turns.values()], axis=0)
        if total.min() < 0.5:
            x, y, z = middles[np.argmin(total)].tolist()
            given = f"faces turned inwards, one at ({x:g}, {y:g}, {z:g}), in no solid"
            allowed = "a closed solid whose faces are all turned outwards"
            raise InvalidInput(Problem(name, given, allowed))
        around = [k for k in turns if k in found and turns[k].min() > 0.5]
        if around:
            found[min(around, key=volumes.__getitem__)].cavities.append(own)
    return list(found.values())


def _winding(triangles: FloatArray, points: FloatArray) -> FloatArray:
    """Return how often a surface (m, 3, 3) winds around points (n, 3): 1 inside.

    The sum of solid angles, by the formula of van Oosterom and Strackee.
    """
    found = np.empty(len(points))
    for i, point in enumerate(points):
        a, b, c = np.moveaxis(triangles - point, 1, 0)
        la, lb, lc = (np.linalg.norm(each, axis=1) for each in (a, b, c))
        inside = (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
        volume = (a * np.cross(b, c)).sum(1)
        found[i] = np.arctan2(volume, la * lb * lc + inside).sum() / (2 * np.pi)
    return found


def _section(vertices: FloatArray, solids: Sequence[_Solid], level: float) -> Area:
    """Return the horizontal section: of solids, each without its cavities."""
    found = []
    for solid in solids:
        # What a surface that crosses itself turns inside out counts as solid, too.
        area = _wound(vertices, solid.faces, level, (-1, 1))
        voids = [_wound(vertices, own, level, (1,)) for own in solid.cavities]
        found.append(polygonal(shapely.difference(area, joined(_array(voids)))))
    return joined(_array(found))


def _wound(
    vertices: FloatArray, faces: IntArray, level: float, signs: tuple[int, ...]
) -> Area:
    """Return around what the lines wind in which a body meets a level.

    Where a body overlaps itself its lines wind twice. They run clockwise (-1) around
    what is inside faces that look outwards.
    """
    rings = list(_loops(vertices, faces, level))
    if not rings:
        return Polygon()
    if len(rings) == 1:
        alone = Polygon(rings[0])
        if alone.is_valid:
            is_kept = (1 if alone.exterior.is_ccw else -1) in signs
            return alone if is_kept else Polygon()
    lines = shapely.get_parts(shapely.union_all(list(map(LinearRing, rings))))
    cells = shapely.get_parts(shapely.polygonize(lines))
    points = shapely.get_coordinates(shapely.point_on_surface(cells))
    turns = sum((_turns(ring, points) for ring in rings), start=np.zeros(len(points)))
    return joined(cells[np.isin(np.sign(turns), signs)])


def _turns(ring: FloatArray, points: FloatArray) -> FloatArray:
    """Return how often a closed line (n, 2) winds around points, counter-clockwise."""
    a, b = ring[:-1], ring[1:]
    x, y = points[:, :1], points[:, 1:]
    side = (b[:, 0] - a[:, 0]) * (y - a[:, 1]) - (x - a[:, 0]) * (b[:, 1] - a[:, 1])
    up = (a[:, 1] <= y) & (b[:, 1] > y) & (side > 0)
    down = (a[:, 1] > y) & (b[:, 1] <= y) & (side < 0)
    return np.asarray(up.sum(axis=1) - down.sum(axis=1), dtype=np.float64)


def _array(areas: list[Area]) -> Geometries:
    found = np.empty(len(areas), dtype=np.object_)
    found[:] = areas
    return found


def _volume(vertices: FloatArray, faces: IntArray) -> float:
    a, b, c = (vertices[faces[:, i]] - vertices[faces[0, 0]] for i in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def _loops(vertices: FloatArray, faces: IntArray, level: float) -> Iterator[FloatArray]:
    """Yield the closed lines (n, 2) in which a closed surface meets a level.

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
            yield np.array(ring)
