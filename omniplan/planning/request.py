"""What is asked of planning: checked, and the answers that need no search."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy.typing as npt

from configspace import InvalidInput, PermissibleSpace, Problem, Vehicle
from configspace.kernels import BLOCKED
from configspace.limits import Reason
from configspace.space import require_space
from omniplan.planning import arguments, hall
from omniplan.planning.connect import Connector
from omniplan.planning.controls import CONTROL_PLANNERS
from omniplan.planning.finish import Ends
from omniplan.planning.moves import Move
from omniplan.planning.permits import Configuration, Permits
from omniplan.planning.result import Plan, PlanStatus
from omniplan.planning.search import PLANNERS
from omniplan.planning.task import Budget, Checker, Pose, Task

__all__ = ["Request", "checked_request", "refusal"]

METHODS = ("geometric", "control")
HEADINGS = ("free", "keep")
SAME = 5e-6
"""Start and goal that differ by less, m and rad, are one."""
LARGEST_SEED = 2**31 - 1
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
        return {"planner": self.task.planner, "seed": self.task.seed}

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
    heading: str,
    checkpoint: Callable[[], None] | None,
) -> Request:
    """Return a request, or raise InvalidInput saying what makes no sense.

    Parameters
    ----------
    start, goal, space, obstacles, bounds, clearance, planner, time, seed, iterations, \
method, heading, checkpoint
        As of `omniplan.plan`.
    """
    vehicle = _vehicle(space)
    a, from_ = arguments.end("start", start)
    b, to = arguments.end("goal", goal)
    if arguments.one_of("method", method, METHODS) == "control":
        # The default is the geometric method's.
        planner = CONTROL_PLANNERS[0] if planner == PLANNERS[0] else planner
        arguments.one_of("planner", planner, CONTROL_PLANNERS)
    arguments.one_of("planner", planner, PLANNERS)
    keeps_heading = arguments.one_of("heading", heading, HEADINGS) == "keep"
    if keeps_heading and method == "control":
        allowed = '"free" with method="control"'
        raise InvalidInput(Problem("heading", "'keep'", allowed))
    seconds = arguments.positive("time", time, "s")
    number = arguments.whole("seed", seed, 1, LARGEST_SEED)
    motions = None
    if iterations is not None:
        motions = arguments.whole("iterations", iterations, 1, None)
    connector = _connector(space, keeps_heading)
    strict, checker = hall.checkers(space, obstacles, bounds, clearance, (a, b))
    task = Task(
        a,
        b,
        space,
        vehicle,
        checker,
        hall.area_of(strict, connector, (a, b)),
        planner,
        number,
        Budget(seconds, motions, checkpoint=checkpoint),
    )
    return Request(task, Ends(from_, to), strict, connector, method)


def refusal(request: Request) -> Plan | None:
    """Return the answer if no search is needed to say no.

    Parameters
    ----------
    request : Request
    """
    if request.connector.is_stuck:
        message = "no configuration of the wheels is permitted: it cannot move"
        return _no(request, PlanStatus.UNREACHABLE, message, request.task.start)
    return _blocked(request) or _forbidden(request) or _turned(request)


def _blocked(request: Request) -> Plan | None:
    """Return the answer if the vehicle cannot stand at the start or the goal."""
    task = request.task
    for status, pose, name in (
        (PlanStatus.START_BLOCKED, task.start, "start"),
        (PlanStatus.GOAL_BLOCKED, task.goal, "goal"),
    ):
        if request.strict is None or request.strict.is_free(pose):
            continue
        hit = request.strict.first_hit(Move.straight(pose, pose))
        what = "is not free" if hit is None else str(hit.message)
        return _no(request, status, f"at the {name} it {what}", pose)
    return None


def _forbidden(request: Request) -> Plan | None:
    """Return the answer if a configuration that is asked for is not permitted."""
    task, ends = request.task, request.ends
    for status, at, pose, name in (
        (PlanStatus.START_NOT_PERMITTED, ends.start, task.start, "start"),
        (PlanStatus.GOAL_NOT_PERMITTED, ends.goal, task.goal, "goal"),
    ):
        why = "" if at is None else _not_permitted(task, at)
        if why:
            text = f"the configuration at the {name}, {why}"
            return _no(request, status, text, pose)
    return None


def _turned(request: Request) -> Plan | None:
    """Return the answer if the heading is kept and the goal asks for more than that."""
    task, space = request.task, request.task.space
    if not request.connector.is_translating or request.is_at_goal:
        return None
    why = "its wheels always point alike, so it keeps its heading"
    if not space.is_translating:
        why = "it shall keep its heading"
    turn = math.remainder(task.goal[2] - task.start[2], 2 * math.pi)
    if abs(turn) > SAME:
        ends = f"{_degrees(task.start[2])} at the start, {_degrees(task.goal[2])}"
        text = f"{why}: {ends} at the goal"
        return _no(request, PlanStatus.UNREACHABLE, text, task.goal)
    state = space.tables.state  # the rows on both sides of κ_n = 0
    if (state[(len(state) - 1) // 2 : len(state) // 2 + 1] == BLOCKED).all():
        text = f"{why}, but nothing is permitted at κ_n = 0: it moves only as it turns"
        return _no(request, PlanStatus.UNREACHABLE, text, task.start)
    if space.line_beta is not None:
        return _off_the_line(request, why, space.line_beta)
    return None


def _off_the_line(request: Request, why: str, line: float) -> Plan | None:
    """Return the answer if a vehicle bound to a line cannot drive straight there."""
    task = request.task
    dx, dy = (b - a for a, b in zip(task.start[:2], task.goal[:2], strict=True))
    off = math.remainder(math.atan2(dy, dx) - task.start[2] - line, math.pi)
    if math.hypot(dx, dy) * abs(math.sin(off)) > SAME:
        at, on = math.remainder(off + line, 2 * math.pi), _degrees(line)
        text = (
            f"{why}, and its fixed axle lets it drive only along β = {on} then, "
            f"but the goal lies at β = {_degrees(at)}"
        )
        return _no(request, PlanStatus.UNREACHABLE, text, task.goal)
    hit = None
    if request.strict is not None:
        hit = request.strict.first_hit(Move.straight(task.start, task.goal))
    if hit is not None:
        text = f"{why}, so there is the straight way only, on which it {hit.message}"
        return _no(request, PlanStatus.UNREACHABLE, text, hit.pose)
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
    what, who = " and ".join(names) or "a limit", ""
    if int(wheel) >= 0:
        # Several limits may be of several wheels: the first one is told.
        of = ", first" if len(names) > 1 else ""
        who = f"{of} of wheel {task.vehicle.wheels[int(wheel)].id}"
    where = f"κ_n = {at[0]:g}, β = {_degrees(at[1])}"
    return f"{where}, is forbidden by {what}{who}"


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):.1f}°"


@lru_cache(maxsize=VEHICLES)
def _permits(space: PermissibleSpace) -> Permits:
    return Permits(space, _vehicle(space))


@lru_cache(maxsize=2 * VEHICLES)
def _connector(space: PermissibleSpace, keeps_heading: bool) -> Connector:
    return Connector(_permits(space), keeps_heading=keeps_heading)


def _vehicle(space: PermissibleSpace) -> Vehicle:
    require_space(space)
    if space.vehicle is None:
        given = f"{space.name}: a data sheet alone"
        allowed = "planning needs the vehicle: a data sheet does not hold all its rates"
        raise InvalidInput(Problem("space", given, allowed))
    return space.vehicle
