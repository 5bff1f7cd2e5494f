"""Steered wheels beside their axis, shared motors, and the guaranteed rates."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from configspace.limits import SectorRow
from configspace.vehicle import SteerableWheel
from omniplan.chords import Change, Chord, over
from omniplan.motion import Enclosure
from omniplan.rows import Bounds

__all__ = ["beside_axis", "zone_bounds"]

FloatArray = npt.NDArray[np.float64]


def beside_axis(
    wheel: SteerableWheel,
    part: Enclosure,
    chord: Chord,
    change: Change,
    own: FloatArray,
    rate: Bounds,
    is_own: bool,
) -> Iterator[Bounds]:
    """Yield the utilisation of the rolling speed where steering takes a share of it.

    ``û = u - (ω + α̇) D`` for every offset D, and ``|u| + k |α̇|`` for shared motors.
    Of a vehicle's own Omni-Curve-Parameters v_n is the share that driving takes, so
    what steering takes must fit into the rest.
    """
    limit = wheel.max_speed
    assert limit is not None
    levers = [abs(offset) for offset in wheel.offsets if offset]
    if wheel.steering_coupling:
        levers.append(wheel.steering_coupling)
    if is_own:
        for lever in levers:
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
    plain = (part.scale0 == 1) & (part.scale1 == 1) & (part.scale_high == 1)
    for offset in wheel.offsets:
        if offset:
            yield over(
                _offset_speed(offset, part, chord, own, turn, rate, plain), limit
            )
    if wheel.steering_coupling:
        k = wheel.steering_coupling
        sizes = np.abs(chord.a) * part.scale0, np.abs(chord.b) * part.scale1
        low = np.maximum(*(u + k * np.abs(t) for u, t in zip(sizes, turn, strict=True)))
        yield over((low, chord.far * part.scale_high + k * rate[1]), limit)


def _offset_speed(
    offset: float,
    part: Enclosure,
    chord: Chord,
    own: FloatArray,
    turn: list[FloatArray],
    rate: Bounds,
    plain: npt.NDArray[np.bool_],
) -> Bounds:
    """Return bounds on |û| of a wheel `offset` left of its axis.

    With u = σ |U|: ``|û| = ||U| - σ (ω + α̇) D|``.
    """
    omega = part.omega0 * part.scale0, part.omega1 * part.scale1
    low = np.maximum(
        *(
            np.abs(np.abs(u) * f - own * (w + t) * offset)
            for u, f, w, t in zip(
                (chord.a, chord.b), (part.scale0, part.scale1), omega, turn, strict=True
            )
        )
    )
    # What ω + α̇ may differ by from its ends.
    slack = part.dt**2 / 8 * part.omega_ddot
    slack = slack + rate[1] - np.maximum(*(np.abs(t) for t in turn))
    ends = [own * (w + t) * offset for w, t in zip(omega, turn, strict=True)]
    most = np.maximum(*ends) + slack * abs(offset)
    least = np.minimum(*ends) - slack * abs(offset)
    high = np.maximum(np.abs(chord.near - most), np.abs(chord.far - least))
    # Where the factor on the twist is not known from both sides: the sum of sizes.
    reach = np.maximum(np.abs(part.omega0), np.abs(part.omega1))
    reach = (reach + part.dt**2 / 8 * part.omega_ddot) * part.scale_high
    total = chord.far * part.scale_high + abs(offset) * (reach + rate[1])
    return low, np.where(plain, high, total)


def zone_bounds(
    part: Enclosure,
    row: SectorRow,
    kappa_g: float,
    reference: complex,
    chord: Chord,
) -> Bounds:
    """Return what the guaranteed rates ask for, over what the steering rate allows.

    As in `configspace.exact.turning_excess`, in units of the twist: the wheel's
    velocity is ``v_s (c e^{jβ} + s b)``.
    """
    body = Chord.of(part, reference)
    arm = abs(row.b)
    ends, speeds = [], []
    for v, omega, u in (
        (body.a, part.omega0, chord.a),
        (body.b, part.omega1, chord.b),
    ):
        v_s = np.maximum(np.maximum(np.abs(v), np.abs(omega) / kappa_g), 1e-300)
        c = np.abs(v) / v_s
        e = np.where(c > 0, v / np.maximum(np.abs(v), 1e-300), 1.0)
        z = u / v_s
        across = np.abs((e * np.conj(row.b)).imag)
        asked = row.kappa_share * across
        asked = asked + row.beta_share * np.abs((c * e * z.conj()).real)
        ends.append((asked, np.abs(z) ** 2))
        speeds.append(v_s)
    slower = 0.5 * np.maximum(*speeds) + 0.5 * np.minimum(*speeds)
    spread = part.dt**2 / 8 * (part.v_ddot + part.omega_ddot / kappa_g)
    # How far c, s, e and with them z may be from those at the nearer end.
    moved = np.abs(body.b - body.a) + np.abs(part.omega1 - part.omega0) / kappa_g
    moved = (moved + 2 * spread) / np.maximum(np.minimum(*speeds), 1e-300)
    with np.errstate(divide="ignore", invalid="ignore"):
        sweep = np.where(
            body.near > 0, (np.abs(body.b - body.a) + 2 * body.radius) / body.near, 2.0
        )
    sweep = np.minimum(sweep, math.pi)
    slack = row.kappa_share * arm * sweep
    slack = slack + row.beta_share * 2 * (2 + arm) * moved
    # Whatever the direction: |Im(e b̄)| ≤ |b| and |c (c + s f)| ≤ c (c + |b|).
    c_high = np.minimum(body.far / np.maximum(np.minimum(*speeds), 1e-300), 1.0)
    most = row.kappa_share * arm + row.beta_share * c_high * (c_high + arm)
    asked_high = np.minimum(np.maximum(ends[0][0], ends[1][0]) + slack, most)
    fastest = np.maximum(*speeds) + spread
    room = (chord.near / np.maximum(fastest, 1e-300)) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        low = np.maximum(
            *(
                np.where((q > 0) & (v > 0), a / q, 0.0)
                for (a, q), v in zip(ends, speeds, strict=True)
            )
        )
        high = np.where(room > 0, asked_high / room, np.inf)
    return np.where(slower > 0, low, 0.0), high
