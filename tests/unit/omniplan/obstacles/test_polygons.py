"""Polygons from outside: what is taken, what is refused, that nothing is lost."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
import shapely  # noqa: TID251
from shapely.geometry import Point, Polygon  # noqa: TID251

from configspace import InvalidInput
from omniplan.obstacles import Obstacles
from omniplan.obstacles.polygons import convex_parts

TRIANGLE = [[0, 0], [1, 0], [0, 1]]


def test_direction_and_closing_corner_do_not_matter() -> None:
    ways = [TRIANGLE, TRIANGLE[::-1], [*TRIANGLE, TRIANGLE[0]]]
    for way in ways:
        found = Obstacles.from_polygons([way])
        assert found.area == 0.5
        assert found.names == ("obstacle 0",)
        (rings,) = found.rings()
        assert len(rings) == 1
        assert Polygon(rings[0]).exterior.is_ccw


def test_values_are_frozen_and_add_up() -> None:
    one = Obstacles.from_polygons({"a": TRIANGLE})
    other = Obstacles.from_polygons({"b": np.array(TRIANGLE) + 5, "c": TRIANGLE})
    both = one | other
    assert both.names == ("a", "b", "c")
    assert len(both) == 3
    assert both.owner.tolist() == [0, 1, 2]
    assert both.bounds == (0, 0, 6, 6)
    assert both.area == 1.0
    assert (one | Obstacles()).names == ("a",)
    with pytest.raises(ValueError, match="read-only"):
        both.owner[0] = 2
    with pytest.raises(TypeError):
        one | "walls"  # type: ignore[operator]


def test_parts_of_many_corners_lose_nothing() -> None:
    rng = np.random.default_rng(0)
    angle = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    radius = rng.uniform(0.5, 2, 200)
    corners = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    holed = Polygon(corners, [0.1 * corners])
    parts = convex_parts(holed)
    assert len(parts) > 100
    assert shapely.area(parts).sum() == pytest.approx(holed.area, rel=1e-12)
    assert shapely.union_all(parts).symmetric_difference(holed).area < 1e-12
    points = np.asarray(shapely.points(rng.uniform(-2, 2, (500, 2))))
    by_parts = shapely.intersects(points[:, None], parts).any(axis=1)
    assert (by_parts == shapely.intersects(points, holed)).all()


def test_convex_parts_cover_an_angle() -> None:
    angle = Polygon([[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]])
    parts = convex_parts(angle)
    assert len(parts) > 1
    assert shapely.equals(shapely.union_all(parts), angle)
    assert all(
        shapely.equals_exact(part, shapely.convex_hull(part), normalize=True)
        for part in parts
    )
    assert len(convex_parts(Polygon(TRIANGLE))) == 1


def test_holes_stay_free() -> None:
    room = Point(0, 0).buffer(5).difference(Point(0, 0).buffer(4))
    found = Obstacles.from_polygons({"room": room})
    assert found.area == pytest.approx(room.area)
    assert len(found.rings()[0]) == 2


@pytest.mark.parametrize(
    ("polygon", "words"),
    [
        ([[0, 0], [2, 2], [2, 0], [0, 2]], r"self-intersection at \(1, 1\)"),
        ([[0, 0], [1, 1]], r"2 corner\(s\); corners \(n, 2\) in m"),
        ([], r"shape \(0,\)"),
        ([[0, 0], [1, 0], [2, 0]], "without an area"),
        ([[1, 1], [1, 1], [1, 1]], r"2 corner\(s\)"),
        ([[1, 1], [2, 2], [1, 1], [3, 3]], "without an area"),
        ([[0, 0], [math.nan, 1], [1, 1]], r"corner 1: \(nan, 1\); finite numbers"),
        ([[0, 0], [1e7, 1], [1, 1]], "at most 1e\\+06 m"),
        ([[0, 0, 0], [1, 0, 0], [1, 1, 0]], r"shape \(3, 3\)"),
        ([[0, 0], [1], [1, 1]], "corners"),
        ("a wall", "'a wall'"),
        ([["0", "0"], ["1", "0"], ["0", "1"]], r"corners \(n, 2\) in m"),
        ([[False, False], [True, False], [True, True]], r"corners \(n, 2\) in m"),
        (None, r"None; corners \(n, 2\) in m"),
        (Polygon(), "an empty polygon"),
        (Polygon([[0, 0], [4, 4], [4, 0], [0, 4]]), r"at \(2, 2\)"),
    ],
)
def test_unusable_polygons_are_named(polygon: object, words: str) -> None:
    with pytest.raises(InvalidInput, match=words) as caught:
        Obstacles.from_polygons({"fine": TRIANGLE, "pillar 7": polygon})
    assert "pillar 7" in str(caught.value)


def test_all_unusable_polygons_are_told_at_once() -> None:
    with pytest.raises(InvalidInput) as caught:
        Obstacles.from_polygons([[], TRIANGLE, [[0, 0], [1, 1]]])
    assert [problem.where for problem in caught.value.problems] == [
        "obstacle 0",
        "obstacle 2",
    ]


def test_files_hold_lists_or_names(tmp_path: Path) -> None:
    path = tmp_path / "hall.json"
    path.write_text(json.dumps([TRIANGLE]))
    assert Obstacles.from_json(path).names == ("obstacle 0",)
    square = [[-1, -1], [4, -1], [4, 4], [-1, 4]]
    path.write_text(
        json.dumps({"room": {"exterior": square, "holes": [TRIANGLE]}, "b": TRIANGLE})
    )
    found = Obstacles.from_json(path)
    assert found.names == ("room", "b")
    assert found.area == pytest.approx(25)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "readable JSON"),
        ("3", "a list of polygons, or a mapping"),
        (
            '{"a": [[0, 0], [1, 0], [0, 1]], "a": [[5, 5], [6, 5], [5, 6]]}',
            "the key 'a' stands twice",
        ),
        ('{"a": {"outside": []}}', "a: keys .'outside'.; exterior"),
        ("[[[0, 0], [2, 2], [2, 0], [0, 2]]]", "obstacle 0: self-intersection"),
        ('{"a": {"exterior": [[0,0],[1,0],[0,1]], "holes": [3]}}', r"a: holes\[0\]"),
        ('{"a": {"exterior": [[0,0],[1,0],[0,1]], "holes": 3}}', "a: holes: 3"),
        ("[[[0, 0], [1, NaN], [1, 1]]]", "finite"),
    ],
)
def test_wrong_files_are_told(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "hall.json"
    path.write_text(text)
    with pytest.raises(InvalidInput, match=words) as caught:
        Obstacles.from_json(path)
    assert "hall.json" in str(caught.value)
    with pytest.raises(InvalidInput, match="No such file"):
        Obstacles.from_json(tmp_path / "nowhere.json")


@pytest.mark.parametrize("given", ["wall", None, 3.0])
def test_what_is_no_collection_of_polygons_is_told(given: object) -> None:
    with pytest.raises(InvalidInput, match="a list of polygons, or a mapping"):
        Obstacles.from_polygons(given)  # type: ignore[arg-type]


@pytest.mark.parametrize("given", [None, 5, [TRIANGLE]])
def test_what_is_no_path_is_told(given: object) -> None:
    with pytest.raises(InvalidInput, match=r"obstacle file: \w+; the path of a file"):
        Obstacles.from_json(given)  # type: ignore[arg-type]
    with pytest.raises(InvalidInput, match=r"map: \w+; the path of a file"):
        Obstacles.from_map(given)  # type: ignore[arg-type]
