"""Selection: which vehicles of a fleet can drive a trajectory, and which is best."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Literal, TypeAlias, get_args

from configspace import ClearanceMap, InvalidInput, PermissibleSpace, Problem
from omniplan.choosing.faults import Undrivable
from omniplan.choosing.fitness import (
    FleetEntry,
    FleetVehicle,
    fleet_of,
    requirements_of,
    shortfalls,
)
from omniplan.choosing.manoeuvrability import fleet_clearance, reserve
from omniplan.choosing.passages import passage_shortfalls
from omniplan.choosing.requirements import NoMirroring, PassableBackwards, Requirement
from omniplan.choosing.shortfalls import Shortfall, Unfit
from omniplan.path import Path
from omniplan.proving import Proved, prove
from omniplan.report import Candidate, Ranking, Report
from omniplan.timing.fastest import time_paths
from omniplan.trajectory import Trajectory, require_motion
from omniplan.validation import validate

__all__ = ["Criterion", "FleetVehicle", "ranked_by", "select", "time_for"]

Criterion: TypeAlias = Literal["duration", "margin", "manoeuvrability"]
"""What `select` can rank by."""
Score: TypeAlias = Callable[[Report], float]
"""A criterion of one's own; smaller is better."""
NOT_KNOWN = "vehicle not known"
"""Status of a path for a data sheet alone."""


def select(
    trajectories: Trajectory | Path | Iterable[Trajectory | Path],
    fleet: Iterable[FleetEntry],
    by: str | Score = "duration",
    *,
    requirements: Iterable[Requirement | str] = (),
    allow_unreachable: bool = False,
) -> tuple[Ranking, ...]:
    """Rank the vehicles of a fleet for each trajectory.

    Vehicles whose spaces are made of the same vehicle are judged once. A path is timed
    for each of them, see `fastest`, and judged so.

    Parameters
    ----------
    trajectories : Trajectory, Path, or iterable of them
    fleet : iterable of FleetEntry
        Spaces, pairs of name and space or `FleetVehicle`; names must differ.
    by : {"duration", "margin", "manoeuvrability"} or callable
        ``duration``: how soon the vehicle can be there when it drives the whole
        trajectory uniformly as fast as it may, or a path in its own fastest timing;
        ``margin``: how much it has left of its limits; ``manoeuvrability``: by what
        angle it could change its direction of motion at any moment, see
        `omniplan.choosing.manoeuvrability`. Or a function from a valid `Report` to a
        number, smaller is better. Among equals the larger margin wins.
    requirements : iterable of Requirement or str
        What a vehicle must meet besides: values of `omniplan.choosing.requirements` or
        their phrases. See `suitable` for requirements without trajectories.
    allow_unreachable : bool
        As for `validate`.

    Returns
    -------
    rankings : tuple of Ranking
        One per trajectory, in their order. Every vehicle is suitable, refused with its
        report, unfit with what it falls short of or, for a path, undrivable with
        what is in the way.

    Raises
    ------
    InvalidInput
        If the criterion is unknown or gives NaN, the fleet is empty, names repeat or a
        phrase cannot be read.

    Examples
    --------
    >>> import configspace, omniplan
    >>> fleet = [configspace.build_space(configspace.load_vehicle(name), cache=False)
    ...          for name in ("mecanum", "differential")]
    >>> aside = omniplan.Trajectory.from_poses([0, 2], [[0, 0, 0], [0, 1, 0]])
    >>> ranking, = omniplan.select(aside, fleet)
    >>> ranking.best.vehicle, ranking.refused[0].violations[0].limit
    ('mecanum', 'FIXED_WHEEL')
    """
    if isinstance(trajectories, Trajectory | Path):
        trajectories = (trajectories,)
    ranked = ranked_by(
        fleet, by, requirements=requirements, allow_unreachable=allow_unreachable
    )
    motions = tuple(trajectories)
    for i, motion in enumerate(motions):
        require_motion(motion, f"trajectories[{i}]")
    return tuple(map(ranked, motions))


def ranked_by(
    fleet: Iterable[FleetEntry],
    by: str | Score = "duration",
    *,
    requirements: Iterable[Requirement | str] = (),
    allow_unreachable: bool = False,
    checkpoint: Callable[[], None] | None = None,
) -> Callable[[Trajectory | Path], Ranking]:
    """Return the function that ranks a fleet for one trajectory after the other.

    What does not depend on a trajectory is judged once, at once.

    Parameters
    ----------
    fleet : iterable of FleetEntry
    by : {"duration", "margin", "manoeuvrability"} or callable
    requirements : iterable of Requirement or str
    allow_unreachable : bool
        As for `select`, all of them.
    checkpoint : callable, optional
        As for `validate`.

    Raises
    ------
    InvalidInput
        As `select` does.
    """
    if isinstance(by, str) and by not in get_args(Criterion):
        allowed = f"one of {', '.join(get_args(Criterion))}"
        raise InvalidInput(Problem("by", repr(by), allowed))
    asked = requirements_of(requirements)
    vehicles = fleet_of(fleet)
    unfit = tuple(
        Unfit(vehicle.id, short)
        for vehicle in vehicles
        if (short := shortfalls(vehicle, asked, allow_unreachable=allow_unreachable))
    )
    names = {one.vehicle for one in unfit}
    fit = [vehicle for vehicle in vehicles if vehicle.id not in names]
    question = _Question(by, asked, allow_unreachable, checkpoint)
    return partial(_ranked, fit, question, unfit)


@dataclass(frozen=True)
class _Verdict:
    """What is said of one vehicle type and one trajectory."""

    report: Report
    shortfalls: tuple[Shortfall, ...]
    score: float
    """0 where it is not asked for."""


class _Question:
    """Judges vehicle types for trajectories."""

    def __init__(
        self,
        by: str | Score,
        asked: tuple[Requirement, ...],
        allow_unreachable: bool,
        checkpoint: Callable[[], None] | None,
    ) -> None:
        self._by, self._asked = by, asked
        self._allow_unreachable = allow_unreachable
        self._checkpoint = checkpoint
        self._watches_passage = any(
            isinstance(one, NoMirroring | PassableBackwards) for one in asked
        )
        self._clearances: dict[Hashable, ClearanceMap] = {}

    @property
    def name(self) -> str:
        """Name of the criterion."""
        return self._by if isinstance(self._by, str) else _called(self._by)

    def verdict(
        self, motion: Trajectory | Path, space: PermissibleSpace
    ) -> _Verdict | Undrivable:
        """Return what is said of one vehicle type."""
        allow = self._allow_unreachable
        (answer,) = time_for((motion,), space, allow_unreachable=allow)
        if isinstance(answer, Undrivable):
            return answer
        return self._judged(answer, space, is_fastest=isinstance(motion, Path))

    def _judged(
        self,
        trajectory: Trajectory,
        space: PermissibleSpace,
        *,
        is_fastest: bool = False,
    ) -> _Verdict:
        allow = self._allow_unreachable
        report = validate(
            trajectory, space, allow_unreachable=allow, checkpoint=self._checkpoint
        )
        if not report.valid:
            return _Verdict(report, (), 0.0)
        if is_fastest:  # what is left of the vehicle's limits, the path's may forbid
            report = replace(
                report, speed_factor=1.0, fastest_duration=trajectory.duration
            )

        @cache
        def proved() -> Proved:
            return prove(
                trajectory,
                space,
                allow_unreachable=allow,
                checkpoint=self._checkpoint,
            )

        if self._watches_passage:
            short = passage_shortfalls(proved(), self._asked, allow_unreachable=allow)
            if short:
                return _Verdict(report, short, 0.0)
        return _Verdict(report, (), self._score(report, space, proved))

    def _score(
        self, report: Report, space: PermissibleSpace, proved: Callable[[], Proved]
    ) -> float:
        """Return the criterion, smaller is better."""
        if self._by == "duration":
            # A valid report always has a fastest duration.
            return report.fastest_duration or 0.0
        if self._by == "margin":
            return -report.margin
        if isinstance(self._by, str):
            return -reserve(proved(), self._clearance(space))
        score = float(self._by(report))
        if math.isnan(score):
            given = f"{self.name} gives NaN for {report.vehicle}"
            raise InvalidInput(Problem("by", given, "a number, smaller is better"))
        return score

    def _clearance(self, space: PermissibleSpace) -> ClearanceMap:
        key = _type_of(space)
        if key not in self._clearances:
            self._clearances[key] = fleet_clearance(space)
        return self._clearances[key]


def _ranked(
    fleet: Iterable[FleetVehicle],
    question: _Question,
    unfit: tuple[Unfit, ...],
    motion: Trajectory | Path,
) -> Ranking:
    verdicts: dict[Hashable, _Verdict | Undrivable] = {}
    suitable: list[Candidate] = []
    refused: list[Report] = []
    short: list[Unfit] = []
    undrivable: list[Undrivable] = []
    for vehicle in fleet:
        key = _type_of(vehicle.space)
        if key not in verdicts:
            verdicts[key] = question.verdict(motion, vehicle.space)
        verdict = verdicts[key]
        if isinstance(verdict, Undrivable):
            undrivable.append(replace(verdict, vehicle=vehicle.id))
            continue
        report = replace(verdict.report, vehicle=vehicle.id)
        if verdict.shortfalls:
            short.append(Unfit(vehicle.id, verdict.shortfalls))
        elif report.valid:
            suitable.append(Candidate(vehicle.id, verdict.score, report))
        else:
            refused.append(report)
    suitable.sort(key=lambda one: (one.score, -one.report.margin, one.vehicle))
    return Ranking(
        trajectory=motion.name,
        criterion=question.name,
        suitable=tuple(suitable),
        refused=tuple(refused),
        unfit=(*unfit, *short),
        undrivable=tuple(undrivable),
    )


def time_for(
    motions: Sequence[Trajectory | Path],
    space: PermissibleSpace,
    *,
    allow_unreachable: bool,
) -> list[Trajectory | Undrivable]:
    """Return motions with times: paths get those of the vehicle, if it has any.

    Parameters
    ----------
    motions : sequence of Trajectory or Path
    space : PermissibleSpace
    allow_unreachable : bool
        As for `fastest`.
    """
    found: dict[int, Trajectory | Undrivable] = {}
    paths = {i: one for i, one in enumerate(motions) if isinstance(one, Path)}
    if space.vehicle is None:
        found = dict.fromkeys(paths, Undrivable(space.name, NOT_KNOWN, None))
    else:
        timings = time_paths(paths.values(), space, allow_unreachable=allow_unreachable)
        for i, timing in zip(paths, timings, strict=True):
            found[i] = timing.trajectory or timing.refusal()
    return [
        one if isinstance(one, Trajectory) else found[i]
        for i, one in enumerate(motions)
    ]


def _type_of(space: PermissibleSpace) -> Hashable:
    """Return what spaces of one vehicle type have in common."""
    # Formulas and table may answer differently.
    return space.header.fingerprint, space.vehicle is None


def _called(score: Score) -> str:
    return str(getattr(score, "__name__", type(score).__name__))
