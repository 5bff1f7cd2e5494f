"""Errors of the questions planners ask; the tree is in `configspace.errors`."""

from __future__ import annotations

from configspace.errors import InvalidInput, OmniplanError

__all__ = [
    "InvalidTrajectory",
    "NoPlanFound",
    "NotDrivable",
    "OptimisationFailed",
    "PlanningError",
]


class InvalidTrajectory(InvalidInput):
    """A trajectory that cannot be used."""


class NotDrivable(OmniplanError):
    """A path that a vehicle cannot drive, or that no timing could be proved for."""


class PlanningError(OmniplanError):
    """There is no plan."""


class NoPlanFound(PlanningError):
    """No way to the goal was found, or there is none."""


class OptimisationFailed(PlanningError):
    """A solver ended without a solution."""
