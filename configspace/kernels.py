"""The hot loops of building a space, in numba; `tests/naive.py` holds plain twins.

What one row says over one cell is in `row_bounds`; here are the loops over cells.

The bounds hold for blocks of cells as well. A row that cannot be the largest anywhere
in a block, or a range that all of a block keeps, need not be looked at cell by cell;
the result is the same, and most of the work with many wheels is gone.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit, prange

from configspace.bounds import GUARD
from configspace.row_bounds import (
    BLOCKED,
    FREE,
    MIXED,
    OFFSET,
    load_at,
    load_range,
    offset_pad,
    sector_state,
    zone_state,
)
from configspace.threads import RELEASES_LOCK

__all__ = ["BLOCKED", "FREE", "MIXED", "cell_tables"]

_REASON_STEER, _REASON_SINGULAR = 1, 2
_BLOCK = 12
"""Cells along each side of a block, at most."""

Array = Any  # numba infers the types; mypy cannot look into the kernels


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
pole, wheel, each (q,)
        The sector rows, see `sector_state` and `zone_state`.

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
    # A block spans at most a quarter turn: `cos_range` needs less than half of one.
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


@njit(cache=True, parallel=True, nogil=RELEASES_LOCK)
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
            least, tops[r] = load_range(
                kind[r], p[r], b[r], n[r], d[r],
                c[k0], s[k0], c[k1], s[k1], e[m0], e[m1],
            )  # fmt: skip
            low = max(low, least)
        binding = np.flatnonzero(tops >= low * (1 - GUARD))
        # Ranges that some of the block leaves.
        worst, who, why = FREE, -1, 0
        pending = np.empty(n_sectors, np.int64)
        n_pending = 0
        for q in range(n_sectors):
            one, because = _sector_and_zone(
                q, sectors, c[k0], s[k0], c[k1], s[k1], e[m0], e[m1]
            )
            if one == BLOCKED:
                worst, who, why = BLOCKED, sectors[9][q], because
                break
            if one == MIXED:
                pending[n_pending] = q
                n_pending += 1
        for k in range(k0, k1 + (k1 == c.size - 1)):
            for m in range(m0, m1 + (m1 == e.size - 1)):
                load = 0.0
                for i in binding:
                    at = load_at(kind[i], p[i], b[i], n[i], d[i], c[k], s[k], e[m])
                    load = max(load, at)
                nodes[k, m] = load
        span = (k0, k1, m0, m1)
        if worst == BLOCKED:
            for k in range(k0, k1):
                for m in range(m0, m1):
                    state[k, m], parts[k, m] = BLOCKED, 0
                    reason[k, m], wheel[k, m] = why, who
        else:
            _fill_states(span, edges, sectors, pending[:n_pending], out)
            _fill_loads(span, edges, loads, binding, tops, out)


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
    b, middle, lower, upper, cos_slack, convex, kappa_share, beta_share, pole, _ = (
        sectors
    )
    turn = sector_state(
        b[q], middle[q], lower[q], upper[q], cos_slack[q], convex[q],
        c0, s0, c1, s1, e0, e1,
    )  # fmt: skip
    free_turning = cos_slack[q] == -1.0
    because = 0
    if turn != FREE:
        because |= _REASON_SINGULAR if free_turning else _REASON_STEER
    zone = zone_state(
        b[q], kappa_share[q], beta_share[q], pole[q], c0, s0, c1, s1, e0, e1
    )
    if zone != FREE:
        because |= _REASON_SINGULAR
    if turn == BLOCKED or zone == BLOCKED:
        return BLOCKED, because
    if turn == FREE and zone == FREE:
        return FREE, because
    return MIXED, because


@njit(cache=True)
def _fill_states(
    span: tuple[int, int, int, int],
    edges: tuple[Array, ...],
    sectors: tuple[Array, ...],
    pending: Array,
    out: tuple[Array, ...],
) -> None:
    """Settle what blocks the cells of a block, from the ranges that it left open."""
    c, s, e, beta = edges
    _, _, _, _, state, parts, reason, wheel = out
    for k in range(span[0], span[1]):
        c0, s0, c1, s1 = c[k], s[k], c[k + 1], s[k + 1]
        for m in range(span[2], span[3]):
            worst, who, why = FREE, -1, 0
            for q in pending:
                one, because = _sector_and_zone(
                    q, sectors, c0, s0, c1, s1, e[m], e[m + 1]
                )
                why |= because
                if one != FREE and worst != BLOCKED:
                    if one == BLOCKED or worst == FREE:
                        who = sectors[9][q]
                    worst = one
            free = 0xFFFF if worst == FREE else 0
            if worst == MIXED:
                worst, free = _settle_parts(
                    c0, s0, c1, s1, beta[m], beta[m + 1], sectors, pending
                )
            state[k, m], parts[k, m] = worst, free
            reason[k, m], wheel[k, m] = (0, -1) if worst == FREE else (why, who)


@njit(cache=True)
def _settle_parts(
    c0: float,
    s0: float,
    c1: float,
    s1: float,
    beta0: float,
    beta1: float,
    sectors: tuple[Array, ...],
    pending: Array,
) -> tuple[int, int]:
    """Return the state of a cell by its 4 × 4 parts, and the bits of the free ones."""
    free, blocked = 0, True
    for i in range(4):
        f0, f1 = i / 4, (i + 1) / 4
        ci0, si0 = c0 + f0 * (c1 - c0), s0 + f0 * (s1 - s0)
        ci1, si1 = c0 + f1 * (c1 - c0), s0 + f1 * (s1 - s0)
        for j in range(4):
            b0 = beta0 + j / 4 * (beta1 - beta0)
            b1 = beta0 + (j + 1) / 4 * (beta1 - beta0)
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
        return FREE, free
    return (BLOCKED if blocked else MIXED), free


@njit(cache=True)
def _fill_loads(
    span: tuple[int, int, int, int],
    edges: tuple[Array, ...],
    loads: tuple[Array, ...],
    binding: Array,
    tops: Array,
    out: tuple[Array, ...],
) -> None:
    """Bound the load over the cells of a block, from the rows that it left open."""
    c, s, e, beta = edges
    kind, p, b, n, d, row_reason, row_wheel = loads
    _, pad, load_low, load_high, state, _, reason, wheel = out
    beside = binding[kind[binding] == OFFSET]
    for k in range(span[0], span[1]):
        for m in range(span[2], span[3]):
            c0, s0, c1, s1, e0, e1 = c[k], s[k], c[k + 1], s[k + 1], e[m], e[m + 1]
            low, high = 0.0, 0.0
            largest = -1
            for r in binding:
                least, tops[r] = load_range(
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
            if beside.size:
                pad[k, m] = _pad_beside(
                    c0, s0, c1, s1, beta[m + 1] - beta[m], e0, e1,
                    loads, binding, beside, tops,
                )  # fmt: skip


@njit(cache=True)
def _pad_beside(
    c0: float,
    s0: float,
    c1: float,
    s1: float,
    width: float,
    e0: complex,
    e1: complex,
    loads: tuple[Array, ...],
    binding: Array,
    beside: Array,
    tops: Array,
) -> float:
    """Return what the corners of a cell need on top because of offset rows."""
    kind, p, b, n, d, _, _ = loads
    corner = np.inf
    for ck, sk in ((c0, s0), (c1, s1)):
        for em in (e0, e1):
            at = 0.0
            for i in binding:
                at = max(at, load_at(kind[i], p[i], b[i], n[i], d[i], ck, sk, em))
            corner = min(corner, at)
    needs = 0.0
    for r in beside:
        lack = max(0.0, tops[r] - corner)
        curve = offset_pad(p[r], b[r], d[r], c0, s0, c1, s1, e0, e1, width)
        needs = max(needs, min(lack, curve))
    return needs
