"""What trajectories are compared by."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from omniplan.motion import PoseMotion
from omniplan.optimising.setting import Guess
from omniplan.optimising.warm_start import splines_of
from omniplan.trajectory import Trajectory

__all__ = ["change_between", "jerk_of"]

FloatArray = npt.NDArray[np.float64]

DENSE = 800
"""Places by which the way of a leg is known."""


def jerk_of(trajectory: Trajectory, kappa_g: float) -> float:
    """Return the integral of the squared jerk, a radian counting 1/κ_g, m²/s⁵.

    Parameters
    ----------
    trajectory : Trajectory
        Of poses: the third derivative of its splines is constant between samples.
    kappa_g : float, 1/m
    """
    point = complex(*trajectory.reference_point)
    motion = PoseMotion(trajectory.t, trajectory.samples, point)
    jerk = np.abs(6 * motion.position[0]) ** 2
    jerk = jerk + (6 * motion.heading[0] / kappa_g) ** 2
    return float(jerk @ np.diff(trajectory.t))


def change_between(found: Guess, meant: Guess, kappa_g: float) -> tuple[float, float]:
    """Return how far the knots of a motion are from the way of another, leg by leg.

    Parameters
    ----------
    found, meant : Guess
        With the same number of legs.
    kappa_g : float, 1/m
        A radian counts 1/κ_g metres.

    Returns
    -------
    mean, largest : float, m
        Root mean square, and the largest.
    """
    scale = np.array([1.0, 1.0, 1 / kappa_g])
    apart = []
    for leg, other in zip(found.legs, meant.legs, strict=True):
        spline = splines_of(other)
        way = np.asarray(spline(np.linspace(0.0, spline.x[-1], DENSE))) * scale
        apart.append(_distances(leg.poses * scale, way))
    off = np.concatenate(apart)
    return float(np.sqrt(np.mean(off**2))), float(off.max())


def _distances(points: FloatArray, way: FloatArray) -> FloatArray:
    """Return the distances of points (n, 3) from a polygon (m, 3)."""
    steps = np.diff(way, axis=0)
    since = points[:, None] - way[:-1]
    size = np.maximum((steps**2).sum(axis=1), 1e-30)
    share = np.clip((since * steps).sum(axis=2) / size, 0.0, 1.0)
    off = since - share[..., None] * steps
    return np.asarray(np.linalg.norm(off, axis=2).min(axis=1))
