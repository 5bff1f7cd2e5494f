"""What cannot be, told before any solver is asked."""

from __future__ import annotations

import math
from collections.abc import Sequence

from configspace.kernels import BLOCKED
from omniplan.optimising.attempts import Task
from omniplan.optimising.pace import least_duration
from omniplan.optimising.warm_start import Course
from omniplan.planning.result import PlanStatus

__all__ = ["hopeless_reason"]

Pose = tuple[float, float, float]
Reason = tuple[PlanStatus, str, Pose | None]

SAME_HEADING = 1e-6
"""Headings nearer than this are one, rad."""


def hopeless_reason(
    task: Task, courses: Sequence[Course], longest: float | None
) -> Reason | None:
    """Return status, message and place of what makes a task impossible.

    Parameters
    ----------
    task : Task
    courses : sequence of Course
        The way as given.
    longest : float, s, optional
        The time there is.

    Returns
    -------
    reason : (PlanStatus, str, pose or None) or None
        None where no such thing is known: that is no promise.
    """
    if (task.space.tables.state == BLOCKED).all():
        text = "no configuration of the wheels is permitted at all"
        return _reason(task, PlanStatus.INFEASIBLE, text, None)
    return (
        _blocked(task, courses)
        or _turned(task, courses)
        or _late(task, courses, longest)
    )


def _reason(task: Task, status: PlanStatus, text: str, place: Pose | None) -> Reason:
    message = f"{task.name} by {task.space.name}: {status.value}: {text}"
    return status, message, place


def _ends(courses: Sequence[Course]) -> tuple[Pose, Pose]:
    first, last = courses[0].poses[0].tolist(), courses[-1].poses[-1].tolist()
    return (first[0], first[1], first[2]), (last[0], last[1], last[2])


def _blocked(task: Task, courses: Sequence[Course]) -> Reason | None:
    """Return why the start or the goal cannot be kept."""
    if task.checker is None or not task.keep_ends:
        return None
    statuses = (PlanStatus.START_BLOCKED, PlanStatus.GOAL_BLOCKED)
    for pose, status in zip(_ends(courses), statuses, strict=True):
        hit = task.checker.hit_at(pose)
        if hit is not None:
            return _reason(task, status, hit.message, hit.pose)
    return None


def _turned(task: Task, courses: Sequence[Course]) -> Reason | None:
    """Return that a vehicle which only translates should turn."""
    start, goal = _ends(courses)
    turn = math.remainder(goal[2] - start[2], 2 * math.pi)
    if not (task.rules.is_translating and task.keep_ends and abs(turn) > SAME_HEADING):
        return None
    text = (
        f"the vehicle keeps its heading, and the goal's is {math.degrees(turn):+.4g}° "
        f"off that of the start"
    )
    return _reason(task, PlanStatus.INFEASIBLE, text, goal)


def _late(
    task: Task, courses: Sequence[Course], longest: float | None
) -> Reason | None:
    """Return that the time given is too short for any motion."""
    if longest is None:
        return None
    least = sum(least_duration(task.rules, course.poses) for course in courses)
    if least <= longest:
        return None
    text = (
        f"{longest:.4g} s are given, and at the wheels' largest speeds alone it takes "
        f"more than {least:.4g} s"
    )
    return _reason(task, PlanStatus.INFEASIBLE, text, _ends(courses)[1])
