"""A profile as a C² motion in time."""

from __future__ import annotations

import itertools

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import BSpline, CubicSpline

from omniplan.timing.solver import PieceProfile
from omniplan.timing.waves import GRADE, graded, spaced, wave_of

FloatArray = npt.NDArray[np.float64]

TOP, PULL, BRAKE = 1.5, 1.0, 2.0


def trapezoid(n: int = 400) -> PieceProfile:
    """From rest at 1 m/s² to 1.5 m/s, on, and to rest at 2 m/s², 4 m."""
    u = np.linspace(0.0, 4.0, n + 1)
    x = np.minimum(np.minimum(2 * PULL * u, TOP**2), 2 * BRAKE * (4.0 - u))
    spent = 2 * np.diff(u) / (np.sqrt(x[1:]) + np.sqrt(x[:-1]))
    row = np.zeros(n + 1, dtype=np.int64)
    return PieceProfile(u, x, row, np.ones(n + 1), 1, -1, float(spent.sum()))


def random_knots(rng: np.random.Generator, last: float) -> FloatArray:
    """Knots whose steps differ as they like."""
    step = rng.uniform(0.2, 1.0, int(rng.integers(8, 60))) ** 3
    t = np.concatenate([[0.0], np.cumsum(step)])
    return np.asarray(t * (last / t[-1]))


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 10**6))
def test_constant_limits_are_kept_whatever_the_steps(seed: int) -> None:
    rng, profile = np.random.default_rng(seed), trapezoid()
    wave = wave_of(profile, random_knots(rng, profile.duration))
    t = rng.uniform(0.0, profile.duration, 500)
    u, speed, change = wave.at(t)
    # Stretched by what means of a speed lose where it peaks.
    mean = (wave.speed[1:] + wave.speed[:-1]) / 2
    assert mean.max() <= TOP * 1.2
    stretch = wave.change.max() / PULL
    assert (change <= PULL * stretch * (1 + 1e-9)).all()
    assert (change >= -BRAKE * stretch * (1 + 1e-9)).all()
    assert (speed >= 0).all()
    assert (speed <= TOP * stretch * (1 + 1e-9)).all()
    assert (u >= 0).all()
    assert (u <= 4.0 + 1e-12).all()
    assert wave.speed[[0, -1]].tolist() == [0.0, 0.0]
    assert wave.u[[0, -1]].tolist() == [0.0, 4.0]


@pytest.mark.parametrize("seed", range(5))
def test_it_is_the_quadratic_b_spline_of_the_speed(seed: int) -> None:
    rng, profile = np.random.default_rng(seed), trapezoid()
    t = random_knots(rng, profile.duration)
    wave = wave_of(profile, t)
    middle = (t[1:] + t[:-1]) / 2
    speed = np.interp(middle, profile.times, np.sqrt(profile.x))
    h = np.diff(t)
    knots = np.concatenate(
        [t[0] - h[:2].cumsum()[::-1], t, t[-1] + h[[-1, -2]].cumsum()]
    )
    c = np.concatenate([-speed[:1], speed, -speed[-1:]])
    naive = BSpline(knots, c, 2)
    at = rng.uniform(0, profile.duration, 200)
    way = naive.integrate(0.0, profile.duration)
    np.testing.assert_allclose(wave.at(at)[1], naive(at) * 4.0 / way, atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_it_is_twice_differentiable_and_its_samples_give_it_back(seed: int) -> None:
    rng, profile = np.random.default_rng(seed), trapezoid()
    t = spaced(profile.times, np.full(profile.u.size, 0.05))
    wave = wave_of(profile, t)
    again = CubicSpline(wave.t, wave.u, bc_type="clamped")
    at = rng.uniform(0, profile.duration, 200)
    for order, values in enumerate(wave.at(at)):
        np.testing.assert_allclose(again(at, order), values, atol=1e-9)
    places = rng.uniform(0.01, 3.99, 20)
    np.testing.assert_allclose(wave.at(wave.passes(places))[0], places, atol=1e-12)


def test_with_short_steps_it_is_the_profile() -> None:
    profile = trapezoid()
    wave = wave_of(profile, spaced(profile.times, np.full(profile.u.size, 2e-3)))
    speed = np.interp(wave.t, profile.times, np.sqrt(profile.x))
    np.testing.assert_allclose(wave.speed, speed, atol=5e-3)
    way = cumulative_trapezoid(speed, wave.t, initial=0)
    np.testing.assert_allclose(wave.u, way, atol=2e-3)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 10**6))
def test_steps_are_graded_and_knots_follow_them(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.concatenate([[0.0], np.cumsum(rng.uniform(1e-3, 0.1, 80))])
    step = rng.uniform(0.001, 0.2, t.size)
    found = graded(t, step)
    assert (found <= step * (1 + 1e-12)).all()
    assert found.min() == pytest.approx(step.min(), rel=1e-9)
    assert (np.abs(np.diff(found)) <= GRADE * np.diff(t) * (1 + 1e-9)).all()
    knots = spaced(t, found)
    assert knots[[0, -1]] == pytest.approx(t[[0, -1]], abs=1e-12)
    assert (np.diff(knots) > 0).all()
    for start, end in itertools.pairwise(knots):
        within = np.interp(np.linspace(start, end, 200), t, found)
        assert end - start <= within.max() * (1 + 1e-9)
    assert spaced(t, np.full(t.size, 1e9), 7).size == 8
