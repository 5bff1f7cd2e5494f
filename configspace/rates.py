"""How fast a configuration may change: the open question of section 4.6, answered.

The limits of steering, rolling and vehicle bound the rates ``(κ̇_n, β̇, v̇_s)`` by a
convex polytope around 0: its faces come from `rate_polytope`, its axis values, the
three functions the paper asks for, from `rate_limits`, and lower bounds that hold all
over a cell of a grid from `build_cell_rates`.

Limits on the configuration itself (ranges, speeds at rest of the rates) are those of
the permissible space and no rows here. Not covered: steering acceleration, and with it
what ``α̈`` costs wheels beside their steering axis; lateral acceleration and tipping.

References
----------
spec/omni-curve §4; spec/steered-wheels §3.6 ("rate box").
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from configspace.errors import InvalidInput, Problem
from configspace.gradients import (
    SINGULAR,
    WheelGradients,
    component_rates,
    rolling_speeds,
    wheel_gradients,
)
from configspace.kinematics import wheel_directions
from configspace.omni_curve import components, finite, nominal_curvature, together
from configspace.rate_cells import CellRates, build_cell_rates, cell_rate_limits
from configspace.vehicle import SteerableWheel, Vehicle

__all__ = [
    "CellRates",
    "RateLimit",
    "RatePolytope",
    "build_cell_rates",
    "cell_rate_limits",
    "rate_limits",
    "rate_polytope",
]

FloatArray = npt.NDArray[np.float64]
RateLimit: TypeAlias = Literal[
    "steering_rate",
    "wheel_acceleration",
    "wheel_speed",
    "acceleration",
    "deceleration",
    "singular",
    "fixed_beta",
    "fixed_kappa",
]
"""What may bound the rates; `fixed_beta` by fixed wheels, `fixed_kappa` by synchro."""


@dataclass(frozen=True, eq=False)
class RatePolytope:
    """All rates x = (κ̇_n, β̇, v̇_s) with ``A x ≤ b``, at one configuration."""

    A: FloatArray
    """(rows, 3), in the units of b per 1/s, rad/s, m/s²; read-only."""
    b: FloatArray
    """(rows,) rad/s, m/s or m/s² as the limit is; negative where the configuration is
    itself too fast. Read-only."""
    limits: tuple[RateLimit, ...]
    """(rows,) what each row is."""
    wheels: tuple[int, ...]
    """(rows,) index of the wheel, -1 for the vehicle."""

    def __post_init__(self) -> None:
        self.A.flags.writeable = False
        self.b.flags.writeable = False

    def contains(self, rates: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Return whether rates keep every limit, rounding aside.

        Parameters
        ----------
        rates : (..., 3) float, 1/s, rad/s, m/s²
        """
        rates = finite("rates", rates, "1/s, rad/s, m/s²")
        size = np.abs(rates) @ np.abs(self.A).T + np.abs(self.b)
        return np.asarray((rates @ self.A.T <= self.b + 1e-12 * size).all(axis=-1))

    def max_along(self, direction: npt.ArrayLike) -> float:
        """Return the largest t with ``t direction`` inside.

        Infinite where nothing bounds; 0 where the configuration is itself too fast.

        Parameters
        ----------
        direction : (3,) float
        """
        return float(min(self._reach(direction), default=math.inf))

    def binding_along(self, direction: npt.ArrayLike) -> int:
        """Return the row that bounds `max_along`, -1 where nothing does."""
        reach = self._reach(direction)
        return int(reach.argmin()) if min(reach, default=math.inf) < math.inf else -1

    def _reach(self, direction: npt.ArrayLike) -> FloatArray:
        towards = self.A @ finite("direction", direction, "1/s, rad/s, m/s²")
        reach = _quotient(self.b, np.maximum(towards, 0.0))
        return np.where(self.b < 0, 0.0, reach)


class _Row(NamedTuple):
    """``a · x ≤ b`` at many configurations; where two-sided, ``|a · x| ≤ b``."""

    limit: RateLimit
    wheel: int
    a: tuple[FloatArray | float, FloatArray | float, FloatArray | float]
    b: FloatArray | float
    two_sided: bool = True


def rate_polytope(
    vehicle: Vehicle, kappa_n: float, beta: float, v_s: float
) -> RatePolytope:
    """Return the admissible rates at one configuration.

    At the kink |κ_n| = 1 the speed gradients of both sides give rows.

    Parameters
    ----------
    vehicle : Vehicle
    kappa_n : float, 1, [-2, 2]
    beta : float, rad
    v_s : float, m/s
        Negative for driving the configuration backwards.

    Raises
    ------
    InvalidInput
        If a value is not finite or `kappa_n` is outside [-2, 2].

    References
    ----------
    spec/omni-curve §4: the polytope.

    Examples
    --------
    >>> from configspace import vehicle_from_data
    >>> vehicle = vehicle_from_data({"name": "v", "kappa_g": 2.0, "wheels": [
    ...     {"type": "steered", "id": "w", "x": 0.5, "y": 0.0,
    ...      "max_steering_rate_deg": 90.0}]})
    >>> rate_polytope(vehicle, 0.0, 0.0, 1.0).max_along((0, 1, 0)) / np.pi
    0.5
    """
    given = _configurations(kappa_n, beta, v_s)
    if given[0].ndim:
        where = "kappa_n, beta, v_s"
        raise InvalidInput(Problem(where, f"shape {given[0].shape}", "one number each"))
    rows = []
    for row in _rows(vehicle, *given):
        if math.isfinite(row.b):
            rows.append(row)
            if row.two_sided:
                rows.append(row._replace(a=(-row.a[0], -row.a[1], -row.a[2])))
    return RatePolytope(
        A=np.array([row.a for row in rows], dtype=np.float64).reshape(-1, 3) + 0.0,
        b=np.array([row.b for row in rows], dtype=np.float64),
        limits=tuple(row.limit for row in rows),
        wheels=tuple(row.wheel for row in rows),
    )


def rate_limits(
    vehicle: Vehicle,
    kappa_n: npt.ArrayLike,
    beta: npt.ArrayLike,
    v_n: npt.ArrayLike,
    v_max: npt.ArrayLike,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return how fast each parameter may change while the other two rest.

    The axis values of `rate_polytope`: the largest rate that is permitted in both
    directions. Infinite where nothing bounds it.

    Parameters
    ----------
    vehicle : Vehicle
    kappa_n : (...,) float, 1, [-2, 2]
    beta : (...,) float, rad
    v_n : (...,) float, 1, [-1, 1]
    v_max : (...,) float, m/s, ≥ 0

    Returns
    -------
    kappa_n_dot : (...,) float, 1/s, ≥ 0
        0 at the singular point of a steered wheel.
    beta_dot : (...,) float, rad/s, ≥ 0
        Likewise.
    v_n_dot : (...,) float, 1/s, ≥ 0
        ``v̇_s / v_max``; 0 where v_max is 0.

    Raises
    ------
    InvalidInput
        If a value is not finite or `kappa_n` is outside [-2, 2].

    References
    ----------
    Brenner and Colomb 2022, section 4.6; spec/omni-curve §4.
    """
    v_n, v_max = together(
        v_n=finite("v_n", v_n, "[-1, 1]"), v_max=finite("v_max", v_max, "m/s")
    )
    given = _configurations(kappa_n, beta, v_n * v_max)
    rates = [np.full(given[0].shape, np.inf) for _ in range(3)]
    for row in _rows(vehicle, *given):
        for rate, a in zip(rates, row.a, strict=True):
            np.minimum(rate, _quotient(row.b, np.abs(a)), out=rate)
    v_max = np.broadcast_to(v_max, given[0].shape)
    with np.errstate(divide="ignore", over="ignore"):
        v_n_dot = np.where(v_max > 0, rates[2] / v_max, 0.0)
    return rates[0], rates[1], v_n_dot


def _configurations(
    kappa_n: npt.ArrayLike, beta: npt.ArrayLike, v_s: npt.ArrayLike
) -> tuple[FloatArray, ...]:
    return together(
        kappa_n=nominal_curvature(kappa_n),
        beta=finite("beta", beta, "rad"),
        v_s=finite("v_s", v_s, "m/s"),
    )


def _quotient(b: FloatArray | float, a: FloatArray | float) -> FloatArray:
    """Return the largest t ≥ 0 with ``t a ≤ b`` for a ≥ 0."""
    # Derivatives that cancel, such as ∂|z|/∂β at κ_n = 0, leave their rounding.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        bound = np.where(np.less(a, 1e-14), np.inf, np.maximum(b, 0.0) / a)
    return np.asarray(bound)


def _rows(
    vehicle: Vehicle, kappa_n: FloatArray, beta: FloatArray, v_s: FloatArray
) -> Iterator[_Row]:
    """Yield all rows; infinite b where a limit does not hold at a configuration."""
    z = wheel_directions(vehicle, kappa_n, beta)
    speed = rolling_speeds(vehicle, z)
    at_kink = bool((np.abs(kappa_n) == 1).any())
    for side in (-1, 1) if at_kink else (-1,):
        gradients = wheel_gradients(vehicle, kappa_n, beta, side=side)
        gradients = WheelGradients(*(np.nan_to_num(g, nan=0.0) for g in gradients))
        for i, wheel in enumerate(vehicle.wheels):
            limit = getattr(wheel, "max_acceleration", None)
            if limit is not None:
                # Eq. d(v_s |z|)/dt = v̇_s |z| + v_s (∂|z|/∂κ_n κ̇_n + ∂|z|/∂β β̇)
                a_kappa = v_s * gradients.speed_kappa[..., i]
                a_beta = v_s * gradients.speed_beta[..., i]
                a = (a_kappa, a_beta, speed[..., i])
                yield _Row("wheel_acceleration", i, a, limit)
            if side < 0 and isinstance(wheel, SteerableWheel):
                at = (gradients.alpha_kappa[..., i], gradients.alpha_beta[..., i])
                still = np.where(np.abs(z[..., i]) < SINGULAR, 0.0, np.inf)
                yield _Row("singular", i, (1.0, 0.0, 0.0), still)
                yield _Row("singular", i, (0.0, 1.0, 0.0), still)
                u = v_s * speed[..., i]
                yield from _steering_rows(vehicle, i, wheel, at, u, v_s, kappa_n)
        yield from _vehicle_rows(vehicle, kappa_n, v_s, side)
    if vehicle.mobility.line_beta is not None:
        yield _Row("fixed_beta", -1, (0.0, 1.0, 0.0), 0.0)
    if vehicle.mobility.is_translating:
        yield _Row("fixed_kappa", -1, (1.0, 0.0, 0.0), 0.0)


def _steering_rows(
    vehicle: Vehicle,
    i: int,
    wheel: SteerableWheel,
    alpha: tuple[FloatArray, FloatArray],
    u: FloatArray,
    v_s: FloatArray,
    kappa_n: FloatArray,
) -> Iterator[_Row]:
    """Yield what bounds the steering rate of one wheel; `alpha` holds ∂α/∂κ_n, ∂α/∂β.

    Wheels beside their steering axis roll by ``û = u - D (ω + α̇)``, and motors that
    steer and roll at once keep ``|û| + coupling |α̇| ≤ max_speed``.
    """
    if wheel.max_steering_rate_deg is not None:
        rate = math.radians(wheel.max_steering_rate_deg)
        yield _Row("steering_rate", i, (*alpha, 0.0), rate)
    if wheel.max_speed is None:
        return
    omega = v_s * components(kappa_n)[1] * vehicle.boundary_curvature
    for offset in wheel.offsets:
        straight = u - offset * omega
        for rolling in (1, -1):
            for steering in (1, -1) if wheel.steering_coupling else (1,):
                per_rate = steering * wheel.steering_coupling - rolling * offset
                a = (per_rate * alpha[0], per_rate * alpha[1], 0.0)
                if per_rate:
                    b = wheel.max_speed - rolling * straight
                    yield _Row("wheel_speed", i, a, b, two_sided=False)


def _vehicle_rows(
    vehicle: Vehicle, kappa_n: FloatArray, v_s: FloatArray, side: int
) -> Iterator[_Row]:
    """Yield the bounds on ``d|v|/dt`` of K, ``v = v_s c``; from rest |v| only grows."""
    up = vehicle.limits.max_acceleration or np.inf
    down = vehicle.limits.max_deceleration or np.inf
    c, c_rate = components(kappa_n)[0], component_rates(kappa_n, side)[0]
    forward = np.where(v_s < 0, -1.0, 1.0)
    a_kappa, a_v = np.abs(v_s) * c_rate, forward * c
    yield _Row("acceleration", -1, (a_kappa, 0.0, a_v), up, two_sided=False)
    slows = np.where(v_s == 0, up, down)
    limit: RateLimit = "deceleration" if (v_s != 0).any() else "acceleration"
    yield _Row(limit, -1, (-a_kappa, 0.0, -a_v), slows, two_sided=False)
