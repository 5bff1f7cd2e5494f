"""Errors of the questions planners ask; the tree is in `configspace.errors`."""

from __future__ import annotations

from configspace.errors import InvalidInput, OmniplanError

__all__ = ["InvalidTrajectory", "NotDrivable"]


class InvalidTrajectory(InvalidInput):
    """A trajectory that cannot be used."""


class NotDrivable(OmniplanError):
    """A path that a vehicle cannot drive, or that no timing could be proved for."""
