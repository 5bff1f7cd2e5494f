"""Moves: the pieces a plan is made of, each of constant shape.

A *straight* move is the interpolation of SE(2): position and heading are linear, so the
ratio of rotation to translation stays and the direction of travel in the vehicle frame
turns against the heading: κ_n is constant and β goes from β_0 to β_0 - Δθ. An *arc* is
a screw motion: the body twist is constant, and so are κ_n and β. Both describe K.

A move is driven in one of two representations: with v_s > 0 in (κ_n, β), or with
v_s < 0 in (-κ_n, β + π).

References
----------
spec/omni-curve §1, facts 1 and 5; K. Lynch, F. Park, Modern Robotics, 3.3.3 (the
exponential coordinates of a planar screw motion).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from configspace.angles import wrap
from omniplan.samples import HEADING_LENGTH

__all__ = ["Move", "goes_on"]

FloatArray = npt.NDArray[np.float64]
Shape: TypeAlias = Literal["straight", "arc"]

SAME = 1e-6
"""Twists whose directions differ by less go on in each other."""
NO_WAY = 1e-12
"""Below this length, m, a move is a turn on the spot: its β has no meaning and is 0."""


@dataclass(frozen=True, eq=False)
class Move:
    """One move from pose to pose. Make one with `straight`, `arc` or `along`.

    At constant speed over its parameter u from 0 to 1: equal steps of u are equal steps
    of way and of turn.
    """

    shape: Shape
    start: FloatArray
    """(3,) m, m, rad: (x, y, θ) of K."""
    goal: FloatArray
    """(3,) m, m, rad; its heading is that of the start plus `turn`."""
    length: float
    """Length of K's way, m, ≥ 0."""
    turn: float
    """Change of the heading, rad, signed."""
    beta_0: float
    """Direction of travel in the vehicle frame at the start, rad, (-π, π]."""

    @classmethod
    def straight(
        cls, start: npt.ArrayLike, goal: npt.ArrayLike, *, turn: float | None = None
    ) -> Move:
        """Return the move with linear position and heading.

        Parameters
        ----------
        start, goal : (3,) float, m, m, rad
            (x, y, θ) of K.
        turn : float, rad, optional
            Change of the heading, equal to that from start to goal but for full turns.
            By default the shorter way round.

        Examples
        --------
        >>> move = Move.straight([0, 0, 0], [2, 0, 1])
        >>> move.length, move.beta_0, move.beta_1
        (2.0, 0.0, -1.0)
        """
        a, dx, dy, turn = _apart(start, goal, turn)
        length = math.hypot(dx, dy)
        beta = (
            math.remainder(math.atan2(dy, dx) - a[2], 2 * math.pi)
            if length > NO_WAY
            else 0.0
        )
        end = (a[0] + dx, a[1] + dy, a[2] + turn)
        return cls("straight", _pose(a), _pose(end), length, turn, beta)

    @classmethod
    def arc(
        cls, start: npt.ArrayLike, goal: npt.ArrayLike, *, turn: float | None = None
    ) -> Move:
        """Return the move of constant body twist: a circular arc, a line, or a turn.

        Parameters
        ----------
        start, goal : (3,) float, m, m, rad
            (x, y, θ) of K.
        turn : float, rad, optional
            As of `straight`. No arc of a whole number of turns, other than none, leads
            to another place; use `along` for whole circles.

        Examples
        --------
        >>> quarter = Move.arc([0, 0, 0], [1, 1, 1.5707963267948966])
        >>> round(quarter.length, 6), round(quarter.beta_0, 6)
        (1.570796, 0.0)
        """
        a, dx, dy, turn = _apart(start, goal, turn)
        way = complex(dx, dy) * complex(math.cos(a[2]), -math.sin(a[2]))
        way /= _chord(turn)
        end = (a[0] + dx, a[1] + dy, a[2] + turn)
        return cls._arc(a, end, way, turn)

    @classmethod
    def along(cls, start: npt.ArrayLike, twist: npt.ArrayLike) -> Move:
        """Return the arc that a body twist drives in one unit of time.

        Parameters
        ----------
        start : (3,) float, m, m, rad
        twist : (3,) float, m, m, rad
            (vx, vy, ω) of K in the vehicle frame, times the time.

        Examples
        --------
        >>> Move.along([0, 0, 0], [1, 0, 0]).goal
        array([1., 0., 0.])
        """
        a = _floats(start)
        vx, vy, turn = _floats(twist)
        way = complex(vx, vy)
        moved = way * _chord(turn) * complex(math.cos(a[2]), math.sin(a[2]))
        return cls._arc(
            a, (a[0] + moved.real, a[1] + moved.imag, a[2] + turn), way, turn
        )

    @classmethod
    def _arc(
        cls,
        start: tuple[float, float, float],
        end: tuple[float, float, float],
        way: complex,
        turn: float,
    ) -> Move:
        length = abs(way)
        beta = math.atan2(way.imag + 0.0, way.real) if length > NO_WAY else 0.0
        return cls("arc", _pose(start), _pose(end), length, turn, beta)

    @property
    def beta_1(self) -> float:
        """Direction of travel at the goal, rad; β_0 - turn (straight) or β_0 (arc).

        Not wrapped: β goes from `beta_0` to `beta_1` without a jump.
        """
        return self.beta_0 - self.turn if self.shape == "straight" else self.beta_0

    def kappa_n(self, kappa_g: float) -> float:
        """Return the nominal curvature with v_s > 0.

        Parameters
        ----------
        kappa_g : float, 1/m, > 0
            Boundary curvature of the vehicle.

        Returns
        -------
        kappa_n : float, 1, [-2, 2]
        """
        p, q = self.length, abs(self.turn) / kappa_g
        size = 0.0 if q == 0 else q / p if q < p else 2.0 - p / q
        return math.copysign(size, self.turn)

    def poses(self, u: npt.ArrayLike) -> FloatArray:
        """Return the poses along the move.

        Parameters
        ----------
        u : (n,) float, 1, [0, 1]

        Returns
        -------
        poses : (n, 3) float, m, m, rad
            The heading is not wrapped.
        """
        u = np.asarray(u, dtype=np.float64)
        if self.shape == "straight":
            return self.start + u[:, None] * (self.goal - self.start)
        half = 0.5 * self.turn * u
        # The chord of an arc has the direction of its middle.
        chord = self.length * u * np.sinc(half / np.pi)
        direction = self.start[2] + self.beta_0 + half
        out = np.empty((u.size, 3))
        out[:, 0] = self.start[0] + chord * np.cos(direction)
        out[:, 1] = self.start[1] + chord * np.sin(direction)
        out[:, 2] = self.start[2] + self.turn * u
        return out

    def part(self, u: float, v: float) -> Move:
        """Return what lies between two parameters.

        Parameters
        ----------
        u, v : float, 1, 0 ≤ u < v ≤ 1
        """
        start, goal = self.poses([u, v])
        share = v - u
        beta = self.beta_0 + u * (self.beta_1 - self.beta_0)
        return Move(
            self.shape,
            _pose(_floats(start)),
            _pose(_floats(goal)),
            share * self.length,
            share * self.turn,
            float(wrap(beta)),
        )

    def reversed(self) -> Move:
        """Return the same way driven from goal to start."""
        beta = float(wrap(self.beta_1 + np.pi)) if self.length > NO_WAY else 0.0
        return Move(self.shape, self.goal, self.start, self.length, -self.turn, beta)


def goes_on(before: Move, after: Move) -> bool:
    """Return whether one move leaves in the twist in which the other one arrives.

    Parameters
    ----------
    before, after : Move
        Each with a length or a turn.
    """
    ends = []
    for move, beta in ((before, before.beta_1), (after, after.beta_0)):
        turn = HEADING_LENGTH * move.turn
        size = math.hypot(move.length, turn)
        length = move.length / size
        ends.append((length * math.cos(beta), length * math.sin(beta), turn / size))
    return math.dist(*ends) < SAME


def _apart(
    start: npt.ArrayLike, goal: npt.ArrayLike, turn: float | None
) -> tuple[tuple[float, float, float], float, float, float]:
    """Return the start and what lies between it and the goal."""
    a, b = _floats(start), _floats(goal)
    if turn is None:
        turn = math.remainder(b[2] - a[2], 2 * math.pi)
    return a, b[0] - a[0], b[1] - a[1], turn


def _chord(turn: float) -> complex:
    """Return the chord of an arc of length 1 that starts along the x axis."""
    half = 0.5 * turn
    size = math.sin(half) / half if half else 1.0
    return size * complex(math.cos(half), math.sin(half))


def _floats(values: npt.ArrayLike) -> tuple[float, float, float]:
    x, y, theta = np.asarray(values, dtype=np.float64).tolist()
    return x, y, theta


def _pose(values: tuple[float, float, float]) -> FloatArray:
    pose = np.array(values)
    pose.flags.writeable = False
    return pose
