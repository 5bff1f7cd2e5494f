"""Steered wheels and turntables, all of a kind at once."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from configspace.angles import wrap
from configspace.limits import SectorRow
from configspace.vehicle import SteerableWheel
from omniplan.judging.beside import (
    Levers,
    Zone,
    beside_axis,
    beside_gains,
    beside_own,
    zone_bounds,
)
from omniplan.judging.chords import (
    Change,
    Chord,
    growths,
    one_way,
    over,
    scaled,
    spot_spread,
    turning,
)
from omniplan.judging.look import Look
from omniplan.judging.points import Points, column
from omniplan.judging.rows import Bounds, Row
from omniplan.judging.swing import swinging
from omniplan.motion import Enclosure

__all__ = ["SteeredWheels", "winds"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
Range: TypeAlias = Literal["none", "part", "full", "winding"]

SEAM = 1e-9
"""So near to a stop of a full turn either stop may be meant, rad."""
FULL = 1e-12
"""A range that exceeds a full turn by less, relative, is one: rounding."""


class SteeredWheels:
    """n steered wheels that have the same limits, with bounds of their own."""

    def __init__(
        self,
        wheels: Mapping[int, SteerableWheel],
        points: Points,
        sectors: Mapping[int, SectorRow],
        *,
        is_own: bool,
        has_rates: bool,
        has_swing: bool,
    ) -> None:
        """Take wheels of one `kind`, by their index in the vehicle.

        Parameters
        ----------
        wheels : mapping of int to SteerableWheel
        points : Points
            Their axes.
        sectors : mapping of int to SectorRow
        is_own : bool
        has_rates : bool
        has_swing : bool
            As for `VehicleJudge`, all three.
        """
        first = next(iter(wheels.values()))
        self._points, self._is_own = points, is_own
        self._levers = _levers(tuple(wheels.values()))
        self._zone: Zone | None = None
        if _asks(sectors[next(iter(wheels))]):
            self._zone = Zone.of([sectors[i] for i in wheels])
        self._range = _range_of(first)
        ends = [wheel.steering_range for wheel in wheels.values()]
        self._half = column(_half(*range_, self._range) for range_ in ends)
        self._middle = column((largest + least) / 2 for least, largest in ends)
        self._rate = self._swing = self._gain = None
        if first.max_steering_rate_deg is not None:
            rates = [wheel.max_steering_rate_deg for wheel in wheels.values()]
            self._rate = column(math.radians(rate or 0.0) for rate in rates)
        if has_swing and first.max_steering_acceleration_deg is not None:
            swings = [w.max_steering_acceleration_deg for w in wheels.values()]
            self._swing = column(math.radians(swing or 0.0) for swing in swings)
        self._speed: FloatArray | None = None
        if first.max_speed is not None:
            self._speed = column(wheel.max_speed or 0.0 for wheel in wheels.values())
        if first.max_acceleration is not None and has_rates:
            limits = [wheel.max_acceleration for wheel in wheels.values()]
            self._gain = column(limit or 0.0 for limit in limits)
        on_axis = any(offset is None for offset in self._levers.offsets)
        self._rolls_on_axis = on_axis and not is_own
        self._gains_beside = has_swing and not self._levers.is_nothing
        self.rows = list(self._listed(list(wheels)))
        """For every limit the rows of all wheels."""

    @staticmethod
    def kind(wheel: SteerableWheel, sector: SectorRow) -> tuple[object, ...]:
        """Return what wheels must share to be judged together."""
        return (
            _range_of(wheel),
            _asks(sector),
            wheel.max_steering_rate_deg is None,
            wheel.max_steering_acceleration_deg is None,
            wheel.max_speed is None,
            wheel.max_acceleration is None,
            tuple(offset == 0 for offset in wheel.offsets),
            wheel.steering_coupling == 0,
        )

    def _listed(self, wheels: Sequence[int]) -> Iterator[list[Row]]:
        """Yield the rows in the order of `evaluate`."""
        yield [Row("SINGULAR", i, 0.0, "m/s", "none", True) for i in wheels]
        if self._zone is not None:
            yield [Row("SINGULAR_ZONE", i, 1.0, "1", "none", True) for i in wheels]
        if self._range != "none":
            yield [
                Row("STEER_RANGE", i, half, "rad", "none", True)
                for i, half in _each(wheels, self._half)
            ]
        if self._rate is not None:
            yield [
                Row("STEER_RATE", i, limit, "rad/s", "speed", True)
                for i, limit in _each(wheels, self._rate)
            ]
        if self._swing is not None:
            yield [
                Row("STEER_ACCELERATION", i, limit, "rad/s²", "acceleration", True)
                for i, limit in _each(wheels, self._swing)
            ]
        if self._speed is not None:
            shared = self._levers.coupling is not None
            beside = [d is not None or shared for d in self._levers.offsets]
            for is_free in [True] * sum(beside) + [False] * self._rolls_on_axis:
                yield [
                    Row("WHEEL_SPEED", i, limit, "m/s", "speed", is_free)
                    for i, limit in _each(wheels, self._speed)
                ]
        if self._gain is not None:
            for _ in self._levers.offsets if self._gains_beside else (None,):
                yield [
                    Row("WHEEL_ACCELERATION", i, limit, "m/s²", "acceleration")
                    for i, limit in _each(wheels, self._gain)
                ]

    def evaluate(
        self, look: Look, chord: Chord, change: Change
    ) -> Iterator[list[Bounds]]:
        """Yield the utilisation of every limit, (n, m): per sign of v_s, or one.

        Parameters
        ----------
        look : Look
        chord : Chord
            Velocities of the axes.
        change : Change
            Likewise.
        """
        part, moving = look.part, look.moving
        # What is reached counts only at ends where the vehicle moves.
        first, last = (
            (v > 0) & (size > 1e-9 * v)
            for v, size in zip(moving, chord.sizes, strict=True)
        )
        on_wheel = ((moving[0] > 0) & ~first) | ((moving[1] > 0) & ~last)
        lost = chord.near <= 0
        yield [(np.where(on_wheel, np.inf, 0.0), np.where(lost, np.inf, 0.0))]
        if self._zone is not None:
            kappa_g, body = look.kappa_g, look.body
            yield [zone_bounds(part, self._zone, kappa_g, body, chord, moving)]
        if self._range == "winding":  # left to `omniplan.standing.winding`
            nothing = np.zeros(chord.near.shape)
            yield [(nothing, nothing)]
        elif self._range != "none":
            yield self._directions(look, chord, change, (first, last))
        yield from self._rates(look, chord, change, (first, last))
        if self._gain is not None:
            for gains in self._gains(look, chord, change, (first, last)):
                yield [over(gain, self._gain) for gain in gains]

    def _directions(
        self, look: Look, chord: Chord, change: Change, rolls: tuple[BoolArray, ...]
    ) -> list[Bounds]:
        """Return the angles aside of the middle of the range."""
        # The segment sweeps from start to end; its surroundings a little more, but not
        # where the angle moves one way only: a wheel may leave its very stop.
        spread = np.where(one_way(look.part, chord, change), 0.0, chord.spread())
        # Nor in a turn on the spot, however fast it is: it may stand at its very stop.
        spread = np.minimum(spread, spot_spread(look.body, chord))
        turned = np.angle(chord.b * chord.a.conj())
        found = []
        for own in look.owns:
            start = wrap(np.angle(own * chord.a) - self._middle)
            at_end = wrap(np.angle(own * chord.b) - self._middle)
            high = np.maximum(np.abs(start), np.abs(start + turned)) + spread
            if self._range == "full":
                high = np.maximum(high, _over_the_seam(start, at_end))
            low = np.maximum(
                np.where(rolls[0], np.abs(start), 0.0),
                np.where(rolls[1], np.abs(at_end), 0.0),
            )
            high = np.where(chord.near <= 0, np.inf, high / self._half)
            found.append((low / self._half, high))
        return found

    def _rates(
        self,
        look: Look,
        chord: Chord,
        change: Change,
        rolls: tuple[BoolArray, BoolArray],
    ) -> Iterator[list[Bounds]]:
        """Yield what steering and rolling ask for, but for the change of rolling."""
        part, levers, limit = look.part, self._levers, self._speed
        is_beside = limit is not None and not levers.is_nothing
        if self._rate is not None or is_beside:
            rate = turning(part, chord, change, rolls)
        if self._rate is not None:
            yield [over(rate, self._rate)]
        if self._swing is not None:
            # Within a standstill α̇ may jump: there the wheels are free.
            yield [over(swinging(*self._swung(part), rolls), self._swing)]
        if limit is None:
            return
        if is_beside and self._is_own:
            for bounds in beside_own(levers, limit, part, rate):
                yield [bounds]
        elif is_beside:
            yield from beside_axis(
                levers, limit, part, chord, change, look.owns, rate, look.moving
            )
        if self._rolls_on_axis:
            yield [over(scaled(part, chord), limit)]

    def _gains(
        self,
        look: Look,
        chord: Chord,
        change: Change,
        rolls: tuple[BoolArray, BoolArray],
    ) -> Iterator[list[Bounds]]:
        """Yield the changes of rolling speed, of every wheel on an axis.

        Where the vehicle stands the wheels are free to steer: there the axis counts.
        """
        at_axis = growths(look.part, chord, change, (0,))
        if not self._gains_beside:
            yield at_axis
            return
        stands = look.speed[1] <= look.floor
        for gains in beside_gains(
            self._levers,
            look.part,
            chord,
            change,
            self._swung(look.part),
            look.owns,
            rolls,
        ):
            found = []
            for low, high in gains:
                low = np.where(stands, at_axis[0][0], low)
                found.append((low, np.where(stands, at_axis[0][1], high)))
            yield found

    def _swung(self, part: Enclosure) -> Bounds:
        assert part.swing is not None
        return part.swing.directions.accelerations(self._points)


def winds(half: float) -> bool:
    """Return whether half a steering range is more than half a turn, rounding aside."""
    return half > math.pi * (1 + FULL)


def _range_of(wheel: SteerableWheel) -> Range:
    if wheel.steering_range_deg is None:
        return "none"
    least, largest = wheel.steering_range
    half = (largest - least) / 2
    if winds(half):
        return "winding"
    return "full" if half >= math.pi else "part"


def _half(least: float, largest: float, kind: Range) -> float:
    half = (largest - least) / 2
    return math.pi if kind == "full" else half


def _asks(sector: SectorRow) -> bool:
    """Return whether guaranteed rates ask something of a wheel."""
    return bool(sector.kappa_share or sector.beta_share)


def _levers(wheels: Sequence[SteerableWheel]) -> Levers:
    offsets = [
        column(each) if each[0] != 0 else None
        for each in zip(*(wheel.offsets for wheel in wheels), strict=True)
    ]
    shared = [wheel.steering_coupling for wheel in wheels]
    return Levers(tuple(offsets), column(shared) if shared[0] != 0 else None)


def _each(wheels: Sequence[int], limits: FloatArray) -> Iterator[tuple[int, float]]:
    return zip(wheels, limits[:, 0].tolist(), strict=True)


def _over_the_seam(start: FloatArray, end: FloatArray) -> FloatArray:
    """Return an angle beyond π where a part comes to the stops of a full turn.

    Both stops are one direction, so a wheel that rounding puts just beyond one of them
    would seem to stand at the other.
    """
    at_stop = [np.abs(angle) > math.pi - SEAM for angle in (start, end)]
    comes = (at_stop[0] != at_stop[1]) | (at_stop[0] & (start * end < 0))
    return np.where(comes, math.pi * (1 + SEAM), 0.0)
