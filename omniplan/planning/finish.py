"""From a route to a plan: timed, proved, and what the wheels do at both ends.

A plan is a success only if `validate` accepts its trajectory and the collision checker
proves it free along its own splines, which leave the moves by a little.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from omniplan.judging.judge import judge_for
from omniplan.judging.rows import Tolerances
from omniplan.motion import OmniCurveMotion
from omniplan.path import Path
from omniplan.planning.permits import Configuration
from omniplan.planning.result import Plan, PlanStatus
from omniplan.planning.route import Route
from omniplan.planning.task import Checker, Task
from omniplan.report import Report
from omniplan.samples import HEADING_LENGTH
from omniplan.standing.ways import Changer
from omniplan.timing.fastest import time_path
from omniplan.timing.path_motion import pieces_of
from omniplan.timing.result import Timing
from omniplan.timing.shape import shape_of
from omniplan.trajectory import Trajectory
from omniplan.validation import judged

__all__ = ["Ends", "finished", "steering_wait"]

REST = 1e-3
"""Least time at rest where one is added, s."""
SPARE = 1e-6
"""By this share such times are longer than they need to be."""

BACK = 1e-6
"""A vehicle drives back where its direction after a stop is more than a quarter turn
off that before it, a radian of heading counting `HEADING_LENGTH` metres; rounding."""


@dataclass(frozen=True)
class Ends:
    """Configurations of the wheels that are asked for; None for any."""

    start: Configuration | None
    goal: Configuration | None


def finished(
    task: Task,
    ends: Ends,
    strict: Checker | None,
    route: Route,
    statistics: Mapping[str, float | int | str],
) -> Plan:
    """Return the plan that a route makes, or why it does not.

    Parameters
    ----------
    task : Task
    ends : Ends
    strict : Checker, optional
        Of the distance that was asked for.
    route : Route
    statistics : mapping
    """
    space, reference = task.space, task.vehicle.reference
    path = route.to_path("plan", (reference.real, reference.imag))
    checkpoint = task.budget.checkpoint
    task.budget.check()
    timing = time_path(path, space, checkpoint=checkpoint)
    if timing.trajectory is None:
        place = None if timing.fault is None else timing.fault.pose
        return _refused(task, timing.message, place, None, statistics)
    trajectory = _with_waits(task, ends, path, timing)
    if trajectory is None:
        message = "at an end the wheels find no way from or to the configuration given"
        return _refused(task, message, task.start, None, statistics)
    # `time_path` has validated it; this is for the report, and after waits were added.
    report = judged(
        trajectory, space, Tolerances(), allow_unreachable=False, checkpoint=checkpoint
    )
    if not report.valid:
        worst = report.headline
        place = None if worst is None else worst.pose
        return _refused(task, str(worst), place, report, statistics)
    task.budget.check()
    hit = None if strict is None else strict.first_hit_of_trajectory(trajectory)
    if hit is not None:
        return _refused(
            task, f"the trajectory {hit.message}", hit.pose, report, statistics
        )
    report = replace(report, speed_factor=1.0, fastest_duration=trajectory.duration)
    stops, cusps = len(route.stops), _cusps(route)
    message = (
        f"{space.name}: {trajectory.duration:.2f} s, "
        f"{stops} stop{'s' * (stops != 1)}, {cusps} of them to drive back"
    )
    return Plan(
        space.name,
        PlanStatus.FOUND,
        message,
        trajectory,
        report,
        None,
        stops,
        cusps,
        statistics,
    )


def _refused(
    task: Task,
    message: str,
    place: tuple[float, float, float] | None,
    report: Report | None,
    statistics: Mapping[str, float | int | str],
) -> Plan:
    status = PlanStatus.NOT_PROVED
    text = f"{task.space.name}: {status.value}: {message}"
    return Plan(
        task.space.name, status, text, None, report, place, statistics=statistics
    )


def _with_waits(
    task: Task, ends: Ends, path: Path, timing: Timing
) -> Trajectory | None:
    """Return the trajectory with time to steer from and to what is asked for."""
    trajectory = timing.raise_for_status()
    if ends.start is None and ends.goal is None:
        return trajectory
    assert timing.profile is not None
    signs = timing.profile.representation
    pieces = pieces_of(path)
    first, last = (
        shape_of(pieces[i], task.space, Tolerances()).ends[int(signs[i])][i]
        for i in (0, -1)
    )
    waits = (
        (len(trajectory.t) - 1, last, ends.goal),  # from the back: rows keep numbers
        (0, ends.start, first),
    )
    for row, before, after in waits:
        if before is None or after is None:
            continue
        wait = steering_wait(task, before, after)
        if math.isinf(wait):
            return None
        if wait > 0:
            trajectory = trajectory.with_dwell(row, max(wait * (1 + SPARE), REST))
    return trajectory


def steering_wait(task: Task, before: Configuration, after: Configuration) -> float:
    """Return the time from one configuration to another at rest, s; inf: no way.

    Parameters
    ----------
    task : Task
    before, after : (float, float), 1 and rad
    """
    still = OmniCurveMotion(
        np.array([0.0, 1.0]),
        np.array([[*before, 0.0]] * 2),
        task.space.kappa_g,
        task.vehicle.reference,
    )
    tolerances = Tolerances()
    judge = judge_for(task.space, still, tolerances)
    change = Changer(judge, task.space, tolerances).change(before, after)
    return min(way.time for way in change.ways)


def _cusps(route: Route) -> int:
    """Return at how many stops the vehicle drives on against where it came from."""
    count = 0
    for row in route.stops:
        steps = np.diff(route.poses[row - 1 : row + 2], axis=0)
        steps = steps * [1.0, 1.0, HEADING_LENGTH]
        came, goes = steps / np.linalg.norm(steps, axis=1, keepdims=True)
        count += bool(came @ goes < -BACK)
    return count
