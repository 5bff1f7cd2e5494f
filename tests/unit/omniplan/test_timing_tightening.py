"""Where samples break limits a path is passed more slowly, and only there."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

import configspace
from configspace import Grid, PermissibleSpace, build_space
from omniplan import Trajectory, validate
from omniplan.proving import prove
from omniplan.timing.tightening import (
    LEAST,
    MORE,
    MOST,
    SPARE,
    any_is_tight,
    slowdowns_of,
    tightened,
)

FloatArray = npt.NDArray[np.float64]

TIMES = np.linspace(0.0, 10.0, 11)
SPANS = np.arange(0.0, 10.0), np.arange(1.0, 11.0)


@pytest.fixture(scope="module")
def mecanum() -> PermissibleSpace:
    vehicle = configspace.load_vehicle("mecanum")
    return build_space(vehicle, Grid(20, 36), cache=False)


def weights(
    asked: FloatArray, before: float = 1.0, pad: float = 0.4, *, loosens: bool = True
) -> FloatArray:
    pads = np.full(11, pad)
    return tightened(np.full(11, before), TIMES, SPANS, asked, pads, loosens=loosens)


def test_only_what_is_near_is_tightened() -> None:
    asked = np.full(10, 0.9)
    asked[4] = 1.1  # from 4 s to 5 s
    found = weights(asked)
    more = 1 + (1.1 * (1 + SPARE) - 1) * MORE
    np.testing.assert_allclose(found[[4, 5]], more)
    np.testing.assert_array_equal(np.delete(found, [4, 5]), 1.0)
    np.testing.assert_array_equal(
        np.flatnonzero(weights(asked, pad=1.4) > 1), [3, 4, 5, 6]
    )


def test_at_once_it_is_not_much() -> None:
    assert weights(np.full(10, 9.0)).tolist() == [MOST] * 11
    assert weights(np.full(10, 0.01), before=2.0) == pytest.approx(2 * LEAST)


def test_what_is_just_kept_stays_and_what_has_room_is_loosened() -> None:
    assert weights(np.ones(10), before=1.2) == pytest.approx(1.2)
    assert weights(np.full(10, 0.9), before=1.2) == pytest.approx(
        1.2 * np.sqrt(0.9 * (1 + SPARE))
    )
    assert weights(np.full(10, 0.9), before=1.01).tolist() == [1.0] * 11
    assert weights(np.full(10, 0.9), before=1.2, loosens=False).tolist() == [1.2] * 11


def test_tight_is_more_than_one() -> None:
    assert not any_is_tight([np.ones(3), np.ones(2)])
    assert any_is_tight([np.ones(3), np.array([1.0, 1.001])])


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
def test_a_slowdown_is_the_factor_that_is_missing(
    mecanum: PermissibleSpace, factor: float
) -> None:
    """Driven at a factor of a speed that is just permitted it is that factor."""
    x = np.linspace(0.0, 1.0, 21)
    line = Trajectory.from_poses(4 * x, np.stack([x, 0 * x, 0 * x], axis=-1))
    quick = line.scaled(validate(line, mecanum).speed_factor * factor)
    proved = prove(quick, mecanum)
    sign = np.ones(proved.parts.stands.size, dtype=np.int64)
    asked = slowdowns_of(proved, sign)
    assert asked.max() == pytest.approx(factor, rel=2e-3)
