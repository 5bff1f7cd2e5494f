"""The facets of surfaces over the (κ_n, β) plane, as numbers; no matplotlib here."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from configspace.errors import InvalidInput, Problem
from configspace.kinematics import wheel_states
from configspace.omni_curve import components
from configspace.plot_data import crossings, require_plane, steering_span
from configspace.rotation_centre import singular_points
from configspace.space import PermissibleSpace
from configspace.vehicle import Castor, SteerableWheel, SteeredWheel, Vehicle

__all__ = [
    "Facets",
    "blocked_polygons",
    "rolling_polygons",
    "steering_polygons",
    "surface_polygons",
    "wheel_index",
]

FloatArray = npt.NDArray[np.float64]
Facets: TypeAlias = list[FloatArray]
"""Polygons, each (p, 3) float: corners (κ_n, β, height) in 1, rad, unit of height."""

# 0 and ±1, where surfaces have kinks, are nodes.
_KAPPA_NODES = np.linspace(-2, 2, 49)
_BETA_NODES = np.linspace(-np.pi, np.pi, 61)
# Further nodes so far from a singular point, where the steering angle jumps.
_NEAR = np.array([0.04, 0.016, 0.006, 0.002])


def surface_polygons(
    space: PermissibleSpace, *, reverse: bool = False
) -> tuple[Facets, Facets]:
    """Return the facets of the surface v_max and the blocked area beneath.

    A coarse net of nodes, cut along the edge of the blocked area, which is found by
    bisection; so the edge is sharp and no facet falls down to the ground.

    Parameters
    ----------
    space : PermissibleSpace
    reverse : bool

    Returns
    -------
    permitted : list of (p, 3) float
        Corners (κ_n, β, v_max) in 1, rad, m/s; v_max > 0 at each.
    blocked : list of (p, 3) float
        Corners (κ_n, β, 0).
    """
    return _cut_net(space, _KAPPA_NODES, _BETA_NODES, reverse)


def blocked_polygons(space: PermissibleSpace) -> Facets:
    """Return the blocked area alone, more finely than `surface_polygons`.

    Parameters
    ----------
    space : PermissibleSpace

    Returns
    -------
    blocked : list of (p, 3) float
        Corners (κ_n, β, 0) in 1, rad.
    """
    kappa_n, beta = np.linspace(-2, 2, 161), np.linspace(-np.pi, np.pi, 181)
    if space.vehicle is not None and len(space.vehicle.wheels) <= 12:
        for wheel in range(len(space.vehicle.wheels)):
            kappa_n, beta = _nodes_near_jumps(space.vehicle, wheel, kappa_n, beta)
    return _cut_net(space, kappa_n, beta)[1]


def steering_polygons(
    space: PermissibleSpace, wheel: int | str
) -> tuple[Facets, Facets]:
    """Return the facets of the steering angle of one wheel.

    The angles run over the full turn about the middle of the wheel's range. Facets end
    there and continue a turn further down or up; none spans the jump at a singular
    point.

    Parameters
    ----------
    space : PermissibleSpace
    wheel : int or str
        Index or id.

    Returns
    -------
    permitted : list of (p, 3) float
        Corners (κ_n, β, α) in 1, rad, rad.
    blocked : list of (p, 3) float
        Corners (κ_n, β, 0).

    Raises
    ------
    InvalidInput
        If the vehicle is not known, has no such wheel or the wheel does not steer.
    """
    vehicle, index = _known_wheel(space, wheel)
    steered = vehicle.wheels[index]
    if not isinstance(steered, SteerableWheel):
        raise InvalidInput(Problem("wheel", f"{steered.id}: {steered.type}", "steers"))
    middle, _ = steering_span(steered)
    kappa_n, beta = _nodes_near_jumps(vehicle, index)
    permitted, blocked = _cut_net(space, kappa_n, beta)
    alpha = _over(
        permitted, lambda k, b: wheel_states(vehicle, k, b, 1.0)[0][..., index]
    )
    facets: Facets = []
    for corners, angles in zip(permitted, alpha, strict=True):
        # The corners lie around their mean direction, which counts from the middle.
        mean = np.angle(np.exp(1j * (angles - middle)).sum()) + middle
        around = mean + np.angle(np.exp(1j * (angles - mean)))
        if np.ptp(around) > 2.6:  # a singular point is inside
            continue
        for turn in (-2 * np.pi, 0.0, 2 * np.pi):
            facet = np.column_stack([corners[:, :2], around + turn])
            facet = _clip(_clip(facet, middle + np.pi, -1), middle - np.pi, 1)
            if len(facet) > 2 and np.ptp(facet[:, 2]) > 0:
                facets.append(facet)
    return facets, blocked


def rolling_polygons(
    space: PermissibleSpace, wheel: int | str
) -> tuple[Facets, Facets]:
    """Return the facets of the rolling speed of one wheel at v_s = 1 m/s.

    Of a wheel beside its steering axis that of the wheel, of a turntable that of its
    middle; the steering rests.

    Parameters
    ----------
    space : PermissibleSpace
    wheel : int or str
        Index or id.

    Returns
    -------
    permitted : list of (p, 3) float
        Corners (κ_n, β, u) in 1, rad, m/s.
    blocked : list of (p, 3) float
        Corners (κ_n, β, 0).

    Raises
    ------
    InvalidInput
        If the vehicle is not known, has no such wheel or the wheel is a castor.

    References
    ----------
    Brenner and Colomb 2022, sections 3.3 and 3.4.
    """
    vehicle, index = _known_wheel(space, wheel)
    rolling = vehicle.wheels[index]
    if isinstance(rolling, Castor):
        raise InvalidInput(
            Problem("wheel", f"{rolling.id}: castor", "a wheel that constrains")
        )
    offset = rolling.offset if isinstance(rolling, SteeredWheel) else 0.0

    def speed(kappa_n: FloatArray, beta: FloatArray) -> FloatArray:
        u = wheel_states(vehicle, kappa_n, beta, 1.0)[1][..., index]
        yaw_rate = components(kappa_n)[1] * vehicle.boundary_curvature
        return np.asarray(u - yaw_rate * offset)

    permitted, blocked = _cut_net(space, *_nodes_near_jumps(vehicle, index))
    heights = _over(permitted, speed)
    return [
        np.column_stack([corners[:, :2], height])
        for corners, height in zip(permitted, heights, strict=True)
    ], blocked


def wheel_index(space: PermissibleSpace, wheel: int | str) -> int:
    """Return the index of a wheel given by index or id.

    Raises
    ------
    InvalidInput
        If there is no such wheel.
    """
    ids = space.header.wheel_ids
    if isinstance(wheel, str) and wheel in ids:
        return ids.index(wheel)
    if isinstance(wheel, int) and 0 <= wheel < len(ids):
        return wheel
    allowed = f"0 to {len(ids) - 1} or one of {', '.join(ids)}"
    raise InvalidInput(Problem("wheel", repr(wheel), allowed))


def _known_wheel(space: PermissibleSpace, wheel: int | str) -> tuple[Vehicle, int]:
    require_plane(space)
    index = wheel_index(space, wheel)
    if space.vehicle is None:
        raise InvalidInput(
            Problem(
                f"space of {space.name}",
                "a data sheet, which says nothing about wheels",
                "build it from the vehicle",
            )
        )
    return space.vehicle, index


def _cut_net(
    space: PermissibleSpace,
    kappa_n: FloatArray,
    beta: FloatArray,
    reverse: bool = False,
) -> tuple[Facets, Facets]:
    """Return the cells of a net, cut along the edge of the blocked area."""
    k, b = np.meshgrid(kappa_n, beta, indexing="ij")
    nodes = np.stack([k, b, space.v_max(k, b, reverse=reverse)], axis=-1)
    along_kappa = crossings(space, nodes[:-1], nodes[1:], reverse)
    along_beta = crossings(space, nodes[:, :-1], nodes[:, 1:], reverse)
    # Around each cell: corner, crossing of the side that follows, next corner, ...
    rings = np.stack(
        [
            nodes[:-1, :-1],
            along_kappa[:, :-1],
            nodes[1:, :-1],
            along_beta[1:],
            nodes[1:, 1:],
            along_kappa[:, 1:],
            nodes[:-1, 1:],
            along_beta[:-1],
        ],
        axis=2,
    ).reshape(-1, 8, 3)
    n_free = (rings[:, ::2, 2] > 0).sum(axis=1)
    permitted = list(rings[n_free == 4][:, ::2])
    blocked = list(rings[n_free == 0][:, ::2])
    is_crossing = np.arange(8) % 2 == 1
    for ring in rings[(n_free > 0) & (n_free < 4)]:
        permitted.append(ring[ring[:, 2] > 0])
        # A crossing belongs to both, a corner to one.
        ground = ring[~np.isnan(ring[:, 2]) & (~(ring[:, 2] > 0) | is_crossing)]
        blocked.append(ground * (1.0, 1.0, 0.0))
    return permitted, blocked


def _nodes_near_jumps(
    vehicle: Vehicle,
    wheel: int,
    kappa_n: FloatArray = _KAPPA_NODES,
    beta: FloatArray = _BETA_NODES,
) -> tuple[FloatArray, FloatArray]:
    """Return nodes that are dense around a wheel's singular points, never on them."""
    for point in singular_points(vehicle):
        if point.wheel != wheel or point.beta is None:
            continue
        beta = beta[np.abs(beta - point.beta) > _NEAR[-1]]
        for way in (-_NEAR, _NEAR):
            kappa_n = np.append(kappa_n, point.kappa_n + way)
            beta = np.append(beta, point.beta + way)
    return (
        np.unique(kappa_n[np.abs(kappa_n) <= 2]),
        np.unique(np.append(beta[np.abs(beta) < np.pi], (-np.pi, np.pi))),
    )


def _over(
    facets: Facets, height: Callable[[FloatArray, FloatArray], FloatArray]
) -> list[FloatArray]:
    """Return a function of (κ_n, β) at the corners of each facet."""
    if not facets:
        return []
    corners = np.concatenate(facets)
    ends = np.cumsum([len(facet) for facet in facets])[:-1]
    return np.split(height(corners[:, 0], corners[:, 1]), ends)


def _clip(facet: FloatArray, level: float, side: int) -> FloatArray:
    """Return the part of a polygon above a level (side 1) or below it (side -1)."""
    inside = side * (facet[:, 2] - level) >= 0
    if inside.all():
        return facet
    kept: list[FloatArray] = []
    for i, point in enumerate(facet):
        if inside[i - 1] != inside[i]:
            before = facet[i - 1]
            share = (level - before[2]) / (point[2] - before[2])
            kept.append(before + share * (point - before))
        if inside[i]:
            kept.append(point)
    return np.array(kept).reshape(-1, 3)
