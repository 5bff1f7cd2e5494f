"""Cubic splines through samples, at rest at their ends where asked.

The same numbers as `scipy.interpolate.CubicSpline`, without the checks that samples
have passed already: of short motions those took most of the time.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.linalg import LinAlgError
from scipy.linalg.lapack import dgtsv

__all__ = ["spline"]

FloatArray = npt.NDArray[np.float64]


def spline(t: FloatArray, values: FloatArray, rest0: bool, rest1: bool) -> FloatArray:
    """Return cubic coefficients of a C² spline, highest power first.

    Parameters
    ----------
    t : (n,) float, s
        Strictly increasing, n ≥ 2.
    values : (n, ...) float
    rest0, rest1 : bool
        Whether the first derivative is zero at the start and at the end. A free end
        has no jump of the third derivative at the next sample; of fewer than four
        samples its second derivative is zero.

    Returns
    -------
    coefficients : (4, n - 1, ...) float
        In the time since each sample.

    References
    ----------
    de Boor, A Practical Guide to Splines, chapter IV: the tridiagonal system of the
    first derivatives.
    """
    y = values.reshape(len(t), -1)
    step = np.diff(t)
    across = step[:, None]
    slope = np.diff(y, axis=0) / across
    lower, upper = np.empty(step.size), np.empty(step.size)
    diagonal, right = np.empty(t.size), np.empty(y.shape)
    diagonal[1:-1] = 2 * (step[:-1] + step[1:])
    upper[1:], lower[:-1] = step[:-1], step[1:]
    right[1:-1] = 3 * (across[1:] * slope[:-1] + across[:-1] * slope[1:])
    diagonal[0], upper[0], right[0] = _end(t[:3], y[:2], step, slope, rest0)
    back = slice(None, None, -1)
    diagonal[-1], lower[-1], right[-1] = _end(
        t[:-4:-1], y[-2:], step[back], slope[back], rest1
    )
    _, _, _, rate, info = dgtsv(lower, diagonal, upper, right, 1, 1, 1, 1)
    if info:
        raise LinAlgError(f"the splines through {t.size} samples are not determined")
    bend = (rate[:-1] + rate[1:] - 2 * slope) / across
    c = np.stack(
        [bend / across, (slope - rate[:-1]) / across - bend, rate[:-1], y[:-1]]
    )
    return c.reshape(4, step.size, *values.shape[1:])


def _end(
    t: FloatArray, y: FloatArray, step: FloatArray, slope: FloatArray, at_rest: bool
) -> tuple[float, float, FloatArray]:
    """Return the equation of an end: diagonal, beside it and right-hand side.

    Times, steps and slopes are counted from that end; `y` are the two values there, in
    order of time.
    """
    if at_rest:
        return 1.0, 0.0, np.zeros(slope.shape[1])
    if step.size < 3:
        return 2 * step[0], step[0], 3 * (y[1] - y[0])
    both = abs(t[2] - t[0])
    first = (step[0] + 2 * both) * step[1] * slope[0]
    return step[1], both, (first + step[0] * step[0] * slope[1]) / both
