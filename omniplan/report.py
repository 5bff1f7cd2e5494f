"""Verdicts: what `validate` and `select` answer, as plain frozen values.

"No" is a value. Every report can be turned into plain data and back, which is how it
travels over the service.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from pydantic import TypeAdapter

from omniplan.choosing.faults import Undrivable
from omniplan.choosing.shortfalls import Unfit
from omniplan.wording import describe

__all__ = ["Advice", "Candidate", "Ranking", "Report", "Violation"]


@dataclass(frozen=True)
class Violation:
    """One limit that one wheel (or the vehicle) breaks over one stretch of time."""

    limit: str
    """Which limit: a name of `configspace.Reason`, or ``REVERSE_SPEED``,
    ``STEER_RATE``, ``STEER_ACCELERATION``, ``WHEEL_ACCELERATION``, ``ACCELERATION``,
    ``DECELERATION``, ``RECONFIGURATION``; the last is a standstill too short to turn or
    unwind the wheels, value and bound in s. ``UNREACHABLE`` is a piece between
    standstills that is permitted but in another component of the space than straight
    ahead."""
    wheel: str | None
    """Id of the wheel; None for the vehicle as a whole."""
    value: float | None
    """The worst value; for a proved violation it is really taken. Of a wheel with a
    range of more than a full turn the angle is followed, so it may be beyond ±π. None
    for ``UNREACHABLE`` and for a ``RECONFIGURATION`` for which no way inside the space
    was found."""
    bound: float
    """What is permitted."""
    unit: str
    """Unit of value and bound; angles are in rad."""
    index: int
    """Row of the last sample at or before the worst place."""
    t: float
    """Time of the worst place, s."""
    t_start: float
    """Start of the stretch, s."""
    t_end: float
    """End of the stretch, s."""
    kappa_n: float
    """Nominal curvature at the worst place, for this vehicle."""
    beta: float
    """Side-slip angle at the worst place, rad."""
    pose: tuple[float, float, float] | None
    """Pose at the worst place (m, m, rad), where the trajectory has poses."""
    is_proved: bool
    """True if the value is taken; False if the limit could only not be shown to hold
    within the stated resolution."""
    scale: float | None = None
    """What the excess is relative to, in `unit`: half the range of a steering angle;
    None: the bound itself."""
    excess_at_samples: float | None = None
    """Largest `excess` at the samples themselves within the stretch, 0 if the limit is
    broken between them only; None where that was not told apart. In a report in which
    no limit is broken at a sample: where the intervals between them are halved evenly
    until one is. At most 1e6."""

    @property
    def excess(self) -> float:
        """How far the value is beyond the bound, relative to the bound's scale, ≥ 0.

        0 if it is not proved to be beyond; infinite where the scale is 0 or there is no
        value.
        """
        scale = abs(self.bound) if self.scale is None else self.scale
        if self.value is None or scale == 0:
            return math.inf
        if self.scale is not None:  # a bound from below or from above, of either sign
            beyond = abs(self.value - self.bound) if self.is_proved else 0.0
        else:
            beyond = abs(self.value) - abs(self.bound)
        return max(beyond, 0.0) / scale

    def __str__(self) -> str:
        """Return one line with wheel, limit, place and numbers."""
        return describe(self)


@dataclass(frozen=True)
class Advice:
    """What would make the trajectory valid; it was checked by validating again."""

    kind: str
    """``slow_down``: drive it slower all along; ``dwell``: stand still longer;
    ``side_slip``: at the most telling violation move in another direction, at the same
    curvature and speed (that was validated as a steady motion, not along the way)."""
    value: float
    """``slow_down``: the factor on the speed, below 1; ``dwell``: seconds in all;
    ``side_slip``: the nearest permitted side-slip angle β, rad."""
    text: str


@dataclass(frozen=True)
class Report:
    """The verdict on one trajectory for one vehicle."""

    vehicle: str
    trajectory: str
    valid: bool
    violations: tuple[Violation, ...]
    margin: float
    """1 - worst (value / bound) over all limits that have a bound: how much is left, at
    least; negative where a limit is broken."""
    tightest: str
    """Which limit, and wheel, the margin belongs to."""
    duration: float
    """Duration as given, s."""
    speed_factor: float
    """A factor by which the whole trajectory may be driven faster: proved by validating
    again, and near the largest. Below 1 it must be driven slower; 0: none was found."""
    fastest_duration: float | None
    """``duration / speed_factor``, s; None if no factor helps."""
    top_speed: float
    """Largest speed of the vehicle's K along the trajectory as given, m/s."""
    top_yaw_rate: float
    """Largest |ω| along the trajectory as given, rad/s."""
    advice: tuple[Advice, ...]
    interpolation: str
    """How the motion between the samples is understood."""
    not_judged: tuple[str, ...]
    """Limits the vehicle declares that were not judged; normally none."""

    @property
    def headline(self) -> Violation | None:
        """The most telling violation, None if valid.

        Proved ones first, then those at the samples, then what no other speed would
        mend, then the largest excess at the samples: none of that depends on where
        motions are cut to prove limits.
        Excesses that differ by rounding only are a tie: then a limit of a wheel comes
        before one of the vehicle, the first limit and wheel by name, the earliest
        place.
        """
        if not self.violations:
            return None
        rank = min(map(_rank, self.violations))
        alike = [v for v in self.violations if _rank(v) == rank]
        most = max(map(_told_excess, alike))
        least = most if math.isinf(most) else most - TIE * (1 + most)
        tied = [v for v in alike if _told_excess(v) >= least]
        return min(tied, key=lambda v: (v.wheel is None, v.limit, v.wheel or "", v.t))

    def to_dict(self) -> dict[str, Any]:
        """Return the report as plain data (JSON types only)."""
        data: dict[str, Any] = _REPORT.dump_python(self, mode="json")
        return data

    @classmethod
    def from_dict(cls, data: object) -> Report:
        """Return the report that plain data describes; ValueError if it does not."""
        return _REPORT.validate_python(data)


@dataclass(frozen=True)
class Candidate:
    """One vehicle for one trajectory."""

    vehicle: str
    score: float
    """Value of the criterion, smaller is better."""
    report: Report


@dataclass(frozen=True)
class Ranking:
    """Who can drive a trajectory, best first, and why the others cannot.

    Of a path the reports are about each vehicle's own fastest timing.
    """

    trajectory: str
    criterion: str
    suitable: tuple[Candidate, ...]
    refused: tuple[Report, ...]
    unfit: tuple[Unfit, ...] = ()
    """Vehicles that do not meet the requirements, and by how much."""
    undrivable: tuple[Undrivable, ...] = ()
    """Of a path: vehicles for which it has no timing, and why."""

    @property
    def best(self) -> Candidate | None:
        """The best vehicle, None if no vehicle can."""
        return self.suitable[0] if self.suitable else None

    def to_dict(self) -> dict[str, Any]:
        """Return the ranking as plain data (JSON types only)."""
        data: dict[str, Any] = _RANKING.dump_python(self, mode="json")
        return data

    @classmethod
    def from_dict(cls, data: object) -> Ranking:
        """Return the ranking that plain data describes; ValueError if it does not."""
        return _RANKING.validate_python(data)


SHAPE_LIMITS = (
    "SINGULAR",
    "STEER_RANGE",
    "FIXED_WHEEL",
    "UNREACHABLE",
    "RECONFIGURATION",
)
"""Limits of the configuration, which driving slower does not mend."""


TIE = 1e-9
"""Excesses that differ by less, relative to the utilisation, are alike."""


def _rank(violation: Violation) -> tuple[bool, bool, int]:
    order = (*SHAPE_LIMITS, violation.limit).index(violation.limit)
    between = violation.excess_at_samples == 0
    return not violation.is_proved, between, order


def _told_excess(violation: Violation) -> float:
    at_samples = violation.excess_at_samples
    return violation.excess if at_samples is None else at_samples


_REPORT: TypeAdapter[Report] = TypeAdapter(Report)
_RANKING: TypeAdapter[Ranking] = TypeAdapter(Ranking)
