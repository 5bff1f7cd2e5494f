"""Building and solving: derivatives, analytic optima, every way to end."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from configspace import InvalidInput, PermissibleSpace, build_space, load_vehicle
from omniplan import validate
from omniplan.optimising.limits import Tightness
from omniplan.optimising.problem import build_problem
from omniplan.optimising.realising import trajectory_of
from omniplan.optimising.setting import Guess, Leg, Separation, Setting, SolverStatus
from omniplan.optimising.warm_start import leg_through

EXACT = Tightness(0.0, 0.0)


@pytest.fixture(scope="module")
def mecanum() -> PermissibleSpace:
    return build_space(load_vehicle("mecanum"), cache=False)


@pytest.fixture(scope="module")
def steered() -> PermissibleSpace:
    return build_space(load_vehicle("ift-four-steered"), cache=False)


def eased(start: list[float], goal: list[float], n: int = 12, time: float = 4.0) -> Leg:
    s = np.linspace(0, 1, n + 1)[:, None]
    way = np.array(goal) - np.array(start)
    return leg_through(np.full(n, time / n), start + (3 * s**2 - 2 * s**3) * way)


def test_derivatives_agree_with_differences(steered: PermissibleSpace) -> None:
    legs = (
        eased([0, 0, 0], [1, 0.2, 0.5], 3, 2.0),
        eased([1, 0.2, 0.5], [0.8, 0.6, 0.4], 3, 2.0),
    )
    part = np.array([[2.0, -1.0], [3.0, -1.0], [3.0, 1.0]])
    setting = Setting(
        (3, 3),
        (1, 1),
        body=((0.3 + 0.2j, -0.3 + 0.2j, -0.3 - 0.2j, 0.3 - 0.2j),),
        separations=(Separation(0, 1, 0, 0, part, 0.01),),
        bounds=(-5.0, -5.0, 5.0, 5.0),
        has_swing=True,
        ways=np.array([leg.poses[-1] - leg.poses[0] for leg in legs]),
    )
    problem = build_problem(steered, setting)
    guess = Guess(legs, (0.5,), np.array([[math.pi, -1.6]]))
    gradient, jacobian = problem.derivatives(guess)
    step = 1e-6

    def moved(leg: int, name: str, row: int, column: int, by: float) -> Guess:
        values = getattr(guess.legs[leg], name).copy()
        values[row, column] += by
        changed = list(guess.legs)
        changed[leg] = replace(guess.legs[leg], **{name: values})
        return replace(guess, legs=tuple(changed))

    for leg, name, row, column, unknown in (
        (0, "poses", 1, 0, 9 + 0),
        (0, "poses", 2, 2, 18 + 2),
        (0, "rates", 1, 1, 9 + 4),
        (1, "poses", 0, 1, 36 + 1),
        (1, "rates", 2, 2, 36 + 18 + 5),
    ):
        (f0, g0), (f1, g1) = (
            problem.values(moved(leg, name, row, column, by)) for by in (-step, step)
        )
        assert (f1 - f0) / (2 * step) == pytest.approx(gradient[unknown], abs=1e-6)
        column_of = jacobian[:, unknown].toarray().ravel()
        np.testing.assert_allclose(
            (g1 - g0) / (2 * step), column_of, rtol=1e-4, atol=1e-4
        )
        assert np.abs(column_of).max() > 0
    turn = np.array([[step, 0.0]])
    _, g1 = problem.values(replace(guess, lines=guess.lines + turn))
    _, g0 = problem.values(replace(guess, lines=guess.lines - turn))
    column_of = jacobian[:, 2 * 36 + 1].toarray().ravel()
    np.testing.assert_allclose((g1 - g0) / (2 * step), column_of, atol=1e-6)


@pytest.mark.parametrize(
    ("goal", "way", "speed"),
    [([2.0, 0.0, 0.0], 2.0, 1.2), ([0.0, 0.0, 1.5], 1.5 * 0.55, 1.2)],
)
def test_straight_ahead_and_on_the_spot_the_optimum_is_a_trapezoid(
    mecanum: PermissibleSpace, goal: list[float], way: float, speed: float
) -> None:
    # Every wheel rolls as far as K, or by the lever a + b = 0.55 m times the turn.
    change = 1.5
    if way * change > speed**2:
        best = way / speed + speed / change
    else:
        best = 2 * math.sqrt(way / change)
    setting = Setting((30,), (1,), tightness=EXACT)
    solution = build_problem(mecanum, setting).solve(
        Guess((eased([0, 0, 0], goal, 30),), ())
    )
    assert solution.has_converged
    assert solution.value is not None
    # Splines of 30 intervals cannot switch at once.
    assert best * (1 - 1e-6) < solution.value.duration < best * 1.01


def test_the_knots_are_those_of_a_spline_at_rest_at_both_ends(
    mecanum: PermissibleSpace,
) -> None:
    guess = Guess((eased([0, 0, 0], [1, 1, 1.0]),), ())
    solution = build_problem(mecanum, Setting((12,), (1,))).solve(guess)
    assert solution.value is not None
    (leg,) = solution.value.legs
    t = np.concatenate([[0.0], np.cumsum(leg.h)])
    spline = CubicSpline(t, leg.poses, bc_type="clamped")
    np.testing.assert_allclose(spline(t, 1), leg.rates, atol=1e-5)
    assert np.ptp(leg.h) < 1e-9
    trajectory = trajectory_of(solution.value, 0j, "found")
    # Limits are looked at half-way as well; so far apart they are nearly kept between.
    assert validate(trajectory, mecanum).speed_factor > 0.97


@pytest.mark.slow
def test_more_intervals_come_nearer_to_the_optimum(mecanum: PermissibleSpace) -> None:
    durations = []
    for n in (8, 16, 32):
        guess = Guess((eased([0, 0, 0], [1.5, 0.8, 1.0], n),), ())
        value = build_problem(mecanum, Setting((n,), (1,))).solve(guess).value
        assert value is not None
        durations.append(value.duration)
    assert durations[2] < durations[1] < durations[0]


@pytest.mark.slow
def test_wheels_get_the_time_to_turn_at_a_stop(steered: PermissibleSpace) -> None:
    legs = eased([0, 0, 0], [1, 0, 0]), eased([1, 0, 0], [1, 1, 0])
    start = Guess(legs, (0.0,))
    ways = np.array([leg.poses[-1] - leg.poses[0] for leg in legs])
    setting = Setting((12, 12), (1, 1), ways=ways)
    solution = build_problem(steered, setting).solve(start)
    assert solution.value is not None
    before, after = solution.value.legs
    come = np.arctan2(*(before.poses[-1] - before.poses[-2])[1::-1])
    leave = np.arctan2(*(after.poses[1] - after.poses[0])[1::-1])
    turn = abs(leave - come) - 0.3  # what headings change between these knots
    assert solution.value.waits[0] >= max(turn, 0.0) / math.pi - 1e-6
    assert solution.violation < 1e-3


def test_contradictions_are_told_with_their_place() -> None:
    """A car cannot move sideways by so little room."""
    space = build_space(load_vehicle("ackermann"), cache=False)
    wall = np.array([[1.0, -3.0], [1.2, -3.0], [1.2, 3.0], [1.0, 3.0]])
    guess = Guess((eased([0, 0, 0], [2.0, 0, 0], 8),), ())
    setting = Setting(
        (8,),
        (1,),
        body=((0.2 + 0.1j, -0.2 + 0.1j, -0.2 - 0.1j, 0.2 - 0.1j),),
        separations=tuple(Separation(0, k, 0, 0, wall, 0.0) for k in range(8)),
        bounds=(-0.5, -0.5, 3.0, 0.5),
    )
    lines = np.array([[math.pi, -0.9]] * 4 + [[0.0, 1.3]] * 4)
    problem = build_problem(space, setting)
    solution = problem.solve(replace(guess, lines=lines), max_iterations=400, time=30)
    assert not solution.has_converged
    assert solution.violation > 1e-2
    assert solution.place is not None
    assert -0.5 < solution.place[0] < 2.5


def test_every_way_to_end_is_a_status(mecanum: PermissibleSpace) -> None:
    problem = build_problem(mecanum, Setting((12,), (1,)))
    leg = eased([0, 0, 0], [1.0, 1.0, 1.0])
    start = Guess((leg,), ())
    assert problem.solve(start).status is SolverStatus.CONVERGED
    few = problem.solve(start, max_iterations=2)
    assert few.status is SolverStatus.ITERATION_LIMIT
    assert few.value is not None
    assert few.statistics["iterations"] == 2
    late = problem.solve(start, time=1e-4)
    assert late.status is SolverStatus.TIME_LIMIT
    poses = leg.poses.copy()
    poses[3, 1] = np.nan
    lost = problem.solve(Guess((replace(leg, poses=poses),), ()))
    assert lost.status is SolverStatus.NON_FINITE
    assert lost.value is None
    with pytest.raises(TypeError):
        few.statistics["iterations"] = 3  # type: ignore[index]


def test_a_quiet_solver_prints_nothing(
    mecanum: PermissibleSpace, capfd: pytest.CaptureFixture[str]
) -> None:
    problem = build_problem(mecanum, Setting((8,), (1,)))
    start = Guess((eased([0, 0, 0], [1.0, 0, 0], 8),), ())
    problem.solve(start)
    assert capfd.readouterr() == ("", "")
    problem.solve(start, quiet=False)
    assert "iter" in capfd.readouterr().out


def test_settings_that_contradict_themselves_are_refused(
    mecanum: PermissibleSpace,
) -> None:
    with pytest.raises(InvalidInput, match="at least two intervals per leg"):
        build_problem(mecanum, Setting((1,), (1,)))
    with pytest.raises(InvalidInput, match="one sign"):
        build_problem(mecanum, Setting((8, 8), (1,)))
    with pytest.raises(InvalidInput, match="reference"):
        build_problem(mecanum, Setting((8,), (1,), "change"))
