"""Planning with the rates of (κ_n, β) and the speed as controls.

The states are (x, y, θ, κ_n, β): a way is continuous in the configuration of the wheels
without a stop, wherever the vehicle does not reverse. OMPL's control planners pick the
state to go on from; of its Python bindings only the state propagator can be our own, so
that is where many controls are driven at once (`omniplan.planning.control_tree`): a
control of OMPL names a batch of them and one of those in it that are permitted and meet
nothing. OMPL hits a pose with no control but by chance; the tree does.

References
----------
S. LaValle, J. Kuffner, Randomized kinodynamic planning, IJRR 2001; spec/omni-curve §4.
"""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass
from typing import Any

from omniplan.planning.blend import rounded_off
from omniplan.planning.connect import Connector
from omniplan.planning.control_tree import State, Tree
from omniplan.planning.improve import GAIN
from omniplan.planning.route import Route
from omniplan.planning.task import RESTARTS, Task

__all__ = [
    "CONTROL_PLANNERS",
    "Explored",
    "explored",
    "make_ready",
]

CONTROL_PLANNERS = ("RRT", "KPIECE1")
"""Planners of OMPL that explore."""
MOST_ROUNDED = 5
"""Of so many ways the corners are rounded."""


@dataclass(frozen=True)
class Explored:
    """What the searches found."""

    routes: tuple[Route, ...]
    """The one that is hoped to be quickest first; empty: no way was found in time.
    Those with rounded corners come before what they were made of."""
    first_at: float
    """When a way was first known, s; inf: never."""
    searches: int
    """So many were begun."""


def explored(task: Task, connector: Connector) -> Explored:
    """Return what OMPL's control planners found, corners rounded off.

    They search again, each time with another seed, while there is time and one of the
    last `RESTARTS` searches found a quicker way.

    Parameters
    ----------
    task : Task
        With a planner of `CONTROL_PLANNERS`.
    connector : Connector
        Of the vehicle.
    """
    budget = task.budget
    ways: list[tuple[float, Route]] = []
    first_at, searches, stale = math.inf, 0, 0
    while stale < RESTARTS and not budget.is_over:
        most = budget.patience if ways else None
        tree = _searched(task, connector, task.seed + searches, most)
        best = min((time for time, _ in ways), default=math.inf)
        searches += 1
        stale += 1
        if tree.ways:
            way = tree.shortened(min(tree.ways, key=lambda way: way.time))
            first_at = min(first_at, tree.ways[0].at)
            ways.append((way.time, tree.route(way)))
            stale = 0 if way.time < best - GAIN else stale
        if not ways:
            break  # only the end of time, or a proof, ends a first search
        budget.has_way = True
    ways.sort(key=operator.itemgetter(0))
    plain = [route for _, route in ways[:MOST_ROUNDED]]
    return Explored(_routes(task, connector, plain), first_at, searches)


def _routes(task: Task, connector: Connector, plain: list[Route]) -> tuple[Route, ...]:
    """Return routes with corners rounded off, the quickest first, and then as given."""
    rounded = [rounded_off(task, connector.permits, route) for route in plain]
    good = [route for route, _ in sorted(rounded, key=operator.itemgetter(1))]
    pairs = zip(plain, rounded, strict=True)
    left = [old for old, (new, _) in pairs if len(new.stops) < len(old.stops)]
    return (*good, *left)


def _searched(task: Task, connector: Connector, seed: int, most: int | None) -> Tree:
    """Return the tree of one search."""
    from omniplan.sampling import ompl_bindings as ompl

    ompl.seeded(seed)
    tree = Tree(task, connector, seed, most)
    with ompl.quiet():
        _explore(tree, ompl)
    return tree


def make_ready(task: Task, connector: Connector) -> None:
    """Compile the kernels and make the vehicle's tables.

    Parameters
    ----------
    task : Task
        Any, of the vehicle.
    connector : Connector
    """
    tree = Tree(task, connector, task.seed)
    for state in tree.begin():
        tree.drive(state, 0.5, 0.0)
        tree.drive(state, 0.5, 1.0)
    for way in tree.ways:
        rounded_off(task, connector.permits, tree.route(way))


def _explore(tree: Tree, ompl: Any) -> None:
    """Let OMPL pick states to go on from until the tree is over."""
    base, control = ompl.base, ompl.control
    task = tree.task
    space = base.CompoundStateSpace(
        [base.SE2StateSpace(), base.RealVectorStateSpace(1), base.SO2StateSpace()],
        [1.0, 0.3, 0.3],
    )
    space.getSubspace(0).setBounds(ompl.bounds_of(task.bounds))
    space.getSubspace(1).setBounds(-2.0, 2.0)
    choices = control.RealVectorControlSpace(space, 2)
    choices.setBounds(_unit(base))
    information = control.SpaceInformation(space, choices)
    wound: dict[State, State] = {}

    def propagate(state: Any, chosen: Any, duration: float, result: Any) -> None:
        at = _read(state)
        end = tree.drive(wound.get(at, at), chosen[0], chosen[1])
        if end is None:
            result[1][0] = 9.0  # outside of its bounds: not valid
            return
        _write(result, end)
        wound[_read(result)] = end

    information.setStatePropagator(propagate)
    information.setStateValidityChecker(lambda state: abs(state[1][0]) <= 2.0)
    information.setPropagationStepSize(1.0)
    information.setMinMaxControlDuration(1, 1)
    information.setup()
    problem = base.ProblemDefinition(information)
    for given in tree.begin():
        state = space.allocState()
        _write(state, given)
        wound[_read(state)] = given
        problem.addStartState(state)
    goal = space.allocState()
    _write(goal, (*task.goal, 0.0, task.space.line_beta or 0.0))
    problem.setGoalState(goal, 1e-12)
    if tree.is_over or problem.getStartStateCount() == 0:
        return
    space.registerDefaultProjection(_position(base, space))
    planner = getattr(control, task.planner)(information)
    planner.setProblemDefinition(problem)
    planner.setup()
    planner.solve(base.PlannerTerminationCondition(lambda: tree.is_over))


def _position(base: Any, space: Any) -> Any:
    """Return the projection of states to their position."""

    class Position(base.ProjectionEvaluator):  # type: ignore[misc]
        def getDimension(self) -> int:
            return 2

        def project(self, state: Any, projection: Any) -> None:
            projection[0], projection[1] = state[0].getX(), state[0].getY()

        def defaultCellSizes(self) -> None:
            self.setCellSizes(0, 0.5)
            self.setCellSizes(1, 0.5)

    made = Position(space)
    made.defaultCellSizes()
    return made


def _unit(base: Any) -> Any:
    bounds = base.RealVectorBounds(2)
    bounds.setLow(0.0)
    bounds.setHigh(1.0)
    return bounds


def _read(state: Any) -> State:
    pose = state[0]
    return pose.getX(), pose.getY(), pose.getYaw(), state[1][0], state[2].value


def _write(state: Any, given: State) -> None:
    """Set a state; angles are wrapped to [-π, π): π itself is out of OMPL's bounds."""
    x, y, theta, kappa_n, beta = given
    state[0].setXY(x, y)
    state[0].setYaw((theta + math.pi) % (2 * math.pi) - math.pi)
    state[1][0] = kappa_n
    state[2].value = (beta + math.pi) % (2 * math.pi) - math.pi
