"""Paths as splines between their stops."""

from __future__ import annotations

import numpy as np
import pytest

from omniplan import InvalidTrajectory, Path, Trajectory
from omniplan.timing.path_motion import PathMotion, path_of, pieces_of


def test_pieces_end_at_required_stops_cusps_and_corners() -> None:
    poses = np.array(
        [[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0], [2, 0.2, 0], [2, 0.2, 1]]
    )
    pieces = pieces_of(Path.from_poses(poses, stops=[1]))
    ends = [(float(p.u[0]), float(p.u[-1])) for p in pieces]
    expected = [(0, 1), (1, 2), (2, 3), (3, 3.8), (3.8, 4.3)]
    np.testing.assert_allclose(ends, expected)
    assert [p.length for p in pieces] == pytest.approx([1, 1, 1, 0.8, 0.5])


def test_splines_go_through_the_poses_and_are_smooth_between_them() -> None:
    rng = np.random.default_rng(0)
    x = np.arange(7.0)
    poses = np.stack([x, rng.uniform(-0.3, 0.3, 7), rng.uniform(-0.3, 0.3, 7)], axis=1)
    path = Path.from_poses(poses)
    (piece,) = pieces_of(path)
    np.testing.assert_allclose(piece.u, path.parameter)
    np.testing.assert_allclose(piece.poses_at(piece.u), poses, atol=1e-12)
    h = 1e-4
    for u in piece.u[1:-1]:
        at = piece.poses_at(u + h * np.arange(-2, 3))
        before, after = np.diff(at[:3], 2, axis=0), np.diff(at[2:], 2, axis=0)
        np.testing.assert_allclose(before / h**2, after / h**2, atol=1e-2)


def test_caps_belong_to_their_pieces() -> None:
    poses = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]]
    path = Path.from_poses(poses, stops=[1], max_speed=[1, 2, 3], max_yaw_rate=0.5)
    first, second = pieces_of(path)
    np.testing.assert_array_equal(first.max_speed, [1])
    np.testing.assert_array_equal(second.max_speed, [2, 3])
    np.testing.assert_array_equal(second.max_yaw_rate, [0.5, 0.5])


def test_the_motion_of_a_piece_passes_it_at_the_given_rate() -> None:
    poses = np.array([[0, 0, 0], [1, 0.2, 0.1], [2, 0, 0.3]])
    (piece,) = pieces_of(Path.from_poses(poses))
    motion = PathMotion(piece, 4.0)
    t = np.linspace(0, piece.length / 4, 9)
    np.testing.assert_allclose(motion.poses_at(t), piece.poses_at(4 * t), atol=1e-12)


def test_a_trajectory_loses_its_times_and_keeps_its_stops() -> None:
    t = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    x = np.array([0, 1, 1, 2, 2.0004, 3])
    poses = np.stack([x, 0 * x, 0 * x], axis=1)
    path = path_of(Trajectory.from_poses(t, poses, reference_point=(0.2, 0.1)))
    # What crowds within a millimetre is one pose.
    np.testing.assert_array_equal(path.poses[:, 0], [0, 1, 2, 3])
    np.testing.assert_array_equal(path.stops, [False, True, False, False])
    assert path.reference_point == (0.2, 0.1)


def test_poses_that_crowd_before_a_stop_give_way_to_it() -> None:
    t = [0.0, 1.0, 2.0, 3.0, 4.0]
    x = np.array([0, 0.9996, 1, 1, 2])
    poses = np.stack([x, 0 * x, 0 * x], axis=1)
    path = path_of(Trajectory.from_poses(t, poses))
    np.testing.assert_array_equal(path.poses[:, 0], [0, 1, 2])
    np.testing.assert_array_equal(path.stops, [False, True, False])


def test_only_motions_in_poses_are_paths() -> None:
    twists = Trajectory.from_twists([0, 1], [[1, 0, 0], [1, 0, 0]])
    with pytest.raises(InvalidTrajectory, match="of the form twists"):
        path_of(twists)
