"""Judging by the exact formulas of a known vehicle."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from configspace import Vehicle
from configspace.limits import rows_of
from configspace.vehicle import Castor, SteerableWheel
from omniplan.judging.body_rows import BodyRows
from omniplan.judging.chords import Change, Chord
from omniplan.judging.driven_wheels import DrivenWheel, DrivenWheels
from omniplan.judging.look import Look
from omniplan.judging.points import Points
from omniplan.judging.rows import Bounds, Row, Tolerances, WindingWheel
from omniplan.judging.steered_wheels import SteeredWheels, winds
from omniplan.motion import Enclosure

__all__ = ["VehicleJudge", "winds"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
Group: TypeAlias = BodyRows | SteeredWheels | DrivenWheels

AT_ONCE = 16_384
"""So many values are worked out at once: what stays near the processor."""


@dataclass(frozen=True, eq=False)
class _Placed:
    """Limits that are evaluated together, and where their results go."""

    group: Group
    points: slice
    """Of the judge's points."""
    columns: tuple[IntArray, ...]
    """For every entry of the group the columns of its rows."""


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
        # An own (κ_n, β) is a configuration even where the vehicle stands.
        self._floor = -1.0 if is_own else tolerances.standstill
        self.kappa_g = vehicle.boundary_curvature
        self.reference = vehicle.reference
        self.wheel_ids = tuple(wheel.id for wheel in vehicle.wheels)
        self.needs_configuration = any(
            isinstance(wheel, SteerableWheel) for wheel in vehicle.wheels
        )
        body = BodyRows(vehicle, tolerances, is_own, has_rates)
        alike = _alike(vehicle)
        contacts = [vehicle.contacts[i] for wheels in alike for i in wheels]
        self._points = Points.of([*body.points, *contacts])
        groups: list[tuple[Group, slice, Sequence[int]]] = []
        start = len(body.points)
        sectors = {row.wheel: row for row in rows_of(vehicle)[1]}
        for wheels in alike:
            here = slice(start, start + len(wheels))
            start = here.stop
            steered = _steered(vehicle, wheels)
            group: Group
            if steered:
                group = SteeredWheels(
                    steered,
                    self._points.rows(here),
                    sectors,
                    is_own=is_own,
                    has_rates=has_rates,
                    has_swing=has_swing,
                )
            else:
                group = DrivenWheels(
                    _driven(vehicle, wheels),
                    tolerances,
                    is_own=is_own,
                    has_rates=has_rates,
                )
            groups.append((group, here, wheels))
        groups.append((body, slice(0, len(body.points)), ()))
        self.rows, self._groups = _placed(groups)
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
        return self.utilisations(part, (sign,))[sign]

    def utilisations(self, part: Enclosure, signs: Sequence[int]) -> dict[int, Bounds]:
        """Return low and high utilisation, (m, rows), of every representation."""
        m, step = part.dt.size, max(AT_ONCE // len(self._points.reach), 1)
        found = {s: self._nothing(m) for s in signs}
        for start in range(0, m, step):
            rows = slice(start, start + step)
            piece = part if m <= step else part.rows(rows)
            self._fill(piece, {s: _cut(bounds, rows) for s, bounds in found.items()})
        return {s: (low.T, high.T) for s, (low, high) in found.items()}

    def _nothing(self, m: int) -> Bounds:
        return np.empty((len(self.rows), m)), np.empty((len(self.rows), m))

    def _fill(self, part: Enclosure, found: dict[int, Bounds]) -> None:
        """Write the utilisations of a few parts, (rows, m)."""
        chords, changes = Chord.of(part, self._points), Change.of(part, self._points)
        owns = tuple(sign * part.sign for sign in found)
        look = Look(part, chords.rows(0), owns, self.kappa_g, self._floor)
        for placed in self._groups:
            entries = placed.group.evaluate(
                look, chords.rows(placed.points), changes.rows(placed.points)
            )
            for columns, entry in zip(placed.columns, entries, strict=True):
                for i, (low, high) in enumerate(found.values()):
                    low[columns], high[columns] = entry[min(i, len(entry) - 1)]


def _alike(vehicle: Vehicle) -> list[list[int]]:
    """Return the wheels that roll, those together that have the same limits."""
    sectors = {row.wheel: row for row in rows_of(vehicle)[1]}
    kinds: dict[tuple[object, ...], list[int]] = {}
    for i, wheel in enumerate(vehicle.wheels):
        if isinstance(wheel, Castor):
            continue
        if isinstance(wheel, SteerableWheel):
            kind = ("steers", *SteeredWheels.kind(wheel, sectors[i]))
        else:
            kind = ("rolls", *DrivenWheels.kind(wheel))
        kinds.setdefault(kind, []).append(i)
    return list(kinds.values())


def _steered(vehicle: Vehicle, wheels: Sequence[int]) -> dict[int, SteerableWheel]:
    each = ((i, vehicle.wheels[i]) for i in wheels)
    return {i: wheel for i, wheel in each if isinstance(wheel, SteerableWheel)}


def _driven(vehicle: Vehicle, wheels: Sequence[int]) -> dict[int, DrivenWheel]:
    each = ((i, vehicle.wheels[i]) for i in wheels)
    return {
        i: wheel for i, wheel in each if not isinstance(wheel, SteerableWheel | Castor)
    }


def _placed(
    groups: Sequence[tuple[Group, slice, Sequence[int]]],
) -> tuple[tuple[Row, ...], tuple[_Placed, ...]]:
    """Return the rows, wheel by wheel and then the body, and the groups."""
    rows: list[Row] = []
    columns = [[np.empty(len(entry), np.int64) for entry in g.rows] for g, *_ in groups]
    in_order = sorted(
        (wheel, k, j)
        for k, (_, _, wheels) in enumerate(groups)
        for j, wheel in enumerate(wheels)
    )
    for _, k, j in in_order:
        for entry, at in zip(groups[k][0].rows, columns[k], strict=True):
            at[j] = len(rows)
            rows.append(entry[j])
    for entry, at in zip(groups[-1][0].rows, columns[-1], strict=True):
        at[:] = np.arange(len(rows), len(rows) + len(entry))
        rows += entry
    placed = (
        _Placed(group, points, tuple(at))
        for (group, points, _), at in zip(groups, columns, strict=True)
    )
    return tuple(rows), tuple(placed)


def _cut(bounds: Bounds, rows: slice) -> Bounds:
    return bounds[0][:, rows], bounds[1][:, rows]
