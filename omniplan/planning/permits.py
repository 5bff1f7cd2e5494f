"""What moves a vehicle may drive, in which representation, and about how quickly.

The times are estimates that guide the search: the speed is the least that is permitted
all along a move, with one acceleration and one deceleration. `omniplan.fastest` tells
the true time in the end.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numba as nb
import numpy as np
import numpy.typing as npt

from configspace import PermissibleSpace, Vehicle
from configspace.vehicle import SteerableWheel
from omniplan.planning.moves import NO_WAY, Move, goes_on
from omniplan.sampling.intervals import PermittedIntervals

__all__ = ["Configuration", "Drive", "Permits"]

FloatArray = npt.NDArray[np.float64]
Configuration = tuple[float, float]
"""κ_n, 1, and β, rad."""

EDGE = 1e-5
"""Turns of β keep so far from what is blocked, rad."""
STOP = 3e-4
"""Wheels keep so far from their stops, rad: the splines of a trajectory leave its moves
by rounding, and a wheel at its stop could not be proved to be within it."""
STEER_FREE = math.radians(0.01)
"""Wheels that turn by less than this keep their configuration, rad."""


@dataclass(frozen=True, slots=True)
class Drive:
    """A move in one representation."""

    move: Move
    sign: int
    """Sign of v_s."""
    start: Configuration
    goal: Configuration
    speed: float
    """Permitted |v_s| all along the move, m/s."""
    duration: float
    """Estimated time from rest to rest, s."""
    ramp: float
    """What of it is for speeding up or slowing down, each, s."""


class Permits:
    """Answers for one vehicle."""

    def __init__(self, space: PermissibleSpace, vehicle: Vehicle) -> None:
        self.space, self.vehicle = space, vehicle
        self.kappa_g = space.kappa_g
        self._acceleration = _acceleration(vehicle)
        self._wheels = _wheels_of(vehicle)
        self._intervals = PermittedIntervals(space)

    @property
    def steers(self) -> bool:
        """Whether wheels have to turn from configuration to configuration."""
        return bool(self._wheels[0].size)

    def drives(self, move: Move) -> tuple[Drive, ...]:
        """Return the representations in which a move is permitted; none if it is not.

        Parameters
        ----------
        move : Move
        """
        return tuple(self._drives(move))

    def _drives(self, move: Move) -> Iterator[Drive]:
        kappa_n = move.kappa_n(self.kappa_g)
        way = max(move.length, abs(move.turn) / self.kappa_g)
        for sign in (1, -1):
            k, aside = sign * kappa_n, 0.0 if sign > 0 else math.pi
            b0, b1 = move.beta_0 + aside, move.beta_1 + aside
            if move.length <= NO_WAY:
                b0 = b1 = self.space.line_beta or 0.0
            speed = self.v_max(k, b0, b1, reverse=sign < 0)
            if speed <= 0:
                continue
            cruise = max(way / speed, abs(move.turn) / self._steering_rate)
            # Half the way is for speeding up if it is too short to reach the speed.
            ramp = min(speed / self._acceleration, math.sqrt(way / self._acceleration))
            yield Drive(
                move,
                sign,
                (k, math.remainder(b0, 2 * math.pi)),
                (k, math.remainder(b1, 2 * math.pi)),
                speed,
                cruise + ramp,
                ramp / 2,
            )

    @cached_property
    def _steering_rate(self) -> float:
        """The least steering rate: where the heading turns wheels turn against it."""
        if self.space.line_beta is not None:
            return math.inf
        return float(self._wheels[3].min(initial=math.inf))

    def v_max(
        self, kappa_n: float, beta_0: float, beta_1: float, *, reverse: bool = False
    ) -> float:
        """Return a speed permitted for all β between two, m/s; 0 if there is none."""
        kappa_n = min(max(kappa_n, -2.0), 2.0)
        turn = beta_1 - beta_0
        if turn:  # clear of the borders, so that rounding breaks no limit
            edge = math.copysign(EDGE, turn)
            beta_0, turn = beta_0 - edge, turn + 2 * edge
        elif self._is_at_stop(kappa_n, beta_0):
            return 0.0
        return self._intervals.piece_speed(
            kappa_n, beta_0, beta_0 + turn, reverse=reverse
        )

    def _is_at_stop(self, kappa_n: float, beta: float) -> bool:
        """Return whether a wheel stands so near to its stop that no proof succeeds."""
        c, s = _components(kappa_n)
        levers, low, high, *_ = self._wheels
        return bool(_is_at_stop(c, s, beta, levers, low, high))

    def steering_time(self, before: Configuration, after: Configuration) -> float:
        """Return the time that the wheels need at least at a standstill, s.

        Every wheel by itself; the way through the space may take longer.
        """
        if not self.steers:
            return 0.0
        c0, s0 = _components(before[0])
        c1, s1 = _components(after[0])
        return float(_steering_time(c0, s0, before[1], c1, s1, after[1], *self._wheels))

    def is_steady(self, before: Drive, after: Drive) -> bool:
        """Return whether one move goes on in the same twist as the one before."""
        return before.sign == after.sign and goes_on(before.move, after.move)


def _components(kappa_n: float) -> tuple[float, float]:
    """Return c and s of one κ_n; see `configspace.omni_curve.components`."""
    return min(1.0, 2.0 - abs(kappa_n)), min(max(kappa_n, -1.0), 1.0)


def _acceleration(vehicle: Vehicle) -> float:
    """Return an acceleration that the vehicle reaches about, m/s²; may be infinite."""
    limits = vehicle.limits
    known = [limits.max_acceleration, limits.max_deceleration]
    known += [getattr(wheel, "max_acceleration", None) for wheel in vehicle.wheels]
    return min((value for value in known if value is not None), default=math.inf)


def _wheels_of(
    vehicle: Vehicle,
) -> tuple[npt.NDArray[np.complex128], FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return what steering asks of: levers, ranges, rates and accelerations."""
    levers, low, high, rates, swings = [], [], [], [], []
    for wheel, contact in zip(vehicle.wheels, vehicle.contacts, strict=True):
        if not isinstance(wheel, SteerableWheel):
            continue
        levers.append(1j * vehicle.boundary_curvature * (contact - vehicle.reference))
        bounded = wheel.steering_range_deg is not None
        least, largest = wheel.steering_range if bounded else (-math.inf, math.inf)
        winds = largest - least > 2 * math.pi
        low.append(-math.inf if winds else least)
        high.append(math.inf if winds else largest)
        rates.append(wheel.standing_steering_rate)
        swing = wheel.max_steering_acceleration_deg
        swings.append(math.inf if swing is None else math.radians(swing))
    return (
        np.array(levers, dtype=np.complex128),
        np.array(low, dtype=np.float64),
        np.array(high, dtype=np.float64),
        np.array(rates, dtype=np.float64),
        np.array(swings, dtype=np.float64),
    )


@nb.njit(cache=True)
def _wrapped(angle):  # type: ignore[no-untyped-def]
    return math.atan2(math.sin(angle), math.cos(angle))


@nb.njit(cache=True)
def _is_at_stop(c, s, beta, levers, low, high):  # type: ignore[no-untyped-def]
    e = c * complex(math.cos(beta), math.sin(beta))
    for i in range(levers.size):
        if math.isfinite(low[i]):
            z = e + s * levers[i]
            middle, half = (low[i] + high[i]) / 2, (high[i] - low[i]) / 2
            apart = abs(_wrapped(math.atan2(z.imag, z.real) - middle))
            if abs(apart - half) < STOP:
                return True
    return False


@nb.njit(cache=True)
def _steering_time(  # type: ignore[no-untyped-def]
    c0, s0, b0, c1, s1, b1, levers, low, high, rates, swings
):
    """Return the longest time that one wheel needs from rest to rest, s."""
    longest = 0.0
    for i in range(levers.size):
        z0 = c0 * complex(math.cos(b0), math.sin(b0)) + s0 * levers[i]
        z1 = c1 * complex(math.cos(b1), math.sin(b1)) + s1 * levers[i]
        a0, a1 = math.atan2(z0.imag, z0.real), math.atan2(z1.imag, z1.real)
        turn = abs(_wrapped(a1 - a0))
        if math.isfinite(low[i]):
            middle = (low[i] + high[i]) / 2
            turn = abs(_wrapped(a1 - middle) - _wrapped(a0 - middle))
        if turn < STEER_FREE:
            continue
        if math.isinf(swings[i]):
            time = turn / rates[i]
        elif math.isinf(rates[i]) or turn < rates[i] ** 2 / swings[i]:
            time = 2 * math.sqrt(turn / swings[i])
        else:
            time = turn / rates[i] + rates[i] / swings[i]
        longest = max(longest, time)
    return longest
