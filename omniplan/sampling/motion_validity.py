"""Whether a vehicle can drive from state to state, for OMPL programs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from configspace import PermissibleSpace
from configspace.errors import InvalidInput, Problem
from configspace.space import require_space
from omniplan.obstacles import CollisionChecker
from omniplan.planning.moves import Move
from omniplan.sampling.curves import along_curves
from omniplan.sampling.intervals import PermittedIntervals
from omniplan.sampling.lines import lines_permitted
from omniplan.sampling.ompl_bindings import base
from omniplan.sampling.state_spaces import (
    is_plain,
    radius_of,
    require_radius,
    require_se2,
)
from omniplan.sampling.state_validity import (
    Collisions,
    pose_of,
    require_checker,
    validity_checker,
    with_method,
)

__all__ = ["MotionValidator", "equip", "motion_validator"]

Check = Callable[[Any, Any], bool]


class MotionValidator(base.MotionValidator):  # type: ignore[misc]
    """Whether the vehicle can drive from state to state: exactly, not by sampling."""

    def __init__(self, si: Any, space: PermissibleSpace) -> None:
        super().__init__(si)
        self.space = space
        """The permissible space of the vehicle."""
        self._state_space = si.getStateSpace()

    def last_valid(
        self, first: Any, second: Any, state: Any = None, tolerance: float = 1e-6
    ) -> float:
        """Return up to which share of a motion it is valid, for Python programs.

        OMPL itself asks for this in C++ only, where no Python class can answer.

        Parameters
        ----------
        first, second : OMPL states
        state : OMPL state, optional
            Becomes the last valid state.
        tolerance : float, 1, > 0
            The answer is less than the true share by this at most.

        Returns
        -------
        share : float, 1, [0, 1]
            1 if all of the motion is valid.
        """
        between = self._state_space.allocState()
        low, high = 0.0, 1.0
        if self.checkMotion(first, second):
            low = 1.0
        while high - low > tolerance:
            middle = 0.5 * (low + high)
            self._state_space.interpolate(first, second, middle, between)
            if self.checkMotion(first, between):
                low = middle
            else:
                high = middle
        if state is not None:
            self._state_space.interpolate(first, second, low, state)
        return low


def motion_validator(
    si: Any,
    space: PermissibleSpace,
    checker: Collisions | None = None,
    *,
    ask_states: bool | None = None,
    reachable_only: bool = True,
) -> MotionValidator:
    """Return a motion validator for SE(2) or for Dubins' or Reeds and Shepp's curves.

    Between two states of SE(2) position and heading are linear, so κ_n is constant
    while β turns: permitted if either representation is, see `PermittedIntervals`. On
    curves κ_n takes three values, which are judged at once.

    Parameters
    ----------
    si : ompl.base.SpaceInformation
        Over SE(2), Dubins' or Reeds and Shepp's space; states are poses of K.
    space : PermissibleSpace
        Of the vehicle.
    checker : Collisions, optional
        Asked about whole motions.
    ask_states : bool, optional
        Whether the state validity checker of `si` is asked along the motion, at
        OMPL's resolution, as without this validator. By default it is if there is no
        `checker`, as that is where an existing program looks for obstacles.
    reachable_only : bool
        As of `PermittedIntervals`.

    Raises
    ------
    InvalidInput
        If the state space is another one, the space is none, the checker is none or
        that of another vehicle, or the curves are tighter than the vehicle can drive.
    """
    require_space(space)
    state_space = require_se2(si)
    require_checker(checker, space)
    intervals = PermittedIntervals(space, reachable_only)
    if ask_states is None:
        ask_states = checker is None
    stepwise = [_stepwise(si)] if ask_states else []
    if not is_plain(state_space):
        radius = radius_of(state_space)
        require_radius(intervals, radius)
        checks = [] if checker is None else [along_curves(state_space, checker, radius)]
        method = _all_of([*checks, *stepwise])
    else:
        along = [] if checker is None else [_along_lines(checker)]
        others = _all_of([*along, *stepwise]) if along or stepwise else None
        method = lines_permitted(state_space, intervals.table, others)
    made: MotionValidator = with_method(MotionValidator, "checkMotion", method)(
        si, space
    )
    return made


def equip(si: Any, space: PermissibleSpace, checker: Collisions | None = None) -> None:
    """Make an OMPL program heed a vehicle and its obstacles: both checks at once.

    Replaces the state validity checker, too: without a `checker` there are no obstacles
    but the bounds. To keep a program's own, set `motion_validator` alone.

    Parameters
    ----------
    si : ompl.base.SpaceInformation
        Over SE(2), Dubins' or Reeds and Shepp's space; states are poses of K.
    space : PermissibleSpace
        Of the vehicle.
    checker : Collisions, optional

    Raises
    ------
    InvalidInput
        As `motion_validator`.
    """
    curved = not is_plain(require_se2(si))
    # Straight motions between states within the bounds stay there; curves may not.
    motion = motion_validator(si, space, checker, ask_states=curved and checker is None)
    si.setStateValidityChecker(validity_checker(si, space, checker))
    si.setMotionValidator(motion)


def _stepwise(si: Any) -> Check:
    """Return OMPL's own check of a motion, which steps along it."""
    found = si.getMotionValidator()
    if isinstance(found, MotionValidator):
        raise InvalidInput(
            Problem(
                "si: motion validator",
                "one of omniplan already",
                "set it once, or give ask_states=False or a checker",
            )
        )
    check: Check = found.checkMotion
    return check


def _all_of(checks: Sequence[Check]) -> Callable[[Any, Any, Any], bool]:
    """Return the method that asks all checks in turn."""
    if len(checks) == 1:
        (only,) = checks
        return lambda _, first, second: only(first, second)
    return lambda _, first, second: all(check(first, second) for check in checks)


def _along_lines(checker: Collisions) -> Check:
    """Return the check of straight motions for collisions."""
    is_clear: Callable[[float, float, float, float], bool] = _never_clear
    if isinstance(checker, CollisionChecker):
        is_clear = checker.is_line_clear

    def check(first: Any, second: Any) -> bool:
        if is_clear(first.getX(), first.getY(), second.getX(), second.getY()):
            return True
        return bool(
            checker.is_motion_free(Move.straight(pose_of(first), pose_of(second)))
        )

    return check


def _never_clear(_x0: float, _y0: float, _x1: float, _y1: float) -> bool:
    return False
