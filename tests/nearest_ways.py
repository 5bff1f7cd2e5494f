"""Nearest ways by a second solver: wheel equations by hand, SciPy's SLSQP.

It shares nothing with `omniplan.optimising` but the definition of the change: a way is
rolled out from N short arcs, each with a length, a turn and a direction of travel.
Wheels may jump to another angle from arc to arc, so what it finds needs a little less
change than what a vehicle can drive.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize

from configspace import Vehicle

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

STEPS = 40
"""Arcs of a way."""
PLACES = 160
"""Places of the way given."""


def even_poses(poses: FloatArray, count: int, arm: float) -> FloatArray:
    """Return places evenly along a polygon of poses; a radian counts `arm`."""
    step = np.linalg.norm(np.diff(poses, axis=0) * [1.0, 1.0, arm], axis=1)
    gone = np.concatenate([[0.0], np.cumsum(step)])
    at = np.linspace(0.0, gone[-1], count + 1)
    return np.stack([np.interp(at, gone, column) for column in poses.T], axis=-1)


def change_between(
    one: FloatArray, other: FloatArray, arm: float
) -> tuple[float, float]:
    """Return root mean square and largest distance of two polygons, both ways, m.

    Point by point against segment by segment: the plain reading of the definition.
    """
    means, largest = [], 0.0
    for points, way in ((one, other), (other, one)):
        points, way = points * [1.0, 1.0, arm], way * [1.0, 1.0, arm]
        off = np.array([_nearest(p, way) for p in points])
        gone = np.linalg.norm(np.diff(points, axis=0), axis=1)
        square = (off[1:] ** 2 + off[:-1] ** 2) / 2
        means.append(float(square @ gone / gone.sum()))
        largest = max(largest, float(off.max()))
    return math.sqrt(max(means)), largest


def _nearest(point: FloatArray, way: FloatArray) -> float:
    best = math.inf
    for a, b in itertools.pairwise(way):
        step = b - a
        size = float(step @ step)
        share = (
            0.0 if size == 0 else min(max(float((point - a) @ step) / size, 0.0), 1.0)
        )
        best = min(best, float(np.linalg.norm(point - a - share * step)))
    return best


@dataclass(frozen=True, eq=False)
class Pillar:
    """A convex obstacle, and a convex footprint that keeps a distance from it."""

    corners: ComplexArray
    footprint: ComplexArray
    """From K."""
    clearance: float


class NearestWay:
    """The way nearest to one given that a vehicle's wheels can follow."""

    def __init__(
        self,
        vehicle: Vehicle,
        given: FloatArray,
        *,
        sign: int = 1,
        pillar: Pillar | None = None,
    ) -> None:
        """Take a vehicle and the poses of K, (n, 3) m, m, rad."""
        self.arm = 1 / vehicle.boundary_curvature
        self.scale = np.array([1.0, 1.0, self.arm])
        self.given, self.sign, self.pillar = given, sign, pillar
        self.places = even_poses(given, PLACES, self.arm) * self.scale
        self.steered: list[tuple[complex, float, float]] = []
        self.crabs = True
        for wheel in vehicle.wheels:
            data: Any = wheel
            at = complex(data.x, data.y) - vehicle.reference
            if data.type == "fixed":
                self.crabs = False
            elif data.type == "steered" and data.steering_range_deg is not None:
                low, high = np.radians(data.steering_range_deg)
                if high - low < math.pi:
                    self.steered.append((at, (low + high) / 2, (high - low) / 2))

    # --- ways

    def split(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return lengths, turns and directions of the arcs, (..., STEPS)."""
        length, turn = x[..., :STEPS], x[..., STEPS : 2 * STEPS]
        beta = x[..., 2 * STEPS :] if self.crabs else np.zeros_like(length)
        return length, turn, beta

    def poses(self, x: FloatArray) -> FloatArray:
        """Return the poses between the arcs, (..., STEPS + 1, 3)."""
        length, turn, beta = self.split(x)
        start = np.broadcast_to(self.given[0], (*x.shape[:-1], 3))
        heading = start[..., 2:] + np.cumsum(turn, axis=-1)
        before = np.concatenate([start[..., 2:], heading[..., :-1]], axis=-1)
        chord = self.sign * length * np.sinc(turn / (2 * math.pi))
        step = chord * np.exp(1j * (before + turn / 2 + beta))
        place = (start[..., :1] + 1j * start[..., 1:2]) + np.cumsum(step, axis=-1)
        rest = np.stack([place.real, place.imag, heading], axis=-1)
        return np.concatenate([start[..., None, :], rest], axis=-2)

    def start(self, way: FloatArray) -> FloatArray:
        """Return the arcs along poses, whether wheels can follow them or not."""
        poses = even_poses(way, STEPS, self.arm)
        place = poses[:, 0] + 1j * poses[:, 1]
        step, turn = np.diff(place), np.diff(poses[:, 2])
        length = np.maximum(np.abs(step), 1e-4)
        middle = (poses[1:, 2] + poses[:-1, 2]) / 2
        if not self.crabs:
            return np.concatenate([length, turn])
        beta = np.angle(self.sign * step * np.exp(-1j * middle))
        return np.concatenate([length, turn, np.unwrap(beta)])

    # --- what is least, and what must be kept

    def _offsets(
        self, poses: FloatArray, which: tuple[Any, Any]
    ) -> tuple[FloatArray, FloatArray]:
        """Return squared distances, both ways, to the segments chosen."""
        made, places = poses * self.scale, self.places
        first = _to_segment(made, places[which[0]], places[which[0] + 1])
        chosen = made[..., which[1], :], made[..., which[1] + 1, :]
        return first, _to_segment(places, *chosen)

    def _chosen(self, poses: FloatArray) -> tuple[Any, Any]:
        made, places = poses * self.scale, self.places
        one = _to_segment(made[:, None], places[:-1], places[1:])
        other = _to_segment(places[:, None], made[:-1], made[1:])
        return one.argmin(axis=1), other.argmin(axis=1)

    def _squares(self, x: FloatArray, which: tuple[Any, Any]) -> FloatArray:
        """Return the mean square of the change, both ways, over arm²."""
        poses = self.poses(x)
        off, back = self._offsets(poses, which)
        gone = np.linalg.norm(np.diff(poses * self.scale, axis=-2), axis=-1)
        there = ((off[..., 1:] + off[..., :-1]) / 2 * gone).sum(-1) / gone.sum(-1)
        here = ((back[..., 1:] + back[..., :-1]) / 2).mean(axis=-1)
        return np.asarray((there + here) / 2 / self.arm**2)

    def objective(self, x: FloatArray) -> tuple[float, FloatArray]:
        """Return the mean square of the change and its gradient."""
        which = self._chosen(self.poses(x))
        step = 1e-7
        moved = self._squares(x + step * np.eye(x.size), which)
        f = float(self._squares(x, which))
        return f, (moved - f) / step

    def _goal(self, x: FloatArray) -> FloatArray:
        end = self.poses(x)[..., -1, :] - self.given[-1]
        return np.asarray(end * self.scale / self.arm)

    def _room(self, x: FloatArray) -> FloatArray:
        """Return what must not be negative: wheels in their ranges, free room."""
        length, turn, beta = self.split(x)
        rows = []
        for at, middle, half in self.steered:
            u = self.sign * length * np.exp(1j * beta) + 1j * turn * at
            u = self.sign * u * np.exp(-1j * middle)
            for side in (1, -1):
                rows.append((math.tan(half) * u.real - side * u.imag) / self.arm)
            rows.append(u.real / self.arm)
        if self.pillar is not None:
            poses = self.poses(x)
            both = (poses[..., 1:, :] + poses[..., :-1, :]) / 2
            rows.append(_gap(poses[..., 1:-1, :], self.pillar) / self.arm)
            rows.append(_gap(both, self.pillar) / self.arm)
        if not rows:
            return np.zeros((*x.shape[:-1], 0))
        return np.concatenate(rows, axis=-1)

    def solve(self, way: FloatArray, *, iterations: int = 150) -> FloatArray | None:
        """Return the nearest way near a start, None if it is not one."""
        x = self.start(way)
        free = np.full(x.size, np.inf)
        low = -free
        low[:STEPS] = 0.0
        low[STEPS : 2 * STEPS], free[STEPS : 2 * STEPS] = -0.6, 0.6

        def slope(f: Any) -> Any:
            def jacobian(x: FloatArray) -> FloatArray:
                step = 1e-7
                return np.asarray((f(x + step * np.eye(x.size)) - f(x)).T / step)

            return jacobian

        rules = [
            {"type": "eq", "fun": self._goal, "jac": slope(self._goal)},
            {"type": "ineq", "fun": self._room, "jac": slope(self._room)},
        ]
        solver: Any = minimize
        found = solver(
            self.objective,
            np.clip(x, low, free),
            jac=True,
            bounds=list(zip(low, free, strict=True)),
            constraints=rules if self._room(x).size else rules[:1],
            method="SLSQP",
            options={"maxiter": iterations, "ftol": 1e-9},
        )
        at = np.asarray(found.x)
        is_kept = np.abs(self._goal(at)).max() < 1e-4
        is_kept &= self._room(at).min(initial=0.0) > -1e-4
        return self.poses(at) if is_kept else None

    def best(
        self, starts: Sequence[FloatArray], rng: np.random.Generator, *, extra: int = 1
    ) -> FloatArray | None:
        """Return the nearest way from several starts and disturbed copies of them."""
        tried = list(starts)
        for _ in range(extra):
            share = np.linspace(0.0, 1.0, len(self.given))
            push = sum(
                rng.normal(0, 0.1, (1, 3)) * np.sin(k * math.pi * share)[:, None]
                for k in (1, 2, 3)
            )
            tried.append(self.given + push * np.array([1.0, 1.0, 0.3]))
        found = [way for start in tried if (way := self.solve(start)) is not None]
        return min(found, key=self.change, default=None)

    def change(self, way: FloatArray) -> float:
        """Return the change of a way, m: root mean square, the larger of both ways."""
        poses = even_poses(way, max(PLACES, len(way)), self.arm) * self.scale
        means = []
        for points, other in ((poses, self.places), (self.places, poses)):
            off = _to_segment(points[:, None], other[:-1], other[1:]).min(axis=1)
            means.append(float(((off[1:] + off[:-1]) / 2).mean()))
        return math.sqrt(max(means))


def _to_segment(points: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """Return squared distances of points from segments."""
    step = b - a
    size = np.maximum((step**2).sum(-1), 1e-18)
    share = np.clip(((points - a) * step).sum(-1) / size, 0.0, 1.0)
    off = points - a - share[..., None] * step
    return np.asarray((off**2).sum(-1))


def _gap(poses: FloatArray, pillar: Pillar) -> FloatArray:
    """Return the distance from the obstacle less the clearance; negative: depth."""
    place = poses[..., 0] + 1j * poses[..., 1]
    body = place[..., None] + np.exp(1j * poses[..., 2:]) * pillar.footprint
    other = np.broadcast_to(pillar.corners, (*body.shape[:-1], pillar.corners.size))
    depth = np.maximum(_beyond(body, other), _beyond(other, body))
    apart = np.minimum(_from_edges(body, other), _from_edges(other, body))
    return np.asarray(np.where(depth > 0, apart, depth) - pillar.clearance)


def _beyond(body: ComplexArray, other: ComplexArray) -> FloatArray:
    """Return by how much edges of one convex polygon have the other outside."""
    edge = np.roll(body, -1, axis=-1) - body
    area = (np.conj(body) * np.roll(body, -1, axis=-1)).imag.sum(-1)
    out = -1j * edge / np.abs(edge) * np.sign(area)[..., None]
    since = other[..., None, :] - body[..., :, None]
    return np.asarray((since * np.conj(out)[..., None]).real.min(-1).max(-1))


def _from_edges(points: ComplexArray, other: ComplexArray) -> FloatArray:
    edge = np.roll(other, -1, axis=-1) - other
    since = points[..., :, None] - other[..., None, :]
    share = (since * np.conj(edge)[..., None, :]).real / np.abs(edge[..., None, :]) ** 2
    off = since - np.clip(share, 0.0, 1.0) * edge[..., None, :]
    return np.asarray(np.abs(off).min(axis=(-1, -2)))
