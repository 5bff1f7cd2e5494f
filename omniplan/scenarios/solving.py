"""Planning a scenario, and what the plans have in common to be compared by."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from configspace import PermissibleSpace
from omniplan.obstacles import CollisionChecker, Obstacles, Swept
from omniplan.planning.planner import plan
from omniplan.planning.result import Plan
from omniplan.scenarios.scenario import TITLES, Pose, Scenario, space_of_platform

__all__ = ["Solution", "pose_of_k", "solve", "solve_all"]

LONGEST = 600.0
"""Default time for a search, s: the iterations end it, or plans would differ with what
else the machine does."""


@dataclass(frozen=True, eq=False)
class Solution:
    """The plan of one vehicle, or why there is none."""

    space: PermissibleSpace
    obstacles: Obstacles
    plan: Plan
    title: str = ""
    """What pictures and tables call the vehicle; default its name."""
    ends: tuple[Pose, ...] = ()
    """Poses of K at start and goal, for pictures of plans that were not found."""

    def __post_init__(self) -> None:
        """Give a title where there is none."""
        object.__setattr__(self, "title", self.title or self.space.name)

    @property
    def vehicle(self) -> str:
        """Name of the vehicle."""
        return self.space.name

    @cached_property
    def swept(self) -> Swept | None:
        """What the footprint sweeps over; None without a trajectory."""
        trajectory = self.plan.trajectory
        if trajectory is None:
            return None
        return CollisionChecker(self.space, self.obstacles).swept(trajectory)

    @property
    def swept_area(self) -> float | None:
        """m²; None without a trajectory."""
        return None if self.swept is None else self.swept.area

    def to_dict(self) -> dict[str, Any]:
        """Return vehicle, swept area and plan as plain data (JSON types only)."""
        area = self.swept_area
        return {
            "vehicle": self.vehicle,
            "swept_area": area,
            "plan": self.plan.to_dict(),
        }


def solve(
    task: Scenario, vehicle: str, *, time: float | None = None, seed: int | None = None
) -> Solution:
    """Return the plan of one platform.

    Parameters
    ----------
    task : Scenario
    vehicle : str
        One of its vehicles.
    time : float, s, > 0, optional
        For the search; by default so long that the iterations of the scenario bound
        it, and the plan is the same every time.
    seed : int, [1, 2**31), optional
        Default that of the scenario.
    """
    space = space_of_platform(vehicle)
    obstacles = Obstacles.from_polygons(task.obstacles)
    start, goal = (pose_of_k(pose, space) for pose in (task.start, task.goal))
    found = plan(
        start,
        goal,
        space,
        obstacles,
        bounds=task.bounds,
        clearance=task.clearance,
        time=LONGEST if time is None else time,
        iterations=task.iterations,
        seed=task.seed if seed is None else seed,
        heading=task.heading,
    )
    return Solution(space, obstacles, found, TITLES[vehicle], (start, goal))


def solve_all(
    task: Scenario, *, time: float | None = None, seed: int | None = None
) -> Iterator[Solution]:
    """Yield the plans of all vehicles of a scenario, as they are found."""
    for vehicle in task.vehicles:
        yield solve(task, vehicle, time=time, seed=seed)


def pose_of_k(pose: Pose, space: PermissibleSpace) -> Pose:
    """Return the pose of K of a vehicle whose file's origin is at a pose."""
    x, y, theta = pose
    k = complex(*space.header.reference)
    at = complex(x, y) + k * complex(math.cos(theta), math.sin(theta))
    return at.real, at.imag, theta
