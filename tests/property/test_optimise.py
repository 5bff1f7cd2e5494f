"""What `omniplan.optimise` returns, for random vehicles and manoeuvres."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import random_motions
from hypothesis import given, settings
from hypothesis import strategies as st
from optimised import assert_kept
from spoiled_motions import CLEARANCE, MISTAKES, REACH, Mistake, mistakes_of, spoiled
from timing_cases import demanding_vehicle

from configspace import (
    Grid,
    PermissibleSpace,
    Vehicle,
    build_space,
    load_vehicle,
    vehicle_from_data,
)
from configspace.testing import VehicleKind
from omniplan import PlanStatus, optimise, time_path, validate
from omniplan.motion import PoseMotion
from omniplan.obstacles import CollisionChecker

KINDS: tuple[VehicleKind, ...] = ("mecanum", "omni", "steered", "ackermann", "loaded")


def without_swing(vehicle: Vehicle) -> Vehicle:
    """The vehicle without limits on steering accelerations, which take long to time."""
    data = vehicle.model_dump(mode="json", exclude_none=True)
    for wheel in data["wheels"]:
        wheel.pop("max_steering_acceleration_deg", None)
    return vehicle_from_data(data)


@settings(max_examples=2, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.sampled_from(KINDS))
def test_what_is_returned_is_drivable_and_no_slower_than_the_fastest_timing(
    seed: int, kind: VehicleKind
) -> None:
    assert_improved(seed, kind)


@pytest.mark.slow
@pytest.mark.timeout(1800)
@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from((*KINDS, "offset", "turntable")))
def test_likewise_for_many(seed: int, kind: VehicleKind) -> None:
    assert_improved(seed, kind)


@settings(max_examples=3, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.sampled_from(MISTAKES))
def test_what_is_mended_is_drivable(seed: int, mistake: Mistake) -> None:
    assert_mended(seed, "ackermann", mistake)


@pytest.mark.slow
@pytest.mark.timeout(1800)
@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from(sorted(REACH)), st.data())
def test_likewise_mended(seed: int, name: str, data: st.DataObject) -> None:
    assert_mended(seed, name, data.draw(st.sampled_from(mistakes_of(name))))


def assert_mended(seed: int, name: str, mistake: Mistake) -> None:
    """A valid trajectory near the one given with its ends, or an honest no."""
    case, space = spoiled(np.random.default_rng(seed), name, mistake), space_of(name)
    clearance = 0.0 if case.obstacles is None else CLEARANCE
    plan = optimise(
        case.trajectory,
        space,
        case.obstacles,
        objective="change",
        clearance=clearance,
        time=60.0,
    )
    if not plan.is_found:
        assert plan.trajectory is None
        assert plan.status is not PlanStatus.TIMEOUT
        assert plan.place is not None
        assert mistake in plan.message
        return
    trajectory = plan.raise_for_status()
    assert validate(trajectory, space).valid
    given = case.trajectory.samples
    np.testing.assert_allclose(trajectory.samples[[0, -1]], given[[0, -1]], atol=1e-6)
    if mistake in {"fast", "jerky"}:
        assert plan.statistics["largest_change"] == 0
    if case.obstacles is not None:
        checker = CollisionChecker(space, case.obstacles, clearance)
        t = np.linspace(trajectory.t[0], trajectory.t[-1], 800)
        motion = PoseMotion(trajectory.t, trajectory.samples, 0j)
        assert checker.are_free(motion.poses_at(t)).all()


@cache
def space_of(name: str) -> PermissibleSpace:
    return build_space(load_vehicle(name), cache=False)


def assert_improved(seed: int, kind: VehicleKind) -> None:
    rng = np.random.default_rng(seed)
    vehicle = without_swing(demanding_vehicle(rng, kind))
    space = build_space(vehicle, Grid(40, 72), cache=False)
    path = random_motions.random_poses(rng, vehicle, space)
    plan = optimise(path, space, intervals=10, max_iterations=40, time=60.0)
    timing = time_path(path, space)
    if not plan.is_found:
        assert timing.trajectory is None
        assert not validate(path, space).valid
        assert plan.status not in {PlanStatus.FOUND, PlanStatus.TIMEOUT}
        assert plan.message
        return
    trajectory = plan.raise_for_status()
    assert validate(trajectory, space).valid
    if timing.trajectory is not None:
        assert trajectory.duration <= timing.trajectory.duration * (1 + 1e-9)
    assert_kept(trajectory, space, per_interval=3)
