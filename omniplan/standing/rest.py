"""Where a standstill begins and ends, whatever parts a motion is cut into.

What stands is known of parts only, and where a motion is cut depends on its limits.
So that a standstill has one length, the interval between two samples in which the
vehicle comes to rest is cut evenly, and so again the part that moves beside those that
stand.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from omniplan.judging.chords import Chord, speed_of
from omniplan.judging.rows import Judge
from omniplan.motion import Enclosure, Intervals, Motion

__all__ = ["CUTS", "DEEPEST", "Edge", "edge_of"]

BoolArray = npt.NDArray[np.bool_]
FloatArray = npt.NDArray[np.float64]

CUTS = 32
"""Into so many parts an interval is cut, and so again the one beside the standstill."""
DEEPEST = 5
"""Cut so often at most until something stands: parts are 32⁶ times shorter then."""


@dataclass(frozen=True)
class Edge:
    """Where a standstill begins or ends: a time and the twist that is left."""

    t: float
    """s."""
    v: complex
    """Velocity of the origin of the vehicle file's frame, m/s; in representation +1."""
    omega: float
    """rad/s."""


def edge_of(
    motion: Motion, judge: Judge, standstill: float, knot: int, *, is_start: bool
) -> Edge | None:
    """Return where the standstill beside a piece of a motion begins or ends.

    Parameters
    ----------
    motion : Motion
    judge : Judge
    standstill : float, m/s
        At this |v_s| or below the vehicle stands.
    knot : int
        The interval between samples that the piece ends in, or begins in.
    is_start : bool
        Whether the standstill begins there: the piece comes before it.

    Returns
    -------
    Edge or None
        None if the vehicle does not stand at the sample where the interval meets the
        standstill: it rests between two samples.
    """
    whole = motion.intervals()
    at = whole.t1 if is_start else whole.t0

    def stands(part: Enclosure) -> BoolArray:
        body = Chord.of(part, judge.reference)
        speed = speed_of(part, body, judge.kappa_g)[1]
        return np.asarray(speed * part.scale_high <= standstill)

    moment = at[knot : knot + 1]
    if not stands(motion.enclose(Intervals(np.array([knot]), moment, moment)))[0]:
        return None
    a, b = float(whole.t0[knot]), float(whole.t1[knot])
    level, is_known = 0, False
    while True:
        times = a + (b - a) * np.arange(CUTS + 1) / CUTS
        times[-1] = b
        part = motion.enclose(Intervals(np.full(CUTS, knot), times[:-1], times[1:]))
        moving = np.flatnonzero(~stands(part))
        was_known = is_known
        if not moving.size:
            following = knot - 1 if is_start else knot + 1
            if level > 0 or not 0 <= following < whole.t0.size:
                return _edge(part, times, 0 if is_start else CUTS)
            # All of it stands: the standstill reaches beyond the sample.
            knot, is_known = following, True
            a, b = float(whole.t0[knot]), float(whole.t1[knot])
            continue
        row = int(moving[-1]) if is_start else int(moving[0])
        is_known |= row < CUTS - 1 if is_start else row > 0
        if (was_known and level > 0) or level == DEEPEST:
            return _edge(part, times, row + is_start)
        a, b = float(times[row]), float(times[row + 1])
        level += 1


def _edge(part: Enclosure, times: FloatArray, i: int) -> Edge:
    """Return the i-th of the times between parts, and the twist there."""
    v, omega, j = (part.v0, part.omega0, 0) if i == 0 else (part.v1, part.omega1, i - 1)
    own = float(part.sign[j])
    return Edge(float(times[i]), own * complex(v[j]), own * float(omega[j]))
