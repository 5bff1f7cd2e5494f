"""How a permissible space hangs together: components, reachability, turns of wheels.

Everything is read off the states of the cells, which hold over whole closed cells:

- two `FREE` cells with a common edge are connected for sure;
- a permitted path never meets a `BLOCKED` cell, not even at a corner, so it goes from
  cell to cell through edges of cells that are `FREE` or `MIXED`.

The truth lies between the *certain* components (of `FREE` cells) and the *possible*
ones (of `FREE` and `MIXED` cells). β = ±π is no border, and at κ_n = ±2 every β is the
same configuration, so a motion may go through that pole.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage
from scipy.sparse import coo_array, csgraph

from configspace.angles import wrap
from configspace.errors import InvalidInput, Problem
from configspace.kernels import BLOCKED, FREE, MIXED
from configspace.omni_curve import finite, nominal_curvature
from configspace.sheet import Sheet
from configspace.turns import winding

__all__ = [
    "REACHABLE",
    "UNDECIDED",
    "UNREACHABLE",
    "Summary",
    "components",
    "part_states",
    "reachable",
    "summary",
    "winding",
]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
States = npt.NDArray[np.uint8]

REACHABLE, UNREACHABLE, UNDECIDED = FREE, BLOCKED, MIXED
"""Codes of `reachable`: those of states, so that it can stand for them."""

_ON_EDGE = 1e-12
"""A start so close to an edge, 1 or rad, belongs to the cells on both sides."""


@dataclass(frozen=True)
class Summary:
    """How a space hangs together; shares are of the whole range of (κ_n, β)."""

    n_certain: int
    """Number of certain components."""
    n_possible: int
    """Number of possible components with a `FREE` cell: at least so many there are."""
    shares: tuple[float, ...]
    """Share of each certain component, largest first, 1."""
    reachable: float
    """Share that is permitted and connected with (0, 0) for sure, 1."""
    unreachable: float
    """Share that is permitted for sure, and for sure not connected with (0, 0), 1."""
    undecided: float
    """Share of the cells of which neither is sure, 1."""


def components(
    state: States, *, possible: bool = False, line: bool = False
) -> IntArray:
    """Return the connected component of every cell.

    Parameters
    ----------
    state : (k, m) uint8
        `FREE`, `BLOCKED` or `MIXED`, rows over κ_n from -2 to 2, columns over β
        from -π to π; k = 1 for a vehicle that cannot turn.
    possible : bool
        Count `MIXED` cells as permitted: no component is divided that is one. Without
        it only `FREE` cells: no two components are joined that are apart.
    line : bool
        Join neither β = ±π nor the poles: for the one column of a line-mobile vehicle,
        or for the strip as `configspace.mesh.to_mesh` cuts it open.

    Returns
    -------
    labels : (k, m) int
        0 for cells that do not count; components count from 1, the largest first.

    Examples
    --------
    A blocked belt parts two components; each holds together across β = ±π:

    >>> state = np.array([[0, 0, 0], [1, 1, 1], [0, 1, 0]], dtype=np.uint8)
    >>> components(state)
    array([[1, 1, 1],
           [0, 0, 0],
           [2, 0, 2]])
    >>> int(components(state, line=True).max())
    3
    """
    _require_cells(state)
    open_ = (state != BLOCKED) if possible else (state == FREE)
    found, count = ndimage.label(open_)
    labels: IntArray = np.asarray(found).astype(np.int64)
    if not line:
        pairs = _same_place(state, labels)
        graph = coo_array(
            (np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])),
            shape=(count + 1, count + 1),
        )
        _, joined = csgraph.connected_components(graph, directed=False)
        labels = joined.astype(np.int64)[labels]
    return _by_size(labels, open_)


def part_states(space: Sheet) -> tuple[States, FloatArray, FloatArray]:
    """Return the states of the 4 × 4 parts of all cells, and their edges.

    Parameters
    ----------
    space : Sheet
        Such as a `PermissibleSpace`.

    Returns
    -------
    state : (4 k, 4 m) uint8
        (4 k, 1) for a line-mobile vehicle, (1, 4 m) for one that cannot turn.
    kappa_edges : (4 k + 1,) float, 1
        Two times 0 for a vehicle that cannot turn.
    beta_edges : (4 m + 1,) float, rad
        Two times its β for a line-mobile vehicle.
    """
    grid = space.header.grid
    bits = space.tables.parts[:, None, :, None]
    i, j = np.ogrid[:4, :4]
    free = (bits >> (4 * i + j)[:, None, :]) & 1 == 1
    coarse = np.broadcast_to(space.tables.state[:, None, :, None], free.shape)
    state = np.where(free, np.uint8(FREE), coarse)
    k, m = space.tables.state.shape
    state = state.reshape(4 * k, 4 * m)
    kappa, beta = (
        np.interp(np.arange(0, x.size - 0.75, 0.25), np.arange(x.size), x)
        for x in (grid.kappa_edges, grid.beta_edges)
    )
    if space.header.line_beta is not None:
        state, beta = state[:, :1], np.full(2, space.header.line_beta)
    if space.header.is_translating:
        state, kappa = state[:1], np.zeros(2)
    return state, kappa, beta


def reachable(
    state: States,
    kappa_edges: FloatArray,
    beta_edges: FloatArray,
    start: tuple[float, float] | None = (0.0, 0.0),
) -> States:
    """Return which cells can be reached from a configuration without a standstill.

    Parameters
    ----------
    state : (k, m) uint8
        `FREE`, `BLOCKED` or `MIXED`; m = 1 for a line-mobile vehicle.
    kappa_edges : (k + 1,) float, 1, [-2, 2]
    beta_edges : (m + 1,) float, rad
        Not used for a line-mobile vehicle.
    start : (float, float), 1 and rad, optional
        (κ_n, β) to start from. None: the largest certain component, for a vehicle
        whose steering ranges exclude the zero configuration.

    Returns
    -------
    code : (k, m) uint8
        `REACHABLE`: permitted all over and connected with the start for sure;
        `UNREACHABLE`: nothing in the cell can be reached, blocked cells among them;
        `UNDECIDED`: anything else. If the start is blocked all is `UNREACHABLE`; if
        the table cannot settle the start, nothing is `REACHABLE`.

    Raises
    ------
    InvalidInput
        If the shapes do not fit or the start is not finite or outside [-2, 2].
    """
    _require_cells(state)
    line = state.shape[1] == 1
    certain = components(state, line=line)
    maybe = components(state, possible=True, line=line)
    if start is None:
        at = certain == 1
    else:
        at = _touching(state.shape, kappa_edges, beta_edges, start)
        if (state[at] == BLOCKED).any():
            return np.full(state.shape, UNREACHABLE, dtype=np.uint8)
    code = np.full(state.shape, UNREACHABLE, dtype=np.uint8)
    code[np.isin(maybe, _labels(maybe[at]))] = UNDECIDED
    code[np.isin(certain, _labels(certain[at]))] = REACHABLE
    return code


def summary(space: Sheet, start: tuple[float, float] | None = (0.0, 0.0)) -> Summary:
    """Return how many components a space has and how much can be reached.

    Judged by the parts of cells, see `part_states`.

    Parameters
    ----------
    space : Sheet
        Such as a `PermissibleSpace`.
    start : (float, float), 1 and rad, optional
        As for `reachable`.

    Examples
    --------
    >>> import configspace
    >>> space = configspace.build_space(
    ...     configspace.load_vehicle("mecanum"), cache=False)
    >>> summary(space).n_certain
    1
    """
    state, kappa_edges, beta_edges = part_states(space)
    line = state.shape[1] == 1
    certain = components(state, line=line)
    maybe = components(state, possible=True, line=line)
    code = reachable(state, kappa_edges, beta_edges, start)
    sizes = np.bincount(certain.ravel())[1:] / state.size
    return Summary(
        n_certain=int(certain.max()),
        n_possible=_labels(maybe[state == FREE]).size,
        shares=tuple(sizes.tolist()),
        reachable=float((code == REACHABLE).mean()),
        unreachable=float(((code == UNREACHABLE) & (state == FREE)).mean()),
        undecided=float((code == UNDECIDED).mean()),
    )


def _require_cells(state: States) -> None:
    if state.ndim != 2 or state.size == 0:
        raise InvalidInput(Problem("state", f"shape {state.shape}", "shape (k, m)"))


def _same_place(state: States, labels: IntArray) -> IntArray:
    """Return pairs of labels that share configurations at the seam or at a pole."""
    pairs = [labels[:, [0, -1]]]
    for row in (0, -1) if len(state) > 1 else ():  # one row: no motion but κ_n = 0
        # One configuration: a blocked cell blocks it, a free one permits it.
        if (state[row] == FREE).any() or not (state[row] == BLOCKED).any():
            members = labels[row][labels[row] > 0]
            pairs.append(np.stack([members, np.roll(members, 1)], axis=-1))
    together = np.concatenate(pairs)
    return np.asarray(together[(together > 0).all(axis=1)])


def _by_size(labels: IntArray, open_: npt.NDArray[np.bool_]) -> IntArray:
    """Return labels numbered from 1 by falling size, 0 where not open."""
    _, first, number, sizes = np.unique(
        labels[open_], return_index=True, return_inverse=True, return_counts=True
    )
    rank = np.empty(sizes.size, dtype=np.int64)
    rank[np.lexsort((first, -sizes))] = np.arange(1, sizes.size + 1)
    numbered = np.zeros(labels.shape, dtype=np.int64)
    numbered[open_] = rank[number]
    return numbered


def _labels(values: IntArray) -> IntArray:
    return np.unique(values[values > 0])


def _touching(
    shape: tuple[int, ...],
    kappa_edges: FloatArray,
    beta_edges: FloatArray,
    start: tuple[float, float],
) -> npt.NDArray[np.bool_]:
    """Return the cells whose closed area holds a configuration, (k, m)."""
    kappa_n = float(nominal_curvature(start[0]))
    beta = float(wrap(finite("start[1]", start[1], "rad")))
    line = shape[1] == 1
    if kappa_edges.size != shape[0] + 1 or (
        not line and beta_edges.size != shape[1] + 1
    ):
        raise InvalidInput(
            Problem(
                "kappa_edges, beta_edges",
                f"{kappa_edges.size} and {beta_edges.size} edges",
                f"one edge more than cells, which are {shape}",
            )
        )
    columns = np.full(shape[1], line or abs(kappa_n) == 2)
    if not columns.any():
        for turn in (-2 * np.pi, 0.0, 2 * np.pi):
            columns |= _holds(beta_edges, beta + turn)
    return np.asarray(_holds(kappa_edges, kappa_n)[:, None] & columns)


def _holds(edges: FloatArray, value: float) -> npt.NDArray[np.bool_]:
    return (edges[:-1] - _ON_EDGE <= value) & (value <= edges[1:] + _ON_EDGE)
