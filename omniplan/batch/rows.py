"""The rows of `vehicle_judge` and `body_rows` over several parts at once, in numba.

The formulas are those of `chords`; here they are loops without branches over the lanes
of a scratch array, which the compiler turns into vector code. What they say is held
against `VehicleJudge.utilisation` in the tests.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from omniplan.batch.chords import (
    A0,
    A1,
    AX,
    AY,
    BEND,
    BX,
    BY,
    DAX,
    DAY,
    DBX,
    DBY,
    DT,
    FAR,
    FAST,
    HIGH,
    J0,
    J3,
    LOW,
    MOVES0,
    MOVES1,
    NA,
    NB,
    NEAR,
    RADIUS,
    REACH,
    SLOW,
    STANDS,
    V0,
    V1,
    WB,
    body,
    change,
    chord,
    ends,
    reach,
)
from omniplan.batch.motions import LANES

__all__ = ["arc_cosine", "evaluate"]

Array = Any  # numba infers the types; mypy cannot look into the kernels


# Kinds of rows:
SINGULAR = 0
"""The velocity of a steered wheel must not vanish."""
RANGE = 1
"""Its direction."""
RATE = 2
"""How fast it turns."""
SPEED = 3
"""The size of a velocity."""
COMPONENT = 4
"""One component of a velocity."""
SLIP = 5
"""One component against what the tolerances allow."""
GROWTH = 6
"""The change of a size: growth, decline or both."""
COMPONENT_GROWTH = 7
"""The change of a component."""
YAW = 8
"""The yaw rate."""
LATERAL = 9
"""The centripetal acceleration."""
TIPPING = 10
"""The acceleration towards an edge."""
PARALLEL = 11
"""The yaw rate against what the tolerances allow."""
BACKWARDS = 12
"""The size of a velocity while one component is negative."""

# Columns of the table of rows: kind; bound; 1 or -1 for a row of one representation
# only, else 0; whether it is about the configuration; a point (2), m; a direction (2);
# an angle, rad, or the side of a growth.
KIND, BOUND, SIGN, FREE, AT, ALONG, ANGLE = 0, 1, 2, 3, 4, 6, 8
PARAMETERS = 9

RANGE_ERROR = 1e-7
"""How far the quick arc cosine may be off, rad."""


@njit(cache=True, error_model="numpy")
def _singular(s: Array) -> None:
    for k in range(LANES):
        m0, m1 = s[MOVES0 + k], s[MOVES1 + k]
        on0 = (m0 > 0.0) & (s[NA + k] <= 1e-9 * m0)
        on1 = (m1 > 0.0) & (s[NB + k] <= 1e-9 * m1)
        s[LOW + k] = np.inf if on0 | on1 else 0.0
        s[HIGH + k] = np.inf if s[NEAR + k] <= 0.0 else 0.0


@njit(cache=True)
def arc_cosine(c: float) -> float:
    """Return the arc cosine to 3e-8 rad (Abramowitz and Stegun 4.4.46)."""
    size = abs(c)
    size = size if size < 1.0 else 1.0
    p = -0.0012624911 * size + 0.0066700901
    p = p * size - 0.0170881256
    p = p * size + 0.0308918810
    p = p * size - 0.0501743046
    p = p * size + 0.0889789874
    p = p * size - 0.2145988016
    p = p * size + 1.5707963050
    angle = p * math.sqrt(1.0 - size)
    return angle if c >= 0.0 else math.pi - angle


@njit(cache=True, error_model="numpy")
def _range(s: Array, sign: float, cos: float, sin: float, half: float) -> None:
    """Steering range with its middle at (cos, sin), within `RANGE_ERROR` / half.

    A part that passes behind is left open: it has to be halved.
    """
    for k in range(LANES):
        ax, ay, bx, by = s[AX + k], s[AY + k], s[BX + k], s[BY + k]
        na, nb = s[NA + k], s[NB + k]
        ca, sa = sign * (ax * cos + ay * sin), sign * (ay * cos - ax * sin)
        cb, sb = sign * (bx * cos + by * sin), sign * (by * cos - bx * sin)
        a = arc_cosine(ca / (na if na > 0.0 else 1.0))
        b = arc_cosine(cb / (nb if nb > 0.0 else 1.0))
        rolls0 = (s[MOVES0 + k] > 0.0) & (na > 1e-9 * s[MOVES0 + k])
        rolls1 = (s[MOVES1 + k] > 0.0) & (nb > 1e-9 * s[MOVES1 + k])
        low0, low1 = (a if rolls0 else 0.0), (b if rolls1 else 0.0)
        near, radius = s[NEAR + k], s[RADIUS + k]
        reach = near + radius
        share = radius / (reach if reach > 0.0 else 1.0)
        spread = 1.5707963267948966 - arc_cosine(share)
        # Behind: the sines differ and the segment crosses the axis left of zero.
        crossing = (ca * sb - cb * sa) * (sb - sa)
        behind = (sa * sb <= 0.0) & (crossing <= 0.0) & ((ca < 0.0) | (cb < 0.0))
        lost = (near <= 0.0) | behind
        high = (a if a > b else b) + spread
        s[LOW + k] = (low0 if low0 > low1 else low1) / half
        s[HIGH + k] = np.inf if lost else high / half


@njit(cache=True)
def _turned(x: float, y: float, middle: float) -> float:
    """Direction of a vector aside of `middle`, in (-π, π], as `wrap` has it."""
    angle = math.atan2(y, x) - middle
    if angle <= -math.pi or angle > math.pi:
        angle = math.atan2(math.sin(angle), math.cos(angle))
        if angle <= -math.pi:
            angle = math.pi
    return angle


@njit(cache=True, error_model="numpy")
def _exact_range(s: Array, sign: float, middle: float, half: float) -> None:
    """Like `_range`, by the arc tangents of `VehicleJudge`."""
    for k in range(LANES):
        ax, ay, bx, by = s[AX + k], s[AY + k], s[BX + k], s[BY + k]
        start = _turned(sign * ax, sign * ay, middle)
        at_end = _turned(sign * bx, sign * by, middle)
        end = start + math.atan2(by * ax - bx * ay, bx * ax + by * ay)
        near, radius = s[NEAR + k], s[RADIUS + k]
        spread = math.asin(min(radius / (near + radius), 1.0)) if near > 0 else 2.0
        high = max(abs(start), abs(end)) + spread
        if half == math.pi:  # both stops are one direction
            stop0 = abs(start) > math.pi - 1e-9
            stop1 = abs(at_end) > math.pi - 1e-9
            if stop0 != stop1 or (stop0 and start * at_end < 0):
                high = max(high, math.pi * (1 + 1e-9))
        low = 0.0
        if s[MOVES0 + k] > 0 and s[NA + k] > 1e-9 * s[MOVES0 + k]:
            low = abs(start)
        if s[MOVES1 + k] > 0 and s[NB + k] > 1e-9 * s[MOVES1 + k]:
            low = max(low, abs(at_end))
        s[LOW + k] = low / half
        s[HIGH + k] = high / half if near > 0 else np.inf


@njit(cache=True, error_model="numpy")
def _rate(s: Array, x: float, y: float, limit: float) -> None:
    """Bound `turning`, |Im(U̇ Ū)| / |U|², at (x, y).

    Its change Im(Ü Ū) is bounded by the direction of Ü as well: Ü stays near what it is
    at the start, and Im(Ü₀ Ū) is largest at an end of the chord. So a vehicle that
    starts straight ahead is not thought to turn its wheels.
    """
    per = 1.0 / limit
    for k in range(LANES):
        n0 = abs(s[DAY + k] * s[AX + k] - s[DAX + k] * s[AY + k])
        n1 = abs(s[DBY + k] * s[BX + k] - s[DBX + k] * s[BY + k])
        na, nb = s[NA + k], s[NB + k]
        rolls0 = (s[MOVES0 + k] > 0.0) & (na > 1e-9 * s[MOVES0 + k])
        rolls1 = (s[MOVES1 + k] > 0.0) & (nb > 1e-9 * s[MOVES1 + k])
        low0 = n0 / (na * na if rolls0 else 1.0)
        low1 = n1 / (nb * nb if rolls1 else 1.0)
        low0, low1 = (low0 if rolls0 else 0.0), (low1 if rolls1 else 0.0)
        far, bend, dt = s[FAR + k], s[BEND + k], s[DT + k]
        jx = s[J0 + k] - s[J0 + 2 * LANES + k] * y
        jy = s[J0 + LANES + k] + s[J0 + 2 * LANES + k] * x
        g0 = abs(jy * s[AX + k] - jx * s[AY + k])
        g1 = abs(jy * s[BX + k] - jx * s[BY + k])
        turned = (g0 if g0 > g1 else g1) + bend * s[RADIUS + k] + dt * s[J3 + k] * far
        most = bend * far
        more = dt / 2 * (turned if turned < most else most)
        near = s[NEAR + k]
        high = ((n0 if n0 > n1 else n1) + more) / (near * near)
        s[LOW + k] = (low0 if low0 > low1 else low1) * per
        s[HIGH + k] = high * per if near > 0.0 else np.inf


@njit(cache=True, error_model="numpy")
def _speed(s: Array, limit: float) -> None:
    per = 1.0 / limit
    for k in range(LANES):
        na, nb = s[NA + k], s[NB + k]
        s[LOW + k] = (na if na > nb else nb) * per
        s[HIGH + k] = s[FAR + k] * per


@njit(cache=True, error_model="numpy")
def _component(s: Array, x: float, y: float, limit: float, is_change: int) -> None:
    """`along` and `size`: the part along (x, -y), times the length of that."""
    per = 1.0 / limit
    stretch = math.sqrt(x * x + y * y)
    a, b = (DAX, DBX) if is_change else (AX, BX)
    for k in range(LANES):
        u = abs(s[a + k] * x - s[a + LANES + k] * y)
        v = abs(s[b + k] * x - s[b + LANES + k] * y)
        most = u if u > v else v
        more = s[DT + k] / 2 * s[BEND + k] if is_change else s[RADIUS + k]
        s[LOW + k] = most * per
        s[HIGH + k] = (most + more * stretch) * per


@njit(cache=True, error_model="numpy")
def _slip(s: Array, x: float, y: float, sine: float, speed: float) -> None:
    """Hold a component against what the tolerances allow at this speed."""
    for k in range(LANES):
        u = abs(s[AX + k] * x - s[AY + k] * y)
        v = abs(s[BX + k] * x - s[BY + k] * y)
        most = u if u > v else v
        little, much = sine * s[SLOW + k], sine * s[FAST + k]
        little = little if little > speed else speed
        much = much if much > speed else speed
        s[LOW + k] = most / much
        s[HIGH + k] = (most + s[RADIUS + k]) / little


@njit(cache=True, error_model="numpy")
def _parallel(s: Array, kappa_g: float, sine: float, speed: float) -> None:
    """Hold the yaw rate against what the tolerances allow at this speed."""
    for k in range(LANES):
        q0 = abs(s[V0 + 2 * LANES + k]) / kappa_g
        q1 = abs(s[V1 + 2 * LANES + k]) / kappa_g
        most = q0 if q0 > q1 else q1
        dt = s[DT + k]
        little, much = sine * s[SLOW + k], sine * s[FAST + k]
        little = little if little > speed else speed
        much = much if much > speed else speed
        s[LOW + k] = most / much
        s[HIGH + k] = (most + dt * dt / 8 * s[WB + k] / kappa_g) / little


@njit(cache=True, error_model="numpy")
def _growth(s: Array, side: float, limit: float) -> None:
    """`growth`: d|U|/dt; `side` 1 only growth, -1 only decline, 0 both."""
    per = 1.0 / limit
    for k in range(LANES):
        n0 = s[DAX + k] * s[AX + k] + s[DAY + k] * s[AY + k]
        n1 = s[DBX + k] * s[BX + k] + s[DBY + k] * s[BY + k]
        n0, n1 = (n0 if side >= 0.0 else -n0), (n1 if side >= 0.0 else -n1)
        floor0 = -n0 if side == 0.0 else 0.0
        floor1 = -n1 if side == 0.0 else 0.0
        n0, n1 = (n0 if n0 > floor0 else floor0), (n1 if n1 > floor1 else floor1)
        na, nb = s[NA + k], s[NB + k]
        low0 = n0 / (na if na > 1e-9 else 1.0)
        low1 = n1 / (nb if nb > 1e-9 else 1.0)
        low0, low1 = (low0 if na > 1e-9 else 0.0), (low1 if nb > 1e-9 else 0.0)
        low = low0 if low0 > low1 else low1
        reach, bend, dt, near = s[REACH + k], s[BEND + k], s[DT + k], s[NEAR + k]
        more = dt / 2 * (bend * s[FAR + k] + reach * reach)
        steep = ((n0 if n0 > n1 else n1) + more) / near
        high = steep if (near > 0.0) & (steep < reach) else reach
        # Into rest |U| only declines, out of rest it only grows.
        pulled = side > 0.0
        px, py = (
            (s[DBX + k] if pulled else s[DAX + k]),
            (s[DBY + k] if pulled else s[DAY + k]),
        )
        still = (nb if pulled else na) <= 1e-9
        least = 2 * dt * bend
        lull = still & (px * px + py * py > least * least) & (side != 0.0)
        s[LOW + k] = low * per
        s[HIGH + k] = (low if lull else high) * per


@njit(cache=True, error_model="numpy")
def _yaw(s: Array, limit: float) -> None:
    per = 1.0 / limit
    for k in range(LANES):
        w0, w1 = abs(s[V0 + 2 * LANES + k]), abs(s[V1 + 2 * LANES + k])
        most = w0 if w0 > w1 else w1
        dt = s[DT + k]
        s[LOW + k] = most * per
        s[HIGH + k] = (most + dt * dt / 8 * s[WB + k]) * per


@njit(cache=True, error_model="numpy")
def _lateral(s: Array, limit: float) -> None:
    """|ω v_P|."""
    per = 1.0 / limit
    for k in range(LANES):
        w0, w1 = abs(s[V0 + 2 * LANES + k]), abs(s[V1 + 2 * LANES + k])
        a, b = s[NA + k] * w0, s[NB + k] * w1
        dt = s[DT + k]
        yaw = (w0 if w0 > w1 else w1) + dt * dt / 8 * s[WB + k]
        s[LOW + k] = (a if a > b else b) * per
        s[HIGH + k] = s[FAR + k] * yaw * per


@njit(cache=True, error_model="numpy")
def _tipping(s: Array, x: float, y: float, limit: float) -> None:
    """Acceleration of the centre of gravity towards the inward normal (x, y)."""
    per = 1.0 / limit
    for k in range(LANES):
        w0, w1 = s[V0 + 2 * LANES + k], s[V1 + 2 * LANES + k]
        e0, e1 = abs(s[A0 + 2 * LANES + k]), abs(s[A1 + 2 * LANES + k])
        a = (s[DAX + k] - w0 * s[AY + k]) * x + (s[DAY + k] + w0 * s[AX + k]) * y
        b = (s[DBX + k] - w1 * s[BY + k]) * x + (s[DBY + k] + w1 * s[BX + k]) * y
        low = a if a > b else b
        low = low if low > 0.0 else 0.0
        w0, w1 = abs(w0), abs(w1)
        dt, more = s[DT + k], s[WB + k]
        yaw = (w0 if w0 > w1 else w1) + dt * dt / 8 * more
        turning = (e0 if e0 > e1 else e1) + dt / 2 * more
        bend = turning * s[FAR + k] + yaw * s[REACH + k] + s[BEND + k]
        s[LOW + k] = low * per
        s[HIGH + k] = (low + dt / 2 * bend) * per


@njit(cache=True, error_model="numpy")
def _backwards(s: Array, x: float, y: float, floor: float, limit: float) -> None:
    """Bound the size of a velocity where its component along (x, y) is negative."""
    per = 1.0 / limit
    for k in range(LANES):
        u = s[AX + k] * x + s[AY + k] * y
        v = s[BX + k] * x + s[BY + k] * y
        least = u if u < v else v
        na, nb = s[NA + k], s[NB + k]
        low = (na if na > nb else nb) * per
        s[LOW + k] = low if least < -floor else 0.0
        s[HIGH + k] = s[FAR + k] * per if least - s[RADIUS + k] < -floor else 0.0


@njit(cache=True)
def _within_free(s: Array) -> None:
    """Take off what is about the configuration, which is free while standing."""
    for k in range(LANES):
        low, high = s[LOW + k], s[HIGH + k]
        stands = s[STANDS + k] > 0.0
        s[LOW + k] = 0.0 if stands else low
        s[HIGH + k] = 0.0 if stands else high


@njit(cache=True)
def _gather(s: Array, most: Array, at: int) -> None:
    """Keep the largest `LOW` and `HIGH` of all blocks so far, lane by lane."""
    for k in range(LANES):
        a, low = most[at + k], s[LOW + k]
        most[at + k] = low if low > a else a
    for k in range(LANES):
        b, high = most[at + LANES + k], s[HIGH + k]
        most[at + LANES + k] = high if high > b else b


@njit(cache=True)
def _keep(s: Array, highs: Array, at: int) -> None:
    """Keep `HIGH` of every part."""
    for k in range(LANES):
        highs[at + k] = s[HIGH + k]


@njit(cache=True)
def evaluate(
    s: Array, rows: Array, first: int, last: int, vehicle: Array, tolerances: Array,
    exact: int, wanted: Array, most: Array, highs: Array, block: int, blocks: int,
) -> None:  # fmt: skip
    """Write what rows first to last - 1 say of a block to its fields `LOW` and `HIGH`.

    All rows in one function: to hand arrays on takes longer than what is computed.

    Parameters
    ----------
    s : (ROOM,) float
        The enclosures are in its first fields.
    rows : (r, PARAMETERS) float
    first, last : int
    vehicle : (4,) float
        K in m, κ_g in 1/m.
    tolerances : (3,) float
        Standstill in m/s, sine of the slip angle, slip speed in m/s.
    exact : {0, 1}
        Whether angles are needed to the last digit.
    wanted : (r,) float
        Rows with a 0 are left out, unless `blocks` is 0.
    most : (r * 2 LANES,) float
        Gets the largest `LOW` and `HIGH` so far of every row, lane by lane.
    highs : (r * blocks * LANES,) float
        Gets `HIGH` of every row and part.
    block, blocks : int
        Which of how many blocks this is; of 0 nothing is kept.
    """
    body(s, vehicle[0], vehicle[1], vehicle[2], tolerances[0])
    at_x, at_y = vehicle[0], vehicle[1]
    has_ends, has_chord, has_change, has_reach = True, True, False, False
    for r in range(first, last):
        if blocks > 0 and wanted[r] == 0.0:
            continue
        x, y = rows[r, AT], rows[r, AT + 1]
        if x != at_x or y != at_y:
            at_x, at_y = x, y
            has_ends, has_chord, has_change, has_reach = False, False, False, False
        kind, bound = int(rows[r, KIND]), rows[r, BOUND]
        a, b, angle = rows[r, ALONG], rows[r, ALONG + 1], rows[r, ANGLE]
        light = kind in (COMPONENT, COMPONENT_GROWTH, SLIP)
        if not light and not has_chord:
            chord(s, x, y)
            has_ends, has_chord = True, True
        if not has_ends:
            ends(s, x, y)
            has_ends = True
        sized = kind in (GROWTH, TIPPING)
        if not has_change and (sized or kind in (RATE, COMPONENT_GROWTH)):
            change(s, x, y)
            has_change = True
        if sized and not has_reach:
            reach(s)
            has_reach = True
        if kind == SINGULAR:
            _singular(s)
        elif kind == RANGE:
            if exact:
                _exact_range(s, rows[r, SIGN], angle, bound)
            else:
                _range(s, rows[r, SIGN], a, b, bound)
        elif kind == RATE:
            _rate(s, x, y, bound)
        elif kind == SPEED:
            _speed(s, bound)
        elif kind == COMPONENT:
            _component(s, a, b, bound, 0)
        elif kind == SLIP:
            _slip(s, a, b, tolerances[1], tolerances[2])
        elif kind == GROWTH:
            _growth(s, angle, bound)
        elif kind == COMPONENT_GROWTH:
            _component(s, a, b, bound, 1)
        elif kind == YAW:
            _yaw(s, bound)
        elif kind == LATERAL:
            _lateral(s, bound)
        elif kind == TIPPING:
            _tipping(s, a, b, bound)
        elif kind == PARALLEL:
            _parallel(s, vehicle[2], tolerances[1], tolerances[2])
        else:
            _backwards(s, a, b, tolerances[0], bound)
        if rows[r, FREE] > 0:
            _within_free(s)
        if blocks > 0:
            _gather(s, most, 2 * LANES * r)
            _keep(s, highs, (r * blocks + block) * LANES)
