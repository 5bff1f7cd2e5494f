"""Ways between configurations by search, where the simple ones do not do.

`transitions` searches the surface of all configurations. What it finds follows the
vehicle's formulas only at points; here it is thinned to straight legs in (κ_n, β), and
`ways` lets the judge prove these like any other way.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from functools import lru_cache
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from configspace import PermissibleSpace
from configspace.angles import wrap
from configspace.vehicle import SteerableWheel
from omniplan.standing.transitions import TransitionMap

__all__ = ["searched_legs", "surface_of"]

FloatArray = npt.NDArray[np.float64]
Configuration = tuple[float, float]

COARSENESS = (0.1, 0.03, 0.01, 0.0)
"""By how much legs may stand off the way that was found, tried in turn."""
CORNER = math.pi / 2
"""Corners of a leg are no further apart in β, so that it stays clear which way round
is meant."""
DIGITS = 6
"""Configurations alike to so many digits share one search: a trajectory is asked about
again when it is driven slower."""

_SURFACES: WeakKeyDictionary[PermissibleSpace, TransitionMap | None] = (
    WeakKeyDictionary()
)


def surface_of(space: PermissibleSpace) -> TransitionMap | None:
    """Return the surface of a space, made once; None where nothing can be searched.

    Parameters
    ----------
    space : PermissibleSpace
        Can be searched if it knows its vehicle, that vehicle is not bound to a line or
        to translation, and some wheel takes time to turn.
    """
    if space not in _SURFACES:
        _SURFACES[space] = _surface(space)
    return _SURFACES[space]


def _surface(space: PermissibleSpace) -> TransitionMap | None:
    vehicle = space.vehicle
    if vehicle is None or space.line_beta is not None or space.is_translating:
        return None
    rates = [
        wheel.standing_steering_rate
        for wheel in vehicle.wheels
        if isinstance(wheel, SteerableWheel)
    ]
    return TransitionMap(vehicle) if any(map(math.isfinite, rates)) else None


def searched_legs(
    surface: TransitionMap, start: Configuration, goal: Configuration
) -> Iterator[list[Configuration]]:
    """Yield the quickest way found as corners in (κ_n, β), coarse ones first.

    Parameters
    ----------
    surface : TransitionMap
    start, goal : (float, float), 1 and rad
    """
    way = _way(surface, _rounded(start), _rounded(goal))
    if way is None:
        return
    points = _with_ends(way, start, goal)
    count = 0
    for coarseness in COARSENESS:
        corners = _thinned(points, coarseness)
        if len(corners) != count:
            yield [(float(k), float(b)) for k, b in _filled(corners)]
        count = len(corners)


def _rounded(at: Configuration) -> Configuration:
    return round(at[0], DIGITS), round(at[1], DIGITS)


@lru_cache(maxsize=256)
def _way(
    surface: TransitionMap, start: Configuration, goal: Configuration
) -> FloatArray | None:
    found = surface.between(start, goal)
    return None if found is None else found.way


def _with_ends(
    way: FloatArray, start: Configuration, goal: Configuration
) -> FloatArray:
    """Return the way from start to goal exactly; at poles their β may be any."""
    points = way.copy()
    for row, at in ((0, start), (-1, goal)):
        points[row] = at[0], points[row, 1] + wrap(at[1] - points[row, 1])
    return points


def _thinned(points: FloatArray, coarseness: float) -> FloatArray:
    """Return the fewest corners that stand off by no more (Douglas and Peucker)."""
    keep = np.zeros(len(points), dtype=bool)
    keep[[0, -1]] = True
    waiting = [(0, len(points) - 1)]
    while waiting:
        first, last = waiting.pop()
        if last - first < 2:
            continue
        a, b = points[first], points[last]
        inner = points[first + 1 : last] - a
        length = max(float((b - a) @ (b - a)), 1e-300)
        f = np.clip(inner @ (b - a) / length, 0.0, 1.0)
        off = np.linalg.norm(inner - f[:, None] * (b - a), axis=1)
        worst = int(off.argmax())
        if off[worst] > coarseness:
            middle = first + 1 + worst
            keep[middle] = True
            waiting += [(first, middle), (middle, last)]
    return np.asarray(points[keep])


def _filled(corners: FloatArray) -> FloatArray:
    """Return the corners with more between those far apart in β."""
    filled = [corners[:1]]
    for a, b in itertools.pairwise(corners):
        count = max(math.ceil(abs(b[1] - a[1]) / CORNER), 1)
        filled.append(a + np.arange(1, count + 1)[:, None] / count * (b - a))
    return np.concatenate(filled)
