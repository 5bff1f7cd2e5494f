import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import configspace
from configspace.rotation_centre import icr, icr_of, singular_points
from configspace.testing import configurations, vehicles
from configspace.vehicle import SteerableWheel, Vehicle


def of(*places: tuple[float, float], **more: object) -> Vehicle:
    wheels = [
        {"id": f"w{i}", "type": "steered", "x": x, "y": y, "max_speed": 1.0}
        for i, (x, y) in enumerate(places)
    ]
    return configspace.vehicle_from_data({"name": "v", "wheels": wheels, **more})


@given(configurations(), st.floats(0.1, 9), st.sampled_from([-0.7, 1.0]))
def test_the_centre_does_not_move(
    at: tuple[float, float], kappa_g: float, v_s: float
) -> None:
    twist = configspace.to_twist(*at, v_s, kappa_g)
    x, y = icr(twist)
    assert not np.isnan(x)
    assert not np.isnan(y)
    assert np.isinf(x) == np.isinf(y)
    if np.isinf(x):
        assert abs(twist[2]) < 1e-300
        return
    vx, vy, omega = twist
    assert vx - omega * y == pytest.approx(0, abs=1e-14)
    assert vy + omega * x == pytest.approx(0, abs=1e-14)
    apart = np.hypot(*np.subtract(icr_of(*at, kappa_g), (x, y)))
    assert apart <= 1e-13 * (1 + np.hypot(x, y))


@pytest.mark.parametrize("omega", [0.0, -0.0, 5e-324, -5e-324])
def test_no_centre_is_infinite_and_silent(omega: float) -> None:
    """Also where it is farther away than numbers go; warnings are errors here."""
    x, y = icr([[1.0, 0.0, omega], [0.0, -1.0, omega], [0.3, 0.4, omega]])
    assert (x == np.inf).all()
    assert (y == np.inf).all()


def test_standstill_has_no_centre() -> None:
    np.testing.assert_array_equal(icr([0.0, 0.0, 0.0]), np.inf)
    np.testing.assert_array_equal(icr_of(0.0, 0.3, 2.0), np.inf)


def test_rotation_about_k() -> None:
    x, y = icr_of([-2.0, 2.0], 0.7, 3.0)
    np.testing.assert_array_equal(x, [0, 0])
    np.testing.assert_array_equal(y, [0, 0])
    assert not np.signbit(icr([0.0, 0.0, -1.0])).any()


def test_left_turn_has_its_centre_on_the_left() -> None:
    x, y = icr_of([1.0, -1.0, 0.5], [0.0, 0.0, np.pi / 2], 2.0)
    np.testing.assert_allclose(x, [0, 0, -1.0], atol=1e-15)
    np.testing.assert_allclose(y, [0.5, -0.5, 0], atol=1e-15)


@given(vehicles(("steered", "mixed", "ackermann")))
def test_a_wheel_stands_still_at_its_singular_points(vehicle: Vehicle) -> None:
    points = singular_points(vehicle)
    steered = [i for i, w in enumerate(vehicle.wheels) if isinstance(w, SteerableWheel)]
    assert [p.wheel for p in points] == [i for i in steered for _ in range(2)]
    for p in points:
        beta = np.linspace(-3, 3, 5) if p.beta is None else np.array([p.beta])
        z = configspace.wheel_directions(vehicle, p.kappa_n, beta)
        # As fine as κ_n near 2 can tell.
        assert np.abs(z[..., p.wheel]).max() < 1e-15 * (2 + np.abs(z).max())
        place = vehicle.contacts[p.wheel] - vehicle.reference
        x, y = icr_of(p.kappa_n, beta, vehicle.boundary_curvature)
        np.testing.assert_allclose(x + 1j * y, place, atol=1e-13 * (1 + abs(place)))


def test_a_wheel_on_k_makes_the_whole_pole_singular() -> None:
    points = singular_points(of((0.0, 0.0), (1.0, 0.0)))
    assert [(p.kappa_n, p.beta) for p in points[:2]] == [(2.0, None), (-2.0, None)]
    assert [p.kappa_n for p in points[2:]] == [1.0, -1.0]


def test_a_given_boundary_curvature_moves_them() -> None:
    near, far = of((0.5, 0.0), kappa_g=1.0), of((0.5, 0.0), kappa_g=4.0)
    assert [p.kappa_n for p in singular_points(near)] == [1.5, -1.5]
    assert [p.kappa_n for p in singular_points(far)] == [0.5, -0.5]
    assert singular_points(near)[0].beta == pytest.approx(-np.pi / 2)
    assert singular_points(near)[1].beta == pytest.approx(np.pi / 2)


def test_vehicles_without_steering_have_none() -> None:
    assert singular_points(configspace.load_vehicle("differential")) == ()
    assert singular_points(configspace.load_vehicle("mecanum")) == ()
    assert singular_points(of((0.5, 0.0), (-0.5, 0.0), synchro=True)) == ()


def test_a_turntable_is_singular_like_a_wheel() -> None:
    data = {"id": "t", "type": "turntable", "x": 0.4, "y": 0.3, "track": 0.2}
    agv = configspace.vehicle_from_data(
        {"name": "v", "wheels": [{**data, "max_speed": 1.0}]}
    )
    assert [p.kappa_n for p in singular_points(agv)] == [1.0, -1.0]
