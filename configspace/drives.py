"""What the drives do: speeds at the contact points, not at the steering axes.

`wheel_states` speaks of the steering axis. A wheel that stands D beside it (positive to
the left of its rolling direction) is carried along by every turn of the wheel over the
ground, that of the vehicle and that of the steering:

    û = u - (ω + α̇) D        with D signed in both terms

A turntable has two such wheels, at D = ±t/2. Where motors share rolling and steering,
the share of steering adds to what they must give: ``|û| + coupling |α̇|``.

References
----------
spec/omni-curve §2; Connette 2013, Eq. (B.10), in the form of spec/steered-wheels §1.5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from configspace.gradients import wheel_gradients
from configspace.kinematics import wheel_states
from configspace.omni_curve import components, finite, together
from configspace.vehicle import Castor, SteerableWheel, Vehicle

__all__ = ["DriveContact", "DriveSpeeds", "drive_contacts", "drive_speeds"]

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class DriveContact:
    """Where a driven wheel meets the ground."""

    name: str
    """The wheel's id; of a turntable with ``/left`` or ``/right`` after it."""
    wheel: int
    """Index of the wheel in the file."""
    offset: float
    """Lateral offset D from the steering axis, m, positive to the left."""
    coupling: float
    """Metres of rolling that one radian of steering costs its motors, m."""
    max_speed: float
    """Largest speed, m/s, as of the wheel."""


@dataclass(frozen=True, eq=False)
class DriveSpeeds:
    """Speeds of m driven contacts of a vehicle with n wheels; arrays are read-only."""

    contacts: tuple[DriveContact, ...]
    """The m contacts, in the order of the file, left before right."""
    rolling: FloatArray
    """(..., m) m/s, û: how fast the contact rolls; negative backwards."""
    demand: FloatArray
    """(..., m) m/s, ≥ 0, ``|û| + coupling |α̇|``: what max_speed bounds."""
    alpha_dot: FloatArray
    """(..., n) rad/s, steering rates of all wheels; 0 for those that do not steer, NaN
    for castors, and where the direction of a wheel jumps (z = 0 at nonzero rates)."""

    def __post_init__(self) -> None:
        for array in (self.rolling, self.demand, self.alpha_dot):
            array.flags.writeable = False

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the contacts."""
        return tuple(contact.name for contact in self.contacts)


def drive_contacts(vehicle: Vehicle) -> tuple[DriveContact, ...]:
    """Return the contacts of all driven wheels: those with a `max_speed`.

    Parameters
    ----------
    vehicle : Vehicle

    Returns
    -------
    contacts : tuple of DriveContact
        In the order of the file; two for a turntable, the left one first.

    Examples
    --------
    >>> from configspace import load_vehicle
    >>> [contact.name for contact in drive_contacts(load_vehicle("tricycle"))]
    ['front']
    """
    found = []
    for i, wheel in enumerate(vehicle.wheels):
        if isinstance(wheel, Castor) or wheel.max_speed is None:
            continue
        offsets: tuple[float, ...] = (0.0,)
        coupling = 0.0
        if isinstance(wheel, SteerableWheel):
            offsets, coupling = wheel.offsets, wheel.steering_coupling
        for side, offset in zip(("/left", "/right"), offsets, strict=False):
            name = wheel.id + (side if len(offsets) > 1 else "")
            found.append(DriveContact(name, i, offset, coupling, wheel.max_speed))
    return tuple(found)


def drive_speeds(
    vehicle: Vehicle,
    kappa_n: npt.ArrayLike,
    beta: npt.ArrayLike,
    v_s: npt.ArrayLike,
    kappa_n_dot: npt.ArrayLike = 0.0,
    beta_dot: npt.ArrayLike = 0.0,
) -> DriveSpeeds:
    """Return how fast every driven contact rolls, and what its motors must give.

    Parameters
    ----------
    vehicle : Vehicle
    kappa_n : (...,) float, 1, [-2, 2]
    beta : (...,) float, rad
    v_s : (...,) float, m/s
        May be 0: a wheel beside its axis rolls when it steers at standstill.
    kappa_n_dot : (...,) float, 1/s
    beta_dot : (...,) float, rad/s
        Rates of κ_n and β; v̇_s does not matter.

    Returns
    -------
    DriveSpeeds

    Raises
    ------
    InvalidInput
        If a value is not finite or `kappa_n` is outside [-2, 2].

    References
    ----------
    spec/omni-curve §2, the rows with an offset and of a turntable; §4 for α̇.

    Examples
    --------
    A wheel 0.1 m left of its axis turns by 2 rad/s at standstill: it rolls backwards.

    >>> from configspace import vehicle_from_data
    >>> vehicle = vehicle_from_data({"name": "v", "wheels": [{"type": "steered",
    ...     "id": "w", "x": 0.5, "y": 0.0, "max_speed": 1.0, "offset": 0.1}]})
    >>> drive_speeds(vehicle, 0.0, 0.0, 0.0, beta_dot=2.0).rolling
    array([-0.2])
    """
    rates = [finite("kappa_n_dot", kappa_n_dot, "1/s")]
    rates.append(finite("beta_dot", beta_dot, "rad/s"))
    _, u = wheel_states(vehicle, kappa_n, beta, v_s)
    gradients = wheel_gradients(vehicle, kappa_n, beta)
    parts = [
        _product(gradient, rate[..., None])
        for gradient, rate in zip(
            (gradients.alpha_kappa, gradients.alpha_beta), rates, strict=True
        )
    ]
    s = components(kappa_n)[1]
    s, speed = together(kappa_n=s, v_s=finite("v_s", v_s, "m/s"))
    omega = np.asarray(vehicle.boundary_curvature * s * speed)
    u, by_kappa, by_beta, omega = together(
        v_s=u, kappa_n_dot=parts[0], beta_dot=parts[1], omega=omega[..., None]
    )
    castors = np.array([isinstance(wheel, Castor) for wheel in vehicle.wheels])
    alpha_dot = np.where(castors, np.nan, by_kappa + by_beta)
    contacts = drive_contacts(vehicle)
    of = [contact.wheel for contact in contacts]
    offset = np.array([contact.offset for contact in contacts])
    coupling = np.array([contact.coupling for contact in contacts])
    turning = alpha_dot[..., of]
    rolling = u[..., of] - _product(omega[..., of] + turning, offset)
    demand = np.abs(rolling) + _product(np.abs(turning), coupling)
    return DriveSpeeds(contacts, rolling, demand, alpha_dot)


def _product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a b, 0 where b is 0 even where a is not known."""
    return np.where(b == 0, 0.0, a * b)
