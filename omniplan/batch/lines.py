"""Vehicles as rows of limits, for the kernels; `VehicleJudge` has the same."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

from configspace import Vehicle
from configspace.exact import LINE_TOLERANCE
from configspace.limits import GRAVITY, SectorRow, center_of_gravity, rows_of
from configspace.vehicle import (
    Castor,
    FixedWheel,
    MecanumWheel,
    OmniWheel,
    SteerableWheel,
)
from omniplan.batch import kinds
from omniplan.judging.rows import Tolerances

__all__ = ["Label", "Line", "lines_of", "own_lines_of"]


@dataclass(frozen=True)
class Label:
    """How a row is reported."""

    limit: str
    wheel: str
    """Id of the wheel; empty for the vehicle."""
    unit: str


Line: TypeAlias = tuple[Label, list[float]]
"""A row, and how it is reported."""


def _line(
    label: Label,
    kind: int,
    bound: float,
    at: complex = 0j,
    along: complex = 0j,
    *,
    sign: int = 0,
    free: bool = False,
    angle: float = 0.0,
    more: tuple[float, ...] = (),
) -> Line:
    line = [kind, bound, sign, free, at.real, at.imag, along.real, along.imag, angle]
    return label, [*line, *more, *[0.0] * (kinds.PARAMETERS - len(line) - len(more))]


def lines_of(vehicle: Vehicle, tolerances: Tolerances) -> Iterator[Line]:
    """Yield the rows of `VehicleJudge` for motions with rates that are not its own."""
    sectors = {row.wheel: row for row in rows_of(vehicle)[1]}
    for i, wheel in enumerate(vehicle.wheels):
        at = vehicle.contacts[i]
        match wheel:
            case Castor():
                continue
            case SteerableWheel():
                yield from _steered(wheel, at, sectors[i])
            case FixedWheel():
                aside = cmath.exp(-1j * (wheel.heading + math.pi / 2))
                sine = math.sin(tolerances.slip_angle)
                label = Label("FIXED_WHEEL", wheel.id, "rad")
                yield _line(label, kinds.SLIP, sine, at, aside)
                yield from _rolling(wheel, at, cmath.exp(-1j * wheel.heading))
            case MecanumWheel() | OmniWheel():
                turn = cmath.exp(-1j * (wheel.heading + wheel.roller))
                yield from _rolling(wheel, at, turn / math.cos(wheel.roller))
    yield from _whole(vehicle, tolerances)


def _steered(wheel: SteerableWheel, at: complex, sector: SectorRow) -> Iterator[Line]:
    singular = Label("SINGULAR", wheel.id, "m/s")
    yield _line(singular, kinds.SINGULAR, 0.0, at, free=True)
    least, largest = wheel.steering_range
    if math.isfinite(largest):
        label = Label("STEER_RANGE", wheel.id, "rad")
        half, middle = min((largest - least) / 2, math.pi), (largest + least) / 2
        ahead = cmath.exp(1j * middle)
        for sign in (1, -1):
            yield _line(
                label, kinds.RANGE, half, at, ahead, sign=sign, free=True, angle=middle
            )
    if sector.kappa_share or sector.beta_share:
        label = Label("SINGULAR_ZONE", wheel.id, "1")
        rates = sector.beta_share, sector.pole_arm, float(sector.line is not None)
        yield _line(
            label, kinds.ZONE, 1.0, at, sector.b, free=True, angle=sector.kappa_share,
            more=rates,
        )  # fmt: skip
    if wheel.max_steering_rate_deg is not None:
        label = Label("STEER_RATE", wheel.id, "rad/s")
        rate = math.radians(wheel.max_steering_rate_deg)
        yield _line(label, kinds.RATE, rate, at, free=True)
    if wheel.max_steering_acceleration_deg is not None:
        label = Label("STEER_ACCELERATION", wheel.id, "rad/s²")
        swing = math.radians(wheel.max_steering_acceleration_deg)
        yield _line(label, kinds.SWING, swing, at, free=True)
    if wheel.max_speed is not None:
        yield from _beside(wheel, at, wheel.max_speed)
    if wheel.max_speed is not None and 0.0 in wheel.offsets:
        label = Label("WHEEL_SPEED", wheel.id, "m/s")
        yield _line(label, kinds.SPEED, wheel.max_speed, at)
    gain = wheel.max_acceleration
    if gain is not None:
        label = Label("WHEEL_ACCELERATION", wheel.id, "m/s²")
        if not (any(wheel.offsets) or wheel.steering_coupling):
            yield _line(label, kinds.GROWTH, gain, at)
            return
        for offset in wheel.offsets:
            lever = complex(offset, wheel.steering_coupling)
            for sign in _signs(wheel, offset):
                yield _line(label, kinds.BESIDE_GROWTH, gain, at, lever, sign=sign)


def _signs(wheel: SteerableWheel, offset: float) -> tuple[int, ...]:
    """Return the representations that have rows of their own for an offset.

    Of wheels on both sides of the axis each is the other's, driven backwards.
    """
    return (0,) if -offset in wheel.offsets else (1, -1)


def own_lines_of(vehicle: Vehicle, tolerances: Tolerances) -> Iterator[Line]:
    """Yield the rows of `VehicleJudge` for its own Omni-Curve-Parameters."""
    sectors = {row.wheel: row for row in rows_of(vehicle)[1]}
    for i, wheel in enumerate(vehicle.wheels):
        if isinstance(wheel, SteerableWheel):
            yield from _own_steered(wheel, vehicle.contacts[i], sectors[i])
    k, line = vehicle.reference, vehicle.mobility.line_beta
    if vehicle.mobility.is_translating:
        yield _translating(tolerances, k)
    if line is not None:
        label = Label("FIXED_WHEEL", "", "rad")
        yield _line(label, kinds.OFF_LINE, LINE_TOLERANCE, k, free=True, angle=line)
    yield _line(Label("V_MAX", "", "1"), kinds.SHARE, 1.0, k)


def _own_steered(
    wheel: SteerableWheel, at: complex, sector: SectorRow
) -> Iterator[Line]:
    for label, line in _steered(wheel, at, sector):
        kind = line[kinds.KIND]
        if kind in (kinds.SINGULAR, kinds.ZONE, kinds.RATE):
            yield label, line
        elif kind == kinds.RANGE and line[kinds.SIGN] > 0:
            held = {kinds.KIND: float(kinds.OWN_RANGE), kinds.SIGN: 0.0}
            yield label, [held.get(i, value) for i, value in enumerate(line)]
    if wheel.max_speed is None:
        return
    for offset in wheel.offsets:
        lever = abs(offset) + wheel.steering_coupling
        if lever:
            label, lever_ = Label("WHEEL_SPEED", wheel.id, "m/s"), complex(lever)
            limit = wheel.max_speed
            yield _line(label, kinds.STEERING, limit, at, lever_, free=True)


def _translating(tolerances: Tolerances, k: complex) -> Line:
    sine = math.sin(tolerances.slip_angle)
    return _line(Label("PARALLEL_WHEELS", "", "rad"), kinds.PARALLEL, sine, k)


def _beside(wheel: SteerableWheel, at: complex, limit: float) -> Iterator[Line]:
    """Yield the rows of rolling speeds that steering takes a share of."""
    label, coupling = Label("WHEEL_SPEED", wheel.id, "m/s"), wheel.steering_coupling
    for offset in wheel.offsets:
        if not (offset or coupling):
            continue
        for sign in _signs(wheel, offset):
            yield _line(
                label, kinds.BESIDE, limit, at, complex(offset, coupling),
                sign=sign, free=True,
            )  # fmt: skip


def _rolling(
    wheel: FixedWheel | MecanumWheel | OmniWheel, at: complex, turn: complex
) -> Iterator[Line]:
    if wheel.max_speed is not None:
        label = Label("WHEEL_SPEED", wheel.id, "m/s")
        yield _line(label, kinds.COMPONENT, wheel.max_speed, at, turn)
    if wheel.max_acceleration is not None:
        label = Label("WHEEL_ACCELERATION", wheel.id, "m/s²")
        yield _line(label, kinds.COMPONENT_GROWTH, wheel.max_acceleration, at, turn)


def _whole(vehicle: Vehicle, tolerances: Tolerances) -> Iterator[Line]:
    limits, k, line = vehicle.limits, vehicle.reference, vehicle.mobility.line_beta
    if vehicle.mobility.is_translating:
        yield _translating(tolerances, k)
    if limits.max_speed is not None:
        yield _line(Label("SPEED", "", "m/s"), kinds.SPEED, limits.max_speed, k)
    if limits.max_reverse_speed is not None:
        label, bound = Label("REVERSE_SPEED", "", "m/s"), limits.max_reverse_speed
        if line is None:
            yield _line(label, kinds.SPEED, bound, k, sign=-1)
        else:
            yield _line(label, kinds.BACKWARDS, bound, k, cmath.exp(1j * line))
    if limits.max_yaw_rate_deg is not None:
        label = Label("YAW_RATE", "", "rad/s")
        yield _line(label, kinds.YAW, math.radians(limits.max_yaw_rate_deg), k)
    if limits.max_lateral_acceleration is not None:
        label = Label("LATERAL_ACCELERATION", "", "m/s²")
        by_load = limits.lateral_acceleration_at == "center_of_gravity"
        at = center_of_gravity(vehicle) if by_load else k
        yield _line(label, kinds.LATERAL, limits.max_lateral_acceleration, at)
    if vehicle.load is not None:
        height = vehicle.load.center_of_gravity[2]
        for normal, distance in vehicle.tipping_edges:
            limit = distance * GRAVITY / (vehicle.load.tipping_factor * height)
            at = center_of_gravity(vehicle)
            yield _line(Label("TIPPING", "", "m/s²"), kinds.TIPPING, limit, at, normal)
    for name, bound_, side in (
        ("ACCELERATION", limits.max_acceleration, 1.0),
        ("DECELERATION", limits.max_deceleration, -1.0),
    ):
        if bound_ is not None:
            yield _line(Label(name, "", "m/s²"), kinds.GROWTH, bound_, k, angle=side)
