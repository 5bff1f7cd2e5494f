"""The exact formula at single points; the reference the cells are held against."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from configspace.angles import wrap
from configspace.limits import LoadRow, Reason, SectorRow, rows_of
from configspace.omni_curve import (
    POLE,
    components,
    finite,
    nominal_curvature,
    together,
)
from configspace.vehicle import Vehicle

__all__ = ["exact_reason", "exact_v_max"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

LINE_TOLERANCE = 1e-9
"""How far β may be from a line-mobile vehicle's constant, rad: rounding only."""


def exact_v_max(
    vehicle: Vehicle,
    kappa_n: npt.ArrayLike,
    beta: npt.ArrayLike,
    *,
    reverse: bool = False,
) -> FloatArray:
    """Return the fastest permitted v_s by the exact formula.

    Parameters
    ----------
    vehicle : Vehicle
    kappa_n : (...,) float, 1, [-2, 2]
    beta : (...,) float, rad
    reverse : bool
        The bound on |v_s| for v_n < 0 rather than v_n > 0.

    Returns
    -------
    v_max : (...,) float, m/s, ≥ 0
        0 where blocked.

    Raises
    ------
    InvalidInput
        If a value is not finite or `kappa_n` is outside [-2, 2].

    References
    ----------
    Brenner and Colomb 2022, section 4.3.

    Examples
    --------
    >>> from configspace import load_vehicle
    >>> float(exact_v_max(load_vehicle("ift-four-steered"), 2.0, 0.0))
    1.0
    """
    c, s, e = _terms(kappa_n, beta)
    loads, sectors = rows_of(vehicle)
    load = largest_load(active_rows(loads, reverse), c, s, e)
    blocked, _, _ = _blocked(vehicle, sectors, c, s, e)
    with np.errstate(divide="ignore"):
        return np.where(blocked, 0.0, 1.0 / np.sqrt(load))


def exact_reason(
    vehicle: Vehicle,
    kappa_n: npt.ArrayLike,
    beta: npt.ArrayLike,
    *,
    reverse: bool = False,
) -> tuple[npt.NDArray[np.uint16], npt.NDArray[np.int16]]:
    """Return what blocks or binds a configuration, and which wheel.

    Parameters
    ----------
    vehicle : Vehicle
    kappa_n : (...,) float, 1, [-2, 2]
    beta : (...,) float, rad
    reverse : bool

    Returns
    -------
    reason : (...,) uint16
        Flags of `Reason`: all that block, or else all that bind.
    wheel : (...,) int16
        The first wheel that does, -1 for the vehicle.
    """
    c, s, e = _terms(kappa_n, beta)
    loads, sectors = rows_of(vehicle)
    blocked, why, who = _blocked(vehicle, sectors, c, s, e)
    values = [(row, load_of(row, c, s, e)) for row in active_rows(loads, reverse)]
    worst = np.maximum.reduce([np.zeros(c.shape), *(value for _, value in values)])
    bind_why = np.zeros(c.shape, np.uint16)
    bind_who = np.full(c.shape, -1, np.int16)
    for row, value in reversed(values):
        hit = (value >= worst * (1 - 1e-12)) & (worst > 0)
        bind_why = np.where(hit, bind_why | np.uint16(row.reason), bind_why)
        bind_who = np.where(hit, np.int16(row.wheel), bind_who)
    return np.where(blocked, why, bind_why), np.where(blocked, who, bind_who)


def _terms(
    kappa_n: npt.ArrayLike, beta: npt.ArrayLike
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.complex128]]:
    kappa_n, beta = together(
        kappa_n=nominal_curvature(kappa_n), beta=finite("beta", beta, "rad")
    )
    c, s = components(kappa_n)
    return c, s, np.exp(1j * beta)


def active_rows(loads: Sequence[LoadRow], reverse: bool) -> tuple[LoadRow, ...]:
    """Return the rows that hold for one driving direction."""
    return tuple(row for row in loads if reverse or row.direction == "both")


def load_of(
    row: LoadRow, c: FloatArray, s: FloatArray, e: npt.NDArray[np.complex128]
) -> FloatArray:
    """Return the squared load of one row; ``load v_s² ≤ 1`` is permitted."""
    if row.kind == "lateral":
        return np.asarray(row.p * np.abs(s) * np.abs(c * e + s * row.b))
    if row.kind == "edge":
        along = ((c * e + s * row.b) * np.exp(-1j * row.nu)).real
        return np.asarray(np.maximum(row.p * s * along, 0.0))
    z = row.p * c * e + s * row.b
    if row.kind == "disc":
        return np.asarray(z.real**2 + z.imag**2)
    if row.kind == "offset":
        return np.asarray((np.abs(z) - s * row.d) ** 2)
    return np.asarray((z * np.exp(-1j * row.nu)).real ** 2)


def largest_load(
    rows: Sequence[LoadRow],
    c: FloatArray,
    s: FloatArray,
    e: npt.NDArray[np.complex128],
) -> FloatArray:
    """Return the largest squared load of all rows."""
    worst = np.zeros(np.broadcast_shapes(c.shape, e.shape))
    for row in rows:
        worst = np.maximum(worst, load_of(row, c, s, e))
    return worst


def is_blocked(
    vehicle: Vehicle,
    sectors: Sequence[SectorRow],
    c: FloatArray,
    s: FloatArray,
    e: npt.NDArray[np.complex128],
) -> BoolArray:
    """Return whether configurations are blocked at any speed."""
    return _blocked(vehicle, sectors, c, s, e)[0]


def _blocked(
    vehicle: Vehicle,
    sectors: Sequence[SectorRow],
    c: FloatArray,
    s: FloatArray,
    e: npt.NDArray[np.complex128],
) -> tuple[BoolArray, npt.NDArray[np.uint16], npt.NDArray[np.int16]]:
    """Return whether, why and by which wheel configurations are blocked."""
    why = np.zeros(c.shape, np.uint16)
    who = np.full(c.shape, -1, np.int16)
    line = vehicle.mobility.line_beta
    if line is not None:
        # A pole is one configuration, whatever β.
        off = (np.abs(wrap(np.angle(e) - line)) > LINE_TOLERANCE) & (c > 0)
        why = np.where(off, np.uint16(Reason.FIXED_WHEEL), why)
    if vehicle.mobility.is_translating:
        turns = np.abs(s) > LINE_TOLERANCE
        why = np.where(turns, np.uint16(Reason.PARALLEL_WHEELS), why)
    for row in reversed(sectors):
        z = c * e + s * row.b
        singular = (np.abs(z) < 1e-12) | (turning_excess(row, c, s, e) > 0)
        why = np.where(singular, why | np.uint16(Reason.SINGULAR), why)
        out = (np.abs(z) >= 1e-12) & (steering_excess(row, z) > 0)
        why = np.where(out, why | np.uint16(Reason.STEER_RANGE), why)
        who = np.where(singular | out, np.int16(row.wheel), who)
    return why != 0, why, who


def turning_excess(
    row: SectorRow, c: FloatArray, s: FloatArray, e: npt.NDArray[np.complex128]
) -> FloatArray:
    """Return by how much the guaranteed rates exceed the steering rate; ≤ 0 within.

    ``|∂α/∂κ_n| κ̇ + |∂α/∂β| β̇ ≤ α̇_max`` with ``∂α/∂κ_n = g / |z|²`` and
    ``∂α/∂β = c (c + s f) / |z|²``, multiplied by |z|² (spec/omni-curve §4). At a pole
    all β are one configuration: the worst of them counts, see `SectorRow.pole_arm`.
    """
    z = c * e + s * row.b
    across, along = np.abs((e * row.b.conjugate()).imag), (e * row.b.conjugate()).real
    across = np.where(c > POLE, across, row.pole_arm)
    asked = row.kappa_share * across + row.beta_share * np.abs(c * (c + s * along))
    # Within rounding is within the rate, but next to z = 0 the rounding is of |z|² too.
    return np.asarray(asked - (z.real**2 + z.imag**2) * (1 + 1e-14))


def steering_excess(row: SectorRow, z: npt.NDArray[np.complex128]) -> FloatArray:
    """Return by how much the angle of `z` leaves the range, rad; ≤ 0 within."""
    if math.isinf(row.half):
        return np.full(z.shape, -np.inf)
    # Within rounding of the stop is within the range.
    turned = wrap(np.angle(z) - row.middle)
    return np.asarray(np.abs(turned) - row.half - 1e-14)
