"""How fast a vehicle can be at all: what no solver has to be asked about."""

from __future__ import annotations

import cmath
import math

import numpy as np
import numpy.typing as npt
from scipy.optimize import linprog

from omniplan.optimising.limits import Rules
from omniplan.timing.rows import RowKind

__all__ = ["least_duration", "top_rates"]

FloatArray = npt.NDArray[np.float64]

DIRECTIONS = 16
"""Sides of the polygon around a disc of velocities."""


def top_rates(rules: Rules) -> tuple[float, float]:
    """Return a speed of K, m/s, and a yaw rate, rad/s, that no motion exceeds.

    Wheel speeds bound the twist (v, ω) linearly: ``Re((v + jω b) n̄) ≤ bound``, a disc
    by the polygon around it. The maxima are those of linear programs; infinite if
    nothing bounds them.
    """
    rows, bounds = [], []
    for row in rules.rows:
        arm = rules.arm(row.point)
        if row.kind is RowKind.SIZE:
            turns = [cmath.exp(-1j * angle) for angle in _angles()]
        elif row.kind is RowKind.COMPONENT:
            turns = [row.turn, -row.turn]
        elif row.kind is RowKind.YAW:
            rows += [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]
            bounds += [row.bound] * 2
            continue
        else:
            continue
        for turn in turns:
            spin = 1j * arm * turn
            rows.append([turn.real, -turn.imag, spin.real])
            bounds.append(row.bound)
    if not rows:
        return math.inf, math.inf
    table, most = np.array(rows), np.array(bounds)
    ahead = [[math.cos(angle), math.sin(angle), 0.0] for angle in _angles()]
    speed = max(_largest(np.array(each), table, most) for each in ahead)
    yaw = _largest(np.array([0.0, 0.0, 1.0]), table, most)
    return speed / math.cos(math.pi / DIRECTIONS), yaw


def least_duration(rules: Rules, poses: FloatArray) -> float:
    """Return a time, s, in which no motion leads from the first pose to the last.

    Parameters
    ----------
    rules : Rules
    poses : (n, 3) float, m, m, rad
        Of K.
    """
    speed, yaw = top_rates(rules)
    way = poses[-1] - poses[0]
    return max(math.hypot(way[0], way[1]) / speed, abs(float(way[2])) / yaw)


def _angles() -> list[float]:
    return [2 * math.pi * k / DIRECTIONS for k in range(DIRECTIONS)]


def _largest(along: FloatArray, rows: FloatArray, bounds: FloatArray) -> float:
    found = linprog(-along, A_ub=rows, b_ub=bounds, bounds=(None, None))
    return math.inf if found.fun is None else -float(found.fun)
