"""Moves against the integration of their twists."""

from __future__ import annotations

import math

import hypothesis.strategies as st
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given

from configspace import from_twist
from omniplan.planning.moves import Move

FloatArray = npt.NDArray[np.float64]
Pose = tuple[float, float, float]

POSES = st.tuples(*(st.floats(-5, 5),) * 2, st.floats(-math.pi, math.pi))
TURNS = st.floats(-6, 6)
U = np.linspace(0, 1, 2001)


def twists_along(move: Move) -> FloatArray:
    """Return body twists between the poses, by differences, (n, 3)."""
    poses = move.poses(U)
    step = np.diff(poses, axis=0) / np.diff(U)[:, None]
    middle = (poses[1:, 2] + poses[:-1, 2]) / 2
    v = (step[:, 0] + 1j * step[:, 1]) * np.exp(-1j * middle)
    return np.stack([v.real, v.imag, step[:, 2]], axis=-1)


def assert_ends(move: Move, start: Pose, goal: Pose) -> None:
    ends = move.poses(np.array([0.0, 1.0]))
    np.testing.assert_allclose(ends[0], start, atol=1e-9)
    np.testing.assert_allclose(ends[1], move.goal, atol=1e-9)
    np.testing.assert_allclose(ends[1][:2], np.asarray(goal)[:2], atol=1e-9)
    full = (ends[1][2] - np.asarray(goal)[2]) / (2 * math.pi)
    assert full == pytest.approx(round(full), abs=1e-9)


@given(POSES, POSES)
def test_straight_moves_keep_kappa_n_and_turn_beta(start: Pose, goal: Pose) -> None:
    move = Move.straight(start, goal)
    assert_ends(move, start, goal)
    assert abs(move.turn) <= math.pi + 1e-12
    if move.length < 1e-3:
        return
    kappa_n, beta, v_s = from_twist(twists_along(move), kappa_g=2.0)
    np.testing.assert_allclose(kappa_n, move.kappa_n(2.0), atol=1e-6)
    expected = move.beta_0 + (U[1:] + U[:-1]) / 2 * (move.beta_1 - move.beta_0)
    np.testing.assert_allclose(np.exp(1j * beta), np.exp(1j * expected), atol=1e-6)
    np.testing.assert_allclose(v_s, max(move.length, abs(move.turn) / 2), rtol=1e-6)


@given(POSES, POSES)
def test_arcs_keep_the_twist(start: Pose, goal: Pose) -> None:
    move = Move.arc(start, goal)
    assert_ends(move, start, goal)
    if move.length < 1e-3:
        return
    twists = twists_along(move)
    e = move.length * np.exp(1j * move.beta_0)
    expected = [e.real, e.imag, move.turn]
    np.testing.assert_allclose(
        twists, np.broadcast_to(expected, twists.shape), rtol=1e-5, atol=1e-5
    )
    assert move.beta_1 == move.beta_0
    kappa_n, _, _ = from_twist(np.array(expected), kappa_g=0.7)
    assert move.kappa_n(0.7) == pytest.approx(float(kappa_n))


@given(POSES, st.tuples(*(st.floats(-3, 3),) * 2, TURNS))
def test_along_and_arc_are_the_same_motion(start: Pose, twist: Pose) -> None:
    move = Move.along(start, twist)
    # Twins: small steps of the same twist.
    pose = np.array(start, dtype=float)
    n = 4000
    for _ in range(n):
        middle = pose[2] + twist[2] / n / 2
        d = complex(twist[0], twist[1]) / n * np.exp(1j * middle)
        pose += [d.real, d.imag, twist[2] / n]
    np.testing.assert_allclose(move.goal, pose, atol=1e-5)
    again = Move.arc(move.start, move.goal, turn=move.turn)
    if abs(abs(move.turn) - 2 * math.pi) > 0.1:
        np.testing.assert_allclose(again.length, move.length, atol=1e-8)
        np.testing.assert_allclose(again.poses(U), move.poses(U), atol=1e-7)


@given(POSES, POSES, st.booleans())
def test_a_reversed_move_goes_the_same_way_back(
    start: Pose, goal: Pose, is_straight: bool
) -> None:
    move = (Move.straight if is_straight else Move.arc)(start, goal)
    back = move.reversed()
    np.testing.assert_allclose(back.poses(U), move.poses(1 - U), atol=1e-8)
    assert back.kappa_n(2.0) == pytest.approx(-move.kappa_n(2.0))
    if move.length > 1e-9:
        e0, e1 = np.exp(1j * move.beta_1), np.exp(1j * back.beta_0)
        assert e1 == pytest.approx(-e0)


@given(POSES, POSES, st.booleans(), st.floats(0, 0.6), st.floats(0.1, 0.4))
def test_parts_lie_on_the_move(
    start: Pose, goal: Pose, is_straight: bool, u: float, share: float
) -> None:
    move = (Move.straight if is_straight else Move.arc)(start, goal)
    part = move.part(u, u + share)
    np.testing.assert_allclose(part.poses(U), move.poses(u + share * U), atol=1e-8)
    assert part.kappa_n(2.0) == pytest.approx(move.kappa_n(2.0))
    if move.length > 1e-6:
        turn = np.exp(1j * (part.beta_1 - part.beta_0))
        assert turn == pytest.approx(np.exp(1j * share * (move.beta_1 - move.beta_0)))


def test_a_turn_on_the_spot_has_kappa_n_two_and_no_beta() -> None:
    for make in (Move.straight, Move.arc):
        move = make([1, 2, 0.5], [1, 2, -0.5])
        assert (move.length, move.beta_0, move.kappa_n(3.0)) == (0.0, 0.0, -2.0)
        assert move.turn == pytest.approx(-1.0)


def test_full_turns_and_whole_circles() -> None:
    wound = Move.straight([0, 0, 0], [1, 0, 0], turn=2 * math.pi)
    assert wound.beta_1 == pytest.approx(-2 * math.pi)
    circle = Move.along([0, 0, 0], [2 * math.pi, 0, 2 * math.pi])
    np.testing.assert_allclose(circle.goal, [0, 0, 2 * math.pi], atol=1e-12)
    np.testing.assert_allclose(circle.poses([0.25])[0][:2], [1, 1], atol=1e-12)


def test_moves_are_read_only() -> None:
    move = Move.straight([0, 0, 0], [1, 0, 0])
    with pytest.raises(ValueError, match="read-only"):
        move.goal[0] = 3.0
