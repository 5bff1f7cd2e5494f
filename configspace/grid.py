"""The grid of a space: cells over (κ_n, β) that no kink cuts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from configspace.errors import InvalidInput, Problem
from configspace.undercarriage import Mobility

__all__ = ["Grid", "edges_of"]

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Grid:
    """Number of cells over κ_n ∈ [-2, 2] and β ∈ [-π, π].

    κ_n = 0 and ±1 are cell edges, so `n_kappa` is a multiple of 4: between them
    c and s are affine in κ_n, and the bounds over a cell are exact.

    Raises
    ------
    InvalidInput
        If a number of cells is out of range.
    """

    n_kappa: int = 400
    """Cells over κ_n, a multiple of 4, 4 to 4000."""
    n_beta: int = 720
    """Cells over β, 8 to 7200."""

    def __post_init__(self) -> None:
        for name in ("n_kappa", "n_beta"):
            value = getattr(self, name)
            if not isinstance(value, int) or isinstance(value, bool):
                raise InvalidInput(Problem(f"grid.{name}", repr(value), "an integer"))
        if not (4 <= self.n_kappa <= 4000 and self.n_kappa % 4 == 0):
            raise InvalidInput(
                Problem("grid.n_kappa", f"{self.n_kappa}", "a multiple of 4, 4 to 4000")
            )
        if not 8 <= self.n_beta <= 7200:
            raise InvalidInput(Problem("grid.n_beta", f"{self.n_beta}", "8 to 7200"))

    @cached_property
    def kappa_edges(self) -> FloatArray:
        """Edges of the cells over κ_n, (n_kappa + 1,), exact at 0, ±1 and ±2."""
        # k * 4 / n is exact at those: n is a multiple of 4.
        edges = np.arange(self.n_kappa + 1) * 4 / self.n_kappa - 2
        edges.flags.writeable = False
        return edges

    @cached_property
    def beta_edges(self) -> FloatArray:
        """Edges of the cells over β, (n_beta + 1,), rad, from -π to π."""
        edges = np.linspace(-np.pi, np.pi, self.n_beta + 1)
        edges.flags.writeable = False
        return edges


def edges_of(mobility: Mobility, grid: Grid) -> tuple[FloatArray, FloatArray]:
    """Return the edges of cells over κ_n and β for a kind of mobility.

    A line-mobile vehicle has one column of cells at its β, one that cannot turn one
    row at κ_n = 0; both have no width.

    Parameters
    ----------
    mobility : Mobility
    grid : Grid

    Returns
    -------
    kappa : (k + 1,) float, 1
    beta : (m + 1,) float, rad
    """
    kappa, beta = grid.kappa_edges, grid.beta_edges
    if mobility.line_beta is not None:
        beta = np.array([mobility.line_beta, mobility.line_beta])
    if mobility.is_translating:
        kappa = np.zeros(2)
    return kappa, beta
