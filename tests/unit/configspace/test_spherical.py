import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

import configspace
from configspace.spherical import (
    angular_distance,
    energy_length,
    from_spherical,
    omni_curve_to_spherical,
    sphere_point,
    spherical_to_omni_curve,
    to_spherical,
    translate,
)
from configspace.testing import configurations

KINKS = [-2.0, -1.0, 0.0, 1.0, 2.0]
speeds = st.floats(-3, 3)
lengths = st.floats(0.05, 20)
angles = st.floats(-10, 10)


def motion(
    rho: npt.ArrayLike, phi: npt.ArrayLike, theta: npt.ArrayLike, d: float
) -> np.ndarray:
    """Twist in equal units, (vx, vy, d ω)."""
    return np.asarray(from_spherical(rho, phi, theta, d) * [1, 1, d])


@given(speeds, speeds, speeds, lengths)
def test_twist_and_back(vx: float, vy: float, omega: float, d: float) -> None:
    rho, phi, theta = to_spherical([vx, vy, omega], d)
    assert rho >= 0
    assert -np.pi < phi <= np.pi
    assert abs(theta) <= np.pi / 2
    back = from_spherical(rho, phi, theta, d) * [1, 1, d]
    np.testing.assert_allclose(back, [vx, vy, d * omega], atol=1e-14 * (1 + float(rho)))


@given(speeds, angles, angles, lengths)
def test_any_coordinates_have_a_twist(
    rho: float, phi: float, theta: float, d: float
) -> None:
    back = to_spherical(from_spherical(rho, phi, theta, d), d)
    np.testing.assert_allclose(motion(*back, d), motion(rho, phi, theta, d), atol=1e-13)
    assert back[0] == pytest.approx(abs(rho), abs=1e-13)


def test_undefined_angles_are_zero() -> None:
    for twist in ([0.0, 0.0, 0.0], [-0.0, -0.0, -0.0]):
        np.testing.assert_array_equal(to_spherical(twist, 1.0), [0, 0, 0])
    rho, phi, theta = to_spherical([-0.0, 0.0, -2.0], 0.5)
    np.testing.assert_array_equal([rho, phi, theta], [1.0, 0.0, -np.pi / 2])


def test_backwards_is_pi_whatever_the_sign_of_zero() -> None:
    for zero in (0.0, -0.0, -5e-324):
        assert to_spherical([-1.0, zero, 0.0], 1.0)[1] == np.pi


@given(configurations(), speeds, lengths)
def test_omni_curve_state_and_twist_agree(
    at: tuple[float, float], v_s: float, d: float
) -> None:
    kappa_n, beta = at
    spherical = omni_curve_to_spherical(kappa_n, beta, v_s)
    twist = configspace.to_twist(kappa_n, beta, v_s, 1 / d)
    np.testing.assert_allclose(
        motion(*spherical, d), twist * [1, 1, d], atol=1e-14 * (1 + abs(v_s))
    )
    rho, _, theta = spherical
    larger = max(np.cos(theta), abs(np.sin(theta)))
    assert v_s == pytest.approx(rho * larger, abs=1e-14)


@given(configurations(), speeds)
def test_omni_curve_state_and_back(at: tuple[float, float], v_s: float) -> None:
    kappa_n, beta = at
    back = spherical_to_omni_curve(*omni_curve_to_spherical(kappa_n, beta, v_s))
    assert back[0] == pytest.approx(kappa_n, abs=1e-15)
    assert abs(np.exp(1j * back[1]) - np.exp(1j * beta)) < 1e-15 * (1 + abs(beta))
    assert back[2] == pytest.approx(v_s, rel=1e-15)


@pytest.mark.parametrize("kappa_n", KINKS)
def test_kinks_come_back_to_the_last_digits(kappa_n: float) -> None:
    spherical = omni_curve_to_spherical(kappa_n, 0.7, -0.4)
    state = spherical_to_omni_curve(*spherical)
    np.testing.assert_allclose(state, [kappa_n, 0.7, -0.4], rtol=3e-16, atol=0)
    assert omni_curve_to_spherical(kappa_n, 0.7, -0.4)[0] < 0


@pytest.mark.parametrize("kappa_n", KINKS)
def test_latitude_is_smooth_across_the_kinks(kappa_n: float) -> None:
    h = 1e-6
    theta = omni_curve_to_spherical(kappa_n + h * np.array([-1, 0, 1]), 0.0, 1.0)[2]
    steps = np.diff(theta)
    assert steps[0] == pytest.approx(steps[1], rel=1e-5)


@given(st.floats(-4, 4), angles, speeds)
def test_past_the_pole_the_wheels_stay(kappa_n: float, beta: float, v_s: float) -> None:
    spherical = omni_curve_to_spherical(kappa_n, beta, v_s)
    state = spherical_to_omni_curve(*spherical)
    assert abs(state[0]) <= 2
    assert np.sign(state[2]) == np.sign(v_s)
    again = omni_curve_to_spherical(*state)
    np.testing.assert_allclose(motion(*again, 1.0), motion(*spherical, 1.0), atol=1e-14)


@given(speeds, angles, angles, st.complex_numbers(max_magnitude=3), lengths)
def test_another_point_of_the_same_body(
    rho: float, phi: float, theta: float, offset: complex, d: float
) -> None:
    vx, vy, omega = from_spherical(rho, phi, theta, d)
    moved = translate(rho, phi, theta, offset, d)
    # v + ω x w, Eq. (3.50)
    expected = np.array([vx - omega * offset.imag, vy + omega * offset.real, d * omega])
    scale = 1e-13 * (1 + abs(offset) / d)
    np.testing.assert_allclose(motion(*moved, d), expected, atol=scale)
    assert moved[0] * rho >= 0  # Eq. (3.51)
    back = translate(*moved, -offset, d)  # Eq. (3.78)
    np.testing.assert_allclose(
        motion(*back, d), motion(rho, phi, theta, d), atol=scale * (1 + abs(offset) / d)
    )


def test_a_steering_axis_as_origin_measures_the_steering_angle() -> None:
    agv = configspace.load_vehicle("ift-four-steered")
    d = 1 / agv.boundary_curvature
    kappa_n, beta = np.array([0.0, 0.8, -1.3, 2.0]), np.array([0.4, -2.0, 3.0, 0.2])
    alpha, u = configspace.wheel_states(agv, kappa_n, beta, 0.6)
    spherical = omni_curve_to_spherical(kappa_n, beta, 0.6)
    for i, wheel in enumerate(agv.wheels):
        rho, phi, theta = translate(*spherical, wheel.position - agv.reference, d)
        np.testing.assert_allclose(phi, alpha[:, i], atol=1e-13)
        np.testing.assert_allclose(rho * np.cos(theta), u[:, i], atol=1e-13)


def test_another_reference_point_of_a_vehicle() -> None:
    """Wheel states of one motion do not depend on the choice of K."""
    wheels = [
        {"id": f"{x}{y}", "type": "steered", "x": x, "y": y, "max_speed": 1.0}
        for x, y in ((0.5, 0.3), (-0.5, 0.3), (-0.5, -0.3), (0.5, -0.3))
    ]
    middle, corner = (
        configspace.vehicle_from_data(
            {"name": "v", "kappa_g": 2.5, "reference_point": k, "wheels": wheels}
        )
        for k in ((0.0, 0.0), (0.2, -0.4))
    )
    spherical = to_spherical([0.3, -0.5, 0.9], 0.4)
    moved = translate(*spherical, 0.2 - 0.4j, 0.4)
    for one, other in zip(
        configspace.wheel_states(middle, *spherical_to_omni_curve(*spherical)),
        configspace.wheel_states(corner, *spherical_to_omni_curve(*moved)),
        strict=True,
    ):
        np.testing.assert_allclose(one, other, atol=1e-13)


def test_arrays_broadcast_and_stay_as_they_are() -> None:
    kappa_n = np.linspace(-2, 2, 5)
    kappa_n.flags.writeable = False
    rho, phi, theta = omni_curve_to_spherical(kappa_n[:, None], np.zeros(3), 1.0)
    assert rho.shape == phi.shape == theta.shape == (5, 3)
    assert from_spherical(rho, phi, theta, 1.0).shape == (5, 3, 3)
    assert translate(rho, phi, theta, 1j, 1.0)[0].shape == (5, 3)


@pytest.mark.parametrize("d", [0.0, -1.0, np.inf, np.nan, 1e-320, [1.0, 2.0], "one"])
def test_the_length_must_be_positive(d: object) -> None:
    with pytest.raises(configspace.InvalidInput, match="d"):
        to_spherical([1.0, 0.0, 0.0], d)  # type: ignore[arg-type]


def test_bad_states_are_named() -> None:
    with pytest.raises(configspace.InvalidInput, match=r"kappa_n: 4\.1 in size"):
        omni_curve_to_spherical(-4.1, 0.0, 1.0)
    with pytest.raises(configspace.InvalidInput, match="theta"):
        from_spherical(1.0, 0.0, np.nan, 1.0)
    with pytest.raises(configspace.InvalidInput, match="shape"):
        to_spherical([1.0, 0.0], 1.0)
    with pytest.raises(configspace.InvalidInput, match=r"rho \(2,\), phi \(3,\)"):
        spherical_to_omni_curve([1.0, 2.0], [0.0, 0.0, 0.0], 0.0)


# --- points of the sphere and the metric of energy


@given(st.integers(0, 2**32 - 1))
def test_with_the_radius_of_gyration_rho_is_the_speed_of_energy(seed: int) -> None:
    """Against a cloud of point masses, seen from a K beside its centre of gravity."""
    rng = np.random.default_rng(seed)
    mass = rng.uniform(1, 20, 12)
    place = rng.normal(0, 0.5, 12) + 1j * rng.normal(0, 0.3, 12)  # from K
    centre = complex((mass * place).sum() / mass.sum())
    inertia = float((mass * np.abs(place - centre) ** 2).sum())
    twist = rng.uniform(-1, 1, 3)
    velocity = complex(twist[0], twist[1]) + 1j * twist[2] * place
    energy = (mass * np.abs(velocity) ** 2).sum() / 2
    d = energy_length(float(mass.sum()), inertia)
    rho, _, _ = translate(*to_spherical(twist, d), centre, d)
    assert mass.sum() * rho**2 / 2 == pytest.approx(energy, rel=1e-9)


def test_energy_of_the_specification() -> None:
    """O-09: m = 180 kg, I = m d²."""
    d = 0.2990819286
    assert energy_length(180.0, 180.0 * d**2) == pytest.approx(d, rel=1e-12)
    rho = to_spherical([0.4, 0.3, 0.5], energy_length(180.0, 180.0 * d**2))[0]
    assert 180 * rho**2 / 2 == pytest.approx(24.512625, abs=1e-6)


@pytest.mark.parametrize(("mass", "inertia"), [(0, 1), (1, -1), (np.inf, 1), (1, 0)])
def test_a_mass_that_is_none_is_refused(mass: float, inertia: float) -> None:
    with pytest.raises(configspace.InvalidInput):
        energy_length(mass, inertia)


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.2, 1.0, 3.0]))
def test_points_of_the_sphere_are_directions_of_the_twist(
    seed: int, scale: float
) -> None:
    rng = np.random.default_rng(seed)
    kappa_n, beta = rng.uniform(-2, 2, 50), rng.uniform(-4, 4, 50)
    twist = configspace.to_twist(kappa_n, beta, 1.0, 2.0)
    rho, phi, theta = to_spherical(twist, scale / 2.0)
    point = sphere_point(kappa_n, beta, scale)
    np.testing.assert_allclose(np.linalg.norm(point, axis=-1), 1, rtol=1e-15)
    np.testing.assert_allclose(
        point * rho[:, None], twist * [1, 1, scale / 2.0], atol=1e-12
    )
    np.testing.assert_allclose(np.arcsin(point[:, 2]), theta, atol=1e-7)
    assert np.isfinite(phi).all()
    opposite = sphere_point(-kappa_n, beta + np.pi, scale)
    np.testing.assert_allclose(angular_distance(point, opposite), np.pi, rtol=1e-15)
    np.testing.assert_allclose(
        angular_distance(point[1:], point[:-1]),
        np.arccos(np.clip((point[1:] * point[:-1]).sum(axis=-1), -1, 1)),
        atol=1e-7,
    )


def test_the_pole_is_one_point_and_small_angles_are_exact() -> None:
    pole = sphere_point(2.0, np.linspace(-3, 3, 7))
    np.testing.assert_array_equal(pole, np.broadcast_to([0.0, 0.0, 1.0], (7, 3)))
    near = angular_distance(sphere_point(0.0, 0.0), sphere_point(0.0, 1e-12))
    assert near == pytest.approx(1e-12, rel=1e-12)
    with pytest.raises(configspace.InvalidInput, match="scale"):
        sphere_point(0.0, 0.0, -1.0)
