"""Timing a path the slow way: finite differences, scipy's linear programmes, loops.

Shares with `omniplan.timing.fastest` the splines of a path and nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy.optimize import linprog

from configspace import Vehicle
from configspace.limits import GRAVITY
from configspace.vehicle import Castor, FixedWheel, SteerableWheel
from omniplan.timing.path_motion import PathPiece

FloatArray = npt.NDArray[np.float64]
Key = tuple[str, int]
Function = Callable[[float], float]

H = 2e-4
"""Step of the differences, m."""


class NaiveLimits:
    """The limits of a vehicle along a piece of a path, at single places."""

    def __init__(self, vehicle: Vehicle, piece: PathPiece, sigma: int) -> None:
        self._vehicle, self._piece, self._sigma = vehicle, piece, sigma

    def loads(self, u: float) -> list[tuple[Key, float]]:
        """Return key and ``speed² / limit²`` per u̇², of everything like a speed."""
        found: list[tuple[Key, float]] = []
        limits, turn = self._vehicle.limits, self._turning(u)
        k = self._vehicle.reference
        if limits.max_speed is not None:
            found.append((("SPEED", -1), (self._size(k)(u) / limits.max_speed) ** 2))
        if limits.max_reverse_speed is not None:
            line = self._vehicle.mobility.line_beta
            back = self._sigma < 0
            if line is not None:
                v = self._velocity(k, u)
                back = v[0] * math.cos(line) + v[1] * math.sin(line) < 0
            load = (self._size(k)(u) / limits.max_reverse_speed) ** 2
            found.append((("REVERSE_SPEED", -1), load if back else 0.0))
        if limits.max_yaw_rate_deg is not None:
            bound = math.radians(limits.max_yaw_rate_deg)
            found.append((("YAW_RATE", -1), (turn / bound) ** 2))
        if limits.max_lateral_acceleration is not None:
            point = k
            if limits.lateral_acceleration_at == "center_of_gravity":
                point = self._load()
            side = abs(turn) * self._size(point)(u) / limits.max_lateral_acceleration
            found.append((("LATERAL_ACCELERATION", -1), side))
        for i, wheel in enumerate(self._vehicle.wheels):
            w = self._vehicle.contacts[i]
            if isinstance(wheel, SteerableWheel):
                alpha = self._difference(self._angle(w, u), u)
                if wheel.max_steering_rate_deg is not None:
                    bound = math.radians(wheel.max_steering_rate_deg)
                    found.append((("STEER_RATE", i), (alpha / bound) ** 2))
                if wheel.max_speed is None:
                    continue
                size = self._size(w)(u)
                for d in wheel.offsets:
                    rolls = size - self._sigma * (turn + alpha) * d
                    both = abs(rolls) + wheel.steering_coupling * abs(alpha)
                    found.append((("WHEEL_SPEED", i), (both / wheel.max_speed) ** 2))
            elif not isinstance(wheel, Castor) and wheel.max_speed is not None:
                rolls = self._rolling(i)(u)
                found.append((("WHEEL_SPEED", i), (rolls / wheel.max_speed) ** 2))
        return found

    def rates(self, u: float) -> list[tuple[Key, float, float, float]]:
        """Return key, a, b and least value of ``least ≤ a ü + b u̇² ≤ 1``."""
        found: list[tuple[Key, float, float, float]] = []

        def add(key: Key, speed: Function, limit: float, least: float) -> None:
            slope = self._difference(speed, u)
            found.append((key, speed(u) / limit, slope / limit, least))

        limits, load = self._vehicle.limits, self._vehicle.load
        size = self._size(self._vehicle.reference)
        if limits.max_acceleration is not None:
            add(("ACCELERATION", -1), size, limits.max_acceleration, -math.inf)
        if limits.max_deceleration is not None:
            add(("DECELERATION", -1), size, -limits.max_deceleration, -math.inf)
        if load is not None:
            height = load.center_of_gravity[2] * load.tipping_factor
            for normal, distance in self._vehicle.tipping_edges:
                n = np.array([normal.real, normal.imag])
                limit = distance * GRAVITY / height
                # In the world: the acceleration is p'' u̇² + p' ü, then turned back.
                along, bend = (self._world(u, order) for order in (1, 2))
                a, b = float(along @ n) / limit, float(bend @ n) / limit
                found.append((("TIPPING", -1), a, b, -math.inf))
        for i, wheel in enumerate(self._vehicle.wheels):
            if isinstance(wheel, Castor):
                continue
            w = self._vehicle.contacts[i]
            if wheel.max_acceleration is not None:
                for speed in self._rolls(i):
                    add(("WHEEL_ACCELERATION", i), speed, wheel.max_acceleration, -1.0)
            if not isinstance(wheel, SteerableWheel):
                continue
            if wheel.max_steering_acceleration_deg is not None:
                limit = math.radians(wheel.max_steering_acceleration_deg)
                angle = self._angle(w, u)
                a = self._difference(angle, u) / limit
                h = 5 * H
                b = (angle(u + h) - 2 * angle(u) + angle(u - h)) / h**2 / limit
                found.append((("STEER_ACCELERATION", i), a, b, -1.0))
        return found

    def _load(self) -> complex:
        assert self._vehicle.load is not None
        x, y, _ = self._vehicle.load.center_of_gravity
        return complex(x, y)

    def _difference(self, f: Function, u: float) -> float:
        return (f(u + H) - f(u - H)) / (2 * H)

    def _place(self, point: complex, u: float) -> FloatArray:
        """Return where a point of the body is in the world."""
        x, y, theta = self._piece.poses_at(np.array([u]))[0]
        arm = (point - self._piece.point) * complex(math.cos(theta), math.sin(theta))
        return np.array([x + arm.real, y + arm.imag])

    def _turning(self, u: float) -> float:
        theta = [self._piece.poses_at(np.array([u + s * H]))[0, 2] for s in (1, -1)]
        return float(theta[0] - theta[1]) / (2 * H)

    def _world(self, u: float, order: int) -> FloatArray:
        """Return a derivative of the load's place by u, in the vehicle's axes."""
        h = H if order == 1 else 5 * H
        ahead, here, behind = (self._place(self._load(), u + s * h) for s in (1, 0, -1))
        d = (ahead - behind) / (2 * h)
        if order == 2:
            d = (ahead - 2 * here + behind) / h**2
        theta = self._piece.poses_at(np.array([u]))[0, 2]
        c, s = math.cos(theta), math.sin(theta)
        return np.array([c * d[0] + s * d[1], c * d[1] - s * d[0]])

    def _velocity(self, point: complex, u: float) -> FloatArray:
        d = (self._place(point, u + H) - self._place(point, u - H)) / (2 * H)
        theta = self._piece.poses_at(np.array([u]))[0, 2]
        c, s = math.cos(theta), math.sin(theta)
        return np.array([c * d[0] + s * d[1], c * d[1] - s * d[0]])

    def _size(self, point: complex) -> Function:
        return lambda u: float(np.linalg.norm(self._velocity(point, u)))

    def _angle(self, point: complex, at: float) -> Function:
        """Return the direction of a wheel, without a jump near `at`."""
        vx, vy = self._velocity(point, at)
        middle = math.atan2(vy, vx)

        def angle(u: float) -> float:
            x, y = self._velocity(point, u)
            return middle + math.remainder(math.atan2(y, x) - middle, 2 * math.pi)

        return angle

    def _rolls(self, i: int) -> list[Function]:
        """Return the rolling speeds per u̇ of the wheels on an axis.

        With what steering takes of shared motors, in either direction.
        """
        wheel, w = self._vehicle.wheels[i], self._vehicle.contacts[i]
        if not isinstance(wheel, SteerableWheel):
            return [self._rolling(i)]

        def roll(offset: float, share: float) -> Function:
            def speed(u: float) -> float:
                alpha = self._difference(self._angle(w, u), u)
                turn = self._turning(u) + alpha
                return self._size(w)(u) - self._sigma * turn * offset + share * alpha

            return speed

        k = wheel.steering_coupling
        return [roll(d, s) for d in wheel.offsets for s in {k, -k}]

    def _rolling(self, i: int) -> Function:
        wheel = self._vehicle.wheels[i]
        assert not isinstance(wheel, Castor | SteerableWheel)
        roller = 0.0 if isinstance(wheel, FixedWheel) else wheel.roller
        along = wheel.heading + roller

        def rolling(u: float) -> float:
            x, y = self._velocity(self._vehicle.contacts[i], u)
            speed = x * math.cos(along) + y * math.sin(along)
            return float(speed) / math.cos(roller)

        return rolling


def sweep(
    step: FloatArray, p: FloatArray, q: FloatArray, low: FloatArray, cap: FloatArray
) -> FloatArray:
    """Return x on the grid by linear programmes; see `timing_kernels.sweep`."""
    n = step.size
    best = np.zeros(n + 1)

    def solve(j: int, weights: list[float], bounds: list[tuple[float, float]]) -> float:
        # unknowns (x_{j+1}, x_j)
        lower = np.isfinite(low)
        rows = np.concatenate(
            [
                np.stack([p[j], q[j]], axis=1),
                -np.stack([p[j], q[j]], axis=1)[lower],
            ]
        )
        sides = np.concatenate([np.ones(low.size), -low[lower]])
        if not sides.size:
            rows, sides = np.zeros((1, 2)), np.ones(1)
        # Rows of like size, as the solver's tolerances are absolute.
        size = np.maximum(np.abs(rows).max(axis=1), 1.0)
        done = linprog(
            weights, rows / size[:, None], sides / size, bounds=bounds, method="highs"
        )
        assert done.status == 0
        return -float(done.fun or 0.0)

    for j in range(n - 1, -1, -1):
        best[j] = solve(j, [0.0, -1.0], [(0.0, best[j + 1]), (0.0, cap[j])])
    x = np.zeros(n + 1)
    for j in range(n):
        at = min(x[j], best[j])
        x[j + 1] = solve(j, [-1.0, 0.0], [(0.0, best[j + 1]), (at, at)])
    return x
