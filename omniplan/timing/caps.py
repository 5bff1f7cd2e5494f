"""Caps of a path on speed and yaw rate, proved between the samples of a trajectory.

No limit of a vehicle, so `validate` does not know them. The fastest point of the body
is a corner of its footprint or the path's own point. A cap changes when the way along
the path, a cubic spline of time like the poses, passes the pose at which it does.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from omniplan.judging.body_rows import yaw_of
from omniplan.judging.chords import Chord
from omniplan.motion import Intervals, PoseMotion
from omniplan.timing.path_motion import PathPiece

__all__ = ["cap_use"]

FloatArray = npt.NDArray[np.float64]

HALVINGS = 3
"""How often what lies between two samples is halved for the bounds."""


def cap_use(
    t: FloatArray,
    u: FloatArray,
    piece: PathPiece,
    poses: FloatArray,
    footprint: Sequence[tuple[float, float]],
) -> float:
    """Return a bound on how far the caps of a piece are used, ≤ 1: they are kept.

    Parameters
    ----------
    t : (n,) float, s
    u : (n,) float, m
        Where on the path the samples are, growing.
    piece : PathPiece
    poses : (n, 3) float, m, m, rad
        The samples, from rest to rest.
    footprint : sequence of points, m
        In the frame of the vehicle's file.
    """
    if not np.isfinite([piece.max_speed, piece.max_yaw_rate]).any():
        return 0.0
    motion = PoseMotion(t, poses, piece.point)
    parts, middle = _parts(t, u, piece)
    for _ in range(HALVINGS):
        parts = parts.halved(np.ones(parts.t0.size, dtype=bool))
        middle = np.repeat(middle, 2)
    span = np.clip(np.searchsorted(piece.u, middle) - 1, 0, piece.u.size - 2)
    part = motion.enclose(parts)
    points = [piece.point, *(complex(x, y) for x, y in footprint)]
    fastest = np.max([Chord.of(part, point).far for point in points], axis=0)
    uses = fastest / piece.max_speed[span], yaw_of(part).far / piece.max_yaw_rate[span]
    return float(np.max(uses))


def _parts(
    t: FloatArray, u: FloatArray, piece: PathPiece
) -> tuple[Intervals, FloatArray]:
    """Return what lies between samples, cut at the path's knots, and u amid it."""
    knots = piece.u[(piece.u > u[0]) & (piece.u < u[-1])]
    when, where = np.append(t, _passed(t, u, knots)), np.append(u, knots)
    order = np.argsort(when, kind="stable")
    when, where = when[order], where[order]
    real = np.flatnonzero(np.diff(when) > 0)
    t0, t1 = when[real], when[real + 1]
    k = np.clip(np.searchsorted(t, t0, side="right") - 1, 0, t.size - 2)
    return Intervals(k, t0, t1), (where[real] + where[real + 1]) / 2


def _passed(t: FloatArray, u: FloatArray, knots: FloatArray) -> FloatArray:
    """Return when the way u(t), from rest to rest, passes places; by halving."""
    moves = np.flatnonzero(np.diff(u) > 0)
    run = slice(moves[0], moves[-1] + 2)  # without the dwells before and after it
    t, u = t[run], u[run]
    way = CubicSpline(t, u, bc_type="clamped")
    k = np.clip(np.searchsorted(u, knots, side="right") - 1, 0, t.size - 2)
    low, high = t[k], t[k + 1]
    for _ in range(50):
        middle = (low + high) / 2
        is_before = way(middle) < knots
        low, high = np.where(is_before, middle, low), np.where(is_before, high, middle)
    return np.asarray((low + high) / 2)
