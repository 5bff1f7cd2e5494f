"""Distances of polygons in plain NumPy: every side against every side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def placed(polygon: FloatArray, pose: Sequence[float] | FloatArray) -> FloatArray:
    """Return the corners of a polygon in the frame of a pose."""
    x, y, theta = (float(value) for value in pose)
    c, s = np.cos(theta), np.sin(theta)
    return np.asarray(polygon @ np.array([[c, s], [-s, c]]) + [x, y])


def distance(first: FloatArray, second: FloatArray) -> float:
    """Return the distance of two polygons (n, 2) and (m, 2); 0 where they overlap."""
    if contains(first, second[0]) or contains(second, first[0]):
        return 0.0
    a, b = first, np.roll(first, -1, axis=0)
    c, d = second, np.roll(second, -1, axis=0)
    if _cross(a, b, c, d):
        return 0.0
    return min(_to_sides(a, c, d), _to_sides(c, a, b))


def contains(polygon: FloatArray, point: FloatArray) -> bool:
    """Return whether a ray from the point to the right crosses the border oddly."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    spans = (a[:, 1] > point[1]) != (b[:, 1] > point[1])
    a, b = a[spans], b[spans]
    x = a[:, 0] + (point[1] - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
    return bool(np.count_nonzero(x > point[0]) % 2)


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    u, v = b - a, c - a
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


def _cross(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> bool:
    """Return whether a side of one polygon properly crosses one of the other."""
    a, b = a[:, None], b[:, None]
    apart = _turn(a, b, c[None]) * _turn(a, b, d[None]) < 0
    return bool(
        (apart & (_turn(c[None], d[None], a) * _turn(c[None], d[None], b) < 0)).any()
    )


def _to_sides(points: FloatArray, a: FloatArray, b: FloatArray) -> float:
    side, to = b - a, points[:, None] - a
    share = np.clip((to * side).sum(-1) / (side**2).sum(-1), 0.0, 1.0)
    return float(np.linalg.norm(to - share[..., None] * side, axis=-1).min())
