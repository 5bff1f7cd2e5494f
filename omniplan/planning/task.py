"""What is to be planned, and how long that may take."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeAlias

from configspace import PermissibleSpace, Vehicle
from omniplan.planning.moves import Move
from omniplan.trajectory import Trajectory

__all__ = ["Bounds", "Budget", "Checker", "Hit", "Pose", "Task"]

Pose: TypeAlias = tuple[float, float, float]
Bounds: TypeAlias = tuple[float, float, float, float]
"""x0, y0, x1, y1, m."""

SEARCH = 0.6
"""Share of the time that is for looking for ways, once there is one; the rest is for
rounding corners."""
RESTARTS = 3
"""So many searches in a row that find nothing quicker are enough."""
PATIENCE, FIRST_TRY = 2, 350
"""A search for a quicker way ends after `PATIENCE` times the motions asked before, or
after `FIRST_TRY` if that is more."""
ENCLOSED, SOON = 0.2, 1.0
"""After this share of the time, or so many seconds, without a way it is looked at
whether there can be one."""


class Hit(Protocol):
    """Where a motion meets something."""

    @property
    def place(self) -> tuple[float, float]:
        """x, y, m."""
        ...


class Checker(Protocol):
    """What planning asks of `omniplan.obstacles.CollisionChecker`."""

    def is_free(self, pose: Pose, /) -> bool:
        """Return whether the vehicle can stand in a pose."""
        ...

    def is_motion_free(self, motion: Move, /) -> bool:
        """Return whether a move is proved to meet nothing."""
        ...

    def first_hit(self, motion: Move, /) -> Any:
        """Return where a move first meets something, None if nowhere."""
        ...

    def first_hit_of_trajectory(self, trajectory: Trajectory, /) -> Any:
        """Return where a trajectory first meets something, None if nowhere."""
        ...


@dataclass
class Budget:
    """Time and number of motions; the one thing of a task that changes."""

    seconds: float
    motions: int | None = None
    """So many motions may be asked about; None: as many as time allows."""
    asked: int = 0
    has_way: bool = False
    """Whether a way is known: then some time is kept for rounding its corners."""
    is_enclosed: bool | None = None
    """Whether it is proved that there is no way; None: not looked at yet."""
    checkpoint: Callable[[], None] | None = None
    """Called again and again; what it raises ends the work."""
    begun: float = field(default_factory=time.perf_counter)

    def start(self) -> None:
        """Let the clock start now."""
        self.begun = time.perf_counter()

    def check(self) -> None:
        """Call the checkpoint, if there is one."""
        if self.checkpoint is not None:
            self.checkpoint()

    @property
    def elapsed(self) -> float:
        """Time since the beginning, s."""
        return time.perf_counter() - self.begun

    @property
    def is_late(self) -> bool:
        """Whether the time is used up."""
        return self.elapsed >= self.seconds

    @property
    def is_spent(self) -> bool:
        """Whether the motions are used up."""
        return self.motions is not None and self.asked >= self.motions

    @property
    def is_over(self) -> bool:
        """Whether time for the search or motions are used up."""
        share = SEARCH if self.has_way else 1.0
        return self.is_spent or self.elapsed >= share * self.seconds

    @property
    def patience(self) -> int:
        """So many motions are for the next search for a quicker way."""
        return max(PATIENCE * self.asked, FIRST_TRY)

    def is_beyond(self, share: float) -> bool:
        """Return whether so much of the time, or of the motions, is used up."""
        motions = math.inf if self.motions is None else self.motions
        return self.asked >= share * motions or self.elapsed >= share * self.seconds


@dataclass(frozen=True, eq=False)
class Task:
    """Two poses of K and what lies between them."""

    start: Pose
    goal: Pose
    space: PermissibleSpace
    vehicle: Vehicle
    checker: Checker | None
    """None: nothing stands in the way."""
    bounds: Bounds
    """Where poses are looked for."""
    planner: str
    seed: int
    budget: Budget

    def is_known_enclosed(self) -> bool:
        """Return whether it is proved that there is no way.

        Looked at once, after some time without a way.
        """
        budget = self.budget
        if budget.is_enclosed is None and not budget.has_way:
            if budget.elapsed < min(ENCLOSED * budget.seconds, SOON):
                return False
            budget.is_enclosed = self.is_enclosed()
        return bool(budget.is_enclosed)

    def is_enclosed(self) -> bool:
        """Return whether it can be proved that there is no way."""
        from omniplan.obstacles import CollisionChecker
        from omniplan.planning.enclosure import is_enclosed

        if not isinstance(self.checker, CollisionChecker):
            return False
        return is_enclosed(self.checker, self.start, self.goal, self.budget.checkpoint)

    def is_free(self, pose: Pose) -> bool:
        """Return whether the vehicle can stand in a pose."""
        self.budget.check()
        return self.checker is None or self.checker.is_free(pose)

    def are_free(self, moves: Iterable[Move]) -> bool:
        """Return whether moves meet nothing; counts them. False once too many were."""
        for move in moves:
            if self.budget.is_spent:
                return False
            self.budget.asked += 1
            self.budget.check()
            if self.checker is not None and not self.checker.is_motion_free(move):
                return False
        return True
