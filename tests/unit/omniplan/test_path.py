import math
import re
from typing import Any

import numpy as np
import pytest

import configspace
import omniplan
from omniplan import InvalidTrajectory, Trajectory
from omniplan.path import Path

LINE = [[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0]]


def test_a_path_holds_poses_caps_and_stops_read_only() -> None:
    poses = np.array(LINE)
    path = Path.from_poses(
        poses, name="a", reference_point=(0.1, 0.2), max_speed=[1, np.inf], stops=[1]
    )
    assert (path.poses == poses).all()
    assert path.reference_point == (0.1, 0.2)
    assert path.max_speed is not None
    assert path.max_speed.tolist() == [1, math.inf]
    assert path.max_yaw_rate is None
    assert path.stops.tolist() == [False, True, False]
    assert path.length == 2.0
    poses[0] = 7
    assert path.poses[0, 0] == 0
    for array in (path.poses, path.max_speed, path.stops):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_one_cap_is_that_of_all_pieces_and_none_is_none() -> None:
    capped = Path.from_poses(LINE, max_speed=0.5, max_yaw_rate=[0.1, 0.2])
    assert capped.max_speed is not None
    assert capped.max_yaw_rate is not None
    assert capped.max_speed.tolist() == [0.5, 0.5]
    assert capped.max_yaw_rate.tolist() == [0.1, 0.2]
    assert Path.from_poses(LINE, max_speed=math.inf).max_speed is None


def test_poses_without_times_are_a_path() -> None:
    path = Trajectory.from_poses(None, LINE, name="a", reference_point=(0.5, 0.0))
    assert isinstance(path, Path)
    assert (path.name, path.reference_point) == ("a", (0.5, 0.0))


def test_headings_are_unwrapped() -> None:
    theta = np.linspace(2.5, 16.0, 28)
    poses = np.stack([theta, theta, np.arctan2(np.sin(theta), np.cos(theta))], axis=-1)
    assert Path.from_poses(poses).poses[:, 2] == pytest.approx(theta, abs=1e-12)


def test_the_parameter_counts_way_and_turn() -> None:
    path = Path.from_poses([[0, 0, 0], [3, 4, 0], [3, 4, 1], [3, 5, 1]])
    assert path.parameter.tolist() == [0, 5, 5.5, 6.5]


@pytest.mark.parametrize(
    ("poses", "message"),
    [
        ([[0, 0, 0]], "at least two rows"),
        ([], "shape (n, 3)"),
        ([[0, 0], [1, 1]], "shape (n, 3)"),
        ([[0, 0, 0], [0, 0]], "different lengths"),
        ([[0, 0, 0], [math.nan, 0, 0]], "row 1, x: nan; must be finite"),
        ([[0, 0, 0], [0, math.inf, 0]], "row 1, y: inf; must be finite"),
        ([[0, 0, 0], [1, 0, 2e6]], "row 1, theta: 2000000.0; must be finite"),
        ([[0, 0, 0], [1, "a", 0]], "row 0, x"),
        ([[0, 0, 0], [1, 0, 2]], "row 1, theta: the heading turns by 114.6°"),
        ([*LINE, LINE[-1]], "row 3, x, y, theta: the same pose (2, 0, 0) as in row 2"),
        ([[0, 0, 0], [1e-8, 0, 0]], "row 1, x, y, theta: the same pose"),
        (None, "must be a number"),
    ],
)
def test_wrong_poses_are_refused_with_the_row(poses: Any, message: str) -> None:
    with pytest.raises(InvalidTrajectory, match=re.escape(message)):
        Path.from_poses(poses)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"max_speed": [1, 0]}, "row 1, max_speed: 0; must be positive"),
        ({"max_speed": math.nan}, "row 0, max_speed: nan"),
        ({"max_speed": -1}, "must be positive"),
        ({"max_speed": [1, 2, 3]}, "one number, or 2"),
        ({"max_yaw_rate": "fast"}, "must be a number"),
        ({"stops": [3]}, "each from 0 to 2"),
        ({"stops": [-1]}, "each from 0 to 2"),
        ({"stops": [0.5]}, "each from 0 to 2"),
        ({"stops": 1}, "a list of rows"),
        ({"stops": [math.nan]}, "a list of rows"),
        ({"name": ""}, "name"),
        ({"name": "a\nb"}, "printable"),
        ({"reference_point": (0, math.nan)}, "reference_point"),
    ],
)
def test_wrong_options_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidTrajectory, match=message):
        Path.from_poses(LINE, **options)


def test_a_path_cannot_be_judged_without_times() -> None:
    vehicle = configspace.load_vehicle("mecanum")
    space = configspace.build_space(vehicle, cache=False)
    path = Path.from_poses(LINE, name="aisle")
    with pytest.raises(InvalidTrajectory, match=r"aisle: a path.*fastest"):
        omniplan.validate(path, space)
