"""Plans for every kind of undercarriage, and every way to say no."""

from __future__ import annotations

import dataclasses
import functools
import math
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from planned import assert_drivable

import configspace
import omniplan
from configspace import Grid, InvalidInput, PermissibleSpace
from omniplan import NoPlanFound, Plan, PlanStatus
from omniplan.obstacles import CollisionChecker, Obstacles
from omniplan.planning.hall import checkers
from omniplan.planning.search import PLANNERS

HALL = {
    "wall": [(2.0, -3.0), (2.3, -3.0), (2.3, 0.6), (2.0, 0.6)],
    "shelf": [(3.5, -1.0), (5.5, -1.0), (5.5, -0.2), (3.5, -0.2)],
}
BOUNDS = (-2.5, -4.0, 8.0, 5.0)
PATIENT = 60.0
MOTIONS = dict.fromkeys(PLANNERS, 200) | {"BITstar": 1500, "FMT": 1500}
"""How many motions planners need until they have found a way round the wall."""


@functools.cache
def space_of(name: str) -> PermissibleSpace:
    vehicle = configspace.load_vehicle(name)
    return configspace.build_space(vehicle, Grid(100, 180), cache=False)


def plan_in_hall(name: str, goal: tuple[float, ...], **options: Any) -> Plan:
    return omniplan.plan(
        (0.0, 0.0, 0.0),
        goal,
        space_of(name),
        Obstacles.from_polygons(HALL),
        bounds=BOUNDS,
        **{"time": PATIENT, "iterations": 250, "clearance": 0.02, **options},
    )


@pytest.mark.parametrize(
    "name",
    [
        "mecanum",
        "ackermann",
        *(
            pytest.param(name, marks=pytest.mark.slow)
            for name in ("differential", "ift-four-steered", "four-wheel-steering")
        ),
    ],
)
def test_the_way_round_a_wall_is_found_and_can_be_driven(name: str) -> None:
    goal = (5.0, 1.2, -0.8)
    found = plan_in_hall(name, goal)
    assert_drivable(found, space_of(name), (0, 0, 0), goal, HALL, 0.02, BOUNDS)
    statistics = found.statistics
    assert 0 < float(statistics["time_to_first"]) <= float(statistics["time"])
    assert statistics["planner"] == "RRTConnect"
    assert 0 < int(statistics["iterations"]) <= 250


@pytest.mark.slow
@pytest.mark.parametrize("name", configspace.catalog())
def test_every_ready_vehicle_finds_its_way_or_says_why_not(name: str) -> None:
    vehicle = configspace.load_vehicle(name)
    assert vehicle.footprint is not None
    size = max(abs(complex(*corner)) for corner in vehicle.footprint)
    space = space_of(name)
    scale = 2.5 * size
    wall = {
        "wall": [(scale, -scale), (1.2 * scale, -scale), (1.2 * scale, 0.4 * scale)]
    }
    goal = (2.5 * scale, -0.3 * scale, 0.0)
    found = omniplan.plan(
        (0, 0, 0),
        goal,
        space,
        Obstacles.from_polygons(wall),
        time=PATIENT,
        iterations=300,
    )
    assert_drivable(found, space, (0, 0, 0), goal, wall)


@pytest.mark.parametrize(
    "planner",
    [
        "RRT",
        "RRTstar",
        *(
            pytest.param(name, marks=pytest.mark.slow)
            for name in PLANNERS
            if name not in ("RRT", "RRTstar", "RRTConnect")
        ),
    ],
)
def test_every_planner_on_the_list_can_be_asked(planner: str) -> None:
    goal = (5.0, 1.2, 0.0)
    found = plan_in_hall("mecanum", goal, planner=planner, iterations=MOTIONS[planner])
    assert found.statistics["planner"] == planner
    assert_drivable(found, space_of("mecanum"), (0, 0, 0), goal, HALL, 0.02, BOUNDS)


def test_the_same_seed_gives_the_same_plan_and_another_one_another() -> None:
    first, again, other = (
        plan_in_hall("mecanum", (5.0, 1.2, -0.8), seed=seed, iterations=60)
        for seed in (3, 3, 4)
    )
    assert first.trajectory is not None
    assert again.trajectory is not None
    assert other.trajectory is not None
    np.testing.assert_array_equal(first.trajectory.samples, again.trajectory.samples)
    np.testing.assert_array_equal(first.trajectory.t, again.trajectory.t)
    assert first.duration != other.duration


def test_one_move_needs_no_stop_and_takes_the_least_time() -> None:
    space = space_of("ift-four-steered")
    found = omniplan.plan((0, 0, 0), (2, 1, 0), space)
    assert_drivable(found, space, (0, 0, 0), (2, 1, 0), {})
    assert found.stops == 0
    assert found.duration is not None
    line = omniplan.Path.from_poses([[0.0, 0.0, 0.0], [1.0, 0.5, 0.0], [2.0, 1.0, 0.0]])
    best = omniplan.fastest(line, space).duration
    assert found.duration == pytest.approx(best, rel=0.01)


def test_a_configuration_at_both_ends_costs_the_time_to_steer() -> None:
    space = space_of("ift-four-steered")
    free = omniplan.plan((0, 0, 0), (2, 0, 0), space)
    bound = omniplan.plan((0, 0, 0, 0, math.pi / 2), (2, 0, 0, 2.0, 0.7), space)
    assert_drivable(bound, space, (0, 0, 0), (2, 0, 0), {})
    assert free.duration is not None
    assert bound.duration is not None
    quarter = 90 / 180  # s, each wheel by itself at its largest rate
    assert bound.duration > free.duration + quarter
    t, samples = bound.trajectory.t, bound.trajectory.samples  # type: ignore[union-attr]
    np.testing.assert_array_equal(samples[0], samples[1])
    assert t[1] - t[0] >= quarter
    # At the pole any β is the same configuration.
    other = omniplan.plan((0, 0, 0, 0, math.pi / 2), (2, 0, 0, 2.0, -2.0), space)
    assert other.duration == pytest.approx(bound.duration, abs=1e-6)


def test_a_goal_that_differs_by_full_turns_is_the_same_goal() -> None:
    space = space_of("mecanum")
    one = omniplan.plan((0, 0, 0), (1, 0, 0.5), space)
    other = omniplan.plan((0, 0, 0), (1, 0, 0.5 + 4 * math.pi), space)
    assert one.duration == pytest.approx(other.duration)


@pytest.mark.parametrize("turn", [0.0, 2 * math.pi])
def test_start_as_goal_is_a_plan_that_stands_still(turn: float) -> None:
    found = omniplan.plan((1, 2, 0.3), (1, 2, 0.3 + turn), space_of("ackermann"))
    assert found.is_found
    assert found.duration is not None
    assert found.duration < 0.01
    assert found.report is not None
    assert found.report.valid


def test_start_as_goal_with_other_wheels_takes_the_time_to_turn_them() -> None:
    found = omniplan.plan(
        (1, 2, 0, 0, 0), (1, 2, 0, 0, math.pi / 2), space_of("ift-four-steered")
    )
    assert found.is_found
    assert found.duration is not None
    assert found.duration >= 0.5


def test_a_start_or_goal_that_is_not_free_names_what_stands_there() -> None:
    blocked = plan_in_hall("mecanum", (4.5, -0.6, 0.0))
    assert blocked.status is PlanStatus.GOAL_BLOCKED
    assert "shelf" in blocked.message
    assert blocked.place == (4.5, -0.6, 0.0)
    with pytest.raises(NoPlanFound, match="shelf"):
        blocked.raise_for_status()
    at_start = omniplan.plan(
        (2.1, 0, 0), (0, 0, 0), space_of("mecanum"), Obstacles.from_polygons(HALL)
    )
    assert at_start.status is PlanStatus.START_BLOCKED
    assert "wall" in at_start.message
    outside = plan_in_hall("mecanum", (20.0, 0.0, 0.0))
    assert outside.status is PlanStatus.GOAL_BLOCKED
    assert "bounds" in outside.message


def test_a_configuration_that_is_not_permitted_names_wheel_and_limit() -> None:
    space = space_of("ift-four-steered")
    start, goal = (0, 0, 0, 0, math.pi), (2, 0, 0)
    refused = omniplan.plan(start, goal, space)
    assert refused.status is PlanStatus.START_NOT_PERMITTED
    assert "STEER_RANGE" in refused.message
    assert "wheel" in refused.message
    back = omniplan.plan(goal, start, space)
    assert back.status is PlanStatus.GOAL_NOT_PERMITTED
    assert back.place == (0, 0, 0)


def test_a_synchro_drive_keeps_its_heading() -> None:
    space = space_of("synchro-drive")
    refused = omniplan.plan((0, 0, 0), (2, 1, 0.5), space)
    assert refused.status is PlanStatus.UNREACHABLE
    assert "28.6°" in refused.message
    goal = (5.0, 1.2, 0.0)
    found = plan_in_hall("synchro-drive", goal, iterations=60)
    assert_drivable(found, space, (0, 0, 0), goal, HALL, 0.02, BOUNDS)


def test_who_moves_only_as_it_turns_whirls_to_the_goal() -> None:
    """The wheels' ranges of this vehicle permit nothing near κ_n = 0."""
    space = space_of("robotis-ffw")
    for goal in ((1.0, 0.4, 0.5), (0.05, 0.0, -0.5)):
        found = omniplan.plan((0, 0, 0), goal, space)
        assert_drivable(found, space, (0, 0, 0), goal, {})
        assert found.stops == 0
        headings = found.raise_for_status().samples[:, 2]
        assert abs(headings[-1] - headings[0]) >= 4.0 * math.hypot(*goal[:2])


@pytest.mark.parametrize("name", ["mecanum", "four-wheel-steering"])
def test_the_heading_is_kept_if_that_is_asked_for(name: str) -> None:
    goal = (5.0, 1.2, 2 * math.pi)
    found = plan_in_hall(name, goal, heading="keep", iterations=150)
    assert_drivable(found, space_of(name), (0, 0, 0), goal, HALL, 0.02, BOUNDS)
    assert np.ptp(found.raise_for_status().samples[:, 2]) < 1e-9


def test_a_crab_of_little_range_moves_aside_in_zigzags() -> None:
    space = space_of("four-wheel-steering")
    found = omniplan.plan((0, 0, 0), (0, 0.6, 0), space, heading="keep")
    assert_drivable(found, space, (0, 0, 0), (0, 0.6, 0), {})
    assert found.cusps == 1
    assert np.ptp(found.raise_for_status().samples[:, 2]) < 1e-9


@pytest.mark.parametrize(
    ("name", "goal", "why"),
    [
        ("mecanum", (5.0, 1.2, 0.5), "it shall keep its heading: 0.0° at the start"),
        ("ackermann", (5.0, 1.2, 0.0), "fixed axle .* the goal lies at β = 13.5°"),
        ("ackermann", (6.4, 0.0, 0.0), "the straight way only, on which .* wall"),
        ("robotis-ffw", (5.0, 1.2, 0.0), "nothing is permitted at κ_n = 0"),
    ],
)
def test_who_cannot_keep_its_heading_is_told_why(
    name: str, goal: tuple[float, ...], why: str
) -> None:
    refused = plan_in_hall(name, goal, heading="keep")
    assert refused.status is PlanStatus.UNREACHABLE
    assert re.search(why, refused.message)
    assert refused.place is not None


def test_along_its_line_an_ackermann_vehicle_keeps_its_heading() -> None:
    space = space_of("ackermann")
    back = (-2 * math.cos(0.3), -2 * math.sin(0.3), 0.3)
    found = omniplan.plan((0, 0, 0.3), back, space, heading="keep")
    assert_drivable(found, space, (0, 0, 0.3), back, {})
    assert found.stops == 0


@pytest.mark.parametrize("heading", [math.pi, -math.pi, 3 * math.pi])
def test_a_heading_of_half_a_turn_is_searched_for(heading: float) -> None:
    found = plan_in_hall("mecanum", (5.0, 1.2, heading), iterations=200)
    goal = (5.0, 1.2, heading)
    assert_drivable(found, space_of("mecanum"), (0, 0, 0), goal, HALL, 0.02, BOUNDS)
    assert int(found.statistics["searches"]) > 0


def test_a_goal_behind_a_closed_wall_is_proved_to_be_unreachable() -> None:
    wall = {"wall": [(-9, 3), (9, 3), (9, 3.5), (-9, 3.5)]}
    hall, bounds = Obstacles.from_polygons(wall), (-5, -5, 5, 9)
    space = space_of("mecanum")
    found = omniplan.plan((0, 0, 0), (0, 6, 0), space, hall, bounds=bounds, time=4)
    assert found.status is PlanStatus.UNREACHABLE
    assert found.place == (0, 6, 0)
    assert float(found.statistics["time"]) < 4
    # Round the wall there is a way.
    free = omniplan.plan((0, 0, 0), (0, 6, 0), space, hall, time=60, iterations=300)
    assert_drivable(free, space, (0, 0, 0), (0, 6, 0), wall)


def test_a_gap_that_only_the_core_fits_through_is_not_proved_closed() -> None:
    width = 0.95  # the vehicle is 0.6 m wide and longer than that
    walls = {
        "left": [(-9.0, 3.0), (-width / 2, 3.0), (-width / 2, 3.5), (-9.0, 3.5)],
        "right": [(9.0, 3.0), (width / 2, 3.0), (width / 2, 3.5), (9.0, 3.5)],
    }
    hall = Obstacles.from_polygons(walls)
    found = omniplan.plan(
        (0, 0, 0), (0, 6, 0), space_of("mecanum"), hall, bounds=(-5, -5, 5, 9),
        time=60, iterations=20,
    )  # fmt: skip
    assert found.status is not PlanStatus.UNREACHABLE


def test_a_checker_can_be_given_with_its_own_bounds() -> None:
    space = space_of("mecanum")
    checker = CollisionChecker(space, Obstacles.from_polygons(HALL), 0.1, BOUNDS)
    goal = (5.0, 1.2, 0.0)
    found = omniplan.plan((0, 0, 0), goal, space, checker, time=60, iterations=300)
    assert_drivable(found, space, (0, 0, 0), goal, HALL, 0.1, BOUNDS)


def test_a_checker_and_obstacles_keep_moves_as_far_away() -> None:
    """Splines leave moves by a little: those keep 1 mm more than is asked for."""
    space, hall = space_of("mecanum"), Obstacles.from_polygons(HALL)
    checker = CollisionChecker(space, hall, 0.1, BOUNDS)
    ends, bounds = ((0.0, 0.0, 0.0), (5.0, 1.2, 0.0)), (-2.5, -4.0, 8.0, 5.0)
    for strict, kept in (
        checkers(space, checker, None, 0.0, ends),
        checkers(space, hall, bounds, 0.1, ends),
    ):
        assert isinstance(strict, CollisionChecker)
        assert isinstance(kept, CollisionChecker)
        assert (strict.clearance, kept.clearance) == pytest.approx((0.1, 0.101))
        assert kept.bounds == strict.bounds == bounds
    near = ((0.0, 0.0, 0.0), (5.0, checker.distance((5.0, 1.2, 0.0)), 0.0))
    assert checkers(space, checker, None, 0.0, near)[0] is checker


class Walled(CollisionChecker):
    """Of a user's own: nothing is known of what it asks beside."""


def test_a_checker_of_another_class_is_asked_as_it_is() -> None:
    space = space_of("mecanum")
    own = Walled(space, Obstacles.from_polygons(HALL))
    ends = ((0.0, 0.0, 0.0), (5.0, 1.2, 0.0))
    assert checkers(space, own, None, 0.0, ends) == (own, own)


COLD = """
from numba.core import event

import configspace
import omniplan
from omniplan.obstacles import Obstacles
from omniplan.planning import planner, task

seen = []


class Compiling(event.Listener):
    def on_start(self, event):
        seen.append("compile")

    def on_end(self, event):
        pass


def noting(name, function):
    def noted(*given):
        seen.append(name)
        return function(*given)
    return noted


event.register("numba:compile", Compiling())
task.Budget.start = noting("start", task.Budget.start)
planner.finished = noting("finish", planner.finished)
vehicle = configspace.load_vehicle("ackermann")
space = configspace.build_space(vehicle, configspace.Grid(32, 48), cache=False)
seen.clear()
wall = Obstacles.from_polygons([[(2, -3), (2.3, -3), (2.3, 0.6), (2, 0.6)]])
plan = omniplan.plan((0, 0, 0), (4.5, 0, 0), space, wall, time=600, iterations=60)
first, last = seen.index("start"), seen.index("finish")
assert plan.is_found, plan.message
print(seen[:first].count("compile"), seen[first:last].count("compile"))
"""


@pytest.mark.slow
def test_kernels_are_compiled_before_the_clock_starts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    ran = subprocess.run(
        [sys.executable, "-c", COLD], capture_output=True, text=True, check=True
    )
    before, within = map(int, ran.stdout.split())
    assert before > 10
    assert within == 0


STOPPED = """
import configspace
import omniplan
from omniplan.obstacles import Obstacles

space = configspace.build_space(configspace.load_vehicle("ackermann"), cache=False)
wall = Obstacles.from_polygons([[(2, -3), (2.3, -3), (2.3, 0.6), (2, 0.6)]])
omniplan.plan((0, 0, 0), (4.5, 0, 0), space, wall, time=600, iterations=20)
print("begins", flush=True)
try:
    omniplan.plan(
        (0, 0, 0), (4.5, 0, 0), space, wall, time=600, planner="RRTstar"
    )
except KeyboardInterrupt:
    again = omniplan.plan((0, 0, 0), (4.5, 0, 0), space, wall, iterations=300, time=60)
    print("ends", again.status.name)
"""


@pytest.mark.skipif(
    signal.getsignal(signal.SIGINT) is signal.SIG_IGN,
    reason="interrupts are ignored, as in the background of a shell",
)
@pytest.mark.slow
def test_an_interrupt_ends_a_plan_and_the_next_one_works() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", STOPPED], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "begins\n"
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(timeout=3)
        process.send_signal(signal.SIGINT)
        assert process.stdout.read() == "ends FOUND\n"


@pytest.mark.parametrize(
    ("options", "where"),
    [
        ({"time": 0.0}, "time"),
        ({"time": -1.0}, "time"),
        ({"time": math.nan}, "time"),
        ({"seed": 0}, "seed"),
        ({"seed": 1.5}, "seed"),
        ({"iterations": 0}, "iterations"),
        ({"planner": "PRM"}, "planner"),
        ({"method": "magic"}, "method"),
        ({"heading": "north"}, "heading"),
        ({"heading": "keep", "method": "control"}, "heading"),
        ({"clearance": -0.1}, "clearance"),
        ({"bounds": (0, 0, 0, 1)}, "bounds"),
        ({"start": (0, 0)}, "start"),
        ({"start": (0, math.nan, 0)}, "start"),
        ({"goal": (0, 0, 0, 3.0, 0)}, "goal"),
        ({"goal": "there"}, "goal"),
        ({"goal": (1e9, 0, 0)}, "goal"),
        ({"obstacles": [[0, 0], [1, 0], [1, 1]]}, "obstacles"),
        ({"space": "mecanum"}, "space"),
    ],
)
def test_what_makes_no_sense_is_an_error_that_says_where(
    options: dict[str, Any], where: str
) -> None:
    given: dict[str, Any] = {
        "start": (0, 0, 0),
        "goal": (1, 0, 0),
        "space": space_of("mecanum"),
    }
    given["obstacles"] = Obstacles.from_polygons(HALL)
    with pytest.raises(InvalidInput) as caught:
        omniplan.plan(**{**given, **options})
    assert where in str(caught.value)


def test_an_unknown_planner_is_told_which_there_are() -> None:
    with pytest.raises(InvalidInput, match="RRTConnect, RRT, "):
        omniplan.plan((0, 0, 0), (1, 0, 0), space_of("mecanum"), planner="A*")


def test_a_data_sheet_alone_is_not_enough() -> None:
    sheet = dataclasses.replace(space_of("mecanum"), vehicle=None)
    with pytest.raises(InvalidInput, match="data sheet alone"):
        omniplan.plan((0, 0, 0), (1, 0, 0), sheet)


def test_a_checker_and_bounds_together_are_an_error() -> None:
    space = space_of("mecanum")
    with pytest.raises(InvalidInput, match="its own bounds"):
        omniplan.plan(
            (0, 0, 0), (1, 0, 0), space, CollisionChecker(space), bounds=BOUNDS
        )
