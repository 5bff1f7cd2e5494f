"""What is driven along a trajectory, and how much every moment of it has left.

The same proof as in `omniplan.validation`, not summed up: one entry per part of the
motion between the samples, and one per standstill.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from configspace import PermissibleSpace
from configspace.angles import wrap
from configspace.omni_curve import curvature_of_ratio
from omniplan.judging.proof import ROUNDING
from omniplan.judging.rows import Tolerances
from omniplan.motion import Intervals
from omniplan.proving import Proved, prove
from omniplan.trajectory import Trajectory

__all__ = ["Trace", "margins", "trace_of"]

FloatArray = npt.NDArray[np.float64]

LEAST_MARGIN = -1e6
"""Stands for "infinitely far out", as in a report."""


@dataclass(frozen=True, eq=False)
class Trace:
    """What is driven over m stretches of a trajectory, and what it has left.

    The stretches follow each other; a standstill without duration, at a cusp or a
    corner, is a stretch of its own if wheels must turn there. Arrays are read-only.
    """

    t: FloatArray
    """(m, 2) s, start and end."""
    margin: FloatArray
    """(m,) 1 - worst value / bound over the stretch: how much is left all over it, at
    least. Negative where a limit is broken, by as much as is proved; or where it could
    not be shown to hold."""
    limit: tuple[str, ...]
    """(m,) the limit that the margin belongs to, as in `omniplan.Violation`."""
    wheel: tuple[str | None, ...]
    """(m,) its wheel."""
    kappa_n: FloatArray
    """(m, 2) at both ends, 1."""
    beta: FloatArray
    """(m, 2) rad, (-π, π]; 0 where nothing moves."""
    v_s: FloatArray
    """(m, 2) m/s, signed: the representation that is driven."""
    stands: npt.NDArray[np.bool_]
    """(m,) whether the vehicle stands; its configuration then means nothing."""

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False


def margins(
    trajectory: Trajectory,
    space: PermissibleSpace,
    tolerances: Tolerances | None = None,
    *,
    allow_unreachable: bool = False,
    longest: float | None = None,
) -> Trace:
    """Return how much is left of the limits all along a trajectory.

    The smallest margin is that of the report of `validate`, or, where `longest` cuts
    the motion finer, a little more.

    Parameters
    ----------
    trajectory : Trajectory
    space : PermissibleSpace
    tolerances : Tolerances, optional
    allow_unreachable : bool
        As for `validate`, both.
    longest : float, s, optional
        No stretch is longer than this; default as the proof needs them.

    Returns
    -------
    Trace

    Examples
    --------
    >>> import configspace, omniplan
    >>> space = configspace.build_space(
    ...     configspace.load_vehicle("differential"), cache=False)
    >>> faster = omniplan.Trajectory.from_twists([0, 1], [[0.5, 0, 0], [0.8, 0, 0]])
    >>> trace = omniplan.margins(faster, space)
    >>> trace.margin.min().round(3), trace.limit[0]
    (np.float64(0.2), 'WHEEL_SPEED')
    """
    proved = prove(
        trajectory,
        space,
        tolerances,
        allow_unreachable=allow_unreachable,
        longest=longest,
    )
    return trace_of(proved)


def trace_of(proved: Proved) -> Trace:
    """Return the stretches of what is proved."""
    parts, judge, choice = proved.parts, proved.judge, proved.choice
    low, high = parts.picked(choice.sign_of(parts.spans))
    # Where one limit is surely broken the others were not pursued to the end.
    broken = low > 1 + ROUNDING
    used = np.where(broken.any(axis=1, keepdims=True), np.where(broken, low, 0), high)
    used = np.pad(used, ((0, 0), (0, 1)))  # where nothing is judged
    worst = used.argmax(axis=1)
    used = np.take_along_axis(used, worst[:, None], 1)[:, 0]
    limits = [*(row.limit for row in judge.rows), "nothing"]
    wheels = [*(row.wheel for row in judge.rows), -1]
    ids = (*judge.wheel_ids, None)
    kappa_n, beta, v_s = states(proved, parts.spans)
    stretches = Trace(
        t=np.stack([parts.spans.t0, parts.spans.t1], axis=-1),
        margin=np.maximum(1.0 - used, LEAST_MARGIN),
        limit=tuple(limits[i] for i in worst),
        wheel=tuple(ids[wheels[i]] for i in worst),
        kappa_n=kappa_n,
        beta=beta,
        v_s=v_s,
        stands=parts.stands.copy(),
    )
    return _with_standstills(stretches, proved)


def _with_standstills(stretches: Trace, proved: Proved) -> Trace:
    """Return the stretches with the time that the wheels need at standstills."""
    for stop in proved.choice.standstills:
        change = stop.change
        if change.time <= 0:
            continue
        left = 1 - change.time / max(stop.t1 - stop.t0, 1e-9)
        at = int(np.searchsorted(stretches.t[:, 0], stop.between[1], side="left"))
        kappa_n, beta = np.array([change.start, change.goal]).T
        wheel = proved.judge.wheel_ids[change.wheel] if change.wheel >= 0 else None
        stretches = Trace(
            t=np.insert(stretches.t, at, (stop.t0, stop.t1), axis=0),
            margin=np.insert(stretches.margin, at, max(left, LEAST_MARGIN)),
            limit=(*stretches.limit[:at], "RECONFIGURATION", *stretches.limit[at:]),
            wheel=(*stretches.wheel[:at], wheel, *stretches.wheel[at:]),
            kappa_n=np.insert(stretches.kappa_n, at, kappa_n, axis=0),
            beta=np.insert(stretches.beta, at, beta, axis=0),
            v_s=np.insert(stretches.v_s, at, 0.0, axis=0),
            stands=np.insert(stretches.stands, at, True),
        )
    return stretches


def states(
    proved: Proved, spans: Intervals
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return what is driven at both ends of parts, each (m, 2).

    Parameters
    ----------
    proved : Proved
    spans : Intervals
        Any parts of the motion.

    Returns
    -------
    kappa_n : (m, 2) float, 1, [-2, 2]
    beta : (m, 2) float, rad, (-π, π]
    v_s : (m, 2) float, m/s, signed
    """
    judge, e = proved.judge, proved.motion.enclose(spans)
    own = (proved.choice.sign_of(spans) * e.sign)[:, None]
    v, omega = np.stack([e.v0, e.v1], -1), np.stack([e.omega0, e.omega1], -1)
    scale = np.stack([e.scale0, e.scale1], axis=-1)
    body, q = own * (v + 1j * omega * judge.reference), own * omega / judge.kappa_g
    line = proved.space.line_beta
    if line is not None and not judge.needs_configuration:
        # Nothing steers: the representation that looks along the line is driven.
        along = np.where((body * np.exp(-1j * line)).real < 0, -1.0, 1.0)
        own, body, q = own * along, body * along, q * along
    kappa_n = np.clip(curvature_of_ratio(np.abs(body), q), -2.0, 2.0)
    beta = np.where(np.abs(body) > 0, np.angle(body), 0.0)
    if line is not None:  # what slips a little is on the line
        beta = np.where(np.abs(wrap(beta - line)) < np.pi / 4, line, beta)
    if proved.space.is_translating:
        kappa_n = np.zeros_like(kappa_n)
    v_s = own * np.maximum(np.abs(body), np.abs(q)) * scale
    if proved.motion.is_own:  # the factor is a share of v_max
        v_max = np.where(
            own < 0,
            proved.space.v_max(kappa_n, beta, reverse=True),
            proved.space.v_max(kappa_n, beta),
        )
        v_s = v_s * v_max
    return kappa_n, beta, v_s
