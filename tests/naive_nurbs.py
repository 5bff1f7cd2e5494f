"""NURBS by the textbook: basis functions by the Cox-de Boor recursion."""

from __future__ import annotations

import math
from collections.abc import Sequence


def basis(i: int, p: int, u: float, knots: Sequence[float]) -> float:
    """N_{i,p}(u), Piegl/Tiller Eq. (2.5); the last span holds its end."""
    if p == 0:
        is_last = u == knots[-1] and knots[i] < knots[i + 1] == knots[-1]
        return 1.0 if knots[i] <= u < knots[i + 1] or is_last else 0.0
    total = 0.0
    if knots[i + p] > knots[i]:
        share = (u - knots[i]) / (knots[i + p] - knots[i])
        total += share * basis(i, p - 1, u, knots)
    if knots[i + p + 1] > knots[i + 1]:
        share = (knots[i + p + 1] - u) / (knots[i + p + 1] - knots[i + 1])
        total += share * basis(i + 1, p - 1, u, knots)
    return total


def blended(
    values: Sequence[float],
    weights: Sequence[float],
    knots: Sequence[float],
    degree: int,
    u: float,
) -> float:
    """Σ N w value / Σ N w, Eq. (4.1)."""
    shares = [basis(i, degree, u, knots) * w for i, w in enumerate(weights)]
    return math.fsum(s * v for s, v in zip(shares, values, strict=True)) / math.fsum(
        shares
    )
