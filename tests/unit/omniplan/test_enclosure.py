"""The disc about K that is used to prove that there is no way."""

from __future__ import annotations

import math

import hypothesis.strategies as st
import numpy as np
import pytest
import shapely  # noqa: TID251
from hypothesis import given

from omniplan.obstacles import CollisionChecker, Obstacles
from omniplan.planning.enclosure import core_radius, is_enclosed

SQUARE = [[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]]


@given(st.integers(3, 9), st.floats(-0.8, 0.8), st.floats(-0.8, 0.8), st.booleans())
def test_the_radius_is_the_distance_to_the_border(
    n: int, x: float, y: float, is_clockwise: bool
) -> None:
    corners = np.exp(2j * np.pi * np.arange(n) / n) + complex(x, y)
    corners = corners[::-1] if is_clockwise else corners
    polygon = shapely.Polygon([(z.real, z.imag) for z in corners])
    origin = shapely.Point(0, 0)
    inside = polygon.contains(origin)
    expected = polygon.exterior.distance(origin) if inside else 0.0
    assert core_radius((corners,)) == pytest.approx(expected, abs=1e-9)


def ring(gap: float) -> Obstacles:
    """Return walls around the origin, with a gap to the right."""
    return Obstacles.from_polygons(
        {
            "upper": [(3, gap / 2), (3, 4), (-3, 4), (-3, 0), (-2.8, 0), (-2.8, 3.8),
                      (2.8, 3.8), (2.8, gap / 2)],
            "lower": [(3, -gap / 2), (3, -4), (-3, -4), (-3, 0), (-2.8, 0),
                      (-2.8, -3.8), (2.8, -3.8), (2.8, -gap / 2)],
        }
    )  # fmt: skip


@pytest.mark.parametrize(
    ("gap", "clearance", "expected"),
    [(0.05, 0.0, True), (0.3, 0.0, True), (1.1, 0.0, False), (1.1, 0.5, True)],
)
def test_a_ring_is_closed_where_the_disc_does_not_fit_by_far(
    gap: float, clearance: float, expected: bool
) -> None:
    checker = CollisionChecker(SQUARE, ring(gap), clearance)
    start, goal = (0.0, 0.0, 0.0), (6.0, 1.0, 0.0)
    assert is_enclosed(checker, start, goal) is expected
    assert is_enclosed(checker, goal, start) is expected
    assert not is_enclosed(checker, start, (1.0, 1.0, 0.3))


def test_nothing_is_proved_without_walls_or_without_a_core() -> None:
    start, goal = (0.0, 0.0, 0.0), (6.0, 1.0, 0.0)
    assert not is_enclosed(CollisionChecker(SQUARE), start, goal)
    beside = [[x + 2, y] for x, y in SQUARE]
    assert core_radius((np.array([complex(*corner) for corner in beside]),)) == 0
    assert not is_enclosed(CollisionChecker(beside, ring(0.05)), start, goal)


def test_what_is_proved_closed_has_no_free_line_through() -> None:
    random = np.random.default_rng(0)
    proved = 0
    for _ in range(15):
        gap = float(random.uniform(0.05, 1.4))
        checker = CollisionChecker(SQUARE, ring(gap))
        if is_enclosed(checker, (0.0, 0.0, 0.0), (6.0, 0.0, 0.0)):
            proved += 1
            poses = np.zeros((400, 3))
            poses[:, 0] = np.linspace(0, 6, 400)
            poses[:, 2] = random.uniform(-math.pi, math.pi)
            assert not checker.are_free(poses).all()
        else:
            assert gap > 0.3
    assert proved > 2
