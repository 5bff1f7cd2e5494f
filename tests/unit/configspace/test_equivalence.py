import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import configspace
from configspace.equivalence import (
    cross_pole,
    equivalent,
    omni_curve_representations,
    representations,
)
from configspace.spherical import (
    from_spherical,
    omni_curve_to_spherical,
    spherical_to_omni_curve,
)
from configspace.testing import configurations

KINKS = [-4.0, -3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0, 4.0]
speeds = st.floats(-3, 3)


def twist_of(spherical: np.ndarray) -> np.ndarray:
    return from_spherical(spherical[0], spherical[1], spherical[2], d=0.7)


@given(speeds, st.floats(-10, 10), st.floats(-10, 10))
def test_spherical_representations_are_one_twist(
    rho: float, phi: float, theta: float
) -> None:
    four = representations(rho, phi, theta)
    assert ((four[:, 1:] > -np.pi) & (four[:, 1:] <= np.pi)).all()
    np.testing.assert_array_equal(np.sign(four[:, 0]), np.sign([rho, rho, -rho, -rho]))
    for state in four:
        np.testing.assert_allclose(
            twist_of(state),
            from_spherical(rho, phi, theta, d=0.7),
            atol=1e-13,
        )


@given(configurations(), speeds)
def test_both_kinds_of_representations_are_the_same(
    at: tuple[float, float], v_s: float
) -> None:
    four = omni_curve_representations(*at, v_s)
    spherical = representations(*omni_curve_to_spherical(*at, v_s))
    for state, twin in zip(four, spherical, strict=True):
        np.testing.assert_allclose(
            twist_of(np.stack(omni_curve_to_spherical(*state))),
            twist_of(twin),
            atol=1e-13,
        )
        latitude = omni_curve_to_spherical(*state)[2]
        assert abs(np.exp(1j * latitude) - np.exp(1j * twin[2])) < 1e-14


@pytest.mark.parametrize("kappa_n", KINKS)
def test_curvature_stays_in_its_range(kappa_n: float) -> None:
    four = omni_curve_representations(kappa_n, np.pi, 1.0)
    assert ((four[:, 0] > -4) & (four[:, 0] <= 4)).all()
    assert ((four[:, 1] > -np.pi) & (four[:, 1] <= np.pi)).all()


def test_two_representations_have_the_same_wheels() -> None:
    agv = configspace.load_vehicle("ift-four-steered")
    four = omni_curve_representations([0.3, -1.4, 0.0], [0.5, -2.0, 3.0], 0.8)
    flat = spherical_to_omni_curve(*omni_curve_to_spherical(*np.moveaxis(four, -1, 0)))
    alpha, u = configspace.wheel_states(agv, *flat)
    turned = np.exp(1j * (alpha - alpha[:, :1]))
    expected = np.broadcast_to(np.array([1, 1, -1, -1])[:, None], (3, 4, 4))
    np.testing.assert_allclose(turned, expected, atol=1e-12)
    np.testing.assert_allclose(u, u[:, :1] * expected, atol=1e-12)


@given(configurations())
def test_crossing_twice_is_no_crossing(at: tuple[float, float]) -> None:
    once = cross_pole(*at)
    for kappa_n, beta in (once, cross_pole(*once)):
        state = [float(kappa_n), float(beta), 1.0]
        assert equivalent(state, [*at, 1.0], of="configuration", tolerance=1e-14)


def test_at_the_pole_every_direction_is_the_same() -> None:
    a = np.array([2.0, 0.0, 0.5])
    b = np.stack([np.full(9, 2.0), np.linspace(-3, 3, 9), np.full(9, 0.5)], axis=-1)
    assert equivalent(a, b, of="configuration").all()
    assert not equivalent(a, b * [0.9, 1, 1], of="configuration").any()


def test_the_pole_is_crossed_as_the_specification_says() -> None:
    np.testing.assert_allclose(cross_pole(1.5, 0.0), (2.5, np.pi))
    np.testing.assert_allclose(cross_pole(-1.5, np.pi), (-2.5, 0.0), atol=1e-15)
    np.testing.assert_allclose(cross_pole(0.0, 1.0), (4.0, 1.0 - np.pi))
    np.testing.assert_allclose(cross_pole(-4.0, 1.0), (0.0, 1.0 - np.pi))


def test_equal_twists_and_equal_configurations() -> None:
    four = omni_curve_representations(0.5, 0.2, 1.0)
    for i, k in itertools.product(range(4), repeat=2):
        assert equivalent(four[i], four[k])
        same_wheels = i // 2 == k // 2
        assert bool(equivalent(four[i], four[k], of="configuration")) == same_wheels
    assert not equivalent(four[0], [0.5, 0.2, 1.1])
    assert not equivalent(four[0], [0.5, 0.21, 1.0])
    assert equivalent(four[0], [0.5, 0.21, 1.0], tolerance=0.02)


def test_standstill_is_one_twist_and_many_configurations() -> None:
    assert equivalent([0.0, 0.0, 0.0], [1.5, 2.0, 0.0])
    assert not equivalent([0.0, 0.0, 0.0], [1.5, 2.0, 0.0], of="configuration")
    assert equivalent([0.4, 0.0, 0.0], [0.4, 0.0, 0.0], of="configuration")


def test_states_broadcast() -> None:
    assert omni_curve_representations(np.zeros((5, 1)), np.zeros(2), 1.0).shape == (
        *(5, 2),
        *(4, 3),
    )
    assert representations(np.zeros((5, 1)), np.zeros(2), 1.0).shape == (5, 2, 4, 3)
    assert equivalent(np.zeros((5, 1, 3)), np.zeros((2, 3))).shape == (5, 2)


def test_bad_states_are_named() -> None:
    with pytest.raises(configspace.InvalidInput, match="of: 'speed'"):
        equivalent([0, 0, 0], [0, 0, 0], of="speed")  # type: ignore[arg-type]
    with pytest.raises(configspace.InvalidInput, match="b: shape"):
        equivalent([0, 0, 0], [0, 0])
    with pytest.raises(configspace.InvalidInput, match="kappa_n"):
        cross_pole(5.0, 0.0)
    with pytest.raises(configspace.InvalidInput, match="kappa_n"):
        omni_curve_representations(-4.5, 0.0, 1.0)
