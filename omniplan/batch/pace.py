"""The time along a way from rest to rest, in numba: `standing.turn_time`."""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from omniplan.batch.kinds import AT, BOUND, KIND, SWING
from omniplan.standing.turn_time import FASTEST, JUMP

__all__ = ["pace_time", "rest_to_rest"]

Array = Any  # numba infers the types; mypy cannot look into the kernels


@njit(cache=True, _nrt=True)
def rest_to_rest(turn: float, rate: float, acceleration: float) -> float:
    """Return the time one wheel needs to turn on its own, s; see `turn_time`."""
    if math.isinf(acceleration):
        return turn / rate
    peaked = 2 * math.sqrt(turn / acceleration)
    if math.isinf(rate) or turn < rate * rate / acceleration:
        return peaked
    return turn / rate + rate / acceleration


@njit(cache=True, error_model="numpy", _nrt=True)
def _turning(
    knot: Array, t0: float, t1: float, x: float, y: float
) -> tuple[float, float, float, float]:
    """Return α̇ of a wheel at both ends of a part, and bounds on |α̇| and |α̈|.

    As `directions_of_legs` and `Directions` have them; infinite where not known.

    Parameters
    ----------
    knot : (KNOT,) float
        Of own Omni-Curve-Parameters.
    t0, t1 : float, s
    x, y : float, m
    """
    kappa_g, px, py = knot[8], x - knot[9], y - knot[10]
    gentle, side, turn = knot[6] > 0.0, knot[7], knot[3]
    c1, s1 = (0.0, knot[1]) if gentle else (-side * knot[1], 0.0)
    at = np.empty((2, 6))
    widest = 0.0
    for end in range(2):
        h = (t0 if end == 0 else t1) - knot[12]
        kappa_n, beta = knot[0] + h * knot[1], knot[2] + h * turn
        c, s = (1.0, kappa_n) if gentle else (2.0 - abs(kappa_n), side)
        e, f = math.cos(beta), math.sin(beta)
        w, a = kappa_g * s, kappa_g * s1
        at[end, 0], at[end, 1] = c * e - w * py, c * f + w * px
        at[end, 2] = c1 * e - turn * c * f - a * py
        at[end, 3] = c1 * f + turn * c * e + a * px
        along, across = -turn * turn * c, 2 * turn * c1
        at[end, 4], at[end, 5] = along * e - across * f, along * f + across * e
        widest = max(widest, abs(c))
    b, slope, dt = abs(turn), abs(c1), t1 - t0
    reach = math.hypot(knot[9], knot[10]) + math.hypot(x, y)
    m1 = slope + b * widest + kappa_g * abs(s1) * reach
    m2, m3 = 2 * b * slope + b**2 * widest, 3 * b**2 * slope + b**3 * widest
    m4 = 4 * b**3 * slope + b**4 * widest
    # Near the centre of rotation the ends tell more.
    ends1 = max(math.hypot(at[0, 2], at[0, 3]), math.hypot(at[1, 2], at[1, 3]))
    ends2 = max(math.hypot(at[0, 4], at[0, 5]), math.hypot(at[1, 4], at[1, 5]))
    m1, m2 = min(m1, ends1 + dt * dt / 8 * m3), min(m2, ends2 + dt * dt / 8 * m4)
    dx, dy = at[1, 0] - at[0, 0], at[1, 1] - at[0, 1]
    length = dx * dx + dy * dy
    share = -(at[0, 0] * dx + at[0, 1] * dy) / (length if length > 0.0 else 1.0)
    share = min(max(share, 0.0), 1.0)
    largest = max(math.hypot(at[0, 0], at[0, 1]), math.hypot(at[1, 0], at[1, 1]))
    near = math.hypot(at[0, 0] + share * dx, at[0, 1] + share * dy)
    near -= dt * dt / 8 * m2 + 1e-14 * largest
    if not near > 0.0:
        return 0.0, 0.0, math.inf, math.inf
    l1, l2, l3, l4 = m1 / near, m2 / near, m3 / near, m4 / near
    third = l3 + 3 * l1 * l2 + 2 * l1**3
    fourth = l4 + 4 * l1 * l3 + 3 * l2**2 + 12 * l1**2 * l2 + 6 * l1**4
    bent, r0, r1 = 0.0, 0.0, 0.0
    for end in range(2):
        p0, q0, p1, q1, p2, q2 = at[end]
        square = p0 * p0 + q0 * q0
        across, along = (q1 * p0 - p1 * q0) / square, (p1 * p0 + q1 * q0) / square
        bent = max(bent, abs((q2 * p0 - p2 * q0) / square - 2 * across * along))
        if end == 0:
            r0 = across
        else:
            r1 = across
    if not fourth < math.inf:
        return r0, r1, math.inf, math.inf
    bent += min(dt / 2 * third, dt * dt / 8 * fourth)
    rate = max(abs(r0), abs(r1)) + min(dt / 2 * bent, dt * dt / 8 * third)
    return r0, r1, rate, bent


@njit(cache=True, error_model="numpy", _nrt=True)
def _reached(steep: Array, bend: Array, k: int, x: float) -> float:
    """Return ṡ² that can be reached across part k from x, or braked from to x."""
    least = math.inf
    for w in range(steep.shape[1]):
        asked = max(steep[k, w] + bend[k, w], 1 / FASTEST)
        least = min(least, (1 + steep[k, w] * x) / asked)
    return least


@njit(cache=True, error_model="numpy", _nrt=True)
def pace_time(
    knots: Array, knot_of: Array, parts: Array, rows: Array, vehicle: Array,
    share: Array, ds: Array, pieces: int,
) -> float:  # fmt: skip
    """Return the time that a way takes from rest to rest, s, as `time_of` has it.

    Parameters
    ----------
    knots : (..., KNOT) float
    knot_of : (n,) int
    parts : (n, 3) float
        Start and end of the parts that are proved.
    rows : (r, PARAMETERS) float
        Of which those of steering accelerations count.
    vehicle : (BODY,) float
    share : (n pieces,) float
        The used share of all limits on steering rates, per ṡ.
    ds : (n pieces,) float
        Length of the pieces.
    pieces : int
        Per part.
    """
    wheels, total = 0, 0.0
    for r in range(rows.shape[0]):
        wheels += rows[r, KIND] == SWING
    m = ds.size
    for k in range(m):
        if not share[k] < math.inf:
            return math.inf
        total += share[k] * ds[k]
    if wheels == 0:
        return total
    ends = np.empty((m, wheels, 2))
    steep, bend = np.empty((m, wheels)), np.empty((m, wheels))
    cap = np.empty(m)
    for k in range(m):
        part, knot = parts[k // pieces], knots[knot_of[k // pieces]]
        t0 = part[0] + (k % pieces) * ds[k]
        w, bent = 0, 0.0
        for r in range(rows.shape[0]):
            if rows[r, KIND] != SWING:
                continue
            most = rows[r, BOUND]
            r0, r1, rate, swing = _turning(
                knot, t0, t0 + ds[k], rows[r, AT], rows[r, AT + 1]
            )
            if not swing < math.inf:
                return math.inf
            ends[k, w, 0], ends[k, w, 1] = r0 / most, r1 / most
            steep[k, w], bend[k, w] = rate / most / (2 * ds[k]), swing / most
            bent = max(bent, bend[k, w])
            w += 1
        cap[k] = min(min(1 / share[k] ** 2, 1 / bent), FASTEST)
    jumps, largest = np.zeros(m), 0.0
    for k in range(1, m):
        for w in range(wheels):
            before, after = ends[k - 1, w, 1], ends[k, w, 0]
            jumps[k] = max(jumps[k], abs(after - before))
            largest = max(largest, max(abs(before), abs(after)))
    x = np.zeros(m + 1)
    for k in range(1, m):  # the wheels rest where α' jumps
        x[k] = 0.0 if jumps[k] > JUMP * largest else min(cap[k - 1], cap[k])
    for k in range(m - 1, -1, -1):
        x[k] = min(x[k], _reached(steep, bend, k, x[k + 1]))
    for k in range(m):
        x[k + 1] = min(x[k + 1], _reached(steep, bend, k, x[k]))
    total = 0.0
    for k in range(m):
        total += 2 * ds[k] / (math.sqrt(x[k]) + math.sqrt(x[k + 1]))
    return total
