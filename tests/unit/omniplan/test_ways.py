"""Ways from configuration to configuration at rest."""

import math

import numpy as np
import pytest

import configspace
from configspace import Grid, PermissibleSpace
from configspace.angles import wrap
from configspace.omni_curve import to_twist
from omniplan import Tolerances, Trajectory, validate
from omniplan.judging.judge import judge_for
from omniplan.motion import OmniCurveMotion
from omniplan.standing.searched_way import searched_legs, surface_of
from omniplan.standing.ways import Changer, Configuration, _ways

START, GOAL = (0.5478, -1.4273), (-1.8361, -2.9975)
"""Two configurations of the paper's vehicle between which no simple way leads."""


@pytest.fixture(scope="module")
def space() -> PermissibleSpace:
    vehicle = configspace.load_vehicle("ift-four-steered")
    return configspace.build_space(vehicle, Grid(100, 180), cache=False)


def changer(space: PermissibleSpace) -> Changer:
    nothing = np.zeros((2, 3))
    reference = complex(*space.header.reference)
    motion = OmniCurveMotion(np.array([0.0, 1]), nothing, space.kappa_g, reference)
    judge = judge_for(space, motion, Tolerances())
    return Changer(judge, space, Tolerances())


def twist_of(space: PermissibleSpace, at: Configuration, v_s: float) -> list[float]:
    vx, vy, omega = (float(x) for x in to_twist(*at, v_s, space.kappa_g))
    x, y = space.header.reference
    return [vx + omega * y, vy - omega * x, omega]


def rest_between(
    space: PermissibleSpace, start: Configuration, goal: Configuration, rest: float
) -> Trajectory:
    a, b = (twist_of(space, at, 0.1) for at in (start, goal))
    zero = [0.0] * 3
    return Trajectory.from_twists(
        [0, 1, 2, 2 + rest, 3 + rest, 4 + rest], [a, a, zero, zero, b, b]
    )


def test_all_simple_ways_fail_but_one_is_found_by_search(
    space: PermissibleSpace,
) -> None:
    ways = changer(space)
    assert all(math.isinf(ways._way(legs).time) for legs in _ways(START, GOAL))
    change = ways.change(START, GOAL)
    (way,) = change.ways
    assert 1.2 < way.time < 4


def test_the_way_by_search_is_within_the_space(space: PermissibleSpace) -> None:
    """Walked in small steps, every wheel stays in range and turns a little."""
    surface, vehicle = surface_of(space), space.vehicle
    assert surface is not None
    assert vehicle is not None
    finest = list(searched_legs(surface, START, GOAL))[-1]
    corners = np.array(finest)
    assert tuple(corners[0]) == pytest.approx(START)
    assert corners[-1, 0] == pytest.approx(GOAL[0])
    assert wrap(corners[-1, 1] - GOAL[1]) == pytest.approx(0.0, abs=1e-9)
    at = np.arange(len(corners))
    fine = np.linspace(0, len(corners) - 1, 200 * len(corners))
    kappa_n, beta = (np.interp(fine, at, column) for column in corners.T)
    z = configspace.wheel_directions(vehicle, kappa_n, beta)
    assert np.abs(z).min() > 1e-3
    assert np.abs(np.angle(z)).max() <= math.radians(155) + 1e-9
    assert np.abs(np.angle(z[1:] / z[:-1])).max() < 0.1


def test_a_stop_between_them_is_permitted_given_the_time(
    space: PermissibleSpace,
) -> None:
    time = min(way.time for way in changer(space).change(START, GOAL).ways)
    # Driving the second piece the other way round may be quicker still.
    assert validate(rest_between(space, START, GOAL, time + 0.1), space).valid
    short = validate(rest_between(space, START, GOAL, 0.05), space)
    assert {v.limit for v in short.violations} == {"RECONFIGURATION"}
    (violation,) = short.violations
    assert violation.value is not None
    assert violation.value <= time + 1e-6


def test_no_search_where_the_wheels_cannot_be_in_time(
    space: PermissibleSpace, monkeypatch: pytest.MonkeyPatch
) -> None:
    from omniplan.standing import ways

    def never(*_: object) -> None:
        raise AssertionError("searched")

    monkeypatch.setattr(ways, "searched_legs", never)
    change = changer(space).change((0.0, 0.0), (0.0, math.pi / 2), 0.1)
    assert min(way.time for way in change.ways) == pytest.approx(0.75, rel=1e-2)


@pytest.mark.parametrize("name", ["mecanum", "differential", "ackermann"])
def test_only_vehicles_that_steer_freely_are_searched(name: str) -> None:
    vehicle = configspace.load_vehicle(name)
    known = configspace.build_space(vehicle, Grid(40, 72), cache=False)
    assert surface_of(known) is None


def test_data_sheets_are_not_searched_and_a_surface_is_made_once(
    space: PermissibleSpace,
) -> None:
    sheet = configspace.parse_space(configspace.dump_space(space))
    assert surface_of(sheet) is None
    assert surface_of(space) is surface_of(space)


def test_no_way_is_said_where_there_is_none(space: PermissibleSpace) -> None:
    # Straight ahead and straight back are apart with stops at ±155°.
    change = changer(space).change((0.0, math.radians(100)), (0.0, math.pi))
    assert all(math.isinf(way.time) for way in change.ways)


@pytest.mark.parametrize("line", [0.0, math.pi])
def test_rounding_beside_the_line_does_not_keep_a_vehicle_from_steering(
    line: float,
) -> None:
    vehicle = configspace.load_vehicle("ackermann")
    on_line = configspace.build_space(vehicle, Grid(100, 180), cache=False)
    ways = changer(on_line)
    side = 1 if line == 0 else -1
    exact, measured = (
        ways.change((side * 0.6, line + aside), (-side * 0.6, line - aside))
        for aside in (0.0, 1e-5)
    )
    if line == 0:
        assert 1 < exact.ways[0].time < 2
    else:  # turned round the wheels are out of their ranges
        assert math.isinf(exact.ways[0].time)
    assert measured.ways[0].time == exact.ways[0].time
    beyond = ways.change((0.6, 0.02), (-0.6, -0.02))
    assert math.isinf(beyond.ways[0].time)
