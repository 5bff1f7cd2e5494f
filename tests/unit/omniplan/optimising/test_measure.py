"""The measure of a change, against point by point and segment by segment."""

from __future__ import annotations

import itertools
import math

import numpy as np
import numpy.typing as npt
import pytest
from nearest_ways import change_between

from omniplan import Trajectory
from omniplan.motion import PoseMotion
from omniplan.optimising.measure import change_of, nearest_on

FloatArray = npt.NDArray[np.float64]


def dense(trajectory: Trajectory, count: int = 800) -> FloatArray:
    t = np.linspace(trajectory.t[0], trajectory.t[-1], count + 1)
    motion = PoseMotion(trajectory.t, trajectory.samples, 0j)
    return np.asarray(motion.poses_at(t))


def wander(rng: np.random.Generator, n: int = 12) -> Trajectory:
    poses = np.cumsum(rng.normal(0, 0.2, (n, 3)), axis=0)
    return Trajectory.from_poses(np.linspace(0, 5, n), poses)


@pytest.mark.parametrize("seed", range(2))
def test_it_is_what_the_plain_reading_says(seed: int) -> None:
    rng = np.random.default_rng(seed)
    one, other = wander(rng), wander(rng)
    way = dense(other, 25)
    found = change_of(one, way, 0j, 1.25)
    assert found == pytest.approx(change_between(dense(one), way, 0.8), rel=1e-9)


def test_far_from_the_origin_it_is_the_same() -> None:
    rng = np.random.default_rng(0)
    one, way = wander(rng), dense(wander(rng), 60)
    far = np.array([5e4, -2e4, 0.0])
    moved = Trajectory.from_poses(one.t, one.samples + far)
    found = change_of(moved, way + far, 0j, 1.25)
    assert found == pytest.approx(change_of(one, way, 0j, 1.25), rel=1e-6)


def test_a_shift_counts_as_it_is_and_a_turn_by_the_lever() -> None:
    line = np.linspace([0.0, 0, 0], [4, 0, 0], 30)
    for off, size in (([0, 0.03, 0], 0.03), ([0, 0, 0.1], 0.1 / 1.25)):
        made = Trajectory.from_poses(np.linspace(0, 9, 30), line + np.array(off))
        assert change_of(made, line, 0j, 1.25) == pytest.approx((size, size))


def test_what_is_left_out_is_a_change_as_well() -> None:
    """A loop of 0.5 m radius that the result does not drive."""
    a = np.linspace(0, 2 * math.pi, 200)
    loop = np.stack([2 + 0.5 * np.sin(a), 0.5 * (1 - np.cos(a)), a], axis=-1)
    lead = np.linspace([0.0, 0, 0], [2, 0, 0], 50)[:-1]
    out = np.linspace([2.0, 0, 2 * math.pi], [4, 0, 2 * math.pi], 50)[1:]
    way = np.concatenate([lead, loop, out]) * [1, 1, 0]
    straight = np.linspace([0.0, 0, 0], [4, 0, 0], 30)
    made = Trajectory.from_poses(np.linspace(0, 9, 30), straight)
    mean, largest = change_of(made, way, 0j, 1.25)
    assert largest == pytest.approx(1.0, rel=1e-3)
    assert mean > 0.3


def test_the_nearest_places_are_on_the_steps_told() -> None:
    rng = np.random.default_rng(1)
    way, points = rng.normal(0, 1, (20, 3)), rng.normal(0, 1, (50, 3))
    places, steps = nearest_on(points, way)
    fine = np.concatenate([np.linspace(a, b, 400) for a, b in itertools.pairwise(way)])
    for point, place, step in zip(points, places, steps, strict=True):
        least = float(np.linalg.norm(fine - point, axis=1).min())
        off = float(np.linalg.norm(point - place))
        assert least - 0.01 < off <= least + 1e-12
        assert np.abs(np.diff(way, axis=0) - step).sum(axis=1).min() < 1e-12
