"""Time that turning the wheels takes at a standstill, with limits on how it swings.

Along a leg with parameter s, with ``x = ṡ²``, a limit on |α̇| is one on x, and as

    α̈ = α' dx/ds / 2 + α'' x

a limit a on |α̈| is kept if ``|α'| |dx/ds| / 2 + |α''| x ≤ a``. Both sweeps of the
classic time-optimal timing are made with x linear between the ends of the parts and
with what |α'| and |α''| are at most on each; so every part keeps every limit all along
it, and the time is never too short. The wheels rest at both ends of a leg and wherever
α' jumps at a corner of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

__all__ = ["Turning", "paces_of", "rest_to_rest", "time_of"]

FloatArray = npt.NDArray[np.float64]

FASTEST = 1e30
"""Bound on ṡ² where no wheel turns, so that all stays finite."""
JUMP = 1e-9
"""A relative jump of α' below this is rounding."""


@dataclass(frozen=True, eq=False)
class Turning:
    """What turning along m parts of a leg asks of n wheels that swing within limits."""

    ds: FloatArray
    """(m,) length of the parts."""
    share: FloatArray
    """(m,) at most: the used share of all limits on steering rates, per ṡ."""
    ends: FloatArray
    """(2, m, n) α' at both ends, over the largest |α̈|."""
    slope: FloatArray
    """(m, n) |α'| at most, over the largest |α̈|."""
    bend: FloatArray
    """(m, n) |α''| at most, over the largest |α̈|."""


def time_of(leg: Turning) -> float:
    """Return the time that a leg takes from rest to rest, s.

    Parameters
    ----------
    leg : Turning

    Returns
    -------
    float
        0 if no wheel turns; infinite if a wheel passes its singular point.
    """
    known = np.isfinite(leg.share) & np.isfinite(leg.bend).all(axis=1)
    if not known.all():
        return math.inf
    if leg.slope.shape[1] == 0:
        return float(leg.share @ leg.ds)
    pace = np.sqrt(paces_of(leg))
    return float(np.sum(2 * leg.ds / (pace[1:] + pace[:-1])))


def paces_of(leg: Turning) -> FloatArray:
    """Return ṡ² at the ends of all parts, (m + 1,), between which it is linear.

    Parameters
    ----------
    leg : Turning
        Finite, with at least one wheel.
    """
    with np.errstate(divide="ignore"):
        cap = np.minimum(1 / leg.share**2, 1 / leg.bend.max(axis=1))
    cap = np.minimum(cap, FASTEST)
    x = np.minimum(np.append(cap, cap[-1]), np.insert(cap, 0, cap[0]))
    x[[0, -1]] = 0.0
    x[1:-1][_jumps(leg)] = 0.0
    for k in range(cap.size - 1, -1, -1):
        x[k] = min(x[k], _reached(leg, k, x[k + 1]))
    for k in range(cap.size):
        x[k + 1] = min(x[k + 1], _reached(leg, k, x[k]))
    return np.asarray(x)


def _jumps(leg: Turning) -> npt.NDArray[np.bool_]:
    """Return at which of the inner ends of parts some α' jumps, (m - 1,)."""
    before, after = leg.ends[1, :-1], leg.ends[0, 1:]
    size = np.maximum(np.abs(before), np.abs(after))
    return np.asarray((np.abs(after - before) > JUMP * size.max()).any(axis=1))


def _reached(leg: Turning, k: int, x: float) -> float:
    """Return ṡ² that can be reached across part k from x, or braked from to x."""
    steep = leg.slope[k] / (2 * leg.ds[k])
    asked = np.maximum(steep + leg.bend[k], 1 / FASTEST)
    return float(((1 + steep * x) / asked).min())


def rest_to_rest(turn: FloatArray, rate: float, acceleration: float) -> FloatArray:
    """Return the time one wheel needs to turn on its own, s.

    Parameters
    ----------
    turn : (...) float, rad, >= 0
    rate : float, rad/s, > 0
        Largest; may be infinite.
    acceleration : float, rad/s², > 0
        Largest; may be infinite.
    """
    if math.isinf(acceleration):
        return turn / rate
    if math.isinf(rate):
        return 2 * np.sqrt(turn / acceleration)
    ramped = turn / rate + rate / acceleration
    peaked = 2 * np.sqrt(turn / acceleration)
    return np.where(turn >= rate**2 / acceleration, ramped, peaked)
