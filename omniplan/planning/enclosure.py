"""Proving that no way leads to the goal: the vehicle's core does not get through.

The largest disc about K inside the footprint sweeps the same floor whatever the
heading. A cell of a grid is closed if that disc meets something wherever in the cell K
is; if start and goal are not joined by cells that are open, no way joins them. What the
grid leaves open may be closed all the same, so the answer is "proved" or "not known".
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from omniplan.planning.task import Pose

if TYPE_CHECKING:
    from omniplan.obstacles import CollisionChecker

__all__ = ["core_radius", "is_enclosed"]

ComplexArray = npt.NDArray[np.complex128]

CELL = 0.5
"""Side of a cell, in radii of the disc ..."""
LARGEST_CELL = 1.0
"""... but up to this where there would be too many: larger ones prove nothing."""
MOST_CELLS = 60_000
AT_ONCE = 2_000
"""So many cells are looked at between two calls of a checkpoint."""
SLACK = 2e-3
"""The disc is smaller by this, m: the checker of a search keeps more distance than was
asked for (`request.SPARE`), which must not count."""
POINT = 1e-6
"""Size of the footprint that stands for the middle of a cell, m."""


def is_enclosed(
    checker: CollisionChecker,
    start: Pose,
    goal: Pose,
    checkpoint: Callable[[], None] | None = None,
) -> bool:
    """Return whether it is proved that no way leads from start to goal.

    Parameters
    ----------
    checker : CollisionChecker
    start, goal : (float, float, float), m, m, rad
    checkpoint : callable, optional
        Called every few milliseconds; what it raises ends the work.
    """
    from omniplan.obstacles import CollisionChecker

    radius = core_radius(checker.footprint.parts) + checker.clearance
    boxes = [box for box in (checker.bounds, checker.obstacles.bounds) if box]
    if radius <= 2 * SLACK or not boxes:
        return False
    corners = np.array([*(box[:2] for box in boxes), *(box[2:] for box in boxes)])
    places = np.concatenate([corners, [start[:2], goal[:2]]])
    low, high = places.min(axis=0) - 3 * radius, places.max(axis=0) + 3 * radius
    side = max(CELL * radius, math.sqrt(float(np.prod(high - low)) / MOST_CELLS))
    if side > LARGEST_CELL * radius:
        return False
    # Wherever in a cell K is, the middle is no farther than half the diagonal.
    reach = radius - side / math.sqrt(2) - SLACK
    count = np.ceil((high - low) / side).astype(np.int64) + 1
    x, y = (low[i] + side * (np.arange(count[i]) + 0.5) for i in (0, 1))
    middles = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    triangle = POINT * np.array([[1.0, 0.0], [-0.5, 0.8], [-0.5, -0.8]])
    point = CollisionChecker(triangle, checker.obstacles, reach, checker.bounds)
    poses = np.concatenate([middles, np.zeros((len(middles), 1))], axis=1)
    parts = []
    for some in np.array_split(poses, math.ceil(len(poses) / AT_ONCE)):
        if checkpoint is not None:
            checkpoint()
        parts.append(point.are_free(some))
    open_ = np.concatenate(parts).reshape(count)
    ends = [
        tuple(((np.array(pose[:2]) - low) / side).astype(np.int64).tolist())
        for pose in (start, goal)
    ]
    for end in ends:  # the vehicle stands there, so it is not closed
        open_[end] = True
    region, _ = ndimage.label(open_, structure=np.ones((3, 3)))
    return bool(region[ends[0]] != region[ends[1]])


def core_radius(parts: tuple[ComplexArray, ...]) -> float:
    """Return the radius of a disc about the origin inside convex parts, m; 0 if none.

    Parameters
    ----------
    parts : tuple of (n,) complex, m
        Corners of convex parts, in either direction.
    """
    best = 0.0
    for part in parts:
        edge = np.roll(part, -1) - part
        # Distance of the origin to the left of every edge.
        aside = -(part * np.conj(edge)).imag / np.abs(edge)
        area = float((np.conj(part) * np.roll(part, -1)).imag.sum())
        best = max(best, float((aside * math.copysign(1.0, area)).min()))
    return best
