"""The scenarios: the vehicles alike, the plans proved, the comparison of figure 1."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from configspace import InvalidInput
from omniplan import validate
from omniplan.obstacles import CollisionChecker, Obstacles
from omniplan.scenarios import SCENARIOS, Scenario, Solution, scenario, solve
from omniplan.scenarios.scenario import TITLES, space_of_platform
from omniplan.scenarios.solving import pose_of_k

PAIRS = [(task, name) for task in SCENARIOS for name in task.vehicles]


@pytest.mark.parametrize("name", TITLES)
def test_platforms_differ_in_nothing_but_the_undercarriage(name: str) -> None:
    space, other = space_of_platform(name), space_of_platform("mecanum")
    assert space.name == f"platform-{name}"
    assert space.header.footprint == other.header.footprint
    one, two = space.vehicle, other.vehicle
    assert one is not None
    assert two is not None
    assert {w.position for w in one.wheels} == {w.position for w in two.wheels}
    assert one.limits == two.limits


def test_every_platform_is_asked_for() -> None:
    assert {name for _, name in PAIRS} == set(TITLES)


@pytest.mark.parametrize("task", SCENARIOS, ids=lambda task: task.name)
def test_start_and_goal_are_free_for_all_vehicles(task: Scenario) -> None:
    hall = Obstacles.from_polygons(task.obstacles)
    for name in task.vehicles:
        space = space_of_platform(name)
        checker = CollisionChecker(space, hall, task.clearance, task.bounds)
        for pose in (task.start, task.goal):
            assert checker.is_free(pose_of_k(pose, space))
    # Without the obstacles it would be no scenario.
    corners = np.concatenate([np.array(each) for each in task.obstacles.values()])
    assert (np.ptp(corners, axis=0) > 1).all()


def test_poses_are_those_of_the_middle() -> None:
    space = space_of_platform("ackermann")  # K is 0.4 m behind
    assert pose_of_k((1.0, 2.0, 0.0), space) == pytest.approx((0.6, 2.0, 0.0))
    up = math.pi / 2
    assert pose_of_k((1.0, 2.0, up), space) == pytest.approx((1.0, 1.6, up))


def test_unknown_scenarios_are_told() -> None:
    with pytest.raises(InvalidInput, match=r"did you mean parking.* one of parking, "):
        scenario("parkin")


def assert_proved(task: Scenario, solution: Solution) -> None:
    """Hold a plan against the judges, not against what the planner says."""
    trajectory = solution.plan.raise_for_status()
    assert validate(trajectory, solution.space).valid
    checker = CollisionChecker(
        solution.space,
        Obstacles.from_polygons(task.obstacles),
        task.clearance,
        task.bounds,
    )
    assert checker.first_hit_of_trajectory(trajectory) is None
    ends = trajectory.samples[[0, -1]]
    for pose, asked in zip(ends, (task.start, task.goal), strict=True):
        x, y, theta = pose_of_k(asked, solution.space)
        assert pose[:2] == pytest.approx((x, y), abs=1e-6)
        assert math.remainder(pose[2] - theta, 2 * math.pi) == pytest.approx(
            0, abs=1e-6
        )


def test_mecanum_parks_in_the_least_area_and_ackermann_in_the_most() -> None:
    """Figure 1 of Brenner and Colomb 2022."""
    task = scenario("parking")
    solutions = {name: solve(task, name) for name in task.vehicles}
    for solution in solutions.values():
        assert_proved(task, solution)
    area = {name: one.swept_area or math.nan for name, one in solutions.items()}
    assert area["mecanum"] < area["all-wheel"] < area["ackermann"]
    # Sideways, 0.95 m: the area of the platform and 1.2 m × 0.95 m.
    assert area["mecanum"] == pytest.approx(1.2 * 0.7 + 1.2 * 0.95, abs=1e-3)
    cusps = {name: one.plan.cusps for name, one in solutions.items()}
    assert cusps["mecanum"] == 0
    assert cusps["ackermann"] >= 1
    assert cusps["all-wheel"] >= 1
    duration = {name: one.plan.duration or math.nan for name, one in solutions.items()}
    assert duration["mecanum"] < duration["all-wheel"] < duration["ackermann"]


def test_an_ackermann_vehicle_takes_the_corner_in_one_go() -> None:
    task = replace(scenario("corner"), iterations=1000)
    solution = solve(task, "ackermann")
    assert_proved(task, solution)
    assert solution.plan.stops == 0


@pytest.mark.parametrize("name", scenario("pillar").vehicles)
def test_the_load_keeps_its_heading_around_the_pillar(name: str) -> None:
    task = scenario("pillar")
    solution = solve(task, name)
    assert_proved(task, solution)
    trajectory = solution.plan.raise_for_status()
    assert np.ptp(trajectory.samples[:, 2]) < 1e-9
    assert np.ptp(trajectory.samples[:, 1]) > 0.6


@pytest.mark.slow
@pytest.mark.parametrize(
    ("task", "name"), PAIRS, ids=[f"{task.name}-{name}" for task, name in PAIRS]
)
def test_every_plan_is_proved(task: Scenario, name: str) -> None:
    assert_proved(task, solve(task, name))
