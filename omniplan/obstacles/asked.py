"""What a collision check is asked to keep to: clearance and bounds, checked."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import shapely

from configspace import InvalidInput, Problem
from omniplan.obstacles.polygons import Geometries
from omniplan.samples import MAX_VALUE

__all__ = ["checked_bounds", "checked_clearance", "not_finite", "walls"]

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
    if not (math.isfinite(clearance) and 0 <= clearance <= MAX_VALUE):
        allowed = "a finite distance of at least 0 m"
        raise InvalidInput(Problem("clearance", f"{clearance}", allowed))
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


def not_finite(pose: Sequence[float] | FloatArray) -> InvalidInput:
    """Return the error of a pose."""
    shown = ", ".join(f"{float(value):g}" for value in pose)
    return InvalidInput(Problem("pose", f"({shown})", "finite numbers"))
