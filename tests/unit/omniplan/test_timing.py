"""Timing paths: cases that can be solved by head, and every way to say no."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from timing_cases import demanding_vehicle, smooth_path

import configspace
from configspace import InvalidInput, PermissibleSpace, vehicle_from_data
from configspace.testing import VehicleKind
from omniplan import (
    InvalidTrajectory,
    NotDrivable,
    Path,
    TimingStatus,
    Trajectory,
    fastest,
    time_path,
    time_paths,
    validate,
)
from omniplan.standing.ways import Change, Changer, Configuration, Way

SpaceOf = Callable[[str], PermissibleSpace]

LINE = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0]]


def mecanum(**limits: float) -> PermissibleSpace:
    """A Mecanum vehicle whose wheels hardly matter, with these limits."""
    wheels = [
        {
            "id": f"w{i}",
            "type": "mecanum",
            "x": 0.3 * sx,
            "y": 0.2 * sy,
            "roller_deg": -45.0 * sx * sy,
            "max_speed": 50.0,
        }
        for i, (sx, sy) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1)))
    ]
    data: dict[str, Any] = {"name": "m", "wheels": wheels, "limits": limits}
    grid = configspace.Grid(40, 72)
    return configspace.build_space(vehicle_from_data(data), grid, cache=False)


def steered(**wheel: Any) -> PermissibleSpace:
    """Four steered wheels."""
    wheels = [
        {"id": f"w{i}", "type": "steered", "x": x, "y": y, "max_speed": 1.0, **wheel}
        for i, (x, y) in enumerate(((0.3, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.3, -0.2)))
    ]
    limits = {"max_acceleration": 1.0, "max_deceleration": 1.0}
    data: dict[str, Any] = {"name": "s", "wheels": wheels, "limits": limits}
    grid = configspace.Grid(40, 72)
    return configspace.build_space(vehicle_from_data(data), grid, cache=False)


def circle(radius: float, turns: float, n: int = 81) -> np.ndarray[Any, Any]:
    phi = np.linspace(0, 2 * np.pi * turns, n)
    return np.stack([radius * np.sin(phi), radius - radius * np.cos(phi), phi], axis=1)


def assert_timed(
    path: Path | Trajectory, space: PermissibleSpace, optimum: float
) -> Trajectory:
    """The optimum is found, and the trajectory is proved and hardly slower."""
    timing = time_path(path, space)
    assert timing.status is TimingStatus.FOUND, timing.message
    assert timing.profile is not None
    assert timing.profile.duration == pytest.approx(optimum, rel=1e-3)
    assert timing.trajectory is not None
    assert timing.trajectory.duration == timing.duration
    assert optimum * 0.9999 < timing.trajectory.duration < optimum * 1.005
    assert validate(timing.trajectory, space).valid
    return timing.trajectory


def test_a_straight_line_is_a_trapezoid() -> None:
    space = mecanum(max_speed=1.0, max_acceleration=0.5, max_deceleration=2.0)
    # 1 m to speed up, 0.25 m to brake, 2.75 m at 1 m/s
    assert_timed(Path.from_poses(LINE), space, 2 + 0.5 + 2.75)


def test_a_short_line_is_a_triangle() -> None:
    space = mecanum(max_speed=9.0, max_acceleration=0.5, max_deceleration=2.0)
    # v²/2 (1/0.5 + 1/2) = 4 m
    v = math.sqrt(8 / 2.5)
    assert_timed(Path.from_poses(LINE), space, v / 0.5 + v / 2)


def test_turning_on_the_spot() -> None:
    space = steered(max_acceleration=0.5)
    turn = [[0.0, 0.0, f * np.pi] for f in (0, 1 / 3, 2 / 3, 1)]
    arm = math.hypot(0.3, 0.2)
    # The wheels roll π arm from rest to rest, up to 1 m/s, at 0.5 m/s².
    assert_timed(Path.from_poses(turn), space, 2 * math.sqrt(np.pi * arm / 0.5))


def test_a_circle_is_driven_at_the_speed_of_its_lateral_acceleration() -> None:
    space = mecanum(
        max_speed=9.0,
        max_lateral_acceleration=0.5,
        max_acceleration=1.0,
        max_deceleration=1.0,
    )
    path = Path.from_poses(circle(2.0, 2.0))
    v = math.sqrt(0.5 * 2.0)
    assert_timed(path, space, 8 * np.pi / v + v)  # v / 2 lost in each ramp


def test_caps_of_the_path_are_kept() -> None:
    space = mecanum(max_speed=1.0, max_acceleration=10.0, max_deceleration=10.0)
    path = Path.from_poses([*LINE, [8.0, 0.0, 0.0]], max_speed=[np.inf, 0.25])
    lost = 1.0 / 20 + 0.75**2 / 20 + 0.25 / 20  # starting, braking, stopping
    trajectory = assert_timed(path, space, 4.0 + 16.0 + lost)
    late = trajectory.samples[:, 0] > 4.01
    speed = np.diff(trajectory.samples[:, 0]) / np.diff(trajectory.t)
    assert speed[late[1:]].max() < 0.2501
    assert speed.max() > 0.99
    space = mecanum(max_speed=1.0, max_acceleration=100.0, max_deceleration=100.0)
    turn = Path.from_poses([[0, 0, 0], [0, 0, 1], [0, 0, 2]], max_yaw_rate=0.5)
    assert_timed(turn, space, 4.0 + 0.5 * 0.36 / 100)


def test_a_required_stop_is_a_stop() -> None:
    space = mecanum(max_speed=1.0, max_acceleration=1.0, max_deceleration=1.0)
    poses = [*LINE, [8.0, 0.0, 0.0]]
    assert_timed(Path.from_poses(poses), space, 9.0)
    stopping = assert_timed(Path.from_poses(poses, stops=[1]), space, 10.0)
    rows = np.flatnonzero(np.abs(stopping.samples[:, 0] - 4.0) < 1e-9)
    assert rows.size == 2  # the pose is repeated


def test_a_cusp_is_a_stop() -> None:
    space = mecanum(max_speed=1.0, max_acceleration=1.0, max_deceleration=1.0)
    assert_timed(Path.from_poses([*LINE, [0.0, 0.0, 0.0]]), space, 10.0)


def test_reversing_is_limited_and_turning_the_wheels_round_may_be_faster() -> None:
    limits = {"max_speed": 1.0, "max_acceleration": 1.0, "max_deceleration": 1.0}
    path = Path.from_poses([*LINE, [0.0, 0.0, 0.0]])
    slow = mecanum(**limits, max_reverse_speed=0.25)
    # A vehicle that can slide has no back: +v_s is one of two representations.
    assert_timed(path, slow, 10.0)
    data = configspace.load_vehicle("differential").model_dump(
        mode="json", exclude_none=True
    )
    data["limits"] = {**limits, "max_reverse_speed": 0.25}
    space = configspace.build_space(vehicle_from_data(data), cache=False)
    timing = time_path(path, space)
    assert timing.profile is not None
    assert "REVERSE_SPEED" in timing.profile.limit
    assert timing.profile.duration > 5 + 15.9


def test_wheels_turn_at_a_stop() -> None:
    space = steered(max_steering_rate_deg=45.0)
    path = Path.from_poses([*LINE, [4.0, 4.0, 0.0]])
    timing = time_path(path, space)
    assert timing.profile is not None
    # 90° at 45°/s; the way is added up from bounds, so a little is lost
    assert 2 * 5.0 + 2.0 < timing.profile.duration < 2 * 5.0 + 2.03
    stands = np.flatnonzero(np.diff(timing.profile.u) == 0)
    assert np.diff(timing.profile.t)[stands] == pytest.approx([2.0], abs=0.03)
    assert_timed(path, steered(max_steering_rate_deg=450.0), 2 * 5.0 + 0.2)


def test_a_representation_whose_steering_range_fits_is_chosen() -> None:
    # Backwards at once in front, the wheels cannot turn round: v_s < 0.
    space = steered(steering_range_deg=[-60.0, 60.0])
    timing = time_path(Path.from_poses([*LINE, [0.0, 0.0, 0.0]]), space)
    assert timing.profile is not None
    assert set(timing.profile.representation) == {1, -1}
    half = timing.profile.u.size // 2
    assert (timing.profile.representation[:half] == 1).all()
    assert (timing.profile.representation[half:] == -1).all()


@pytest.mark.parametrize(
    ("name", "poses", "limit"),
    [
        ("differential", [[0, 0, 0], [0, 1, 0]], "FIXED_WHEEL"),
        ("romea-4ws", [[0, 0, 0], [0, 1, 0]], "STEER_RANGE"),
        ("synchro-drive", [[0, 0, 0], [0, 0, 1]], "PARALLEL_WHEELS"),
    ],
)
def test_a_path_that_cannot_be_driven_says_where_and_why(
    space_of: SpaceOf, name: str, poses: list[list[float]], limit: str
) -> None:
    space = space_of(name)
    good = [[-1.0, 0.0, 0.0], *poses]
    timing = time_path(Path.from_poses(good, name="aside"), space)
    assert timing.status is TimingStatus.BLOCKED
    assert timing.trajectory is None
    assert timing.duration is None
    assert timing.fault is not None
    assert timing.fault.limit == limit
    assert timing.fault.u == pytest.approx(1.0, abs=1e-6)
    assert timing.fault.pose == pytest.approx((0, 0, 0), abs=1e-6)
    for part in ("aside", name, limit, "1.00 m along"):
        assert part in timing.message
    with pytest.raises(NotDrivable, match=limit):
        fastest(Path.from_poses(good), space)


def test_a_centre_of_rotation_on_a_wheel_blocks() -> None:
    turn = [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 2.0]]
    path = Path.from_poses(turn, reference_point=(0.3, 0.2))
    timing = time_path(path, steered())
    assert timing.status is TimingStatus.BLOCKED
    assert timing.fault is not None
    assert timing.fault.wheel == "w0"
    assert timing.fault.limit == "SINGULAR"


def test_no_way_between_two_pieces_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    space = steered(max_steering_rate_deg=90.0)
    path = Path.from_poses([*LINE, [4.0, 4.0, 0.0]])

    def closed(_: Changer, start: Configuration, goal: Configuration) -> Change:
        return Change(start, goal, 0, 1.0, (Way(math.inf, ()),))

    monkeypatch.setattr(Changer, "change", closed)
    timing = time_path(path, space)
    assert timing.status is TimingStatus.NO_WAY
    assert timing.fault is not None
    assert timing.fault.limit == "RECONFIGURATION"
    assert timing.fault.u == pytest.approx(4.0)
    assert timing.fault.pose == pytest.approx((4.0, 0.0, 0.0))


def test_times_of_a_trajectory_are_dropped() -> None:
    space = mecanum(max_speed=1.0, max_acceleration=1.0, max_deceleration=1.0)
    t = [0.0, 100.0, 130.0, 131.0]
    poses = [*LINE, LINE[-1], [8.0, 0.0, 0.0]]
    slow = Trajectory.from_poses(t, poses, reference_point=(0.1, 0.0))
    quick = assert_timed(slow, space, 10.0)  # it still stops where it stood
    assert quick.reference_point == (0.1, 0.0)


def test_what_cannot_be_timed_is_an_error() -> None:
    space = mecanum(max_speed=1.0)
    twists = Trajectory.from_twists([0, 1], [[1, 0, 0], [1, 0, 0]])
    with pytest.raises(InvalidTrajectory, match="twists"):
        time_path(twists, space)
    with pytest.raises(InvalidTrajectory, match="moves"):
        time_path(Trajectory.from_poses([0, 1], [[0, 0, 0], [0, 0, 0]]), space)
    with pytest.raises(InvalidInput, match="grid"):
        time_path(Path.from_poses(LINE), space, grid=1)
    assert time_paths([], space) == ()


def test_a_data_sheet_alone_is_refused(tmp_path: Any) -> None:
    sheet = tmp_path / "m.safetensors"
    mecanum(max_speed=1.0).save(sheet)
    with pytest.raises(InvalidInput, match="data sheet"):
        fastest(Path.from_poses(LINE), configspace.load_space(sheet))


def test_many_paths_are_timed_as_each_of_them(space_of: SpaceOf) -> None:
    space = space_of("ift-four-steered")
    rng = np.random.default_rng(5)
    paths = [
        Path.from_poses([[0, 0, 0], [1, y, 0.2 * y], [2, 0, 0]], name=f"p{i}")
        for i, y in enumerate(rng.uniform(-0.5, 0.5, 4))
    ]
    paths.append(Path.from_poses([*LINE, [4.0, 1.0, 0.0]], name="corner"))
    together = time_paths(paths, space, grid=120, steps=100)
    assert [timing.path for timing in together] == [path.name for path in paths]
    for path, timing in zip(paths, together, strict=True):
        alone = time_path(path, space, grid=120, steps=100)
        assert alone.profile is not None
        assert timing.profile is not None
        np.testing.assert_array_equal(alone.profile.t, timing.profile.t)
        assert alone.duration == timing.duration


def test_without_limits_on_acceleration_speed_alone_counts() -> None:
    # What a start takes is then a matter of how finely the path is sampled.
    assert_timed(Path.from_poses(LINE), mecanum(max_speed=1.0), 4.0)


def test_profiles_tell_the_limit_and_its_wheel(space_of: SpaceOf) -> None:
    timing = time_path(Path.from_poses(circle(1.0, 0.5, 21)), space_of("mecanum"))
    profile = timing.profile
    assert profile is not None
    assert profile.u.size == len(profile.limit) == len(profile.wheel)
    assert set(profile.limit) == {"WHEEL_ACCELERATION", "WHEEL_SPEED"}
    assert set(profile.wheel) <= {
        "front-left",
        "front-right",
        "rear-left",
        "rear-right",
    }
    assert (np.diff(profile.t) > 0).all()
    assert not profile.u.flags.writeable


@pytest.mark.parametrize(
    ("seed", "kind", "loss"),
    [
        (2, "loaded", 5e-3),  # motors shared by driving and steering, beside the axis
        (22, "turntable", 5e-3),
        (11, "offset", 3e-2),  # limits on the steering acceleration
    ],
)
def test_trajectories_are_hardly_slower_than_the_optimum(
    seed: int, kind: VehicleKind, loss: float
) -> None:
    rng = np.random.default_rng(seed)
    vehicle = demanding_vehicle(rng, kind)
    space = configspace.build_space(vehicle, configspace.Grid(40, 72), cache=False)
    timing = time_path(smooth_path(rng), space)
    assert timing.trajectory is not None, timing.message
    assert timing.profile is not None
    assert validate(timing.trajectory, space).valid
    assert timing.trajectory.duration < timing.profile.duration * (1 + loss)
