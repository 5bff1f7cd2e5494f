"""Corners that are rounded: fewer stops, quicker, free, and the same ends."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest

import configspace
import omniplan
from configspace import Grid, PermissibleSpace
from omniplan.obstacles import CollisionChecker, Obstacles
from omniplan.planning.blend import rounded_off
from omniplan.planning.moves import Move
from omniplan.planning.permits import Permits
from omniplan.planning.route import Route
from omniplan.planning.task import Budget, Checker, Task


@functools.cache
def space_of(name: str) -> PermissibleSpace:
    vehicle = configspace.load_vehicle(name)
    return configspace.build_space(vehicle, Grid(100, 180), cache=False)


def task_for(name: str, route: Route, checker: Checker | None = None) -> Task:
    space = space_of(name)
    assert space.vehicle is not None
    start, goal = (tuple(route.poses[i].tolist()) for i in (0, -1))
    area = (-10.0, -10.0, 10.0, 10.0)
    vehicle, budget = space.vehicle, Budget(60.0)
    return Task(start, goal, space, vehicle, checker, area, "RRT", 1, budget)


def rounded(
    name: str, route: Route, checker: Checker | None = None
) -> tuple[Route, float]:
    task = task_for(name, route, checker)
    return rounded_off(task, Permits(task.space, task.vehicle), route)


def duration(name: str, route: Route) -> float:
    space = space_of(name)
    assert space.vehicle is not None
    k = space.vehicle.reference
    return omniplan.fastest(route.to_path("p", (k.real, k.imag)), space).duration


def corner() -> Route:
    one = Move.straight((0, 0, 0), (2, 0, 0))
    return Route.from_moves([one, Move.straight(one.goal, (2, 2, 0))])


@pytest.mark.parametrize("name", ["mecanum", "ift-four-steered"])
def test_a_corner_is_rounded_where_that_is_quicker(name: str) -> None:
    route = corner()
    assert len(route.stops) == 1
    found, time = rounded(name, route)
    assert found.stops == ()
    np.testing.assert_allclose(found.poses[[0, -1]], route.poses[[0, -1]])
    proved = duration(name, found)
    assert proved < duration(name, route) - 0.1
    assert time == pytest.approx(proved, rel=0.03)


def test_an_obstacle_inside_the_corner_keeps_the_blend_out() -> None:
    space = space_of("mecanum")
    assert space.vehicle is not None
    assert space.vehicle.footprint is not None
    x0 = min(x for x, _ in space.vehicle.footprint)
    y1 = max(y for _, y in space.vehicle.footprint)
    # Only just beside the way of the rear left corner.
    edge = [(-3.0, y1 + 0.01), (2 + x0 - 0.01, y1 + 0.01), (2 + x0 - 0.01, 4), (-3, 4)]
    checker = CollisionChecker(space, Obstacles.from_polygons({"shelf": edge}))
    found, _ = rounded("mecanum", corner(), checker)
    free, _ = rounded("mecanum", corner())
    assert free.stops == ()
    assert found.stops == corner().stops or (
        len(found.poses) != len(free.poses) or not np.allclose(found.poses, free.poses)
    )
    k = space.vehicle.reference
    path = found.to_path("p", (k.real, k.imag))
    trajectory = omniplan.fastest(path, space)
    assert checker.first_hit_of_trajectory(trajectory) is None


def test_an_arc_into_a_line_is_driven_without_a_stop_by_an_ackermann_vehicle() -> None:
    turn = Move.along((0, 0, 0), (2.5, 0, 1.0))
    on = Move.along(turn.goal, (2.5, 0, 0))
    route = Route.from_moves([turn, on])
    found, _ = rounded("ackermann", route)
    assert found.stops == ()
    heading = found.poses[:, 2]
    way = np.diff(found.poses[:, :2], axis=0)
    middle = (heading[1:] + heading[:-1]) / 2
    aside = np.angle((way[:, 0] + 1j * way[:, 1]) * np.exp(-1j * middle))
    assert np.abs(aside).max() < 1e-3  # the rear axle never slips
    assert duration("ackermann", found) < duration("ackermann", route) - 0.3


def test_a_cusp_stays() -> None:
    there = Move.along((0, 0, 0), (2, 0, 0.6))
    back = Move.along(there.goal, (-2, 0, 0.6))
    route = Route.from_moves([there, back])
    found, _ = rounded("ackermann", route)
    assert found.stops == route.stops
    np.testing.assert_array_equal(found.poses, route.poses)


def test_a_turn_on_the_spot_between_two_lines_is_left_out() -> None:
    one = Move.straight((0, 0, 0), (2, 0, 0))
    turn = Move.straight(one.goal, (2, 0, 0.8))
    on = Move.along(turn.goal, (2, 0, 0))
    route = Route.from_moves([one, turn, on])
    assert len(route.stops) == 2
    found, _ = rounded("differential", route)
    assert found.stops == ()
    assert found.poses[-1, 2] == pytest.approx(0.8)
    assert duration("differential", found) < duration("differential", route) - 0.3


def test_headings_go_on_over_full_turns() -> None:
    one = Move.straight((0, 0, 3.0), (-2, 0.3, 3.0))
    turn = Move.straight(one.goal, (-2, 0.3, -2.4))
    on = Move.along(turn.goal, (2, 0, 0))
    route = Route.from_moves([one, turn, on])
    found, _ = rounded("mecanum", route)
    assert np.abs(np.diff(found.poses[:, 2])).max() < math.pi / 2
    assert math.cos(found.poses[-1, 2] + 2.4) == pytest.approx(1)


def test_without_time_everything_stays() -> None:
    route = corner()
    task = task_for("mecanum", route)
    task.budget.seconds = 0.0
    found, _ = rounded_off(task, Permits(task.space, task.vehicle), route)
    assert found.stops == route.stops
