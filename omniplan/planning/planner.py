"""Planning: from pose to pose, such that the vehicle can drive it.

The configuration of the wheels belongs to the state: a way is a chain of moves in which
the wheels hold or follow their configuration, and where the next move needs another
one the vehicle stops and steers, which takes its time.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from configspace import PermissibleSpace
from omniplan.planning.blend import rounded_off
from omniplan.planning.connect import Connector
from omniplan.planning.easing import eased_off
from omniplan.planning.finish import finished, steering_wait
from omniplan.planning.improve import GAIN, moves_of, shortened
from omniplan.planning.request import Request, checked_request, refusal
from omniplan.planning.result import Plan, PlanStatus
from omniplan.planning.route import Route
from omniplan.planning.search import ENDLESS, OPTIMISING, Found, direct, search
from omniplan.planning.start_up import make_ready
from omniplan.planning.task import FIRST_TRY, RESTARTS, Task
from omniplan.trajectory import Trajectory
from omniplan.validation import validate

__all__ = ["plan"]

STANDING = 1e-3
"""Duration of a plan from a pose to itself, s."""
EXPLORED = 0.4
"""Share of the time and motions after which a planner that goes on for ever ends: the
rest makes its way shorter."""
MOST_FINISHED = 3
"""Of so many ways the corners are rounded, and all are timed and proved, those that are
hoped to be the quickest first, until one is accepted."""
MOST_EASED = 8
"""Of so many ways the arcs are eased."""

Statistics = dict[str, float | int | str]


def plan(
    start: npt.ArrayLike,
    goal: npt.ArrayLike,
    space: PermissibleSpace,
    obstacles: object = None,
    *,
    bounds: npt.ArrayLike | None = None,
    clearance: float = 0.0,
    planner: str = "RRTConnect",
    time: float = 5.0,
    seed: int = 1,
    iterations: int | None = None,
    method: Literal["geometric", "control"] = "geometric",
    heading: Literal["free", "keep"] = "free",
    checkpoint: Callable[[], None] | None = None,
) -> Plan:
    """Return the quickest trajectory found from pose to pose, or why there is none.

    A plan that is found has been accepted by `validate` and proved to meet nothing; it
    starts and ends at rest. It is a chain of moves in which the wheels' configuration
    is permitted throughout; between them the vehicle stands and steers.

    Parameters
    ----------
    start, goal : (3,) or (5,) float, m, m, rad, 1, rad
        (x, y, θ) of K in the world frame. (x, y, θ, κ_n, β) asks for a configuration of
        the wheels as well: at rest they are turned from the one at the start, and to
        the one at the goal. At κ_n = ±2 any β is the same.
    space : PermissibleSpace
        With its vehicle: timing needs limits that a data sheet does not tell.
    obstacles : Obstacles or CollisionChecker, optional
        By default nothing stands in the way. A checker brings its own clearance and
        bounds.
    bounds : (4,) float, m, optional
        (x0, y0, x1, y1): the footprint stays inside. By default poses are looked for
        around start, goal and obstacles.
    clearance : float, m, ≥ 0
        Distance to keep from obstacles and bounds.
    planner : str
        Of OMPL: ``RRTConnect`` (a first way soon, then short cuts and new searches),
        ``RRT``, ``KPIECE1``, ``BKPIECE1``, ``LBKPIECE1``; ``RRTstar``,
        ``InformedRRTstar``, ``BITstar`` and ``FMT`` minimise the travel time. With
        ``method="control"`` only ``RRT``, which is the default there, and ``KPIECE1``.
    time : float, s, > 0
        For the search; timing and proof come on top, and so does what is done once: a
        first plan compiles kernels, the first one of a vehicle makes its tables. It
        ends earlier once several searches in a row have found nothing quicker.
    seed : int, [1, 2**31)
    iterations : int, > 0, optional
        So many motions are checked for collisions at most: with enough time the same
        seed gives the same plan.
    method : {"geometric", "control"}
        Chains of moves, or motions with the rates of (κ_n, β, v_s) as controls.
    heading : {"free", "keep"}
        With ``keep`` the vehicle only translates, in any direction it can: its load
        keeps its heading all along. Whether it can at all, the status says.
    checkpoint : callable, optional
        Called every few milliseconds, from the search to the proof; what it raises
        ends the work and reaches the caller. So a plan can be given up.

    Returns
    -------
    Plan
        With the statistics ``planner``, ``seed``, ``time_to_first`` (until a way was
        known, proved permitted and free), ``time`` (all), ``iterations`` and
        ``searches``.

    Raises
    ------
    InvalidInput
        For values that make no sense; obstacles in the way are no error.

    References
    ----------
    spec/omni-curve §1, §5; J. Kuffner, S. LaValle, RRT-Connect, ICRA 2000.

    Examples
    --------
    >>> import configspace, omniplan
    >>> space = configspace.build_space(
    ...     configspace.load_vehicle("mecanum"), cache=False)
    >>> found = omniplan.plan([0, 0, 0], [2, 1, 0], space)
    >>> found.status.name, found.stops
    ('FOUND', 0)
    """
    request = checked_request(
        start,
        goal,
        space,
        obstacles,
        bounds=bounds,
        clearance=clearance,
        planner=planner,
        time=time,
        seed=seed,
        iterations=iterations,
        method=method,
        heading=heading,
        checkpoint=checkpoint,
    )
    no = refusal(request)
    if no is not None:
        return no
    if request.is_at_goal:
        return _standing(request)
    make_ready(request.connector, method)
    request.task.budget.start()
    if method == "control":
        return _controlled(request)
    return _geometric(request)


def _geometric(request: Request) -> Plan:
    task = request.task
    ways, searches = _ways(task, request.connector)
    statistics: Statistics = {**request.statistics, "searches": searches}
    if not ways:
        return _nothing(request, statistics)
    statistics["time_to_first"] = min(found.at for found in ways)
    routes = _routes(task, request.connector, ways)
    return _first_proved(request, routes, statistics)


def _first_proved(
    request: Request, routes: Iterable[Route], statistics: Statistics
) -> Plan:
    """Return the plan of the first route that is accepted, else that of the first."""
    plans: list[Plan] = []
    for route in routes:
        plan = finished(request.task, request.ends, request.strict, route, statistics)
        spent = {**plan.statistics, **_spent(request.task)}
        plans.append(replace(plan, statistics=spent))
        if plan.is_found:
            return plans[-1]
    return plans[0]


def _routes(task: Task, connector: Connector, ways: list[Found]) -> Iterator[Route]:
    """Yield routes to try, the one that is hoped to be quickest first."""
    chains = [moves_of(way.chain) for way in ways[:MOST_EASED]]
    routes = [Route.from_moves(moves) for moves in chains[:MOST_FINISHED]]
    rounded = [rounded_off(task, connector.permits, route) for route in routes]
    eased = [eased_off(task, connector, moves) for moves in chains]
    good = [*rounded, *(pair for pair in eased if pair is not None)]
    for route, _ in sorted(good, key=operator.itemgetter(1))[: 2 * MOST_FINISHED]:
        yield route
    for (route, _), plain in zip(rounded, routes, strict=True):
        if len(plain.stops) > len(route.stops):
            yield plain


def _ways(task: Task, connector: Connector) -> tuple[list[Found], int]:
    """Return ways to the goal, the quickest one first, and the number of searches."""
    random = np.random.default_rng(task.seed)
    first = direct(task, connector)
    ways = [] if first is None else [first]
    searches, stale = 0, 0
    if not _is_enough(task, ways) and first is not None:
        _improve(task, connector, ways, first, random)
    while not _is_enough(task, ways) and stale < RESTARTS:
        searches += 1
        best = _quickest(ways)
        found, is_cut_short = _searched(task, connector, searches)
        if found is not None:
            ways.append(found)
            task.budget.has_way = True
            _improve(task, connector, ways, found, random)
        is_better = _quickest(ways) < best - GAIN
        stale = 0 if is_better or is_cut_short else stale + 1
        if task.planner in OPTIMISING and found is not None:
            break
    return sorted(ways, key=lambda way: way.duration), searches


def _searched(
    task: Task, connector: Connector, number: int
) -> tuple[Found | None, bool]:
    """Return what the search of a number found, and whether it was cut short."""
    budget, seed = task.budget, task.seed + number
    if task.planner in OPTIMISING:
        share = EXPLORED if task.planner in ENDLESS and number == 1 else 1.0
        found = search(task, connector, seed, share=share)
        return found, found is None and share < 1
    if budget.has_way:
        return search(task, connector, seed, budget.patience), False
    # How long a first way takes varies much from seed to seed: the search starts anew
    # after so many motions; then one that grows its trees in short steps gets half as
    # many. With each such pair both numbers are doubled.
    pair, is_short = divmod(number - 1, 2)
    most = FIRST_TRY * 2**pair // (1 + is_short)
    last = budget.asked + most
    found = search(task, connector, seed, most, in_short_steps=bool(is_short))
    return found, found is None and budget.asked >= last


def _improve(
    task: Task,
    connector: Connector,
    ways: list[Found],
    found: Found,
    random: np.random.Generator,
) -> None:
    better = shortened(task, connector, found, random)
    if better.duration < found.duration:
        ways.append(better)


def _quickest(ways: list[Found]) -> float:
    return min((way.duration for way in ways), default=math.inf)


def _is_enough(task: Task, ways: list[Found]) -> bool:
    """Return whether the search must end, or nothing can be quicker."""
    task.budget.has_way = bool(ways)
    if task.budget.is_enclosed:
        return True
    return task.budget.is_over or any(way.is_best for way in ways)


def _controlled(request: Request) -> Plan:
    from omniplan.planning import controls

    found = controls.explored(request.task, request.connector)
    statistics: Statistics = {**request.statistics, "searches": found.searches}
    if not found.routes:
        return _nothing(request, statistics)
    statistics["time_to_first"] = found.first_at
    return _first_proved(request, found.routes, statistics)


def _spent(task: Task) -> dict[str, float | int | str]:
    return {"time": task.budget.elapsed, "iterations": task.budget.asked}


def _nothing(request: Request, statistics: Statistics) -> Plan:
    task = request.task
    if task.budget.is_enclosed is None:
        task.budget.is_enclosed = task.is_enclosed()
    if task.budget.is_enclosed:
        name, unreachable = task.space.name, PlanStatus.UNREACHABLE
        message = (
            f"{name}: {unreachable.value}: obstacles or bounds part the goal from the "
            "start: not even the largest disc about K inside the footprint gets through"
        )
        spent = {**statistics, **_spent(task)}
        return Plan(name, unreachable, message, place=task.goal, statistics=spent)
    message = (
        f"{task.space.name}: no way was found in {task.budget.elapsed:.1f} s "
        f"and {task.budget.asked} motions; there may be one"
    )
    spent = {**statistics, **_spent(task)}
    return Plan(task.space.name, PlanStatus.TIMEOUT, message, statistics=spent)


def _standing(request: Request) -> Plan:
    """Return the plan from a pose to itself: the wheels turn, if at all."""
    task, ends = request.task, request.ends
    wait = 0.0
    if ends.start is not None and ends.goal is not None:
        wait = steering_wait(task, ends.start, ends.goal)
    name = task.space.name
    statistics = {**request.statistics, **_spent(task)}
    if math.isinf(wait):
        message = f"{name}: at rest the wheels find no way to the configuration asked"
        status = PlanStatus.NOT_PROVED
        return Plan(name, status, message, place=task.start, statistics=statistics)
    reference = task.vehicle.reference
    trajectory = Trajectory.from_poses(
        [0.0, max(wait * (1 + 1e-6), STANDING)],
        [task.start, task.start],
        name="plan",
        reference_point=(reference.real, reference.imag),
    )
    report = validate(trajectory, task.space)
    message = f"{name}: it stands at the goal already, its wheels turn in {wait:.2f} s"
    found = PlanStatus.FOUND
    return Plan(name, found, message, trajectory, report, statistics=statistics)
