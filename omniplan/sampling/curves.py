"""The arcs of a Dubins or Reeds–Shepp curve, found by asking for its poses.

OMPL's bindings tell the length of a curve and the pose at any share of it, but not its
segments. Between two of its poses a curve is one segment if the straight line or an arc
of the least radius, forwards or backwards, leads from one over the middle to the other;
where none does, the part is halved.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

from omniplan.planning.moves import Move

__all__ = ["along_curves", "arcs_of"]

Pose: TypeAlias = tuple[float, float, float]
_Kind: TypeAlias = tuple[float, float]
"""1 forwards or -1 backwards; 1 to the left, -1 to the right, 0 straight."""
_Segment: TypeAlias = tuple[_Kind | None, float]
"""A kind, None for a rest of no kind, and the way, m."""

_SAME = 1e-7
"""Poses that agree to this, m or rad, are the same: rounding."""
_REST = 1e-6
"""Parts up to this length, m, are not halved: the two ends of a segment meet there."""
_WIDEST = 0.5 * math.pi
"""Largest turn of a part, rad: beyond it other curves might lead over its middle."""


def arcs_of(
    pose_at: Callable[[float], Pose], length: float, radius: float
) -> list[Move]:
    """Return the moves that a curve consists of, each an arc or a line.

    Parameters
    ----------
    pose_at : callable
        The pose (x, y, θ), m, m, rad, at a share of the curve from 0 to 1.
    length : float, m, ≥ 0
        Length of the curve.
    radius : float, m, > 0
        Radius of its arcs.

    Returns
    -------
    moves : list of Move
        In order, each begins where the one before ends; they differ from the curve by
        about 1e-6 m per segment.
    """
    if length <= _REST:
        return [Move.arc(pose_at(0.0), pose_at(1.0))]
    parts = max(1, math.ceil(length / (_WIDEST * radius)))
    places = [(i / parts, pose_at(i / parts)) for i in range(parts + 1)]
    segments: list[_Segment] = []
    for first, last in itertools.pairwise(places):
        segments += _cut(pose_at, first, last, length, radius)
    moves: list[Move] = []
    at = places[0][1]
    for (direction, side), way in _merged(segments):
        turn = direction * side * way / radius
        moves.append(Move.along(at, (direction * way, 0.0, turn)))
        x, y, theta = moves[-1].goal.tolist()
        at = (x, y, theta)
    return moves


def _cut(
    pose_at: Callable[[float], Pose],
    first: tuple[float, Pose],
    last: tuple[float, Pose],
    length: float,
    radius: float,
) -> list[_Segment]:
    """Return the segments between two places of the curve."""
    way = (last[0] - first[0]) * length
    if way <= _REST:
        return [(None, way)]
    middle = 0.5 * (first[0] + last[0])
    between = pose_at(middle)
    kind = _kind(first[1], between, last[1], way, radius)
    if kind is not None:
        return [(kind, way)]
    halves = ((first, (middle, between)), ((middle, between), last))
    return [
        segment
        for start, end in halves
        for segment in _cut(pose_at, start, end, length, radius)
    ]


def _merged(segments: list[_Segment]) -> list[tuple[_Kind, float]]:
    """Return segments without neighbours of one kind and without rests."""
    known = [kind for kind, _ in segments if kind is not None]
    out: list[tuple[_Kind, float]] = []
    here = known[0] if known else (1.0, 0.0)
    for kind, way in segments:
        if kind is not None:
            here = kind
        if out and out[-1][0] == here:
            out[-1] = (here, out[-1][1] + way)
        else:
            out.append((here, way))
    return out


def _kind(
    start: Pose, between: Pose, goal: Pose, way: float, radius: float
) -> _Kind | None:
    """Return of which kind one segment from pose over pose to pose is, if it is one."""
    for direction in (1.0, -1.0):
        for side in (0.0, 1.0, -1.0):
            turn = direction * side * way / radius
            first = Move.along(start, (direction * 0.5 * way, 0.0, 0.5 * turn))
            if not _is_same(first.goal.tolist(), between):
                continue
            whole = Move.along(start, (direction * way, 0.0, turn))
            if _is_same(whole.goal.tolist(), goal):
                return direction, side
    return None


def _is_same(a: list[float], b: Pose) -> bool:
    return (
        abs(a[0] - b[0]) <= _SAME
        and abs(a[1] - b[1]) <= _SAME
        and abs(math.remainder(a[2] - b[2], 2 * math.pi)) <= _SAME
    )


def along_curves(
    state_space: Any, checker: Any, radius: float
) -> Callable[[Any, Any], bool]:
    """Return the check of curves for collisions and bounds, segment by segment.

    Parameters
    ----------
    state_space : OMPL state space
        Dubins' or Reeds and Shepp's.
    checker : Collisions
    radius : float, m
        Of the curves.
    """

    def check(first: Any, second: Any) -> bool:
        between = state_space.allocState()

        def pose_at(share: float) -> Pose:
            state_space.interpolate(first, second, share, between)
            return between.getX(), between.getY(), between.getYaw()

        length = state_space.distance(first, second)
        moves = arcs_of(pose_at, length, radius)
        return all(checker.is_motion_free(move) for move in moves) and all(
            _is_within(state_space, move) for move in moves
        )

    return check


def _is_within(state_space: Any, move: Move) -> bool:
    """Return whether K stays within the bounds of a state space on a move."""
    bounds = state_space.getBounds()
    low, high = bounds.low, bounds.high
    u = [0.0, 1.0]
    if move.turn:
        # The way is farthest out where it runs along an axis.
        course = move.start[2] + move.beta_0
        quarters = np.arange(-4, 5) * (np.pi / 2)
        first = np.round(course / (np.pi / 2)) * (np.pi / 2)
        shares = (first + quarters - course) / move.turn
        u += shares[(shares > 0) & (shares < 1)].tolist()
    places = move.poses(np.array(u))[:, :2]
    return bool((places >= low).all() and (places <= high).all())
