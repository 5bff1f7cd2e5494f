"""Many vehicles as flat tables of rows, for the kernels of `batch_verdicts`."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from configspace import PermissibleSpace, Vehicle
from configspace.exact import LINE_TOLERANCE
from configspace.kernels import BLOCKED, FREE
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
from omniplan.judging.vehicle_judge import winds
from omniplan.report import SHAPE_LIMITS

__all__ = ["Fleet", "Label", "fleet_of", "is_connected", "is_plain"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Label:
    """How a row is reported."""

    limit: str
    wheel: str
    """Id of the wheel; empty for the vehicle."""
    unit: str


Codes: TypeAlias = npt.NDArray[np.uint8]
BODY = 9
"""Numbers per vehicle."""
Line: TypeAlias = tuple[Label, list[float]]


@dataclass(frozen=True, eq=False)
class Fleet:
    """n vehicles; the rows of one follow those of the other."""

    bodies: FloatArray
    """(n, BODY): K in m, κ_g in 1/m, 1 where it has to be chosen which representation
    is driven, 1 where ways of the wheels can be searched for, the constant β of a
    line-mobile vehicle in rad or NaN, the least time per rad of a wheel at rest in
    s/rad, rows and columns of its cells; 0 where all of the space is reached."""
    rows: FloatArray
    """(r, PARAMETERS)."""
    order: IntArray
    """(r, 2): what is told first where several limits are broken: class and, in it,
    where limit and wheel are in the alphabet, as `Report.headline` has it."""
    first: IntArray
    """(n + 1,): first row of every vehicle."""
    own_rows: FloatArray
    """(q, PARAMETERS): those of the vehicles' own Omni-Curve-Parameters."""
    first_own: IntArray
    """(n + 1,): first of them of every vehicle."""
    cells: npt.NDArray[np.uint8]
    """(c,): codes of `reaches`, by rows."""
    first_cell: IntArray
    """(n + 1,): first of them of every vehicle."""
    labels: tuple[Label, ...]
    """(r,)."""

    @property
    def told(self) -> tuple[Label, ...]:
        """All that is told, (2 r + 2,).

        The rows, standstills at which the wheel of a row turns furthest, and those of
        no wheel in particular.
        """
        at_rest = (Label("RECONFIGURATION", x.wheel, "s") for x in self.labels)
        others = Label("UNREACHABLE", "", "1"), Label("RECONFIGURATION", "", "s")
        return (*self.labels, *at_rest, *others)

    @property
    def arrays(self) -> tuple[npt.NDArray[Any], ...]:
        """What `judge_pairs` takes."""
        own = self.own_rows, self.first_own
        cells = self.cells, self.first_cell
        return self.bodies, self.rows, self.order, self.first, *own, *cells

    def content(self, vehicle: int) -> bytes:
        """Return what tells a vehicle from others, names of vehicles aside."""
        rows = slice(self.first[vehicle], self.first[vehicle + 1])
        own = slice(self.first_own[vehicle], self.first_own[vehicle + 1])
        ids = repr(self.labels[rows]).encode()
        cells = slice(self.first_cell[vehicle], self.first_cell[vehicle + 1])
        tables = (
            self.bodies[vehicle], self.rows[rows], self.own_rows[own], self.cells[cells]
        )  # fmt: skip
        return b"".join(bytes(table.tobytes()) for table in tables) + ids

    def picked(self, vehicles: Sequence[int]) -> Fleet:
        """Return only some of the vehicles, in this order."""
        rows, first = _spans(self.first, vehicles)
        own, first_own = _spans(self.first_own, vehicles)
        cells, first_cell = _spans(self.first_cell, vehicles)
        return Fleet(
            self.bodies[vehicles],
            self.rows[rows],
            self.order[rows],
            first,
            self.own_rows[own],
            first_own,
            self.cells[cells],
            first_cell,
            tuple(self.labels[row] for row in rows),
        )


def _spans(first: IntArray, vehicles: Sequence[int]) -> tuple[IntArray, IntArray]:
    """Return the rows of some vehicles, and where those of each begin then."""
    spans = [np.arange(first[v], first[v + 1]) for v in vehicles]
    rows = np.concatenate([np.zeros(0, np.int64), *spans])
    ends = np.cumsum([0, *(span.size for span in spans)])
    return rows, ends.astype(np.int64)


_CONNECTED: WeakKeyDictionary[PermissibleSpace, bool] = WeakKeyDictionary()


def is_plain(space: PermissibleSpace, *, allow_unreachable: bool = False) -> bool:
    """Return whether the kernels know all that `validate` asks of a vehicle.

    Not those known by their data sheet alone, ranges of more than a full turn, wheels
    beside their axis or with shared motors whose acceleration is limited, and spaces in
    which some configurations cannot be reached.

    Parameters
    ----------
    space : PermissibleSpace
    allow_unreachable : bool
        Then it does not matter what can be reached.
    """
    return _has_plain_wheels(space) and (
        allow_unreachable or is_connected(space) or _is_planar(space)
    )


def is_connected(space: PermissibleSpace) -> bool:
    """Return whether all that may be permitted is one piece, by sides of cells."""
    known = _CONNECTED.get(space)
    if known is None:
        known = _CONNECTED[space] = _is_connected(space)
    return known


def _is_planar(space: PermissibleSpace) -> bool:
    """Return whether the kernels can tell what is reached."""
    vehicle = space.vehicle
    steers = vehicle is not None and any(
        isinstance(wheel, SteerableWheel) for wheel in vehicle.wheels
    )
    return steers and space.line_beta is None and not space.is_translating


def _has_plain_wheels(space: PermissibleSpace) -> bool:
    vehicle = space.vehicle
    if vehicle is None:
        return False
    for wheel in vehicle.wheels:
        if not isinstance(wheel, SteerableWheel):
            continue
        least, largest = wheel.steering_range
        if math.isfinite(largest) and winds((largest - least) / 2):
            return False
    return True


def _is_connected(space: PermissibleSpace) -> bool:
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


def fleet_of(
    vehicles: Sequence[Vehicle],
    tolerances: Tolerances,
    *,
    is_own: bool = False,
    codes: Sequence[Codes | None] = (),
) -> Fleet:
    """Return plain vehicles as flat arrays.

    Parameters
    ----------
    vehicles : sequence of Vehicle
    tolerances : Tolerances
    is_own : bool
        For motions in their own Omni-Curve-Parameters.
    codes : sequence of (rows, columns) uint8 or None, optional
        By vehicle, of `reaches`; None where all of the space is reached.
    """
    rows, own_rows, labels, order = [], [], [], []
    first, first_own, bodies = [0], [0], []
    for vehicle in vehicles:
        own = list(_own_lines(vehicle, tolerances))
        for label, line in own if is_own else _lines(vehicle, tolerances):
            labels.append(label)
            rows.append(line)
        order += _order(labels[first[-1] :])
        first.append(len(rows))
        own_rows += [line for _, line in own]
        first_own.append(len(own_rows))
        bodies.append(_body(vehicle, is_own))
    bodies_ = np.array(bodies, dtype=np.float64).reshape(-1, BODY)
    cells, first_cell = _cells(bodies_, codes)
    return Fleet(
        bodies_,
        np.array(rows, dtype=np.float64).reshape(-1, kinds.PARAMETERS),
        np.array(order, dtype=np.int64).reshape(-1, 2),
        np.array(first),
        np.array(own_rows, dtype=np.float64).reshape(-1, kinds.PARAMETERS),
        np.array(first_own),
        cells,
        first_cell,
        tuple(labels),
    )


def _order(labels: Sequence[Label]) -> list[tuple[int, int]]:
    """Return class and place in the alphabet of the rows of one vehicle."""
    names = sorted({(label.limit, label.wheel) for label in labels})
    limits = (
        *SHAPE_LIMITS,
        *(limit for limit, _ in names if limit not in SHAPE_LIMITS),
    )
    return [
        (
            min(limits.index(label.limit), len(SHAPE_LIMITS)),
            names.index((label.limit, label.wheel)),
        )
        for label in labels
    ]


def _body(vehicle: Vehicle, is_own: bool) -> tuple[float, ...]:
    k, line = vehicle.reference, vehicle.mobility.line_beta
    steered = [wheel for wheel in vehicle.wheels if isinstance(wheel, SteerableWheel)]
    quickest = max((wheel.standing_steering_rate for wheel in steered), default=1.0)
    slows = any(math.isfinite(wheel.standing_steering_rate) for wheel in steered)
    searches = line is None and not vehicle.mobility.is_translating and slows
    return (
        k.real,
        k.imag,
        vehicle.boundary_curvature,
        float(bool(steered) and not is_own),
        float(searches),
        math.nan if line is None else line,
        1 / quickest,
        0.0,
        0.0,
    )


def _cells(bodies: FloatArray, codes: Sequence[Codes | None]) -> tuple[Codes, IntArray]:
    """Return the cells of all vehicles, and where those of each begin."""
    tables, first = [np.zeros(0, np.uint8)], np.zeros(len(bodies) + 1, np.int64)
    for i, table in enumerate(codes):
        if table is not None:
            tables.append(table.ravel())
            bodies[i, 7:9] = table.shape
            first[i + 1] = table.size
    return np.concatenate(tables), np.cumsum(first)


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


def _lines(vehicle: Vehicle, tolerances: Tolerances) -> Iterator[Line]:
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


def _own_lines(vehicle: Vehicle, tolerances: Tolerances) -> Iterator[Line]:
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
