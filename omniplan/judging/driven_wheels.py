"""Wheels that do not steer: fixed ones, Mecanum and omni wheels, all at once."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TypeAlias

import numpy as np

from configspace.vehicle import FixedWheel, MecanumWheel, OmniWheel
from omniplan.judging.chords import Change, Chord, along, changed, over, scaled, size
from omniplan.judging.look import Look
from omniplan.judging.points import Points, column
from omniplan.judging.rows import Bounds, Row, Tolerances

__all__ = ["DrivenWheel", "DrivenWheels"]

DrivenWheel: TypeAlias = FixedWheel | MecanumWheel | OmniWheel


class DrivenWheels:
    """n wheels that have the same limits, with bounds of their own."""

    def __init__(
        self,
        wheels: Mapping[int, DrivenWheel],
        tolerances: Tolerances,
        *,
        is_own: bool,
        has_rates: bool,
    ) -> None:
        """Take wheels of one `kind`, by their index in the vehicle.

        Parameters
        ----------
        wheels : mapping of int to DrivenWheel
        tolerances : Tolerances
        is_own : bool
        has_rates : bool
            As for `VehicleJudge`, both.
        """
        first = next(iter(wheels.values()))
        self._tolerances = tolerances
        self._turn = Points.of([_driven(wheel) for wheel in wheels.values()])
        self._across: Points | None = None
        self._speed = self._gain = None
        self.rows: list[list[Row]] = []
        """For every limit the rows of all wheels."""
        if isinstance(first, FixedWheel) and not is_own:
            sine = math.sin(tolerances.slip_angle)
            aside = [wheel.heading + math.pi / 2 for wheel in wheels.values()]
            self._across = Points.of([np.exp(-1j * angle) for angle in aside])
            self.rows.append([Row("FIXED_WHEEL", i, sine, "1", "none") for i in wheels])
        if first.max_speed is not None and not is_own:
            rows = [
                Row("WHEEL_SPEED", i, wheel.max_speed or 0.0, "m/s", "speed")
                for i, wheel in wheels.items()
            ]
            self.rows.append(rows)
            self._speed = column(row.bound for row in rows)
        if first.max_acceleration is not None and has_rates:
            rows = [
                Row("WHEEL_ACCELERATION", i, limit or 0.0, "m/s²", "acceleration")
                for i, limit in ((i, w.max_acceleration) for i, w in wheels.items())
            ]
            self.rows.append(rows)
            self._gain = column(row.bound for row in rows)

    @staticmethod
    def kind(wheel: DrivenWheel) -> tuple[object, ...]:
        """Return what wheels must share to be judged together."""
        return (
            isinstance(wheel, FixedWheel),
            wheel.max_speed is None,
            wheel.max_acceleration is None,
        )

    def evaluate(
        self, look: Look, chord: Chord, change: Change
    ) -> Iterator[list[Bounds]]:
        """Yield the utilisation of every limit, (n, m), the same for all signs of v_s.

        Parameters
        ----------
        look : Look
        chord : Chord
            Velocities of the contacts.
        change : Change
            Likewise.
        """
        if self._across is not None:
            yield [self._slip(self._across, look, chord)]
        # Only the component along the driven direction rolls.
        if self._speed is not None:
            yield [over(scaled(look.part, along(chord, self._turn)), self._speed)]
        if self._gain is not None:
            yield [over(size(changed(look.part, change, self._turn)), self._gain)]

    def _slip(self, across: Points, look: Look, chord: Chord) -> Bounds:
        """Sideways slip against what the tolerances allow at this speed."""
        allowed = [
            np.maximum(
                math.sin(self._tolerances.slip_angle) * v, self._tolerances.slip_speed
            )
            for v in look.speed
        ]
        low, high = size(along(chord, across))
        return low / allowed[1], high / allowed[0]


def _driven(wheel: DrivenWheel) -> complex:
    """Return the factor whose real part with a velocity is what rolls."""
    roller = 0.0 if isinstance(wheel, FixedWheel) else wheel.roller
    driven: complex = np.exp(-1j * (wheel.heading + roller)) / math.cos(roller)
    return driven
