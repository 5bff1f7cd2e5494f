"""Write the manoeuvres of this folder: ``python examples/make_manoeuvres.py``.

Each manoeuvre is a chain of legs from rest to rest. A leg is a path of unit-free
parameter 0 to 1, driven with the smoothest (minimum-jerk) timing, and sampled every
50 ms. All poses are those of the origin of the vehicle file's frame.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt

from omniplan import Trajectory, write_trajectories

STEP = 0.05
FloatArray = npt.NDArray[np.float64]
Leg = Callable[[FloatArray], FloatArray]
"""From parameters (n,) in [0, 1] to pose changes (n, 3) in the frame at its start."""


def straight(dx: float, dy: float) -> Leg:
    """Move by (dx, dy) metres in the body frame; the heading stays."""
    return lambda f: np.stack([dx * f, dy * f, 0 * f], axis=-1)


def turn(angle: float) -> Leg:
    """Turn on the spot by `angle` radians."""
    return lambda f: np.stack([0 * f, 0 * f, angle * f], axis=-1)


def crab_corner(radius: float, entry: float) -> Leg:
    """Go round a 90° corner, heading kept, with `entry` metres before and after."""
    arc = radius * math.pi / 2
    total = arc + 2 * entry

    def leg(f: FloatArray) -> FloatArray:
        s = f * total
        phi = np.clip((s - entry) / radius, 0, math.pi / 2)
        x = np.minimum(s, entry) + radius * np.sin(phi)
        y = radius * (1 - np.cos(phi)) + np.maximum(s - entry - arc, 0)
        return np.stack([x, y, 0 * f], axis=-1)

    return leg


def curve(length: float, bends: tuple[float, ...]) -> Leg:
    """Follow a tangential path of signed `length`; negative drives backwards.

    Each of the equally long `bends` turns the heading by that many radians; the
    curvature swells and fades as sin², so the steering never has to jump.
    """

    def leg(f: FloatArray) -> FloatArray:
        fine = np.linspace(0, 1, 4001)
        place = fine * len(bends)
        which = np.minimum(place.astype(int), len(bends) - 1)
        u = place - which
        done = np.concatenate([[0.0], np.cumsum(bends)])[which]
        heading = done + np.array(bends)[which] * (
            u - np.sin(2 * math.pi * u) / (2 * math.pi)
        )
        xy = []
        for part in (np.cos(heading), np.sin(heading)):
            steps = (part[1:] + part[:-1]) / 2 * length / (len(fine) - 1)
            xy.append(np.interp(f, fine, np.concatenate([[0.0], np.cumsum(steps)])))
        return np.stack([*xy, np.interp(f, fine, heading)], axis=-1)

    return leg


def wait(_: FloatArray) -> FloatArray:
    """Stand still."""
    return np.zeros((len(_), 3))


def chain(name: str, *legs: tuple[Leg, float]) -> Trajectory:
    """Return the trajectory of legs with their durations, from pose (0, 0, 0)."""
    times, poses = [np.zeros(1)], [np.zeros((1, 3))]
    for leg, duration in legs:
        n = round(duration / STEP)
        tau = np.arange(1, n + 1) / n
        f = tau**3 * (10 - 15 * tau + 6 * tau**2)
        x, y, theta = poses[-1][-1]
        d = leg(f)
        turned = (d[:, 0] + 1j * d[:, 1]) * np.exp(1j * theta)
        poses.append(
            np.stack([x + turned.real, y + turned.imag, theta + d[:, 2]], axis=-1)
        )
        times.append(times[-1][-1] + tau * duration)
    # Nanometres: a leg that keeps the heading keeps it exactly.
    return Trajectory.from_poses(
        np.concatenate(times).round(9), np.concatenate(poses).round(9), name=name
    )


def manoeuvres() -> list[Trajectory]:
    """Return all manoeuvres."""
    return [
        # The three of figure 1 of the paper, into the same gap 0.9 m to the right.
        chain(
            "parking-ackermann",
            (straight(1.2, 0.0), 3.0),
            (curve(-3.2, (0.58, -0.58)), 8.0),
            (straight(0.5, 0.0), 2.0),
        ),
        chain(
            "parking-limited-steering",
            (straight(1.2, 0.0), 3.0),
            (wait, 0.5),
            (straight(-1.2, -0.9), 4.0),
        ),
        chain(
            "parking-sideways", (straight(1.2, 0.0), 3.0), (straight(0.0, -0.9), 3.0)
        ),
        chain("turn-on-the-spot", (turn(math.pi), 5.0)),
        chain("crab-corner", (crab_corner(0.8, 0.8), 8.0)),
        chain(
            "docking",
            (curve(2.4, (0.9,)), 6.0),
            (curve(-2.4, (0.9,)), 6.0),
            (straight(-0.4, 0.0), 2.0),
        ),
        chain(
            "forward-stop-sideways",
            (straight(1.0, 0.0), 3.0),
            (wait, 1.0),
            (straight(0.0, 0.8), 3.0),
        ),
        chain("wide-curve-fast", (curve(9.0, (0.8, -0.8)), 13.0)),
    ]


if __name__ == "__main__":
    folder = Path(__file__).parent / "manoeuvres"
    for manoeuvre in manoeuvres():
        write_trajectories(folder / f"{manoeuvre.name}.csv", [manoeuvre])
