"""A plain simulation of planar motions, to hold verdicts against.

Nothing of `omniplan` is used: motions are sampled finely, angles are followed step by
step, accelerations and steering rates are differences of neighbouring samples. A
difference never exceeds the largest derivative, so a motion that keeps its limits
keeps them here as well.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import naive
import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from configspace.vehicle import Castor, FixedWheel, SteeredWheel, Vehicle

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
TwistAt = Callable[[FloatArray], FloatArray]
"""From times (n,) to body twists (n, 3) of the origin of the vehicle file's frame."""

STANDSTILL = 1e-3  # m/s, the documented tolerances
SLIP_ANGLE = math.radians(1.0)
SLIP_SPEED = 5e-3
ALIGNMENT = math.radians(1.0)


# --- motions


def twist_motion(t: FloatArray, twists: FloatArray, x: float, y: float) -> TwistAt:
    """Twists of the point (x, y), linear in time."""

    def at(when: FloatArray) -> FloatArray:
        vx, vy, omega = (np.interp(when, t, column) for column in twists.T)
        return np.stack([vx + omega * y, vy - omega * x, omega], axis=-1)

    return at


def pose_motion(t: FloatArray, poses: FloatArray, x: float, y: float) -> TwistAt:
    """Splines through poses of the point (x, y), as `Trajectory` documents them."""
    stop = _stops(t, poses)
    ends = sorted({0, len(t) - 1, *np.flatnonzero(stop).tolist()})
    splines = [
        (t[a], t[b], _spline(t[a : b + 1], poses[a : b + 1], stop[a], stop[b]))
        for a, b in itertools.pairwise(ends)
    ]

    def at(when: FloatArray) -> FloatArray:
        out = np.zeros((len(when), 3))
        for start, end, spline in splines:
            here = (when >= start) & (when <= end)
            _, _, theta = spline(when[here]).T
            dx, dy, omega = spline(when[here], 1).T
            vx = np.cos(theta) * dx + np.sin(theta) * dy
            vy = -np.sin(theta) * dx + np.cos(theta) * dy
            out[here] = np.stack([vx + omega * y, vy - omega * x, omega], axis=-1)
        return out

    return at


def _stops(t: FloatArray, poses: FloatArray) -> BoolArray:
    """Corners of more than 60° (1 rad counts 0.5 m), dwells, starts from rest."""
    steps = np.diff(poses, axis=0) * [1, 1, 0.5]
    stop = np.zeros(len(t), dtype=bool)
    for i in range(len(steps)):
        if np.linalg.norm(steps[i]) < 1e-9:
            stop[i] = stop[i + 1] = True
    for i in range(1, len(steps)):
        sizes = np.linalg.norm(steps[i - 1]) * np.linalg.norm(steps[i])
        if sizes > 0 and steps[i - 1] @ steps[i] < 0.5 * sizes:
            stop[i] = True
    if len(t) > 2:
        for end, one, two in ((0, 1, 2), (-1, -2, -3)):
            first = steps[0 if end == 0 else -1] / abs(t[one] - t[end])
            second = steps[1 if end == 0 else -2] / abs(t[two] - t[one])
            share = (t[one] - t[end]) / (t[two] - t[end])
            speed = first - share * (second - first)
            stop[end] |= speed @ first < 0.25 * (first @ first)
    return stop


def _spline(t: FloatArray, poses: FloatArray, rest0: bool, rest1: bool) -> CubicSpline:
    free: Any = "not-a-knot" if len(t) > 3 else (2, np.zeros(3))
    rest: Any = (1, np.zeros(3))
    ends = (rest if rest0 else free, rest if rest1 else free)
    return CubicSpline(t, poses, bc_type=ends)


def instants(t: FloatArray, per_interval: int) -> FloatArray:
    """Times with `per_interval` steps between any two knots, knots included."""
    fine = [
        np.linspace(a, b, per_interval, endpoint=False)
        for a, b in itertools.pairwise(t)
    ]
    return np.concatenate([*fine, t[-1:]])


# --- limits


@dataclass(frozen=True)
class Breach:
    """A limit that is broken in the simulation."""

    limit: str
    wheel: str | None
    value: float
    bound: float
    t: float


@dataclass(frozen=True)
class Piece:
    """A stretch between two standstills: rows first to last of the samples."""

    first: int
    last: int


class Simulation:
    """One motion of one vehicle, sampled."""

    def __init__(self, vehicle: Vehicle, t: FloatArray, twists: FloatArray) -> None:
        self.vehicle, self.t = vehicle, t
        self.vx, self.vy, self.omega = twists.T
        kx, ky = naive.reference(vehicle)
        self.kx, self.ky = self.vx - self.omega * ky, self.vy + self.omega * kx
        self.speed = np.hypot(self.kx, self.ky)
        self.v_s = np.maximum(self.speed, np.abs(self.omega) / naive.kappa_g(vehicle))
        self.moves = self.v_s > STANDSTILL * (1 + 1e-6)
        self.pieces = self._pieces()

    def _pieces(self) -> list[Piece]:
        pieces, first = [], None
        for i, moves in enumerate([*self.moves.tolist(), False]):
            if moves and first is None:
                first = i
            elif not moves and first is not None:
                pieces.append(Piece(first, i - 1))
                first = None
        return pieces

    def wheel_velocity(self, i: int) -> tuple[FloatArray, FloatArray]:
        """Velocity of the contact point of wheel i in the vehicle frame."""
        wheel = self.vehicle.wheels[i]
        return self.vx - self.omega * wheel.y, self.vy + self.omega * wheel.x

    def rolling(self, i: int) -> FloatArray:
        """Rolling speed of wheel i; of a steered wheel its amount."""
        wheel = self.vehicle.wheels[i]
        assert not isinstance(wheel, Castor)
        ux, uy = self.wheel_velocity(i)
        if isinstance(wheel, SteeredWheel):
            return np.hypot(ux, uy)
        delta = math.radians(getattr(wheel, "heading_deg", 0.0))
        gamma = math.radians(getattr(wheel, "roller_deg", 0.0))
        along = ux * math.cos(delta + gamma) + uy * math.sin(delta + gamma)
        return along / math.cos(gamma)

    def steering(self, i: int, sign: int, piece: Piece) -> FloatArray:
        """Steering angle of wheel i over a piece, followed from its start."""
        rows = slice(piece.first, piece.last + 1)
        ux, uy = self.wheel_velocity(i)
        return np.unwrap(np.arctan2(sign * uy[rows], sign * ux[rows]))

    def is_clear(self) -> bool:
        """Whether no wheel passes so near the ICR that an angle cannot be followed."""
        for i, wheel in enumerate(self.vehicle.wheels):
            if isinstance(wheel, SteeredWheel):
                for piece in self.pieces:
                    steps = np.abs(np.diff(self.steering(i, 1, piece)))
                    if steps.max(initial=0.0) > 1.5:
                        return False
        return True

    def breaches(self) -> list[Breach]:
        """Every broken limit that does not depend on the configuration."""
        found: list[Breach] = []
        dt = np.diff(self.t)
        mid = self.t[:-1]

        def hold(
            limit: str,
            wheel: str | None,
            value: FloatArray,
            bound: float | FloatArray | None,
            when: FloatArray,
        ) -> None:
            if bound is None or not value.size:
                return
            bound = np.broadcast_to(bound, value.shape)
            i = int(np.argmax(value / bound))
            if value[i] > bound[i] * (1 + 1e-6) + 1e-9:
                found.append(
                    Breach(
                        limit, wheel, float(value[i]), float(bound[i]), float(when[i])
                    )
                )

        for i, wheel in enumerate(self.vehicle.wheels):
            if isinstance(wheel, Castor):
                continue
            u = self.rolling(i)
            hold("WHEEL_SPEED", wheel.id, np.abs(u), wheel.max_speed, self.t)
            gain = np.abs(np.diff(u)) / dt
            hold("WHEEL_ACCELERATION", wheel.id, gain, wheel.max_acceleration, mid)
            if isinstance(wheel, FixedWheel):
                ux, uy = self.wheel_velocity(i)
                delta = math.radians(wheel.heading_deg)
                aside = np.abs(uy * math.cos(delta) - ux * math.sin(delta))
                allowed = np.maximum(math.sin(SLIP_ANGLE) * self.v_s, SLIP_SPEED)
                hold("FIXED_WHEEL", wheel.id, aside, allowed, self.t)
            if isinstance(wheel, SteeredWheel) and wheel.max_steering_rate_deg:
                limit = math.radians(wheel.max_steering_rate_deg)
                for piece in self.pieces:
                    rows = slice(piece.first, piece.last)
                    turn = np.abs(np.diff(self.steering(i, 1, piece)))
                    hold("STEER_RATE", wheel.id, turn / dt[rows], limit, mid[rows])
        limits = self.vehicle.limits
        hold("SPEED", None, self.speed, limits.max_speed, self.t)
        if limits.max_yaw_rate_deg is not None:
            bound = math.radians(limits.max_yaw_rate_deg)
            hold("YAW_RATE", None, np.abs(self.omega), bound, self.t)
        sideways = np.abs(self.omega) * self.speed
        name = "LATERAL_ACCELERATION"
        hold(name, None, sideways, limits.max_lateral_acceleration, self.t)
        gain = np.diff(self.speed) / dt
        hold("ACCELERATION", None, gain, limits.max_acceleration, mid)
        hold("DECELERATION", None, -gain, limits.max_deceleration, mid)
        line = naive.constant_beta(self.vehicle)
        if line is not None and limits.max_reverse_speed is not None:
            ahead = self.kx * math.cos(line) + self.ky * math.sin(line)
            back = np.where(ahead < -STANDSTILL * (1 + 1e-6), self.speed, 0.0)
            hold("REVERSE_SPEED", None, back, limits.max_reverse_speed, self.t)
        return found

    def is_possible(self, piece: Piece, sign: int) -> bool:
        """Whether a piece can be driven in one representation."""
        vehicle = self.vehicle
        reverse = vehicle.limits.max_reverse_speed
        if sign < 0 and reverse is not None and naive.constant_beta(vehicle) is None:
            rows = slice(piece.first, piece.last + 1)
            if self.speed[rows].max() > reverse * (1 + 1e-6):
                return False
        for i, wheel in enumerate(vehicle.wheels):
            if isinstance(wheel, SteeredWheel) and wheel.steering_range_deg is not None:
                least, largest = map(math.radians, wheel.steering_range_deg)
                alpha = self.steering(i, sign, piece)
                turns = range(-5, 6)
                if not any(
                    alpha.min() + 2 * math.pi * k >= least - 1e-9
                    and alpha.max() + 2 * math.pi * k <= largest + 1e-9
                    for k in turns
                ):
                    return False
        return True

    def can_turn(self, before: tuple[Piece, int], after: tuple[Piece, int]) -> bool:
        """Whether the wheels can turn in time from the end of a piece to the next."""
        (one, sign_one), (two, sign_two) = before, after
        there_is = self.t[two.first] - self.t[one.last]
        for i, wheel in enumerate(self.vehicle.wheels):
            if not isinstance(wheel, SteeredWheel) or not wheel.max_steering_rate_deg:
                continue
            a = float(self.steering(i, sign_one, one)[-1])
            b = float(self.steering(i, sign_two, two)[0])
            turn = abs(math.remainder(b - a, 2 * math.pi))
            rate = math.radians(wheel.max_steering_rate_deg)
            if turn - ALIGNMENT > rate * there_is * (1 + 1e-6) + 1e-3:
                return False
        return True

    def is_drivable(self) -> bool:
        """Whether some choice of representations keeps the steering ranges."""
        signs = [
            [sign for sign in (1, -1) if self.is_possible(piece, sign)]
            for piece in self.pieces
        ]
        return any(
            all(
                self.can_turn((self.pieces[i], a), (self.pieces[i + 1], b))
                for i, (a, b) in enumerate(itertools.pairwise(choice))
            )
            for choice in itertools.product(*signs)
        )


def simulate(
    vehicle: Vehicle, t: FloatArray, twist_at: TwistAt, per_interval: int = 60
) -> Simulation:
    """Sample a motion with knots `t` finely."""
    when = instants(t, per_interval)
    return Simulation(vehicle, when, twist_at(when))
