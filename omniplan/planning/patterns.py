"""Patterns: ways between two poses for vehicles that cannot turn on the spot.

A *word* is one of Reeds and Shepp's, driven at a constant direction of travel β. A
*zigzag* is two moves without turning, at β and -β, and an arc before or after them for
the heading: a vehicle that crabs but a little moves sideways that way.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from omniplan.planning.moves import Move
from omniplan.planning.reeds_shepp import words
from omniplan.planning.task import Pose

__all__ = [
    "SHORT",
    "TURNLESS",
    "Frame",
    "Word",
    "Zigzag",
    "words_between",
    "zigzags_between",
]

SHORT, TURNLESS = 1e-7, 1e-7
"""Moves of less way, m, and turn, rad, are left out."""
JOINT = 1.0
"""What a stop between two moves counts where patterns are compared, s."""
ZIGZAGS = (0.97, 0.5)
"""Directions of zigzags, as shares of the largest |β|."""


@dataclass(frozen=True)
class Frame:
    """A direction of travel and the radius that the vehicle can drive there."""

    beta: float
    """rad"""
    radius: float
    """Least radius of both turns, m."""


@dataclass(frozen=True, slots=True)
class Word:
    """A Reeds-Shepp word in a frame."""

    price: float
    """About the time it takes, s."""
    frame: Frame
    turns: list[int]
    lengths: list[float]

    def moves(self, start: Pose) -> tuple[Move, ...]:
        """Return its pieces from a pose on."""
        beta, radius = self.frame.beta, self.frame.radius
        e = complex(math.cos(beta), math.sin(beta)) * radius
        steps = zip(self.turns, self.lengths, strict=True)
        return _driven(start, [(size * e, turn * size) for turn, size in steps])


@dataclass(frozen=True, slots=True)
class Zigzag:
    """Two moves at opposite directions of travel, and an arc before or after them."""

    price: float
    """About the time it takes, s."""
    way: complex
    """Displacement of the two moves in the vehicle frame, m."""
    beta: float
    """Direction of the first move, rad."""
    arc: complex
    """Way of the arc in the vehicle frame, m, of either sign."""
    turn: float
    """What the arc turns, rad."""
    is_first: bool
    """Whether the arc comes first."""

    def moves(self, start: Pose) -> tuple[Move, ...]:
        """Return its moves from a pose on."""
        e = complex(math.cos(self.beta), math.sin(self.beta))
        # way = one e^{jβ} + other e^{-jβ}
        one = (self.way.real / e.real + self.way.imag / e.imag) / 2
        other = (self.way.real / e.real - self.way.imag / e.imag) / 2
        steps = [(one * e, 0.0), (other * e.conjugate(), 0.0)]
        arc = (self.arc, self.turn)
        return _driven(start, [arc, *steps] if self.is_first else [*steps, arc])


def words_between(a: Pose, b: Pose, frame: Frame, speed: float) -> list[Word]:
    """Return all words from pose to pose, those that take least time first.

    Parameters
    ----------
    a, b : (float, float, float), m, m, rad
    frame : Frame
    speed : float, m/s
        What way is compared with stops at.
    """
    local = _local(a, b, frame.beta) / frame.radius
    turns, lengths = words(local.real, local.imag, b[2] - a[2])
    price = np.abs(lengths).sum(axis=1) * (frame.radius / speed)
    price += JOINT * (np.abs(lengths) > SHORT).sum(axis=1)
    return [
        Word(float(price[i]), frame, turns[i].tolist(), lengths[i].tolist())
        for i in np.argsort(price, kind="stable").tolist()
    ]


def zigzags_between(
    a: Pose, b: Pose, largest: float, radius: float, speed: float
) -> list[Zigzag]:
    """Return zigzags from pose to pose.

    Parameters
    ----------
    a, b : (float, float, float), m, m, rad
    largest : float, rad, (0, π/2]
        Largest |β| without turning.
    radius : float, m
        Of the arc.
    speed : float, m/s
        What way is compared with stops at.
    """
    way = _local(a, b, 0.0)
    turn = math.remainder(b[2] - a[2], 2 * math.pi)
    turns = abs(turn) > TURNLESS
    arcs = [complex(side * turn * radius) for side in (1, -1)] if turns else [0j]
    found = []
    for arc, is_first in itertools.product(arcs, (True, False) if turns else (True,)):
        rest = way - complex(*Move.along((0, 0, 0), (arc.real, 0, turn)).goal[:2])
        if is_first:  # what follows is driven at the new heading
            rest *= complex(math.cos(turn), -math.sin(turn))
        for share, side in itertools.product(ZIGZAGS, (1, -1)):
            beta = side * share * largest
            length = max(
                abs(rest.real / math.cos(beta)), abs(rest.imag / math.sin(beta))
            )
            price = (length + abs(arc)) / speed + JOINT * (2 + turns)
            found.append(Zigzag(price, rest, beta, arc, turn, is_first))
    return found


def _local(a: Pose, b: Pose, beta: float) -> complex:
    """Return the way from pose to pose, turned to a direction of travel."""
    heading = a[2] + beta
    way = complex(b[0] - a[0], b[1] - a[1])
    return way * complex(math.cos(heading), -math.sin(heading))


def _driven(start: Pose, steps: Sequence[tuple[complex, float]]) -> tuple[Move, ...]:
    """Return the arcs of ways and turns one after the other."""
    at: Sequence[float] = start
    moves: list[Move] = []
    for way, turn in steps:
        if abs(way) > SHORT or abs(turn) > TURNLESS:
            moves.append(Move.along(at, (way.real, way.imag, turn)))
            at = moves[-1].goal.tolist()
    return tuple(moves)
