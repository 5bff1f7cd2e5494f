"""Permitted speeds by the rigid-body formula ``v + ω x w``: the twin of spaces.

Written apart from `configspace.limits` and `configspace.exact` on purpose.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from configspace.vehicle import (
    Castor,
    FixedWheel,
    MecanumWheel,
    OmniWheel,
    SteerableWheel,
    Vehicle,
)

__all__ = ["RigidBody", "rigid_body"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

_SPARE_ROUNDING = 1e-12
_GRAVITY = 9.81


@dataclass(frozen=True)
class RigidBody:
    """What ``v + ω x w`` says of configurations, wheel by wheel in real numbers."""

    v_max: FloatArray
    """(...,) m/s, the fastest permitted |v_s| if steering is left aside."""
    margin: FloatArray
    """(...,) rad, the least room to a steering stop; negative where blocked."""
    stillness: FloatArray
    """(...,) the least speed of a steered wheel per v_s; 0 at a singular point."""
    spare: FloatArray
    """(...,) the least |u|² less what the guaranteed rates need of it, per v_s²;
    negative in the singular zone."""

    @property
    def permitted(self) -> FloatArray:
        """(...,) m/s, v_max or 0 where blocked."""
        open_ = (self.margin >= 0) & (self.stillness > 1e-12) & (self.spare >= 0)
        return np.where(open_, self.v_max, 0.0)

    @property
    def slack(self) -> FloatArray:
        """(...,) rad, rounding: an angle is as exact as the wheel's speed."""
        return 4e-15 / np.maximum(self.stillness, 1e-15) + 3e-14

    @property
    def is_blocked(self) -> BoolArray:
        """(...,) whether blocked by more than rounding."""
        return np.asarray(
            (self.margin < -self.slack)
            | (self.stillness < 1e-13)
            | (self.spare < -_SPARE_ROUNDING)
        )

    @property
    def is_open(self) -> BoolArray:
        """(...,) whether permitted by more than rounding."""
        return np.asarray(
            (self.margin > self.slack)
            & (self.stillness > 1e-9)
            & (self.spare > _SPARE_ROUNDING)
        )

    def is_clear(self, room: float = 1e-9) -> BoolArray:
        """(...,) whether permitted or blocked by more than rounding."""
        fine = np.minimum(self.stillness, 1.0) * np.minimum(np.abs(self.margin), 1.0)
        fine = np.minimum(fine, np.abs(self.spare))
        return np.asarray((fine > room) & (self.stillness > room))


def rigid_body(
    vehicle: Vehicle,
    kappa_n: npt.ArrayLike,
    beta: npt.ArrayLike,
    *,
    reverse: bool = False,
) -> RigidBody:
    """Return permitted speeds by the rigid-body formula, without cells or tables.

    Written apart from `configspace.limits` and `configspace.exact` on purpose. The
    wheels do not turn about their steering axes: α̇ = 0.

    Parameters
    ----------
    vehicle : Vehicle
    kappa_n : (...,) float, 1, [-2, 2]
    beta : (...,) float, rad
    reverse : bool
        For v_n < 0.
    """
    kappa_n, beta = np.broadcast_arrays(
        np.asarray(kappa_n, np.float64), np.asarray(beta, np.float64)
    )
    line = vehicle.mobility.line_beta
    if line is not None:  # on the spot β means nothing; the line is the way to leave
        beta = np.where(np.abs(kappa_n) == 2, line, beta)
    gentle = np.abs(kappa_n) < 1
    v = np.where(gentle, 1.0, 2 - np.abs(kappa_n))
    omega = vehicle.boundary_curvature * np.where(
        gentle, kappa_n, np.copysign(1.0, kappa_n)
    )
    vx, vy = v * np.cos(beta), v * np.sin(beta)
    slowest = np.full(kappa_n.shape, np.inf)
    margin = np.full(kappa_n.shape, np.inf)
    stillness = np.full(kappa_n.shape, np.inf)
    spare = np.full(kappa_n.shape, np.inf)
    k = vehicle.reference
    with np.errstate(divide="ignore", over="ignore"):
        for wheel in vehicle.wheels:
            if isinstance(wheel, Castor):
                continue
            x, y = _ground_point(vehicle, wheel)
            ux, uy = vx - omega * (y - k.imag), vy + omega * (x - k.real)
            if isinstance(wheel, SteerableWheel):
                u = np.hypot(ux, uy)
                stillness = np.minimum(stillness, u)
                margin = np.minimum(margin, _room(wheel, np.arctan2(uy, ux)))
                need = _needed(vehicle, wheel, kappa_n, beta, (ux, uy))
                spare = np.minimum(spare, u**2 - need if need is not None else np.inf)
                u = np.maximum.reduce([np.abs(u - omega * d) for d in wheel.offsets])
            else:
                u = _rolling(wheel, ux, uy)
            if wheel.max_speed is not None:
                slowest = np.minimum(slowest, wheel.max_speed / np.abs(u))
        slowest = np.minimum(slowest, _body_bound(vehicle, vx, vy, omega, reverse))
    off = np.zeros(kappa_n.shape)
    if line is not None:
        off = np.abs(np.angle(np.exp(1j * (beta - line))))
    if vehicle.mobility.is_translating:
        off = np.abs(kappa_n)
    # About a nano-radian beside the line is rounding: neither clear.
    margin = np.where(off > 5e-10, np.minimum(margin, 0.0), margin)
    margin = np.where(off > 2e-9, np.minimum(margin, -off), margin)
    return RigidBody(slowest, margin, stillness, spare)


def _ground_point(
    vehicle: Vehicle, wheel: SteerableWheel | FixedWheel | MecanumWheel | OmniWheel
) -> tuple[float, float]:
    """Return where a wheel touches the ground, or its steering axis does."""
    if vehicle.skid_steer is None:
        return wheel.x, wheel.y
    # The whole side stands beside the middle, at half the effective track.
    fixed = [w for w in vehicle.wheels if isinstance(w, FixedWheel)]
    mx = sum(w.x for w in fixed) / len(fixed)
    my = sum(w.y for w in fixed) / len(fixed)
    left = (-math.sin(fixed[0].heading), math.cos(fixed[0].heading))
    is_left = (wheel.x - mx) * left[0] + (wheel.y - my) * left[1] > 0
    arm = vehicle.skid_steer.effective_track / 2 * (1 if is_left else -1)
    return mx + arm * left[0], my + arm * left[1]


def _needed(
    vehicle: Vehicle,
    wheel: SteerableWheel,
    kappa_n: FloatArray,
    beta: FloatArray,
    u: tuple[FloatArray, FloatArray],
) -> FloatArray | None:
    """Return the |u|² at which a wheel just follows the guaranteed rates.

    ``α̇ = (ux u̇y - uy u̇x) / |u|²``, the rates of κ_n and β with the worse signs. The
    velocity changes linearly with κ_n on each branch and turns with β. At κ_n = ±2 the
    motion may leave with any β, so ``Δu`` may stand across the wheel: ``|u × Δu|`` is
    at most |u|; a line-mobile vehicle leaves along its line.
    """
    steering = [
        wheel.max_steering_rate_deg and math.radians(wheel.max_steering_rate_deg)
    ]
    for offset in wheel.offsets if wheel.max_speed else ():
        # At standstill the wheel rolls by |α̇ D|, and coupled motors also pay for α̇.
        share = abs(offset) + wheel.steering_coupling
        steering.append((wheel.max_speed or 0.0) / share if share else None)
    rate = min((each for each in steering if each), default=math.inf)
    if vehicle.guaranteed is None or math.isinf(rate):
        return None
    gentle = np.abs(kappa_n) < 1
    side = np.copysign(1.0, kappa_n)
    kg, k = vehicle.boundary_curvature, vehicle.reference
    size = np.where(gentle, 1.0, 2 - np.abs(kappa_n))
    along = (np.cos(beta), np.sin(beta))
    by_kappa = (
        np.where(gentle, -kg * (wheel.y - k.imag), -side * along[0]),
        np.where(gentle, kg * (wheel.x - k.real), -side * along[1]),
    )
    by_beta = (-size * along[1], size * along[0])
    turn_kappa = np.abs(u[0] * by_kappa[1] - u[1] * by_kappa[0])
    if vehicle.mobility.line_beta is None:
        # Nearer than rounding is at the pole.
        turn_kappa = np.where(size <= 1e-12, np.hypot(*u), turn_kappa)
    turn_beta = np.abs(u[0] * by_beta[1] - u[1] * by_beta[0])
    rates = vehicle.guaranteed
    asked = turn_kappa * rates.kappa_rate
    asked = asked + turn_beta * math.radians(rates.beta_rate_deg)
    return np.asarray(asked / rate)


def _body_bound(
    vehicle: Vehicle,
    vx: FloatArray,
    vy: FloatArray,
    omega: FloatArray,
    reverse: bool,
) -> FloatArray:
    """Return the largest |v_s| by the limits of the whole vehicle."""
    limits, v = vehicle.limits, np.hypot(vx, vy)
    bound = np.full(v.shape, np.inf)
    if limits.max_speed is not None:
        bound = np.minimum(bound, limits.max_speed / v)
    if limits.max_reverse_speed is not None and reverse:
        bound = np.minimum(bound, limits.max_reverse_speed / v)
    if limits.max_yaw_rate_deg is not None:
        rate = math.radians(limits.max_yaw_rate_deg)
        bound = np.minimum(bound, rate / np.abs(omega))
    px = py = 0.0
    if vehicle.load is not None:
        px = vehicle.load.center_of_gravity[0] - vehicle.reference.real
        py = vehicle.load.center_of_gravity[1] - vehicle.reference.imag
        drift = (vx - omega * py, vy + omega * px)
        # Centripetal acceleration ω x v per v_s²; the ground pushes the other way.
        push = (omega * drift[1], -omega * drift[0])
        factor = vehicle.load.center_of_gravity[2] * vehicle.load.tipping_factor
        shift = tuple(factor / _GRAVITY * p for p in push)
        bound = np.minimum(bound, np.sqrt(_way_out(vehicle, shift)))
    if limits.max_lateral_acceleration is not None:
        if limits.lateral_acceleration_at == "center_of_gravity":
            v = np.hypot(vx - omega * py, vy + omega * px)
        sideways = limits.max_lateral_acceleration / np.abs(v * omega)
        bound = np.minimum(bound, np.sqrt(sideways))
    return np.asarray(bound)


def _way_out(vehicle: Vehicle, shift: Sequence[FloatArray]) -> FloatArray:
    """Return how often `shift` fits between centre of gravity and polygon's edge."""
    assert vehicle.load is not None
    px, py, _ = vehicle.load.center_of_gravity
    corners = _hull([(w.x, w.y) for w in vehicle.wheels])
    times = np.full(shift[0].shape, np.inf)
    for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
        ex, ey = bx - ax, by - ay
        # Inside is left of the edge; the area shrinks by `closing` with every shift.
        area = ex * (py - ay) - ey * (px - ax)
        closing = ey * shift[0] - ex * shift[1]
        leaves = closing > 0
        time = area / np.where(leaves, closing, 1.0)
        times = np.where(leaves, np.minimum(times, time), times)
    return times


def _hull(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the corners of the convex hull, counter-clockwise, by gift wrapping."""
    start = here = min(points)
    corners: list[tuple[float, float]] = []
    while not corners or here != start:
        corners.append(here)
        there = here
        for p in points:
            ax, ay = there[0] - here[0], there[1] - here[1]
            bx, by = p[0] - here[0], p[1] - here[1]
            turn = ax * by - ay * bx
            farther = math.hypot(bx, by) > math.hypot(ax, ay)
            if turn < 0 or (turn == 0 and farther):
                there = p
        here = there
    return corners


def _rolling(
    wheel: FixedWheel | MecanumWheel | OmniWheel, ux: FloatArray, uy: FloatArray
) -> FloatArray:
    """Return the rolling speed of a wheel that does not steer."""
    gamma = 0.0 if isinstance(wheel, FixedWheel) else wheel.roller
    angle = wheel.heading + gamma
    return np.asarray((ux * math.cos(angle) + uy * math.sin(angle)) / math.cos(gamma))


def _room(wheel: SteerableWheel, alpha: FloatArray) -> FloatArray:
    """Return how far α is within the steering range, negative outside, rad."""
    least, largest = wheel.steering_range
    if largest - least >= 2 * math.pi:
        return np.full(alpha.shape, np.inf)
    width = largest - least
    past = np.mod(alpha - least, 2 * math.pi)
    inside = np.minimum(past, width - past)
    outside = -np.minimum(past - width, 2 * math.pi - past)
    return np.where(past <= width, inside, outside)
