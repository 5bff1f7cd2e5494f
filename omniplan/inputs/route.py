"""Joining curves and turns on the spot into the poses of a path.

The poses are as many as it takes: the C² spline through them, over the chord length
as everywhere, is compared with the curves, and halved where it is farther off than
the tolerance. Where the direction of travel or the heading jumps, the vehicle stops.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from configspace import Problem
from configspace.angles import wrap
from omniplan.errors import InvalidTrajectory
from omniplan.inputs.nurbs import Nurbs, Span, spans_of
from omniplan.samples import HEADING_LENGTH

__all__ = ["Line", "Piece", "Poses", "Route", "Tolerance"]

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
IntArray = npt.NDArray[np.int64]

MAX_POSES = 200_000
"""More are not made of one path."""
LEAST_CHORD = 2e-6
"""Poses closer than this are not made, m; a turn so tight is a corner."""
WIDE_TURN = 0.35
"""Largest turn of tangent or heading from pose to pose, rad."""
BLUNT_SHARE = 0.2
"""A turn within this share of the tolerance is a corner."""
TURN_STEP = math.pi / 4
"""Largest turn from pose to pose on the spot, rad."""
REVERSAL = math.radians(150)
"""A tangent that turns by more goes back: the vehicle reverses, and need not turn."""
SHARE = 0.8
"""Share of the tolerance that is used: the rest is for what lies between probes."""
PROBES = np.arange(1, 12) / 12
"""Where between two poses the spline is compared with the curve."""


@dataclass(frozen=True)
class Tolerance:
    """How far the spline through the poses may be off the curve."""

    position: float = 1e-4
    """m"""
    heading: float = 1e-4
    """rad; directions that differ by more make a stop."""

    def __post_init__(self) -> None:
        """Refuse what no sampling can reach."""
        for name, value, largest in (
            ("position", self.position, 1.0),
            ("heading", self.heading, 0.2),
        ):
            if not 1e-7 <= value <= largest:
                raise InvalidTrajectory(
                    Problem(f"tolerance.{name}", f"{value}", f"1e-7 to {largest:g}")
                )


class Piece(Protocol):
    """A smooth curve with the heading along it; w runs from 0 to 1."""

    @property
    def is_straight(self) -> bool:
        """Whether x, y and θ are straight."""
        ...

    def poses(self, w: FloatArray) -> FloatArray:
        """Return (x, y, θ), (m, 3)."""
        ...

    def velocity(self, w: FloatArray) -> ComplexArray:
        """Return d(x + j y)/dw."""
        ...

    def direction(self, w: FloatArray) -> ComplexArray:
        """Return the unit tangent."""
        ...


@dataclass(frozen=True)
class Line:
    """A straight line, driven with one heading."""

    start: complex
    end: complex
    heading: float

    is_straight = True

    def poses(self, w: FloatArray) -> FloatArray:
        """Return (x, y, θ), (m, 3)."""
        point = self.start + w * (self.end - self.start)
        heading = np.full(np.shape(w), self.heading)
        return np.stack([point.real, point.imag, heading], axis=-1)

    def velocity(self, w: FloatArray) -> ComplexArray:
        """Return d(x + j y)/dw."""
        return np.full(np.shape(w), self.end - self.start)

    def direction(self, w: FloatArray) -> ComplexArray:
        """Return the unit tangent."""
        return self.velocity(w) / abs(self.end - self.start)


@dataclass(frozen=True, eq=False)
class Poses:
    """What a `Route` was sampled to; see `Path`."""

    poses: FloatArray
    max_speed: FloatArray
    max_yaw_rate: FloatArray
    stops: list[int]


@dataclass
class _Run:
    """Pieces from stop to stop, each with the turns added to its heading and caps."""

    pieces: list[tuple[Piece, float, float, float]] = field(default_factory=list)
    turn: tuple[complex, float, float] | None = None
    """A turn on the spot instead: where, from which heading, by how much."""
    max_yaw_rate: float = np.inf


class Route:
    """Takes curves in the order in which they are driven, then samples them."""

    def __init__(self, tolerance: Tolerance) -> None:
        self._tolerance = tolerance
        self._runs: list[_Run] = [_Run()]
        self._heading: float | None = None
        self._at: complex | None = None
        self._direction = 0j
        self._max_yaw_rate = np.inf

    def add(
        self,
        piece: Piece,
        *,
        max_speed: float = np.inf,
        max_yaw_rate: float = np.inf,
        flip: float = 0.0,
    ) -> None:
        """Drive a piece, after a turn on the spot if it starts with another heading.

        `flip` is added to the heading of the piece, rad.
        """
        ends = np.array([0.0, 1.0])
        (x, y, theta0), (x1, y1, theta1) = piece.poses(ends)
        first, last = (complex(d) for d in piece.direction(ends))
        theta0, theta1 = float(theta0) + flip, float(theta1) + flip
        if self._heading is None:
            self._heading = theta0
        self._at = complex(x, y)
        turn = float(wrap(theta0 - self._heading))
        if abs(turn) > self._tolerance.heading:
            self._turn(turn, max_yaw_rate)
        elif (
            self._direction
            and abs(np.angle(first / self._direction)) > self._tolerance.heading
        ):
            self.stop()
        shift = flip + round((self._heading - theta0) / (2 * math.pi)) * 2 * math.pi
        self._runs[-1].pieces.append((piece, shift, max_speed, max_yaw_rate))
        self._heading = theta1 + shift - flip
        self._at, self._direction = complex(x1, y1), last
        self._max_yaw_rate = max_yaw_rate

    def face(
        self,
        theta: float,
        at: complex,
        deviation: float = 0.0,
        departing: float | None = None,
    ) -> None:
        """Turn on the spot to a heading.

        Nothing is done if the present heading or the one of departure is within the
        deviation, as the vehicle has the wanted heading then anyway.
        """
        deviation = max(deviation, self._tolerance.heading)
        if departing is not None and abs(wrap(departing - theta)) <= deviation:
            return
        if self._heading is None:
            self._heading = theta
            return
        turn = float(wrap(theta - self._heading))
        if abs(turn) > deviation:
            self._at = at
            self._turn(turn, self._max_yaw_rate)

    def stop(self) -> None:
        """Stand where the route has got to."""
        if self._runs[-1].pieces or self._runs[-1].turn:
            self._runs.append(_Run())
        self._direction = 0j

    def reverses(self, piece: Piece) -> bool:
        """Return whether a piece leads back to where the last one came from."""
        if not self._direction:
            return False
        first = complex(piece.direction(np.array([0.0]))[0])
        return abs(float(np.angle(first / self._direction))) > REVERSAL

    def spans(
        self, curve: Nurbs, orientation: float | FloatArray, is_global: bool
    ) -> list[Span]:
        """Return the smooth spans of a curve."""
        blunt = BLUNT_SHARE * self._tolerance.position
        return spans_of(curve, orientation, is_global, blunt)

    def follow(
        self,
        curve: Nurbs,
        orientation: float | FloatArray,
        is_global: bool,
        *,
        max_speed: float = np.inf,
        max_yaw_rate: float = np.inf,
    ) -> None:
        """Drive a NURBS.

        Where its tangent goes back, at a cusp, a vehicle that is oriented along it
        keeps its heading and drives on the other way round.

        Raises
        ------
        InvalidTrajectory
            If the curve has no length.
        """
        flip, is_first = 0.0, True
        for span in self.spans(curve, orientation, is_global):
            if np.abs(np.diff(curve.at(np.linspace(span.u0, span.u1, 33)))).sum() < (
                LEAST_CHORD
            ):
                continue
            along = not (is_global or isinstance(orientation, np.ndarray))
            if along and not is_first and self.reverses(span):
                flip = math.pi - flip
            self.add(span, max_speed=max_speed, max_yaw_rate=max_yaw_rate, flip=flip)
            is_first = False
        if is_first:
            x, y = curve.points[0]
            raise InvalidTrajectory(
                Problem(f"curve at ({x:g}, {y:g})", "no length", "must lead somewhere")
            )

    def _turn(self, turn: float, max_yaw_rate: float) -> None:
        assert self._at is not None
        assert self._heading is not None
        self.stop()
        self._runs[-1].turn = (self._at, self._heading, turn)
        self._runs[-1].max_yaw_rate = max_yaw_rate
        self._heading += turn
        self.stop()

    def sampled(self) -> Poses:
        """Return the poses of the whole route.

        Raises
        ------
        InvalidTrajectory
            If a curve turns too tightly or is too long for its tolerance.
        """
        rows: list[FloatArray] = []
        caps: list[FloatArray] = []
        stops, n = [], 0
        for run in self._runs:
            if not (run.pieces or run.turn):
                continue
            poses, limits = (
                _turned(*run.turn, run.max_yaw_rate)
                if run.turn
                else _Sampler(run, self._tolerance).sampled()
            )
            if rows:
                stops.append(n)
                poses = poses[1:]
            rows.append(poses)
            caps.append(limits)
            n = sum(map(len, rows)) - 1
        speed, yaw_rate = np.concatenate(caps, axis=1)
        return Poses(np.concatenate(rows), speed, yaw_rate, stops)


def _turned(
    at: complex, heading: float, turn: float, max_yaw_rate: float
) -> tuple[FloatArray, FloatArray]:
    """Return poses and caps (2, n - 1) of a turn on the spot."""
    n = math.ceil(abs(turn) / TURN_STEP) + 1
    theta = heading + np.linspace(0.0, turn, n)
    poses = np.stack([np.full(n, at.real), np.full(n, at.imag), theta], axis=-1)
    return poses, np.stack([np.full(n - 1, np.inf), np.full(n - 1, max_yaw_rate)])


class _Sampler:
    """Samples the pieces between two stops, closer where the spline is off."""

    def __init__(self, run: _Run, tolerance: Tolerance) -> None:
        self._pieces = [piece for piece, *_ in run.pieces]
        self._shift = np.array([shift for _, shift, *_ in run.pieces])
        self._caps = np.array([caps for _, _, *caps in run.pieces]).T
        self._tolerance = tolerance
        counts = [1 if piece.is_straight else 4 for piece in self._pieces]
        self._piece = np.repeat(np.arange(len(counts)), counts)
        self._w0 = np.concatenate([np.arange(n) / n for n in counts])
        self._w1 = np.concatenate([np.arange(1, n + 1) / n for n in counts])

    def sampled(self) -> tuple[FloatArray, FloatArray]:
        """Return poses (n, 3) and caps (2, n - 1)."""
        while True:
            start = self._poses(self._piece, self._w0)
            end = self._poses(self._piece[-1:], self._w1[-1:])
            poses = np.concatenate([start, end])
            off = self._wide(poses) | self._off(poses)
            if not off.any():
                return poses, self._caps[:, self._piece]
            self._halve(off, poses)

    def _halve(self, off: npt.NDArray[np.bool_], poses: FloatArray) -> None:
        """Cut the gaps between poses that are off."""
        chord = np.abs(np.diff(poses[:, 0] + 1j * poses[:, 1]))
        if self._piece.size > MAX_POSES or (chord[off] < LEAST_CHORD).any():
            x, y, _ = poses[int(np.flatnonzero(off)[chord[off].argmin()])]
            raise InvalidTrajectory(
                Problem(
                    f"curve near ({x:g}, {y:g})",
                    "turns too tightly, or is too long, to be sampled to "
                    f"{self._tolerance.position:g} m and "
                    f"{self._tolerance.heading:g} rad",
                    f"{MAX_POSES} poses, at least {LEAST_CHORD:g} m apart",
                )
            )
        at = np.flatnonzero(off)
        middle = (self._w0[at] + self._w1[at]) / 2
        w1 = self._w1.copy()
        w1[at] = middle
        self._piece = np.insert(self._piece, at + 1, self._piece[at])
        self._w0 = np.insert(self._w0, at + 1, middle)
        self._w1 = np.insert(w1, at + 1, self._w1[at])

    def _poses(self, piece: IntArray, w: FloatArray) -> FloatArray:
        """Return the poses of pieces at places w, (..., 3)."""
        poses = np.empty((*w.shape, 3))
        for k in np.unique(piece):
            mask = piece == k
            poses[mask] = self._pieces[k].poses(w[mask])
        poses[..., 2] += self._shift[piece].reshape(-1, *[1] * (w.ndim - 1))
        return poses

    def _wide(self, poses: FloatArray) -> npt.NDArray[np.bool_]:
        """Return behind which poses tangent or heading turn far."""
        turn = np.empty(self._piece.size)
        for k in np.unique(self._piece):
            mask = self._piece == k
            before, behind = (
                self._pieces[k].direction(w[mask]) for w in (self._w0, self._w1)
            )
            turn[mask] = np.abs(np.angle(behind / before))
        return (turn > WIDE_TURN) | (np.abs(np.diff(poses[:, 2])) > WIDE_TURN)

    def _off(self, poses: FloatArray) -> npt.NDArray[np.bool_]:
        """Return behind which poses the spline is off by too much."""
        steps = np.linalg.norm(np.diff(poses, axis=0) * [1, 1, HEADING_LENGTH], axis=1)
        if (steps <= 0).any():
            x, y, _ = poses[int(steps.argmin())]
            raise InvalidTrajectory(
                Problem(f"curve at ({x:g}, {y:g})", "stands still", "must move on")
            )
        u = np.concatenate([[0.0], np.cumsum(steps)])
        spline = (
            CubicSpline(u, poses, bc_type="not-a-knot")
            if len(u) > 3
            else CubicSpline(u, poses, bc_type="natural")
        )
        on_spline = spline(u[:-1, None] + steps[:, None] * PROBES)
        on_curve = self._nearest(on_spline)
        gap = on_spline - on_curve
        distance = np.hypot(gap[..., 0], gap[..., 1]).max(axis=1)
        turn = np.abs(gap[..., 2]).max(axis=1)
        return np.asarray(
            (distance > SHARE * self._tolerance.position)
            | (turn > SHARE * self._tolerance.heading)
        )

    def _nearest(self, target: FloatArray) -> FloatArray:
        """Return the poses of the curves nearest to probes, (m, n, 3)."""
        point = target[..., 0] + 1j * target[..., 1]
        piece, w0, w1 = self._piece, self._w0, self._w1
        reach = (w1 - w0)[:, None]
        low = np.maximum(w0[:, None] - reach, 0.0)
        high = np.minimum(w1[:, None] + reach, 1.0)
        w = w0[:, None] + reach * PROBES
        for _ in range(4):  # Gauss-Newton on the distance
            velocity = np.empty(w.shape, dtype=complex)
            for k in np.unique(piece):
                mask = piece == k
                velocity[mask] = self._pieces[k].velocity(w[mask])
            here = self._poses(piece, w)
            miss = point - (here[..., 0] + 1j * here[..., 1])
            along = (miss * velocity.conj()).real
            size = np.abs(velocity) ** 2
            step = np.divide(along, size, out=np.zeros_like(size), where=size > 0)
            w = np.clip(w + step, low, high)
        return self._poses(piece, w)
