"""What `omniplan.optimise` answers, from what its attempts led to."""

from __future__ import annotations

import itertools
import math
import time as clock
from dataclasses import dataclass

from omniplan.obstacles import Hit
from omniplan.optimising.attempts import WORTH_A_LOOK, Attempts, Candidate, Task
from omniplan.optimising.limits import top_speed
from omniplan.optimising.realising import Realised
from omniplan.optimising.repairing import Repair
from omniplan.optimising.setting import Guess, SolverStatus
from omniplan.optimising.warm_start import courses_of, guess_of
from omniplan.planning.result import Plan, PlanStatus
from omniplan.report import Report

__all__ = ["Answers"]

_MEASURES = {
    "time": ("s", "duration"),
    "smooth": ("m²/s⁵", "squared jerk"),
    "change": ("m", "root mean square of the change"),
}
_STATUS = {
    SolverStatus.CONVERGED: PlanStatus.NOT_PROVED,
    SolverStatus.INFEASIBLE: PlanStatus.INFEASIBLE,
    SolverStatus.ITERATION_LIMIT: PlanStatus.ITERATION_LIMIT,
    SolverStatus.STUCK: PlanStatus.ITERATION_LIMIT,
    SolverStatus.TIME_LIMIT: PlanStatus.TIMEOUT,
    SolverStatus.NON_FINITE: PlanStatus.NON_FINITE,
}


@dataclass(frozen=True, eq=False)
class Answers:
    """Makes plans of candidates and of failures."""

    task: Task
    attempts: Attempts
    repair: Repair
    began: float
    """By `time.perf_counter`, s."""

    def found(self, best: Candidate, before: Candidate | None) -> Plan:
        """Return the answer for a proved trajectory."""
        task, trajectory = self.task, best.realised.trajectory
        courses, _ = courses_of(trajectory, task.rules.reference, top_speed(task.rules))
        turns = [
            float(one.directions()[1] @ other.directions()[0])
            for one, other in itertools.pairwise(courses)
        ]
        return Plan(
            task.space.name,
            PlanStatus.FOUND,
            self._success(best, before),
            trajectory,
            best.realised.report,
            stops=len(courses) - 1,
            cusps=sum(turn < 0 for turn in turns),
            statistics=self._statistics(best, before),
        )

    def _success(self, best: Candidate, before: Candidate | None) -> str:
        task = self.task
        name = f"{task.name} by {task.space.name}"
        unit, what = _MEASURES[task.objective]
        if best is before:
            if task.objective == "change":
                return f"{name}: permitted as it is, nothing was changed"
            return f"{name}: nothing better than what was given was proved{self._end()}"
        text = f"{what} {best.score:.4g} {unit}"
        if before is not None:
            text += f" instead of {before.score:.4g} {unit}"
        if task.objective == "change":
            text += f", at most {best.change:.4g} m; a radian counts 1/κ_g"
        if best.way == "plan":
            why = "there was no time to mend the way"
            if self.repair.is_exhausted:
                why = "no small change was found"
            text += f"; planned anew between the ends: {why}"
        if best.way == "timing":
            text += f", on the path as given{self._end()}"
        return f"{name}: {text}"

    def _end(self) -> str:
        """Return how the solver ended, if that is worth telling."""
        solution = self.attempts.solution
        if solution is None or solution.has_converged:
            return ""
        return f" (solver: {solution.status.value})"

    def refusal(self) -> Plan:
        """Return why there is no trajectory: which limit cannot be kept, and where."""
        task, attempts = self.task, self.attempts
        miss = self._miss()
        status = self._status()
        is_given = miss is None
        if miss is None:
            courses, waits = self.repair.courses, self.repair.waits
            given = guess_of(courses, waits, task.intervals)
            miss = task.judged(task.trajectory_of(given))
        text, place = _refused(miss)
        if is_given:
            text = f"there was no time to mend it; as given: {text}"
        elif status is PlanStatus.INFEASIBLE:
            text = f"no way near it keeps all limits; the nearest tried: {text}"
        elif attempts.refused is not miss:
            text = f"the nearest way tried: {text}"
        message = f"{task.name} by {task.space.name}: {status.value}: {text}"
        return self.no(status, message, place, miss.report)

    def _status(self) -> PlanStatus:
        solution = self.attempts.solution
        limits_are_broken = solution is None or solution.violation > WORTH_A_LOOK
        if self.repair.is_exhausted and limits_are_broken:
            return PlanStatus.INFEASIBLE
        if solution is None:
            return PlanStatus.TIMEOUT
        return _STATUS[solution.status]

    def _miss(self) -> Realised | None:
        """Return what came nearest to being permitted, with its verdicts."""
        solution, nearest = self.attempts.solution, self.repair.start
        options: list[Guess] = [] if nearest is None else [nearest]
        if solution is not None and solution.value is not None:
            options.append(solution.value)
        task = self.task
        misses = [task.judged(task.trajectory_of(guess)) for guess in options]
        if self.attempts.refused is not None:
            misses.append(self.attempts.refused)
        return min(misses, key=_badness, default=None)

    def no(
        self,
        status: PlanStatus,
        message: str,
        place: tuple[float, float, float] | None,
        report: Report | None = None,
    ) -> Plan:
        """Return the answer where there is no trajectory."""
        return Plan(
            self.task.space.name,
            status,
            message,
            report=report,
            place=place,
            statistics=self._statistics(None, None),
        )

    def _statistics(
        self, best: Candidate | None, before: Candidate | None
    ) -> dict[str, float | int | str]:
        attempts = self.attempts
        statistics: dict[str, float | int | str] = {
            "objective": self.task.objective,
            "iterations": attempts.iterations,
            "solves": attempts.solves,
            "unknowns": attempts.unknowns,
            "constraints": attempts.constraints,
            "solve_time": attempts.solve_time,
            "time": clock.perf_counter() - self.began,
        }
        if attempts.solution is not None:
            statistics["solver"] = attempts.solution.status.value
        if before is not None:
            statistics["before"] = before.score
        if best is not None:
            statistics |= {"way": best.way, "after": best.score}
            if self.task.objective == "change":
                statistics["largest_change"] = best.change
        return statistics


def _badness(miss: Realised) -> float:
    """Return by how much the worst limit is exceeded, relative; 0 for a mere hit."""
    worst = miss.report.headline
    if worst is None:
        return 0.0
    if worst.value is None:
        return math.inf
    scale = worst.scale or abs(worst.bound) or 1.0
    return abs(worst.value - worst.bound) / scale


def _refused(refused: Realised) -> tuple[str, tuple[float, float, float] | None]:
    """Return why a trajectory was refused, and where."""
    worst = refused.report.headline
    if worst is not None:
        return str(worst), worst.pose
    if refused.hit is None:  # it may be driven, but it was not asked for
        return "the solver was not content with it", None
    assert isinstance(refused.hit, Hit)
    return refused.hit.message, refused.hit.pose
