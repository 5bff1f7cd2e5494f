"""Steered wheels beside their axis, shared motors, and the guaranteed rates."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from configspace.limits import SectorRow
from configspace.omni_curve import POLE
from configspace.vehicle import SteerableWheel
from omniplan.judging.chords import Change, Chord, excess, growth_excess, over
from omniplan.judging.rows import Bounds
from omniplan.motion import Enclosure

__all__ = ["beside_axis", "beside_gain", "zone_bounds"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


def beside_axis(
    wheel: SteerableWheel,
    part: Enclosure,
    chord: Chord,
    change: Change,
    own: FloatArray,
    rate: Bounds,
    moving: tuple[FloatArray, FloatArray],
    is_own: bool,
) -> Iterator[Bounds]:
    """Yield the utilisation of the rolling speed where steering takes a share of it.

    ``|û| + k |α̇|`` with ``û = u - (ω + α̇) D`` for every offset D, k for shared motors.
    Of a vehicle's own Omni-Curve-Parameters v_n is the share that driving takes, so
    what steering takes must fit into the rest. `moving` is 0 at ends where the vehicle
    stands: how a wheel seems to turn there may be rounding.
    """
    limit = wheel.max_speed
    assert limit is not None
    coupling = wheel.steering_coupling
    if is_own:
        for lever in (abs(offset) + coupling for offset in wheel.offsets):
            if lever == 0:
                continue
            share = [r * lever / limit for r in rate]
            low = np.maximum(part.scale0, part.scale1)
            yield np.where(share[0] > 0, low, 0.0), part.scale_high + share[1]
        return
    turn = [
        np.where(near > 1e-12, (d * u.conj()).imag / np.maximum(near, 1e-12) ** 2, 0.0)
        for u, d, near in (
            (chord.a, change.a, np.abs(chord.a)),
            (chord.b, change.b, np.abs(chord.b)),
        )
    ]
    for offset in wheel.offsets:
        if offset:
            levers = offset, coupling
            yield over(
                _offset_speed(levers, part, chord, change, own, turn, rate, moving),
                limit,
            )
        elif coupling:
            sizes = np.abs(chord.a) * part.scale0, np.abs(chord.b) * part.scale1
            given = (
                np.where(v > 0, u + coupling * np.abs(t), 0.0)
                for v, u, t in zip(moving, sizes, turn, strict=True)
            )
            most = chord.far * part.scale_high + coupling * rate[1]
            yield over((np.maximum(*given), most), limit)


def _offset_speed(
    levers: tuple[float, float],
    part: Enclosure,
    chord: Chord,
    change: Change,
    own: FloatArray,
    turn: list[FloatArray],
    rate: Bounds,
    moving: tuple[FloatArray, FloatArray],
) -> Bounds:
    """Return bounds on |û| + k |α̇| of a wheel D left of its axis; `levers` D and k.

    With u = σ |U|: ``|û| = ||U| - σ (ω + α̇) D|``.
    """
    offset, coupling = levers
    omega = part.omega0 * part.scale0, part.omega1 * part.scale1
    low = np.maximum(
        *(
            np.where(
                v > 0,
                np.abs(np.abs(u) * f - own * (w + t) * offset) + coupling * np.abs(t),
                0.0,
            )
            for v, u, f, w, t in zip(
                moving,
                (chord.a, chord.b),
                (part.scale0, part.scale1),
                omega,
                turn,
                strict=True,
            )
        )
    )
    slack = _turning_excess(part, chord, change)
    ends = [own * (w + t) * offset for w, t in zip(omega, turn, strict=True)]
    most = np.maximum(*ends) + slack * abs(offset)
    least = np.minimum(*ends) - slack * abs(offset)
    high = np.maximum(np.abs(chord.near - most), np.abs(chord.far - least))
    # Where the factor on the twist is not known from both sides: the sum of sizes.
    reach = np.maximum(np.abs(part.omega0), np.abs(part.omega1))
    reach = (reach + part.dt**2 / 8 * part.omega_ddot) * part.scale_high
    total = chord.far * part.scale_high + abs(offset) * (reach + rate[1])
    plain = (part.scale0 == 1) & (part.scale1 == 1) & (part.scale_high == 1)
    # Without shared motors not 0 times a rate that may be infinite.
    shared = coupling * rate[1] if coupling else 0.0
    return low, np.where(plain, high, total) + shared


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


def beside_gain(
    wheel: SteerableWheel,
    offset: float,
    part: Enclosure,
    point: complex,
    own: FloatArray,
    rolls: tuple[BoolArray, BoolArray],
) -> Bounds:
    """Return bounds on how fast the rolling speed of a wheel beside its axis changes.

    ``|dû/dt| + k |α̈|``, with ``dû/dt = σ d|U|/dt - (ω̇ + α̈) D``; k for shared motors.

    Parameters
    ----------
    wheel : SteerableWheel
    offset : float, m
        D, > 0: left of its axis.
    part : Enclosure
        With `Enclosure.swing`.
    point : complex, m
        The wheel's axis in the frame of the vehicle's file.
    own : (m,) float
        Sign of v_s, σ.
    rolls : two (m,) bool
        Whether the wheel's axis moves at an end.
    """
    assert part.swing is not None
    chord, change = Chord.of(part, point), Change.of(part, point)
    swung, most = part.swing.directions.accelerations(point)
    swing_excess = most - np.abs(swung).max(axis=0)
    ends, counted = [], []
    for u, d, gain, bent, does_roll in zip(
        (chord.a, chord.b),
        (change.a, change.b),
        (part.omega_dot0, part.omega_dot1),
        swung,
        rolls,
        strict=True,
    ):
        speeding = (d * u.conj()).real / np.maximum(np.abs(u), 1e-300)
        rolled = np.abs(speeding - own * (gain + bent) * offset)
        ends.append(rolled + wheel.steering_coupling * np.abs(bent))
        counted.append(np.where(does_roll, ends[-1], 0.0))
    low = np.maximum(*counted)
    lever = abs(offset) + wheel.steering_coupling
    turned = np.maximum(np.abs(part.omega_dot0), np.abs(part.omega_dot1))
    turned_excess = excess(part, part.omega_ddot, part.omega_dddot)
    fine = growth_excess(part, chord, change) + abs(offset) * turned_excess
    # Where the wheel may stand there is no bound on its growth.
    fine = np.maximum(*ends) + fine + lever * swing_excess
    coarse = change.far + abs(offset) * (turned + turned_excess) + lever * most
    return low, np.minimum(fine, coarse)


def zone_bounds(
    part: Enclosure,
    row: SectorRow,
    kappa_g: float,
    reference: complex,
    chord: Chord,
    moving: tuple[FloatArray, FloatArray],
) -> Bounds:
    """Return what the guaranteed rates ask for, over what the steering rate allows.

    As in `configspace.exact.turning_excess`, in units of the twist: the wheel's
    velocity is ``v_s (c e^{jβ} + s b)``. At a pole the worst β counts, whatever
    direction the motion takes through it. `moving` is 0 at ends where it stands.
    """
    body = Chord.of(part, reference)
    arm = abs(row.b)
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
    row: SectorRow,
    kappa_g: float,
    v: npt.NDArray[np.complex128],
    omega: FloatArray,
    u: npt.NDArray[np.complex128],
) -> _End:
    v_s = np.maximum(np.maximum(np.abs(v), np.abs(omega) / kappa_g), 1e-300)
    share, z = v / v_s, u / v_s
    e = np.where(np.abs(share) > 0, share / np.maximum(np.abs(share), 1e-300), 1.0)
    across = np.abs((e * np.conj(row.b)).imag)
    if row.line is not None:  # what stands off the line is slip
        across = np.full_like(across, row.pole_arm)
    asked = row.kappa_share * np.where(np.abs(share) > POLE, across, row.pole_arm)
    asked = asked + row.beta_share * np.abs((share * z.conj()).real)
    return _End(v_s, share, omega / kappa_g / v_s, asked, np.abs(z))
