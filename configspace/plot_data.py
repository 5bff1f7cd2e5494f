"""What maps and curves of a permissible space show, as numbers; no matplotlib here."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull

from configspace.errors import InvalidInput, Problem
from configspace.kernels import MIXED
from configspace.space import PermissibleSpace
from configspace.vehicle import SteerableWheel, Vehicle, Wheel

__all__ = [
    "blocked_ranges",
    "cell_values",
    "crossings",
    "curve_values",
    "require_curve",
    "require_plane",
    "steering_span",
    "support_polygon",
    "wheel_bodies",
]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

_CURVE_NODES = 2001


def cell_values(
    space: PermissibleSpace, *, reverse: bool = False
) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Return what the map shows: v_max at the middle of every cell.

    Parameters
    ----------
    space : PermissibleSpace
    reverse : bool

    Returns
    -------
    kappa_n : (k,) float, 1
    beta : (m,) float, rad
    v_max : (k, m) float, m/s
        NaN where blocked.
    mixed : (k, m) bool
        What a data sheet alone cannot settle, and counts as blocked.
    """
    # A coarse table is looked up several times per cell, so the map stays smooth.
    per_row = math.ceil(200 / space.grid.n_kappa)
    per_column = math.ceil(200 / space.grid.n_beta)
    kappa_n = _middles(np.linspace(-2, 2, space.grid.n_kappa * per_row + 1))
    beta = _middles(np.linspace(-np.pi, np.pi, space.grid.n_beta * per_column + 1))
    v_max = space.v_max(kappa_n[:, np.newaxis], beta, reverse=reverse)
    state = np.repeat(space.tables.state, per_row, axis=0)
    state = np.repeat(state, per_column, axis=1)
    sheet = replace(space, vehicle=None)
    by_sheet = sheet.v_max(kappa_n[:, np.newaxis], beta, reverse=reverse)
    mixed = (state == MIXED) & (by_sheet == 0)
    return kappa_n, beta, np.where(v_max > 0, v_max, np.nan), mixed


def curve_values(
    space: PermissibleSpace, *, reverse: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Return v_max along the one parameter that is free.

    Parameters
    ----------
    space : PermissibleSpace
        Of a vehicle that is line-mobile or cannot turn.
    reverse : bool

    Returns
    -------
    parameter : (n,) float
        κ_n of a line-mobile vehicle, β in rad of one that cannot turn.
    v_max : (n,) float, m/s
        NaN where blocked.
    """
    nodes = _curve_nodes(space, reverse)
    return nodes[:, _free_axis(space)], np.where(nodes[:, 2] > 0, nodes[:, 2], np.nan)


def blocked_ranges(space: PermissibleSpace) -> list[tuple[float, float]]:
    """Return the ranges of the free parameter that the vehicle cannot take.

    Parameters
    ----------
    space : PermissibleSpace
        Of a vehicle that is line-mobile or cannot turn.

    Returns
    -------
    list of (float, float)
        Of κ_n, or of β in rad where the vehicle cannot turn; from low to high, as far
        as they are wider than 1/2000 of the whole.
    """
    nodes, axis = _curve_nodes(space, False), _free_axis(space)
    edges = crossings(space, nodes[:-1], nodes[1:], False)[:, axis]
    is_blocked = nodes[:, 2] == 0
    starts = [float(nodes[0, axis])] if is_blocked[0] else []
    starts += edges[~is_blocked[:-1] & is_blocked[1:]].tolist()
    ends = edges[is_blocked[:-1] & ~is_blocked[1:]].tolist()
    ends += [float(nodes[-1, axis])] if is_blocked[-1] else []
    return list(zip(starts, ends, strict=True))


def crossings(
    space: PermissibleSpace, first: FloatArray, second: FloatArray, reverse: bool
) -> FloatArray:
    """Return where lines between nodes cross the edge of the blocked area.

    Parameters
    ----------
    space : PermissibleSpace
    first, second : (..., 3) float
        (κ_n, β, v_max) in 1, rad, m/s.
    reverse : bool

    Returns
    -------
    crossing : (..., 3) float
        The last point that is permitted, with its v_max; NaN where nothing is crossed.
    """
    crossing = np.full(first.shape, np.nan)
    cut = (first[..., 2] > 0) != (second[..., 2] > 0)
    starts_free = (first[cut][:, 2] > 0)[:, np.newaxis]
    inside = np.where(starts_free, first[cut], second[cut])
    outside = np.where(starts_free, second[cut], first[cut])
    for _ in range(20):
        middle = (inside + outside) / 2
        middle[:, 2] = space.v_max(middle[:, 0], middle[:, 1], reverse=reverse)
        free = middle[:, 2] > 0
        inside[free] = middle[free]
        outside[~free] = middle[~free]
    crossing[cut] = inside
    return crossing


def require_plane(space: PermissibleSpace) -> None:
    """Raise `InvalidInput` unless the space is a surface over (κ_n, β)."""
    if space.line_beta is not None or space.is_translating:
        kind, over = (
            ("line-mobile", "κ_n") if _free_axis(space) == 0 else ("κ_n = 0", "β")
        )
        raise InvalidInput(
            Problem(
                f"space of {space.name}",
                f"{kind}: its space is a curve over {over}",
                "draw it with plot_curve or plot_space",
            )
        )


def require_curve(space: PermissibleSpace) -> None:
    """Raise `InvalidInput` unless the space is a curve over κ_n or β."""
    if space.line_beta is None and not space.is_translating:
        raise InvalidInput(
            Problem(
                f"space of {space.name}",
                "not line-mobile: its space is a surface over (κ_n, β)",
                "draw it with plot_surface, plot_map or plot_space",
            )
        )


def steering_span(wheel: SteerableWheel) -> tuple[float, float]:
    """Return the middle of a steering range and half of it, rad.

    The middle is 0 where the wheel turns freely; half is π at most.
    """
    least, largest = wheel.steering_range
    if math.isinf(largest):
        return 0.0, math.pi
    return (least + largest) / 2, min((largest - least) / 2, math.pi)


def wheel_bodies(wheel: Wheel | SteerableWheel) -> tuple[tuple[complex, float], ...]:
    """Return place and rolling direction of everything that rolls in a wheel unit.

    Steering angles are 0, or in the middle of the range where 0 is not in it. A wheel
    beside its steering axis stands there, a turntable has two.

    Returns
    -------
    bodies : tuple of (complex, float), m, rad
        In the vehicle file's frame.
    """
    if not isinstance(wheel, SteerableWheel):
        return ((wheel.position, getattr(wheel, "heading", 0.0)),)
    middle, half = steering_span(wheel)
    alpha = 0.0 if abs(math.remainder(middle, 2 * math.pi)) <= half else middle
    aside = 1j * cmath.exp(1j * alpha)
    return tuple((wheel.position + aside * d, alpha) for d in wheel.offsets)


def support_polygon(vehicle: Vehicle) -> FloatArray:
    """Return the corners of the polygon that a vehicle stands on.

    Parameters
    ----------
    vehicle : Vehicle
        Whose wheels do not stand on one line, as where a load is given.

    Returns
    -------
    corners : (n, 2) float, m
        Counter-clockwise, in the vehicle file's frame.
    """
    points = np.array([(wheel.x, wheel.y) for wheel in vehicle.wheels])
    return np.asarray(points[ConvexHull(points).vertices])


def _free_axis(space: PermissibleSpace) -> int:
    return 1 if space.is_translating else 0


def _curve_nodes(space: PermissibleSpace, reverse: bool) -> FloatArray:
    """Return nodes (κ_n, β, v_max) along the curve, (n, 3)."""
    require_curve(space)
    if space.line_beta is not None:
        kappa_n = np.linspace(-2, 2, _CURVE_NODES)
        beta = np.full_like(kappa_n, space.line_beta)
    else:
        beta = np.linspace(-np.pi, np.pi, _CURVE_NODES)
        kappa_n = np.zeros_like(beta)
    v_max = space.v_max(kappa_n, beta, reverse=reverse)
    return np.stack([kappa_n, beta, v_max], axis=-1)


def _middles(edges: FloatArray) -> FloatArray:
    return (edges[:-1] + edges[1:]) / 2
