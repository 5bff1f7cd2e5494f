"""The limits of a vehicle as rows in (ü, u̇²), for the timing of a path.

Along a path the velocity of a point of the body is ``g(u) u̇``, in the vehicle's frame.
With ``|g|' = Re(g' ḡ)/|g|`` and ``α' = Im(g' ḡ)/|g|²`` every limit on rates is exact
and linear in ``x = u̇²`` and ``ü``:

==========================  =====================================================
a speed                     ``load(u) x ≤ 1``, load = (speed per u̇ / limit)²
a change of a speed r u̇     ``(r ü + r' x) / limit ≤ 1``, and ≥ -1 where two-sided
a steering acceleration     ``α̈ = α' ü + α'' x``
... beside an axis          ``dû/dt = r ü + r' x``, r = |g| - σ (θ' + α') D
an acceleration along n     ``Re(g n̄) ü + Re((g' + j θ' g) n̄) x``
==========================  =====================================================

As the speeds are per u̇ and not per v_s, they have no kink at |κ_n| = 1. The rows are
those that `validate` judges; what is about the configuration alone is no row here.
"""

from __future__ import annotations

import cmath
import enum
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from configspace import Vehicle
from configspace.limits import GRAVITY, center_of_gravity
from configspace.vehicle import Castor, FixedWheel, SteerableWheel, Wheel

__all__ = [
    "FIRST_RATE",
    "ONE_SIDED",
    "RowKind",
    "RowTable",
    "TimingRow",
    "row_table",
    "timing_rows",
]

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
IntArray = npt.NDArray[np.int64]


class RowKind(enum.IntEnum):
    """How a row is computed; those from `SIZE_RATE` on involve ü."""

    SIZE = 0
    """``|g|``"""
    COMPONENT = 1
    """``Re(g n̄)``"""
    YAW = 2
    """``θ'``"""
    LATERAL = 3
    """``|θ'| |g|``, per u̇²"""
    STEER_RATE = 4
    """``α'``"""
    BESIDE = 5
    """``||g| - σ (θ' + α') D| + k |α'|``"""
    REVERSE = 6
    """``|g|``, where the vehicle drives backwards"""
    PATH_SPEED = 7
    """speed of the path's own point, with the path's cap"""
    PATH_YAW = 8
    """``θ'``, with the path's cap"""
    PATH_POINT = 9
    """``|g|``, with the path's cap on speed"""
    SIZE_RATE = 16
    """``|g| ü + |g|' x``, both signs"""
    SIZE_UP = 17
    """the same, growth only"""
    SIZE_DOWN = 18
    """the same, decline only"""
    COMPONENT_RATE = 19
    """``Re(g n̄) ü + Re(g' n̄) x``, both signs"""
    ACCELERATION_ALONG = 20
    """``Re(g n̄) ü + Re((g' + j θ' g) n̄) x``, one sign"""
    STEER_ACCELERATION = 21
    """``α' ü + α'' x``, both signs"""
    SAMPLING = 22
    """``ü``, both signs: how fast u̇ may change for the samples to follow"""
    BESIDE_RATE = 23
    """``r ü + r' x``, both signs, with ``r = |g| - σ (θ' + α') D + k α'``"""


FIRST_RATE = int(RowKind.SIZE_RATE)
"""Rows below this one bound x alone."""
ONE_SIDED = (RowKind.SIZE_UP, RowKind.SIZE_DOWN, RowKind.ACCELERATION_ALONG)
"""Rows that have no bound on the other side."""


@dataclass(frozen=True)
class TimingRow:
    """One limit of one wheel, of the vehicle or of the path."""

    limit: str
    """As in `omniplan.Violation`; also ``STEER_ACCELERATION``, ``PATH_SPEED``,
    ``PATH_YAW_RATE`` and ``SAMPLING``."""
    wheel: int
    """Index of the wheel, -1 for the vehicle."""
    kind: RowKind
    bound: float
    """The limit; of the rows of the path and of sampling 1, as theirs varies."""
    point: complex = 0j
    """Whose velocity g is, in the frame of the vehicle's file, m."""
    turn: complex = 1 + 0j
    """``n̄``, with the factor of a roller; of REVERSE that of the line, or 0."""
    lever: float = 0.0
    """D, m: how far left of its axis a wheel rolls."""
    coupling: float = 0.0
    """k, m: the share of motors that drive and steer; of BESIDE_RATE with a sign."""


@dataclass(frozen=True, eq=False)
class RowTable:
    """The rows as arrays, for the kernels."""

    kind: IntArray
    point: ComplexArray
    turn: ComplexArray
    lever: FloatArray
    coupling: FloatArray
    scale: FloatArray
    """1 / bound."""


def row_table(rows: tuple[TimingRow, ...]) -> RowTable:
    """Return the rows as arrays."""
    return RowTable(
        np.array([row.kind for row in rows], dtype=np.int64),
        np.array([row.point for row in rows], dtype=np.complex128),
        np.array([row.turn for row in rows], dtype=np.complex128),
        np.array([row.lever for row in rows], dtype=np.float64),
        np.array([row.coupling for row in rows], dtype=np.float64),
        np.array([1 / row.bound for row in rows], dtype=np.float64),
    )


def timing_rows(vehicle: Vehicle, *, has_caps: bool = True) -> tuple[TimingRow, ...]:
    """Return all limits of a vehicle that depend on how fast a path is passed.

    Rows that involve ü come last; the last one of all is ``SAMPLING``.

    Parameters
    ----------
    vehicle : Vehicle
    has_caps : bool
        Whether rows for the caps of a path are wanted.

    References
    ----------
    spec/omni-curve §2, §4.
    """
    rows = list(_body(vehicle))
    for i, wheel in enumerate(vehicle.wheels):
        if not isinstance(wheel, Castor):
            rows += _wheel(vehicle.contacts[i], i, wheel)
    if has_caps:
        rows += _path(vehicle)
    rows.append(TimingRow("SAMPLING", -1, RowKind.SAMPLING, 1.0))
    return tuple(sorted(rows, key=lambda row: row.kind >= FIRST_RATE))


def _body(vehicle: Vehicle) -> Iterator[TimingRow]:
    limits, k = vehicle.limits, vehicle.reference
    if limits.max_speed is not None:
        yield TimingRow("SPEED", -1, RowKind.SIZE, limits.max_speed, k)
    if limits.max_reverse_speed is not None:
        line = vehicle.mobility.line_beta
        turn = 0j if line is None else cmath.exp(-1j * line)
        yield TimingRow(
            "REVERSE_SPEED", -1, RowKind.REVERSE, limits.max_reverse_speed, k, turn
        )
    if limits.max_yaw_rate_deg is not None:
        rate = math.radians(limits.max_yaw_rate_deg)
        yield TimingRow("YAW_RATE", -1, RowKind.YAW, rate)
    if limits.max_lateral_acceleration is not None:
        at_load = limits.lateral_acceleration_at == "center_of_gravity"
        point = center_of_gravity(vehicle) if at_load else k
        bound = limits.max_lateral_acceleration
        yield TimingRow("LATERAL_ACCELERATION", -1, RowKind.LATERAL, bound, point)
    if limits.max_acceleration is not None:
        bound = limits.max_acceleration
        yield TimingRow("ACCELERATION", -1, RowKind.SIZE_UP, bound, k)
    if limits.max_deceleration is not None:
        bound = limits.max_deceleration
        yield TimingRow("DECELERATION", -1, RowKind.SIZE_DOWN, bound, k)
    if vehicle.load is not None:
        point = center_of_gravity(vehicle)
        reach = vehicle.load.tipping_factor * vehicle.load.center_of_gravity[2]
        for normal, distance in vehicle.tipping_edges:
            yield TimingRow(
                "TIPPING",
                -1,
                RowKind.ACCELERATION_ALONG,
                distance * GRAVITY / reach,
                point,
                normal.conjugate(),
            )


def _path(vehicle: Vehicle) -> Iterator[TimingRow]:
    """Yield the rows of a path's caps: |v + j ω p| is largest at a corner."""
    yield TimingRow("PATH_SPEED", -1, RowKind.PATH_SPEED, 1.0)
    for x, y in vehicle.footprint:
        yield TimingRow("PATH_SPEED", -1, RowKind.PATH_POINT, 1.0, complex(x, y))
    yield TimingRow("PATH_YAW_RATE", -1, RowKind.PATH_YAW, 1.0)


def _wheel(contact: complex, i: int, wheel: Wheel) -> Iterator[TimingRow]:
    """Yield the rows of a wheel; a castor has none."""
    if isinstance(wheel, SteerableWheel):
        yield from _steered(contact, i, wheel)
        return
    if isinstance(wheel, Castor):
        return
    roller = 0.0 if isinstance(wheel, FixedWheel) else wheel.roller
    turn = cmath.exp(-1j * (wheel.heading + roller)) / math.cos(roller)
    if wheel.max_speed is not None:
        kind, bound = RowKind.COMPONENT, wheel.max_speed
        yield TimingRow("WHEEL_SPEED", i, kind, bound, contact, turn)
    if wheel.max_acceleration is not None:
        kind, bound = RowKind.COMPONENT_RATE, wheel.max_acceleration
        yield TimingRow("WHEEL_ACCELERATION", i, kind, bound, contact, turn)


def _steered(contact: complex, i: int, wheel: SteerableWheel) -> Iterator[TimingRow]:
    if wheel.max_steering_rate_deg is not None:
        rate = math.radians(wheel.max_steering_rate_deg)
        yield TimingRow("STEER_RATE", i, RowKind.STEER_RATE, rate, contact)
    if wheel.max_speed is not None:
        bound, coupling = wheel.max_speed, wheel.steering_coupling
        for offset in wheel.offsets:
            kind = RowKind.BESIDE if offset or coupling else RowKind.SIZE
            yield TimingRow(
                "WHEEL_SPEED",
                i,
                kind,
                bound,
                contact,
                lever=offset,
                coupling=coupling,
            )
    if wheel.max_acceleration is not None:
        yield from _speeding_up(contact, i, wheel, wheel.max_acceleration)
    if wheel.max_steering_acceleration_deg is not None:
        bound = math.radians(wheel.max_steering_acceleration_deg)
        kind = RowKind.STEER_ACCELERATION
        yield TimingRow("STEER_ACCELERATION", i, kind, bound, contact)


def _speeding_up(
    contact: complex, i: int, wheel: SteerableWheel, bound: float
) -> Iterator[TimingRow]:
    """Yield the rows of ``|dû/dt| + k |α̈|`` of every wheel on an axis."""
    limit, coupling = "WHEEL_ACCELERATION", wheel.steering_coupling
    for offset in wheel.offsets:
        if not (offset or coupling):
            yield TimingRow(limit, i, RowKind.SIZE_RATE, bound, contact)
            continue
        for share in (coupling, -coupling) if coupling else (0.0,):
            yield TimingRow(
                limit,
                i,
                RowKind.BESIDE_RATE,
                bound,
                contact,
                lever=offset,
                coupling=share,
            )
