"""The reserve of manoeuvrability: how far what is driven keeps from what is blocked.

The reserve of a trajectory is the least `configspace.clearance_map` of all
configurations that are driven: the angle by which the direction of motion
``(vx, vy, ω d)`` of K may be changed at once, whichever way, without the stop of a
wheel or the centre of rotation on a wheel being in the way. One length d weights
rotation for all vehicles, as κ_n means something else for every vehicle
(spec/omni-curve §1, fact 4).

A line-mobile vehicle, and one that cannot turn, has a reserve of 0: something is
blocked right beside every motion of it. One that blocks nothing, as with Mecanum
wheels, has π. What is left of speeds and change rates is the margin, not this.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from configspace import ClearanceMap, PermissibleSpace, clearance_map
from configspace.omni_curve import curvature_of_ratio
from omniplan.judging.chords import Chord, speed_of
from omniplan.motion import Enclosure
from omniplan.proving import Proved
from omniplan.samples import HEADING_LENGTH

__all__ = ["fleet_clearance", "reserve"]

FloatArray = npt.NDArray[np.float64]

RESOLUTION = 0.01
"""The reserve is known to this, rad ..."""
MAX_PARTS = 20_000
"""... unless the motion has to be cut into more parts than this ..."""
MAX_HALVINGS = 20
"""... or more often."""


def fleet_clearance(space: PermissibleSpace) -> ClearanceMap:
    """Return the clearance that vehicles of a fleet are compared by."""
    return clearance_map(space, HEADING_LENGTH)


def reserve(proved: Proved, clearance: ClearanceMap) -> float:
    """Return the reserve of manoeuvrability of a trajectory.

    Parameters
    ----------
    proved : Proved
        Of `omniplan.proving.prove`.
    clearance : ClearanceMap
        `fleet_clearance` of its space.

    Returns
    -------
    reserve : float, rad, [0, π]
        Never more than the true one, at and between the samples. π where nothing is
        blocked, and for a trajectory that only stands.
    """
    space, spans = proved.space, proved.parts.spans
    if space.line_beta is not None or space.is_translating:
        return 0.0
    if clearance.tree is None:  # nothing to keep away from, or nothing permitted
        return math.pi if clearance.free.all() else 0.0
    for _ in range(MAX_HALVINGS):
        part = proved.motion.enclose(spans)
        own = proved.choice.sign_of(spans) * part.sign
        low, high = _over_parts(proved, part, own, clearance)
        wanted = low < min(high.min(initial=math.pi), math.pi) - RESOLUTION
        if not wanted.any() or low.size > MAX_PARTS:
            break
        spans = spans.halved(wanted)
    return float(low.min(initial=math.pi))


def _over_parts(
    proved: Proved, part: Enclosure, own: FloatArray, clearance: ClearanceMap
) -> tuple[FloatArray, FloatArray]:
    """Return the least clearance over parts: from below, and at their ends, (m,) rad.

    The direction stays within `aside` of the arc between those of the ends, and the
    clearance changes by no more than the direction does.
    """
    judge = proved.judge
    body = Chord.of(part, judge.reference)
    v = own * np.stack([body.a, body.b])
    omega = own * np.stack([part.omega0, part.omega1])
    ends = np.stack([v.real, v.imag, omega * HEADING_LENGTH], axis=-1)
    turn = part.dt**2 / 8 * part.omega_ddot * HEADING_LENGTH
    radius = np.hypot(body.radius, turn)
    near = _distance(*ends) - radius
    # From or into rest along one straight direction: that of the other end.
    from_rest = (np.linalg.norm(ends, axis=-1) == 0) & (radius == 0)
    ends = np.where(from_rest[..., None], ends[::-1], ends)
    v, omega = ends[..., 0] + 1j * ends[..., 1], ends[..., 2] / HEADING_LENGTH
    kappa_n = curvature_of_ratio(np.abs(v), omega / judge.kappa_g)
    at = clearance(np.clip(kappa_n, -2, 2), np.angle(v))
    with np.errstate(divide="ignore", invalid="ignore"):
        aside = np.arcsin(np.clip(radius / (near + radius), 0.0, 1.0))
    low = (at.sum(axis=0) - _angle(*ends)) / 2 - aside
    is_sure = (near > 0) | from_rest.any(axis=0)
    speed = speed_of(part, body, judge.kappa_g)[1] * part.scale_high
    rests = (speed <= proved.tolerances.standstill) & (not proved.motion.is_own)
    low = np.where(is_sure, np.clip(low, 0.0, math.pi), 0.0)
    return np.where(rests, math.pi, low), np.where(rests, math.pi, at.min(axis=0))


def _angle(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the angles between vectors, (m,) rad."""
    across = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.asarray(np.arctan2(across, (a * b).sum(axis=-1)) * (1 + 1e-12))


def _distance(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the distance of the segments [a, b] from zero, (m,)."""
    d = b - a
    length = (d * d).sum(axis=-1)
    f = np.clip(-(a * d).sum(axis=-1) / np.where(length > 0, length, 1.0), 0.0, 1.0)
    return np.asarray(np.linalg.norm(a + f[:, None] * d, axis=-1))
