"""Random vehicles and configurations, and what every space must keep: for tests.

Import this module in tests only: the strategies need hypothesis, which is imported
when one is asked for. Everything random comes from a passed `numpy.random.Generator`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt

from configspace.grid import Grid
from configspace.omni_curve import from_twist
from configspace.space import PermissibleSpace
from configspace.vehicle import (
    Castor,
    FixedWheel,
    MecanumWheel,
    OmniWheel,
    SteeredWheel,
    Vehicle,
)
from configspace.vehicle_io import vehicle_from_data

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

__all__ = [
    "VEHICLE_KINDS",
    "RigidBody",
    "assert_sound",
    "configurations",
    "grids",
    "random_configurations",
    "random_vehicle",
    "rigid_body",
    "vehicles",
]

FloatArray = npt.NDArray[np.float64]
VehicleKind: TypeAlias = Literal[
    "steered", "mixed", "differential", "ackermann", "mecanum", "omni"
]

VEHICLE_KINDS: tuple[VehicleKind, ...] = get_args(VehicleKind)
"""The kinds of undercarriage that `random_vehicle` builds."""


def random_vehicle(
    rng: np.random.Generator, kind: VehicleKind | None = None
) -> Vehicle:
    """Return a random vehicle whose speed is bounded everywhere.

    Parameters
    ----------
    rng : numpy.random.Generator
    kind : str, optional
        One of `VEHICLE_KINDS`; default any.

    Examples
    --------
    >>> random_vehicle(np.random.default_rng(0), "mecanum").wheels[0].type
    'mecanum'
    """
    kind = kind or VEHICLE_KINDS[int(rng.integers(len(VEHICLE_KINDS)))]
    wheels, always_bounded = _WHEELS[kind](rng)
    for i in range(int(rng.integers(3))):
        x, y = _point(rng)
        wheels.append({"id": f"castor-{i}", "type": "castor", "x": x, "y": y})
    order = rng.permutation(len(wheels))
    data: dict[str, Any] = {
        "name": f"random-{kind}",
        "wheels": [wheels[i] for i in order],
        "limits": _random_limits(rng, always_bounded),
    }
    if rng.random() < 0.4:
        data["reference_point"] = _point(rng, 0.3)
    if rng.random() < 0.2:
        data["kappa_g"] = float(rng.uniform(0.5, 8.0))
    return vehicle_from_data(data)


def random_configurations(
    rng: np.random.Generator, vehicle: Vehicle, count: int
) -> tuple[FloatArray, FloatArray]:
    """Return configurations, many of them where something happens.

    Half are uniform; the rest are at or next to the kinks κ_n = 0, ±1, ±2, the seam
    β = ±π, the singular points of wheels and the ends of steering ranges. For a
    line-mobile vehicle β is mostly its constant one.

    Parameters
    ----------
    rng : numpy.random.Generator
    vehicle : Vehicle
    count : int

    Returns
    -------
    kappa_n : (count,) float, 1, [-2, 2]
    beta : (count,) float, rad
    """
    kappa_n = rng.uniform(-2, 2, count)
    beta = rng.uniform(-np.pi, np.pi, count)
    near = rng.choice([-1.0, 0.0, 1.0], count) * 10.0 ** rng.uniform(-17, -1, count)
    case = rng.integers(0, 10, count)
    kinks = rng.choice([-2.0, -1.0, 0.0, 1.0, 2.0], count)
    kappa_n = np.where(case == 5, kinks + near, kappa_n)
    seams = rng.choice([-np.pi, -np.pi / 2, 0.0, np.pi / 2, np.pi], count)
    beta = np.where((case == 6) | ((case == 5) & (near > 0)), seams + near, beta)
    steered = [w for w in vehicle.wheels if isinstance(w, SteeredWheel)]
    if steered:
        pick = rng.integers(0, len(steered), count)
        w = np.array([wheel.position - vehicle.reference for wheel in steered])[pick]
        # The centre of rotation on the wheel: v = -ω x w.
        omega = rng.choice([-1.0, 1.0], count)
        still = np.stack([omega * w.imag, -omega * w.real, omega], axis=-1)
        on_k, on_beta, _ = from_twist(still, vehicle.boundary_curvature)
        apart = near * rng.uniform(-1, 1, count)
        kappa_n = np.where(case == 7, on_k + apart, kappa_n)
        beta = np.where(case == 7, on_beta + near, beta)
        # A wheel at the end of its range: Im(z exp(-jα)) = 0 solved for β.
        ends = np.array([w.steering_range for w in steered])[pick, pick % 2]
        ends = np.where(np.isfinite(ends), ends, np.pi)
        c = np.minimum(1.0, 2 - np.abs(np.clip(kappa_n, -2, 2)))
        s = np.clip(kappa_n, -1, 1)
        b = 1j * vehicle.boundary_curvature * w
        sine = s * (b * np.exp(-1j * ends)).imag / np.maximum(c, 1e-9)
        bend = np.arcsin(np.clip(sine, -1, 1))
        beta = np.where(case >= 8, ends - bend + near, beta)
    line = vehicle.mobility.line_beta
    if line is not None:
        beta = np.where(rng.random(count) < 0.9, line, beta)
    return np.clip(kappa_n, -2, 2), beta


@dataclass(frozen=True)
class RigidBody:
    """What ``v + ω x w`` says of configurations, wheel by wheel in real numbers."""

    v_max: FloatArray
    """(...,) m/s, the fastest permitted |v_s| if steering is left aside."""
    margin: FloatArray
    """(...,) rad, the least room to a steering stop; negative where blocked."""
    stillness: FloatArray
    """(...,) the least speed of a steered wheel per v_s; 0 at a singular point."""

    @property
    def permitted(self) -> FloatArray:
        """(...,) m/s, v_max or 0 where blocked."""
        open_ = (self.margin >= 0) & (self.stillness > 1e-12)
        return np.where(open_, self.v_max, 0.0)

    def is_clear(self, room: float = 1e-9) -> npt.NDArray[np.bool_]:
        """(...,) whether permitted or blocked by more than rounding."""
        fine = np.minimum(self.stillness, 1.0) * np.minimum(np.abs(self.margin), 1.0)
        return np.asarray((fine > room) & (self.stillness > room))


def rigid_body(
    vehicle: Vehicle,
    kappa_n: npt.ArrayLike,
    beta: npt.ArrayLike,
    *,
    reverse: bool = False,
) -> RigidBody:
    """Return permitted speeds by the rigid-body formula, without cells or tables.

    Written apart from `configspace.limits` and `configspace.exact` on purpose.

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
    gentle = np.abs(kappa_n) < 1
    v = np.where(gentle, 1.0, 2 - np.abs(kappa_n))
    omega = vehicle.boundary_curvature * np.where(
        gentle, kappa_n, np.copysign(1.0, kappa_n)
    )
    vx, vy = v * np.cos(beta), v * np.sin(beta)
    slowest = np.full(kappa_n.shape, np.inf)
    margin = np.full(kappa_n.shape, np.inf)
    stillness = np.full(kappa_n.shape, np.inf)
    k = vehicle.reference
    with np.errstate(divide="ignore", over="ignore"):
        for wheel in vehicle.wheels:
            if isinstance(wheel, Castor):
                continue
            ux = vx - omega * (wheel.y - k.imag)
            uy = vy + omega * (wheel.x - k.real)
            if isinstance(wheel, SteeredWheel):
                u = np.hypot(ux, uy)
                stillness = np.minimum(stillness, u)
                margin = np.minimum(margin, _room(wheel, np.arctan2(uy, ux)))
            else:
                u = _rolling(wheel, ux, uy)
            if wheel.max_speed is not None:
                slowest = np.minimum(slowest, wheel.max_speed / np.abs(u))
        limits = vehicle.limits
        if limits.max_speed is not None:
            slowest = np.minimum(slowest, limits.max_speed / v)
        if limits.max_reverse_speed is not None and reverse:
            slowest = np.minimum(slowest, limits.max_reverse_speed / v)
        if limits.max_yaw_rate_deg is not None:
            rate = math.radians(limits.max_yaw_rate_deg)
            slowest = np.minimum(slowest, rate / np.abs(omega))
        if limits.max_lateral_acceleration is not None:
            sideways = limits.max_lateral_acceleration / np.abs(v * omega)
            slowest = np.minimum(slowest, np.sqrt(sideways))
    line = vehicle.mobility.line_beta
    if line is not None:
        off = np.abs(np.angle(np.exp(1j * (beta - line))))
        turning = np.abs(kappa_n) < 2
        # About a nano-radian beside the line is rounding: neither clear.
        margin = np.where(turning & (off > 5e-10), np.minimum(margin, 0.0), margin)
        margin = np.where(turning & (off > 2e-9), np.minimum(margin, -off), margin)
    return RigidBody(slowest, margin, stillness)


def assert_sound(
    space: PermissibleSpace,
    vehicle: Vehicle,
    kappa_n: npt.ArrayLike,
    beta: npt.ArrayLike,
) -> None:
    """Fail unless the space promises nothing that the rigid-body formula forbids.

    Checks `v_max` and `contains` in both driving directions, and, if the space knows
    its vehicle, that clearly permitted configurations are not refused.

    Parameters
    ----------
    space : PermissibleSpace
        Of this vehicle, built or read from a data sheet.
    vehicle : Vehicle
    kappa_n : (...,) float, 1, [-2, 2]
    beta : (...,) float, rad

    Raises
    ------
    AssertionError
        Naming the first configuration that breaks the promise.
    """
    kappa_n, beta = np.broadcast_arrays(
        np.asarray(kappa_n, np.float64), np.asarray(beta, np.float64)
    )
    for reverse in (False, True):
        truth = rigid_body(vehicle, kappa_n, beta, reverse=reverse)
        promised = space.v_max(kappa_n, beta, reverse=reverse)
        # Rounding only: an angle is as exact as the wheel's speed lets it be.
        slack = 4e-15 / np.maximum(truth.stillness, 1e-15) + 3e-14
        blocked = (truth.margin < -slack) | (truth.stillness < 1e-13)
        _fail_where(blocked & (promised > 0), "blocked but permitted", kappa_n, beta)
        too_fast = promised > truth.v_max * (1 + 1e-12)
        _fail_where(too_fast, "faster than permitted", kappa_n, beta)
        v_s = -promised if reverse else promised
        moves = (promised > 0) & np.isfinite(promised)
        held = space.contains(kappa_n, beta, v_s)
        _fail_where(moves & ~held, "v_max itself is refused", kappa_n, beta)
        over = v_s * (1 + 1e-9)
        taken = space.contains(kappa_n, beta, over)
        _fail_where(moves & taken, "more than v_max is taken", kappa_n, beta)
        if space.vehicle is not None:
            refused = truth.is_clear() & (truth.margin > 0) & (promised <= 0)
            _fail_where(refused, "clearly permitted but refused", kappa_n, beta)


def vehicles(
    kinds: tuple[VehicleKind, ...] = VEHICLE_KINDS,
) -> SearchStrategy[Vehicle]:
    """Return a hypothesis strategy for vehicles of these kinds."""
    from hypothesis import strategies

    def build(kind: VehicleKind, seed: int) -> Vehicle:
        return random_vehicle(np.random.default_rng(seed), kind)

    seeds = strategies.integers(0, 2**32 - 1)
    return strategies.builds(build, strategies.sampled_from(kinds), seeds)


def configurations() -> SearchStrategy[tuple[float, float]]:
    """Return a hypothesis strategy for (κ_n, β), kinks and seam included."""
    from hypothesis import strategies as st

    tiny = st.sampled_from([0.0, 1e-16, -1e-16, 1e-12, -1e-12, 1e-6, -1e-6])
    kinks = st.sampled_from([-2.0, -1.0, 0.0, 1.0, 2.0])
    seams = st.sampled_from([-np.pi, -np.pi / 2, 0.0, np.pi / 2, np.pi])
    near_kink = st.builds(lambda k, d: min(2.0, max(-2.0, k + d)), kinks, tiny)
    near_seam = st.builds(lambda b, d: float(b + d), seams, tiny)
    return st.tuples(
        st.one_of(near_kink, st.floats(-2, 2)),
        st.one_of(near_seam, st.floats(-np.pi, np.pi)),
    )


def grids(largest: int = 48) -> SearchStrategy[Grid]:
    """Return a hypothesis strategy for coarse grids, from 16 × 24, quick to build."""
    from hypothesis import strategies as st

    quarters = st.integers(4, max(4, largest // 4))
    return st.builds(
        lambda quarter, n_beta: Grid(4 * quarter, n_beta),
        quarters,
        st.integers(24, max(24, largest)),
    )


def _fail_where(
    wrong: npt.NDArray[np.bool_], what: str, kappa_n: FloatArray, beta: FloatArray
) -> None:
    if wrong.any():
        first = tuple(np.argwhere(wrong)[0])
        raise AssertionError(
            f"{what} at {int(wrong.sum())} of {wrong.size} configurations, first "
            f"kappa_n = {float(kappa_n[first])!r}, beta = {float(beta[first])!r}"
        )


def _rolling(
    wheel: FixedWheel | MecanumWheel | OmniWheel, ux: FloatArray, uy: FloatArray
) -> FloatArray:
    """Return the rolling speed of a wheel that does not steer."""
    gamma = 0.0 if isinstance(wheel, FixedWheel) else wheel.roller
    angle = wheel.heading + gamma
    return np.asarray((ux * math.cos(angle) + uy * math.sin(angle)) / math.cos(gamma))


def _room(wheel: SteeredWheel, alpha: FloatArray) -> FloatArray:
    """Return how far α is within the steering range, negative outside, rad."""
    least, largest = wheel.steering_range
    if largest - least >= 2 * math.pi:
        return np.full(alpha.shape, np.inf)
    width = largest - least
    past = np.mod(alpha - least, 2 * math.pi)
    inside = np.minimum(past, width - past)
    outside = -np.minimum(past - width, 2 * math.pi - past)
    return np.where(past <= width, inside, outside)


def _point(rng: np.random.Generator, size: float = 1.0) -> tuple[float, float]:
    x, y = rng.uniform(-size, size, 2)
    return float(x), float(y)


def _speed(rng: np.random.Generator) -> float:
    return float(rng.uniform(0.3, 3.0))


def _random_limits(rng: np.random.Generator, optional: bool) -> dict[str, float]:
    """Return limits; speed and yaw rate at least, unless they are `optional`."""

    def chosen(share: float) -> bool:
        return bool(rng.random() < share)

    limits: dict[str, float] = {}
    if not optional or chosen(0.4):
        limits["max_speed"] = _speed(rng)
    if chosen(0.3):
        limits["max_reverse_speed"] = _speed(rng)
    if not optional or chosen(0.3):
        limits["max_yaw_rate_deg"] = float(rng.uniform(20, 300))
    if chosen(0.3):
        limits["max_lateral_acceleration"] = float(rng.uniform(0.2, 5.0))
    return limits


def _random_range(rng: np.random.Generator) -> tuple[float, float] | None:
    """Return a steering range, degrees: of every shape that the spec names."""
    match int(rng.integers(9)):
        case 0:
            return None
        case 1:  # symmetric
            half = float(rng.uniform(20, 175))
            return -half, half
        case 2:  # asymmetric
            return float(-rng.uniform(5, 170)), float(rng.uniform(5, 170))
        case 3:  # one-sided
            return 0.0, float(rng.uniform(30, 180))
        case 4:  # narrow
            return float(-rng.uniform(0.1, 3)), float(rng.uniform(0.1, 3))
        case 5:  # more than half a turn, off centre
            least = float(rng.uniform(-300, 0))
            return least, least + float(rng.uniform(185, 359))
        case 6:  # several turns
            return float(-rng.uniform(180, 700)), float(rng.uniform(180, 700))
        case 7:  # ends at round numbers
            ends = ((-90.0, 90.0), (-180.0, 180.0), (0.0, 180.0), (-90.0, 270.0))
            return ends[int(rng.integers(4))]
        case _:  # the other way round
            return float(rng.uniform(90, 170)), float(rng.uniform(190, 270))


def _steered(
    rng: np.random.Generator,
    name: str,
    driven: bool,
    steering_range: tuple[float, float] | None = None,
) -> dict[str, Any]:
    x, y = _point(rng)
    wheel: dict[str, Any] = {"id": name, "type": "steered", "x": x, "y": y}
    if driven:
        wheel["max_speed"] = _speed(rng)
    if steering_range is not None:
        wheel["steering_range_deg"] = steering_range
    return wheel


def _steered_wheels(rng: np.random.Generator) -> tuple[list[dict[str, Any]], bool]:
    """All wheels steered and driven."""
    count = int(rng.integers(1, 9))
    same = _random_range(rng)
    alike = rng.random() < 0.5
    wheels = [
        _steered(rng, f"w{i}", True, same if alike else _random_range(rng))
        for i in range(count)
    ]
    if rng.random() < 0.3 and count % 2 == 0:  # a rectangle, as real vehicles have
        for i, wheel in enumerate(wheels):
            wheel["x"] = (0.4 + 0.2 * (i // 4)) * (1 if i % 2 else -1)
            wheel["y"] = 0.25 * (1 if i // 2 % 2 else -1)
    return wheels, count > 1


def _mixed_wheels(rng: np.random.Generator) -> tuple[list[dict[str, Any]], bool]:
    """Steered wheels of which some are passive."""
    count = int(rng.integers(2, 7))
    driven = int(rng.integers(0, count))
    wheels = [
        _steered(rng, f"w{i}", i < driven, _random_range(rng)) for i in range(count)
    ]
    return wheels, driven > 1


def _axle(
    rng: np.random.Generator, passive: bool
) -> tuple[list[dict[str, Any]], float, complex]:
    """Two fixed wheels on one axle line, rotated and off the origin at times."""
    heading = float(rng.uniform(-180, 180)) if rng.random() < 0.5 else 0.0
    middle = complex(*_point(rng, 0.5)) if rng.random() < 0.5 else 0j
    along = complex(0, 1) * complex(
        math.cos(math.radians(heading)), math.sin(math.radians(heading))
    )
    wheels = []
    for i, offset in enumerate((rng.uniform(0.1, 0.8), -rng.uniform(0.1, 0.8))):
        place = middle + float(offset) * along
        turned = 180.0 if rng.random() < 0.2 else 0.0
        wheel: dict[str, Any] = {
            "id": f"fixed-{i}",
            "type": "fixed",
            "x": place.real,
            "y": place.imag,
            "heading_deg": heading + turned,
        }
        if not passive:
            wheel["max_speed"] = _speed(rng)
        wheels.append(wheel)
    return wheels, heading, middle


def _differential_wheels(
    rng: np.random.Generator,
) -> tuple[list[dict[str, Any]], bool]:
    wheels, _, _ = _axle(rng, passive=False)
    return wheels, True


def _ackermann_wheels(rng: np.random.Generator) -> tuple[list[dict[str, Any]], bool]:
    wheels, heading, middle = _axle(rng, passive=rng.random() < 0.3)
    half = float(rng.uniform(20, 110))
    ahead = complex(math.cos(math.radians(heading)), math.sin(math.radians(heading)))
    for i in range(int(rng.integers(1, 4))):
        shift = complex(float(rng.uniform(0.3, 1.2)), float(rng.uniform(-0.4, 0.4)))
        place = middle + shift * ahead
        forward = (
            heading if abs(heading) <= 90 else heading - math.copysign(180, heading)
        )
        wheel = _steered(
            rng, f"steered-{i}", rng.random() < 0.5, (forward - half, forward + half)
        )
        wheels.append({**wheel, "x": place.real, "y": place.imag})
    return wheels, False


def _mecanum_wheels(rng: np.random.Generator) -> tuple[list[dict[str, Any]], bool]:
    wheels = []
    gamma = 45.0 if rng.random() < 0.6 else float(rng.uniform(20, 70))
    turned = 0.0 if rng.random() < 0.6 else float(rng.uniform(-180, 180))
    for axle in range(1 if rng.random() < 0.5 else 2):
        x, y = rng.uniform(0.15, 1.0, 2)
        for i, (sx, sy) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
            wheels.append(
                {
                    "id": f"m{axle}{i}",
                    "type": "mecanum",
                    "x": float(sx * x),
                    "y": float(sy * y),
                    "heading_deg": turned,
                    "roller_deg": -gamma * sx * sy,
                    "max_speed": _speed(rng),
                }
            )
    return wheels, True


def _omni_wheels(rng: np.random.Generator) -> tuple[list[dict[str, Any]], bool]:
    count = int(rng.integers(3, 5))
    start = float(rng.uniform(0, 360))
    wheels = []
    for i in range(count):
        angle = start + 360 / count * i
        r = float(rng.uniform(0.15, 0.6))
        wheels.append(
            {
                "id": f"o{i}",
                "type": "omni",
                "x": r * math.cos(math.radians(angle)),
                "y": r * math.sin(math.radians(angle)),
                "heading_deg": angle + 90,
                "max_speed": _speed(rng),
            }
        )
    return wheels, True


_WHEELS = {
    "steered": _steered_wheels,
    "mixed": _mixed_wheels,
    "differential": _differential_wheels,
    "ackermann": _ackermann_wheels,
    "mecanum": _mecanum_wheels,
    "omni": _omni_wheels,
}
