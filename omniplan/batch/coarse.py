"""Eight parts of a motion at once, roughly: which rows are worth a closer look where.

Over a group of parts every velocity lies in a box and a ball, and so does its change.
That bounds each row from above, for sixteen groups in one go. Where the bound is below
what some row reaches anyhow, the parts of the group need not be evaluated.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from omniplan.batch import kinds
from omniplan.batch.kernel import kernel
from omniplan.batch.motions import LANES, Motions
from omniplan.batch.steering import arc_cosine

__all__ = ["GROUP", "groups_of", "screen"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

GROUP = 8
"""Parts per group; half a block."""
PER_BLOCK = LANES // GROUP
# Of v: the middle (vx, vy, ω), how far each is off it, how far v is off it; the same
# of the change of v.
MIDDLE, OFF, RADIUS, CHANGE, CHANGE_OFF, CHANGE_RADIUS = 0, 3, 6, 7, 10, 13
FIELDS = 14
# Of a point: velocity (2), its size, how far it is off; the same of its change; and
# bounds on the speed of the vehicle.
UX, UY, UN, UR, DX, DY, DN, DR, SLOW, FAST = range(10)
SCRATCH = 10
ROUNDING = 1e-9
"""By so much, relative, all bounds are wider: it covers float64 arithmetic."""
ANGLE_ROUNDING = 1e-6
"""Rad; it covers the quick arc cosine."""
ROOT = math.sqrt(2.0)


def groups_of(motions: Motions) -> tuple[npt.NDArray[np.float64], Array]:
    """Return the groups of all motions, and where those of each begin.

    Parameters
    ----------
    motions : Motions

    Returns
    -------
    groups : (c, FIELDS, LANES) float
        The last group of a motion fills its last row.
    first : (n + 1,) int
    """
    blocks = np.diff(motions.first)
    first = np.concatenate([[0], np.cumsum(-(-blocks * PER_BLOCK // LANES))])
    groups = np.empty((int(first[-1]), FIELDS, LANES))
    _fill_groups(motions.blocks, motions.first, first, groups)
    return groups, first


@njit(cache=True)
def _fill_groups(blocks: Array, first: Array, first_group: Array, out: Array) -> None:
    for n in range(first.size - 1):
        last = PER_BLOCK * (first[n + 1] - first[n]) - 1
        for g in range(LANES * (first_group[n + 1] - first_group[n])):
            at = min(g, last)
            lane = at % PER_BLOCK * GROUP
            part = blocks[first[n] + at // PER_BLOCK, :, lane : lane + GROUP]
            into = out[first_group[n] + g // LANES]
            _enclose(part, 0, 0.125, 2, into, MIDDLE, g % LANES)
            _enclose(part, 6, 0.5, 1, into, CHANGE, g % LANES)


@kernel()
def _enclose(
    part: Array, field: int, share: float, power: int, out: Array, into: int, lane: int
) -> None:
    """Box and ball around the values at the ends, and what lies between them."""
    bend, turn = 0.0, 0.0
    for k in range(GROUP):
        step = share * part[14, k] ** power
        bend, turn = max(bend, step * part[12, k]), max(turn, step * part[13, k])
    for i in range(3):
        least, most = np.inf, -np.inf
        for k in range(GROUP):
            a, b = part[field + i, k], part[field + 3 + i, k]
            least, most = min(least, a, b), max(most, a, b)
        middle = (least + most) / 2
        size = max(abs(least), abs(most))
        more = turn if i == 2 else bend
        out[into + i, lane] = middle
        out[into + 3 + i, lane] = (most - least) / 2 + more + ROUNDING * size
    x, y, radius = out[into, lane], out[into + 1, lane], 0.0
    for k in range(GROUP):
        for end in (field, field + 3):
            dx, dy = part[end, k] - x, part[end + 1, k] - y
            radius = max(radius, math.sqrt(dx * dx + dy * dy))
    slack = ROUNDING * (abs(x) + abs(y) + radius)
    out[into + 6, lane] = radius + bend + slack


@kernel(error_model="numpy")
def _point(f: Array, u: Array, x: float, y: float) -> None:
    """Write velocity and change of a point of the body."""
    arm = math.sqrt(x * x + y * y)
    for k in range(LANES):
        w = f[MIDDLE + 2, k]
        vx, vy = f[MIDDLE, k] - w * y, f[MIDDLE + 1, k] + w * x
        u[UX, k], u[UY, k] = vx, vy
        u[UN, k] = math.sqrt(vx * vx + vy * vy)
        u[UR, k] = f[RADIUS, k] + f[OFF + 2, k] * arm
    for k in range(LANES):
        e = f[CHANGE + 2, k]
        ax, ay = f[CHANGE, k] - e * y, f[CHANGE + 1, k] + e * x
        u[DX, k], u[DY, k] = ax, ay
        u[DN, k] = math.sqrt(ax * ax + ay * ay)
        u[DR, k] = f[CHANGE_RADIUS, k] + f[CHANGE_OFF + 2, k] * arm


@kernel(error_model="numpy")
def _slowest(f: Array, u: Array, x: float, y: float, kappa_g: float) -> None:
    """Write bounds on the speed of a vehicle with K at (x, y)."""
    _point(f, u, x, y)
    for k in range(LANES):
        least = u[UN, k] - u[UR, k]
        turn = (abs(f[MIDDLE + 2, k]) - f[OFF + 2, k]) / kappa_g
        u[SLOW, k] = least if least > turn else turn
        most = u[UN, k] + u[UR, k]
        turn = (abs(f[MIDDLE + 2, k]) + f[OFF + 2, k]) / kappa_g
        u[FAST, k] = most if most > turn else turn


@kernel(error_model="numpy")
def _linear(
    f: Array, field: int, x: float, y: float, along_x: float, along_y: float,
    limit: float, out: Array,
) -> None:  # fmt: skip
    """Bound the part of a velocity along (along_x, -along_y) by the box."""
    a, b, c = along_x, -along_y, -along_x * y - along_y * x
    per = 1.0 / limit
    for k in range(LANES):
        at = a * f[field, k] + b * f[field + 1, k] + c * f[field + 2, k]
        off = abs(a) * f[field + 3, k] + abs(b) * f[field + 4, k]
        out[k] = (abs(at) + off + abs(c) * f[field + 5, k]) * per


@kernel(error_model="numpy")
def _against(u: Array, sine: float, speed: float, out: Array) -> None:
    """Hold it against what the tolerances allow."""
    for k in range(LANES):
        room = sine * u[SLOW, k]
        out[k] /= room if room > speed else speed


@kernel(error_model="numpy")
def _direction(u: Array, kind: int, row: Array, out: Array) -> None:
    """Bound rows about the direction of a velocity, or about what is along it.

    A velocity within R of U is turned against it by φ with sin φ = R / |U|, so the unit
    vectors differ by 2 sin(φ/2) ≤ √2 R / |U|.
    """
    bound, side, sign = row[kinds.BOUND], row[kinds.ANGLE], row[kinds.SIGN]
    cos, sin = sign * row[kinds.ALONG], sign * row[kinds.ALONG + 1]
    for k in range(LANES):
        size, radius = u[UN, k], u[UR, k]
        near = size - radius
        clear = near > 0.0
        per = 1.0 / (size if size > 0.0 else 1.0)
        ex, ey = u[UX, k] * per, u[UY, k] * per
        more = u[DN, k] * ROOT * radius * per + u[DR, k]
        largest = u[DN, k] + u[DR, k]
        if kind == kinds.SINGULAR:
            value = 0.0
        elif kind == kinds.RANGE:
            spread = math.pi / 2 - arc_cosine(radius * per)
            aside = arc_cosine(ex * cos + ey * sin)
            value = (aside + spread + ANGLE_ROUNDING) / bound
        elif kind == kinds.RATE:
            across = abs(u[DY, k] * ex - u[DX, k] * ey) + more
            across = across if across < largest else largest
            value = across / ((near if clear else 1.0) * bound)
        else:
            along = u[DX, k] * ex + u[DY, k] * ey
            along = abs(along) if side == 0.0 else along * side
            most = along + more if clear else largest
            most = most if most < largest else largest
            value = (most if most > 0.0 else 0.0) / bound
        lost = (not clear) & (kind != kinds.GROWTH)
        out[k] = np.inf if lost else value


@kernel(error_model="numpy")
def _whole(f: Array, u: Array, kind: int, row: Array, floor: float, out: Array) -> None:
    """Bound rows about sizes."""
    per, x, y = 1.0 / row[kinds.BOUND], row[kinds.ALONG], row[kinds.ALONG + 1]
    for k in range(LANES):
        far = u[UN, k] + u[UR, k]
        yaw = abs(f[MIDDLE + 2, k]) + f[OFF + 2, k]
        if kind == kinds.SPEED:
            value = far
        elif kind == kinds.YAW:
            value = yaw
        elif kind == kinds.LATERAL:
            value = far * yaw
        elif kind == kinds.TIPPING:
            size = math.sqrt(x * x + y * y)
            pull = u[DX, k] * x + u[DY, k] * y
            pull += (u[DR, k] + far * yaw) * size
            value = pull if pull > 0.0 else 0.0
        else:
            ahead = u[UX, k] * x + u[UY, k] * y - u[UR, k]
            value = far if ahead < -floor else 0.0
        out[k] = value * per


@kernel(error_model="numpy")
def _steered(f: Array, u: Array, kind: int, row: Array, out: Array) -> None:
    """Bound what a wheel rolls beside its axis, or what guaranteed rates ask for."""
    per = 1.0 / row[kinds.BOUND]
    if kind == kinds.BESIDE:
        # |u| + |D| (|ω| + |α̇|) + k |α̇|, with |α̇| over the same bound in `out`
        _direction(u, kinds.RATE, row, out)
        lever = abs(row[kinds.OFFSET])
        for k in range(LANES):
            yaw = abs(f[MIDDLE + 2, k]) + f[OFF + 2, k]
            rolled = (u[UN, k] + u[UR, k] + lever * yaw) * per
            out[k] = rolled + (lever + row[kinds.COUPLING]) * out[k]
        return
    arm = math.hypot(row[kinds.ZONE_ARM], row[kinds.ZONE_ARM + 1])
    asked = row[kinds.ZONE_KAPPA] * row[kinds.ZONE_POLE] * per
    asked += row[kinds.ZONE_BETA] * (1 + arm) * per
    for k in range(LANES):
        near = u[UN, k] - u[UR, k]
        room = near / (u[FAST, k] if near > 0.0 else 1.0)
        out[k] = asked / (room * room) * (1 + ROUNDING) if near > 0.0 else np.inf


@kernel()
def screen(
    groups: Array, rows: Array, vehicle: Array, tolerances: Array, u: Array, out: Array
) -> None:
    """Write upper bounds of every row over every group.

    Parameters
    ----------
    groups : (c, FIELDS, LANES) float
        Of one motion.
    rows : (r, PARAMETERS) float
    vehicle, tolerances
        As for `rows.evaluate`.
    u : (SCRATCH, LANES) float
        Scratch.
    out : (r, c LANES) float
    """
    sine, speed = tolerances[1], tolerances[2]
    for c in range(groups.shape[0]):
        f = groups[c]
        _slowest(f, u, vehicle[0], vehicle[1], vehicle[2])
        at_x, at_y = vehicle[0], vehicle[1]
        for r in range(rows.shape[0]):
            into = out[r, c * LANES : (c + 1) * LANES]
            kind, bound = int(rows[r, kinds.KIND]), rows[r, kinds.BOUND]
            x, y = rows[r, kinds.AT], rows[r, kinds.AT + 1]
            a, b = rows[r, kinds.ALONG], rows[r, kinds.ALONG + 1]
            if kind == kinds.COMPONENT:
                _linear(f, MIDDLE, x, y, a, b, bound, into)
                continue
            if kind == kinds.COMPONENT_GROWTH:
                _linear(f, CHANGE, x, y, a, b, bound, into)
                continue
            if kind == kinds.SLIP:
                _linear(f, MIDDLE, x, y, a, b, 1.0, into)
                _against(u, sine, speed, into)
                continue
            if kind == kinds.PARALLEL:
                _whole(f, u, kinds.YAW, rows[r], tolerances[0], into)
                for k in range(LANES):
                    into[k] *= bound / vehicle[2]
                _against(u, sine, speed, into)
                continue
            if kind >= kinds.SWING:
                for k in range(LANES):
                    into[k] = np.inf  # groups do not tell
                continue
            if x != at_x or y != at_y:
                at_x, at_y = x, y
                _point(f, u, x, y)
            if kind in (kinds.BESIDE, kinds.ZONE):
                _steered(f, u, kind, rows[r], into)
            elif kind in (kinds.SINGULAR, kinds.RANGE, kinds.RATE, kinds.GROWTH):
                _direction(u, kind, rows[r], into)
            else:
                _whole(f, u, kind, rows[r], tolerances[0], into)
