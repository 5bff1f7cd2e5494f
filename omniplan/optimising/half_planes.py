"""Half-planes that keep a vehicle's body away from what is near, place by place."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from omniplan.optimising.separation import Surroundings, line_between
from omniplan.optimising.setting import Box

__all__ = ["Side", "sides_of"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.intp]
ComplexArray = npt.NDArray[np.complex128]

REACH = 1.0
"""How near an obstacle is when it is looked at, m."""
SHALLOW = 0.02
"""The hull of two places that is inside by less is pushed out the shortest way, m."""


@dataclass(frozen=True, eq=False)
class Side:
    """A half-plane that a part of the body keeps to at one step."""

    step: int
    arms: ComplexArray
    """Corners of the part, from K in the body frame, m."""
    normal: complex
    least: float
    """Of all corners along the normal, m."""


def sides_of(
    place: ComplexArray,
    heading: FloatArray,
    surroundings: Surroundings,
    room: float,
    bounds: Box | None,
    *,
    swept: bool = False,
) -> list[Side]:
    """Return half-planes that keep the body away from what is near, step by step.

    Parameters
    ----------
    place, heading : (n,) complex, m, and float, rad
        Of K; the first and the last place are not looked at.
    surroundings : Surroundings
    room : float, m
        Distance to keep from obstacles and bounds.
    bounds : (x0, y0, x1, y1) float, m, optional
    swept : bool
        Whether a half-plane is for two successive places, so that what lies between
        keeps to it as well, and not for one.
    """
    ahead = np.gradient(place)
    ahead = ahead / np.maximum(np.abs(ahead), 1e-12)
    found: list[Side] = []
    for body in surroundings.body:
        arms = np.array(body)
        corners = place[:, None] + np.exp(1j * heading)[:, None] * arms
        looked = corners
        if swept:
            looked = np.concatenate([corners[:-1], corners[1:]], axis=1)
        for part, box in zip(surroundings.parts, surroundings.boxes, strict=True):
            steps = _near(looked, box)
            if not swept:
                steps = steps[(steps > 0) & (steps < len(place) - 1)]
            inside = SHALLOW if swept else 0.0
            normals = _normals(looked[steps], part, 1j * ahead[steps], room, inside)
            for k, normal in zip(steps.tolist(), normals, strict=True):
                least = float((part * np.conj(normal)).real.max()) + room
                found += [
                    Side(j, arms, normal, least)
                    for j in ((k, k + 1) if swept else (k,))
                    if 0 < j < len(place) - 1
                ]
        if bounds is not None:
            found += _inside(corners, arms, bounds, room)
    return found


def _near(corners: ComplexArray, box: FloatArray) -> IntArray:
    """Return the rows of corners that come near a box."""
    x0, y0, x1, y1 = box
    near = (corners.real.max(axis=1) > x0 - REACH) & (
        corners.real.min(axis=1) < x1 + REACH
    )
    near &= (corners.imag.max(axis=1) > y0 - REACH) & (
        corners.imag.min(axis=1) < y1 + REACH
    )
    return np.flatnonzero(near)


def _normals(
    corners: ComplexArray,
    part: ComplexArray,
    across: ComplexArray,
    room: float,
    inside: float,
) -> list[complex]:
    """Return the directions in which a body is kept off: where it is free, or aside.

    Where it is far inside, all of it is pushed to the side that is nearer.
    """
    lack = [_lack(corners, part, side * across, room) for side in (1, -1)]
    side = 1 if lack[0].sum() <= lack[1].sum() else -1
    found = []
    for row, normal in zip(corners, (side * across).tolist(), strict=True):
        gap, direction, _ = line_between(row, part)
        is_free = gap > -inside
        found.append(complex(np.exp(1j * direction)) if is_free else normal)
    return found


def _inside(
    corners: ComplexArray, arms: ComplexArray, bounds: Box, room: float
) -> Iterator[Side]:
    """Yield the half-planes of the bounds that are near."""
    x0, y0, x1, y1 = bounds
    for normal, wall in ((1, x0), (-1, -x1), (1j, y0), (-1j, -y1)):
        gap = (corners * np.conj(normal)).real.min(axis=1) - wall
        for k in (np.flatnonzero(gap[1:-1] < REACH) + 1).tolist():
            yield Side(k, arms, complex(normal), wall + room)


def _lack(
    corners: ComplexArray, part: ComplexArray, normals: ComplexArray, room: float
) -> FloatArray:
    """Return how far a body would have to move along normals to be clear, m."""
    conj = normals.conj()[:, None]
    nearest = (corners * conj).real.min(axis=1)
    farthest = (part[None] * conj).real.max(axis=1)
    return np.asarray(np.maximum(farthest + room - nearest, 0.0))
