"""Velocity vectors over parts of a motion, and bounds on what is derived from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from configspace.angles import wrap
from configspace.exact import LINE_TOLERANCE
from omniplan.judging.points import Points
from omniplan.judging.rows import Bounds
from omniplan.motion import Enclosure

__all__ = [
    "Change",
    "Chord",
    "Component",
    "along",
    "changed",
    "ends_moving",
    "excess",
    "growth_excess",
    "growths",
    "off_line",
    "one_way",
    "over",
    "scaled",
    "size",
    "speed_of",
    "spot_spread",
    "turning",
]

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Chord:
    """A velocity vector over m parts, and what is derived from it more than once.

    Of n points at once every array is (n, m) instead of (m,).
    """

    a: ComplexArray
    b: ComplexArray
    radius: FloatArray
    near: FloatArray
    """At least this far from zero; 0 if zero cannot be excluded."""
    far: FloatArray
    """At most this far from zero."""

    @classmethod
    def of(cls, part: Enclosure, point: complex | Points) -> Chord:
        """Return the velocity of a point of the body, or of several."""
        at, reach = _placed(point)
        a = part.v0 + 1j * part.omega0 * at
        b = part.v1 + 1j * part.omega1 * at
        radius = part.dt**2 / 8 * (part.v_ddot + part.omega_ddot * reach)
        largest = np.maximum(np.abs(a), np.abs(b))
        # A segment that ends in zero must not seem to miss it by rounding.
        near = np.maximum(_distance(a, b) - radius - 1e-14 * largest, 0.0)
        return cls(a, b, radius, near, largest + radius)

    @cached_property
    def sizes(self) -> tuple[FloatArray, FloatArray]:
        """|U| at both ends."""
        return np.abs(self.a), np.abs(self.b)

    def rows(self, rows: slice | int) -> Chord:
        """Return those of some points, or of one."""
        ends, reach = (self.a[rows], self.b[rows]), (self.near[rows], self.far[rows])
        return Chord(*ends, self.radius[rows], *reach)

    def spread(self) -> FloatArray:
        """Return by how much a direction may stand off those of the segment, rad."""
        reach = np.where(self.near > 0, self.near + self.radius, np.inf)
        return np.asarray(np.arcsin(np.minimum(self.radius / reach, 1.0)))


def _placed(
    point: complex | Points,
) -> tuple[complex | ComplexArray, float | FloatArray]:
    """Return where points are and how far from the origin."""
    if isinstance(point, Points):
        return point.at, point.reach
    return point, abs(point)


def _distance(a: ComplexArray, b: ComplexArray) -> FloatArray:
    """Return the distance of the segments [a, b] from zero."""
    d = b - a
    length = np.abs(d) ** 2
    f = -(a * d.conj()).real / np.where(length > 0, length, 1.0)
    return np.asarray(np.abs(a + np.minimum(np.maximum(f, 0.0), 1.0) * d))


@dataclass(frozen=True, eq=False)
class Change:
    """First derivative of a velocity vector over m parts; (n, m) of n points."""

    a: ComplexArray
    b: ComplexArray
    bend: FloatArray
    """Bound on the second derivative."""
    third: FloatArray
    """Bound on the third derivative."""
    far: FloatArray
    """Bound on the first derivative."""

    @classmethod
    def of(cls, part: Enclosure, point: complex | Points) -> Change:
        """Return the derivative of the velocity of a point of the body, or several."""
        at, reach = _placed(point)
        a = part.v_dot0 + 1j * part.omega_dot0 * at
        b = part.v_dot1 + 1j * part.omega_dot1 * at
        bend = part.v_ddot + part.omega_ddot * reach
        third = part.v_dddot + part.omega_dddot * reach
        far = np.maximum(np.abs(a), np.abs(b)) + excess(part, bend, third)
        return cls(a, b, bend, third, far)

    def rows(self, rows: slice | int) -> Change:
        """Return those of some points, or of one."""
        ends, bounds = (self.a[rows], self.b[rows]), (self.bend[rows], self.third[rows])
        return Change(*ends, *bounds, self.far[rows])


def excess(part: Enclosure, slope: FloatArray, bend: FloatArray) -> FloatArray:
    """Return by how much a value may exceed those at both ends of a part.

    Parameters
    ----------
    part : Enclosure
    slope, bend : (m,) float
        Bounds on its first and on its second derivative.
    """
    return np.asarray(np.minimum(part.dt / 2 * slope, part.dt**2 / 8 * bend))


def speed_of(part: Enclosure, body: Chord, kappa_g: float) -> Bounds:
    """Return bounds on max(|v|, |ω|/κ_g), the |v_s| of the twist without its factor."""
    q0, q1 = np.abs(part.omega0) / kappa_g, np.abs(part.omega1) / kappa_g
    spread = part.dt**2 / 8 * part.omega_ddot / kappa_g
    crosses = part.omega0 * part.omega1 <= 0
    q_low = np.where(crosses, 0.0, np.maximum(np.minimum(q0, q1) - spread, 0.0))
    q_high = np.maximum(q0, q1) + spread
    return np.maximum(body.near, q_low), np.maximum(body.far, q_high)


def ends_moving(
    part: Enclosure, body: Chord, kappa_g: float, threshold: float
) -> tuple[FloatArray, FloatArray]:
    """Return |v_s| at both ends without its factor; 0 where the vehicle stands."""
    ends = []
    for v, omega, scale in (
        (body.a, part.omega0, part.scale0),
        (body.b, part.omega1, part.scale1),
    ):
        speed = np.maximum(np.abs(v), np.abs(omega) / kappa_g)
        ends.append(np.where(speed * scale > threshold, speed, 0.0))
    return ends[0], ends[1]


def off_line(body: Chord, own: FloatArray, line: float) -> Bounds:
    """Return how far β is from a line-mobile vehicle's constant, per what is rounding.

    For a vehicle's own Omni-Curve-Parameters, which carry no noise: β is linear
    between the ends of a part, so the ends tell of all of it. At a pole β has no
    meaning.
    """
    off = np.maximum(
        *(
            np.where(np.abs(v) > 1e-12, np.abs(wrap(np.angle(own * v) - line)), 0.0)
            for v in (body.a, body.b)
        )
    )
    return off / LINE_TOLERANCE, off / LINE_TOLERANCE


@dataclass(frozen=True, eq=False)
class Component:
    """The size of a component of a vector over m parts; (n, m) of n points."""

    first: FloatArray
    """At the start."""
    last: FloatArray
    """At the end."""
    far: FloatArray
    """Never exceeded."""

    @property
    def sizes(self) -> tuple[FloatArray, FloatArray]:
        """At both ends."""
        return self.first, self.last


def along(chord: Chord, turn: complex | Points) -> Component:
    """Return the component of a chord along ``conj(turn)``, scaled by its size.

    Parameters
    ----------
    chord : Chord
    turn : complex or Points
        One direction, or one for each point of the chord.
    """
    towards, factor = _placed(turn)
    first, last = (np.abs((u * towards).real) for u in (chord.a, chord.b))
    far = np.maximum(first, last) + chord.radius * factor
    return Component(first, last, far)


def changed(part: Enclosure, change: Change, turn: complex | Points) -> Component:
    """Return the derivative of a component; as `along`."""
    towards, factor = _placed(turn)
    first, last = (np.abs((u * towards).real) for u in (change.a, change.b))
    bend, third = change.bend * factor, change.third * factor
    far = np.maximum(first, last) + excess(part, bend, third)
    return Component(first, last, far)


def size(vector: Component) -> Bounds:
    """Return bounds on a length: taken at an end, never exceeded."""
    return np.maximum(vector.first, vector.last), vector.far


def scaled(part: Enclosure, vector: Chord | Component) -> Bounds:
    """Return the bounds of a speed with the factor on the twist."""
    first, last = vector.sizes
    low = np.maximum(first * part.scale0, last * part.scale1)
    return low, vector.far * part.scale_high


def over(value: Bounds, limit: float | FloatArray) -> Bounds:
    """Return the utilisation of a limit."""
    return value[0] / limit, value[1] / limit


def turning(
    part: Enclosure,
    chord: Chord,
    change: Change,
    rolls: tuple[BoolArray, BoolArray],
) -> Bounds:
    """Return bounds on |d arg U / dt| = |Im(U̇ Ū)| / |U|²; see `swing` for the bend."""
    ends = [
        np.abs((d * u.conj()).imag)
        for u, d in ((chord.a, change.a), (chord.b, change.b))
    ]
    at_ends = [
        n / np.maximum(u**2, 1e-300) for n, u in zip(ends, chord.sizes, strict=True)
    ]
    counted = (np.where(m, rate, 0.0) for m, rate in zip(rolls, at_ends, strict=True))
    low = np.maximum(*counted)
    # d/dt Im(U̇ Ū) = Im(Ü Ū)
    more = part.dt / 2 * change.bend * chord.far
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        steep = (np.maximum(*ends) + more) / chord.near**2
        l_1, l_2, l_3 = (
            x / chord.near for x in (change.far, change.bend, change.third)
        )
        swung = excess(part, l_2 + l_1**2, l_3 + 3 * l_1 * l_2 + 2 * l_1**3)
        bent = np.maximum(*at_ends) + swung
        high = np.where(chord.near > 0, np.fmin(steep, bent), np.inf)
    return low, high


def one_way(part: Enclosure, chord: Chord, change: Change) -> BoolArray:
    """Return whether the direction of U surely never turns back over a part.

    ``Im(U̇ Ū)`` keeps its sign if both ends together exceed what it may change by.
    """
    first, last = (
        (d * u.conj()).imag for u, d in ((chord.a, change.a), (chord.b, change.b))
    )
    may_change = part.dt * change.bend * chord.far
    return np.asarray((chord.near > 0) & (np.abs(first + last) >= may_change))


def spot_spread(body: Chord, chord: Chord) -> FloatArray:
    """Return by how much directions of U may differ near a turn on the spot, rad.

    With v of the reference k and ``U = v + jω (p - k)``: the sine of the angle between
    U and the line along ``j (p - k)`` is ``|v| / |U|`` at most, and ω keeps its sign as
    long as that is below 1. Two directions differ by twice that angle at most, and
    ``asin x ≤ π/2 x``.

    Parameters
    ----------
    body : Chord
        Of the reference, (m,) parts.
    chord : Chord
        Of one or n points.
    """
    is_clear = body.far < chord.near
    share = body.far / np.where(is_clear, chord.near, 1.0)
    return np.asarray(np.where(is_clear, np.pi * share, np.inf))


def growth_excess(part: Enclosure, chord: Chord, change: Change) -> FloatArray:
    """Return by how much d|U|/dt may exceed its values at both ends; see `growth`."""
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        l_1 = change.far / chord.near
        slope = change.bend + change.far * l_1
        bend = change.third + 6 * change.bend * l_1 + 3 * change.far * l_1**2
        return np.where(chord.near > 0, excess(part, slope, bend), np.inf)


def growths(
    part: Enclosure, chord: Chord, change: Change, sides: Sequence[int]
) -> list[Bounds]:
    """Return bounds on d|U|/dt; a side 1 only growth, -1 only decline, 0 both.

    With r = |U|: ``ṙ = Re(U̇ Ū)/r``, ``|r̈| ≤ |Ü| + |U̇|²/r`` and ``|r⃛| ≤ |U⃛| +
    6 |Ü| |U̇|/r + 3 |U̇|³/r²``.
    """
    ends = [(d * u.conj()).real for u, d in ((chord.a, change.a), (chord.b, change.b))]
    # d/dt Re(U̇ Ū) = Re(Ü Ū) + |U̇|²; and never more than |U̇|.
    more = part.dt / 2 * (change.bend * chord.far + change.far**2)
    bent = growth_excess(part, chord, change)
    return [_growth(part, chord, change, ends, more, bent, side) for side in sides]


def _growth(
    part: Enclosure,
    chord: Chord,
    change: Change,
    ends: list[FloatArray],
    more: FloatArray,
    bent: FloatArray,
    side: int,
) -> Bounds:
    sizes = chord.sizes
    weighed = [np.abs(n) if side == 0 else np.maximum(side * n, 0.0) for n in ends]
    reached = [n / np.maximum(s, 1e-300) for n, s in zip(weighed, sizes, strict=True)]
    low = np.maximum(*(r * (s > 1e-9) for r, s in zip(reached, sizes, strict=True)))
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        steep = (np.maximum(*weighed) + more) / chord.near
        bent = np.maximum(*reached) + bent
        steep = np.where(chord.near > 0, np.fmin(steep, bent), np.inf)
    high = np.minimum(steep, change.far)
    if side == 0:
        return low, high
    # Into rest |U| only declines, out of rest it only grows, while U̇ keeps its way.
    still = sizes[1 if side > 0 else 0] <= 1e-9
    pull = np.abs(change.b if side > 0 else change.a)
    lull = still & (pull > 2 * part.dt * change.bend)
    return low, np.where(lull, low, high)
