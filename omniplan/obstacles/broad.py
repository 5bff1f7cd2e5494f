"""The broad phase: which pieces can matter at a place.

An STRtree finds the pieces; what it found for a cell of the floor is kept, so that a
planner's many questions about the same places cost one look into a dict. Cells know
how far away the nearest piece is, however far: discs about places decide long moves.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import shapely

from omniplan.obstacles.polygons import Geometries

__all__ = ["Broad", "Nearby", "OpenFloor"]

IntArray = npt.NDArray[np.int64]

SMALL = 0.25
"""Smaller discs than this share of a cell are not worth their look-up."""
MAX_KEPT = 200_000
"""Cells that are remembered at most."""


class Nearby(NamedTuple):
    """What is near one cell of the floor."""

    gap: float
    """No point of the cell is nearer to any piece, m."""
    pieces: Geometries
    """(k,) all pieces within the reach of any point of the cell."""


class OpenFloor(NamedTuple):
    """Cells of the floor where nothing is near."""

    cells: set[tuple[int, int]]
    """``(⌊x cells_per_metre⌋, ⌊y cells_per_metre⌋)``."""
    cells_per_metre: float


class Broad:
    """Pieces near places.

    Parameters
    ----------
    pieces : (n,) polygons
    reach : float, m, > 0
        How far around a place `at` must know all pieces.
    ball : float, m, > 0
        Places with a larger gap are open floor.
    """

    def __init__(self, pieces: Geometries, reach: float, ball: float) -> None:
        self.pieces = pieces
        self.reach = reach
        self._ball = ball
        shapely.prepare(pieces)
        self.tree = shapely.STRtree(pieces)
        self._scale = 2 / reach
        self._cell = 1 / self._scale
        self._half_diagonal = self._cell * math.sqrt(0.5)
        self.open_floor = OpenFloor(set(), self._scale)
        self._kept: dict[tuple[int, int], Nearby] = {}

    def at(self, x: float, y: float) -> Nearby:
        """Return what is near a place; x and y must be finite."""
        scale = self._scale
        key = (math.floor(x * scale), math.floor(y * scale))
        found = self._kept.get(key)
        return self._look(key) if found is None else found

    def _look(self, key: tuple[int, int]) -> Nearby:
        x, y = ((k + 0.5) * self._cell for k in key)
        middle = shapely.Point(x, y)
        # A hair more than needed, as x · scale and the middle are rounded.
        radius = (self.reach + self._half_diagonal) * (1 + 1e-9) + 1e-9
        index = self.tree.query(middle, predicate="dwithin", distance=radius)
        pieces = self.pieces[np.sort(index)]
        if index.size:
            least = float(shapely.distance(pieces, middle).min())
        else:
            nearest = self.tree.nearest(middle)
            least = math.inf
            if nearest is not None:
                least = float(shapely.distance(self.pieces[nearest], middle))
        lost = 1e-9 + 1e-9 * self._half_diagonal + 1e-12 * (abs(x) + abs(y))
        found = Nearby(least - self._half_diagonal - lost, pieces)
        if len(self._kept) >= MAX_KEPT:
            self._kept.clear()
            self.open_floor.cells.clear()
        self._kept[key] = found
        if found.gap > self._ball:
            self.open_floor.cells.add(key)
        return found

    def is_clear(self, x0: float, y0: float, x1: float, y1: float, room: float) -> bool:
        """Return whether discs without pieces cover all within `room` of a line.

        True is sure; False comes where a disc would be small.

        Parameters
        ----------
        x0, y0, x1, y1 : float, m
            Ends of the line, finite.
        room : float, m
        """
        dx, dy = x1 - x0, y1 - y0
        length = math.hypot(dx, dy)
        least, gone = SMALL * self._cell, 0.0
        while True:
            share = gone / length if length > 0 else 0.0
            step = self.at(x0 + share * dx, y0 + share * dy).gap - room
            if gone + step > length:
                return step > 0
            if step < least:
                return False
            # A hair less, so that rounding leaves no gap between discs.
            gone += step * (1 - 1e-9)

    def in_box(self, x0: float, y0: float, x1: float, y1: float) -> Geometries:
        """Return all pieces, and perhaps more, that reach into a box."""
        return self.pieces[np.sort(self.tree.query(shapely.box(x0, y0, x1, y1)))]

    def near(self, shapes: Geometries, distance: npt.ArrayLike) -> IntArray:
        """Return pairs (2, k): shapes and the pieces within a distance of them."""
        # Types of shapely know no array of distances with an array of shapes.
        query: Any = self.tree.query
        found = query(shapes, predicate="dwithin", distance=distance)
        return np.asarray(found, dtype=np.int64)
