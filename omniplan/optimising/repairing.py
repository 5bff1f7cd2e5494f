"""Mending what wheels cannot follow: the nearest way they can, or one planned anew."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from omniplan.optimising.attempts import Attempts, Candidate
from omniplan.optimising.limits import top_speed
from omniplan.optimising.polishing import MARGINS, polished
from omniplan.optimising.projection import TRIALS, Trial, projected
from omniplan.optimising.realising import Realised, trajectory_of
from omniplan.optimising.setting import Guess
from omniplan.optimising.warm_start import (
    Course,
    courses_of,
    guess_of,
    leg_through,
    rounded,
)
from omniplan.trajectory import Trajectory

__all__ = ["Repair"]

ROOM = 0.01
"""What is kept from obstacles beyond the clearance at first, m."""
LEAST_PLANNING = 2.0
"""Time for a plan between the ends at least, s."""
MOTIONS = 300
"""A plan between the ends ends after so many motions were looked at."""


@dataclass(eq=False)
class Repair:
    """Finds what can be driven near a way that cannot."""

    attempts: Attempts
    courses: Sequence[Course]
    waits: Sequence[float]
    start: Guess | None = None
    """The nearest way that was found last, for a solver to go on from."""
    near: tuple[Sequence[Course], Sequence[float]] | None = None
    """The nearest way that was proved, and its waits."""
    is_exhausted: bool = False
    """Whether all ways of finding a nearest way were tried to their end."""

    def nearest(self) -> Candidate | None:
        """Return a proved trajectory on a nearest way, None if none is proved."""
        for trial, (courses, waits) in itertools.product(TRIALS, self._readings()):
            if self.attempts.time_left <= 0:
                return None
            found = self._projected(courses, trial)
            if found is None:
                continue
            if courses is self.courses:
                self.start = guess_of(found, waits, self.attempts.task.intervals)
            realised = self._realised(found, waits)
            if realised is not None and realised.is_proved:
                self.near = found, waits
                return self.attempts.rated(realised, "nearest")
        self.is_exhausted = True
        return None

    def closer(self, best: Candidate) -> Candidate:
        """Return a proved trajectory closer to the way given, or the one that is known.

        Parameters
        ----------
        best : Candidate
            Proved, and rated by its change.
        """
        found = self._closest(*(self.near or self.courses_along(best)))
        return best if found is None or found.score >= best.score else found

    def closest(self) -> Candidate | None:
        """Return a proved trajectory on the closest way around the one given."""
        for courses, waits in self._readings():
            found = self._closest(courses, waits)
            if found is not None:
                return found
        return None

    def _closest(
        self, courses: Sequence[Course], waits: Sequence[float]
    ) -> Candidate | None:
        for margin in MARGINS:
            if self.attempts.time_left <= 0:
                break
            found = polished(self.attempts, courses, margin)
            if found is None:
                continue
            realised = self._realised(found, waits)
            if realised is not None and realised.is_proved:
                return self.attempts.rated(realised, "nearest")
        return None

    def _readings(self) -> Iterator[tuple[Sequence[Course], Sequence[float]]]:
        """Yield the courses as they are, and as one: noise looks like stops."""
        yield self.courses, self.waits
        if len(self.courses) > 1:
            yield [rounded(self.courses)], ()

    def _projected(
        self, courses: Sequence[Course], trial: Trial
    ) -> list[Course] | None:
        task, number = self.attempts.task, TRIALS.index(trial)
        found = []
        for course in courses:
            near = projected(
                course,
                task.rules,
                trial,
                task.surroundings,
                room=task.clearance + ROOM * (number + 1),
                bounds=task.bounds,
            )
            if near is None and len(courses) == 1:
                return None
            found.append(near or course)
        return found

    def _realised(
        self, courses: Sequence[Course], waits: Sequence[float]
    ) -> Realised | None:
        """Return the fastest timing along courses, at the given pace if it may be."""
        attempts, task = self.attempts, self.attempts.task
        legs = tuple(leg_through(np.diff(c.t), c.poses) for c in courses)
        guess = Guess(legs, tuple(waits))
        made = trajectory_of(guess, task.rules.reference, task.name, per_interval=1)
        realised = task.retimed(made)
        if realised is None or not realised.is_proved:
            if realised is not None:
                attempts.refused = realised
            return realised
        if task.objective == "change":
            return attempts.at_pace([realised], guess.duration)
        return realised

    def planned(self) -> Candidate | None:
        """Return a plan between the ends, whatever the way between them was."""
        # OMPL is heavy, and hardly ever needed here.
        from omniplan.planning.planner import plan

        attempts, task = self.attempts, self.attempts.task
        if not task.keep_ends:
            return None
        seconds = max(attempts.time_left, LEAST_PLANNING)
        ends = self.courses[0].poses[0], self.courses[-1].poses[-1]
        found = plan(*ends, task.space, task.checker, time=seconds, iterations=MOTIONS)
        if found.trajectory is None:
            return None
        realised = task.realised(self._turned(found.trajectory))
        if not realised.is_proved:
            return None
        return attempts.rated(realised, "plan")

    def _turned(self, trajectory: Trajectory) -> Trajectory:
        """Return the plan, its headings counted from that of the given start."""
        start = self.courses[0].poses[0, 2]
        turns = 2 * np.pi * np.round((start - trajectory.samples[0, 2]) / (2 * np.pi))
        if not turns:
            return trajectory
        return Trajectory.from_poses(
            trajectory.t,
            trajectory.samples + np.array([0.0, 0.0, turns]),
            name=trajectory.name,
            reference_point=trajectory.reference_point,
        )

    def courses_along(self, candidate: Candidate) -> tuple[list[Course], list[float]]:
        """Return the courses of a proved trajectory."""
        rules = self.attempts.task.rules
        trajectory = candidate.realised.trajectory
        return courses_of(trajectory, rules.reference, top_speed(rules))
