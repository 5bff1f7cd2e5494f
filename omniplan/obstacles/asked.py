"""What a collision check is asked to keep to: clearance and bounds, checked."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, SupportsFloat

import numpy as np
import numpy.typing as npt
import shapely

from configspace import InvalidInput, Problem
from omniplan.obstacles.polygons import Geometries
from omniplan.samples import MAX_VALUE

__all__ = [
    "checked_bounds",
    "checked_clearance",
    "checked_path",
    "checked_poses",
    "is_pose",
    "not_a_motion",
    "not_a_pose",
    "walls",
]

FloatArray = npt.NDArray[np.float64]
Bounds = tuple[float, float, float, float]

FAR = 4 * MAX_VALUE
"""Walls reach so far, m: beyond any pose."""


def walls(bounds: Bounds | None) -> Geometries:
    """Return what lies outside the bounds, as boxes; nothing without bounds."""
    if bounds is None:
        return np.empty(0, dtype=np.object_)
    x0, y0, x1, y1 = bounds
    sides = [
        (-FAR, -FAR, x0, FAR),
        (x1, -FAR, FAR, FAR),
        (-FAR, -FAR, FAR, y0),
        (-FAR, y1, FAR, FAR),
    ]
    return np.asarray(shapely.box(*np.array(sides).T))


def checked_clearance(clearance: float) -> float:
    """Return a distance to keep, or raise."""
    is_number = isinstance(clearance, SupportsFloat)
    if not (is_number and 0 <= float(clearance) <= MAX_VALUE):
        given = f"{clearance}" if is_number else repr(clearance)[:60]
        allowed = "a finite distance of at least 0 m"
        raise InvalidInput(Problem("clearance", given, allowed))
    return float(clearance)


def checked_bounds(given: Sequence[float]) -> Bounds:
    """Return (x0, y0, x1, y1), or raise."""
    allowed = f"[x0, y0, x1, y1] with x0 < x1 and y0 < y1, at most {MAX_VALUE:g} m"
    try:
        x0, y0, x1, y1 = (float(value) for value in given)
    except (TypeError, ValueError) as error:
        raise InvalidInput(Problem("bounds", repr(given)[:60], allowed)) from error
    ordered = -MAX_VALUE <= x0 < x1 <= MAX_VALUE and -MAX_VALUE <= y0 < y1 <= MAX_VALUE
    if not ordered:
        raise InvalidInput(
            Problem("bounds", f"[{x0:g}, {y0:g}, {x1:g}, {y1:g}]", allowed)
        )
    return x0, y0, x1, y1


def is_pose(x: float, y: float, theta: float) -> bool:
    """Return whether a vehicle can be asked about at a pose."""
    return (
        -MAX_VALUE <= x <= MAX_VALUE
        and -MAX_VALUE <= y <= MAX_VALUE
        and math.isfinite(theta)
    )


def checked_poses(given: npt.ArrayLike) -> FloatArray:
    """Return poses (n, 3), or raise."""
    try:
        poses = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise not_a_pose(given) from error
    if poses.shape == (0,):
        poses = poses.reshape(0, 3)
    if poses.ndim != 2 or poses.shape[1] != 3:
        allowed = "poses (n, 3): x, y and θ each"
        raise InvalidInput(Problem("poses", f"shape {poses.shape}", allowed))
    right = np.isfinite(poses[:, 2]) & (np.abs(poses[:, :2]) <= MAX_VALUE).all(axis=1)
    if not right.all():
        raise not_a_pose(poses[~right][0])
    return poses


def not_a_pose(pose: Any) -> InvalidInput:
    """Return the error of a pose."""
    try:
        shown = f"({', '.join(f'{float(value):g}' for value in pose)})"
    except (TypeError, ValueError):
        shown = repr(pose)[:60]
    allowed = f"finite numbers (x, y, θ), x and y of at most {MAX_VALUE:g} m"
    return InvalidInput(Problem("pose", shown, allowed))


def not_a_motion(given: object) -> InvalidInput:
    """Return the error of a motion."""
    allowed = "a Move, or anything with start, goal, length, turn and poses"
    return InvalidInput(Problem("motion", type(given).__name__, allowed))


def checked_path(given: object, what: str) -> Path:
    """Return the path of a file, or raise."""
    if not isinstance(given, str | os.PathLike):
        allowed = "the path of a file"
        raise InvalidInput(Problem(what, type(given).__name__, allowed))
    return Path(given)
