"""The time for turning wheels at rest, against closed forms and a simulation."""

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omniplan.standing.turn_time import Turning, paces_of, rest_to_rest, time_of

FloatArray = npt.NDArray[np.float64]
Function = Callable[[FloatArray], FloatArray]


def leg_of(
    slopes: list[Function], bends: list[Function], rate: float, limit: float, n: int
) -> Turning:
    """Wheels with α' and α'' given over s in [0, 1]."""
    s = np.linspace(0, 1, n + 1)
    inside = s[:-1, None] + np.linspace(0, 1, 20) * np.diff(s)[:, None]
    slope = np.stack([np.abs(f(inside)).max(axis=1) for f in slopes], axis=-1)
    bend = np.stack([np.abs(f(inside)).max(axis=1) for f in bends], axis=-1)
    at = np.stack([f(s) for f in slopes], axis=-1)
    ends = np.stack([at[:-1], at[1:]])
    share = slope.max(axis=1) / rate
    return Turning(np.diff(s), share, ends / limit, slope / limit, bend / limit)


def one_wheel(turn: float, rate: float, limit: float, n: int = 400) -> Turning:
    return leg_of([lambda s: np.full_like(s, turn)], [np.zeros_like], rate, limit, n)


@pytest.mark.parametrize(
    ("turn", "rate", "limit", "time"),
    [
        (math.pi / 2, math.pi, 4 * math.pi, 0.75),  # Δ/ω + ω/a
        (1.0, 10.0, 4.0, 1.0),  # 2 √(Δ/a): the rate is not reached
        (0.25, 1.0, 4.0, 0.5),  # both at once
    ],
)
def test_one_wheel_takes_the_time_of_a_trapezoid(
    turn: float, rate: float, limit: float, time: float
) -> None:
    found = time_of(one_wheel(turn, rate, limit))
    assert time * (1 - 1e-12) <= found <= time * 1.01
    assert rest_to_rest(np.array(turn), rate, limit) == pytest.approx(time)


def test_without_limits_on_swinging_only_rates_count() -> None:
    none = np.zeros((4, 0))
    leg = Turning(np.full(4, 0.25), np.full(4, 2.0), np.stack([none] * 2), none, none)
    assert time_of(leg) == pytest.approx(2.0)


def test_wheels_that_do_not_turn_take_hardly_any_time() -> None:
    assert time_of(one_wheel(0.0, 1.0, 1.0)) < 1e-12


def test_a_wheel_that_passes_its_singular_point_takes_for_ever() -> None:
    leg = one_wheel(1.0, 1.0, 1.0, 3)
    leg.bend[1, 0] = math.inf
    assert time_of(leg) == math.inf


def test_at_a_corner_the_wheels_stop() -> None:
    n = 400
    leg = leg_of([np.ones_like], [np.zeros_like], 1e3, 1.0, n)
    leg.ends[:, n // 2 :] *= -1  # the wheel turns back half-way
    assert time_of(leg) == pytest.approx(2 * 2 * math.sqrt(0.5), rel=1e-2)
    assert paces_of(leg)[n // 2] == 0


@given(
    a=st.floats(0.2, 3), b=st.floats(0.2, 3), rate=st.floats(0.3, 5),
    limit=st.floats(0.3, 20), n=st.integers(3, 60),
)  # fmt: skip
def test_what_is_driven_keeps_every_limit(
    a: float, b: float, rate: float, limit: float, n: int
) -> None:
    """Wheels that turn to and fro: α = sin(a + 3 b s) and α = a s² + b."""
    slopes: list[Function] = [
        lambda s: 3 * b * np.cos(a + 3 * b * s),
        lambda s: 2 * a * s,
    ]
    bends: list[Function] = [
        lambda s: -9 * b**2 * np.sin(a + 3 * b * s),
        lambda s: np.full_like(s, 2 * a),
    ]
    leg = leg_of(slopes, bends, rate, limit, n)
    x = paces_of(leg)
    assert x[0] == x[-1] == 0
    assert (x[1:-1] > 0).all()
    f = np.linspace(0, 1, 30)
    start = np.arange(n)[:, None] / n
    s = start + f / n
    pace = x[:-1, None] * (1 - f) + x[1:, None] * f  # ṡ²
    change = np.diff(x)[:, None] * n / 2  # s̈
    for slope, bend in zip(slopes, bends, strict=True):
        assert (np.abs(slope(s)) * np.sqrt(pace) <= rate * (1 + 1e-3)).all()
        swing = np.abs(slope(s) * change + bend(s) * pace)
        assert (swing <= limit * (1 + 1e-3)).all()
    # Each wheel alone needs as long, and finer parts only help.
    turn = max(math.fabs(math.sin(a + 3 * b) - math.sin(a)), a)
    assert time_of(leg) >= rest_to_rest(np.array(turn), rate, limit) * (1 - 1e-2)
    fine = leg_of(slopes, bends, rate, limit, 4 * n)
    assert time_of(fine) <= time_of(leg) * (1 + 1e-9)


@given(turn=st.floats(1e-3, 10), rate=st.floats(0.1, 10), limit=st.floats(0.1, 50))
def test_rest_to_rest_against_a_simulation(
    turn: float, rate: float, limit: float
) -> None:
    """Speed up while half is not yet reached and the rate allows, then mirror."""
    steps = 20_000
    time = float(rest_to_rest(np.array(turn), rate, limit))
    t = (np.arange(steps) + 0.5) * time / steps
    speed = np.minimum(np.minimum(limit * t, limit * (time - t)), rate)
    assert speed.sum() * time / steps == pytest.approx(turn, rel=1e-3)
    assert rest_to_rest(np.array(turn), rate, math.inf) == pytest.approx(turn / rate)
    assert rest_to_rest(np.array(turn), math.inf, limit) <= time * (1 + 1e-12)
