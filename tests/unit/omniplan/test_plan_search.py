"""How a search begins anew, gives up, and proves that there is no way."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from planned import assert_drivable

import configspace
import omniplan
from configspace import Grid, PermissibleSpace
from omniplan import Plan, PlanStatus
from omniplan.obstacles import Obstacles
from omniplan.planning.search import PLANNERS
from omniplan.planning.task import RESTARTS

WALL = {"wall": [(-9.0, 3.0), (9.0, 3.0), (9.0, 3.5), (-9.0, 3.5)]}
SHELVES = {
    f"shelf {i}": [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    for i, (x0, y0, x1, y1) in enumerate(
        [
            (6.54, 0.54, 8.73, 2.12),
            (3.75, 5.22, 4.05, 9.22),
            (0.97, 6.67, 2.96, 7.18),
            (0.30, 8.49, 1.60, 9.68),
            (3.25, 3.90, 3.55, 7.90),
            (5.06, 1.79, 6.27, 3.63),
            (3.77, 3.84, 4.07, 7.84),
        ]
    )
}
PATIENT = 60.0


@functools.cache
def space_of(name: str) -> PermissibleSpace:
    vehicle = configspace.load_vehicle(name)
    return configspace.build_space(vehicle, Grid(100, 180), cache=False)


@pytest.mark.parametrize("seed", [11, 12, 20])
def test_a_search_that_takes_long_starts_anew(seed: int) -> None:
    """With each of these seeds one tree alone finds no way in 3000 motions."""
    space, hall = space_of("four-wheel-steering"), Obstacles.from_polygons(SHELVES)
    start, goal = (8.1, 6.1, -1.66), (1.05, 2.31, 1.12)
    bounds = (0.0, 0.0, 10.0, 12.0)
    found = omniplan.plan(
        start,
        goal,
        space,
        hall,
        bounds=bounds,
        seed=seed,
        iterations=1500,
        time=PATIENT,
    )
    assert_drivable(found, space, start, goal, SHELVES, bounds=bounds)
    assert int(found.statistics["searches"]) > 1


def test_to_start_anew_is_not_to_give_up() -> None:
    """The core fits through the gap, so nothing is proved; the vehicle does not."""
    walls = {
        "left": [(-9.0, 3.0), (-0.3, 3.0), (-0.3, 3.5), (-9.0, 3.5)],
        "right": [(9.0, 3.0), (0.7, 3.0), (0.7, 3.5), (9.0, 3.5)],
    }
    found = omniplan.plan(
        (0, 0, 0), (0, 6, 0), space_of("mecanum"), Obstacles.from_polygons(walls),
        bounds=(-5, -5, 5, 9), clearance=0.2, time=PATIENT, iterations=3000,
    )  # fmt: skip
    assert found.status is PlanStatus.TIMEOUT, found.message
    assert int(found.statistics["searches"]) > RESTARTS
    assert int(found.statistics["iterations"]) == 3000


@pytest.mark.parametrize("method", ["geometric", "control"])
@pytest.mark.parametrize(
    "options", [{"time": 1e-9}, {"time": 0.02}, {"time": PATIENT, "iterations": 1}]
)
def test_what_is_proved_closed_is_unreachable_however_little_time_there_is(
    method: str, options: dict[str, Any]
) -> None:
    found = omniplan.plan(
        (0, 0, 0), (0, 6, 0), space_of("mecanum"), Obstacles.from_polygons(WALL),
        bounds=(-5, -5, 5, 9), method=method, **options,  # type: ignore[arg-type]
    )  # fmt: skip
    assert found.status is PlanStatus.UNREACHABLE, found.message
    assert found.place == (0, 6, 0)


@pytest.mark.parametrize("method", ["geometric", "control"])
def test_the_proof_ends_a_search_early(method: str) -> None:
    found = omniplan.plan(
        (0, 0, 0), (0, 6, 0), space_of("mecanum"), Obstacles.from_polygons(WALL),
        bounds=(-5, -5, 5, 9), method=method, time=1000,  # type: ignore[arg-type]
    )  # fmt: skip
    assert found.status is PlanStatus.UNREACHABLE
    assert float(found.statistics["time"]) < 500


class GivenUpError(Exception):
    """Raised by a checkpoint."""


class Countdown:
    """A checkpoint that gives up when it has been called so many times."""

    def __init__(self, left: float) -> None:
        self.calls, self._left = 0, left

    def __call__(self) -> None:
        self.calls += 1
        if self.calls > self._left:
            raise GivenUpError


def plan_round_the_wall(checkpoint: Callable[[], None], **options: Any) -> Plan:
    wall = [(2.0, -3.0), (2.3, -3.0), (2.3, 0.6), (2.0, 0.6)]
    return omniplan.plan(
        (0, 0, 0), (5, -1, -0.8), space_of("mecanum"), Obstacles.from_polygons([wall]),
        bounds=(-2.5, -4, 8, 5), checkpoint=checkpoint,
        **{"time": PATIENT, "iterations": 60, **options},
    )  # fmt: skip


@pytest.mark.parametrize(
    "options",
    [
        {"method": "control"},
        *({"planner": name, "iterations": 300} for name in PLANNERS),
    ],
    ids=str,
)
def test_a_plan_can_be_given_up_in_the_search(options: dict[str, Any]) -> None:
    for calls in (0, 1, 7, 25):
        ask = Countdown(calls)
        with pytest.raises(GivenUpError):
            plan_round_the_wall(ask, **options)
        assert ask.calls == calls + 1


@pytest.mark.parametrize("method", ["geometric", "control"])
def test_a_plan_can_be_given_up_at_any_time_and_the_next_one_is_the_same(
    method: str,
) -> None:
    whole, most = Countdown(math.inf), 60 if method == "geometric" else 20_000
    found = plan_round_the_wall(whole, method=method, iterations=most)
    assert found.is_found
    for share in (0.5, 0.9, 0.97, 1.0):
        ask = Countdown(int(share * (whole.calls - 1)))
        with pytest.raises(GivenUpError):
            plan_round_the_wall(ask, method=method, iterations=most)
    last = Countdown(math.inf)
    again = plan_round_the_wall(last, method=method, iterations=most)
    one, other = again.raise_for_status(), found.raise_for_status()
    np.testing.assert_array_equal(one.samples, other.samples)
    np.testing.assert_array_equal(one.t, other.t)


def test_a_plan_can_be_given_up_within_timing_and_proof() -> None:
    """One move needs no search."""
    ask = Countdown(math.inf)
    found = omniplan.plan((0, 0, 0), (2, 1, 0.5), space_of("mecanum"), checkpoint=ask)
    assert found.is_found
    for calls in range(ask.calls):
        with pytest.raises(GivenUpError):
            omniplan.plan(
                (0, 0, 0), (2, 1, 0.5), space_of("mecanum"), checkpoint=Countdown(calls)
            )


def test_a_proof_that_there_is_no_way_can_be_given_up() -> None:
    hall = Obstacles.from_polygons(WALL)
    arguments = ((0, 0, 0), (0, 6, 0), space_of("mecanum"), hall)
    options: dict[str, Any] = {"bounds": (-5, -5, 5, 9), "time": 1e-9}
    ask = Countdown(math.inf)
    found = omniplan.plan(*arguments, checkpoint=ask, **options)
    assert found.status is PlanStatus.UNREACHABLE
    with pytest.raises(GivenUpError):
        omniplan.plan(*arguments, checkpoint=Countdown(ask.calls - 1), **options)


PILLAR = [[(3.0, -1.0), (4.0, -1.0), (4.0, 1.2), (3.0, 1.2)]]


def test_one_free_move_does_not_end_the_search() -> None:
    """Turning on the spot and then driving by takes 9.1 s, one arc around 11.2 s."""
    found = omniplan.plan(
        (0, 0, 0),
        (6, -2, 3),
        space_of("ift-four-steered"),
        Obstacles.from_polygons(PILLAR),
        iterations=1500,
        time=PATIENT,
    )
    assert found.duration is not None
    assert found.duration < 9.1
    assert int(found.statistics["searches"]) >= RESTARTS


@pytest.mark.parametrize("planner", ["RRTstar", "InformedRRTstar", "BITstar"])
def test_ways_of_planners_that_optimise_are_made_shorter(planner: str) -> None:
    """What they find within their time has stops that a short cut saves."""
    ask = functools.partial(
        omniplan.plan,
        (0, 0, 0),
        (6, -2, 3),
        space_of("ackermann"),
        Obstacles.from_polygons(PILLAR),
        iterations=3000,
        time=PATIENT,
    )
    found, usual = ask(planner=planner), ask()
    assert found.duration is not None
    assert usual.duration is not None
    assert found.duration < 1.2 * usual.duration
    assert int(found.statistics["iterations"]) < 3000


@pytest.mark.parametrize("clearance", [-1.0, math.nan, math.inf])
def test_a_clearance_is_checked_where_nothing_stands(clearance: float) -> None:
    with pytest.raises(configspace.InvalidInput, match="clearance"):
        omniplan.plan((0, 0, 0), (1, 0, 0), space_of("mecanum"), clearance=clearance)
