"""The limits of a vehicle as smooth functions of a motion, for a solver.

Which limits there are is asked of `omniplan.timing.rows` (what depends on the speed)
and of `configspace.limits` (where wheels may point); nothing about a vehicle is decided
here. All is written in body twists and wheel velocities, so neither the pole κ_n = ±2
nor the kinks at κ_n = 0, ±1 are special.

Where a motion comes to rest its twist is a real factor, the time to rest, times one
that is not zero. That one has the same directions and is what angles are taken from.

The formulas know numbers only by ``+ - * /`` and by `Functions`: a solver puts its
symbols in, a test arrays.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, TypeAlias

from configspace import Vehicle
from configspace.limits import SectorRow, rows_of
from configspace.vehicle import SteerableWheel
from omniplan.judging.vehicle_judge import winds
from omniplan.timing.rows import RowKind, TimingRow, timing_rows

__all__ = [
    "Bound",
    "Functions",
    "Pair",
    "Rules",
    "Tightness",
    "Twist",
    "rules_of",
    "speed_bounds",
    "top_speed",
    "turn_angles",
]

Number: TypeAlias = Any
"""A float, an array or a symbol of a solver."""

TINY = 1e-9
"""What keeps quotients and roots smooth where a wheel stands, m²/s²."""
_SPEEDS = (RowKind.SIZE, RowKind.COMPONENT, RowKind.REVERSE)
_SWINGING = (RowKind.STEER_ACCELERATION, RowKind.BESIDE_RATE)
SINE_MARGIN = 1e-2
"""So far a wheel with a full turn keeps from its stops, rad."""


@dataclass(frozen=True)
class Functions:
    """The functions that the formulas need, for one kind of number."""

    sin: Callable[[Number], Number]
    cos: Callable[[Number], Number]
    sqrt: Callable[[Number], Number]
    atan2: Callable[[Number, Number], Number]


@dataclass(frozen=True)
class Pair:
    """A vector of the plane, ``x + j y``."""

    x: Number
    y: Number

    def __add__(self, other: Pair) -> Pair:
        """Return the sum."""
        return Pair(self.x + other.x, self.y + other.y)

    def __sub__(self, other: Pair) -> Pair:
        """Return the difference."""
        return Pair(self.x - other.x, self.y - other.y)

    def times(self, factor: Number) -> Pair:
        """Return the vector times a real number."""
        return Pair(self.x * factor, self.y * factor)

    def turned(self, z: complex) -> Pair:
        """Return the product with a complex constant."""
        return Pair(
            self.x * z.real - self.y * z.imag, self.x * z.imag + self.y * z.real
        )

    def dot(self, other: Pair) -> Number:
        """Return ``Re(a b̄)``."""
        return self.x * other.x + self.y * other.y

    def cross(self, other: Pair) -> Number:
        """Return ``Im(ā b)``: positive if the other is to the left."""
        return self.x * other.y - self.y * other.x

    @property
    def square(self) -> Number:
        """``|a|²``."""
        return self.x * self.x + self.y * self.y


@dataclass(frozen=True)
class Twist:
    """A twist of K in the body frame and its two derivatives with respect to time."""

    v: tuple[Pair, Pair, Pair]
    omega: tuple[Number, Number, Number]

    def at(self, arm: complex) -> tuple[Pair, Pair, Pair]:
        """Return the velocity of a point of the body, with two derivatives.

        Parameters
        ----------
        arm : complex, m
            From K, in the body frame.
        """
        one, two, three = (
            v + Pair(-omega * arm.imag, omega * arm.real)
            for v, omega in zip(self.v, self.omega, strict=True)
        )
        return one, two, three


@dataclass(frozen=True)
class Tightness:
    """How much tighter than the limits the solver is held."""

    share: float = 4e-3
    """Of speeds, accelerations and rates."""
    angle: float = math.radians(0.3)
    """Of steering ranges, rad."""


@dataclass(frozen=True)
class Bound:
    """A value that a motion has somewhere, and what it may be."""

    limit: str
    wheel: int
    value: Number
    least: float
    largest: float
    is_swing: bool = False
    """Whether a steering acceleration has a part in it: near rest that is steep."""


@dataclass(frozen=True)
class Rules:
    """What a vehicle's motion must keep."""

    reference: complex
    kappa_g: float
    rows: tuple[TimingRow, ...]
    """Limits on speeds, accelerations and rates."""
    sectors: tuple[SectorRow, ...]
    """Steering ranges that a direction alone decides, and guaranteed rates."""
    line: float | None
    """The constant β of a line-mobile vehicle, rad."""
    is_translating: bool
    axes: tuple[tuple[complex, float], ...]
    """Steered wheels: place from K, m; largest rate at rest, rad/s, maybe infinite."""

    def arm(self, point: complex) -> complex:
        """Return a point of the vehicle file's frame as seen from K, m."""
        return point - self.reference

    @property
    def bounds_swing(self) -> bool:
        """Whether something is bounded that a steering acceleration has a part in."""
        return any(row.kind in _SWINGING for row in self.rows)

    @property
    def has_configuration(self) -> bool:
        """Whether wheels point somewhere."""
        return bool(self.axes)


def rules_of(vehicle: Vehicle) -> Rules:
    """Return what the motion of a vehicle must keep."""
    kappa_g, mobility = vehicle.boundary_curvature, vehicle.mobility
    wheels = [
        (i, wheel)
        for i, wheel in enumerate(vehicle.wheels)
        if isinstance(wheel, SteerableWheel)
    ]
    winding = {
        i
        for i, wheel in wheels
        if wheel.steering_range_deg is not None
        and winds((wheel.steering_range[1] - wheel.steering_range[0]) / 2)
    }
    return Rules(
        vehicle.reference,
        kappa_g,
        tuple(
            row
            for row in timing_rows(vehicle, has_caps=False)
            if row.kind is not RowKind.SAMPLING
        ),
        tuple(_sectors(rows_of(vehicle)[1], winding)),
        mobility.line_beta,
        mobility.is_translating,
        tuple(
            (vehicle.contacts[i] - vehicle.reference, wheel.standing_steering_rate)
            for i, wheel in wheels
        ),
    )


def _sectors(rows: tuple[SectorRow, ...], winding: set[int]) -> Iterator[SectorRow]:
    """Yield the rows that forbid something; windings are left to `validate`."""
    for row in rows:
        bounded = math.isfinite(row.half) and row.wheel not in winding
        if bounded or row.kappa_share or row.beta_share:
            half = row.half if bounded else math.inf
            yield SectorRow(
                row.b,
                row.middle,
                half,
                row.wheel,
                row.kappa_share,
                row.beta_share,
                row.line,
            )


def speed_bounds(
    rules: Rules,
    twist: Twist,
    direction: Twist,
    sign: int,
    f: Functions,
    tightness: Tightness,
) -> Iterator[Bound]:
    """Yield every limit of a vehicle at one instant, scaled to about 1.

    Parameters
    ----------
    rules : Rules
    twist : Twist
        That of K.
    direction : Twist
        The same up to a positive factor; not zero where the vehicle comes to rest.
    sign : {1, -1}
        The representation: the sign of v_s.
    f : Functions
    tightness : Tightness
    """
    top = 1 - tightness.share
    for row in rules.rows:
        swings = row.kind in _SWINGING
        for value, least, largest in _row(rules, row, twist, direction, sign, f):
            ends = least * top, largest * top
            yield Bound(row.limit, row.wheel, value, *ends, is_swing=swings)
    for sector in rules.sectors:
        yield from _sector(rules, sector, direction, sign, f, tightness)


Scaled: TypeAlias = tuple[Number, float, float]


def _row(
    rules: Rules,
    row: TimingRow,
    twist: Twist,
    direction: Twist,
    sign: int,
    f: Functions,
) -> Iterator[Scaled]:
    arm, scale, inf = rules.arm(row.point), 1 / row.bound, math.inf
    u, u1, _ = twist.at(arm)
    omega, omega1 = twist.omega[0], twist.omega[1]
    match row.kind:
        case RowKind.SIZE:
            yield u.square * scale**2, -inf, 1.0
        case RowKind.COMPONENT:
            yield u.turned(row.turn).x * scale, -1.0, 1.0
        case RowKind.YAW:
            yield omega * scale, -1.0, 1.0
        case RowKind.LATERAL:
            yield omega * omega * u.square * scale**2, -inf, 1.0
        case RowKind.REVERSE:
            if row.turn:
                yield u.turned(row.turn).x * scale, -1.0, inf
            elif sign < 0:
                yield u.square * scale**2, -inf, 1.0
        case RowKind.COMPONENT_RATE:
            yield u1.turned(row.turn).x * scale, -1.0, 1.0
        case RowKind.ACCELERATION_ALONG:
            across = Pair(-u.y * omega, u.x * omega)
            yield (u1 + across).turned(row.turn).x * scale, -inf, 1.0
        case _:
            yield from _rolling(row, u, u1, (omega, omega1), direction.at(arm), sign, f)


def _rolling(
    row: TimingRow,
    u: Pair,
    u1: Pair,
    omega: tuple[Number, Number],
    along: tuple[Pair, Pair, Pair],
    sign: int,
    f: Functions,
) -> Iterator[Scaled]:
    """Yield the limits that depend on where a velocity points."""
    d, d1, d2 = along
    square, scale, inf = d.square + TINY, 1 / row.bound, math.inf
    gain = u1.dot(d) / f.sqrt(square)
    rate = d.cross(d1) / square
    swing = d.cross(d2) / square - 2 * d.dot(d1) * rate / square
    match row.kind:
        case RowKind.SIZE_RATE:
            yield gain * scale, -1.0, 1.0
        case RowKind.SIZE_UP:
            yield gain * scale, -inf, 1.0
        case RowKind.SIZE_DOWN:
            yield gain * scale, -1.0, inf
        case RowKind.STEER_RATE:
            yield rate * scale, -1.0, 1.0
        case RowKind.STEER_ACCELERATION:
            yield swing * scale, -1.0, 1.0
        case RowKind.BESIDE_RATE:
            rolls = gain - sign * row.lever * (omega[1] + swing) + row.coupling * swing
            yield rolls * scale, -1.0, 1.0
        case RowKind.BESIDE:
            size = f.sqrt(u.square + TINY)
            rolls = size - sign * row.lever * (omega[0] + rate)
            for side in (1, -1) if row.coupling else (0,):
                yield (rolls + side * row.coupling * rate) * scale, -1.0, 1.0
        case _:
            raise NotImplementedError(row.kind)


def _sector(
    rules: Rules,
    row: SectorRow,
    direction: Twist,
    sign: int,
    f: Functions,
    tightness: Tightness,
) -> Iterator[Bound]:
    d, _, _ = direction.at(row.b / (1j * rules.kappa_g))
    square = d.square + TINY
    if math.isfinite(row.half):
        half = min(row.half - tightness.angle, math.pi - SINE_MARGIN)
        ahead = d.turned(cmath.exp(-1j * row.middle)).x * sign / f.sqrt(square)
        yield Bound("STEER_RANGE", row.wheel, ahead, math.cos(half), math.inf)
    if row.kappa_share or row.beta_share:
        yield from _zone(rules, row, direction, d, f, tightness)


def _zone(
    rules: Rules,
    row: SectorRow,
    direction: Twist,
    d: Pair,
    f: Functions,
    tightness: Tightness,
) -> Iterator[Bound]:
    """Yield the guaranteed rates: what they ask for, per largest steering rate.

    With ``v e^{jβ} c`` the velocity of K, ``S = v s`` and ``d = v z``:
    ``∂α/∂β = Re(v c e^{jβ} d̄) / |d|²`` and ``∂α/∂κ_n = Im(b e^{-jβ}) v² / |d|²``,
    v the larger of the two; each gets a row (spec/omni-curve §4).
    """
    body, turn = direction.v[0], direction.omega[0] / rules.kappa_g
    square, speed = d.square + TINY, body.square + TINY
    arm = Pair(row.b.real, row.b.imag)
    aside = body.cross(arm) / f.sqrt(speed)
    by_beta = row.beta_share * body.dot(d)
    for size in (speed, turn * turn):
        by_kappa = row.kappa_share * aside * size
        asked = f.sqrt(by_kappa * by_kappa + TINY) + f.sqrt(by_beta * by_beta + TINY)
        yield Bound(
            "SINGULAR_ZONE", row.wheel, asked / square, -math.inf, 1 - tightness.share
        )


def turn_angles(
    rules: Rules, before: Twist, after: Twist, sign: int, f: Functions
) -> Iterator[tuple[Number, float]]:
    """Yield by how much each steered wheel turns at a stop, and its largest rate.

    Parameters
    ----------
    rules : Rules
    before, after : Twist
        Directions in which a motion comes to the stop and leaves it.
    sign : {1, -1}
        -1 if v_s changes its sign.
    f : Functions
    """
    for arm, rate in rules.axes:
        if math.isfinite(rate):
            a, b = before.at(arm)[0], after.at(arm)[0]
            yield f.atan2(sign * a.cross(b), sign * a.dot(b)), rate


def top_speed(rules: Rules) -> float:
    """Return about how fast a vehicle can be, m/s."""
    speeds = [row.bound for row in rules.rows if row.kind in _SPEEDS]
    return min(speeds, default=1.0)
