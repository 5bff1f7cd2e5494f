"""Random fleets and trajectories for `omniplan bench`."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from configspace import Vehicle, load_vehicle, vehicle_from_data
from omniplan.trajectory import Trajectory

__all__ = ["KINDS", "random_trajectories", "random_vehicles"]

FloatArray = npt.NDArray[np.float64]

KINDS = (
    "mecanum",
    "differential",
    "omni-four",
    "ift-four-steered",
    "dingo-o",
    "mir100",
    "robotino",
    "raw3-short",
    "ridgeback",
    "husky",
    "ackermann",
    "one-steered-castors",
)
"""Vehicles of the catalogue that the fleet varies."""
FINE = 2001
"""Points a path is integrated over."""


def random_vehicles(rng: np.random.Generator, count: int) -> list[Vehicle]:
    """Return vehicles of `KINDS` in turn, each with its own size and speeds.

    Without limits on the steering acceleration, so that figures stay comparable.

    Parameters
    ----------
    rng : numpy.random.Generator
    count : int
    """
    plain = {
        kind: load_vehicle(kind).model_dump(mode="json", exclude_none=True)
        for kind in KINDS
    }
    return [_varied(rng, plain[KINDS[i % len(KINDS)]], i) for i in range(count)]


def _varied(rng: np.random.Generator, data: dict[str, Any], number: int) -> Vehicle:
    size, speed, gain = rng.uniform(0.8, 1.25, 3)
    wheels = []
    for wheel in data["wheels"]:
        wheel = {**wheel, "x": wheel["x"] * size, "y": wheel["y"] * size}
        wheel.pop("max_steering_acceleration_deg", None)
        for key, factor in (("max_speed", speed), ("max_acceleration", gain)):
            if key in wheel:
                wheel[key] *= factor
        wheels.append(wheel)
    varied = {k: v for k, v in data.items() if k != "kappa_g"}
    varied.update(name=f"{data['name']}-{number}", wheels=wheels)
    return vehicle_from_data(varied)


def random_trajectories(
    rng: np.random.Generator, count: int, samples: int = 100
) -> list[Trajectory]:
    """Return trajectories of timed poses from rest to rest.

    55 % follow a winding path ahead, 10 % backwards, 25 % sideways with a turning
    heading, 10 % turn on the spot; mean speeds up to 0.8 m/s.

    Parameters
    ----------
    rng : numpy.random.Generator
    count : int
    samples : int
    """
    share = np.linspace(0.0, 1.0, samples)
    return [
        Trajectory.from_poses(*_motion(rng, share), name=f"trajectory-{i}")
        for i in range(count)
    ]


def _motion(
    rng: np.random.Generator, share: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return times and poses; the speed rises and falls smoothly."""
    kind = rng.choice(["ahead", "back", "aside", "spot"], p=[0.55, 0.1, 0.25, 0.1])
    if kind == "spot":
        turn = rng.uniform(0.5, 3.0) * rng.choice([-1.0, 1.0])
        zero = np.zeros_like(share)
        duration = abs(turn) / rng.uniform(0.1, 0.6)
        return share * duration, np.stack([zero, zero, _smooth(share) * turn], axis=-1)
    length = rng.uniform(1.0, 8.0)
    way = np.linspace(0.0, length, FINE)
    curvature = rng.normal(0, 0.5) * np.sin(
        rng.uniform(0, 2 * np.pi) + way * rng.uniform(0.3, 1.0)
    )
    course = _integral(curvature, way)
    heading, direction = course, course
    if kind == "back":
        direction = course + np.pi
    elif kind == "aside":
        direction = course + rng.uniform(-np.pi, np.pi)
        heading = _smooth(way / length) * rng.uniform(-1.0, 1.0)
    path = (_integral(np.cos(direction), way), _integral(np.sin(direction), way))
    at = _smooth(share) * length
    poses = np.stack([np.interp(at, way, x) for x in (*path, heading)], axis=-1)
    return share * (length / rng.uniform(0.1, 0.8)), poses


def _smooth(share: FloatArray) -> FloatArray:
    """Return the way travelled by least jerk, 0 to 1."""
    return share**3 * (10 + share * (6 * share - 15))


def _integral(values: FloatArray, at: FloatArray) -> FloatArray:
    steps = (values[1:] + values[:-1]) / 2 * np.diff(at)
    return np.concatenate([[0.0], np.cumsum(steps)])
