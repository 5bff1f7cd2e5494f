"""Collision checks against brute force: every obstacle, every pose of a dense row."""

from __future__ import annotations

import math

import naive_collision
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omniplan import Trajectory
from omniplan.motion import PoseMotion, motion_of
from omniplan.obstacles import CollisionChecker, Obstacles
from omniplan.planning.moves import Move

FloatArray = npt.NDArray[np.float64]

seeds = st.integers(0, 2**32 - 1)
L_SHAPE = np.array(
    [[1, 0.3], [-0.6, 0.3], [-0.6, -1.2], [0, -1.2], [0, -0.3], [1, -0.3]]
)
BOX = np.array([[0.7, 0.3], [-0.5, 0.3], [-0.5, -0.3], [0.7, -0.3]])


def star(rng: np.random.Generator, at: FloatArray, size: float) -> FloatArray:
    """Return a polygon around a place, mostly not convex."""
    n = int(rng.integers(3, 26))
    angle = np.sort(rng.uniform(0, 2 * np.pi, n)) + rng.uniform(0, 0.3)
    # No gap of half a turn, so that the place is inside and nothing crosses.
    angle = np.concatenate([angle, [0.1, 2.2, 4.3]])
    angle = np.unique(angle % (2 * np.pi))
    radius = size * rng.uniform(0.3, 1.0, angle.size)
    shape = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return np.asarray(at + radius[:, None] * shape)


def hall(rng: np.random.Generator, n: int = 12, size: float = 6.0) -> list[FloatArray]:
    return [
        star(rng, rng.uniform(0, size, 2), float(rng.uniform(0.1, 0.8)))
        for _ in range(n)
    ]


def naive_distance(
    footprint: FloatArray, polygons: list[FloatArray], pose: FloatArray
) -> float:
    corners = naive_collision.placed(footprint, pose)
    return min(naive_collision.distance(corners, each) for each in polygons)


def any_pose(rng: np.random.Generator, size: float = 6.0) -> FloatArray:
    return np.array([*rng.uniform(0, size, 2), rng.uniform(-4, 4)])


@given(seed=seeds, clearance=st.sampled_from([0.0, 0.4]), size=st.sampled_from([6, 40]))
@settings(max_examples=8, deadline=None)
def test_what_is_clear_at_a_glance_is_free_whatever_the_heading(
    seed: int, clearance: float, size: int
) -> None:
    rng = np.random.default_rng(seed)
    polygons = hall(rng, size=size)
    obstacles = Obstacles.from_polygons(polygons)
    checker = CollisionChecker(BOX, obstacles, clearance, (-2, -2, size + 2, size + 2))
    radius = float(np.linalg.norm(BOX, axis=1).max())
    clear = 0
    for _ in range(40):
        (x0, y0), (x1, y1) = rng.uniform(-3, size + 3, (2, 2))
        if not checker.is_line_clear(x0, y0, x1, y1):
            continue
        clear += 1
        share = np.linspace(0, 1, 12)[:, None]
        for x, y in np.array([x0, y0]) * (1 - share) + np.array([x1, y1]) * share:
            outside = min(x + 2, y + 2, size + 2 - x, size + 2 - y)
            assert outside > clearance + radius
            point = np.array([[x, y], [x + 1e-9, y], [x, y + 1e-9]])
            true = min(naive_collision.distance(point, each) for each in polygons)
            assert true > clearance + radius - 1e-8
        headings = rng.uniform(-np.pi, np.pi, 2)
        move = Move.straight((x0, y0, headings[0]), (x1, y1, headings[1]))
        assert checker.is_motion_free(move)
    assert size < 40 or clear > 0


@given(seed=seeds, bounded=st.booleans())
@settings(max_examples=10, deadline=None)
def test_open_floor_is_free(seed: int, bounded: bool) -> None:
    rng = np.random.default_rng(seed)
    polygons = hall(rng, size=20.0)
    walls = (-0.5, -0.5, 20.5, 20.5) if bounded else None
    checker = CollisionChecker(BOX, Obstacles.from_polygons(polygons), 0.1, walls)
    poses = np.column_stack([rng.uniform(-1, 21, (200, 2)), rng.uniform(-4, 4, 200)])
    for pose in poses:
        checker.is_free(pose)
    floor = checker.open_floor
    assert floor.longest
    for column, ends in floor.ends.items():
        assert (np.diff(ends) > 0).all()
        runs = np.reshape(ends, (-1, 2))
        low, high = floor.longest[column]
        assert high - low == (runs[:, 1] - runs[:, 0]).max()
        assert [low, high] in runs.tolist()
    for column in list(floor.ends)[:8]:
        for low, high in np.reshape(floor.ends[column], (-1, 2)):
            # The column of these x, by the very sum that finds it; not their border.
            x = column - floor.shift + rng.uniform(-0.499, 0.499) * floor.cell
            assert x + floor.shift == column
            low, high = max(low, -3.0), min(high, 23.0)
            for y in (low, high, *rng.uniform(low, high, 2)):
                pose = np.array([x, y, rng.uniform(-4, 4)])
                assert naive_distance(BOX, polygons, pose) > 0.1
                if bounded:
                    corners = naive_collision.placed(BOX, pose)
                    assert np.abs(corners - 10.0).max() < 10.4


@pytest.mark.parametrize("footprint", [BOX, L_SHAPE], ids=["box", "l-shape"])
@given(seed=seeds, clearance=st.sampled_from([0.0, 0.05, 0.4]))
@settings(max_examples=12, deadline=None)
def test_poses_agree_with_brute_force(
    footprint: FloatArray, seed: int, clearance: float
) -> None:
    rng = np.random.default_rng(seed)
    polygons = hall(rng)
    checker = CollisionChecker(footprint, Obstacles.from_polygons(polygons), clearance)
    poses = np.array([any_pose(rng) for _ in range(20)])
    free = checker.are_free(poses)
    for pose, is_free in zip(poses, free, strict=True):
        true = naive_distance(footprint, polygons, pose)
        assert checker.distance(pose) == pytest.approx(true, abs=1e-12)
        assert checker.is_free(pose) == is_free
        if abs(true - clearance) > 1e-8:
            assert is_free == (true > clearance)
        hit = checker.hit_at(pose)
        assert (hit is None) == is_free
        if hit is not None:
            assert hit.distance == pytest.approx(true, abs=1e-12)
            corners = naive_collision.placed(footprint, pose)
            theirs = naive_collision.distance(corners, polygons[hit.index])
            assert theirs == pytest.approx(true, abs=1e-12)


def any_move(rng: np.random.Generator) -> Move:
    start = any_pose(rng)
    kind = rng.integers(3)
    if kind == 0:
        twist = [*rng.uniform(-1.5, 1.5, 2), rng.uniform(-6, 6)]
        return Move.along(start, twist)
    turn = float(rng.uniform(-3, 3))
    goal = start + np.array([*rng.uniform(-1.5, 1.5, 2), turn])
    make = Move.straight if kind == 1 else Move.arc
    return make(start, goal, turn=turn)


@pytest.mark.parametrize("footprint", [BOX, L_SHAPE], ids=["box", "l-shape"])
@given(seed=seeds, clearance=st.sampled_from([0.0, 0.05]))
@settings(max_examples=8, deadline=None)
def test_moves_agree_with_dense_sampling(
    footprint: FloatArray, seed: int, clearance: float
) -> None:
    rng = np.random.default_rng(seed)
    polygons = hall(rng, 4)
    checker = CollisionChecker(footprint, Obstacles.from_polygons(polygons), clearance)
    for _ in range(2):
        move = any_move(rng)
        u = np.linspace(0, 1, 80)
        dense = np.array(
            [naive_distance(footprint, polygons, pose) for pose in move.poses(u)]
        )
        hit = checker.first_hit(move)
        assert (hit is None) == checker.is_motion_free(move)
        # Between two samples no point moves farther than this.
        step = (move.length + 1.4 * abs(move.turn)) / 79
        if hit is None:
            assert dense.min() > clearance
        else:
            assert dense[u < hit.u].min(initial=math.inf) > clearance
            assert dense.min() <= clearance + step + 2e-4
            assert hit.distance <= clearance + 2e-4
            assert move.poses([hit.u])[0] == pytest.approx(hit.pose)


@given(seed=seeds, form=st.sampled_from(["origin", "elsewhere"]))
@settings(max_examples=12, deadline=None)
def test_trajectories_agree_with_dense_sampling(seed: int, form: str) -> None:
    rng = np.random.default_rng(seed)
    polygons = hall(rng, 4)
    point = (0.0, 0.0) if form == "origin" else (0.4, -0.2)
    checker = CollisionChecker(BOX, Obstacles.from_polygons(polygons))
    n = int(rng.integers(2, 9))
    poses = any_pose(rng) + np.cumsum(rng.uniform(-0.8, 0.8, (n, 3)), axis=0)
    t = np.cumsum(rng.uniform(0.2, 1.0, n))
    trajectory = Trajectory.from_poses(t, poses, reference_point=point)
    motion = motion_of(trajectory, is_own=False)
    assert isinstance(motion, PoseMotion)
    at = np.linspace(t[0], t[-1], 120)
    seen = motion.poses_at(at)
    dense = np.array([naive_distance(BOX - point, polygons, pose) for pose in seen])
    hit = checker.first_hit_of_trajectory(trajectory)
    if hit is None:
        assert dense.min() > 0
    else:
        assert hit.t is not None
        assert (dense[at < hit.t - 1e-9] > 0).all()
        assert hit.distance <= 2e-4
        assert motion.poses_at(np.array([hit.t]))[0] == pytest.approx(hit.pose)


@given(seed=seeds)
@settings(max_examples=4, deadline=None)
def test_swept_area_agrees_with_painted_cells(seed: int) -> None:
    rng = np.random.default_rng(seed)
    move = any_move(rng)
    checker = CollisionChecker(L_SHAPE)
    swept = checker.swept(move)
    x0, y0, x1, y1 = swept.bounds
    points = rng.uniform([x0, y0], [x1, y1], (1500, 2))
    covered = np.zeros(len(points), dtype=bool)
    for x, y, theta in move.poses(np.linspace(0, 1, 400)):
        local = naive_collision.placed(points - [x, y], (0, 0, -theta))
        covered |= _inside_l_shape(local)
    expected = covered.mean() * (x1 - x0) * (y1 - y0)
    sigma = 0.5 / math.sqrt(len(points)) * (x1 - x0) * (y1 - y0)
    assert swept.area == pytest.approx(expected, abs=4.5 * sigma + 0.02)
    assert swept.area == checker.swept_area(move)


def _inside_l_shape(p: FloatArray) -> npt.NDArray[np.bool_]:
    x, y = p.T
    bar = (x >= -0.6) & (x <= 1) & (abs(y) <= 0.3)
    leg = (x >= -0.6) & (x <= 0) & (y >= -1.2) & (y <= 0.3)
    return np.asarray(bar | leg)


@given(seed=seeds)
@settings(max_examples=40, deadline=None)
def test_bounds_are_walls(seed: int) -> None:
    rng = np.random.default_rng(seed)
    bounds = (0.5, 1.0, 4.5, 3.5)
    clearance = float(rng.choice([0.0, 0.2]))
    checker = CollisionChecker(BOX, None, clearance, bounds)
    poses = np.array([any_pose(rng) for _ in range(50)])
    for pose, free in zip(poses, checker.are_free(poses), strict=True):
        corners = naive_collision.placed(BOX, pose)
        low, high = corners.min(axis=0), corners.max(axis=0)
        room = min(*(low - bounds[:2]), *(bounds[2:] - high))
        assert free == (room > clearance)
        assert checker.is_free(pose) == free
        assert checker.distance(pose) == pytest.approx(max(room, 0.0), abs=1e-12)
