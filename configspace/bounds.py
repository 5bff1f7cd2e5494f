"""Exact extremes over one cell; every kernel that bounds something uses these.

A cell is a box ``[κ⁰, κ¹] × [β⁰, β¹]`` that does not straddle κ_n = 0 or ±1. On it
c ≥ 0 and s are affine in κ_n and s keeps its sign; (c0, s0) and (c1, s1) are the
components at its ends, e0 and e1 are ``e^{jβ}`` at its sides, less than π apart.

For maintainers: numba puts these functions into the machine code of their callers and
caches that per file of the *caller*, by its time and size. A change here therefore does
not reach the cached code of `row_bounds`, `kernels` and `rate_kernels`: after a change
of this file, or of `row_bounds`, delete ``configspace/__pycache__/*.nb?``.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math

from numba import njit

__all__ = ["GUARD", "cos_range", "disc_range", "functional_range"]

GUARD = 1e-12
"""What covers rounding, relative to the terms of a bound."""


@njit(cache=True, inline="always")
def cos_range(e0: complex, e1: complex, n: complex) -> tuple[float, float]:
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
def functional_range(
    c0: float, s0: float, c1: float, s1: float, low: float, high: float, h: float
) -> tuple[float, float]:
    """Least and largest ``c cos + s h`` over a cell; `low`, `high` bound the cosine."""
    least = min(c0 * low + s0 * h, c1 * low + s1 * h)
    largest = max(c0 * high + s0 * h, c1 * high + s1 * h)
    return least, largest


@njit(cache=True, inline="always")
def disc_range(
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
    return max(0.0, least - GUARD * largest), largest
