"""What trajectories are compared by."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from omniplan.motion import PoseMotion
from omniplan.optimising.warm_start import moved
from omniplan.trajectory import Trajectory

__all__ = ["change_of", "jerk_of"]

FloatArray = npt.NDArray[np.float64]

DENSE = 800
"""Places by which the way of a trajectory is known."""


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


def change_of(
    trajectory: Trajectory, way: FloatArray, reference: complex, kappa_g: float
) -> tuple[float, float]:
    """Return how far a trajectory is from a way, place by place.

    Parameters
    ----------
    trajectory : Trajectory
        Of poses.
    way : (n, 3) float, m, m, rad
        Poses of K, densely.
    reference : complex, m
        K in the vehicle file's frame.
    kappa_g : float, 1/m
        A radian counts 1/κ_g metres.

    Returns
    -------
    mean, largest : float, m
        Root mean square along the way of the trajectory, and the largest.
    """
    scale = np.array([1.0, 1.0, 1 / kappa_g])
    point = complex(*trajectory.reference_point)
    motion = PoseMotion(trajectory.t, trajectory.samples, point)
    t = np.linspace(trajectory.t[0], trajectory.t[-1], DENSE + 1)
    points = moved(motion.poses_at(t), reference - point) * scale
    off = _distances(points, way * scale)
    gone = np.linalg.norm(np.diff(points, axis=0), axis=1)
    square = (off[1:] ** 2 + off[:-1] ** 2) / 2
    mean = float(square @ gone) / max(float(gone.sum()), 1e-12)
    return math.sqrt(mean), float(off.max())


def _distances(points: FloatArray, way: FloatArray) -> FloatArray:
    """Return the distances of points (n, 3) from a polygon (m, 3)."""
    steps = np.diff(way, axis=0)
    since = points[:, None] - way[:-1]
    size = np.maximum((steps**2).sum(axis=1), 1e-30)
    share = np.clip((since * steps).sum(axis=2) / size, 0.0, 1.0)
    off = since - share[..., None] * steps
    return np.asarray(np.linalg.norm(off, axis=2).min(axis=1))
