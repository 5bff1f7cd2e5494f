"""Motions through the (κ_n, β, v_n) of one vehicle: straight pieces."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from configspace import Vehicle, exact_v_max
from configspace.angles import wrap
from configspace.limits import LoadRow, rows_of
from configspace.vehicle import SteerableWheel
from omniplan.judging.swing import (
    Directions,
    directions_of_legs,
)
from omniplan.motion.crossings import with_crossings
from omniplan.motion.enclosure import Enclosure, Intervals

__all__ = ["OmniCurveMotion"]

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

LEAST_LOAD = 1e-9
"""Speeds are not bounded by limits that are used less, per m/s."""


class OmniCurveMotion:
    """Straight pieces in (κ_n, β, v_n) of one vehicle.

    The twist enclosed is the direction (c e^{jβ}, s κ_g); the speed is a factor on it:
    |v_n| for the vehicle itself, ``|v_n| v_max`` for any other.

    Attributes `t` (n,), `samples` (n, 3) with those at the kinks, `kappa_g` and the
    point `reference` tell all of it but `owner`.
    """

    has_rates = False
    interpolation = "linear in κ_n, β and v_n of the trajectory's vehicle"

    def __init__(
        self,
        t: FloatArray,
        samples: FloatArray,
        kappa_g: float,
        reference: complex,
        owner: Vehicle | None = None,
    ) -> None:
        """Take the samples as those of `owner`, or of the vehicle that is judged."""
        # c and s have a kink at |κ_n| = 1, v_s changes sign with v_n.
        for column, levels in ((0, (-1.0, 1.0)), (2, (0.0,))):
            for level in levels:
                t, samples = with_crossings(t, samples, column, level)
        self.t, self.samples = t, samples
        self.kappa_g, self.reference, self._owner = kappa_g, reference, owner
        self.is_own = owner is None

    def intervals(self) -> Intervals:
        """Return the intervals between the samples and the kinks."""
        return Intervals(np.arange(len(self.t) - 1), self.t[:-1], self.t[1:])

    def enclose(self, parts: Intervals) -> Enclosure:
        """Return an enclosure of every part."""
        k = parts.knot
        span = self.t[k + 1] - self.t[k]
        rate = (self.samples[k + 1] - self.samples[k]) / span[:, None]
        at0, at1 = (
            self.samples[k] + (t - self.t[k])[:, None] * rate
            for t in (parts.t0, parts.t1)
        )
        middle = (self.samples[k, 0] + self.samples[k + 1, 0]) / 2
        gentle = np.abs(middle) < 1
        side = np.where(middle < 0, -1.0, 1.0)
        c_dot = np.where(gentle, 0.0, -side * rate[:, 0])
        s_dot = np.where(gentle, rate[:, 0], 0.0)
        factor = np.where(self.samples[k, 2] + self.samples[k + 1, 2] < 0, -1.0, 1.0)
        kappa_g, offset = self.kappa_g, self.reference
        ends = []
        for at in (at0, at1):
            c = np.where(gentle, 1.0, 2 - np.abs(at[:, 0]))
            s = np.where(gentle, at[:, 0], side)
            omega = factor * s * kappa_g
            omega_dot = factor * s_dot * kappa_g
            e = factor * np.exp(1j * at[:, 1])
            v_dot = (c_dot + 1j * rate[:, 1] * c) * e - 1j * omega_dot * offset
            ends.append((c, c * e - 1j * omega * offset, omega, v_dot, omega_dot))
        (c0, v0, o0, vd0, od0), (c1, v1, o1, vd1, od1) = ends
        turn, most = np.abs(rate[:, 1]), np.maximum(c0, c1)
        v_ddot = 2 * np.abs(c_dot) * turn + most * turn**2
        v_dddot = 3 * np.abs(c_dot) * turn**2 + most * turn**3
        share = np.abs(at0[:, 2]), np.abs(at1[:, 2])
        dt = parts.t1 - parts.t0
        zero = np.zeros_like(dt)
        if self._owner is None:
            scale = (*share, np.maximum(*share))
        else:
            radius = dt**2 / 8 * v_ddot
            ends_ = (v0, v1, o0, o1)
            scale = _speeds(self._owner, (at0, at1), share, factor, ends_, radius)
        bends = v_ddot, zero, v_dddot, zero
        return Enclosure(dt, v0, v1, o0, o1, vd0, vd1, od0, od1, *bends, *scale, factor)

    def directions(self, parts: Intervals) -> Directions:
        """Return how directions swing along the parts, whatever v_n is."""
        k = parts.knot
        rate = np.diff(self.samples, axis=0)[k] / np.diff(self.t)[k][:, None]
        since = np.stack([parts.t0, parts.t1]) - self.t[k]
        kappa_n, beta = (self.samples[k, i] + since * rate[:, i] for i in (0, 1))
        middle = (self.samples[k, 0] + self.samples[k + 1, 0]) / 2
        gentle, side = np.abs(middle) < 1, np.where(middle < 0, -1.0, 1.0)
        return directions_of_legs(
            parts.t1 - parts.t0,
            np.where(gentle, 1.0, 2 - np.abs(kappa_n)),
            np.where(gentle, kappa_n, side),
            beta,
            (
                np.where(gentle, 0.0, -side * rate[:, 0]),
                np.where(gentle, rate[:, 0], 0.0),
                rate[:, 1],
            ),
            self.kappa_g,
            self.reference,
        )


def _speeds(
    owner: Vehicle,
    at: tuple[FloatArray, FloatArray],
    share: tuple[FloatArray, FloatArray],
    factor: FloatArray,
    ends: tuple[ComplexArray, ComplexArray, FloatArray, FloatArray],
    radius: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return |v_s| at both ends and a bound over the parts.

    v_max is at most 1/ρ of any one limit, and |v_n| is linear over a part. So where ρ
    exceeds something linear the quotient is largest at an end.
    """
    v0, v1, o0, o1 = ends
    forward = factor > 0
    exact = [
        np.where(
            forward,
            exact_v_max(owner, end[:, 0], end[:, 1]),
            exact_v_max(owner, end[:, 0], end[:, 1], reverse=True),
        )
        for end in at
    ]
    kappa_g, offset = owner.boundary_curvature, owner.reference
    s = factor * np.stack([o0, o1]) / kappa_g
    v: ComplexArray = np.stack([v0, v1]) + 1j * np.stack([o0, o1]) * offset
    v = v * factor
    shares = np.stack(share)
    high = shares.max(axis=0) / LEAST_LOAD
    for row in rows_of(owner)[0]:
        holds = (row.direction == "both") | ~forward
        for quotient in _quotients(row, shares, v, s, radius):
            high = np.where(holds, np.minimum(high, quotient), high)
    high = np.where(_is_out(owner, factor, ends, radius), 0.0, high)
    return share[0] * exact[0], share[1] * exact[1], high


def _quotients(
    row: LoadRow, share: FloatArray, v: ComplexArray, s: FloatArray, radius: FloatArray
) -> Iterator[FloatArray]:
    """Yield bounds on |v_n|/ρ of one limit over parts, infinite where not known.

    Parameters
    ----------
    row : LoadRow
    share : (2, m) float
        |v_n| at both ends.
    v, s : (2, m)
        c e^{jβ} and s at both ends.
    radius : (m,) float
        How far c e^{jβ} may be from its chord.
    """

    def largest(least: FloatArray) -> FloatArray:
        known = (least > LEAST_LOAD).all(axis=0)
        least = np.where(known, least, 1.0)
        return np.where(known, (share / least).max(axis=0), np.inf)

    p = 1.0 if row.kind in {"lateral", "edge"} else row.p
    z, r = p * v + s * row.b, p * radius
    if row.kind in {"strip", "edge"}:
        along = (z * np.exp(-1j * row.nu)).real
    else:  # towards the middle of the chord
        middle = z.sum(axis=0)
        size = np.abs(middle)
        along = (z * (middle / np.where(size > 0, size, 1.0)).conj()).real
    match row.kind:
        case "disc":
            yield largest(along - r)
        case "strip":
            yield largest(np.sign(along.sum(axis=0)) * along - r)
        case "offset":
            yield largest(along - r - s * row.d)
            yield largest(s * row.d - np.abs(z) - r)
        case _:  # the square of v_s is limited
            side = np.sign(s.sum(axis=0))
            along = side * along if row.kind == "edge" else along
            a, b = largest(side * s), largest(along - r)
            known = np.isfinite(a) & np.isfinite(b)
            square = np.where(known, a, 0.0) * np.where(known, b, 0.0)
            yield np.where(known, np.sqrt(square / row.p), np.inf)


def _is_out(
    owner: Vehicle,
    factor: FloatArray,
    ends: tuple[ComplexArray, ComplexArray, FloatArray, FloatArray],
    radius: FloatArray,
) -> npt.NDArray[np.bool_]:
    """Return where a wheel of the owner is out of its range all over a part.

    There v_max is 0: the owner stands, and so does whoever is to do the same.
    """
    v0, v1, o0, o1 = ends
    out = np.zeros(radius.shape, dtype=bool)
    for wheel, contact in zip(owner.wheels, owner.contacts, strict=True):
        if not isinstance(wheel, SteerableWheel) or wheel.steering_range_deg is None:
            continue
        least, largest = wheel.steering_range
        half = (largest - least) / 2
        a, b = (factor * (v + 1j * o * contact) for v, o in ((v0, o0), (v1, o1)))
        near = np.maximum(np.abs(a), np.abs(b)) - np.abs(b - a) - radius
        start = wrap(np.angle(a) - (least + largest) / 2)
        end = start + np.angle(b * a.conj())
        sizes = np.abs(start), np.abs(end)
        aside = np.minimum(np.minimum(*sizes), 2 * np.pi - np.maximum(*sizes))
        aside = np.where(start * end > 0, aside, 0.0)
        spread = np.arcsin(np.clip(radius / np.maximum(near, 1e-300), 0.0, 1.0))
        out |= (near > 0) & (aside - spread > half)
    return out
