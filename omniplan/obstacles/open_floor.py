"""The open floor: places where a vehicle is free whatever its heading.

Kept as columns of y, each with the runs known to be open, so that whoever asks often
needs one look into a dict and two comparisons, without any call.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right

__all__ = ["OpenFloor"]


class OpenFloor:
    """Columns of places that are known to be open; they become more.

    Parameters
    ----------
    cell : float, m
        Width of a column, a power of two.
    size : float, m
        No place farther from the axes is ever open.

    Attributes
    ----------
    cell : float, m
    longest : dict of float to (float, float), m
        Lower and upper end of the longest run of every column. The column of x has
        the key ``x + shift``: the sum rounds x to a multiple of the cell, so a key
        holds all x within half a cell of it, and no others.
    ends : dict of float to list of float, m
        The ends of all runs of every column, rising.
    shift : float, m
    """

    def __init__(self, cell: float, size: float) -> None:
        self.longest: dict[float, tuple[float, float]] = {}
        # Floats of this binade are one cell apart.
        self.shift = 1.5 * 2.0**52 * cell
        self.ends: dict[float, list[float]] = {}
        self.cell = cell
        self._size = size

    def __contains__(self, place: tuple[float, float]) -> bool:
        """Return whether a place is known to be open; not for what is not finite."""
        x, y = place
        # Odd places lie in a run, even ones between two.
        return bisect_right(self.ends.get(x + self.shift, ()), y) % 2 == 1

    def clear(self) -> None:
        """Forget all."""
        self.longest.clear()
        self.ends.clear()

    def open_around(self, x: float, y: float, radius: float) -> None:
        """Make known that all within a radius of any point of a cell is open.

        Only the column of the cell learns it: its neighbours would take longer to tell
        than to look at when they are asked for.

        Parameters
        ----------
        x, y : float, m
            Middle of the cell.
        radius : float, m, > 0
        """
        if abs(x) + self.cell / 2 > self._size:
            return
        # A hair less, so that rounding opens nothing.
        reach = self.cell / 2 + radius * (1 - 1e-9) - 1e-9
        low, high = max(y - reach, -self._size), min(y + reach, self._size)
        if low < high:
            self._add(x + self.shift, low, high)

    def _add(self, key: float, low: float, high: float) -> None:
        """Join a run with those of its column."""
        ends = self.ends.setdefault(key, [])
        # Even places lie before a run, odd ones in it.
        first, last = bisect_left(ends, low), bisect_right(ends, high)
        ends[first:last] = [low] * (first % 2 == 0) + [high] * (last % 2 == 0)
        at = bisect_right(ends, low) - 1
        low, high = ends[at], ends[at + 1]
        before = self.longest.get(key, (0.0, 0.0))
        if high - low > before[1] - before[0]:
            self.longest[key] = low, high
