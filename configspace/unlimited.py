"""Whether some permitted configuration has no speed limit at all.

A cell's least load is bounded by the largest of its rows' least values, which may be 0
though no point of the cell is free of load: such cells are suspects, to be searched.
Two searches find what counts, a permitted configuration where every load vanishes:

- suspects are sampled, all over where they are `FREE`, at permitted points elsewhere;
- a wheel beside its steering axis stands still where the centre of rotation is under
  it, on a circle in the plane of centres around its axis. The circle may be smaller
  than any cell, so it is followed itself.

Next to the singular point of a wheel on its axis speeds grow beyond any bound, yet each
configuration has one (the point itself is blocked): that is permitted.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from configspace.exact import is_blocked, largest_load, load_of
from configspace.limits import LoadRow, SectorRow
from configspace.omni_curve import components
from configspace.row_bounds import BLOCKED, FREE
from configspace.vehicle import Vehicle

__all__ = ["is_unlimited"]

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
BoolArray = npt.NDArray[np.bool_]

_STEPS = np.linspace(0, 1, 65)
_TURN = np.linspace(-np.pi, np.pi, 2880, endpoint=False)
_VANISHING = 1e-12


def is_unlimited(
    vehicle: Vehicle,
    rows: Sequence[LoadRow],
    sectors: Sequence[SectorRow],
    edges: tuple[FloatArray, FloatArray],
    low: FloatArray,
    state: npt.NDArray[np.uint8],
) -> bool:
    """Return whether some permitted configuration is free of any load.

    What the step of a search cannot tell from no limit counts as none.

    Parameters
    ----------
    vehicle : Vehicle
    rows : sequence of LoadRow
        Those of one driving direction.
    sectors : sequence of SectorRow
    edges : (k + 1,) float and (m + 1,) float, 1 and rad
        κ_n and β at the edges of the cells.
    low : (k, m) float, (m/s)⁻²
        What the squared load is at least, all over a cell.
    state : (k, m) uint8
    """
    if not rows:
        return True
    if _stands_still(vehicle, rows, sectors):
        return True
    # What changes as fast as a disc or strip does; the others do not bound alone.
    steepest = max(row.p + abs(row.b) for row in rows)
    slowest = min((row.p for row in rows if row.p > 0), default=1.0)
    kappa, beta = edges
    for k, m in np.argwhere((state != BLOCKED) & (low < _VANISHING)):
        at_kappa = kappa[k] + _STEPS * (kappa[k + 1] - kappa[k])
        at_beta = beta[m] + _STEPS * (beta[m + 1] - beta[m])
        c, s = (x[:, None] for x in components(at_kappa))
        e = np.exp(1j * at_beta)[None, :]
        step = (kappa[k + 1] - kappa[k] + beta[m + 1] - beta[m]) / 128
        free = largest_load(rows, c, s, e) <= (steepest * step) ** 2
        if free.any() and state[k, m] != FREE:
            reach = 2 * steepest * step / slowest
            free &= _is_open(vehicle, sectors, c, s, e, reach)
        if free.any():
            return True
    return False


def _is_open(
    vehicle: Vehicle,
    sectors: Sequence[SectorRow],
    c: FloatArray,
    s: FloatArray,
    e: ComplexArray,
    reach: float,
) -> BoolArray:
    """Return what is permitted and not within `reach` of a wheel's singular point."""
    open_ = ~is_blocked(vehicle, sectors, *np.broadcast_arrays(c, s, e))
    for row in sectors:
        open_ &= np.abs(c * e + s * row.b) > reach
    return np.asarray(open_)


def _stands_still(
    vehicle: Vehicle, rows: Sequence[LoadRow], sectors: Sequence[SectorRow]
) -> bool:
    """Return whether nothing bounds the speed where some wheel beside its axis stands.

    There ``|z| = s d`` for a row of kind ``offset``.
    """
    steepest = max(row.p + abs(row.b) + abs(row.d) for row in rows)
    for row in rows:
        if row.kind != "offset":
            continue
        line = vehicle.mobility.line_beta
        if line is None:
            c, s, e = _around(row)
            step = abs(row.d) / row.p * math.pi / _TURN.size
        else:
            c, s, e = _on_line(row, cmath.exp(1j * line))
            step = 0.0
        tolerance = (_VANISHING + 2 * steepest * step) ** 2
        for other in rows:  # most of them bound all that is left, at once
            free = load_of(other, c, s, e) <= tolerance
            c, s, e = c[free], s[free], e[free]
            if not c.size:
                break
        if not is_blocked(vehicle, sectors, c, s, e).all():
            return True
    return False


def _around(row: LoadRow) -> tuple[FloatArray, FloatArray, ComplexArray]:
    """Return configurations in which the wheel of an offset row stands still.

    ``z = s d e^{jα}`` for every steering angle α: ``c e^{jβ} p = s (d e^{jα} - b)``.
    """
    sign = math.copysign(1.0, row.d)
    arm = sign * (row.d * np.exp(1j * _TURN) - row.b) / row.p
    ratio = np.abs(arm)  # c / |s|
    c, s = _components(ratio)
    moves = ratio > 0
    e = np.where(moves, arm, 1.0) / np.where(moves, ratio, 1.0)
    return c, sign * s, np.asarray(e, np.complex128)


def _on_line(row: LoadRow, e: complex) -> tuple[FloatArray, FloatArray, ComplexArray]:
    """Return the same for the one β of a line-mobile vehicle: roots in c / |s|."""
    sign = math.copysign(1.0, row.d)
    middle = sign * (row.b * e.conjugate()).real
    under = middle**2 - abs(row.b) ** 2 + row.d**2
    roots = np.array([-1.0, 1.0]) * math.sqrt(max(under, 0.0)) - middle
    ratio = roots[(roots >= 0) & (under >= 0)] / row.p
    c, s = _components(ratio)
    return c, sign * s, np.full(c.shape, e)


def _components(ratio: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return c and |s| whose ratio is given."""
    return np.minimum(ratio, 1.0), 1 / np.maximum(ratio, 1.0)
