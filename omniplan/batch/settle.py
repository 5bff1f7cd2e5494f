"""Whether single twists are permitted: `PermissibleSpace.contains`, in numba.

The tables first, bilinear and by parts of cells; in what they leave open the exact rows
of the vehicle, if it is known. Point by point the same answer as `configspace.space`
and `configspace.exact`, which stay the reference.

numba keeps compiled code per file and does not notice that a function of another file
has changed: after a change of `configspace.row_bounds.load_at` clear the caches.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from configspace import PermissibleSpace
from configspace.kernels import MIXED
from configspace.limits import LoadRow, SectorRow, rows_of
from configspace.omni_curve import POLE
from configspace.row_bounds import DISC, EDGE, LATERAL, OFFSET, STRIP, load_at

__all__ = ["Sheet", "settle", "sheet_of"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

KINDS = {
    "disc": DISC,
    "strip": STRIP,
    "offset": OFFSET,
    "lateral": LATERAL,
    "edge": EDGE,
}


@dataclass(frozen=True, eq=False)
class Sheet:
    """What the kernels know of a space, as flat arrays."""

    tables: tuple[Array, Array, Array]
    """Loads (d, k + 1, m + 1), states (k, m) and parts (k, m)."""
    loads: tuple[Array, ...]
    """kind, p, b, n = exp(j ν), d and whether it holds only backwards, per row."""
    sectors: tuple[Array, ...]
    """b, middle, half, pole arm, κ_n and β share, per steered wheel."""
    is_exact: bool
    """Whether the vehicle is known, so that the rows settle what tables leave open."""


def sheet_of(space: PermissibleSpace) -> Sheet:
    """Return a space as flat arrays."""
    vehicle = space.vehicle
    loads: tuple[LoadRow, ...] = ()
    sectors: tuple[SectorRow, ...] = ()
    if vehicle is not None:
        loads, sectors = rows_of(vehicle)
    t = space.tables
    return Sheet(
        (t.load, t.state, t.parts),
        (
            np.array([KINDS[row.kind] for row in loads], np.int64),
            np.array([row.p for row in loads], np.float64),
            np.array([row.b for row in loads], np.complex128),
            np.array([cmath.exp(1j * row.nu) for row in loads], np.complex128),
            np.array([row.d for row in loads], np.float64),
            np.array([x.direction == "reverse" for x in loads], np.bool_),
        ),
        (
            np.array([row.b for row in sectors], np.complex128),
            np.array([row.middle for row in sectors], np.float64),
            np.array([row.half for row in sectors], np.float64),
            np.array([row.pole_arm for row in sectors], np.float64),
            np.array([row.kappa_share for row in sectors], np.float64),
            np.array([row.beta_share for row in sectors], np.float64),
        ),
        vehicle is not None,
    )


@njit(cache=True)
def settle(
    twists: Array, which: Array, count: int, out: Array, point: tuple[float, ...],
    bound: tuple[float, ...], tables: tuple[Array, ...], loads: tuple[Array, ...],
    sectors: tuple[Array, ...], is_exact: bool,
) -> int:  # fmt: skip
    """Decide some twists in float64; return the first that is not finite, or -1.

    All in one loop: to hand so many arrays on takes longer than what is computed.

    Parameters
    ----------
    twists : (3 n,) float32 or float64
    which : (m,) int
        Which of them; only the first `count` are meant.
    count : int
    out : (n,) uint8
        Gets 0 or 1.
    point : x and y of K in m, κ_g in 1/m
    bound
        Line-mobile? translating? the line in rad, sine of the slip angle, slip speed.
    tables, loads, sectors, is_exact
        Of a `Sheet`.
    """
    load, state, parts = tables
    kind, p, lever, n, d, only_backwards = loads
    b, middle, half, pole_arm, kappa_share, beta_share = sectors
    rx, ry, kappa_g = point
    is_line, is_translating, line, sine, slip = bound
    rows, columns = state.shape
    cos_line, sin_line = math.cos(line), math.sin(line)
    for at in range(count):
        i = which[at]
        vx, vy = float(twists[3 * i]), float(twists[3 * i + 1])
        omega = float(twists[3 * i + 2])
        if not (abs(vx) < np.inf and abs(vy) < np.inf and abs(omega) < np.inf):
            return int(i)
        x, y, z = vx - omega * ry, vy + omega * rx, omega / kappa_g
        out[i] = 0
        if is_line or is_translating:
            v_s = max(math.hypot(x, y), abs(z))
            aside = abs(y * cos_line - x * sin_line) if is_line else abs(z)
            if aside > max(sine * v_s, slip):
                continue
            if is_line:
                x, y = x * cos_line + y * sin_line, 0.0
            else:
                z = 0.0
        size = math.hypot(x, y)
        v_s = max(size, abs(z))
        if v_s == 0:
            out[i] = 1
            continue
        for backwards in (0, 1):
            sign = 1.0 - 2.0 * backwards
            if is_line and sign * x < 0:  # β would be off the line
                continue
            kappa_n = abs(z) / v_s if abs(z) < size else 2.0 - size / v_s
            if sign * z < 0:
                kappa_n = -kappa_n
            beta = 0.0
            if is_line:
                beta = line
            elif size > 0:
                # Adding 0.0 turns -0.0 into 0.0.
                beta = math.atan2(sign * y + 0.0, sign * x + 0.0)
            # The tables, as `PermissibleSpace.v_max` reads them.
            row, fk, column, fb = 0, 0.0, 0, 0.0
            if not is_translating:
                place = (kappa_n + 2) * (rows / 4)
                row = min(max(int(place), 0), rows - 1)
                fk = place - row
            if columns > 1:
                place = ((beta + np.pi) % (2 * np.pi)) * (columns / (2 * np.pi))
                column = min(max(int(place), 0), columns - 1)
                fb = min(max(place - column, 0.0), 1.0)
            back = backwards if load.shape[0] > 1 else 0
            part = 4 * int(min(4 * fk, 3.0)) + int(min(4 * fb, 3.0))
            if (parts[row, column] >> part) & 1 == 1:
                below = (1 - fb) * load[back, row, column]
                below += fb * load[back, row, column + 1]
                above = (1 - fb) * load[back, row + 1, column]
                above += fb * load[back, row + 1, column + 1]
                largest = (1 - fk) * below + fk * above
                if v_s <= (1 - 1e-15) / math.sqrt(largest):
                    out[i] = 1
                    break
                continue
            if state[row, column] != MIXED or not is_exact:
                continue
            # The rows, as `exact_v_max` does.
            c, s = min(1.0, 2.0 - abs(kappa_n)), min(max(kappa_n, -1.0), 1.0)
            e = complex(math.cos(beta), math.sin(beta))
            is_open = True
            for q in range(b.size):
                if _is_blocked(
                    b[q], middle[q], half[q], pole_arm[q], kappa_share[q],
                    beta_share[q], c, s, e,
                ):  # fmt: skip
                    is_open = False
                    break
            if not is_open:
                continue
            most = 0.0
            for r in range(kind.size):
                if back == 1 or not only_backwards[r]:
                    one = load_at(kind[r], p[r], lever[r], n[r], d[r], c, s, e)
                    most = max(most, one)
            if most == 0 or v_s <= 1.0 / math.sqrt(most):
                out[i] = 1
                break
    return -1


@njit(cache=True)
def _is_blocked(
    b: complex, middle: float, half: float, pole_arm: float, kappa_share: float,
    beta_share: float, c: float, s: float, e: complex,
) -> bool:  # fmt: skip
    """Return whether one steered wheel blocks a configuration."""
    z = c * e + s * b
    if abs(z) < 1e-12:
        return True
    if kappa_share > 0 or beta_share > 0:
        turn = e * b.conjugate()
        across = abs(turn.imag) if c > POLE else pole_arm
        asked = kappa_share * across + beta_share * abs(c * (c + s * turn.real))
        if asked - (z.real * z.real + z.imag * z.imag) - 1e-14 > 0:
            return True
    if half < np.inf:
        aside = math.atan2(z.imag, z.real) - middle
        if aside <= -np.pi or aside > np.pi:
            aside = math.atan2(math.sin(aside), math.cos(aside))
        return bool(abs(aside) - half - 1e-14 > 0)
    return False
