"""What trajectories are compared by."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from omniplan.motion import PoseMotion
from omniplan.optimising.warm_start import moved
from omniplan.trajectory import Trajectory

__all__ = ["change_of", "jerk_of", "nearest_on"]

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
    """Return how far a trajectory is from a way, whatever the times.

    The distance of two poses is ``√(Δx² + Δy² + (Δθ / κ_g)²)``, that of a pose from a
    way is the distance from its nearest pose. Both ways are looked along: every pose of
    the trajectory is to be near the way, and every pose of the way near the trajectory,
    so that nothing is left out unnoticed.

    Parameters
    ----------
    trajectory : Trajectory
        Of poses.
    way : (n, 3) float, m, m, rad
        Poses of K, densely, joined by straight lines.
    reference : complex, m
        K in the vehicle file's frame.
    kappa_g : float, 1/m
        A radian counts 1/κ_g metres.

    Returns
    -------
    mean, largest : float, m
        The root of the mean square by length, the larger of the two; and the largest
        distance of all (that of Hausdorff).

    References
    ----------
    O. Schütze et al., Using the averaged Hausdorff distance, IEEE Transactions on
    Evolutionary Computation 16 (2012), equation 45: Δ_p with p = 2.
    """
    scale = np.array([1.0, 1.0, 1 / kappa_g])
    point = complex(*trajectory.reference_point)
    motion = PoseMotion(trajectory.t, trajectory.samples, point)
    t = np.linspace(trajectory.t[0], trajectory.t[-1], DENSE + 1)
    made = moved(motion.poses_at(t), reference - point) * scale
    given = way * scale
    means, farthest = [], []
    for points, other in ((made, given), (given, made)):
        off = np.linalg.norm(points - nearest_on(points, other)[0], axis=1)
        gone = np.linalg.norm(np.diff(points, axis=0), axis=1)
        square = (off[1:] ** 2 + off[:-1] ** 2) / 2
        means.append(float(square @ gone) / max(float(gone.sum()), 1e-12))
        farthest.append(float(off.max()))
    return math.sqrt(max(means)), max(farthest)


def nearest_on(points: FloatArray, way: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the nearest places on a polygon, and the steps of it that they are on.

    Parameters
    ----------
    points : (n, k) float
    way : (m, k) float

    Returns
    -------
    places, steps : (n, k) float
    """
    steps = np.diff(way, axis=0)
    size = np.maximum((steps**2).sum(axis=1), 1e-30)
    # |p - a - share step|² for all pairs, but for |p|²; near the origin, for rounding
    middle = way.mean(axis=0)
    near, starts = points - middle, way[:-1] - middle
    ahead = near @ steps.T - (starts * steps).sum(axis=1)
    share = np.clip(ahead / size, 0.0, 1.0)
    square = (starts**2).sum(axis=1) - 2 * (near @ starts.T)
    best = (square + share * (share * size - 2 * ahead)).argmin(axis=1)
    chosen = share[np.arange(len(points)), best]
    return way[best] + chosen[:, None] * steps[best], steps[best]
