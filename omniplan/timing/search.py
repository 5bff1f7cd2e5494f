"""The search for a path's timing: tried, judged, timed again, and proved."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from configspace import PermissibleSpace
from omniplan.choosing.faults import Fault
from omniplan.judging.judge import judge_for
from omniplan.judging.rows import Tolerances
from omniplan.path import Path
from omniplan.proving import Proved, prove
from omniplan.report import Report
from omniplan.timing.legs import (
    Leg,
    crawl_of,
    legs_of,
    lengthened,
    trajectory_of,
)
from omniplan.timing.path_motion import PathMotion, PathPiece
from omniplan.timing.representations import fastest_together
from omniplan.timing.result import SpeedProfile, Timing, TimingStatus
from omniplan.timing.sampling import PieceSampler, SampledPiece
from omniplan.timing.shape import first_fault, shape_of
from omniplan.timing.solver import PieceProfile, TimingProblem
from omniplan.timing.tightening import any_is_tight, slowdowns_of, tightened
from omniplan.trajectory import Trajectory
from omniplan.validation import report_of, validate
from omniplan.wording import describe

__all__ = ["Timer"]

FloatArray = npt.NDArray[np.float64]
Array = TypeVar("Array", npt.NDArray[np.float64], npt.NDArray[np.int64])

PER_POSE = 1
"""Least number of steps between two poses of the path."""
CAPPED = 8
"""So many times more steps where caps have to be kept between samples."""
LOSS = 5e-3
"""If a trajectory takes longer than the optimum by more than this share ..."""
TRIES = 8
"""... it is timed again, slower where a limit was found broken, so many times ..."""
PATIENCE, GAIN = 3, 1e-3
"""... unless so many more gained less than this share of time."""
AROUND = 1
"""So many steps before and after such a place are passed more slowly, too."""
STARTING = 0.01
"""... and of the time since rest, or until it, up to this, s, as much."""
AT_REST = 1.05
"""There limits on α̈ are known least, and a slower start costs next to nothing."""
PARTS = 20_000
"""How many parts a trajectory may be halved into until it is known well enough."""
SCALINGS, SPARE = 3, 1e-4
"""How often a trajectory is slowed down as a whole, by this share more than asked."""
CANDIDATES = 2
"""How many of the trajectories are proved until one is."""
WAITS = 3
"""How often waits at stops are made longer as `validate` demands."""
SHAPE_LIMITS = (
    "STEER_RANGE",
    "SINGULAR",
    "SINGULAR_ZONE",
    "FIXED_WHEEL",
    "PARALLEL_WHEELS",
    "UNREACHABLE",
)
"""Limits of the configuration, which driving slower does not mend."""


BLOCKED, NO_WAY = TimingStatus.BLOCKED, TimingStatus.NO_WAY


@dataclass(frozen=True, eq=False)
class _Try:
    """A trajectory as it was judged."""

    proved: Proved
    report: Report
    """Its speed factor is what the margins promise."""
    slowdowns: FloatArray
    """How many times more slowly every part had to be passed."""
    legs: list[Leg]

    @property
    def estimate(self) -> float:
        """How long it takes, if need be slowed down as a whole, s."""
        if self.report.valid:
            return self.report.duration
        if not self.is_mendable:
            return math.inf
        return self.report.duration * max(float(self.slowdowns.max()), 1.0)

    @property
    def is_mendable(self) -> bool:
        """Whether driving some places more slowly may help."""
        return all(
            v.limit not in SHAPE_LIMITS
            and (v.limit != "RECONFIGURATION" or crawl_of(v, self.legs) > 1)
            for v in self.report.violations
        )


class Timer:
    """Times paths for one vehicle."""

    def __init__(
        self,
        space: PermissibleSpace,
        tolerances: Tolerances,
        allow_unreachable: bool,
        steps: int,
        checkpoint: Callable[[], None] | None = None,
    ) -> None:
        self._space, self._tolerances = space, tolerances
        self._allow_unreachable, self._steps = allow_unreachable, steps
        self._checkpoint = checkpoint

    def signs(self, piece: PathPiece) -> tuple[int, ...]:
        """Return the representations that the vehicle has."""
        judge = judge_for(self._space, PathMotion(piece, 1.0), self._tolerances)
        return (1, -1) if judge.needs_configuration else (1,)

    def time(
        self,
        path: Path,
        problem: TimingProblem,
        numbers: range,
        profiles: dict[tuple[int, int], PieceProfile],
    ) -> Timing:
        """Return the timing of one path, whose pieces have these numbers."""
        pieces = [problem.pieces[k] for k in numbers]
        shapes = [shape_of(piece, self._space, self._tolerances) for piece in pieces]
        fault = first_fault(shapes)
        if fault is not None:
            return self._no(path, BLOCKED, fault)
        options = [
            {
                sign: profiles[k, sign]
                for sign, wrong in shape.faults.items()
                if wrong is None and profiles[k, sign].stuck < 0
            }
            for k, shape in zip(numbers, shapes, strict=True)
        ]
        for k, piece, option, shape in zip(
            numbers, pieces, options, shapes, strict=True
        ):
            if not option:
                free = [s for s, wrong in shape.faults.items() if wrong is None]
                stuck = self._stuck(problem, piece, profiles[k, free[0]])
                return self._no(path, TimingStatus.STUCK, stuck)
        choice = fastest_together(
            pieces, shapes, options, self._space, self._tolerances
        )
        if isinstance(choice, Fault):
            return self._no(path, NO_WAY, choice)
        chosen, waits = choice
        profile = _joined(problem, chosen, waits, self._wheel_ids)
        samplers = [
            PieceSampler(problem, k, one, self._steps_of(problem.pieces[k]))
            for k, one in zip(numbers, chosen, strict=True)
        ]
        weights = [np.ones(sampler.u.size) for sampler in samplers]
        sampled = [sampler.sampled() for sampler in samplers]
        tries: list[_Try] = []
        for _ in range(TRIES):
            one = self._tried(path, sampled, waits, chosen)
            tries.append(one)
            profile = _joined(problem, chosen, waits, self._wheel_ids)
            if _is_enough(tries, profile.duration):
                break
            if not one.is_mendable or (one.report.valid and not any_is_tight(weights)):
                break
            for i, (sampler, leg) in enumerate(zip(samplers, one.legs, strict=True)):
                weight = _tighter(weights[i], sampler, leg, one)
                if (weight != weights[i]).any():
                    weights[i], sampled[i] = weight, sampler.sampled(weight)
        tries.sort(key=lambda one: one.estimate)
        timing = self._proved(path, tries[0], chosen, profile)
        for one in tries[1:CANDIDATES]:
            if timing.duration is not None and timing.duration <= one.estimate:
                break
            again = self._proved(path, one, chosen, profile)
            timing = min(timing, again, key=_worth)
        return timing

    @property
    def _wheel_ids(self) -> tuple[str, ...]:
        assert self._space.vehicle is not None
        return tuple(wheel.id for wheel in self._space.vehicle.wheels)

    def _no(
        self,
        path: Path,
        status: TimingStatus,
        fault: Fault,
        profile: SpeedProfile | None = None,
    ) -> Timing:
        message = f"{path.name} by {self._space.name}: {status.value}: {fault}"
        return Timing(
            self._space.name, path.name, status, None, profile, fault, message
        )

    def _stuck(
        self, problem: TimingProblem, piece: PathPiece, profile: PieceProfile
    ) -> Fault:
        """Return where a profile cannot go on, and by which limit."""
        at = profile.stuck
        row = problem.rows[int(profile.row[at])]
        u = float(profile.u[at])
        x, y, theta = piece.poses_at(np.array([u]))[0].tolist()
        wheel = self._wheel_ids[row.wheel] if row.wheel >= 0 else None
        text = "can only be passed infinitely slowly"
        return Fault(row.limit, wheel, u, (x, y, theta), text)

    @property
    def _footprint(self) -> Sequence[tuple[float, float]]:
        assert self._space.vehicle is not None
        return self._space.vehicle.footprint

    def _steps_of(self, piece: PathPiece) -> int:
        has_caps = bool(np.isfinite([piece.max_speed, piece.max_yaw_rate]).any())
        least = self._steps * (CAPPED if has_caps else 1)
        return max(least, PER_POSE * (piece.u.size - 1))

    def _tried(
        self,
        path: Path,
        sampled: list[SampledPiece],
        waits: list[float],
        chosen: list[PieceProfile],
    ) -> _Try:
        """Return a trajectory as it was judged; waits grow as it demands."""
        legs = legs_of(sampled, waits, self._footprint)
        one = self._weighed(trajectory_of(path, legs), legs, chosen)
        for _ in range(WAITS):
            if not lengthened(waits, one.legs, one.report):
                break
            legs = legs_of(sampled, waits, self._footprint)
            one = self._weighed(trajectory_of(path, legs), legs, chosen)
        return one

    def _weighed(
        self, trajectory: Trajectory, legs: list[Leg], chosen: list[PieceProfile]
    ) -> _Try:
        proved, report = self._judged(trajectory)
        spans, starts = proved.parts.spans, [leg.t[0] for leg in legs]
        leg = np.searchsorted(starts, (spans.t0 + spans.t1) / 2, side="right") - 1
        sign = np.array([one.sigma for one in chosen], dtype=np.int64)[leg]
        slowdowns = slowdowns_of(proved, sign)
        for violation in report.violations:
            factor = crawl_of(violation, legs)
            if factor <= 1:
                continue
            inside = (spans.t1 > violation.t_start) & (spans.t0 < violation.t_end)
            slowdowns[inside] = np.maximum(slowdowns[inside], factor)
        return _Try(proved, report, slowdowns, legs)

    def _judged(self, trajectory: Trajectory) -> tuple[Proved, Report]:
        proved = prove(
            trajectory,
            self._space,
            self._tolerances,
            allow_unreachable=self._allow_unreachable,
            max_parts=PARTS,
            is_sharp=False,
            checkpoint=self._checkpoint,
        )
        return proved, report_of(proved)

    def _proved(
        self,
        path: Path,
        one: _Try,
        chosen: list[PieceProfile],
        profile: SpeedProfile,
    ) -> Timing:
        """Return the timing once it has been proved, slower if need be."""
        for _ in range(SCALINGS):
            if one.report.valid or not math.isfinite(one.estimate):
                break
            trajectory = one.proved.trajectory
            factor = trajectory.duration / one.estimate * (1 - SPARE)
            legs = [replace(leg, t=leg.t / factor) for leg in one.legs]
            one = self._weighed(trajectory.scaled(factor), legs, chosen)
        trajectory, report = one.proved.trajectory, one.report
        if not report.valid:
            report = self._validate(trajectory)
            if report.speed_factor <= 0:
                return self._refused(path, profile, report)
            # A factor in a report has been proved by validating again.
            trajectory = trajectory.scaled(report.speed_factor)
        message = (
            f"{path.name} by {self._space.name}: {trajectory.duration:.3f} s, "
            f"the optimum is {profile.duration:.3f} s"
        )
        found = TimingStatus.FOUND
        name = self._space.name
        return Timing(name, path.name, found, trajectory, profile, None, message)

    def _validate(self, trajectory: Trajectory) -> Report:
        return validate(
            trajectory,
            self._space,
            self._tolerances,
            allow_unreachable=self._allow_unreachable,
            checkpoint=self._checkpoint,
        )

    def _refused(self, path: Path, profile: SpeedProfile, report: Report) -> Timing:
        worst = report.headline
        assert worst is not None
        u = float(np.interp(worst.t, profile.t, profile.u))
        pose = worst.pose or (0.0, 0.0, 0.0)
        fault = Fault(worst.limit, worst.wheel, u, pose, describe(worst))
        if worst.limit in SHAPE_LIMITS:
            status = BLOCKED
        elif worst.limit == "RECONFIGURATION":
            status = NO_WAY
        else:
            status = TimingStatus.NOT_PROVED
        message = f"{path.name} by {self._space.name}: {status.value}: {fault.text}"
        return Timing(
            self._space.name, path.name, status, None, profile, fault, message
        )


def _tighter(
    weight: FloatArray, sampler: PieceSampler, leg: Leg, one: _Try
) -> FloatArray:
    """Return tighter limits where they were broken, looser where they are not."""
    spans = one.proved.parts.spans
    asked = one.slowdowns
    middle = (spans.t0 + spans.t1) / 2
    starts = np.minimum(abs(middle - leg.t[0]), abs(middle - leg.t[-1])) < STARTING
    asked = np.where(starts & (asked > 1), np.maximum(asked, AT_REST), asked)
    times = np.interp(sampler.u, leg.u, leg.t)
    gaps = np.diff(times, append=times[-1:], prepend=times[:1])
    pad = np.maximum(AROUND * sampler.steps_at(times), np.maximum(gaps[1:], gaps[:-1]))
    # A start is passed more slowly as a whole, not moment by moment.
    since = np.minimum(times - leg.t[0], leg.t[-1] - times)
    pad = np.where(since < STARTING, np.maximum(pad, since), pad)
    return tightened(
        weight,
        times,
        (spans.t0, spans.t1),
        asked,
        pad,
        loosens=one.report.valid,
    )


def _is_enough(tries: list[_Try], optimum: float) -> bool:
    """Return whether more tries are not worth their time."""
    worth = [one.estimate for one in tries]
    best = min(worth)
    if best < (1 + LOSS) * optimum:
        return True
    before = min(worth[:-PATIENCE], default=math.inf)
    return math.isfinite(before) and best > before * (1 - GAIN)


def _worth(timing: Timing) -> float:
    """Return what to judge timings of one path by: the shorter the better."""
    return math.inf if timing.duration is None else timing.duration


def _joined(
    problem: TimingProblem,
    chosen: list[PieceProfile],
    waits: list[float],
    wheel_ids: tuple[str, ...],
) -> SpeedProfile:
    """Return the profiles of all pieces as one."""
    t, now = [], 0.0
    for profile, wait in zip(chosen, [*waits, 0.0], strict=True):
        t.append(now + profile.times)
        now = float(t[-1][-1]) + wait
    rows = [problem.rows[i] for profile in chosen for i in profile.row.tolist()]
    return SpeedProfile(
        u=_locked(np.concatenate([profile.u for profile in chosen])),
        t=_locked(np.concatenate(t)),
        speed=_locked(np.sqrt(np.concatenate([profile.x for profile in chosen]))),
        limit=tuple(row.limit for row in rows),
        wheel=tuple(wheel_ids[r.wheel] if r.wheel >= 0 else None for r in rows),
        utilisation=_locked(np.concatenate([profile.share for profile in chosen])),
        representation=_locked(
            np.concatenate([np.full(one.u.size, one.sigma) for one in chosen])
        ),
    )


def _locked(values: Array) -> Array:
    values.flags.writeable = False
    return values
