"""The hot loop of `configspace.rate_cells`, in numba; its plain twin is in the tests.

Notation of spec/omni-curve §4 with ``b = j κ_g w``, ``e = e^{jβ}``: ``f = Re(e b̄)``,
``g = -Im(e b̄)``, ``Q = |z|²``. Extremes of numerators and of Q are exact up to
rounding, which `GUARD` covers.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit, prange

from configspace.bounds import GUARD, cos_range, disc_range, functional_range
from configspace.threads import RELEASES_LOCK

__all__ = ["fill_bounds"]

Array = Any  # numba infers the types; mypy cannot look into the kernels


@njit(cache=True, inline="always")
def _peak(low: float, high: float) -> float:
    """Largest size of a number between two bounds."""
    size: float = max(abs(low), abs(high))
    return size


@njit(cache=True, inline="always")
def _turn_with_beta(
    c0: float,
    s0: float,
    c1: float,
    s1: float,
    low: float,
    high: float,
    size: float,
    q: float,
    q_max: float,
) -> float:
    """Largest |∂α/∂β| over a cell; `low`, `high` bound f and `q`, `q_max` bound Q.

    The smaller of two bounds: of ``c (c + s f) / Q`` term by term, which is sharp where
    c is small, and of the same as ``(1 + (c² - s²|b|²) / Q) / 2``, where β enters once.
    """
    largest, c_max = 0.0, max(c0, c1)
    for f in (low, high):
        largest = max(largest, abs(c0 * (c0 + s0 * f)), abs(c1 * (c1 + s1 * f)))
        # s is constant where c varies: a parabola in c, its vertex at -s f / 2
        vertex = -s0 * f / 2
        if min(c0, c1) < vertex < c_max:
            largest = max(largest, vertex * vertex)
    by_terms = (largest + GUARD * c_max * (c_max + size)) / q
    d0, d1 = c0 * c0 - (s0 * size) ** 2, c1 * c1 - (s1 * size) ** 2
    least, most = min(d0, d1), max(d0, d1)
    bottom = least / (q_max if least > 0 else q)
    top = most / (q if most > 0 else q_max)
    once = (_peak(1 + bottom, 1 + top) + GUARD * (1 + _peak(bottom, top))) / 2
    smallest: float = min(by_terms, once, c_max / math.sqrt(q))
    return smallest


@njit(cache=True, inline="always")
def _slope(
    outer: bool,
    c0: float,
    s0: float,
    c1: float,
    s1: float,
    low: float,
    high: float,
    size: float,
) -> float:
    """Largest ``|Re(∂z/∂κ_n z̄)|`` over a cell; `low`, `high` bound f, `size` is |b|."""
    if outer:  # c + s f
        f0, f1 = min(s0 * low, s0 * high), max(s0 * low, s0 * high)
        peak = _peak(min(c0, c1) + f0, max(c0, c1) + f1)
    else:  # f + s |b|²
        bottom, top = functional_range(1.0, s0, 1.0, s1, low, high, size * size)
        peak = _peak(bottom, top)
    slope: float = peak + GUARD * (1 + size) * (1 + size)
    return slope


@njit(cache=True, inline="always")
def _steered(
    outer: bool,
    kink: float,
    c0: float,
    s0: float,
    c1: float,
    s1: float,
    e0: complex,
    e1: complex,
    b: complex,
) -> tuple[float, float, float, float, float, float]:
    """Bounds over a cell for a wheel that steers; `kink` is κ_n there or 0.

    Largest |∂α/∂κ_n|, |∂α/∂β|, |∂|z|/∂κ_n|, |∂|z|/∂β|, then least and largest |z|. The
    gradients are infinite where the least |z| is 0.
    """
    size = abs(b)
    low, high = cos_range(e0, e1, b)  # f = Re(e^{jβ} b̄)
    g_low, g_high = cos_range(e0, e1, -1j * b)
    q, largest = disc_range(c0, s0, c1, s1, 1.0, size * size, low, high)
    if q <= 0.0:
        return np.inf, np.inf, np.inf, np.inf, 0.0, math.sqrt(largest)
    z, c_max = math.sqrt(q), max(c0, c1)
    g = _peak(g_low, g_high) + GUARD * size
    turn = _turn_with_beta(c0, s0, c1, s1, low, high, size, q, largest)
    lever, other = (1.0, size) if outer else (size, 1.0)  # |∂z/∂κ_n| here and beyond
    speed = min(lever, _slope(outer, c0, s0, c1, s1, low, high, size) / z)
    if kink != 0.0:
        beyond = _slope(not outer, 1.0, kink, 1.0, kink, low, high, size) / z
        speed = max(speed, min(other, beyond))
    cs = max(c0 * abs(s0), c1 * abs(s1))
    return (
        min(g / q, lever / z),
        turn,
        speed,
        min(cs * g / z, c_max),
        z,
        math.sqrt(largest),
    )


@njit(cache=True, inline="always")
def _unsteered(
    outer: bool,
    kink: float,
    c0: float,
    s0: float,
    c1: float,
    s1: float,
    e0: complex,
    e1: complex,
    b: complex,
    n: complex,
) -> tuple[float, float, float]:
    """Largest |∂r/∂κ_n|, |∂r/∂β| and |r| over a cell, ``r = Re(z n̄)``."""
    h = b.real * n.real + b.imag * n.imag
    low, high = cos_range(e0, e1, n)
    side_low, side_high = cos_range(e0, e1, -1j * n)
    guard = GUARD * abs(n) * (1 + abs(b))
    with_kappa = 0.0
    if outer or kink != 0.0:
        with_kappa = _peak(low, high)
    if not outer or kink != 0.0:
        with_kappa = max(with_kappa, abs(h))
    bottom, top = functional_range(c0, s0, c1, s1, low, high, h)
    with_beta = max(c0, c1) * _peak(side_low, side_high)
    return with_kappa + guard, with_beta + guard, _peak(bottom, top) + guard


@njit(cache=True, parallel=True, nogil=RELEASES_LOCK)
def fill_bounds(
    c: Array,
    s: Array,
    e: Array,
    vehicle_accel: float,
    kappa_g: float,
    shares: Array,
    wheels: tuple[Array, ...],
    out: Array,
) -> None:
    """Fill the tables of `CellRates`, not yet rounded.

    Parameters
    ----------
    c, s : (k + 1,) float
        Components of κ_n at the edges of cells, which straddle no kink.
    e : (m + 1,) complex
        ``exp(j β)`` at the edges, less than half a turn apart.
    vehicle_accel, kappa_g : float, m/s², 1/m
    shares : (h,) float
        Shares of the largest load at which the headroom is wanted.
    wheels : b, n, rate, accel, max_speed, per_rate, offset_low, offset_high, each (w,)
        Levers ``j κ_g w``, directions with ``Re(z n̄)`` the rolling speed (0 for wheels
        that steer), limits (infinite where there is none), what a radian of steering
        costs in rolling, m, least and largest offset D, m.
    out : (6 + 2 h, k, m) float
        Written to: steer, accel of κ_n and β, v_s_dot, load, headroom of κ_n and β.
    """
    b, n, rate, accel, max_speed, per_rate, offset_low, offset_high = wheels
    rolls = np.flatnonzero((per_rate > 0.0) & (max_speed < np.inf))
    for k in prange(c.size - 1):
        turns, loads = np.empty((2, b.size)), np.zeros(b.size)
        c0, s0, c1, s1 = c[k], s[k], c[k + 1], s[k + 1]
        outer = c0 != c1
        kink = 0.0
        if max(c0, c1) == 1.0 and max(abs(s0), abs(s1)) == 1.0:
            kink = 1.0 if s0 + s1 > 0 else -1.0
        for m in range(e.size - 1):
            cell = out[:, k, m]
            cell[:] = np.inf
            if outer or kink != 0.0:
                cell[2] = vehicle_accel
            cell[4] = vehicle_accel / max(c0, c1)
            for i in range(b.size):
                if n[i] != 0:
                    with_kappa, with_beta, r = _unsteered(
                        outer, kink, c0, s0, c1, s1, e[m], e[m + 1], b[i], n[i]
                    )
                    cell[2] = min(cell[2], _ratio(accel[i], with_kappa))
                    cell[3] = min(cell[3], _ratio(accel[i], with_beta))
                    cell[4] = min(cell[4], _ratio(accel[i], r))
                    continue
                turns[0, i], turns[1, i], with_kappa, with_beta, near, far = _steered(
                    outer, kink, c0, s0, c1, s1, e[m], e[m + 1], b[i]
                )
                if near == 0.0:
                    cell[0], cell[1] = 0.0, 0.0
                cell[0] = min(cell[0], _ratio(rate[i], turns[0, i]))
                cell[1] = min(cell[1], _ratio(rate[i], turns[1, i]))
                cell[2] = min(cell[2], _ratio(accel[i], with_kappa))
                cell[3] = min(cell[3], _ratio(accel[i], with_beta))
                cell[4] = min(cell[4], _ratio(accel[i], far))
                if per_rate[i] > 0.0:
                    d0, d1 = offset_low[i] * kappa_g, offset_high[i] * kappa_g
                    d_low = min(d0 * s0, d0 * s1, d1 * s0, d1 * s1)
                    d_high = max(d0 * s0, d0 * s1, d1 * s0, d1 * s1)
                    loads[i] = max(far - d_low, d_high - near) / max_speed[i]
            cell[5] = loads.max()
            _fill_headroom(cell[5:], shares, rolls, loads, turns, max_speed, per_rate)


@njit(cache=True, inline="always")
def _fill_headroom(
    out: Array,
    shares: Array,
    rolls: Array,
    loads: Array,
    turns: Array,
    max_speed: Array,
    per_rate: Array,
) -> None:
    """Bound the rates by ``(1 - |v_s| load) max_speed / per_rate`` of every wheel.

    `rolls` are the wheels that roll as they steer. `out` holds the largest load, then
    the bounds at each share of it for κ_n and for β.
    """
    for i in rolls:
        for h in range(shares.size):
            left = 1.0 - shares[h] * _share(loads[i], out[0])
            limit = left * max_speed[i] / per_rate[i]
            for axis in range(2):
                at = 1 + axis * shares.size + h
                out[at] = min(out[at], _ratio(limit, turns[axis, i]))


@njit(cache=True, inline="always")
def _ratio(limit: float, gradient: float) -> float:
    """``limit / gradient``, infinite where nothing bounds."""
    ratio: float = limit / gradient if gradient > 0.0 and limit < np.inf else np.inf
    return ratio


@njit(cache=True, inline="always")
def _share(part: float, whole: float) -> float:
    """``part / whole``, 0 of nothing."""
    share: float = part / whole if whole > 0.0 else 0.0
    return share
