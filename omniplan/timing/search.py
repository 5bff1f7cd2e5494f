"""Putting the timing of a path together: pieces, representations, waits, proof."""

from __future__ import annotations

import math
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
from omniplan.standing.ways import Changer
from omniplan.timing.caps import cap_use
from omniplan.timing.path_motion import PathMotion, PathPiece
from omniplan.timing.result import SpeedProfile, Timing, TimingStatus
from omniplan.timing.sampling import sample_piece
from omniplan.timing.shape import PieceShape, first_fault, shape_of
from omniplan.timing.solver import PieceProfile, TimingProblem
from omniplan.timing.tightening import any_is_tight, slowdowns_of, tightened
from omniplan.trajectory import Trajectory
from omniplan.validation import report_of, validate
from omniplan.wording import describe

__all__ = ["Timer"]

FloatArray = npt.NDArray[np.float64]
Array = TypeVar("Array", npt.NDArray[np.float64], npt.NDArray[np.int64])

PER_POSE = 2
"""Least number of samples between two poses of the path."""
DWELL = 1e-4
"""Time at every stop, s, so that its pose is repeated and the stop cannot be missed."""
LOSS = 5e-3
"""If a trajectory takes longer than the optimum by more than this share ..."""
REFINEMENTS = (1, 1, 1, 1, 1, 1, 2, 2)
"""... it is timed again, slower where a limit was found broken, and sampled more
finely, so many times ..."""
PATIENCE = 3
"""... unless it got no faster so often in a row."""
AROUND = 3
"""So many steps before and after such a place are passed more slowly, too."""
PARTS = 20_000
"""How many parts a trajectory may be halved into until it is known well enough."""
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
class _Leg:
    """The samples of one piece."""

    piece: PathPiece
    t: FloatArray
    """(n,) s, from the start of the path."""
    u: FloatArray
    """(n,) m, from the start of the path."""


@dataclass(frozen=True, eq=False)
class _Try:
    """A trajectory as it was judged."""

    proved: Proved
    report: Report
    """Its speed factor is what the margins promise."""
    slowdowns: FloatArray
    """How many times more slowly every part had to be passed."""

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
            v.limit not in SHAPE_LIMITS and v.limit != "RECONFIGURATION"
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
    ) -> None:
        self._space, self._tolerances = space, tolerances
        self._allow_unreachable, self._steps = allow_unreachable, steps

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
        choice = self._choose(pieces, shapes, options)
        if isinstance(choice, Fault):
            return self._no(path, NO_WAY, choice)
        chosen, waits = choice
        profile = _joined(problem, chosen, waits, self._wheel_ids)
        tight = [np.ones(one.u.size) for one in chosen]
        tries: list[_Try] = []
        for finer in REFINEMENTS:
            legs = self._legs(problem, numbers, chosen, waits, tight, finer)
            one = self._tried(_trajectory(path, legs), legs, chosen)
            tries.append(one)
            if _is_enough(tries, profile.duration):
                break
            if not one.is_mendable or (one.report.valid and not any_is_tight(tight)):
                break
            self._tighten(tight, legs, chosen, one)
        tries.sort(key=lambda one: one.estimate)
        timing = self._proved(path, tries[0], profile)
        for one in tries[1:CANDIDATES]:
            if timing.duration is not None and timing.duration <= one.estimate:
                break
            timing = min(timing, self._proved(path, one, profile), key=_worth)
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

    def _choose(
        self,
        pieces: list[PathPiece],
        shapes: list[PieceShape],
        options: list[dict[int, PieceProfile]],
    ) -> tuple[list[PieceProfile], list[float]] | Fault:
        """Return the profiles that are fastest together, and the waits between them.

        A short dynamic programme; among equals driving forwards comes first.
        """
        # Half the tolerance, as what `validate` measures differs by the sampling.
        tolerances = replace(self._tolerances, alignment=self._tolerances.alignment / 2)
        judge = judge_for(self._space, PathMotion(pieces[0], 1.0), tolerances)
        changer = Changer(judge, self._space, tolerances)
        best: dict[int, tuple[float, list[int], list[float]]] = {
            sign: (_cost(profile), [sign], []) for sign, profile in options[0].items()
        }
        for i, option in enumerate(options[1:], start=1):
            step: dict[int, tuple[float, list[int], list[float]]] = {}
            for after, profile in option.items():
                found = []
                for before, (total, signs, waits) in best.items():
                    change = changer.change(
                        shapes[i - 1].ends[before][1], shapes[i].ends[after][0]
                    )
                    wait = min(way.time for way in change.ways)
                    cost = total + wait + _cost(profile)
                    found.append((cost, [*signs, after], [*waits, wait]))
                quickest = min(found, key=lambda some: some[0])
                if math.isfinite(quickest[0]):
                    step[after] = quickest
            if not step:
                return _no_way(pieces[i])
            best = step
        _, signs, waits = min(best.values(), key=lambda some: some[0])
        return [option[s] for option, s in zip(options, signs, strict=True)], waits

    def _legs(
        self,
        problem: TimingProblem,
        numbers: range,
        chosen: list[PieceProfile],
        waits: list[float],
        tight: list[FloatArray],
        finer: int,
    ) -> list[_Leg]:
        """Return the samples of all pieces, slower where a piece breaks limits."""
        legs, now = [], 0.0
        for k, profile, wait, weight in zip(
            numbers, chosen, [*waits, 0.0], tight, strict=True
        ):
            knots = problem.pieces[k].u.size
            steps = max(self._steps * finer, PER_POSE * (knots - 1))
            sampled = sample_piece(problem, k, profile, steps, weight)
            poses = sampled.path.poses_at(sampled.u)
            vehicle = self._space.vehicle
            footprint = () if vehicle is None else vehicle.footprint
            used = cap_use(sampled.t, sampled.u, sampled.path, poses, footprint)
            t = now + sampled.t * max(sampled.excess, used, 1.0)
            legs.append(_Leg(sampled.path, t, sampled.u))
            now = float(t[-1]) + wait * (1 + 1e-6) + DWELL
        return legs

    def _tried(
        self, trajectory: Trajectory, legs: list[_Leg], chosen: list[PieceProfile]
    ) -> _Try:
        """Return a trajectory as it was judged, with waits as long as it demands."""
        proved, report = self._judged(trajectory)
        for _ in range(WAITS):
            if not _waits_only(report):
                break
            trajectory = _with_longer_waits(proved.trajectory, report)
            proved, report = self._judged(trajectory)
        spans, starts = proved.parts.spans, [leg.t[0] for leg in legs]
        leg = np.searchsorted(starts, (spans.t0 + spans.t1) / 2, side="right") - 1
        sign = np.array([one.sigma for one in chosen], dtype=np.int64)[leg]
        return _Try(proved, report, slowdowns_of(proved, sign))

    def _judged(self, trajectory: Trajectory) -> tuple[Proved, Report]:
        proved = prove(
            trajectory,
            self._space,
            self._tolerances,
            allow_unreachable=self._allow_unreachable,
            max_parts=PARTS,
        )
        return proved, report_of(proved)

    def _tighten(
        self,
        tight: list[FloatArray],
        legs: list[_Leg],
        chosen: list[PieceProfile],
        one: _Try,
    ) -> None:
        """Make the limits tighter where they were broken, looser where they are not."""
        spans, asked = one.proved.parts.spans, one.slowdowns
        for i, (leg, profile) in enumerate(zip(legs, chosen, strict=True)):
            pad = AROUND * float(leg.t[-1] - leg.t[0]) / self._steps
            times = np.interp(profile.u, leg.u, leg.t)
            tight[i] = tightened(tight[i], times, (spans.t0, spans.t1), asked, pad)

    def _proved(self, path: Path, one: _Try, profile: SpeedProfile) -> Timing:
        """Return the timing once `validate` has accepted it, slower if need be."""
        trajectory, report = one.proved.trajectory, one.report
        if not report.valid:
            report = self._validate(trajectory)
        if not report.valid and report.speed_factor > 0:
            # A factor in a report has been proved by validating again.
            trajectory = trajectory.scaled(report.speed_factor)
        elif not report.valid:
            return self._refused(path, profile, report)
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


def _trajectory(path: Path, legs: list[_Leg]) -> Trajectory:
    return Trajectory.from_poses(
        np.concatenate([leg.t for leg in legs]),
        np.concatenate([leg.piece.poses_at(leg.u) for leg in legs]),
        name=path.name,
        reference_point=path.reference_point,
    )


def _is_enough(tries: list[_Try], optimum: float) -> bool:
    """Return whether more tries are not worth their time."""
    worth = [one.estimate for one in tries]
    best = int(np.argmin(worth))
    if tries[best].report.valid and worth[best] < (1 + LOSS) * optimum:
        return True
    return len(tries) - 1 - best >= PATIENCE and math.isfinite(worth[best])


def _worth(timing: Timing) -> float:
    """Return what to judge timings of one path by: the shorter the better."""
    return math.inf if timing.duration is None else timing.duration


def _cost(profile: PieceProfile) -> float:
    """Return a profile's duration; among equals driving forwards is preferred."""
    return profile.duration * (1 + 1e-9 * (profile.sigma < 0))


def _no_way(piece: PathPiece) -> Fault:
    u = float(piece.u[0])
    x, y, theta = piece.poses_at(piece.u[:1])[0].tolist()
    text = "at rest the wheels find no way to their new angles inside the space"
    return Fault("RECONFIGURATION", None, u, (x, y, theta), text)


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


def _waits_only(report: Report) -> bool:
    """Return whether longer waits at stops may mend a trajectory."""
    return bool(report.violations) and all(
        v.limit == "RECONFIGURATION" and v.value is not None for v in report.violations
    )


def _with_longer_waits(trajectory: Trajectory, report: Report) -> Trajectory:
    """Return the trajectory with the waits that a report demands."""
    for violation in reversed(report.violations):  # so that rows keep their numbers
        assert violation.value is not None
        row = int(np.abs(trajectory.t - violation.t).argmin())
        wait = max(violation.value - violation.bound, 0.0) * (1 + 1e-6) + DWELL
        trajectory = trajectory.with_dwell(row, wait)
    return trajectory
