"""From broken and undecided parts to violations with wheel, place and numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from configspace import PermissibleSpace, Reason
from configspace.angles import wrap
from configspace.omni_curve import curvature_of_ratio
from configspace.vehicle import SteerableWheel
from omniplan.judging.proof import ROUNDING, Parts, refused
from omniplan.judging.rows import Judge, Row
from omniplan.motion import Enclosure, Motion, PoseMotion
from omniplan.report import Violation
from omniplan.standing.standstill import Choice
from omniplan.trajectory import Trajectory

__all__ = [
    "find_violations",
    "reconfiguration_violations",
    "unreachable_violations",
]

FloatArray = npt.NDArray[np.float64]


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
        x, y, theta = self._motion.poses_at(np.array([t]))[0]
        return float(x), float(y), float(theta)

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
            if is_proved and angle is None and row.bound > 0:
                touched = (first.spans.t0 < span[1]) & (first.spans.t1 > span[0])
                most = float(at_samples[touched, column].max(initial=0.0))
                violation = replace(violation, excess_at_samples=_excess(row, most))
            yield violation


def _excess(row: Row, ratio: float) -> float:
    """Return how far a utilisation is beyond a limit, as `Violation.excess` has it."""
    if row.limit in {"FIXED_WHEEL", "PARALLEL_WHEELS"} and row.unit == "1":
        slip = math.asin(min(ratio * row.bound, 1.0))
        return max(slip / math.asin(row.bound) - 1, 0.0)
    return max(ratio - 1, 0.0)


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
    lows = [
        Parts(parts.spans, part, parts.stands, *_bounds(judge, part)).picked(sign)[0]
        for part in (_only(parts.enclosure, "0"), _only(parts.enclosure, "1"))
    ]
    worse = np.asarray(lows[1] > lows[0], dtype=bool)
    for wheel in judge.winding_wheels:
        if wheel.column in parts.angles:
            aside = [np.abs(a - wheel.middle) for a in parts.angles[wheel.column]]
            worse[:, wheel.column] = aside[1] > aside[0]
    return worse


def _bounds(
    judge: Judge, part: Enclosure
) -> tuple[dict[int, FloatArray], dict[int, FloatArray]]:
    found = judge.utilisations(part, (1, -1))
    return ({s: b[0] for s, b in found.items()}, {s: b[1] for s, b in found.items()})


def _only(part: Enclosure, end: str) -> Enclosure:
    """Return the parts shrunk to their start ("0") or their end ("1")."""
    fields = {
        name: getattr(part, name[:-1] + end) if name[-1] in "01" else value
        for name, value in vars(part).items()
    }
    swing = None if part.swing is None else part.swing.only(int(end))
    still = {"dt": np.zeros_like(part.dt), "swing": swing}
    return replace(part, **{**fields, **still})
