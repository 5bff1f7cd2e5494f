"""Poses become C² splines on SE(2); the report says so."""

from collections.abc import Callable

import numpy as np
import pytest

import configspace
from omniplan import Trajectory, validate
from omniplan.motion import Motion, PoseMotion, motion_of, stops_of


def wavy(n: int, seed: int) -> Trajectory:
    """A winding drive that turns several times, its headings given wrapped."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.2, 0.6, n))
    course = np.cumsum(rng.normal(0.1, 0.25, n))
    xy = np.cumsum(np.stack([np.cos(course), np.sin(course)], axis=-1) * 0.3, axis=0)
    theta = np.cumsum(rng.uniform(0.2, 0.9, n))
    wrapped = np.arctan2(np.sin(theta), np.cos(theta))
    return Trajectory.from_poses(t, np.column_stack([xy, wrapped]))


def splines(trajectory: Trajectory) -> PoseMotion:
    motion: Motion = motion_of(trajectory, is_own=False)
    assert isinstance(motion, PoseMotion)
    return motion


@pytest.mark.parametrize("seed", range(8))
def test_poses_are_twice_differentiable_between_stops(seed: int) -> None:
    trajectory = wavy(25, seed)
    motion = splines(trajectory)
    stop = stops_of(trajectory.samples)
    inner = trajectory.t[1:-1][~stop[1:-1]]
    assert inner.size > 5
    h = 1e-3
    one = np.arange(4) * h
    # Value, slope and curvature from either side, by differences of third order.
    weights = np.array(
        [[1, 0, 0, 0], [-11 / 6, 3, -1.5, 1 / 3], [2, -5, 4, -1]]
    ) / np.array([[1], [h], [h**2]])
    for t in inner:
        behind = weights @ motion.poses_at(t + one)
        before = weights @ motion.poses_at(t - one) * [[1], [-1], [1]]
        assert np.abs(behind - before).max(axis=1) == pytest.approx([0, 0, 0], abs=1e-6)


def test_the_heading_is_unwrapped() -> None:
    trajectory = wavy(40, 3)
    motion = splines(trajectory)
    dense = motion.poses_at(np.linspace(trajectory.t[0], trajectory.t[-1], 5000))
    assert np.ptp(dense[:, 2]) > 4 * np.pi
    assert np.abs(np.diff(dense[:, 2])).max() < 0.1
    assert motion.poses_at(trajectory.t) == pytest.approx(trajectory.samples, abs=1e-9)


def test_the_report_names_the_interpolation(
    space_of: Callable[[str], configspace.PermissibleSpace],
) -> None:
    report = validate(wavy(10, 1), space_of("mecanum"))
    assert report.interpolation == PoseMotion.interpolation
    for word in ("C²", "x, y and heading", "at rest"):
        assert word in report.interpolation
