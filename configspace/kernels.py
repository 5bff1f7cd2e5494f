"""The hot loops of building a space, in numba; `tests/naive.py` holds plain twins.

A cell is a box ``[κ⁰, κ¹] × [β⁰, β¹]`` that does not straddle κ_n = 0 or ±1. On it
c ≥ 0 and s are affine in κ_n and s keeps its sign, so for each row of `limits`

- a linear functional ``c cos(β - ν) + s h`` is affine in κ_n and a cosine in β:
  its extremes are at edges in κ_n and closed form in β;
- a squared disc ``c² p² + s² |b|² + 2 c s p Re(e^{jβ} b̄)`` is convex in κ_n (largest
  at an edge, least at the vertex of a parabola) and a cosine in β.

Every bound here is therefore exact up to rounding, which `_GUARD` covers.

The bounds hold for blocks of cells as well. A row that cannot be the largest anywhere
in a block, or a range that all of a block keeps, need not be looked at cell by cell;
the result is the same, and most of the work with many wheels is gone.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit, prange

__all__ = ["BLOCKED", "FREE", "MIXED", "cell_tables"]

FREE, BLOCKED, MIXED = 0, 1, 2
"""States of a cell: permitted all over, nowhere, or to be settled."""

_DISC, _STRIP, _PRODUCT = 0, 1, 2
_GUARD = 1e-12
_REASON_STEER, _REASON_SINGULAR = 1, 2
_BLOCK = 12
"""Cells along each side of a block, at most."""

Array = Any  # numba infers the types; mypy cannot look into the kernels


@njit(cache=True, inline="always")
def _cos_range(e0: complex, e1: complex, n: complex) -> tuple[float, float]:
    """Least and largest |n| cos(β - arg n) for β from arg e0 to arg e1, < π apart."""
    at0 = e0.real * n.real + e0.imag * n.imag
    if e0 == e1:  # the one column of a line-mobile vehicle
        return at0, at0
    at1 = e1.real * n.real + e1.imag * n.imag
    low, high = min(at0, at1), max(at0, at1)
    side0 = e0.real * n.imag - e0.imag * n.real
    side1 = n.real * e1.imag - n.imag * e1.real
    if side0 >= 0 and side1 >= 0:  # n lies between e0 and e1
        high = math.sqrt(n.real * n.real + n.imag * n.imag)
    if side0 <= 0 and side1 <= 0:  # -n does
        low = -math.sqrt(n.real * n.real + n.imag * n.imag)
    return low, high


@njit(cache=True, inline="always")
def _functional_range(
    c0: float, s0: float, c1: float, s1: float, low: float, high: float, h: float
) -> tuple[float, float]:
    """Least and largest ``c cos + s h`` over a cell; `low`, `high` bound the cosine."""
    least = min(c0 * low + s0 * h, c1 * low + s1 * h)
    largest = max(c0 * high + s0 * h, c1 * high + s1 * h)
    return least, largest


@njit(cache=True, inline="always")
def _disc_range(
    c0: float,
    s0: float,
    c1: float,
    s1: float,
    p: float,
    bb: float,
    low: float,
    high: float,
) -> tuple[float, float]:
    """Least and largest squared disc; `low`, `high` bound ``p Re(e^{jβ} b̄)``."""
    far, near = (high, low) if s0 + s1 > 0 else (low, high)
    pp = p * p
    largest = max(
        c0 * c0 * pp + s0 * s0 * bb + 2 * c0 * s0 * far,
        c1 * c1 * pp + s1 * s1 * bb + 2 * c1 * s1 * far,
    )
    # Along κ_n: |c p e + s b|² with c, s affine is a parabola A τ² + 2 B τ + C.
    dc, ds = c1 - c0, s1 - s0
    a = dc * dc * pp + ds * ds * bb + 2 * dc * ds * near
    b = c0 * dc * pp + s0 * ds * bb + (c0 * ds + s0 * dc) * near
    c = c0 * c0 * pp + s0 * s0 * bb + 2 * c0 * s0 * near
    tau = min(1.0, max(0.0, -b / a)) if a > 0 else 0.0
    least = min((a * tau + 2 * b) * tau + c, a + 2 * b + c)
    # Near zero the parabola is a difference of large numbers.
    return max(0.0, least - _GUARD * largest), largest


@njit(cache=True, inline="always")
def _load_range(
    kind: int,
    p: float,
    b: complex,
    n: complex,
    c0: float,
    s0: float,
    c1: float,
    s1: float,
    e0: complex,
    e1: complex,
) -> tuple[float, float]:
    """Least and largest squared load of one row over a cell."""
    if kind == _DISC:
        low, high = _cos_range(e0, e1, p * b)
        bb = b.real * b.real + b.imag * b.imag
        least, largest = _disc_range(c0, s0, c1, s1, p, bb, low, high)
        return least, largest
    if kind == _STRIP:
        low, high = _cos_range(e0, e1, p * n)
        h = b.real * n.real + b.imag * n.imag
        least, largest = _functional_range(c0, s0, c1, s1, low, high, h)
        top = max(least * least, largest * largest)
        bottom = 0.0 if least <= 0 <= largest else min(least * least, largest * largest)
        return bottom, top
    at0, at1 = p * p * c0 * abs(s0), p * p * c1 * abs(s1)
    return min(at0, at1), max(at0, at1)


@njit(cache=True, inline="always")
def _sector_state(
    b: complex,
    middle: complex,
    lower: complex,
    upper: complex,
    cos_slack: float,
    convex: bool,
    c0: float,
    s0: float,
    c1: float,
    s1: float,
    e0: complex,
    e1: complex,
) -> int:
    """State of a cell under one steering range.

    `middle`, `lower`, `upper` are unit vectors of the middle and the ends of the range;
    `convex` says that the range spans at most half a turn. `cos_slack` is the cosine
    of the largest angle from `middle` at which the normal of a half-plane may stand so
    that the half-plane keeps clear of the forbidden sector; -1 for no range.
    """
    if convex:
        # Permitted: the wedge between two half-planes.
        worst = FREE
        for n in (1j * lower, -1j * upper):
            low, high = _cos_range(e0, e1, n)
            h = b.real * n.real + b.imag * n.imag
            least, largest = _functional_range(c0, s0, c1, s1, low, high, h)
            if largest < -_GUARD:
                return BLOCKED
            if least <= _GUARD:
                worst = MIXED
        return worst
    # Permitted if the cell lies in one half-plane clear of the forbidden wedge; the
    # normal is the cell's own direction, turned towards the middle where it must.
    mean_c, mean_s = (c0 + c1) / 2, (s0 + s1) / 2
    centre = mean_c * (e0 + e1) / 2 + mean_s * b
    size = abs(centre)
    if size > _GUARD:
        n = centre / size
        cos_n = n.real * middle.real + n.imag * middle.imag
        if cos_n < cos_slack:
            side = middle.real * n.imag - middle.imag * n.real
            sine = math.sqrt(max(0.0, 1 - cos_slack * cos_slack))
            n = middle * complex(cos_slack, sine if side >= 0 else -sine)
        low, _ = _cos_range(e0, e1, n)
        h = b.real * n.real + b.imag * n.imag
        least, _ = _functional_range(c0, s0, c1, s1, low, low, h)
        if least > _GUARD:
            return FREE
    if cos_slack == -1.0:
        return MIXED
    # Blocked if the cell lies in the forbidden wedge.
    for n in (1j * upper, -1j * lower):
        low, _ = _cos_range(e0, e1, n)
        h = b.real * n.real + b.imag * n.imag
        least, _ = _functional_range(c0, s0, c1, s1, low, low, h)
        if least <= _GUARD:
            return MIXED
    return BLOCKED


@njit(cache=True, inline="always")
def _load_at(
    kind: int, p: float, b: complex, n: complex, c: float, s: float, e: complex
) -> float:
    """Squared load of one row at a point."""
    if kind == _PRODUCT:
        return p * p * c * abs(s)
    z = c * p * e + s * b
    if kind == _DISC:
        return z.real * z.real + z.imag * z.imag
    along = z.real * n.real + z.imag * n.imag
    return along * along


def block_edges(n_cells: int, largest: int) -> Array:
    """Return edges of blocks of at most `largest` cells each."""
    count = -(-n_cells // largest)
    return np.round(np.linspace(0, n_cells, count + 1)).astype(np.int64)


def cell_tables(
    c: Array,
    s: Array,
    e: Array,
    loads: tuple[Array, ...],
    sectors: tuple[Array, ...],
) -> tuple[Array, ...]:
    """Return exact bounds, states and reasons of all cells, and the loads at nodes.

    Parameters
    ----------
    c, s : (k + 1,) float
        Components of κ_n at the edges; k is a multiple of 4 and no kink lies inside a
        quarter.
    e : (m + 1,) complex
        ``exp(j β)`` at the edges.
    loads : kind, p, b, n, reason, wheel, each (r,)
        The load rows; n is ``exp(j ν)``.
    sectors : b, middle, lower, upper, cos_slack, convex, wheel, each (q,)
        The sector rows, see `_sector_state`.

    Returns
    -------
    nodes : (k + 1, m + 1) float
        Largest squared load at every node.
    low, high : (k, m) float
        ``low ≤ load ≤ high`` over the whole cell; not filled where it is blocked.
    state : (k, m) uint8
        `FREE`, `BLOCKED` or `MIXED`.
    reason : (k, m) uint16
        What blocks (blocked, mixed) or may bind (free).
    wheel : (k, m) int16
        The wheel that blocks or binds, -1 for the vehicle.
    """
    rows, columns = c.size - 1, e.size - 1
    quarter = rows // 4
    within = block_edges(quarter, _BLOCK)
    over_kappa = np.concatenate(
        [within[:-1] + i * quarter for i in range(4)] + [np.array([rows])]
    )
    # A block spans at most a quarter turn: `_cos_range` needs less than half of one.
    over_beta = block_edges(columns, max(1, min(_BLOCK, columns // 4)))
    out = (
        np.empty((rows + 1, columns + 1)),
        np.zeros((rows, columns)),
        np.zeros((rows, columns)),
        np.empty((rows, columns), np.uint8),
        np.empty((rows, columns), np.uint16),
        np.empty((rows, columns), np.int16),
    )
    _fill_blocks(c, s, e, *loads, *sectors, over_kappa, over_beta, *out)
    return out


@njit(cache=True, parallel=True)
def _fill_blocks(
    c: Array,
    s: Array,
    e: Array,
    kind: Array,
    p: Array,
    b: Array,
    n: Array,
    row_reason: Array,
    row_wheel: Array,
    sector_b: Array,
    middle: Array,
    lower: Array,
    upper: Array,
    cos_slack: Array,
    convex: Array,
    sector_wheel: Array,
    over_kappa: Array,
    over_beta: Array,
    nodes: Array,
    load_low: Array,
    load_high: Array,
    state: Array,
    reason: Array,
    wheel: Array,
) -> None:
    """Fill the tables of `cell_tables`, block by block."""
    wide = over_beta.size - 1
    for block in prange((over_kappa.size - 1) * wide):
        k0, k1 = over_kappa[block // wide], over_kappa[block // wide + 1]
        m0, m1 = over_beta[block % wide], over_beta[block % wide + 1]
        # Rows that may be the largest somewhere in the block.
        tops = np.empty(kind.size)
        low = 0.0
        for r in range(kind.size):
            least, tops[r] = _load_range(
                kind[r], p[r], b[r], n[r], c[k0], s[k0], c[k1], s[k1], e[m0], e[m1]
            )
            low = max(low, least)
        binding = np.flatnonzero(tops >= low * (1 - _GUARD))
        # Ranges that some of the block leaves.
        worst, who = FREE, -1
        open_sectors = np.empty(sector_b.size, np.int64)
        n_open = 0
        for q in range(sector_b.size):
            one = _sector_state(
                sector_b[q], middle[q], lower[q], upper[q], cos_slack[q], convex[q],
                c[k0], s[k0], c[k1], s[k1], e[m0], e[m1],
            )  # fmt: skip
            if one == BLOCKED:
                worst, who = BLOCKED, sector_wheel[q]
                break
            if one == MIXED:
                open_sectors[n_open] = q
                n_open += 1
        for k in range(k0, k1 + (k1 == c.size - 1)):
            for m in range(m0, m1 + (m1 == e.size - 1)):
                load = 0.0
                for i in binding:
                    at = _load_at(kind[i], p[i], b[i], n[i], c[k], s[k], e[m])
                    load = max(load, at)
                nodes[k, m] = load
        for k in range(k0, k1):
            for m in range(m0, m1):
                if worst == BLOCKED:
                    state[k, m], reason[k, m], wheel[k, m] = BLOCKED, _REASON_STEER, who
                    continue
                _fill_cell(
                    k, m, c, s, e, kind, p, b, n, row_reason, row_wheel,
                    sector_b, middle, lower, upper, cos_slack, convex, sector_wheel,
                    binding, open_sectors[:n_open], tops,
                    load_low, load_high, state, reason, wheel,
                )  # fmt: skip


@njit(cache=True)
def _fill_cell(
    k: int,
    m: int,
    c: Array,
    s: Array,
    e: Array,
    kind: Array,
    p: Array,
    b: Array,
    n: Array,
    row_reason: Array,
    row_wheel: Array,
    sector_b: Array,
    middle: Array,
    lower: Array,
    upper: Array,
    cos_slack: Array,
    convex: Array,
    sector_wheel: Array,
    binding: Array,
    open_sectors: Array,
    tops: Array,
    load_low: Array,
    load_high: Array,
    state: Array,
    reason: Array,
    wheel: Array,
) -> None:
    """Fill one cell from the rows and ranges that its block left open."""
    c0, s0, c1, s1, e0, e1 = c[k], s[k], c[k + 1], s[k + 1], e[m], e[m + 1]
    worst, who, why = FREE, -1, 0
    for q in open_sectors:
        one = _sector_state(
            sector_b[q], middle[q], lower[q], upper[q], cos_slack[q], convex[q],
            c0, s0, c1, s1, e0, e1,
        )  # fmt: skip
        if one == FREE:
            continue
        if worst != BLOCKED:
            if one == BLOCKED or worst == FREE:
                who = sector_wheel[q]
            worst = one
        why |= _REASON_SINGULAR if cos_slack[q] == -1.0 else _REASON_STEER
    low, high = 0.0, 0.0
    largest = -1
    for r in binding:
        least, tops[r] = _load_range(kind[r], p[r], b[r], n[r], c0, s0, c1, s1, e0, e1)
        low = max(low, least)
        if tops[r] > high:
            high, largest = tops[r], r
    load_low[k, m], load_high[k, m] = low, high
    if worst == FREE:
        who = row_wheel[largest] if largest >= 0 else -1
        for r in binding:
            if tops[r] >= low:
                why |= row_reason[r]
    state[k, m], reason[k, m], wheel[k, m] = worst, why, who
