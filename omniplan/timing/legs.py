"""Legs between stops, put together in time with the waits at the stops."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from omniplan.path import Path
from omniplan.report import Report, Violation
from omniplan.timing.caps import cap_use
from omniplan.timing.path_motion import PathPiece
from omniplan.timing.sampling import DWELL, SampledPiece
from omniplan.trajectory import Trajectory

__all__ = ["Leg", "crawl_of", "legs_of", "lengthened", "trajectory_of"]

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Leg:
    """The samples of one piece."""

    piece: PathPiece
    t: FloatArray
    """(n,) s, from the start of the path."""
    u: FloatArray
    """(n,) m, from the start of the path."""


def legs_of(
    sampled: Sequence[SampledPiece],
    waits: Sequence[float],
    footprint: Sequence[tuple[float, float]],
) -> list[Leg]:
    """Return the legs of a path, slowed down to its caps, with times at stops between.

    Parameters
    ----------
    sampled : (n,) sequence of SampledPiece
    waits : (n - 1,) sequence of float, s
    footprint : sequence of points, m
        In the frame of the vehicle's file.
    """
    legs, now = [], 0.0
    for one, wait in zip(sampled, [*waits, 0.0], strict=True):
        poses = one.path.poses_at(one.u)
        used = cap_use(one.t, one.u, one.path, poses, footprint)
        t = now + one.t * max(one.excess, used, 1.0)
        legs.append(Leg(one.path, t, one.u))
        now = float(t[-1]) + wait * (1 + 1e-6) + DWELL
    return legs


def trajectory_of(path: Path, legs: Sequence[Leg]) -> Trajectory:
    """Return the legs of a path as one trajectory."""
    return Trajectory.from_poses(
        np.concatenate([leg.t for leg in legs]),
        np.concatenate([leg.piece.poses_at(leg.u) for leg in legs]),
        name=path.name,
        reference_point=path.reference_point,
    )


def crawl_of(violation: Violation, legs: Sequence[Leg]) -> float:
    """Return how many times more slowly wheels have to turn amid a leg, or 1.

    Where the centre of rotation passes close by a wheel, even the optimum may be slow
    enough to count as standing; then the wheels turn from rest to rest.
    """
    if violation.limit != "RECONFIGURATION" or violation.value is None:
        return 1.0
    ends = np.array([leg.t[-1] for leg in legs[:-1]])
    is_stop = (violation.t_start <= ends) & (ends <= violation.t_end)
    if is_stop.any() or not 0 < violation.bound < violation.value < math.inf:
        return 1.0
    return violation.value / violation.bound


def lengthened(waits: list[float], legs: Sequence[Leg], report: Report) -> bool:
    """Make waits between legs as long as a report demands; return whether any is."""
    ends = np.array([leg.t[-1] for leg in legs[:-1]])
    grew = False
    for violation in report.violations:
        if violation.limit != "RECONFIGURATION" or violation.value is None:
            continue
        since = np.where(ends <= violation.t_end, violation.t_end - ends, math.inf)
        missing = violation.value - violation.bound
        if not np.isfinite(since).any() or not 0 < missing < math.inf:
            continue
        waits[int(since.argmin())] += missing + DWELL
        grew = True
    return grew
