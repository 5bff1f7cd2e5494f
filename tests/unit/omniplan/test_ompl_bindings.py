"""What OMPL's Python bindings do, as far as omniplan relies on it or warns of it.

These tests are about OMPL 2.0.1, not about omniplan: one that fails says that a release
changed what `omniplan.sampling.ompl_bindings` or its documentation builds on.
"""

from __future__ import annotations

import gc
import math
import subprocess
import sys
import weakref
from typing import Any

import pytest

from omniplan.sampling.ompl_bindings import (
    base,
    bounds_of,
    control,
    geometric,
    quiet,
    seeded,
    util,
)


@pytest.fixture(autouse=True)
def _silent() -> Any:
    with quiet():
        yield


def _se2() -> Any:
    space = base.SE2StateSpace()
    space.setBounds(bounds_of((0, 0, 10, 10)))
    return space


def _state(space: Any, x: float, y: float, theta: float = 0.0) -> Any:
    state = space.allocState()
    state.setXY(x, y)
    state.setYaw(theta)
    return state


def _problem(si: Any) -> Any:
    space = si.getStateSpace()
    problem = base.ProblemDefinition(si)
    problem.setStartAndGoalStates(_state(space, 1, 1), _state(space, 9, 1), 0.1)
    return problem


def _solve(si: Any, kind: str, problem: Any, seconds: float = 2.0) -> Any:
    planner = getattr(geometric, kind)(si)
    planner.setProblemDefinition(problem)
    planner.setup()
    return planner.solve(seconds)


class _Wall(base.StateValidityChecker):  # type: ignore[misc]
    def __init__(self, si: Any) -> None:
        super().__init__(si)
        self.calls = 0

    def isValid(self, state: Any) -> bool:
        self.calls += 1
        return not (4 < state.getX() < 6 and state.getY() < 8)

    def clearance(self, state: Any) -> float:
        return 1.5


class _Motions(base.MotionValidator):  # type: ignore[misc]
    def __init__(self, si: Any) -> None:
        super().__init__(si)
        self.arguments: list[int] = []

    def checkMotion(self, *states: Any) -> bool:
        self.arguments.append(len(states))
        return True


def test_state_validity_checkers_of_python_are_asked() -> None:
    si = base.SpaceInformation(_se2())
    si.setStateValidityChecker(_Wall(si))
    gc.collect()
    held = si.getStateValidityChecker()
    assert isinstance(held, _Wall)
    assert si.isValid(_state(si.getStateSpace(), 1, 1))
    assert not si.isValid(_state(si.getStateSpace(), 5, 1))
    assert held.calls == 2
    path = geometric.PathGeometric(si, _state(si.getStateSpace(), 1, 1))
    assert path.clearance() == 1.5


def test_motion_validators_of_python_are_asked_with_two_states() -> None:
    space = _se2()
    si = base.SpaceInformation(space)
    si.setMotionValidator(_Motions(si))
    gc.collect()
    assert si.checkMotion(_state(space, 1, 1), _state(space, 9, 1))
    held = si.getMotionValidator()
    assert isinstance(held, _Motions)
    assert held.arguments == [2]


def test_the_last_valid_state_cannot_be_asked_for_or_told() -> None:
    space = _se2()
    si = base.SpaceInformation(space)
    si.setStateValidityChecker(lambda state: True)
    si.setMotionValidator(_Motions(si))
    si.setup()
    first, second = _state(space, 1, 1), _state(space, 9, 1)
    with pytest.raises(TypeError, match="incompatible function arguments"):
        si.checkMotion(first, second, (first, 0.0))
    # KPIECE1 extends its motions by the check with three arguments.
    assert _solve(si, "KPIECE1", _problem(si))
    assert set(si.getMotionValidator().arguments) == {2}


def test_motions_that_fail_in_part_are_not_kept_by_kpiece() -> None:
    class Never(base.MotionValidator):  # type: ignore[misc]
        def checkMotion(self, first: Any, second: Any) -> bool:
            return False

    si = base.SpaceInformation(_se2())
    si.setStateValidityChecker(lambda state: True)
    si.setMotionValidator(Never(si))
    si.setup()
    problem = _problem(si)
    _solve(si, "KPIECE1", problem, 0.05)
    assert not problem.hasExactSolution()
    assert not problem.hasApproximateSolution() or (
        problem.getSolutionPath().getStateCount() == 1
    )


def test_a_subclass_of_a_state_space_is_not_asked() -> None:
    class Space(base.SE2StateSpace):  # type: ignore[misc]
        def distance(self, first: Any, second: Any) -> float:
            raise AssertionError

    space = Space()
    space.setBounds(bounds_of((0, 0, 10, 10)))
    si = base.SpaceInformation(space)
    first, second = _state(space, 0, 0), _state(space, 3, 4)
    assert si.distance(first, second) == pytest.approx(5.0)
    with pytest.raises(TypeError, match="no constructor"):
        type("Space", (base.StateSpace,), {})()


@pytest.mark.parametrize(
    "name",
    ["StatePropagator", "DirectedControlSampler", "ControlSampler", "ControlSpace"],
)
def test_these_classes_of_control_cannot_be_subclassed(name: str) -> None:
    with pytest.raises(TypeError, match="no constructor"):
        type("Own", (getattr(control, name),), {})(_se2())


@pytest.mark.parametrize("name", ["SST", "PDST"])
def test_these_planners_of_control_cannot_be_made(name: str) -> None:
    with pytest.raises(TypeError, match="no constructor"):
        getattr(control, name)(_se2())


def test_a_function_propagates_states() -> None:
    space = _se2()
    controls = control.RealVectorControlSpace(space, 2)
    controls.setBounds(bounds_of((-1, -1, 1, 1)))
    si = control.SpaceInformation(space, controls)
    calls = []

    def propagate(state: Any, given: Any, duration: float, result: Any) -> None:
        calls.append(duration)
        x, y = state.getX(), state.getY()
        result.setXY(x + duration * given[0], y + duration * given[1])
        result.setYaw(0.0)

    si.setStatePropagator(propagate)
    si.setStateValidityChecker(space.satisfiesBounds)
    si.setPropagationStepSize(0.1)
    si.setMinMaxControlDuration(1, 20)
    si.setup()
    problem = base.ProblemDefinition(si)
    problem.setStartAndGoalStates(_state(space, 1, 1), _state(space, 8, 6), 0.5)
    planner = control.RRT(si)
    planner.setProblemDefinition(problem)
    planner.setup()
    with pytest.raises(TypeError):
        planner.solve(1.0)  # a termination condition only, unlike geometric planners
    planner.solve(base.timedPlannerTerminationCondition(2.0))
    assert problem.hasExactSolution()
    assert set(calls) == {0.1}


def test_costs_of_python_guide_rrt_star() -> None:
    class Cost(base.OptimizationObjective):  # type: ignore[misc]
        calls = 0

        def motionCost(self, first: Any, second: Any) -> Any:
            Cost.calls += 1
            return base.Cost(abs(first.getX() - second.getX()))

        def stateCost(self, state: Any) -> Any:
            return base.Cost(1.0)

    si = base.SpaceInformation(_se2())
    si.setStateValidityChecker(lambda state: True)
    si.setup()
    problem = _problem(si)
    problem.setOptimizationObjective(Cost(si))
    gc.collect()
    assert _solve(si, "RRTstar", problem, 0.1)
    assert Cost.calls > 10


def test_samplers_and_goals_of_python_are_asked() -> None:
    class Sampler(base.ValidStateSampler):  # type: ignore[misc]
        calls = 0

        def sample(self, state: Any) -> bool:
            Sampler.calls += 1
            state.setXY(5.0, 5.0)
            state.setYaw(0.0)
            return True

    class Goal(base.GoalSampleableRegion):  # type: ignore[misc]
        calls = 0

        def distanceGoal(self, state: Any) -> float:
            return abs(float(state.getX()) - 9.0)

        def sampleGoal(self, state: Any) -> None:
            Goal.calls += 1
            state.setXY(9.0, 5.0)
            state.setYaw(0.0)

        def maxSampleCount(self) -> int:
            return 3

    space = _se2()
    si = base.SpaceInformation(space)
    si.setStateValidityChecker(lambda state: True)
    si.setValidStateSamplerAllocator(Sampler)
    si.setup()
    problem = base.ProblemDefinition(si)
    problem.addStartState(_state(space, 1, 1))
    problem.setGoal(Goal(si))
    gc.collect()
    assert _solve(si, "RRTConnect", problem)
    assert problem.getSolutionPath().getStates()[-1].getX() == 9.0
    assert Goal.calls >= 1
    sampler = si.allocValidStateSampler()
    assert sampler.sample(_state(space, 1, 1))
    assert Sampler.calls == 1


def test_an_approximate_solution_counts_as_true() -> None:
    si = base.SpaceInformation(_se2())
    si.setStateValidityChecker(lambda state: not 4 < state.getX() < 6)
    si.setup()
    problem = _problem(si)
    status = _solve(si, "RRTConnect", problem, 0.05)
    assert status
    assert str(status) == "Approximate solution"
    assert not problem.hasExactSolution()


def test_a_function_ends_the_search() -> None:
    calls = []

    def is_over() -> bool:
        calls.append(1)
        return len(calls) > 20

    si = base.SpaceInformation(_se2())
    si.setStateValidityChecker(lambda state: not 4 < state.getX() < 6)
    si.setup()
    problem = _problem(si)
    _solve(si, "RRTConnect", problem, base.PlannerTerminationCondition(is_over))
    assert len(calls) == 21


def test_errors_of_callbacks_come_out_of_the_planner() -> None:
    class Odd(base.MotionValidator):  # type: ignore[misc]
        def checkMotion(self, first: Any, second: Any) -> bool:
            raise ValueError("from the callback")

    si = base.SpaceInformation(_se2())
    si.setStateValidityChecker(lambda state: True)
    si.setMotionValidator(Odd(si))
    si.setup()
    with pytest.raises(ValueError, match="from the callback"):
        _solve(si, "RRTConnect", _problem(si))


def test_validators_live_and_die_with_their_space_information() -> None:
    class Mark:
        pass

    si = base.SpaceInformation(_se2())
    si.setStateValidityChecker(_Wall(si))
    si.setMotionValidator(_Motions(si))
    si.mark = Mark()
    mark = weakref.ref(si.mark)
    gc.collect()
    assert isinstance(si.getMotionValidator(), _Motions)
    del si
    gc.collect()
    assert mark() is None


def test_the_same_seed_gives_the_same_path() -> None:
    def path(seed: int) -> list[float]:
        seeded(seed)
        si = base.SpaceInformation(_se2())
        si.setStateValidityChecker(_Wall(si))
        si.setup()
        problem = _problem(si)
        assert _solve(si, "RRTConnect", problem)
        return [state.getX() for state in problem.getSolutionPath().getStates()]

    assert path(7) == path(7)
    assert path(7) != path(8)


@pytest.mark.parametrize(
    ("first", "second", "quarter"),
    [
        (3.0, -3.0, 3.0707963267948966),
        (0.0, 3.141592653589793, 0.7853981633974483),
        (1.0, -2.141592653589793, 0.21460183660255172),
        (0.0, 7.0, 0.17920367320510344),
    ],
)
def test_headings_are_interpolated_the_shorter_way(
    first: float, second: float, quarter: float
) -> None:
    space = _se2()
    between = space.allocState()
    space.interpolate(
        _state(space, 0, 0, first), _state(space, 1, 0, second), 0.25, between
    )
    assert between.getYaw() == pytest.approx(quarter, abs=1e-12)


def test_compound_states_give_their_parts() -> None:
    curvature = base.RealVectorStateSpace(1)
    curvature.setBounds(-2.0, 2.0)
    space = base.CompoundStateSpace(
        [_se2(), curvature, base.SO2StateSpace()], [1.0, 0.5, 0.5]
    )
    si = base.SpaceInformation(space)
    state = si.allocState()
    state[0].setXY(3.0, 2.0)
    state[1][0] = 0.5
    state[2].value = 1.5
    seen: list[tuple[float, float, float]] = []

    def is_valid(given: Any) -> bool:
        seen.append((given[0].getX(), given[1][0], given[2].value))
        return True

    si.setStateValidityChecker(is_valid)
    assert si.isValid(state)
    assert seen == [(3.0, 0.5, 1.5)]


def test_the_log_level_is_put_back() -> None:
    util.setLogLevel(util.LogLevel.LOG_WARN)
    with quiet():
        assert util.getLogLevel() == util.LogLevel.LOG_NONE
    assert util.getLogLevel() == util.LogLevel.LOG_WARN


def test_a_heading_of_pi_is_out_of_bounds_and_minus_pi_is_not() -> None:
    space = _se2()
    assert not space.satisfiesBounds(_state(space, 1, 1, math.pi))
    assert space.satisfiesBounds(_state(space, 1, 1, -math.pi))


HANGS = """
from omniplan.sampling.ompl_bindings import base, bounds_of, geometric


class Cost(base.OptimizationObjective):
    def motionCost(self, first, second):
        return base.Cost(1.0)


def main():
    space = base.SE2StateSpace()
    space.setBounds(bounds_of((0, 0, 10, 10)))
    si = base.SpaceInformation(space)
    si.setStateValidityChecker(lambda state: True)
    si.setup()
    first, second = space.allocState(), space.allocState()
    first.setXY(1, 1)
    first.setYaw(0)
    second.setXY(9, 1)
    second.setYaw(0)
    problem = base.ProblemDefinition(si)
    problem.setStartAndGoalStates(first, second)
    problem.setOptimizationObjective(Cost(si))
    planner = geometric.PRM(si)
    planner.setProblemDefinition(problem)
    planner.setup()
    print("begins", flush=True)
    planner.solve(0.2)
    print("ends", flush=True)


main()
"""


@pytest.mark.slow
def test_prm_hangs_with_a_cost_of_python() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", HANGS], stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "begins\n"
            with pytest.raises(subprocess.TimeoutExpired):
                process.wait(timeout=5)
        finally:
            process.kill()
