"""Collision checks in a hall of 200 m × 200 m with 500 obstacles.

``python benchmarks/bench_obstacles.py`` prints processor time per question, for
places anywhere and for those close to an obstacle, where most of the work is.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image
from pytest_benchmark.fixture import BenchmarkFixture

from configspace import load_vehicle
from omniplan.obstacles import CollisionChecker, Obstacles
from omniplan.planning.moves import Move

FloatArray = npt.NDArray[np.float64]
Pose = tuple[float, float, float]

SIZE, N_OBSTACLES, N_POSES = 200.0, 500, 4000


def hall() -> list[FloatArray]:
    """Return polygons of 3 to 30 corners, 0.3 m to 3 m in radius."""
    rng = np.random.default_rng(0)
    polygons = []
    for _ in range(N_OBSTACLES):
        n = int(rng.integers(3, 30))
        angle = np.linspace(0, 2 * np.pi, n, endpoint=False)
        radius = rng.uniform(0.3, 3.0) * rng.uniform(0.7, 1.0, n)
        shape = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        polygons.append(rng.uniform(0, SIZE, 2) + radius[:, None] * shape)
    return polygons


def poses(polygons: Sequence[FloatArray], *, near: bool) -> list[Pose]:
    rng = np.random.default_rng(1)
    if near:
        chosen = rng.integers(0, N_OBSTACLES, N_POSES)
        places = np.array([polygons[i][0] for i in chosen])
        places += rng.normal(0, 0.6, (N_POSES, 2))
    else:
        places = rng.uniform(0, SIZE, (N_POSES, 2))
    turns = rng.uniform(-np.pi, np.pi, N_POSES)
    return [(x, y, t) for (x, y), t in zip(places.tolist(), turns, strict=True)]


def moves(starts: Sequence[Pose], length: float) -> list[Move]:
    rng = np.random.default_rng(2)
    found = []
    for x, y, theta in starts:
        angle, turn = rng.uniform(-np.pi, np.pi), rng.uniform(-0.5, 0.5)
        goal = x + length * np.cos(angle), y + length * np.sin(angle), theta + turn
        found.append(Move.arc((x, y, theta), goal, turn=turn))
    return found


def make_checker(polygons: Sequence[FloatArray]) -> CollisionChecker:
    obstacles = Obstacles.from_polygons(polygons)
    return CollisionChecker(load_vehicle("mecanum"), obstacles, 0.05)


@pytest.mark.parametrize("near", [False, True], ids=["anywhere", "near"])
def test_pose(benchmark: BenchmarkFixture, near: bool) -> None:
    polygons = hall()
    checker = make_checker(polygons)
    at = poses(polygons, near=near)
    free = [checker.is_free(pose) for pose in at]
    assert 0 < sum(free) < len(free)
    assert benchmark(lambda: [checker.is_free(pose) for pose in at]) == free


@pytest.mark.parametrize("near", [False, True], ids=["anywhere", "near"])
def test_move(benchmark: BenchmarkFixture, near: bool) -> None:
    polygons = hall()
    checker = make_checker(polygons)
    along = moves(poses(polygons, near=near), 1.0)
    free = [checker.is_motion_free(move) for move in along]
    assert 0 < sum(free) < len(free)
    assert benchmark(lambda: [checker.is_motion_free(m) for m in along]) == free


def large_map(folder: Path) -> Path:
    """Write a map of 4000 × 4000 cells with 3000 boxes."""
    grey = np.full((4000, 4000), 254, dtype=np.uint8)
    rng = np.random.default_rng(0)
    for x, y, w, h in rng.integers([0, 0, 1, 1], [3900, 3900, 90, 90], (3000, 4)):
        grey[y : y + h, x : x + w] = 0
    Image.fromarray(grey).save(folder / "map.png")
    path = folder / "map.yaml"
    path.write_text(
        "{image: map.png, resolution: 0.05, origin: [0, 0, 0], negate: 0, "
        "occupied_thresh: 0.65, free_thresh: 0.196}"
    )
    return path


def test_map(benchmark: BenchmarkFixture, tmp_path: Path) -> None:
    path = large_map(tmp_path)
    found = benchmark(lambda: Obstacles.from_map(path))
    assert len(found.pieces) > 3000


def _each(ask: Callable[[Any], object], questions: Sequence[Any]) -> float:
    start = time.process_time()
    for question in questions:
        ask(question)
    return (time.process_time() - start) / len(questions) * 1e6


def _say(text: str) -> None:
    sys.stdout.write(f"{text}\n")


def _report() -> None:
    polygons = hall()
    start = time.process_time()
    checker = make_checker(polygons)
    _say(f"building the checker: {(time.process_time() - start) * 1e3:.0f} ms")
    nothing = _each(lambda _: True, range(N_POSES))
    _say(f"{'a callback that returns True':34s} {nothing:8.2f} µs")
    for name, near in (("anywhere", False), ("near an obstacle", True)):
        at = poses(polygons, near=near)
        first, again = (_each(checker.is_free, at) for _ in range(2))
        share = np.mean([checker.is_free(pose) for pose in at])
        _say(f"pose {name}, {share:.0%} free: {first:8.1f} µs, again {again:.1f} µs")
        # The least of some, as one of them meets the garbage collector.
        batch = min(_each(checker.are_free, [at]) for _ in range(3)) / N_POSES
        _say(f"{'  in one batch':34s} {batch:8.1f} µs")
        for length in (0.3, 1.0, 3.0, 10.0):
            along = moves(at, length)
            free = np.array([checker.is_motion_free(move) for move in along])
            per = [
                _each(checker.is_motion_free, [along[i] for i in np.flatnonzero(each)])
                for each in (free, ~free)
            ]
            _say(
                f"  move of {length:4.1f} m, {free.mean():4.0%} free: "
                f"{per[0]:8.1f} µs if free, {per[1]:.1f} µs if not"
            )
    with TemporaryDirectory() as folder:
        path = large_map(Path(folder))
        start = time.process_time()
        found = Obstacles.from_map(path)
        read = time.process_time() - start
        start = time.process_time()
        CollisionChecker(load_vehicle("mecanum"), found)
        index = time.process_time() - start
    _say(
        f"map of 4000 × 4000 cells: {read:.2f} s, {len(found.pieces)} rectangles; "
        f"checker {index:.2f} s"
    )


if __name__ == "__main__":
    _report()
