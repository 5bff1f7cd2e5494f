"""Rounding off the jumps of a path's third derivative.

Steering accelerations contain the third derivative of the path, which jumps at the
knots of its C² splines. The optimum answers with a jump of ü, but poses in time that
are C² have none: they would have to pass every knot so slowly that both sides of the
jump suit one ü. So around a knot the third derivative is led from the one side to the
other. On a window ``|h| ≤ δ`` about the knot the jump Δ becomes

    p''' = (left + right)/2 + Δ/2 f(h/δ),   f(x) = a x + (1 - a) x³

as a staircase of cubics. It joins both sides as they are if f has the first moment of
the step, ``∫ x f dx = ∫ |x| dx``; the others agree as f is odd. The path leaves its
spline by less than ``δ³ |Δ| / 100``.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from omniplan.timing.path_motion import PathPiece

__all__ = ["rounded"]

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

STAIRS = 32
"""Cubics per window."""
SHARE = 0.3
"""At most this share of a span next to a knot is taken."""


def rounded(piece: PathPiece, reach: FloatArray) -> PathPiece:
    """Return a piece whose third derivatives change gradually.

    Parameters
    ----------
    piece : PathPiece
        k knots.
    reach : (k - 2,) float, m, > 0
        δ at every inner knot; it is shortened where the next knot is near.

    Returns
    -------
    piece : PathPiece
        With more knots and the same ends.
    """
    inner = piece.u.size - 2
    if inner < 1:
        return piece
    span = np.diff(piece.u)
    delta = np.minimum(reach, SHARE * np.minimum(span[:-1], span[1:]))
    edges = delta[:, None] * np.linspace(-1.0, 1.0, STAIRS + 1)
    # After the last edge of a window comes what is left of the span.
    is_after = np.arange(STAIRS + 1) >= STAIRS // 2
    span_of = np.append(0, (np.arange(inner)[:, None] + is_after).ravel())
    starts = (piece.u[1:-1, None] + edges).ravel()
    return PathPiece(
        np.concatenate([piece.u[:1], starts, piece.u[-1:]]),
        _cubics(piece.position, span, delta),
        _cubics(piece.heading.astype(np.complex128), span, delta).real,
        piece.point,
        piece.max_speed[span_of],
        piece.max_yaw_rate[span_of],
    )


def _stairs() -> FloatArray:
    """Return f on every stair, (STAIRS,)."""
    x = np.linspace(-1.0, 1.0, STAIRS + 1)
    line, cube = (np.diff(x**n) / np.diff(x) / n for n in (2, 4))
    moments = (line @ line) * 2 / STAIRS, (cube @ line) * 2 / STAIRS
    a = (1 - moments[1]) / (moments[0] - moments[1])
    return np.asarray(a * line + (1 - a) * cube)


def _cubics(given: ComplexArray, span: FloatArray, delta: FloatArray) -> ComplexArray:
    """Return the coefficients of all cubics, (4, n), highest power first."""
    found = np.empty((4, delta.size, STAIRS + 1), dtype=np.complex128)
    left, right = given[0, :-1], given[0, 1:]
    at = _moved(given[:, :-1], span[:-1] - delta)
    for stair, f in enumerate(_stairs()):
        at[0] = (left + right + (right - left) * f) / 2
        found[:, :, stair] = at
        at = _moved(at, 2 * delta / STAIRS)
    found[:, :, STAIRS] = _moved(given[:, 1:], delta)
    return np.concatenate([given[:, :1], found.reshape(4, -1)], axis=1)


def _moved(cubics: ComplexArray, h: FloatArray) -> ComplexArray:
    """Return cubics in the way since a place h further."""
    a, b, c, d = cubics
    return np.stack(
        [a, b + 3 * a * h, c + (2 * b + 3 * a * h) * h, d + (c + (b + a * h) * h) * h]
    )
