"""Slow, plain twins of the vectorised routines, written from the paper's cases.

Nothing here uses the complex form, `configspace.limits` or `configspace.exact`: a
mistake would have to be made twice to stay hidden. Scalars are plain floats.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from configspace.vehicle import (
    Castor,
    FixedWheel,
    MecanumWheel,
    OmniWheel,
    SteeredWheel,
    Vehicle,
)

FloatArray = npt.NDArray[np.float64]


def sgn(x: float) -> float:
    """Sign without a zero (section 2.4, last but one equation)."""
    return 1.0 if x >= 0 else -1.0


# --- section 2.4 and 3.1: from Omni-Curve-Parameters to the twist and back


def twist(
    kappa_n: float, beta: float, v_s: float, kappa_g: float
) -> tuple[float, float, float]:
    """(vx, vy, ω) by the two cases of section 2.4."""
    if abs(kappa_n) < 1:
        v = v_s
        omega = v_s * kappa_g * kappa_n
    else:
        v = v_s * (2 - abs(kappa_n))
        omega = v_s * kappa_g * sgn(kappa_n)
    return v * math.cos(beta), v * math.sin(beta), omega


def from_twist(
    vx: float, vy: float, omega: float, kappa_g: float, sign: int
) -> tuple[float, float, float]:
    """(κ_n, β, v_s) by inverting the cases of section 2.4."""
    vx, vy, omega = sign * vx, sign * vy, sign * omega
    v = math.hypot(vx, vy)
    beta = math.atan2(vy, vx) if v > 0 else 0.0
    if v == 0 and omega == 0:
        return 0.0, 0.0, 0.0
    if abs(omega) < kappa_g * v:  # |κ| < κ_g: a gentle curve
        return omega / v / kappa_g, beta, sign * v
    radius = v / abs(omega)
    kappa_n = sgn(omega) * (2 - radius * kappa_g)
    return kappa_n, beta, sign * abs(omega) / kappa_g


# --- section 3.2 and the reference point


def reference(vehicle: Vehicle) -> tuple[float, float]:
    """K: as the file says, or its foot on the axle line of the fixed wheels."""
    kx, ky = vehicle.reference_point or (0.0, 0.0)
    for wheel in vehicle.wheels:
        if isinstance(wheel, FixedWheel):
            heading = math.radians(wheel.heading_deg)
            # Move K along the rolling direction until it is beside the wheel.
            ahead = (wheel.x - kx) * math.cos(heading)
            ahead += (wheel.y - ky) * math.sin(heading)
            return kx + ahead * math.cos(heading), ky + ahead * math.sin(heading)
    return kx, ky


def constant_beta(vehicle: Vehicle) -> float | None:
    """β of a line-mobile vehicle: the rolling direction that points forward."""
    for wheel in vehicle.wheels:
        if isinstance(wheel, FixedWheel):
            heading = math.radians(wheel.heading_deg)
            if math.cos(heading) < -1e-9:
                heading += math.pi
            return math.atan2(math.sin(heading), math.cos(heading))
    return None


def kappa_g(vehicle: Vehicle) -> float:
    """Section 3.2: one over the distance of the wheel with most |w_i| / u_lim,i."""
    if vehicle.kappa_g is not None:
        return vehicle.kappa_g
    kx, ky = reference(vehicle)
    rollers = any(isinstance(w, MecanumWheel | OmniWheel) for w in vehicle.wheels)
    best, distance = -1.0, 0.0
    for wheel in vehicle.wheels:
        if isinstance(wheel, Castor):
            continue
        r = math.hypot(wheel.x - kx, wheel.y - ky)
        if rollers:
            quotient = r
        elif wheel.max_speed is None:
            continue
        else:
            quotient = r / wheel.max_speed
        if quotient > best:
            best, distance = quotient, r
    if distance == 0:  # no driven wheel apart from K: any other that rolls
        distance = max(
            math.hypot(w.x - kx, w.y - ky)
            for w in vehicle.wheels
            if not isinstance(w, Castor)
        )
    return 1 / distance


# --- section 3.3: steered wheels, with the paper's auxiliary terms


def steered_wheel(
    kappa_n: float, beta: float, v_s: float, kg: float, x: float, y: float
) -> tuple[float, float]:
    """(α_i, u_i) of section 3.3, case by case; α_i is not reduced to one turn."""
    f = x * math.sin(beta) + y * -math.cos(beta)
    s = sgn(kappa_n) * sgn(x * math.cos(beta) + y * math.sin(beta))
    ww = x * x + y * y
    if abs(kappa_n) < 1:
        kappa = kappa_n * kg
        root = math.sqrt(max(0.0, 1 + kappa * kappa * ww + 2 * kappa * f))
        u = v_s * root
        cosine = (1 + kappa * f) / root if root > 0 else 1.0
    else:
        radius = (2 * sgn(kappa_n) - kappa_n) / kg
        root = math.sqrt(max(0.0, radius * radius + ww + 2 * radius * f))
        u = v_s * kg * root
        cosine = (abs(radius) + sgn(kappa_n) * f) / root if root > 0 else 1.0
    return beta + s * math.acos(min(1.0, max(-1.0, cosine))), u


def differential(
    kappa_n: float, v_s: float, kg: float, track: float
) -> tuple[float, float]:
    """Section 3.5 before κ_g = 2/b is put in: u_1 (left) and u_2 (right)."""
    half = track / 2
    if abs(kappa_n) < 1:
        v, w = v_s, kappa_n * kg * v_s
    else:
        v, w = v_s * (2 - abs(kappa_n)), kg * v_s * sgn(kappa_n)
    return v - w * half, v + w * half


def differential_closed(kappa_n: float, v_s: float) -> tuple[float, float]:
    """Section 3.5 with κ_g = 2/b; the second case as corrected in the spec, §6."""
    if abs(kappa_n) < 1:
        return v_s * (1 - kappa_n), v_s * (1 + kappa_n)
    return (
        v_s * (2 - abs(kappa_n) - sgn(kappa_n)),
        v_s * (2 - abs(kappa_n) + sgn(kappa_n)),
    )


def single_track(kappa_n: float, v_s: float) -> tuple[float, float, float]:
    """Section 3.6 with κ_g = 1/a: u_1 (steered), u_2 (fixed) and α_1."""
    if abs(kappa_n) < 1:
        return v_s * math.sqrt(1 + kappa_n**2), v_s, math.atan(kappa_n)
    u_1 = v_s * math.sqrt(kappa_n**2 - 4 * abs(kappa_n) + 5)
    u_2 = v_s * abs(2 * sgn(kappa_n) - kappa_n)
    rest = 2 * sgn(kappa_n) - kappa_n
    alpha = sgn(kappa_n) * math.acos(abs(rest) / math.sqrt(rest**2 + 1))
    return u_1, u_2, alpha


# --- rigid body: v + ω x w, in real numbers


@dataclass(frozen=True)
class Answer:
    """What the exact formula says of one configuration."""

    v_max: float
    """Fastest |v_s| if steering is left aside, m/s."""
    margin: float
    """Room to the nearest steering stop or to being off the line, rad; < 0 blocked."""
    stillness: float
    """Least speed of a steered wheel per v_s; 0 at a singular point."""

    @property
    def permitted(self) -> float:
        """v_max, or 0 where blocked."""
        return self.v_max if self.margin >= 0 and self.stillness > 1e-12 else 0.0


def exact(
    vehicle: Vehicle, kappa_n: float, beta: float, *, reverse: bool = False
) -> Answer:
    """Return the permitted speed by the rigid-body formula, wheel by wheel."""
    kg = kappa_g(vehicle)
    kx, ky = reference(vehicle)
    vx, vy, omega = twist(kappa_n, beta, 1.0, kg)
    bound, margin, stillness = math.inf, math.inf, math.inf
    line = constant_beta(vehicle)
    if line is not None and abs(kappa_n) != 2:
        off = abs(math.remainder(beta - line, 2 * math.pi))
        margin = min(margin, 2e-9 - off)
    for wheel in vehicle.wheels:
        if isinstance(wheel, Castor):
            continue
        ux = vx - omega * (wheel.y - ky)
        uy = vy + omega * (wheel.x - kx)
        u = rolling(wheel, ux, uy)
        if wheel.max_speed is not None and u != 0:
            bound = min(bound, wheel.max_speed / abs(u))
        if isinstance(wheel, SteeredWheel):
            stillness = min(stillness, math.hypot(ux, uy))
            if wheel.steering_range_deg is not None:
                margin = min(margin, room(wheel, math.atan2(uy, ux)))
    limits = vehicle.limits
    v = math.hypot(vx, vy)
    if limits.max_speed is not None and v > 0:
        bound = min(bound, limits.max_speed / v)
    if reverse and limits.max_reverse_speed is not None and v > 0:
        bound = min(bound, limits.max_reverse_speed / v)
    if limits.max_yaw_rate_deg is not None and omega != 0:
        bound = min(bound, math.radians(limits.max_yaw_rate_deg) / abs(omega))
    if limits.max_lateral_acceleration is not None and v * omega != 0:
        bound = min(bound, math.sqrt(limits.max_lateral_acceleration / abs(v * omega)))
    return Answer(bound, margin, stillness)


def rolling(
    wheel: SteeredWheel | FixedWheel | MecanumWheel | OmniWheel, ux: float, uy: float
) -> float:
    """Rolling speed of a wheel whose contact point moves with (ux, uy)."""
    match wheel:
        case SteeredWheel():
            return math.hypot(ux, uy)
        case FixedWheel() | OmniWheel():
            delta = math.radians(wheel.heading_deg)
            return ux * math.cos(delta) + uy * math.sin(delta)
        case MecanumWheel():
            delta = math.radians(wheel.heading_deg)
            gamma = math.radians(wheel.roller_deg)
            along = ux * math.cos(delta + gamma) + uy * math.sin(delta + gamma)
            return along / math.cos(gamma)


def room(wheel: SteeredWheel, alpha: float) -> float:
    """How far α is inside the steering range (negative: outside), rad."""
    assert wheel.steering_range_deg is not None
    least, largest = map(math.radians, wheel.steering_range_deg)
    if largest - least >= 2 * math.pi:
        return math.inf
    best = -math.inf
    for turn in range(-3, 4):
        angle = alpha + 2 * math.pi * (turn + round((least + largest) / 4 / math.pi))
        best = max(best, min(angle - least, largest - angle))
    return best


# --- plain twins of configspace.kernels


def node_loads(
    c: FloatArray,
    s: FloatArray,
    e: npt.NDArray[np.complex128],
    table: Sequence[npt.NDArray[Any]],
    pad: FloatArray,
) -> FloatArray:
    """Largest squared load at every node: disc 0, strip 1, product 2."""
    kind, p, b, n = table
    out = np.zeros((c.size, e.size))
    for row in range(kind.size):
        z = c[:, None] * p[row] * e[None, :] + s[:, None] * b[row]
        if kind[row] == 0:
            load = np.abs(z) ** 2
        elif kind[row] == 1:
            load = (z * np.conj(n[row])).real ** 2
        else:
            load = np.broadcast_to((p[row] ** 2 * c * np.abs(s))[:, None], out.shape)
        out = np.maximum(out, load)
    return out + pad[:, None]


def load_bounds(
    row: Sequence[Any],
    kappa: tuple[float, float],
    beta: tuple[float, float],
) -> tuple[float, float]:
    """Least and largest squared load of one row over one cell, by candidates.

    The extremes are taken over everything where one can stand: corners, the points of
    an edge where the derivative vanishes, and a mesh within.
    """
    kind, p, b, n = int(row[0]), float(row[1]), complex(row[2]), complex(row[3])

    def load(k: float, angle: float) -> float:
        c, s = min(1.0, 2 - abs(k)), max(-1.0, min(1.0, k))
        z = c * p * cmath.exp(1j * angle) + s * b
        if kind == 0:
            return abs(z) ** 2
        if kind == 1:
            return float((z * n.conjugate()).real ** 2)
        return p * p * c * abs(s)

    angles = [beta[0], beta[1]]
    for zero in (cmath.phase(b) if b else 0.0, cmath.phase(n)):
        for turn in range(-8, 9):
            angle = zero + turn * math.pi / 2
            if beta[0] < angle < beta[1]:
                angles.append(angle)
    angles.extend(np.linspace(*beta, 25))
    curvatures = [kappa[0], kappa[1], *np.linspace(*kappa, 25)]
    values = [load(k, a) for k in curvatures for a in angles]
    return min(values), max(values)
