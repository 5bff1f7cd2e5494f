"""Runs of open floor against a plain list of intervals."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omniplan.obstacles.open_floor import OpenFloor

CELL, SIZE = 0.25, 100.0
whole = st.integers(-20, 20)


@given(discs=st.lists(st.tuples(whole, whole, st.integers(0, 12)), max_size=12))
def test_runs_are_the_union_of_what_was_opened(
    discs: list[tuple[int, int, int]],
) -> None:
    floor = OpenFloor(CELL, SIZE)
    for i, j, radius in discs:
        floor.open_around(i * CELL, j * CELL, radius * 0.1)
    for i in range(-21, 22):
        for half in (-0.49, 0.0, 0.49):
            x = (i + half) * CELL
            for y in (k * 0.1 + 0.013 for k in range(-70, 71)):
                opened = any(
                    column == i and abs(y - j * CELL) < CELL / 2 + radius * 0.1
                    for column, j, radius in discs
                )
                assert ((x, y) in floor) == opened


def test_the_longest_run_of_a_column_grows() -> None:
    floor = OpenFloor(CELL, SIZE)
    key = 1.0 + floor.shift
    floor.open_around(1.0, 5.0, 1.0)
    assert floor.longest[key] == pytest.approx((3.875, 6.125), abs=1e-8)
    floor.open_around(1.0, 0.0, 0.5)
    assert floor.longest[key] == pytest.approx((3.875, 6.125), abs=1e-8)
    floor.open_around(1.0, 2.0, 2.0)
    assert floor.longest[key] == pytest.approx((-0.625, 6.125), abs=1e-8)
    assert len(floor.ends[key]) == 2
    floor.clear()
    assert (1.0, 5.0) not in floor


def test_a_floor_without_anything_ends_at_the_size() -> None:
    floor = OpenFloor(CELL, SIZE)
    floor.open_around(100.0, 0.0, math.inf)
    assert not floor.longest
    floor.open_around(99.75, 0.0, math.inf)
    assert floor.longest == {99.75 + floor.shift: (-SIZE, SIZE)}


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e300])
def test_what_is_not_finite_is_not_open(bad: float) -> None:
    floor = OpenFloor(CELL, SIZE)
    floor.open_around(0.0, 0.0, math.inf)
    assert (0.0, 0.0) in floor
    assert (bad, 0.0) not in floor
    assert (0.0, bad) not in floor


@pytest.mark.parametrize("cells", [0, 1, 7, 399])
def test_the_sum_finds_the_column_up_to_its_last_bit(cells: int) -> None:
    floor = OpenFloor(CELL, SIZE)
    edge = (cells + 0.5) * CELL
    for x, column in (
        (math.nextafter(edge, 0.0), cells),
        (math.nextafter(edge, 1e9), cells + 1),
    ):
        assert x + floor.shift == pytest.approx(column * CELL + floor.shift, abs=0)
        assert -x + floor.shift == pytest.approx(-column * CELL + floor.shift, abs=0)
