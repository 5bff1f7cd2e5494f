"""From bounds of cells to the tables of a data sheet, in one pass of numba."""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit, prange

from configspace.row_bounds import BLOCKED, FREE
from configspace.threads import RELEASES_LOCK

__all__ = ["round_tables"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

_SLACK = 1e-14
"""What covers the rounding of the sums and roots here, relative."""
_LEAST_LOAD = 1e-30
"""Never 0: a load that vanishes at a singular point is not a speed limit."""
_FASTEST = 3e38
"""A cell around a wheel's singular point may have no bound on its speed, m/s."""


def round_tables(
    nodes: Array, row_pad: Array, cell_pad: Array, low: Array, high: Array, state: Array
) -> tuple[Array, Array, Array]:
    """Return loads at nodes and speeds of cells, rounded to the safe side.

    Parameters
    ----------
    nodes : (k + 1, m + 1) float, (m/s)⁻²
        Largest squared load at every node.
    row_pad : (k + 1,) float, (m/s)⁻²
        Added to all nodes of a row.
    cell_pad : (k, m) float, (m/s)⁻²
        Added to a node: the largest of the cells that meet there.
    low, high : (k, m) float, (m/s)⁻²
        Bounds of the squared load over the cells.
    state : (k, m) uint8

    Returns
    -------
    load : (k + 1, m + 1) float32, (m/s)⁻²
        Never less than given.
    v_lo : (k, m) float32, m/s
        Never more than ``1/√high``; 0 where the cell is not `FREE`.
    v_hi : (k, m) float32, m/s
        Never less than ``1/√low``; 0 where the cell is `BLOCKED`.
    """
    load = np.empty(nodes.shape, np.float32)
    v_lo, v_hi = np.empty((2, *low.shape), np.float32)
    _fill(nodes, row_pad, cell_pad, low, high, state, load, v_lo, v_hi)
    return load, v_lo, v_hi


@njit(cache=True, inline="always")
def _up(value: float) -> Any:
    """Return a number as float32, never smaller."""
    single = np.float32(value)
    if np.float64(single) < value:
        single = np.nextafter(single, np.float32(np.inf))
    return single


@njit(cache=True, inline="always")
def _inverse_root(load: float) -> float:
    return 1.0 / math.sqrt(load) if load > 0.0 else math.inf


@njit(cache=True, parallel=True, nogil=RELEASES_LOCK)
def _fill(
    nodes: Array,
    row_pad: Array,
    cell_pad: Array,
    low: Array,
    high: Array,
    state: Array,
    load: Array,
    v_lo: Array,
    v_hi: Array,
) -> None:
    """Write load, v_lo and v_hi, row by row."""
    rows, columns = low.shape
    for k in prange(rows + 1):
        for m in range(columns + 1):
            pad = 0.0
            for i in range(max(k - 1, 0), min(k + 1, rows)):
                for j in range(max(m - 1, 0), min(m + 1, columns)):
                    pad = max(pad, cell_pad[i, j])
            padded = (nodes[k, m] + row_pad[k] + pad) * (1 + _SLACK)
            load[k, m] = _up(max(padded, _LEAST_LOAD))
        if k == rows:
            continue
        for m in range(columns):
            slowest = fastest = 0.0
            if state[k, m] == FREE:
                slowest = _inverse_root(high[k, m]) * (1 - _SLACK)
            if state[k, m] != BLOCKED:
                fastest = min(_inverse_root(low[k, m]) * (1 + _SLACK), _FASTEST)
            v_lo[k, m] = -_up(-slowest)
            v_hi[k, m] = _up(fastest)
