"""The nearest permitted side-slip angle at an offending place."""

import math

import numpy as np
import numpy.typing as npt
import pytest

import configspace
from configspace import Grid, PermissibleSpace, exact_v_max, vehicle_from_data
from omniplan import Advice, Report, Trajectory, validate
from omniplan.side_step import nearest_side_slip

GRID = Grid(100, 180)


def rectangle(half_range: float | None, **limits: float) -> PermissibleSpace:
    wheels = [
        {
            "id": f"{x}/{y}", "type": "steered", "x": x, "y": y, "max_speed": 1.0,
            "steering_range_deg": half_range and (-half_range, half_range),
        }
        for x in (0.4, -0.4)
        for y in (0.3, -0.3)
    ]  # fmt: skip
    vehicle = vehicle_from_data(
        {"name": "rectangle", "wheels": wheels, "limits": limits}
    )
    return configspace.build_space(vehicle, GRID, cache=False)


def crab(beta_deg: float, speed: float = 0.3) -> Trajectory:
    beta = math.radians(beta_deg)
    twist = [speed * math.cos(beta), speed * math.sin(beta), 0.0]
    return Trajectory.from_twists([0, 1], [twist, twist])


def side_slips(report: Report) -> list[Advice]:
    return [advice for advice in report.advice if advice.kind == "side_slip"]


@pytest.mark.parametrize("by_sheet", [False, True])
@pytest.mark.parametrize(
    ("beta", "nearest"), [(75.0, 60.0), (-80.0, -60.0), (65.0, 60.0)]
)
def test_beyond_the_steering_range_the_stop_is_nearest(
    beta: float, nearest: float, by_sheet: bool
) -> None:
    space = rectangle(60)
    if by_sheet:
        space = configspace.parse_space(configspace.dump_space(space))
    report = validate(crab(beta), space)
    assert not report.valid
    (advice,) = side_slips(report)
    # A data sheet knows the border to a cell and its parts.
    assert math.degrees(advice.value) == pytest.approx(
        nearest, abs=1.1 if by_sheet else 0.01
    )
    assert abs(math.degrees(advice.value)) <= 60
    assert f"instead of {beta:.1f}°" in advice.text
    assert validate(crab(math.degrees(advice.value)), space).valid


def test_the_nearest_may_be_driven_backwards() -> None:
    report = validate(crab(115.0), rectangle(60))
    (advice,) = side_slips(report)
    assert math.degrees(advice.value) == pytest.approx(120, abs=0.01)  # -60° backwards
    assert "instead of 115.0°" in advice.text


def test_a_wheel_that_is_too_fast_is_slower_at_another_side_slip() -> None:
    space = rectangle(None)
    kappa_n, v_s = 1.0, 0.7
    omega = v_s * space.kappa_g
    report = validate(
        Trajectory.from_twists([0, 1], [[v_s, 0, omega], [v_s, 0, omega]]), space
    )
    assert {v.limit for v in report.violations} == {"WHEEL_SPEED"}
    vehicle = space.vehicle
    assert vehicle is not None
    found = nearest_side_slip(space, kappa_n, 0.0, v_s)
    around = np.linspace(-math.pi, math.pi, 200_001)
    fits = exact_v_max(vehicle, np.full_like(around, kappa_n), around) >= v_s
    if fits.any():
        assert found is not None
        assert abs(found) == pytest.approx(np.abs(around[fits]).min(), abs=1e-4)
        (advice,) = side_slips(report)
        assert advice.value == pytest.approx(found, abs=3e-3)
    else:
        assert found is None
        assert side_slips(report) == []


@pytest.mark.parametrize("seed", range(20))
def test_the_nearest_against_all_directions(seed: int) -> None:
    rng = np.random.default_rng(seed)
    space = rectangle(float(rng.uniform(20, 170)))
    vehicle = space.vehicle
    assert vehicle is not None
    kappa_n, beta = float(rng.uniform(-2, 2)), float(rng.uniform(-math.pi, math.pi))
    v_s = float(rng.uniform(0.05, 0.9)) * float(rng.choice([-1, 1]))
    found = nearest_side_slip(space, kappa_n, beta, v_s)
    offset = np.linspace(-math.pi, math.pi, 100_001)

    def permits(towards: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        k = np.full_like(towards, kappa_n)
        either = np.maximum(
            exact_v_max(vehicle, k, towards), exact_v_max(vehicle, -k, towards + np.pi)
        )
        return np.asarray(either >= abs(v_s))

    fits = permits(beta + offset)
    if permits(np.array([beta]))[0]:
        return  # nothing offends here
    if not fits.any():
        assert found is None
        return
    assert found is not None
    assert permits(np.array([found]))[0]
    assert abs(found - beta) <= np.abs(offset[fits]).min() + 1e-4


def test_at_most_one_and_none_where_no_direction_helps() -> None:
    space = rectangle(60, max_speed=0.5)
    fast = validate(crab(0.0, 0.6), space)  # |v| is the same in all directions
    assert side_slips(fast) == []
    assert side_slips(validate(crab(0.0), space)) == []
    t = [0.0, 1, 2, 3]
    twice = [crab(b).samples[0] for b in (0.0, 75.0, 0.0, -75.0)]
    report = validate(Trajectory.from_twists(t, twice), space)
    assert len([v for v in report.violations if v.limit == "STEER_RANGE"]) > 1
    assert len(side_slips(report)) == 1


def test_vehicles_on_a_line_get_none() -> None:
    space = configspace.build_space(
        configspace.load_vehicle("differential"), GRID, cache=False
    )
    assert side_slips(validate(crab(30.0), space)) == []
    assert side_slips(validate(crab(0.0, 5.0), space)) == []


def test_a_vehicles_own_parameters_are_advised_too() -> None:
    space = rectangle(60)
    assert space.vehicle is not None
    own = Trajectory.from_omni_curve(
        [0, 1], [0, 0], [math.radians(70)] * 2, [0.5, 0.5], space.vehicle
    )
    (advice,) = side_slips(validate(own, space))
    assert math.degrees(advice.value) == pytest.approx(60, abs=0.01)
