"""The broad phase: which pieces can matter at a place.

An STRtree finds the pieces; what it found for a cell of the floor is kept, so that a
planner's many questions about the same places cost one look into a dict.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import shapely

from omniplan.obstacles.polygons import Geometries

__all__ = ["Broad", "Nearby"]

IntArray = npt.NDArray[np.int64]

MAX_KEPT = 200_000
"""Cells that are remembered at most."""


class Nearby(NamedTuple):
    """What is near one cell of the floor."""

    gap: float
    """No point of the cell is nearer to any piece, m; at most the reach asked for."""
    pieces: Geometries
    """(k,) all pieces within the reach of any point of the cell."""


class Broad:
    """Pieces near places.

    Parameters
    ----------
    pieces : (n,) polygons
    reach : float, m, > 0
        How far around a place `at` must know all pieces.
    """

    def __init__(self, pieces: Geometries, reach: float) -> None:
        self.pieces = pieces
        self.reach = reach
        shapely.prepare(pieces)
        self.tree = shapely.STRtree(pieces)
        self._cell = reach / 2
        self._half_diagonal = self._cell * math.sqrt(0.5)
        self._kept: dict[tuple[int, int], Nearby] = {}

    def at(self, x: float, y: float) -> Nearby:
        """Return what is near a place; x and y must be finite."""
        cell = self._cell
        key = (math.floor(x / cell), math.floor(y / cell))
        found = self._kept.get(key)
        return self._look(key) if found is None else found

    def _look(self, key: tuple[int, int]) -> Nearby:
        x, y = ((k + 0.5) * self._cell for k in key)
        middle = shapely.Point(x, y)
        # A hair more than needed, as x / cell and the middle are rounded.
        radius = (self.reach + self._half_diagonal) * (1 + 1e-9) + 1e-9
        index = self.tree.query(middle, predicate="dwithin", distance=radius)
        pieces = self.pieces[np.sort(index)]
        least = float(shapely.distance(pieces, middle).min()) if index.size else radius
        found = Nearby(least - self._half_diagonal * (1 + 1e-9) - 1e-9, pieces)
        if len(self._kept) >= MAX_KEPT:
            self._kept.clear()
        self._kept[key] = found
        return found

    def in_box(self, x0: float, y0: float, x1: float, y1: float) -> Geometries:
        """Return all pieces, and perhaps more, that reach into a box."""
        return self.pieces[np.sort(self.tree.query(shapely.box(x0, y0, x1, y1)))]

    def near(self, shapes: Geometries, distance: npt.ArrayLike) -> IntArray:
        """Return pairs (2, k): shapes and the pieces within a distance of them."""
        # Types of shapely know no array of distances with an array of shapes.
        query: Any = self.tree.query
        found = query(shapes, predicate="dwithin", distance=distance)
        return np.asarray(found, dtype=np.int64)
