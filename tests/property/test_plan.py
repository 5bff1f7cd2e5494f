"""Plans of random vehicles in random halls keep everything they promise."""

from __future__ import annotations

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from planned import assert_drivable
from random_halls import bodied_vehicle, random_hall, size_of

import configspace
import omniplan
from configspace import Grid
from configspace.testing import ALL_KINDS, VehicleKind
from omniplan import PlanStatus
from omniplan.obstacles import Obstacles

ANSWERS = (PlanStatus.FOUND, PlanStatus.TIMEOUT, PlanStatus.UNREACHABLE)


def assert_kept(kind: VehicleKind, seed: int) -> None:
    rng = np.random.default_rng(seed)
    vehicle = bodied_vehicle(rng, kind)
    space = configspace.build_space(vehicle, Grid(80, 120), cache=False)
    start, goal, hall = random_hall(rng, size_of(vehicle))
    if space.is_translating:
        goal = (*goal[:2], start[2])
    found = omniplan.plan(
        start, goal, space, Obstacles.from_polygons(hall), time=5, iterations=100
    )
    assert found.status in ANSWERS, found.message
    if found.status is PlanStatus.FOUND:
        assert_drivable(found, space, start, goal, hall)


@settings(max_examples=3, deadline=None)
@given(st.sampled_from(ALL_KINDS), st.integers(0, 2**32 - 1))
def test_what_is_found_is_valid_and_free_from_start_to_goal(
    kind: VehicleKind, seed: int
) -> None:
    assert_kept(kind, seed)


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(st.sampled_from(ALL_KINDS), st.integers(0, 2**32 - 1))
def test_what_is_found_is_valid_and_free_for_many(kind: VehicleKind, seed: int) -> None:
    assert_kept(kind, seed)
