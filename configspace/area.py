"""The permitted area of the (κ_n, β) plane as triangles: the ground plan of the mesh.

Whole `FREE` cells, joined to larger rectangles where all cells are free, and parts of
`MIXED` cells: the free ones or, where the vehicle is known, all, cut along the border
of the blocked area. Rectangles of different size meet without gaps, since a larger one
takes every vertex on its sides.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array, csgraph

from configspace.kernels import BLOCKED, FREE, MIXED
from configspace.places import Blocks, border_on, is_permitted

if TYPE_CHECKING:
    from configspace.space import PermissibleSpace

__all__ = ["Area", "permitted_area"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

_APART = 0.01
"""How far parts that touch at one vertex only are drawn apart."""


@dataclass(frozen=True)
class Area:
    """Triangles over the cells of a table."""

    place: FloatArray
    """(n, 2) vertices, in cells from κ_n = -2 and from β = -π."""
    triangles: IntArray
    """(t, 3) vertices, counter-clockwise in (κ_n, β)."""
    cell: IntArray
    """(t,) flat index of the (first) cell of the table that holds the triangle."""
    blocks: Blocks


def permitted_area(space: PermissibleSpace, max_cells: int, parts: int) -> Area:
    """Return the permitted area of a space as triangles, cut open at β = ±π.

    Parameters
    ----------
    space : PermissibleSpace
        Not line-mobile.
    max_cells : int
        Free cells are joined until the whole range counts at most so many.
    parts : int
        Parts along each side of a mixed cell, a multiple of 4.
    """
    state = space.tables.state
    blocks = Blocks.of(state == FREE, max_cells)
    lattice = _Lattice(state.shape[0], state.shape[1], parts)
    corners = lattice.parts(np.argwhere(state == MIXED))
    is_free = _part_is_free(space, lattice, corners)
    if space.vehicle is None:
        corners, is_free = corners[is_free], is_free[is_free]
    whole, whole_cell = _whole_cells(lattice, state == FREE, blocks, corners)
    cut, cut_cell, edges, crossing = _cut_cells(space, lattice, corners, is_free)
    ids, flat = np.unique(np.concatenate([whole, cut]), return_inverse=True)
    place = lattice.place(ids, blocks)
    of_edge = (ids >= lattice.size) & (ids < 3 * lattice.size)
    place[of_edge] = crossing[np.searchsorted(edges, ids[of_edge])]
    place, triangles = _without_pinches(place, flat.reshape(-1, 3))
    return Area(place, triangles, np.concatenate([whole_cell, cut_cell]), blocks)


@dataclass(frozen=True)
class _Lattice:
    """Integer names of all vertices: nodes, then cuts of sides, then middles."""

    k: int
    m: int
    per_cell: int
    """Parts along each side of a cell."""

    @property
    def width(self) -> int:
        """Nodes over β."""
        return self.m * self.per_cell + 1

    @property
    def size(self) -> int:
        """Number of nodes."""
        return (self.k * self.per_cell + 1) * self.width

    def parts(self, cells: IntArray) -> IntArray:
        """Return the corners (i, j) of the parts of cells, counter-clockwise.

        (n, 4, 2), in the order of the cells.
        """
        steps = np.arange(self.per_cell)
        part = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1)
        first = (cells[:, None, None] * self.per_cell + part).reshape(-1, 1, 2)
        return np.asarray(first + np.array([[0, 0], [1, 0], [1, 1], [0, 1]]))

    def name(self, nodes: IntArray) -> IntArray:
        """Return the names of nodes (i, j), (..., 2)."""
        return np.asarray(nodes[..., 0] * self.width + nodes[..., 1])

    def node(self, names: IntArray) -> IntArray:
        """Return the nodes (i, j) of names."""
        return np.stack(np.divmod(names, self.width), axis=-1)

    def place(self, ids: IntArray, blocks: Blocks) -> FloatArray:
        """Return the places of nodes and middles, in cells; nodes for the rest."""
        place = self.node(ids % self.size) / self.per_cell
        middles = ids >= 3 * self.size
        low, high = blocks.extent(ids[middles] - 3 * self.size)
        place[middles] = (low + high) / 2
        return place


def _whole_cells(
    lattice: _Lattice, free: BoolArray, blocks: Blocks, parts: IntArray
) -> tuple[IntArray, IntArray]:
    """Return the triangles of free cells and rectangles, and their cells."""
    k, m = free.shape
    leaf = blocks.leaves(free)
    leaves = np.unique(leaf[free])
    low, high = (lattice.per_cell * x for x in blocks.extent(leaves))
    corner = np.stack(
        [low, np.stack([high[:, 0], low[:, 1]], axis=-1), high,
         np.stack([low[:, 0], high[:, 1]], axis=-1)], axis=1
    )  # fmt: skip
    used = np.unique(lattice.name(np.concatenate([corner, parts]).reshape(-1, 2)))
    sides = [_sides(lattice, used, leaf, along) for along in (0, 1)]
    first, second, around = (np.concatenate(x) for x in zip(*sides, strict=True))
    # Four sides: two triangles; more: a fan around the middle.
    count = np.bincount(around, minlength=k * m)
    plain = count[leaves] == 4
    a, b, c, d = lattice.name(corner[plain]).T
    fan = count[around] > 4
    middle = 3 * lattice.size + around[fan]
    triangles = [
        np.stack([a, b, c], axis=-1),
        np.stack([a, c, d], axis=-1),
        np.stack([first[fan], second[fan], middle], axis=-1),
    ]
    return np.concatenate(triangles), np.concatenate(
        [leaves[plain], leaves[plain], around[fan]]
    )


def _sides(
    lattice: _Lattice, used: IntArray, leaf: IntArray, along: int
) -> tuple[IntArray, IntArray, IntArray]:
    """Return sides between neighbouring vertices and the rectangle on their left.

    `along` 0: sides along κ_n, 1: along β.
    """
    nodes = lattice.node(used)
    across = 1 - along
    nodes = nodes[np.lexsort((nodes[:, along], nodes[:, across]))]
    start, end = nodes[:-1], nodes[1:]
    neighbours = start[:, across] == end[:, across]
    start, end = start[neighbours], end[neighbours]
    behind = start.copy()
    behind[:, across] -= 1
    padded = np.pad(leaf, 1, constant_values=-1)
    on = [padded[tuple((x // lattice.per_cell + 1).T)] for x in (start, behind)]
    names = lattice.name(start), lattice.name(end)
    border = on[0] != on[1]
    parts = []
    for owner, forward in ((on[0], along == 0), (on[1], along == 1)):
        mine = border & (owner >= 0)
        first, second = names if forward else names[::-1]
        parts.append((first[mine], second[mine], owner[mine]))
    first, second, owner = (np.concatenate(x) for x in zip(*parts, strict=True))
    return first, second, owner


def _polygons(case: int, joined: bool) -> list[list[int]]:
    """Return the permitted polygons of a part; corners are 0 to 3, cuts 4 to 7.

    Bit i of `case`: corner i is permitted. `joined`: so is the middle.
    """
    free = [bool(case >> i & 1) for i in range(4)]
    if case in (5, 10) and not joined:
        return [[4 + (i - 1) % 4, i, 4 + i] for i in range(4) if free[i]]
    ring = []
    for i in range(4):
        ring += [i] * free[i] + [4 + i] * (free[i] != free[(i + 1) % 4])
    return [ring] if ring else []


def _cut_cells(
    space: PermissibleSpace, lattice: _Lattice, corners: IntArray, is_free: BoolArray
) -> tuple[IntArray, IntArray, IntArray, FloatArray]:
    """Return triangles of parts of mixed cells, their cells, and the cut sides."""
    names, inverse = np.unique(lattice.name(corners), return_inverse=True)
    inverse = inverse.reshape(-1, 4)
    permitted = _node_permitted(space, lattice, lattice.node(names))
    permitted[inverse[is_free]] = True
    free = permitted[inverse]
    case = free @ np.array([1, 2, 4, 8])
    joined = np.zeros(len(case), dtype=bool)
    saddle = (case == 5) | (case == 10)
    joined[saddle] = is_permitted(
        space, corners[saddle].mean(axis=1) / lattice.per_cell
    )
    # A side is named after its first node and its direction.
    first = lattice.name(corners[:, [0, 1, 3, 0]])
    side = lattice.size + 2 * first + np.array([0, 1, 0, 1])
    vertices = np.concatenate([lattice.name(corners), side], axis=1)
    cell = corners[:, 0] // lattice.per_cell @ np.array([lattice.m, 1])
    triangles, cells = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)]
    for number, middle in np.ndindex(16, 2):
        here = (case == number) & (joined == bool(middle))
        if here.any():
            for ring in _polygons(number, bool(middle)):
                for i in range(1, len(ring) - 1):
                    triangles.append(vertices[here][:, [ring[0], ring[i], ring[i + 1]]])
                    cells.append(cell[here])
    cut = free != np.roll(free, -1, axis=1)
    edges, index = np.unique(side[cut], return_index=True)
    ends = np.stack([corners[cut], np.roll(corners, -1, axis=1)[cut]], axis=1)[index]
    outward = np.where(free[cut][index][:, None, None], ends, ends[:, ::-1])
    crossing = border_on(space, *(outward.swapaxes(0, 1) / lattice.per_cell))
    return np.concatenate(triangles), np.concatenate(cells), edges, crossing


def _part_is_free(
    space: PermissibleSpace, lattice: _Lattice, corners: IntArray
) -> BoolArray:
    """Return whether the table says that a part is free."""
    cell, within = np.divmod(corners[:, 0], lattice.per_cell)
    i, j = (within * 4 // lattice.per_cell).T
    return np.asarray((space.tables.parts[tuple(cell.T)] >> (4 * i + j)) & 1 == 1)


def _node_permitted(
    space: PermissibleSpace, lattice: _Lattice, nodes: IntArray
) -> BoolArray:
    """Return whether nodes are permitted; on the side of a cell its state decides."""
    permitted = is_permitted(space, nodes / lattice.per_cell)
    state = space.tables.state
    for back in np.ndindex(2, 2):
        i, j = ((nodes - back) // lattice.per_cell).T
        around = state[i.clip(0, state.shape[0] - 1), j.clip(0, state.shape[1] - 1)]
        permitted = (permitted | (around == FREE)) & (around != BLOCKED)
    return permitted


def _without_pinches(
    place: FloatArray, triangles: IntArray
) -> tuple[FloatArray, IntArray]:
    """Return triangles such that parts that touch at one vertex only do not touch."""
    count = triangles.size
    corner = np.arange(count).reshape(-1, 3)
    start, end = triangles, np.roll(triangles, -1, axis=1)
    side = np.minimum(start, end) * len(place) + np.maximum(start, end)
    order = np.argsort(side, axis=None, kind="stable")
    twice = np.flatnonzero(np.diff(side.ravel()[order]) == 0)
    one, two = order[twice], order[twice + 1]
    # Two triangles run along a common side in opposite directions.
    following = np.roll(corner, -1, axis=1).ravel()
    pairs = np.concatenate([[one, following[two]], [following[one], two]], axis=1)
    graph = coo_array((np.ones(pairs.shape[1], np.int8), pairs), shape=(count, count))
    n_vertices, fan = csgraph.connected_components(graph, directed=False)
    original = np.empty(n_vertices, dtype=np.int64)
    original[fan] = triangles.ravel()
    centre = np.repeat(place[triangles].mean(axis=1), 3, axis=0)
    sums = np.stack([np.bincount(fan, x) for x in centre.T], axis=-1)
    inward = sums / np.bincount(fan)[:, None] - place[original]
    pinched = np.bincount(original)[original] > 1
    moved = place[original] + _APART * pinched[:, None] * inward
    return moved, fan.astype(np.int64).reshape(-1, 3)
