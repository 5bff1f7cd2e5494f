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

from typing import TypeVar

import numpy as np
import numpy.typing as npt

from omniplan.timing.path_motion import PathPiece

__all__ = ["rounded"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
Cubics = TypeVar("Cubics", npt.NDArray[np.float64], npt.NDArray[np.complex128])

STAIRS = (8, 32)
"""Cubics per window, of jumps that count little and of others."""
SHARE = 0.3
"""At most this share of a span next to a knot is taken."""


def rounded(piece: PathPiece, reach: FloatArray, stairs: IntArray) -> PathPiece:
    """Return a piece whose third derivatives change gradually.

    Parameters
    ----------
    piece : PathPiece
        k knots.
    reach : (k - 2,) float, m, > 0
        δ at every inner knot; it is shortened where the next knot is near.
    stairs : (k - 2,) int
        How many cubics a window has, of `STAIRS`; 0 leaves a knot as it is.

    Returns
    -------
    piece : PathPiece
        With more knots and the same ends.
    """
    if not stairs.any():
        return piece
    span = np.diff(piece.u)
    delta = np.minimum(reach, SHARE * np.minimum(span[:-1], span[1:]))
    delta = np.where(stairs > 0, delta, 0.0)
    # What is left of every span after the window about its start.
    since = np.concatenate([[0.0], delta])
    starts, spans = [piece.u[:-1] + since], [np.arange(span.size)]
    position = [_moved(piece.position, since)]
    heading = [_moved(piece.heading, since)]
    for count in STAIRS:
        at = np.flatnonzero(stairs == count)
        edges = delta[at, None] * np.linspace(-1.0, 1.0, count + 1)[:-1]
        is_after = np.arange(count) >= count // 2
        starts.append((piece.u[1:-1][at, None] + edges).ravel())
        spans.append((at[:, None] + is_after).ravel())
        position.append(_cubics(piece.position, span, delta, at, count))
        heading.append(_cubics(piece.heading, span, delta, at, count))
    order = np.argsort(np.concatenate(starts), kind="stable")
    span_of = np.concatenate(spans)[order]
    return PathPiece(
        np.append(np.concatenate(starts)[order], piece.u[-1]),
        np.concatenate(position, axis=1)[:, order],
        np.concatenate(heading, axis=1)[:, order],
        piece.point,
        piece.max_speed[span_of],
        piece.max_yaw_rate[span_of],
    )


def _levels(count: int) -> FloatArray:
    """Return f on every stair, (count,)."""
    x = np.linspace(-1.0, 1.0, count + 1)
    line, cube = (np.diff(x**n) / np.diff(x) / n for n in (2, 4))
    moments = (line @ line) * 2 / count, (cube @ line) * 2 / count
    a = (1 - moments[1]) / (moments[0] - moments[1])
    return np.asarray(a * line + (1 - a) * cube)


def _cubics(
    given: Cubics, span: FloatArray, delta: FloatArray, at: IntArray, count: int
) -> Cubics:
    """Return the coefficients of the stairs at some knots, (4, n)."""
    found = np.empty((4, at.size, count), dtype=given.dtype)
    left, right = given[0, at], given[0, at + 1]
    now = _moved(given[:, at], span[at] - delta[at])
    for stair, f in enumerate(_levels(count)):
        now[0] = (left + right + (right - left) * f) / 2
        found[:, :, stair] = now
        now = _moved(now, 2 * delta[at] / count)
    return found.reshape(4, -1)


def _moved(cubics: Cubics, h: FloatArray) -> Cubics:
    """Return cubics in the way since a place h further."""
    a, b, c, d = cubics
    return np.stack(
        [a, b + 3 * a * h, c + (2 * b + 3 * a * h) * h, d + (c + (b + a * h) * h) * h]
    )
