"""What `omniplan.optimise` answers, from what its attempts led to."""

from __future__ import annotations

import itertools
import math
import time as clock
from dataclasses import dataclass

from omniplan.obstacles import Hit
from omniplan.optimising.attempts import Attempts, Candidate, Task
from omniplan.optimising.limits import top_speed
from omniplan.optimising.realising import Realised
from omniplan.optimising.setting import SolverStatus
from omniplan.optimising.warm_start import courses_of
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
        if best.way == "timing":
            text += f", on the path as given{self._end()}"
        if task.objective == "change":
            text += f", at most {best.change:.4g} m; a radian counts 1/κ_g"
        return f"{name}: {text}"

    def _end(self) -> str:
        """Return how the solver ended, if that is worth telling."""
        solution = self.attempts.solution
        if solution is None or solution.has_converged:
            return ""
        return f" (solver: {solution.status.value})"

    def refusal(self) -> Plan:
        """Return why there is no trajectory: what was refused last, and where."""
        task, attempts = self.task, self.attempts
        solution, refused = attempts.solution, attempts.refused
        status = PlanStatus.TIMEOUT
        if solution is not None:
            status = _STATUS[solution.status]
        reason, place = "there was no time to begin", None
        if solution is not None:
            broken = f"{solution.violation:.2g}"
            reason = f"the solver ended with limits exceeded by {broken} of themselves"
        if refused is not None:
            reason, place = _refused(refused)
        if solution is not None and solution.place is not None:
            place = solution.place
            x, y, theta = place[0], place[1], math.degrees(place[2])
            reason = (
                f"limits contradict each other near x = {x:.2f} m, y = {y:.2f} m, "
                f"θ = {theta:.0f}°; as given: {reason}"
            )
        message = f"{task.name} by {task.space.name}: {status.value}: {reason}"
        report = None if refused is None else refused.report
        return self.no(status, message, place, report)

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


def _refused(refused: Realised) -> tuple[str, tuple[float, float, float] | None]:
    """Return why a trajectory was refused, and where."""
    worst = refused.report.headline
    if worst is not None:
        return str(worst), worst.pose
    assert isinstance(refused.hit, Hit)
    return refused.hit.message, refused.hit.pose
