"""Many trajectories as flat arrays, with the enclosures of `motion`, in numba.

A trajectory is cut at its samples, and towards rest ever finer: there the direction of
a velocity is known only on parts that are short against the time to rest. None of it
depends on a vehicle.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from omniplan.motion import PoseMotion, TwistMotion, motion_of
from omniplan.trajectory import Trajectory

__all__ = ["FIELDS", "KNOT", "LANES", "Motions", "enclose", "motions_of"]

Array = Any  # numba infers the types; mypy cannot look into the kernels
FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

LANES = 16
"""Parts that the loops of `batch_rows` treat at once."""
FIELDS = 21
"""Numbers per part: see `enclose`."""
KNOT = 16
"""Numbers per knot: twelve coefficients, start and end in s, the point in m."""

REST = 2e-4
"""Parts that are slower than this are not cut further, m/s."""
STEEP = 0.55
"""A part is cut while one end is slower than this share of the other."""
MAX_CUTS = 40
"""Cuts per part, at most."""
TURNING = 0.5
"""Metres that one radian counts in that comparison."""


@dataclass(frozen=True, eq=False)
class Motions:
    """The motions of n trajectories of poses or twists."""

    blocks: FloatArray
    """(b, FIELDS, LANES): parts by blocks; the last part of a motion fills its last."""
    knot_of: IntArray
    """(b, LANES): the knot each part belongs to."""
    first: IntArray
    """(n + 1,): first block of every motion."""
    count: IntArray
    """(n,): parts of every motion."""
    knots: FloatArray
    """(k, KNOT)."""
    is_pose: npt.NDArray[np.bool_]
    """(n,)."""


def motions_of(trajectories: Sequence[Trajectory]) -> Motions:
    """Return trajectories of poses or twists as flat arrays.

    Parameters
    ----------
    trajectories : sequence of Trajectory
    """
    knots, spans, forms = [], [0], []
    for trajectory in trajectories:
        table, is_pose = _knots_of(trajectory)
        knots.append(table)
        spans.append(spans[-1] + len(table))
        forms.append(is_pose)
    flat = np.concatenate(knots)
    is_pose_ = np.array(forms, dtype=np.bool_)
    first_knot = np.array(spans)
    count = _count_parts(flat, first_knot, is_pose_)
    first = np.concatenate([[0], np.cumsum(-(-count // LANES))])
    blocks = np.empty((int(first[-1]), FIELDS, LANES))
    knot_of = np.empty((int(first[-1]), LANES), np.int64)
    _fill_parts(flat, first_knot, is_pose_, first, blocks, knot_of)
    return Motions(blocks, knot_of, first, count, flat, is_pose_)


def _knots_of(trajectory: Trajectory) -> tuple[FloatArray, bool]:
    """Return the polynomials between the samples, (m, KNOT), and whether of poses."""
    motion = motion_of(trajectory, is_own=False)
    if isinstance(motion, PoseMotion):
        t, point = motion.t, motion.point
        table = np.empty((t.size - 1, KNOT))
        table[:, 0:4] = motion.position.real.T
        table[:, 4:8] = motion.position.imag.T
        table[:, 8:12] = motion.heading.T
        table[:, 14:] = point.real, point.imag
    else:
        assert isinstance(motion, TwistMotion)
        t = motion.t
        table = np.zeros((t.size - 1, KNOT))
        for column, values in ((0, motion.v.real), (4, motion.v.imag)):
            table[:, column], table[:, column + 1] = values[:-1], values[1:]
        table[:, 8], table[:, 9] = motion.omega[:-1], motion.omega[1:]
    table[:, 12], table[:, 13] = t[:-1], t[1:]
    return table, isinstance(motion, PoseMotion)


@njit(cache=True)
def _at(knot: Array, t: float, out: Array, v: int, v_dot: int, lane: int) -> Any:
    """Write v, ω and v̇, ω̇ of a spline; return the sizes of its first derivatives."""
    h = t - knot[12]
    x1 = (3 * knot[0] * h + 2 * knot[1]) * h + knot[2]
    y1 = (3 * knot[4] * h + 2 * knot[5]) * h + knot[6]
    x2, y2 = 6 * knot[0] * h + 2 * knot[1], 6 * knot[4] * h + 2 * knot[5]
    h0 = ((knot[8] * h + knot[9]) * h + knot[10]) * h + knot[11]
    h1 = (3 * knot[8] * h + 2 * knot[9]) * h + knot[10]
    h2 = 6 * knot[8] * h + 2 * knot[9]
    c, s = math.cos(h0), math.sin(h0)
    px, py = knot[14], knot[15]
    # e^{-jθ} p' - jθ' point and its derivative
    out[v, lane] = c * x1 + s * y1 + h1 * py
    out[v + 1, lane] = c * y1 - s * x1 - h1 * px
    out[v + 2, lane] = h1
    bx, by = x2 + h1 * y1, y2 - h1 * x1
    out[v_dot, lane] = c * bx + s * by + h2 * py
    out[v_dot + 1, lane] = c * by - s * bx - h2 * px
    out[v_dot + 2, lane] = h2
    return math.hypot(x1, y1), math.hypot(x2, y2)


@njit(cache=True)
def _second(knot: Array, t: float, out: Array, lane: int) -> None:
    """Write the second derivatives of v and ω of a spline."""
    h = t - knot[12]
    x1 = (3 * knot[0] * h + 2 * knot[1]) * h + knot[2]
    y1 = (3 * knot[4] * h + 2 * knot[5]) * h + knot[6]
    x2, y2 = 6 * knot[0] * h + 2 * knot[1], 6 * knot[4] * h + 2 * knot[5]
    h0 = ((knot[8] * h + knot[9]) * h + knot[10]) * h + knot[11]
    h1 = (3 * knot[8] * h + 2 * knot[9]) * h + knot[10]
    h2, h3 = 6 * knot[8] * h + 2 * knot[9], 6 * knot[8]
    x = 6 * knot[0] + 2 * h1 * y2 + h2 * y1 - h1 * h1 * x1
    y = 6 * knot[4] - 2 * h1 * x2 - h2 * x1 - h1 * h1 * y1
    c, s = math.cos(h0), math.sin(h0)
    out[17, lane] = c * x + s * y + h3 * knot[15]
    out[18, lane] = c * y - s * x - h3 * knot[14]
    out[19, lane] = h3


@njit(cache=True)
def enclose(
    knot: Array, is_pose: bool, t0: float, t1: float, out: Array, lane: int
) -> None:
    """Write the enclosure of one part, as `Motion.enclose` has it, into a lane.

    Rows of `out`: v0 (2), ω0, v1 (2), ω1, v̇0 (2), ω̇0, v̇1 (2), ω̇1, bounds on |v̈| and
    |ω̈|, Δt, start and end; then v̈ at the start (2), ω̈ and a bound on the next
    derivative of v. ω̈ is constant over a part.

    Parameters
    ----------
    knot : (KNOT,) float
    is_pose : bool
    t0, t1 : float, s
    out : (FIELDS, LANES) float
    lane : int
    """
    dt = t1 - t0
    if is_pose:
        s0, b0 = _at(knot, t0, out, 0, 6, lane)
        s1, b1 = _at(knot, t1, out, 3, 9, lane)
        p3 = 6 * math.hypot(knot[0], knot[4])
        h3 = 6 * abs(knot[8])
        p1 = max(s0, s1) + dt * dt / 8 * p3
        p2 = max(b0, b1)
        h1 = max(abs(out[2, lane]), abs(out[5, lane])) + dt * dt / 8 * h3
        h2 = max(abs(out[8, lane]), abs(out[11, lane]))
        arm = math.hypot(knot[14], knot[15])
        q = p3 + 2 * h1 * p2 + h2 * p1 + h1 * h1 * p1
        v_ddot = q + h3 * arm
        # d/dt (e^{-jθ} q) = e^{-jθ} (q' - jθ'q) with q as in `PoseMotion.enclose`
        third = h1 * q + 3 * h2 * p2 + 2 * h1 * p3 + h3 * p1
        out[20, lane] = third + 2 * h1 * h2 * p1 + h1 * h1 * p2
        _second(knot, t0, out, lane)
    else:
        span = knot[13] - knot[12]
        f0, f1 = (t0 - knot[12]) / span, (t1 - knot[12]) / span
        for i in range(3):
            first, last = knot[4 * i], knot[4 * i + 1]
            out[i, lane] = (1 - f0) * first + f0 * last
            out[3 + i, lane] = (1 - f1) * first + f1 * last
            out[6 + i, lane] = out[9 + i, lane] = (last - first) / span
        v_ddot, h3 = 0.0, 0.0
        out[17:21, lane] = 0.0
    out[12, lane], out[13, lane], out[14, lane] = v_ddot, h3, dt
    out[15, lane], out[16, lane] = t0, t1


@njit(cache=True)
def _cuts(knot: Array, is_pose: bool, times: Array, room: Array) -> int:
    """Write the times at which an interval is cut; return the number of parts."""
    times[0] = knot[12]
    end, count = knot[13], 1
    times[1] = end
    at = 0
    while at < count:
        if count >= MAX_CUTS:
            break
        enclose(knot, is_pose, times[at], times[at + 1], room, 0)
        v0 = math.hypot(room[0, 0], room[1, 0]) + TURNING * abs(room[2, 0])
        v1 = math.hypot(room[3, 0], room[4, 0]) + TURNING * abs(room[5, 0])
        if max(v0, v1) <= REST or min(v0, v1) >= STEEP * max(v0, v1):
            at += 1
            continue
        for k in range(count, at, -1):
            times[k + 1] = times[k]
        times[at + 1] = (times[at] + times[at + 2]) / 2
        count += 1
    return count


@njit(cache=True)
def _count_parts(knots: Array, first_knot: Array, is_pose: Array) -> Array:
    count = np.zeros(is_pose.size, np.int64)
    times, room = np.empty(MAX_CUTS + 2), np.empty((FIELDS, LANES))
    for n in range(is_pose.size):
        for k in range(first_knot[n], first_knot[n + 1]):
            count[n] += _cuts(knots[k], is_pose[n], times, room)
    return count


@njit(cache=True)
def _fill_parts(
    knots: Array, first_knot: Array, is_pose: Array, first: Array, blocks: Array,
    knot_of: Array,
) -> None:  # fmt: skip
    times, room = np.empty(MAX_CUTS + 2), np.empty((FIELDS, LANES))
    for n in range(is_pose.size):
        at = first[n] * LANES
        for k in range(first_knot[n], first_knot[n + 1]):
            count = _cuts(knots[k], is_pose[n], times, room)
            for i in range(count):
                block, lane = at // LANES, at % LANES
                enclose(
                    knots[k], is_pose[n], times[i], times[i + 1], blocks[block], lane
                )
                knot_of[block, lane] = k
                at += 1
        while at < first[n + 1] * LANES:
            block, lane = at // LANES, at % LANES
            blocks[block, :, lane] = blocks[block, :, lane - 1]
            knot_of[block, lane] = knot_of[block, lane - 1]
            at += 1
