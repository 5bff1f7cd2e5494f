"""Planning with rates of the configuration as controls."""

from __future__ import annotations

import itertools
import math

import numpy as np
import numpy.typing as npt
import pytest

import configspace
import omniplan
from configspace import PermissibleSpace
from configspace.omni_curve import to_twist
from omniplan.obstacles import CollisionChecker, Obstacles
from omniplan.planning import controls
from omniplan.planning.control_kernels import LEVELS, STEPS, drive
from omniplan.planning.control_tree import rate_tables
from omniplan.planning.request import Request, checked_request
from omniplan.planning.task import RESTARTS
from omniplan.sampling.intervals import PermittedIntervals

FloatArray = npt.NDArray[np.float64]

NAMES = ("ackermann", "mecanum", "four-wheel-steering", "differential")
FINE = 0.01
HALL = (0.0, 0.0, 12.0, 8.0)
WALL = [(5.8, 0.0), (6.2, 0.0), (6.2, 4.5), (5.8, 4.5)]


@pytest.fixture(scope="module", params=NAMES)
def space(request: pytest.FixtureRequest) -> PermissibleSpace:
    return configspace.build_space(configspace.load_vehicle(request.param))


def _driven(
    space: PermissibleSpace, start: tuple[float, ...], given: FloatArray
) -> tuple[FloatArray, FloatArray]:
    states = np.empty((len(given), STEPS + 1, 5))
    ends = np.empty((len(given), 2))
    drive(
        PermittedIntervals(space).table,
        space.tables.load,
        *rate_tables(space),
        space.line_beta is not None,
        space.is_translating,
        space.kappa_g,
        FINE,
        np.array(start),
        given,
        states,
        ends,
    )
    return states, ends


def _random_controls(rng: np.random.Generator, count: int) -> FloatArray:
    shares = rng.uniform(-1, 1, (count, 2)) * 0.5
    level = rng.integers(1, len(LEVELS) + 1, count) * rng.choice([-1, 1], count)
    return np.column_stack([shares, level, rng.uniform(0.05, 1.0, count)])


def test_controls_drive_as_the_twist_says(space: PermissibleSpace) -> None:
    rng = np.random.default_rng(1)
    given = _random_controls(rng, 30)
    line = space.line_beta or 0.0
    states, ends = _driven(space, (1.0, 2.0, 0.5, 0.1, line), given)
    assert (ends[:, 0] > 0).sum() > 10
    for control, path, (_, steps) in zip(given, states, ends, strict=True):
        sign = math.copysign(1.0, control[2])
        step = sign * control[3] / STEPS
        pose = np.array([1.0, 2.0, 0.5])
        # A plain loop in 200 small steps per step, without arcs.
        for a, b in itertools.pairwise(path[: int(steps) + 1]):
            shares = (np.arange(60) + 0.5) / 60
            change = a[3:] + shares[:, None] * (b[3:] - a[3:])
            twists = to_twist(change[:, 0], change[:, 1], step / 60, space.kappa_g)
            for vx, vy, omega in twists:
                moved = complex(vx, vy) * np.exp(1j * (pose[2] + omega / 2))
                pose += [moved.real, moved.imag, omega]
            np.testing.assert_allclose(b[:3], pose, atol=2e-5)


def test_what_is_driven_is_permitted_and_within_the_rates(
    space: PermissibleSpace,
) -> None:
    rng = np.random.default_rng(2)
    given = _random_controls(rng, 200)
    line = space.line_beta or 0.0
    states, ends = _driven(space, (0.0, 0.0, 0.0, 0.4, line), given)
    kappa_rates, beta_rates = rate_tables(space)
    permitted = ends[:, 0] > 0
    assert permitted.any()
    for control, path, (time, _) in zip(
        given[permitted], states[permitted], ends[permitted], strict=True
    ):
        assert (space.v_max(path[:, 3], path[:, 4], reachable_only=True) > 0).all()
        change = np.abs(path[-1, 3:] - path[0, 3:])
        assert change[0] <= abs(control[0]) * kappa_rates.max() * time + 1e-12
        assert change[1] <= abs(control[1]) * beta_rates.max() * time + 1e-12
        # v_n v_max is driven, or a little less.
        fastest = space.v_max(path[:, 3], path[:, 4]).max()
        assert time >= control[3] / (fastest * LEVELS[int(abs(control[2])) - 1]) / 1.001


def test_controls_that_leave_what_is_permitted_end() -> None:
    space = configspace.build_space(configspace.load_vehicle("four-wheel-steering"))
    given = np.array([[0.0, 1.0, 3.0, 5.0], [0.0, 0.0, 3.0, 5.0]])
    states, ends = _driven(space, (0.0, 0.0, 0.0, 0.0, 0.3), given)
    assert ends[0, 0] < 0
    assert ends[0, 1] < STEPS
    last = states[0, int(ends[0, 1]), 4]
    assert 0.3 < last <= math.radians(40)
    assert ends[1, 0] > 0
    straight = 5.0 * np.array([math.cos(0.3), math.sin(0.3)])
    np.testing.assert_allclose(states[1, -1, :2], straight, atol=1e-9)


def test_a_plan_by_controls_is_driven_around_a_wall(space: PermissibleSpace) -> None:
    wall = Obstacles.from_polygons({"wall": WALL})
    start, goal = (2.0, 2.0, 0.0), (10.0, 3.0, 0.5)
    plan = omniplan.plan(
        start, goal, space, wall, bounds=HALL, time=30.0, seed=2, method="control"
    )
    assert plan.is_found, plan.message
    trajectory = plan.raise_for_status()
    assert omniplan.validate(trajectory, space).valid
    checker = CollisionChecker(space, wall, bounds=HALL)
    assert checker.first_hit_of_trajectory(trajectory) is None
    poses = trajectory.samples
    np.testing.assert_allclose(poses[0], start, atol=1e-9)
    end = poses[-1] - np.array(goal)
    end[2] = math.remainder(end[2], 2 * math.pi)
    np.testing.assert_allclose(end, 0, atol=1e-9)
    assert plan.statistics["planner"] == "RRT"
    assert isinstance(plan.statistics["searches"], int)
    assert plan.statistics["searches"] > 1


def test_a_blocked_goal_is_out_of_reach_in_time() -> None:
    space = configspace.build_space(configspace.load_vehicle("mecanum"))
    wall = Obstacles.from_polygons([[(5.8, 0), (6.2, 0), (6.2, 8), (5.8, 8)]])
    plan = omniplan.plan(
        (2, 2, 0), (10, 3, 0), space, wall, bounds=HALL, time=0.5, method="control"
    )
    assert not plan.is_found
    assert plan.trajectory is None


def test_kpiece_explores_as_well() -> None:
    space = configspace.build_space(configspace.load_vehicle("mecanum"))
    wall = Obstacles.from_polygons([WALL])
    plan = omniplan.plan(
        (2, 2, 0),
        (10, 3, 0.5),
        space,
        wall,
        bounds=HALL,
        time=30.0,
        planner="KPIECE1",
        method="control",
    )
    assert plan.is_found, plan.message


def test_a_synchro_drive_is_driven_by_controls_too() -> None:
    space = configspace.build_space(configspace.load_vehicle("synchro-drive"))
    wall = Obstacles.from_polygons([WALL])
    start, goal = (2, 2, 0), (10, 3, 0)
    plan = omniplan.plan(
        start, goal, space, wall, bounds=HALL, time=60.0, method="control"
    )
    trajectory = plan.raise_for_status()
    assert np.ptp(trajectory.samples[:, 2]) < 1e-9
    checker = CollisionChecker(space, wall, bounds=HALL)
    assert checker.first_hit_of_trajectory(trajectory) is None


WHOLE = {"mecanum": 20_000, "ackermann": 4_000}


def _around_a_box(name: str, seed: int, motions: int) -> omniplan.Plan:
    space = configspace.build_space(configspace.load_vehicle(name))
    box = Obstacles.from_polygons([[(3, -1), (4, -1), (4, 1.2), (3, 1.2)]])
    return omniplan.plan(
        (0, 0, 0),
        (7, 0, 0),
        space,
        box,
        bounds=(-3, -5, 10, 5),
        time=60.0,
        seed=seed,
        iterations=motions,
        method="control",
    )


@pytest.mark.parametrize("name", WHOLE)
def test_with_motions_left_quicker_ways_are_searched(name: str) -> None:
    first = _around_a_box(name, 5, 1900)
    last = _around_a_box(name, 5, WHOLE[name])
    assert first.duration is not None
    assert last.duration is not None
    assert last.duration < 0.8 * first.duration
    assert isinstance(last.statistics["iterations"], int)
    assert last.statistics["iterations"] > 1900


def test_the_same_seed_and_motions_give_the_same_plan() -> None:
    one, other = (_around_a_box("mecanum", 4, 9000) for _ in range(2))
    np.testing.assert_array_equal(
        one.raise_for_status().samples, other.raise_for_status().samples
    )
    assert one.statistics["iterations"] == other.statistics["iterations"]


def _request(planner: str, motions: int) -> Request:
    space = configspace.build_space(configspace.load_vehicle("mecanum"))
    return checked_request(
        (2, 2, 0),
        (10, 3, 0.5),
        space,
        Obstacles.from_polygons([WALL]),
        bounds=HALL,
        clearance=0.0,
        planner=planner,
        time=60.0,
        seed=1,
        iterations=motions,
        method="control",
        heading="free",
        checkpoint=None,
    )


def test_searches_are_counted_and_routes_start_and_end_as_asked() -> None:
    request = _request("RRT", 30_000)
    found = controls.explored(request.task, request.connector)
    assert found.searches > RESTARTS
    assert 0 < found.first_at < request.task.budget.elapsed
    assert found.routes
    for route in found.routes:
        np.testing.assert_allclose(route.poses[0], (2, 2, 0), atol=1e-9)
        end = route.poses[-1] - np.array([10, 3, 0.5])
        end[2] = math.remainder(end[2], 2 * math.pi)
        np.testing.assert_allclose(end, 0, atol=1e-9)


def test_a_search_without_a_way_is_the_only_one() -> None:
    request = _request("RRT", 3)
    found = controls.explored(request.task, request.connector)
    assert found == controls.Explored((), math.inf, 1)


def test_the_planner_named_is_the_one_that_explores() -> None:
    def poses(planner: str) -> FloatArray:
        request = _request(planner, 4000)
        return controls.explored(request.task, request.connector).routes[0].poses

    np.testing.assert_array_equal(poses("RRTConnect"), poses("RRT"))
    assert not np.array_equal(poses("KPIECE1"), poses("RRT"))
    for planner in ("RRTstar", "BKPIECE1"):
        with pytest.raises(configspace.InvalidInput, match="one of RRT, KPIECE1"):
            _request(planner, 4000)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_plan() -> None:
    space = configspace.build_space(configspace.load_vehicle("mecanum"))
    wall = Obstacles.from_polygons([WALL])

    def duration(seed: int) -> float | None:
        return omniplan.plan(
            (2, 2, 0),
            (10, 3, 0.5),
            space,
            wall,
            bounds=HALL,
            time=60.0,
            seed=seed,
            method="control",
        ).duration

    assert duration(5) == duration(5)
    # The searches of neighbouring seeds are partly the same.
    assert duration(5) != duration(500)
