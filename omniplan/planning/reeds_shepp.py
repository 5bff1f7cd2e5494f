"""Shortest ways of a vehicle with a least radius that drives forwards and backwards.

A word is a chain of at most five pieces, left or right turns of radius 1 or straight
ones. For every of the 48 words there is a closed form; all that exist are returned, as
the shortest one is not always free, nor the quickest.

References
----------
J. Reeds, L. Shepp, Optimal paths for a car that goes both forwards and backwards,
Pacific J. Math. 145 (1990), formulas 8.1 to 8.11.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np
import numpy.typing as npt

__all__ = ["LEFT", "RIGHT", "STRAIGHT", "words"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

LEFT, STRAIGHT, RIGHT = 1, 0, -1
NONE = 2
"""Fills up a word that has less than five pieces."""

_LSL, _LSR, _LRL, _LRLR_A, _LRLR_B, _LRSL, _LRSR, _LRSLR = range(8)
_SHAPES = np.array(
    [
        [LEFT, STRAIGHT, LEFT, NONE, NONE],
        [LEFT, STRAIGHT, RIGHT, NONE, NONE],
        [LEFT, RIGHT, LEFT, NONE, NONE],
        [LEFT, RIGHT, LEFT, RIGHT, NONE],
        [LEFT, RIGHT, LEFT, RIGHT, NONE],
        [LEFT, RIGHT, STRAIGHT, LEFT, NONE],
        [LEFT, RIGHT, STRAIGHT, RIGHT, NONE],
        [LEFT, RIGHT, STRAIGHT, LEFT, RIGHT],
    ]
)
_PIECES = np.array([3, 3, 3, 4, 4, 4, 4, 5])
_MAX_WORDS = 64
_HALF = math.pi / 2
ROUNDING = 1e-9
"""A length may be so far on the wrong side of 0, rad: it is 0 then."""


def words(x: float, y: float, phi: float) -> tuple[IntArray, FloatArray]:
    """Return all words that lead from (0, 0, 0) to a pose, the shortest one first.

    Parameters
    ----------
    x, y : float, in units of the radius
    phi : float, rad

    Returns
    -------
    turns : (n, 5) int
        `LEFT` (1), `STRAIGHT` (0) or `RIGHT` (-1); pieces of length 0 fill up.
    lengths : (n, 5) float
        In units of the radius, that is rad for turns; negative: driven backwards.

    Examples
    --------
    >>> turns, lengths = words(2.0, 2.0, math.pi / 2)
    >>> float(abs(lengths[0]).sum().round(4))
    2.985
    """
    turns = np.empty((_MAX_WORDS, 5), dtype=np.int64)
    lengths = np.empty((_MAX_WORDS, 5))
    phi = math.remainder(phi, 2 * math.pi)
    count = _all_words(x, y, phi, turns, lengths)
    total = np.abs(lengths[:count]).sum(axis=1)
    order = np.argsort(total, kind="stable")
    return turns[order], lengths[order]


@nb.njit(cache=True)
def _mod(angle):  # type: ignore[no-untyped-def]
    """Return the angle in [-π, π]."""
    turned = angle % (2 * math.pi)
    return turned - 2 * math.pi if turned > math.pi else turned


@nb.njit(cache=True)
def _tau_omega(u, v, xi, eta, phi):  # type: ignore[no-untyped-def]
    """Return the outer lengths of a word of four turns."""
    delta = _mod(u - v)
    a = math.sin(u) - math.sin(delta)
    b = math.cos(u) - math.cos(delta) - 1
    first = math.atan2(eta * a - xi * b, xi * a + eta * b)
    second = 2 * (math.cos(delta) - math.cos(v) - math.cos(u)) + 3
    tau = _mod(first + math.pi) if second < 0 else _mod(first)
    return tau, _mod(tau - u + v - phi)


@nb.njit(cache=True)
def _solve(shape, x, y, phi):  # type: ignore[no-untyped-def]
    """Return whether a basic word exists, and its lengths t, u, v.

    The signs of the lengths are those of the basic words: L+S+L+, L+S+R+, L+R-L,
    L+R+L-R-, L+R-L-R+, L+R-S-L-, L+R-S-R-, L+R-S-L-R+.
    """
    sine, cosine = math.sin(phi), math.cos(phi)
    if shape in (_LSL, _LRL, _LRSL):
        xi, eta = x - sine, y - 1 + cosine
    else:
        xi, eta = x + sine, y - 1 - cosine
    rho, angle = math.hypot(xi, eta), math.atan2(eta, xi)
    t, u, v = 0.0, 0.0, 0.0
    if shape == _LSL:  # 8.1
        t, u = angle, rho
        v = _mod(phi - t)
        return t >= -ROUNDING and v >= -ROUNDING, t, u, v
    if shape == _LSR:  # 8.2
        if rho < 2:
            return False, t, u, v
        u = math.sqrt(rho * rho - 4)
        t = _mod(angle + math.atan2(2.0, u))
        v = _mod(t - phi)
        return t >= -ROUNDING and v >= -ROUNDING, t, u, v
    if shape == _LRL:  # 8.3, 8.4 (the sign of v is free)
        if rho > 4:
            return False, t, u, v
        u = -2 * math.asin(rho / 4)
        t = _mod(angle + u / 2 + math.pi)
        v = _mod(phi - t + u)
        return t >= -ROUNDING and u <= ROUNDING, t, u, v
    if shape == _LRLR_A:  # 8.7
        size = (2 + rho) / 4
        if size > 1:
            return False, t, u, v
        u = math.acos(size)
        t, v = _tau_omega(u, -u, xi, eta, phi)
        return t >= -ROUNDING and v <= ROUNDING, t, u, v
    if shape == _LRLR_B:  # 8.8
        size = (20 - rho * rho) / 16
        if size < 0 or size > 1:
            return False, t, u, v
        u = -math.acos(size)
        t, v = _tau_omega(u, u, xi, eta, phi)
        return t >= -ROUNDING and v >= -ROUNDING, t, u, v
    if rho < 2:
        return False, t, u, v
    if shape == _LRSL:  # 8.9
        root = math.sqrt(rho * rho - 4)
        u = 2 - root
        t = _mod(angle + math.atan2(root, -2.0))
        v = _mod(phi - _HALF - t)
        return t >= -ROUNDING and u <= ROUNDING and v <= ROUNDING, t, u, v
    if shape == _LRSR:  # 8.10
        t, u = math.atan2(xi, -eta), 2 - rho
        v = _mod(t + _HALF - phi)
        return t >= -ROUNDING and u <= ROUNDING and v <= ROUNDING, t, u, v
    u = 4 - math.sqrt(rho * rho - 4)  # 8.11
    if u > ROUNDING:
        return False, t, u, v
    t = _mod(math.atan2((4 - u) * xi - 2 * eta, -2 * xi + (u - 4) * eta))
    v = _mod(t - phi)
    return t >= -ROUNDING and v >= -ROUNDING, t, u, v


@nb.njit(cache=True)
def _put(shape, t, u, v, flip, mirror, is_backwards, turns, lengths):  # type: ignore[no-untyped-def]
    """Write one word: driven the other way, mirrored, or read from its end."""
    if shape < _LRLR_A:
        values = (t, u, v, 0.0, 0.0)
    elif shape == _LRLR_A:
        values = (t, u, -u, v, 0.0)
    elif shape == _LRLR_B:
        values = (t, u, u, v, 0.0)
    elif shape == _LRSLR:
        values = (t, -_HALF, u, -_HALF, v)
    else:
        values = (t, -_HALF, u, v, 0.0)
    pieces = _PIECES[shape]
    for k in range(5):
        if k >= pieces:
            turns[k], lengths[k] = STRAIGHT, 0.0
            continue
        source = pieces - 1 - k if is_backwards else k
        turns[k] = _SHAPES[shape, source] * mirror
        lengths[k] = values[source] * flip


@nb.njit(cache=True)
def _all_words(x, y, phi, turns, lengths):  # type: ignore[no-untyped-def]
    """Write all words that exist and return how many there are."""
    count = 0
    back_x = x * math.cos(phi) + y * math.sin(phi)
    back_y = x * math.sin(phi) - y * math.cos(phi)
    for shape in range(8):
        ways = 2 if shape in (_LRL, _LRSL, _LRSR) else 1
        for way in range(ways):
            at_x, at_y = (back_x, back_y) if way else (x, y)
            for flip in (1, -1):
                for mirror in (1, -1):
                    exists, t, u, v = _solve(
                        shape, at_x * flip, at_y * mirror, phi * flip * mirror
                    )
                    if exists and count < _MAX_WORDS:
                        _put(
                            shape,
                            t,
                            u,
                            v,
                            flip,
                            mirror,
                            way == 1,
                            turns[count],
                            lengths[count],
                        )
                        count += 1
    return count
