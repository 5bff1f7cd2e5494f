"""The quickest way of the wheels from one configuration to another.

A configuration is a point (c e^{jβ}, s) of a sphere; its coordinates here are those of
Connette, φ = β and θ with ``tan θ = s / c``, taken past the poles as well, where they
form a torus. The wheels' singular points are the holes of this surface. Time is asked
for by steering, ``|Δα_i| / α̇_max,i``, and by a bound on the speed in (φ, θ) if given.

A grid is searched for the quickest way (Dijkstra), which is then pulled straight and
polished; the time is that of the way found, so it can be too long but never too short.

References
----------
Connette 2013, sections 4.1 and 5.2; spec/steered-wheels §3.3, §3.6, S2.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.sparse import csgraph, csr_array

from configspace import InvalidInput, Problem, Vehicle
from configspace.exact import steering_excess, turning_excess
from configspace.limits import SectorRow, rows_of
from configspace.omni_curve import curvature_of_ratio, nominal_curvature
from configspace.spherical import omni_curve_to_spherical
from configspace.vehicle import SteerableWheel

__all__ = ["Transition", "TransitionMap"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
Configuration = tuple[float, float]

N_PHI, N_THETA = 120, 60
"""Nodes of the searched grid over φ and from pole to pole."""
OFFSETS = ((1, 0), (0, 1), (1, 1), (1, -1), (2, 1), (2, -1), (1, 2), (1, -2))
"""Steps from node to node, in nodes over (φ, θ); their opposites as well."""
STEP = 0.01
"""A way is followed in steps of this length, rad."""
MAX_TURN = 0.5
"""A wheel that turns more than this in one step is passed too closely, rad."""
LENGTH_WEIGHT = 1e-4
"""Seconds per rad of the way, so that among equals the shorter one is taken."""
POLISH = (0.05, 0.02, 0.01, 0.004, 0.0015)
"""By how much corners of the way are moved to make it quicker, rad."""


@dataclass(frozen=True, eq=False)
class Transition:
    """A way from configuration to configuration and the time it takes."""

    way: FloatArray
    """(n, 2) κ_n, β along the way; at a pole β may jump, as it has no meaning there."""
    time: float
    """s."""
    wheel: str
    """Id of the wheel that turns most."""
    turn: float
    """What that wheel turns in all, rad."""
    max_steering_rate: float
    """Largest steering rate of any wheel along the way, rad/s."""
    is_mirrored: bool
    """Whether the goal is reached with every wheel turned by π and v_s negated."""


class TransitionMap:
    """The searched surface of one vehicle; build it once, ask it often."""

    def __init__(self, vehicle: Vehicle, path_speed: float | None = None) -> None:
        """Prepare the search.

        Parameters
        ----------
        vehicle : Vehicle
            With at least one steered wheel.
        path_speed : float, rad/s, > 0, optional
            Bound on the speed in (φ, θ); by default steering alone takes time.

        Raises
        ------
        InvalidInput
            If no wheel steers, or neither wheels nor `path_speed` bound the speed.
        """
        wheels = [
            (i, wheel)
            for i, wheel in enumerate(vehicle.wheels)
            if isinstance(wheel, SteerableWheel)
        ]
        mobility = vehicle.mobility
        if not wheels or mobility.line_beta is not None or mobility.is_translating:
            raise InvalidInput(
                Problem(
                    "vehicle",
                    vehicle.name,
                    "needs steered wheels and none that bind it to a line",
                )
            )
        self._rates = np.array([_rate(wheel) for _, wheel in wheels])
        if path_speed is None and not np.isfinite(self._rates).any():
            raise InvalidInput(
                Problem(
                    "path_speed", "none", "needed where no wheel has a steering rate"
                )
            )
        if path_speed is not None and not (0 < path_speed < math.inf):
            raise InvalidInput(Problem("path_speed", f"{path_speed}", "must be > 0"))
        self._ids = [wheel.id for _, wheel in wheels]
        self._sectors: tuple[SectorRow, ...] = rows_of(vehicle)[1]
        self._levers = np.array([row.b for row in self._sectors])
        self._path_speed = path_speed or math.inf

    def between(
        self, start: Configuration, goal: Configuration, *, mirrored: bool = False
    ) -> Transition | None:
        """Return the quickest way found, None if there is none.

        Parameters
        ----------
        start, goal : (κ_n, β)
        mirrored : bool
            Whether the goal may also be reached with every wheel turned by π (the
            representations R3 and R4), whichever is quicker.

        Raises
        ------
        InvalidInput
            If a value is not finite or κ_n is outside [-2, 2].
        """
        a, b = _point(start), _point(goal)
        images = [(b, False)]
        if mirrored:
            images.append((np.array([b[0] + np.pi, -b[1]]), True))
        search = _Search(self, a)
        found = [(self._corners(search, image), flag) for image, flag in images]
        ways = [(self._time(c), c, flag) for c, flag in found if c is not None]
        if not ways:
            return None
        _, corners, flag = min(ways, key=lambda way: way[0])
        return self._described(corners, flag)

    def is_permitted(self, at: Configuration) -> bool:
        """Return whether a configuration keeps all steering ranges and zones."""
        return bool(self._open(_point(at)[None])[0])

    def _corners(self, search: _Search, b: FloatArray) -> FloatArray | None:
        """Return the corners of the quickest way, (n, 2) φ, θ unrolled."""
        a = search.start
        if not self._open(np.stack([a, b])).all():
            return None
        straight = np.stack([a, _nearest(a, b)])
        if np.linalg.norm(straight[1] - straight[0]) < 1e-9:
            return straight
        way = search.way_to(b)
        options = [self._polished(straight)]
        if way is not None:
            options.append(self._polished(self._pulled(way)))
        best = min(options, key=self._time)
        return best if math.isfinite(self._time(best)) else None

    def links(self, point: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the nodes around a point and the time to each."""
        images = np.stack([_nearest(point, node) for node in _images(point)])
        cells = np.array([2 * np.pi / N_PHI, np.pi / N_THETA])
        candidates = []
        for image in images:
            at = np.floor((image - [-np.pi, -np.pi / 2]) / cells - 0.5).astype(int)
            for i in range(-1, 3):
                for j in range(-1, 3):
                    if 0 <= at[1] + j < N_THETA:
                        candidates.append((at[0] + i) % N_PHI * N_THETA + at[1] + j)
        near = np.unique(np.array(candidates, dtype=np.int64))
        ends = np.stack([_nearest(point, self.nodes[node]) for node in near])
        cost = self._times(np.broadcast_to(point, ends.shape), ends)
        open_ = np.isfinite(cost)
        return near[open_], cost[open_]

    def _pulled(self, way: FloatArray) -> FloatArray:
        """Return the way with straight pieces where they are quicker."""
        n = len(way)
        first, last = np.triu_indices(n, 1)
        price = np.full((n, n), np.inf)
        price[first, last] = self._times(way[first], way[last])
        best, before = np.full(n, np.inf), np.zeros(n, dtype=int)
        best[0] = 0.0
        for j in range(1, n):
            options = best[:j] + price[:j, j]
            before[j] = int(options.argmin())
            best[j] = options[before[j]]
        chain = [n - 1]
        while chain[-1] != 0:
            chain.append(int(before[chain[-1]]))
        return way[chain[::-1]]

    def _polished(self, corners: FloatArray) -> FloatArray:
        """Return the way with its corners moved, and new ones, to be quicker."""
        best = corners
        if math.isfinite(self._time(corners)):
            # A way that rates bound is quicker with a bend in the middle.
            halves = np.insert(
                corners, np.arange(1, len(corners)), (corners[1:] + corners[:-1]) / 2, 0
            )
            best = halves if len(halves) <= 9 else corners
        angles = np.arange(8) * np.pi / 4
        around = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        for size in POLISH:
            for i in range(1, len(best) - 1):
                moved = best[i] + size * np.concatenate([[[0.0, 0.0]], around])
                count = len(moved)
                before = np.broadcast_to(best[i - 1], (count, 2))
                after = np.broadcast_to(best[i + 1], (count, 2))
                cost = self._times(before, moved) + self._times(moved, after)
                best = best.copy()
                best[i] = moved[int(np.argmin(cost))]
        return best

    def _described(self, corners: FloatArray, is_mirrored: bool) -> Transition:
        points = _stepped(corners)
        turns = self._turns(points[None])[0]
        length = np.linalg.norm(np.diff(points, axis=0), axis=-1)
        times = np.maximum(
            (turns / self._rates).max(axis=-1), length / self._path_speed
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            rates = np.where(turns > 0, turns / times[:, None], 0.0)
        total = turns.sum(axis=0)
        worst = int(total.argmax())
        return Transition(
            way=_to_omni_curve(points),
            time=float(times.sum()),
            wheel=self._ids[worst],
            turn=float(total[worst]),
            max_steering_rate=float(rates.max(initial=0.0)),
            is_mirrored=is_mirrored,
        )

    def _time(self, corners: FloatArray) -> float:
        """Return the time along corners, s; infinite if the way is closed."""
        points = _stepped(corners)
        if not self._open(points).all():
            return math.inf
        return float(self._step_times(points[None]).sum())

    def _times(self, start: FloatArray, end: FloatArray) -> FloatArray:
        """Return the time along straight pieces, (m, 2) each; infinite if closed."""
        out = np.empty(len(start))
        steps = np.maximum(
            np.ceil(np.linalg.norm(end - start, axis=1) / STEP).astype(int), 2
        )
        # Pieces of like length together, so that short ones stay cheap.
        size = 2 ** np.ceil(np.log2(steps)).astype(int)
        for count in np.unique(size):
            those = np.flatnonzero(size == count)
            f = np.linspace(0, 1, count + 1)[:, None]
            points = start[those, None] + f * (end - start)[those, None]
            time = self._step_times(points).sum(axis=1)
            out[those] = np.where(self._open(points).all(axis=1), time, np.inf)
        return out

    def _step_times(self, points: FloatArray) -> FloatArray:
        """Return the time of every step along ways, (m, k, 2) -> (m, k - 1)."""
        turns = self._turns(points)
        steering = (turns / self._rates).max(axis=-1)
        length = np.linalg.norm(np.diff(points, axis=1), axis=-1)
        time = np.maximum(steering, length / self._path_speed) + LENGTH_WEIGHT * length
        return np.where((turns > MAX_TURN).any(axis=-1), np.inf, time)

    def _turns(self, points: FloatArray) -> FloatArray:
        """Return |Δα_i| of every step, (m, k, 2) -> (m, k - 1, wheels)."""
        z = np.cos(points[..., 1]) * np.exp(1j * points[..., 0])
        z = z[..., None] + np.sin(points[..., 1])[..., None] * self._levers
        return np.asarray(np.abs(np.angle(z[:, 1:] * z[:, :-1].conj())))

    def _open(self, points: FloatArray) -> npt.NDArray[np.bool_]:
        """Return whether configurations (..., 2) are within ranges and zones."""
        cosine, sine = np.cos(points[..., 1]), np.sin(points[..., 1])
        # Past a pole the same configuration has c > 0 and the opposite direction.
        e = np.exp(1j * points[..., 0]) * np.where(cosine < 0, -1.0, 1.0)
        scale = 1 / np.maximum(np.abs(cosine), np.abs(sine))
        c, s = np.abs(cosine) * scale, sine * scale
        open_ = np.ones(points.shape[:-1], dtype=bool)
        for row in self._sectors:
            z = c * e + s * row.b
            open_ &= (np.abs(z) > 1e-9) & (steering_excess(row, z) <= 0)
            open_ &= turning_excess(row, c, s, e) <= 0
        return open_

    @cached_property
    def nodes(self) -> FloatArray:
        """The nodes, (n, 2) φ, θ; none lies on a pole."""
        phi = -np.pi + (np.arange(N_PHI) + 0.5) * (2 * np.pi / N_PHI)
        theta = -np.pi / 2 + (np.arange(N_THETA) + 0.5) * (np.pi / N_THETA)
        return np.stack(np.meshgrid(phi, theta, indexing="ij"), axis=-1).reshape(-1, 2)

    @cached_property
    def graph(self) -> csr_array:
        """The time from node to node, s."""
        i, j = (x.ravel() for x in np.indices((N_PHI, N_THETA)))
        cells = np.array([2 * np.pi / N_PHI, np.pi / N_THETA])
        heads, tails, costs = [], [], []
        for di, dj in OFFSETS:
            cost = self._times(self.nodes, self.nodes + np.array([di, dj]) * cells)
            to_i, to_j = i + di, j + dj
            # Past a pole the same configuration lies half a turn further on.
            past = (to_j >= N_THETA) | (to_j < 0)
            to_j = np.where(to_j >= N_THETA, 2 * N_THETA - 1 - to_j, to_j)
            to_j = np.where(to_j < 0, -1 - to_j, to_j)
            to_i = (to_i + past * (N_PHI // 2)) % N_PHI
            head, tail = i * N_THETA + j, to_i * N_THETA + to_j
            open_ = np.isfinite(cost)
            for a, b in ((head, tail), (tail, head)):
                heads.append(a[open_])
                tails.append(b[open_])
                costs.append(cost[open_])
        return csr_array(
            (
                np.concatenate(costs),
                (np.concatenate(heads), np.concatenate(tails)),
            ),
            shape=(len(self.nodes), len(self.nodes)),
        )


class _Search:
    """Ways over the nodes from one configuration; searched when first needed."""

    def __init__(self, surface: TransitionMap, start: FloatArray) -> None:
        self._surface, self.start = surface, start

    @cached_property
    def _tree(self) -> tuple[FloatArray, IntArray]:
        """Times to all nodes and the node before each, the start being the last."""
        graph, count = self._surface.graph, len(self._surface.nodes)
        near, cost = self._surface.links(self.start)
        whole = csr_array(
            (
                np.concatenate([graph.data, cost]),
                np.concatenate([graph.indices, near]),
                np.append(graph.indptr, graph.indptr[-1] + near.size),
            ),
            shape=(count + 1, count + 1),
        )
        distance, before = csgraph.dijkstra(
            whole, indices=np.array([count]), return_predecessors=True
        )
        return distance[0], before[0].astype(np.int64)

    def way_to(self, goal: FloatArray) -> FloatArray | None:
        """Return the quickest way over the nodes, (n, 2) φ, θ unrolled."""
        near, cost = self._surface.links(goal)
        if not near.size:
            return None
        distance, before = self._tree
        total = distance[near] + cost
        if not np.isfinite(total.min()):
            return None
        chain = [int(near[total.argmin()])]
        start = len(self._surface.nodes)
        while before[chain[-1]] != start:
            chain.append(int(before[chain[-1]]))
        way = [self.start]
        for node in reversed(chain):
            way.append(_nearest(way[-1], self._surface.nodes[node]))
        way.append(_nearest(way[-1], goal))
        return np.stack(way)


def _rate(wheel: SteerableWheel) -> float:
    """Return the steering rate from standstill, rad/s; infinite where none binds.

    Steering rolls a wheel beside its axis, and takes from shared motors.
    """
    rate = math.radians(wheel.max_steering_rate_deg or math.inf)
    lever = max(map(abs, wheel.offsets)) + wheel.steering_coupling
    if wheel.max_speed is None or lever == 0:
        return rate
    return min(rate, wheel.max_speed / lever)


def _point(at: Configuration) -> FloatArray:
    """Return (φ, θ) of (κ_n, β)."""
    kappa_n, beta = at
    nominal_curvature(kappa_n)
    _, phi, theta = omni_curve_to_spherical(kappa_n, beta, 1.0)
    return np.array([float(phi), float(theta)])


def _images(point: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the two coordinates of one configuration on the torus."""
    return point, np.array([point[0] + np.pi, np.pi - point[1]])


def _nearest(to: FloatArray, point: FloatArray) -> FloatArray:
    """Return the coordinates of a configuration that lie nearest to `to`."""
    options = [
        image + 2 * np.pi * np.round((to - image) / (2 * np.pi))
        for image in _images(point)
    ]
    return min(options, key=lambda p: float(np.linalg.norm(p - to)))


def _stepped(corners: FloatArray) -> FloatArray:
    """Return points along corners, not more than `STEP` apart."""
    points = [corners[:1]]
    for a, b in itertools.pairwise(corners):
        count = max(int(np.ceil(np.linalg.norm(b - a) / STEP)), 1)
        points.append(a + np.arange(1, count + 1)[:, None] / count * (b - a))
    return np.concatenate(points)


def _to_omni_curve(points: FloatArray) -> FloatArray:
    """Return (κ_n, β) of (φ, θ), β continuous but at poles."""
    cosine, sine = np.cos(points[:, 1]), np.sin(points[:, 1])
    past = cosine < 0
    kappa_n = curvature_of_ratio(np.abs(cosine), sine)
    beta = points[:, 0] + np.pi * past
    return np.stack([np.clip(kappa_n, -2, 2), np.unwrap(beta)], axis=-1)
