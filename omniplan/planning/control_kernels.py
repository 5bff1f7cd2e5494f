"""Driving with rates of (κ_n, β) and a speed as controls: many controls at once.

Each control is a share of what the vehicle offers: of the change rates at the
configuration it is in, and of v_max there. The way is cut into steps; in each the rates
are constant, and K moves along arcs of the configurations it passes. The rates
rise from nothing and fall to nothing along the way, so that no wheel has to start
turning at once where one control follows another.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from omniplan.sampling.kernels import is_piece_permitted

__all__ = ["LEVELS", "MARGIN", "STEPS", "arcs_of_step", "drive"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

LEVELS = (0.25, 0.5, 1.0)
"""Shares of v_max that are driven: the slower, the more change is available."""
STEPS = 16
"""Steps of one control."""
MARGIN = 5e-3
"""Distance kept from what is blocked, in κ_n and rad: a spline through the poses leaves
the configurations by less."""
_TWO_PI = 2 * math.pi


@njit(cache=True)
def drive(
    table: Array,
    load: Array,
    kappa_dot: Array,
    beta_dot: Array,
    is_line: bool,
    is_straight: bool,
    kappa_g: float,
    fine: float,
    start: Array,
    controls: Array,
    states: Array,
    ends: Array,
) -> None:
    """Drive every control from one state; those that are not permitted end early.

    Parameters
    ----------
    table : (n,) float
        Of `omniplan.sampling.intervals.PermittedIntervals`.
    load : (d, k + 1, m + 1) float, (m/s)⁻²
        Of the space.
    kappa_dot, beta_dot : (l, k', m') float, 1/s and rad/s
        Change rates per level of speed.
    is_line : bool
        Whether β is constant.
    is_straight : bool
        Whether κ_n is 0 at all times.
    kappa_g : float, 1/m
    fine : float, 1 and rad
        As of `arcs_of_step`.
    start : (5,) float
        x, y, θ, κ_n, β: m, m, rad, 1, rad.
    controls : (j, 4) float
        Shares of the rates of κ_n and of β, |a| + |b| ≤ 1; the level of speed with the
        sign of v_s, ±1 to ±3; the way ∫|v_s| dt, m.
    states : (j, STEPS + 1, 5) float
        Written.
    ends : (j, 2) float
        Written: the time, s, negative if not permitted, and the last step reached.
    """
    for j in range(len(controls)):
        states[j, 0] = start
        ends[j] = _drive_one(
            table,
            load,
            kappa_dot,
            beta_dot,
            is_line,
            is_straight,
            kappa_g,
            fine,
            controls[j],
            states[j],
        )


@njit(cache=True)
def _drive_one(
    table: Array,
    load: Array,
    kappa_dot: Array,
    beta_dot: Array,
    is_line: bool,
    is_straight: bool,
    kappa_g: float,
    fine: float,
    control: Array,
    states: Array,
) -> tuple[float, float]:
    sign = 1.0 if control[2] > 0 else -1.0
    level = int(abs(control[2])) - 1
    reverse = 1 if sign < 0 and len(load) > 1 else 0
    step = control[3] / STEPS
    time = 0.0
    for i in range(STEPS):
        kappa, beta = states[i, 3], states[i, 4]
        speed = _v_max(load[reverse], kappa, beta) * LEVELS[level]
        duration = step / speed
        time += duration
        row, column = _cell(kappa_dot.shape[1], kappa_dot.shape[2], kappa, beta)
        along = (i + 0.5) / STEPS
        duration *= 4 * along * (1 - along)
        change = control[0] * kappa_dot[level, row, column] * duration
        kappa_1 = kappa if is_straight else min(2.0, max(-2.0, kappa + change))
        beta_1 = beta
        if not is_line:
            beta_1 += control[1] * beta_dot[level, row, column] * duration
        if not _is_step_permitted(
            table, is_line, is_straight, kappa, kappa_1, beta, beta_1
        ):
            return -1.0, float(i)
        states[i + 1, 3], states[i + 1, 4] = kappa_1, beta_1
        _move(states, i, sign * step, kappa_g, fine)
    return time, float(STEPS)


@njit(cache=True)
def _is_step_permitted(
    table: Array, is_line: bool, is_straight: bool, kappa_0: float, kappa_1: float,
    beta_0: float, beta_1: float,
) -> bool:  # fmt: skip
    """Return whether the configurations around a step are permitted, on both edges."""
    if is_straight:
        first, turn = min(beta_0, beta_1), abs(beta_1 - beta_0)
        return bool(is_piece_permitted(table, 0.0, first - MARGIN, turn + 2 * MARGIN))
    low, high = min(kappa_0, kappa_1) - MARGIN, max(kappa_0, kappa_1) + MARGIN
    low, high = max(low, -2.0), min(high, 2.0)
    first, turn = min(beta_0, beta_1), abs(beta_1 - beta_0)
    if not is_line:
        first, turn = first - MARGIN, turn + 2 * MARGIN
    if not is_piece_permitted(table, low, first, turn):
        return False
    return bool(is_piece_permitted(table, high, first, turn))


@njit(cache=True)
def arcs_of_step(
    kappa_change: float, beta_change: float, way: float, kappa_g: float, fine: float
) -> int:
    """Return of how many arcs a step is, so that none changes more than `fine`."""
    change = max(abs(kappa_change), abs(beta_change), abs(way) * kappa_g)
    return max(1, math.ceil(change / fine))


@njit(cache=True)
def _move(states: Array, i: int, way: float, kappa_g: float, fine: float) -> None:
    """Write the pose after a step in which the configuration changes evenly."""
    kappa, beta = states[i, 3], states[i, 4]
    kappa_change, beta_change = states[i + 1, 3] - kappa, states[i + 1, 4] - beta
    count = arcs_of_step(kappa_change, beta_change, way, kappa_g, fine)
    x, y, theta = states[i, 0], states[i, 1], states[i, 2]
    for n in range(count):
        u = (n + 0.5) / count
        k = kappa + u * kappa_change
        c, s = min(1.0, 2.0 - abs(k)), min(1.0, max(-1.0, k))
        turn = way / count * s * kappa_g
        half = 0.5 * turn
        chord = way / count * c * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
        course = theta + beta + u * beta_change + half
        x += chord * math.cos(course)
        y += chord * math.sin(course)
        theta += turn
    states[i + 1, 0], states[i + 1, 1], states[i + 1, 2] = x, y, theta


@njit(cache=True)
def _cell(rows: int, columns: int, kappa: float, beta: float) -> tuple[int, int]:
    """Row and column of the cell that holds a configuration."""
    row = min(int((kappa + 2.0) * (rows / 4.0)), rows - 1)
    turned = (beta + math.pi) % _TWO_PI
    return row, min(int(turned * (columns / _TWO_PI)), columns - 1)


@njit(cache=True)
def _v_max(load: Array, kappa: float, beta: float) -> float:
    """Speed by the nodes around a configuration, the slowest of them."""
    row, column = _cell(load.shape[0] - 1, load.shape[1] - 1, kappa, beta)
    worst = np.float64(0.0)
    for i in (row, row + 1):
        for j in (column, column + 1):
            worst = max(worst, np.float64(load[i, j]))
    return 1.0 / math.sqrt(worst)
