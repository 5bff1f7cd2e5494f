"""Limits of the vehicle as a whole."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from configspace import Vehicle
from configspace.exact import LINE_TOLERANCE
from configspace.limits import GRAVITY, center_of_gravity
from configspace.vehicle import Limits
from omniplan.judging.chords import (
    Change,
    Chord,
    excess,
    growths,
    off_line,
    over,
    scaled,
)
from omniplan.judging.look import Look
from omniplan.judging.points import column
from omniplan.judging.rows import Bounds, Row, Tolerances
from omniplan.motion import Enclosure

__all__ = ["BodyRows"]

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
BoolArray = npt.NDArray[np.bool_]
Term: TypeAlias = Callable[[Look, Chord, Change], list[Bounds]]
"""From parts and the velocities of the body's points to utilisations."""


class BodyRows:
    """Speeds and accelerations of the vehicle's body."""

    def __init__(
        self, vehicle: Vehicle, tolerances: Tolerances, is_own: bool, has_rates: bool
    ) -> None:
        self._tolerances, self._has_rates = tolerances, has_rates
        self._line = vehicle.mobility.line_beta
        self.points: list[complex] = [vehicle.reference]
        """What it asks the velocities of; K is the first."""
        self.rows: list[list[Row]] = []
        """The rows of every term."""
        self._terms: list[Term] = []
        for rows, term in self._listed(vehicle, is_own):
            if rows:
                self.rows.append(rows)
                self._terms.append(term)

    def evaluate(
        self, look: Look, chords: Chord, changes: Change
    ) -> Iterator[list[Bounds]]:
        """Yield the utilisation of the rows of every term.

        (m,) or (rows, m): per sign of v_s, or one for all.

        Parameters
        ----------
        look : Look
        chords : Chord
            Velocities of `points`.
        changes : Change
            Likewise.
        """
        for term in self._terms:
            yield term(look, chords, changes)

    def _listed(
        self, vehicle: Vehicle, is_own: bool
    ) -> Iterator[tuple[list[Row], Term]]:
        limits = vehicle.limits
        if vehicle.mobility.is_translating:
            sine = math.sin(self._tolerances.slip_angle)
            yield [Row("PARALLEL_WHEELS", -1, sine, "1", "none")], self._turning
        if is_own:
            if self._line is not None:
                row = Row("FIXED_WHEEL", -1, LINE_TOLERANCE, "rad", "none", True)
                yield [row], self._off_line
            # v_n is a share of v_max, which holds all these limits.
            yield [Row("V_MAX", -1, 1.0, "1", "speed")], _shares
        else:
            yield from self._speeds(limits)
            yield from self._lateral(vehicle)
            yield from self._tipping(vehicle)
        if self._has_rates:
            yield from self._gains(limits)

    def _speeds(self, limits: Limits) -> Iterator[tuple[list[Row], Term]]:
        fastest, reverse = limits.max_speed, limits.max_reverse_speed
        if fastest is not None:
            row = Row("SPEED", -1, fastest, "m/s", "speed")
            yield [row], partial(_speed, fastest)
        if reverse is not None:
            row = Row("REVERSE_SPEED", -1, reverse, "m/s", "speed")
            yield [row], partial(self._reverse, reverse)
        if limits.max_yaw_rate_deg is not None:
            limit = math.radians(limits.max_yaw_rate_deg)
            row = Row("YAW_RATE", -1, limit, "rad/s", "speed")
            yield [row], partial(_yaw_rate, limit)

    def _reverse(
        self, limit: float, look: Look, chords: Chord, _: Change
    ) -> list[Bounds]:
        low, high = over(scaled(look.part, look.body), limit)
        found = []
        for own in look.owns:
            surely, perhaps = self._backwards(look.body, own)
            found.append((np.where(surely, low, 0.0), np.where(perhaps, high, 0.0)))
        return found

    def _backwards(self, body: Chord, own: FloatArray) -> tuple[BoolArray, BoolArray]:
        """Return whether a part is driven backwards somewhere: surely, possibly.

        A line-mobile vehicle drives backwards where K moves against its constant β,
        any other where v_s < 0.
        """
        if self._line is None:
            return own < 0, own < 0
        floor = self._tolerances.standstill
        forward = [(x * np.exp(-1j * self._line)).real for x in (body.a, body.b)]
        least = np.minimum(*forward)
        return least < -floor, least - body.radius < -floor

    def _off_line(self, look: Look, chords: Chord, _: Change) -> list[Bounds]:
        assert self._line is not None
        return [off_line(look.body, own, self._line) for own in look.owns]

    def _turning(self, look: Look, chords: Chord, _: Change) -> list[Bounds]:
        """Return how much a vehicle turns that cannot, as a share of its speed."""
        sine = math.sin(self._tolerances.slip_angle)
        allowed = [
            np.maximum(sine * v, self._tolerances.slip_speed) for v in look.speed
        ]
        yaw = yaw_of(look.part)
        low = np.maximum(np.abs(yaw.a), np.abs(yaw.b)) / look.kappa_g
        return [(low / allowed[1], yaw.far / look.kappa_g / allowed[0])]

    def _lateral(self, vehicle: Vehicle) -> Iterator[tuple[list[Row], Term]]:
        """Yield ``|ω v_P|`` of the named point."""
        limit = vehicle.limits.max_lateral_acceleration
        if limit is None:
            return
        point = vehicle.reference
        if vehicle.limits.lateral_acceleration_at == "center_of_gravity":
            point = center_of_gravity(vehicle)
        row = Row("LATERAL_ACCELERATION", -1, limit, "m/s²", "acceleration")
        yield [row], partial(_lateral, limit, self._index(point))

    def _tipping(self, vehicle: Vehicle) -> Iterator[tuple[list[Row], Term]]:
        """Yield the acceleration of the centre of gravity towards every edge.

        Where accelerations are known they count, so braking is included.
        """
        load = vehicle.load
        if load is None:
            return
        height = load.center_of_gravity[2]
        edges = vehicle.tipping_edges
        rows = [
            Row("TIPPING", -1, limit, "m/s²", "acceleration")
            for limit in (
                distance * GRAVITY / (load.tipping_factor * height)
                for _, distance in edges
            )
        ]
        if not rows:
            return
        inward = np.array([[normal.conjugate()] for normal, _ in edges])
        limits = column(row.bound for row in rows)
        index = self._index(center_of_gravity(vehicle))
        yield rows, partial(_tipping, inward, limits, self._has_rates, index)

    def _gains(self, limits: Limits) -> Iterator[tuple[list[Row], Term]]:
        """Yield acceleration and deceleration of K."""
        asked = [
            (Row(name, -1, limit, "m/s²", "acceleration"), side)
            for name, limit, side in (
                ("ACCELERATION", limits.max_acceleration, 1),
                ("DECELERATION", limits.max_deceleration, -1),
            )
            if limit is not None
        ]
        if not asked:
            return
        bounds = column(row.bound for row, _ in asked)
        sides = [side for _, side in asked]
        yield [row for row, _ in asked], partial(_gains, sides, bounds)

    def _index(self, point: complex) -> int:
        """Return where a point is among `points`."""
        if point not in self.points:
            self.points.append(point)
        return self.points.index(point)


def _shares(look: Look, chords: Chord, _: Change) -> list[Bounds]:
    part = look.part
    return [(np.maximum(part.scale0, part.scale1), part.scale_high)]


def _speed(limit: float, look: Look, chords: Chord, _: Change) -> list[Bounds]:
    return [over(scaled(look.part, look.body), limit)]


def _yaw_rate(limit: float, look: Look, chords: Chord, _: Change) -> list[Bounds]:
    return [over(scaled(look.part, yaw_of(look.part)), limit)]


def _lateral(
    limit: float, index: int, look: Look, chords: Chord, changes: Change
) -> list[Bounds]:
    part, v, change = look.part, chords.rows(index), changes.rows(index)
    yaw, gain = yaw_of(part), yaw_change(part)
    at_ends = np.maximum(
        np.abs(v.a * yaw.a) * part.scale0**2, np.abs(v.b * yaw.b) * part.scale1**2
    )
    # |ω v|: d/dt (ω v) = ω̇ v + ω v̇, and so on
    slope = gain.far * v.far + yaw.far * change.far
    bend = gain.bend * v.far + 2 * gain.far * change.far + yaw.far * change.bend
    bent = at_ends + excess(part, slope, bend)
    product = v.far * yaw.far * part.scale_high**2
    high = np.where(is_plain(part), np.minimum(bent, product), product)
    return [over((at_ends, high), limit)]


def _tipping(
    inward: ComplexArray,
    limits: FloatArray,
    has_rates: bool,
    index: int,
    look: Look,
    chords: Chord,
    changes: Change,
) -> list[Bounds]:
    """Return the acceleration towards edges, whose normals are `inward`, conjugated."""
    part, v, change = look.part, chords.rows(index), changes.rows(index)
    yaw, gain = yaw_of(part), yaw_change(part)
    ends = [1j * yaw.a * v.a * part.scale0**2, 1j * yaw.b * v.b * part.scale1**2]
    # d/dt (j ω v) = j (ω̇ v + ω v̇)
    slope = gain.far * v.far + yaw.far * change.far
    bend = gain.bend * v.far + 2 * gain.far * change.far + yaw.far * change.bend
    if has_rates:
        ends = [ends[0] + change.a, ends[1] + change.b]
        slope, bend = slope + change.bend, bend + change.third
    more = excess(part, slope, bend)
    grow = np.maximum(part.scale_high, 1e-300) ** 2
    towards = [(a * inward).real for a in ends]
    low = np.maximum(np.maximum(*towards), 0.0)
    # With a varying factor on the twist: its largest on the largest size.
    high = np.where(is_plain(part), low + more, v.far * yaw.far * grow)
    return [over((low, high), limits)]


def _gains(
    sides: Sequence[int],
    limits: FloatArray,
    look: Look,
    chords: Chord,
    changes: Change,
) -> list[Bounds]:
    found = growths(look.part, look.body, changes.rows(0), sides)
    low, high = (np.stack(bounds) for bounds in zip(*found, strict=True))
    return [over((low, high), limits)]


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
