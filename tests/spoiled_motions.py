"""Trajectories that one kind of mistake keeps a vehicle from driving."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt

from omniplan import Trajectory
from omniplan.obstacles import Obstacles

FloatArray = npt.NDArray[np.float64]
Mistake: TypeAlias = Literal[
    "narrow", "aslant", "fast", "jerky", "bent", "pillar", "noisy"
]

MISTAKES: tuple[Mistake, ...] = get_args(Mistake)
REACH = {
    "ackermann": (1.23, 0.0),
    "four-wheel-steering": (1.1, math.radians(38)),
    "ift-four-steered": (0.0, math.radians(80)),
    "mecanum": (0.0, math.pi / 2),
}
"""Least radius straight ahead, m, and largest direction of travel, rad."""
CLEARANCE = 0.03


@dataclass(frozen=True)
class Spoiled:
    """A trajectory that is not permitted, and the hall it is driven in."""

    trajectory: Trajectory
    obstacles: Obstacles | None = None


def mistakes_of(name: str) -> tuple[Mistake, ...]:
    """What can be wrong with a way of this vehicle."""
    if REACH[name][0]:
        return MISTAKES
    return tuple(m for m in MISTAKES if m not in {"narrow", "aslant"})


def spoiled(rng: np.random.Generator, name: str, mistake: Mistake) -> Spoiled:
    """Return a way of 4 to 7 m with one mistake in its middle."""
    radius, crab = REACH[name]
    tight = 1 / radius if radius else 1.2
    length, n = float(rng.uniform(4, 7)), int(rng.integers(30, 90))
    s = np.linspace(0, length, n)
    share = s / length
    side = float(rng.choice([-1, 1]))
    swell = np.sin(math.pi * share) ** 2
    curvature = side * 0.45 * tight * swell * rng.uniform(-1, 1)
    beta = 0.6 * crab * swell * rng.uniform(-1, 1)
    speed = 0.3
    middle = np.exp(-(((share - 0.5) / rng.uniform(0.06, 0.15)) ** 2))
    if mistake == "narrow":
        curvature = curvature + side * tight * rng.uniform(1.1, 3.0) * middle
    elif mistake == "aslant":
        beta = beta + side * (crab + rng.uniform(0.05, 0.5)) * middle
    elif mistake == "fast":
        speed = float(rng.uniform(3, 10))
    elif mistake == "bent":
        # Wheels jump from one side to the other under way.
        step = np.where(share < 0.5, 1.0, -1.0) * (np.abs(share - 0.5) < 0.3)
        curvature = side * 0.8 * tight * step
        beta = -side * 0.8 * crab * step * float(rng.uniform(0, 0.5))
        speed = 0.5
    poses = _way(s, curvature, beta)
    if mistake == "noisy":
        poses = poses + rng.normal(0, rng.uniform(0.003, 0.02), poses.shape)
    t = s / speed
    if mistake == "jerky":
        t = np.concatenate([[0], np.cumsum(np.diff(s) / rng.uniform(0.1, 2, n - 1))])
    trajectory = Trajectory.from_poses(t, poses, name=mistake)
    if mistake != "pillar":
        return Spoiled(trajectory)
    return Spoiled(trajectory, _pillar(rng, poses, side))


def _way(s: FloatArray, curvature: FloatArray, beta: FloatArray) -> FloatArray:
    fine = np.linspace(s[0], s[-1], 20 * len(s))
    bend = np.interp(fine, s, curvature)
    step = fine[1] - fine[0]
    course = np.concatenate([[0], np.cumsum((bend[1:] + bend[:-1]) / 2 * step)])
    ahead = np.exp(1j * course)
    z = np.concatenate([[0], np.cumsum((ahead[1:] + ahead[:-1]) / 2 * step)])
    heading = course - np.interp(fine, s, beta)
    return np.stack([np.interp(s, fine, c) for c in (z.real, z.imag, heading)], -1)


def _pillar(rng: np.random.Generator, poses: FloatArray, side: float) -> Obstacles:
    """A pillar beside the middle of the way, too near by up to 0.25 m."""
    x, y, _ = poses[len(poses) // 2]
    dx, dy = poses[len(poses) // 2 + 1, :2] - poses[len(poses) // 2 - 1, :2]
    across = side * 1j * complex(dx, dy) / abs(complex(dx, dy))
    half = float(rng.uniform(0.1, 0.3))
    middle = complex(x, y) + across * (half + 0.42 - float(rng.uniform(0.05, 0.25)))
    corners = [middle + half * z for z in (1 + 1j, -1 + 1j, -1 - 1j, 1 - 1j)]
    return Obstacles.from_polygons({"pillar": [(z.real, z.imag) for z in corners]})
