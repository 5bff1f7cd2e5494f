"""Sizes and components of velocities over several parts at once, in numba.

The formulas of `vehicle_judge` and `body_rows` for what rolls and for the body.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

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
    LOW,
    NA,
    NB,
    NEAR,
    RADIUS,
    REACH,
    SLOW,
    SWUNG,
    V0,
    V1,
    WB,
)
from omniplan.batch.kernel import kernel
from omniplan.batch.motions import LANES

__all__ = [
    "backwards",
    "component",
    "driven",
    "growth",
    "lateral",
    "off_line",
    "parallel",
    "slip",
    "speed",
    "tipping",
    "yaw",
]

Array = Any  # numba infers the types; mypy cannot look into the kernels


@kernel(error_model="numpy")
def speed(s: Array, limit: float) -> None:
    """Bound the size of a velocity."""
    per = 1.0 / limit
    for k in range(LANES):
        na, nb = s[NA + k], s[NB + k]
        s[LOW + k] = (na if na > nb else nb) * per
        s[HIGH + k] = s[FAR + k] * per


@kernel(error_model="numpy")
def component(s: Array, x: float, y: float, limit: float, is_change: int) -> None:
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


@kernel(error_model="numpy")
def slip(s: Array, x: float, y: float, sine: float, speed: float) -> None:
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


@kernel(error_model="numpy")
def parallel(s: Array, kappa_g: float, sine: float, speed: float) -> None:
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


@kernel(error_model="numpy")
def growth(s: Array, side: float, limit: float) -> None:
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


@kernel(error_model="numpy")
def yaw(s: Array, limit: float) -> None:
    """Bound |ω|."""
    per = 1.0 / limit
    for k in range(LANES):
        w0, w1 = abs(s[V0 + 2 * LANES + k]), abs(s[V1 + 2 * LANES + k])
        most = w0 if w0 > w1 else w1
        dt = s[DT + k]
        s[LOW + k] = most * per
        s[HIGH + k] = (most + dt * dt / 8 * s[WB + k]) * per


@kernel(error_model="numpy")
def lateral(s: Array, limit: float) -> None:
    """|ω v_P|."""
    per = 1.0 / limit
    for k in range(LANES):
        w0, w1 = abs(s[V0 + 2 * LANES + k]), abs(s[V1 + 2 * LANES + k])
        a, b = s[NA + k] * w0, s[NB + k] * w1
        dt = s[DT + k]
        yaw = (w0 if w0 > w1 else w1) + dt * dt / 8 * s[WB + k]
        s[LOW + k] = (a if a > b else b) * per
        s[HIGH + k] = s[FAR + k] * yaw * per


@kernel(error_model="numpy")
def tipping(s: Array, x: float, y: float, limit: float) -> None:
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


@kernel(error_model="numpy")
def driven(s: Array) -> None:
    """Bound |v_n|, which is linear over a part."""
    for k in range(LANES):
        most = max(s[SWUNG + k], s[SWUNG + LANES + k])
        s[LOW + k] = most
        s[HIGH + k] = most


@kernel(error_model="numpy")
def off_line(s: Array, line: float, limit: float) -> None:
    """Hold a direction against a constant one, as `off_line` of `chords` does.

    β is linear between the ends, so these tell of all the part; at a pole it has no
    meaning.
    """
    for k in range(LANES):
        most = 0.0
        if s[NA + k] > 1e-12:
            off = math.atan2(s[AY + k], s[AX + k]) - line
            most = abs(math.atan2(math.sin(off), math.cos(off)))
        if s[NB + k] > 1e-12:
            off = math.atan2(s[BY + k], s[BX + k]) - line
            most = max(most, abs(math.atan2(math.sin(off), math.cos(off))))
        s[LOW + k] = most / limit
        s[HIGH + k] = most / limit


@kernel(error_model="numpy")
def backwards(s: Array, x: float, y: float, floor: float, limit: float) -> None:
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
