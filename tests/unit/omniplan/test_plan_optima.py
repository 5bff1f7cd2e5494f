"""How far plans are from times that are known from elsewhere.

The times come from `planning_optima` of the benchmarks: by hand from the limits of
wheels, Reeds and Shepp's lengths by OMPL, and a visibility graph by shapely. Searches
are bounded by their number of motions, so that the plans are the same every time.
"""

from __future__ import annotations

import itertools
import math
import statistics

import pytest
import shapely  # noqa: TID251
from planning_optima import (
    BODY,
    among_boxes,
    reeds_shepp,
    rest_to_rest,
    shortest,
    straight_lines,
)

PATIENT = 100.0


@pytest.mark.parametrize(
    ("way", "limits", "expected"),
    [
        (3.0, (1.0, 1.0, 1.0), 4.0),
        (0.25, (1.0, 1.0, 1.0), 1.0),
        (3.0, (1.5, 1.0, 1.5), (3 - 1.875) / 1.5 + 2.5),
        (0.75, (9.0, 1.0, 2.0), 1.5),  # 1 s faster, half a second slower
    ],
)
def test_the_time_from_rest_to_rest(
    way: float, limits: tuple[float, float, float], expected: float
) -> None:
    assert rest_to_rest(way, *limits) == pytest.approx(expected)


def test_the_shortest_way_of_a_disc_past_a_box() -> None:
    """Two tangents and two quarters of arcs, or what of them there is."""
    box, y = shapely.box(4, 0, 6, 5), 5.0 + BODY
    found = shortest([box], (1.0, y), (9.0, y))
    assert found == pytest.approx(8.0, abs=1e-2)
    lower = shortest([box], (1.0, 5.0), (9.0, 5.0))
    assert lower is not None
    # Tangent to the corner's circle, an arc up to its top, along it, and likewise down.
    far = math.hypot(3.0, 0.0)
    tangent = math.sqrt(far**2 - BODY**2)
    arc = BODY * (math.pi / 2 - math.acos(BODY / far))
    assert lower == pytest.approx(2 * (tangent + arc) + 2.0, abs=1e-2)
    assert shortest([shapely.box(4, 0, 6, 8)], (1.0, y), (9.0, y)) is None


@pytest.mark.parametrize("name", ["mecanum", "ift-four-steered"])
def test_straight_lines_take_no_longer_than_by_hand(name: str) -> None:
    for case in itertools.islice(straight_lines(name), 0, None, 2):
        assert 1 - 1e-6 < case.ratio(PATIENT, 50) < 1.003


def test_no_plan_beats_reeds_and_shepp_and_few_are_far_off() -> None:
    ratios = [case.ratio(PATIENT, 40) for case in reeds_shepp(10)]
    assert min(ratios) > 1
    assert statistics.median(ratios) < 1.45
    assert max(ratios) < 3.0


def test_no_plan_beats_the_visibility_graph_and_few_are_far_off() -> None:
    ratios = [case.ratio(PATIENT, 800) for case in among_boxes(5)]
    assert min(ratios) > 1
    assert statistics.median(ratios) < 1.5
    assert max(ratios) < 2.5
