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

_DISC, _STRIP, _OFFSET, _LATERAL, _EDGE = 0, 1, 2, 3, 4
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
def _offset_range(
    p: float,
    b: complex,
    d: float,
    c0: float,
    s0: float,
    c1: float,
    s1: float,
    e0: complex,
    e1: complex,
) -> tuple[float, float]:
    """Least and largest ``|c e p + s b| - s d`` over a cell; the largest is exact.

    The length is convex in κ_n for every β, and so is what is left of it.
    """
    low, high = _cos_range(e0, e1, p * b)
    bb = b.real * b.real + b.imag * b.imag
    least, _ = _disc_range(c0, s0, c1, s1, p, bb, low, high)
    far = high if s0 + s1 > 0 else low
    at0 = math.sqrt(max(0.0, c0 * c0 * p * p + s0 * s0 * bb + 2 * c0 * s0 * far))
    at1 = math.sqrt(max(0.0, c1 * c1 * p * p + s1 * s1 * bb + 2 * c1 * s1 * far))
    return math.sqrt(least) - max(s0 * d, s1 * d), max(at0 - s0 * d, at1 - s1 * d)


@njit(cache=True, inline="always")
def _load_range(
    kind: int,
    p: float,
    b: complex,
    n: complex,
    d: float,
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
        bottom, top = _squared(least, largest)
        return bottom, top
    if kind == _OFFSET:
        least, largest = _offset_range(p, b, d, c0, s0, c1, s1, e0, e1)
        bottom, top = _squared(least, largest)
        return bottom, top
    small, large = min(abs(s0), abs(s1)), max(abs(s0), abs(s1))
    if kind == _LATERAL:
        low, high = _cos_range(e0, e1, b)
        bb = b.real * b.real + b.imag * b.imag
        least, largest = _disc_range(c0, s0, c1, s1, 1.0, bb, low, high)
        return p * small * math.sqrt(least), p * large * math.sqrt(largest)
    low, high = _cos_range(e0, e1, n)
    h = b.real * n.real + b.imag * n.imag
    least, largest = _functional_range(c0, s0, c1, s1, low, high, h)
    if s0 + s1 < 0:
        least, largest = -largest, -least
    top = max(0.0, largest * large, largest * small)
    bottom = max(0.0, min(least * large, least * small))
    return p * bottom, p * top


@njit(cache=True, inline="always")
def _squared(least: float, largest: float) -> tuple[float, float]:
    """Range of the square of what ranges from `least` to `largest`."""
    top = max(least * least, largest * largest)
    bottom = 0.0 if least <= 0 <= largest else min(least * least, largest * largest)
    return bottom, top


@njit(cache=True, inline="always")
def _zone_state(
    b: complex,
    kappa_share: float,
    beta_share: float,
    c0: float,
    s0: float,
    c1: float,
    s1: float,
    e0: complex,
    e1: complex,
) -> int:
    """State of a cell under the guaranteed change rates of one wheel."""
    if kappa_share == 0 and beta_share == 0:
        return FREE
    low, high = _cos_range(e0, e1, b)  # Re(e b̄)
    left, right = _cos_range(e0, e1, 1j * b)  # Im(e b̄)
    far = max(abs(left), abs(right))
    near = 0.0 if left <= 0 <= right else min(abs(left), abs(right))
    bb = b.real * b.real + b.imag * b.imag
    least, largest = _disc_range(c0, s0, c1, s1, 1.0, bb, low, high)
    inner = min(c0 + min(s0 * low, s0 * high), c1 + min(s1 * low, s1 * high))
    outer = max(c0 + max(s0 * low, s0 * high), c1 + max(s1 * low, s1 * high))
    # |c (c + s f)|
    most = max(c0, c1) * max(abs(inner), abs(outer))
    fewest = 0.0
    if not inner <= 0 <= outer:
        fewest = min(c0, c1) * min(abs(inner), abs(outer))
    if kappa_share * far + beta_share * most <= least - _GUARD:
        return FREE
    if kappa_share * near + beta_share * fewest > largest + _GUARD:
        return BLOCKED
    return MIXED


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
    kind: int,
    p: float,
    b: complex,
    n: complex,
    d: float,
    c: float,
    s: float,
    e: complex,
) -> float:
    """Squared load of one row at a point."""
    if kind == _LATERAL:
        return p * abs(s) * abs(c * e + s * b)
    if kind == _EDGE:
        z = c * e + s * b
        return max(0.0, p * s * (z.real * n.real + z.imag * n.imag))
    z = c * p * e + s * b
    if kind == _DISC:
        return z.real * z.real + z.imag * z.imag
    if kind == _OFFSET:
        rest = abs(z) - s * d
        return rest * rest
    along = z.real * n.real + z.imag * n.imag
    return along * along


@njit(cache=True, inline="always")
def _offset_pad(
    p: float,
    b: complex,
    d: float,
    c0: float,
    s0: float,
    c1: float,
    s1: float,
    e0: complex,
    e1: complex,
    width: float,
) -> float:
    """Return how much too low an interpolated offset row may be in a cell.

    Where ``|z| - s d`` stays positive its square is convex in κ_n, and in β it curves
    down by at most ``2 c |s| p |b| + 2 |s d| max(c p, (c p)² / |z|)``.
    """
    low, high = _cos_range(e0, e1, p * b)
    bb = b.real * b.real + b.imag * b.imag
    least, _ = _disc_range(c0, s0, c1, s1, p, bb, low, high)
    c, s = max(c0, c1), max(abs(s0), abs(s1))
    near = math.sqrt(least)
    if near - s * abs(d) <= 0:
        return np.inf
    curve = 2 * c * s * p * math.sqrt(bb)
    curve += 2 * s * abs(d) * max(c * p, (c * p) ** 2 / near)
    return width * width / 8 * curve


def block_edges(n_cells: int, largest: int) -> Array:
    """Return edges of blocks of at most `largest` cells each."""
    count = -(-n_cells // largest)
    return np.round(np.linspace(0, n_cells, count + 1)).astype(np.int64)


def cell_tables(
    kappa: Array,
    beta: Array,
    loads: tuple[Array, ...],
    sectors: tuple[Array, ...],
) -> tuple[Array, ...]:
    """Return exact bounds, states and reasons of all cells, and the loads at nodes.

    Parameters
    ----------
    kappa : (k + 1,) float, 1
        Edges of the cells. k is a multiple of 4 and no kink lies inside a quarter, or
        k is 1 and κ_n is constant.
    beta : (m + 1,) float, rad
        Edges of the cells.
    loads : kind, p, b, n, d, reason, wheel, each (r,)
        The load rows; n is ``exp(j ν)``.
    sectors : b, middle, lower, upper, cos_slack, convex, kappa_share, beta_share, \
wheel, each (q,)
        The sector rows, see `_sector_state` and `_zone_state`.

    Returns
    -------
    nodes : (k + 1, m + 1) float
        Largest squared load at every node.
    pad : (k, m) float
        What the corners of a cell need on top because of offset rows.
    low, high : (k, m) float
        ``low ≤ load ≤ high`` over the whole cell; not filled where it is blocked.
    state : (k, m) uint8
        `FREE`, `BLOCKED` or `MIXED`.
    parts : (k, m) uint16
        Which of the 4 × 4 parts of a mixed cell are free: bit 4 i + j for the part
        i-th in κ_n and j-th in β; all or none for other cells.
    reason : (k, m) uint16
        What blocks (blocked, mixed) or may bind (free).
    wheel : (k, m) int16
        The wheel that blocks or binds, -1 for the vehicle.
    """
    rows, columns = kappa.size - 1, beta.size - 1
    if rows == 1:
        over_kappa = np.array([0, 1])
    else:
        quarter = rows // 4
        within = block_edges(quarter, _BLOCK)
        over_kappa = np.concatenate(
            [within[:-1] + i * quarter for i in range(4)] + [np.array([rows])]
        )
    # A block spans at most a quarter turn: `_cos_range` needs less than half of one.
    over_beta = block_edges(columns, max(1, min(_BLOCK, columns // 4)))
    c, s = np.minimum(1.0, 2.0 - np.abs(kappa)), np.clip(kappa, -1.0, 1.0)
    out = (
        np.empty((rows + 1, columns + 1)),
        np.zeros((rows, columns)),
        np.zeros((rows, columns)),
        np.zeros((rows, columns)),
        np.empty((rows, columns), np.uint8),
        np.empty((rows, columns), np.uint16),
        np.empty((rows, columns), np.uint16),
        np.empty((rows, columns), np.int16),
    )
    edges = (c, s, np.exp(1j * beta), beta)
    _fill_blocks(edges, loads, sectors, over_kappa, over_beta, out)
    return out


@njit(cache=True, parallel=True)
def _fill_blocks(
    edges: tuple[Array, ...],
    loads: tuple[Array, ...],
    sectors: tuple[Array, ...],
    over_kappa: Array,
    over_beta: Array,
    out: tuple[Array, ...],
) -> None:
    """Fill the tables of `cell_tables`, block by block."""
    c, s, e, _ = edges
    kind, p, b, n, d, _, _ = loads
    nodes, _, _, _, state, parts, reason, wheel = out
    n_sectors = sectors[0].size
    wide = over_beta.size - 1
    for block in prange((over_kappa.size - 1) * wide):
        k0, k1 = over_kappa[block // wide], over_kappa[block // wide + 1]
        m0, m1 = over_beta[block % wide], over_beta[block % wide + 1]
        # Rows that may be the largest somewhere in the block.
        tops = np.empty(kind.size)
        low = 0.0
        for r in range(kind.size):
            least, tops[r] = _load_range(
                kind[r], p[r], b[r], n[r], d[r],
                c[k0], s[k0], c[k1], s[k1], e[m0], e[m1],
            )  # fmt: skip
            low = max(low, least)
        binding = np.flatnonzero(tops >= low * (1 - _GUARD))
        # Ranges that some of the block leaves.
        worst, who, why = FREE, -1, 0
        pending = np.empty(n_sectors, np.int64)
        n_pending = 0
        for q in range(n_sectors):
            one, because = _sector_and_zone(
                q, sectors, c[k0], s[k0], c[k1], s[k1], e[m0], e[m1]
            )
            if one == BLOCKED:
                worst, who, why = BLOCKED, sectors[8][q], because
                break
            if one == MIXED:
                pending[n_pending] = q
                n_pending += 1
        for k in range(k0, k1 + (k1 == c.size - 1)):
            for m in range(m0, m1 + (m1 == e.size - 1)):
                load = 0.0
                for i in binding:
                    at = _load_at(kind[i], p[i], b[i], n[i], d[i], c[k], s[k], e[m])
                    load = max(load, at)
                nodes[k, m] = load
        for k in range(k0, k1):
            for m in range(m0, m1):
                if worst == BLOCKED:
                    state[k, m], parts[k, m] = BLOCKED, 0
                    reason[k, m], wheel[k, m] = why, who
                else:
                    _fill_state(k, m, edges, sectors, pending[:n_pending], out)
                    _fill_loads(k, m, edges, loads, binding, tops, out)


@njit(cache=True, inline="always")
def _sector_and_zone(
    q: int,
    sectors: tuple[Array, ...],
    c0: float,
    s0: float,
    c1: float,
    s1: float,
    e0: complex,
    e1: complex,
) -> tuple[int, int]:
    """State of a cell under one wheel's range and guaranteed rates, and the reason."""
    b, middle, lower, upper, cos_slack, convex, kappa_share, beta_share, _ = sectors
    turn = _sector_state(
        b[q], middle[q], lower[q], upper[q], cos_slack[q], convex[q],
        c0, s0, c1, s1, e0, e1,
    )  # fmt: skip
    free_turning = cos_slack[q] == -1.0
    because = 0
    if turn != FREE:
        because |= _REASON_SINGULAR if free_turning else _REASON_STEER
    zone = _zone_state(b[q], kappa_share[q], beta_share[q], c0, s0, c1, s1, e0, e1)
    if zone != FREE:
        because |= _REASON_SINGULAR
    if turn == BLOCKED or zone == BLOCKED:
        return BLOCKED, because
    if turn == FREE and zone == FREE:
        return FREE, because
    return MIXED, because


@njit(cache=True)
def _fill_state(
    k: int,
    m: int,
    edges: tuple[Array, ...],
    sectors: tuple[Array, ...],
    pending: Array,
    out: tuple[Array, ...],
) -> None:
    """Settle what blocks one cell, from the ranges that its block left open."""
    c, s, e, beta = edges
    _, _, _, _, state, parts, reason, wheel = out
    c0, s0, c1, s1 = c[k], s[k], c[k + 1], s[k + 1]
    worst, who, why = FREE, -1, 0
    for q in pending:
        one, because = _sector_and_zone(q, sectors, c0, s0, c1, s1, e[m], e[m + 1])
        why |= because
        if one != FREE and worst != BLOCKED:
            if one == BLOCKED or worst == FREE:
                who = sectors[8][q]
            worst = one
    free, blocked = 0xFFFF if worst == FREE else 0, worst == BLOCKED
    if worst == MIXED:
        blocked = True
        for i in range(4):
            f0, f1 = i / 4, (i + 1) / 4
            ci0, si0 = c0 + f0 * (c1 - c0), s0 + f0 * (s1 - s0)
            ci1, si1 = c0 + f1 * (c1 - c0), s0 + f1 * (s1 - s0)
            for j in range(4):
                b0 = beta[m] + j / 4 * (beta[m + 1] - beta[m])
                b1 = beta[m] + (j + 1) / 4 * (beta[m + 1] - beta[m])
                e0 = complex(math.cos(b0), math.sin(b0))
                e1 = complex(math.cos(b1), math.sin(b1)) if b1 > b0 else e0
                part = FREE
                for q in pending:
                    one, _ = _sector_and_zone(q, sectors, ci0, si0, ci1, si1, e0, e1)
                    if one == BLOCKED:
                        part = BLOCKED
                        break
                    if one == MIXED:
                        part = MIXED
                if part == FREE:
                    free |= 1 << (4 * i + j)
                blocked = blocked and part == BLOCKED
    if free == 0xFFFF:
        worst = FREE
    elif blocked:
        worst = BLOCKED
    state[k, m], parts[k, m] = worst, free
    reason[k, m], wheel[k, m] = (0, -1) if worst == FREE else (why, who)


@njit(cache=True)
def _fill_loads(
    k: int,
    m: int,
    edges: tuple[Array, ...],
    loads: tuple[Array, ...],
    binding: Array,
    tops: Array,
    out: tuple[Array, ...],
) -> None:
    """Bound the load over one cell, from the rows that its block left open."""
    c, s, e, beta = edges
    kind, p, b, n, d, row_reason, row_wheel = loads
    _, pad, load_low, load_high, state, _, reason, wheel = out
    c0, s0, c1, s1, e0, e1 = c[k], s[k], c[k + 1], s[k + 1], e[m], e[m + 1]
    low, high = 0.0, 0.0
    largest = -1
    for r in binding:
        least, tops[r] = _load_range(
            kind[r], p[r], b[r], n[r], d[r], c0, s0, c1, s1, e0, e1
        )
        low = max(low, least)
        if tops[r] > high:
            high, largest = tops[r], r
    load_low[k, m], load_high[k, m] = low, high
    if state[k, m] == FREE:
        why = 0
        for r in binding:
            if tops[r] >= low:
                why |= row_reason[r]
        reason[k, m] = why
        wheel[k, m] = row_wheel[largest] if largest >= 0 else -1
    needs = 0.0
    for r in binding:
        if kind[r] == _OFFSET:
            corner = np.inf
            for ck, sk in ((c0, s0), (c1, s1)):
                for em in (e0, e1):
                    at = 0.0
                    for i in binding:
                        one = _load_at(kind[i], p[i], b[i], n[i], d[i], ck, sk, em)
                        at = max(at, one)
                    corner = min(corner, at)
            lack = max(0.0, tops[r] - corner)
            width = beta[m + 1] - beta[m]
            curve = _offset_pad(p[r], b[r], d[r], c0, s0, c1, s1, e0, e1, width)
            needs = max(needs, min(lack, curve))
    pad[k, m] = needs
