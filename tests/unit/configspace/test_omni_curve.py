import naive
import numpy as np
import pytest
from hypothesis import given

import configspace
from configspace.angles import wrap
from configspace.omni_curve import components, curvature_of_ratio
from configspace.testing import configurations

KAPPA_G = 4.1
KINKS = [-2.0, -1.5, -1.0, -0.999, -0.5, -0.0, 0.0, 0.3, 1.0, 1.001, 1.7, 2.0]
BETAS = [-np.pi, -2.0, -np.pi / 2, 0.0, 0.7, np.pi / 2, 3.0, np.pi]


@pytest.mark.parametrize("kappa_n", KINKS)
@pytest.mark.parametrize("beta", BETAS)
@pytest.mark.parametrize("v_s", [-1.3, 0.0, 0.4])
def test_twist_is_that_of_the_papers_cases(
    kappa_n: float, beta: float, v_s: float
) -> None:
    twist = configspace.to_twist(kappa_n, beta, v_s, KAPPA_G)
    np.testing.assert_allclose(
        twist, naive.twist(kappa_n, beta, v_s, KAPPA_G), rtol=0, atol=1e-12
    )


@given(configurations())
def test_twist_is_that_of_the_papers_cases_anywhere(
    configuration: tuple[float, float],
) -> None:
    twist = configspace.to_twist(*configuration, 0.7, KAPPA_G)
    expected = naive.twist(*configuration, 0.7, KAPPA_G)
    np.testing.assert_allclose(twist, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("sign", [-1, 1])
def test_parameters_survive_the_round_trip(sign: int) -> None:
    rng = np.random.default_rng(1)
    kappa_n = np.concatenate([rng.uniform(-1.99, 1.99, 2000), KINKS[1:-1]])
    beta = rng.uniform(-np.pi, np.pi, kappa_n.size)
    v_s = sign * rng.uniform(0.1, 3, kappa_n.size)
    twist = configspace.to_twist(kappa_n, beta, v_s, KAPPA_G)
    back_kappa, back_beta, back_v = configspace.from_twist(twist, KAPPA_G, sign)
    np.testing.assert_allclose(back_kappa, kappa_n, atol=1e-13)
    np.testing.assert_allclose(wrap(back_beta - beta), 0, atol=1e-12)
    np.testing.assert_allclose(back_v, v_s, atol=1e-13)


@pytest.mark.parametrize("sign", [-1, 1])
def test_twists_survive_the_round_trip(sign: int) -> None:
    rng = np.random.default_rng(2)
    twist = rng.normal(size=(2000, 3)) * 10.0 ** rng.integers(-6, 3, (2000, 3))
    twist[:200, 2] = 0
    twist[200:400, :2] = 0
    twist[400:450] = 0
    kappa_n, beta, v_s = configspace.from_twist(twist, KAPPA_G, sign)
    assert (np.sign(v_s) * sign >= 0).all()
    again = configspace.to_twist(kappa_n, beta, v_s, KAPPA_G)
    size = np.abs(twist).max(axis=1, keepdims=True)
    assert (np.abs(again - twist) <= 1e-14 * KAPPA_G * size).all()


@pytest.mark.parametrize("sign", [-1, 1])
def test_parameters_of_a_twist_are_those_of_the_papers_cases(sign: int) -> None:
    rng = np.random.default_rng(3)
    twists = rng.normal(size=(500, 3)) * [1, 1, KAPPA_G]
    kappa_n, beta, v_s = configspace.from_twist(twists, KAPPA_G, sign)
    for i, (vx, vy, omega) in enumerate(twists.tolist()):
        expected = naive.from_twist(vx, vy, omega, KAPPA_G, sign)
        assert kappa_n[i] == pytest.approx(expected[0], abs=1e-9)
        assert beta[i] == pytest.approx(expected[1], abs=1e-9)
        assert v_s[i] == pytest.approx(expected[2], abs=1e-9)


def test_every_twist_has_two_representations() -> None:
    # Fact 1: (κ_n, β, v_s) and (-κ_n, β + π, -v_s) are one twist.
    rng = np.random.default_rng(4)
    kappa_n, beta = rng.uniform(-2, 2, 500), rng.uniform(-np.pi, np.pi, 500)
    one = configspace.to_twist(kappa_n, beta, 0.8, KAPPA_G)
    other = configspace.to_twist(-kappa_n, beta + np.pi, -0.8, KAPPA_G)
    np.testing.assert_allclose(one, other, atol=1e-14)
    kappa_f, beta_f, v_f = configspace.from_twist(one, KAPPA_G, 1)
    kappa_r, beta_r, v_r = configspace.from_twist(one, KAPPA_G, -1)
    np.testing.assert_allclose(kappa_r, -kappa_f, atol=1e-14)
    np.testing.assert_allclose(np.abs(wrap(beta_r - beta_f)), np.pi, atol=1e-12)
    np.testing.assert_allclose(v_r, -v_f)


def test_backwards_is_beta_zero_and_negative_speed() -> None:
    kappa_n, beta, v_s = configspace.from_twist([-0.5, 0.0, 0.0], KAPPA_G, sign=-1)
    assert (float(kappa_n), float(beta), float(v_s)) == (0.0, 0.0, -0.5)
    kappa_n, beta, v_s = configspace.from_twist([-0.5, -0.0, -0.0], KAPPA_G)
    assert (float(kappa_n), float(beta), float(v_s)) == (0.0, np.pi, 0.5)


def test_sign_of_zero_is_plus() -> None:
    for zero in (0.0, -0.0):
        kappa_n, _, _ = configspace.from_twist([1.0, 0.0, zero], KAPPA_G)
        assert float(kappa_n) == 0.0
        assert not np.signbit(kappa_n)
    c, s = components([1.0, -1.0])
    np.testing.assert_array_equal(c, [1, 1])
    np.testing.assert_array_equal(s, [1, -1])


def test_pole_and_standstill_have_beta_zero() -> None:
    kappa_n, beta, v_s = configspace.from_twist(
        [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 0.0, 0.0]], KAPPA_G
    )
    np.testing.assert_array_equal(kappa_n, [2, -2, 0])
    np.testing.assert_array_equal(beta, 0)
    np.testing.assert_allclose(v_s, [1 / KAPPA_G, 1 / KAPPA_G, 0])


def test_shares_are_of_maximum_norm_one_and_match_at_the_kinks() -> None:
    c, s = components(np.linspace(-2, 2, 4001))
    np.testing.assert_allclose(np.maximum(c, np.abs(s)), 1, atol=1e-15)
    assert np.abs(np.diff(c)).max() < 1.1e-3
    assert np.abs(np.diff(s)).max() < 1.1e-3


def test_sign_may_differ_by_row() -> None:
    twist = [[1.0, 0, 0], [1.0, 0, 0]]
    _, beta, v_s = configspace.from_twist(twist, KAPPA_G, [1, -1])
    np.testing.assert_array_equal(v_s, [1, -1])
    np.testing.assert_allclose(beta, [0, np.pi])


def test_curvature_grows_with_rotation() -> None:
    kappa_n = curvature_of_ratio(1.0, np.linspace(-5, 5, 101))
    assert (np.diff(kappa_n) > 0).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 2.0000001, -3.0, "a", None])
def test_refuses_curvatures_out_of_range(bad: object) -> None:
    with pytest.raises(configspace.InvalidInput, match="kappa_n"):
        configspace.to_twist(bad, 0.0, 1.0, KAPPA_G)  # type: ignore[arg-type]


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_refuses_what_is_not_finite(bad: float) -> None:
    with pytest.raises(configspace.InvalidInput, match=r"beta\[1\]"):
        configspace.to_twist(0.0, [0.0, bad], 1.0, KAPPA_G)
    with pytest.raises(configspace.InvalidInput, match="v_s"):
        configspace.to_twist(0.0, 0.0, bad, KAPPA_G)
    with pytest.raises(configspace.InvalidInput, match=r"twist\[0, 2\]"):
        configspace.from_twist([[0.0, 0.0, bad]], KAPPA_G)


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_refuses_boundary_curvatures_that_are_not_positive(bad: float) -> None:
    with pytest.raises(configspace.InvalidInput, match="kappa_g"):
        configspace.to_twist(0.0, 0.0, 1.0, bad)
    with pytest.raises(configspace.InvalidInput, match="kappa_g"):
        configspace.from_twist([0.0, 0.0, 1.0], bad)


@pytest.mark.parametrize("bad", [0, 2, -0.5, np.nan])
def test_refuses_other_signs(bad: float) -> None:
    with pytest.raises(configspace.InvalidInput, match="sign"):
        configspace.from_twist([1.0, 0.0, 0.0], KAPPA_G, bad)


@pytest.mark.parametrize("bad", [1.0, [1.0, 2.0], [[1.0], [2.0]]])
def test_refuses_twists_without_three_components(bad: object) -> None:
    with pytest.raises(configspace.InvalidInput, match="shape"):
        configspace.from_twist(bad, KAPPA_G)  # type: ignore[arg-type]


def test_inputs_stay_as_they_are() -> None:
    twist = np.array([[-1.0, -0.0, 0.5]])
    copy = twist.copy()
    configspace.from_twist(twist, KAPPA_G, -1)
    np.testing.assert_array_equal(twist, copy)
