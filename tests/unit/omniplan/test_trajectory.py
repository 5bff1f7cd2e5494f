import json
import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import configspace
from configspace import InvalidVehicle, Vehicle
from omniplan import InvalidTrajectory, Trajectory

BUILDERS = pytest.mark.parametrize(
    "build", [Trajectory.from_poses, Trajectory.from_twists]
)
Build = Callable[..., Trajectory]


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    return configspace.load_vehicle("ift-four-steered")


def line(n: int) -> list[list[float]]:
    return [[0.1 * i, 0.0, 0.0] for i in range(n)]


@BUILDERS
@pytest.mark.parametrize(
    ("t", "row"), [([0, 2, 1], 2), ([0, 1, 1], 2), ([0, 0, 1], 1), ([3, 2, 1], 1)]
)
def test_times_that_do_not_increase_are_refused_with_the_row(
    build: Build, t: list[float], row: int
) -> None:
    with pytest.raises(InvalidTrajectory, match=rf"row {row}, t: .* must increase"):
        build(t, line(3))


@BUILDERS
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize(("row", "column"), [(0, 0), (2, 1), (1, 2)])
def test_values_that_are_not_finite_are_refused_with_row_and_column(
    build: Build, bad: float, row: int, column: int
) -> None:
    samples = line(3)
    samples[row][column] = bad
    names = (("x", "y", "theta"), ("vx", "vy", "omega"))
    name = names[build == Trajectory.from_twists][column]
    with pytest.raises(InvalidTrajectory, match=rf"row {row}, {name}: .*finite"):
        build([0, 1, 2], samples)


@BUILDERS
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_time_that_is_not_finite_is_refused_with_the_row(
    build: Build, bad: float
) -> None:
    with pytest.raises(InvalidTrajectory, match=r"row 1, t: .*finite"):
        build([0, bad, 2], line(3))


@BUILDERS
def test_one_sample_is_not_a_trajectory(build: Build) -> None:
    with pytest.raises(InvalidTrajectory, match="at least two"):
        build([0], line(1))


@BUILDERS
@pytest.mark.parametrize(
    ("t", "samples"),
    [
        ([0, 1], line(3)),
        ([0, 1], [[0, 0], [1, 0]]),
        ([[0, 1]], line(2)),
        ([], []),
        (0.0, line(2)),
        ([0, 1], [0, 1]),
    ],
)
def test_wrong_shapes_are_refused(build: Build, t: Any, samples: Any) -> None:
    with pytest.raises(InvalidTrajectory, match=r"shape|at least two"):
        build(t, samples)


@BUILDERS
@pytest.mark.parametrize(
    ("t", "samples"),
    [
        (["a", "b"], line(2)),
        ([0, 1], [["x", 0, 0], [0, 0, 0]]),
        ([0, 1], [[0, 0, 0], [0, 0]]),
        ([0, 1], None),
        ([0, 1], {"x": 1}),
        ([0, 1j], line(2)),
    ],
)
def test_what_is_not_a_number_is_refused(build: Build, t: Any, samples: Any) -> None:
    with pytest.raises(InvalidTrajectory):
        build(t, samples)


@BUILDERS
@pytest.mark.parametrize(
    "point", [(math.nan, 0.0), (0.0, math.inf), (1.0,), (0.0, 0.0, 0.0), "ab", None]
)
def test_a_reference_point_that_is_none_is_refused(build: Build, point: Any) -> None:
    with pytest.raises(InvalidTrajectory, match="reference_point"):
        build([0, 1], line(2), reference_point=point)


def test_a_jump_of_the_heading_is_refused_with_the_row() -> None:
    poses = [[0.0, 0, 0], [0.0, 0, 1.0], [0.0, 0, 2.7], [0.0, 0, 3.0]]
    with pytest.raises(InvalidTrajectory, match=r"row 2, theta: .*97\.4°.*row 1"):
        Trajectory.from_poses([0, 1, 2, 3], poses)


def test_a_quarter_turn_per_row_is_clear() -> None:
    poses = [[0, 0, i * math.pi / 2] for i in range(9)]
    trajectory = Trajectory.from_poses(range(9), poses)
    assert trajectory.samples[-1, 2] == pytest.approx(4 * math.pi)


@pytest.mark.parametrize("direction", [1, -1])
def test_wrapped_headings_are_unwrapped_across_half_a_turn(direction: int) -> None:
    theta = direction * np.linspace(2.5, 16.0, 28)
    wrapped = np.arctan2(np.sin(theta), np.cos(theta))
    poses = np.stack([0 * theta, 0 * theta, wrapped], axis=-1)
    samples = Trajectory.from_poses(np.arange(28.0), poses).samples
    assert samples[:, 2] == pytest.approx(theta, abs=1e-12)


def test_stored_arrays_are_read_only_and_inputs_stay(vehicle: Vehicle) -> None:
    t, samples = np.array([0.0, 1.0]), np.array([[0.0, 0, 3.0], [1.0, 0, -3.0]])
    before = samples.copy()
    built = [
        Trajectory.from_poses(t, samples),
        Trajectory.from_twists(t, samples),
        Trajectory.from_omni_curve(t, t, t + 6.0, t, vehicle),
    ]
    built += [b.scaled(0.5) for b in built] + [built[0].with_dwell(0, 1.0)]
    for trajectory in built:
        for array in (trajectory.t, trajectory.samples):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 1.0
    assert (samples == before).all()
    assert (t == [0, 1]).all()
    t[0] = -5.0
    assert built[0].t[0] == 0.0


@pytest.mark.parametrize("bad", [2.0001, -3.0])
def test_a_curvature_out_of_range_is_refused(vehicle: Vehicle, bad: float) -> None:
    with pytest.raises(InvalidTrajectory, match=r"row 1, kappa_n: .*\[-2, 2\]"):
        Trajectory.from_omni_curve([0, 1, 2], [0, bad, bad], [0] * 3, [1] * 3, vehicle)


@pytest.mark.parametrize("bad", [1.0001, -1.5])
def test_a_share_of_v_max_out_of_range_is_refused(vehicle: Vehicle, bad: float) -> None:
    with pytest.raises(InvalidTrajectory, match=r"row 2, v_n: .*\[-1, 1\]"):
        Trajectory.from_omni_curve([0, 1, 2], [0] * 3, [0] * 3, [1, 0, bad], vehicle)


def test_half_a_turn_of_beta_is_refused_with_the_row(vehicle: Vehicle) -> None:
    with pytest.raises(InvalidTrajectory, match=r"row 2, beta: .*half a turn"):
        Trajectory.from_omni_curve(
            [0, 1, 2], [0] * 3, [0, 1, 1 + math.pi], [1] * 3, vehicle
        )


def test_beta_is_joined_the_shorter_way_round(vehicle: Vehicle) -> None:
    trajectory = Trajectory.from_omni_curve(
        [0, 1, 2], [0] * 3, [3.0, -3.0, 3.0], [1] * 3, vehicle
    )
    assert trajectory.samples[:, 1] == pytest.approx([3, 2 * math.pi - 3, 3])


def test_wrong_shapes_of_omni_curve_columns_are_refused(vehicle: Vehicle) -> None:
    with pytest.raises(InvalidTrajectory):
        Trajectory.from_omni_curve([0.0, 1], [0.0, 0, 0], [0.0, 0], [1.0, 1], vehicle)
    text: Any = [0, "a"]
    with pytest.raises(InvalidTrajectory):
        Trajectory.from_omni_curve([0, 1], text, [0.0, 0], [1.0, 1], vehicle)


def test_driving_faster_takes_less_time(vehicle: Vehicle) -> None:
    poses = Trajectory.from_poses([1.0, 2, 4], line(3)).scaled(2)
    assert poses.t == pytest.approx([1, 1.5, 2.5])
    assert poses.samples == pytest.approx(np.array(line(3)))
    twists = Trajectory.from_twists([1, 2, 4], line(3)).scaled(2)
    assert twists.samples == pytest.approx(2 * np.array(line(3)))
    own = Trajectory.from_omni_curve([0, 1], [0, 0], [0, 0], [0.2, 0.4], vehicle)
    assert own.scaled(2).samples[:, 2] == pytest.approx([0.4, 0.8])
    assert own.scaled(2).vehicle == vehicle
    with pytest.raises(InvalidTrajectory, match="v_n"):
        own.scaled(3)


@pytest.mark.parametrize("factor", [0.0, -1.0, math.nan, math.inf])
def test_a_factor_that_is_not_positive_is_refused(factor: float) -> None:
    with pytest.raises(InvalidTrajectory, match="positive"):
        Trajectory.from_poses([0, 1], line(2)).scaled(factor)


def test_a_dwell_repeats_a_pose_and_delays_the_rest() -> None:
    trajectory = Trajectory.from_poses([0, 1, 2], line(3)).with_dwell(1, 0.5)
    assert trajectory.t == pytest.approx([0, 1, 1.5, 2.5])
    assert trajectory.samples[:, 0] == pytest.approx([0, 0.1, 0.1, 0.2])
    assert trajectory.duration == 2.5


@pytest.mark.parametrize(
    ("row", "seconds"), [(-1, 1.0), (3, 1.0), (0, 0.0), (0, math.nan)]
)
def test_a_dwell_out_of_range_is_refused(row: int, seconds: float) -> None:
    with pytest.raises(InvalidTrajectory, match="standstill"):
        Trajectory.from_poses([0, 1, 2], line(3)).with_dwell(row, seconds)


def test_only_poses_can_dwell() -> None:
    with pytest.raises(InvalidTrajectory, match="twists"):
        Trajectory.from_twists([0, 1], line(2)).with_dwell(0, 1.0)


def test_plain_data_and_back(vehicle: Vehicle) -> None:
    for trajectory in (
        Trajectory.from_poses([0, 1], line(2), name="a", reference_point=(0.1, -0.2)),
        Trajectory.from_twists([0, 1], line(2)),
        Trajectory.from_omni_curve([0, 1], [0, 1], [3, -3], [0, 1], vehicle, name="c"),
    ):
        data = json.loads(json.dumps(trajectory.to_dict(), allow_nan=False))
        back = Trajectory.from_dict(data)
        assert back.to_dict() == trajectory.to_dict()
        assert (back.t == trajectory.t).all()
        assert (back.samples == trajectory.samples).all()
        assert back.vehicle == trajectory.vehicle


GOOD: dict[str, Any] = {"name": "a", "t": [0, 1], "poses": [[0, 0, 0], [1, 0, 0]]}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"speed": 1}, "unknown key speed"),
        ({"twists": [[0, 0, 0], [0, 0, 0]]}, "exactly one of"),
        ({"poses": ...}, "exactly one of"),
        ({"t": ...}, "t and exactly one"),
        ({"name": ""}, "1 to 200 characters"),
        ({"name": 5}, "1 to 200 characters"),
        ({"name": "x" * 201}, "1 to 200 characters"),
        ({"name": None}, "1 to 200 characters"),
        ({"t": [0, math.nan]}, "row 1, t"),
        ({"poses": [[0, 0, 0], [0, math.nan, 0]]}, "row 1, y"),
        ({"t": None}, "a"),
        ({"t": {"a": 1}}, "a"),
        ({"poses": "abc"}, "a"),
        ({"reference_point": [0, math.nan]}, "reference_point"),
        ({"reference_point": [0]}, "reference_point"),
        ({"reference_point": 7}, "reference_point"),
        ({"reference_point": ["0", "a"]}, "reference_point"),
    ],
)
def test_plain_data_with_a_mistake_is_refused(
    change: dict[str, Any], message: str
) -> None:
    data = {k: v for k, v in {**GOOD, **change}.items() if v is not ...}
    with pytest.raises(InvalidTrajectory, match=re.escape(message)):
        Trajectory.from_dict(data)


@pytest.mark.parametrize("data", [None, 3, "poses", [GOOD], {1: 2}, {}])
def test_plain_data_that_is_no_trajectory_is_refused(data: Any) -> None:
    with pytest.raises(InvalidTrajectory):
        Trajectory.from_dict(data)


@pytest.mark.parametrize("vehicle_data", [None, {}, "ift-four-steered", {"name": "a"}])
def test_omni_curve_data_needs_a_whole_vehicle(vehicle_data: Any) -> None:
    data = {"t": [0, 1], "omni_curve": [[0, 0, 0], [0, 0, 0]], "vehicle": vehicle_data}
    with pytest.raises(InvalidVehicle):
        Trajectory.from_dict(data)


@pytest.mark.parametrize("t", [[0, 1, 2], None])
def test_headings_in_degrees_are_refused(t: list[float] | None) -> None:
    poses = [[0, 0, 0], [1, 0, 45], [2, 0, 90]]
    with pytest.raises(InvalidTrajectory, match="row 1, theta: 45 after 0; radians"):
        Trajectory.from_poses(t, poses)
