"""Vehicles with limits on every rate, and paths for them."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from configspace import Vehicle, vehicle_from_data
from configspace.testing import VehicleKind, random_vehicle
from omniplan import Path, Trajectory
from omniplan.motion import PoseMotion, motion_of

FloatArray = npt.NDArray[np.float64]

SOON = 1e-3
"""A moment after rest, as a share of the step that starts with it."""


def demanding_vehicle(rng: np.random.Generator, kind: VehicleKind) -> Vehicle:
    """A random vehicle with limits on accelerations and on steering."""
    data: dict[str, Any] = random_vehicle(rng, kind).model_dump(
        mode="json", exclude_none=True
    )
    data["name"] = "demanding"
    limits = data.setdefault("limits", {})
    limits["max_acceleration"] = float(rng.uniform(0.2, 2))
    limits["max_deceleration"] = float(rng.uniform(0.2, 2))
    for wheel in data["wheels"]:
        kind_of = wheel["type"]
        if kind_of == "castor":
            continue
        wheel["max_acceleration"] = float(rng.uniform(0.3, 3))
        if kind_of in {"steered", "turntable"}:
            wheel.pop("steering_range_deg", None)
            wheel["max_steering_rate_deg"] = float(rng.uniform(40, 200))
            if rng.random() < 0.5:
                rate = float(rng.uniform(100, 1000))
                wheel["max_steering_acceleration_deg"] = rate
    return vehicle_from_data(data)


def swinging_vehicle(rng: np.random.Generator, kind: VehicleKind) -> Vehicle:
    """A random vehicle all of whose steered wheels have steering accelerations."""
    data = demanding_vehicle(rng, kind).model_dump(mode="json", exclude_none=True)
    for wheel in data["wheels"]:
        if wheel["type"] in {"steered", "turntable"}:
            rate = float(rng.uniform(100, 1000))
            wheel.setdefault("max_steering_acceleration_deg", rate)
    return vehicle_from_data(data)


def smooth_path(rng: np.random.Generator, n: int = 6) -> Path:
    """A path whose direction and heading wander, without stops."""
    course = rng.uniform(-np.pi, np.pi) + np.cumsum(rng.uniform(-0.4, 0.4, n))
    step = rng.uniform(0.3, 0.8) * np.exp(1j * course)
    theta = np.cumsum(rng.uniform(-0.3, 0.3, n))
    p = np.cumsum(step)
    poses = np.stack([p.real, p.imag, theta], axis=1)
    point = tuple(rng.uniform(-0.3, 0.3, 2).tolist())
    return Path.from_poses(poses, reference_point=point)


def assert_rests(trajectory: Trajectory, stops: int) -> None:
    """At both ends and at so many stops the motion comes to rest and from rest.

    Seen from its poses alone, shortly after each rest and before it.
    """
    motion = motion_of(trajectory, is_own=False)
    assert isinstance(motion, PoseMotion)
    moves = np.linalg.norm(np.diff(trajectory.samples, axis=0), axis=1) > 1e-12
    edges = np.flatnonzero(np.diff(moves, prepend=False, append=False))
    assert edges.size == 2 * (stops + 1)
    t = trajectory.t
    leaves = [(t[k], t[k + 1]) for k in edges[::2].tolist()]
    arrives = [(t[k], t[k - 1]) for k in edges[1::2].tolist()]
    for rest, next_ in (*leaves, *arrives):
        moments = rest + np.array([0.0, SOON, 1.0]) * (next_ - rest)
        poses = motion.poses_at(moments)
        early, whole = np.linalg.norm(poses[1:] - poses[0], axis=1)
        # A pull that falls to zero within the step gives the most, 3/2 SOON².
        blur = 1e-15 * np.abs(poses).max()
        assert early < 4 * SOON**2 * whole + blur, rest
