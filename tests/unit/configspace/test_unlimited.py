"""Vehicles that some permitted configuration leaves without a speed limit."""

from typing import Any

import numpy as np
import pytest

import configspace
from configspace import Grid, Vehicle
from configspace.limits import rows_of
from configspace.unlimited import _around, _on_line

ALONE = {"type": "steered", "x": 0.4, "y": 0.1, "max_speed": 1.0}


def of(*wheels: dict[str, Any], **more: Any) -> Vehicle:
    named = [{"id": f"w{i}", **wheel} for i, wheel in enumerate(wheels)]
    return configspace.vehicle_from_data({"name": "v", "wheels": named, **more})


def is_refused(vehicle: Vehicle, grid: Grid) -> bool:
    try:
        configspace.build_space(vehicle, grid, cache=False)
    except configspace.InvalidVehicle as error:
        return "no limit bounds the speed" in str(error)
    return False


@pytest.mark.parametrize("grid", [Grid(4, 8), Grid(16, 24), Grid(100, 180)])
@pytest.mark.parametrize("offset", [0.3, -0.3, 1e-2, -1e-3, 1e-5, 1e-9])
def test_a_wheel_beside_its_axis_that_may_stand_still_does_not_bound_the_speed(
    grid: Grid, offset: float
) -> None:
    # However small the circle of such centres of rotation is.
    alone = {**ALONE, "offset": offset}
    assert is_refused(of(alone), grid)
    assert not is_refused(of(alone, {**ALONE, "x": -0.4}), grid)
    assert not is_refused(of(alone, limits={"max_yaw_rate_deg": 90}), grid)


@pytest.mark.parametrize("grid", [Grid(4, 8), Grid(16, 24), Grid(100, 180)])
def test_a_wheel_on_its_axis_bounds_the_speed_of_all_that_is_permitted(
    grid: Grid,
) -> None:
    assert not is_refused(of(ALONE), grid)
    assert not is_refused(of({**ALONE, "steering_range_deg": [-100, 100]}), grid)


def test_what_is_blocked_need_not_be_bounded() -> None:
    # The circle lies within the singular zone.
    alone = {**ALONE, "offset": 1e-3, "max_steering_rate_deg": 60}
    assert is_refused(of(alone), Grid(16, 24))
    guarded = of(alone, guaranteed={"kappa_rate": 0.2, "beta_rate_deg": 20})
    assert not is_refused(guarded, Grid(16, 24))


@pytest.mark.parametrize("offset", [0.5, -0.5, 0.5000001, 0.9])
def test_a_line_mobile_vehicle_is_judged_on_its_line(offset: float) -> None:
    axle = [{"type": "fixed", "x": 0.0, "y": y} for y in (0.3, -0.3)]
    front = {"type": "steered", "x": 0.5, "y": 0.0, "max_speed": 1.0}
    grid = Grid(100, 180)
    assert is_refused(of(*axle, {**front, "offset": offset}), grid)
    # The contact stays ahead of the axle.
    assert not is_refused(of(*axle, {**front, "offset": 0.8 * 0.5}), grid)
    driven = [{**wheel, "max_speed": 1.0} for wheel in axle]
    assert not is_refused(of(*driven, {**front, "offset": offset}), grid)


def test_a_driven_wheel_is_searched_for_in_cells_that_a_stop_divides() -> None:
    # Rotation about the only driven wheel: β = 0, κ_n = 1 / (0.3 κ_g); the passive
    # wheel's stop is a little beyond it, in the same cell of a coarse grid.
    driven = {"type": "fixed", "x": 0.0, "y": 0.3, "max_speed": 1.0}
    alpha = np.degrees(np.arctan2(0.5, 0.3))
    for room, refused in ((0.2, True), (-1.0, False)):
        reach = float(alpha + room)
        front = {"type": "steered", "x": 0.5, "y": 0.0}
        ranged = {**front, "steering_range_deg": [-reach, reach]}
        vehicle = of(driven, ranged, kappa_g=2.0)
        assert is_refused(vehicle, Grid(16, 24)) == refused


def test_the_followed_configurations_are_those_without_load() -> None:
    rng = np.random.default_rng(0)
    for offset in (0.3, -0.3, 1e-6):
        wheel = {**ALONE, "x": float(rng.normal()), "offset": offset}
        (row, *_), _ = rows_of(of(wheel))
        for c, s, e in (_around(row), _on_line(row, np.exp(0.3j))):
            rest = np.abs(c * e * row.p + s * row.b) - s * row.d
            np.testing.assert_allclose(rest, 0, atol=1e-12)
            np.testing.assert_allclose(np.maximum(c, np.abs(s)), 1)
            np.testing.assert_allclose(np.abs(e), 1)
