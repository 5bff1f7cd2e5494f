"""How often wheels turn along closed circles of β; use it as `topology.winding`."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from configspace.errors import InvalidInput, Problem
from configspace.kinematics import wheel_directions
from configspace.omni_curve import components, nominal_curvature
from configspace.vehicle import Vehicle

__all__ = ["winding"]

_SMALLEST_ARC = 1e-9
"""An arc of β, rad, on which a wheel's direction is not followed any closer."""


def winding(vehicle: Vehicle, kappa_n: npt.ArrayLike) -> npt.NDArray[np.int64]:
    """Return how often every wheel turns as β makes one turn at constant κ_n.

    A steering range of more than a turn has to be followed along a trajectory: after a
    closed circle the wheel stands this many turns further.

    Parameters
    ----------
    vehicle : Vehicle
        With n wheels.
    kappa_n : (...,) float, 1, [-2, 2]

    Returns
    -------
    turns : (..., n) int
        1 for |κ_n| < |κ_n,S,i|, where the centre of rotation is on the wheel, 0 beyond;
        for wheels that do not steer: of the velocity of their contact point.

    Raises
    ------
    InvalidInput
        If a value is not finite, outside [-2, 2] or on |κ_n,S,i|: undefined there.

    Notes
    -----
    The directions at the ends of arcs are added up. On an arc of half-length δ the
    velocity stays within c δ of that in its middle; arcs are halved until this is less
    than the velocity itself, so on none does the wheel turn by half a turn or more.

    References
    ----------
    spec/steered-wheels O-38.

    Examples
    --------
    >>> from configspace import load_vehicle
    >>> winding(load_vehicle("ift-four-steered"), [0.5, 1.5])
    array([[1, 1, 1, 1],
           [0, 0, 0, 0]])
    """
    kappa_n = nominal_curvature(kappa_n)
    n_wheels = len(vehicle.wheels)
    kappa = np.repeat(kappa_n.ravel(), n_wheels)
    wheel = np.tile(np.arange(n_wheels), kappa_n.size)
    turned = np.zeros(kappa.size)
    # Arcs of β, each of one wheel at one κ_n.
    owner = np.repeat(np.arange(kappa.size), 8)
    low = np.tile(np.linspace(-np.pi, np.pi, 9)[:-1], kappa.size)
    width = np.pi / 4
    while owner.size:
        if width < _SMALLEST_ARC:
            first = owner[0]
            raise InvalidInput(
                Problem(
                    "kappa_n",
                    f"{kappa[first]:g}",
                    "the centre of rotation meets wheel "
                    f"{vehicle.wheels[wheel[first]].id}: its turns are undefined",
                )
            )
        at = low + width * np.array([[0.0], [0.5], [1.0]])
        z = wheel_directions(vehicle, kappa[owner], at)
        z0, middle, z1 = z[:, np.arange(owner.size), wheel[owner]]
        c, _ = components(kappa[owner])
        short = c * width / 2 < np.abs(middle) * (1 - 1e-9)
        np.add.at(turned, owner[short], np.angle(z1 * z0.conj())[short])
        owner, low = np.repeat(owner[~short], 2), np.repeat(low[~short], 2)
        width /= 2
        low[1::2] += width
    turns = np.rint(turned / (2 * np.pi)).astype(np.int64)
    return turns.reshape(*kappa_n.shape, n_wheels)
