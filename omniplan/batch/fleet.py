"""Many vehicles as flat tables of rows, for the kernels of `batch_verdicts`."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from configspace import PermissibleSpace, Vehicle
from configspace.kernels import BLOCKED, FREE
from configspace.limits import GRAVITY, center_of_gravity
from configspace.vehicle import (
    Castor,
    FixedWheel,
    MecanumWheel,
    OmniWheel,
    SteerableWheel,
)
from omniplan.batch import rows as kinds
from omniplan.judging.rows import Tolerances
from omniplan.judging.vehicle_judge import winds
from omniplan.report import SHAPE_LIMITS

__all__ = ["Fleet", "Label", "fleet_of", "is_plain"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Label:
    """How a row is reported."""

    limit: str
    wheel: str
    """Id of the wheel; empty for the vehicle."""
    unit: str


Line: TypeAlias = tuple[Label, list[float]]


@dataclass(frozen=True, eq=False)
class Fleet:
    """n vehicles; the rows of one follow those of the other."""

    bodies: FloatArray
    """(n, 4): K in m, κ_g in 1/m, 1 where it matters which representation is driven."""
    rows: FloatArray
    """(r, PARAMETERS)."""
    order: IntArray
    """(r,): what is told first where several limits are broken."""
    first: IntArray
    """(n + 1,): first row of every vehicle."""
    labels: tuple[Label, ...]
    """(r,)."""

    def content(self, vehicle: int) -> bytes:
        """Return what tells a vehicle from others, names of vehicles aside."""
        rows = slice(self.first[vehicle], self.first[vehicle + 1])
        ids = repr(self.labels[rows]).encode()
        numbers = np.concatenate([self.bodies[vehicle], self.rows[rows].ravel()])
        return bytes(numbers.tobytes()) + ids

    def picked(self, vehicles: Sequence[int]) -> Fleet:
        """Return only some of the vehicles, in this order."""
        spans = [np.arange(self.first[v], self.first[v + 1]) for v in vehicles]
        rows = np.concatenate([np.zeros(0, np.int64), *spans])
        return Fleet(
            self.bodies[vehicles],
            self.rows[rows],
            self.order[rows],
            np.concatenate([[0], np.cumsum([span.size for span in spans])]).astype(
                np.int64
            ),
            tuple(self.labels[row] for row in rows),
        )


_PLAIN: WeakKeyDictionary[PermissibleSpace, tuple[bool, bool]] = WeakKeyDictionary()


def is_plain(space: PermissibleSpace, *, allow_unreachable: bool = False) -> bool:
    """Return whether the kernels know all that `validate` asks of a vehicle.

    Not those known by their data sheet alone, wheels beside their steering axis, shared
    motors, ranges of more than a full turn, limits on the steering acceleration,
    guaranteed rates, and spaces in which some configurations cannot be reached.

    Parameters
    ----------
    space : PermissibleSpace
    allow_unreachable : bool
        Then it does not matter what can be reached.
    """
    known = _PLAIN.get(space)
    if known is None:
        known = _PLAIN[space] = _has_plain_wheels(space), _is_connected(space)
    return known[0] and (known[1] or allow_unreachable)


def _has_plain_wheels(space: PermissibleSpace) -> bool:
    vehicle = space.vehicle
    if vehicle is None or vehicle.guaranteed is not None:
        return False
    for wheel in vehicle.wheels:
        if not isinstance(wheel, SteerableWheel):
            continue
        least, largest = wheel.steering_range
        beside = any(wheel.offsets) or wheel.steering_coupling > 0
        jerks = wheel.max_steering_acceleration_deg is not None
        if beside or jerks or (math.isfinite(largest) and winds((largest - least) / 2)):
            return False
    return True


def _is_connected(space: PermissibleSpace) -> bool:
    """Return whether all that may be permitted is one piece, by sides of cells."""
    state = space.tables.state
    if not (state == FREE).any():
        return False
    may = state != BLOCKED
    if may.all():
        return True
    parts, count = ndimage.label(may)
    if count > 1 and may.shape[1] > 1:
        joined = may[:, 0] & may[:, -1]  # β = ±π is one line
        for a, b in zip(parts[joined, 0], parts[joined, -1], strict=True):
            if a != b:
                parts[parts == b] = a
                count -= 1
    return bool(count == 1)


def fleet_of(vehicles: Sequence[Vehicle], tolerances: Tolerances) -> Fleet:
    """Return plain vehicles as flat arrays.

    Parameters
    ----------
    vehicles : sequence of Vehicle
    tolerances : Tolerances
    """
    rows: list[list[float]] = []
    labels: list[Label] = []
    first, bodies = [0], []
    for vehicle in vehicles:
        for label, line in _lines(vehicle, tolerances):
            labels.append(label)
            rows.append(line)
        first.append(len(rows))
        k = vehicle.reference
        steers = any(isinstance(wheel, SteerableWheel) for wheel in vehicle.wheels)
        bodies.append((k.real, k.imag, vehicle.boundary_curvature, float(steers)))
    order = [
        SHAPE_LIMITS.index(label.limit)
        if label.limit in SHAPE_LIMITS
        else len(SHAPE_LIMITS)
        for label in labels
    ]
    return Fleet(
        np.array(bodies).reshape(-1, 4),
        np.array(rows).reshape(-1, kinds.PARAMETERS),
        np.array(order, dtype=np.int64),
        np.array(first),
        tuple(labels),
    )


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
) -> Line:
    return label, [
        *(kind, bound, sign, free, at.real, at.imag, along.real, along.imag, angle)
    ]


def _lines(vehicle: Vehicle, tolerances: Tolerances) -> Iterator[Line]:
    """Yield the rows of `VehicleJudge` for motions with rates that are not its own."""
    for i, wheel in enumerate(vehicle.wheels):
        at = vehicle.contacts[i]
        match wheel:
            case Castor():
                continue
            case SteerableWheel():
                yield from _steered(wheel, at)
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


def _steered(wheel: SteerableWheel, at: complex) -> Iterator[Line]:
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
    if wheel.max_steering_rate_deg is not None:
        label = Label("STEER_RATE", wheel.id, "rad/s")
        rate = math.radians(wheel.max_steering_rate_deg)
        yield _line(label, kinds.RATE, rate, at, free=True)
    if wheel.max_speed is not None:
        label = Label("WHEEL_SPEED", wheel.id, "m/s")
        yield _line(label, kinds.SPEED, wheel.max_speed, at)
    if wheel.max_acceleration is not None:
        label = Label("WHEEL_ACCELERATION", wheel.id, "m/s²")
        yield _line(label, kinds.GROWTH, wheel.max_acceleration, at)


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
        sine = math.sin(tolerances.slip_angle)
        yield _line(Label("PARALLEL_WHEELS", "", "rad"), kinds.PARALLEL, sine, k)
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
