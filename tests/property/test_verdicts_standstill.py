"""At a standstill wheels steer as fast as they can, and roll and share motors."""

from __future__ import annotations

import math
from typing import Any

import naive_limits
import numpy as np
import pytest
import random_motions

import configspace
from configspace import Grid, PermissibleSpace
from omniplan import Trajectory, validate

SPEED = 0.5


def space_with(rate_deg: float | None, **wheel: Any) -> PermissibleSpace:
    """Two steered wheels in line, whose steering costs rolling."""
    wheels = [
        {"type": "steered", "id": name, "x": x, "y": 0.0, "max_speed": SPEED, **wheel}
        for name, x in (("front", 1.0), ("rear", -1.0))
    ]
    if rate_deg is not None:
        wheels = [{**wheel, "max_steering_rate_deg": rate_deg} for wheel in wheels]
    vehicle = configspace.vehicle_from_data({"name": "two", "wheels": wheels})
    return configspace.build_space(vehicle, Grid(40, 72), cache=False)


@pytest.mark.parametrize("rest", [0.0, 1e-9, 1e-13, 1e-17])
def test_where_the_vehicle_stands_no_direction_is_singular(rest: float) -> None:
    """What is left of a motion at rest is rounding, and may point anywhere."""
    wheels = [
        {"type": "steered", "id": name, "x": x, "y": 0.0, "max_speed": SPEED,
         "max_steering_rate_deg": 90.0}
        for name, x in (("front", 1.0), ("rear", -1.0))
    ]  # fmt: skip
    guaranteed = {"kappa_rate": 0.1, "beta_rate_deg": 10.0}
    data = {"name": "two", "wheels": wheels, "guaranteed": guaranteed}
    vehicle = configspace.vehicle_from_data(data)
    space = configspace.build_space(vehicle, Grid(40, 72), cache=False)
    # Turning about a point beside the front wheel, as far as it turns at all.
    twists = np.array([[0.3, 0.0, 0.0], [0.01 * rest, -0.99 * rest, rest]])
    moving = Trajectory.from_twists([0, 1], [twists[1] / max(rest, 1e-30) * 0.2] * 2)
    assert rest == 0 or not validate(moving, space).valid
    assert validate(Trajectory.from_twists([0.0, 2.0], twists), space).valid


@pytest.mark.parametrize("rest", [1e-9, 1e-11, 1e-13, 1e-17])
@pytest.mark.parametrize("wheel", [{"offset": -0.1}, {"steering_coupling": 0.1}])
def test_where_the_vehicle_stands_steering_costs_no_rolling(
    wheel: dict[str, float], rest: float
) -> None:
    twists = np.array([[0.3, 0.0, 0.0], [0.01 * rest, -0.99 * rest, rest]])
    trajectory = Trajectory.from_twists([0.0, 2.0], twists)
    assert validate(trajectory, space_with(None, **wheel)).valid


def ahead_then_sideways(rest: float) -> Trajectory:
    """Half a metre ahead, a rest of so many seconds, half a metre to the left."""
    f = np.linspace(0, 1, 13)
    gone = 0.5 * (3 * f**2 - 2 * f**3)
    none = np.zeros(13)
    poses = [
        np.stack([gone, none, none], axis=-1),
        np.stack([none + 0.5, gone, none], axis=-1),
    ]
    t = np.concatenate([4 * f, 4 + rest + 4 * f])
    return Trajectory.from_poses(t, np.concatenate(poses))


@pytest.mark.parametrize(
    "rate_deg", [None, pytest.param(400.0, marks=pytest.mark.slow), 30.0]
)
@pytest.mark.parametrize(
    ("wheel", "rolled"),
    [
        ({}, 0.0),
        ({"offset": 0.5}, 0.5),
        ({"offset": -0.5}, 0.5),
        ({"steering_coupling": 0.4}, 0.4),
        ({"offset": 0.3, "steering_coupling": 0.2}, 0.5),
        ({"type": "turntable", "track": 1.0}, 0.5),
    ],
)
def test_a_quarter_turn_at_rest_takes_the_time_that_rolling_asks(
    wheel: dict[str, Any], rolled: float, rate_deg: float | None
) -> None:
    space = space_with(rate_deg, **wheel)
    assert space.vehicle is not None
    rates = [SPEED / rolled] if rolled else []
    rates += [math.radians(rate_deg)] if rate_deg else []
    needed = math.pi / 2 / min(rates) if rates else 0.0
    for rest in (0.9 * needed, 1.1 * needed + 0.1):
        trajectory = ahead_then_sideways(max(rest, 0.02))
        simulation = random_motions.simulated(space.vehicle, trajectory)
        report = validate(trajectory, space)
        enough = rest >= needed
        assert report.valid == enough
        assert (naive_limits.breaches(simulation) == []) == enough
        if not enough:
            (violation,) = report.violations
            assert violation.limit == "RECONFIGURATION"
            # The time for the wheels' turn is bounded from above, closely.
            assert violation.value is not None
            assert needed * (1 - 1e-3) <= violation.value <= needed * 1.05
