"""Where else to move at an offending place: the nearest permitted side-slip angle."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from configspace import PermissibleSpace, exact_v_max
from configspace.angles import wrap
from configspace.omni_curve import components
from omniplan.judging.judge import is_own
from omniplan.motion import Intervals, motion_of
from omniplan.report import Advice, Report, Violation
from omniplan.trajectory import Trajectory

__all__ = ["nearest_side_slip", "side_step"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

PLACE_LIMITS = frozenset(
    {
        "BLOCKED",
        "LATERAL_ACCELERATION",
        "REVERSE_SPEED",
        "SINGULAR",
        "SINGULAR_ZONE",
        "STEER_RANGE",
        "TIPPING",
        "V_MAX",
        "WHEEL_SPEED",
    }
)
"""Limits of (κ_n, β, v_s) at one place that another β may keep."""
STEPS = 1440
"""Directions that are tried to each side; a gap narrower than half a turn over this,
0.125°, may be passed over."""
BISECTIONS = 40
INWARD = (1e-4, 2e-3)
"""How far from the border of what is permitted the advice stays, rad, tried in turn."""
SLOWEST = 1e-2
"""A speed at which only the configuration matters, m/s."""
SECONDS = 1.0
"""How long the checked motion takes, s."""


def side_step(
    report: Report,
    trajectory: Trajectory,
    space: PermissibleSpace,
    holds: Callable[[Trajectory], bool],
) -> tuple[Advice, ...]:
    """Return the advice to move in another direction at the most telling violation.

    Curvature κ_n and speed v_s stay. It is given only if driving so, steadily, was
    validated. A vehicle that is bound to a line or to translation is given none.

    Parameters
    ----------
    report : Report
        Not valid.
    trajectory : Trajectory
    space : PermissibleSpace
    holds : callable
        Returns whether a trajectory is valid.
    """
    worst = report.headline
    bound = space.line_beta is not None or space.is_translating
    if worst is None or bound or worst.limit not in PLACE_LIMITS:
        return ()
    v_s = _speed_at(worst, trajectory, space)
    if v_s == 0:
        return ()
    border = nearest_side_slip(space, worst.kappa_n, worst.beta, v_s)
    if border is None:
        return ()
    away = math.copysign(1.0, wrap(border - worst.beta))
    for inward in INWARD:
        beta = float(wrap(border + away * inward))
        if holds(_steady(space, worst.kappa_n, beta, v_s)):
            text = (
                f"at t = {worst.t:.2f} s: move towards β = {math.degrees(beta):.1f}° "
                f"instead of {math.degrees(worst.beta):.1f}°"
            )
            return (Advice("side_slip", beta, text),)
    return ()


def nearest_side_slip(
    space: PermissibleSpace, kappa_n: float, beta: float, v_s: float
) -> float | None:
    """Return the border of what is permitted that is nearest in β, rad.

    Parameters
    ----------
    space : PermissibleSpace
        Answers by the exact formulas if it knows its vehicle.
    kappa_n : float, 1, [-2, 2]
    beta : float, rad
    v_s : float, m/s
        Its sign is that of the representation that κ_n and β belong to.

    Returns
    -------
    float or None
        Permitted itself, in either representation, and at most half a turn from `beta`;
        None if no β is permitted.
    """

    def permits(offset: FloatArray) -> BoolArray:
        towards = beta + offset
        backwards = v_s < 0
        # The same twist in both of its representations.
        return _is_permitted(space, kappa_n, towards, abs(v_s), backwards) | (
            _is_permitted(space, -kappa_n, towards + math.pi, abs(v_s), not backwards)
        )

    steps = np.arange(1, STEPS + 1) * (math.pi / STEPS)
    both = np.stack([steps, -steps], axis=-1).ravel()  # the nearer ones first
    good = np.flatnonzero(permits(both))
    if not good.size:
        return None
    sides = []
    for side in (1.0, -1.0):
        mine = good[(good % 2 == 0) == (side > 0)]
        if mine.size:
            sides.append(_border(permits, side, float(abs(both[mine[0]]))))
    return float(beta + min(sides, key=abs))


def _is_permitted(
    space: PermissibleSpace,
    kappa_n: float,
    beta: FloatArray,
    speed: float,
    reverse: bool,
) -> BoolArray:
    at, beta = np.full_like(beta, kappa_n), wrap(beta)
    if space.vehicle is None:
        v_max = space.v_max(at, beta, reverse=reverse)
    else:
        v_max = exact_v_max(space.vehicle, at, beta, reverse=reverse)
    return np.asarray((v_max > 0) & (v_max >= speed))


def _border(
    permits: Callable[[FloatArray], BoolArray], side: float, good: float
) -> float:
    """Return the offset next to one that is not permitted, by bisection."""
    bad = good - math.pi / STEPS
    for _ in range(BISECTIONS):
        middle = (bad + good) / 2
        if permits(np.array([side * middle]))[0]:
            good = middle
        else:
            bad = middle
    return side * good


def _speed_at(
    worst: Violation, trajectory: Trajectory, space: PermissibleSpace
) -> float:
    """Return v_s of the representation that is told of, at the worst place, m/s.

    Of the space's own Omni-Curve-Parameters, which are shares of v_max, just any speed.
    """
    own = is_own(trajectory, space)
    motion = motion_of(trajectory, is_own=own)
    spans = motion.intervals()
    knot = int(np.clip(np.searchsorted(spans.t1, worst.t), 0, spans.t1.size - 1))
    at = np.array([worst.t])
    part = motion.enclose(Intervals(spans.knot[[knot]], at, at))
    omega = float(part.omega0[0])
    body = complex(part.v0[0]) + 1j * omega * complex(*space.header.reference)
    speed = max(abs(body), abs(omega) / space.kappa_g) * float(part.scale0[0])
    c, s = components(worst.kappa_n)
    told = c * np.exp(1j * worst.beta)
    agrees = (body * np.conj(told)).real + omega / space.kappa_g * s
    sign = -1.0 if agrees < 0 else 1.0
    return sign * (SLOWEST if own else speed)


def _steady(
    space: PermissibleSpace, kappa_n: float, beta: float, v_s: float
) -> Trajectory:
    """Return a short motion at a constant twist."""
    c, s = components(kappa_n)
    omega = v_s * float(s) * space.kappa_g
    v = v_s * float(c) * np.exp(1j * beta) - 1j * omega * complex(
        *space.header.reference
    )
    twist = [float(v.real), float(v.imag), omega]
    return Trajectory.from_twists([0.0, SECONDS], [twist, twist], name="steady")
