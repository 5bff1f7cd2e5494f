"""Several points of a vehicle's body at once: one row of every array for each."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

__all__ = ["Points", "column"]

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Points:
    """n points of the body; what is derived over m parts has the shape (n, m)."""

    at: ComplexArray
    """(n, 1) m, in the frame of the vehicle's file."""
    reach: FloatArray
    """(n, 1) m, distance from its origin."""

    @classmethod
    def of(cls, points: Sequence[complex]) -> Points:
        """Return points as columns, to go with parts along the rows."""
        at = np.array(points, dtype=np.complex128)[:, None]
        return cls(at, column(abs(point) for point in points))

    def rows(self, rows: slice) -> Points:
        """Return some of the points."""
        return Points(self.at[rows], self.reach[rows])


def column(values: Iterable[float]) -> FloatArray:
    """Return numbers as a column (n, 1)."""
    return np.array(list(values), dtype=np.float64)[:, None]
