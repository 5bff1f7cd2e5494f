"""Short cuts: quicker ways that are still permitted, free and from start to goal."""

from __future__ import annotations

import functools
import itertools

import numpy as np
import pytest

import configspace
from configspace import Grid
from omniplan.obstacles import CollisionChecker, Obstacles
from omniplan.planning.connect import Chain, Connector, chain_time, joined
from omniplan.planning.improve import moves_of, shortened
from omniplan.planning.moves import Move
from omniplan.planning.permits import Permits
from omniplan.planning.search import Found
from omniplan.planning.task import Budget, Task

DETOUR = ((0.0, 0.0, 0.0), (1.0, 2.5, 1.0), (3.0, 2.8, -0.5), (4.0, 0.0, 0.0))
BLOCK = {"block": [(1.6, -2.0), (2.4, -2.0), (2.4, 0.8), (1.6, 0.8)]}


@functools.cache
def connector(name: str) -> Connector:
    vehicle = configspace.load_vehicle(name)
    space = configspace.build_space(vehicle, Grid(100, 180), cache=False)
    assert space.vehicle is not None
    return Connector(Permits(space, space.vehicle))


def detour(ways: Connector) -> Chain:
    chains = [ways.quick(a, b) for a, b in itertools.pairwise(DETOUR)]
    return joined([chain for chain in chains if chain is not None])


def task_for(ways: Connector, motions: int) -> Task:
    space = ways.permits.space
    checker = CollisionChecker(space, Obstacles.from_polygons(BLOCK))
    vehicle, area = ways.permits.vehicle, (-5.0, -5.0, 9.0, 9.0)
    budget = Budget(60.0, motions)
    return Task(DETOUR[0], DETOUR[-1], space, vehicle, checker, area, "RRT", 1, budget)


@pytest.mark.parametrize("name", ["mecanum", "ift-four-steered", "ackermann"])
def test_a_detour_becomes_shorter_and_stays_free(name: str) -> None:
    ways = connector(name)
    task, chain = task_for(ways, 400), detour(ways)
    assert task.checker is not None
    before = Found(chain, chain_time(ways.permits, chain), 0.0)
    after = shortened(task, ways, before, np.random.default_rng(1))
    assert after.duration < 0.95 * before.duration
    assert after.duration == pytest.approx(chain_time(ways.permits, after.chain))
    moves = moves_of(after.chain)
    np.testing.assert_allclose(moves[0].start, DETOUR[0], atol=1e-9)
    np.testing.assert_allclose(moves[-1].goal[:2], DETOUR[-1][:2], atol=1e-6)
    for one, other in itertools.pairwise(moves):
        np.testing.assert_allclose(one.goal[:2], other.start[:2], atol=1e-6)
    kept = {id(move) for move in moves_of(chain)}
    new = [move for move in moves if id(move) not in kept]
    assert new
    assert all(task.checker.is_motion_free(move) for move in new)


def test_what_is_quickest_already_stays() -> None:
    ways = connector("mecanum")
    drives = ways.permits.drives(Move.straight((0, 0, 0), (1, 0, 0)))
    found = Found((drives,), chain_time(ways.permits, (drives,)), 0.0)
    again = shortened(task_for(ways, 50), ways, found, np.random.default_rng(1))
    assert again.chain == found.chain


def test_a_spent_budget_changes_nothing() -> None:
    ways = connector("mecanum")
    task, chain = task_for(ways, 1), detour(ways)
    task.budget.asked = 1
    found = Found(chain, chain_time(ways.permits, chain), 0.0)
    assert shortened(task, ways, found, np.random.default_rng(1)).chain == chain
