"""Random wheels of every kind of undercarriage, as vehicle files have them."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import combinations
from typing import Any

import numpy as np

__all__ = ["WHEELS", "random_point", "random_speed"]


def random_point(rng: np.random.Generator, size: float = 1.0) -> tuple[float, float]:
    """Return a point of a square about the origin, m."""
    x, y = rng.uniform(-size, size, 2)
    return float(x), float(y)


def random_speed(rng: np.random.Generator) -> float:
    """Return a speed of a wheel or a vehicle, m/s."""
    return float(rng.uniform(0.3, 3.0))


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
    x, y = random_point(rng)
    wheel: dict[str, Any] = {"id": name, "type": "steered", "x": x, "y": y}
    if driven:
        wheel["max_speed"] = random_speed(rng)
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
    middle = complex(*random_point(rng, 0.5)) if rng.random() < 0.5 else 0j
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
            wheel["max_speed"] = random_speed(rng)
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
                    "max_speed": random_speed(rng),
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
                "max_speed": random_speed(rng),
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
    middle, half = complex(*random_point(rng, 0.5)), float(rng.uniform(0.1, 0.6))
    speed = random_speed(rng)
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
                    "max_speed": speed if rng.random() < 0.7 else random_speed(rng),
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


WHEELS: dict[
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
"""From a kind to what draws its wheels, and whether all are driven alike."""
