"""State spaces of OMPL whose states are poses, and the curves of a vehicle in them."""

from __future__ import annotations

from typing import Any

from configspace import PermissibleSpace
from configspace.errors import InvalidInput, Problem
from configspace.space import require_space
from omniplan.sampling.intervals import PermittedIntervals
from omniplan.sampling.line_radius import is_radius_permitted, least_radius
from omniplan.sampling.ompl_bindings import base, bounds_of

__all__ = ["is_plain", "line_space", "radius_of", "require_radius", "require_se2"]


def line_space(
    space: PermissibleSpace,
    *,
    reverse: bool = True,
    radius: float | None = None,
    bounds: tuple[float, float, float, float] | None = None,
) -> Any:
    """Return the state space of a line-mobile vehicle: its curves of least radius.

    Parameters
    ----------
    space : PermissibleSpace
        Of a vehicle with a fixed axle.
    reverse : bool
        Reeds and Shepp's space, which drives backwards as well; else Dubins'.
    radius : float, m, optional
        By default the least one that the space permits to both sides.
    bounds : (x_min, y_min, x_max, y_max), m, optional

    Returns
    -------
    state_space : ompl.base.ReedsSheppStateSpace or ompl.base.DubinsStateSpace
        States are poses of K.

    Raises
    ------
    InvalidInput
        Naming the vehicle: if it is not line-mobile, if no `radius` is given and it
        turns on the spot, if it cannot drive the one given, or if its β is not 0.
    """
    require_space(space)
    subject = f"vehicle {space.name}"
    least = least_radius(space)
    if space.line_beta:
        problem = Problem("space.line_beta", f"{space.line_beta:g} rad", "β = 0")
        raise InvalidInput(problem, subject)
    if radius is None and least == 0:
        given = "not given, and the vehicle turns on the spot"
        raise InvalidInput(Problem("radius", given, "a radius above 0 m"), subject)
    if radius is not None and not max(least, 1e-6) <= radius < float("inf"):
        allowed = f"finite, at least {max(least, 1e-6):.6g} m"
        raise InvalidInput(Problem("radius", f"{radius:g} m", allowed), subject)
    kind = base.ReedsSheppStateSpace if reverse else base.DubinsStateSpace
    state_space = kind(least if radius is None else float(radius))
    if bounds is not None:
        state_space.setBounds(bounds_of(bounds))
    return state_space


def require_se2(si: Any) -> Any:
    """Return the state space of `si` if states are poses; else raise InvalidInput."""
    if not isinstance(si, base.SpaceInformation):
        allowed = "an ompl.base.SpaceInformation; a SimpleSetup has one"
        raise InvalidInput(Problem("si", type(si).__name__, allowed))
    state_space = si.getStateSpace()
    if not isinstance(state_space, base.SE2StateSpace):
        given = type(state_space).__name__
        allowed = "SE2StateSpace, DubinsStateSpace or ReedsSheppStateSpace"
        raise InvalidInput(Problem("si: state space", given, allowed))
    if isinstance(state_space, base.TrochoidStateSpace):
        allowed = "curves relative to the ground, not to a moving medium"
        raise InvalidInput(Problem("si: state space", "TrochoidStateSpace", allowed))
    return state_space


def is_plain(state_space: Any) -> bool:
    """Return whether states are joined by straight lines."""
    curved = (base.DubinsStateSpace, base.ReedsSheppStateSpace)
    return not isinstance(state_space, curved)


def radius_of(state_space: Any) -> float:
    """Return the radius of a space of curves, m: they are alike but for their size."""
    unit = (
        base.DubinsStateSpace(1.0)
        if isinstance(state_space, base.DubinsStateSpace)
        else base.ReedsSheppStateSpace(1.0)
    )
    lengths = []
    for each in (state_space, unit):
        first, second = each.allocState(), each.allocState()
        for state, heading in ((first, 0.0), (second, 3.0)):
            state.setXY(0.0, 0.0)
            state.setYaw(heading)
        lengths.append(each.distance(first, second))
    return float(lengths[0] / lengths[1])


def require_radius(intervals: PermittedIntervals, radius: float) -> None:
    """Raise InvalidInput unless a vehicle can drive curves of this radius."""
    # The radius was measured: within rounding of the least one is the least one.
    if is_radius_permitted(intervals, radius * (1 + 1e-9)):
        return
    space = intervals.space
    allowed = "a radius whose arcs to both sides, with β = 0, the vehicle can drive"
    if space.line_beta is not None:
        allowed = f"at least {least_radius(space):.6g} m"
    problem = Problem("si: radius of the curves", f"{radius:.6g} m", allowed)
    raise InvalidInput(problem, f"vehicle {space.name}")
