"""`omniplan.optimise`: a better trajectory near the one given, proved, or why not."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Sequence
from dataclasses import replace
from numbers import Integral, Real
from typing import get_args

import numpy as np

from configspace import InvalidInput, PermissibleSpace, Problem
from configspace.space import require_space
from omniplan.errors import InvalidTrajectory
from omniplan.judging.rows import Tolerances
from omniplan.obstacles import CollisionChecker, Obstacles
from omniplan.optimising.answers import Answers
from omniplan.optimising.attempts import Attempts, Candidate, Task
from omniplan.optimising.hopeless import hopeless_reason
from omniplan.optimising.limits import rules_of, top_speed
from omniplan.optimising.repairing import Repair
from omniplan.optimising.separation import Surroundings
from omniplan.optimising.setting import Box, Objective
from omniplan.optimising.warm_start import (
    Course,
    courses_of,
    guess_of,
    merged,
    rounded,
)
from omniplan.path import Path
from omniplan.planning.result import Plan
from omniplan.trajectory import Trajectory, require_motion

__all__ = ["optimise"]

INTERVALS = 40
"""Of the longest way between two stops."""
GAIN = 1e-3
"""What is better by less than this share is no better."""
LONGER = 1.25
"""How much longer than its fastest timing a smooth motion on a path may take."""
MOST_PLACES = 1500
"""By so many poses the way given is known when changes are measured."""
FIRST = 0.6
"""Share of the time for a first try, if others may follow."""


def optimise(
    motion: Trajectory | Path | Plan,
    space: PermissibleSpace,
    obstacles: Obstacles | None = None,
    *,
    objective: Objective = "time",
    bounds: Sequence[float] | None = None,
    clearance: float = 0.0,
    keep_ends: bool = True,
    intervals: int = INTERVALS,
    max_iterations: int = 300,
    time: float = 10.0,
    tolerances: Tolerances | None = None,
    allow_unreachable: bool = False,
) -> Plan:
    """Return a better trajectory near the one given.

    A local optimum: the way round obstacles stays. Stops are kept, or driven through
    where the vehicle can do so and that is better; every limit that `validate` judges
    and every obstacle is kept, and what is returned has been proved to.

    Parameters
    ----------
    motion : Trajectory, Path or Plan
        Where to start, of poses: that of `omniplan.plan`, or any other; it need not
        keep any limit. The result starts and ends at rest, unless it is the one given
        or that one slowed down.
    space : PermissibleSpace
        With its vehicle: a data sheet alone does not tell all limits.
    obstacles : Obstacles, optional
        The vehicle file must then have a footprint.
    objective : {"time", "smooth", "change"}
        The shortest duration; the least jerk in no more than the given duration; or
        the smallest change with which all limits are kept: a permitted trajectory is
        then returned as it is. See Notes.
    bounds : (x0, y0, x1, y1) float, m, optional
        The area that the footprint stays in.
    clearance : float, m, ≥ 0
        Least distance to obstacles and bounds.
    keep_ends : bool
        Whether start and goal stay; only ``change`` can do otherwise.
    intervals : int, [8, 120]
        Number of intervals of the splines on the longest way between two stops.
    max_iterations : int, ≥ 1
        Of the solver, each time it is asked.
    time : float, s, > 0
        About how long to try; proving the result comes on top.
    tolerances : Tolerances, optional
        What counts as standing and as free of slip.
    allow_unreachable : bool
        As of `validate`.

    Returns
    -------
    Plan
        Statistics: ``way`` (``solver``, ``timing``: the fastest timing of the given
        path, ``nearest``: the nearest way that wheels can follow, ``plan``: one planned
        anew between the ends, or ``input``), ``objective``, ``before`` and ``after``
        (what is optimised: s, m²/s⁵ or m; ``before`` only if the input is permitted),
        ``iterations``, ``solves``, ``solver`` (how it ended), ``unknowns``,
        ``constraints``, ``solve_time`` s, ``time`` s, and ``largest_change`` m for
        ``change``.

    Raises
    ------
    InvalidInput
        If an argument is out of range, or the space does not know its vehicle.
    InvalidTrajectory
        If the samples are not poses or do not move.

    Notes
    -----
    The change is that of the way of K, at whatever speed. Two poses are
    ``√(Δx² + Δy² + (Δθ / κ_g)²)`` m apart, a pose is as far from a way as from its
    nearest pose. The change is the root of the mean square, by length, of the distances
    of the result's poses from the way given, or of the given poses from the result,
    whichever is larger (`omniplan.optimising.measure.change_of`); its unit is m. Stops
    stay where they are. Among equal ways the duration is as near to the given one as
    can be. What is found is a local optimum of this, less a margin for the proof.

    References
    ----------
    spec/omni-curve §3 and §4 for the limits; J. Betts, Practical Methods for Optimal
    Control Using Nonlinear Programming, chapter 4 (direct transcription).

    Examples
    --------
    >>> import configspace, omniplan
    >>> space = configspace.build_space(
    ...     configspace.load_vehicle("mecanum"), cache=False)
    >>> corner = omniplan.Path.from_poses([[0, 0, 0], [1, 0, 0], [1, 1, 0]])
    >>> better = omniplan.optimise(corner, space)
    >>> better.stops, better.duration < omniplan.fastest(corner, space).duration
    (0, True)
    """
    began = clock.perf_counter()
    given = _motion_of(motion)
    task = _task(
        given.name,
        space,
        obstacles,
        objective,
        bounds,
        clearance,
        keep_ends,
        intervals,
        max_iterations,
        time,
        tolerances or Tolerances(),
        allow_unreachable,
    )
    return _Optimisation(task, given, began, time).run()


def _motion_of(motion: Trajectory | Path | Plan) -> Trajectory | Path:
    if isinstance(motion, Plan):
        if motion.trajectory is None:
            shown = f"a plan without a trajectory: {motion.status.value}"
            allowed = "a plan that was found"
            raise InvalidTrajectory(Problem("motion", shown, allowed))
        return motion.trajectory
    require_motion(motion, "motion")
    return motion


def _task(
    name: str,
    space: PermissibleSpace,
    obstacles: Obstacles | None,
    objective: Objective,
    bounds: Sequence[float] | None,
    clearance: float,
    keep_ends: bool,
    intervals: int,
    max_iterations: int,
    time: float,
    tolerances: Tolerances,
    allow_unreachable: bool,
) -> Task:
    """Return the task after a look at the arguments."""
    require_space(space)
    if space.vehicle is None:
        given = f"{space.name}: a data sheet alone"
        allowed = "optimising needs the vehicle: a data sheet does not hold all rates"
        raise InvalidInput(Problem("space", given, allowed))
    objectives = get_args(Objective)
    _require(
        objective in objectives, "objective", repr(objective), ", ".join(objectives)
    )
    is_time = isinstance(time, Real) and math.isfinite(time) and time > 0
    _require(is_time, "time", repr(time), "positive, s")
    for name_of, count, low, high, allowed in (
        ("max_iterations", max_iterations, 1, math.inf, "a whole number, at least 1"),
        ("intervals", intervals, 8, 120, "a whole number from 8 to 120"),
    ):
        is_within = isinstance(count, Integral) and low <= count <= high
        _require(is_within, name_of, repr(count), allowed)
    is_room = isinstance(clearance, Real) and math.isfinite(clearance)
    allowed = "a finite distance of at least 0 m"
    _require(is_room and clearance >= 0, "clearance", repr(clearance), allowed)
    _require(
        keep_ends or objective == "change",
        "keep_ends",
        f"False for the objective {objective}",
        "only change may move the ends",
    )
    _require(
        obstacles is None or isinstance(obstacles, Obstacles),
        "obstacles",
        type(obstacles).__name__,
        "an Obstacles, as Obstacles.from_polygons returns",
    )
    checker, surroundings = None, None
    if obstacles is not None or bounds is not None:
        around = Obstacles() if obstacles is None else obstacles
        checker = CollisionChecker(space.vehicle, around, clearance, bounds)
        surroundings = Surroundings.of(space.vehicle, around)
    box: Box | None = None
    if bounds is not None:
        x0, y0, x1, y1 = (float(x) for x in bounds)
        box = x0, y0, x1, y1
    return Task(
        space,
        space.vehicle,
        rules_of(space.vehicle),
        objective,
        checker,
        surroundings,
        box,
        clearance,
        keep_ends,
        intervals,
        max_iterations,
        tolerances,
        allow_unreachable,
        name,
    )


def _require(holds: bool, where: str, given: str, allowed: str) -> None:
    if not holds:
        raise InvalidInput(Problem(where, given, allowed))


class _Optimisation:
    """One run of `optimise`."""

    def __init__(
        self, task: Task, given: Trajectory | Path, began: float, time: float
    ) -> None:
        self._task, self._given = task, given
        self._courses, self._waits = courses_of(
            given, task.rules.reference, top_speed(task.rules)
        )
        way = np.concatenate([course.poses for course in self._courses])
        thinned = way[:: 1 + len(way) // MOST_PLACES]
        self._attempts = Attempts(task, began + time, np.append(thinned, way[-1:], 0))
        self._longest: float | None = None
        if task.objective == "smooth" and isinstance(given, Trajectory):
            self._longest = given.duration
        self._repair = Repair(self._attempts, self._courses, self._waits)
        self._answers = Answers(task, self._attempts, self._repair, began)

    def run(self) -> Plan:
        hopeless = hopeless_reason(self._task, self._courses, self._longest)
        if hopeless is not None:
            return self._answers.no(*hopeless)
        before = self._input()
        if self._task.objective == "change" and before is not None:
            return self._answers.found(before, before)
        found = self._found(before)
        options = [one for one in (before, found) if one is not None]
        if not options:
            return self._answers.refusal()
        best = min(
            options, key=lambda one: one.score * (1 + GAIN * (one is not before))
        )
        return self._answers.found(best, before)

    def _input(self) -> Candidate | None:
        """Return the input as a candidate, None if it is no proved trajectory."""
        task, given = self._task, self._given
        if isinstance(given, Path):
            return None
        realised = task.judged(given)
        if not realised.is_proved:
            self._attempts.refused = realised
            return None
        score = 0.0
        if task.objective != "change":
            score = self._attempts.rated(realised).score
        return Candidate(realised, score, "input")

    def _found(self, before: Candidate | None) -> Candidate | None:
        """Return the best that timing, mending and solving lead to."""
        objective, timed = self._task.objective, self._timed()
        if objective == "change":
            return self._mended() if timed is None else self._at_pace(timed)
        start = timed or self._repair.nearest()
        if objective == "time":
            return self._fastest(start)
        longest = self._longest
        if longest is None and start is not None:
            longest = LONGER * start.realised.trajectory.duration
        return self._improved(self._courses, self._waits, longest=longest)

    def _mended(self) -> Candidate | None:
        """Return what is permitted near a way that is not."""
        near = self._repair.nearest()
        if near is not None:
            return self._repair.closer(near)
        near = self._repair.closest()
        if near is not None:
            return near
        attempts, start = self._attempts, self._repair.start
        if start is not None:
            meant, _ = attempts.guess(self._courses, self._waits)
            signs = attempts.signs_of(start)
            swings = self._task.rules.bounds_swing
            found = attempts.improve(
                start, signs, meant=meant, has_swing=swings, share=FIRST
            )
            if found is not None:
                return self._repair.closer(found)
        found = self._improved(self._courses, self._waits)
        if found is not None:
            return self._repair.closer(found)
        return self._repair.planned()

    def _fastest(self, timed: Candidate | None) -> Candidate | None:
        """Return the fastest: of the path as it is, or of one near it."""
        courses, waits = self._courses, self._waits
        if timed is not None:
            courses, waits = self._repair.courses_along(timed)
        found = self._improved(courses, waits)
        if found is not None and self._task.rules.bounds_swing:
            # The solver has not been told of steering accelerations yet.
            guess, signs = self._attempts.guess(*self._repair.courses_along(found))
            finer = self._attempts.improve(guess, signs, has_swing=True)
            found = _better(found, finer)
        return _better(timed, found)

    def _timed(self) -> Candidate | None:
        """Return the fastest timing of the path as it is given."""
        task = self._task
        realised = task.retimed(self._given)
        if realised is None or not realised.is_proved:
            return None
        if task.objective == "change":
            return Candidate(realised, 0.0, "timing")
        return self._attempts.rated(realised, "timing")

    def _at_pace(self, timed: Candidate) -> Candidate:
        """Return the unchanged path at a pace as near to the given one as can be."""
        options, duration = [timed.realised], 0.0
        if isinstance(self._given, Trajectory):
            duration = self._given.duration
            slower = self._task.realised(self._given)
            options += [slower] if slower.is_proved else []
        return replace(timed, realised=self._attempts.at_pace(options, duration))

    def _improved(
        self,
        courses: Sequence[Course],
        waits: Sequence[float],
        *,
        longest: float | None = None,
    ) -> Candidate | None:
        """Return what solving leads to: without stops that need not be, or with all."""
        task, attempts = self._task, self._attempts
        has_swing = task.rules.bounds_swing and task.objective != "time"
        guess, signs = attempts.guess(courses, waits)
        free = not task.rules.has_configuration and task.rules.line is None
        groups = merged(courses, signs, turns_anywhere=free)
        if task.objective != "change" and len(groups) < len(courses):
            some = [rounded([courses[i] for i in group]) for group in groups]
            between = [waits[group[-1]] for group in groups[:-1]]
            chosen = tuple(signs[group[0]] for group in groups)
            found = attempts.improve(
                guess_of(some, between, task.intervals),
                chosen,
                longest=longest,
                has_swing=has_swing,
                share=FIRST,
            )
            if found is not None:
                return found
        return attempts.improve(guess, signs, longest=longest, has_swing=has_swing)


def _better(one: Candidate | None, other: Candidate | None) -> Candidate | None:
    """Return the better of two; the first where they hardly differ."""
    if one is None or other is None:
        return one or other
    return other if other.score < one.score * (1 - GAIN) else one
