"""Checks solvable by head, speed of search, and what is refused."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import shapely  # noqa: TID251

from configspace import InvalidInput, Vehicle, build_space, load_vehicle
from omniplan import InvalidTrajectory, Path, Trajectory, plan
from omniplan.obstacles import CollisionChecker, Obstacles
from omniplan.planning.moves import Move

FloatArray = npt.NDArray[np.float64]

SQUARE = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]
WALL = [[3.0, -50.0], [4.0, -50.0], [4.0, 50.0], [3.0, 50.0]]


def wall() -> Obstacles:
    return Obstacles.from_polygons({"wall": WALL})


def random_hall(n: int = 500, size: float = 200.0) -> list[FloatArray]:
    rng = np.random.default_rng(1)
    polygons = []
    for _ in range(n):
        corners = int(rng.integers(3, 30))
        angle = np.linspace(0, 2 * np.pi, corners, endpoint=False)
        shape = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        radius = rng.uniform(0.3, 3.0) * rng.uniform(0.7, 1.0, corners)
        polygons.append(rng.uniform(0, size, 2) + radius[:, None] * shape)
    return polygons


def test_touching_is_a_hit_and_a_hair_less_is_not() -> None:
    checker = CollisionChecker(SQUARE, wall())
    assert not checker.is_free((2.0, 0.0, 0.0))
    assert checker.is_free((2.0 - 1e-6, 0.0, 0.0))
    assert checker.distance((0.0, 0.0, math.pi / 4)) == pytest.approx(3 - math.sqrt(2))
    assert checker.distance((3.0, 0.0, 0.3)) == 0.0


def test_clearance_counts_from_the_footprint() -> None:
    checker = CollisionChecker(SQUARE, wall(), clearance=0.5)
    assert checker.is_free((1.4999, 0, 0))
    assert not checker.is_free((1.5, 0, 0))
    hit = checker.hit_at((1.75, 2.0, 0))
    assert hit is not None
    assert (hit.obstacle, hit.index, hit.place[0]) == ("wall", 0, 3.0)
    assert hit.distance == pytest.approx(0.25)
    assert "0.2500 m to wall" in hit.message
    assert "clearance 0.5 m" in hit.message


def test_a_pillar_inside_the_footprint_is_hit() -> None:
    pillar = [[0.01, 0.01], [0.02, 0.01], [0.02, 0.02]]
    checker = CollisionChecker(SQUARE, Obstacles.from_polygons([pillar]))
    assert not checker.is_free((0, 0, 0))
    inside = CollisionChecker([[3.4, 0], [3.6, 0], [3.5, 0.1]], wall())
    assert not inside.is_free((0, 0, 0))
    assert checker.is_free((5, 0, 0))


def test_nothing_stands_in_an_empty_hall() -> None:
    checker = CollisionChecker(SQUARE)
    assert checker.is_free((1e5, 0, 0))
    assert checker.are_free(np.zeros((3, 3))).all()
    assert checker.distance((0, 0, 0)) == math.inf
    assert checker.is_motion_free(Move.straight([0, 0, 0], [99, 0, 3]))
    assert checker.hit_at((0, 0, 0)) is None
    assert Obstacles().bounds is None
    assert Obstacles().area == 0.0
    assert len(Obstacles()) == 0


def test_driving_along_a_wall_is_proved_free() -> None:
    checker = CollisionChecker(SQUARE, wall())
    for gap in (1e-3, 1e-5, 1e-6):
        x = 2.0 - gap
        assert checker.is_motion_free(Move.straight([x, -40, 0], [x, 40, 0]))
    assert not checker.is_motion_free(Move.straight([2, -40, 0], [2, 40, 0]))


def test_first_hit_is_where_the_corner_meets_the_wall() -> None:
    checker = CollisionChecker(SQUARE, wall())
    hit = checker.first_hit(Move.straight([0, 0, 0], [10, 0, 0]))
    assert hit is not None
    assert hit.u == pytest.approx(0.2, abs=2e-5)
    assert hit.u <= 0.2
    assert hit.pose[0] == pytest.approx(2.0, abs=2e-4)
    # A turn on the spot: the corner at √2 reaches the wall at 3 from x = 1.7.
    turn = Move.along([1.7, 0, 0], [0, 0, math.pi / 2])
    hit = checker.first_hit(turn)
    assert hit is not None
    reached = math.pi / 4 - math.acos(1.3 / math.sqrt(2))
    assert hit.u * math.pi / 2 == pytest.approx(reached, abs=1e-4)
    assert "wall" in hit.message


def test_a_thin_pillar_between_two_free_ends_is_met() -> None:
    thin = [[5, 0], [5.001, 0], [5, 0.001]]
    checker = CollisionChecker(SQUARE, Obstacles.from_polygons([thin]))
    move = Move.straight([0, 0, 0], [100, 0, 0])
    assert checker.are_free(move.poses([0, 1])).all()
    assert not checker.is_motion_free(move)
    assert checker.is_motion_free(Move.straight([0, 1.1, 0], [100, 1.1, 0]))


@dataclass(frozen=True)
class Dubins:
    """A right and a left arc of the unit circle: constant speed, no constant twist."""

    start: FloatArray
    goal: FloatArray
    length: float = math.pi
    turn: float = 0.0

    def poses(self, u: npt.ArrayLike) -> FloatArray:
        s = np.asarray(u, dtype=np.float64) * math.pi
        right = s < math.pi / 2
        x = np.where(right, np.sin(s), 2 - np.sin(s))
        y = np.where(right, np.cos(s) - 1, -1 + np.cos(s))
        return np.stack([x, y, np.zeros_like(s)], axis=-1)


def test_any_motion_at_constant_speed_will_do() -> None:
    ends = np.zeros(3), np.array([2.0, -2.0, 0.0])
    move = Dubins(*ends)
    assert move.poses([0, 1]) == pytest.approx(np.array(ends))
    tiny = [[0.01, 0.01], [-0.01, 0.01], [-0.01, -0.01], [0.01, -0.01]]
    bend = math.sin(math.pi / 4)
    for off, free in ((0.03, True), (0.0, False)):
        at = np.array([bend + off, bend - 1 + off])
        pillar = at + np.array(tiny)[::-1]
        checker = CollisionChecker(tiny, Obstacles.from_polygons([pillar]))
        assert checker.is_motion_free(move) == free


def test_swept_areas_have_closed_forms() -> None:
    checker = CollisionChecker(SQUARE)
    straight = checker.swept(Move.straight([0, 0, 0], [3, 0, 0]))
    assert straight.area == pytest.approx(2 * 2 + 3 * 2)
    assert straight.bounds == pytest.approx((-1, -1, 4, 1))
    # A square that turns by a quarter on the spot paints its whole circumscribed disc.
    turn = checker.swept_area(Move.along([0, 0, 0], [0, 0, math.pi / 2]))
    assert turn == pytest.approx(2 * math.pi, abs=3e-4)
    # A ring remains where the middle is never reached.
    ring = checker.swept(Move.along([0, 4, 0], [8 * math.pi, 0, 2 * math.pi]))
    outer, inner = math.hypot(1, 5), 3.0
    assert ring.area == pytest.approx(math.pi * (outer**2 - inner**2), abs=1e-3)
    assert len(ring.rings) == 2


def test_trajectories_are_followed_by_their_own_reference_point() -> None:
    vehicle = load_vehicle("ackermann")  # 1.1 m ahead of the origin of its file
    checker = CollisionChecker(vehicle, wall())
    poses = np.array([[0, 0, 0], [1, 0, 0], [1.85, 0, 0]])
    assert (
        checker.first_hit_of_trajectory(Trajectory.from_poses([0, 1, 2], poses)) is None
    )
    ahead = Trajectory.from_poses([0, 1, 2], poses, reference_point=(-0.1, 0))
    hit = checker.first_hit_of_trajectory(ahead)
    assert hit is not None
    assert hit.t is not None
    assert 1.9 < hit.t < 2
    assert hit.u == pytest.approx(hit.t / 2)
    assert f"t = {hit.t:.3f} s" in hit.message
    assert checker.swept_area(ahead) == pytest.approx((1.4 + 1.85) * 0.7, abs=1e-6)


def test_a_vehicle_and_its_space_stand_alike() -> None:
    vehicle = load_vehicle("bmw-320i")
    poses = np.random.default_rng(3).uniform([-4, -8, -4], [9, 8, 4], (200, 3))
    corners = np.array(vehicle.footprint) - [vehicle.reference.real, 0]
    answers = [
        CollisionChecker(body, wall()).are_free(poses)
        for body in (vehicle, build_space(vehicle, cache=False), corners)
    ]
    assert 0 < answers[0].sum() < 200
    assert all((each == answers[0]).all() for each in answers)


def test_footprint_is_moved_to_the_reference_point() -> None:
    data = load_vehicle("mecanum").model_dump(mode="json")
    moved = Vehicle.model_validate_json(
        json.dumps({**data, "reference_point": [0.45, 0.0]})
    )
    checker = CollisionChecker(moved, wall())
    assert checker.distance((2.0, 0, 0)) == pytest.approx(1.0)
    assert checker.distance((2.0, 0, math.pi)) == pytest.approx(0.1)


def test_the_broad_phase_loses_nothing() -> None:
    """Against all 500 obstacles one by one, near and far, cell by cell."""
    polygons = random_hall()
    obstacles = Obstacles.from_polygons(polygons)
    every = np.array([shapely.Polygon(each) for each in polygons])
    rng = np.random.default_rng(2)
    vehicle = load_vehicle("mecanum")
    for clearance in (0.0, 0.7):
        checker = CollisionChecker(vehicle, obstacles, clearance)
        around = np.array([each[0] for each in polygons[::2]])
        poses = np.concatenate(
            [
                rng.uniform([-5, -5, -4], [205, 205, 4], (200, 3)),
                np.column_stack(
                    [around + rng.normal(0, 0.5, (250, 2)), rng.uniform(-4, 4, 250)]
                ),
            ]
        )
        free = [checker.is_free(pose) for pose in poses]
        corners = np.array(vehicle.footprint) @ [1, 1j]
        placed = np.exp(1j * poses[:, 2:]) * corners + poses[:, :1] + 1j * poses[:, 1:2]
        bodies = np.asarray(
            shapely.polygons(np.stack([placed.real, placed.imag], axis=-1))
        )
        naive = shapely.distance(bodies[:, None], every).min(axis=1)
        assert free == (naive > clearance + 1e-9).tolist()
        assert (checker.are_free(poses) == free).all()
        assert 0.2 < np.mean(free) < 0.9
        for pose, true in zip(poses[::50], naive[::50], strict=True):
            assert checker.distance(pose) == pytest.approx(true, abs=1e-9)


def test_long_and_short_moves_in_a_hall_agree_with_dense_poses() -> None:
    polygons = random_hall()
    checker = CollisionChecker(
        load_vehicle("mecanum"), Obstacles.from_polygons(polygons)
    )
    rng = np.random.default_rng(5)
    seen = set()
    for length in (0.3, 2.0, 10.0, 40.0):
        for _ in range(60):
            start = rng.uniform([0, 0, -3], [200, 200, 3])
            turn = rng.uniform(-2, 2)
            angle = rng.uniform(-3, 3)
            step = np.array([length * np.cos(angle), length * np.sin(angle), turn])
            goal = start + step
            move = Move.arc(start, goal, turn=turn)
            dense = checker.are_free(
                move.poses(np.linspace(0, 1, int(40 * length) + 9))
            )
            free = checker.is_motion_free(move)
            assert not free or dense.all()
            # In such a hall nothing is missed by less than the step of the samples.
            assert free or not dense.all() or checker.first_hit(move) is not None
            seen.add((length, free))
    assert len(seen) == 8


@pytest.mark.parametrize(
    ("clearance", "bounds", "words"),
    [
        (-0.1, None, "clearance: -0.1; a finite distance of at least 0 m"),
        (math.nan, None, "clearance: nan"),
        (0.0, (0, 0, 0, 1), r"bounds: \[0, 0, 0, 1\]; .*x0 < x1"),
        (0.0, (0, 0, math.inf, 1), "bounds: .*inf"),
        (0.0, (0, 0, 1), "bounds: "),
        (0.0, "abcd", "bounds: 'abcd'"),
    ],
)
def test_wrong_numbers_are_refused(
    clearance: float, bounds: object, words: str
) -> None:
    with pytest.raises(InvalidInput, match=words):
        CollisionChecker(SQUARE, None, clearance, bounds)  # type: ignore[arg-type]


@pytest.mark.parametrize("pose", [(math.nan, 0, 0), (0, math.inf, 0), (0, 0, math.nan)])
def test_poses_must_be_finite(pose: tuple[float, float, float]) -> None:
    checker = CollisionChecker(SQUARE, wall())
    for ask in (checker.is_free, checker.distance, checker.hit_at):
        with pytest.raises(InvalidInput, match=r"pose: .*; finite numbers"):
            ask(pose)
    with pytest.raises(InvalidInput, match="finite numbers"):
        checker.are_free([(0, 0, 0), pose])


def test_a_vehicle_without_footprint_is_refused() -> None:
    data = load_vehicle("mecanum").model_dump()
    bare = Vehicle.model_validate({**data, "footprint": ()})
    with pytest.raises(InvalidInput, match="give footprint in the vehicle file"):
        CollisionChecker(bare)
    crossed = ((1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0))
    twisted = Vehicle.model_validate({**data, "footprint": crossed})
    with pytest.raises(InvalidInput, match="vehicle mecanum: footprint: "):
        CollisionChecker(twisted)


def test_motions_without_places_are_refused() -> None:
    checker = CollisionChecker(SQUARE)
    twists = Trajectory.from_twists([0, 1], [[1, 0, 0], [1, 0, 0]])
    with pytest.raises(InvalidTrajectory, match="tell no place"):
        checker.first_hit_of_trajectory(twists)
    path = Path.from_poses([[0, 0, 0], [1, 0, 0]])
    with pytest.raises(InvalidTrajectory, match="no times"):
        checker.first_hit_of_trajectory(path)  # type: ignore[arg-type]


@pytest.mark.parametrize("pose", [(2e6, 0, 0), (0, -1e300, 0)])
def test_poses_beyond_the_walls_are_refused(pose: tuple[float, float, float]) -> None:
    """The walls of the bounds are thick, not endless: nothing is free behind them."""
    checker = CollisionChecker(SQUARE, wall(), bounds=(-9, -9, 9, 9))
    assert not checker.is_free((1e6, -1e6, 0))
    away = Move.straight((0, 0, 0), pose)
    words = r"pose: \(.*\); finite numbers \(x, y, θ\), x and y of at most 1e\+06 m"
    for ask in (checker.is_free, checker.distance, checker.hit_at):
        with pytest.raises(InvalidInput, match=words):
            ask(pose)
    with pytest.raises(InvalidInput, match=words):
        checker.are_free([(0, 0, 0), pose])
    for ask_of in (checker.is_motion_free, checker.first_hit):
        with pytest.raises(InvalidInput, match=words):
            ask_of(away)
    for ends in ((0, 0, *pose[:2]), (*pose[:2], 0, 0)):
        with pytest.raises(InvalidInput, match=words):
            checker.is_line_clear(*ends)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_line_to_nowhere_is_told(bad: float) -> None:
    checker = CollisionChecker(load_vehicle("mecanum"), wall())
    with pytest.raises(InvalidInput, match=r"pose: .*; finite numbers"):
        checker.is_line_clear(0.0, 0.0, bad, 1.0)


def test_bodies_are_told_apart_by_footprint_and_reference_point() -> None:
    vehicle = load_vehicle("mecanum")
    space = build_space(vehicle)
    data = vehicle.model_dump()
    assert vehicle.footprint is not None
    begun_elsewhere = [*vehicle.footprint[1:], vehicle.footprint[0]]
    changes: list[dict[str, object]] = [
        {"name": "renamed"},
        {"footprint": tuple(begun_elsewhere)},
        {"footprint": tuple(begun_elsewhere[::-1])},
    ]
    for change in changes:
        same = Vehicle.model_validate({**data, **change})
        CollisionChecker(same).require_body_of(space)
    longer = tuple((2 * x, y) for x, y in vehicle.footprint)
    changes = [{"footprint": longer}, {"reference_point": (0.1, 0.0)}]
    for change in changes:
        other = Vehicle.model_validate({**data, **change})
        with pytest.raises(InvalidInput, match="checks vehicle mecanum, whose foot"):
            CollisionChecker(other).require_body_of(space)
    bare = build_space(Vehicle.model_validate({**data, "footprint": ()}))
    CollisionChecker(vehicle).require_body_of(bare)
    renamed = Vehicle.model_validate({**data, "name": "renamed"})
    with pytest.raises(InvalidInput, match=r"checks vehicle renamed.* vehicle mecanum"):
        CollisionChecker(renamed).require_body_of(bare)
    with pytest.raises(InvalidInput, match="checks vehicle ackermann, whose foot"):
        plan((0, 0, 0), (1, 0, 0), space, CollisionChecker(load_vehicle("ackermann")))


@pytest.mark.parametrize(
    "pose", [(0, 0), (0, 0, 0, 0), "abc", None, (0, 0, "a"), [[0, 0, 0]], 3.0]
)
def test_what_is_no_pose_is_told(pose: Any) -> None:
    checker = CollisionChecker(SQUARE, wall())
    words = r"pose: .*; finite numbers \(x, y, θ\)"
    for ask in (checker.is_free, checker.distance, checker.hit_at):
        with pytest.raises(InvalidInput, match=words):
            ask(pose)


@pytest.mark.parametrize("poses", [(0, 0, 0), [[0, 0]] * 3, [[0, 0, "a"]], None, 3.0])
def test_what_are_no_poses_is_told(poses: Any) -> None:
    checker = CollisionChecker(SQUARE, wall())
    with pytest.raises(InvalidInput, match="pose"):
        checker.are_free(poses)
    assert checker.are_free([]).shape == (0,)


@pytest.mark.parametrize("motion", [None, 5, [(0, 0, 0), (1, 0, 0)]])
def test_what_is_no_motion_is_told(motion: Any) -> None:
    checker = CollisionChecker(SQUARE, wall())
    for ask in (checker.is_motion_free, checker.first_hit, checker.swept):
        with pytest.raises(InvalidInput, match=r"motion: \w+; a Move, or anything"):
            ask(motion)


@pytest.mark.parametrize("given", [[SQUARE], "hall.json", {"wall": WALL}])
def test_what_are_no_obstacles_is_told(given: Any) -> None:
    with pytest.raises(InvalidInput, match=r"obstacles: \w+; Obstacles, such as"):
        CollisionChecker(SQUARE, given)


@pytest.mark.parametrize("given", ["far", None, [1.0]])
def test_what_is_no_clearance_is_told(given: Any) -> None:
    with pytest.raises(InvalidInput, match=r"clearance: .*; a finite distance"):
        CollisionChecker(SQUARE, None, given)
