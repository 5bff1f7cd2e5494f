"""Every limit of a vehicle, held against the samples of a plain simulation.

Nothing of `omniplan` is used, and of `configspace` the plain fields of `Vehicle` only.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from naive import constant_beta
from naive_motion import (
    ALIGNMENT,
    SLIP_ANGLE,
    SLIP_SPEED,
    STANDSTILL,
    Piece,
    Simulation,
    point_velocity,
    rolling_of,
)

from configspace.vehicle import (
    Castor,
    FixedWheel,
    SteerableWheel,
    SteeredWheel,
    Turntable,
    Vehicle,
)

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

GRAVITY = 9.81
RELATIVE, ABSOLUTE = 1e-5, 1e-5
"""What seeing changes from a moment later may be wrong by."""


@dataclass(frozen=True)
class Use:
    """How far a limit is used over the samples looked at, at the worst of them."""

    limit: str
    wheel: str | None
    value: float
    bound: float
    t: float

    @property
    def is_broken(self) -> bool:
        return self.value > self.bound * (1 + RELATIVE) + ABSOLUTE

    @property
    def share(self) -> float:
        return self.value / self.bound if self.bound > 0 else math.inf


def use(
    limit: str,
    wheel: str | None,
    value: FloatArray,
    bound: float | FloatArray,
    t: FloatArray,
) -> Use:
    bounds = np.broadcast_to(bound, value.shape)
    i = int(np.argmax(value / bounds))
    return Use(limit, wheel, float(value[i]), float(bounds[i]), float(t[i]))


# --- in either representation


def whole_uses(sim: Simulation) -> Iterator[Use]:
    """Limits that hold in whichever representation, moving or not."""
    yield from body_uses(sim)
    yield from tipping_uses(sim)
    for i, wheel in enumerate(sim.vehicle.wheels):
        if isinstance(wheel, Castor):
            continue
        u = sim.velocity(*sim.places[i])
        if wheel.max_speed is not None and 0.0 in offsets_of(wheel):
            speed = np.abs(rolling_of(sim.vehicle, i, u))
            yield use("WHEEL_SPEED", wheel.id, speed, wheel.max_speed, sim.t)
        if wheel.max_acceleration is not None and sim.has_accelerations:
            later = sim.velocity_later(*sim.places[i])
            gain = rolling_of(sim.vehicle, i, later) - rolling_of(sim.vehicle, i, u)
            rate = np.abs(gain) / sim.moment
            if is_beside(wheel) and sim.ahead is not None:  # see `steering_uses`
                rate = np.where(sim.moves, 0.0, rate)
            limit = "WHEEL_ACCELERATION"
            yield use(limit, wheel.id, rate, wheel.max_acceleration, sim.t)
        if isinstance(wheel, FixedWheel):
            delta = math.radians(wheel.heading_deg)
            aside = np.abs(u.imag * math.cos(delta) - u.real * math.sin(delta))
            yield use("FIXED_WHEEL", wheel.id, aside, slip_allowed(sim), sim.t)


def offsets_of(wheel: object) -> tuple[float, ...]:
    """Where wheels stand beside a steering axis, by the fields of the file."""
    match wheel:
        case SteeredWheel():
            return (wheel.offset,)
        case Turntable():
            return (wheel.track / 2, -wheel.track / 2)
    return (0.0,)


def is_beside(wheel: object) -> bool:
    """Whether steering takes part in what a wheel's motor does."""
    coupling = getattr(wheel, "steering_coupling", 0.0)
    return any(offsets_of(wheel)) or coupling > 0


def slip_allowed(sim: Simulation) -> FloatArray:
    return np.asarray(np.maximum(math.sin(SLIP_ANGLE) * sim.v_s, SLIP_SPEED))


def body_uses(sim: Simulation) -> Iterator[Use]:
    """Speeds, turning and accelerations of the body."""
    vehicle, limits, t = sim.vehicle, sim.vehicle.limits, sim.t
    if limits.max_speed is not None:
        yield use("SPEED", None, sim.speed, limits.max_speed, t)
    if limits.max_yaw_rate_deg is not None:
        bound = math.radians(limits.max_yaw_rate_deg)
        yield use("YAW_RATE", None, np.abs(sim.omega), bound, t)
    if limits.max_lateral_acceleration is not None:
        speed = sim.speed
        if limits.lateral_acceleration_at == "center_of_gravity":
            assert vehicle.load is not None
            speed = np.abs(sim.velocity(*vehicle.load.center_of_gravity[:2]))
        sideways = np.abs(sim.omega) * speed
        bound = limits.max_lateral_acceleration
        yield use("LATERAL_ACCELERATION", None, sideways, bound, t)
    if sim.has_accelerations:
        assert sim.later is not None
        later = np.abs(point_velocity(sim.later, *sim.reference))
        gain = (later - sim.speed) / sim.moment
        if limits.max_acceleration is not None:
            yield use("ACCELERATION", None, gain, limits.max_acceleration, t)
        if limits.max_deceleration is not None:
            yield use("DECELERATION", None, -gain, limits.max_deceleration, t)
    line = constant_beta(vehicle)
    if line is not None and limits.max_reverse_speed is not None:
        ahead = sim.kx * math.cos(line) + sim.ky * math.sin(line)
        back = np.where(ahead < -STANDSTILL * (1 + 1e-6), sim.speed, 0.0)
        yield use("REVERSE_SPEED", None, back, limits.max_reverse_speed, t)
    if vehicle.synchro:
        turn = np.abs(sim.omega) / sim.kappa_g
        yield use("PARALLEL_WHEELS", None, turn, slip_allowed(sim), t)


def tipping_uses(sim: Simulation) -> Iterator[Use]:
    """The zero-moment point against every edge of what the vehicle stands on."""
    vehicle = sim.vehicle
    if vehicle.load is None:
        return
    px, py, height = vehicle.load.center_of_gravity
    v = sim.velocity(px, py)
    push = 1j * sim.omega * v
    if sim.has_accelerations:
        push = push + (sim.velocity_later(px, py) - v) / sim.moment
    # Gravity and inertia together meet the ground here, seen from below the centre.
    point = -push * height * vehicle.load.tipping_factor / GRAVITY
    steered = [w for w in vehicle.wheels if isinstance(w, SteeredWheel)]
    beside = max((abs(w.offset) for w in steered), default=0.0)
    corners = hull([complex(w.x - px, w.y - py) for w in vehicle.wheels])
    for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
        outward = -1j * (b - a) / abs(b - a)
        reach = (point * outward.conjugate()).real
        room = (a * outward.conjugate()).real - beside
        yield use("TIPPING", None, reach, room, sim.t)


def hull(points: list[complex]) -> list[complex]:
    """Corners of the convex hull, counter-clockwise: lower chain, then upper chain."""
    ordered = sorted(set(points), key=lambda p: (p.real, p.imag))
    corners: list[complex] = []
    for way in (ordered, ordered[::-1]):
        chain: list[complex] = []
        for p in way:
            while len(chain) > 1:
                one, two = chain[-1] - chain[-2], p - chain[-1]
                if (one.conjugate() * two).imag > 1e-12:
                    break
                chain.pop()
            chain.append(p)
        corners += chain[:-1]
    return corners


# --- a piece between standstills, in one representation


def piece_uses(sim: Simulation, piece: Piece, sign: int) -> Iterator[Use]:
    """Limits of how a piece is driven: with v_s > 0 or < 0."""
    vehicle, rows = sim.vehicle, piece.rows
    t = sim.t[rows]
    reverse = vehicle.limits.max_reverse_speed
    if sign < 0 and reverse is not None and constant_beta(vehicle) is None:
        yield use("REVERSE_SPEED", None, sim.speed[rows], reverse, t)
    for i, wheel in enumerate(vehicle.wheels):
        if not isinstance(wheel, SteerableWheel):
            continue
        alpha = sim.steering(i, sign, piece)
        if wheel.steering_range_deg is not None:
            off, half = off_middle(wheel, alpha)
            yield use("STEER_RANGE", wheel.id, off, half, t)
        yield from steering_uses(sim, i, wheel, piece, alpha, sign)
        if wheel.max_speed is None:
            continue
        shared = wheel.steering_coupling * np.abs(sim.turning(i))
        for offset in offsets_of(wheel):
            if offset or wheel.steering_coupling:
                speed = np.abs(sim.contact_speed(i, offset, sign)) + shared
                yield use("WHEEL_SPEED", wheel.id, speed[rows], wheel.max_speed, t)


def off_middle(wheel: SteerableWheel, alpha: FloatArray) -> tuple[FloatArray, float]:
    """How far an angle is from the middle of its range, with the best number of turns.

    The turns are those with which the angle's own middle is nearest.
    """
    assert wheel.steering_range_deg is not None
    low, high = (math.radians(x) for x in wheel.steering_range_deg)
    middle = (float(alpha.min()) + float(alpha.max())) / 2
    turns = round(((low + high) / 2 - middle) / (2 * math.pi))
    return np.abs(alpha + 2 * math.pi * turns - (low + high) / 2), (high - low) / 2


def steering_uses(
    sim: Simulation,
    i: int,
    wheel: SteerableWheel,
    piece: Piece,
    alpha: FloatArray,
    sign: int,
) -> Iterator[Use]:
    """Steering rate, its change, what that asks of motors, and guaranteed rates."""
    rows, t = piece.rows, sim.t[piece.rows]
    if wheel.max_steering_rate_deg is not None:
        limit = math.radians(wheel.max_steering_rate_deg)
        yield use("STEER_RATE", wheel.id, np.abs(sim.turning(i))[rows], limit, t)
        if len(t) > 1:
            mean = np.abs(np.diff(alpha)) / np.diff(t)
            yield use("STEER_RATE", wheel.id, mean, limit, t[:-1])
    if wheel.max_steering_acceleration_deg is not None and sim.ahead is not None:
        limit = math.radians(wheel.max_steering_acceleration_deg)
        yield use("STEER_ACCELERATION", wheel.id, sim.swinging(i)[rows], limit, t)
    if (
        wheel.max_acceleration is not None
        and is_beside(wheel)
        and sim.ahead is not None
    ):
        shared = wheel.steering_coupling * sim.swinging(i)[rows]
        for offset in offsets_of(wheel):
            gain = sim.contact_gain(i, offset, sign)[rows] + shared
            yield use("WHEEL_ACCELERATION", wheel.id, gain, wheel.max_acceleration, t)
    if sim.vehicle.guaranteed and rate_at_rest(wheel) < math.inf:
        asked, limit = guaranteed_rate(sim, i)[rows], rate_at_rest(wheel)
        yield use("SINGULAR_ZONE", wheel.id, asked, limit, t)


def guaranteed_rate(sim: Simulation, i: int) -> FloatArray:
    """Steering rate that the guaranteed rates of κ_n and β ask of wheel i.

    Derivatives of the angle by differences of fourth order on the branch that holds.
    """
    assert sim.vehicle.guaranteed is not None
    with np.errstate(divide="ignore", invalid="ignore"):
        c = sim.speed / sim.v_s
        s = sim.omega / sim.kappa_g / sim.v_s
    v = sim.velocity(*sim.reference)
    beta = np.angle(v)
    arm = complex(*sim.places[i]) - complex(*sim.reference)
    gentle, side = sim.speed > np.abs(sim.omega) / sim.kappa_g, np.sign(s)

    def direction(by_kappa: FloatArray, by_beta: FloatArray) -> ComplexArray:
        cc = np.where(gentle, 1.0, c - side * by_kappa)
        ss = np.where(gentle, s + by_kappa, side)
        turn = np.exp(1j * (beta + by_beta))
        return np.asarray(cc * turn + 1j * ss * sim.kappa_g * arm)

    none = np.zeros_like(c)
    z = direction(none, none)
    h = 1e-3 * np.abs(z) / max(1.0, sim.kappa_g * abs(arm))
    total = np.zeros_like(c)
    guaranteed = sim.vehicle.guaranteed
    for is_kappa, rate in (
        (1.0, guaranteed.kappa_rate),
        (0.0, math.radians(guaranteed.beta_rate_deg)),
    ):
        apart = [
            np.angle(
                direction(n * h * is_kappa, n * h * (1 - is_kappa))
                * direction(-n * h * is_kappa, -n * h * (1 - is_kappa)).conj()
            )
            for n in (1, 2)
        ]
        total += rate * np.abs((8 * apart[0] - apart[1]) / (12 * h))
    # Turning on the spot is one configuration, to be left in any direction β.
    on_the_spot = guaranteed.kappa_rate / max(sim.kappa_g * abs(arm), 1e-300)
    return np.where(c < 1e-9, on_the_spot, total)


# --- the motion as a whole


def signs_of(vehicle: Vehicle) -> tuple[int, ...]:
    """Representations to choose from; without steering they are one."""
    steers = any(isinstance(w, SteerableWheel) for w in vehicle.wheels)
    return (1, -1) if steers else (1,)


def uses(sim: Simulation, given: Sequence[int] | None = None) -> list[Use]:
    """How far all limits are used in the best choice of representations.

    Unless those of the pieces are given. With a broken ``RECONFIGURATION`` if the
    wheels cannot get from piece to piece.
    """
    options_of = [signs_of(sim.vehicle)] * len(sim.pieces)
    if given is not None:
        options_of = [(sign,) for sign in given]
    found = [
        {sign: list(piece_uses(sim, piece, sign)) for sign in signs}
        for piece, signs in zip(sim.pieces, options_of, strict=True)
    ]
    choices = list(
        itertools.product(
            *(
                [s for s in options if not any(x.is_broken for x in options[s])]
                or list(options)
                for options in found
            )
        )
    )
    fitting = [choice for choice in choices if can_follow(sim, choice)]
    out = list(whole_uses(sim))
    for options, sign in zip(found, (fitting or choices)[0], strict=True):
        out += options[sign]
    if not fitting:
        out.append(Use("RECONFIGURATION", None, math.inf, 1.0, float(sim.t[0])))
    return out


def breaches(sim: Simulation) -> list[Use]:
    """Every broken limit."""
    return [one for one in uses(sim) if one.is_broken]


def can_follow(sim: Simulation, signs: tuple[int, ...]) -> bool:
    """Whether every wheel gets from piece to piece in the time there is."""
    return all(
        can_wheel_follow(sim, i, wheel, signs)
        for i, wheel in enumerate(sim.vehicle.wheels)
        if isinstance(wheel, SteerableWheel)
    )


def can_wheel_follow(
    sim: Simulation, i: int, wheel: SteerableWheel, signs: tuple[int, ...]
) -> bool:
    """Whether a wheel does, with a number of turns for each piece within its range."""
    angles = [sim.steering(i, s, p) for s, p in zip(signs, sim.pieces, strict=True)]
    turned = windings(wheel, angles[0]) if angles else [0]
    for (one, before), (two, after) in itertools.pairwise(
        zip(sim.pieces, angles, strict=True)
    ):
        reach = turn_within(wheel, float(sim.t[two.first] - sim.t[one.last]))
        reach = max(reach * (1 + 1e-6), ALIGNMENT) + 1e-3
        apart = float(after[0] - before[-1])
        if wheel.steering_range_deg is None:
            if abs(math.remainder(apart, 2 * math.pi)) > reach:
                return False
            continue
        turned = [
            k
            for k in windings(wheel, after)
            if any(abs(apart + 2 * math.pi * (k - j)) <= reach for j in turned)
        ]
        if not turned:
            return False
    return True


def windings(wheel: SteerableWheel, alpha: FloatArray) -> list[int]:
    """Full turns that, added to an angle, keep it within the range."""
    if wheel.steering_range_deg is None:
        return [0]
    low, high = (math.radians(x) for x in wheel.steering_range_deg)
    first = math.ceil((low - ABSOLUTE - float(alpha.min())) / (2 * math.pi))
    last = math.floor((high + ABSOLUTE - float(alpha.max())) / (2 * math.pi))
    return list(range(first, last + 1))


def turn_within(wheel: SteerableWheel, rest: float) -> float:
    """Furthest turn from rest to rest in a time: the area below a trapezoid."""
    rate = rate_at_rest(wheel)
    if wheel.max_steering_acceleration_deg is None:
        return rate * rest
    gain = math.radians(wheel.max_steering_acceleration_deg)
    peak = min(rate, gain * rest / 2)
    return peak * (rest - peak / gain)


def rate_at_rest(wheel: SteerableWheel) -> float:
    """Fastest steering at rest: wheels beside the axis roll, motors are shared."""
    rate = math.inf
    if wheel.max_steering_rate_deg is not None:
        rate = math.radians(wheel.max_steering_rate_deg)
    taken = max(abs(x) for x in offsets_of(wheel)) + wheel.steering_coupling
    if wheel.max_speed is not None and taken > 0:
        rate = min(rate, wheel.max_speed / taken)
    return rate
