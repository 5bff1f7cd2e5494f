"""The least radius that a line-mobile vehicle can drive, from its space."""

from __future__ import annotations

from configspace import PermissibleSpace
from configspace.errors import InvalidInput, Problem
from omniplan.sampling.intervals import PermittedIntervals

__all__ = ["is_radius_permitted", "least_radius"]

_STEPS = 60
"""Halvings: enough for the last bit."""
_SMALLEST = 1e-6
"""A radius below this, m, is a turn on the spot."""
_OUTWARD = 1e-9
"""Relative; rounding of a radius is to the safe side."""


def least_radius(space: PermissibleSpace) -> float:
    """Return the least radius that is permitted to both sides, m.

    All curvatures from straight ahead up to its own are permitted, or nearly: beyond
    what the rows of the data sheet prove the very curvature is asked for.

    Parameters
    ----------
    space : PermissibleSpace
        Of a line-mobile vehicle.

    Returns
    -------
    radius : float, m
        0 if the vehicle turns on the spot.

    Raises
    ------
    InvalidInput
        If the vehicle is not line-mobile or may not drive straight ahead.
    """
    line = space.line_beta
    if line is None:
        raise _unfit(
            space,
            "it is not line-mobile: β is free",
            "a line-mobile vehicle; use SE2StateSpace and motion_validator",
        )
    intervals = PermittedIntervals(space)
    if not intervals.permits(0.0, line, line):
        raise _unfit(
            space,
            "it may not drive straight ahead",
            "a vehicle that may drive straight",
        )
    return max(_one_side(space, intervals, side) for side in (1.0, -1.0))


def is_radius_permitted(intervals: PermittedIntervals, radius: float) -> bool:
    """Return whether straight ahead and arcs of this radius are permitted, both sides.

    Parameters
    ----------
    intervals : PermittedIntervals
    radius : float, m, > 0
        Of K's way, with β = 0.
    """
    ratio = 1.0 / (radius * intervals.space.kappa_g)
    kappa_n = ratio if ratio < 1 else 2.0 - 1.0 / ratio
    return all(intervals.permits(k, 0.0, 0.0) for k in (0.0, kappa_n, -kappa_n))


def _one_side(
    space: PermissibleSpace, intervals: PermittedIntervals, side: float
) -> float:
    """Return the least radius to the left (+1) or to the right (-1), m."""
    line = space.line_beta or 0.0
    step = 1.0 / space.grid.n_kappa  # a part of a cell
    places = [i * step for i in range(2 * space.grid.n_kappa + 1)]
    good = 0.0
    for place in places[1:]:
        bad = min(place, 2.0)
        if not intervals.permits(side * bad, line, line):
            break
        good = bad
    else:
        return 0.0
    for _ in range(_STEPS):
        middle = 0.5 * (good + bad)
        if intervals.permits(side * middle, line, line):
            good = middle
        else:
            bad = middle
    ratio = good if good < 1 else 1.0 / (2.0 - good)
    if ratio == 0:
        raise _unfit(space, "it may only drive straight ahead", "a vehicle that turns")
    radius = (1 + _OUTWARD) / (ratio * space.kappa_g)
    return radius if radius > _SMALLEST else 0.0


def _unfit(space: PermissibleSpace, given: str, allowed: str) -> InvalidInput:
    return InvalidInput(Problem("space", given, allowed), f"vehicle {space.name}")
