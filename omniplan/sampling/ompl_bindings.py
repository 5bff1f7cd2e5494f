"""Validity checks for OMPL programs; the one module that imports OMPL.

What of OMPL 2.0.1's Python bindings this relies on is kept by
``tests/unit/omniplan/test_ompl_bindings.py``: C++ calls `isValid`, `clearance` and
`checkMotion` with two states of Python classes. It never asks Python for the last valid
state of a motion (`checkMotion` with three arguments is answered by the one with two,
and "nothing of it" stays as the share): see `MotionValidator.last_valid`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from ompl import base, control, geometric, util

from configspace import PermissibleSpace
from configspace.errors import InvalidInput, Problem
from configspace.omni_curve import finite
from configspace.space import require_space
from omniplan.obstacles import CollisionChecker
from omniplan.planning.moves import Move
from omniplan.sampling.curves import along_curves
from omniplan.sampling.intervals import PermittedIntervals
from omniplan.sampling.line_radius import is_radius_permitted, least_radius
from omniplan.sampling.lines import lines_permitted

__all__ = [
    "Collisions",
    "MotionValidator",
    "StateValidityChecker",
    "base",
    "bounds_of",
    "control",
    "equip",
    "geometric",
    "line_space",
    "motion_validator",
    "quiet",
    "seeded",
    "util",
    "validity_checker",
]

FloatArray = npt.NDArray[np.float64]
Pose = tuple[float, float, float]

Check = Callable[[Any, Any], bool]


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

    def __init__(self, si: Any, checker: Collisions | None) -> None:
        super().__init__(si)
        self._checker = checker

    def clearance(self, state: Any) -> float:
        """Return the distance to the nearest obstacle, m; infinite without any."""
        if self._checker is None:
            return math.inf
        return float(self._checker.distance(_pose(state)))


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


def _with_method(kind: Any, name: str, method: Callable[..., bool]) -> Any:
    """Return a class with one more method.

    A function that finds all it needs in its closure answers OMPL in two thirds of the
    time of one that looks for it in `self`.
    """
    return type(kind.__name__, (kind,), {name: method, "__doc__": kind.__doc__})


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
        If the state space is another one, or the space is none.
    """
    require_space(space)
    is_within = _require_se2(si).satisfiesBounds
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
            return is_within(state) and bool(is_free(_pose(state)))

    kind = _with_method(StateValidityChecker, "isValid", is_valid)
    made: StateValidityChecker = kind(si, checker)
    return made


def _valid_on_open_floor(
    is_within: Callable[[Any], bool], checker: CollisionChecker
) -> Callable[[Any, Any], bool]:
    """Return the method `isValid` that decides most states by one look into a set."""
    is_free, floor = checker.is_free, math.floor
    cells, scale = checker.open_floor

    def is_valid(_: Any, state: Any) -> bool:
        if not is_within(state):
            return False
        try:
            if (floor(state.getX() * scale), floor(state.getY() * scale)) in cells:
                return True
        except (ValueError, OverflowError):  # not finite: the checker says it better
            pass
        return is_free(_pose(state))

    return is_valid


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
        If the state space is another one, the space is none, or the curves are tighter
        than the vehicle can drive.
    """
    require_space(space)
    state_space = _require_se2(si)
    intervals = PermittedIntervals(space, reachable_only)
    if ask_states is None:
        ask_states = checker is None
    stepwise = [_stepwise(si)] if ask_states else []
    if not _is_plain(state_space):
        radius = _radius_of(state_space)
        _require_radius(intervals, radius)
        checks = [] if checker is None else [along_curves(state_space, checker, radius)]
        method = _all_of([*checks, *stepwise])
    else:
        along = [] if checker is None else [_along_lines(checker)]
        others = _all_of([*along, *stepwise]) if along or stepwise else None
        method = lines_permitted(state_space, intervals.table, others)
    made: MotionValidator = _with_method(MotionValidator, "checkMotion", method)(
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
    curved = not _is_plain(si.getStateSpace())
    # Straight motions between states within the bounds stay there; curves may not.
    motion = motion_validator(si, space, checker, ask_states=curved and checker is None)
    si.setStateValidityChecker(validity_checker(si, space, checker))
    si.setMotionValidator(motion)


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


def bounds_of(bounds: tuple[float, float, float, float]) -> Any:
    """Return bounds for the position.

    Parameters
    ----------
    bounds : (x_min, y_min, x_max, y_max), m

    Returns
    -------
    bounds : ompl.base.RealVectorBounds

    Raises
    ------
    InvalidInput
        Unless the numbers are finite and least ones are less than largest ones.
    """
    numbers = finite("bounds", bounds, "m")
    if numbers.shape != (4,) or not (numbers[:2] < numbers[2:]).all():
        allowed = "(x_min, y_min, x_max, y_max) in m, least below largest"
        raise InvalidInput(Problem("bounds", f"{bounds}", allowed))
    x_min, y_min, x_max, y_max = numbers.tolist()
    out = base.RealVectorBounds(2)
    for axis, low, high in ((0, x_min, x_max), (1, y_min, y_max)):
        out.setLow(axis, low)
        out.setHigh(axis, high)
    return out


@contextmanager
def quiet() -> Iterator[None]:
    """Keep OMPL from printing; its log level holds for the whole process."""
    before = util.getLogLevel()
    util.setLogLevel(util.LogLevel.LOG_NONE)
    try:
        yield
    finally:
        util.setLogLevel(before)


def seeded(seed: int) -> None:
    """Make OMPL's random numbers repeatable from here on, for the whole process.

    Parameters
    ----------
    seed : int, 1 to 2**32 - 1
        What is made afterwards - samplers, planners - is repeatable, although OMPL says
        otherwise after the first time; that line is kept from being printed.

    Raises
    ------
    InvalidInput
        If the seed is out of range; 0 would mean the time of day to OMPL.
    """
    if not 1 <= seed < 2**32:
        raise InvalidInput(Problem("seed", f"{seed}", "1 to 4294967295"))
    with quiet():
        util.RNG.setSeed(int(seed))


def _require_se2(si: Any) -> Any:
    """Return the state space of `si` if states are poses."""
    state_space = si.getStateSpace()
    if not isinstance(state_space, base.SE2StateSpace):
        given = type(state_space).__name__
        allowed = "SE2StateSpace, DubinsStateSpace or ReedsSheppStateSpace"
        raise InvalidInput(Problem("si: state space", given, allowed))
    if isinstance(state_space, base.TrochoidStateSpace):
        allowed = "curves relative to the ground, not to a moving medium"
        raise InvalidInput(Problem("si: state space", "TrochoidStateSpace", allowed))
    return state_space


def _is_plain(state_space: Any) -> bool:
    """Return whether states are joined by straight lines."""
    curved = (base.DubinsStateSpace, base.ReedsSheppStateSpace)
    return not isinstance(state_space, curved)


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


def _pose(state: Any) -> Pose:
    return state.getX(), state.getY(), state.getYaw()


def _along_lines(checker: Collisions) -> Check:
    """Return the check of straight motions for collisions."""
    is_clear: Callable[[float, float, float, float], bool] = _never_clear
    if isinstance(checker, CollisionChecker):
        is_clear = checker.is_line_clear

    def check(first: Any, second: Any) -> bool:
        if is_clear(first.getX(), first.getY(), second.getX(), second.getY()):
            return True
        return bool(checker.is_motion_free(Move.straight(_pose(first), _pose(second))))

    return check


def _never_clear(_x0: float, _y0: float, _x1: float, _y1: float) -> bool:
    return False


def _radius_of(state_space: Any) -> float:
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


def _require_radius(intervals: PermittedIntervals, radius: float) -> None:
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
