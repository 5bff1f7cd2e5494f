"""Routes: where the vehicle must stop, and how well splines keep to the moves."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from omniplan.planning.moves import Move, goes_on
from omniplan.planning.route import Route
from omniplan.timing.path_motion import pieces_of


def test_a_stop_is_where_the_twist_jumps_and_nowhere_else() -> None:
    one = Move.along((0, 0, 0), (1, 0, 0.5))
    on = Move.along(one.goal, (2, 0, 1.0))
    straight = Move.along(on.goal, (1, 0, 0))
    back = straight.reversed()
    turn = Move.straight(back.goal, (*back.goal[:2], back.goal[2] + 1))
    moves = [one, on, straight, back, turn]
    joints = [goes_on(a, b) for a, b in itertools.pairwise(moves)]
    assert joints == [True, False, False, False]
    route = Route.from_moves(moves)
    at = [route.poses[row] for row in route.stops]
    expected = [on.goal, straight.goal, back.goal]
    np.testing.assert_allclose(at, expected, atol=1e-12)
    path = route.to_path("p", (0.0, 0.0))
    assert len(pieces_of(path)) == 4


def test_a_straight_move_goes_on_where_beta_has_turned_to() -> None:
    whole = Move.straight((0, 0, 0), (2, 1, 1.2))
    assert goes_on(whole.part(0.0, 0.4), whole.part(0.4, 1.0))
    route = Route.from_moves([whole.part(0.0, 0.4), whole.part(0.4, 1.0)])
    assert route.stops == ()


def test_headings_go_on_although_moves_are_wound_differently() -> None:
    one = Move.straight((0, 0, 3.0), (1, 0, 3.0))
    other = Move.straight((1, 0, 3.0 - 2 * math.pi), (2, 0, 2.5 - 2 * math.pi))
    route = Route.from_moves([one, other])
    assert route.poses[-1, 2] == pytest.approx(2.5)
    assert np.abs(np.diff(route.poses[:, 2])).max() < 1


@pytest.mark.parametrize("twist", [(1.5, 0, 1.5), (0.3, 0.2, -2.0), (4.0, 0, 0.2)])
def test_splines_through_arcs_keep_curvature_and_direction(
    twist: tuple[float, float, float],
) -> None:
    move = Move.along((3, -2, 0.7), twist)
    (piece,) = pieces_of(Route.from_moves([move]).to_path("p", (0.0, 0.0)))
    u = np.linspace(piece.u[0], piece.u[-1], 4001)
    poses = piece.poses_at(u)
    step = np.diff(poses, axis=0)
    middle = (poses[1:, 2] + poses[:-1, 2]) / 2
    v = (step[:, 0] + 1j * step[:, 1]) * np.exp(-1j * middle)
    beta = np.angle(v * np.exp(-1j * move.beta_0))
    assert np.abs(beta).max() < 1e-4
    np.testing.assert_allclose(
        step[:, 2] / np.abs(v), twist[2] / move.length, rtol=1e-3
    )


def test_splines_through_straight_moves_are_exact() -> None:
    move = Move.straight((3, -2, 0.7), (5, 1, -2.0))
    (piece,) = pieces_of(Route.from_moves([move]).to_path("p", (0.0, 0.0)))
    f = np.linspace(0, 1, 1001)
    poses = piece.poses_at(f * piece.u[-1])
    np.testing.assert_allclose(poses, move.poses(f), atol=1e-12)


@pytest.mark.parametrize("way", [2e-5, 1e-4, 1e-3])
def test_small_moves_have_few_poses_that_still_move(way: float) -> None:
    route = Route.from_moves([Move.along((0, 0, 0), (way, 0, way))])
    assert len(route.to_path("p", (0.0, 0.0)).poses) >= 2
