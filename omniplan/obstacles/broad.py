"""The broad phase: which pieces can matter at a place.

An STRtree finds the pieces; what it found for a cell of the floor is kept, so that a
planner's many questions about the same places cost one look into a dict. Who needs it
learns how far away the nearest piece is, however far: discs decide long moves.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import shapely

from omniplan.obstacles.open_floor import OpenFloor
from omniplan.obstacles.polygons import Geometries
from omniplan.samples import MAX_VALUE

__all__ = ["Broad", "Nearby"]

IntArray = npt.NDArray[np.int64]
Key = tuple[float, float]

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
        self._cell = 2.0 ** math.floor(math.log2(reach / 2))
        self._half_diagonal = self._cell * math.sqrt(0.5)
        self.open_floor = OpenFloor(self._cell, MAX_VALUE)
        self._shift = self.open_floor.shift
        self._kept: dict[Key, Nearby] = {}
        self._gaps: dict[Key, float] = {}

    def at(self, x: float, y: float) -> Nearby:
        """Return what is near a place; x and y must be of at most `MAX_VALUE`."""
        key = (x + self._shift, y + self._shift)
        found = self._kept.get(key)
        return self._look(key) if found is None else found

    def _look(self, key: Key) -> Nearby:
        x, y = key[0] - self._shift, key[1] - self._shift
        middle = shapely.Point(x, y)
        # A hair more than needed, as places and pieces are rounded.
        radius = (self.reach + self._half_diagonal) * (1 + 1e-9) + 1e-9
        index = self.tree.query(middle, predicate="dwithin", distance=radius)
        pieces = self.pieces[np.sort(index)]
        least = float(shapely.distance(pieces, middle).min()) if index.size else radius
        found = Nearby(self._gap_of(x, y, least), pieces)
        if len(self._kept) >= MAX_KEPT:
            self._kept.clear()
            self._gaps.clear()
            self.open_floor.clear()
        self._kept[key] = found
        if found.gap > self._ball:
            self.open_floor.open_around(x, y, found.gap - self._ball)
        return found

    def _gap_of(self, x: float, y: float, least: float) -> float:
        """Return the gap of a cell whose middle is so far from all pieces."""
        lost = 1e-9 + 1e-9 * self._half_diagonal + 1e-12 * (abs(x) + abs(y))
        return least - self._half_diagonal - lost

    def _far_gap(self, key: Key) -> float:
        """Return the gap of a cell with nothing in reach, however large."""
        x, y = key[0] - self._shift, key[1] - self._shift
        middle = shapely.Point(x, y)
        nearest, least = self.tree.nearest(middle), math.inf
        if nearest is not None:
            least = float(shapely.distance(self.pieces[nearest], middle))
        self._gaps[key] = gap = self._gap_of(x, y, least)
        return gap

    def is_clear(self, x0: float, y0: float, x1: float, y1: float, room: float) -> bool:
        """Return whether discs without pieces cover all within `room` of a line.

        True is sure; False comes where a disc would be small.

        Parameters
        ----------
        x0, y0, x1, y1 : float, m
            Ends of the line, of at most `MAX_VALUE`.
        room : float, m
        """
        dx, dy = x1 - x0, y1 - y0
        length = math.hypot(dx, dy)
        least, gone = SMALL * self._cell, 0.0
        shift, kept, gaps = self._shift, self._kept, self._gaps
        x, y = x0, y0
        while True:
            key = (x + shift, y + shift)
            gap = gaps.get(key)
            if gap is None:
                gap, pieces = kept.get(key) or self._look(key)
                if gone + gap - room <= length and not len(pieces):
                    gap = self._far_gap(key)
            step = gap - room
            if gone + step > length:
                return step > 0
            if step < least:
                return False
            # A hair less, so that rounding leaves no gap between discs.
            gone += step * (1 - 1e-9)
            share = gone / length
            x, y = x0 + share * dx, y0 + share * dy

    def in_box(self, x0: float, y0: float, x1: float, y1: float) -> Geometries:
        """Return all pieces, and perhaps more, that reach into a box."""
        return self.pieces[np.sort(self.tree.query(shapely.box(x0, y0, x1, y1)))]

    def near(self, shapes: Geometries, distance: npt.ArrayLike) -> IntArray:
        """Return pairs (2, k): shapes and the pieces within a distance of them."""
        # Types of shapely know no array of distances with an array of shapes.
        query: Any = self.tree.query
        found = query(shapes, predicate="dwithin", distance=distance)
        return np.asarray(found, dtype=np.int64)
