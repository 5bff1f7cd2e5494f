"""Splines are held against SciPy's."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from omniplan.splines import spline


@given(
    n=st.integers(2, 30),
    seed=st.integers(0, 2**32 - 1),
    rests=st.tuples(st.booleans(), st.booleans()),
    shape=st.sampled_from([(), (3,), (2, 2)]),
)
def test_they_are_those_of_scipy(
    n: int, seed: int, rests: tuple[bool, bool], shape: tuple[int, ...]
) -> None:
    rng = np.random.default_rng(seed)
    t = np.cumsum(10.0 ** rng.uniform(-3, 1, n))
    values = rng.normal(size=(n, *shape))
    free: Any = "not-a-knot" if n > 3 else (2, np.zeros(shape))
    ends: Any = tuple((1, np.zeros(shape)) if rest else free for rest in rests)
    expected = CubicSpline(t, values, bc_type=ends).c
    found = spline(t, values, *rests)
    assert found.shape == expected.shape
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize(("rest0", "rest1"), [(False, False), (True, False)])
def test_a_cubic_polynomial_is_itself(rest0: bool, rest1: bool) -> None:
    t = np.array([0.0, 0.3, 1.0, 1.1, 2.0])
    h = t - t[0]
    found = spline(t, 2 * h**3 - h**2 + (0.0 if rest0 else 0.5) * h, rest0, rest1)
    np.testing.assert_allclose(found[0], 2.0, rtol=1e-12)
    np.testing.assert_allclose(found[1], 6 * t[:-1] - 1, rtol=1e-11)


def test_samples_stay_as_they_are() -> None:
    t, values = np.arange(6.0), np.arange(18.0).reshape(6, 3) ** 2
    kept = values.copy()
    values.flags.writeable = t.flags.writeable = False
    spline(t, values, True, False)
    np.testing.assert_array_equal(values, kept)
