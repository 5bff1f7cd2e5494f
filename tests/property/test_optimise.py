"""What `omniplan.optimise` returns, for random vehicles and manoeuvres."""

from __future__ import annotations

import naive_limits
import naive_motion
import numpy as np
import pytest
import random_motions
from hypothesis import given, settings
from hypothesis import strategies as st
from timing_cases import demanding_vehicle

from configspace import Grid, Vehicle, build_space, vehicle_from_data
from configspace.testing import VehicleKind
from omniplan import PlanStatus, optimise, time_path, validate

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
@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from((*KINDS, "offset", "turntable")))
def test_likewise_for_many(seed: int, kind: VehicleKind) -> None:
    assert_improved(seed, kind)


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
    simulation = naive_motion.simulate(
        vehicle, trajectory.t, random_motions.motion_of(trajectory), per_interval=3
    )
    assert naive_limits.breaches(simulation) == []
