"""What the table of a space says of whole boxes in the (κ_n, β) plane."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from configspace.exact import LINE_TOLERANCE
from configspace.kernels import BLOCKED, FREE, MIXED
from configspace.sheet import SheetHeader, Tables

__all__ = ["bilinear", "box_states", "column_of", "row_of"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


def row_of(header: SheetHeader, kappa_n: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the row of cells and the place within it, 0 to 1."""
    if header.is_translating:
        return np.zeros(kappa_n.shape, np.int64), np.zeros(kappa_n.shape)
    count = header.grid.n_kappa
    position = (kappa_n + 2) * (count / 4)
    row = np.clip(position.astype(np.int64), 0, count - 1)
    return row, position - row


def column_of(columns: int, beta: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the column of cells, of so many, and the place within it, 0 to 1."""
    position = np.mod(beta + np.pi, 2 * np.pi) * (columns / (2 * np.pi))
    column = np.clip(position.astype(np.int64), 0, columns - 1)
    return column, np.clip(position - column, 0.0, 1.0)


def bilinear(
    nodes: npt.NDArray[np.float32],
    row: IntArray,
    column: IntArray,
    fk: FloatArray,
    fb: FloatArray,
) -> FloatArray:
    """Return nodes interpolated bilinearly within their cells."""
    below = (1 - fb) * nodes[row, column] + fb * nodes[row, column + 1]
    above = (1 - fb) * nodes[row + 1, column] + fb * nodes[row + 1, column + 1]
    return np.asarray((1 - fk) * below + fk * above, dtype=np.float64)


def box_states(
    header: SheetHeader,
    tables: Tables,
    box: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    direction: int,
) -> tuple[npt.NDArray[np.uint8], FloatArray]:
    """Return what holds all over boxes, for `PermissibleSpace.box`.

    Parameters
    ----------
    header : SheetHeader
    tables : Tables
    box : four (n,) float, 1, 1, rad, rad
        Least and largest κ_n, least and largest β.
    direction : int, {0, 1}
        First index of the loads.

    Returns
    -------
    state : (n,) uint8
    v_low : (n,) float, m/s
    """
    kappa_low, kappa_high, beta_low, beta_high = box
    load = tables.load[direction]
    state = tables.state
    columns = state.shape[1]
    sound = (kappa_low >= -2) & (kappa_low <= kappa_high) & (kappa_high <= 2)
    sound &= beta_low <= beta_high
    kappa_low, kappa_high = (np.where(sound, k, 0.0) for k in (kappa_low, kappa_high))
    beta_low, beta_high = (np.where(sound, b, 0.0) for b in (beta_low, beta_high))
    k0, f0 = row_of(header, kappa_low)
    k1, f1 = row_of(header, kappa_high)
    if header.is_translating:
        sound &= (kappa_low >= -LINE_TOLERANCE) & (kappa_high <= LINE_TOLERANCE)
    if columns == 1:
        m0, g0 = np.zeros_like(k0), np.zeros_like(f0)
        m1, g1 = m0, g0
    else:
        m0, g0 = column_of(columns, beta_low)
        step = 2 * np.pi / columns
        reach = g0 + (beta_high - beta_low) / step * (1 + 1e-12)
        m1 = m0 + np.floor(reach).astype(np.int64)
        g1 = reach - np.floor(reach)
    near = (k1 - k0 <= 1) & (m1 - m0 <= 1)
    left, right = m0 % columns, m1 % columns
    corners = ((k0, left), (k0, right), (k1, left), (k1, right))
    all_free = np.all([state[at] == FREE for at in corners], axis=0)
    all_blocked = np.all([state[at] == BLOCKED for at in corners], axis=0)
    all_free |= _parts_free(tables, k0 + f0, k1 + f1, m0 + g0, m1 + g1)
    # A bilinear function is largest at a corner of a box; an edge between two
    # cells divides the box, so it counts as a corner from either side.
    over_k, over_m = (k1 > k0).astype(float), (m1 > m0).astype(float)
    rows_at = ((k0, f0), (k0, np.where(k1 > k0, over_k, f1)), (k1, f1))
    columns_at = ((left, g0), (left, np.where(m1 > m0, over_m, g1)), (right, g1))
    worst = np.max(
        [
            bilinear(load, row, column, x, y)
            for row, x in rows_at
            for column, y in columns_at
        ],
        axis=0,
    )
    # A box over all β, as at the poles: whole rows of cells.
    ring = (k1 - k0 <= 1) & ~near
    row_free = (state == FREE).all(axis=1)
    all_free = np.where(ring, row_free[k0] & row_free[k1], all_free & near)
    ring_load = load.max(axis=1)
    at_ring = [(1 - f) * ring_load[k] + f * ring_load[k + 1] for k, f in rows_at]
    worst = np.where(ring, np.max(at_ring, axis=0), worst)
    answer = np.full(k0.shape, MIXED, np.uint8)
    answer[all_free & sound] = FREE
    answer[all_blocked & near & sound] = BLOCKED
    return answer, (1 - 1e-14) / np.sqrt(worst)


def _parts_free(
    tables: Tables,
    k_low: FloatArray,
    k_high: FloatArray,
    m_low: FloatArray,
    m_high: FloatArray,
) -> npt.NDArray[np.bool_]:
    """Return whether boxes lie in two by two free parts of cells at most.

    The boxes are given in cells, β not wrapped.
    """
    rows, columns = tables.state.shape
    ends = [np.floor(4 * x).astype(np.int64) for x in (k_low, k_high, m_low, m_high)]
    i0, i1 = (np.minimum(x, 4 * rows - 1) for x in ends[:2])
    j0, j1 = ends[2:] if columns > 1 else (np.minimum(x, 3) for x in ends[2:])
    free = (i1 - i0 <= 1) & (j1 - j0 <= 1)
    for i in (i0, i1):
        for j in (j0, j1):
            parts = tables.parts[i // 4, (j // 4) % columns]
            free = free & ((parts >> (4 * (i % 4) + j % 4)) & 1 == 1)
    return np.asarray(free)
