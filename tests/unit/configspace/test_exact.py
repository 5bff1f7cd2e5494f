import naive
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import configspace
from configspace import Reason
from configspace.testing import ALL_KINDS, configurations, rigid_body, vehicles
from configspace.vehicle import Vehicle


@given(vehicles(ALL_KINDS), configurations())
def test_exact_speed_is_that_of_the_rigid_body(
    vehicle: Vehicle, configuration: tuple[float, float]
) -> None:
    for reverse in (False, True):
        truth = naive.exact(vehicle, *configuration, reverse=reverse)
        other = rigid_body(vehicle, *configuration, reverse=reverse)
        v_max = float(configspace.exact_v_max(vehicle, *configuration, reverse=reverse))
        if other.is_clear():
            assert v_max == pytest.approx(float(other.permitted), rel=1e-9)
        # The loop version finds the rates by differences and tipping by bisection.
        if other.is_clear(1e-6):
            assert v_max == pytest.approx(truth.permitted, rel=1e-7)


@given(vehicles(ALL_KINDS), configurations())
def test_a_reason_is_given_for_every_answer(
    vehicle: Vehicle, configuration: tuple[float, float]
) -> None:
    v_max = float(configspace.exact_v_max(vehicle, *configuration))
    why, who = configspace.exact_reason(vehicle, *configuration)
    blocking = Reason.STEER_RANGE | Reason.SINGULAR | Reason.FIXED_WHEEL
    blocking |= Reason.PARALLEL_WHEELS
    assert int(why) != 0
    assert (int(why) & blocking != 0) == (v_max == 0)
    assert -1 <= int(who) < len(vehicle.wheels)


def test_a_vehicle_without_speed_limits_is_unbounded_not_an_error() -> None:
    vehicle = configspace.vehicle_from_data(
        {"name": "v", "wheels": [{"id": "a", "type": "steered", "x": 1, "y": 0}]}
    )
    assert float(configspace.exact_v_max(vehicle, 0.0, 0.0)) == np.inf
    why, who = configspace.exact_reason(vehicle, 0.0, 0.0)
    assert (int(why), int(who)) == (0, -1)


def test_the_end_of_a_range_is_permitted() -> None:
    vehicle = configspace.load_vehicle("ift-four-steered")
    end = np.radians(155)
    v_max = configspace.exact_v_max(vehicle, 0.0, [end, -end, end + 1e-9, -end - 1e-9])
    np.testing.assert_allclose(v_max, [1, 1, 0, 0])


@pytest.mark.parametrize(
    ("steering_range", "permitted", "blocked"),
    [
        ((-10, 340), [-9, 0, 90, 180, -90, -21], [-11, -15, -19]),
        ((0, 180), [0, 1, 90, 179, 180], [-1, -90, -179]),
        ((100, 260), [100.1, 180, -100.1], [0, 99, -99, 50]),
        ((-270, 270), [0, 90, 180, -90], []),
        ((-180, 180), [0, 90, 180, -179], []),
        ((-0.5, 0.5), [0, 0.4, -0.4], [0.6, -0.6, 180, 90]),
        ((350, 370), [0, 9, -9], [11, -11, 180]),
    ],
)
def test_direction_decides_whether_an_angle_is_in_range(
    steering_range: tuple[float, float], permitted: list[float], blocked: list[float]
) -> None:
    wheel = {
        "id": "a",
        "type": "steered",
        "x": 0.5,
        "y": 0.0,
        "max_speed": 1,
        "steering_range_deg": steering_range,
    }
    vehicle = configspace.vehicle_from_data(
        {"name": "v", "wheels": [wheel], "limits": {"max_yaw_rate_deg": 90}}
    )
    assert (configspace.exact_v_max(vehicle, 0.0, np.radians(permitted)) > 0).all()
    assert (configspace.exact_v_max(vehicle, 0.0, np.radians(blocked)) == 0).all()


def test_the_pole_of_a_line_mobile_vehicle_is_one_configuration() -> None:
    # Guaranteed rates ask how fast the wheel turns on leaving the pole, which such a
    # vehicle can do along its line only.
    wheels = [
        {"id": "l", "type": "fixed", "x": 0.0, "y": 0.3, "max_speed": 1.0},
        {"id": "r", "type": "fixed", "x": 0.0, "y": -0.3, "max_speed": 1.0},
        {"id": "s", "type": "steered", "x": 0.5, "y": 0.0},
    ]
    wheels[2]["max_steering_rate_deg"] = 60
    beta = np.linspace(-np.pi, np.pi, 9)
    for rate, is_permitted in ((0.8, True), (6.0, False)):
        vehicle = configspace.vehicle_from_data(
            {"name": "v", "wheels": wheels, "guaranteed": {"kappa_rate": rate}}
        )
        v_max = configspace.exact_v_max(vehicle, 2.0, beta)
        np.testing.assert_array_equal(v_max > 0, is_permitted)
        space = configspace.build_space(vehicle, configspace.Grid(16, 24), cache=False)
        for pole in (2.0, -2.0):
            np.testing.assert_array_equal(space.v_max(pole, beta) > 0, is_permitted)
            why, _ = configspace.exact_reason(vehicle, pole, beta)
            assert ((why & configspace.Reason.SINGULAR != 0) != is_permitted).all()


@given(vehicles(("guaranteed",)), st.floats(0, 3))
def test_the_pole_is_one_configuration_whatever_beta(
    vehicle: Vehicle, factor: float
) -> None:
    data = vehicle.model_dump(mode="json")
    for key in data["guaranteed"]:
        data["guaranteed"][key] *= factor
    vehicle = configspace.vehicle_from_data(data)
    beta = np.linspace(-np.pi, np.pi, 25)
    for pole in (2.0, -2.0):
        for reverse in (False, True):
            v_max = configspace.exact_v_max(vehicle, pole, beta, reverse=reverse)
            assert (v_max == v_max[0]).all()
        why, who = configspace.exact_reason(vehicle, pole, beta)
        assert (why == why[0]).all()
        assert (who == who[0]).all()


def test_the_pole_asks_for_the_worst_way_to_leave_it() -> None:
    # Next to the pole c = 2 - κ_n the wheel at (0.5, 0) points to its left; leaving
    # along x turns it by -dc/dκ_n / |z| = 1 rad, leaving along y by nothing.
    wheel = {"id": "w", "type": "steered", "x": 0.5, "y": 0.0, "max_speed": 1.0}
    wheel["max_steering_rate_deg"] = np.degrees(1.0)
    for rate, is_permitted in ((0.99, True), (1.01, False)):
        vehicle = configspace.vehicle_from_data(
            {"name": "v", "wheels": [wheel], "guaranteed": {"kappa_rate": rate}}
        )
        near = 2 - 1e-9
        v_max = configspace.exact_v_max(vehicle, [near, near], [0.0, np.pi / 2])
        np.testing.assert_array_equal(v_max > 0, [is_permitted, True])
        at_pole = configspace.exact_v_max(vehicle, 2.0, [0.0, np.pi / 2, 1.0])
        np.testing.assert_array_equal(at_pole > 0, is_permitted)
        space = configspace.build_space(vehicle, configspace.Grid(16, 24), cache=False)
        beta = np.linspace(-np.pi, np.pi, 50)
        np.testing.assert_array_equal(space.v_max(2.0, beta) > 0, is_permitted)
        if not is_permitted:  # no cell that touches the pole is free, nor part of one
            assert (space.tables.state[[0, -1]] != 0).all()
            assert (space.tables.parts[0] & 0x000F == 0).all()
            assert (space.tables.parts[-1] & 0xF000 == 0).all()
