"""Paths whose third derivatives change gradually."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from timing_cases import smooth_path

from omniplan.timing.path_motion import PathPiece, pieces_of
from omniplan.timing.rounding import STAIRS, rounded

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

FEW, MANY = (np.full(4, count) for count in STAIRS)
MIXED = np.array([0, *STAIRS, 0])


def some_piece(seed: int) -> PathPiece:
    (piece,) = pieces_of(smooth_path(np.random.default_rng(seed)))
    return piece


def derivatives(cubics: FloatArray, h: FloatArray) -> FloatArray:
    """Value and two derivatives at h, (3, n)."""
    a, b, c, d = cubics
    return np.stack(
        [((a * h + b) * h + c) * h + d, (3 * a * h + 2 * b) * h + c, 6 * a * h + 2 * b]
    )


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("stairs", [FEW, MANY, MIXED])
def test_the_path_stays_twice_differentiable(seed: int, stairs: IntArray) -> None:
    piece = rounded(some_piece(seed), np.full(4, 0.03), stairs)
    span = np.diff(piece.u)
    assert (span > 0).all()
    for cubics in (piece.position.real, piece.position.imag, piece.heading):
        ends = derivatives(cubics, span)[:, :-1]
        starts = derivatives(cubics, np.zeros_like(span))[:, 1:]
        np.testing.assert_allclose(ends, starts, atol=1e-11)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("stairs", [FEW, MANY])
def test_outside_the_windows_it_is_the_same_and_inside_nearly(
    seed: int, stairs: IntArray
) -> None:
    before, reach = some_piece(seed), 0.05
    after = rounded(before, np.full(4, reach), stairs)
    u = np.linspace(before.u[0], before.u[-1], 20001)
    gap = np.abs(after.poses_at(u) - before.poses_at(u))
    near = np.abs(u[:, None] - before.u[1:-1]).min(axis=1) < reach
    assert gap[~near].max() < 1e-13
    jumps = [6 * np.abs(np.diff(c[0])).max() for c in (before.position, before.heading)]
    assert 0 < gap[near][:, :2].max() < reach**3 * jumps[0] / 100
    assert 0 < gap[near][:, 2].max() < reach**3 * jumps[1] / 100


def test_no_jump_is_left_that_counts() -> None:
    before = some_piece(3)
    after = rounded(before, np.full(4, 0.03), MANY)
    assert after.u.size == before.u.size + 4 * (STAIRS[-1] + 1) - 4
    jumps = [np.abs(np.diff(piece.position[0])).max() for piece in (before, after)]
    assert jumps[1] < 0.08 * jumps[0]
    assert np.abs(after.position[0]).max() < np.abs(before.position[0]).max() * 1.2


def test_caps_stay_where_they_are_and_near_knots_share_their_span() -> None:
    before = some_piece(4)
    capped = PathPiece(
        before.u,
        before.position,
        before.heading,
        before.point,
        np.arange(1.0, 6.0),
        np.arange(11.0, 16.0),
    )
    after = rounded(capped, np.full(4, 10.0), MIXED)
    middles = (after.u[1:] + after.u[:-1]) / 2
    span = np.searchsorted(before.u, middles) - 1
    np.testing.assert_array_equal(after.max_speed, span + 1.0)
    np.testing.assert_array_equal(after.max_yaw_rate, span + 11.0)


def test_knots_may_be_left_as_they_are() -> None:
    before = some_piece(1)
    assert rounded(before, np.full(4, 0.03), np.zeros(4, np.int64)) is before
    after = rounded(before, np.full(4, 0.03), MIXED)
    assert np.isin(before.u[[1, 4]], after.u).all()
    near = (after.u > before.u[1] - 0.03) & (after.u < before.u[1] + 0.03)
    assert near.sum() == 1
    assert after.u.size == before.u.size + sum(STAIRS)


def test_without_inner_knots_there_is_nothing_to_do() -> None:
    piece = some_piece(0)
    straight = PathPiece(
        piece.u[:2],
        piece.position[:, :1],
        piece.heading[:, :1],
        0j,
        piece.max_speed[:1],
        piece.max_yaw_rate[:1],
    )
    assert rounded(straight, np.zeros(0), np.zeros(0, np.int64)) is straight
