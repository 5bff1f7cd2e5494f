"""What steered wheels are asked for, over several parts at once, in numba.

The formulas of `vehicle_judge` and `beside`: where a wheel points, how fast it turns
and how that changes, what it rolls beside its axis, which rates are guaranteed.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

from configspace.omni_curve import POLE
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
    STANDS,
    SWUNG,
    V0,
    V1,
    VB,
    WB,
)
from omniplan.batch.kernel import kernel
from omniplan.batch.kinds import ZONE_ARM, ZONE_BETA, ZONE_KAPPA, ZONE_LINE, ZONE_POLE
from omniplan.batch.motions import LANES

__all__ = [
    "arc_cosine",
    "beside",
    "beside_growth",
    "exact_range",
    "quick_range",
    "rate",
    "singular",
    "steering",
    "swinging",
    "zone",
]

Array = Any  # numba infers the types; mypy cannot look into the kernels


@kernel(error_model="numpy")
def singular(s: Array) -> None:
    """Tell where the velocity vanishes, and where it may."""
    for k in range(LANES):
        m0, m1 = s[MOVES0 + k], s[MOVES1 + k]
        on0 = (m0 > 0.0) & (s[NA + k] <= 1e-9 * m0)
        on1 = (m1 > 0.0) & (s[NB + k] <= 1e-9 * m1)
        s[LOW + k] = math.inf if on0 | on1 else 0.0
        s[HIGH + k] = math.inf if s[NEAR + k] <= 0.0 else 0.0


@kernel()
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


@kernel(error_model="numpy")
def quick_range(s: Array, sign: float, cos: float, sin: float, half: float) -> None:
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
        s[HIGH + k] = math.inf if lost else high / half


@kernel()
def _turned(x: float, y: float, middle: float) -> float:
    """Direction of a vector aside of `middle`, in (-π, π], as `wrap` has it."""
    angle = math.atan2(y, x) - middle
    if angle <= -math.pi or angle > math.pi:
        angle = math.atan2(math.sin(angle), math.cos(angle))
        if angle <= -math.pi:
            angle = math.pi
    return angle


@kernel(error_model="numpy")
def exact_range(s: Array, sign: float, middle: float, half: float) -> None:
    """Like `quick_range`, by the arc tangents of `VehicleJudge`; with the change."""
    for k in range(LANES):
        ax, ay, bx, by = s[AX + k], s[AY + k], s[BX + k], s[BY + k]
        start = _turned(sign * ax, sign * ay, middle)
        at_end = _turned(sign * bx, sign * by, middle)
        end = start + math.atan2(by * ax - bx * ay, bx * ax + by * ay)
        near, radius = s[NEAR + k], s[RADIUS + k]
        spread = math.asin(min(radius / (near + radius), 1.0)) if near > 0 else 2.0
        # Where the angle moves one way only nothing is beyond the ends: see `one_way`.
        n0 = s[DAY + k] * ax - s[DAX + k] * ay
        n1 = s[DBY + k] * bx - s[DBX + k] * by
        if abs(n0 + n1) >= s[DT + k] * s[BEND + k] * s[FAR + k]:
            spread = 0.0
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
        s[HIGH + k] = high / half if near > 0 else math.inf


@kernel(error_model="numpy")
def rate(s: Array, x: float, y: float, limit: float) -> None:
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
        s[HIGH + k] = high * per if near > 0.0 else math.inf


@kernel(error_model="numpy")
def _turn(s: Array, k: int, u: int, d: int) -> float:
    """Return α̇ at an end of a part, with its sign; 0 where the wheel stands."""
    x, y = s[u + k], s[u + LANES + k]
    square = x * x + y * y
    if square <= 1e-24:
        return 0.0
    turn: float = (s[d + LANES + k] * x - s[d + k] * y) / square
    return turn


@kernel(error_model="numpy")
def _turning_excess(s: Array, k: int) -> float:
    """Return what ω + α̇ may exceed its values at both ends by; see `beside_axis`."""
    dt, near = s[DT + k], s[NEAR + k]
    if not near > 0.0:
        return math.inf
    gain = max(abs(s[A0 + 2 * LANES + k]), abs(s[A1 + 2 * LANES + k]))
    gain += dt / 2 * s[WB + k]
    l1, l2, l3 = s[REACH + k] / near, s[BEND + k] / near, s[J3 + k] / near
    slope = gain + l2 + l1 * l1
    bend = s[WB + k] + l3 + 3 * l1 * l2 + 2 * l1 * l1 * l1
    excess: float = min(dt / 2 * slope, dt * dt / 8 * bend)
    return excess


@kernel(error_model="numpy")
def beside(s: Array, offset: float, coupling: float, sign: float, limit: float) -> None:
    """Bound |û| + k |α̇| with û = u - (ω + α̇) D, as `beside_axis` does.

    `HIGH` holds a bound on |α̇|, by `rate` for a limit of 1.
    """
    per, lever = 1.0 / limit, abs(offset)
    for k in range(LANES):
        most_rate = s[HIGH + k]
        w0, w1 = s[V0 + 2 * LANES + k], s[V1 + 2 * LANES + k]
        t0, t1 = _turn(s, k, AX, DAX), _turn(s, k, BX, DBX)
        a, b = abs(t0), abs(t1)
        low0 = abs(s[NA + k] - sign * (w0 + t0) * offset) + coupling * a
        low1 = abs(s[NB + k] - sign * (w1 + t1) * offset) + coupling * b
        low0 = low0 if s[MOVES0 + k] > 0.0 else 0.0
        low1 = low1 if s[MOVES1 + k] > 0.0 else 0.0
        near, far = s[NEAR + k], s[FAR + k]
        high = far
        if offset != 0.0:
            slack = _turning_excess(s, k)
            e0, e1 = sign * (w0 + t0) * offset, sign * (w1 + t1) * offset
            most = (e0 if e0 > e1 else e1) + slack * lever
            least = (e0 if e0 < e1 else e1) - slack * lever
            u, v = abs(near - most), abs(far - least)
            high = u if u > v else v
        if coupling > 0.0:
            high += coupling * most_rate
        s[LOW + k] = (low0 if low0 > low1 else low1) * per
        s[HIGH + k] = high * per


@kernel(error_model="numpy")
def _asked(
    vx: float, vy: float, omega: float, ux: float, uy: float, kappa_g: float,
    row: Array,
) -> Any:  # fmt: skip
    """Return |v_s|, c e^{jβ}, s, what the rates ask for and |z| at an end of a part."""
    v_s = max(max(math.hypot(vx, vy), abs(omega) / kappa_g), 1e-300)
    sx, sy = vx / v_s, vy / v_s
    share = math.hypot(sx, sy)
    ex, ey = (sx / share, sy / share) if share > 0.0 else (1.0, 0.0)
    across = abs(ey * row[ZONE_ARM] - ex * row[ZONE_ARM + 1])
    if row[ZONE_LINE] > 0.0 or not share > POLE:
        across = row[ZONE_POLE]
    zx, zy = ux / v_s, uy / v_s
    asked = row[ZONE_KAPPA] * across + row[ZONE_BETA] * abs(sx * zx + sy * zy)
    return v_s, sx, sy, omega / kappa_g / v_s, asked, math.hypot(zx, zy)


@kernel(error_model="numpy")
def zone(s: Array, row: Array, vehicle: Array) -> None:
    """Bound what the guaranteed rates ask for, as `zone_bounds` does.

    Parameters
    ----------
    s : (ROOM,) float
        With the chord of the wheel.
    row : (PARAMETERS,) float
    vehicle : (BODY,) float
    """
    kx, ky, kappa_g = vehicle[0], vehicle[1], vehicle[2]
    arm, reach = math.hypot(row[ZONE_ARM], row[ZONE_ARM + 1]), math.hypot(kx, ky)
    of_kappa, of_beta = row[ZONE_KAPPA], row[ZONE_BETA]
    for k in range(LANES):
        w0, w1, dt = s[V0 + 2 * LANES + k], s[V1 + 2 * LANES + k], s[DT + k]
        px, py = s[V0 + k] - w0 * ky, s[V0 + LANES + k] + w0 * kx
        qx, qy = s[V1 + k] - w1 * ky, s[V1 + LANES + k] + w1 * kx
        v0, x0, y0, s0, asked0, room0 = _asked(
            px, py, w0, s[AX + k], s[AY + k], kappa_g, row
        )
        v1, x1, y1, s1, asked1, room1 = _asked(
            qx, qy, w1, s[BX + k], s[BY + k], kappa_g, row
        )
        slowest, fastest = min(v0, v1), max(v0, v1)
        excess = dt * dt / 8
        spread = 2 * excess * (s[VB + k] + s[WB + k] / kappa_g) / slowest
        moved = 2 * math.hypot(x1 - x0, y1 - y0) + 2 * abs(s1 - s0) + spread
        # The chord of K: how near it comes to zero, and how far it turns.
        radius = excess * (s[VB + k] + s[WB + k] * reach)
        dx, dy = qx - px, qy - py
        length = dx * dx + dy * dy
        f = -(px * dx + py * dy) / (length if length > 0.0 else 1.0)
        f = min(max(f, 0.0), 1.0)
        largest = max(math.hypot(px, py), math.hypot(qx, qy))
        near = math.hypot(px + f * dx, py + f * dy) - radius - 1e-14 * largest
        sweep = math.pi
        if near > POLE * fastest * (1 + spread):
            sweep = abs(math.atan2(qy * px - qx * py, qx * px + qy * py))
            sweep += math.asin(min(radius / (near + radius), 1.0))
        slack = of_kappa * arm * sweep + of_beta * 2 * (2 + arm) * moved
        c = max(math.hypot(x0, y0), math.hypot(x1, y1))
        c = min(c + moved, 1.0)
        most = of_kappa * row[ZONE_POLE] + of_beta * c * (c + arm)
        asked = min(max(asked0, asked1) + slack, most)
        nearest = min(room0, room1) - (1 + arm) * moved
        room = max(nearest, s[NEAR + k] / max(fastest * (1 + spread), 1e-300))
        low = 0.0
        if s[MOVES0 + k] > 0.0 and room0 > 0.0:
            low = asked0 / room0**2
        if s[MOVES1 + k] > 0.0 and room1 > 0.0:
            low = max(low, asked1 / room1**2)
        s[LOW + k] = low
        s[HIGH + k] = max(asked / room**2, low) if room > 0.0 else math.inf


@kernel(error_model="numpy")
def steering(s: Array, lever: float, limit: float) -> None:
    """Bound |v_n| and what steering takes of a rolling speed together.

    `LOW` and `HIGH` hold those of |α̇|, by `rate` for a limit of 1.
    """
    share = lever / limit
    for k in range(LANES):
        driven = max(s[SWUNG + k], s[SWUNG + LANES + k])
        s[LOW + k] = driven if s[LOW + k] * share > 0.0 else 0.0
        s[HIGH + k] = driven + s[HIGH + k] * share


@kernel(error_model="numpy")
def _swing_at(s: Array, k: int, x: float, y: float, arm: float) -> Any:
    """Return α̈ at both ends by the directions of `swings`, and what may exceed it.

    As `Directions.accelerations` does; 0 at an end at rest, and the excess infinite.
    """
    # d_0 to d_2 of the wheel at both ends, from those of the origin and ω.
    p0, q0, p1, q1, p2, q2 = _vectors(s, SWUNG, k, x, y)
    a0, b0, a1, b1, a2, b2 = _vectors(s, SWUNG + 9 * LANES, k, x, y)
    m0 = s[SWUNG + 18 * LANES + k] + arm * s[SWUNG + 22 * LANES + k]
    m1 = s[SWUNG + 19 * LANES + k] + arm * s[SWUNG + 23 * LANES + k]
    m2, m3 = s[SWUNG + 20 * LANES + k], s[SWUNG + 21 * LANES + k]
    dt = s[DT + k]
    bent = dt * dt / 8
    # Near the centre of rotation the ends tell more.
    m0 = min(m0, max(math.hypot(p1, q1), math.hypot(a1, b1)) + bent * m2)
    m1 = min(m1, max(math.hypot(p2, q2), math.hypot(a2, b2)) + bent * m3)
    ca, cb = a0 - p0, b0 - q0
    length = ca * ca + cb * cb
    f = -(p0 * ca + q0 * cb) / (length if length > 0.0 else 1.0)
    f = min(max(f, 0.0), 1.0)
    largest = max(math.hypot(p0, q0), math.hypot(a0, b0))
    near = math.hypot(p0 + f * ca, q0 + f * cb) - bent * m1 - 1e-14 * largest
    l1, l2, l3, l4 = m0 / near, m1 / near, m2 / near, m3 / near
    third = l3 + 3 * l1 * l2 + 2 * l1**3
    fourth = l4 + 4 * l1 * l3 + 3 * l2**2 + 12 * l1**2 * l2 + 6 * l1**4
    known = near > 0.0 and third < math.inf and fourth < math.inf
    more = min(dt / 2 * third, bent * fourth) if known else math.inf
    return _bent(p0, q0, p1, q1, p2, q2), _bent(a0, b0, a1, b1, a2, b2), more


@kernel(error_model="numpy")
def swinging(s: Array, x: float, y: float, limit: float) -> None:
    """Bound |α̈|. Of an end at rest nothing is reached; the bound is infinite there."""
    per, arm = 1.0 / limit, math.hypot(x, y)
    for k in range(LANES):
        first, last, more = _swing_at(s, k, x, y, arm)
        start, end = abs(first), abs(last)
        on0 = s[MOVES0 + k] > 0.0 and s[NA + k] > 1e-9 * s[MOVES0 + k]
        on1 = s[MOVES1 + k] > 0.0 and s[NB + k] > 1e-9 * s[MOVES1 + k]
        s[LOW + k] = max(start if on0 else 0.0, end if on1 else 0.0) * per
        s[HIGH + k] = (max(start, end) + more) * per


@kernel(error_model="numpy")
def beside_growth(
    s: Array, x: float, y: float, offset: float, coupling: float, sign: float,
    limit: float,
) -> None:  # fmt: skip
    """Bound |dû/dt| + k |α̈|, as `beside_gain` does.

    `LOW` and `HIGH` hold the growth of the axis, which counts where the vehicle stands
    or where it is not known how directions swing.
    """
    per, arm, lever = 1.0 / limit, math.hypot(x, y), abs(offset) + coupling
    for k in range(LANES):
        is_known = s[SWUNG + 24 * LANES + k] > 0.0 and not s[STANDS + k] > 0.0
        if not is_known:
            continue
        b0, b1, more = _swing_at(s, k, x, y, arm)
        e0, e1 = s[A0 + 2 * LANES + k], s[A1 + 2 * LANES + k]
        na, nb, near, dt = s[NA + k], s[NB + k], s[NEAR + k], s[DT + k]
        n0 = s[DAX + k] * s[AX + k] + s[DAY + k] * s[AY + k]
        n1 = s[DBX + k] * s[BX + k] + s[DBY + k] * s[BY + k]
        g0, g1 = n0 / max(na, 1e-300), n1 / max(nb, 1e-300)
        start = abs(g0 - sign * (e0 + b0) * offset) + coupling * abs(b0)
        end = abs(g1 - sign * (e1 + b1) * offset) + coupling * abs(b1)
        on0 = s[MOVES0 + k] > 0.0 and na > 1e-9 * s[MOVES0 + k]
        on1 = s[MOVES1 + k] > 0.0 and nb > 1e-9 * s[MOVES1 + k]
        s[LOW + k] = max(start if on0 else 0.0, end if on1 else 0.0) * per
        bend, gain, third = s[BEND + k], s[REACH + k], s[J3 + k]
        turned = dt / 2 * s[WB + k]
        fine = math.inf
        if near > 0.0:
            l1 = gain / near
            slope = bend + gain * l1
            grown = min(
                dt / 2 * slope,
                dt * dt / 8 * (third + 6 * bend * l1 + 3 * gain * l1 * l1),
            )
            fine = max(start, end) + grown + abs(offset) * turned + lever * more
        most = max(abs(b0), abs(b1)) + more
        coarse = gain + abs(offset) * (max(abs(e0), abs(e1)) + turned) + lever * most
        s[HIGH + k] = min(fine, coarse) * per


@kernel(error_model="numpy")
def _vectors(s: Array, at: int, k: int, x: float, y: float) -> Any:
    """Return a direction of a point and its two derivatives at an end of a part."""
    w0, w1, w2 = (
        s[at + 6 * LANES + k], s[at + 7 * LANES + k], s[at + 8 * LANES + k],
    )  # fmt: skip
    return (
        s[at + k] - w0 * y,
        s[at + LANES + k] + w0 * x,
        s[at + 2 * LANES + k] - w1 * y,
        s[at + 3 * LANES + k] + w1 * x,
        s[at + 4 * LANES + k] - w2 * y,
        s[at + 5 * LANES + k] + w2 * x,
    )


@kernel(error_model="numpy")
def _bent(p0: float, q0: float, p1: float, q1: float, p2: float, q2: float) -> float:
    """Return Im(d₂/d₀ - (d₁/d₀)²); 0 where the direction is not known."""
    square = p0 * p0 + q0 * q0
    if not square > 0.0:
        return 0.0
    across, along = (q1 * p0 - p1 * q0) / square, (p1 * p0 + q1 * q0) / square
    bent: float = (q2 * p0 - p2 * q0) / square - 2 * across * along
    return bent if math.isfinite(bent) else 0.0
