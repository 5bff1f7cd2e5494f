"""Velocity vectors over several parts at once, in numba: `chords` lane by lane.

A scratch array holds a block of parts, field by field, `LANES` numbers each. As all
places in it are known when the loops are compiled, they become vector code.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

from omniplan.batch.kernel import kernel
from omniplan.batch.motions import FIELDS, LANES, SWING_FIELDS

__all__ = ["ROOM", "body", "change", "chord", "ends", "reach"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

# Where the fields of a block begin in the scratch array: those of `enclose` ...
V0, V1, A0, A1 = (i * LANES for i in (0, 3, 6, 9))
VB, WB, DT, J0, J3 = (i * LANES for i in (12, 13, 14, 17, 20))
# ... the speed of the body, and whether it moves at the ends or stands throughout ...
SLOW, FAST, MOVES0, MOVES1, STANDS = ((FIELDS + i) * LANES for i in range(5))
# ... a chord and its change at a point ...
AX, AY, BX, BY, NA, NB = ((FIELDS + 5 + i) * LANES for i in range(6))
NEAR, FAR, RADIUS = ((FIELDS + 11 + i) * LANES for i in range(3))
DAX, DAY, DBX, DBY, BEND, REACH = ((FIELDS + 14 + i) * LANES for i in range(6))
# ... and what a row says.
LOW, HIGH = ((FIELDS + 20 + i) * LANES for i in range(2))
# ... and how directions swing: see `swings`.
SWUNG = (FIELDS + 22) * LANES
ROOM = SWUNG + SWING_FIELDS * LANES
"""Size of the scratch array of a block."""


@kernel(error_model="numpy")
def ends(s: Array, x: float, y: float) -> None:
    """Write the ends and the radius of `Chord.of` a point of the body."""
    arm = math.sqrt(x * x + y * y)
    for k in range(LANES):
        w0, w1 = s[V0 + 2 * LANES + k], s[V1 + 2 * LANES + k]
        dt = s[DT + k]
        s[AX + k], s[AY + k] = s[V0 + k] - w0 * y, s[V0 + LANES + k] + w0 * x
        s[BX + k], s[BY + k] = s[V1 + k] - w1 * y, s[V1 + LANES + k] + w1 * x
        s[RADIUS + k] = dt * dt / 8 * (s[VB + k] + s[WB + k] * arm)


@kernel(error_model="numpy")
def chord(s: Array, x: float, y: float) -> None:
    """Write `Chord.of` a point of the body."""
    ends(s, x, y)
    for k in range(LANES):
        ax, ay, bx, by = s[AX + k], s[AY + k], s[BX + k], s[BY + k]
        na, nb = math.sqrt(ax * ax + ay * ay), math.sqrt(bx * bx + by * by)
        radius = s[RADIUS + k]
        dx, dy = bx - ax, by - ay
        length = dx * dx + dy * dy
        length = length if length > 0.0 else 1.0
        f = -(ax * dx + ay * dy) / length
        f = f if f > 0.0 else 0.0
        f = f if f < 1.0 else 1.0
        cx, cy = ax + f * dx, ay + f * dy
        most = na if na > nb else nb
        near = math.sqrt(cx * cx + cy * cy) - radius - 1e-14 * most
        s[NA + k], s[NB + k] = na, nb
        s[NEAR + k] = near if near > 0.0 else 0.0
        s[FAR + k] = most + radius


@kernel(error_model="numpy")
def change(s: Array, x: float, y: float) -> None:
    """Write `Change.of` a point of the body, without its largest size."""
    arm = math.sqrt(x * x + y * y)
    for k in range(LANES):
        w0, w1 = s[A0 + 2 * LANES + k], s[A1 + 2 * LANES + k]
        s[DAX + k], s[DAY + k] = s[A0 + k] - w0 * y, s[A0 + LANES + k] + w0 * x
        s[DBX + k], s[DBY + k] = s[A1 + k] - w1 * y, s[A1 + LANES + k] + w1 * x
        s[BEND + k] = s[VB + k] + s[WB + k] * arm


@kernel(error_model="numpy")
def reach(s: Array) -> None:
    """Write the largest size of a change."""
    for k in range(LANES):
        ax, ay, bx, by = s[DAX + k], s[DAY + k], s[DBX + k], s[DBY + k]
        a, b = ax * ax + ay * ay, bx * bx + by * by
        s[REACH + k] = math.sqrt(a if a > b else b) + s[DT + k] / 2 * s[BEND + k]


@kernel(error_model="numpy")
def body(s: Array, x: float, y: float, kappa_g: float, standstill: float) -> None:
    """Speeds of the body with K at (x, y); whether it moves at the ends, or stands.

    `speed_of` and `ends_moving` of `chords`.

    Parameters
    ----------
    s : (ROOM,) float
        The enclosures are in its first fields.
    x, y : float, m
    kappa_g : float, 1/m
    standstill : float, m/s
    """
    chord(s, x, y)
    for k in range(LANES):
        w0, w1 = s[V0 + 2 * LANES + k], s[V1 + 2 * LANES + k]
        q0, q1 = abs(w0) / kappa_g, abs(w1) / kappa_g
        dt = s[DT + k]
        spread = dt * dt / 8 * s[WB + k] / kappa_g
        least, most = (q0 if q0 < q1 else q1) - spread, (q0 if q0 > q1 else q1) + spread
        least = least if w0 * w1 > 0.0 else 0.0
        near, far = s[NEAR + k], s[FAR + k]
        s[SLOW + k] = near if near > least else least
        fast = far if far > most else most
        s[FAST + k] = fast
        v0, v1 = s[NA + k], s[NB + k]
        v0 = v0 if v0 > q0 else q0
        v1 = v1 if v1 > q1 else q1
        s[MOVES0 + k] = v0 if v0 > standstill else 0.0
        s[MOVES1 + k] = v1 if v1 > standstill else 0.0
        s[STANDS + k] = 1.0 if fast <= standstill else 0.0
