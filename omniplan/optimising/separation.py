"""Obstacles for a solver: which are near, and lines between them and the vehicle."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from configspace import Vehicle
from omniplan.obstacles import Obstacles
from omniplan.obstacles.footprint import footprint_of
from omniplan.obstacles.polygons import convex_parts, rings_of
from omniplan.optimising.setting import Guess, Leg, Separation
from omniplan.optimising.warm_start import splines_of

__all__ = ["Surroundings", "line_between"]

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
Key: TypeAlias = tuple[int, int, int, int]

SHARES = (0.0, 0.5, 1.0)
"""Where in an interval the vehicle is looked at."""
AT_ENDS = 0.9
"""Share of the room there is at a start or goal that is kept."""
MOST = 6
"""So many obstacles per interval and part of the footprint are looked at first."""


def line_between(body: ComplexArray, part: ComplexArray) -> tuple[float, float, float]:
    """Return the line that keeps two sets of points apart as far as can be.

    Parameters
    ----------
    body, part : (n,), (m,) complex, m
        Corners of a convex polygon, or of one at several poses in turn.

    Returns
    -------
    gap : float, m
        Distance; negative: by how much they overlap at least.
    direction : float, rad
        Of the line's normal, from the part to the body.
    offset : float, m
        Of the line from the origin along the normal, half-way in the gap.
    """
    edges = [np.roll(corners, -1) - corners for corners in (part, body)]
    across = (body[:, None] - part[None, :]).ravel()
    normals = np.concatenate([-1j * edges[0], 1j * edges[0], -1j * edges[1]])
    normals = np.concatenate([normals, 1j * edges[1], across])
    size = np.abs(normals)
    normals = normals[size > 1e-9] / size[size > 1e-9]
    nearest = (normals[:, None].conj() * body).real.min(axis=1)
    farthest = (normals[:, None].conj() * part).real.max(axis=1)
    best = int(np.argmax(nearest - farthest))
    gap = float(nearest[best] - farthest[best])
    return gap, float(np.angle(normals[best])), float(farthest[best] + gap / 2)


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The convex parts of obstacles and of a vehicle's footprint."""

    body: tuple[tuple[complex, ...], ...]
    """Corners from K in the body frame, m."""
    parts: tuple[ComplexArray, ...]
    """Corners of obstacles in the world, m."""
    boxes: FloatArray
    """(n, 4) m: least x and y, largest x and y of each part."""

    @classmethod
    def of(cls, vehicle: Vehicle, obstacles: Obstacles) -> Surroundings:
        """Return what a vehicle is to be kept apart from."""
        footprint, reference = footprint_of(vehicle)
        parts = [
            rings_of(part)[0][:-1] @ np.array([1.0, 1j])
            for piece in obstacles.pieces
            for part in convex_parts(piece)
        ]
        boxes = [
            (p.real.min(), p.imag.min(), p.real.max(), p.imag.max()) for p in parts
        ]
        moved = footprint.moved(-reference).parts
        return cls(
            tuple(tuple(part.tolist()) for part in moved),
            tuple(parts),
            np.array(boxes).reshape(-1, 4),
        )

    def separations(
        self,
        guess: Guess,
        reach: float,
        room: float,
        known: Sequence[Separation] = (),
        *,
        keep_ends: bool = True,
    ) -> tuple[tuple[Separation, ...], FloatArray]:
        """Return what is near a motion, and lines to start with.

        Parameters
        ----------
        guess : Guess
        reach : float, m
            What is nearer than this is near.
        room : float, m
            Distance to keep; at a start or goal that stays as much of it as there is.
        known : sequence of Separation
            What was near before, and still counts.
        keep_ends : bool
            Whether start and goal stay.

        Returns
        -------
        separations : tuple of Separation
        lines : (k, 2)
            Direction, rad, and offset, m.
        """
        before = {(s.leg, s.interval, s.body, s.number) for s in known}
        made: list[Separation] = []
        lines: list[tuple[float, float]] = []
        last = len(guess.legs) - 1
        for i, leg in enumerate(guess.legs):
            poses = _poses(leg)
            for k in range(len(leg.h)):
                ends = [poses[k, 0]] if keep_ends and (i, k) == (0, 0) else []
                if keep_ends and (i, k) == (last, len(leg.h) - 1):
                    ends.append(poses[k, -1])
                for b, arms in enumerate(self.body):
                    body = _corners(poses[k], arms)
                    wanted = [
                        n for n in range(len(self.parts)) if (i, k, b, n) in before
                    ]
                    for n, line in self._near(body, reach, wanted):
                        free = [
                            line_between(_corners(end[None], arms), self.parts[n])[0]
                            for end in ends
                        ]
                        least = min(room, AT_ENDS * max(min(free, default=math.inf), 0))
                        part = np.stack([self.parts[n].real, self.parts[n].imag], -1)
                        made.append(Separation(i, k, b, n, part, least))
                        lines.append(line)
        return tuple(made), np.array(lines).reshape(-1, 2)

    def _near(
        self, body: ComplexArray, reach: float, wanted: Sequence[int]
    ) -> list[tuple[int, tuple[float, float]]]:
        """Return the nearest parts within reach, and those wanted, with their lines."""
        x, y = self.boxes[:, 0::2], self.boxes[:, 1::2]
        aside = [
            np.maximum(side[:, 0] - values.max(), values.min() - side[:, 1])
            for side, values in ((x, body.real), (y, body.imag))
        ]
        close = np.flatnonzero(np.maximum(*aside) < reach).tolist()
        found = {n: line_between(body, self.parts[n]) for n in {*close, *wanted}}
        nearest = sorted((gap, n) for n, (gap, _, _) in found.items() if gap < reach)
        kept = {n for _, n in nearest[:MOST]} | set(wanted)
        return [(n, found[n][1:]) for n in sorted(kept)]


def _poses(leg: Leg) -> FloatArray:
    """Return the poses at the shares of every interval, (n, shares, 3)."""
    spline = splines_of(leg)
    t = spline.x[:-1, None] + leg.h[:, None] * np.array(SHARES)
    return np.asarray(spline(t))


def _corners(poses: FloatArray, arms: Sequence[complex]) -> ComplexArray:
    """Return corners of the body at several poses, as one set of points."""
    place, turn = poses[:, 0] + 1j * poses[:, 1], np.exp(1j * poses[:, 2])
    return np.asarray((place[:, None] + turn[:, None] * np.array(arms)).ravel())
