"""Steered wheels beside their axis, shared motors, and the guaranteed rates."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from configspace.limits import SectorRow
from configspace.omni_curve import POLE
from omniplan.judging.chords import Change, Chord, excess, growth_excess, over
from omniplan.judging.points import Points, column
from omniplan.judging.rows import Bounds
from omniplan.motion import Enclosure

__all__ = [
    "Levers",
    "Zone",
    "beside_axis",
    "beside_gains",
    "beside_own",
    "zone_bounds",
]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Levers:
    """What steering costs n wheels on their axes of the same kind."""

    offsets: tuple[FloatArray | None, ...]
    """(n, 1) D of every wheel on an axis, > 0: left of it, m; None: on the axis."""
    coupling: FloatArray | None
    """(n, 1) metres of rolling that a radian costs shared motors, m; None: nothing."""

    @property
    def is_nothing(self) -> bool:
        """Whether steering costs nothing."""
        return self.coupling is None and all(d is None for d in self.offsets)


def beside_own(
    levers: Levers, limit: FloatArray, part: Enclosure, rate: Bounds
) -> Iterator[Bounds]:
    """Yield the utilisation of the rolling speed of the vehicle's own parameters.

    v_n is the share that driving takes, so what steering takes must fit into the rest.
    """
    for offset in levers.offsets:
        lever = _length(offset, levers.coupling)
        if lever is None:
            continue
        share = [r * lever / limit for r in rate]
        low = np.maximum(part.scale0, part.scale1)
        yield np.where(share[0] > 0, low, 0.0), part.scale_high + share[1]


def _length(
    offset: FloatArray | None, coupling: FloatArray | None
) -> FloatArray | None:
    """Return how much a wheel rolls per radian that it steers, m; None: not at all."""
    if offset is None:
        return coupling
    return np.abs(offset) if coupling is None else np.abs(offset) + coupling


def beside_axis(
    levers: Levers,
    limit: FloatArray,
    part: Enclosure,
    chord: Chord,
    change: Change,
    owns: Sequence[FloatArray],
    rate: Bounds,
    moving: tuple[FloatArray, FloatArray],
) -> Iterator[list[Bounds]]:
    """Yield the utilisation of the rolling speed where steering takes a share of it.

    ``|û| + k |α̇|`` with ``û = u - (ω + α̇) D`` for every offset D, k for shared motors;
    one for every sign of v_s in `owns`, or one for all. `moving` is 0 at ends where the
    vehicle stands: how a wheel seems to turn there may be rounding.
    """
    coupling = levers.coupling
    turn = [
        np.where(near > 1e-12, (d * u.conj()).imag / np.maximum(near, 1e-12) ** 2, 0.0)
        for u, d, near in zip(
            (chord.a, chord.b), (change.a, change.b), chord.sizes, strict=True
        )
    ]
    for offset in levers.offsets:
        if offset is not None:
            speeds = _offset_speeds(
                (offset, coupling), part, chord, change, owns, turn, rate, moving
            )
            yield [over(speed, limit) for speed in speeds]
        elif coupling is not None:
            sizes = chord.sizes[0] * part.scale0, chord.sizes[1] * part.scale1
            given = (
                np.where(v > 0, u + coupling * np.abs(t), 0.0)
                for v, u, t in zip(moving, sizes, turn, strict=True)
            )
            most = chord.far * part.scale_high + coupling * rate[1]
            yield [over((np.maximum(*given), most), limit)]


def _offset_speeds(
    levers: tuple[FloatArray, FloatArray | None],
    part: Enclosure,
    chord: Chord,
    change: Change,
    owns: Sequence[FloatArray],
    turn: list[FloatArray],
    rate: Bounds,
    moving: tuple[FloatArray, FloatArray],
) -> Iterator[Bounds]:
    """Yield bounds on |û| + k |α̇| of a wheel D left of its axis; `levers` D and k.

    With u = σ |U|: ``|û| = ||U| - σ (ω + α̇) D|``.
    """
    offset, coupling = levers
    omega = part.omega0 * part.scale0, part.omega1 * part.scale1
    slack = _turning_excess(part, chord, change)
    # Where the factor on the twist is not known from both sides: the sum of sizes.
    reach = np.maximum(np.abs(part.omega0), np.abs(part.omega1))
    reach = (reach + part.dt**2 / 8 * part.omega_ddot) * part.scale_high
    total = chord.far * part.scale_high + np.abs(offset) * (reach + rate[1])
    plain = (part.scale0 == 1) & (part.scale1 == 1) & (part.scale_high == 1)
    for own in owns:
        rolled = (
            np.abs(u * f - own * (w + t) * offset)
            for u, f, w, t in zip(
                chord.sizes, (part.scale0, part.scale1), omega, turn, strict=True
            )
        )
        if coupling is not None:
            rolled = (
                u + coupling * np.abs(t) for u, t in zip(rolled, turn, strict=True)
            )
        low = np.maximum(
            *(np.where(v > 0, u, 0.0) for v, u in zip(moving, rolled, strict=True))
        )
        ends = [own * (w + t) * offset for w, t in zip(omega, turn, strict=True)]
        most = np.maximum(*ends) + slack * np.abs(offset)
        least = np.minimum(*ends) - slack * np.abs(offset)
        high = np.maximum(np.abs(chord.near - most), np.abs(chord.far - least))
        high = np.where(plain, high, total)
        yield low, high if coupling is None else high + coupling * rate[1]


def _turning_excess(part: Enclosure, chord: Chord, change: Change) -> FloatArray:
    """Return what ω + α̇ may exceed its values at both ends by.

    Both together: one may rise while the other falls. See `swing` for α̈ and α⃛.
    """
    yaw_gain = np.maximum(np.abs(part.omega_dot0), np.abs(part.omega_dot1))
    yaw_gain = yaw_gain + excess(part, part.omega_ddot, part.omega_dddot)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        l_1, l_2, l_3 = (
            x / chord.near for x in (change.far, change.bend, change.third)
        )
        slope = yaw_gain + l_2 + l_1**2
        bend = part.omega_ddot + l_3 + 3 * l_1 * l_2 + 2 * l_1**3
        return np.where(chord.near > 0, excess(part, slope, bend), np.inf)


def beside_gains(
    levers: Levers,
    part: Enclosure,
    chord: Chord,
    change: Change,
    swing: Bounds,
    owns: Sequence[FloatArray],
    rolls: tuple[BoolArray, BoolArray],
) -> Iterator[list[Bounds]]:
    """Yield bounds on how fast the rolling speed of wheels beside an axis changes.

    ``|dû/dt| + k |α̈|``, with ``dû/dt = σ d|U|/dt - (ω̇ + α̈) D``; k for shared motors.

    Parameters
    ----------
    levers : Levers
    part : Enclosure
    chord : Chord
        Of the axes.
    change : Change
        Of the axes.
    swing : (2, n, m) and (n, m) float
        Their steering accelerations at the ends and never exceeded.
    owns : sequence of (m,) float
        Signs of v_s, σ.
    rolls : two (n, m) bool
        Whether the wheel's axis moves at an end.
    """
    swung, most = swing
    swing_excess = most - np.abs(swung).max(axis=0)
    speeding = [
        (d * u.conj()).real / np.maximum(near, 1e-300)
        for u, d, near in zip(
            (chord.a, chord.b), (change.a, change.b), chord.sizes, strict=True
        )
    ]
    turned = np.maximum(np.abs(part.omega_dot0), np.abs(part.omega_dot1))
    turned_excess = excess(part, part.omega_ddot, part.omega_dddot)
    grown = growth_excess(part, chord, change)
    gains = part.omega_dot0, part.omega_dot1
    zero = np.zeros((len(most), 1))
    coupling = zero if levers.coupling is None else levers.coupling
    for each in levers.offsets:
        offset = zero if each is None else each
        lever, arm = np.abs(offset) + coupling, np.abs(offset)
        fine = grown + arm * turned_excess
        coarse = change.far + arm * (turned + turned_excess) + lever * most
        found = []
        for own in owns:
            ends = [
                np.abs(faster - own * (gain + bent) * offset) + coupling * np.abs(bent)
                for faster, gain, bent in zip(speeding, gains, swung, strict=True)
            ]
            low = np.maximum(
                *(np.where(does, n, 0.0) for does, n in zip(rolls, ends, strict=True))
            )
            # Where the wheel may stand there is no bound on its growth.
            high = np.maximum(*ends) + fine + lever * swing_excess
            found.append((low, np.minimum(high, coarse)))
        yield found


@dataclass(frozen=True, eq=False)
class Zone:
    """What guaranteed rates ask of n wheels, (n, 1) each; see `SectorRow`."""

    b: npt.NDArray[np.complex128]
    arm: FloatArray
    """|b|."""
    kappa_share: FloatArray
    beta_share: FloatArray
    pole_arm: FloatArray
    is_on_line: bool

    @classmethod
    def of(cls, rows: Sequence[SectorRow]) -> Zone:
        """Return what sectors ask; all or none of a line-mobile vehicle."""
        b = Points.of([row.b for row in rows])
        return cls(
            b.at,
            b.reach,
            column(row.kappa_share for row in rows),
            column(row.beta_share for row in rows),
            column(row.pole_arm for row in rows),
            rows[0].line is not None,
        )


def zone_bounds(
    part: Enclosure,
    row: Zone,
    kappa_g: float,
    body: Chord,
    chord: Chord,
    moving: tuple[FloatArray, FloatArray],
) -> Bounds:
    """Return what the guaranteed rates ask for, over what the steering rate allows.

    As in `configspace.exact.turning_excess`, in units of the twist: the wheel's
    velocity is ``v_s (c e^{jβ} + s b)``. At a pole the worst β counts, whatever
    direction the motion takes through it. `moving` is 0 at ends where it stands.
    """
    arm = row.arm
    ends = [
        _asked(row, kappa_g, v, omega, u)
        for v, omega, u in (
            (body.a, part.omega0, chord.a),
            (body.b, part.omega1, chord.b),
        )
    ]
    slowest = np.minimum(ends[0].v_s, ends[1].v_s)
    fastest = np.maximum(ends[0].v_s, ends[1].v_s)
    # How far (c e^{jβ}, s) may be from that at the ends: the chord itself turns it
    # monotonously, from end to end; the rest is what the motion leaves the chord by.
    spread = part.dt**2 / 8 * (part.v_ddot + part.omega_ddot / kappa_g)
    spread = 2 * spread / np.maximum(slowest, 1e-300)
    moved = 2 * np.abs(ends[1].share - ends[0].share)
    moved = moved + 2 * np.abs(ends[1].s - ends[0].s) + spread
    sweep = np.abs(np.angle(body.b * body.a.conj())) + body.spread()
    # Where a pole may be within the part, any β.
    apart = body.near > POLE * fastest * (1 + spread)
    sweep = np.where(apart, sweep, math.pi)
    slack = row.kappa_share * arm * sweep
    slack = slack + row.beta_share * 2 * (2 + arm) * moved
    # Whatever the direction: |Im(e b̄)| is at most that at a pole, and
    # |c (c + s f)| ≤ c (c + |b|).
    c = np.minimum(np.maximum(np.abs(ends[0].share), np.abs(ends[1].share)) + moved, 1)
    most = row.kappa_share * row.pole_arm + row.beta_share * c * (c + arm)
    asked = np.maximum(ends[0].asked, ends[1].asked)
    asked_high = np.minimum(asked + slack, most)
    # |z|² = |U|² / v_s², at its least between the ends or by what may have moved.
    nearest = np.minimum(ends[0].room, ends[1].room) - (1 + arm) * moved
    room = np.maximum(nearest, chord.near / np.maximum(fastest * (1 + spread), 1e-300))
    with np.errstate(divide="ignore", invalid="ignore"):
        low = np.maximum(
            # At an end at rest the direction may be rounding.
            *(
                np.where((v > 0) & (end.room > 0), end.asked / end.room**2, 0.0)
                for v, end in zip(moving, ends, strict=True)
            )
        )
        high = np.where(room > 0, asked_high / room**2, np.inf)
    return low, np.maximum(high, low)


@dataclass(frozen=True)
class _End:
    """What the guaranteed rates ask for at one end of a part."""

    v_s: FloatArray
    share: npt.NDArray[np.complex128]
    """``c e^{jβ}``."""
    s: FloatArray
    asked: FloatArray
    room: FloatArray
    """|z|."""


def _asked(
    row: Zone,
    kappa_g: float,
    v: npt.NDArray[np.complex128],
    omega: FloatArray,
    u: npt.NDArray[np.complex128],
) -> _End:
    v_s = np.maximum(np.maximum(np.abs(v), np.abs(omega) / kappa_g), 1e-300)
    share, z = v / v_s, u / v_s
    e = np.where(np.abs(share) > 0, share / np.maximum(np.abs(share), 1e-300), 1.0)
    across = np.abs((e * np.conj(row.b)).imag)
    if row.is_on_line:  # what stands off the line is slip
        across = np.full_like(across, row.pole_arm)
    asked = row.kappa_share * np.where(np.abs(share) > POLE, across, row.pole_arm)
    asked = asked + row.beta_share * np.abs((share * z.conj()).real)
    return _End(v_s, share, omega / kappa_g / v_s, asked, np.abs(z))
