"""The continuous motion between the samples of a trajectory, with enclosures.

A motion is cut at its knots into intervals. On a part ``[t0, t1]`` of an interval the
body twist is ``scale · (v, ω)`` with

    v(t) ∈ chord [v(t0), v(t1)] ⊕ disc of radius Δt²/8 · max |v̈|

and likewise for ω. Everything `judge` decides between the samples rests on that
enclosure, whose excess shrinks with the square of Δt.

Twists are those of the origin of the vehicle files' frame, ``v = vx + j vy``.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from configspace import Vehicle, exact_v_max
from configspace.angles import wrap
from configspace.exact import active_rows
from configspace.limits import rows_of
from configspace.vehicle import SteerableWheel
from omniplan.judging.swing import (
    Directions,
    Pieces,
    Swing,
    directions_of_legs,
    factored,
)
from omniplan.samples import HEADING_LENGTH
from omniplan.splines import spline
from omniplan.trajectory import Trajectory

__all__ = [
    "Enclosure",
    "Intervals",
    "Motion",
    "PoseMotion",
    "motion_of",
    "spline",
    "stops_of",
]

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
IntArray = npt.NDArray[np.int64]
Number = TypeVar("Number", np.float64, np.complex128)

STOP_TURN = np.radians(60)
"""A path that turns by more than this from sample to sample must stop there."""
REST_SHARE = 0.25
"""A motion that starts at less than this share of its first step's speed starts at
rest."""


@dataclass(frozen=True)
class Intervals:
    """Parts of a motion, in order of time."""

    knot: IntArray
    """(m,) the interval each part belongs to."""
    t0: FloatArray
    """(m,) s."""
    t1: FloatArray
    """(m,) s."""

    def halved(self, mask: npt.NDArray[np.bool_]) -> Intervals:
        """Return the intervals with those of `mask` cut in two."""
        half = (self.t0[mask] + self.t1[mask]) / 2
        at = np.flatnonzero(mask)
        t1 = self.t1.copy()
        t1[at] = half
        return Intervals(
            np.insert(self.knot, at + 1, self.knot[at]),
            np.insert(self.t0, at + 1, half),
            np.insert(t1, at + 1, self.t1[at]),
        )


@dataclass(frozen=True)
class Enclosure:
    """The twist over m parts; 0 and 1 are their ends."""

    dt: FloatArray
    v0: ComplexArray
    v1: ComplexArray
    omega0: FloatArray
    omega1: FloatArray
    v_dot0: ComplexArray
    v_dot1: ComplexArray
    omega_dot0: FloatArray
    omega_dot1: FloatArray
    v_ddot: FloatArray
    """Bound on |v̈|, per s²."""
    omega_ddot: FloatArray
    """Bound on |ω̈|, per s²."""
    v_dddot: FloatArray
    """Bound on |v⃛|, per s³."""
    omega_dddot: FloatArray
    """Bound on |ω⃛|, per s³."""
    scale0: FloatArray
    scale1: FloatArray
    scale_high: FloatArray
    """Bound on the factor on the twist over the part, ≥ 0."""
    sign: FloatArray
    """Sign of v_s of the configuration that is meant (omni_curve), else 1."""
    swing: Swing | None = None
    """How directions swing; None where the twist may bend without bound."""

    def rows(self, rows: slice) -> Enclosure:
        """Return some of the parts."""
        swing = None if self.swing is None else self.swing.rows(rows)
        fields = {
            name: values[rows] for name, values in vars(self).items() if name != "swing"
        }
        return Enclosure(**fields, swing=swing)

    def merged(self, others: Enclosure, order: IntArray) -> Enclosure:
        """Return parts of both: these and then the others, in a new order.

        Parameters
        ----------
        others : Enclosure
            Of the same motion.
        order : (n,) int
            Indices into all of them.
        """
        swing = self.swing
        if swing is not None and others.swing is not None:
            swing = swing.merged(others.swing, order)
        fields = {
            name: np.concatenate([values, getattr(others, name)])[order]
            for name, values in vars(self).items()
            if name != "swing"
        }
        return Enclosure(**fields, swing=swing)


class Motion(Protocol):
    """What `judge` needs to know of a motion."""

    is_own: bool
    """The samples are this vehicle's own (κ_n, β, v_n): the configuration is given and
    the factor on the twist is |v_n|, a share of v_max."""
    has_rates: bool
    """Whether accelerations are known."""
    interpolation: str

    def intervals(self) -> Intervals:
        """Return the intervals between the knots."""
        ...

    def enclose(self, parts: Intervals) -> Enclosure:
        """Return an enclosure of every part."""
        ...


def motion_of(trajectory: Trajectory, *, is_own: bool) -> Motion:
    """Return the motion of a trajectory.

    Parameters
    ----------
    trajectory : Trajectory
    is_own : bool
        Whether the vehicle that is judged is the trajectory's own: then its
        Omni-Curve-Parameters are taken as they are, otherwise as twists.
    """
    point = complex(*trajectory.reference_point)
    if trajectory.form == "poses":
        return PoseMotion(trajectory.t, trajectory.samples, point)
    if trajectory.form == "twists":
        return TwistMotion(trajectory.t, trajectory.samples, point)
    owner = trajectory.vehicle
    assert owner is not None
    return OmniCurveMotion(
        trajectory.t,
        trajectory.samples,
        owner.boundary_curvature,
        owner.reference,
        None if is_own else owner,
    )


def stops_of(samples: FloatArray) -> npt.NDArray[np.bool_]:
    """Return which pose samples are standstills: cusps, corners and dwells.

    Parameters
    ----------
    samples : (n, 3) float, m, m, rad

    Returns
    -------
    is_stop : (n,) bool
    """
    chord = np.diff(samples, axis=0) * [1.0, 1.0, HEADING_LENGTH]
    length = np.linalg.norm(chord, axis=1)
    still = length < 1e-9
    stop = np.zeros(len(samples), dtype=bool)
    stop[:-1] |= still
    stop[1:] |= still
    dot = np.einsum("ij,ij->i", chord[:-1], chord[1:])
    sharp = dot < np.cos(STOP_TURN) * length[:-1] * length[1:]
    stop[1:-1] |= sharp & ~still[:-1] & ~still[1:]
    return stop


def starts_at_rest(t: FloatArray, samples: FloatArray) -> bool:
    """Return whether samples leave their first one from rest.

    The speed there, by the parabola through three samples, is far below that of the
    first step. A spline with a free end would swing backwards before such a start.
    """
    if len(t) < 3:
        return False
    chord = np.diff(samples[:3], axis=0) * [1.0, 1.0, HEADING_LENGTH]
    first, second = chord / np.diff(t[:3])[:, None]
    share = (t[1] - t[0]) / (t[2] - t[0])
    at_start = first - share * (second - first)
    return bool(at_start @ first < REST_SHARE * (first @ first))


class PoseMotion:
    """Cubic splines through poses, at rest in every stop.

    Between two stops position and heading are C²; at a stop they start anew with zero
    speed, as a C² spline through a cusp would swing around it.

    Attributes `t` (n,), the coefficients `position` and `heading` (4, n - 1) of the
    cubics in the time since each sample, highest power first, and the described
    `point` tell all of it.
    """

    rest: npt.NDArray[np.bool_] | None = None
    """(2, n - 1) whether intervals start and end at rest; None: nowhere."""
    is_own = False
    has_rates = True
    interpolation = (
        "C² cubic splines of x, y and heading; at rest at cusps, corners and dwells"
    )

    def __init__(self, t: FloatArray, samples: FloatArray, point: complex) -> None:
        self.t = t
        self.point = point
        self.position = np.zeros((4, len(t) - 1), dtype=complex)
        self.heading = np.zeros((4, len(t) - 1))
        stop = stops_of(samples)
        stop[0] |= starts_at_rest(t, samples)
        stop[-1] |= starts_at_rest(-t[::-1], samples[::-1])
        self.rest = np.stack([stop[:-1], stop[1:]])
        bounds = sorted({0, len(t) - 1, *np.flatnonzero(stop).tolist()})
        for first, last in itertools.pairwise(bounds):
            run = slice(first, last + 1)
            ends = bool(stop[first]), bool(stop[last])
            part = slice(first, last)
            x, y, heading = np.moveaxis(spline(t[run], samples[run], *ends), 2, 0)
            self.position[:, part] = x + 1j * y
            self.heading[:, part] = heading

    @cached_property
    def since(self) -> FloatArray:
        """(n - 1,) s: how long after a rest intervals start, negative before it.

        Of those over which the twist is nearly a multiple of that time: it leaves less
        change, relative to its size, if divided by it. Elsewhere infinite.
        """
        t, middle = self.t, (self.t[1:] + self.t[:-1]) / 2
        h = middle - t[:-1]
        p1, p2 = _first(self.position, h), _second(self.position, h)
        h1, h2 = _first(self.heading, h), _second(self.heading, h)

        def change(rest: FloatArray) -> FloatArray:
            with np.errstate(divide="ignore", invalid="ignore"):
                pull = 1 / (middle - rest)
                left = np.abs(p2 - p1 * pull) + HEADING_LENGTH * np.abs(h2 - h1 * pull)
            return np.where(np.isfinite(left), left, np.inf)

        if self.rest is None:
            return np.full(middle.shape, np.inf)
        before = np.maximum.accumulate(np.where(self.rest[0], t[:-1], -np.inf))
        after = np.minimum.accumulate(np.where(self.rest[1], t[1:], np.inf)[::-1])[::-1]
        after = np.where(np.isfinite(after), after, -np.inf)
        options = np.stack([np.full(middle.shape, -np.inf), before, after])
        least = np.argmin([change(rest) for rest in options], axis=0)
        return np.asarray(t[:-1] - np.take_along_axis(options, least[None], axis=0)[0])

    def intervals(self) -> Intervals:
        """Return the intervals between the samples."""
        return Intervals(np.arange(len(self.t) - 1), self.t[:-1], self.t[1:])

    def poses_at(self, t: FloatArray) -> FloatArray:
        """Return the poses at times t, (n, 3)."""
        knot = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2)
        h = t - self.t[knot]
        p = _value(self.position[:, knot], h)
        return np.stack([p.real, p.imag, _value(self.heading[:, knot], h)], axis=-1)

    def enclose(self, parts: Intervals) -> Enclosure:
        """Return an enclosure of every part."""
        k, dt = parts.knot, parts.t1 - parts.t0
        position, heading = self.position[:, k], self.heading[:, k]
        h = np.stack([parts.t0, parts.t1]) - self.t[k]
        # Both ends at once, (2, m)
        p1, p2 = _first(position, h), _second(position, h)
        h0, h1, h2 = _value(heading, h), _first(heading, h), _second(heading, h)
        turn = np.exp(-1j * h0)
        v = turn * p1 - 1j * h1 * self.point
        v_dot = turn * (p2 - 1j * h1 * p1) - 1j * h2 * self.point
        p1_most, p2_most = np.abs(p1).max(axis=0), np.abs(p2).max(axis=0)
        h1_most, h2_most = np.abs(h1).max(axis=0), np.abs(h2).max(axis=0)
        p3, h3 = 6 * np.abs(position[0]), 6 * np.abs(heading[0])
        # The second derivative is linear, so its ends bound it; the first one bends.
        bent = dt**2 / 8
        p1_most, h1_most = p1_most + bent * p3, h1_most + bent * h3
        # d²/dt² (e^{-jθ} p') = e^{-jθ} (p''' - 2jθ'p'' - jθ''p' - θ'²p')
        turn2 = h2_most + h1_most**2  # of |dᵏ/dtᵏ e^{-jθ}|
        turn3 = h3 + 3 * h1_most * h2_most + h1_most**3
        v_ddot = p3 + 2 * h1_most * p2_most + turn2 * p1_most + h3 * abs(self.point)
        v_dddot = 3 * h1_most * p3 + 3 * turn2 * p2_most + turn3 * p1_most
        one, zero = np.ones_like(dt), np.zeros_like(dt)
        ends = v[0], v[1], h1[0], h1[1], v_dot[0], v_dot[1], h2[0], h2[1]
        bends = v_ddot, h3, v_dddot, zero
        swing = Swing(dt, h, k, self.swinging)
        return Enclosure(dt, *ends, *bends, one, one, one, one, swing)

    def swinging(self) -> Pieces:
        """Return the splines over a factor in which their directions swing evenly."""
        return self._pieces

    @cached_property
    def _pieces(self) -> Pieces:
        span, since = np.diff(self.t), self.since
        if self.rest is not None:
            since = np.where(self.rest.any(axis=0), np.inf, since)
        return Pieces(
            speed=factored(self.position, span, self.rest, since),
            turn=factored(self.heading, span, self.rest, since),
            since=since,
            heading=self.heading,
            point=self.point,
        )


class TwistMotion:
    """Body twists, linear in time between the samples.

    Attributes `t` (n,), `v` (n,) and `omega` (n,) tell all of it.
    """

    is_own = False
    has_rates = True
    interpolation = "body twist linear between the samples"

    def __init__(self, t: FloatArray, samples: FloatArray, point: complex) -> None:
        t, samples = _with_zero_crossings(t, samples)
        self.t = t
        self.omega = samples[:, 2]
        self.v = samples[:, 0] + 1j * samples[:, 1] - 1j * self.omega * point

    def intervals(self) -> Intervals:
        """Return the intervals between the samples."""
        return Intervals(np.arange(len(self.t) - 1), self.t[:-1], self.t[1:])

    def enclose(self, parts: Intervals) -> Enclosure:
        """Return an enclosure of every part; it has no excess."""
        k = parts.knot
        span = self.t[k + 1] - self.t[k]
        v_dot = (self.v[k + 1] - self.v[k]) / span
        omega_dot = (self.omega[k + 1] - self.omega[k]) / span
        f0, f1 = ((t - self.t[k]) / span for t in (parts.t0, parts.t1))
        v0, v1 = ((1 - f) * self.v[k] + f * self.v[k + 1] for f in (f0, f1))
        o0, o1 = ((1 - f) * self.omega[k] + f * self.omega[k + 1] for f in (f0, f1))
        zero, one = np.zeros_like(span), np.ones_like(span)
        return Enclosure(
            parts.t1 - parts.t0,
            v0,
            v1,
            o0,
            o1,
            v_dot,
            v_dot,
            omega_dot,
            omega_dot,
            *(zero, zero, zero, zero),
            one,
            one,
            one,
            one,
        )


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
                t, samples = _with_crossings(t, samples, column, level)
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

    v_max is at most 1/ρ of any one limit, and the ρ of a disc or a strip changes
    by at most the length that its argument moves.
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
    s = np.stack([o0, o1]) / kappa_g
    v = np.stack([v0, v1]) + 1j * np.stack([o0, o1]) * offset
    v_reach = np.abs(v[1] - v[0]) / 2 + radius
    s_reach = np.abs(s[1] - s[0]) / 2
    rho = np.full(radius.shape, 1e-9)
    for row in active_rows(rows_of(owner)[0], False):
        if row.kind not in {"disc", "strip"}:
            continue
        z = row.p * v.mean(axis=0) + s.mean(axis=0) * row.b
        size = (
            np.abs(z) if row.kind == "disc" else np.abs((z * np.exp(-1j * row.nu)).real)
        )
        rho = np.maximum(rho, size - row.p * v_reach - abs(row.b) * s_reach)
    high = np.where(_is_out(owner, factor, ends, radius), 0.0, np.maximum(*share) / rho)
    return share[0] * exact[0], share[1] * exact[1], high


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


def _value(cubic: npt.NDArray[Number], h: FloatArray) -> npt.NDArray[Number]:
    """Return the values of cubic pieces, (4, m), at h, (..., m)."""
    a, b, c, d = cubic
    values: npt.NDArray[Number] = ((a * h + b) * h + c) * h + d
    return values


def _first(cubic: npt.NDArray[Number], h: FloatArray) -> npt.NDArray[Number]:
    """Return the first derivatives of cubic pieces."""
    a, b, c, _ = cubic
    values: npt.NDArray[Number] = (3 * a * h + 2 * b) * h + c
    return values


def _second(cubic: npt.NDArray[Number], h: FloatArray) -> npt.NDArray[Number]:
    """Return the second derivatives of cubic pieces."""
    a, b, _, _ = cubic
    values: npt.NDArray[Number] = 6 * a * h + 2 * b
    return values


def _with_crossings(
    t: FloatArray, samples: FloatArray, column: int, level: float
) -> tuple[FloatArray, FloatArray]:
    """Insert samples where a column crosses a level, exactly at the level."""
    values = samples[:, column] - level
    at = np.flatnonzero(values[:-1] * values[1:] < 0)
    f = values[at] / (values[at] - values[at + 1])
    new = samples[at] + f[:, None] * (samples[at + 1] - samples[at])
    new[:, column] = level
    return _inserted(t, samples, at, t[at] + f * (t[at + 1] - t[at]), new)


def _with_zero_crossings(
    t: FloatArray, samples: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Insert standstills where a twist turns into its opposite."""
    scaled = samples * [1.0, 1.0, HEADING_LENGTH]
    size = np.linalg.norm(scaled, axis=1)
    dot = np.einsum("ij,ij->i", scaled[:-1], scaled[1:])
    both = size[:-1] * size[1:]
    at = np.flatnonzero((both > 0) & (dot < -(1 - 1e-12) * both))
    f = size[at] / (size[at] + size[at + 1])
    when = t[at] + f * (t[at + 1] - t[at])
    return _inserted(t, samples, at, when, np.zeros((at.size, 3)))


def _inserted(
    t: FloatArray,
    samples: FloatArray,
    at: IntArray,
    when: FloatArray,
    new: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Insert rows after rows `at`, unless rounding puts them on an existing time."""
    inside = (when > t[at]) & (when < t[at + 1])
    at, when, new = at[inside], when[inside], new[inside]
    return np.insert(t, at + 1, when), np.insert(samples, at + 1, new, axis=0)
