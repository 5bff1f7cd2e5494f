"""A plain simulation of planar motions, to hold verdicts against.

Nothing of `omniplan` is used: motions are sampled finely, angles are followed step by
step, and what changes is seen from a moment later. Every such difference is a value
that the derivative takes within that moment, so a motion that keeps its limits keeps
them here as well. `naive_limits` holds the samples against the limits.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import naive
import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from configspace.testing import rigid_body
from configspace.vehicle import Castor, SteerableWheel, Vehicle

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
BoolArray = npt.NDArray[np.bool_]
TwistAt = Callable[[FloatArray], FloatArray]
"""From times (n,) to body twists (n, 3) of the origin of the vehicle file's frame."""

STANDSTILL = 1e-3  # m/s, the documented tolerances
SLIP_ANGLE = math.radians(1.0)
SLIP_SPEED = 5e-3
ALIGNMENT = math.radians(1.0)
MOMENT = 1e-6  # s, over which changes are seen
EPS = float(np.finfo(np.float64).eps)
SWING = 1e-4  # s, likewise for changes of changes, at most


# --- motions


def twist_motion(t: FloatArray, twists: FloatArray, x: float, y: float) -> TwistAt:
    """Twists of the point (x, y), linear in time."""

    def at(when: FloatArray) -> FloatArray:
        vx, vy, omega = (np.interp(when, t, column) for column in twists.T)
        return np.stack([vx + omega * y, vy - omega * x, omega], axis=-1)

    return at


def pose_motion(t: FloatArray, poses: FloatArray, x: float, y: float) -> TwistAt:
    """Splines through poses of the point (x, y), as `Trajectory` documents them."""
    stop = _stops(t, poses)
    ends = sorted({0, len(t) - 1, *np.flatnonzero(stop).tolist()})
    splines = [
        (t[a], t[b], _spline(t[a : b + 1], poses[a : b + 1], stop[a], stop[b]))
        for a, b in itertools.pairwise(ends)
    ]

    def at(when: FloatArray) -> FloatArray:
        out = np.zeros((len(when), 3))
        for start, end, spline in splines:
            here = (when >= start) & (when <= end)
            _, _, theta = spline(when[here]).T
            dx, dy, omega = spline(when[here], 1).T
            vx = np.cos(theta) * dx + np.sin(theta) * dy
            vy = -np.sin(theta) * dx + np.cos(theta) * dy
            out[here] = np.stack([vx + omega * y, vy - omega * x, omega], axis=-1)
        return out

    return at


def _stops(t: FloatArray, poses: FloatArray) -> BoolArray:
    """Corners of more than 60° (1 rad counts 0.5 m), dwells, starts from rest."""
    steps = np.diff(poses, axis=0) * [1, 1, 0.5]
    stop = np.zeros(len(t), dtype=bool)
    for i in range(len(steps)):
        if np.linalg.norm(steps[i]) < 1e-9:
            stop[i] = stop[i + 1] = True
    for i in range(1, len(steps)):
        sizes = np.linalg.norm(steps[i - 1]) * np.linalg.norm(steps[i])
        if sizes > 0 and steps[i - 1] @ steps[i] < 0.5 * sizes:
            stop[i] = True
    if len(t) > 2:
        for end, one, two in ((0, 1, 2), (-1, -2, -3)):
            first = steps[0 if end == 0 else -1] / abs(t[one] - t[end])
            second = steps[1 if end == 0 else -2] / abs(t[two] - t[one])
            share = (t[one] - t[end]) / (t[two] - t[end])
            speed = first - share * (second - first)
            stop[end] |= speed @ first < 0.25 * (first @ first)
    return stop


def _spline(t: FloatArray, poses: FloatArray, rest0: bool, rest1: bool) -> CubicSpline:
    free: Any = "not-a-knot" if len(t) > 3 else (2, np.zeros(3))
    rest: Any = (1, np.zeros(3))
    ends = (rest if rest0 else free, rest if rest1 else free)
    return CubicSpline(t, poses, bc_type=ends)


def omni_curve_motion(t: FloatArray, samples: FloatArray, vehicle: Vehicle) -> TwistAt:
    """(κ_n, β, v_n) linear in time, v_n the share of the exact v_max."""
    kappa_g, (kx, ky) = naive.kappa_g(vehicle), naive.reference(vehicle)

    def at(when: FloatArray) -> FloatArray:
        k, b, share = (np.interp(when, t, column) for column in samples.T)
        k = np.clip(k, -2, 2)
        # Where the wheels cannot point that way the speed is as if they could.
        v_max = [rigid_body(vehicle, k, b, reverse=r).v_max for r in (False, True)]
        v_s = share * np.minimum(np.where(share < 0, v_max[1], v_max[0]), 100.0)
        rows = np.stack([k, b, v_s], axis=-1).tolist()
        twists = np.array(
            [naive.twist(kn, be, v, kappa_g) for kn, be, v in rows]
        ).reshape(-1, 3)
        twists[:, 0] += twists[:, 2] * ky
        twists[:, 1] -= twists[:, 2] * kx
        return twists

    return at


def instants(t: FloatArray, per_interval: int) -> FloatArray:
    """Times with `per_interval` steps between any two knots, knots included."""
    fine = [
        np.linspace(a, b, per_interval, endpoint=False)
        for a, b in itertools.pairwise(t)
    ]
    return np.concatenate([*fine, t[-1:]])


# --- samples


@dataclass(frozen=True)
class Piece:
    """A stretch between two standstills: rows first to last of the samples."""

    first: int
    last: int

    @property
    def rows(self) -> slice:
        return slice(self.first, self.last + 1)


@dataclass(frozen=True)
class Ahead:
    """Twists one and two steps after every sample."""

    step: FloatArray
    """(n,) s."""
    one: FloatArray
    """(n, 3)."""
    two: FloatArray
    goes_on: BoolArray
    """(n,) whether the vehicle moves on until then."""


class Simulation:
    """One motion of one vehicle, sampled; with every sample the twist a moment later.

    Without these (``later``) the rates of change are not known, without those `ahead`
    how they change.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        t: FloatArray,
        twists: FloatArray,
        later: FloatArray | None = None,
        moment: FloatArray | None = None,
        ahead: Ahead | None = None,
        *,
        has_accelerations: bool = True,
    ) -> None:
        self.vehicle, self.t = vehicle, t
        self.twists, self.later, self.ahead = twists, later, ahead
        self.moment = np.full(t.shape, MOMENT) if moment is None else moment
        self.has_accelerations = has_accelerations and later is not None
        self.vx, self.vy, self.omega = twists.T
        self.reference = naive.reference(vehicle)
        self.kappa_g = naive.kappa_g(vehicle)
        self.places = naive.ground(vehicle)
        kx, ky = self.reference
        self.kx, self.ky = self.vx - self.omega * ky, self.vy + self.omega * kx
        self.speed = np.hypot(self.kx, self.ky)
        self.v_s = np.maximum(self.speed, np.abs(self.omega) / self.kappa_g)
        self.moves = self.v_s > STANDSTILL * (1 + 1e-6)
        self.pieces = self._pieces()

    def _pieces(self) -> list[Piece]:
        pieces, first = [], None
        for i, moves in enumerate([*self.moves.tolist(), False]):
            if moves and first is None:
                first = i
            elif not moves and first is not None:
                pieces.append(Piece(first, i - 1))
                first = None
        return pieces

    def velocity(self, x: float, y: float) -> ComplexArray:
        """Velocity of a point of the vehicle in its frame, ``vx + j vy``."""
        return point_velocity(self.twists, x, y)

    def velocity_later(self, x: float, y: float) -> ComplexArray:
        assert self.later is not None
        return point_velocity(self.later, x, y)

    def wheel_velocity(self, i: int) -> tuple[FloatArray, FloatArray]:
        """Velocity of the steering axis or contact of wheel i in the vehicle frame."""
        u = self.velocity(*self.places[i])
        return u.real, u.imag

    def rolling(self, i: int) -> FloatArray:
        """Rolling speed of wheel i; of a steered wheel its amount at the axis."""
        return rolling_of(self.vehicle, i, self.velocity(*self.places[i]))

    def steering(self, i: int, sign: int, piece: Piece) -> FloatArray:
        """Steering angle of wheel i over a piece, followed from its start."""
        u = sign * self.velocity(*self.places[i])[piece.rows]
        return np.unwrap(np.angle(u))

    def turning(self, i: int) -> FloatArray:
        """Steering rate of wheel i, from its direction a moment later."""
        u, later = self.velocity(*self.places[i]), self.velocity_later(*self.places[i])
        return np.asarray(np.angle(later * u.conj()) / self.moment)

    def swinging(self, i: int) -> FloatArray:
        """Steering acceleration of wheel i: 0 where the vehicle soon stands.

        Without what rounding may add; the difference of two mean rates over one step
        is a value that the acceleration takes, even across its jumps.
        """
        ahead, place = self.ahead, self.places[i]
        assert ahead is not None
        u, one, two = (
            point_velocity(twists, *place)
            for twists in (self.twists, ahead.one, ahead.two)
        )
        first, second = np.angle(one * u.conj()), np.angle(two * one.conj())
        with np.errstate(divide="ignore", invalid="ignore"):
            blur = 16 * EPS * np.abs(u).max() / np.abs(u)
            blur += 4 * EPS * np.abs(self.t) * np.abs(first) / ahead.step
            swing = (np.abs(second - first) - blur) / ahead.step**2
        return np.asarray(np.where(ahead.goes_on, np.maximum(swing, 0.0), 0.0))

    def contact_speed(self, i: int, offset: float, sign: int) -> FloatArray:
        """Rolling speed of the wheel `offset` left of steering axis i.

        Its contact moves with the body, ω x p, and on it as the wheel steers.
        """
        place = complex(*self.places[i])
        u, later = self.velocity(*self.places[i]), self.velocity_later(*self.places[i])
        with np.errstate(divide="ignore", invalid="ignore"):
            ahead, ahead_later = sign * u / np.abs(u), sign * later / np.abs(later)
        contact = place + 1j * offset * ahead
        moved = 1j * offset * (ahead_later - ahead) / self.moment
        body = self.vx + 1j * self.vy + 1j * self.omega * contact
        return np.asarray(((body + moved) * ahead.conj()).real)

    def contact_gain(self, i: int, offset: float, sign: int) -> FloatArray:
        """How fast the rolling speed of the wheel `offset` left of axis i changes.

        By where its contact is on the body at three moments: over each step the ground
        passes it at the body's speed there and at that of its own way on the body. 0
        where the vehicle soon stands; without what rounding may add.
        """
        ahead, place = self.ahead, complex(*self.places[i])
        assert ahead is not None
        moments = self.twists, ahead.one, ahead.two
        sizes = [np.abs(point_velocity(x, *self.places[i])) for x in moments]
        with np.errstate(divide="ignore", invalid="ignore"):
            aims = [
                sign * point_velocity(x, *self.places[i]) / size
                for x, size in zip(moments, sizes, strict=True)
            ]
        contacts = [place + 1j * offset * aim for aim in aims]
        rolled = []
        for k in (0, 1):
            aim = aims[k] + aims[k + 1]
            with np.errstate(divide="ignore", invalid="ignore"):
                aim = aim / np.abs(aim)
            bodies = [
                x[:, 0] + 1j * x[:, 1] + 1j * x[:, 2] * contact
                for x, contact in zip(moments[k : k + 2], contacts[k:], strict=False)
            ]
            moved = (contacts[k + 1] - contacts[k]) / ahead.step
            over_ground = (bodies[0] + bodies[1]) / 2 + moved
            rolled.append((over_ground * aim.conj()).real)
        with np.errstate(divide="ignore", invalid="ignore"):
            blur = 64 * EPS * (1 + abs(offset) / sizes[0]) / ahead.step**2
        gain = np.abs(rolled[1] - rolled[0]) / ahead.step - blur
        return np.asarray(np.where(ahead.goes_on, np.maximum(gain, 0.0), 0.0))

    def is_clear(self) -> bool:
        """Whether no wheel passes so near the ICR that an angle cannot be followed."""
        for i, wheel in enumerate(self.vehicle.wheels):
            if isinstance(wheel, SteerableWheel):
                for piece in self.pieces:
                    steps = np.abs(np.diff(self.steering(i, 1, piece)))
                    if steps.max(initial=0.0) > 1.5:
                        return False
        return True


def point_velocity(twists: FloatArray, x: float, y: float) -> ComplexArray:
    vx, vy, omega = twists.T
    return np.asarray(vx - omega * y + 1j * (vy + omega * x))


def rolling_of(vehicle: Vehicle, i: int, u: ComplexArray) -> FloatArray:
    """Rolling speed of wheel i whose axis or contact moves with u."""
    wheel = vehicle.wheels[i]
    assert not isinstance(wheel, Castor)
    if isinstance(wheel, SteerableWheel):
        return np.abs(u)
    delta = math.radians(wheel.heading_deg)
    gamma = math.radians(getattr(wheel, "roller_deg", 0.0))
    along = u.real * math.cos(delta + gamma) + u.imag * math.sin(delta + gamma)
    return np.asarray(along / math.cos(gamma))


def simulate(
    vehicle: Vehicle,
    t: FloatArray,
    twist_at: TwistAt,
    per_interval: int = 60,
    *,
    has_accelerations: bool = True,
    has_swing: bool = False,
) -> Simulation:
    """Sample a motion with knots `t` finely, most finely where directions swing.

    Accelerations of a motion along Omni-Curve-Parameters are no one's promise, steering
    accelerations (`has_swing`) are one of poses only.
    """
    when = np.union1d(instants(t, per_interval), t[1:] - 2 * MOMENT)
    when = np.union1d(when, near_rest(vehicle, when, twist_at))
    when = np.union1d(when, edges_of_rest(vehicle, when, twist_at))
    if has_swing:
        when = np.union1d(when, np.maximum(t[1:] - 2.001 * SWING, t[:-1]))
        when = np.union1d(when, strongest_swings(vehicle, when, twist_at))
    when = np.minimum(when, t[-1] - MOMENT)
    when = when[np.concatenate([[True], np.diff(when) > 1e-10])]
    after = when + MOMENT
    return Simulation(
        vehicle,
        when,
        twist_at(when),
        twist_at(after),
        after - when,
        look_ahead(vehicle, when, twist_at) if has_swing else None,
        has_accelerations=has_accelerations,
    )


def look_ahead(vehicle: Vehicle, when: FloatArray, twist_at: TwistAt) -> Ahead:
    """Look so little ahead that the vehicle does not come to rest on the way."""
    kappa_g = naive.kappa_g(vehicle)
    now, soon = (
        moving_vectors(vehicle, twist_at(at), kappa_g) for at in (when, when + MOMENT)
    )
    gain = np.linalg.norm(soon - now, axis=1) / MOMENT
    reach = 0.05 * np.linalg.norm(now, axis=1) / np.maximum(gain, 1e-9)
    first = when + np.clip(reach, MOMENT, SWING)
    step = first - when
    one, two = twist_at(first), twist_at(first + step)
    goes_on = [v_s_of(vehicle, twists, kappa_g) > STANDSTILL for twists in (one, two)]
    return Ahead(step, one, two, goes_on[0] & goes_on[1] & (reach > MOMENT))


def strongest_swings(
    vehicle: Vehicle, when: FloatArray, twist_at: TwistAt
) -> FloatArray:
    """Times at which wheels with such a limit accelerate their steering most."""
    found: list[FloatArray] = [when[:0]]
    for i, wheel in enumerate(vehicle.wheels):
        if getattr(wheel, "max_steering_acceleration_deg", None) is None:
            continue

        def calm(at: FloatArray, i: int = i) -> FloatArray:
            ahead = look_ahead(vehicle, at, twist_at)
            return -Simulation(vehicle, at, twist_at(at), ahead=ahead).swinging(i)

        size = -calm(when)
        peak = (size[1:-1] >= size[:-2]) & (size[1:-1] >= size[2:])
        at = np.flatnonzero(peak & (size[1:-1] > 0.3 * size.max())) + 1
        if at.size:
            found.append(least(calm, when[at - 1], when[at + 1]))
    return np.concatenate(found)


def near_rest(vehicle: Vehicle, when: FloatArray, twist_at: TwistAt) -> FloatArray:
    """Times around those where K or a wheel comes to rest, or nearly so.

    The distance of the times halves towards the slowest instant, so an angle can be
    followed from one to the next.
    """
    axes = [
        naive.ground(vehicle)[i]
        for i, wheel in enumerate(vehicle.wheels)
        if isinstance(wheel, SteerableWheel)
    ]
    kappa_g = naive.kappa_g(vehicle)
    found: list[FloatArray] = [when[:0]]
    for point in (None, *axes):

        def vectors(
            at: FloatArray, point: tuple[float, float] | None = point
        ) -> FloatArray:
            twists = twist_at(at)
            if point is None:
                return moving_vectors(vehicle, twists, kappa_g)
            u = point_velocity(twists, *point)
            return np.stack([u.real, u.imag], axis=-1)

        def sizes(at: FloatArray) -> FloatArray:
            return np.asarray(np.linalg.norm(vectors(at), axis=-1))

        there = vectors(when)
        size = np.linalg.norm(there, axis=-1)
        step = np.linalg.norm(np.diff(there, axis=0), axis=-1)
        low = (size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:])
        low &= size[1:-1] < 3 * np.maximum(step[:-1], step[1:]) + STANDSTILL
        at = np.flatnonzero(low) + 1
        if not at.size:
            continue
        a, b = when[at - 1], when[at + 1]
        slowest = least(sizes, a, b)
        reach = np.maximum(b - slowest, slowest - a)[:, None] * 0.5 ** np.arange(1, 20)
        around = np.concatenate([slowest[:, None] - reach, slowest[:, None] + reach], 1)
        around = np.clip(around, a[:, None], b[:, None])
        found += [slowest, around.ravel()]
    return np.concatenate(found)


def v_s_of(vehicle: Vehicle, twists: FloatArray, kappa_g: float) -> FloatArray:
    """|v_s|, m/s."""
    x, y, q = moving_vectors(vehicle, twists, kappa_g).T
    return np.asarray(np.maximum(np.hypot(x, y), np.abs(q)))


def moving_vectors(vehicle: Vehicle, twists: FloatArray, kappa_g: float) -> FloatArray:
    """K's velocity and ω / κ_g, (n, 3)."""
    v = point_velocity(twists, *naive.reference(vehicle))
    return np.stack([v.real, v.imag, twists[:, 2] / kappa_g], axis=-1)


def least(
    value: Callable[[FloatArray], FloatArray], a: FloatArray, b: FloatArray
) -> FloatArray:
    """Where a value is least between a and b, thirds by thirds."""
    for _ in range(60):
        one, two = a + (b - a) / 3, b - (b - a) / 3
        left = value(one) < value(two)
        a, b = np.where(left, a, one), np.where(left, two, b)
    return (a + b) / 2


def edges_of_rest(vehicle: Vehicle, when: FloatArray, twist_at: TwistAt) -> FloatArray:
    """Times at which |v_s| passes what counts as standing, seen from where it moves."""
    kappa_g = naive.kappa_g(vehicle)

    def moves(at: FloatArray) -> BoolArray:
        v_s = v_s_of(vehicle, twist_at(at), kappa_g)
        return np.asarray(v_s > STANDSTILL * (1 + 1e-6))

    now = moves(when)
    at = np.flatnonzero(now[1:] != now[:-1])
    if not at.size:
        return when[:0]
    still = np.where(now[at], when[at + 1], when[at])
    moving = np.where(now[at], when[at], when[at + 1])
    for _ in range(50):
        middle = (still + moving) / 2
        on_the_move = moves(middle)
        moving = np.where(on_the_move, middle, moving)
        still = np.where(on_the_move, still, middle)
    return moving
