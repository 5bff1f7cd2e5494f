"""Eight parts of a motion at once, roughly: which rows are worth a closer look where.

Over a group of parts every velocity lies near a straight line, and so does its change,
and its direction: divided by its size it is known towards rest as well. That bounds
each row from above, for sixteen groups in one go. Where the bound is below what some
row reaches anyhow, the parts of the group need not be evaluated.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

import numpy as np

from omniplan.batch import kinds
from omniplan.batch.groups import (
    CHANGE,
    END,
    FIELDS,
    HEADING,
    OFF,
    PER_ROW,
    RADIUS,
    ROUNDING,
    STILL,
    STILL_TURN,
    VELOCITY,
)
from omniplan.batch.kernel import kernel
from omniplan.batch.motions import LANES
from omniplan.batch.steering import arc_cosine

__all__ = ["screen"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

# Scratch behind the fields of groups. Of a point: the velocity at both ends of the line
# (2 each), the sizes there, how far it is off the line, how near that comes to zero ...
AX, AY, BX, BY, NA, NB, OFF_LINE, NEAR = ((FIELDS + i) * LANES for i in range(8))
# ... the same of its change but the last, with the larger size only ...
DAX, DAY, DBX, DBY, DN, DOFF = ((FIELDS + 8 + i) * LANES for i in range(6))
# ... of the velocity over the size of that of the body what there is of a velocity ...
HAX, HAY, HBX, HBY, HNA, HNB, HOFF, HNEAR = (
    (FIELDS + 14 + i) * LANES for i in range(8)
)
# ... bounds on the speed of the vehicle; infinite unless it surely stands where
# directions are not known, else 0; the bound on a row.
SLOW, FAST, LOST, TOP = ((FIELDS + 22 + i) * LANES for i in range(4))
# The largest bound over a block, and of those that count in any case.
CREST = (FIELDS + 26) * LANES
COUNTING = CREST + PER_ROW
ANGLE_ROUNDING = 1e-6
"""Rad; it covers the quick arc cosine."""
LEAST = 1e-4
"""Of the size of the velocity of the body: a point that is faster does not stand."""
ROOT = math.sqrt(2.0)


@kernel(error_model="numpy")
def _sizes(f: Array, x: float, y: float) -> None:
    """Write the velocity of a point of the body at the ends of its line."""
    arm = math.sqrt(x * x + y * y)
    for k in range(LANES):
        w0, w1 = f[2 * LANES + k], f[END + 2 * LANES + k]
        ax, ay = f[k] - w0 * y, f[LANES + k] + w0 * x
        bx, by = f[END + k] - w1 * y, f[END + LANES + k] + w1 * x
        f[AX + k], f[AY + k], f[BX + k], f[BY + k] = ax, ay, bx, by
        f[NA + k] = math.sqrt(ax * ax + ay * ay)
        f[NB + k] = math.sqrt(bx * bx + by * by)
        f[OFF_LINE + k] = f[RADIUS + k] + f[OFF + 2 * LANES + k] * arm


@kernel(error_model="numpy")
def _nearest(f: Array) -> None:
    """Write how near the line of a velocity comes to zero."""
    for k in range(LANES):
        ax, ay = f[AX + k], f[AY + k]
        dx, dy = f[BX + k] - ax, f[BY + k] - ay
        length = dx * dx + dy * dy
        share = -(ax * dx + ay * dy) / (length if length > 0.0 else 1.0)
        share = share if share > 0.0 else 0.0
        share = share if share < 1.0 else 1.0
        cx, cy = ax + share * dx, ay + share * dy
        off = ROUNDING * (f[NA + k] + f[NB + k])
        f[NEAR + k] = math.sqrt(cx * cx + cy * cy) - off


@kernel(error_model="numpy")
def _changes(f: Array, x: float, y: float) -> None:
    """Write the change of the velocity of a point at the ends of its line."""
    arm = math.sqrt(x * x + y * y)
    for k in range(LANES):
        e0, e1 = f[CHANGE + 2 * LANES + k], f[CHANGE + END + 2 * LANES + k]
        ax, ay = f[CHANGE + k] - e0 * y, f[CHANGE + LANES + k] + e0 * x
        bx = f[CHANGE + END + k] - e1 * y
        by = f[CHANGE + END + LANES + k] + e1 * x
        f[DAX + k], f[DAY + k], f[DBX + k], f[DBY + k] = ax, ay, bx, by
        a, b = ax * ax + ay * ay, bx * bx + by * by
        f[DN + k] = math.sqrt(a if a > b else b)
        off = f[CHANGE + OFF + 2 * LANES + k] * arm
        f[DOFF + k] = f[CHANGE + RADIUS + k] + off


@kernel(error_model="numpy")
def _speeds(f: Array, x: float, y: float, kappa_g: float, standstill: float) -> None:
    """Write bounds on the speed of a vehicle with K at (x, y), and where it stands."""
    _sizes(f, x, y)
    _nearest(f)
    arm, per = math.sqrt(x * x + y * y), 1.0 / kappa_g
    for k in range(LANES):
        w0, w1 = f[2 * LANES + k], f[END + 2 * LANES + k]
        q0, q1 = abs(w0), abs(w1)
        off = f[OFF + 2 * LANES + k]
        turn = (q0 if q0 < q1 else q1) if w0 * w1 > 0.0 else 0.0
        turn, near = (turn - off) * per, f[NEAR + k] - f[OFF_LINE + k]
        f[SLOW + k] = near if near > turn else turn
        turn = ((q0 if q0 > q1 else q1) + off) * per
        most = f[NA + k] if f[NA + k] > f[NB + k] else f[NB + k]
        most += f[OFF_LINE + k]
        f[FAST + k] = most if most > turn else turn
        still = f[STILL + k] + f[STILL_TURN + k] * arm
        stands = (still <= standstill) & (f[STILL_TURN + k] * per <= standstill)
        f[LOST + k] = 0.0 if stands else np.inf


@kernel(error_model="numpy")
def _linear(
    f: Array, field: int, x: float, y: float, along_x: float, along_y: float,
    limit: float,
) -> None:  # fmt: skip
    """Bound the part of a velocity along (along_x, -along_y)."""
    a, b, c = along_x, -along_y, -along_x * y - along_y * x
    per = 1.0 / limit
    for k in range(LANES):
        p = a * f[field + k] + b * f[field + LANES + k] + c * f[field + 2 * LANES + k]
        at = field + END
        q = a * f[at + k] + b * f[at + LANES + k] + c * f[at + 2 * LANES + k]
        at = field + OFF
        off = abs(a) * f[at + k] + abs(b) * f[at + LANES + k]
        off += abs(c) * f[at + 2 * LANES + k]
        p, q = abs(p), abs(q)
        f[TOP + k] = ((p if p > q else q) + off) * per


@kernel(error_model="numpy")
def _against(f: Array, sine: float, speed: float) -> None:
    """Hold it against what the tolerances allow."""
    for k in range(LANES):
        room = sine * f[SLOW + k]
        f[TOP + k] /= room if room > speed else speed


@kernel(error_model="numpy")
def _headings(f: Array, x: float, y: float) -> None:
    """Write the velocity of a point over the size of that of the body, likewise."""
    arm = math.sqrt(x * x + y * y)
    for k in range(LANES):
        w0 = f[HEADING + 2 * LANES + k]
        w1 = f[HEADING + END + 2 * LANES + k]
        ax, ay = f[HEADING + k] - w0 * y, f[HEADING + LANES + k] + w0 * x
        bx = f[HEADING + END + k] - w1 * y
        by = f[HEADING + END + LANES + k] + w1 * x
        na, nb = math.sqrt(ax * ax + ay * ay), math.sqrt(bx * bx + by * by)
        dx, dy = bx - ax, by - ay
        length = dx * dx + dy * dy
        share = -(ax * dx + ay * dy) / (length if length > 0.0 else 1.0)
        share = share if share > 0.0 else 0.0
        share = share if share < 1.0 else 1.0
        cx, cy = ax + share * dx, ay + share * dy
        off = f[HEADING + RADIUS + k] + f[HEADING + OFF + 2 * LANES + k] * arm
        f[HAX + k], f[HAY + k], f[HBX + k], f[HBY + k] = ax, ay, bx, by
        f[HNA + k], f[HNB + k], f[HOFF + k] = na, nb, off
        f[HNEAR + k] = math.sqrt(cx * cx + cy * cy) - ROUNDING * (na + nb)


@kernel(error_model="numpy")
def _singular(f: Array) -> None:
    """Tell where a velocity may vanish."""
    for k in range(LANES):
        is_clear = f[HNEAR + k] > f[HOFF + k] + LEAST
        f[TOP + k] = (0.0 if is_clear else np.inf) + f[LOST + k]


@kernel(error_model="numpy")
def _range(f: Array, cos: float, sin: float, half: float) -> None:
    """Bound the angle between a velocity and (cos, sin).

    As `quick_range`: the line between two directions is in the angle between them,
    unless it passes behind.
    """
    per = 1.0 / half
    for k in range(LANES):
        ax, ay, bx, by = f[HAX + k], f[HAY + k], f[HBX + k], f[HBY + k]
        na, nb, off, near = f[HNA + k], f[HNB + k], f[HOFF + k], f[HNEAR + k]
        ca, sa = ax * cos + ay * sin, ay * cos - ax * sin
        cb, sb = bx * cos + by * sin, by * cos - bx * sin
        a = arc_cosine(ca / (na if na > 0.0 else 1.0))
        b = arc_cosine(cb / (nb if nb > 0.0 else 1.0))
        lost = not near > off
        spread = math.pi / 2 - arc_cosine(1.0 if lost else off / near)
        crossing = (ca * sb - cb * sa) * (sb - sa)
        lost |= (sa * sb <= 0.0) & (crossing <= 0.0) & ((ca < 0.0) | (cb < 0.0))
        most = ((a if a > b else b) + spread + ANGLE_ROUNDING) * per
        most = np.inf if lost else most
        f[TOP + k] = (0.0 if off < 0.0 else most) + f[LOST + k]


@kernel(error_model="numpy")
def _rate(f: Array, limit: float) -> None:
    """Bound |Im(U̇ Ū)| / |U|².

    On the lines of U and U̇ its numerator is a square of time: largest at an end but
    for a quarter of what both change by.
    """
    per = 1.0 / limit
    for k in range(LANES):
        ax, ay, bx, by = f[AX + k], f[AY + k], f[BX + k], f[BY + k]
        px, py, qx, qy = f[DAX + k], f[DAY + k], f[DBX + k], f[DBY + k]
        n0, n1 = abs(py * ax - px * ay), abs(qy * bx - qx * by)
        cross = abs((qy - py) * (bx - ax) - (qx - px) * (by - ay)) / 4
        size = f[NA + k] if f[NA + k] > f[NB + k] else f[NB + k]
        off, change, more = f[OFF_LINE + k], f[DN + k], f[DOFF + k]
        most = (n0 if n0 > n1 else n1) + cross + more * size + (change + more) * off
        near = f[NEAR + k] - off
        turned, swung = most / (near * near), (change + more) / near
        least = turned if turned < swung else swung
        f[TOP + k] = least * per * (1 + ROUNDING) if near > 0.0 else np.inf


@kernel(error_model="numpy")
def _growth(f: Array, side: float, limit: float) -> None:
    """Bound d|U|/dt, the part of U̇ along U; `side` as for `rolling.growth`.

    U has a direction between those at the ends of its line, turned against them by φ
    with sin φ = R / |U| at most, so unit vectors differ by 2 sin(φ/2) ≤ √2 R / |U|.
    Those between the ends are off the line between these by 1 - cos of half the angle.
    """
    per = 1.0 / limit
    for k in range(LANES):
        na, nb, near = f[NA + k], f[NB + k], f[NEAR + k]
        off, change, more = f[OFF_LINE + k], f[DN + k], f[DOFF + k]
        p, q = 1.0 / (na if na > 0.0 else 1.0), 1.0 / (nb if nb > 0.0 else 1.0)
        ax, ay, bx, by = f[AX + k] * p, f[AY + k] * p, f[BX + k] * q, f[BY + k] * q
        px, py, qx, qy = f[DAX + k], f[DAY + k], f[DBX + k], f[DBY + k]
        g0, g1 = px * ax + py * ay, px * bx + py * by
        g2, g3 = qx * ax + qy * ay, qx * bx + qy * by
        most = g0 if g0 > g1 else g1
        most = most if most > g2 else g2
        most = most if most > g3 else g3
        least = g0 if g0 < g1 else g1
        least = least if least < g2 else g2
        least = least if least < g3 else g3
        both = most if most > -least else -least
        along = both if side == 0.0 else (most if side > 0.0 else -least)
        half = (1.0 + ax * bx + ay * by) / 2
        bulge = 1.0 - math.sqrt(half if half > 0.0 else 0.0)
        turned = bulge + ROOT * off / (near if near > 0.0 else 1.0)
        along += change * turned + more + ROUNDING * change
        largest = change + more
        value = along if (near > off) & (along < largest) else largest
        f[TOP + k] = (value if value > 0.0 else 0.0) * per


@kernel(error_model="numpy")
def _whole(f: Array, kind: int, row: Array, floor: float) -> None:
    """Bound rows about sizes."""
    per, x, y = 1.0 / row[kinds.BOUND], row[kinds.ALONG], row[kinds.ALONG + 1]
    size = math.sqrt(x * x + y * y)
    for k in range(LANES):
        far = f[NA + k] if f[NA + k] > f[NB + k] else f[NB + k]
        far += f[OFF_LINE + k]
        w0, w1 = abs(f[2 * LANES + k]), abs(f[END + 2 * LANES + k])
        yaw = (w0 if w0 > w1 else w1) + f[OFF + 2 * LANES + k]
        if kind == kinds.SPEED:
            value = far
        elif kind == kinds.YAW:
            value = yaw
        elif kind == kinds.LATERAL:
            value = far * yaw
        elif kind == kinds.TIPPING:
            p = f[DAX + k] * x + f[DAY + k] * y
            q = f[DBX + k] * x + f[DBY + k] * y
            pull = (p if p > q else q) + (f[DOFF + k] + far * yaw) * size
            value = pull if pull > 0.0 else 0.0
        else:
            p = f[AX + k] * x + f[AY + k] * y
            q = f[BX + k] * x + f[BY + k] * y
            ahead = (p if p < q else q) - f[OFF_LINE + k] * size
            value = far if ahead < -floor else 0.0
        f[TOP + k] = value * per


@kernel(error_model="numpy")
def _beside(f: Array, row: Array) -> None:
    """Bound |u| + |D| (|ω| + |α̇|) + k |α̇|, with |α̇| over the same bound in `TOP`."""
    per, lever = 1.0 / row[kinds.BOUND], abs(row[kinds.OFFSET])
    for k in range(LANES):
        far = f[NA + k] if f[NA + k] > f[NB + k] else f[NB + k]
        w0, w1 = abs(f[2 * LANES + k]), abs(f[END + 2 * LANES + k])
        yaw = (w0 if w0 > w1 else w1) + f[OFF + 2 * LANES + k]
        rolled = (far + f[OFF_LINE + k] + lever * yaw) * per
        f[TOP + k] = rolled + (lever + row[kinds.COUPLING]) * f[TOP + k]


@kernel(error_model="numpy")
def _zone(f: Array, row: Array) -> None:
    """Bound what guaranteed rates ask for."""
    per = 1.0 / row[kinds.BOUND]
    arm = math.hypot(row[kinds.ZONE_ARM], row[kinds.ZONE_ARM + 1])
    asked = row[kinds.ZONE_KAPPA] * row[kinds.ZONE_POLE] * per
    asked += row[kinds.ZONE_BETA] * (1 + arm) * per
    for k in range(LANES):
        near = f[NEAR + k] - f[OFF_LINE + k]
        room = near / (f[FAST + k] if near > 0.0 else 1.0)
        f[TOP + k] = asked / (room * room) * (1 + ROUNDING) if near > 0.0 else np.inf


@kernel()
def _keep(f: Array, counts: bool) -> None:
    """Write the bound over both groups of a block to the first; keep the largest."""
    for k in range(PER_ROW):
        one, other = f[TOP + k], f[TOP + PER_ROW + k]
        top = one if one > other else other
        most, known = f[CREST + k], f[COUNTING + k]
        share = top if counts & (top < np.inf) else 0.0
        f[TOP + k] = top
        f[CREST + k] = top if top > most else most
        f[COUNTING + k] = share if share > known else known


@kernel()
def screen(
    groups: Array, rows: Array, vehicle: Array, tolerances: Array, out: Array,
    crest: Array,
) -> None:  # fmt: skip
    """Write upper bounds of every row over every block.

    Parameters
    ----------
    groups : (c, GROUP_ROOM) float
        Of one motion; the room behind the fields is used.
    rows : (r, PARAMETERS) float
    vehicle, tolerances
        As for `rows.evaluate`.
    out : (r, c PER_ROW) float
    crest : (c PER_ROW, 2) float
        Gets the largest of all rows, and of those that hold for both representations,
        as far as they are finite.
    """
    sine, speed = tolerances[1], tolerances[2]
    for c in range(groups.shape[0]):
        f = groups[c]
        _speeds(f, vehicle[0], vehicle[1], vehicle[2], tolerances[0])
        at_x, at_y = vehicle[0], vehicle[1]
        has_sizes, has_near, has_changes, has_headings = True, True, False, False
        for k in range(LANES):
            f[CREST + k] = 0.0
        for r in range(rows.shape[0]):
            kind, bound = int(rows[r, kinds.KIND]), rows[r, kinds.BOUND]
            x, y = rows[r, kinds.AT], rows[r, kinds.AT + 1]
            a, b = rows[r, kinds.ALONG], rows[r, kinds.ALONG + 1]
            if x != at_x or y != at_y:
                at_x, at_y = x, y
                has_sizes, has_near = False, False
                has_changes, has_headings = False, False
            light = kind in (kinds.COMPONENT, kinds.COMPONENT_GROWTH, kinds.SLIP)
            light |= kind in (kinds.SINGULAR, kinds.RANGE, kinds.SWING)
            if not has_headings and kind in (kinds.SINGULAR, kinds.RANGE):
                _headings(f, x, y)
                has_headings = True
            if not (light or has_sizes):
                _sizes(f, x, y)
                has_sizes = True
            turns = kind in (kinds.RATE, kinds.BESIDE)
            if not has_near and (turns or kind in (kinds.GROWTH, kinds.ZONE)):
                _nearest(f)
                has_near = True
            if not has_changes and (turns or kind in (kinds.GROWTH, kinds.TIPPING)):
                _changes(f, x, y)
                has_changes = True
            if kind == kinds.COMPONENT:
                _linear(f, VELOCITY, x, y, a, b, bound)
            elif kind == kinds.COMPONENT_GROWTH:
                _linear(f, CHANGE, x, y, a, b, bound)
            elif kind == kinds.SLIP:
                _linear(f, VELOCITY, x, y, a, b, 1.0)
                _against(f, sine, speed)
            elif kind == kinds.RANGE:
                sign = rows[r, kinds.SIGN]
                _range(f, sign * a, sign * b, bound)
            elif kind == kinds.SINGULAR:
                _singular(f)
            elif kind == kinds.RATE:
                _rate(f, bound)
            elif kind == kinds.GROWTH:
                _growth(f, rows[r, kinds.ANGLE], bound)
            elif kind >= kinds.SWING:
                for k in range(LANES):
                    f[TOP + k] = np.inf  # groups do not tell
            elif kind == kinds.BESIDE:
                _rate(f, bound)
                _beside(f, rows[r])
            elif kind == kinds.ZONE:
                _zone(f, rows[r])
            elif kind == kinds.PARALLEL:
                _whole(f, kinds.YAW, rows[r], tolerances[0])
                for k in range(LANES):
                    f[TOP + k] *= bound / vehicle[2]
                _against(f, sine, speed)
            else:
                _whole(f, kind, rows[r], tolerances[0])
            _keep(f, rows[r, kinds.SIGN] == 0)
            for k in range(PER_ROW):
                out[r, c * PER_ROW + k] = f[TOP + k]
        for k in range(PER_ROW):
            crest[c * PER_ROW + k, 0] = f[CREST + k]
            crest[c * PER_ROW + k, 1] = f[COUNTING + k]
