"""Checks of whole motions against shapely at thousands of poses, from both sides.

The least distance d of the dense poses decides what the answer must be: a little more
clearance than d is refused, as one of the poses shows; a little less is granted, so
that no refusal is idle. What shapely is asked is the footprint as one polygon and
all obstacles as one area; poses are those of the test's own formulas or of OMPL.
"""

from __future__ import annotations

import math
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import shapely  # noqa: TID251
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from shapely.geometry import Polygon  # noqa: TID251

from configspace import PermissibleSpace, build_space, load_vehicle
from omniplan import Trajectory, sampling
from omniplan.motion import PoseMotion, motion_of
from omniplan.obstacles import CollisionChecker, Obstacles
from omniplan.planning.moves import Move
from omniplan.sampling.ompl_bindings import base

FloatArray = npt.NDArray[np.float64]

seeds = st.integers(0, 2**32 - 1)
N_POSES = 1500
ABOVE = 1e-6
"""This much above the least distance, m, a clearance is refused."""
RESERVE = 1e-3
"""This much below it, m, one is granted."""

FOOTPRINTS = {
    "box": [(0.7, 0.3), (-0.5, 0.3), (-0.5, -0.3), (0.7, -0.3)],
    "fork": [
        (0.9, 0.4), (0.9, 0.2), (0.1, 0.2), (0.1, -0.2),
        (0.9, -0.2), (0.9, -0.4), (-0.4, -0.4), (-0.4, 0.4),
    ],
    "off-centre star": [
        (0.5, 0.1), (0.8, 0.5), (0.3, 0.4), (-0.2, 0.7), (0.1, 0.2), (-0.1, -0.3),
    ],
}  # fmt: skip
BOUNDS = (-1.0, -1.0, 6.0, 6.0)
SIZE = 5.0


def random_area(rng: np.random.Generator) -> tuple[Obstacles, Any]:
    """Return obstacles, and the same as one area of the test's own making."""
    if rng.random() < 0.3:
        return random_map(rng)
    shapes: list[Any] = []
    for _ in range(int(rng.integers(1, 7))):
        at, size = rng.uniform(0, SIZE, 2), rng.uniform(0.1, 0.7)
        angle = np.sort(rng.uniform(0, 2 * np.pi, int(rng.integers(5, 12))))
        radius = size * rng.uniform(0.4, 1.0, angle.size)
        ring = at + radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], -1)
        shape = Polygon(ring)
        if shape.is_valid and shape.area > 1e-3:
            shapes.append(shape)
        if rng.random() < 0.3:  # with a room in it
            room = shapely.box(*(at - size), *(at + size))
            shapes.append(room.difference(room.buffer(-0.1 * size)))
    return Obstacles.from_polygons(shapes), shapely.union_all(shapes)


def random_map(rng: np.random.Generator) -> tuple[Obstacles, Any]:
    cell, yaw = float(rng.uniform(0.1, 0.3)), float(rng.uniform(-3, 3))
    black = rng.random((14, 11)) < 0.06
    x, y = rng.uniform(1, 4, 2).tolist()
    boxes = []
    for row, column in np.argwhere(black):
        low = column * cell, (len(black) - 1 - row) * cell
        boxes.append(shapely.box(*low, low[0] + cell, low[1] + cell))
    turned = np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]])
    area = shapely.transform(shapely.union_all(boxes), lambda xy: xy @ turned + [x, y])
    with TemporaryDirectory() as folder:
        Image.fromarray(np.where(black, 0, 255).astype(np.uint8)).save(
            Path(folder) / "map.png"
        )
        path = Path(folder) / "map.yaml"
        path.write_text(
            f"{{image: map.png, resolution: {cell!r}, origin: [{x!r}, {y!r}, {yaw!r}], "
            "negate: 0, occupied_thresh: 0.65, free_thresh: 0.196}"
        )
        return Obstacles.from_map(path), area


def random_motion(rng: np.random.Generator) -> tuple[Move, FloatArray]:
    """Return a move, and its poses (n, 3) by the test's own formulas."""
    (x, y), theta = rng.uniform(0, SIZE, 2).tolist(), float(rng.uniform(-4, 4))
    u = np.linspace(0, 1, N_POSES)
    kind = rng.integers(4)
    if kind == 0:  # on the spot
        turn = float(rng.uniform(-7, 7))
        move = Move.along((x, y, theta), (0.0, 0.0, turn))
        return move, np.stack([x + 0 * u, y + 0 * u, theta + turn * u], -1)
    if kind == 1:  # the heading turns while K goes straight
        (dx, dy), turn = rng.uniform(-2, 2, 2).tolist(), float(rng.uniform(-3, 3))
        move = Move.straight((x, y, theta), (x + dx, y + dy, theta + turn), turn=turn)
        return move, np.stack([x + dx * u, y + dy * u, theta + turn * u], -1)
    vx, vy = rng.uniform(-2, 2, 2).tolist()
    omega = float(rng.uniform(-6, 6)) if kind == 2 else float(rng.normal(0, 1e-3))
    v, w = complex(vx, vy), omega * u
    # The integral of v exp(iωu): exp(iω/2) sinc(ω/2).
    way = v * np.exp(1j * (theta + w / 2)) * u * np.sinc(w / (2 * np.pi))
    move = Move.along((x, y, theta), (vx, vy, omega))
    return move, np.stack([x + way.real, y + way.imag, theta + w], -1)


def least_distance(footprint: Polygon, poses: FloatArray, area: Any) -> float:
    """Return the least distance of the footprint at poses to an area, and to BOUNDS."""
    corners = shapely.get_coordinates(footprint)
    c, s = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
    x = poses[:, :1] + c * corners[:, 0] - s * corners[:, 1]
    y = poses[:, 1:2] + s * corners[:, 0] + c * corners[:, 1]
    to_bounds = min(
        x.min() - BOUNDS[0], y.min() - BOUNDS[1],
        BOUNDS[2] - x.max(), BOUNDS[3] - y.max(),
    )  # fmt: skip
    to_area = math.inf
    if not area.is_empty:
        to_area = shapely.distance(shapely.polygons(np.stack([x, y], -1)), area).min()
    return max(0.0, float(min(to_area, to_bounds)))


def farthest(footprint: Polygon) -> float:
    return float(np.linalg.norm(shapely.get_coordinates(footprint), axis=1).max())


def half_step(poses: FloatArray, radius: float) -> float:
    """Return how far a point of the footprint is off the nearest pose at most, m."""
    step = np.diff(poses, axis=0)
    moved = np.hypot(step[:, 0], step[:, 1]) + radius * np.abs(step[:, 2])
    # Ways between neighbouring poses are longer than their chords by far less.
    return float(moved.max()) / 2 * 1.01


def judge_one_motion(seed: int, shape: str) -> None:
    rng = np.random.default_rng(seed)
    footprint = Polygon(FOOTPRINTS[shape])
    obstacles, area = random_area(rng)
    move, poses = random_motion(rng)
    assert np.abs(move.poses(np.linspace(0, 1, N_POSES)) - poses).max() < 1e-9
    checker = CollisionChecker(FOOTPRINTS[shape], obstacles, 0.0, BOUNDS)
    least = least_distance(footprint, poses, area)
    refused = checker.with_clearance(least + ABOVE)
    assert not refused.is_motion_free(move)
    hit = refused.first_hit(move)
    assert hit is not None
    assert hit.distance <= least + ABOVE + RESERVE
    # Before that nothing comes nearer.
    before = poses[: math.floor(hit.u * (N_POSES - 1))]
    if len(before):
        assert least_distance(footprint, before, area) > least
    if least == 0.0:
        assert not checker.is_motion_free(move)
        return
    granted = least - half_step(poses, farthest(footprint)) - RESERVE
    if granted >= 0:
        free = checker.with_clearance(granted)
        assert free.is_motion_free(move)
        assert free.first_hit(move) is None
        assert free.are_free(poses[::50]).all()
    assert (checker.are_free(poses[::50])).all()


@pytest.mark.parametrize("shape", FOOTPRINTS)
@given(seed=seeds)
@settings(max_examples=40, deadline=None)
def test_moves_are_judged_by_their_least_distance(seed: int, shape: str) -> None:
    judge_one_motion(seed, shape)


@pytest.mark.slow
@pytest.mark.parametrize("shape", FOOTPRINTS)
def test_thousands_of_moves_are_judged_by_their_least_distance(shape: str) -> None:
    for seed in range(3000):
        judge_one_motion(seed, shape)


def judge_one_trajectory(seed: int, shape: str) -> None:
    rng = np.random.default_rng(seed)
    obstacles, area = random_area(rng)
    point = rng.uniform(-0.5, 0.5, 2)
    n = int(rng.integers(2, 9))
    steps = rng.uniform(-0.6, 0.6, (n, 3))
    at_first = [*rng.uniform(0, SIZE, 2), rng.uniform(-4, 4)]
    t = np.cumsum(rng.uniform(0.2, 1.0, n))
    given_poses = at_first + np.cumsum(steps, axis=0)
    trajectory = Trajectory.from_poses(t, given_poses, reference_point=tuple(point))
    motion = motion_of(trajectory, is_own=False)
    assert isinstance(motion, PoseMotion)
    poses = motion.poses_at(np.linspace(t[0], t[-1], N_POSES))
    footprint = Polygon(np.array(FOOTPRINTS[shape]) - point)
    checker = CollisionChecker(FOOTPRINTS[shape], obstacles, 0.0, BOUNDS)
    least = least_distance(footprint, poses, area)
    hit = checker.with_clearance(least + ABOVE).first_hit_of_trajectory(trajectory)
    assert hit is not None
    assert hit.distance <= least + ABOVE + RESERVE
    granted = least - half_step(poses, farthest(footprint)) - RESERVE
    if granted >= 0:
        free = checker.with_clearance(granted)
        assert free.first_hit_of_trajectory(trajectory) is None


@pytest.mark.parametrize("shape", FOOTPRINTS)
@given(seed=seeds)
@settings(max_examples=15, deadline=None)
def test_trajectories_are_judged_by_their_least_distance(seed: int, shape: str) -> None:
    judge_one_trajectory(seed, shape)


@pytest.mark.slow
@pytest.mark.parametrize("shape", FOOTPRINTS)
def test_thousands_of_trajectories_are_judged_alike(shape: str) -> None:
    for seed in range(1000):
        judge_one_trajectory(seed, shape)


@pytest.fixture(scope="module")
def mecanum() -> PermissibleSpace:
    return build_space(load_vehicle("mecanum"))


def judge_motions_of_ompl(seed: int, space: PermissibleSpace) -> None:
    """Mecanum can drive all of them: what is refused is so for obstacles."""
    rng = np.random.default_rng(seed)
    obstacles, area = random_area(rng)
    k = np.array(space.header.reference)
    footprint = Polygon(np.array(space.header.footprint) - k)
    state_space = base.SE2StateSpace()
    state_space.setBounds(sampling.bounds_of((-9, -9, 9, 9)))
    first, second, between = (state_space.allocState() for _ in range(3))
    for state in (first, second):
        state.setXY(*rng.uniform(0, SIZE, 2).tolist())
        state.setYaw(float(rng.uniform(-np.pi, np.pi)))
    rows = []
    for share in np.linspace(0, 1, N_POSES).tolist():
        state_space.interpolate(first, second, share, between)
        rows.append((between.getX(), between.getY(), between.getYaw()))
    poses = np.array(rows)
    poses[:, 2] = np.unwrap(poses[:, 2])
    least = least_distance(footprint, poses, area)
    checker = CollisionChecker(space, obstacles, 0.0, BOUNDS)

    def answer(clearance: float) -> tuple[bool, bool]:
        si = base.SpaceInformation(state_space)
        sampling.equip(si, space, checker.with_clearance(clearance))
        ends = si.isValid(first) and si.isValid(second)
        assert ends == (si.isValid(first) and si.isValid(second))  # now known
        return si.checkMotion(first, second), ends

    assert not answer(least + ABOVE)[0]
    granted = least - half_step(poses, farthest(footprint)) - RESERVE
    if granted >= 0:
        assert answer(granted) == (True, True)
    at_ends = least_distance(footprint, poses[[0, -1]], area)
    assert not answer(at_ends + ABOVE)[1]
    if at_ends > ABOVE:
        assert answer(at_ends - ABOVE)[1]


@given(seed=seeds)
@settings(max_examples=30, deadline=None)
def test_motions_of_ompl_are_judged_by_their_least_distance(
    mecanum: PermissibleSpace, seed: int
) -> None:
    judge_motions_of_ompl(seed, mecanum)


@pytest.mark.slow
def test_thousands_of_motions_of_ompl_are_judged_alike(
    mecanum: PermissibleSpace,
) -> None:
    for seed in range(2000):
        judge_motions_of_ompl(seed, mecanum)
