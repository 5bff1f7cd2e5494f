"""Wheel states of a configuration, in the complex form of spec/omni-curve §1."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from configspace.angles import wrap
from configspace.omni_curve import components, finite, nominal_curvature, together
from configspace.vehicle import Castor, FixedWheel, SteerableWheel, Vehicle

__all__ = ["wheel_directions", "wheel_states"]

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]


def wheel_directions(
    vehicle: Vehicle, kappa_n: npt.ArrayLike, beta: npt.ArrayLike
) -> ComplexArray:
    """Return the velocity of every wheel's contact point per v_s.

    Parameters
    ----------
    vehicle : Vehicle
        With n wheels.
    kappa_n : (...,) float, 1, [-2, 2]
    beta : (...,) float, rad

    Returns
    -------
    z : (..., n) complex, 1
        ``z_i = c e^{jβ} + j s κ_g (x_i + j y_i)``, in the order of the file.

    Raises
    ------
    InvalidInput
        If a value is not finite or `kappa_n` is outside [-2, 2].
    """
    kappa_n, beta = together(
        kappa_n=nominal_curvature(kappa_n), beta=finite("beta", beta, "rad")
    )
    c, s = components(kappa_n)
    w = np.array(vehicle.contacts) - vehicle.reference
    translation = np.asarray(c * np.exp(1j * beta))
    rotation = np.asarray(1j * s * vehicle.boundary_curvature)
    return np.asarray(translation[..., None] + rotation[..., None] * w)


def wheel_states(
    vehicle: Vehicle, kappa_n: npt.ArrayLike, beta: npt.ArrayLike, v_s: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return steering angles and rolling speeds of all wheels.

    Parameters
    ----------
    vehicle : Vehicle
        With n wheels.
    kappa_n : (...,) float, 1, [-2, 2]
    beta : (...,) float, rad
    v_s : (...,) float, m/s

    Returns
    -------
    alpha : (..., n) float, rad, (-π, π]
        Direction of rolling from the vehicle's x axis; the mounting direction for
        wheels that do not steer, NaN for castors. At a wheel's singular point
        (z_i = 0) the angle is undefined and 0 is returned.
    u : (..., n) float, m/s
        Rolling speed at the steering axis; NaN for castors. `drive_speeds` tells what
        wheels beside their axis and shared motors do.

    Raises
    ------
    InvalidInput
        If a value is not finite or `kappa_n` is outside [-2, 2].

    References
    ----------
    Brenner and Colomb 2022, section 3.3 (there with case split), table in
    spec/omni-curve §2.

    Examples
    --------
    >>> from configspace import load_vehicle
    >>> alpha, u = wheel_states(load_vehicle("ift-four-steered"), 0.0, 0.5, 1.0)
    >>> alpha
    array([0.5, 0.5, 0.5, 0.5])
    >>> u
    array([1., 1., 1., 1.])
    """
    z = wheel_directions(vehicle, kappa_n, beta)
    speed = finite("v_s", v_s, "m/s")
    speed = together(kappa_n=z[..., 0].real, v_s=speed)[1][..., None]
    z = np.broadcast_to(z, (*speed.shape[:-1], z.shape[-1]))
    alpha = np.full(z.shape, np.nan)
    u = np.full(z.shape, np.nan)
    for i, wheel in enumerate(vehicle.wheels):
        if isinstance(wheel, Castor):
            continue
        if isinstance(wheel, SteerableWheel):
            alpha[..., i] = wrap(np.angle(z[..., i] + 0.0))
            u[..., i] = speed[..., 0] * np.abs(z[..., i])
            continue
        roller = 0.0 if isinstance(wheel, FixedWheel) else wheel.roller
        along = (z[..., i] * np.exp(-1j * (wheel.heading + roller))).real
        alpha[..., i] = np.arctan2(np.sin(wheel.heading), np.cos(wheel.heading))
        u[..., i] = speed[..., 0] * along / np.cos(roller)
    return alpha, u
