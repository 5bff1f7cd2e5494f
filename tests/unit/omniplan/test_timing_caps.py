"""Caps of a path hold for the fastest point of the vehicle."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from configspace import Grid, PermissibleSpace, build_space, vehicle_from_data
from omniplan import Path, Trajectory, fastest, time_path
from omniplan.motion import PoseMotion, motion_of

FloatArray = npt.NDArray[np.float64]

CORNERS = [[0.6, 0.3], [-0.5, 0.3], [-0.5, -0.4], [0.6, -0.4]]
REFERENCE = (0.2, 0.1)
ROUNDING = 1e-9
"""Of the differences: a cap is not passed between the samples either."""


def mecanum(footprint: list[list[float]]) -> PermissibleSpace:
    """A vehicle that can do far more than any cap here."""
    wheels = [
        {
            "id": f"w{i}",
            "type": "mecanum",
            "x": 0.3 * sx,
            "y": 0.2 * sy,
            "roller_deg": -45.0 * sx * sy,
            "max_speed": 50.0,
        }
        for i, (sx, sy) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1)))
    ]
    limits = {"max_acceleration": 3.0, "max_deceleration": 3.0}
    data: dict[str, Any] = {"name": "m", "wheels": wheels, "limits": limits}
    vehicle = vehicle_from_data({**data, "footprint": footprint})
    return build_space(vehicle, Grid(40, 72), cache=False)


def bend(**caps: Any) -> Path:
    """A curve whose heading turns faster and slower, and the other way round."""
    s = np.linspace(0, 1, 25)
    poses = [6 * s, np.sin(4 * s), 1.5 * np.sin(5 * s)]
    return Path.from_poses(np.stack(poses, axis=1), reference_point=REFERENCE, **caps)


def seen(trajectory: Trajectory, points: list[Any]) -> tuple[FloatArray, FloatArray]:
    """Speeds of points of the body, (n, points), and |ω|, from dense differences."""
    t = np.linspace(0, trajectory.duration, 40001)
    motion = motion_of(trajectory, is_own=False)
    assert isinstance(motion, PoseMotion)
    poses = motion.poses_at(t)
    arm = np.array([complex(*p) - complex(*REFERENCE) for p in points])
    place = (poses[:, 0] + 1j * poses[:, 1])[:, None] + np.exp(1j * poses[:, 2])[
        :, None
    ] * arm
    dt = float(t[1])
    speed = np.abs(np.diff(place, axis=0)) / dt
    return speed, np.abs(np.diff(poses[:, 2])) / dt


def test_no_corner_of_the_footprint_is_faster_than_the_cap() -> None:
    space, path = mecanum(CORNERS), bend(max_speed=0.5)
    speed, _ = seen(fastest(path, space), [*CORNERS, REFERENCE])
    assert speed.max() < 0.5 * (1 + ROUNDING)
    # Nor is it slower than the cap asks for, but where it starts and ends.
    middle = speed[4000:-4000].max(axis=1)
    assert middle.min() > 0.49
    # More than one corner is the fastest somewhere, and never a point within.
    assert np.unique(speed[4000:-4000].argmax(axis=1)).size >= 2
    rng = np.random.default_rng(3)
    low, high = np.min(CORNERS, axis=0), np.max(CORNERS, axis=0)
    within, _ = seen(fastest(path, space), rng.uniform(low, high, (20, 2)).tolist())
    assert (within.max(axis=1) <= speed.max(axis=1) + 1e-9).all()


def test_without_a_footprint_the_cap_is_that_of_the_reference_point() -> None:
    path = bend(max_speed=0.5)
    speed, _ = seen(fastest(path, mecanum([])), [*CORNERS, REFERENCE])
    assert speed[:, -1].max() < 0.5 * (1 + ROUNDING)
    assert speed[4000:-4000, -1].min() > 0.49
    assert speed.max() > 0.6


def test_a_cap_on_the_yaw_rate_is_one_of_either_direction() -> None:
    path = bend(max_yaw_rate=0.3, max_speed=1.0)
    timing = time_path(path, mecanum(CORNERS))
    speed, omega = seen(timing.raise_for_status(), CORNERS)
    assert omega.max() < 0.3 * (1 + ROUNDING)
    assert speed.max() < 1.0 * (1 + ROUNDING)
    assert omega.max() > 0.3 * (1 - 5e-3)
    assert timing.profile is not None
    assert {"PATH_SPEED", "PATH_YAW_RATE"} <= set(timing.profile.limit)


def test_a_cap_holds_on_its_piece_alone() -> None:
    caps = np.full(24, np.inf)
    caps[10:14] = 0.2
    path = bend(max_speed=caps)
    trajectory = fastest(path, mecanum(CORNERS))
    speed, _ = seen(trajectory, [*CORNERS, REFERENCE])
    x = np.interp(
        np.linspace(0, trajectory.duration, 40001)[1:],
        trajectory.t,
        trajectory.samples[:, 0],
    )
    is_slow = (x > path.poses[10, 0] + 0.005) & (x < path.poses[14, 0] - 0.005)
    assert speed[is_slow].max() < 0.2 * (1 + ROUNDING)
    assert speed[~is_slow].max() > 1.0
    slow = np.diff(x, prepend=0.0)[is_slow].size * trajectory.duration / 40000
    assert slow == pytest.approx(1.0 / 0.2, rel=0.9)
