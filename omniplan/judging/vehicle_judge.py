"""Judging by the exact formulas of a known vehicle."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from configspace import Vehicle
from configspace.angles import wrap
from configspace.limits import rows_of
from configspace.vehicle import (
    Castor,
    FixedWheel,
    MecanumWheel,
    OmniWheel,
    SteerableWheel,
)
from omniplan.judging.beside import beside_axis, beside_gain, zone_bounds
from omniplan.judging.body_rows import BodyRows
from omniplan.judging.chords import (
    Change,
    Chord,
    along,
    changed,
    ends_moving,
    growth,
    one_way,
    over,
    scaled,
    size,
    speed_of,
    turning,
)
from omniplan.judging.rows import Bounds, Row, Tolerances, WindingWheel
from omniplan.judging.swing import Swing, swinging
from omniplan.motion import Enclosure

__all__ = ["VehicleJudge", "winds"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

SEAM = 1e-9
"""So near to a stop of a full turn either stop may be meant, rad."""
FULL = 1e-12
"""A range that exceeds a full turn by less, relative, is one: rounding."""


class VehicleJudge:
    """Judges by the exact formulas of a known vehicle."""

    def __init__(
        self,
        vehicle: Vehicle,
        tolerances: Tolerances,
        *,
        is_own: bool,
        has_rates: bool,
        has_swing: bool = False,
    ) -> None:
        """Take what is known of the motions.

        Parameters
        ----------
        vehicle : Vehicle
        tolerances : Tolerances
        is_own : bool
            Whether they are the vehicle's own Omni-Curve-Parameters.
        has_rates : bool
            Whether accelerations are known.
        has_swing : bool
            Whether steering accelerations are known: `Enclosure.swing`.
        """
        self._vehicle = vehicle
        self._tolerances = tolerances
        self._is_own = is_own
        self._has_rates = has_rates
        self._has_swing = has_swing
        self.kappa_g = vehicle.boundary_curvature
        self.reference = vehicle.reference
        self.wheel_ids = tuple(wheel.id for wheel in vehicle.wheels)
        self.needs_configuration = any(
            isinstance(wheel, SteerableWheel) for wheel in vehicle.wheels
        )
        self._sectors = {row.wheel: row for row in rows_of(vehicle)[1]}
        self.rows: tuple[Row, ...] = ()
        # One evaluation on an empty part lists the rows.
        empty = np.zeros(0)
        nothing = replace(
            Enclosure(*([empty] * 17)),  # type: ignore[arg-type]
            swing=Swing.nothing(),
        )
        self.rows = tuple(row for row, _ in self._evaluate(nothing, 1))
        self.winding_wheels = tuple(self._winding_wheels())

    def _winding_wheels(self) -> Iterator[WindingWheel]:
        for column, row in enumerate(self.rows):
            if row.limit != "STEER_RANGE" or not winds(row.bound):
                continue
            wheel = self._vehicle.wheels[row.wheel]
            assert isinstance(wheel, SteerableWheel)
            swing = wheel.max_steering_acceleration_deg
            yield WindingWheel(
                row.wheel,
                column,
                self._vehicle.contacts[row.wheel],
                *wheel.steering_range,
                wheel.standing_steering_rate,
                math.inf if swing is None else math.radians(swing),
            )

    def utilisation(self, part: Enclosure, sign: int) -> Bounds:
        """Return low and high utilisation, (m, rows), of representation `sign`."""
        bounds = [bound for _, bound in self._evaluate(part, sign)]
        if not bounds:
            nothing = np.zeros((part.dt.size, 0))
            return nothing, nothing
        low, high = (np.stack(column, axis=1) for column in zip(*bounds, strict=True))
        return low, high

    def _evaluate(self, part: Enclosure, sign: int) -> list[tuple[Row, Bounds]]:
        own = sign * part.sign
        body = Chord.of(part, self.reference)
        speed = speed_of(part, body, self.kappa_g)
        # An own (κ_n, β) is a configuration even where the vehicle stands.
        floor = -1.0 if self._is_own else self._tolerances.standstill
        moving = ends_moving(part, body, self.kappa_g, floor)
        entries: list[tuple[Row, Bounds]] = []
        for i, wheel in enumerate(self._vehicle.wheels):
            if isinstance(wheel, Castor):
                continue
            chord = Chord.of(part, self._vehicle.contacts[i])
            change = Change.of(part, self._vehicle.contacts[i])
            if isinstance(wheel, SteerableWheel):
                entries += self._steered(i, wheel, part, chord, change, own, moving)
                gains = [growth(part, chord, change, 0)]
                if self._has_swing and (any(wheel.offsets) or wheel.steering_coupling):
                    stands = speed[1] <= floor
                    gains = self._beside(i, wheel, part, own, moving, stands, gains[0])
            else:
                if isinstance(wheel, FixedWheel) and not self._is_own:
                    entries.append(self._slip(i, wheel, chord, speed))
                # Only the component along the driven direction rolls.
                roller = 0.0 if isinstance(wheel, FixedWheel) else wheel.roller
                turn = np.exp(-1j * (wheel.heading + roller)) / math.cos(roller)
                chord, change = along(chord, turn), changed(part, change, turn)
                gains = [size(change)]
            entries += self._rolling(i, wheel, part, chord, gains)
        whole = BodyRows(self._vehicle, self._tolerances, self._is_own, self._has_rates)
        return [*entries, *whole.evaluate(part, body, own)]

    def _steered(
        self,
        i: int,
        wheel: SteerableWheel,
        part: Enclosure,
        chord: Chord,
        change: Change,
        own: FloatArray,
        moving: tuple[FloatArray, FloatArray],
    ) -> list[tuple[Row, Bounds]]:
        """Return what a wheel's direction and its rolling beside the axis ask for."""
        lost = chord.near <= 0
        # What is reached counts only at ends where the vehicle moves.
        rolls = [
            (v > 0) & (np.abs(u) > 1e-9 * v)
            for v, u in zip(moving, (chord.a, chord.b), strict=True)
        ]
        on_wheel = ((moving[0] > 0) & ~rolls[0]) | ((moving[1] > 0) & ~rolls[1])
        singular = np.where(on_wheel, np.inf, 0.0), np.where(lost, np.inf, 0.0)
        entries: list[tuple[Row, Bounds]] = [
            (Row("SINGULAR", i, 0.0, "m/s", "none", True), singular)
        ]
        row = self._sectors[i]
        if row.kappa_share or row.beta_share:
            zone = zone_bounds(part, row, self.kappa_g, self.reference, chord, moving)
            entries.append((Row("SINGULAR_ZONE", i, 1.0, "1", "none", True), zone))
        if wheel.steering_range_deg is not None:
            entries.append(_steering_range(i, wheel, part, chord, change, own, rolls))
        rate = turning(part, chord, change, (rolls[0], rolls[1]))
        if wheel.max_steering_rate_deg is not None:
            limit = math.radians(wheel.max_steering_rate_deg)
            turn = Row("STEER_RATE", i, limit, "rad/s", "speed", True)
            entries.append((turn, over(rate, limit)))
        if self._has_swing and wheel.max_steering_acceleration_deg is not None:
            entries.append(self._swinging(i, wheel, part, (rolls[0], rolls[1])))
        if wheel.max_speed is not None:
            roll = Row("WHEEL_SPEED", i, wheel.max_speed, "m/s", "speed", True)
            is_own = self._is_own
            beside = beside_axis(wheel, part, chord, change, own, rate, moving, is_own)
            for bounds in beside:
                entries.append((roll, bounds))
        return entries

    def _beside(
        self,
        i: int,
        wheel: SteerableWheel,
        part: Enclosure,
        own: FloatArray,
        moving: tuple[FloatArray, FloatArray],
        stands: BoolArray,
        at_axis: Bounds,
    ) -> list[Bounds]:
        """Return the accelerations of wheels beside an axis, and of shared motors.

        Where the vehicle stands the wheels are free to steer: there the axis counts.
        """
        point = self._vehicle.contacts[i]
        chord = Chord.of(part, point)
        first, last = (
            (v > 0) & (np.abs(u) > 1e-9 * v)
            for v, u in zip(moving, (chord.a, chord.b), strict=True)
        )
        found = []
        for offset in wheel.offsets:
            bounds = beside_gain(wheel, offset, part, point, own, (first, last))
            low, high = (
                np.where(stands, axis, moved)
                for axis, moved in zip(at_axis, bounds, strict=True)
            )
            found.append((low, high))
        return found

    def _swinging(
        self,
        i: int,
        wheel: SteerableWheel,
        part: Enclosure,
        rolls: tuple[BoolArray, BoolArray],
    ) -> tuple[Row, Bounds]:
        """Return the steering acceleration |α̈|.

        Within a standstill α̇ may jump: there the wheels are free.
        """
        assert part.swing is not None
        assert wheel.max_steering_acceleration_deg is not None
        limit = math.radians(wheel.max_steering_acceleration_deg)
        swing = part.swing.directions.accelerations(self._vehicle.contacts[i])
        row = Row("STEER_ACCELERATION", i, limit, "rad/s²", "acceleration", True)
        return row, over(swinging(*swing, rolls), limit)

    def _slip(
        self, i: int, wheel: FixedWheel, chord: Chord, speed: Bounds
    ) -> tuple[Row, Bounds]:
        """Sideways slip against what the tolerances allow at this speed."""
        aside = along(chord, np.exp(-1j * (wheel.heading + math.pi / 2)))
        allowed = [
            np.maximum(
                math.sin(self._tolerances.slip_angle) * v, self._tolerances.slip_speed
            )
            for v in speed
        ]
        low, high = size(aside)
        row = Row("FIXED_WHEEL", i, math.sin(self._tolerances.slip_angle), "1", "none")
        return row, (low / allowed[1], high / allowed[0])

    def _rolling(
        self,
        i: int,
        wheel: SteerableWheel | FixedWheel | MecanumWheel | OmniWheel,
        part: Enclosure,
        chord: Chord,
        gains: list[Bounds],
    ) -> list[tuple[Row, Bounds]]:
        """Return rolling speed and its change, of every wheel on an axis."""
        entries: list[tuple[Row, Bounds]] = []
        on_axis = not isinstance(wheel, SteerableWheel) or 0.0 in wheel.offsets
        if wheel.max_speed is not None and on_axis and not self._is_own:
            row = Row("WHEEL_SPEED", i, wheel.max_speed, "m/s", "speed")
            entries.append((row, over(scaled(part, chord), row.bound)))
        if wheel.max_acceleration is not None and self._has_rates:
            limit = wheel.max_acceleration
            row = Row("WHEEL_ACCELERATION", i, limit, "m/s²", "acceleration")
            entries += [(row, over(gain, limit)) for gain in gains]
        return entries


def _steering_range(
    i: int,
    wheel: SteerableWheel,
    part: Enclosure,
    chord: Chord,
    change: Change,
    own: FloatArray,
    rolls: list[BoolArray],
) -> tuple[Row, Bounds]:
    """Return the angle aside of the middle of the range.

    Of a wheel that winds the row is left to `omniplan.standing.winding`.
    """
    least, largest = wheel.steering_range
    half, middle = (largest - least) / 2, (largest + least) / 2
    if winds(half):
        nothing = np.zeros(own.shape)
        return Row("STEER_RANGE", i, half, "rad", "none", True), (nothing, nothing)
    half = min(half, math.pi)
    start = wrap(np.angle(own * chord.a) - middle)
    end = start + np.angle(chord.b * chord.a.conj())
    at_end = wrap(np.angle(own * chord.b) - middle)
    # The segment sweeps from start to end; its surroundings a little more, but not
    # where the angle moves one way only: a wheel may leave its very stop.
    spread = np.where(one_way(part, chord, change), 0.0, chord.spread())
    high = np.maximum(np.abs(start), np.abs(end)) + spread
    if half == math.pi:
        high = np.maximum(high, _over_the_seam(start, at_end))
    low = np.maximum(
        np.where(rolls[0], np.abs(start), 0.0),
        np.where(rolls[1], np.abs(at_end), 0.0),
    )
    high = np.where(chord.near <= 0, np.inf, high / half)
    return Row("STEER_RANGE", i, half, "rad", "none", True), (low / half, high)


def winds(half: float) -> bool:
    """Return whether half a steering range is more than half a turn, rounding aside."""
    return half > math.pi * (1 + FULL)


def _over_the_seam(start: FloatArray, end: FloatArray) -> FloatArray:
    """Return an angle beyond π where a part comes to the stops of a full turn.

    Both stops are one direction, so a wheel that rounding puts just beyond one of them
    would seem to stand at the other.
    """
    at_stop = [np.abs(angle) > math.pi - SEAM for angle in (start, end)]
    comes = (at_stop[0] != at_stop[1]) | (at_stop[0] & (start * end < 0))
    return np.where(comes, math.pi * (1 + SEAM), 0.0)
