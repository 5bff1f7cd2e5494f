"""An OMPL program that plans in SE(2), before and after it heeds its vehicle."""

import itertools
import math

import configspace
from omniplan import sampling
from omniplan.planning.moves import Move
from omniplan.sampling.ompl_bindings import base, geometric, quiet

HALL = (0.0, 0.0, 16.0, 9.0)
RADIUS = 0.45  # of the circle around the vehicle, m


def is_free(state: base.State) -> bool:
    """Return whether the vehicle's circle clears a wall with a gap in its middle."""
    x, y = state.getX(), state.getY()
    in_gap = 4.0 + RADIUS < y < 5.2 - RADIUS
    return in_gap or not 7.8 - RADIUS < x < 8.2 + RADIUS


def plan(space: configspace.PermissibleSpace | None) -> list[Move]:
    """Return the moves from one side of the wall to the other."""
    state_space = base.SE2StateSpace()
    state_space.setBounds(sampling.bounds_of(HALL))
    si = base.SpaceInformation(state_space)
    si.setStateValidityChecker(is_free)
    if space is not None:  # the one line that an existing program needs
        si.setMotionValidator(sampling.motion_validator(si, space))
    si.setup()
    start, goal = state_space.allocState(), state_space.allocState()
    start.setXY(2.0, 2.0)
    start.setYaw(0.0)
    goal.setXY(14.0, 7.0)
    goal.setYaw(math.pi / 2)
    problem = base.ProblemDefinition(si)
    problem.setStartAndGoalStates(start, goal)
    planner = geometric.RRTConnect(si)
    planner.setProblemDefinition(problem)
    planner.setup()
    planner.solve(5.0)
    if not problem.hasExactSolution():
        return []
    states = problem.getSolutionPath().getStates()
    poses = [(state.getX(), state.getY(), state.getYaw()) for state in states]
    return [Move.straight(a, b) for a, b in itertools.pairwise(poses)]


def drivable(moves: list[Move], space: configspace.PermissibleSpace) -> int:
    """Return how many moves the wheels permit, driven forwards or backwards."""
    intervals = sampling.PermittedIntervals(space)
    count = 0
    for move in moves:
        k, b0, b1 = move.kappa_n(space.kappa_g), move.beta_0, move.beta_1
        there = intervals.permits(k, b0, b1)
        back = intervals.permits(-k, b0 + math.pi, b1 + math.pi)
        count += there or back
    return count


def main() -> None:
    """Plan twice for a vehicle whose wheels turn by half a right angle or less."""
    space = configspace.build_space(configspace.load_vehicle("four-wheel-steering"))
    with quiet():
        for heeding in (None, space):
            sampling.seeded(3)
            moves = plan(heeding)
            who = "plain OMPL" if heeding is None else "with the motion validator"
            print(f"{who}: {drivable(moves, space)} of {len(moves)} moves drivable")


if __name__ == "__main__":
    main()
