"""What steered wheels are asked for, over several parts at once, in numba.

The formulas of `vehicle_judge`: where a wheel points, how fast it turns, which rates
are guaranteed; see `beside` for what it rolls beside its axis.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

from configspace.omni_curve import POLE
from omniplan.batch.chords import (
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
    SWUNG,
    V0,
    V1,
    VB,
    WB,
)
from omniplan.batch.kernel import kernel
from omniplan.batch.kinds import (
    RANGE_ERROR,
    ZONE_ARM,
    ZONE_BETA,
    ZONE_KAPPA,
    ZONE_LINE,
    ZONE_POLE,
)
from omniplan.batch.motions import LANES

__all__ = [
    "arc_cosine",
    "exact_range",
    "open_range",
    "quick_range",
    "rate",
    "singular",
    "steering",
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
def open_range(
    s: Array, sign: float, cos: float, sin: float, middle: float, half: float
) -> None:
    """Like `exact_range`, but without arc tangents where `quick_range` is enough.

    That is where the range is kept for sure: there its bounds are told, `RANGE_ERROR`
    farther apart.
    """
    quick_range(s, sign, cos, sin, half)
    error, is_open = RANGE_ERROR / half, False
    for k in range(LANES):
        s[HIGH + k] += error
        low = s[LOW + k] - error
        s[LOW + k] = low if low > 0.0 else 0.0
        is_open |= s[HIGH + k] > 1.0
    if is_open:
        exact_range(s, sign, middle, half, 1.0)


@kernel(error_model="numpy")
def exact_range(
    s: Array, sign: float, middle: float, half: float, least: float
) -> None:
    """Like `quick_range`, by the arc tangents of `VehicleJudge`; with the change.

    Parts whose `HIGH` is not above `least` are left as they are.
    """
    for k in range(LANES):
        if s[HIGH + k] <= least:
            continue
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
