"""Random vehicles of every kind of undercarriage, with every kind of limit: for tests.

`configspace.testing` is the module to import.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import combinations
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from configspace.vehicle import Vehicle
from configspace.vehicle_io import vehicle_from_data

__all__ = ["ALL_KINDS", "VEHICLE_KINDS", "VehicleKind", "random_vehicle"]

PlainKind: TypeAlias = Literal[
    "steered", "mixed", "differential", "ackermann", "mecanum", "omni"
]
VehicleKind: TypeAlias = (
    PlainKind
    | Literal["offset", "turntable", "loaded", "guaranteed", "skid", "synchro"]
)

VEHICLE_KINDS: tuple[PlainKind, ...] = get_args(PlainKind)
"""The plain kinds of undercarriage."""
ALL_KINDS: tuple[VehicleKind, ...] = (
    *VEHICLE_KINDS,
    "offset",
    "turntable",
    "loaded",
    "guaranteed",
    "skid",
    "synchro",
)
"""Every kind that `random_vehicle` builds. A loaded one may tip and a guaranteed one
has a singular zone; what they stand on is drawn from the other kinds."""


def random_vehicle(
    rng: np.random.Generator, kind: VehicleKind | None = None
) -> Vehicle:
    """Return a random vehicle whose speed is bounded everywhere.

    Parameters
    ----------
    rng : numpy.random.Generator
    kind : str, optional
        One of `ALL_KINDS`; default any of `VEHICLE_KINDS`.

    Examples
    --------
    >>> random_vehicle(np.random.default_rng(0), "mecanum").wheels[0].type
    'mecanum'
    """
    kind = kind or VEHICLE_KINDS[int(rng.integers(len(VEHICLE_KINDS)))]
    base: VehicleKind = kind
    if kind in _STANDS_ON:
        base = _STANDS_ON[kind][int(rng.integers(len(_STANDS_ON[kind])))]
    wheels, always_bounded = _WHEELS[base](rng)
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
    if base == "skid":
        data["skid_steer"] = {"effective_track": float(rng.uniform(0.3, 2.0))}
    if base == "synchro":
        data["synchro"] = True
    if kind == "loaded":
        _add_load(rng, data)
    if kind == "guaranteed" or (kind == "loaded" and rng.random() < 0.3):
        _add_guarantee(rng, data)
    _add_steering_accelerations(rng.spawn(1)[0], data)
    return vehicle_from_data(data)


def _add_steering_accelerations(rng: np.random.Generator, data: dict[str, Any]) -> None:
    """Limit how fast some vehicles may change their steering rates."""
    share = 0.7 if rng.random() < 0.25 else 0.0
    for wheel in data["wheels"]:
        if wheel["type"] in {"steered", "turntable"} and rng.random() < share:
            swing = float(10.0 ** rng.uniform(1.5, 3.5))
            wheel["max_steering_acceleration_deg"] = swing


def _add_load(rng: np.random.Generator, data: dict[str, Any]) -> None:
    """Put a load on the vehicle, with castors where the wheels do not carry it."""
    for wheel in data["wheels"]:
        wheel.pop("offset", None)  # it shrinks the polygon; `rigid_body` knows nothing
    for i in range(int(rng.integers(3, 5)) if len(data["wheels"]) < 3 else 1):
        x, y = _point(rng)
        castor = {"id": f"carrier-{i}", "type": "castor", "x": x, "y": y}
        data["wheels"].append(castor)
    while True:
        contacts = np.array([(w["x"], w["y"]) for w in data["wheels"]])
        spread = np.linalg.svd(contacts - contacts.mean(axis=0), compute_uv=False)
        if spread[-1] > 0.1:
            break
        x, y = _point(rng)
        name = f"carrier-{len(contacts)}"
        data["wheels"].append({"id": name, "type": "castor", "x": x, "y": y})
    share = 0.95 * rng.dirichlet(np.ones(len(contacts))) + 0.05 / len(contacts)
    x, y = (float(value) for value in share @ contacts)
    height = float(10.0 ** rng.uniform(-1.5, 0.5))
    data["load"] = {"center_of_gravity": [x, y, height]}
    if rng.random() < 0.5:
        data["load"]["tipping_factor"] = float(rng.uniform(1, 3))
    if rng.random() < 0.5:
        data["limits"]["max_lateral_acceleration"] = float(rng.uniform(0.2, 5.0))
        data["limits"]["lateral_acceleration_at"] = "center_of_gravity"


def _add_guarantee(rng: np.random.Generator, data: dict[str, Any]) -> None:
    """Guarantee change rates, and give the wheels that steer a rate of their own."""
    for wheel in data["wheels"]:
        if wheel["type"] in {"steered", "turntable"} and rng.random() < 0.9:
            wheel["max_steering_rate_deg"] = float(rng.uniform(40, 300))
    rates = {
        "kappa_rate": float(10.0 ** rng.uniform(-2, 0.3)),
        "beta_rate_deg": float(10.0 ** rng.uniform(-1, 1.7)),
    }
    if any(wheel["type"] == "fixed" for wheel in data["wheels"]):
        del rates["beta_rate_deg"]  # β is constant
    if data.get("synchro"):
        del rates["kappa_rate"]  # κ_n is 0
    for key in rng.choice(
        list(rates), int(rng.integers(1, len(rates) + 1)), replace=False
    ):
        data.setdefault("guaranteed", {})[str(key)] = rates[str(key)]


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


def _offset_wheels(rng: np.random.Generator) -> tuple[list[dict[str, Any]], bool]:
    """Steered wheels that roll beside their steering axis, on either side."""
    wheels, _ = _steered_wheels(rng)
    largest = 1.0 if rng.random() < 0.2 else 0.15
    alike = float(rng.uniform(-largest, largest))
    for wheel in wheels:
        offset = alike if rng.random() < 0.4 else float(rng.uniform(-largest, largest))
        if rng.random() < 0.8:
            wheel["offset"] = offset
    _couple(rng, wheels)
    return wheels, _never_stand_together(wheels)


def _turntable_wheels(rng: np.random.Generator) -> tuple[list[dict[str, Any]], bool]:
    """Turntables, at times beside steered wheels."""
    wheels, _ = _offset_wheels(rng)
    for wheel in wheels[: int(rng.integers(1, len(wheels) + 1))]:
        wheel.pop("offset", None)
        wheel["type"] = "turntable"
        wheel["track"] = float(rng.uniform(0.02, 0.8))
    return wheels, True


def _couple(rng: np.random.Generator, wheels: list[dict[str, Any]]) -> None:
    if rng.random() < 0.4:
        for wheel in wheels:
            wheel["steering_coupling"] = float(rng.uniform(0, 0.3))


def _never_stand_together(wheels: list[dict[str, Any]]) -> bool:
    """Return whether two wheels cannot both have the centre of rotation on them."""
    for a, b in combinations(wheels, 2):
        reach = abs(a.get("offset", 0.0)) + abs(b.get("offset", 0.0))
        if reach < 0.9 * math.hypot(a["x"] - b["x"], a["y"] - b["y"]):
            return True
    return False


def _skid_wheels(rng: np.random.Generator) -> tuple[list[dict[str, Any]], bool]:
    """Two sides of two or three fixed wheels."""
    heading = float(rng.uniform(-180, 180)) if rng.random() < 0.5 else 0.0
    turn = complex(math.cos(math.radians(heading)), math.sin(math.radians(heading)))
    middle, half = complex(*_point(rng, 0.5)), float(rng.uniform(0.1, 0.6))
    speed = _speed(rng)
    wheels = []
    for side in (1, -1):
        for i in range(int(rng.integers(2, 4))):
            place = middle + turn * complex(float(rng.uniform(-0.6, 0.6)), side * half)
            turned = 180.0 if rng.random() < 0.2 else 0.0
            wheels.append(
                {
                    "id": f"{'left' if side > 0 else 'right'}-{i}",
                    "type": "fixed",
                    "x": place.real,
                    "y": place.imag,
                    "heading_deg": heading + turned,
                    "max_speed": speed if rng.random() < 0.7 else _speed(rng),
                }
            )
    return wheels, True


def _synchro_wheels(rng: np.random.Generator) -> tuple[list[dict[str, Any]], bool]:
    """Steered wheels of all sorts, to be turned alike."""
    wheels, _ = (_offset_wheels if rng.random() < 0.5 else _turntable_wheels)(rng)
    if rng.random() < 0.3:
        for wheel in wheels[1:]:
            wheel.pop("max_speed", None)
    return wheels, True


_WHEELS: dict[
    str, Callable[[np.random.Generator], tuple[list[dict[str, Any]], bool]]
] = {
    "steered": _steered_wheels,
    "mixed": _mixed_wheels,
    "differential": _differential_wheels,
    "ackermann": _ackermann_wheels,
    "mecanum": _mecanum_wheels,
    "omni": _omni_wheels,
    "offset": _offset_wheels,
    "turntable": _turntable_wheels,
    "skid": _skid_wheels,
    "synchro": _synchro_wheels,
}

_STANDS_ON: dict[VehicleKind, tuple[VehicleKind, ...]] = {
    "loaded": (*VEHICLE_KINDS, "offset", "turntable", "skid"),
    "guaranteed": ("steered", "mixed", "ackermann", "offset", "turntable"),
}
