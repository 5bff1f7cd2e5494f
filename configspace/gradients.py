"""How wheel states change with the configuration, in closed form.

Every gradient comes from one complex number per wheel: with ``z = c e^{jβ} + s b``,
``b = j κ_g w`` a change ``dz`` turns the wheel by ``Im(dz z̄)/|z|²`` and changes its
speed by ``Re(dz z̄)/|z|``. Nothing is singular but z = 0 itself, where the direction of
a steered wheel is undefined; κ_n = 0 and ±2 are regular.

c and s have a kink at |κ_n| = 1. Directions do not: ∂α/∂κ_n is the same from both
sides; speeds do, so at the kink `side` chooses one of two values.

References
----------
spec/omni-curve §4; Connette 2013, Eq. (5.8) in the form of spec/steered-wheels §2.7.
"""

from __future__ import annotations

import cmath
import math
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from configspace.kinematics import wheel_directions
from configspace.omni_curve import components, finite, nominal_curvature, together
from configspace.vehicle import Castor, FixedWheel, SteerableWheel, Vehicle

__all__ = ["SINGULAR", "WheelGradients", "wheel_gradients"]

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

SINGULAR = 1e-12
"""A steered wheel slower than this per v_s has no direction; as in `exact_v_max`."""


class WheelGradients(NamedTuple):
    """Partial derivatives of the states of n wheels, each (..., n).

    NaN for castors, and for a steered wheel at its singular point. Wheels that do not
    steer have alpha gradients of 0.
    """

    alpha_kappa: FloatArray
    """∂α/∂κ_n, rad."""
    alpha_beta: FloatArray
    """∂α/∂β, 1."""
    speed_kappa: FloatArray
    """Change of the rolling speed per v_s with κ_n, 1."""
    speed_beta: FloatArray
    """Change of the rolling speed per v_s with β, 1/rad."""


def wheel_gradients(
    vehicle: Vehicle,
    kappa_n: npt.ArrayLike,
    beta: npt.ArrayLike,
    *,
    side: Literal[-1, 1] = -1,
) -> WheelGradients:
    """Return the gradients of all steering angles and rolling speeds.

    Parameters
    ----------
    vehicle : Vehicle
        With n wheels.
    kappa_n : (...,) float, 1, [-2, 2]
    beta : (...,) float, rad
    side : {-1, 1}
        From where the kink is looked at: at |κ_n| = 1 exactly -1 gives the gradient for
        |κ_n| < 1, 1 that for |κ_n| > 1. No other point depends on it.

    Returns
    -------
    WheelGradients
        Of ``α = arg z`` and ``|z|`` for steered wheels and turntables, on the steering
        axis, and of the rolling speed per v_s for fixed, Mecanum and omni wheels.

    Raises
    ------
    InvalidInput
        If a value is not finite or `kappa_n` is outside [-2, 2].

    References
    ----------
    spec/omni-curve §4, the four formulas.

    Examples
    --------
    In translation every wheel turns as much as β does:

    >>> from configspace import load_vehicle
    >>> wheel_gradients(load_vehicle("ift-four-steered"), 0.0, 0.4).alpha_beta
    array([1., 1., 1., 1.])
    """
    kappa_n, beta = together(
        kappa_n=nominal_curvature(kappa_n), beta=finite("beta", beta, "rad")
    )
    z = wheel_directions(vehicle, kappa_n, beta)
    c, _ = components(kappa_n)
    e = np.exp(1j * beta)
    c_rate, s_rate = component_rates(kappa_n, side)
    # At κ_n = 2 translation is gone and z is the lever b = j κ_g w.
    lever = wheel_directions(vehicle, 2.0, 0.0)
    dz_kappa = (c_rate * e)[..., None] + s_rate[..., None] * lever
    dz_beta = np.broadcast_to((1j * c * e)[..., None], z.shape)
    steers = np.array([isinstance(w, SteerableWheel) for w in vehicle.wheels])
    along = rolling_directions(vehicle)
    size = np.abs(z)
    with np.errstate(divide="ignore", invalid="ignore"):
        unit = np.where(steers, np.where(size < SINGULAR, np.nan, z / size), along)
        # Eq. α̇ = Im(ż/z) = Im(ż z̄)/|z|²; 0 for wheels that do not steer
        per_size = np.where(steers, 1 / size, 0.0)
        return WheelGradients(
            alpha_kappa=(dz_kappa * unit.conj()).imag * per_size,
            alpha_beta=(dz_beta * unit.conj()).imag * per_size,
            speed_kappa=(dz_kappa * unit.conj()).real,
            speed_beta=(dz_beta * unit.conj()).real,
        )


def component_rates(kappa_n: FloatArray, side: int) -> tuple[FloatArray, FloatArray]:
    """Return dc/dκ_n and ds/dκ_n; at the kink those of one side."""
    size = np.abs(kappa_n)
    outer = (size > 1) | ((size == 1) & (side > 0))
    return np.where(outer, -np.sign(kappa_n), 0.0), np.where(outer, 0.0, 1.0)


def rolling_directions(vehicle: Vehicle) -> ComplexArray:
    """Return n with ``Re(z n̄)`` the rolling speed per v_s of wheels that do not steer.

    ``e^{j(δ+γ)}/cos γ`` (table in spec/omni-curve §2); NaN for castors, 0 for wheels
    that steer.
    """
    directions = np.zeros(len(vehicle.wheels), complex)
    for i, wheel in enumerate(vehicle.wheels):
        if isinstance(wheel, Castor):
            directions[i] = complex(math.nan, math.nan)
        elif not isinstance(wheel, SteerableWheel):
            roller = 0.0 if isinstance(wheel, FixedWheel) else wheel.roller
            turn = cmath.exp(1j * (wheel.heading + roller))
            directions[i] = turn / math.cos(roller)
    return directions


def rolling_speeds(vehicle: Vehicle, z: ComplexArray) -> FloatArray:
    """Return the rolling speeds per v_s of wheels that move with `z`, (..., n).

    NaN for castors; for wheels that steer the speed of the steering axis.
    """
    steers = np.array([isinstance(w, SteerableWheel) for w in vehicle.wheels])
    along = (z * rolling_directions(vehicle).conj()).real
    return np.where(steers, np.abs(z), along)
