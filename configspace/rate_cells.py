"""Lower bounds of the axis values of `configspace.rates`, cell by cell.

On a cell that straddles no kink the four gradients of spec/omni-curve §4 are ratios of
terms whose extremes are known in closed form: g is a cosine in β, ``c (c + s f)`` a
parabola in c and affine in f, Q the disc of `configspace.kernels`. The largest
numerator over the least denominator is therefore a bound all over the cell; so is
``|dz|/|z|``, which is the sharper one next to a wheel's singular point.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from configspace.gradients import rolling_directions
from configspace.grid import Grid, edges_of
from configspace.kinematics import wheel_directions
from configspace.omni_curve import components, finite, nominal_curvature, together
from configspace.rate_kernels import fill_bounds
from configspace.vehicle import Castor, SteerableWheel, Vehicle

__all__ = ["CellRates", "build_cell_rates", "cell_rate_limits"]

FloatArray = npt.NDArray[np.float64]
Table = npt.NDArray[np.float32]
IntArray = npt.NDArray[np.int64]

SHARES = np.array([0.0, 0.5, 0.75, 0.9])
"""Shares of the load at which headroom is stored."""
SHARES.flags.writeable = False
_GUARD = 1e-12


@dataclass(frozen=True, eq=False)
class CellRates:
    """What every configuration of a cell offers at least; read-only tables over (k, m).

    Infinite where nothing bounds. The cells are those of `configspace.grid.edges_of`:
    one column for a line-mobile vehicle, one row for one that cannot turn.
    """

    kappa_steer: Table
    """Bound of |κ̇_n| by steering rates, 1/s; 0 where the cell holds a singular point
    of a steered wheel, and for a synchro drive."""
    beta_steer: Table
    """Bound of |β̇| by steering rates, rad/s; 0 likewise, and if line-mobile."""
    kappa_accel: Table
    """Bound of |v_s κ̇_n| by accelerations of wheels and vehicle, m/s²."""
    beta_accel: Table
    """Bound of |v_s β̇| by accelerations of wheels, m/s²."""
    v_s_dot: Table
    """Bound of |v̇_s| by accelerations of wheels and vehicle, m/s²."""
    headroom_load: Table
    """Largest share of their max_speed that wheels which roll as they steer take per
    v_s, 1/(m/s)."""
    kappa_headroom: Table
    """(h, k, m) bound of |κ̇_n| by the speed of those wheels where ``|v_s| load`` is one
    of `SHARES`, 1/s; 0 at 1. It is concave in v_s: chords are never too large."""
    beta_headroom: Table
    """(h, k, m) bound of |β̇|, likewise, rad/s."""

    def __post_init__(self) -> None:
        for array in vars(self).values():
            array.flags.writeable = False

    def locate(
        self, kappa_n: npt.ArrayLike, beta: npt.ArrayLike
    ) -> tuple[IntArray, IntArray]:
        """Return row and column of the cells that hold configurations.

        Parameters
        ----------
        kappa_n : (...,) float, 1, [-2, 2]
        beta : (...,) float, rad
            Of no effect for a line-mobile vehicle, as κ_n for one that cannot turn.
        """
        kappa_n, beta = together(
            kappa_n=nominal_curvature(kappa_n), beta=finite("beta", beta, "rad")
        )
        rows, columns = self.v_s_dot.shape
        row = ((kappa_n + 2) * (rows / 4)).astype(np.int64)
        turns = np.mod(beta + np.pi, 2 * np.pi) / (2 * np.pi)
        column = (turns * columns).astype(np.int64)
        return np.minimum(row, rows - 1), np.minimum(column, columns - 1)


def build_cell_rates(vehicle: Vehicle, grid: Grid | None = None) -> CellRates:
    """Compute the bounds for a vehicle.

    Parameters
    ----------
    vehicle : Vehicle
    grid : Grid, optional
        Default 100 × 180 cells: change rates need no finer one.

    References
    ----------
    spec/omni-curve §3 "Sound cells", §4.

    Examples
    --------
    >>> from configspace import load_vehicle
    >>> build_cell_rates(load_vehicle("mecanum")).v_s_dot.shape
    (100, 180)
    """
    grid = grid or Grid(100, 180)
    kappa, beta = edges_of(vehicle.mobility, grid)
    c, s = components(kappa)
    down, up = vehicle.limits.max_deceleration, vehicle.limits.max_acceleration
    bounds = np.empty((6 + 2 * SHARES.size, c.size - 1, beta.size - 1))
    fill_bounds(
        c,
        s,
        np.exp(1j * beta),
        min(up or np.inf, down or np.inf),
        vehicle.boundary_curvature,
        SHARES,
        _wheel_table(vehicle),
        bounds,
    )
    if vehicle.mobility.line_beta is not None:
        bounds[1] = 0.0
    if vehicle.mobility.is_translating:
        bounds[0] = 0.0
    kappa_headroom, beta_headroom = np.split(bounds[6:], 2)
    return CellRates(
        kappa_steer=_rounded_down(bounds[0]),
        beta_steer=_rounded_down(bounds[1]),
        kappa_accel=_rounded_down(bounds[2]),
        beta_accel=_rounded_down(bounds[3]),
        v_s_dot=_rounded_down(bounds[4]),
        headroom_load=-_rounded_down(-bounds[5]),  # the one not to be too small
        kappa_headroom=_rounded_down(kappa_headroom),
        beta_headroom=_rounded_down(beta_headroom),
    )


def cell_rate_limits(
    cells: CellRates,
    row: npt.ArrayLike,
    column: npt.ArrayLike,
    v_n: npt.ArrayLike,
    v_max: npt.ArrayLike,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return axis values that every configuration of a cell offers at least.

    Parameters
    ----------
    cells : CellRates
    row, column : (...,) int
        As `CellRates.locate` returns them.
    v_n : (...,) float, 1, [-1, 1]
    v_max : (...,) float, m/s, ≥ 0

    Returns
    -------
    kappa_n_dot : (...,) float, 1/s
    beta_dot : (...,) float, rad/s
    v_n_dot : (...,) float, 1/s
        0 where v_max is 0. None is larger than that of `rate_limits` at any
        configuration of the cell.
    """
    v_max = np.asarray(v_max, dtype=np.float64)
    v_s = np.abs(np.asarray(v_n, dtype=np.float64)) * v_max
    at = (np.asarray(row), np.asarray(column))
    share = v_s * cells.headroom_load[at].astype(np.float64)

    def least(steer: Table, accel: Table, headroom: Table) -> FloatArray:
        rolling = np.where(v_s > 0, accel[at] / v_s, np.inf)
        beside = _on_chords(headroom[:, *at], share)
        return np.asarray(np.minimum(np.minimum(rolling, beside), steer[at]))

    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        v_n_dot = cells.v_s_dot[at] / v_max
        return (
            least(cells.kappa_steer, cells.kappa_accel, cells.kappa_headroom),
            least(cells.beta_steer, cells.beta_accel, cells.beta_headroom),
            np.where(v_max > 0, v_n_dot, 0.0),
        )


def _on_chords(knots: Table, share: FloatArray) -> FloatArray:
    """Return what is known at `SHARES` and 0 at 1, linear in between, 0 beyond."""
    edges = np.append(SHARES, 1.0)
    piece = np.clip(np.searchsorted(edges, share, "right") - 1, 0, SHARES.size - 1)
    values = np.concatenate([knots, np.zeros_like(knots[:1])]).astype(np.float64)
    left = np.take_along_axis(values, piece[None], 0)[0]
    right = np.take_along_axis(values, piece[None] + 1, 0)[0]
    part = (share - edges[piece]) / (edges[piece + 1] - edges[piece])
    with np.errstate(invalid="ignore"):
        chord = np.where(np.isinf(left), left, left + part * (right - left))
    return np.where(share < 1, np.maximum(chord, 0.0), 0.0)


def _wheel_table(vehicle: Vehicle) -> tuple[npt.NDArray[Any], ...]:
    """Return lever, rolling direction, limits and offsets of all but castors."""
    rolling = [i for i, w in enumerate(vehicle.wheels) if not isinstance(w, Castor)]
    levers = wheel_directions(vehicle, 2.0, 0.0)
    numbers = np.empty((6, len(rolling)))
    for column, i in enumerate(rolling):
        wheel: Any = vehicle.wheels[i]
        steers = isinstance(wheel, SteerableWheel)
        offsets = wheel.offsets if steers else (0.0,)
        per_rate = max(map(abs, offsets)) + (wheel.steering_coupling if steers else 0)
        rate = math.radians(getattr(wheel, "max_steering_rate_deg", None) or np.inf)
        numbers[:, column] = (
            rate,
            wheel.max_acceleration or np.inf,
            wheel.max_speed or np.inf,
            per_rate,
            min(offsets),
            max(offsets),
        )
    return levers[rolling], rolling_directions(vehicle)[rolling], *numbers


def _rounded_down(values: FloatArray) -> Table:
    """Return `values` as float32, never larger; infinite ones as they are."""
    lowered = values - _GUARD * np.abs(np.where(np.isinf(values), 0.0, values))
    largest = np.finfo(np.float32).max
    single = np.where(np.isinf(values), values, np.minimum(lowered, largest))
    table = single.astype(np.float32)
    above = table.astype(np.float64) > single
    return np.where(above, np.nextafter(table, np.float32(-np.inf)), table)
