"""Easing: arcs of a vehicle bound to a line are joined by ramps of curvature.

Where one arc follows another the curvature jumps, and the vehicle would have to stand
and steer. With a ramp of the curvature in place of each jump it drives through. That
alone would lead elsewhere: lengths and curvatures of all arcs are changed as little as
leads to the goal again (Newton's method, the least step of those that do). Cusps stay:
the vehicle stands there anyway.

Ramps of length 2 h move an arc aside by about κ (2 h)² / 24, so short ones are free
where long ones are not.

References
----------
D. Shin, S. Singh, Path generation for robot vehicles using composite clothoid segments,
CMU-RI-TR-90-31, 1990.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from omniplan.planning.blend import is_free, timed
from omniplan.planning.connect import Connector
from omniplan.planning.moves import Move
from omniplan.planning.route import Route
from omniplan.planning.task import Task
from omniplan.samples import locked

__all__ = ["Eased", "eased", "eased_off"]

FloatArray = npt.NDArray[np.float64]

SHARES = (0.95, 0.6, 0.35, 0.2, 0.1)
"""Ramps take so much of the room that the arcs leave them; tried in turn."""
LONGEST = 1.0
"""Half a ramp is no longer than this, m ..."""
SHORTEST = (0.25, 0.05)
"""Arcs shorter than this are left out, m: each is tried, the quickest way counts."""
LEAST = 1e-3
"""... and those shorter than this always."""
SAME = 1e-4
"""Arcs whose curvature differs by less are one, 1/m."""
TIGHTEST = 1e-3
"""Radii below this are turns on the spot, m."""
MORE = 5e-4
"""Curvatures may be larger than those of moves by this share."""
STEPS = 25
"""Newton steps."""
CLOSED = 1e-11
"""A way that misses the goal by less, m and rad, leads there."""
DIFFERENCE = 1e-6
"""Step for the derivatives, m and 1/m."""
BENDING = 0.5
"""A change of the curvature by so much, in κ_max per metre of length, costs as much as
a change of a length by 1 m."""
TURN, BEND, STEP = 0.04, 0.03, 0.2
"""From pose to pose the heading changes by so much at most, rad, the curvature, in
κ_max, and the way, m."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_NODES, _WEIGHTS = (_NODES + 1) / 2, _WEIGHTS / 2


@dataclass(frozen=True, eq=False)
class Eased:
    """Arcs with ramps of the curvature between them."""

    start: FloatArray
    """(3,) m, m, rad: (x, y, θ) of K."""
    line: float
    """β of the line that K drives along, rad."""
    signs: FloatArray
    """(n,) ±1: forwards or backwards along the line."""
    lengths: FloatArray
    """(n,) m, > 0."""
    curvatures: FloatArray
    """(n,) 1/m, over the way driven forwards."""
    ramps: FloatArray
    """(n - 1,) m: half the length of the ramps; 0 at cusps."""

    @classmethod
    def of(
        cls, moves: Sequence[Move], line: float, shortest: float = 0.0
    ) -> Eased | None:
        """Return moves without ramps; None if one of them is a turn on the spot.

        Those too short for ramps are left out: what leads to the goal does without.

        Parameters
        ----------
        moves : sequence of Move
            Along the line, each beginning where the one before ends.
        line : float, rad
        shortest : float, m
            Arcs shorter than this are left out.
        """
        start = moves[0].start
        if any(move.length < abs(move.turn) * TIGHTEST for move in moves):
            return None
        arcs: list[tuple[float, float, float]] = []
        for move in moves:
            if move.length <= max(shortest, LEAST):
                continue
            sign = math.copysign(1.0, math.cos(move.beta_0 - line))
            length, bend = move.length, sign * move.turn / move.length
            if arcs and arcs[-1][0] == sign and abs(arcs[-1][2] - bend) < SAME:
                length += arcs.pop()[1]
            arcs.append((sign, length, bend))
        if len(arcs) < 2:
            return None
        signs, lengths, bends = np.array(arcs).T
        return cls(start, line, signs, lengths, bends, np.zeros(len(arcs) - 1))

    @property
    def jumps(self) -> npt.NDArray[np.bool_]:
        """(n - 1,) Whether the curvature jumps at a joint that is no cusp."""
        same = self.signs[1:] == self.signs[:-1]
        return np.asarray(same & (np.abs(np.diff(self.curvatures)) > SAME))

    @property
    def room(self) -> FloatArray:
        """(n - 1,) m: how much of both sides a ramp can take, at most."""
        jumps = np.concatenate([[False], self.jumps, [False]])
        # Between two ramps each has one half.
        rooms = self.lengths / np.maximum(jumps[1:].astype(int) + jumps[:-1], 1)
        room = np.minimum(np.minimum(rooms[1:], rooms[:-1]), LONGEST)
        return np.where(self.jumps, room, 0.0)

    @property
    def rest(self) -> FloatArray:
        """(n,) m: what the ramps leave of the arcs."""
        around = np.concatenate([[0.0], self.ramps, [0.0]])
        return np.asarray(self.lengths - around[1:] - around[:-1])

    def _pieces(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return signed lengths and curvatures at both ends: arcs and ramps in turn."""
        n = len(self.lengths)
        ways, first, last = np.zeros((3, 2 * n - 1))
        ways[::2] = self.signs * self.rest
        first[::2] = last[::2] = self.curvatures
        ways[1::2] = self.signs[1:] * 2 * self.ramps
        first[1::2], last[1::2] = self.curvatures[:-1], self.curvatures[1:]
        return ways, first, last

    def goal(self) -> FloatArray:
        """Return the pose it leads to, (3,) m, m, rad."""
        ways, first, last = self._pieces()
        heading = np.cumsum([self.start[2], *(ways * (first + last) / 2)])
        u = _NODES[:, None]
        turned = ways * _turned(first, last, u)
        e = np.exp(1j * (heading[:-1] + self.line + turned))
        at = complex(self.start[0], self.start[1]) + (ways * (_WEIGHTS @ e)).sum()
        return np.array([at.real, at.imag, heading[-1]])

    def closed(self, goal: FloatArray, largest: float) -> Eased | None:
        """Return what leads to a pose with little change; None if nothing is found.

        Parameters
        ----------
        goal : (3,) float, m, m, rad
        largest : float, 1/m
            Largest curvature.
        """
        n, way = len(self.lengths), self
        scale = np.concatenate([np.ones(n), np.full(n, BENDING * largest)])
        for _ in range(STEPS):
            off = goal - way.goal()
            off[2] = math.remainder(off[2], 2 * math.pi)
            if np.abs(off).max() < CLOSED:
                return way
            slopes = way._slopes() * scale
            stuck = np.zeros(2 * n, dtype=bool)
            for _ in range(2):  # what is at its largest curvature already stays there
                free = np.where(stuck, 0.0, slopes)
                step = scale * (np.linalg.pinv(free, rcond=1e-9) @ off)
                bends = way.curvatures + step[n:]
                stuck[n:] |= np.abs(bends) > largest
            bends = np.clip(way.curvatures + step[n:], -largest, largest)
            way = replace(way, lengths=way.lengths + step[:n], curvatures=bends)
            if way.rest.min() < 0:
                return None
        return None

    def _slopes(self) -> FloatArray:
        """Return the derivatives of the goal by lengths and curvatures, (3, 2 n)."""
        columns = []
        for name in ("lengths", "curvatures"):
            values = getattr(self, name)
            for i in range(len(values)):
                step = DIFFERENCE * (np.arange(len(values)) == i)
                ends = [
                    replace(self, **{name: values + side * step}).goal()
                    for side in (1, -1)
                ]
                columns.append((ends[0] - ends[1]) / (2 * DIFFERENCE))
        return np.stack(columns, axis=1)

    def to_route(self, largest: float) -> Route:
        """Return the poses and the stops, which are at the cusps.

        Parameters
        ----------
        largest : float, 1/m
            Largest curvature of the vehicle.
        """
        at, poses, stops, row = self.start, [self.start[None]], [], 0
        signs = np.repeat(self.signs, 2)[1:]
        for i, (way, first, last) in enumerate(zip(*self._pieces(), strict=True)):
            if way:
                rest = _along(at, self.line, way, first, last, largest)
                at, row = rest[-1], row + len(rest)
                poses.append(rest)
            if i % 2 == 1 and signs[i] != signs[i - 1]:
                stops.append(row)
        return Route(locked(np.concatenate(poses)), tuple(stops))


def eased_off(
    task: Task, connector: Connector, moves: Sequence[Move]
) -> tuple[Route, float] | None:
    """Return an eased route that is permitted and free, and its time, s; else None.

    Parameters
    ----------
    task : Task
    connector : Connector
    moves : sequence of Move
        Each beginning where the one before ends.
    """
    line = task.space.line_beta
    if line is None or not connector.frames:
        return None
    largest = (1 + MORE) / connector.frames[0].radius
    found = []
    for shortest in SHORTEST:
        for way in eased(moves, line, largest, shortest):
            task.budget.check()
            if task.budget.is_late:
                break
            route = way.to_route(largest)
            if not is_free(task, route.poses):
                continue
            time = timed(task, connector.permits, route)
            if math.isfinite(time):
                found.append((route, time))
                break
    return min(found, key=lambda pair: pair[1], default=None)


def eased(
    moves: Sequence[Move], line: float, largest: float, shortest: float = 0.0
) -> Iterator[Eased]:
    """Yield eased ways with the ends of moves, those with the longest ramps first.

    Parameters
    ----------
    moves : sequence of Move
        Along the line, each beginning where the one before ends.
    line : float, rad
        β of the line.
    largest : float, 1/m
        Largest curvature.
    shortest : float, m
        Arcs shorter than this are left out.
    """
    plain = Eased.of(moves, line, shortest)
    if plain is None or not plain.jumps.any():
        return
    for share in SHARES:
        way = replace(plain, ramps=share * plain.room).closed(moves[-1].goal, largest)
        if way is not None:
            yield way


def _turned(
    first: FloatArray | float, last: FloatArray | float, u: FloatArray
) -> FloatArray:
    """Return the turn up to a share of a ramp, per metre of it.

    The curvature is `first` + (`last` - `first`) (3 u² - 2 u³): splines through the
    poses follow it without overshoot, and wheels begin and end to steer gently.
    """
    return np.asarray(first * u + (last - first) * (u**3 - u**4 / 2))


def _along(
    at: FloatArray, line: float, way: float, first: float, last: float, largest: float
) -> FloatArray:
    """Return the poses of one piece after its start."""
    turn = way * (first + last) / 2
    steps = max(
        math.ceil(abs(turn) / TURN),
        math.ceil(abs(last - first) / (BEND * largest)),
        math.ceil(abs(way) / STEP),
        4,
    )
    u = np.arange(steps + 1) / steps
    heading = at[2] + way * _turned(first, last, u)
    inner = (u[:-1, None] + _NODES / steps).ravel()
    course = at[2] + line + way * _turned(first, last, inner)
    chords = np.exp(1j * course).reshape(steps, -1) @ _WEIGHTS * (way / steps)
    places = complex(at[0], at[1]) + np.cumsum(chords)
    return np.stack([places.real, places.imag, heading[1:]], axis=1)
