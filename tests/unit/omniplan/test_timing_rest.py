"""Timings start and end at rest, and what reads their samples sees that."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from timing_cases import assert_rests

from configspace import Grid, PermissibleSpace, build_space, vehicle_from_data
from omniplan import Path, time_path, validate

TOP, SLOW = 2.0, 0.2
STEPS = 8
"""So few that a slow pace is reached within one."""


def mecanum(**limits: float) -> PermissibleSpace:
    """A vehicle whose accelerations nothing bounds but these limits."""
    wheels = [
        {
            "id": f"w{i}",
            "type": "mecanum",
            "x": 0.3 * sx,
            "y": 0.2 * sy,
            "roller_deg": -45.0 * sx * sy,
            "max_speed": TOP,
        }
        for i, (sx, sy) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1)))
    ]
    data: dict[str, Any] = {"name": "m", "wheels": wheels, "limits": limits}
    return build_space(vehicle_from_data(data), Grid(20, 36), cache=False)


LIMITS: tuple[dict[str, float], ...] = (
    {},
    {"max_acceleration": 1.0, "max_deceleration": 1.5},
)


@pytest.mark.parametrize("limits", LIMITS, ids=["free", "bounded"])
@pytest.mark.parametrize("slow", [(0,), (-1,), (0, -1)], ids=str)
def test_who_crawls_at_an_end_rests_there(
    slow: tuple[int, ...], limits: dict[str, float]
) -> None:
    """From rest to a slow pace takes far less than a step."""
    s = np.linspace(0, 1, 21)
    caps = np.full(20, np.inf)
    caps[list(slow)] = SLOW
    path = Path.from_poses(
        np.stack([4 * s, np.sin(s), 0.3 * s], axis=1), max_speed=caps
    )
    space = mecanum(**limits)
    trajectory = time_path(path, space, steps=STEPS).raise_for_status()
    assert_rests(trajectory, 0)
    assert validate(trajectory, space).valid


@pytest.mark.parametrize("limits", LIMITS, ids=["free", "bounded"])
def test_who_crawls_beside_a_stop_rests_there(limits: dict[str, float]) -> None:
    s = np.linspace(0, 1, 11)
    there = np.stack([2 * s, 0.3 * s**2, 0 * s], axis=1)
    poses = np.concatenate([there, there[-2::-1]])
    caps = np.full(20, np.inf)
    caps[[0, 9, 10, 19]] = SLOW
    space = mecanum(**limits)
    path = Path.from_poses(poses, max_speed=caps)
    trajectory = time_path(path, space, steps=STEPS).raise_for_status()
    assert_rests(trajectory, 1)
    assert validate(trajectory, space).valid


@pytest.mark.parametrize("size", [1e-4, 1e-3])
def test_where_steps_cannot_be_halved_a_dwell_shows_the_rest(size: float) -> None:
    s = np.linspace(0, 1, 21)
    caps = np.full(20, np.inf)
    caps[[0, -1]] = SLOW
    poses = size * np.stack([4 * s, np.sin(s), 0.3 * s], axis=1)
    space, path = mecanum(), Path.from_poses(poses, max_speed=caps)
    trajectory = time_path(path, space, steps=STEPS).raise_for_status()
    assert (trajectory.samples[:2] == trajectory.samples[0]).all()
    assert_rests(trajectory, 0)
    assert validate(trajectory, space).valid


def test_who_crawls_for_long_is_sampled_often_enough_where_it_turns() -> None:
    """Else its heading would turn so far from sample to sample that none could tell."""
    s = np.linspace(0, 1, 21)
    caps = np.full(20, np.inf)
    caps[[0, -1]] = 1e-4
    poses = 100 * np.stack([4 * s, np.sin(s), 0.3 * s], axis=1)
    space, path = mecanum(), Path.from_poses(poses, max_speed=caps)
    trajectory = time_path(path, space, steps=STEPS).raise_for_status()
    assert_rests(trajectory, 0)
    assert np.abs(np.diff(trajectory.samples[:, 2])).max() < np.pi / 3
