"""The geometry of a path: splines between its stops, over the length of the way.

The parameter u of a path is the length of its chords, a radian of heading counting
`HEADING_LENGTH` metres. Between two stops x, y and heading are C² splines of u; every
stop starts new ones, with free ends, so that the way into a stop has a direction.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from configspace import Problem
from omniplan.errors import InvalidTrajectory
from omniplan.motion import PoseMotion, stops_of
from omniplan.path import Path
from omniplan.samples import HEADING_LENGTH, locked
from omniplan.splines import spline
from omniplan.trajectory import Trajectory

__all__ = ["PathMotion", "PathPiece", "path_of", "pieces_of"]

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

NEAR = 1e-3
"""Timed poses closer than this are one pose of their path, m."""


@dataclass(frozen=True, eq=False)
class PathPiece:
    """What lies between two stops of a path: k knots, k - 1 cubic polynomials."""

    u: FloatArray
    """(k,) m, the knots."""
    position: ComplexArray
    """(4, k - 1) x + j y of the path's reference point, highest power first."""
    heading: FloatArray
    """(4, k - 1) rad."""
    point: complex
    """The path's reference point in the frame of the vehicle's file, m."""
    max_speed: FloatArray
    """(k - 1,) m/s, cap on the speed of the vehicle's fastest point; inf: none."""
    max_yaw_rate: FloatArray
    """(k - 1,) rad/s, cap on |ω|; inf: none."""

    @property
    def length(self) -> float:
        """Length over u, m."""
        return float(self.u[-1] - self.u[0])

    def poses_at(self, u: FloatArray) -> FloatArray:
        """Return the poses at parameters u, (n, 3) m, m, rad."""
        last = self.u.size - 2
        knot = np.clip(np.searchsorted(self.u, u, side="right") - 1, 0, last)
        h = u - self.u[knot]
        a, b, c, d = self.position[:, knot]
        p = ((a * h + b) * h + c) * h + d
        a, b, c, d = self.heading[:, knot]
        return np.stack([p.real, p.imag, ((a * h + b) * h + c) * h + d], axis=-1)


class PathMotion(PoseMotion):
    """A piece of a path, passed at a constant rate of u."""

    interpolation = "C² cubic splines of x, y and heading over the length of the path"

    def __init__(self, piece: PathPiece, rate: float) -> None:
        """Take a piece and u̇, m/s."""
        powers = rate ** np.arange(3, -1, -1)[:, None]
        self.t = (piece.u - piece.u[0]) / rate
        self.point = piece.point
        self.position = piece.position * powers
        self.heading = piece.heading * powers


def path_of(motion: Path | Trajectory) -> Path:
    """Return a path, or that of a trajectory of poses, without its times.

    Where the trajectory stands still the path has a stop.

    Raises
    ------
    InvalidTrajectory
        If the trajectory is not one of poses, or does not move.
    """
    if isinstance(motion, Path):
        return motion
    if motion.form != "poses":
        given = f"samples of the form {motion.form}"
        raise InvalidTrajectory(
            Problem(motion.name, given, "a path or a trajectory of poses")
        )
    kept, stops = _thinned(motion.samples)
    if len(kept) < 2:
        raise InvalidTrajectory(
            Problem(motion.name, "the same pose throughout", "a path that moves")
        )
    return Path(
        motion.name,
        locked(motion.samples[kept]),
        motion.reference_point,
        None,
        locked(np.array(stops)),
    )


def _thinned(samples: FloatArray) -> tuple[list[int], list[bool]]:
    """Return the rows to keep, and which of them are stops.

    Rows in which the vehicle stands become one. Timed samples also crowd where it is
    slow; their rounding would look like a path that swings to and fro.
    """
    stands = stops_of(samples)
    kept, stops = [0], [bool(stands[0])]
    for row in range(1, len(samples)):
        ends = bool(stands[row]) or row == len(samples) - 1
        while ends and len(kept) > 1 and not stops[-1] and _near(samples, kept, row):
            del kept[-1], stops[-1]
        if not _near(samples, kept, row):
            kept.append(row)
            stops.append(bool(stands[row]))
        elif ends:
            stops[-1] = True
    return kept, stops


def _near(samples: FloatArray, kept: list[int], row: int) -> bool:
    step = (samples[row] - samples[kept[-1]]) * [1.0, 1.0, HEADING_LENGTH]
    return bool(np.linalg.norm(step) < NEAR)


def pieces_of(path: Path) -> Sequence[PathPiece]:
    """Return the pieces between the stops of a path: required ones, cusps, corners."""
    stop = path.stops | stops_of(path.poses)
    stop[[0, -1]] = True
    u, n = path.parameter, len(path.poses)
    caps = [
        np.full(n - 1, np.inf) if cap is None else cap
        for cap in (path.max_speed, path.max_yaw_rate)
    ]
    pieces = []
    for first, last in itertools.pairwise(np.flatnonzero(stop).tolist()):
        run, part = slice(first, last + 1), slice(first, last)
        x, y, heading = (
            spline(u[run], path.poses[run, i], False, False) for i in range(3)
        )
        pieces.append(
            PathPiece(
                u[run],
                np.asarray(x + 1j * y, dtype=np.complex128),
                heading,
                complex(*path.reference_point),
                caps[0][part],
                caps[1][part],
            )
        )
    return tuple(pieces)
