import math
from typing import Literal

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given

import configspace
from configspace.gradients import WheelGradients, wheel_gradients
from configspace.testing import VEHICLE_KINDS, configurations, random_vehicle, vehicles
from configspace.vehicle import SteerableWheel, Vehicle

FloatArray = npt.NDArray[np.float64]
NAMES = ("alpha_kappa", "alpha_beta", "speed_kappa", "speed_beta")


def care_o_bot() -> Vehicle:
    """Section 5.1 of spec/steered-wheels, wheels in its order."""
    corners = [(0.235, 0.185), (-0.235, 0.185), (-0.235, -0.185), (0.235, -0.185)]
    return configspace.vehicle_from_data(
        {
            "name": "care-o-bot-3",
            "wheels": [
                {"type": "steered", "id": f"w{i}", "x": x, "y": y, "max_speed": 1.0}
                for i, (x, y) in enumerate(corners)
            ],
        }
    )


def differences(
    vehicle: Vehicle, kappa_n: float, beta: float, step: tuple[float, float]
) -> tuple[FloatArray, FloatArray]:
    """Second-order differences of α and rolling speed from one side, or central."""
    at = [(kappa_n + i * step[0], beta + i * step[1]) for i in (-1, 0, 1, 2)]
    central = not (abs(kappa_n) in {1.0, 2.0} and step[0])
    states = [
        configspace.wheel_states(vehicle, k, b, 1.0) if central or i else None
        for i, (k, b) in enumerate(at)
    ]
    h = step[0] + step[1]
    found = []
    for part in (0, 1):
        values = [None if x is None else np.array(x[part]) for x in states]
        zero, one = values[1], values[2]
        assert zero is not None
        assert one is not None

        def change(x: FloatArray | None, zero: FloatArray = zero) -> FloatArray:
            assert x is not None
            return np.asarray((x - zero + np.pi) % (2 * np.pi) - np.pi)

        if central:
            found.append((change(one) - change(values[0])) / (2 * h))
        else:
            found.append((4 * change(one) - change(values[3])) / (2 * h))
    return found[0], found[1]


def assert_as_differences(
    vehicle: Vehicle, kappa_n: float, beta: float, side: Literal[-1, 1] = -1
) -> None:
    gradients = wheel_gradients(vehicle, kappa_n, beta, side=side)
    slowest = np.abs(configspace.wheel_directions(vehicle, kappa_n, beta))
    h = 1e-5 * side * math.copysign(1, kappa_n)
    with_kappa = differences(vehicle, kappa_n, beta, (h, 0.0))
    with_beta = differences(vehicle, kappa_n, beta, (0.0, 1e-5))
    expected = (with_kappa[0], with_beta[0], with_kappa[1], with_beta[1])
    rolls = np.isfinite(gradients.speed_beta) & (slowest > 0.05)
    for name, value, other in zip(NAMES, gradients, expected, strict=True):
        # The third derivatives, and so the differences, grow as 1/|z|³.
        tolerance = 1e-6 * (1 + 1e-3 / slowest**3)
        wrong = rolls & (np.abs(value - other) > tolerance * (1 + np.abs(value)))
        assert not wrong.any(), (name, kappa_n, beta, side, value, other)


@pytest.mark.parametrize("kind", VEHICLE_KINDS)
def test_gradients_are_those_of_finite_differences(kind: str) -> None:
    rng = np.random.default_rng(20)
    for _ in range(40):
        vehicle = random_vehicle(rng, next(k for k in VEHICLE_KINDS if k == kind))
        for _ in range(5):
            kappa_n, beta = float(rng.uniform(-2, 2)), float(rng.uniform(-3.1, 3.1))
            if min(abs(abs(kappa_n) - kink) for kink in (1, 2)) > 1e-4:
                assert_as_differences(vehicle, kappa_n, beta)


@pytest.mark.parametrize("kappa_n", [-1.0, 1.0])
@pytest.mark.parametrize("side", [-1, 1])
def test_each_side_of_the_kink_has_its_gradients(
    kappa_n: float, side: Literal[-1, 1]
) -> None:
    rng = np.random.default_rng(21)
    for index in range(60):
        vehicle = random_vehicle(rng, VEHICLE_KINDS[index % len(VEHICLE_KINDS)])
        assert_as_differences(vehicle, kappa_n, float(rng.uniform(-3, 3)), side)


@pytest.mark.parametrize("kappa_n", [-2.0, 2.0])
def test_at_the_poles_gradients_are_those_from_within(kappa_n: float) -> None:
    assert_as_differences(care_o_bot(), kappa_n, 0.4, -1)


@given(vehicles(), configurations())
def test_only_speeds_depend_on_the_side_and_only_at_the_kink(
    vehicle: Vehicle, at: tuple[float, float]
) -> None:
    inner, outer = (wheel_gradients(vehicle, *at, side=side) for side in (-1, 1))
    steers = [isinstance(w, SteerableWheel) for w in vehicle.wheels]
    for name in NAMES:
        one, other = getattr(inner, name), getattr(outer, name)
        if name != "speed_kappa" or abs(at[0]) != 1:
            slow = np.abs(configspace.wheel_directions(vehicle, *at)) < 1e-6
            fine = ~(slow & steers) if name == "alpha_kappa" else slow | ~slow
            np.testing.assert_allclose(one[fine], other[fine], rtol=1e-6, atol=1e-9)


@given(vehicles(), configurations())
def test_the_complex_form_equals_the_formulas_of_the_specification(
    vehicle: Vehicle, at: tuple[float, float]
) -> None:
    kappa_n, beta = at
    inner = abs(kappa_n) < 1
    c, s = (1.0, kappa_n) if inner else (2 - abs(kappa_n), math.copysign(1, kappa_n))
    gradients = wheel_gradients(vehicle, kappa_n, beta, side=1)
    for i, wheel in enumerate(vehicle.wheels):
        place = vehicle.contacts[i] - vehicle.reference
        x, y = (vehicle.boundary_curvature * v for v in (place.real, place.imag))
        f = x * math.sin(beta) - y * math.cos(beta)
        g = x * math.cos(beta) + y * math.sin(beta)
        q = c * c + s * s * (x * x + y * y) + 2 * c * s * f
        if not isinstance(wheel, SteerableWheel) or q < 1e-6:
            continue
        root = math.sqrt(q)
        outwards = -math.copysign(1, kappa_n) * (c + s * f)
        expected = (
            g / q,
            c * (c + s * f) / q,
            (f + kappa_n * (x * x + y * y) if inner else outwards) / root,
            c * s * g / root,
        )
        for name, value in zip(NAMES, expected, strict=True):
            close = pytest.approx(value, rel=1e-9, abs=1e-9 / q)
            assert getattr(gradients, name)[i] == close


def test_wheels_that_do_not_steer_do_not_turn_and_castors_say_nothing() -> None:
    rng = np.random.default_rng(22)
    for kind in VEHICLE_KINDS:
        vehicle = random_vehicle(rng, kind)
        gradients = wheel_gradients(vehicle, [[0.3], [1.4]], [0.1, 0.2, 0.3])
        for i, wheel in enumerate(vehicle.wheels):
            parts = [g[..., i] for g in gradients]
            assert all(part.shape == (2, 3) for part in parts)
            if wheel.type == "castor":
                assert all(np.isnan(part).all() for part in parts)
            elif not isinstance(wheel, SteerableWheel):
                assert not parts[0].any()
                assert not parts[1].any()


def test_at_a_singular_point_that_wheel_alone_has_no_gradients() -> None:
    vehicle = care_o_bot()
    on_wheel = math.atan2(0.185, 0.235) - math.pi / 2  # O-29
    gradients = wheel_gradients(vehicle, 1.0, on_wheel)
    for part in gradients:
        assert np.isnan(part).tolist() == [True, False, False, False]


def test_bad_input_is_refused() -> None:
    with pytest.raises(configspace.InvalidInput, match="kappa_n"):
        wheel_gradients(care_o_bot(), 2.1, 0.0)
    with pytest.raises(configspace.InvalidInput, match="beta"):
        wheel_gradients(care_o_bot(), 0.0, [0.0, math.nan])


# --- oracles of spec/steered-wheels §7; κ_n = tan θ, so dκ_n/dθ = 1 + κ_n² inside


def oracle(theta: float, phi: float) -> tuple[FloatArray, FloatArray]:
    """∂α/∂φ and ∂α/∂θ of the spherical twist, |θ| ≤ π/4."""
    kappa_n = min(1.0, math.tan(theta))
    gradients = wheel_gradients(care_o_bot(), kappa_n, phi)
    return gradients.alpha_beta, gradients.alpha_kappa * (1 + kappa_n**2)


@pytest.mark.parametrize("beta", [-2.0, 0.0, 1.1])
def test_o_16_in_translation_wheels_turn_as_beta_and_at_the_poles_not_at_all(
    beta: float,
) -> None:
    def turn(kappa_n: float) -> FloatArray:
        return wheel_gradients(care_o_bot(), kappa_n, beta).alpha_beta

    assert turn(0.0) == pytest.approx(np.ones(4), abs=1e-12)
    assert turn(2.0) == pytest.approx(np.zeros(4), abs=1e-12)
    assert turn(-2.0) == pytest.approx(np.zeros(4), abs=1e-12)


def test_o_17() -> None:
    with_phi, with_theta = oracle(0.5, 0.3)
    assert with_phi == pytest.approx([0.886959, 1.378950, 0.707511, 0.659603], abs=1e-6)
    expected = [1.337043, -1.847519, -0.717005, 0.335480]
    assert with_theta == pytest.approx(expected, abs=1e-6)


def test_o_18() -> None:
    expected = [2.059923, -2.059923, -0.485455, 0.485455]
    _, with_theta = oracle(math.pi / 4, 0.0)
    assert with_theta == pytest.approx(expected, abs=1e-6)
    reach = math.hypot(0.235, 0.185)
    assert with_theta[0] == pytest.approx(0.235 / (reach - 0.185), abs=1e-9)
    along = [oracle(theta, 0.0)[1][0] for theta in np.linspace(0, math.pi / 4, 50)]
    assert max(along) == along[-1]


def test_o_21() -> None:
    gradients = wheel_gradients(care_o_bot(), 0.5, 0.0)
    expected = [1.093880, 1.093880, 0.700689, 0.700689]
    assert gradients.alpha_beta == pytest.approx(expected, abs=1e-6)
    expected = [1.244358, -1.244358, -0.420505, 0.420505]
    assert gradients.alpha_kappa == pytest.approx(expected, abs=1e-6)


def test_o_22_wheels_on_the_boundary_circle() -> None:
    vehicle = care_o_bot()
    for beta in (-2.5, 0.0, 0.3, 1.4):
        at_kink = wheel_gradients(vehicle, 1.0, beta)
        assert at_kink.alpha_beta == pytest.approx(np.full(4, 0.5), abs=1e-9)
        low, high = (wheel_gradients(vehicle, k, beta) for k in (0.5, 1.5))
        assert low.alpha_kappa == pytest.approx(high.alpha_kappa, abs=1e-9)
        assert low.alpha_beta + high.alpha_beta == pytest.approx(np.ones(4), abs=1e-9)
    assert wheel_gradients(vehicle, 1.5, 0.0).alpha_beta[0] == pytest.approx(
        -0.093880, abs=1e-6
    )
    expected = [0.566, 0.297, 0.824, 0.955]
    inner, outer = speed_gradients(vehicle, -1), speed_gradients(vehicle, 1)
    assert inner.speed_kappa == pytest.approx(expected, abs=5e-4)
    assert outer.speed_kappa == pytest.approx(-np.array(expected), abs=5e-4)


def speed_gradients(vehicle: Vehicle, side: Literal[-1, 1]) -> WheelGradients:
    return wheel_gradients(vehicle, 1.0, 0.3, side=side)
