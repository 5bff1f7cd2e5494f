import numpy as np
import pytest

from configspace.angles import wrap


@pytest.mark.parametrize(
    ("angle", "expected"),
    [
        (0.0, 0.0),
        (np.pi, np.pi),
        (-np.pi, np.pi),
        (3 * np.pi, np.pi),
        (np.pi / 2 + 4 * np.pi, np.pi / 2),
        (-3.5 * np.pi, np.pi / 2),
    ],
)
def test_wraps_into_the_half_open_turn(angle: float, expected: float) -> None:
    assert wrap(angle) == pytest.approx(expected, abs=1e-12)


def test_leaves_angles_in_range_as_they_are_to_the_last_bit() -> None:
    angles = np.random.default_rng(0).uniform(-np.pi, np.pi, 1000)
    np.testing.assert_array_equal(wrap(angles), angles)


def test_never_leaves_the_range() -> None:
    angles = np.random.default_rng(0).uniform(-1e4, 1e4, 10_000)
    wrapped = wrap(angles)
    assert (wrapped > -np.pi).all()
    assert (wrapped <= np.pi).all()
    np.testing.assert_allclose(np.exp(1j * wrapped), np.exp(1j * angles), atol=1e-11)
