"""Functions of one interval, or of two around a knot or a stop, for a solver.

A radian counts 1/κ_g where it is compared with metres.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import casadi
import numpy as np
import numpy.typing as npt

from omniplan.optimising.cubics import Cubic, Rest, corners, twists_at
from omniplan.optimising.limits import (
    Functions,
    Number,
    Rules,
    Twist,
    speed_bounds,
    turn_angles,
)
from omniplan.optimising.setting import Setting
from omniplan.optimising.unknowns import GIVE, STATE, SWING, H

__all__ = [
    "apart_by_line",
    "calm_over",
    "jerk_over",
    "joint",
    "limits_over",
    "turns_at_stop",
]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
SYMBOLS = Functions(casadi.sin, casadi.cos, casadi.sqrt, casadi.atan2)

SLIP = 2e-3
"""Sideways slip of a line-mobile vehicle half-way between knots, m/s: what the splines
need between places without slip, and less than `validate` allows."""


def cubic_of(x0: Any, x1: Any) -> Cubic:
    """Return the interval between two knots."""
    entries = [[x[i] for i in range(STATE)] for x in (x0, x1)]
    (p0, v0), (p1, v1) = ((e[:3], e[3:6]) for e in entries)
    return Cubic(p0, p1, v0, v1, entries[0][H])


def joint() -> Any:
    """Return the jump of the second derivative at a knot, m/s, as a function."""
    x = [casadi.SX.sym(f"x{i}", STATE) for i in range(3)]
    _, before = cubic_of(x[0], x[1]).bends()
    after, _ = cubic_of(x[1], x[2]).bends()
    jump = [b - a * x[0][H] / x[1][H] for b, a in zip(before, after, strict=True)]
    return casadi.Function("joint", x, [casadi.vertcat(*jump)])


def limits_over(
    rules: Rules, setting: Setting, rest: Rest, sign: int
) -> tuple[Any, FloatArray, IntArray]:
    """Return the limits over one interval as a function, with their bounds.

    The last result tells which of the interval's unknowns gives way for each.
    """
    x0, x1 = (casadi.SX.sym(name, STATE) for name in ("x0", "x1"))
    cubic = cubic_of(x0, x1)
    shares = [0.0, 0.5]
    if rest == "end" or setting.has_swing:
        shares.append(1.0)
    values, least, states = [], [], []

    def add(value: Number, low: float, high: float, state: int = GIVE) -> None:
        if casadi.SX(value).is_constant():  # 0 at rest, whatever the motion
            return
        for side, bound in ((1, low), (-1, -high)):
            if np.isfinite(bound):
                values.append(side * value + x0[state])
                least.append(bound)
                states.append(state)

    for share in shares:
        pose, twist, direction = twists_at(cubic, share, rest, SYMBOLS)
        tightness = setting.tightness
        for bound in speed_bounds(rules, twist, direction, sign, SYMBOLS, tightness):
            if bound.is_swing and not setting.has_swing:
                continue  # near rest too steep to be told from the beginning
            state = SWING if bound.is_swing else GIVE
            add(bound.value, bound.least, bound.largest, state)
        is_knot = share != 0.5
        if share == 1.0 and rest != "end":
            continue
        for slip, moving in _slips(rules, direction, twist):
            add(*((slip, 0.0, 0.0) if is_knot else (moving, -SLIP, SLIP)))
        if setting.bounds is not None:
            x_min, y_min, x_max, y_max = setting.bounds
            for part in setting.body:
                for corner in corners(pose, part, SYMBOLS):
                    add(corner.x, x_min, x_max)
                    add(corner.y, y_min, y_max)
    look = casadi.Function("look", [x0, x1], [casadi.vertcat(casadi.SX(0, 1), *values)])
    return look, np.array(least), np.array(states, dtype=np.int64)


def turns_at_stop(rules: Rules, sign: int) -> Any | None:
    """Return the signed times that wheels need to turn at a stop, as a function."""
    x = [casadi.SX.sym(f"x{i}", STATE) for i in range(4)]
    _, _, before = twists_at(cubic_of(x[0], x[1]), 1.0, "end", SYMBOLS)
    _, _, after = twists_at(cubic_of(x[2], x[3]), 0.0, "start", SYMBOLS)
    times = [
        angle / rate for angle, rate in turn_angles(rules, before, after, sign, SYMBOLS)
    ]
    if not times:
        return None
    return casadi.Function("turns", x, [casadi.vertcat(*times)])


def apart_by_line(arms: Sequence[complex], corner_count: int) -> Any:
    """Return by how much a line keeps both sides apart, m, as a function."""
    x0, x1 = (casadi.SX.sym(name, STATE) for name in ("x0", "x1"))
    line = casadi.SX.sym("line", 2)
    part = casadi.SX.sym("part", 2 * corner_count)
    room = casadi.SX.sym("room")
    nx, ny = casadi.cos(line[0]), casadi.sin(line[0])
    cubic = cubic_of(x0, x1)
    apart = [
        line[1] - nx * part[2 * i] - ny * part[2 * i + 1] for i in range(corner_count)
    ]
    for share in (0.0, 0.5, 1.0):
        pose = cubic.at(share)[0]
        apart += [
            nx * corner.x + ny * corner.y - line[1] - room + x0[GIVE]
            for corner in corners(pose, arms, SYMBOLS)
        ]
    inputs = [x0, x1, line, part, room]
    return casadi.Function("apart", inputs, [casadi.vertcat(*apart)])


def jerk_over(kappa_g: float) -> Any:
    """Return the integral of the squared jerk over an interval, m²/s⁵."""
    x0, x1 = (casadi.SX.sym(name, STATE) for name in ("x0", "x1"))
    jerk = cubic_of(x0, x1).at(0.0)[3]
    square = jerk[0] ** 2 + jerk[1] ** 2 + (jerk[2] / kappa_g) ** 2
    return casadi.Function("jerk", [x0, x1], [square * x0[H]])


def calm_over(kappa_g: float) -> Any:
    """Return the integral of the squared acceleration over an interval, m²/s³."""
    x0, x1 = (casadi.SX.sym(name, STATE) for name in ("x0", "x1"))
    total = 0.0
    arms = (1.0, 1.0, 1 / kappa_g)
    for a0, a1, arm in zip(*cubic_of(x0, x1).bends(), arms, strict=True):
        total += (a0 * a0 + a0 * a1 + a1 * a1) / 3 * arm**2 / x0[H]
    return casadi.Function("calm", [x0, x1], [total])


def _slips(rules: Rules, direction: Twist, twist: Twist) -> list[tuple[Number, Number]]:
    """Return what a vehicle cannot do: of its direction, and of its twist, m/s."""
    found = []
    if rules.line is not None:
        back = complex(math.cos(rules.line), -math.sin(rules.line))
        found.append(tuple(t.v[0].turned(back).y for t in (direction, twist)))
    if rules.is_translating:
        found.append(tuple(t.omega[0] / rules.kappa_g for t in (direction, twist)))
    return found
