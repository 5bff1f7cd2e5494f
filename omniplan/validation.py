"""Validation: is a trajectory drivable by a vehicle, and if not, where and why.

Every part of the motion between the samples is judged by bounds that hold all along
it. A part that is neither shown to keep a limit nor shown to break it is halved; what
stays undecided at the stated resolution (see `proof`) is not permitted.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from configspace import PermissibleSpace
from configspace.omni_curve import curvature_of_ratio
from configspace.space import require_space
from configspace.vehicle import SteerableWheel
from omniplan.judging.chords import Chord
from omniplan.judging.proof import Parts
from omniplan.judging.rows import Judge, Tolerances
from omniplan.judging.violations import (
    find_violations,
    reconfiguration_violations,
    told_between,
    unreachable_violations,
)
from omniplan.motion import Motion, PoseMotion
from omniplan.path import Path
from omniplan.proving import Proved, prove
from omniplan.report import Advice, Report
from omniplan.side_step import side_step
from omniplan.standing.standstill import Choice
from omniplan.trajectory import Trajectory, timed

__all__ = ["Tolerances", "judged", "report_of", "validate"]

MIN_FACTOR, MAX_FACTOR = 0.01, 100.0
"""Slower or faster than this nothing is promised."""
FACTOR_STEP = 1.01
"""How near to a factor that is too large a proved one comes at least, as a ratio."""


def validate(
    trajectory: Trajectory | Path,
    space: PermissibleSpace,
    tolerances: Tolerances | None = None,
    *,
    allow_unreachable: bool = False,
    checkpoint: Callable[[], None] | None = None,
) -> Report:
    """Judge a trajectory for a vehicle.

    With a space that knows its vehicle the exact formulas are used and every limit of
    its file is judged; a data sheet alone answers from its table, in which mixed cells
    count as blocked.

    Parameters
    ----------
    trajectory : Trajectory
    space : PermissibleSpace
    tolerances : Tolerances, optional
        What counts as standing and as free of slip.
    allow_unreachable : bool
        Permit pieces in another component of the space than straight ahead: the
        vehicle must have been brought there otherwise. Without it a piece is refused
        as ``UNREACHABLE`` if the cells of the space prove that no way leads there; what
        they leave undecided counts as reachable.
    checkpoint : callable, optional
        Called every few milliseconds; what it raises ends the work. So a long proof can
        be given up at a deadline.

    Returns
    -------
    Report
        Valid only if every limit is proved to hold at and between the samples.

    Raises
    ------
    InvalidTrajectory
        For a path: `fastest` gives it times.

    References
    ----------
    spec/omni-curve §5.

    Examples
    --------
    >>> import configspace, omniplan
    >>> space = configspace.build_space(
    ...     configspace.load_vehicle("differential"), cache=False)
    >>> line = omniplan.Trajectory.from_poses([0, 1], [[0, 0, 0], [0.5, 0, 0]])
    >>> omniplan.validate(line, space).valid
    True
    """
    require_space(space)
    ask = partial(
        prove,
        space=space,
        tolerances=tolerances or Tolerances(),
        allow_unreachable=allow_unreachable,
        checkpoint=checkpoint,
    )
    trajectory = timed(trajectory)
    proved = ask(trajectory)
    report = report_of(proved)
    factor = _proved_factor(report, proved, ask)
    fastest = trajectory.duration / factor if factor > 0 else None
    report = replace(report, speed_factor=factor, fastest_duration=fastest)
    if report.valid:
        return report

    def holds(other: Trajectory) -> bool:
        return ask(other).is_valid

    advice = (
        *_slow_down(report, trajectory),
        *_dwell(report, trajectory, holds),
        *side_step(report, trajectory, space, holds),
    )
    return replace(report, advice=advice)


def judged(
    trajectory: Trajectory,
    space: PermissibleSpace,
    tolerances: Tolerances,
    allow_unreachable: bool,
    checkpoint: Callable[[], None] | None = None,
) -> Report:
    """Judge a timed trajectory once, without advice and proved speed factor.

    Parameters
    ----------
    trajectory : Trajectory
    space : PermissibleSpace
    tolerances : Tolerances
    allow_unreachable, checkpoint
        As for `validate`.
    """
    return report_of(
        prove(
            trajectory,
            space,
            tolerances,
            allow_unreachable=allow_unreachable,
            checkpoint=checkpoint,
        )
    )


def report_of(proved: Proved) -> Report:
    """Sum up the proof of a trajectory; the speed factor is what the margins promise.

    Parameters
    ----------
    proved : Proved
    """
    trajectory, space = proved.trajectory, proved.space
    motion, judge = proved.motion, proved.judge
    parts, choice = proved.parts, proved.choice
    violations = [
        *find_violations(parts, proved.first, choice, judge, trajectory, motion, space),
        *reconfiguration_violations(choice, judge, trajectory, motion, space),
        *unreachable_violations(choice, judge, trajectory, motion, space),
    ]
    violations = told_between(
        violations, proved.proof.evaluate, proved.first, choice, judge
    )
    violations.sort(key=lambda v: (v.t_start, v.limit, v.wheel or ""))
    margin, tightest, factor = _margins(parts, choice, judge)
    top_speed, top_yaw_rate = _tops(parts, judge, motion, space)
    return Report(
        vehicle=space.name,
        trajectory=trajectory.name,
        valid=not violations,
        violations=tuple(violations),
        margin=margin,
        tightest=tightest,
        duration=trajectory.duration,
        speed_factor=factor,
        fastest_duration=trajectory.duration / factor if factor > 0 else None,
        top_speed=top_speed,
        top_yaw_rate=top_yaw_rate,
        advice=(),
        interpolation=motion.interpolation,
        not_judged=tuple(_not_judged(space, motion)),
    )


def _margins(parts: Parts, choice: Choice, judge: Judge) -> tuple[float, str, float]:
    """Return the margin, what it belongs to, and the speed factor."""
    _, high = parts.picked(choice.sign_of(parts.spans))
    worst = {"nothing": 0.0}
    factors, drivable = [np.inf], not choice.apart
    for row, ratio in zip(judge.rows, high.max(axis=0), strict=True):
        name = (
            f"{row.limit} {judge.wheel_ids[row.wheel]}" if row.wheel >= 0 else row.limit
        )
        worst[name] = max(worst.get(name, 0.0), float(ratio))
        if row.scaling == "speed":
            factors.append(1 / max(float(ratio), 1e-9))
        elif row.scaling == "acceleration":
            factors.append(1 / np.sqrt(max(float(ratio), 1e-18)))
        else:
            drivable &= bool(ratio <= 1)
    for stop in choice.standstills:
        if stop.change.time > 0:
            used = stop.change.time / max(stop.t1 - stop.t0, 1e-9)
            worst["RECONFIGURATION"] = max(worst.get("RECONFIGURATION", 0.0), used)
            factors.append(1 / used)
            drivable &= bool(np.isfinite(used))
    tightest = max(worst, key=worst.__getitem__)
    factor = float(min(factors)) if drivable else 0.0
    # Finite, so that a report can travel as JSON.
    return max(1 - worst[tightest], -1e6), tightest, min(factor, 1e6)


def _tops(
    parts: Parts, judge: Judge, motion: Motion, space: PermissibleSpace
) -> tuple[float, float]:
    """Return the largest |v| of K and |ω| at the ends of all parts, m/s and rad/s."""
    e = parts.enclosure
    body = Chord.of(e, judge.reference)
    speeds, rates = [], []
    for v, omega, share in (
        (body.a, e.omega0, e.scale0),
        (body.b, e.omega1, e.scale1),
    ):
        scale = share
        if motion.is_own:  # the share is of v_max
            kappa_n = curvature_of_ratio(np.abs(v), e.sign * omega / judge.kappa_g)
            v_max = space.v_max(np.clip(kappa_n, -2, 2), np.angle(e.sign * v))
            scale = share * v_max
        speeds.append(float((np.abs(v) * scale).max()))
        rates.append(float((np.abs(omega) * scale).max()))
    return max(speeds), max(rates)


def _not_judged(space: PermissibleSpace, motion: Motion) -> Iterator[str]:
    """Yield the declared limits that this version does not judge."""
    vehicle = space.vehicle
    if vehicle is None:
        yield "change rates (the data sheet does not hold all of them)"
        return
    steered = [w for w in vehicle.wheels if isinstance(w, SteerableWheel)]
    swings = any(w.max_steering_acceleration_deg is not None for w in steered)
    if swings and not isinstance(motion, PoseMotion):
        yield "max_steering_acceleration_deg (samples other than poses bend suddenly)"
    if motion.has_rates:
        # Poses alone swing smoothly: see `judging.beside.beside_gain`.
        if not isinstance(motion, PoseMotion) and any(
            w.max_acceleration is not None and (any(w.offsets) or w.steering_coupling)
            for w in steered
        ):
            yield "max_acceleration of wheels, as far as steering asks for it"
        return
    if any(getattr(w, "max_acceleration", None) is not None for w in vehicle.wheels):
        yield "max_acceleration of the wheels"
    for name in ("max_acceleration", "max_deceleration"):
        if getattr(vehicle.limits, name) is not None:
            yield f"limits.{name}"


def _proved_factor(report: Report, proved: Proved, ask: Callable[..., Proved]) -> float:
    """Return a factor on the speed that validating again has proved, 0 if none.

    What the utilisations promise is tried first; as they are sharp to a part in 1000
    (`proof.SHARPNESS`), so is the factor. It may be too much, as what counts as
    standing and as slip does not scale with the speed; then a factor is found that is
    proved and at most 1 % below one that is not.
    """
    trajectory = proved.trajectory
    promised = min(report.speed_factor * (1 - 1e-9), MAX_FACTOR)
    least = 1.0 if report.valid else 0.0
    if trajectory.form == "omni_curve":  # v_n stays in [-1, 1]
        largest = float(np.abs(trajectory.samples[:, 2]).max())
        promised = min(promised, 1 / max(largest, 1e-9))
    if promised <= max(least, MIN_FACTOR):
        return least

    def holds(factor: float) -> bool:
        return ask(trajectory.scaled(factor), like=proved).is_valid

    if holds(promised):
        return promised
    while promised > FACTOR_STEP * max(least, MIN_FACTOR):
        middle = math.sqrt(max(least, MIN_FACTOR) * promised)
        if holds(middle):
            least = middle
        else:
            promised = middle
    return least


def _slow_down(report: Report, trajectory: Trajectory) -> tuple[Advice, ...]:
    """Return the advice to drive slower, if that is proved to help."""
    factor = report.speed_factor
    if factor == 0:
        return ()
    text = (
        f"drive it at {factor:.1%} of the speed: {trajectory.duration / factor:.2f} s"
    )
    return (Advice("slow_down", factor, text),)


def _dwell(
    report: Report,
    trajectory: Trajectory,
    holds: Callable[[Trajectory], bool],
) -> tuple[Advice, ...]:
    """Return the advice to stand still longer, if that is proved to help."""
    short = [v for v in report.violations if v.limit == "RECONFIGURATION"]
    if len(short) != len(report.violations) or trajectory.form != "poses":
        return ()
    longer, waits = trajectory, []
    for violation in reversed(short):  # from the back, so that rows keep their numbers
        if violation.value is None:
            return ()
        row = int(np.abs(trajectory.t - violation.t).argmin())
        wait = violation.value * (1 + 1e-9) + 1e-6
        longer = longer.with_dwell(row, wait)
        waits.append((float(trajectory.t[row]), wait))
    if not holds(longer):
        return ()
    text = " and ".join(f"{wait:.2f} s at t = {t:.2f} s" for t, wait in waits[::-1])
    total = sum(wait for _, wait in waits)
    return (Advice("dwell", total, f"stand still for {text}"),)
