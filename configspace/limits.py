"""The limits of a vehicle, one function each.

A limit is turned into rows that the kernels understand; no kernel knows a vehicle.
With ``z = c e^{jβ} + s b`` per v_s:

`LoadRow`
    bounds the speed: ``load(κ_n, β) v_s² ≤ 1`` with a squared load that is

    - ``disc``: ``|c e^{jβ} p + s b|²`` (speed of a steered wheel or of a body point),
    - ``strip``: ``Re((c e^{jβ} p + s b) e^{-jν})²`` (rolling of Mecanum, omni and
      fixed wheels),
    - ``offset``: ``(|c e^{jβ} p + s b| - s d)²`` (rolling beside the steering axis),
    - ``lateral``: ``p |s| |z|`` (centripetal acceleration of a body point),
    - ``edge``: ``p s Re(z e^{-jν})``, at least 0 (tipping over an edge).
`SectorRow`
    blocks: ``arg z`` must lie in a sector and must exist, and must not turn too fast
    where change rates are guaranteed.

To add a limit write one function from a vehicle to rows and add it to `LIMITS`.
"""

from __future__ import annotations

import cmath
import enum
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal, TypeAlias

from configspace.vehicle import (
    FixedWheel,
    MecanumWheel,
    OmniWheel,
    SteerableWheel,
    Vehicle,
)

__all__ = ["LIMITS", "LoadRow", "Reason", "Row", "SectorRow", "rows_of"]

GRAVITY = 9.81
"""Acceleration of gravity, m/s²."""


class Reason(enum.IntFlag):
    """Which limit blocks or binds a configuration."""

    NONE = 0
    STEER_RANGE = 1
    """A steering angle is out of its range."""
    SINGULAR = 2
    """The centre of rotation is on a steered wheel, or so near that the guaranteed
    change rates are not available."""
    WHEEL_SPEED = 4
    """A wheel rolls at its largest speed."""
    SPEED = 8
    """K moves at the vehicle's largest speed."""
    YAW_RATE = 16
    """The vehicle turns at its largest rate."""
    LATERAL_ACCELERATION = 32
    """The named point is accelerated sideways as much as permitted."""
    FIXED_WHEEL = 64
    """A fixed wheel would have to slip sideways."""
    TIPPING = 128
    """The zero-moment point is at an edge of the support polygon."""
    PARALLEL_WHEELS = 256
    """Wheels that always point alike would have to point in different directions."""
    UNREACHABLE = 512
    """Permitted, but no way inside the space leads there from straight ahead."""


Direction: TypeAlias = Literal["both", "reverse"]
Kind: TypeAlias = Literal["disc", "strip", "offset", "lateral", "edge"]


@dataclass(frozen=True)
class LoadRow:
    """A bound on the speed: ``load v_s² ≤ 1``. See the module for the kinds."""

    reason: Reason
    kind: Kind
    p: float
    """Factor of the translation, 1/(m/s); of lateral and edge: of the whole."""
    b: complex = 0j
    """Factor of the rotation, 1/(m/s); of lateral and edge: 1."""
    nu: float = 0.0
    """Direction of a strip or an edge, rad."""
    d: float = 0.0
    """Share of the rotation that an offset takes off, 1/(m/s)."""
    wheel: int = -1
    """Index of the wheel, -1 for the vehicle."""
    direction: Direction = "both"
    """``reverse`` rows hold only where v_n < 0."""


@dataclass(frozen=True)
class SectorRow:
    """A steering angle: ``arg(c e^{jβ} + s b)`` within ``middle ± half``."""

    b: complex
    """``j κ_g w_i``."""
    middle: float
    """Middle of the range, rad."""
    half: float
    """Half the range, rad, at most π; infinite where the wheel turns freely."""
    wheel: int
    kappa_share: float = 0.0
    """Guaranteed dκ_n/dt per largest steering rate, 1/rad."""
    beta_share: float = 0.0
    """Guaranteed dβ/dt per largest steering rate, 1."""
    line: float | None = None
    """The constant β of a line-mobile vehicle, rad."""

    @property
    def pole_arm(self) -> float:
        """Largest ``|∂α/∂κ_n| |z|²`` at κ_n = ±2, 1.

        All β are one configuration there and the motion may leave it with any of them,
        so what is asked is the worst over β: ``|b|`` for ``|Im(e^{jβ} b̄)|``. A
        line-mobile vehicle leaves along its line.
        """
        if self.line is None:
            return abs(self.b)
        return abs((cmath.exp(1j * self.line) * self.b.conjugate()).imag)


Row: TypeAlias = LoadRow | SectorRow


def wheel_speed(vehicle: Vehicle) -> Iterator[Row]:
    """``|u_i| ≤ u_lim,i`` for every driven wheel (section 4.3)."""
    for i, wheel in enumerate(vehicle.wheels):
        limit = getattr(wheel, "max_speed", None)
        if limit is None:
            continue
        b = lever(vehicle, i) / limit
        match wheel:
            case SteerableWheel():
                for offset in wheel.offsets:
                    d = vehicle.boundary_curvature * offset / limit
                    kind: Kind = "offset" if offset else "disc"
                    yield LoadRow(Reason.WHEEL_SPEED, kind, 1 / limit, b, d=d, wheel=i)
            case FixedWheel():
                yield LoadRow(
                    Reason.WHEEL_SPEED, "strip", 1 / limit, b, wheel.heading, wheel=i
                )
            case MecanumWheel() | OmniWheel():
                scale = 1 / math.cos(wheel.roller)
                yield LoadRow(
                    Reason.WHEEL_SPEED,
                    "strip",
                    scale / limit,
                    scale * b,
                    wheel.heading + wheel.roller,
                    wheel=i,
                )


def vehicle_speed(vehicle: Vehicle) -> Iterator[Row]:
    """``|v| ≤ max_speed``, backwards also ``max_reverse_speed``."""
    forward, reverse = vehicle.limits.max_speed, vehicle.limits.max_reverse_speed
    if forward is not None:
        yield LoadRow(Reason.SPEED, "disc", 1 / forward)
    if reverse is not None and (forward is None or reverse < forward):
        yield LoadRow(Reason.SPEED, "disc", 1 / reverse, direction="reverse")


def yaw_rate(vehicle: Vehicle) -> Iterator[Row]:
    """``|ω| ≤ max_yaw_rate``."""
    if vehicle.limits.max_yaw_rate_deg is not None:
        limit = math.radians(vehicle.limits.max_yaw_rate_deg)
        yield LoadRow(
            Reason.YAW_RATE, "disc", 0.0, complex(vehicle.boundary_curvature / limit)
        )


def lateral_acceleration(vehicle: Vehicle) -> Iterator[Row]:
    """``|ω v_P| ≤ max_lateral_acceleration`` at K or the centre of gravity."""
    limit = vehicle.limits.max_lateral_acceleration
    if limit is None:
        return
    b = 0j
    if vehicle.limits.lateral_acceleration_at == "center_of_gravity":
        b = body_lever(vehicle, center_of_gravity(vehicle))
    yield LoadRow(
        Reason.LATERAL_ACCELERATION, "lateral", vehicle.boundary_curvature / limit, b
    )


def tipping(vehicle: Vehicle) -> Iterator[Row]:
    """Keep the zero-moment point inside the support polygon of all contacts.

    The centre of gravity P at height h is accelerated by ``a = j ω v_P`` at constant
    v_s, which moves the zero-moment point by ``-f h / g a`` (f the safety factor). At
    an edge with inward normal n and distance e from P: ``a · n ≤ e g / (f h)``.
    """
    load = vehicle.load
    if load is None:
        return
    p = center_of_gravity(vehicle)
    b = body_lever(vehicle, p)
    height = load.center_of_gravity[2]
    for normal, distance in vehicle.tipping_edges:
        largest = distance * GRAVITY / (load.tipping_factor * height)
        # a · n = v_s² s κ_g Re(j z n̄) and j n̄ = conj(-j n).
        direction = cmath.phase(-1j * normal)
        gain = vehicle.boundary_curvature / largest
        yield LoadRow(Reason.TIPPING, "edge", gain, b, direction)


def steering(vehicle: Vehicle) -> Iterator[Row]:
    """``α_i ∈ [α⁻_i, α⁺_i]``, ``z_i ≠ 0`` and the guaranteed rates (sections 4.1, 4.2).

    A finite range of more than a full turn is used as the full turn in its middle:
    then the direction alone decides. The singular zone is where some wheel would have
    to steer faster than it can to follow the guaranteed rates of κ_n and β. The rates
    are guaranteed from standstill (v_s → 0): what a wheel beside its axis or with
    shared motors can steer then is `SteerableWheel.standing_steering_rate`, as in
    `configspace.rates.rate_limits` for v_n = 0. While it rolls it can steer less; the
    guarantee does not say by how much the vehicle must slow down for its rates.
    """
    for i, wheel in enumerate(vehicle.wheels):
        if not isinstance(wheel, SteerableWheel):
            continue
        least, largest = wheel.steering_range
        middle, half = 0.0, math.inf
        if math.isfinite(largest):
            middle, half = (largest + least) / 2, min((largest - least) / 2, math.pi)
        kappa_share = beta_share = 0.0
        if vehicle.guaranteed:
            rate = wheel.standing_steering_rate
            kappa_share = vehicle.guaranteed.kappa_rate / rate
            beta_share = math.radians(vehicle.guaranteed.beta_rate_deg) / rate
        yield SectorRow(
            lever(vehicle, i),
            middle,
            half,
            i,
            kappa_share,
            beta_share,
            vehicle.mobility.line_beta,
        )


LIMITS: tuple[Callable[[Vehicle], Iterator[Row]], ...] = (
    steering,
    wheel_speed,
    vehicle_speed,
    yaw_rate,
    lateral_acceleration,
    tipping,
)
"""Every limit the space honours."""


def lever(vehicle: Vehicle, wheel: int) -> complex:
    """Return ``j κ_g w_i``, the wheel's velocity per v_s at κ_n = 2."""
    return body_lever(vehicle, vehicle.contacts[wheel])


def body_lever(vehicle: Vehicle, point: complex) -> complex:
    """Return the velocity per v_s at κ_n = 2 of a point of the file's frame."""
    return 1j * vehicle.boundary_curvature * (point - vehicle.reference)


def center_of_gravity(vehicle: Vehicle) -> complex:
    """Return the centre of gravity in the file's frame; K where no load is given."""
    if vehicle.load is None:
        return vehicle.reference
    x, y, _ = vehicle.load.center_of_gravity
    return complex(x, y)


def rows_of(vehicle: Vehicle) -> tuple[tuple[LoadRow, ...], tuple[SectorRow, ...]]:
    """Return all rows of `LIMITS` for a vehicle."""
    rows = [row for limit in LIMITS for row in limit(vehicle)]
    loads = tuple(row for row in rows if isinstance(row, LoadRow))
    sectors = tuple(row for row in rows if isinstance(row, SectorRow))
    return loads, sectors
