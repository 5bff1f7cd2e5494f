"""What the rows of `configspace.limits` say over one cell, in numba.

The loads of `LoadRow` at points and their extremes over cells, and the states of cells
under the two parts of a `SectorRow`. See `configspace.bounds` for cells, and for what
to do about cached code after a change of this file.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math

import numpy as np
from numba import njit

from configspace.bounds import GUARD, cos_range, disc_range, functional_range
from configspace.omni_curve import POLE

__all__ = [
    "BLOCKED",
    "DISC",
    "EDGE",
    "FREE",
    "LATERAL",
    "MIXED",
    "OFFSET",
    "STRIP",
    "load_at",
    "load_range",
    "offset_pad",
    "sector_state",
    "zone_state",
]

FREE, BLOCKED, MIXED = 0, 1, 2
"""States of a cell: permitted all over, nowhere, or to be settled."""

DISC, STRIP, OFFSET, LATERAL, EDGE = 0, 1, 2, 3, 4
"""Kinds of load rows."""


@njit(cache=True, inline="always")
def load_range(
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
    if kind == DISC:
        low, high = cos_range(e0, e1, p * b)
        bb = b.real * b.real + b.imag * b.imag
        least, largest = disc_range(c0, s0, c1, s1, p, bb, low, high)
        return least, largest
    if kind == STRIP:
        low, high = cos_range(e0, e1, p * n)
        h = b.real * n.real + b.imag * n.imag
        least, largest = functional_range(c0, s0, c1, s1, low, high, h)
        bottom, top = _squared(least, largest)
        return bottom, top
    if kind == OFFSET:
        least, largest = _offset_range(p, b, d, c0, s0, c1, s1, e0, e1)
        bottom, top = _squared(least, largest)
        return bottom, top
    small, large = min(abs(s0), abs(s1)), max(abs(s0), abs(s1))
    if kind == LATERAL:
        low, high = cos_range(e0, e1, b)
        bb = b.real * b.real + b.imag * b.imag
        least, largest = disc_range(c0, s0, c1, s1, 1.0, bb, low, high)
        return p * small * math.sqrt(least), p * large * math.sqrt(largest)
    low, high = cos_range(e0, e1, n)
    h = b.real * n.real + b.imag * n.imag
    least, largest = functional_range(c0, s0, c1, s1, low, high, h)
    if s0 + s1 < 0:
        least, largest = -largest, -least
    top = max(0.0, largest * large, largest * small)
    bottom = max(0.0, min(least * large, least * small))
    return p * bottom, p * top


@njit(cache=True, inline="always")
def load_at(
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
    if kind == LATERAL:
        return p * abs(s) * abs(c * e + s * b)
    if kind == EDGE:
        z = c * e + s * b
        return max(0.0, p * s * (z.real * n.real + z.imag * n.imag))
    z = c * p * e + s * b
    if kind == DISC:
        return z.real * z.real + z.imag * z.imag
    if kind == OFFSET:
        rest = abs(z) - s * d
        return rest * rest
    along = z.real * n.real + z.imag * n.imag
    return along * along


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
    """Bounds of ``|c e p + s b| - s d`` over a cell; the largest is exact.

    The length is convex in κ_n for every β, and so is what is left of it. The least is
    a bound only: it takes the least length and the largest ``s d``, which may be at
    different places. Where the difference is negative in the cell it is also the larger
    in size, so there the bound of its square is safe but not exact.
    """
    low, high = cos_range(e0, e1, p * b)
    bb = b.real * b.real + b.imag * b.imag
    least, _ = disc_range(c0, s0, c1, s1, p, bb, low, high)
    far = high if s0 + s1 > 0 else low
    at0 = math.sqrt(max(0.0, c0 * c0 * p * p + s0 * s0 * bb + 2 * c0 * s0 * far))
    at1 = math.sqrt(max(0.0, c1 * c1 * p * p + s1 * s1 * bb + 2 * c1 * s1 * far))
    return math.sqrt(least) - max(s0 * d, s1 * d), max(at0 - s0 * d, at1 - s1 * d)


@njit(cache=True, inline="always")
def _squared(least: float, largest: float) -> tuple[float, float]:
    """Range of the square of what ranges from `least` to `largest`."""
    top = max(least * least, largest * largest)
    bottom = 0.0 if least <= 0 <= largest else min(least * least, largest * largest)
    return bottom, top


@njit(cache=True, inline="always")
def offset_pad(
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
    low, high = cos_range(e0, e1, p * b)
    bb = b.real * b.real + b.imag * b.imag
    least, _ = disc_range(c0, s0, c1, s1, p, bb, low, high)
    c, s = max(c0, c1), max(abs(s0), abs(s1))
    near = math.sqrt(least)
    if near - s * abs(d) <= 0:
        return np.inf
    curve = 2 * c * s * p * math.sqrt(bb)
    curve += 2 * s * abs(d) * max(c * p, (c * p) ** 2 / near)
    return width * width / 8 * curve


@njit(cache=True, inline="always")
def zone_state(
    b: complex,
    kappa_share: float,
    beta_share: float,
    pole: float,
    c0: float,
    s0: float,
    c1: float,
    s1: float,
    e0: complex,
    e1: complex,
) -> int:
    """State of a cell under the guaranteed change rates of one wheel.

    As `configspace.exact.turning_excess`; `pole` is what is asked at κ_n = ±2. A cell
    that touches a pole is free only if the pole is.
    """
    if kappa_share == 0 and beta_share == 0:
        return FREE
    low, high = cos_range(e0, e1, b)  # Re(e b̄)
    left, right = cos_range(e0, e1, 1j * b)  # Im(e b̄)
    far = max(abs(left), abs(right))
    near = 0.0 if left <= 0 <= right else min(abs(left), abs(right))
    bb = b.real * b.real + b.imag * b.imag
    least, largest = disc_range(c0, s0, c1, s1, 1.0, bb, low, high)
    inner = min(c0 + min(s0 * low, s0 * high), c1 + min(s1 * low, s1 * high))
    outer = max(c0 + max(s0 * low, s0 * high), c1 + max(s1 * low, s1 * high))
    # |c (c + s f)|
    most = max(c0, c1) * max(abs(inner), abs(outer))
    fewest = 0.0
    if not inner <= 0 <= outer:
        fewest = min(c0, c1) * min(abs(inner), abs(outer))
    if kappa_share * far + beta_share * most <= least - GUARD and (
        min(c0, c1) > POLE or pole <= bb - GUARD
    ):
        return FREE
    if kappa_share * near + beta_share * fewest > largest + GUARD:
        return BLOCKED
    return MIXED


@njit(cache=True, inline="always")
def sector_state(
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
            low, high = cos_range(e0, e1, n)
            h = b.real * n.real + b.imag * n.imag
            least, largest = functional_range(c0, s0, c1, s1, low, high, h)
            if largest < -GUARD:
                return BLOCKED
            if least <= GUARD:
                worst = MIXED
        return worst
    # Permitted if the cell lies in one half-plane clear of the forbidden wedge; the
    # normal is the cell's own direction, turned towards the middle where it must.
    mean_c, mean_s = (c0 + c1) / 2, (s0 + s1) / 2
    centre = mean_c * (e0 + e1) / 2 + mean_s * b
    size = abs(centre)
    if size > GUARD:
        n = centre / size
        cos_n = n.real * middle.real + n.imag * middle.imag
        if cos_n < cos_slack:
            side = middle.real * n.imag - middle.imag * n.real
            sine = math.sqrt(max(0.0, 1 - cos_slack * cos_slack))
            n = middle * complex(cos_slack, sine if side >= 0 else -sine)
        low, _ = cos_range(e0, e1, n)
        h = b.real * n.real + b.imag * n.imag
        least, _ = functional_range(c0, s0, c1, s1, low, low, h)
        if least > GUARD:
            return FREE
    if cos_slack == -1.0:
        return MIXED
    # Blocked if the cell lies in the forbidden wedge.
    for n in (1j * upper, -1j * lower):
        low, _ = cos_range(e0, e1, n)
        h = b.real * n.real + b.imag * n.imag
        least, _ = functional_range(c0, s0, c1, s1, low, low, h)
        if least <= GUARD:
            return MIXED
    return BLOCKED
