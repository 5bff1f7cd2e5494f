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


def means(profile: PieceProfile, t: FloatArray) -> tuple[BSpline, float]:
    """The quadratic B-spline of the speeds amid the steps, odd about both ends.

    And by how much it has to be stretched to go as far as the profile does.
    """
    h = np.diff(t)
    speed = np.interp((t[1:] + t[:-1]) / 2, profile.times, np.sqrt(profile.x))
    before, after = t[0] - h[:2].cumsum()[::-1], t[-1] + h[[-1, -2]].cumsum()
    spline = BSpline(
        np.concatenate([before, t, after]),
        np.concatenate([-speed[:1], speed, -speed[-1:]]),
        2,
    )
    way = profile.u[-1] - profile.u[0]
    return spline, way / float(spline.integrate(t[0], t[-1]))


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 10**6))
def test_constant_limits_are_kept_whatever_the_steps(seed: int) -> None:
    rng, profile = np.random.default_rng(seed), trapezoid()
    knots = random_knots(rng, profile.duration)
    wave = wave_of(profile, knots)
    # Means of a concave speed are less. At every t their nodes lie up to 1.5 steps
    # away with a variance of a quarter of a step's square at most; with the mean t a
    # corner then lifts its mean by (√(variance + d²) - d) / 2, d away, at most.
    _, stretch = means(profile, knots)
    lost = 0.2883 * (PULL + BRAKE) * float(np.diff(knots).max()) ** 2
    assert stretch >= 1 - 1e-9
    assert stretch * (4.0 - lost) <= 4.0
    u, speed, change = wave.at(rng.uniform(0.0, profile.duration, 500))
    assert (change <= PULL * stretch * (1 + 1e-9)).all()
    assert (change >= -BRAKE * stretch * (1 + 1e-9)).all()
    assert (speed >= 0).all()
    assert (speed <= TOP * stretch * (1 + 1e-9)).all()
    assert (u >= 0).all()
    assert (u <= 4.0 + 1e-12).all()
    assert wave.speed[[0, -1]].tolist() == [0.0, 0.0]
    assert wave.u[[0, -1]].tolist() == [0.0, 4.0]


@pytest.mark.parametrize("n", [8, 13, 40])
def test_by_even_steps_every_corner_loses_what_can_be_computed(n: int) -> None:
    """Their integral is that of the midpoint rule less thirds of steps at the ends."""
    profile = trapezoid(8000)  # with a node at both corners
    last, h = profile.duration, profile.duration / n
    wave = wave_of(profile, np.linspace(0.0, last, n + 1))
    lost = 0.0
    for corner, bend in ((TOP / PULL, PULL), (last - TOP / BRAKE, BRAKE)):
        off_middle = abs(corner / h - np.floor(corner / h) - 0.5) * h
        lost += bend * (h**2 / 6 - (h / 2 - off_middle) ** 2 / 2)
    stretch = 4.0 / (4.0 - lost)
    assert wave.change[0] == pytest.approx(PULL * stretch, rel=1e-6)
    assert wave.change[-1] == pytest.approx(-BRAKE * stretch, rel=1e-6)
    assert wave.speed.max() == pytest.approx(TOP * stretch, rel=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_it_is_the_quadratic_b_spline_of_the_speed(seed: int) -> None:
    rng, profile = np.random.default_rng(seed), trapezoid()
    t = random_knots(rng, profile.duration)
    wave = wave_of(profile, t)
    naive, stretch = means(profile, t)
    at = rng.uniform(0, profile.duration, 200)
    np.testing.assert_allclose(wave.at(at)[1], naive(at) * stretch, atol=1e-9)


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


def test_knots_are_laid_through_steps_of_very_different_sizes() -> None:
    t = np.array([0.0, 1.0, 1001.0, 1002.0])
    step = np.array([1e-3, 0.25, 0.25, 1e-3])
    knots = spaced(t, step)
    assert (np.diff(knots) > 0).all()
    assert np.diff(knots).max() == pytest.approx(0.25, rel=1e-3)


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
