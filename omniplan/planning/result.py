"""What planning answers; "no" is a value."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from omniplan.errors import NoPlanFound, OptimisationFailed, PlanningError
from omniplan.report import Report
from omniplan.trajectory import Trajectory

__all__ = ["Plan", "PlanStatus"]

Pose = tuple[float, float, float]


class PlanStatus(enum.Enum):
    """How planning or optimising ended."""

    FOUND = "found"
    """There is a trajectory; `validate` and the collision check have proved it."""
    START_BLOCKED = "start blocked"
    """The vehicle stands in an obstacle or outside the bounds at the start."""
    GOAL_BLOCKED = "goal blocked"
    """The vehicle would stand in an obstacle or outside the bounds at the goal."""
    START_NOT_PERMITTED = "start not permitted"
    """The wheels' configuration at the start is not permitted."""
    GOAL_NOT_PERMITTED = "goal not permitted"
    """The wheels' configuration asked for at the goal is not permitted."""
    UNREACHABLE = "unreachable"
    """It is proved that no way leads to the goal."""
    TIMEOUT = "timeout"
    """No way was found in the time given; there may be one."""
    INFEASIBLE = "infeasible"
    """The solver found the optimisation problem to have no solution near the start."""
    ITERATION_LIMIT = "iteration limit"
    """The solver ended before it converged."""
    NON_FINITE = "non-finite"
    """The solver met a value that is not a number."""
    NOT_PROVED = "not proved"
    """A result was computed, but `validate` or the collision check refused it."""


_OF_OPTIMISATION = frozenset(
    {PlanStatus.INFEASIBLE, PlanStatus.ITERATION_LIMIT, PlanStatus.NON_FINITE}
)


@dataclass(frozen=True, eq=False)
class Plan:
    """A trajectory a vehicle can drive from start to goal, or why there is none."""

    vehicle: str
    status: PlanStatus
    message: str
    """The answer in one line: what is in the way, and where."""
    trajectory: Trajectory | None = None
    """Of K; starts and ends at rest. None unless the status is FOUND."""
    report: Report | None = None
    """The verdict of `validate`: on the trajectory, or on what was refused."""
    place: Pose | None = None
    """x m, y m, θ rad: where it fails; None for a success or where none is to blame."""
    stops: int = 0
    """How often the vehicle stands still on its way, start and goal not counted."""
    cusps: int = 0
    """At how many of these stops it drives on against the direction it came in."""
    statistics: Mapping[str, float | int | str] = field(default_factory=dict)
    """How the answer was found: ``planner``, ``seed``, ``time_to_first`` s, ``time`` s,
    ``iterations``, ... as far as they apply."""

    def __post_init__(self) -> None:
        """Keep the statistics from being changed."""
        frozen = MappingProxyType(dict(self.statistics))
        object.__setattr__(self, "statistics", frozen)

    @property
    def is_found(self) -> bool:
        """Whether there is a trajectory."""
        return self.status is PlanStatus.FOUND

    @property
    def duration(self) -> float | None:
        """Duration of the trajectory, s; None if there is none."""
        return None if self.trajectory is None else self.trajectory.duration

    def to_dict(self) -> dict[str, Any]:
        """Return the answer as plain data (JSON types only)."""
        found = self.trajectory
        return {
            "vehicle": self.vehicle,
            "status": self.status.value,
            "message": self.message,
            "duration": self.duration,
            "place": None if self.place is None else list(self.place),
            "stops": self.stops,
            "cusps": self.cusps,
            "statistics": dict(self.statistics),
            "trajectory": None if found is None else found.to_dict(),
            "report": None if self.report is None else self.report.to_dict(),
        }

    def raise_for_status(self) -> Trajectory:
        """Return the trajectory.

        Raises
        ------
        NoPlanFound, OptimisationFailed
            If there is none; with the message.
        """
        if self.trajectory is None:
            raise self._error()
        return self.trajectory

    def _error(self) -> PlanningError:
        if self.status in _OF_OPTIMISATION:
            return OptimisationFailed(self.message)
        return NoPlanFound(self.message)
