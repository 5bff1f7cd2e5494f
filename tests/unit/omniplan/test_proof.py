"""Halving the parts of a motion until every limit is decided."""

from __future__ import annotations

import numpy as np
import pytest

import configspace
from omniplan import Trajectory, validate


@pytest.fixture(scope="module")
def space() -> configspace.PermissibleSpace:
    """Four wheels of ±100°, so that most motions fit one representation only."""
    wheels = [
        {
            "id": f"w{i}",
            "type": "steered",
            "x": x,
            "y": y,
            "max_speed": 5.0,
            "steering_range_deg": [-100, 100],
        }
        for i, (x, y) in enumerate([(0.5, 0.3), (-0.5, 0.3), (-0.5, -0.3), (0.5, -0.3)])
    ]
    vehicle = configspace.vehicle_from_data(
        {"name": "limited", "wheels": wheels, "limits": {"max_speed": 1.0}}
    )
    return configspace.build_space(vehicle, cache=False)


def backwards(seed: int) -> Trajectory:
    rng = np.random.default_rng(seed)
    heading = np.cumsum(rng.normal(0, 0.4, 6))
    course = heading + np.cumsum(rng.normal(0, 0.4, 6))
    steps = -0.6 * np.stack([np.cos(course), np.sin(course)], axis=1)
    poses = np.concatenate([np.cumsum(steps, axis=0), heading[:, None]], axis=1)
    return Trajectory.from_poses(np.linspace(0, 4, 6), poses)


@pytest.mark.parametrize("seed", [12, 15, 22, 39, 42, 50, 56])
def test_too_fast_hides_nothing_of_the_configuration(
    space: configspace.PermissibleSpace, seed: int
) -> None:
    """What is only too fast is not also reported as out of a steering range."""
    trajectory = backwards(seed)
    factor = validate(trajectory, space).speed_factor
    assert factor > 1
    report = validate(trajectory.scaled(1.02 * factor), space)
    assert {v.limit for v in report.violations} == {"SPEED"}
    assert report.speed_factor == pytest.approx(1 / 1.02, rel=2e-3)
