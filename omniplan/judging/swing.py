"""How fast directions swing: steering accelerations, with bounds between two times.

The direction of a velocity U is the imaginary part of log U, so with
``L_k = U^(k) / U``

    α̇ = Im L_1,   α̈ = Im (L_2 - L_1²)

and the two derivatives after that are at most

    |α⃛| ≤ l_3 + 3 l_1 l_2 + 2 l_1³
    |α⁗| ≤ l_4 + 4 l_1 l_3 + 3 l_2² + 12 l_1² l_2 + 6 l_1⁴

where l_k bounds |L_k|. Between two times a value thus exceeds those at the ends by no
more than ``Δt/2 max|α⃛|``, and by no more than ``Δt²/8 max|α⁗|``.

Where a motion comes to rest all of this would be 0 / 0. But there the twist is a real
factor, ``τ = t - t_rest``, times one that is not zero; it has the same directions and
is what is looked at. Shortly before and after, where the twist is nearly such a
product, it is divided by τ as well: its size then hardly changes, and L_1 tells of
directions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from omniplan.judging.points import Points

__all__ = [
    "Directions",
    "Pieces",
    "Swing",
    "directions_of_legs",
    "factored",
    "swinging",
]

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]
Number = TypeVar("Number", np.float64, np.complex128)

TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Directions:
    """Vectors along the twist over m parts, with derivatives.

    The twist is that of the origin of the vehicle file's frame, up to a real factor.
    """

    dt: FloatArray
    """(m,) s."""
    v: ComplexArray
    """(3, 2, m): order of the derivative, end of the part."""
    omega: FloatArray
    """(3, 2, m)."""
    v_most: FloatArray
    """(4, m): bounds on the sizes of the first to fourth derivative."""
    omega_most: FloatArray
    """(4, m)."""

    def _of(self, point: complex | Points) -> tuple[ComplexArray, FloatArray]:
        """Return the ends, and bounds on |L_1| to |L_4|; infinite if unknown.

        Of several points there is one more axis, before that of the parts.
        """
        if isinstance(point, Points):
            d = self.v[:, :, None] + 1j * self.omega[:, :, None] * point.at
            most = self.v_most[:, None] + self.omega_most[:, None] * point.reach
        else:
            d = self.v + 1j * self.omega * point
            most = self.v_most + self.omega_most * abs(point)
        # Where v and jωr cancel, near the centre of rotation, the ends tell more.
        at_ends, bent = np.abs(d).max(axis=1), self.dt**2 / 8
        for order in (2, 1):
            near_ends = at_ends[order] + bent * most[order + 1]
            most[order - 1] = np.minimum(most[order - 1], near_ends)
        start, end = d[0]
        chord = end - start
        length = np.abs(chord) ** 2
        f = -(start * chord.conj()).real / np.where(length > 0, length, 1.0)
        nearest = np.abs(start + np.minimum(np.maximum(f, 0.0), 1.0) * chord)
        largest = np.maximum(np.abs(start), np.abs(end))
        near = nearest - self.dt**2 / 8 * most[1] - 1e-14 * largest
        with np.errstate(over="ignore"):
            shares = np.where(near > 0, most / np.maximum(near, TINY), np.inf)
        return d, shares

    def rates(self, point: complex) -> tuple[FloatArray, FloatArray]:
        """Return α̇ of the direction of a point at both ends, (2, m), and a bound.

        Parameters
        ----------
        point : complex, m
            In the frame of the vehicle's file.
        """
        d, l_ = self._of(point)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            ends = (d[1] / d[0]).imag
            third = l_[2] + 3 * l_[0] * l_[1] + 2 * l_[0] ** 3
        ends = np.where(np.isfinite(ends), ends, 0.0)
        _, bend = self.accelerations(point)
        excess = self._least(bend, third)
        return ends, np.abs(ends).max(axis=0) + excess

    def accelerations(self, point: complex | Points) -> tuple[FloatArray, FloatArray]:
        """Return α̈ of the direction of a point at both ends, (2, m), and a bound.

        An end at which the point stands counts 0; the bound is infinite there.

        Parameters
        ----------
        point : complex or Points, m
            In the frame of the vehicle's file; of n points it is (2, n, m) and (n, m).
        """
        d, l_ = self._of(point)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            ends = (d[2] / d[0] - (d[1] / d[0]) ** 2).imag
            third = l_[2] + 3 * l_[0] * l_[1] + 2 * l_[0] ** 3
            fourth = l_[3] + 4 * l_[0] * l_[2] + 3 * l_[1] ** 2
            fourth = fourth + 12 * l_[0] ** 2 * l_[1] + 6 * l_[0] ** 4
        ends = np.where(np.isfinite(ends), ends, 0.0)
        excess = self._least(third, fourth)
        return ends, np.abs(ends).max(axis=0) + excess

    def _least(self, slope: FloatArray, bend: FloatArray) -> FloatArray:
        """Return by how much values may exceed those at the ends, by either bound.

        Infinite where one is not known, even if the part is a mere instant.
        """
        is_known = np.isfinite(slope) & np.isfinite(bend)
        slope, bend = np.where(is_known, slope, 0.0), np.where(is_known, bend, 0.0)
        excess = np.minimum(self.dt / 2 * slope, self.dt**2 / 8 * bend)
        return np.where(is_known, excess, np.inf)


@dataclass(frozen=True, eq=False)
class Pieces:
    """k cubic splines of position and heading, over a real factor."""

    speed: ComplexArray
    """(4, k): p' over the factor, coefficients of h², h, 1 and 1 / τ."""
    turn: FloatArray
    """(4, k): θ' over the same factor."""
    since: FloatArray
    """(k,) s: ``τ = since + h``; infinite where the last coefficients are 0."""
    heading: FloatArray
    """(4, k): θ."""
    point: complex
    """The described point in the frame of the vehicle's file, m."""


@dataclass(frozen=True, eq=False)
class Swing:
    """m parts of splines of position and heading; worked out when asked for."""

    dt: FloatArray
    """(m,) s."""
    h: FloatArray
    """(2, m) s: the ends, since the sample before."""
    knot: IntArray
    """(m,) the spline each part belongs to."""
    pieces: Callable[[], Pieces]
    """Gives the splines."""

    def rows(self, rows: slice | IntArray) -> Swing:
        """Return some of the parts."""
        return Swing(self.dt[rows], self.h[:, rows], self.knot[rows], self.pieces)

    def only(self, end: int) -> Swing:
        """Return the parts shrunk to one of their ends, 0 or 1."""
        h = np.stack([self.h[end], self.h[end]])
        return Swing(np.zeros_like(self.dt), h, self.knot, self.pieces)

    def merged(self, others: Swing, order: IntArray) -> Swing:
        """Return parts of both: these and then the others, in a new order.

        Parameters
        ----------
        others : Swing
            Of the same splines.
        order : (n,) int
            Indices into all of them.
        """
        return Swing(
            np.concatenate([self.dt, others.dt])[order],
            np.concatenate([self.h, others.h], axis=1)[:, order],
            np.concatenate([self.knot, others.knot])[order],
            self.pieces,
        )

    @cached_property
    def directions(self) -> Directions:
        """The twist over the factor, ``e^{-jθ} P - j Q r`` and ``Q``."""
        pieces, k = self.pieces(), self.knot
        h, dt, r, since = self.h, self.dt, pieces.point, pieces.since[k]
        p0, p1, p2, s3, s4 = _divided(pieces.speed[:, k], since, h)
        q0, q1, q2, o3, o4 = _divided(pieces.turn[:, k], since, h)
        a, b, c, d = pieces.heading[:, None, k]
        t0, t1 = ((a * h + b) * h + c) * h + d, (3 * a * h + 2 * b) * h + c
        t2, t3 = 6 * a * h + 2 * b, np.abs(6 * a[0])
        # d/dt e^{-jθ} = -jθ' e^{-jθ}, and so on
        v0 = p0
        v1 = p1 - 1j * t1 * p0
        v2 = p2 - 2j * t1 * p1 - (1j * t2 + t1**2) * p0
        v = np.exp(-1j * t0) * np.stack([v0, v1, v2])
        omega = np.stack([q0, q1, q2])
        # The sizes: θ'' is linear in time, P'' in 1 / τ³; their ends bound them.
        bent = dt**2 / 8
        s2, o2 = np.abs(p2).max(axis=0), np.abs(q2).max(axis=0)
        s1, o1 = np.abs(p1).max(axis=0) + bent * s3, np.abs(q1).max(axis=0) + bent * o3
        s0 = np.abs(p0).max(axis=0) + bent * s2
        w1 = np.abs(t1).max(axis=0) + bent * t3
        w2 = np.abs(t2).max(axis=0)
        # |dᵏ/dtᵏ e^{-jθ}|, with θ⁗ = 0
        e2, e3 = w2 + w1**2, t3 + 3 * w1 * w2 + w1**3
        e4 = 3 * w2**2 + 4 * w1 * t3 + 6 * w1**2 * w2 + w1**4
        omega_most = np.stack([o1, o2, o3, o4])
        v_most = np.stack(
            [
                s1 + w1 * s0,
                s2 + 2 * w1 * s1 + e2 * s0,
                s3 + 3 * w1 * s2 + 3 * e2 * s1 + e3 * s0,
                s4 + 4 * w1 * s3 + 6 * e2 * s2 + 4 * e3 * s1 + e4 * s0,
            ]
        )
        return Directions(
            dt, v - 1j * omega * r, omega, v_most + omega_most * abs(r), omega_most
        )


def _divided(
    coefficients: npt.NDArray[Number], since: FloatArray, h: FloatArray
) -> tuple[
    npt.NDArray[Number],
    npt.NDArray[Number],
    npt.NDArray[Number],
    FloatArray,
    FloatArray,
]:
    """Return value and two derivatives at both ends, (2, m) each, of what was divided.

    And bounds on the sizes of the third and the fourth derivative, (m,).
    """
    a, b, c, left = coefficients[:, None, :]
    tau = since + h
    pole = left / tau
    nearest, size = np.abs(tau).min(axis=0), np.abs(left[0])
    return (
        (a * h + b) * h + c + pole,
        2 * a * h + b - pole / tau,
        2 * a + 2 * pole / tau**2,
        6 * size / nearest**4,
        24 * size / nearest**5,
    )


def factored(
    cubic: npt.NDArray[Number],
    span: FloatArray,
    rest: BoolArray | None,
    since: FloatArray,
) -> npt.NDArray[Number]:
    """Return the derivatives of cubic pieces divided by the time since rest.

    Parameters
    ----------
    cubic : (4, m)
        Coefficients in the time since the start, highest power first.
    span : (m,) float, s
        Length of the pieces.
    rest : (2, m) bool or None
        Whether they start and whether they end at rest, where the derivative is zero.
    since : (m,) float, s
        Of pieces that neither start nor end at rest: how long after a rest they start,
        negative before it; infinite where they are to stay as they are.

    Returns
    -------
    divided : (4, m)
        As of `Pieces.speed`; the derivative is this times ``h``, ``h - span``, both, τ
        or 1.
    """
    a, b, c = 3 * cubic[0], 2 * cubic[1], cubic[2]
    zero = np.zeros_like(a)
    is_far = np.isinf(since)
    past = np.where(is_far, 0.0, since)
    # a h² + b h + c with h = τ - past
    left = a * past**2 - b * past + c
    whole = np.where(is_far, [a, b, c, zero], [zero, a, b - a * past, left])
    if rest is None:
        return whole
    start, end = rest
    after = np.stack([zero, a, b, zero])
    before = np.stack([zero, a, a * span + b, zero])
    both = np.stack([zero, zero, a, zero])
    return np.where(
        start & end, both, np.where(start, after, np.where(end, before, whole))
    )


def directions_of_legs(
    dt: FloatArray,
    c: FloatArray,
    s: FloatArray,
    beta: FloatArray,
    rates: tuple[FloatArray, FloatArray, FloatArray],
    kappa_g: float,
    reference: complex,
) -> Directions:
    """Return the directions along straight legs in (κ_n, β), which no kink cuts.

    Parameters
    ----------
    dt : (m,) float, s
    c, s : (2, m) float
        Affine components at both ends (spec/omni-curve §1).
    beta : (2, m) float, rad
    rates : three (m,) float, 1/s
        ċ, ṡ and β̇.
    kappa_g : float, 1/m
    reference : complex, m
        K in the frame of the vehicle's file.
    """
    c1, s1, b1 = rates
    e, b = np.exp(1j * beta), np.abs(b1)
    omega = kappa_g * np.stack([s, np.broadcast_to(s1, s.shape), np.zeros_like(s)])
    at_k = e * np.stack([c + 0j, c1 + 1j * b1 * c, 2j * b1 * c1 - b1**2 * c])
    most, slope = np.abs(c).max(axis=0), np.abs(c1)
    zero = np.zeros_like(dt)
    omega_most = kappa_g * np.stack([np.abs(s1), zero, zero, zero])
    v_most = np.stack([k * b ** (k - 1) * slope + b**k * most for k in (1, 2, 3, 4)])
    return Directions(
        dt,
        at_k - 1j * omega * reference,
        omega,
        v_most + omega_most * abs(reference),
        omega_most,
    )


def swinging(
    ends: FloatArray, bound: FloatArray, rolls: tuple[BoolArray, BoolArray]
) -> tuple[FloatArray, FloatArray]:
    """Return what is reached at ends that count, and what is never exceeded.

    Parameters
    ----------
    ends : (2, m) float
    bound : (m,) float
    rolls : two (m,) bool
        Whether an end counts.
    """
    low = np.where(np.stack(rolls), np.abs(ends), 0.0).max(axis=0)
    return np.asarray(low), bound
