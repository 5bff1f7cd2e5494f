"""Places in a table, counted in cells: what they are, whether permitted, how fast.

What the mesh needs beside its ground plan: rectangles of cells, the border of the
blocked area, and for the vertices of triangles speeds such that no point of a triangle
is too fast.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from configspace.space import PermissibleSpace

__all__ = ["Blocks", "border_on", "is_permitted", "kappa_beta", "speeds"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]


_CLEARANCE = 1e-3
"""Least distance of a cut from the ends of its side: no triangle gets too thin."""


@dataclass(frozen=True)
class Blocks:
    """Rectangles of cells, and which of them are joined."""

    rows: IntArray
    """(p + 1,) edges over κ_n, in cells; κ_n = 0 and ±1 are among them."""
    columns: IntArray
    """(q + 1,) edges over β, in cells."""
    joined: BoolArray
    """(k, m) whether the cell belongs to a rectangle of free cells only."""

    @classmethod
    def of(cls, free: BoolArray, max_cells: int) -> Self:
        """Return rectangles as large as it needs to have at most `max_cells`."""
        k, m = free.shape
        factor = max(1.0, (k * m / max_cells) ** 0.5)
        rows = _edges(k, min(k, max(4, int(k / factor) // 4 * 4)))
        columns = _edges(m, max(1, min(m, int(m / factor))))
        whole = np.logical_and.reduceat(free, rows[:-1], axis=0)
        whole = np.logical_and.reduceat(whole, columns[:-1], axis=1)
        joined = np.repeat(whole, np.diff(rows), axis=0)
        return cls(rows, columns, np.repeat(joined, np.diff(columns), axis=1))

    def leaves(self, free: BoolArray) -> IntArray:
        """Return for every cell the first of its rectangle, -1 if not free, (k, m)."""
        k, m = free.shape
        row = np.repeat(self.rows[:-1], np.diff(self.rows))
        column = np.repeat(self.columns[:-1], np.diff(self.columns))
        own = np.arange(k * m).reshape(k, m)
        leaf = np.where(self.joined, row[:, None] * m + column, own)
        return np.where(free, leaf, -1)

    def extent(self, leaves: IntArray) -> tuple[IntArray, IntArray]:
        """Return the first and the last corner of cells or rectangles, in cells."""
        i, j = np.divmod(leaves, self.joined.shape[1])
        joined = self.joined[i, j]
        row = self.rows[np.searchsorted(self.rows, i, side="right")]
        column = self.columns[np.searchsorted(self.columns, j, side="right")]
        high_i, high_j = np.where(joined, row, i + 1), np.where(joined, column, j + 1)
        return np.stack([i, j], axis=-1), np.stack([high_i, high_j], axis=-1)


def border_on(
    space: PermissibleSpace, inside: FloatArray, outside: FloatArray
) -> FloatArray:
    """Return where sides leave the permitted area, by bisection.

    Parameters
    ----------
    space : PermissibleSpace
    inside, outside : (n, 2) float
        Ends of the sides as places in cells: permitted and blocked.

    Returns
    -------
    place : (n, 2) float
        The last permitted place, a little off the ends.
    """
    low, high = np.zeros(len(inside)), np.ones(len(inside))
    for _ in range(24):
        middle = (low + high) / 2
        at = inside + middle[:, None] * (outside - inside)
        is_free = is_permitted(space, at)
        low, high = np.where(is_free, middle, low), np.where(is_free, high, middle)
    low = np.clip(low, _CLEARANCE, 1 - _CLEARANCE)
    return np.asarray(inside + low[:, None] * (outside - inside))


def kappa_beta(space: PermissibleSpace, place: FloatArray) -> FloatArray:
    """Return (κ_n, β) of places in cells, (n, 2), 1 and rad."""
    grid = space.grid
    kappa = np.interp(place[:, 0], np.arange(grid.n_kappa + 1), grid.kappa_edges)
    beta = np.interp(place[:, 1], np.arange(grid.n_beta + 1), grid.beta_edges)
    if space.line_beta is not None:
        beta = np.full_like(beta, space.line_beta)
    if space.is_translating:
        kappa = np.zeros_like(kappa)
    return np.stack([kappa, beta], axis=-1)


def is_permitted(space: PermissibleSpace, place: FloatArray) -> BoolArray:
    """Return whether places in cells are permitted, (n,)."""
    at = kappa_beta(space, place)
    return space.v_max(at[:, 0], at[:, 1]) > 0


def speeds(
    space: PermissibleSpace,
    place: FloatArray,
    simplices: IntArray,
    cell: IntArray,
    blocks: Blocks,
) -> tuple[FloatArray, FloatArray]:
    """Return speeds at vertices that are permitted all over the simplices between them.

    Parameters
    ----------
    space : PermissibleSpace
    place : (n, 2) float
        Vertices, in cells from κ_n = -2 and from β = -π.
    simplices : (t, 2 or 3) int
        Vertices of pieces or triangles, each within one cell or joined rectangle.
    cell : (t,) int
        Flat index of the cell, or of the first of the rectangle.
    blocks : Blocks

    Returns
    -------
    forward, reverse : (n,) float, m/s, > 0

    Notes
    -----
    Interpolated bilinearly, the table of squared inverse speeds L is never too small.
    Interpolated over a simplex in a rectangle of cells it is lower by at most `_excess`
    of the rectangle, so that much is added. v = L^(-1/2) is convex: between L and q² L
    its chord lies above it by a factor of at most 2 (a + 1)^(3/2) / (3 √3 a),
    a = q² + q; so the speeds are divided by it.
    """
    both = []
    for load in space.tables.load.astype(np.float64):
        excess = np.zeros(len(place))
        added = _excess(load, blocks).ravel()[cell]
        np.maximum.at(excess, simplices, added[:, None])
        at = _bilinear(load, place) + excess
        ends = at[simplices]
        q = np.sqrt(ends.max(axis=1) / ends.min(axis=1))
        a = q * q + q
        factor = np.ones(len(place))
        chord = 2 * (a + 1) ** 1.5 / (27**0.5 * a)
        np.maximum.at(factor, simplices, chord[:, None])
        both.append((1 - 1e-14) / (np.sqrt(at) * factor))
    return both[0], both[-1]


def _excess(load: FloatArray, blocks: Blocks) -> FloatArray:
    """Return by how much the table exceeds planes through places in a cell, (k, m).

    For joined cells: in their rectangle. Against the bilinear function through the
    corners of the rectangle the table differs by what is found at its nodes, and that
    function differs from its planes by at most a quarter of its twist.
    """
    rows, columns = blocks.rows, blocks.columns
    coarse = load[np.ix_(rows, columns)]
    i, j = np.arange(load.shape[0]), np.arange(load.shape[1])
    fine = np.stack(np.meshgrid(
        np.interp(i, rows, np.arange(rows.size)),
        np.interp(j, columns, np.arange(columns.size)), indexing="ij"), axis=-1,
    )  # fmt: skip
    apart = load - _bilinear(coarse, fine.reshape(-1, 2)).reshape(load.shape)
    whole = np.abs(_twist(coarse)) / 4
    for sign in (1, -1):
        over = sign * apart
        worst = np.maximum(
            np.maximum(over[:-1, :-1], over[1:, :-1]),
            np.maximum(over[:-1, 1:], over[1:, 1:]),
        )
        worst = np.maximum.reduceat(worst, rows[:-1], axis=0)
        worst = np.maximum.reduceat(worst, columns[:-1], axis=1)
        whole += np.maximum(worst, 0.0)
    spread = np.repeat(whole, np.diff(rows), axis=0)
    spread = np.repeat(spread, np.diff(columns), axis=1)
    return np.where(blocks.joined, spread, np.abs(_twist(load)) / 4)


def _twist(nodes: FloatArray) -> FloatArray:
    return np.asarray(np.diff(np.diff(nodes, axis=0), axis=1))


def _bilinear(nodes: FloatArray, place: FloatArray) -> FloatArray:
    """Return nodes interpolated at places in cells, (n,)."""
    last = np.array(nodes.shape) - 2
    cell = np.clip(place.astype(np.int64), 0, last)
    (i, j), (x, y) = cell.T, (place - cell).T
    below = (1 - y) * nodes[i, j] + y * nodes[i, j + 1]
    above = (1 - y) * nodes[i + 1, j] + y * nodes[i + 1, j + 1]
    return np.asarray((1 - x) * below + x * above)


def _edges(cells: int, count: int) -> IntArray:
    return np.round(np.linspace(0, cells, count + 1)).astype(np.int64)
