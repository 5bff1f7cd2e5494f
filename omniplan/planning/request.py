"""What is asked of planning: checked, and the answers that need no search."""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass
from functools import lru_cache
from typing import cast

import numpy as np
import numpy.typing as npt

from configspace import InvalidInput, PermissibleSpace, Problem, Vehicle
from configspace.limits import Reason
from configspace.omni_curve import nominal_curvature
from configspace.space import require_space
from omniplan.planning.connect import Connector
from omniplan.planning.finish import Ends
from omniplan.planning.moves import Move
from omniplan.planning.permits import Configuration, Permits
from omniplan.planning.result import Plan, PlanStatus
from omniplan.planning.search import PLANNERS
from omniplan.planning.task import Bounds, Budget, Checker, Pose, Task
from omniplan.samples import MAX_VALUE

__all__ = ["Request", "checked_request", "refusal"]

METHODS = ("geometric", "control")
SAME = 5e-6
"""Start and goal that differ by less, m and rad, are one."""
LARGEST_SEED = 2**31 - 1
ROOM = 5.0
"""Where no bounds are given, poses are looked for within this distance at least, m."""
RADII = 4.0
"""... and within so many least radii ..."""
SHARE = 0.5
"""... and within this share of the size of the hall."""
SPARE = 1e-3
"""Moves keep so much more distance than asked for, where start and goal allow it, m:
the splines of a trajectory leave them by less."""


LEAST_SPARE = 1e-5
"""Less than this is not worth a second checker, m."""
VEHICLES = 16
"""For so many vehicles the tables of the search are kept."""


@dataclass(frozen=True, eq=False)
class Request:
    """A task and the configurations asked for at its ends."""

    task: Task
    ends: Ends
    strict: Checker | None
    """Keeps the distance that was asked for; that of the task a little more."""
    connector: Connector
    """Of the vehicle."""
    method: str

    @property
    def statistics(self) -> dict[str, float | int | str]:
        """What is known before the search."""
        planner = self.task.planner if self.method == "geometric" else self.method
        return {"planner": planner, "seed": self.task.seed}

    @property
    def is_at_goal(self) -> bool:
        """Whether the goal is the pose of the start."""
        a, b = self.task.start, self.task.goal
        turn = math.remainder(b[2] - a[2], 2 * math.pi)
        return math.dist(a[:2], b[:2]) <= SAME and abs(turn) <= SAME


def checked_request(
    start: npt.ArrayLike,
    goal: npt.ArrayLike,
    space: PermissibleSpace,
    obstacles: object,
    *,
    bounds: npt.ArrayLike | None,
    clearance: float,
    planner: str,
    time: float,
    seed: int,
    iterations: int | None,
    method: str,
) -> Request:
    """Return a request, or raise InvalidInput saying what makes no sense.

    Parameters
    ----------
    start, goal, space, obstacles, bounds, clearance, planner, time, seed, iterations, \
method
        As of `omniplan.plan`.
    """
    vehicle = _vehicle(space)
    a, from_ = _end("start", start)
    b, to = _end("goal", goal)
    _require_one_of("planner", planner, PLANNERS)
    _require_one_of("method", method, METHODS)
    seconds = _positive("time", time, "s")
    number = _whole("seed", seed, 1, LARGEST_SEED)
    motions = None if iterations is None else _whole("iterations", iterations, 1, None)
    connector = _connector(space)
    strict, checker = _checkers(space, obstacles, bounds, clearance, (a, b))
    task = Task(
        a,
        b,
        space,
        vehicle,
        checker,
        _area(strict, connector, (a, b)),
        planner,
        number,
        Budget(seconds, motions),
    )
    return Request(task, Ends(from_, to), strict, connector, method)


def refusal(request: Request) -> Plan | None:
    """Return the answer if no search is needed to say no.

    Parameters
    ----------
    request : Request
    """
    task, ends = request.task, request.ends
    if request.connector.is_stuck:
        message = "no configuration of the wheels is permitted: it cannot move"
        return _no(request, PlanStatus.UNREACHABLE, message, task.start)
    for status, pose, name in (
        (PlanStatus.START_BLOCKED, task.start, "start"),
        (PlanStatus.GOAL_BLOCKED, task.goal, "goal"),
    ):
        if request.strict is None or request.strict.is_free(pose):
            continue
        hit = request.strict.first_hit(Move.straight(pose, pose))
        what = "is not free" if hit is None else str(hit.message)
        return _no(request, status, f"at the {name} it {what}", pose)
    for status, at, pose, name in (
        (PlanStatus.START_NOT_PERMITTED, ends.start, task.start, "start"),
        (PlanStatus.GOAL_NOT_PERMITTED, ends.goal, task.goal, "goal"),
    ):
        if at is not None:
            why = _not_permitted(task, at)
            if why:
                text = f"the configuration at the {name}, {why}"
                return _no(request, status, text, pose)
    turn = math.remainder(task.goal[2] - task.start[2], 2 * math.pi)
    if task.space.is_translating and abs(turn) > SAME:
        message = (
            "its wheels always point alike, so it keeps its heading: "
            f"{_degrees(task.start[2])} at the start, {_degrees(task.goal[2])} at the "
            "goal"
        )
        return _no(request, PlanStatus.UNREACHABLE, message, task.goal)
    return None


def _no(request: Request, status: PlanStatus, text: str, place: Pose) -> Plan:
    name = request.task.space.name
    return Plan(
        name,
        status,
        f"{name}: {status.value}: {text}",
        place=place,
        statistics={**request.statistics, "time": request.task.budget.elapsed},
    )


def _not_permitted(task: Task, at: Configuration) -> str:
    """Return which limit forbids a configuration; nothing if none does."""
    space = task.space
    if any(
        space.v_max(*at, reverse=reverse, reachable_only=True) > 0
        for reverse in (False, True)
    ):
        return ""
    reason, wheel = space.explain(*at)
    names = [flag.name or "" for flag in Reason(int(reason))]
    who = f" of wheel {task.vehicle.wheels[int(wheel)].id}" if int(wheel) >= 0 else ""
    what = " and ".join(names) or "a limit"
    where = f"κ_n = {at[0]:g}, β = {_degrees(at[1])}"
    return f"{where}, is forbidden by {what}{who}"


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):.1f}°"


@lru_cache(maxsize=VEHICLES)
def _connector(space: PermissibleSpace) -> Connector:
    return Connector(Permits(space, _vehicle(space)))


def _vehicle(space: PermissibleSpace) -> Vehicle:
    require_space(space)
    if space.vehicle is None:
        given = f"{space.name}: a data sheet alone"
        allowed = "planning needs the vehicle: a data sheet does not hold all its rates"
        raise InvalidInput(Problem("space", given, allowed))
    return space.vehicle


def _end(name: str, value: npt.ArrayLike) -> tuple[Pose, Configuration | None]:
    """Return pose and configuration of the start or the goal."""
    allowed = "(x, y, θ) or (x, y, θ, κ_n, β): finite numbers, m, m, rad, 1, rad"
    try:
        given = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidInput(Problem(name, repr(value)[:60], allowed)) from error
    if given.shape not in ((3,), (5,)) or not np.isfinite(given).all():
        raise InvalidInput(Problem(name, repr(value)[:60], allowed))
    if np.abs(given).max() > MAX_VALUE:
        allowed = f"numbers of at most {MAX_VALUE:g}"
        raise InvalidInput(Problem(name, repr(value)[:60], allowed))
    x, y, theta, *rest = given.tolist()
    if not rest:
        return (x, y, theta), None
    try:
        nominal_curvature(rest[0])
    except InvalidInput as error:
        raise InvalidInput(error.problems, name) from error
    return (x, y, theta), (rest[0], math.remainder(rest[1], 2 * math.pi))


def _require_one_of(name: str, value: object, allowed: tuple[str, ...]) -> None:
    if value not in allowed:
        choice = f"one of {', '.join(allowed)}"
        raise InvalidInput(Problem(name, repr(value)[:60], choice))


def _positive(name: str, value: object, unit: str) -> float:
    is_number = isinstance(value, int | float | np.number) and value is not True
    if not is_number or not 0 < cast(float, value) < math.inf:
        allowed = f"a positive, finite number of {unit}"
        raise InvalidInput(Problem(name, repr(value)[:60], allowed))
    return float(cast(float, value))


def _whole(name: str, value: object, least: int, largest: int | None) -> int:
    allowed = f"a whole number, at least {least}"
    if largest is not None:
        allowed += f", at most {largest}"
    try:
        number = operator.index(cast(int, value))
    except TypeError as error:
        raise InvalidInput(Problem(name, repr(value)[:60], allowed)) from error
    if isinstance(value, bool) or number < least or number > (largest or number):
        raise InvalidInput(Problem(name, repr(value)[:60], allowed))
    return number


def _checkers(
    space: PermissibleSpace,
    obstacles: object,
    bounds: npt.ArrayLike | None,
    clearance: float,
    ends: tuple[Pose, Pose],
) -> tuple[Checker | None, Checker | None]:
    """Return the checker that was asked for, and one that keeps a little more off."""
    from omniplan.obstacles import CollisionChecker, Obstacles

    if isinstance(obstacles, CollisionChecker):
        if bounds is not None or clearance != 0.0:
            allowed = "a CollisionChecker brings its own bounds and clearance"
            raise InvalidInput(Problem("bounds, clearance", "given as well", allowed))
        return obstacles, obstacles
    if obstacles is None and bounds is None:
        return None, None
    if obstacles is not None and not isinstance(obstacles, Obstacles):
        allowed = "Obstacles, or a CollisionChecker"
        raise InvalidInput(Problem("obstacles", type(obstacles).__name__, allowed))
    area = None if bounds is None else np.asarray(bounds).ravel().tolist()
    strict = CollisionChecker(space, obstacles, clearance, area)
    room = min(strict.distance(pose) for pose in ends) - clearance
    spare = min(SPARE, room / 2)
    if spare < LEAST_SPARE:
        return strict, strict
    return strict, CollisionChecker(space, obstacles, clearance + spare, area)


def _area(
    checker: Checker | None, connector: Connector, ends: tuple[Pose, Pose]
) -> Bounds:
    """Return where K is looked for."""
    x = [pose[0] for pose in ends]
    y = [pose[1] for pose in ends]
    bounds = getattr(checker, "bounds", None)
    if bounds is not None:
        return (
            min(bounds[0], *x), min(bounds[1], *y),
            max(bounds[2], *x), max(bounds[3], *y),
        )  # fmt: skip
    hall = getattr(getattr(checker, "obstacles", None), "bounds", None)
    if hall is not None:
        x, y = [*x, hall[0], hall[2]], [*y, hall[1], hall[3]]
    size = max(max(x) - min(x), max(y) - min(y))
    room = max(ROOM, SHARE * size, RADII * (connector.radius or 0.0))
    return min(x) - room, min(y) - room, max(x) + room, max(y) + room
