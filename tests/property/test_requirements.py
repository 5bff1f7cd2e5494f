"""Requirements against the rigid-body formula, which knows no table and no row."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import from_twist

import configspace
from configspace import Vehicle
from configspace.testing import rigid_body, vehicles
from omniplan import FleetVehicle
from omniplan.choosing.fitness import shortfalls
from omniplan.choosing.requirements import Crab, Radius, Speed, TurnOnTheSpot

Motion = Crab | Radius | Speed | TurnOnTheSpot
CLEAR = 1e-6
"""Nearer to a limit than this, relative, neither answer is asked for."""

motions: st.SearchStrategy[Motion] = st.one_of(
    st.builds(TurnOnTheSpot, st.floats(0.01, 3)),
    st.builds(Crab, st.floats(0.01, 3.1), st.floats(0.01, 2)),
    st.builds(Radius, st.floats(0.01, 20), st.floats(0.01, 2), st.just("both ways")),
    st.builds(Speed, st.floats(0.01, 3), st.just("both ways")),
)


def twists(asked: Motion, ahead: float) -> list[tuple[float, float, float]]:
    """Return what is asked for, by hand."""
    match asked:
        case TurnOnTheSpot():
            return [(0.0, 0.0, asked.rate), (0.0, 0.0, -asked.rate)]
        case Crab():
            ways = (ahead + asked.angle, ahead - asked.angle)
            return [
                (asked.speed * math.cos(a), asked.speed * math.sin(a), 0.0)
                for a in ways
            ]
    turns = [0.0]
    if isinstance(asked, Radius):
        turns = [asked.speed / asked.radius, -asked.speed / asked.radius]
    speed = asked.speed
    vx, vy = speed * math.cos(ahead), speed * math.sin(ahead)
    return [(sign * vx, sign * vy, turn) for sign in (1, -1) for turn in turns]


def at_least_as_tight(
    vehicle: Vehicle, twist: tuple[float, float, float]
) -> list[tuple[float, float, float]]:
    """Return the twists with the same velocity of K round smaller circles."""
    vx, vy, omega = twist
    q = abs(omega) / math.hypot(vx, vy) / vehicle.boundary_curvature
    asked = q if q < 1 else 2 - 1 / q
    found = []
    for k in range(200):
        kappa_n = asked + (2 - asked) * k / 200
        ratio = kappa_n if kappa_n < 1 else 1 / (2 - kappa_n)
        found.append((vx, vy, omega * ratio / q))
    return found


def can(
    vehicle: Vehicle,
    twist: tuple[float, float, float],
    slack: float,
    or_tighter: bool = False,
) -> bool:
    """Return whether a twist is permitted in either representation."""
    if or_tighter:
        twists = at_least_as_tight(vehicle, twist)
        return any(can(vehicle, one, slack) for one in twists)
    for sign in (1, -1):
        kappa_n, beta, v_s = from_twist(*twist, vehicle.boundary_curvature, sign)
        body = rigid_body(vehicle, kappa_n, beta, reverse=v_s < 0)
        fast = float(body.v_max) * (1 + slack) >= abs(v_s)
        stands = float(body.margin) >= -slack and float(body.spare) >= -slack
        if fast and stands and float(body.stillness) > -slack:
            return True
    return False


@settings(max_examples=150, deadline=None)
@given(vehicles(), motions)
def test_what_is_promised_is_permitted_and_what_is_refused_is_not(
    vehicle: Vehicle, asked: Motion
) -> None:
    space = configspace.build_space(vehicle, configspace.Grid(16, 24), cache=False)
    found = shortfalls(FleetVehicle("v", space), [asked], allow_unreachable=True)
    ahead = vehicle.mobility.line_beta or 0.0
    tighter = isinstance(asked, Radius)
    able = [can(vehicle, twist, CLEAR, tighter) for twist in twists(asked, ahead)]
    surely = [can(vehicle, twist, -CLEAR, tighter) for twist in twists(asked, ahead)]
    assert len(found) >= able.count(False)
    assert len(found) <= surely.count(False)
    for one in found:
        assert one.asked is not None
        assert one.offered is not None
        assert one.offered < one.asked
        assert one.limit


@settings(max_examples=30, deadline=None)
@given(vehicles(), motions)
def test_a_data_sheet_never_promises_more(vehicle: Vehicle, asked: Motion) -> None:
    space = configspace.build_space(vehicle, configspace.Grid(24, 36), cache=False)
    sheet = configspace.parse_space(configspace.dump_space(space))
    if not shortfalls(FleetVehicle("v", sheet), [asked]):
        assert not shortfalls(FleetVehicle("v", space), [asked])


@settings(max_examples=30, deadline=None)
@given(vehicles(), motions)
def test_what_is_offered_is_met(vehicle: Vehicle, asked: Motion) -> None:
    space = configspace.build_space(vehicle, configspace.Grid(16, 24), cache=False)
    agv = FleetVehicle("v", space)
    found = shortfalls(agv, [asked])
    offers = [one.offered for one in found if one.offered]
    if len(offers) < len(found) or not offers or min(offers) < 2e-6:
        return
    least = min(offers) * (1 - 1e-9)
    match asked:
        case TurnOnTheSpot():
            assert shortfalls(agv, [TurnOnTheSpot(least)]) == ()
        case Crab():
            assert shortfalls(agv, [Crab(asked.angle, least)]) == ()
        case Radius():
            assert shortfalls(agv, [Radius(asked.radius, least, asked.way)]) == ()
        case Speed():
            assert shortfalls(agv, [Speed(least, asked.way)]) == ()


def test_naive_motions_are_those_of_the_words() -> None:
    left, right = twists(Crab(math.pi / 2, 0.5), 0.0)
    assert left == pytest.approx((0.0, 0.5, 0.0))
    assert right == pytest.approx((0.0, -0.5, 0.0))
    ways = np.array(twists(Radius(2.0, 1.0), 0.0))
    np.testing.assert_allclose(np.abs(ways[:, 2]), 0.5)
