"""The optimisation problem and its solver; the one importer of CasADi.

Unknowns are the knots of C² cubic splines (see `omniplan.optimising.cubics`): pose,
rate and duration at every knot, waits at the stops between the legs, and a line for
every obstacle that is near. The splines are the trajectory itself, so limits hold
exactly where they are looked at, at the knots and half-way. Derivatives are exact
(CasADi), the solver is IPOPT.
"""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Sequence
from typing import Any

import casadi
import numpy as np
import numpy.typing as npt
from scipy.sparse import csc_matrix

from configspace import InvalidInput, PermissibleSpace, Problem
from configspace.space import require_space
from omniplan.optimising.cubics import Cubic, Rest, corners, twists_at
from omniplan.optimising.limits import (
    Functions,
    Number,
    Rules,
    Twist,
    rules_of,
    speed_bounds,
    turn_angles,
)
from omniplan.optimising.setting import (
    Guess,
    Setting,
    Solution,
    SolverStatus,
)
from omniplan.optimising.unknowns import GIVE, STATE, SWING, H, Unknowns

__all__ = ["OptimisationProblem", "build_problem"]

FloatArray = npt.NDArray[np.float64]
SYMBOLS = Functions(casadi.sin, casadi.cos, casadi.sqrt, casadi.atan2)

SLIP = 2e-3
"""Sideways slip of a line-mobile vehicle half-way between knots, m/s: what the splines
need between places without slip, and less than `validate` allows."""
PRICE, SWING_PRICE = 100.0, 0.1
"""Of exceeding a limit, or one on α̈, by itself for a second. The first is above what
any limit is worth, so that all are kept where that is possible."""
CHANGE, CHANGE_TIME = 30.0, 3e-3
"""Weights of the mean squared change, over 1/κ_g², and of the relative duration."""
SMOOTH = 1e-2
"""Weight of the squared jerk over that of a way of the same length and time."""
GIVEN_WAY = 4e-3
"""Limits that give way by more than this are not kept: more than is kept from them."""
ALONG = 0.02
"""Weight of a change along the way against one across it."""
KEPT_WAY = 0.2
"""Share of its way that a leg keeps."""
NEARNESS = {"time": 1e-3, "smooth": 1e-3, "change": 1e-2}
"""How near to the limits a search starts, for each objective: the first barrier
parameter. What is to be repaired starts beyond them."""
CALM = 1e-4
"""Weight of calm among motions that are equally fast."""
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

    def add(
        self, value: Any, least: FloatArray | float, largest: float | FloatArray
    ) -> None:
        """Add constraints; a bound for all of them or one each."""
        flat = casadi.vec(value)
        n = flat.numel()
        self.values.append(flat)
        self.least.append(np.broadcast_to(least, (n,)))
        self.largest.append(np.broadcast_to(largest, (n,)))


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
        for leg, sign in zip(self._legs, setting.signs, strict=True):
            self._leg(rows, leg, sign)
        self._stops(rows)
        self._separations(rows)
        duration = self._duration()
        if setting.longest is not None:
            rows.add(duration, 0.0, setting.longest)
        unknowns = casadi.vertcat(
            *(casadi.vec(leg) for leg in self._legs),
            self._waits,
            casadi.vec(self._lines),
        )
        self._least, self._largest = (
            np.concatenate(x) for x in (rows.least, rows.largest)
        )
        self._nlp = {
            "x": unknowns,
            "f": self._objective(duration, reference),
            "g": casadi.vertcat(*rows.values),
        }

    # --- constraints

    def _leg(self, rows: _Rows, leg: Any, sign: int) -> None:
        """Add what one leg must keep: limits, smooth joints, no slip."""
        n = leg.shape[1] - 1
        rests: list[tuple[Rest, int, int]] = [
            ("start", 0, 1),
            ("none", 1, n - 1),
            ("end", n - 1, n),
        ]
        for rest, first, last in rests:
            if last > first:
                look, least = self._limits(rest, sign)
                ends = leg[:, first:last], leg[:, first + 1 : last + 1]
                value = look.map(last - first)(*ends)
                rows.add(value, np.tile(least, last - first), np.inf)
        joint = _joint().map(n - 1)
        rows.add(joint(leg[:, :-2], leg[:, 1:-1], leg[:, 2:]), 0.0, 0.0)
        h = leg[H, :]
        # One duration for all, in a form that keeps the matrices banded.
        rows.add(h[1:] - h[:-1], 0.0, 0.0)

    def _limits(self, rest: Rest, sign: int) -> tuple[Any, FloatArray]:
        """Return the limits over one interval as a function, and their bounds."""
        rules, setting = self._rules, self.setting
        x0, x1 = (casadi.SX.sym(name, STATE) for name in ("x0", "x1"))
        cubic = _cubic(x0, x1)
        shares = [0.0, 0.5]
        if rest == "end" or setting.has_swing:
            shares.append(1.0)
        values, least = [], []

        def add(value: Number, low: float, high: float, state: int = GIVE) -> None:
            if casadi.SX(value).is_constant():  # 0 at rest, whatever the motion
                return
            for side, bound in ((1, low), (-1, -high)):
                if np.isfinite(bound):
                    values.append(side * value + x0[state])
                    least.append(bound)

        for share in shares:
            pose, twist, direction = twists_at(cubic, share, rest, SYMBOLS)
            tightness = setting.tightness
            for bound in speed_bounds(
                rules, twist, direction, sign, SYMBOLS, tightness
            ):
                if bound.is_swing and not setting.has_swing:
                    continue  # near rest too steep to be told from the beginning
                state = SWING if bound.is_swing else GIVE
                add(bound.value, bound.least, bound.largest, state)
            is_knot = share != 0.5
            if share == 1.0 and rest != "end":
                continue
            for slip, moving in _slips(rules, direction, twist):
                add(*((slip, 0.0, 0.0) if is_knot else (moving, -SLIP, SLIP)))
            if setting.bounds is not None:
                x_min, y_min, x_max, y_max = setting.bounds
                for part in setting.body:
                    for corner in corners(pose, part, SYMBOLS):
                        add(corner.x, x_min, x_max)
                        add(corner.y, y_min, y_max)
        look = casadi.Function(
            "look", [x0, x1], [casadi.vertcat(casadi.SX(0, 1), *values)]
        )
        return look, np.array(least)

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
            turns = self._turns(signs[i] * signs[i + 1])
            if turns is not None:
                ends = before[:, -2], before[:, -1], after[:, 0], after[:, 1]
                times = turns(*ends)
                rows.add(self._waits[i] - times, 0.0, np.inf)
                rows.add(self._waits[i] + times, 0.0, np.inf)

    def _turns(self, sign: int) -> Any | None:
        """Return the signed times that wheels need to turn at a stop, as a function."""
        x = [casadi.SX.sym(f"x{i}", STATE) for i in range(4)]
        _, _, before = twists_at(_cubic(x[0], x[1]), 1.0, "end", SYMBOLS)
        _, _, after = twists_at(_cubic(x[2], x[3]), 0.0, "start", SYMBOLS)
        times = [
            angle / rate
            for angle, rate in turn_angles(self._rules, before, after, sign, SYMBOLS)
        ]
        if not times:
            return None
        return casadi.Function("turns", x, [casadi.vertcat(*times)])

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
            apart = self._apart(arms, corner_count)
            x0 = casadi.horzcat(*(self._legs[s.leg][:, s.interval] for s in picked))
            x1 = casadi.horzcat(*(self._legs[s.leg][:, s.interval + 1] for s in picked))
            parts = np.stack([_padded(s.part, corner_count) for s in picked], axis=1)
            room = np.array([[s.room for s in picked]])
            value = apart.map(len(picked))(x0, x1, self._lines[:, chosen], parts, room)
            rows.add(value, 0.0, np.inf)

    def _apart(self, arms: Sequence[complex], corner_count: int) -> Any:
        """Return by how much a line keeps both sides apart, m, as a function."""
        x0, x1 = (casadi.SX.sym(name, STATE) for name in ("x0", "x1"))
        line = casadi.SX.sym("line", 2)
        part = casadi.SX.sym("part", 2 * corner_count)
        room = casadi.SX.sym("room")
        nx, ny = casadi.cos(line[0]), casadi.sin(line[0])
        cubic = _cubic(x0, x1)
        apart = [
            line[1] - nx * part[2 * i] - ny * part[2 * i + 1]
            for i in range(corner_count)
        ]
        for share in (0.0, 0.5, 1.0):
            pose = cubic.at(share)[0]
            apart += [
                nx * corner.x + ny * corner.y - line[1] - room + x0[GIVE]
                for corner in corners(pose, arms, SYMBOLS)
            ]
        inputs = [x0, x1, line, part, room]
        return casadi.Function("apart", inputs, [casadi.vertcat(*apart)])

    # --- objective

    def _duration(self) -> Any:
        total = casadi.sum1(self._waits)
        for leg in self._legs:
            total += casadi.sum2(leg[H, :-1])
        return total

    def _objective(self, duration: Any, reference: Guess | None) -> Any:
        price = PRICE * self._given(GIVE) + SWING_PRICE * self._given(SWING)
        if reference is None:
            return duration + CALM * self._calm() + price
        usual = max(reference.duration, 1e-3)
        if self.setting.objective == "smooth":
            length = reference.length(1 / self._rules.kappa_g)
            return SMOOTH * usual**5 / length**2 * self._jerk() + price
        return CHANGE * self._change(reference) + CHANGE_TIME * duration / usual + price

    def _change(self, reference: Guess) -> Any:
        """Return the mean squared change, over 1/κ_g².

        Along the way it counts little: that is a matter of time, which is free.
        """
        total: Any = 0.0
        arm = 1 / self._rules.kappa_g
        scale = np.array([1.0, 1.0, arm])
        for leg, meant in zip(self._legs, reference.legs, strict=True):
            off = (leg[:3, :] - meant.poses.T) * casadi.DM(scale)
            ahead = (meant.rates * scale).T
            size = np.linalg.norm(ahead, axis=0)
            ahead = np.divide(ahead, size, out=np.zeros_like(ahead), where=size > 0)
            slid = casadi.sum1(off * ahead)
            square = casadi.sumsqr(off) - (1 - ALONG) * casadi.sumsqr(slid)
            total += square / off.shape[1] / arm**2
        return total

    def _given(self, state: int) -> Any:
        """Return by how much limits give way, times time, s."""
        return sum(casadi.dot(leg[state, :-1], leg[H, :-1]) for leg in self._legs)

    def _jerk(self) -> Any:
        """Return the integral of the squared jerk, a radian counting 1/κ_g, m²/s⁵."""
        x0, x1 = (casadi.SX.sym(name, STATE) for name in ("x0", "x1"))
        jerk = _cubic(x0, x1).at(0.0)[3]
        square = jerk[0] ** 2 + jerk[1] ** 2 + (jerk[2] / self._rules.kappa_g) ** 2
        return self._summed(casadi.Function("jerk", [x0, x1], [square * x0[H]]))

    def _calm(self) -> Any:
        """Return the integral of the squared acceleration, m²/s³."""
        x0, x1 = (casadi.SX.sym(name, STATE) for name in ("x0", "x1"))
        total = 0.0
        arms = (1.0, 1.0, 1 / self._rules.kappa_g)
        for a0, a1, arm in zip(*_cubic(x0, x1).bends(), arms, strict=True):
            total += (a0 * a0 + a0 * a1 + a1 * a1) / 3 * arm**2 / x0[H]
        return self._summed(casadi.Function("calm", [x0, x1], [total]))

    def _summed(self, part: Any) -> Any:
        total = 0.0
        for leg in self._legs:
            total += casadi.sum2(part.map(leg.shape[1] - 1)(leg[:, :-1], leg[:, 1:]))
        return total

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
        solver = casadi.nlpsol("solver", "ipopt", self._nlp, options)
        built = clock.perf_counter()
        found = solver(
            x0=np.clip(x0, least, largest),
            lbx=least,
            ubx=largest,
            lbg=self._least,
            ubg=self._largest,
        )
        ended = clock.perf_counter()
        return self._answer(found, solver.stats(), built - began, ended - began)

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


def _cubic(x0: Any, x1: Any) -> Cubic:
    """Return the interval between two knots."""
    entries = [[x[i] for i in range(STATE)] for x in (x0, x1)]
    (p0, v0), (p1, v1) = ((e[:3], e[3:6]) for e in entries)
    return Cubic(p0, p1, v0, v1, entries[0][H])


def _joint() -> Any:
    """Return the jump of the second derivative at a knot, m/s, as a function."""
    x = [casadi.SX.sym(f"x{i}", STATE) for i in range(3)]
    _, before = _cubic(x[0], x[1]).bends()
    after, _ = _cubic(x[1], x[2]).bends()
    jump = [b - a * x[0][H] / x[1][H] for b, a in zip(before, after, strict=True)]
    return casadi.Function("joint", x, [casadi.vertcat(*jump)])


def _slips(rules: Rules, direction: Twist, twist: Twist) -> list[tuple[Number, Number]]:
    """Return what a vehicle cannot do: of its direction, and of its twist, m/s."""
    found = []
    if rules.line is not None:
        back = complex(math.cos(rules.line), -math.sin(rules.line))
        found.append(tuple(t.v[0].turned(back).y for t in (direction, twist)))
    if rules.is_translating:
        found.append(tuple(t.omega[0] / rules.kappa_g for t in (direction, twist)))
    return found


def _padded(part: FloatArray, count: int) -> FloatArray:
    """Return corners as one column, the last one repeated."""
    rows = np.concatenate([part, np.repeat(part[-1:], count - len(part), axis=0)])
    return rows.ravel()
