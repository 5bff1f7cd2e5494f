"""The least v_max over a turn of β at constant κ_n, from the table of a space.

The load at the nodes is interpolated bilinearly and never too small, so its largest
value over a piece is reached at a node or is less than what the nodes around its ends
say. Largest values of 2^l neighbours are kept for every l: a turn of any size takes two
of them per row of nodes.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from configspace import PermissibleSpace

__all__ = ["SlowestTable"]

Array = Any  # numba infers the types; mypy cannot look into the kernels
FloatArray = npt.NDArray[np.float64]

_TWO_PI = 2 * math.pi


@dataclass(frozen=True, eq=False)
class SlowestTable:
    """Largest loads over 2^l neighbouring nodes."""

    levels: npt.NDArray[np.float32]
    """(d, l, k + 1, m) (m/s)⁻²; the nodes of one turn, from -π on."""
    is_translating: bool

    @classmethod
    def of(cls, space: PermissibleSpace) -> SlowestTable:
        """Return the table for a space."""
        load = space.tables.load
        if space.line_beta is not None:
            nodes = load.max(axis=2, keepdims=True)
        else:
            nodes = load[:, :, :-1].copy()
            nodes[:, :, 0] = np.maximum(load[:, :, 0], load[:, :, -1])  # one place
        levels = [nodes]
        for level in range(nodes.shape[2].bit_length() - 1):
            last = levels[-1]
            levels.append(np.maximum(last, np.roll(last, -(2**level), axis=2)))
        table = np.stack(levels, axis=1)
        table.flags.writeable = False
        return cls(table, space.is_translating)

    def of_piece(
        self, kappa_n: float, beta_0: float, beta_1: float, reverse: bool
    ) -> float:
        """Return `v_max` of one piece; plain numbers, for callers in a hurry."""
        levels = self.levels[1 if reverse and len(self.levels) > 1 else 0]
        return float(_slowest_of(levels, self.is_translating, kappa_n, beta_0, beta_1))

    def v_max(
        self,
        kappa_n: FloatArray,
        beta_0: FloatArray,
        beta_1: FloatArray,
        reverse: bool,
    ) -> FloatArray:
        """Return a speed that no limit on speed forbids anywhere on the pieces, m/s.

        Whether they are permitted at all is left aside.
        """
        levels = self.levels[1 if reverse and len(self.levels) > 1 else 0]
        out = np.empty(kappa_n.shape)
        flat = [np.ascontiguousarray(x).ravel() for x in (kappa_n, beta_0, beta_1)]
        _slowest(levels, self.is_translating, *flat, out.reshape(-1))
        return out


@njit(cache=True)
def _slowest(
    levels: Array,
    is_translating: bool,
    kappa_n: Array,
    beta_0: Array,
    beta_1: Array,
    out: Array,
) -> None:
    """Write the speed for each piece."""
    for i in range(out.size):
        out[i] = _slowest_of(levels, is_translating, kappa_n[i], beta_0[i], beta_1[i])


@njit(cache=True)
def _slowest_of(
    levels: Array, is_translating: bool, kappa_n: float, beta_0: float, beta_1: float
) -> float:
    """Return the speed for one piece."""
    rows, columns = levels.shape[1] - 1, levels.shape[2]
    row, share = 0, 0.0
    if not is_translating:
        place = (kappa_n + 2.0) * (rows / 4.0)
        row = min(max(int(place), 0), rows - 1)
        share = place - row
    first, count = _nodes(columns, beta_0, beta_1, kappa_n)
    below = _largest(levels, row, first, count)
    above = _largest(levels, row + 1, first, count)
    return (1.0 - 1e-14) / math.sqrt((1.0 - share) * below + share * above)


@njit(cache=True)
def _nodes(
    columns: int, beta_0: float, beta_1: float, kappa_n: float
) -> tuple[int, int]:
    """First node and number of nodes that hold a piece between them."""
    low, high = min(beta_0, beta_1), max(beta_0, beta_1)
    if abs(kappa_n) == 2.0:  # a pole: any column will do
        low = high = 0.0
    scale = columns / _TWO_PI
    place = ((low + math.pi) % _TWO_PI) * scale
    first = int(place)
    # A little wider, so that rounding loses no node.
    last = math.ceil(place + (high - low) * scale + 1e-9)
    count = min(max(last - first + 1, 2), columns)
    return first % columns, count


@njit(cache=True)
def _largest(levels: Array, row: int, first: int, count: int) -> float:
    """Largest load of `count` nodes from the first one, round the seam."""
    level = 0
    while (2 << level) <= count:
        level += 1
    columns = levels.shape[2]
    second = (first + count - (1 << level)) % columns
    return float(max(levels[level, row, first], levels[level, row, second]))
