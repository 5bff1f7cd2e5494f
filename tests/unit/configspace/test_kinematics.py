import math

import naive
import numpy as np
import pytest
from hypothesis import given

import configspace
from configspace.testing import configurations, random_vehicle, vehicles
from configspace.vehicle import Castor, SteerableWheel, Vehicle

KINKS = [-2.0, -1.3, -1.0, -0.4, 0.0, 0.4, 1.0, 1.3, 2.0]


def of(*wheels: dict[str, object], **more: object) -> Vehicle:
    named = [{"id": f"w{i}", **wheel} for i, wheel in enumerate(wheels)]
    return configspace.vehicle_from_data({"name": "v", "wheels": named, **more})


def rows(vehicle: Vehicle) -> np.ndarray:
    """Matrix from (vx, vy, ω) to the rolling speeds."""
    kg = vehicle.boundary_curvature
    columns = []
    for unit in np.eye(3):
        kappa_n, beta, v_s = configspace.from_twist(unit, kg)
        columns.append(configspace.wheel_states(vehicle, kappa_n, beta, v_s)[1])
    return np.stack(columns, axis=-1)


def assert_paper(vehicle: Vehicle, kappa_n: float, beta: float, v_s: float) -> None:
    """Steered wheels against section 3.3; α modulo 2π."""
    alpha, u = configspace.wheel_states(vehicle, kappa_n, beta, v_s)
    kx, ky = naive.reference(vehicle)
    kg = naive.kappa_g(vehicle)
    for i, wheel in enumerate(vehicle.wheels):
        if not isinstance(wheel, SteerableWheel):
            continue
        angle, speed = naive.steered_wheel(
            kappa_n, beta, v_s, kg, wheel.x - kx, wheel.y - ky
        )
        # The paper's root and acos lose half the digits where they vanish.
        size = (1 + kg * math.hypot(wheel.x - kx, wheel.y - ky)) ** 2
        assert u[i] ** 2 == pytest.approx(speed**2, abs=1e-14 * size)
        if abs(u[i]) < 1e-4 * abs(v_s):
            continue
        assert u[i] == pytest.approx(speed, abs=1e-9 * size)
        flat = max(abs(math.sin(angle - beta)), 1e-8)
        slack = 1e-9 + 1e-15 * size / flat / (u[i] / v_s) ** 2
        assert abs(math.remainder(alpha[i] - angle, 2 * math.pi)) < slack


@pytest.mark.parametrize("kappa_n", KINKS)
@pytest.mark.parametrize("beta", [-np.pi, -2.2, -0.3, 0.0, 0.5, np.pi / 2, 3.0])
@pytest.mark.parametrize("v_s", [-0.6, 1.0])
def test_steered_wheels_follow_the_papers_cases(
    kappa_n: float, beta: float, v_s: float
) -> None:
    assert_paper(configspace.load_vehicle("ift-four-steered"), kappa_n, beta, v_s)


@given(vehicles(("steered", "mixed", "turntable", "loaded")), configurations())
def test_steered_wheels_follow_the_papers_cases_on_any_vehicle(
    vehicle: Vehicle, configuration: tuple[float, float]
) -> None:
    assert_paper(vehicle, *configuration, 0.9)


def test_mecanum_rows_are_those_of_the_lecture() -> None:
    a, b = 0.3, 0.25
    vehicle = of(  # front left, front right, rear left, rear right
        {"type": "mecanum", "x": a, "y": b, "roller_deg": -45, "max_speed": 1},
        {"type": "mecanum", "x": a, "y": -b, "roller_deg": 45, "max_speed": 1},
        {"type": "mecanum", "x": -a, "y": b, "roller_deg": 45, "max_speed": 1},
        {"type": "mecanum", "x": -a, "y": -b, "roller_deg": -45, "max_speed": 1},
    )
    expected = [
        [1, -1, -(a + b)],
        [1, 1, a + b],
        [1, 1, -(a + b)],
        [1, -1, a + b],
    ]
    np.testing.assert_allclose(rows(vehicle), expected, atol=1e-12)


def test_catalogue_mecanum_has_rows_of_both_hands() -> None:
    vehicle = configspace.load_vehicle("mecanum")
    matrix = rows(vehicle)
    np.testing.assert_allclose(matrix[:, 0], 1, atol=1e-12)
    np.testing.assert_allclose(np.abs(matrix[:, 1]), 1, atol=1e-12)
    np.testing.assert_allclose(np.abs(matrix[:, 2]), 0.55, atol=1e-12)
    # Equal hands on a diagonal (section 3.1), and the rows span all motions.
    assert np.linalg.matrix_rank(matrix) == 3
    for wheel, row in zip(vehicle.wheels, matrix, strict=True):
        assert row[1] == pytest.approx(-np.sign(wheel.x * wheel.y))


def test_omni_rows_are_those_of_the_lecture() -> None:
    b = 0.2
    vehicle = of(
        *(
            {
                "type": "omni",
                "x": b * math.cos(math.radians(at)),
                "y": b * math.sin(math.radians(at)),
                "heading_deg": heading,
                "max_speed": 1,
            }
            for at, heading in ((0, -90), (120, 30), (-120, 150))
        )
    )
    h = math.sqrt(3) / 2
    expected = [[0, -1, -b], [h, 0.5, -b], [-h, 0.5, -b]]
    np.testing.assert_allclose(rows(vehicle), expected, atol=1e-12)


def test_differential_rows_are_those_of_the_lecture() -> None:
    b = 0.22  # half the track
    matrix = rows(configspace.load_vehicle("differential"))[:2, [0, 2]]
    np.testing.assert_allclose(matrix, [[1, -b], [1, b]], atol=1e-12)


def test_a_wheel_mounted_backwards_rolls_backwards() -> None:
    wheel = {"type": "fixed", "x": 0, "y": 0.2, "max_speed": 1}
    vehicle = of(wheel, {**wheel, "y": -0.2, "heading_deg": 180})
    alpha, u = configspace.wheel_states(vehicle, 0.0, 0.0, 1.0)
    np.testing.assert_allclose(u, [1, -1])
    np.testing.assert_allclose(np.abs(alpha), [0, np.pi])


@pytest.mark.parametrize("seed", range(24))
def test_wheels_move_as_a_simulated_rigid_body(seed: int) -> None:
    rng = np.random.default_rng(seed)
    vehicle = random_vehicle(rng)
    kappa_n, beta = rng.uniform(-2, 2), rng.uniform(-np.pi, np.pi)
    v_s = rng.uniform(-1, 1)
    if vehicle.mobility.line_beta is not None:
        beta = vehicle.mobility.line_beta
    vx, vy, omega = naive.twist(kappa_n, beta, v_s, vehicle.boundary_curvature)
    kx, ky = naive.reference(vehicle)
    alpha, u = configspace.wheel_states(vehicle, kappa_n, beta, v_s)
    h = 1e-5
    for i, wheel in enumerate(vehicle.wheels):
        if isinstance(wheel, Castor):
            assert np.isnan(u[i])
            continue

        def place(t: float, px: float = wheel.x - kx, py: float = wheel.y - ky):  # type: ignore[no-untyped-def]
            theta = omega * t  # the body turned by θ, K moved along the mean twist
            if abs(omega) > 1e-12:
                sx = (math.sin(theta) * vx - (1 - math.cos(theta)) * vy) / omega
                sy = ((1 - math.cos(theta)) * vx + math.sin(theta) * vy) / omega
            else:
                sx, sy = vx * t, vy * t
            x = sx + math.cos(theta) * px - math.sin(theta) * py
            y = sy + math.sin(theta) * px + math.cos(theta) * py
            return np.array([x, y])

        moved = (place(h) - place(-h)) / (2 * h)
        if isinstance(wheel, SteerableWheel):
            rolled = u[i] * np.array([math.cos(alpha[i]), math.sin(alpha[i])])
            np.testing.assert_allclose(rolled, moved, atol=1e-6)
        else:
            speed = naive.rolling(wheel, *moved)
            assert u[i] == pytest.approx(speed, abs=1e-6)
        if wheel.type == "fixed":
            side = wheel.heading + math.pi / 2
            slip = moved @ [math.cos(side), math.sin(side)]
            assert slip == pytest.approx(0, abs=1e-6)


def test_angles_stay_when_driving_backwards() -> None:
    vehicle = configspace.load_vehicle("ift-four-steered")
    kappa_n, beta = np.meshgrid(np.linspace(-2, 2, 21), np.linspace(-3, 3, 21))
    forward, u = configspace.wheel_states(vehicle, kappa_n, beta, 0.7)
    backward, minus_u = configspace.wheel_states(vehicle, kappa_n, beta, -0.7)
    np.testing.assert_array_equal(forward, backward)
    np.testing.assert_array_equal(u, -minus_u)


def test_the_other_representation_turns_every_wheel_by_half_a_turn() -> None:
    vehicle = configspace.load_vehicle("ift-four-steered")
    rng = np.random.default_rng(0)
    kappa_n, beta = rng.uniform(-2, 2, 200), rng.uniform(-np.pi, np.pi, 200)
    alpha, u = configspace.wheel_states(vehicle, kappa_n, beta, 1.0)
    other, minus_u = configspace.wheel_states(vehicle, -kappa_n, beta + np.pi, -1.0)
    np.testing.assert_allclose(np.exp(1j * other), -np.exp(1j * alpha), atol=1e-9)
    np.testing.assert_allclose(minus_u, -u, atol=1e-12)


def test_all_beta_are_one_configuration_at_the_pole() -> None:
    vehicle = configspace.load_vehicle("ift-four-steered")
    alpha, u = configspace.wheel_states(vehicle, 2.0, np.linspace(-3, 3, 13), 1.0)
    np.testing.assert_allclose(np.exp(1j * (alpha - alpha[:1])), 1, atol=1e-12)
    np.testing.assert_allclose(u, 1.0)


def test_the_angle_at_a_singular_point_is_zero() -> None:
    vehicle = of({"type": "steered", "x": 0.5, "y": 0, "max_speed": 1})
    alpha, u = configspace.wheel_states(vehicle, 2.0, 0.0, 1.0)
    assert float(alpha[0]) == pytest.approx(np.pi / 2)
    at_k = of(
        {"type": "steered", "x": 0.0, "y": 0, "max_speed": 1},
        {"type": "steered", "x": 0.5, "y": 0, "max_speed": 1},
    )
    alpha, u = configspace.wheel_states(at_k, -2.0, -3.0, 1.0)
    assert (float(alpha[0]), float(u[0])) == (0.0, 0.0)


def test_shapes_broadcast() -> None:
    vehicle = configspace.load_vehicle("mecanum")
    alpha, u = configspace.wheel_states(
        vehicle, np.zeros((5, 1, 1)), np.zeros((3, 1)), np.zeros(2)
    )
    assert alpha.shape == u.shape == (5, 3, 2, 4)
    assert configspace.wheel_directions(vehicle, 0.0, np.zeros(7)).shape == (7, 4)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_refuses_what_is_not_finite(bad: float) -> None:
    vehicle = configspace.load_vehicle("mecanum")
    for arguments in ((bad, 0.0, 0.0), (0.0, bad, 0.0), (0.0, 0.0, bad)):
        with pytest.raises(configspace.InvalidInput):
            configspace.wheel_states(vehicle, *arguments)
    with pytest.raises(configspace.InvalidInput):
        configspace.wheel_directions(vehicle, 2.1, 0.0)
