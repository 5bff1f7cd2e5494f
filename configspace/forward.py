"""Forward kinematics: the twist of K from what the wheels measure.

Every wheel says up to two things about the twist: its rolling speed and, if it is a
standard wheel, that it does not slip along its axle (`configspace.constraints`). With
a lateral axle offset D the first reads ``(row - (0, 0, D)) · t = û + D dα/dt``, with û
as in `configspace.drives`. As a rule that is more than three equations: the twist is
their least squares solution, and what remains tells slip, faults and wrong geometry.

References
----------
Connette 2013, Eq. (3.87), (3.88), (B.10); lecture, section 3.2
(Vorwärtstransformation); spec/steered-wheels §1.5, §2.8, §2.11.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from configspace.constraints import is_standard, measured, wheel_rows
from configspace.drives import drive_contacts
from configspace.errors import InvalidInput, Problem
from configspace.omni_curve import finite, together
from configspace.vehicle import (
    Castor,
    MecanumWheel,
    OmniWheel,
    SteeredWheel,
    Vehicle,
)

__all__ = ["twist_from_drives", "twist_from_pair", "twist_from_wheels"]

FloatArray = npt.NDArray[np.float64]

# Directions of the twist that change no measurement by more than this are unknown.
_RANK_TOLERANCE = 1e-9


def twist_from_wheels(
    vehicle: Vehicle,
    alpha: npt.ArrayLike,
    u: npt.ArrayLike,
    *,
    alpha_dot: npt.ArrayLike | None = None,
    weights: npt.ArrayLike | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return the twist that fits all wheels best, and how well it fits.

    Parameters
    ----------
    vehicle : Vehicle
        With n wheels.
    alpha : (..., n) float, rad
        Steering angles, as `wheel_states` returns them. Read for wheels that steer
        only; NaN where not measured, which leaves the wheel out.
    u : (..., n) float, m/s
        Rolling speeds; NaN where not measured: a standard wheel then still says that
        it does not slip. Of a turntable the mean of its two wheels.
    alpha_dot : (..., n) float, rad/s, optional
        Steering rates. With them, `u` of a wheel with a lateral offset D is the speed
        at which that wheel rolls; without, `u` is meant at the steering axis, as
        `wheel_states` returns it.
    weights : (..., n) float, 1, ≥ 0, optional
        Trust in each wheel, inverse to the variance; default 1.

    Returns
    -------
    twist : (..., 3) float, m/s, m/s, rad/s
        (vx, vy, omega) of K in the vehicle frame.
    residual : (...,) float, m/s, ≥ 0
        Root of the (weighted) mean square of what the rows lack; 0 for wheel states
        of one motion.

    Raises
    ------
    InvalidInput
        If the last axis is not n, a value is infinite, a weight negative or NaN, or
        the measurements leave a part of the twist unknown: it names the first sample
        and its wheels.

    Examples
    --------
    >>> from configspace import load_vehicle, wheel_states
    >>> agv = load_vehicle("ift-four-steered")
    >>> twist, residual = twist_from_wheels(agv, *wheel_states(agv, 0.0, 0.0, 0.5))
    >>> bool(abs(twist - [0.5, 0.0, 0.0]).max() < 1e-12), bool(residual < 1e-12)
    (True, True)
    """
    count = len(vehicle.wheels)
    angle, speed = measured("alpha", alpha, count), measured("u", u, count)
    rate = measured("alpha_dot", 0.0 if alpha_dot is None else alpha_dot, count)
    trust = _weights(weights, count)
    angle, speed, rate, trust = together(
        alpha=angle, u=speed, alpha_dot=rate, weights=trust
    )
    offset = _offsets(vehicle) if alpha_dot is not None else np.zeros(count)
    rolls = [i for i, w in enumerate(vehicle.wheels) if not isinstance(w, Castor)]
    measured_by = _Measured([vehicle.wheels[i].id for i in rolls], rolls, offset[rolls])
    return _fit(vehicle, measured_by, angle, speed[..., rolls], rate, trust)


def twist_from_drives(
    vehicle: Vehicle,
    alpha: npt.ArrayLike,
    rolling: npt.ArrayLike,
    alpha_dot: npt.ArrayLike,
    *,
    weights: npt.ArrayLike | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return the twist that fits the speeds of the drives best: odometry, telemetry.

    The way back of `drive_speeds`. Unlike `twist_from_wheels` it reads both wheels of a
    turntable, whose difference tells ω + α̇.

    Parameters
    ----------
    vehicle : Vehicle
        With n wheels and m driven contacts.
    alpha : (..., n) float, rad
        Steering angles; read for wheels that steer only; NaN where not measured.
    rolling : (..., m) float, m/s
        Rolling speeds û of the contacts, in the order of `drive_contacts`; NaN where
        not measured.
    alpha_dot : (..., n) float, rad/s
        Steering rates; read for wheels that roll beside their axis. NaN where not
        measured, which leaves the speeds of such wheels out.
    weights : (..., n) float, 1, ≥ 0, optional
        Trust in each wheel, inverse to the variance; default 1.

    Returns
    -------
    twist : (..., 3) float, m/s, m/s, rad/s
        (vx, vy, omega) of K in the vehicle frame.
    residual : (...,) float, m/s, ≥ 0
        Root of the (weighted) mean square of what the rows lack.

    Raises
    ------
    InvalidInput
        As `twist_from_wheels`; also if the last axis of `rolling` is not m.

    References
    ----------
    Connette 2013, Eq. (B.10); spec/steered-wheels §1.5, §2.11.

    Examples
    --------
    >>> from configspace import drive_speeds, load_vehicle, wheel_states
    >>> agv = load_vehicle("two-turntables")
    >>> alpha, _ = wheel_states(agv, 0.5, 0.2, 0.4)
    >>> speeds = drive_speeds(agv, 0.5, 0.2, 0.4, kappa_n_dot=0.3)
    >>> twist, residual = twist_from_drives(
    ...     agv, alpha, speeds.rolling, speeds.alpha_dot)
    >>> bool(residual < 1e-12)
    True
    """
    contacts = drive_contacts(vehicle)
    of = [contact.wheel for contact in contacts]
    count = len(vehicle.wheels)
    angle, trust = measured("alpha", alpha, count), _weights(weights, count)
    rate = measured("alpha_dot", alpha_dot, count)
    speed = measured("rolling", rolling, len(contacts))
    shape = together(
        alpha=angle[..., 0],
        rolling=speed[..., :1].sum(axis=-1),
        alpha_dot=rate[..., 0],
        weights=trust[..., 0],
    )[0].shape
    angle, rate, trust = (
        np.broadcast_to(x, (*shape, count)) for x in (angle, rate, trust)
    )
    speed = np.broadcast_to(speed, (*shape, len(contacts)))
    measured_by = _Measured(
        [contact.name for contact in contacts],
        of,
        np.array([contact.offset for contact in contacts]),
    )
    return _fit(vehicle, measured_by, angle, speed, rate, trust)


def twist_from_pair(
    vehicle: Vehicle,
    pair: tuple[int, int],
    alpha: npt.ArrayLike,
    u: npt.ArrayLike,
) -> FloatArray:
    """Return the twist from two standard wheels: both angles and one rolling speed.

    The speed is that of the wheel farther from the centre of rotation, so nothing is
    divided by zero when the centre is on a wheel or at infinity. Two wheels on one
    axle leave the centre open, as a differential drive does; both speeds tell then.

    Parameters
    ----------
    vehicle : Vehicle
        With n wheels.
    pair : (int, int)
        Indices of two steered or fixed wheels that do not stand on one another.
    alpha : (..., n) float, rad
        Directions of rolling, as `wheel_states` returns them; mounting directions of
        fixed wheels. The other wheels are not read.
    u : (..., n) float, m/s
        Rolling speeds at the steering axes.

    Returns
    -------
    twist : (..., 3) float, m/s, m/s, rad/s
        Of K. Exact if the axles of the pair meet, NaN where what is read is NaN.

    Raises
    ------
    InvalidInput
        If the pair is not two standard wheels in different places, the last axis is
        not n or a value is infinite.

    References
    ----------
    Connette 2013, Eq. (3.87), (3.88), in the form of spec/steered-wheels §2.8.
    """
    count = len(vehicle.wheels)
    i, k = _checked_pair(vehicle, pair)
    angle, speed = measured("alpha", alpha, count), measured("u", u, count)
    angle, speed = together(alpha=angle, u=speed)
    w_i, w_k = (vehicle.contacts[j] - vehicle.reference for j in (i, k))
    delta = w_k - w_i
    e_i, e_k = np.exp(1j * angle[..., i]), np.exp(1j * angle[..., k])
    sine = (e_k * e_i.conj()).imag
    # λ_k = along_i / sine and λ_i = along_k / sine  # Eq. (C.10), (C.11)
    along_i, along_k = (delta.conjugate() * e_i).real, (delta.conjugate() * e_k).real
    by_k = np.abs(along_i) >= np.abs(along_k)
    along = np.where(by_k, along_i, along_k)
    size = np.hypot(along_i, along_k)
    on_one_axle = (size < 1e-9 * abs(delta)) & (np.abs(sine) < 1e-9)
    q = sine / np.where(on_one_axle, 1.0, along)
    v_i, v_k = speed[..., i] * e_i, speed[..., k] * e_k
    # Of the wheel that is read: ω = u q, Eq. (3.32), and v_K = v - jωw.
    omega = np.where(by_k, speed[..., k], speed[..., i]) * q
    turning = (delta.conjugate() * (v_k - v_i)).imag / abs(delta) ** 2
    omega = np.where(on_one_axle, turning, omega)
    v = np.where(by_k, v_k - 1j * omega * w_k, v_i - 1j * omega * w_i)
    return np.stack([v.real, v.imag, omega], axis=-1)


class _Measured(NamedTuple):
    """What has a rolling speed: m contacts, with their wheels and lateral offsets."""

    names: list[str]
    wheels: list[int]
    offset: FloatArray


def _fit(
    vehicle: Vehicle,
    by: _Measured,
    angle: FloatArray,
    speed: FloatArray,
    rate: FloatArray,
    trust: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the least squares twist and residual; `speed` (..., m), the rest of n."""
    all_rolling, no_slip = wheel_rows(vehicle, angle)
    rolling = all_rolling[..., by.wheels, :]
    rolling[..., 2] -= by.offset
    right = speed + np.where(by.offset != 0, by.offset * rate[..., by.wheels], 0.0)
    slips_not = is_standard(vehicle) & ~np.isnan(no_slip[..., 0])
    known = ~np.isnan(rolling[..., 0]) & ~np.isnan(right)
    share = np.concatenate([trust[..., by.wheels] * known, trust * slips_not], axis=-1)
    right = np.concatenate([right, np.zeros(no_slip.shape[:-1])], axis=-1)
    matrix = np.concatenate([rolling, no_slip], axis=-2)
    used = share > 0
    root = np.sqrt(np.where(used, share, 0.0))
    matrix = np.where(used[..., None], matrix, 0.0)
    right = np.where(used, right, 0.0)
    twist = _least_squares(vehicle, by.names, matrix * root[..., None], right * root)
    lacking = (matrix @ twist[..., None])[..., 0] - right
    mean_square = (share * lacking**2).sum(axis=-1) / share.sum(axis=-1)
    return twist, np.sqrt(mean_square)


def _least_squares(
    vehicle: Vehicle, names: list[str], matrix: FloatArray, right: FloatArray
) -> FloatArray:
    """Return the twists, or raise naming the wheels of the first that is not known."""
    scale = np.array([1.0, 1.0, vehicle.boundary_curvature])
    left, values, axes = np.linalg.svd(matrix * scale, full_matrices=False)
    rank = (values > _RANK_TOLERANCE * values[..., :1]).sum(axis=-1)
    if (rank < 3).any():
        _raise_unknown(names, rank, matrix)
    along = (left.swapaxes(-1, -2) @ right[..., None]) / values[..., None]
    twist: FloatArray = (axes.swapaxes(-1, -2) @ along)[..., 0] * scale
    return twist


def _raise_unknown(
    names: list[str], rank: npt.NDArray[np.int_], matrix: FloatArray
) -> None:
    first = tuple(map(int, np.argwhere(rank < 3)[0]))
    says = (matrix[first] != 0).any(axis=-1)[: len(names)]
    read = [name for name, r in zip(names, says, strict=True) if r]
    missing = [name for name, r in zip(names, says, strict=True) if not r]
    where = f"u[{', '.join(map(str, first))}]" if first else "u"
    given = f"rolling speeds of {', '.join(read) or 'no wheel'}"
    without = f" (not of {', '.join(missing)})" if missing else ""
    raise InvalidInput(
        Problem(
            where,
            given + without,
            f"with the steering angles they tell {rank[first]} of the 3 components "
            "of the twist; more wheels must be measured",
        )
    )


def _offsets(vehicle: Vehicle) -> FloatArray:
    """Return the lateral offsets D; those of a turntable cancel in its mean speed."""
    return np.array(
        [w.offset if isinstance(w, SteeredWheel) else 0.0 for w in vehicle.wheels]
    )


def _weights(weights: npt.ArrayLike | None, count: int) -> FloatArray:
    values = finite("weights", 1.0 if weights is None else weights, "1")
    if (values < 0).any():
        raise InvalidInput(Problem("weights", f"{values.min():g}", "must be ≥ 0"))
    return measured("weights", values, count)


def _checked_pair(vehicle: Vehicle, pair: tuple[int, int]) -> tuple[int, int]:
    count = len(vehicle.wheels)
    for i in pair:
        if not 0 <= i < count:
            raise InvalidInput(Problem("pair", f"{i}", f"must lie in [0, {count - 1}]"))
        wheel = vehicle.wheels[i]
        if isinstance(wheel, MecanumWheel | OmniWheel | Castor):
            raise InvalidInput(
                Problem("pair", f"{wheel.id} ({wheel.type})", "standard wheels only")
            )
    i, k = pair
    if abs(vehicle.contacts[i] - vehicle.contacts[k]) < 1e-9:
        names = f"{vehicle.wheels[i].id}, {vehicle.wheels[k].id}"
        raise InvalidInput(Problem("pair", names, "must stand in different places"))
    return i, k
