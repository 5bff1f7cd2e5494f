"""The instantaneous centre of rotation, and where it is on a steering axis.

The centre is for pictures; motions are judged by (κ_n, β) or by (c e^{jβ}, s), which
stay regular where the centre is at infinity.

References
----------
Connette 2013, sections 2.2.3 and 3.2.3; spec/steered-wheels §2.1, §2.10, §3.1.
"""

from __future__ import annotations

import cmath
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from configspace.angles import wrap
from configspace.omni_curve import boundary_curvature, components, finite, together
from configspace.spherical import twist_components
from configspace.vehicle import SteerableWheel, Vehicle

__all__ = ["SingularPoint", "icr", "icr_of", "singular_points"]

FloatArray = npt.NDArray[np.float64]


def icr(twist: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return the instantaneous centre of rotation of a twist.

    For pictures only: it runs to infinity and returns from the other side where the
    motion itself is smooth. Judge nothing by it.

    Parameters
    ----------
    twist : (..., 3) float, m/s, m/s, rad/s
        Of K.

    Returns
    -------
    x, y : (...,) float, m
        Seen from K, in the vehicle's frame. Both are ``inf``, whatever the direction,
        where there is no centre: in translation and at standstill.

    References
    ----------
    Connette 2013, Eq. (2.31), (2.32).

    Examples
    --------
    >>> x, y = icr([[0.4, 0.3, 0.5], [1.0, 0.0, 0.0]])
    >>> x, y
    (array([-0.6,  inf]), array([0.8, inf]))
    """
    vx, vy, omega = twist_components(twist)
    return _centre(-vy, vx, omega)


def icr_of(
    kappa_n: npt.ArrayLike, beta: npt.ArrayLike, kappa_g: float
) -> tuple[FloatArray, FloatArray]:
    """Return the instantaneous centre of rotation of a configuration.

    Parameters
    ----------
    kappa_n : (...,) float, 1, [-2, 2]
    beta : (...,) float, rad
    kappa_g : float, 1/m, > 0

    Returns
    -------
    x, y : (...,) float, m
        As of `icr`; both ``inf`` at κ_n = 0.
    """
    c, s = components(kappa_n)
    c, s, beta = together(kappa_n=c, s=s, beta=finite("beta", beta, "rad"))
    omega = s * boundary_curvature(kappa_g)
    return _centre(-c * np.sin(beta), c * np.cos(beta), omega)


@dataclass(frozen=True)
class SingularPoint:
    """A configuration whose centre of rotation is on a steering axis."""

    wheel: int
    """Index of the wheel."""
    kappa_n: float
    """Nominal curvature, [-2, 2]."""
    beta: float | None
    """Side-slip angle, rad, (-π, π]; None where every β is singular, on the pole."""


def singular_points(vehicle: Vehicle) -> tuple[SingularPoint, ...]:
    """Return the configurations at which a steered wheel stands still while K moves.

    Two per wheel that steers, of either sign of κ_n; past the poles they have images
    (`cross_pole`). A wheel on K makes the whole pole singular. A line-mobile vehicle
    meets only those at its own β, a synchro drive none.

    Parameters
    ----------
    vehicle : Vehicle

    Returns
    -------
    points : tuple of SingularPoint
        Ordered by wheel, κ_n > 0 first.

    References
    ----------
    Connette 2013, Eq. (3.58), (3.59); spec/steered-wheels §2.10.

    Examples
    --------
    >>> from configspace import load_vehicle
    >>> points = singular_points(load_vehicle("ift-four-steered"))
    >>> len(points), points[0].kappa_n, points[1].kappa_n
    (8, 1.0, -1.0)
    """
    if vehicle.mobility.is_translating:
        return ()
    points = []
    for i, wheel in enumerate(vehicle.wheels):
        if not isinstance(wheel, SteerableWheel):
            continue
        w = vehicle.contacts[i] - vehicle.reference
        m = vehicle.boundary_curvature * abs(w)
        size = 2.0 - m if m <= 1 else 1.0 / m
        for sign in (1.0, -1.0):
            # z = c e^{jβ} + j s κ_g w vanishes.
            beta = None if size == 2 else float(wrap(cmath.phase(w) - sign * np.pi / 2))
            points.append(SingularPoint(i, sign * size, beta))
    return tuple(points)


def _centre(
    across: FloatArray, along: FloatArray, omega: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return (across, along) / omega, both infinite where either is."""
    turns = omega != 0
    with np.errstate(over="ignore"):
        x = np.where(turns, across, 0.0) / np.where(turns, omega, 1.0) + 0.0
        y = np.where(turns, along, 0.0) / np.where(turns, omega, 1.0) + 0.0
    near = turns & np.isfinite(x) & np.isfinite(y)
    return np.where(near, x, np.inf), np.where(near, y, np.inf)
