"""Routes: the geometry of a plan, ready to be timed."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from omniplan.path import Path
from omniplan.planning.moves import Move, goes_on
from omniplan.samples import HEADING_LENGTH, locked

__all__ = ["Route"]

FloatArray = npt.NDArray[np.float64]

ARC_STEP = 0.04
"""Turn from pose to pose of an arc, rad: the splines through the poses have the
arc's curvature but for a share of about 10⁻³ at its ends."""
STRAIGHT_STEP = math.pi / 4
"""The same of a straight move, whose splines are exact, rad."""
LEAST = 4
"""Least number of steps of a move: a spline through fewer is not free to bend."""
CLOSEST = 1e-5
"""Poses are no closer than this, m: a path must move from pose to pose."""


@dataclass(frozen=True, eq=False)
class Route:
    """Poses of K and where the vehicle stands."""

    poses: FloatArray
    """(n, 3) m, m, rad; headings unwrapped."""
    stops: tuple[int, ...]
    """Rows where the vehicle stands; first and last are not named."""

    @classmethod
    def from_moves(cls, moves: Sequence[Move]) -> Route:
        """Return the route along moves, with a stop wherever the twist jumps.

        Parameters
        ----------
        moves : sequence of Move
            At least one; each starts where the one before ends.
        """
        poses, stops = [moves[0].start[None]], []
        row = 0
        for before, move in itertools.pairwise([None, *moves]):
            assert move is not None
            if before is not None and not goes_on(before, move):
                stops.append(row)
            steps = _steps(move)
            part = move.poses(np.arange(1, steps + 1) / steps)
            # Headings go on from where they are: a move may be wound differently.
            part[:, 2] += poses[-1][-1, 2] - move.start[2]
            poses.append(part)
            row += steps
        return cls(locked(np.concatenate(poses)), tuple(stops))

    def to_path(self, name: str, reference_point: tuple[float, float]) -> Path:
        """Return the path to be timed.

        Parameters
        ----------
        name : str
        reference_point : (float, float), m
            K in the frame of the vehicle's file.
        """
        return Path.from_poses(
            self.poses, name=name, reference_point=reference_point, stops=self.stops
        )


def _steps(move: Move) -> int:
    curved = move.shape == "arc" and move.length > 0
    step = ARC_STEP if curved else STRAIGHT_STEP
    steps = max(math.ceil(abs(move.turn) / step), LEAST)
    way = math.hypot(move.length, HEADING_LENGTH * move.turn)
    return max(min(steps, int(way / CLOSEST)), 1)
