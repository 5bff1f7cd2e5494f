"""Whether a pose is valid, for OMPL programs."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from typing import Any, Protocol

from configspace import PermissibleSpace
from configspace.errors import InvalidInput, Problem
from configspace.space import require_space
from omniplan.obstacles import CollisionChecker
from omniplan.sampling.ompl_bindings import base
from omniplan.sampling.state_spaces import require_se2

__all__ = [
    "Collisions",
    "StateValidityChecker",
    "pose_of",
    "require_checker",
    "validity_checker",
    "with_method",
]

Pose = tuple[float, float, float]


class Collisions(Protocol):
    """What is asked of a collision checker; `omniplan.obstacles` has one."""

    def is_free(self, pose: Any) -> bool:
        """Return whether the vehicle may stand at (x, y, θ)."""

    def is_motion_free(self, motion: Any) -> bool:
        """Return whether the vehicle may drive a `Move`, both ends included."""

    def distance(self, pose: Any) -> float:
        """Return the distance to the nearest obstacle, m; 0 if one is hit."""


class StateValidityChecker(base.StateValidityChecker):  # type: ignore[misc]
    """Whether a pose is within the bounds of the space and free of collisions."""

    # Without a dict its methods are found quicker.
    __slots__ = ("__weakref__", "_checker")

    def __init__(self, si: Any, checker: Collisions | None) -> None:
        super().__init__(si)
        self._checker = checker

    def clearance(self, state: Any) -> float:
        """Return the distance to the nearest obstacle, m; infinite without any."""
        if self._checker is None:
            return math.inf
        return float(self._checker.distance(pose_of(state)))


def validity_checker(
    si: Any, space: PermissibleSpace, checker: Collisions | None = None
) -> StateValidityChecker:
    """Return a state validity checker for SE(2).

    A pose alone asks nothing of the wheels: it is valid within the bounds of the state
    space and free of collisions. What the wheels permit is judged by the motion.

    Parameters
    ----------
    si : ompl.base.SpaceInformation
        Over SE(2), Dubins' or Reeds and Shepp's space; states are poses of K.
    space : PermissibleSpace
        Of the vehicle.
    checker : Collisions, optional
        Such as `omniplan.obstacles.CollisionChecker`.

    Raises
    ------
    InvalidInput
        If the state space is another one, the space is none, or the checker is none or
        that of another vehicle.
    """
    require_space(space)
    require_checker(checker, space)
    # Space informations ask quicker than state spaces. `si` itself is not kept: it
    # keeps the checker, and OMPL's pointers would keep both for ever.
    is_within = base.SpaceInformation(require_se2(si)).satisfiesBounds
    is_valid: Callable[[Any, Any], bool]
    if checker is None:

        def is_valid(_: Any, state: Any) -> bool:
            answer: bool = is_within(state)
            return answer

    elif isinstance(checker, CollisionChecker):
        is_valid = _valid_on_open_floor(is_within, checker)
    else:
        is_free = checker.is_free

        def is_valid(_: Any, state: Any) -> bool:
            return is_within(state) and bool(is_free(pose_of(state)))

    kind = with_method(StateValidityChecker, "isValid", is_valid)
    made: StateValidityChecker = kind(si, checker)
    return made


def _valid_on_open_floor(
    is_within: Callable[[Any], bool], checker: CollisionChecker
) -> Callable[[Any, Any], bool]:
    """Return the method `isValid` that decides most states by a look at the open floor.

    The longest open run of a column comes first, as it needs no further call.
    """
    is_free, floor = checker.is_free, checker.open_floor
    longest, ends, shift = floor.longest, floor.ends, floor.shift
    # Asked through the class they answer quicker than as methods of a state.
    x_of, y_of = base.SE2StateType.getX, base.SE2StateType.getY

    def is_valid(_: Any, state: Any) -> bool:
        if not is_within(state):
            return False
        try:
            low, high = longest[x_of(state) + shift]
            if low < y_of(state) < high:
                return True
            if bisect_right(ends[x_of(state) + shift], y_of(state)) % 2:
                return True
        except KeyError:  # a column that nothing is known of, or not finite
            pass
        return is_free(pose_of(state))

    return is_valid


def require_checker(checker: object, space: PermissibleSpace) -> None:
    """Raise InvalidInput unless collisions of the vehicle can be asked for, or None."""
    asked = ("is_free", "is_motion_free", "distance")
    if checker is not None and not all(
        callable(getattr(checker, name, None)) for name in asked
    ):
        allowed = f"a CollisionChecker, or anything with {', '.join(asked)}"
        raise InvalidInput(Problem("checker", type(checker).__name__, allowed))
    if isinstance(checker, CollisionChecker):
        checker.require_body_of(space)


def with_method(kind: Any, name: str, method: Callable[..., bool]) -> Any:
    """Return a class with one more method.

    A function that finds all it needs in its closure answers OMPL in two thirds of the
    time of one that looks for it in `self`.
    """
    inside = {name: method, "__doc__": kind.__doc__, "__slots__": ()}
    return type(kind.__name__, (kind,), inside)


def pose_of(state: Any) -> Pose:
    """Return (x, y, θ) of a state of SE(2), m, m, rad."""
    return state.getX(), state.getY(), state.getYaw()
