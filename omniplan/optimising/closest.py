"""The closest way that wheels can follow, as a problem for a solver, without times.

Unknowns are poses and body twists at the knots of a way, one unit of an invented time
apart; between knots twists are linear in it. Wheel velocities are linear in twists, so
a steering range of less than half a turn to each side is two linear inequalities, and
what holds at the knots holds between them. Only the poses' integrals are not linear.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
import numpy.typing as npt

from omniplan.optimising.half_planes import Side
from omniplan.optimising.limits import Rules

__all__ = ["Aim", "Way", "closest"]

FloatArray = npt.NDArray[np.float64]

EVEN = (0.7, 1.4)
"""Least and largest twist, over the usual one: a way that stands is two."""
ITERATIONS = 150
KEPT = 1e-5
"""Equations and limits are kept as well as this, scaled."""
TINY = 1e-9


@dataclass(frozen=True, eq=False)
class Way:
    """Knots of a way."""

    poses: FloatArray
    """(n + 1, 3) m, m, rad, of K."""
    twists: FloatArray
    """(n + 1, 3) of K, in the body frame: m, m, rad per interval."""


@dataclass(frozen=True, eq=False)
class Aim:
    """Where the knots of a way are to be, and what they must keep."""

    poses: FloatArray
    """(n + 1, 3) m, m, rad."""
    ahead: FloatArray
    """(n + 1, 3) unit vectors along the way there, a radian counting 1/κ_g; or zero."""
    along: float
    """Weight of a change along the way given against one across it: it is measured to
    the nearest place of that way, which moves along."""
    shares: FloatArray
    """(n + 1,) weights, 1 in all."""
    scale: float
    """The usual change, m."""
    keeps: tuple[bool, bool]
    """Whether start and goal stay."""
    sign: int
    """The representation: the sign of v_s."""
    spare: float
    """What steering angles keep from the ends of their ranges, rad."""
    calm: float
    """Weight of changes of the twist from knot to knot, and of changes of these, which
    splines through the poses exaggerate; over the usual twist."""
    sides: Sequence[Side] = ()


def closest(way: Way, aim: Aim, rules: Rules, time: float) -> Way | None:
    """Return the way closest to what is aimed at, None if the solver finds none.

    Parameters
    ----------
    way : Way
        Where to start; it need not keep anything but its ends.
    aim : Aim
    rules : Rules
    time : float, s
        For the solver.
    """
    n = len(way.poses) - 1
    poses, twists = casadi.SX.sym("p", 3, n + 1), casadi.SX.sym("u", 3, n + 1)
    arm = 1 / rules.kappa_g
    usual = np.linalg.norm(way.twists * [1.0, 1.0, arm], axis=1).mean()
    equations = _equations(poses, twists, rules, arm)
    weights = casadi.DM([[1.0, 1.0, arm**2]]) / usual**2
    size = casadi.mtimes(weights, twists**2)
    limits = [
        size - EVEN[0] ** 2,
        EVEN[1] ** 2 - size,
        *(limit / usual for limit in _wheels(twists, rules, aim)),
        *_free(poses, aim.sides),
    ]
    found = _solved(
        casadi.vertcat(casadi.vec(poses), casadi.vec(twists)),
        _cost(poses, twists, aim, arm, usual),
        casadi.vertcat(*equations),
        casadi.vertcat(*(casadi.vec(limit) for limit in limits)),
        np.concatenate([way.poses.ravel(), way.twists.ravel()]),
        _ends(way, aim),
        time,
    )
    if found is None:
        return None
    table = found.reshape(2, n + 1, 3)
    return Way(table[0].copy(), table[1].copy())


def _cost(poses: Any, twists: Any, aim: Aim, arm: float, usual: float) -> Any:
    """Return the mean square of the change, and of how the twist changes."""
    scale = np.array([1.0, 1.0, arm])
    off = casadi.mtimes(casadi.DM(np.diag(scale)), poses - casadi.DM(aim.poses.T))
    slid = casadi.sum1(off * casadi.DM(aim.ahead.T))
    square = casadi.sum1(off**2) - (1 - aim.along) * slid**2
    change = casadi.dot(square, casadi.DM(aim.shares).T) / aim.scale**2
    steps = casadi.mtimes(
        casadi.DM(np.diag(scale / usual)), twists[:, 1:] - twists[:, :-1]
    )
    bends = steps[:, 1:] - steps[:, :-1]
    return change + aim.calm * (casadi.sumsqr(steps) + casadi.sumsqr(bends))


def _equations(poses: Any, twists: Any, rules: Rules, arm: float) -> list[Any]:
    """Return what is zero: the twists lead from pose to pose, and no wheel slips.

    Simpson's rule; the heading is a parabola between the knots.
    """
    early, late = twists[:, :-1], twists[:, 1:]
    middle = (early + late) / 2
    start, end = poses[2, :-1], poses[2, 1:]
    between = start + (3 * early[2, :] + late[2, :]) / 8
    gone: list[Any] = [0.0, 0.0]
    for heading, u, weight in ((start, early, 1), (between, middle, 4), (end, late, 1)):
        s, c = casadi.sin(heading), casadi.cos(heading)
        gone[0] += weight / 6 * (c * u[0, :] - s * u[1, :])
        gone[1] += weight / 6 * (s * u[0, :] + c * u[1, :])
    found = [
        casadi.vec(poses[0, 1:] - poses[0, :-1] - gone[0]),
        casadi.vec(poses[1, 1:] - poses[1, :-1] - gone[1]),
        casadi.vec(end - start - middle[2, :]) * arm,
    ]
    if rules.line is not None:
        aside = (
            math.cos(rules.line) * twists[1, :] - math.sin(rules.line) * twists[0, :]
        )
        found.append(casadi.vec(aside))
    if rules.is_translating:
        found.append(casadi.vec(twists[2, :]) * arm)
    return found


def _wheels(twists: Any, rules: Rules, aim: Aim) -> list[Any]:
    """Return what is not negative where wheels keep their steering ranges, m."""
    found = []
    if rules.line is not None:
        c, s = math.cos(rules.line), math.sin(rules.line)
        found.append(aim.sign * (c * twists[0, :] + s * twists[1, :]))
    for sector in rules.sectors:
        if not math.isfinite(sector.half):
            continue
        at = sector.b / (1j * rules.kappa_g)
        x = twists[0, :] - at.imag * twists[2, :]
        y = twists[1, :] + at.real * twists[2, :]
        c, s = math.cos(sector.middle), math.sin(sector.middle)
        ahead, aside = aim.sign * (c * x + s * y), aim.sign * (c * y - s * x)
        half = max(sector.half - aim.spare, sector.half / 2)
        if half < math.pi / 2:
            sine, cosine = math.sin(half), math.cos(half)
            found += [sine * ahead - cosine * aside, sine * ahead + cosine * aside]
        else:
            size = casadi.sqrt(x * x + y * y + TINY)
            found.append(ahead - math.cos(half) * size)
    return found


def _free(poses: Any, sides: Sequence[Side]) -> list[Any]:
    """Return by how much corners of the body are within their half-planes, m."""
    found = []
    for side in sides:
        pose = poses[:, side.step]
        for corner in side.arms.tolist():
            turned = corner * side.normal.conjugate()
            along = side.normal.real * pose[0] + side.normal.imag * pose[1]
            reach = turned.real * casadi.cos(pose[2]) - turned.imag * casadi.sin(
                pose[2]
            )
            found.append(along + reach - side.least)
    return found


def _ends(way: Way, aim: Aim) -> tuple[FloatArray, FloatArray]:
    """Return the ranges of the unknowns: the ends that stay."""
    low = np.full((2, *way.poses.shape), -np.inf)
    for row, stays in zip((0, -1), aim.keeps, strict=True):
        if stays:
            low[0, row] = way.poses[row]
    return low.ravel(), np.where(np.isfinite(low), low, np.inf).ravel()


def _solved(
    x: Any,
    cost: Any,
    equations: Any,
    limits: Any,
    start: FloatArray,
    ranges: tuple[FloatArray, FloatArray],
    time: float,
) -> FloatArray | None:
    """Return the solver's optimum, None where it does not keep what it must."""
    problem = {"x": x, "f": cost, "g": casadi.vertcat(equations, limits)}
    options: dict[str, Any] = {
        "print_time": False,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "ipopt.max_iter": ITERATIONS,
        "ipopt.max_wall_time": max(time, 1e-3),
        "ipopt.tol": 1e-6,
        "ipopt.acceptable_tol": 1e-4,
        "ipopt.acceptable_iter": 5,
        "ipopt.mu_init": 1e-3,
        "ipopt.nlp_scaling_method": "none",
    }
    solver = casadi.nlpsol("closest", "ipopt", problem, options)
    count = equations.numel()
    room = np.full(limits.numel(), np.inf)
    found = solver(
        x0=start,
        lbx=ranges[0],
        ubx=ranges[1],
        lbg=np.zeros(count + room.size),
        ubg=np.concatenate([np.zeros(count), room]),
    )
    at, g = np.asarray(found["x"]).ravel(), np.asarray(found["g"]).ravel()
    if not (np.isfinite(at).all() and np.isfinite(g).all()):
        return None
    lack = max(np.abs(g[:count]).max(), -g[count:].min(initial=0.0))
    return at if lack < KEPT else None
