"""Lines between a vehicle and obstacles."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from configspace import load_vehicle
from omniplan.obstacles import Obstacles
from omniplan.optimising.separation import Surroundings, line_between
from omniplan.optimising.setting import Guess
from omniplan.optimising.warm_start import leg_through


def polygon(rng: np.random.Generator, at: complex) -> npt.NDArray[np.complex128]:
    points = rng.normal(size=(8, 2))
    hull = points[ConvexHull(points).vertices]
    return np.asarray(at + 0.3 * (hull[:, 0] + 1j * hull[:, 1]))


def border(corners: npt.NDArray[np.complex128]) -> npt.NDArray[np.complex128]:
    s = np.linspace(0, 1, 200)[:, None]
    return np.asarray((corners + s * (np.roll(corners, -1) - corners)).ravel())


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.integers(0, 10**6))
def test_the_line_is_half_way_in_the_gap(seed: int) -> None:
    rng = np.random.default_rng(seed)
    body = polygon(rng, 0j)
    part = polygon(rng, rng.uniform(2, 4) * np.exp(1j * rng.uniform(0, 6.3)))
    gap, direction, offset = line_between(body, part)
    least = np.abs(border(body)[:, None] - border(part)[None]).min()
    assert gap == pytest.approx(least, abs=5e-3)
    assert gap <= least + 1e-12
    normal = np.exp(-1j * direction)
    assert (normal * body).real.min() - offset == pytest.approx(gap / 2)
    assert offset - (normal * part).real.max() == pytest.approx(gap / 2)


def test_overlapping_polygons_have_a_negative_gap() -> None:
    square = np.array([0j, 1, 1 + 1j, 1j])
    gap, direction, _ = line_between(square, square + (0.8 + 0j))
    assert gap == pytest.approx(-0.2)
    assert np.cos(direction) == pytest.approx(-1)


def test_what_is_near_is_kept_apart_and_start_and_goal_have_the_room_there_is() -> None:
    vehicle = load_vehicle("mecanum")
    around = Surroundings.of(
        vehicle,
        Obstacles.from_polygons(
            {
                "ell": [(0, 0.4), (3, 0.4), (3, 1), (1, 1), (1, 2), (0, 2)],
                "far": [(0, 9), (1, 9), (1, 10)],
            }
        ),
    )
    corners = np.concatenate(around.parts)
    assert corners.real.max() == 3
    assert corners.imag.max() == 10
    poses = np.linspace([0.5, 0, 0], [2.5, 0, 0], 9)
    guess = Guess((leg_through(np.full(8, 0.3), poses),), ())
    separations, lines = around.separations(guess, 0.5, 0.1)
    assert len(separations) == len(lines) >= 8
    assert {s.interval for s in separations} == set(range(8))
    far = [i for i, part in enumerate(around.parts) if part.imag.min() > 8]
    assert not {s.number for s in separations} & set(far)
    # The footprint is 0.32 m wide: 0.08 m are left, less than what is asked for.
    assert {s.room for s in separations if 0 < s.interval < 7} == {0.1}
    for end in (0, 7):
        rooms = [s.room for s in separations if s.interval == end]
        assert min(rooms) == pytest.approx(0.9 * 0.08)
    moved, _ = around.separations(guess, 0.5, 0.1, keep_ends=False)
    assert {s.room for s in moved} == {0.1}
    # What was near stays in the list.
    again, _ = around.separations(guess, 0.01, 0.1, separations)
    assert len(again) == len(separations)
