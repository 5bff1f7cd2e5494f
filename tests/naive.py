"""Slow, plain twins of the vectorised routines, written from the paper's cases.

Nothing here uses the complex form, `configspace.limits` or `configspace.exact`: a
mistake would have to be made twice to stay hidden. Scalars are plain floats.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from configspace.vehicle import (
    Castor,
    FixedWheel,
    MecanumWheel,
    OmniWheel,
    SteerableWheel,
    SteeredWheel,
    Turntable,
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


def ground(vehicle: Vehicle) -> list[tuple[float, float]]:
    """Where every wheel counts: for a skid steer, half its track beside the middle."""
    if vehicle.skid_steer is None:
        return [(wheel.x, wheel.y) for wheel in vehicle.wheels]
    fixed = [w for w in vehicle.wheels if isinstance(w, FixedWheel)]
    mx, my = sum(w.x for w in fixed) / len(fixed), sum(w.y for w in fixed) / len(fixed)
    angle = math.radians(fixed[0].heading_deg) + math.pi / 2
    points = []
    for wheel in vehicle.wheels:
        if isinstance(wheel, Castor):
            points.append((wheel.x, wheel.y))
            continue
        aside = (wheel.x - mx) * math.cos(angle) + (wheel.y - my) * math.sin(angle)
        arm = sgn(aside) * vehicle.skid_steer.effective_track / 2
        points.append((mx + arm * math.cos(angle), my + arm * math.sin(angle)))
    return points


def reference(vehicle: Vehicle) -> tuple[float, float]:
    """K: as the file says, or its foot on the axle line of the fixed wheels."""
    kx, ky = vehicle.reference_point or (0.0, 0.0)
    for wheel, (x, y) in zip(vehicle.wheels, ground(vehicle), strict=True):
        if isinstance(wheel, FixedWheel):
            heading = math.radians(wheel.heading_deg)
            # Move K along the rolling direction until it is beside the wheel.
            ahead = (x - kx) * math.cos(heading) + (y - ky) * math.sin(heading)
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
    for wheel, (x, y) in zip(vehicle.wheels, ground(vehicle), strict=True):
        if isinstance(wheel, Castor):
            continue
        r = math.hypot(x - kx, y - ky)
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
            math.hypot(x - kx, y - ky)
            for w, (x, y) in zip(vehicle.wheels, ground(vehicle), strict=True)
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
    spare: float
    """Largest steering rate less what the guaranteed rates ask, per the former."""

    @property
    def permitted(self) -> float:
        """v_max, or 0 where blocked."""
        open_ = self.margin >= 0 and self.stillness > 1e-12 and self.spare >= 0
        return self.v_max if open_ else 0.0


def exact(
    vehicle: Vehicle, kappa_n: float, beta: float, *, reverse: bool = False
) -> Answer:
    """Return the permitted speed by the rigid-body formula, wheel by wheel."""
    kg = kappa_g(vehicle)
    kx, ky = reference(vehicle)
    vx, vy, omega = twist(kappa_n, beta, 1.0, kg)
    bound, margin, stillness, spare = math.inf, math.inf, math.inf, math.inf
    line = constant_beta(vehicle)
    if line is not None:
        if abs(kappa_n) == 2:  # the pole is one configuration, left along the line
            beta = line
        off = abs(math.remainder(beta - line, 2 * math.pi))
        margin = min(margin, 2e-9 - off)
    if vehicle.synchro:
        margin = min(margin, 2e-9 - abs(kappa_n))
    for wheel, (x, y) in zip(vehicle.wheels, ground(vehicle), strict=True):
        if isinstance(wheel, Castor):
            continue
        ux, uy = vx - omega * (y - ky), vy + omega * (x - kx)
        for u in rolling_speeds(wheel, ux, uy, omega):
            if wheel.max_speed is not None and u != 0:
                bound = min(bound, wheel.max_speed / abs(u))
        if isinstance(wheel, SteerableWheel):
            still = math.hypot(ux, uy)
            stillness = min(stillness, still)
            if wheel.steering_range_deg is not None:
                margin = min(margin, room(wheel, math.atan2(uy, ux)))
            rate = standing_rate(wheel)
            if vehicle.guaranteed and rate < math.inf and still > 1e-9:
                by_kappa, by_beta = angle_rates(vehicle, wheel, kappa_n, beta, still)
                if 2 - abs(kappa_n) <= 1e-12 and line is None:
                    # Any β: the rate is a sinusoid in it, its size that of two at 90°.
                    quarter = beta + math.pi / 2
                    other, _ = angle_rates(vehicle, wheel, kappa_n, quarter, still)
                    by_kappa = math.hypot(by_kappa, other)
                asked = abs(by_kappa) * vehicle.guaranteed.kappa_rate
                asked += abs(by_beta) * math.radians(vehicle.guaranteed.beta_rate_deg)
                spare = min(spare, (rate - asked) / rate)
    limits = vehicle.limits
    v = math.hypot(vx, vy)
    if limits.max_speed is not None and v > 0:
        bound = min(bound, limits.max_speed / v)
    if reverse and limits.max_reverse_speed is not None and v > 0:
        bound = min(bound, limits.max_reverse_speed / v)
    if limits.max_yaw_rate_deg is not None and omega != 0:
        bound = min(bound, math.radians(limits.max_yaw_rate_deg) / abs(omega))
    if vehicle.load is not None:
        cx, cy, _ = vehicle.load.center_of_gravity
        gx, gy = vx - omega * (cy - ky), vy + omega * (cx - kx)
        bound = min(bound, tipping_speed(vehicle, -omega * gy, omega * gx))
        if limits.lateral_acceleration_at == "center_of_gravity":
            v = math.hypot(gx, gy)
    if limits.max_lateral_acceleration is not None and v * omega != 0:
        bound = min(bound, math.sqrt(limits.max_lateral_acceleration / abs(v * omega)))
    return Answer(bound, margin, stillness, spare)


def tipping_speed(vehicle: Vehicle, ax: float, ay: float) -> float:
    """Largest v_s with the zero-moment point among the contacts, by bisection.

    (ax, ay) is the acceleration of the centre of gravity at v_s = 1.
    """
    assert vehicle.load is not None
    px, py, height = vehicle.load.center_of_gravity
    factor = vehicle.load.tipping_factor * height / 9.81
    contacts = [(w.x - px, w.y - py) for w in vehicle.wheels]
    reach = max(math.hypot(x, y) for x, y in contacts)
    size = math.hypot(ax, ay) * factor
    if size < 1e-12 * reach:
        return math.inf
    low, high = 0.0, 1.01 * reach / size
    for _ in range(60):
        middle = (low + high) / 2
        point = (-ax * factor * middle, -ay * factor * middle)
        low, high = (middle, high) if is_among(point, contacts) else (low, middle)
    return math.sqrt(low)


def is_among(
    point: tuple[float, float], corners: Sequence[tuple[float, float]]
) -> bool:
    """Whether a point is in a triangle of the origin and two corners.

    Where the origin is in the convex hull of the corners, these triangles fill it.
    """
    x, y = point
    for ax, ay in corners:
        for bx, by in corners:
            area = ax * by - ay * bx
            if area <= 1e-15:
                continue
            # point = s a + t b with s, t >= 0 and s + t <= 1
            s, t = (x * by - y * bx) / area, (ax * y - ay * x) / area
            if s >= -1e-12 and t >= -1e-12 and s + t <= 1:
                return True
    return False


def standing_rate(wheel: SteerableWheel) -> float:
    """Largest |α̇| at standstill: that of the steering, or what rolling allows."""
    rate = math.inf
    if wheel.max_steering_rate_deg is not None:
        rate = math.radians(wheel.max_steering_rate_deg)
    if wheel.max_speed is not None:
        for u in rolling_speeds(wheel, 0.0, 0.0, 1.0):  # as α̇ alone does
            taken = abs(u) + wheel.steering_coupling
            if taken > 0:
                rate = min(rate, wheel.max_speed / taken)
    return rate


def angle_rates(
    vehicle: Vehicle, wheel: SteerableWheel, kappa_n: float, beta: float, still: float
) -> tuple[float, float]:
    """Derivatives of α_i by κ_n and β, by differences of fourth order.

    The formula of the branch that holds at κ_n is continued beyond its ends.
    """
    kg = kappa_g(vehicle)
    kx, ky = reference(vehicle)
    x, y = wheel.x - kx, wheel.y - ky

    def alpha(k: float, b: float) -> float:
        if abs(kappa_n) < 1:
            v, omega = 1.0, kg * k
        else:
            v, omega = 2 - sgn(kappa_n) * k, kg * sgn(kappa_n)
        return math.atan2(v * math.sin(b) + omega * x, v * math.cos(b) - omega * y)

    h = 1e-3 * still / max(1.0, kg * math.hypot(x, y))

    def slope(at: Callable[[float], float]) -> float:
        total = 0.0
        for step, weight in ((1, 8), (2, -1)):
            apart = math.remainder(at(step * h) - at(-step * h), 2 * math.pi)
            total += weight * apart
        return total / (12 * h)

    return (
        slope(lambda d: alpha(kappa_n + d, beta)),
        slope(lambda d: alpha(kappa_n, beta + d)),
    )


def rolling_speeds(
    wheel: SteerableWheel | FixedWheel | MecanumWheel | OmniWheel,
    ux: float,
    uy: float,
    omega: float,
) -> list[float]:
    """Rolling speeds of all wheels on one mount, at resting steering.

    Wheels beside a steering axis move with it and with the vehicle's rotation.
    """
    match wheel:
        case SteeredWheel():
            arms = [wheel.offset]
        case Turntable():
            arms = [wheel.track / 2, -wheel.track / 2]
        case _:
            return [rolling(wheel, ux, uy)]
    alpha = math.atan2(uy, ux)
    speeds = []
    for arm in arms:
        ax, ay = -arm * math.sin(alpha), arm * math.cos(alpha)
        wx, wy = ux - omega * ay, uy + omega * ax
        speeds.append(wx * math.cos(alpha) + wy * math.sin(alpha))
    return speeds


def rolling(
    wheel: SteerableWheel | FixedWheel | MecanumWheel | OmniWheel, ux: float, uy: float
) -> float:
    """Rolling speed of a wheel whose contact point or axis moves with (ux, uy)."""
    match wheel:
        case SteerableWheel():
            return math.hypot(ux, uy)
        case FixedWheel() | OmniWheel():
            delta = math.radians(wheel.heading_deg)
            return ux * math.cos(delta) + uy * math.sin(delta)
        case MecanumWheel():
            delta = math.radians(wheel.heading_deg)
            gamma = math.radians(wheel.roller_deg)
            along = ux * math.cos(delta + gamma) + uy * math.sin(delta + gamma)
            return along / math.cos(gamma)


def room(wheel: SteerableWheel, alpha: float) -> float:
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

DISC, STRIP, OFFSET, LATERAL, EDGE = range(5)


def row_load(row: Sequence[Any], c: float, s: float, beta: float) -> float:
    """Squared load of one row (kind, p, b, n, d) of the load table."""
    kind, p, b, n, d = int(row[0]), *row[1:5]
    scale = p if kind in (DISC, STRIP, OFFSET) else 1.0
    x = c * scale * math.cos(beta) + s * b.real
    y = c * scale * math.sin(beta) + s * b.imag
    along = x * n.real + y * n.imag
    match kind:
        case 0:
            return float(x * x + y * y)
        case 1:
            return float(along**2)
        case 2:
            return float((math.hypot(x, y) - s * d) ** 2)
        case 3:
            return float(p * abs(s) * math.hypot(x, y))
        case _:
            return float(max(0.0, p * s * along))


def split(kappa_n: float) -> tuple[float, float]:
    """(c, s): the shares of translation and rotation."""
    if abs(kappa_n) < 1:
        return 1.0, kappa_n
    return 2 - abs(kappa_n), sgn(kappa_n)


def node_loads(
    kappa: FloatArray, beta: FloatArray, table: Sequence[npt.NDArray[Any]]
) -> FloatArray:
    """Largest squared load at every node, one after the other."""
    rows = list(zip(*table[:5], strict=True))
    return np.array(
        [
            [max(row_load(row, *split(k), b) for row in rows) for b in beta.tolist()]
            for k in kappa.tolist()
        ]
    )


def load_bounds(
    row: Sequence[Any],
    kappa: tuple[float, float],
    beta: tuple[float, float],
) -> tuple[float, float]:
    """Least and largest squared load of one row over one cell, by candidates.

    The extremes are taken over everything where one can stand: corners, the points of
    an edge where the derivative vanishes, and a mesh within.
    """
    angles = [beta[0], beta[1]]
    b, n = complex(row[2]), complex(row[3])
    for zero in (cmath.phase(b) if b else 0.0, cmath.phase(n)):
        for turn in range(-8, 9):
            angle = zero + turn * math.pi / 2
            if beta[0] < angle < beta[1]:
                angles.append(angle)
    angles.extend(np.linspace(*beta, 25).tolist())
    curvatures = [kappa[0], kappa[1], *np.linspace(*kappa, 25).tolist()]
    values = [row_load(row, *split(k), a) for k in curvatures for a in angles]
    return min(values), max(values)
