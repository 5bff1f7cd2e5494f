"""What the pictures of a verdict show, as numbers and words; no matplotlib here."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from configspace import PermissibleSpace, Vehicle, to_twist, wheel_states
from configspace.angles import wrap
from configspace.plot_data import steering_span
from configspace.vehicle import Castor, SteerableWheel
from omniplan.motion import PoseMotion
from omniplan.proving import prove
from omniplan.report import Report, Violation
from omniplan.trace import Trace, trace_of
from omniplan.trajectory import Trajectory
from omniplan.wording import quantity

__all__ = ["Drive", "Mark", "drive_of", "marks_of", "telling_wheels"]

FloatArray = npt.NDArray[np.float64]

STRETCHES = 300
"""Pictures show a motion cut into at least so many stretches."""
MAX_MARKS = 6
"""More kinds of violations are not labelled."""
JUMP = math.radians(100)
"""A wheel that turns by more between two moments has met its singular point."""


@dataclass(frozen=True, eq=False)
class Drive:
    """What a vehicle does along a trajectory, at the 2 m ends of m short stretches."""

    space: PermissibleSpace
    trace: Trace
    t: FloatArray
    """(2 m,) s, not decreasing."""
    poses: FloatArray
    """(2 m, 3) m, m, rad: of the frame of the vehicle file; from the origin where the
    trajectory has no poses."""
    kappa_n: FloatArray
    """(2 m,) 1; NaN where the vehicle stands."""
    beta: FloatArray
    """(2 m,) rad; NaN likewise."""
    v_s: FloatArray
    """(2 m,) m/s, signed."""
    twist: FloatArray
    """(2 m, 3) of K, m/s, m/s, rad/s."""
    v_max: FloatArray
    """(2, 2 m) m/s: v_max forwards and backwards; NaN where the vehicle stands."""
    alpha: FloatArray
    """(2 m, wheels) rad, unwrapped, joined straight where the wheels turn at rest; NaN
    for wheels that do not steer; (2 m, 0) without the vehicle."""
    u: FloatArray
    """(2 m, wheels) m/s, rolling speed; of steered wheels at the steering axis; NaN for
    castors; (2 m, 0) without the vehicle."""


@dataclass(frozen=True)
class Mark:
    """One violation that a picture labels."""

    number: int
    violation: Violation
    text: str


def drive_of(
    trajectory: Trajectory,
    space: PermissibleSpace,
    *,
    allow_unreachable: bool = False,
) -> Drive:
    """Return what a vehicle does along a trajectory, close enough for a line.

    Parameters
    ----------
    trajectory : Trajectory
    space : PermissibleSpace
    allow_unreachable : bool
        As for `validate`.
    """
    proved = prove(
        trajectory,
        space,
        allow_unreachable=allow_unreachable,
        longest=trajectory.duration / STRETCHES,
    )
    trace = trace_of(proved)
    kappa_n, beta, v_s = (x.ravel() for x in (trace.kappa_n, trace.beta, trace.v_s))
    rests = np.repeat(trace.stands, 2)
    if proved.motion.is_own:  # a configuration is given even at rest
        rests = np.zeros_like(rests)
    v_s = np.where(rests, 0.0, v_s)
    t = trace.t.ravel()
    twist = to_twist(kappa_n, beta, v_s, space.kappa_g)
    if isinstance(proved.motion, PoseMotion):
        poses = proved.motion.poses_at(t)
        point = complex(*trajectory.reference_point)
    else:
        poses = _integrated(t, twist)
        point = complex(*space.header.reference)
    nothing = np.where(rests, np.nan, 1.0)
    v_max = np.stack([space.v_max(kappa_n, beta, reverse=r) for r in (False, True)])
    alpha, u = _wheels(space.vehicle, kappa_n, beta, v_s, rests, t)
    return Drive(
        space=space,
        trace=trace,
        t=t,
        poses=_moved(poses, -point),
        kappa_n=kappa_n * nothing,
        beta=beta * nothing,
        v_s=v_s,
        twist=twist,
        v_max=v_max * nothing,
        alpha=alpha,
        u=u,
    )


def _moved(poses: FloatArray, by: complex) -> FloatArray:
    """Return the poses of another point, given in the vehicle's frame."""
    place = poses[:, 0] + 1j * poses[:, 1] + np.exp(1j * poses[:, 2]) * by
    return np.stack([place.real, place.imag, poses[:, 2]], axis=-1)


def _integrated(t: FloatArray, twist: FloatArray) -> FloatArray:
    """Return the poses of K from the origin on, each step with its mean twist."""
    dt = np.diff(t)
    mean = (twist[1:] + twist[:-1]) / 2
    theta = np.concatenate([[0.0], np.cumsum(mean[:, 2] * dt)])
    half = mean[:, 2] * dt / 2
    # A step along an arc: its chord has the direction of the middle heading.
    chord = (mean[:, 0] + 1j * mean[:, 1]) * dt * np.sinc(half / math.pi)
    place = np.concatenate([[0.0], np.cumsum(chord * np.exp(1j * (theta[:-1] + half)))])
    return np.stack([place.real, place.imag, theta], axis=-1)


def _wheels(
    vehicle: Vehicle | None,
    kappa_n: FloatArray,
    beta: FloatArray,
    v_s: FloatArray,
    rests: npt.NDArray[np.bool_],
    t: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return unwrapped steering angles and rolling speeds."""
    if vehicle is None:
        return np.empty((t.size, 0)), np.empty((t.size, 0))
    alpha, u = wheel_states(vehicle, kappa_n, beta, v_s)
    for i, wheel in enumerate(vehicle.wheels):
        if isinstance(wheel, SteerableWheel):
            middle = steering_span(wheel)[0]
            alpha[:, i] = _followed(alpha[:, i], rests, t, middle)
        else:
            alpha[:, i] = np.nan
    return alpha, u


def _followed(
    angle: FloatArray, rests: npt.NDArray[np.bool_], t: FloatArray, middle: float
) -> FloatArray:
    """Return an angle unwrapped over every piece that is driven, joined at rests."""
    moving = np.flatnonzero(~rests)
    followed = np.full(angle.shape, np.nan)
    if not moving.size:
        return followed
    cuts = np.flatnonzero(np.diff(moving) > 1) + 1
    for piece in np.split(moving, cuts):
        start = middle + wrap(angle[piece[0]] - middle)
        step = wrap(np.diff(angle[piece]))
        followed[piece] = start + np.concatenate([[0.0], np.cumsum(step)])
        followed[piece[1:][np.abs(step) > JUMP]] = np.nan
    first, last = moving[0], moving[-1]
    between = rests.copy()
    between[:first] = between[last:] = False
    followed[between] = np.interp(t[between], t[moving], followed[moving])
    return followed


def marks_of(report: Report) -> tuple[Mark, ...]:
    """Return the violations that pictures label: the worst of every kind.

    Parameters
    ----------
    report : Report
    """
    kinds = dict.fromkeys(v.limit for v in report.violations)
    found = []
    for kind in list(kinds)[:MAX_MARKS]:
        same = [v for v in report.violations if v.limit == kind]
        worst = max(same, key=lambda v: (v.is_proved, v.excess))
        found.append((worst, len(same) - 1))
    found.sort(key=lambda pair: pair[0].t)
    return tuple(
        Mark(number, violation, _worded(violation, more))
        for number, (violation, more) in enumerate(found, start=1)
    )


def _worded(violation: Violation, more: int) -> str:
    """Return limit, wheel and numbers in few words."""
    what = violation.limit.lower().replace("_", " ").replace("steer ", "steering ")
    who = f" of {violation.wheel}" if violation.wheel else ""
    numbers = ""
    if violation.value is not None and violation.limit != "SINGULAR":
        value, bound = (
            quantity(x, violation.unit) for x in (violation.value, violation.bound)
        )
        numbers = f": {value}, permitted {bound}"
    others = f" (and {more} more)" if more else ""
    return f"{what}{who}{numbers} at t = {violation.t:.2f} s{others}"


def telling_wheels(drive: Drive, report: Report, number: int) -> list[int]:
    """Return the wheels to draw one by one: violated, then tight, then extreme.

    Parameters
    ----------
    drive : Drive
        With its vehicle.
    report : Report
    number : int
        So many at most; all if there are no more that roll.

    Returns
    -------
    list of int
        Indices, rising.
    """
    vehicle = drive.space.vehicle
    assert vehicle is not None
    rolling = [i for i, w in enumerate(vehicle.wheels) if not isinstance(w, Castor)]
    if len(rolling) <= number:
        return rolling
    ids = drive.space.header.wheel_ids
    worst = sorted(report.violations, key=lambda v: -v.excess)
    tight = [drive.trace.wheel[i] for i in np.argsort(drive.trace.margin)]
    names = dict.fromkeys([*(v.wheel for v in worst), *tight])
    chosen = [ids.index(name) for name in names if name in ids]
    fastest = np.nanmax(np.abs(drive.u), axis=0, initial=0.0)
    chosen += _outermost(rolling, fastest)
    return sorted(list(dict.fromkeys(chosen))[:number])


def _outermost(rolling: Sequence[int], size: FloatArray) -> list[int]:
    order = sorted(rolling, key=lambda i: -size[i])
    return [order[0], order[-1], *order[1:-1]]
