"""One try to improve a motion: solve, prove, and mend what was refused."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from configspace import PermissibleSpace, Vehicle
from omniplan.judging.rows import Tolerances
from omniplan.obstacles import CollisionChecker
from omniplan.optimising.limits import Rules, Tightness
from omniplan.optimising.measure import change_of, jerk_of
from omniplan.optimising.problem import build_problem
from omniplan.optimising.realising import (
    PER_INTERVAL,
    Realised,
    faster_timing,
    realise,
    trajectory_of,
)
from omniplan.optimising.separation import Surroundings
from omniplan.optimising.setting import (
    Box,
    Guess,
    Objective,
    Separation,
    Setting,
    Solution,
)
from omniplan.optimising.warm_start import Course, guess_of, signs_of
from omniplan.path import Path
from omniplan.trajectory import Trajectory
from omniplan.validation import validate

__all__ = ["WORTH_A_LOOK", "Attempts", "Candidate", "Task"]

FloatArray = npt.NDArray[np.float64]

ROUNDS = 3
"""How often what was refused is mended."""
PAD = 2e-3
"""What is kept from obstacles beyond the clearance, as the vehicle is looked at from
time to time, m; the exact check comes after."""
STRICTER = 3.0
"""Factor on such margins from round to round."""
REACH = 1.5
"""How near an obstacle is when it is looked at from the beginning, m."""
WORTH_A_LOOK = 0.3
"""Limits broken by more than this share are not worth proving."""
SHORT_OF_TIME = 0.2
"""Without this time no solver is started, s."""


@dataclass(frozen=True, eq=False)
class Task:
    """What is to be optimised, and what it must keep."""

    space: PermissibleSpace
    vehicle: Vehicle
    rules: Rules
    objective: Objective
    checker: CollisionChecker | None
    surroundings: Surroundings | None
    bounds: Box | None
    clearance: float
    keep_ends: bool
    intervals: int
    max_iterations: int
    tolerances: Tolerances
    allow_unreachable: bool
    name: str

    def trajectory_of(self, guess: Guess) -> Trajectory:
        """Return the trajectory of a motion."""
        return trajectory_of(guess, self.rules.reference, self.name)

    def path_of(self, guess: Guess) -> Trajectory:
        """Return a trajectory whose path is to be timed.

        Steering accelerations jump at the knots of a path: then the fewer the better.
        """
        count = 1 if self.rules.bounds_swing else PER_INTERVAL
        name, reference = self.name, self.rules.reference
        return trajectory_of(guess, reference, name, per_interval=count)

    def realise(self, guess: Guess) -> Realised:
        """Return the trajectory of a motion with its verdicts."""
        return self.realised(self.trajectory_of(guess))

    def judged(self, made: Trajectory) -> Realised:
        """Return a trajectory as it is, with its verdicts."""
        report = validate(
            made,
            self.space,
            self.tolerances,
            allow_unreachable=self.allow_unreachable,
        )
        hit = None
        if self.checker is not None:
            hit = self.checker.first_hit_of_trajectory(made)
        return Realised(made, report, hit)

    def realised(self, trajectory: Trajectory) -> Realised:
        """Return a trajectory with its verdicts, slower if need be."""
        return realise(
            trajectory,
            self.space,
            self.checker,
            self.tolerances,
            allow_unreachable=self.allow_unreachable,
        )

    def retimed(self, motion: Trajectory | Path) -> Realised | None:
        """Return the fastest timing of a motion's path, None if there is none."""
        return faster_timing(
            motion,
            self.space,
            self.checker,
            self.tolerances,
            allow_unreachable=self.allow_unreachable,
        )


@dataclass(frozen=True, eq=False)
class Candidate:
    """A proved trajectory, and what it is compared by: less is better."""

    realised: Realised
    score: float
    way: str
    """``solver``, ``timing``, ``nearest``, ``plan`` or ``input``."""
    change: float = 0.0
    """Largest change of a pose; for the objective ``change``, m."""


@dataclass
class Attempts:
    """Tries to solve a task, within a time; keeps what the last one ended with."""

    task: Task
    deadline: float
    """Of `time.perf_counter`, s."""
    way: FloatArray = field(repr=False)
    """(n, 3) m, m, rad: the way of K as it was given, densely."""
    iterations: int = 0
    solves: int = 0
    unknowns: int = 0
    constraints: int = 0
    solve_time: float = 0.0
    solution: Solution | None = None
    """Of the last solve."""
    refused: Realised | None = field(default=None, repr=False)
    """What was computed last and not accepted."""

    @property
    def time_left(self) -> float:
        """Time until the deadline, s."""
        return self.deadline - clock.perf_counter()

    def guess(
        self, courses: Sequence[Course], waits: Sequence[float]
    ) -> tuple[Guess, tuple[int, ...]]:
        """Return the motion along courses, and its representations."""
        guess = guess_of(courses, waits, self.task.intervals)
        return guess, self.signs_of(guess)

    def signs_of(self, guess: Guess) -> tuple[int, ...]:
        """Return the representations of a motion, leg by leg."""
        task = self.task
        if not task.rules.has_configuration:
            return (1,) * len(guess.legs)
        start, middles = 0.0, []
        for leg, wait in zip(guess.legs, [*guess.waits, 0.0], strict=True):
            middles.append(start + leg.duration / 2)
            start += leg.duration + wait
        return signs_of(task.trajectory_of(guess), middles, task.space)

    def improve(
        self,
        guess: Guess,
        signs: tuple[int, ...],
        *,
        meant: Guess | None = None,
        longest: float | None = None,
        has_swing: bool = False,
        share: float = 1.0,
    ) -> Candidate | None:
        """Return what solving leads to, proved; None if nothing is.

        Parameters
        ----------
        guess : Guess
        signs : tuple of {1, -1}
        meant : Guess, optional
            What is to be changed least, or smoothed; by default the guess.
        longest : float, s, optional
            Largest duration.
        has_swing : bool
            Whether the solver is told of limits on steering accelerations.
        share : float, (0, 1]
            Of the time that is left.
        """
        task, end = self.task, clock.perf_counter() + share * self.time_left
        reference = None if task.objective == "time" else meant or guess
        tightness, pad = Tightness(), PAD
        known: tuple[Separation, ...] = ()
        for _ in range(ROUNDS):
            if end - clock.perf_counter() < SHORT_OF_TIME:
                break
            lines = np.zeros((0, 2))
            if task.surroundings is not None:
                known, lines = task.surroundings.separations(
                    guess,
                    REACH,
                    task.clearance + pad,
                    known,
                    keep_ends=task.keep_ends,
                )
            guess = replace(guess, lines=lines)
            setting = Setting(
                tuple(len(leg.h) for leg in guess.legs),
                signs,
                task.objective,
                task.keep_ends,
                tightness,
                () if task.surroundings is None else task.surroundings.body,
                known,
                self._box(guess, pad),
                longest,
                has_swing,
                _ways(guess),
            )
            solution = self._solve(setting, guess, reference, end)
            found = solution.value
            if found is None or solution.violation > WORTH_A_LOOK:
                break
            candidate = self._candidate(found, reference, has_swing)
            if candidate is not None:
                return candidate
            tightness, pad = self._stricter(tightness, pad)
            assert self.refused is not None
            if self.refused.hit is None or task.surroundings is None:
                guess = found
            else:
                # From the start again, with what turned out to be near: a line through
                # an obstacle tells no side.
                known, _ = task.surroundings.separations(
                    found, REACH, 0.0, known, keep_ends=False
                )
        return None

    def _solve(
        self, setting: Setting, guess: Guess, reference: Guess | None, end: float
    ) -> Solution:
        problem = build_problem(self.task.space, setting, reference)
        left = max(end - clock.perf_counter(), SHORT_OF_TIME / 2)
        solution = problem.solve(
            guess, max_iterations=self.task.max_iterations, time=left
        )
        self.solution = solution
        self.solves += 1
        statistics = solution.statistics
        self.iterations += int(statistics["iterations"])
        self.solve_time += float(statistics["time"])
        self.unknowns = int(statistics.get("unknowns", 0))
        self.constraints = int(statistics.get("constraints", 0))
        return solution

    def _candidate(
        self, found: Guess, reference: Guess | None, has_swing: bool
    ) -> Candidate | None:
        """Return the better of the solver's own timing and the fastest one."""
        task, options = self.task, []
        if task.objective != "smooth":
            timed = task.retimed(task.path_of(found))
            options += [] if timed is None else [timed]
        if has_swing or not task.rules.bounds_swing or not options:
            options.append(task.realise(found))
        proved = [one for one in options if one.is_proved]
        if not proved:
            self.refused = options[-1]
            return None
        if task.objective == "change":
            assert reference is not None
            proved = [self.at_pace(proved, reference.duration)]
        rated = [self.rated(one) for one in proved]
        return min(rated, key=lambda one: one.score)

    def at_pace(self, options: Sequence[Realised], duration: float) -> Realised:
        """Return the timing whose duration is nearest to a given one, not below it."""
        fastest = min(options, key=lambda one: one.trajectory.duration)
        taken = fastest.trajectory.duration
        if taken < duration:
            slower = self.task.realised(fastest.trajectory.scaled(taken / duration))
            if slower.is_proved:
                return slower
        return fastest

    def rated(self, realised: Realised, way: str = "solver") -> Candidate:
        """Return a proved trajectory with what it is compared by."""
        task, found = self.task, realised.trajectory
        kappa_g = task.rules.kappa_g
        if task.objective == "time":
            return Candidate(realised, found.duration, way)
        if task.objective == "smooth":
            return Candidate(realised, jerk_of(found, kappa_g), way)
        reference = task.rules.reference
        mean, largest = change_of(found, self.way, reference, kappa_g)
        return Candidate(realised, mean, way, largest)

    def _stricter(self, tightness: Tightness, pad: float) -> tuple[Tightness, float]:
        """Return larger margins for what was refused."""
        assert self.refused is not None
        if self.refused.hit is not None:
            pad *= STRICTER
        if not self.refused.report.valid:
            tightness = Tightness(
                tightness.share * STRICTER, tightness.angle * STRICTER
            )
        return tightness, pad

    def _box(self, guess: Guess, pad: float) -> Box | None:
        """Return the bounds less the clearance; at the ends as much as there is."""
        task = self.task
        if task.bounds is None or task.surroundings is None:
            return None
        margin = task.clearance + pad
        x0, y0, x1, y1 = task.bounds
        if task.keep_ends:
            for pose in (guess.legs[0].poses[0], guess.legs[-1].poses[-1]):
                arms = np.concatenate([np.array(p) for p in task.surroundings.body])
                at = complex(pose[0], pose[1]) + np.exp(1j * pose[2]) * arms
                free = [at.real - x0, x1 - at.real, at.imag - y0, y1 - at.imag]
                margin = min(margin, 0.9 * max(float(np.min(free)), 0.0))
        return x0 + margin, y0 + margin, x1 - margin, y1 - margin


def _ways(guess: Guess) -> FloatArray | None:
    """Return how each leg goes on, where there are several."""
    if len(guess.legs) < 2:
        return None
    return np.array([leg.poses[-1] - leg.poses[0] for leg in guess.legs])
