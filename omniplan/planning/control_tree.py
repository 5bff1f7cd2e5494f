"""What has been driven with the rates of (κ_n, β) as controls, and ways to the goal.

Many controls are driven at once from a state; one of those that are permitted and meet
nothing is kept. From every state that is reached the connector of the geometric method
tries to go on to the goal, after a stop in which the wheels turn.

References
----------
spec/omni-curve §4.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from configspace import PermissibleSpace
from configspace.omni_curve import components
from configspace.rate_cells import cell_rate_limits
from omniplan.planning.connect import Chain, Connector, chain_time
from omniplan.planning.control_kernels import LEVELS, STEPS, arcs_of_step, drive
from omniplan.planning.improve import moves_of, shortened
from omniplan.planning.moves import Move
from omniplan.planning.route import Route
from omniplan.planning.search import Found
from omniplan.planning.task import Pose, Task
from omniplan.sampling.intervals import PermittedIntervals

__all__ = ["State", "Tree", "rate_tables"]

FloatArray = npt.NDArray[np.float64]
State: TypeAlias = tuple[float, float, float, float, float]
"""x, y, θ, κ_n, β: m, m, rad, 1, rad."""

BATCH = 24
"""Controls that are driven at once."""
POOL = 4096
"""Controls to take batches from."""
FASTEST_CHANGE = 4.0
"""Rates beyond this, 1/s and rad/s, are not asked for: nothing else would be driven."""
SHORTEST, LONGEST = 0.15, 0.1
"""Way of a control: at least this, m, at most this share of the hall's diagonal."""
GREEDY = 0.4
"""So often the control that comes nearest to the goal is taken."""
ENOUGH = 12
"""So many ways are enough; the one with the least estimated time is taken."""
PATIENCE = 3.0
"""After so many times the motions of the first way the search ends."""
AHEAD = 0.85
"""So often a control goes on forwards after a forward one, backwards after another."""
STOP = 3.0
"""What a stop to drive back counts where ways are compared, s."""
CRABS = (0.0, 0.35, -0.35, math.pi / 2, -math.pi / 2)
"""β to start with at κ_n = 0, rad, as far as they are permitted."""
FINE, LINE_FINE = 0.25, 0.03
"""Turn, change of β, rad, and of κ_n from pose to pose of a route; the wheels of a
line-mobile vehicle slip sideways where a spline leaves the way."""


@dataclass(frozen=True, eq=False)
class _Segment:
    """What one control drove, and from where."""

    before: State
    states: FloatArray
    sign: int
    way: float
    """∫|v_s| dt, m."""
    time: float
    """From the start to its end, s."""


@dataclass(frozen=True, eq=False)
class _Way:
    """A state from which moves lead to the goal."""

    last: State
    chain: Chain
    time: float
    """From the start to the goal, s."""
    at: float
    """When it was found, s."""


class Tree:
    """What has been driven so far, and the ways to the goal found from there.

    Parameters
    ----------
    task : Task
    connector : Connector
        Of the vehicle.
    seed : int, ≥ 1
    most : int, optional
        So many motions are checked at most.
    """

    def __init__(
        self, task: Task, connector: Connector, seed: int, most: int | None = None
    ) -> None:
        self.task = task
        self._begun = task.budget.asked
        self._most = math.inf if most is None else most
        space = task.space
        self._space = space
        self._table = PermittedIntervals(space).table
        self._rates = rate_tables(space)
        self._connector = connector
        self._permits = connector.permits
        self._random = np.random.default_rng(seed)
        self._pool = _controls(self._random, task)
        self._states = np.empty((BATCH, STEPS + 1, 5))
        self._ends = np.empty((BATCH, 2))
        self._segments: dict[State, _Segment] = {}
        self._first_after: int | None = None
        self.ways: list[_Way] = []

    @property
    def is_over(self) -> bool:
        """Whether to end."""
        task = self.task
        if task.budget.is_over or len(self.ways) >= ENOUGH:
            return True
        if self._asked >= self._most:
            return True
        first = self._first_after
        if first is None:
            return task.is_known_enclosed()
        return self._asked > PATIENCE * first

    @property
    def _asked(self) -> int:
        """Number of motions that this tree asked about."""
        return self.task.budget.asked - self._begun

    def begin(self) -> list[State]:
        """Return the states to start from: the pose with several configurations."""
        line = self._space.line_beta
        betas = CRABS if line is None else (line,)
        found: list[State] = []
        for beta in betas:
            if self._permits.v_max(0.0, beta, beta) > 0:
                found.append((*self.task.start, 0.0, beta))
        for state in found[:1]:
            self._connect(state, 0.0)
        return found

    def drive(self, state: State, batch: float, pick: float) -> State | None:
        """Drive a batch of controls; return the end of the one that is picked."""
        self.task.budget.check()
        first = int(batch * (POOL - BATCH))
        controls = self._pool[first : first + BATCH].copy()
        known = self._segments.get(state)
        if known is not None:
            controls[:, 2] *= known.sign
        drive(
            self._table,
            self._space.tables.load,
            *self._rates,
            self._space.line_beta is not None,
            self._space.is_translating,
            self._space.kappa_g,
            _fineness(self._space),
            np.array(state),
            controls,
            self._states,
            self._ends,
        )
        for j in self._order(pick):
            end = self._accept(state, int(j), controls[j])
            if end is not None:
                return end
        return None

    def _order(self, pick: float) -> npt.NDArray[np.int64]:
        """Return which controls to try: permitted ones within the bounds."""
        x0, y0, x1, y1 = self.task.bounds
        last = self._states[:, -1]
        inside = (last[:, 0] >= x0) & (last[:, 0] <= x1)
        inside &= (last[:, 1] >= y0) & (last[:, 1] <= y1)
        good = np.flatnonzero((self._ends[:, 0] >= 0) & inside)
        if pick < GREEDY:
            good = good[np.argsort(self._apart(last[good]))]
            return good[:2]
        if good.size:
            good = np.roll(good, -int((pick - GREEDY) / (1 - GREEDY) * good.size))
        return good[:2]

    def _apart(self, states: FloatArray) -> FloatArray:
        """Return how far states are from the goal, m."""
        goal = self.task.goal
        way = np.hypot(states[:, 0] - goal[0], states[:, 1] - goal[1])
        turn = np.abs(np.remainder(states[:, 2] - goal[2] + np.pi, 2 * np.pi) - np.pi)
        return np.asarray(way + turn / self._space.kappa_g / 2)

    def _accept(self, before: State, j: int, control: FloatArray) -> State | None:
        """Return the end of a control that meets nothing; None if it does."""
        states = self._states[j].copy()
        x, y, theta, kappa_n, beta = states[-1].tolist()
        if not self.task.is_free((x, y, theta)):
            return None
        pairs = itertools.pairwise(states[:, :3])
        arcs = [Move.arc(a, b, turn=b[2] - a[2]) for a, b in pairs]
        if not self.task.are_free(arcs):
            return None
        end: State = (x, y, theta, kappa_n, beta)
        known = self._segments.get(before)
        sign = 1 if control[2] > 0 else -1
        time = float(self._ends[j, 0])
        if known is not None:
            time += known.time + (STOP if known.sign != sign else 0.0)
        self._segments[end] = _Segment(before, states, sign, float(control[3]), time)
        self._connect(end, time)
        return end

    def _connect(self, state: State, time: float) -> None:
        """Look for moves from a state to the goal."""
        pose: Pose = state[:3]
        chain = self._connector.quick(pose, self.task.goal)
        if chain is None or not self.task.are_free(leg[0].move for leg in chain):
            return
        total = time + chain_time(self._permits, chain)
        total += self._steering(state, chain)
        if self._first_after is None:
            self._first_after = self._asked
        self.ways.append(_Way(state, chain, total, self.task.budget.elapsed))

    def shortened(self, way: _Way) -> _Way:
        """Return the way with quicker moves at its end, or the same."""
        before = chain_time(self._permits, way.chain)
        tail = Found(way.chain, before, way.at)
        better = shortened(self.task, self._connector, tail, self._random)
        if not way.chain or better.duration >= before:
            return way
        total = way.time - self._steering(way.last, way.chain) - before
        total += self._steering(way.last, better.chain) + better.duration
        return replace(way, chain=better.chain, time=total)

    def _steering(self, state: State, chain: Chain) -> float:
        """Return the time in which the wheels turn before a chain, s."""
        if not chain:
            return 0.0
        before = state[3], state[4]
        steering_time = self._permits.steering_time
        return min(steering_time(before, drive.start) for drive in chain[0])

    def route(self, way: _Way) -> Route:
        """Return the poses of a way and where the vehicle stands."""
        segments: list[_Segment] = []
        state = way.last
        while state in self._segments:
            segments.append(self._segments[state])
            state = segments[-1].before
        segments.reverse()
        poses: list[FloatArray] = [np.array([self.task.start])]
        stops: list[int] = []
        row, sign = 0, 0
        for segment in segments:
            if sign and segment.sign != sign:
                stops.append(row)
            sign = segment.sign
            poses.append(_fine(segment, self._space))
            row += len(poses[-1])
        if way.chain:
            if segments:
                stops.append(row)
            rest = Route.from_moves(moves_of(way.chain))
            wound = np.array([0.0, 0.0, poses[-1][-1, 2] - rest.poses[0, 2]])
            poses.append(rest.poses[1:] + wound)
            stops += [row + stop for stop in rest.stops]
        return Route(np.concatenate(poses), tuple(stops))


def _fine(segment: _Segment, space: PermissibleSpace) -> FloatArray:
    """Return the poses of a segment after its start, close enough for splines."""
    fine = _fineness(space)
    way = segment.sign * segment.way / STEPS
    changes = np.diff(segment.states[:, 3:], axis=0)
    counts = [arcs_of_step(k, b, way, space.kappa_g, fine) for k, b in changes]
    if max(counts) == 1:
        largest = max(float(np.abs(changes).max()), abs(way) * space.kappa_g)
        stride = next(n for n in (8, 4, 2, 1) if n == 1 or n * largest <= fine)
        return segment.states[stride::stride, :3]
    out = []
    for a, change, count in zip(segment.states, changes, counts, strict=False):
        u = (np.arange(count) + 0.5) / count
        c, s = components(np.clip(a[3] + u * change[0], -2, 2))
        turn = way / count * s * space.kappa_g
        course = a[2] + np.cumsum(turn) - 0.5 * turn + a[4] + u * change[1]
        chord = way / count * c * np.sinc(0.5 * turn / np.pi)
        steps = np.stack([chord * np.cos(course), chord * np.sin(course), turn], axis=1)
        out.append(a[:3] + np.cumsum(steps, axis=0))
    return np.concatenate(out)


def _fineness(space: PermissibleSpace) -> float:
    return FINE if space.line_beta is None else LINE_FINE


def _controls(random: np.random.Generator, task: Task) -> FloatArray:
    """Return a pool of controls, (POOL, 4); see `control_kernels.drive`."""
    x0, y0, x1, y1 = task.bounds
    out = np.empty((POOL, 4))
    # Shares of the rates on and in the square |a| + |b| ≤ 1; a quarter change nothing.
    size = np.where(random.random(POOL) < 0.25, 0.0, random.random(POOL) ** 0.5)
    split = random.uniform(-1, 1, POOL)
    side = random.choice([-1.0, 1.0], POOL)
    out[:, 0], out[:, 1] = size * split, size * side * (1 - np.abs(split))
    if task.space.line_beta is not None:
        out[:, 0] = size * side
        out[:, 1] = 0.0
    if task.space.is_translating:
        out[:, 0] = 0.0
        out[:, 1] = size * side
    level = random.integers(1, len(LEVELS) + 1, POOL)
    out[:, 2] = level * np.where(random.random(POOL) < AHEAD, 1.0, -1.0)
    longest = max(2 * SHORTEST, LONGEST * math.hypot(x1 - x0, y1 - y0))
    out[:, 3] = random.uniform(SHORTEST, longest, POOL)
    return out


@lru_cache(maxsize=16)
def rate_tables(space: PermissibleSpace) -> tuple[FloatArray, FloatArray]:
    """Return change rates of κ_n and β, 1/s and rad/s, per level of speed and cell.

    Parameters
    ----------
    space : PermissibleSpace
    """
    rows, columns = space.rates.v_s_dot.shape
    kappa = (np.arange(rows) + 0.5) * (4 / rows) - 2
    beta = (np.arange(columns) + 0.5) * (2 * np.pi / columns) - np.pi
    if space.line_beta is not None:
        beta = np.full(1, space.line_beta)
    if space.is_translating:
        kappa = np.zeros(1)
    k, b = np.meshgrid(kappa, beta, indexing="ij")
    speed = space.v_max(k, b)
    i, j = np.indices((rows, columns))
    tables = [cell_rate_limits(space.rates, i, j, level, speed) for level in LEVELS]
    return tuple(
        np.stack([np.minimum(table[axis], FASTEST_CHANGE) for table in tables])
        for axis in (0, 1)
    )  # type: ignore[return-value]
