"""The limits of a vehicle, one function each.

A limit is turned into rows that the kernels understand; no kernel knows a vehicle.

`LoadRow`
    bounds the speed: ``load(κ_n, β) v_s² ≤ 1`` with a squared load that is

    - ``disc``: ``|c e^{jβ} p + s b|²`` (speed of a steered wheel or of a body point),
    - ``strip``: ``Re((c e^{jβ} p + s b) e^{-jν})²`` (rolling of Mecanum, omni and
      fixed wheels),
    - ``product``: ``c |s| p²`` (centripetal acceleration).

    Squared, every one is convex in κ_n between the kinks 0 and ±1, and smooth in β.
`SectorRow`
    blocks: ``arg(c e^{jβ} + s b)`` must lie in a sector and must exist.

To add a limit write one function from a vehicle to rows and add it to `LIMITS`.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal, TypeAlias

from configspace.vehicle import (
    FixedWheel,
    MecanumWheel,
    OmniWheel,
    SteeredWheel,
    Vehicle,
)

__all__ = ["LIMITS", "LoadRow", "Reason", "Row", "SectorRow", "rows_of"]


class Reason(enum.IntFlag):
    """Which limit blocks or binds a configuration."""

    NONE = 0
    STEER_RANGE = 1
    """A steering angle is out of its range."""
    SINGULAR = 2
    """The centre of rotation is on a steered wheel."""
    WHEEL_SPEED = 4
    """A wheel rolls at its largest speed."""
    SPEED = 8
    """K moves at the vehicle's largest speed."""
    YAW_RATE = 16
    """The vehicle turns at its largest rate."""
    LATERAL_ACCELERATION = 32
    """K is accelerated sideways as much as permitted."""
    FIXED_WHEEL = 64
    """A fixed wheel would have to slip sideways."""


Direction: TypeAlias = Literal["both", "reverse"]
Kind: TypeAlias = Literal["disc", "strip", "product"]


@dataclass(frozen=True)
class LoadRow:
    """A bound on the speed: ``load v_s² ≤ 1``. See the module for the three kinds."""

    reason: Reason
    kind: Kind
    p: float
    """Factor of the translation, 1/(m/s)."""
    b: complex = 0j
    """Factor of the rotation, 1/(m/s)."""
    nu: float = 0.0
    """Direction of a strip, rad."""
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


Row: TypeAlias = LoadRow | SectorRow


def wheel_speed(vehicle: Vehicle) -> Iterator[Row]:
    """``|u_i| ≤ u_lim,i`` for every driven wheel (section 4.3)."""
    for i, wheel in enumerate(vehicle.wheels):
        limit = getattr(wheel, "max_speed", None)
        if limit is None:
            continue
        b = lever(vehicle, i) / limit
        match wheel:
            case SteeredWheel():
                yield LoadRow(Reason.WHEEL_SPEED, "disc", 1 / limit, b, wheel=i)
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
    """``|v ω| ≤ max_lateral_acceleration`` at K: ``v_s² c |s| κ_g ≤ a``."""
    limit = vehicle.limits.max_lateral_acceleration
    if limit is not None:
        p = math.sqrt(vehicle.boundary_curvature / limit)
        yield LoadRow(Reason.LATERAL_ACCELERATION, "product", p)


def steering_range(vehicle: Vehicle) -> Iterator[Row]:
    """``α_i ∈ [α⁻_i, α⁺_i]`` and ``z_i ≠ 0`` for every steered wheel (section 4.1).

    A finite range of more than a full turn is used as the full turn in its middle:
    then the direction alone decides, and following the angle is never needed.
    """
    for i, wheel in enumerate(vehicle.wheels):
        if not isinstance(wheel, SteeredWheel):
            continue
        least, largest = wheel.steering_range
        if math.isinf(largest):
            yield SectorRow(lever(vehicle, i), 0.0, math.inf, i)
        else:
            half = min((largest - least) / 2, math.pi)
            yield SectorRow(lever(vehicle, i), (largest + least) / 2, half, i)


LIMITS: tuple[Callable[[Vehicle], Iterator[Row]], ...] = (
    steering_range,
    wheel_speed,
    vehicle_speed,
    yaw_rate,
    lateral_acceleration,
)
"""Every limit the space honours."""


def lever(vehicle: Vehicle, wheel: int) -> complex:
    """Return ``j κ_g w_i``, the wheel's velocity per v_s at κ_n = 2."""
    offset = vehicle.wheels[wheel].position - vehicle.reference
    return 1j * vehicle.boundary_curvature * offset


def rows_of(vehicle: Vehicle) -> tuple[tuple[LoadRow, ...], tuple[SectorRow, ...]]:
    """Return all rows of `LIMITS` for a vehicle."""
    rows = [row for limit in LIMITS for row in limit(vehicle)]
    loads = tuple(row for row in rows if isinstance(row, LoadRow))
    sectors = tuple(row for row in rows if isinstance(row, SectorRow))
    return loads, sectors
