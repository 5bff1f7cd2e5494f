"""Searching a way from pose to pose with OMPL's geometric planners.

The states are poses; between two of them the connector finds permitted moves. Where a
vehicle can neither turn on the spot nor crab, distances are those of Reeds and Shepp
with its own least radius, so that what is near is near for this vehicle.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any

from omniplan.planning.connect import Chain, Connector, chain_time, joined
from omniplan.planning.task import Pose, Task

__all__ = ["ENDLESS", "OPTIMISING", "PLANNERS", "Found", "direct", "search"]

FIRST = ("RRTConnect", "RRT", "KPIECE1", "BKPIECE1", "LBKPIECE1")
ENDLESS = ("RRTstar", "InformedRRTstar", "BITstar")
"""These go on looking for quicker ways until their time is over."""
OPTIMISING = (*ENDLESS, "FMT")
PLANNERS = (*FIRST, *OPTIMISING)
CLOSED = 1e6
"""Estimated time of a motion that is not permitted, s."""
SHORTER = 0.25
"""Short steps of a planner's trees, as a share of OMPL's."""
DIRECT = 4
"""So many ways without a search are checked for collisions."""


@dataclass(frozen=True)
class Found:
    """A way that is permitted and free."""

    chain: Chain
    duration: float
    """Estimated, s."""
    at: float
    """When it was found, s from the beginning."""
    is_best: bool = False
    """Whether nothing that is known is quicker even where nothing stands in the way."""


def direct(task: Task, connector: Connector) -> Found | None:
    """Return a way without intermediate poses, if one is free.

    Parameters
    ----------
    task : Task
    connector : Connector
    """
    known = connector.thorough(task.start, task.goal)[:DIRECT]
    for i, (duration, chain) in enumerate(known):
        if task.budget.is_over:
            return None
        if task.are_free(leg[0].move for leg in chain):
            is_best = i == 0 and len(chain) == 1
            return Found(chain, duration, task.budget.elapsed, is_best)
    return None


def search(
    task: Task,
    connector: Connector,
    seed: int,
    most: int | None = None,
    *,
    share: float = 1.0,
    in_short_steps: bool = False,
) -> Found | None:
    """Return a way found by OMPL, or None.

    Parameters
    ----------
    task : Task
    connector : Connector
    seed : int, ≥ 1
    most : int, optional
        So many motions are checked at most.
    share : float, (0, 1]
        When so much of the task's time or motions is used up, it ends.
    in_short_steps : bool
        Whether trees grow in shorter steps than usual, of planners with restarts.
    """
    from omniplan.sampling import ompl_bindings as ompl

    run = _Run(task, connector, ompl, in_short_steps)
    ompl.seeded(seed)
    with ompl.quiet():
        last = math.inf if most is None else task.budget.asked + most
        poses = run.solve(last, share)
    if poses is None:
        return None
    chains = [run.chain(a, b) for a, b in itertools.pairwise(poses)]
    if any(chain is None for chain in chains):
        return None
    whole = joined([chain for chain in chains if chain is not None])
    at = run.first_at if run.first_at is not None else task.budget.elapsed
    return Found(whole, chain_time(connector.permits, whole), at)


class _Run:
    """One run of one planner."""

    def __init__(
        self, task: Task, connector: Connector, ompl: Any, in_short_steps: bool
    ) -> None:
        self._task, self._connector, self._ompl = task, connector, ompl
        self._in_short_steps = in_short_steps
        self._known: dict[tuple[Pose, Pose], Chain | None] = {}
        self.first_at: float | None = None

    def chain(self, a: Pose, b: Pose) -> Chain | None:
        """Return the moves between two poses if they are permitted and free."""
        key = a, b
        if key not in self._known:
            chain = self._connector.quick(a, b)
            moves = () if chain is None else (leg[0].move for leg in chain)
            free = chain is not None and self._task.are_free(moves)
            self._known[key] = chain if free else None
        return self._known[key]

    def solve(self, most: float, share: float) -> list[Pose] | None:
        """Return the poses of the way."""
        base, task = self._ompl.base, self._task
        space = self._space(base)
        information = base.SpaceInformation(space)
        run = self

        class Motions(base.MotionValidator):  # type: ignore[misc, name-defined]
            def checkMotion(self, *states: Any) -> bool:
                a, b = map(run.pose, states[:2])
                return run.chain(a, b) is not None

        information.setStateValidityChecker(lambda state: task.is_free(run.pose(state)))
        information.setMotionValidator(Motions(information))
        information.setup()
        problem = base.ProblemDefinition(information)
        problem.setStartAndGoalStates(
            self._state(space, task.start), self._state(space, task.goal), 1e-9
        )
        if task.planner in OPTIMISING:
            problem.setOptimizationObjective(self._objective(base, information))
        planner = getattr(self._ompl.geometric, task.planner)(information)
        planner.setProblemDefinition(problem)
        planner.setup()
        if self._in_short_steps and task.planner in FIRST:
            planner.setRange(SHORTER * planner.getRange())

        def is_over() -> bool:
            task.budget.check()
            if self.first_at is None and problem.hasExactSolution():
                self.first_at = task.budget.elapsed
            if task.budget.is_over or task.budget.asked >= most:
                return True
            if task.budget.is_beyond(share):
                return True
            return self.first_at is None and task.is_known_enclosed()

        planner.solve(base.PlannerTerminationCondition(is_over))
        if not problem.hasExactSolution():
            return None
        return [self.pose(state) for state in problem.getSolutionPath().getStates()]

    def pose(self, state: Any) -> Pose:
        """Return the pose that a state stands for."""
        if self._connector.is_translating:
            return state[0], state[1], self._task.start[2]
        return state.getX(), state.getY(), state.getYaw()

    def _state(self, space: Any, pose: Pose) -> Any:
        state = space.allocState()
        if self._connector.is_translating:
            state[0], state[1] = pose[:2]
        else:
            state.setXY(pose[0], pose[1])
            heading = math.remainder(pose[2], 2 * math.pi)
            # π itself is out of the bounds of SO(2), and planners wait for ever.
            state.setYaw(heading if heading < math.pi else -math.pi)
        return state

    def _space(self, base: Any) -> Any:
        """Return the space of poses; of places, where the heading cannot change."""
        radius = self._connector.radius
        if self._connector.is_translating:
            space = base.RealVectorStateSpace(2)
            space.setBounds(self._ompl.bounds_of(self._task.bounds))
            return space
        space = (
            base.SE2StateSpace()
            if radius is None
            else base.ReedsSheppStateSpace(radius)
        )
        space.setBounds(self._ompl.bounds_of(self._task.bounds))
        return space

    def _objective(self, base: Any, information: Any) -> Any:
        run, connector = self, self._connector

        class TravelTime(base.OptimizationObjective):  # type: ignore[misc]
            def motionCost(self, a: Any, b: Any) -> Any:
                key = run.pose(a), run.pose(b)
                chain = run._known.get(key) or connector.quick(*key)
                time = CLOSED if chain is None else chain_time(connector.permits, chain)
                return base.Cost(time)

        return TravelTime(information)
