"""Building a permissible space: sound tables from the rows of `limits`."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from configspace import cache as space_cache
from configspace import kernels
from configspace.errors import InvalidInput, InvalidVehicle, Problem
from configspace.exact import active_rows
from configspace.grid import Grid, edges_of
from configspace.limits import LoadRow, SectorRow, rows_of
from configspace.omni_curve import components
from configspace.rate_cells import build_cell_rates
from configspace.rounding import round_tables
from configspace.sheet import SheetHeader, Tables
from configspace.space import PermissibleSpace
from configspace.unlimited import is_unlimited
from configspace.vehicle import Vehicle

__all__ = ["build_space"]

FloatArray = npt.NDArray[np.float64]
Scalar = TypeVar("Scalar", bound=np.generic)
_KINDS = {"disc": 0, "strip": 1, "offset": 2, "lateral": 3, "edge": 4}


def build_space(
    vehicle: Vehicle,
    grid: Grid | None = None,
    cache: bool | str | Path = True,
) -> PermissibleSpace:
    """Compute the permissible configuration space of a vehicle, or take it from cache.

    Parameters
    ----------
    vehicle : Vehicle
    grid : Grid, optional
        Default 400 × 720 cells.
    cache : bool or path
        True: the folder named by ``OMNIPLAN_CACHE`` or the platform's cache folder;
        False: compute; a path: this folder.

    Returns
    -------
    PermissibleSpace
        Sound over whole cells; knows its vehicle, so mixed cells are settled exactly.

    Raises
    ------
    InvalidVehicle
        If some permitted configuration has no speed limit at all.
    InvalidInput
        If the vehicle is none, but the name of one.

    Examples
    --------
    >>> from configspace import load_vehicle
    >>> space = build_space(load_vehicle("mecanum"), cache=False)
    >>> bool(space.contains(0.0, 0.0, 1.2))
    True
    """
    _require_vehicle(vehicle)
    grid = grid or Grid()
    if cache is False:
        return _compute(vehicle, grid)
    folder = space_cache.default_folder() if cache is True else Path(cache)
    cached = space_cache.read(folder, vehicle, grid)
    if cached is not None:
        return cached
    space = _compute(vehicle, grid)
    space_cache.write(folder, space)
    return space


def _require_vehicle(given: object) -> None:
    if not isinstance(given, Vehicle):
        allowed = "a Vehicle: load_vehicle(name)"
        raise InvalidInput(Problem("vehicle", repr(given)[:60], allowed))


def _compute(vehicle: Vehicle, grid: Grid) -> PermissibleSpace:
    kappa, beta = edges_of(vehicle.mobility, grid)
    loads, sectors = rows_of(vehicle)
    directions = [active_rows(loads, False)]
    if any(row.direction == "reverse" for row in loads):
        directions.append(active_rows(loads, True))
    layers = [_layer(vehicle, rows, sectors, kappa, beta) for rows in directions]
    tables = Tables(
        load=_stacked([layer.load for layer in layers]),
        v_lo=_stacked([layer.v_lo for layer in layers]),
        v_hi=_stacked([layer.v_hi for layer in layers]),
        # Steering does not depend on the driving direction.
        state=layers[0].state,
        parts=layers[0].parts,
        reason=_stacked([layer.reason for layer in layers]),
        wheel=_stacked([layer.wheel for layer in layers]),
    )
    header = SheetHeader.of(vehicle, grid)
    # Change rates vary slowly enough for a grid of a quarter of the cells each way.
    coarse = Grid(max(grid.n_kappa // 16 * 4, 4), max(grid.n_beta // 4, 8))
    rates = build_cell_rates(vehicle, coarse)
    return PermissibleSpace(header=header, tables=tables, rates=rates, vehicle=vehicle)


def _stacked(layers: Sequence[npt.NDArray[Scalar]]) -> npt.NDArray[Scalar]:
    """Return arrays along a new first axis; one alone is not copied."""
    return layers[0][None] if len(layers) == 1 else np.stack(layers)


def _layer(
    vehicle: Vehicle,
    rows: Sequence[LoadRow],
    sectors: Sequence[SectorRow],
    kappa: FloatArray,
    beta: FloatArray,
) -> Tables:
    """Return the tables for one driving direction, without the axis of directions."""
    nodes, cell_pad, low, high, state, parts, reason, wheel = kernels.cell_tables(
        kappa, beta, _load_table(rows), _sector_table(sectors)
    )
    edges = (kappa, beta)
    if is_unlimited(vehicle, rows, sectors, edges, low, state):
        raise _unlimited(vehicle)
    row_pad = _pad(rows, kappa, float(beta[1] - beta[0]))
    load, v_lo, v_hi = round_tables(nodes, row_pad, cell_pad, low, high, state)
    return Tables(
        load=load,
        v_lo=v_lo,
        v_hi=v_hi,
        state=state,
        parts=parts,
        reason=reason,
        wheel=wheel,
    )


def _load_table(rows: Sequence[LoadRow]) -> tuple[npt.NDArray[np.generic], ...]:
    return (
        np.array([_KINDS[row.kind] for row in rows], dtype=np.int64),
        np.array([row.p for row in rows], dtype=np.float64),
        np.array([row.b for row in rows], dtype=np.complex128),
        np.array([cmath.exp(1j * row.nu) for row in rows], dtype=np.complex128),
        np.array([row.d for row in rows], dtype=np.float64),
        np.array([int(row.reason) for row in rows], dtype=np.int64),
        np.array([row.wheel for row in rows], dtype=np.int64),
    )


def _sector_table(rows: Sequence[SectorRow]) -> tuple[npt.NDArray[np.generic], ...]:
    def unit(angle: float) -> complex:
        return cmath.exp(1j * angle) if math.isfinite(angle) else 1 + 0j

    return (
        np.array([row.b for row in rows], dtype=complex),
        np.array([unit(row.middle) for row in rows], dtype=complex),
        np.array([unit(row.middle - row.half) for row in rows], dtype=complex),
        np.array([unit(row.middle + row.half) for row in rows], dtype=complex),
        # The normal of a half-plane clear of the forbidden sector stands at most
        # half - π/2 from the middle; cos(half - π/2) = sin(half).
        np.array(
            [-1.0 if math.isinf(row.half) else math.sin(row.half) for row in rows]
        ),
        np.array([row.half <= math.pi / 2 for row in rows], dtype=bool),
        np.array([row.kappa_share for row in rows], dtype=np.float64),
        np.array([row.beta_share for row in rows], dtype=np.float64),
        np.array([row.kappa_share * row.pole_arm for row in rows], dtype=np.float64),
        np.array([row.wheel for row in rows], dtype=np.int16),
    )


def _pad(rows: Sequence[LoadRow], kappa: FloatArray, width: float) -> FloatArray:
    """Return what a row of nodes needs so that interpolation cannot be too low.

    Linear interpolation over a step h is off by at most ``h²/8 max(-f'')``. In κ_n
    discs and strips are convex; lateral and edge rows are, outside |κ_n| < 1, where
    they curve down by a constant. In β the curvature is bounded in closed form and
    grows towards one edge of each cell. A row of nodes serves the cells on both sides
    of it, hence the largest of three neighbours. Offset rows are padded per cell.
    """
    c, s = components(kappa)
    step = kappa[1] - kappa[0]
    largest = np.zeros_like(c)
    for row in rows:
        along_kappa = 0.0
        h = (row.b * cmath.exp(-1j * row.nu)).real
        if row.kind == "disc":
            over_beta = 2 * c * np.abs(s) * row.p * abs(row.b)
        elif row.kind == "strip":
            over_beta = 2 * (c * row.p + np.abs(s) * abs(h)) * c * row.p
        elif row.kind in {"lateral", "edge"}:
            over_beta = row.p * np.abs(s) * c
            bend = abs(row.b) if row.kind == "lateral" else max(0.0, -h)
            along_kappa = 2 * row.p * bend
        else:
            continue
        bound = (width**2 * over_beta + step**2 * along_kappa) / 8
        largest = np.maximum(largest, bound)
    around = np.pad(largest, 1, mode="edge")
    return np.maximum(np.maximum(around[:-2], around[1:-1]), around[2:])


def _unlimited(vehicle: Vehicle) -> InvalidVehicle:
    return InvalidVehicle(
        Problem(
            "limits",
            "no limit bounds the speed of some configurations",
            "give max_speed for the driven wheels, or limits.max_speed together with "
            "limits.max_yaw_rate_deg",
        ),
        subject=f"vehicle {vehicle.name}",
    )
