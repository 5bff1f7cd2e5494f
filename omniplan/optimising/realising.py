"""From what a solver found to a trajectory that is proved, or a refusal with its place.

Nothing leaves here as a success that `omniplan.validate` and the collision check have
not accepted.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from configspace import PermissibleSpace
from omniplan.judging.rows import Tolerances
from omniplan.motion import PoseMotion
from omniplan.optimising.setting import Guess
from omniplan.optimising.warm_start import splines_of
from omniplan.path import Path
from omniplan.report import Report
from omniplan.timing.fastest import time_path
from omniplan.timing.path_motion import path_of
from omniplan.trajectory import Trajectory
from omniplan.validation import validate

__all__ = ["Checker", "Realised", "faster_timing", "realise", "trajectory_of"]

FloatArray = npt.NDArray[np.float64]

PER_INTERVAL = 4
"""Samples per interval: the splines stay what they are."""
DWELL = 1e-4
"""Time at every stop, s, so that its pose is repeated and the stop cannot be missed."""
WAITS = 3
"""How often waits at stops are made longer as `validate` demands."""


class Checker(Protocol):
    """What is asked of a collision checker."""

    def first_hit_of_trajectory(self, trajectory: Trajectory) -> Hit | None:
        """Return the first hit along a trajectory, None if it is proved free."""
        ...


class Hit(Protocol):
    """Where a motion hits something."""

    @property
    def pose(self) -> npt.ArrayLike:
        """(x, y, θ) of K."""
        ...


@dataclass(frozen=True, eq=False)
class Realised:
    """A trajectory and its verdicts."""

    trajectory: Trajectory
    report: Report
    hit: Hit | None = None

    @property
    def is_proved(self) -> bool:
        """Whether it can be driven and hits nothing."""
        return self.report.valid and self.hit is None


def trajectory_of(
    guess: Guess, reference: complex, name: str, *, per_interval: int = PER_INTERVAL
) -> Trajectory:
    """Return the trajectory of K that the knots of a motion describe."""
    times: list[FloatArray] = []
    poses: list[FloatArray] = []
    now = 0.0
    for leg, wait in zip(guess.legs, [*guess.waits, 0.0], strict=True):
        spline = splines_of(leg)
        knots = spline.x
        steps = np.linspace(0.0, 1.0, per_interval, endpoint=False)
        t = np.append((knots[:-1, None] + leg.h[:, None] * steps).ravel(), knots[-1])
        samples = np.asarray(spline(t))
        samples[[0, -1]] = leg.poses[[0, -1]]
        times.append(now + t)
        poses.append(samples)
        now = float(times[-1][-1]) + max(wait, DWELL)
    made = _sampled(np.concatenate(times), np.concatenate(poses), reference, name)
    rest = PoseMotion(made.t, made.samples, reference).rest
    assert rest is not None
    if rest[0, 0] and rest[1, -1]:
        return made
    # The samples do not tell that they start or end at rest: a dwell does.
    t, samples = made.t, made.samples
    t = np.concatenate([[t[0] - DWELL], t, [t[-1] + DWELL]]) + DWELL
    samples = np.concatenate([samples[:1], samples, samples[-1:]])
    return _sampled(t, samples, reference, name)


def _sampled(
    t: FloatArray, samples: FloatArray, reference: complex, name: str
) -> Trajectory:
    point = reference.real, reference.imag
    return Trajectory.from_poses(t, samples, name=name, reference_point=point)


def realise(
    trajectory: Trajectory,
    space: PermissibleSpace,
    checker: Checker | None,
    tolerances: Tolerances,
    *,
    allow_unreachable: bool = False,
) -> Realised:
    """Return a trajectory with its verdicts, slower or with longer waits if need be."""

    def judge(one: Trajectory) -> Report:
        return validate(one, space, tolerances, allow_unreachable=allow_unreachable)

    report = judge(trajectory)
    for _ in range(WAITS):
        if not _asks_for_waits(report):
            break
        trajectory = _with_longer_waits(trajectory, report)
        report = judge(trajectory)
    if not report.valid and report.speed_factor > 0:
        # A factor in a report has been proved by validating again.
        trajectory = trajectory.scaled(report.speed_factor)
        report = judge(trajectory)
    hit = checker.first_hit_of_trajectory(trajectory) if checker is not None else None
    return Realised(trajectory, report, hit)


def faster_timing(
    motion: Trajectory | Path,
    space: PermissibleSpace,
    checker: Checker | None,
    tolerances: Tolerances,
    *,
    allow_unreachable: bool = False,
) -> Realised | None:
    """Return the fastest timing of a motion's path, proved; None if it has none."""
    path = path_of(motion)
    timing = time_path(path, space, tolerances, allow_unreachable=allow_unreachable)
    if timing.trajectory is None:
        return None
    return realise(
        timing.trajectory,
        space,
        checker,
        tolerances,
        allow_unreachable=allow_unreachable,
    )


def _asks_for_waits(report: Report) -> bool:
    """Return whether wheels find a way at stops, but not the time."""
    return any(
        v.limit == "RECONFIGURATION" and v.value is not None for v in report.violations
    )


def _with_longer_waits(trajectory: Trajectory, report: Report) -> Trajectory:
    """Return the trajectory with the waits that a report demands."""
    for violation in reversed(report.violations):  # so that rows keep their numbers
        if violation.limit != "RECONFIGURATION" or violation.value is None:
            continue
        row = int(np.abs(trajectory.t - violation.t).argmin())
        wait = max(violation.value - violation.bound, 0.0) * (1 + 1e-6) + DWELL
        trajectory = trajectory.with_dwell(row, wait)
    return trajectory
