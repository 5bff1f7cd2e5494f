"""Selection: which vehicles of a fleet can drive a trajectory, and which is best."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Literal, TypeAlias

from configspace import InvalidInput, PermissibleSpace, Problem
from omniplan.report import Candidate, Ranking, Report
from omniplan.trajectory import Trajectory
from omniplan.validation import validate

__all__ = ["CRITERIA", "Criterion", "select"]

Criterion: TypeAlias = Literal["duration", "margin"]

CRITERIA: dict[str, Callable[[Report], float]] = {
    # A valid report always has a fastest duration.
    "duration": lambda report: report.fastest_duration or 0.0,
    "margin": lambda report: -report.margin,
}
"""What `select` can rank by; smaller is better."""


def select(
    trajectories: Trajectory | Iterable[Trajectory],
    fleet: Sequence[PermissibleSpace],
    by: str = "duration",
) -> tuple[Ranking, ...]:
    """Rank the vehicles of a fleet for each trajectory.

    Parameters
    ----------
    trajectories : Trajectory or iterable of Trajectory
    fleet : sequence of PermissibleSpace
        One per vehicle type; names must differ.
    by : {"duration", "margin"}
        ``duration``: how soon the vehicle can be there when it drives the whole
        trajectory uniformly as fast as it may; ``margin``: how much it has left.

    Returns
    -------
    rankings : tuple of Ranking
        One per trajectory, in their order.

    Raises
    ------
    InvalidInput
        If the criterion is unknown, the fleet is empty or names repeat.

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
    if by not in CRITERIA:
        raise InvalidInput(Problem("by", repr(by), f"one of {', '.join(CRITERIA)}"))
    if not fleet:
        raise InvalidInput(Problem("fleet", "empty", "at least one vehicle"))
    names = [space.name for space in fleet]
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise InvalidInput(
            Problem("fleet", f"{repeated[0]} twice", "names must differ")
        )
    if isinstance(trajectories, Trajectory):
        trajectories = (trajectories,)
    return tuple(_rank(trajectory, fleet, by) for trajectory in trajectories)


def _rank(
    trajectory: Trajectory, fleet: Sequence[PermissibleSpace], by: str
) -> Ranking:
    reports = [validate(trajectory, space) for space in fleet]
    suitable = [
        Candidate(report.vehicle, CRITERIA[by](report), report)
        for report in reports
        if report.valid
    ]
    suitable.sort(key=lambda candidate: (candidate.score, candidate.vehicle))
    return Ranking(
        trajectory=trajectory.name,
        criterion=by,
        suitable=tuple(suitable),
        refused=tuple(report for report in reports if not report.valid),
    )
