"""The optimisation problem and its solver.

Unknowns are the knots of C² cubic splines (see `omniplan.optimising.cubics`): pose,
rate and duration at every knot, waits at the stops between the legs, and a line for
every obstacle that is near. The splines are the trajectory itself, so limits hold
exactly where they are looked at, at the knots and half-way. Derivatives are exact
(CasADi), the solver is IPOPT.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from typing import Any

import casadi
import numpy as np
import numpy.typing as npt
from scipy.sparse import csc_matrix

from configspace import InvalidInput, PermissibleSpace, Problem
from configspace.space import require_space
from omniplan.optimising.cubics import Rest
from omniplan.optimising.formulas import (
    apart_by_line,
    joint,
    limits_over,
    turns_at_stop,
)
from omniplan.optimising.limits import Rules, rules_of
from omniplan.optimising.prices import Price
from omniplan.optimising.setting import (
    Guess,
    Setting,
    Solution,
    SolverStatus,
)
from omniplan.optimising.unknowns import BEGIN, STATE, H, Unknowns

__all__ = ["OptimisationProblem", "build_problem"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

GIVEN_WAY = 4e-3
"""Limits that give way by more than this are not kept: more than is kept from them."""
KEPT_WAY = 0.2
"""Share of its way that a leg keeps."""
NEARNESS = {"time": 1e-3, "smooth": 1e-3, "change": 1e-2}
"""How near to the limits a search starts, for each objective: the first barrier
parameter. What is to be repaired starts beyond them."""
_STATUS = {
    "Solve_Succeeded": SolverStatus.CONVERGED,
    "Solved_To_Acceptable_Level": SolverStatus.CONVERGED,
    "Feasible_Point_Found": SolverStatus.CONVERGED,
    "Infeasible_Problem_Detected": SolverStatus.INFEASIBLE,
    "Maximum_Iterations_Exceeded": SolverStatus.ITERATION_LIMIT,
    "Maximum_CpuTime_Exceeded": SolverStatus.TIME_LIMIT,
    "Maximum_WallTime_Exceeded": SolverStatus.TIME_LIMIT,
    "Invalid_Number_Detected": SolverStatus.NON_FINITE,
}


class _Rows:
    """The constraints, as they are collected."""

    def __init__(self) -> None:
        self.values: list[Any] = []
        self.least: list[FloatArray] = []
        self.largest: list[FloatArray] = []
        self.gives: list[IntArray] = []
        """Which unknown gives way for each constraint; -1: none does."""

    def add(
        self,
        value: Any,
        least: FloatArray | float,
        largest: float | FloatArray,
        gives: IntArray | int = -1,
    ) -> None:
        """Add constraints; a bound for all of them or one each."""
        flat = casadi.vec(value)
        n = flat.numel()
        self.values.append(flat)
        self.least.append(np.broadcast_to(least, (n,)))
        self.largest.append(np.broadcast_to(largest, (n,)))
        self.gives.append(np.broadcast_to(gives, (n,)))


def build_problem(
    space: PermissibleSpace, setting: Setting, reference: Guess | None = None
) -> OptimisationProblem:
    """Return the optimisation problem of a vehicle.

    Parameters
    ----------
    space : PermissibleSpace
        With its vehicle: a data sheet alone does not tell all limits.
    setting : Setting
    reference : Guess, optional
        What is to be changed least, or smoothed.

    Raises
    ------
    InvalidInput
        If the space does not know its vehicle, or the setting contradicts itself.
    """
    require_space(space)
    if space.vehicle is None:
        given = f"{space.name}: a data sheet alone"
        allowed = "optimising needs the vehicle: a data sheet does not hold all rates"
        raise InvalidInput(Problem("space", given, allowed))
    counts = setting.intervals
    if not counts or min(counts) < 2 or len(setting.signs) != len(counts):
        given = f"intervals {counts}, signs {setting.signs}"
        allowed = "one sign and at least two intervals per leg"
        raise InvalidInput(Problem("setting", given, allowed))
    if (setting.objective != "time") != (reference is not None):
        allowed = "given for the objectives smooth and change, and only for those"
        raise InvalidInput(Problem("reference", repr(reference)[:40], allowed))
    return OptimisationProblem(rules_of(space.vehicle), setting, reference)


class OptimisationProblem:
    """A problem, ready to be solved from any number of starts. See `build_problem`."""

    def __init__(self, rules: Rules, setting: Setting, reference: Guess | None) -> None:
        """Write down unknowns, constraints and objective."""
        self.setting = setting
        self._rules = rules
        self._unknowns = Unknowns(setting)
        self._legs = [
            casadi.MX.sym(f"leg{i}", STATE, n + 1)
            for i, n in enumerate(setting.intervals)
        ]
        stops = len(setting.intervals) - 1
        self._waits = casadi.MX.sym("waits", stops)
        self._lines = casadi.MX.sym("lines", 2, len(setting.separations))
        rows = _Rows()
        at = 0
        for leg, sign in zip(self._legs, setting.signs, strict=True):
            self._leg(rows, leg, sign, at)
            at += leg.numel()
        self._stops(rows)
        self._separations(rows)
        price = Price(setting, rules.kappa_g, self._legs, self._waits)
        if setting.longest is not None:
            rows.add(price.duration(), 0.0, setting.longest)
        unknowns = casadi.vertcat(
            *(casadi.vec(leg) for leg in self._legs),
            self._waits,
            casadi.vec(self._lines),
        )
        self._least, self._largest = (
            np.concatenate(x) for x in (rows.least, rows.largest)
        )
        self._gives = np.concatenate(rows.gives)
        self._nlp = {
            "x": unknowns,
            "f": price.objective(reference),
            "g": casadi.vertcat(*rows.values),
        }

    # --- constraints

    def _leg(self, rows: _Rows, leg: Any, sign: int, at: int) -> None:
        """Add what one leg must keep: limits, smooth joints, no slip.

        `at` is the number of its first unknown.
        """
        n = leg.shape[1] - 1
        rests: list[tuple[Rest, int, int]] = [
            ("start", 0, 1),
            ("none", 1, n - 1),
            ("end", n - 1, n),
        ]
        for rest, first, last in rests:
            if last > first:
                look, least, states = limits_over(self._rules, self.setting, rest, sign)
                ends = leg[:, first:last], leg[:, first + 1 : last + 1]
                value = look.map(last - first)(*ends)
                knots = np.arange(first, last)
                gives = (at + STATE * knots[:, None] + states).ravel()
                rows.add(value, np.tile(least, last - first), np.inf, gives)
        smooth = joint().map(n - 1)
        rows.add(smooth(leg[:, :-2], leg[:, 1:-1], leg[:, 2:]), 0.0, 0.0)
        h = leg[H, :]
        # One duration for all, in a form that keeps the matrices banded.
        rows.add(h[1:] - h[:-1], 0.0, 0.0)

    def _stops(self, rows: _Rows) -> None:
        """Add that legs join, and that the wheels have the time to turn."""
        signs, ways = self.setting.signs, self.setting.ways
        for leg, way in zip(self._legs, [] if ways is None else ways, strict=False):
            length = float(np.linalg.norm(way))
            if length > 0:
                gone = casadi.dot((way / length**2), leg[:3, -1] - leg[:3, 0])
                rows.add(gone, KEPT_WAY, np.inf)
        for i, (before, after) in enumerate(
            zip(self._legs, self._legs[1:], strict=False)
        ):
            rows.add(before[:3, -1] - after[:3, 0], 0.0, 0.0)
            turns = turns_at_stop(self._rules, signs[i] * signs[i + 1])
            if turns is not None:
                ends = before[:, -2], before[:, -1], after[:, 0], after[:, 1]
                times = turns(*ends)
                rows.add(self._waits[i] - times, 0.0, np.inf)
                rows.add(self._waits[i] + times, 0.0, np.inf)

    def _separations(self, rows: _Rows) -> None:
        """Add that a line lies between the vehicle and every obstacle that is near."""
        setting = self.setting
        if not setting.separations:
            return
        corner_count = max(len(s.part) for s in setting.separations)
        for body, arms in enumerate(setting.body):
            chosen = [i for i, s in enumerate(setting.separations) if s.body == body]
            if not chosen:
                continue
            picked = [setting.separations[i] for i in chosen]
            apart = apart_by_line(arms, corner_count)
            x0 = casadi.horzcat(*(self._legs[s.leg][:, s.interval] for s in picked))
            x1 = casadi.horzcat(*(self._legs[s.leg][:, s.interval + 1] for s in picked))
            parts = np.stack([_padded(s.part, corner_count) for s in picked], axis=1)
            room = np.array([[s.room for s in picked]])
            value = apart.map(len(picked))(x0, x1, self._lines[:, chosen], parts, room)
            at = [self._unknowns.give_of(s.leg, s.interval) for s in picked]
            rows.add(value, 0.0, np.inf, np.repeat(at, value.shape[0]))

    # --- values, for tests and for people

    def values(self, guess: Guess) -> tuple[float, FloatArray]:
        """Return the objective and all constraints at a motion."""
        f, g = self._function([self._nlp["f"], self._nlp["g"]])(
            self._unknowns.packed(guess)
        )
        return float(f), np.asarray(g).ravel()

    def derivatives(self, guess: Guess) -> tuple[FloatArray, csc_matrix]:
        """Return the gradient of the objective and the Jacobian of the constraints."""
        x = self._nlp["x"]
        gradient = casadi.gradient(self._nlp["f"], x)
        jacobian = casadi.jacobian(self._nlp["g"], x)
        at = self._function([gradient, jacobian])(self._unknowns.packed(guess))
        return np.asarray(at[0]).ravel(), at[1].sparse()

    def _function(self, outputs: list[Any]) -> Callable[[FloatArray], Any]:
        made: Callable[[FloatArray], Any] = casadi.Function(
            "values", [self._nlp["x"]], outputs
        )
        return made

    # --- solving

    def solve(
        self,
        start: Guess,
        *,
        max_iterations: int = 300,
        time: float = 10.0,
        tolerance: float = 1e-5,
        quiet: bool = True,
    ) -> Solution:
        """Return the optimum near a start.

        Parameters
        ----------
        start : Guess
            Its ends are kept if the setting says so.
        max_iterations : int, ≥ 1
        time : float, s, > 0
            Time the solver may take; the best motion so far is returned.
        tolerance : float, > 0
            How well the optimum is met, scaled.
        quiet : bool
            False: the solver prints its iterations.
        """
        x0 = self._unknowns.packed(start)
        if not np.isfinite(x0).all():
            return Solution(
                SolverStatus.NON_FINITE, None, statistics={"iterations": 0, "time": 0.0}
            )
        least, largest = self._unknowns.ranges(start)
        options = {
            "print_time": False,
            "ipopt.print_level": 0 if quiet else 5,
            "ipopt.sb": "yes",
            "ipopt.max_iter": max_iterations,
            "ipopt.max_wall_time": time,
            "ipopt.tol": tolerance,
            "ipopt.constr_viol_tol": 1e-6,
            "ipopt.acceptable_tol": 1e-3,
            "ipopt.acceptable_iter": 6,
            "ipopt.acceptable_obj_change_tol": 1e-4,
            "ipopt.mu_strategy": "monotone",
            "ipopt.mu_init": NEARNESS[self.setting.objective],
            "ipopt.nlp_scaling_method": "none",
        }
        began = clock.perf_counter()
        x0 = self._eased(np.clip(x0, least, largest), largest)
        solver = casadi.nlpsol("solver", "ipopt", self._nlp, options)
        built = clock.perf_counter()
        found = solver(
            x0=x0,
            lbx=least,
            ubx=largest,
            lbg=self._least,
            ubg=self._largest,
        )
        ended = clock.perf_counter()
        return self._answer(found, solver.stats(), built - began, ended - began)

    def _eased(self, x: FloatArray, largest: FloatArray) -> FloatArray:
        """Return a start in which limits give way by what it breaks them.

        A search that starts within the limits moves on; one that starts far beyond
        them spends its steps on getting there.
        """
        gives = np.unique(self._gives[self._gives >= 0])
        x = x.copy()
        x[gives] = 0.0
        g = np.asarray(self._function([self._nlp["g"]])(x)).ravel()
        rows = self._gives >= 0
        lack = np.maximum(self._least[rows] - g[rows], 0.0)
        np.maximum.at(x, self._gives[rows], lack)
        x[gives] = np.minimum(1.1 * x[gives] + BEGIN, largest[gives])
        return x

    def _answer(
        self, found: Any, statistics: Any, build_time: float, time: float
    ) -> Solution:
        x, g = (np.asarray(found[name]).ravel() for name in ("x", "g"))
        word = str(statistics["return_status"])
        status = _STATUS.get(word, SolverStatus.STUCK)
        told: dict[str, float | int | str] = {
            "iterations": int(statistics["iter_count"]),
            "build_time": build_time,
            "time": time,
            "objective": float(found["f"]),
            "unknowns": x.size,
            "constraints": g.size,
            "solver_status": word,
        }
        if not (np.isfinite(x).all() and np.isfinite(g).all()):
            return Solution(SolverStatus.NON_FINITE, None, statistics=told)
        guess, give, poses = self._unknowns.unpacked(x)
        excess = np.maximum(self._least - g, g - self._largest).max(initial=0.0)
        worst = int(np.argmax(give))
        place = None
        if give[worst] > GIVEN_WAY:
            if status is SolverStatus.CONVERGED:
                status = SolverStatus.INFEASIBLE
            place = tuple(poses[worst].tolist())
        violation = max(float(excess), float(give[worst]))
        return Solution(status, guess, violation, place, told)


def _padded(part: FloatArray, count: int) -> FloatArray:
    """Return corners as one column, the last one repeated."""
    rows = np.concatenate([part, np.repeat(part[-1:], count - len(part), axis=0)])
    return rows.ravel()
