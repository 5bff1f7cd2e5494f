"""From broken and undecided parts to violations with wheel, place and numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from configspace import PermissibleSpace, Reason
from configspace.angles import wrap
from configspace.omni_curve import curvature_of_ratio
from configspace.vehicle import SteerableWheel
from omniplan.judging.proof import ROUNDING, Parts, refused
from omniplan.judging.rows import Judge, Row
from omniplan.motion import Enclosure, Intervals, Motion, PoseMotion
from omniplan.report import Violation
from omniplan.standing.standstill import Choice
from omniplan.trajectory import Trajectory

__all__ = [
    "FINEST",
    "find_violations",
    "reconfiguration_violations",
    "told_between",
    "unreachable_violations",
]

FloatArray = npt.NDArray[np.float64]

FINEST = 12
"""So often intervals are halved to tell what is broken between the samples ..."""
MANY = 4096
"""... unless so many parts are in question."""
MOST = 1e6
"""The largest excess that is told."""


@dataclass(frozen=True)
class _Place:
    """One end of one part, in the representation that is driven."""

    t: float
    kappa_n: float
    beta: float
    v_s: float
    """Signed, m/s; for a vehicle's own Omni-Curve-Parameters the signed v_n."""
    v: complex
    omega: float
    """Configuration direction at the origin of the file's frame, sign included."""


class _Describer:
    """Describes violations of one motion."""

    def __init__(
        self,
        judge: Judge,
        trajectory: Trajectory,
        motion: Motion,
        space: PermissibleSpace,
    ) -> None:
        self._judge, self._trajectory = judge, trajectory
        self._motion, self._space = motion, space
        self._poses: dict[float, tuple[float, float, float]] = {}

    def place(self, parts: Parts, part: int, at_end: bool, sign: int) -> _Place:
        """Return what is driven at one end of a part."""
        e = parts.enclosure
        v, omega, scale, t = (
            (e.v1, e.omega1, e.scale1, parts.spans.t1)
            if at_end
            else (e.v0, e.omega0, e.scale0, parts.spans.t0)
        )
        own = sign * float(e.sign[part])
        direction, turning = own * complex(v[part]), own * float(omega[part])
        body = direction + 1j * turning * self._judge.reference
        q = turning / self._judge.kappa_g
        return _Place(
            t=float(t[part]),
            kappa_n=float(np.clip(curvature_of_ratio(abs(body), q), -2, 2)),
            beta=float(np.angle(body)) if abs(body) > 0 else 0.0,
            v_s=own * max(abs(body), abs(q)) * float(scale[part]),
            v=direction,
            omega=turning,
        )

    def violation(
        self,
        row: Row,
        place: _Place,
        span: tuple[float, float],
        ratio: float,
        *,
        is_proved: bool,
        angle: float | None = None,
    ) -> Violation:
        """Return the violation of a row at a place.

        `angle` is the steering angle where it was followed.
        """
        limit, wheel = row.limit, row.wheel
        value, bound, unit, scale = ratio * row.bound, row.bound, row.unit, None
        if limit == "STEER_RANGE":
            value, bound = self._angle(row, place, angle)
            scale = row.bound
        elif limit == "SINGULAR":
            position = self._space.vehicle.contacts[wheel]  # type: ignore[union-attr]
            value = abs(place.v + 1j * place.omega * position)
        elif limit in {"FIXED_WHEEL", "PARALLEL_WHEELS"} and unit == "1":
            value, bound, unit = math.asin(min(value, 1.0)), math.asin(bound), "rad"
        elif limit in {"BLOCKED", "V_MAX"} and self._space.vehicle is None:
            limit, wheel, bound = self._by_sheet(place)
            value, unit = abs(place.v_s), "m/s"
            if self._motion.is_own:
                value *= bound
        return Violation(
            limit=limit,
            wheel=self._judge.wheel_ids[wheel] if wheel >= 0 else None,
            value=value,
            bound=bound,
            unit=unit,
            index=self.index(place.t),
            t=place.t,
            t_start=span[0],
            t_end=span[1],
            kappa_n=place.kappa_n,
            beta=place.beta,
            pose=self.pose(place.t),
            is_proved=is_proved,
            scale=scale,
        )

    def pose(self, t: float) -> tuple[float, float, float] | None:
        """Return the pose at a time, if the trajectory has poses."""
        if not isinstance(self._motion, PoseMotion):
            return None
        if t not in self._poses:  # several limits may be broken at one place
            x, y, theta = self._motion.poses_at(np.array([t]))[0]
            self._poses[t] = float(x), float(y), float(theta)
        return self._poses[t]

    def index(self, t: float) -> int:
        times = self._trajectory.t
        row = int(np.searchsorted(times, t * (1 + 1e-15) + 1e-12, side="right")) - 1
        return min(max(row, 0), times.size - 1)

    def _angle(
        self, row: Row, place: _Place, angle: float | None
    ) -> tuple[float, float]:
        """Return the steering angle and the end of the range that it passes."""
        vehicle = self._space.vehicle
        assert vehicle is not None
        wheel = vehicle.wheels[row.wheel]
        assert isinstance(wheel, SteerableWheel)
        least, largest = wheel.steering_range
        middle = (least + largest) / 2
        if angle is None:
            z = place.v + 1j * place.omega * vehicle.contacts[row.wheel]
            aside = float(wrap(np.angle(z) - middle))
        else:
            aside = angle - middle
        return middle + aside, middle + math.copysign(row.bound, aside)

    def _by_sheet(self, place: _Place) -> tuple[str, int, float]:
        """Return limit, wheel and v_max as the data sheet has them."""
        reverse = place.v_s < 0
        beta = place.beta if self._space.line_beta is None else self._space.line_beta
        why, who = self._space.explain(place.kappa_n, beta, reverse=reverse)
        v_max = float(self._space.v_max(place.kappa_n, beta, reverse=reverse))
        flags = [flag.name or "" for flag in Reason(int(why))]
        return (flags[0] if flags else "BLOCKED"), int(who), v_max


def find_violations(
    parts: Parts,
    first: Parts,
    choice: Choice,
    judge: Judge,
    trajectory: Trajectory,
    motion: Motion,
    space: PermissibleSpace,
) -> Iterator[Violation]:
    """Yield one violation per limit, wheel and stretch of time.

    Parameters
    ----------
    parts : Parts
        Decided.
    first : Parts
        The intervals between the samples, as a whole.
    choice : Choice
    judge : Judge
    trajectory : Trajectory
    motion : Motion
    space : PermissibleSpace
    """
    sign = choice.sign_of(parts.spans)
    low, high = parts.picked(sign)
    describer = _Describer(judge, trajectory, motion, space)
    faults = refused(low, high, judge.rows)
    if not faults.any():
        return
    at_end = _worse_at_end(judge, parts, sign)
    at_samples = first.picked(choice.sign_of(first.spans))[0]
    for column, row in enumerate(judge.rows):
        for run in _runs(faults[:, column]):
            reached = low[run, column]
            is_proved = bool((reached > 1 + ROUNDING).any())
            ranked = reached if is_proved else high[run, column]
            part = int(run[int(np.argmax(ranked))])
            tail = bool(at_end[part, column])
            place = describer.place(parts, part, tail, int(sign[part]))
            span = float(parts.spans.t0[run[0]]), float(parts.spans.t1[run[-1]])
            ratio = float(ranked.max())
            angle = None
            if column in parts.angles:
                angle = float(parts.angles[column][int(at_end[part, column])][part])
            violation = describer.violation(
                row, place, span, ratio, is_proved=is_proved, angle=angle
            )
            if is_proved and angle is None:
                most = _largest(at_samples, first.spans, span, column)
                violation = replace(violation, excess_at_samples=_excess(row, most))
            yield violation


def told_between(
    violations: Sequence[Violation],
    evaluate: Callable[[Intervals], Parts],
    first: Parts,
    choice: Choice,
    judge: Judge,
) -> list[Violation]:
    """Return violations with their excess where no limit is broken at a sample.

    The intervals between the samples are halved evenly until some limit is, and so
    what is told first does not depend on where they were cut to find that.

    Parameters
    ----------
    violations : sequence of Violation
    evaluate : callable
        From spans to parts.
    first : Parts
        The intervals between the samples, as a whole.
    choice : Choice
    judge : Judge
    """
    proved = [v.excess_at_samples for v in violations if v.is_proved]
    if not proved or any(excess != 0 for excess in proved):
        return list(violations)
    spans, parts = first.spans, first
    for _ in range(FINEST):
        _, high = parts.picked(choice.sign_of(spans))
        is_open = (high > 1 + ROUNDING).any(axis=1)
        if not is_open.any() or is_open.sum() > MANY:
            break
        spans = Intervals(spans.knot[is_open], spans.t0[is_open], spans.t1[is_open])
        spans = spans.halved(np.ones(spans.t0.shape, dtype=bool))
        parts = evaluate(spans)
        low, _ = parts.picked(choice.sign_of(spans))
        if (low > 1 + ROUNDING).any():
            return [_told_at(v, low, spans, judge) for v in violations]
    return list(violations)


def _told_at(
    violation: Violation, low: FloatArray, spans: Intervals, judge: Judge
) -> Violation:
    """Return a violation with its excess where the intervals are cut like that."""
    if violation.excess_at_samples is None:
        return violation
    span, excess = (violation.t_start, violation.t_end), 0.0
    for column, row in enumerate(judge.rows):
        wheel = judge.wheel_ids[row.wheel] if row.wheel >= 0 else None
        if (row.limit, wheel) == (violation.limit, violation.wheel):
            excess = max(excess, _excess(row, _largest(low, spans, span, column)))
    return replace(violation, excess_at_samples=excess)


def _largest(
    ratios: FloatArray, spans: Intervals, span: tuple[float, float], column: int
) -> float:
    """Return the largest utilisation of a row on the parts that a stretch touches."""
    touched = (spans.t0 < span[1]) & (spans.t1 > span[0])
    return float(ratios[touched, column].max(initial=0.0))


def _excess(row: Row, ratio: float) -> float:
    """Return how far a utilisation is beyond a limit, as `Violation.excess` has it.

    Finite, so that a report can travel as JSON.
    """
    if row.limit in {"FIXED_WHEEL", "PARALLEL_WHEELS"} and row.unit == "1":
        slip = math.asin(min(ratio * row.bound, 1.0))
        return max(slip / math.asin(row.bound) - 1, 0.0)
    return min(max(ratio - 1, 0.0), MOST)


def reconfiguration_violations(
    choice: Choice,
    judge: Judge,
    trajectory: Trajectory,
    motion: Motion,
    space: PermissibleSpace,
) -> Iterator[Violation]:
    """Yield the standstills that are too short for the wheels to turn.

    Parameters
    ----------
    choice : Choice
    judge : Judge
    trajectory : Trajectory
    motion : Motion
    space : PermissibleSpace
    """
    describer = _Describer(judge, trajectory, motion, space)
    for stop in choice.standstills:
        if not stop.is_short:
            continue
        t = (stop.t0 + stop.t1) / 2
        kappa_n, beta = stop.change.start
        wheel = stop.change.wheel
        yield Violation(
            limit="RECONFIGURATION",
            wheel=judge.wheel_ids[wheel] if wheel >= 0 else None,
            value=stop.change.time if math.isfinite(stop.change.time) else None,
            bound=stop.t1 - stop.t0,
            unit="s",
            index=int(np.searchsorted(trajectory.t, t, side="right")) - 1,
            t=t,
            t_start=stop.t0,
            t_end=stop.t1,
            kappa_n=kappa_n,
            beta=beta,
            pose=describer.pose(t),
            is_proved=math.isfinite(stop.change.time),
        )


def unreachable_violations(
    choice: Choice,
    judge: Judge,
    trajectory: Trajectory,
    motion: Motion,
    space: PermissibleSpace,
) -> Iterator[Violation]:
    """Yield the pieces in another component of the space than straight ahead.

    Parameters
    ----------
    choice : Choice
    judge : Judge
    trajectory : Trajectory
    motion : Motion
    space : PermissibleSpace
    """
    describer = _Describer(judge, trajectory, motion, space)
    for piece in choice.apart:
        kappa_n, beta = piece.start
        yield Violation(
            limit="UNREACHABLE",
            wheel=None,
            value=None,
            bound=0.0,
            unit="1",
            index=describer.index(piece.t0),
            t=piece.t0,
            t_start=piece.t0,
            t_end=piece.t1,
            kappa_n=kappa_n,
            beta=beta,
            pose=describer.pose(piece.t0),
            is_proved=True,
        )


def _runs(mask: npt.NDArray[np.bool_]) -> list[npt.NDArray[np.int64]]:
    """Return the runs of True as index arrays."""
    at = np.flatnonzero(mask)
    if not at.size:
        return []
    return np.split(at, np.flatnonzero(np.diff(at) > 1) + 1)


def _worse_at_end(
    judge: Judge, parts: Parts, sign: npt.NDArray[np.int64]
) -> npt.NDArray[np.bool_]:
    """Return whether each row is utilised more at the end of a part, (m, rows)."""
    e, m = parts.enclosure, len(parts.stands)
    both = _only(e, "0").merged(_only(e, "1"), np.arange(2 * m))
    bounds = judge.utilisations(both, tuple(parts.low))
    low = {s: each[0] for s, each in bounds.items()}
    ends = [{s: each[rows] for s, each in low.items()} for rows in _halves_of(m)]
    lows = [replace(parts, low=end, high=end).picked(sign)[0] for end in ends]
    worse = np.asarray(lows[1] > lows[0], dtype=bool)
    for wheel in judge.winding_wheels:
        if wheel.column in parts.angles:
            aside = [np.abs(a - wheel.middle) for a in parts.angles[wheel.column]]
            worse[:, wheel.column] = aside[1] > aside[0]
    return worse


def _halves_of(m: int) -> tuple[slice, slice]:
    return slice(0, m), slice(m, 2 * m)


def _only(part: Enclosure, end: str) -> Enclosure:
    """Return the parts shrunk to their start ("0") or their end ("1")."""
    fields = {
        name: getattr(part, name[:-1] + end) if name[-1] in "01" else value
        for name, value in vars(part).items()
    }
    swing = None if part.swing is None else part.swing.only(int(end))
    still = {"dt": np.zeros_like(part.dt), "swing": swing}
    return replace(part, **{**fields, **still})
