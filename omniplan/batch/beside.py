"""What wheels roll beside their axis or share with steering, in numba.

The formulas of `judging.beside`: rolling speeds, how they change, and how steering
rates do.
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
    HIGH,
    J3,
    LOW,
    MOVES0,
    MOVES1,
    NA,
    NB,
    NEAR,
    REACH,
    STANDS,
    SWUNG,
    V0,
    V1,
    WB,
)
from omniplan.batch.kernel import kernel
from omniplan.batch.motions import LANES

__all__ = ["beside", "beside_growth", "swinging"]

Array = Any  # numba infers the types; mypy cannot look into the kernels


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
