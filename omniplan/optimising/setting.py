"""What an optimisation is about, and what a solver answers; no solver is known here."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from omniplan.optimising.limits import Tightness

__all__ = [
    "Guess",
    "Leg",
    "Objective",
    "Separation",
    "Setting",
    "Solution",
    "SolverStatus",
]

FloatArray = npt.NDArray[np.float64]
Objective: TypeAlias = Literal["time", "smooth", "change"]
Box: TypeAlias = tuple[float, float, float, float]


class SolverStatus(enum.Enum):
    """How a solver ended."""

    CONVERGED = "converged"
    """An optimum near the start, to the solver's tolerance."""
    INFEASIBLE = "infeasible"
    """The solver came to a point where the limits contradict each other."""
    ITERATION_LIMIT = "iteration limit"
    TIME_LIMIT = "time limit"
    NON_FINITE = "non-finite"
    """The start, or a value or derivative on the way, is not a number."""
    STUCK = "stuck"
    """The solver makes no more progress."""


@dataclass(frozen=True, eq=False)
class Leg:
    """What lies between two stops: knots of C² cubic splines, from rest to rest."""

    h: FloatArray
    """(n,) s, duration of each interval."""
    poses: FloatArray
    """(n + 1, 3) m, m, rad, of K."""
    rates: FloatArray
    """(n + 1, 3) m/s, m/s, rad/s, in the world."""

    @property
    def duration(self) -> float:
        """Duration, s."""
        return float(self.h.sum())


@dataclass(frozen=True, eq=False)
class Guess:
    """A motion: where a solver starts, and what it finds."""

    legs: tuple[Leg, ...]
    waits: tuple[float, ...]
    """s, at the stops between the legs."""
    lines: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    """(k, 2): direction, rad, and offset, m, of each `Separation`'s line."""

    @property
    def duration(self) -> float:
        """Duration, s."""
        return sum(leg.duration for leg in self.legs) + sum(self.waits)

    def length(self, arm: float) -> float:
        """Return the length of the way from knot to knot, m; a radian counts `arm`."""
        steps = [np.diff(leg.poses, axis=0) * [1.0, 1.0, arm] for leg in self.legs]
        return float(sum(np.linalg.norm(step, axis=1).sum() for step in steps))


@dataclass(frozen=True, eq=False)
class Separation:
    """A part of an obstacle to be kept apart from the vehicle over one interval.

    A line lies between them, whose direction and place the solver finds.
    """

    leg: int
    interval: int
    body: int
    """Number of the convex part of the footprint."""
    number: int
    """Of the convex part of an obstacle."""
    part: FloatArray
    """(k, 2) m, its corners."""
    room: float = 0.0
    """Least distance at the times looked at, m."""


@dataclass(frozen=True, eq=False)
class Setting:
    """What is to be optimised; with the vehicle it makes a problem."""

    intervals: tuple[int, ...]
    """Number of intervals of each leg, at least 2."""
    signs: tuple[int, ...]
    """Representation of each leg: the sign of v_s."""
    objective: Objective = "time"
    keep_ends: bool = True
    tightness: Tightness = field(default_factory=Tightness)
    body: tuple[tuple[complex, ...], ...] = ()
    """Convex parts of the footprint: corners from K in the body frame, m."""
    separations: tuple[Separation, ...] = ()
    bounds: Box | None = None
    """(x0, y0, x1, y1) m, in which the footprint stays."""
    longest: float | None = None
    """Largest duration, s; None: any."""
    has_swing: bool = False
    """Whether steering accelerations are bounded, at a price rather than strictly."""
    ways: FloatArray | None = None
    """(legs, 3) m, m, rad: how each leg goes on at the start of the search; it keeps
    a share of that, lest it shrink to a point, where no wheel points anywhere."""


@dataclass(frozen=True, eq=False)
class Solution:
    """What a solver answers; "no" is a value."""

    status: SolverStatus
    value: Guess | None
    """The last motion the solver came to; None if it is not finite."""
    violation: float = np.inf
    """By how much it breaks limits at most, scaled to 1."""
    place: tuple[float, float, float] | None = None
    """x m, y m, θ rad of K: where limits give way most; None if none does."""
    statistics: Mapping[str, float | int | str] = field(default_factory=dict)
    """``iterations``, ``time`` and ``build_time`` s, ``objective``, ``unknowns``,
    ``constraints``, ``solver_status``: the solver's own word."""

    def __post_init__(self) -> None:
        """Keep the statistics from being changed."""
        frozen = MappingProxyType(dict(self.statistics))
        object.__setattr__(self, "statistics", frozen)

    @property
    def has_converged(self) -> bool:
        """Whether the value is an optimum."""
        return self.status is SolverStatus.CONVERGED
