"""Occupancy maps: cell by cell against the picture, and everything that is wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import shapely  # noqa: TID251
from PIL import Image

from configspace import InvalidInput
from omniplan.obstacles import CollisionChecker, Obstacles
from omniplan.obstacles.maps import runs_of

DOT = [[0.004, 0.004], [-0.004, 0.004], [-0.004, -0.004], [0.004, -0.004]]
"""A footprint smaller than a cell."""


def written(
    folder: Path, grey: npt.NDArray[Any], name: str = "map.png", **changes: Any
) -> Path:
    Image.fromarray(grey).save(folder / name)
    data: dict[str, object] = {
        "image": name,
        "resolution": 0.05,
        "origin": [0.0, 0.0, 0.0],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
        **changes,
    }
    lines = [f"{key}: {value}" for key, value in data.items() if value is not None]
    path = folder / "map.yaml"
    path.write_text("\n".join(lines))
    return path


def painted(seed: int, shape: tuple[int, int] = (23, 37)) -> npt.NDArray[np.uint8]:
    rng = np.random.default_rng(seed)
    return rng.choice([0, 100, 205, 254, 255], shape).astype(np.uint8)


@pytest.mark.parametrize("name", ["map.png", "map.pgm"])
@pytest.mark.parametrize("unknown_is_free", [False, True])
@pytest.mark.parametrize("negate", [0, 1])
def test_every_cell_is_as_painted(
    tmp_path: Path, name: str, unknown_is_free: bool, negate: int
) -> None:
    grey = painted(1)
    path = written(tmp_path, grey, name, origin=[-1.0, 2.0, 0.0], negate=negate)
    found = Obstacles.from_map(path, unknown_is_free=unknown_is_free)
    assert found.names == ("map.yaml",)
    checker = CollisionChecker(DOT, found)
    h, w = grey.shape
    for row in range(h):
        y = 2.0 + (h - row - 0.5) * 0.05
        poses = [(-1.0 + (col + 0.5) * 0.05, y, 0.0) for col in range(w)]
        p = (grey[row] if negate else 255 - grey[row].astype(float)) / 255
        expected = p > 0.65 if unknown_is_free else p >= 0.196
        assert (checker.are_free(poses) == ~expected).all()
    occupied = ((grey if negate else 255.0 - grey) / 255) >= 0.196
    if not unknown_is_free:
        assert found.area == pytest.approx(occupied.sum() * 0.05**2)


def test_an_origin_with_yaw_turns_the_map_about_its_corner(tmp_path: Path) -> None:
    grey = np.full((10, 20), 255, dtype=np.uint8)
    grey[0, 19] = 0  # top right
    path = written(
        tmp_path, grey, resolution=1.0, origin=[3.0, 4.0, 1.5707963267948966]
    )
    found = Obstacles.from_map(path)
    # (19 to 20, 9 to 10) from the corner, turned by a quarter: (-10 to -9, 19 to 20).
    assert found.bounds == pytest.approx((-7, 23, -6, 24))


@pytest.mark.parametrize("seed", range(4))
def test_runs_tile_the_occupied_cells(seed: int) -> None:
    rng = np.random.default_rng(seed)
    occupied = rng.random((17, 19)) < [0.1, 0.5, 0.9, 0.99][seed]
    count = np.zeros(occupied.shape, dtype=int)
    for left, right, top, bottom in zip(*runs_of(occupied), strict=True):
        assert left < right
        assert top < bottom
        count[top:bottom, left:right] += 1
    assert (count == occupied).all()


def test_runs_of_nothing_and_of_all() -> None:
    assert runs_of(np.zeros((5, 4), dtype=bool))[0].size == 0
    assert [x.tolist() for x in runs_of(np.ones((5, 4), dtype=bool))] == [
        [0],
        [4],
        [0],
        [5],
    ]


def test_an_empty_map_is_a_value(tmp_path: Path) -> None:
    found = Obstacles.from_map(written(tmp_path, np.full((9, 9), 255, dtype=np.uint8)))
    assert len(found) == 0
    assert CollisionChecker(DOT, found).is_free((0.2, 0.2, 0))


def test_colours_and_depths_are_read_alike(tmp_path: Path) -> None:
    grey = painted(2)
    expected = Obstacles.from_map(written(tmp_path, grey))
    deep = (grey.astype(np.uint16) * 257).astype(np.uint16)
    opaque = np.dstack([grey, grey, grey, np.full_like(grey, 255)])
    for other in (np.dstack([grey] * 3), opaque, deep):
        found = Obstacles.from_map(written(tmp_path, other, "other.png"))
        assert len(found.pieces) == len(expected.pieces)
        assert found.area == expected.area
    black = np.where(grey > 127, 255, 0).astype(np.uint8)
    Image.fromarray(black).convert("1").save(tmp_path / "one.png")
    one = Obstacles.from_map(written(tmp_path, black, "two.png", image="one.png"))
    assert one.area == Obstacles.from_map(written(tmp_path, black)).area


def test_thresholds_are_strict(tmp_path: Path) -> None:
    grey = np.array([[204, 205, 203]], dtype=np.uint8)  # p = 0.2 for 204
    path = written(tmp_path, grey, resolution=1.0, free_thresh=0.2, occupied_thresh=0.2)
    assert Obstacles.from_map(path).area == 2
    assert Obstacles.from_map(path, unknown_is_free=True).area == 1


@pytest.mark.slow
def test_a_large_map_stays_exact(tmp_path: Path) -> None:
    grey = np.full((4000, 4000), 254, dtype=np.uint8)
    rng = np.random.default_rng(0)
    for x, y, w, h in rng.integers([0, 0, 1, 1], [3900, 3900, 90, 90], (3000, 4)):
        grey[y : y + h, x : x + w] = 0
    found = Obstacles.from_map(written(tmp_path, grey))
    assert shapely.area(found.pieces).sum() == pytest.approx(
        (grey == 0).sum() * 0.05**2
    )


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"image": None}, "image: missing"),
        ({"resolution": 0}, "resolution: 0; metres per cell"),
        ({"resolution": "fine"}, "resolution: 'fine'"),
        ({"resolution": ".nan"}, "resolution: nan"),
        ({"origin": [0, 0]}, r"origin: \[0, 0\]; .x, y, yaw."),
        ({"origin": "[0, 0, .inf]"}, "origin: "),
        ({"negate": 2}, "negate: 2; 0 or 1"),
        ({"occupied_thresh": 65}, "occupied_thresh: 65; from 0 to 1"),
        ({"free_thresh": 0.7}, "free_thresh: 0.7, occupied_thresh 0.65; at most"),
        ({"mode": "scale"}, "mode: 'scale'; trinary"),
        ({"resolutoin": 1}, "resolutoin: unknown key; allowed are free_thresh"),
        ({"image": "none.png"}, "No such file"),
        ({"image": "map.yaml"}, "cannot identify"),
    ],
)
def test_wrong_headers_are_told(
    tmp_path: Path, changes: dict[str, Any], words: str
) -> None:
    path = written(tmp_path, painted(0), **changes)
    with pytest.raises(InvalidInput, match=words) as caught:
        Obstacles.from_map(path)
    assert str(tmp_path) in str(caught.value)


def test_all_mistakes_are_told_at_once(tmp_path: Path) -> None:
    path = written(tmp_path, painted(0), resolution=-1, negate=7, image=None)
    with pytest.raises(InvalidInput) as caught:
        Obstacles.from_map(path)
    assert {problem.where for problem in caught.value.problems} == {
        "resolution",
        "negate",
        "image",
    }


@pytest.mark.parametrize(
    ("text", "words"),
    [("a: [", "line 1"), ("just text", "a mapping"), ("", "a mapping"), ("- 1", "map")],
)
def test_files_that_are_no_header(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "map.yaml"
    path.write_text(text)
    with pytest.raises(InvalidInput, match=words):
        Obstacles.from_map(path)
    with pytest.raises(InvalidInput, match="No such file"):
        Obstacles.from_map(tmp_path / "nowhere.yaml")


def test_pictures_that_cannot_be_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    grey = painted(0)
    ghost = np.dstack([grey, grey, grey, np.full_like(grey, 128)])
    with pytest.raises(
        InvalidInput, match="transparent cells; a picture without alpha"
    ):
        Obstacles.from_map(written(tmp_path, ghost))
    path = written(tmp_path, grey)
    whole = (tmp_path / "map.png").read_bytes()
    (tmp_path / "map.png").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InvalidInput, match="map image"):
        Obstacles.from_map(path)
    path = written(tmp_path, grey)
    monkeypatch.setattr("omniplan.obstacles.maps.MAX_CELLS", 800)
    with pytest.raises(InvalidInput, match="37 × 23 cells; at most 800 cells"):
        Obstacles.from_map(path)
    monkeypatch.setattr("omniplan.obstacles.maps.MAX_CELLS", 10**6)
    monkeypatch.setattr("omniplan.obstacles.maps.MAX_RECTANGLES", 10)
    with pytest.raises(InvalidInput, match="rectangles of occupied cells; at most 10"):
        Obstacles.from_map(path)


@pytest.mark.parametrize("negate", [0, 1])
@pytest.mark.parametrize("kind", ["L", "RGB", "I;16"])
def test_maps_are_read_as_map_servers_do(
    tmp_path: Path, negate: int, kind: str
) -> None:
    """Pixel by pixel, as ROS' `map_server` and `nav2_map_server` fill their message.

    The row at the bottom comes first; the mean of the colours is the shade.
    """
    rng = np.random.default_rng(negate)
    high = 65536 if kind == "I;16" else 256
    shape = (9, 14, 3) if kind == "RGB" else (9, 14)
    picture = rng.integers(0, high, shape).astype(np.uint16 if high > 256 else np.uint8)
    path = written(tmp_path, picture, negate=negate, resolution=0.5)
    height, width = picture.shape[:2]
    message = np.empty(height * width, dtype=int)
    for row in range(height):
        for column in range(width):
            shade = float(np.mean(picture[row, column])) / (high - 1)
            occupied = shade if negate else 1.0 - shade
            value = 100 if occupied > 0.65 else 0 if occupied < 0.196 else -1
            message[(height - 1 - row) * width + column] = value
    assert {-1, 0, 100} == set(message.tolist())
    careful, bold = (
        CollisionChecker(DOT, Obstacles.from_map(path, unknown_is_free=is_bold))
        for is_bold in (False, True)
    )
    for index, value in enumerate(message.tolist()):
        pose = (0.5 * (index % width + 0.5), 0.5 * (index // width + 0.5), 0.0)
        assert careful.is_free(pose) == (value == 0)
        assert bold.is_free(pose) == (value != 100)


@pytest.mark.parametrize(
    ("mode", "name"), [("I", "map.tif"), ("F", "map.tif"), ("CMYK", "map.tif")]
)
def test_pixels_without_a_white_are_refused(
    tmp_path: Path, mode: str, name: str
) -> None:
    """Of 32 bits the upper ones would be lost: 65536 is not black."""
    path = written(tmp_path, painted(0))
    Image.new(mode, (5, 4)).save(tmp_path / "map.tif")
    path.write_text(path.read_text().replace("map.png", name))
    words = f"image: pixels of kind {mode}; 8 or 16 bits of grey, or colours"
    with pytest.raises(InvalidInput, match=words):
        Obstacles.from_map(path)


def test_an_opaque_alpha_frees_no_cell(tmp_path: Path) -> None:
    """Map servers take it for one more white channel."""
    grey = painted(3)
    opaque = np.dstack([grey, np.full_like(grey, 255)])
    found = Obstacles.from_map(written(tmp_path, opaque))
    assert found.area == Obstacles.from_map(written(tmp_path, grey)).area
    with pytest.raises(InvalidInput, match="alpha, with negate"):
        Obstacles.from_map(written(tmp_path, opaque, negate=1))


@pytest.mark.parametrize(
    "changes", [{"origin": [999_999, 0, 0], "resolution": 1.0}, {"resolution": 1000.0}]
)
def test_maps_beyond_all_poses_are_refused(
    tmp_path: Path, changes: dict[str, Any]
) -> None:
    grey = painted(0, (1000, 300))
    words = r"resolution: 300 × 1000 cells of .*; a map within 1e\+06 m of the axes"
    with pytest.raises(InvalidInput, match=words):
        Obstacles.from_map(written(tmp_path, grey, **changes))
