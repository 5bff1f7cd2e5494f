"""Rolling and no-slip conditions of the wheels, as rows that act on the twist.

With the direction a and the place w of a wheel, relative to K,

    rolling   (cos a, sin a, Im(w* e^{ja})) · t = u
    no slip   (-sin a, cos a, Re(w* e^{ja})) · t = 0

where a is the steering angle or the mounting direction. Only standard wheels have the
second row. A Mecanum wheel rolls along a = δ + γ, and its row is divided by cos γ.

References
----------
Connette 2013, Eq. (2.12) to (2.16); lecture, section 3.2; spec/steered-wheels §1.5.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from configspace.errors import InvalidInput, Problem
from configspace.omni_curve import finite
from configspace.spherical import length_scale
from configspace.vehicle import FixedWheel, SteerableWheel, Vehicle

__all__ = ["no_slip_rows", "steering_residual"]

FloatArray = npt.NDArray[np.float64]


def no_slip_rows(vehicle: Vehicle, alpha: npt.ArrayLike) -> FloatArray:
    """Return the no-slip conditions of the standard wheels, C_1S.

    Parameters
    ----------
    vehicle : Vehicle
        With n wheels, m of them steered, turntables or fixed.
    alpha : (..., n) float, rad
        Steering angles; read for wheels that steer only.

    Returns
    -------
    rows : (..., m, 3) float, 1, 1, m
        ``rows @ twist`` is the sideways speed of each wheel, m/s, positive to the left
        of its rolling direction; 0 for a permitted motion.

    Raises
    ------
    InvalidInput
        If the last axis is not n or the angle of a wheel that steers is not finite.

    References
    ----------
    Connette 2013, Eq. (2.13), (2.18).
    """
    angle = measured("alpha", alpha, len(vehicle.wheels))
    steers = is_kind(vehicle, SteerableWheel)
    finite("alpha", angle[..., steers], "rad")
    rows: FloatArray = wheel_rows(vehicle, angle)[1][..., is_standard(vehicle), :]
    return rows


def steering_residual(
    vehicle: Vehicle, alpha: npt.ArrayLike, d: float | None = None
) -> FloatArray:
    """Return how far steering angles are from having one centre of rotation.

    Parameters
    ----------
    vehicle : Vehicle
        With n wheels.
    alpha : (..., n) float, rad
    d : float, m, > 0, optional
        Length that weights ω; default 1/κ_g.

    Returns
    -------
    residual : (...,) float, 1, ≥ 0
        Smallest singular value of C_1S in (vx, vy, d ω): the least sideways speed of
        all wheels together (root of the sum of squares) in a motion with ρ = 1. About
        the steering error in rad; 0 exactly where the axles meet, also at infinity.

    References
    ----------
    spec/steered-wheels §2.11.
    """
    rows = no_slip_rows(vehicle, alpha)
    if rows.shape[-2] < 3:
        return np.zeros(rows.shape[:-2])
    scale = vehicle.boundary_curvature if d is None else 1 / length_scale(d)
    values = np.linalg.svd(rows * [1.0, 1.0, scale], compute_uv=False)
    return np.asarray(values[..., -1])


def wheel_rows(vehicle: Vehicle, alpha: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the rolling and the no-slip row of every wheel, NaN where α is.

    The second means something for standard wheels only.
    """
    steers = is_kind(vehicle, SteerableWheel)
    heading = np.array([getattr(wheel, "heading", 0.0) for wheel in vehicle.wheels])
    roller = np.array([getattr(wheel, "roller", 0.0) for wheel in vehicle.wheels])
    w = np.array(vehicle.contacts) - vehicle.reference
    a = np.where(steers, alpha, heading + roller)
    cos, sin = np.cos(a), np.sin(a)
    ahead, aside = w.real * cos + w.imag * sin, w.real * sin - w.imag * cos
    rolling = np.stack([cos, sin, aside], axis=-1) / np.cos(roller)[:, None]
    return rolling, np.stack([-sin, cos, ahead], axis=-1)


def is_kind(vehicle: Vehicle, kind: type[object]) -> npt.NDArray[np.bool_]:
    """Return which wheels are of a kind."""
    return np.array([isinstance(wheel, kind) for wheel in vehicle.wheels])


def is_standard(vehicle: Vehicle) -> npt.NDArray[np.bool_]:
    """Return which wheels do not slip along their axle."""
    return is_kind(vehicle, SteerableWheel) | is_kind(vehicle, FixedWheel)


def measured(name: str, values: npt.ArrayLike, count: int) -> FloatArray:
    """Return values of all wheels, NaN where there are none, or raise naming them."""
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        array = finite(name, values, "SI units")  # raises, in the usual words
    unknown = np.isnan(array)
    finite(name, np.where(unknown, 0.0, array), "SI units, or NaN,")
    if array.ndim and array.shape[-1] != count:
        raise InvalidInput(
            Problem(name, f"shape {array.shape}", f"shape (..., {count}), all wheels")
        )
    return array if array.ndim else np.broadcast_to(array, (count,))
