"""Eased arcs: no jump of the curvature, the same ends, and quicker."""

from __future__ import annotations

import functools
import math
from typing import Any

import hypothesis.strategies as st
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import assume, given, settings
from scipy.integrate import solve_ivp

import configspace
import omniplan
from configspace import Grid, PermissibleSpace
from omniplan.planning.connect import Connector
from omniplan.planning.easing import Eased, eased, eased_off
from omniplan.planning.moves import Move
from omniplan.planning.permits import Permits
from omniplan.planning.route import Route
from omniplan.planning.task import Budget, Checker, Task

FloatArray = npt.NDArray[np.float64]
START = (0.3, -0.2, 0.4)
LARGEST = 0.8


@functools.cache
def space_of(name: str) -> PermissibleSpace:
    vehicle = configspace.load_vehicle(name)
    return configspace.build_space(vehicle, Grid(100, 180), cache=False)


def driven(*steps: tuple[float, float], line: float = 0.0) -> list[Move]:
    """Return arcs of signed lengths and curvatures one after the other."""
    moves: list[Move] = []
    for length, curvature in steps:
        at = moves[-1].goal if moves else START
        e = length * np.array([math.cos(line), math.sin(line)])
        moves.append(Move.along(at, (*e, length * curvature)))
    return moves


def curvature_of(way: Eased, s: float) -> float:
    """Return the curvature at a place, by the definition of the ramps."""
    ends = np.cumsum(way.lengths)
    index = int(np.count_nonzero(ends[:-1] < s))
    curvature = float(way.curvatures[index])
    for i, half in enumerate(way.ramps.tolist()):
        if abs(s - ends[i]) < half:
            u = (s - ends[i] + half) / (2 * half)
            a, b = way.curvatures[i : i + 2].tolist()
            return float(a + (b - a) * u * u * (3 - 2 * u))
    return curvature


def integrated(way: Eased) -> FloatArray:
    """Return the pose at the end by integrating numerically."""
    ends = np.cumsum(way.lengths)

    def rate(s: float, at: FloatArray) -> list[float]:
        sign = way.signs[int(np.count_nonzero(ends[:-1] < s))]
        course = at[2] + way.line
        return [
            sign * math.cos(course),
            sign * math.sin(course),
            sign * curvature_of(way, s),
        ]

    at = np.array(way.start)
    for a, b in zip([0.0, *ends[:-1]], ends, strict=True):
        at = solve_ivp(
            rate, (a + 1e-13, b - 1e-13), at, rtol=1e-10, atol=1e-12, max_step=0.02
        ).y[:, -1]
    return at


LENGTHS, BENDS = st.floats(0.3, 2.0), st.floats(-LARGEST, LARGEST)
ARCS = st.tuples(LENGTHS, BENDS)
BACK = st.tuples(LENGTHS.map(lambda x: -x), BENDS)


@settings(max_examples=25, deadline=None)
@given(st.lists(ARCS | BACK, min_size=2, max_size=5), st.sampled_from([0.0, 0.7]))
def test_eased_arcs_lead_to_the_same_goal_within_the_curvature(
    steps: list[tuple[float, float]], line: float
) -> None:
    moves = driven(*steps, line=line)
    for way in eased(moves, line, LARGEST):
        assert np.abs(way.curvatures).max() <= LARGEST
        assert way.rest.min() >= 0
        jumps = (way.signs[1:] == way.signs[:-1]) & (
            np.abs(np.diff(way.curvatures)) > 1e-2
        )
        assert (way.ramps[jumps] > 0).all()
        off = way.goal() - moves[-1].goal
        assert np.abs(off[:2]).max() < 1e-9
        assert math.cos(off[2]) > 1 - 1e-12
        route = way.to_route(LARGEST)
        np.testing.assert_allclose(route.poses[-1, :2], moves[-1].goal[:2], atol=1e-9)
        assert len(route.stops) == (way.signs[1:] != way.signs[:-1]).sum()


@settings(max_examples=5, deadline=None)
@given(st.lists(ARCS, min_size=2, max_size=4))
def test_the_goal_is_that_of_a_numerical_integration(
    steps: list[tuple[float, float]],
) -> None:
    way = next(iter(eased(driven(*steps), 0.0, LARGEST)), None)
    assume(way is not None)
    assert way is not None
    np.testing.assert_allclose(way.goal(), integrated(way), atol=1e-7)


def test_a_turn_on_the_spot_cannot_be_eased() -> None:
    turn = Move.straight(START, (*START[:2], 1.4))
    on = Move.along(turn.goal, (1, 0, 0.3))
    assert Eased.of([turn, on], 0.0) is None
    assert not list(eased([turn, on], 0.0, LARGEST))


def test_arcs_of_one_curvature_are_one() -> None:
    way = Eased.of(driven((1, 0.5), (0.5, 0.5), (1, 0), (-1, 0), (-0.5, 0.3)), 0.0)
    assert way is not None
    np.testing.assert_allclose(way.lengths, [1.5, 1, 1, 0.5])
    assert way.jumps.tolist() == [True, False, True]
    np.testing.assert_allclose(way.room, [1, 0, 0.5])


def eased_by_ackermann(
    moves: list[Move], checker: Checker | None = None
) -> tuple[Route, float] | None:
    space = space_of("ackermann")
    assert space.vehicle is not None
    connector = Connector(Permits(space, space.vehicle))
    start, goal = (tuple(pose.tolist()) for pose in (moves[0].start, moves[-1].goal))
    area, budget = (-10.0, -10.0, 10.0, 10.0), Budget(60.0)
    task = Task(start, goal, space, space.vehicle, checker, area, "RRT", 1, budget)
    return eased_off(task, connector, moves)


def lane_change() -> list[Move]:
    space = space_of("ackermann")
    assert space.vehicle is not None
    radius = Connector(Permits(space, space.vehicle)).frames[0].radius
    return driven((1.5, 0), (1.2, 1 / radius), (1.2, -1 / radius), (1.5, 0))


def test_an_ackermann_vehicle_need_not_stop_between_arcs_of_its_least_radius() -> None:
    space, moves = space_of("ackermann"), lane_change()
    assert space.vehicle is not None
    found = eased_by_ackermann(moves)
    assert found is not None
    route, time = found
    assert route.stops == ()
    k = space.vehicle.reference
    plain, quick = (
        omniplan.fastest(each.to_path("p", (k.real, k.imag)), space).duration
        for each in (Route.from_moves(moves), route)
    )
    assert time == pytest.approx(quick, rel=0.03)
    assert quick < plain - 2.0
    np.testing.assert_allclose(route.poses[-1, :2], moves[-1].goal[:2], atol=1e-9)


class Tube:
    """Free is what keeps near to a way."""

    def __init__(self, moves: list[Move], width: float) -> None:
        u = np.linspace(0, 1, 2001)
        self._places = np.concatenate([move.poses(u)[:, :2] for move in moves])
        self._width = width

    def off(self, places: FloatArray) -> float:
        apart = places[:, None] - self._places
        return float(np.linalg.norm(apart, axis=-1).min(axis=1).max())

    def is_free(self, pose: Any) -> bool:
        return self.off(np.array([pose[:2]])) < self._width

    def is_motion_free(self, motion: Move) -> bool:
        return self.off(motion.poses(np.linspace(0, 1, 5))[:, :2]) < self._width

    first_hit = first_hit_of_trajectory = is_free


def test_less_room_asks_for_shorter_ramps() -> None:
    moves = lane_change()
    free = eased_by_ackermann(moves)
    assert free is not None
    off = Tube(moves, 1.0).off(free[0].poses[:, :2])
    tube = Tube(moves, off / 4)
    narrow = eased_by_ackermann(moves, tube)
    assert narrow is not None
    assert narrow[0].stops == ()
    assert tube.off(narrow[0].poses[:, :2]) < off / 4
    assert narrow[1] > free[1]
    assert eased_by_ackermann(moves, Tube(moves, 1e-6)) is None


def test_who_is_bound_to_no_line_is_not_eased() -> None:
    space = space_of("mecanum")
    assert space.vehicle is not None
    connector = Connector(Permits(space, space.vehicle))
    moves = driven((1, 0), (1, 0.3))
    start, goal = START, tuple(moves[-1].goal.tolist())
    area = (-9.0, -9.0, 9.0, 9.0)
    task = Task(start, goal, space, space.vehicle, None, area, "RRT", 1, Budget(9.0))
    assert eased_off(task, connector, moves) is None
