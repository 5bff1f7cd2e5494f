"""One number per vehicle: which share of all motions it may take, and how fast.

A share needs a measure of the configurations. Three are offered, none of which speed
enters:

``angles``
    ``dφ dθ``, the area of Connette's map of longitude and latitude;
``sphere``
    ``cos θ dφ dθ``, the solid angle of the twist directions: all directions of
    (vx, vy, d ω) count alike, and a pole, one configuration, counts nothing;
``omni_curve``
    ``dκ_n dβ``, the area of the paper's figures.

With the default d = 1/κ_g every vehicle is measured by its own size; one common d makes
shares of different vehicles those of the same physical motions.

References
----------
spec/steered-wheels §3.5, §3.6, §5.7 (B1), §6 (M9); Connette 2013, Table 8.1 ("workspace
used", there of simulated controllers: not like for like).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from configspace.errors import InvalidInput, Problem
from configspace.gradients import wheel_gradients
from configspace.kernels import BLOCKED, FREE
from configspace.omni_curve import components, finite
from configspace.space import PermissibleSpace
from configspace.vehicle import Vehicle

__all__ = ["ManoeuvrabilityIndex", "Measure", "dexterity", "manoeuvrability_index"]

FloatArray = npt.NDArray[np.float64]
Measure: TypeAlias = Literal["angles", "sphere", "omni_curve"]


@dataclass(frozen=True)
class ManoeuvrabilityIndex:
    """Shares of the configurations of a vehicle, 0 to 1, each with its two bounds."""

    dimension: int
    """2 if the vehicle moves all over the plane; 1 if β or κ_n is constant: shares are
    then of that line, and the share of the plane is 0."""
    share: float
    """Share that is permitted for sure."""
    share_high: float
    """Share that is not blocked for sure: the true share is not above."""
    speed_share: float
    """Mean of ``min(v_max / v_ref, 1)`` over all configurations, 0 where blocked; from
    below."""
    speed_share_high: float
    """The same from above."""
    v_ref: float
    """Speed that counts as 1, m/s."""


def manoeuvrability_index(
    space: PermissibleSpace,
    *,
    measure: Measure = "angles",
    d: float | None = None,
    v_ref: float | None = None,
    reverse: bool = False,
) -> ManoeuvrabilityIndex:
    """Return which share of its configurations a vehicle may take, and how fast.

    Read off the table with certain bounds, so a coarser grid gives wider ones.

    Parameters
    ----------
    space : PermissibleSpace
    measure : {"angles", "sphere", "omni_curve"}
        What a set of configurations weighs, see the module.
    d : float, m, > 0, optional
        Length that weights rotation, for the measures over (φ, θ); default 1/κ_g.
    v_ref : float, m/s, > 0, optional
        |v_s| that counts as 1; faster counts no more. Default: v_max straight ahead;
        where that is blocked the largest that all of some cell has, and 1 m/s where no
        cell is free.
    reverse : bool
        For v_n < 0.

    Returns
    -------
    ManoeuvrabilityIndex

    Raises
    ------
    InvalidInput
        If `measure` is unknown, or `d` or `v_ref` not positive.

    Examples
    --------
    >>> import configspace
    >>> space = configspace.build_space(
    ...     configspace.load_vehicle("mecanum"), cache=False)
    >>> index = manoeuvrability_index(space)
    >>> index.dimension, round(index.share, 6)
    (2, 1.0)
    """
    from configspace.topology import part_states

    if measure not in ("angles", "sphere", "omni_curve"):
        allowed = "'angles', 'sphere' or 'omni_curve'"
        raise InvalidInput(Problem("measure", repr(measure), allowed))
    state, kappa, _ = part_states(space)
    weight = _row_weights(space, kappa, measure, d)[:, None]
    count = state.shape[1]

    def mean(values: FloatArray) -> float:
        # Rounding must not lift a share above 1.
        return min(float((weight * values).sum() / count), 1.0)

    share, high = mean(state == FREE), mean(state != BLOCKED)
    reference = _reference_speed(space, v_ref, reverse)
    low_speed, high_speed = _part_speeds(space, reverse)
    slow = np.where(state == FREE, np.minimum(low_speed / reference, 1), 0.0)
    fast = np.where(state != BLOCKED, np.minimum(high_speed / reference, 1), 0.0)
    one = space.line_beta is not None or space.is_translating
    return ManoeuvrabilityIndex(
        1 if one else 2, share, high, mean(slow), mean(fast), reference
    )


def dexterity(
    vehicle: Vehicle, kappa_n: npt.ArrayLike, beta: npt.ArrayLike
) -> FloatArray:
    """Return how far a motion may turn per turn of each wheel, in the worst direction.

    A motion whose direction moves through (φ, θ) at a rate of r needs a steering rate
    of r / dexterity at most, so it is permitted where the dexterity is at least r over
    the largest steering rate.

    Parameters
    ----------
    vehicle : Vehicle
        With n wheels.
    kappa_n : (...,) float, 1, [-2, 2]
    beta : (...,) float, rad

    Returns
    -------
    dexterity : (..., n) float, 1, ≥ 0
        ``1 / |grad α|`` over (φ, θ) with d = 1/κ_g; goes to 0 with the distance from a
        wheel's singular point; infinite for what does not steer.

    Raises
    ------
    InvalidInput
        If a value is not finite or `kappa_n` is outside [-2, 2].

    References
    ----------
    spec/steered-wheels §3.5 (dex_i), §3.6.

    Examples
    --------
    In translation every wheel turns as much as the motion, or more:

    >>> from configspace import load_vehicle
    >>> bool((dexterity(load_vehicle("care-o-bot-3"), 0.0, 0.4) <= 1).all())
    True
    """
    gradients = wheel_gradients(vehicle, kappa_n, beta)
    c, s = components(kappa_n)
    # dκ_n/dθ = 1 + tan² θ or 1 + cot² θ: c² + s² in both branches.
    by_theta = gradients.alpha_kappa * np.asarray(c**2 + s**2)[..., None]
    gain = np.hypot(gradients.alpha_beta, by_theta)
    steers = [hasattr(wheel, "steering_range") for wheel in vehicle.wheels]
    with np.errstate(divide="ignore"):
        free = np.where(np.isnan(gain), 0.0, 1 / gain)
    return np.where(steers, free, np.inf)


def _row_weights(
    space: PermissibleSpace, kappa: FloatArray, measure: Measure, d: float | None
) -> FloatArray:
    """Return the share of the measure of every row of parts; the sum is 1."""
    scale = 1.0
    if d is not None:
        length = finite("d", d, "m")
        if length.ndim or length <= 0:
            raise InvalidInput(Problem("d", f"{d}", "one positive length, m"))
        scale = float(length) * space.kappa_g
    if space.is_translating:
        return np.ones(1)
    height = kappa
    if measure != "omni_curve":
        c, s = components(kappa)
        height = np.arctan2(scale * s, c)
        # The line of a line-mobile vehicle is an arc of the sphere: its length counts.
        if measure == "sphere" and space.line_beta is None:
            height = np.sin(height)
    steps = np.diff(height)
    return np.asarray(steps / steps.sum())


def _reference_speed(
    space: PermissibleSpace, v_ref: float | None, reverse: bool
) -> float:
    if v_ref is not None:
        given = finite("v_ref", v_ref, "m/s")
        if given.ndim or given <= 0:
            raise InvalidInput(Problem("v_ref", f"{v_ref}", "one positive speed, m/s"))
        return float(given)
    ahead = float(space.v_max(0.0, space.line_beta or 0.0, reverse=reverse))
    return ahead or float(space.tables.v_lo[_direction(space, reverse)].max()) or 1.0


def _part_speeds(
    space: PermissibleSpace, reverse: bool
) -> tuple[FloatArray, FloatArray]:
    """Return bounds on v_max over every part of the table, where it is permitted."""
    direction = _direction(space, reverse)
    load = space.tables.load[direction].astype(np.float64)
    k, m = space.tables.state.shape
    rows = 1 if space.is_translating else 4
    columns = 1 if space.line_beta is not None else 4
    slowest = np.empty((k, rows, m, columns))
    for i in range(rows):
        for j in range(columns):
            # A bilinear function is largest at a corner.
            worst = [
                (1 - x) * ((1 - y) * load[:-1, :-1] + y * load[:-1, 1:])
                + x * ((1 - y) * load[1:, :-1] + y * load[1:, 1:])
                for x in (i / 4, (i + 1) / 4)
                for y in (j / 4, (j + 1) / 4)
            ]
            slowest[:, i, :, j] = np.max(worst, axis=0)
    with np.errstate(divide="ignore"):
        low = (1 - 1e-14) / np.sqrt(slowest.reshape(k * rows, m * columns))
    high = space.tables.v_hi[direction].astype(np.float64)
    high = np.repeat(np.repeat(high, rows, axis=0), columns, axis=1)
    return low, high


def _direction(space: PermissibleSpace, reverse: bool) -> int:
    return 1 if reverse and len(space.tables.load) > 1 else 0
