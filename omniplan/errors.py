"""Errors of the questions planners ask; the tree is in `configspace.errors`."""

from __future__ import annotations

from configspace.errors import InvalidInput

__all__ = ["InvalidTrajectory"]


class InvalidTrajectory(InvalidInput):
    """A trajectory that cannot be used."""
