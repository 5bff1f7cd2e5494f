"""Limits of the vehicle as a whole."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from configspace import Vehicle
from configspace.exact import LINE_TOLERANCE
from configspace.limits import GRAVITY, center_of_gravity
from omniplan.judging.chords import (
    Change,
    Chord,
    excess,
    growth,
    off_line,
    over,
    scaled,
    speed_of,
)
from omniplan.judging.rows import Bounds, Row, Tolerances
from omniplan.motion import Enclosure

__all__ = ["BodyRows"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


class BodyRows:
    """Speeds and accelerations of the vehicle's body."""

    def __init__(
        self, vehicle: Vehicle, tolerances: Tolerances, is_own: bool, has_rates: bool
    ) -> None:
        self._vehicle, self._tolerances = vehicle, tolerances
        self._is_own, self._has_rates = is_own, has_rates
        self._kappa_g = vehicle.boundary_curvature

    def evaluate(
        self, part: Enclosure, body: Chord, own: FloatArray
    ) -> Iterator[tuple[Row, Bounds]]:
        """Yield every limit of the body with its utilisation.

        `body` is the velocity of K; `own` the sign of v_s.
        """
        if self._vehicle.mobility.is_translating:
            yield self._turning(part, body)
        line = self._vehicle.mobility.line_beta
        if self._is_own and line is not None:
            row = Row("FIXED_WHEEL", -1, LINE_TOLERANCE, "rad", "none", True)
            yield row, off_line(body, own, line)
        if self._is_own:  # v_n is a share of v_max, which holds all these limits
            row = Row("V_MAX", -1, 1.0, "1", "speed")
            yield row, (np.maximum(part.scale0, part.scale1), part.scale_high)
        else:
            yield from self._speeds(part, body, own)
            yield from self._lateral(part)
            yield from self._tipping(part)
        if self._has_rates:
            yield from self._gains(part, body)

    def _speeds(
        self, part: Enclosure, body: Chord, own: FloatArray
    ) -> Iterator[tuple[Row, Bounds]]:
        limits = self._vehicle.limits
        v = scaled(part, body)
        if limits.max_speed is not None:
            row = Row("SPEED", -1, limits.max_speed, "m/s", "speed")
            yield row, over(v, row.bound)
        if limits.max_reverse_speed is not None:
            row = Row("REVERSE_SPEED", -1, limits.max_reverse_speed, "m/s", "speed")
            low, high = over(v, row.bound)
            surely, perhaps = self._backwards(body, own)
            yield row, (np.where(surely, low, 0.0), np.where(perhaps, high, 0.0))
        if limits.max_yaw_rate_deg is not None:
            row = Row(
                "YAW_RATE", -1, math.radians(limits.max_yaw_rate_deg), "rad/s", "speed"
            )
            yield row, over(scaled(part, yaw_of(part)), row.bound)

    def _backwards(self, body: Chord, own: FloatArray) -> tuple[BoolArray, BoolArray]:
        """Return whether a part is driven backwards somewhere: surely, possibly.

        A line-mobile vehicle drives backwards where K moves against its constant β,
        any other where v_s < 0.
        """
        line = self._vehicle.mobility.line_beta
        if line is None:
            return own < 0, own < 0
        floor = self._tolerances.standstill
        forward = [(x * np.exp(-1j * line)).real for x in (body.a, body.b)]
        least = np.minimum(*forward)
        return least < -floor, least - body.radius < -floor

    def _lateral(self, part: Enclosure) -> Iterator[tuple[Row, Bounds]]:
        """Yield ``|ω v_P|`` of the named point."""
        limit = self._vehicle.limits.max_lateral_acceleration
        if limit is None:
            return
        point = self._vehicle.reference
        if self._vehicle.limits.lateral_acceleration_at == "center_of_gravity":
            point = center_of_gravity(self._vehicle)
        v, yaw = Chord.of(part, point), yaw_of(part)
        at_ends = np.maximum(
            np.abs(v.a * yaw.a) * part.scale0**2, np.abs(v.b * yaw.b) * part.scale1**2
        )
        change, gain = Change.of(part, point), yaw_change(part)
        # |ω v|: d/dt (ω v) = ω̇ v + ω v̇, and so on
        slope = gain.far * v.far + yaw.far * change.far
        bend = gain.bend * v.far + 2 * gain.far * change.far + yaw.far * change.bend
        bent = at_ends + excess(part, slope, bend)
        product = v.far * yaw.far * part.scale_high**2
        high = np.where(is_plain(part), np.minimum(bent, product), product)
        row = Row("LATERAL_ACCELERATION", -1, limit, "m/s²", "acceleration")
        yield row, over((at_ends, high), limit)

    def _tipping(self, part: Enclosure) -> Iterator[tuple[Row, Bounds]]:
        """Yield the acceleration of the centre of gravity towards every edge.

        Where accelerations are known they count, so braking is included.
        """
        load = self._vehicle.load
        if load is None:
            return
        point = center_of_gravity(self._vehicle)
        v, change, yaw = Chord.of(part, point), Change.of(part, point), yaw_of(part)
        ends = [1j * yaw.a * v.a * part.scale0**2, 1j * yaw.b * v.b * part.scale1**2]
        gain = yaw_change(part)
        # d/dt (j ω v) = j (ω̇ v + ω v̇)
        slope = gain.far * v.far + yaw.far * change.far
        bend = gain.bend * v.far + 2 * gain.far * change.far + yaw.far * change.bend
        if self._has_rates:
            ends = [ends[0] + change.a, ends[1] + change.b]
            slope, bend = slope + change.bend, bend + change.third
        more = excess(part, slope, bend)
        height = load.center_of_gravity[2]
        grow = np.maximum(part.scale_high, 1e-300) ** 2
        known = is_plain(part)
        for normal, distance in self._vehicle.tipping_edges:
            limit = distance * GRAVITY / (load.tipping_factor * height)
            towards = [(a * normal.conjugate()).real for a in ends]
            low = np.maximum(np.maximum(*towards), 0.0)
            # With a varying factor on the twist: its largest on the largest size.
            high = np.where(known, low + more, v.far * yaw.far * grow)
            row = Row("TIPPING", -1, limit, "m/s²", "acceleration")
            yield row, over((low, high), limit)

    def _turning(self, part: Enclosure, body: Chord) -> tuple[Row, Bounds]:
        """Return how much a vehicle turns that cannot, as a share of its speed."""
        sine = math.sin(self._tolerances.slip_angle)
        allowed = [
            np.maximum(sine * v, self._tolerances.slip_speed)
            for v in speed_of(part, body, self._kappa_g)
        ]
        yaw = yaw_of(part)
        low = np.maximum(np.abs(yaw.a), np.abs(yaw.b)) / self._kappa_g
        row = Row("PARALLEL_WHEELS", -1, sine, "1", "none")
        return row, (low / allowed[1], yaw.far / self._kappa_g / allowed[0])

    def _gains(self, part: Enclosure, body: Chord) -> Iterator[tuple[Row, Bounds]]:
        """Yield acceleration and deceleration of K."""
        limits = self._vehicle.limits
        change = Change.of(part, self._vehicle.reference)
        for name, limit, side in (
            ("ACCELERATION", limits.max_acceleration, 1),
            ("DECELERATION", limits.max_deceleration, -1),
        ):
            if limit is not None:
                row = Row(name, -1, limit, "m/s²", "acceleration")
                yield row, over(growth(part, body, change, side), limit)


def is_plain(part: Enclosure) -> BoolArray:
    """Return where the twist has no factor."""
    is_one = (part.scale0 == 1) & (part.scale1 == 1) & (part.scale_high == 1)
    return np.asarray(is_one, dtype=bool)


def yaw_change(part: Enclosure) -> Change:
    """Return ω̇ on the real axis."""
    first, last = (
        np.asarray(w, dtype=np.complex128) for w in (part.omega_dot0, part.omega_dot1)
    )
    bend, third = part.omega_ddot, part.omega_dddot
    far = np.maximum(np.abs(first), np.abs(last)) + excess(part, bend, third)
    return Change(first, last, bend, third, far)


def yaw_of(part: Enclosure) -> Chord:
    """Return ω as a chord on the real axis."""
    radius = part.dt**2 / 8 * part.omega_ddot
    far = np.maximum(np.abs(part.omega0), np.abs(part.omega1)) + radius
    first, last = (
        np.asarray(w, dtype=np.complex128) for w in (part.omega0, part.omega1)
    )
    return Chord(first, last, radius, np.zeros_like(radius), far)
