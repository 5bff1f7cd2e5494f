"""Moves between poses: they lead there, and the space permits all of them."""

from __future__ import annotations

import functools
import math

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

import configspace
from configspace import Grid, PermissibleSpace, Vehicle
from omniplan.planning.connect import Chain, Connector, chain_time
from omniplan.planning.moves import Move
from omniplan.planning.permits import Permits

Pose = tuple[float, float, float]
NAMES = (
    "ackermann",
    "mecanum",
    "differential",
    "tricycle",
    "ift-four-steered",
    "four-wheel-steering",
    "exomars",
)
POSES = st.tuples(*(st.floats(-3, 3),) * 2, st.floats(-math.pi, math.pi))


def known(space: PermissibleSpace) -> Vehicle:
    assert space.vehicle is not None
    return space.vehicle


@functools.cache
def connector(name: str) -> Connector:
    vehicle = configspace.load_vehicle(name)
    space = configspace.build_space(vehicle, Grid(100, 180), cache=False)
    return Connector(Permits(space, known(space)))


def assert_leads(chain: Chain, space: PermissibleSpace, a: Pose, b: Pose) -> None:
    """Assert that moves join, lead to the goal and are permitted, by dense samples."""
    at = np.array(a)
    for leg in chain:
        move = leg[0].move
        np.testing.assert_allclose(move.start[:2], at[:2], atol=1e-6)
        assert math.cos(move.start[2] - at[2]) > 1 - 1e-12
        at = move.goal
        for drive in leg:
            assert drive.move is move
            assert_permitted(move, drive.sign, space)
    np.testing.assert_allclose(at[:2], b[:2], atol=1e-6)
    assert math.cos(at[2] - b[2]) > 1 - 1e-12


def assert_permitted(move: Move, sign: int, space: PermissibleSpace) -> None:
    f = np.linspace(0, 1, 101)
    beta = move.beta_0 + f * (move.beta_1 - move.beta_0) + (sign < 0) * math.pi
    kappa_n = np.full(f.size, sign * move.kappa_n(space.kappa_g))
    speed = space.v_max(kappa_n, beta, reverse=sign < 0, reachable_only=True)
    assert (speed > 0).all()


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=15, deadline=None)
@given(a=POSES, b=POSES)
def test_chains_lead_to_the_goal_and_are_permitted(name: str, a: Pose, b: Pose) -> None:
    ways = connector(name)
    space = ways.permits.space
    quick = ways.quick(a, b)
    assert quick is not None
    assert_leads(quick, space, a, b)
    timed = ways.thorough(a, b)
    assert timed
    for time, chain in timed:
        assert_leads(chain, space, a, b)
        assert time == pytest.approx(chain_time(ways.permits, chain))
    times = [time for time, _ in timed]
    assert times == sorted(times)
    assert times[0] <= chain_time(ways.permits, quick) + 1e-9


def test_who_turns_on_the_spot_is_told_apart() -> None:
    spinning = {name: connector(name).spins for name in NAMES}
    assert spinning == {
        "ackermann": False,
        "mecanum": True,
        "differential": True,
        "tricycle": False,  # its wheel would stand at its very stop
        "ift-four-steered": True,
        "four-wheel-steering": False,
        "exomars": False,
    }


def test_the_least_radius_of_an_ackermann_vehicle_is_that_of_its_inner_wheel() -> None:
    radius = connector("ackermann").radius
    # Front wheels 0.8 m ahead, 0.275 m aside, turning by 40° at most.
    inner = 0.8 / math.tan(math.radians(40)) + 0.275
    assert radius == pytest.approx(inner, rel=5e-3)
    assert radius is not None
    assert radius > inner


def test_a_shift_aside_by_two_crab_moves() -> None:
    ways = connector("four-wheel-steering")
    (time, chain), *_ = ways.thorough((0, 0, 0), (0, 0.5, 0))
    assert len(chain) == 2
    assert all(leg[0].move.turn == 0 for leg in chain)
    one, other = (leg[0].move for leg in chain)
    assert math.cos(one.beta_0 + other.beta_0) == pytest.approx(-1)
    assert time < 20


def test_the_time_of_a_chain_counts_steering_and_saves_it_where_nothing_changes() -> (
    None
):
    permits = connector("ift-four-steered").permits
    ahead = permits.drives(Move.straight((0, 0, 0), (1, 0, 0)))
    on = permits.drives(Move.straight((1, 0, 0), (2, 0, 0)))
    aside = permits.drives(Move.straight((1, 0, 0), (1, 1, 0)))
    alone = chain_time(permits, (ahead,))
    whole = permits.drives(Move.straight((0, 0, 0), (2, 0, 0)))
    straight = chain_time(permits, (ahead, on))
    assert straight == pytest.approx(chain_time(permits, (whole,)))
    corner = chain_time(permits, (ahead, aside))
    quarter = permits.steering_time((0.0, 0.0), (0.0, math.pi / 2))
    assert corner == pytest.approx(2 * alone + quarter)
    # From rest to rest: 90° at 180°/s, with 720°/s² up and down.
    assert quarter == pytest.approx(90 / 180 + 180 / 720)
    assert chain_time(permits, ()) == 0


def test_driving_back_is_the_same_configuration_and_takes_no_steering() -> None:
    permits = connector("ackermann").permits
    there = permits.drives(Move.along((0, 0, 0), (1, 0, 0.5)))
    back = permits.drives(Move.along(there[0].move.goal, (-1, 0, -0.5)))
    assert {drive.sign for drive in there} == {1}
    assert {drive.sign for drive in back} == {-1}
    assert permits.steering_time(there[0].goal, back[0].start) == 0
    assert not permits.is_steady(there[0], back[0])
