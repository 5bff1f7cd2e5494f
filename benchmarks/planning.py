"""Planning against OMPL alone: who finds a way, how soon, and who can drive it.

The same halls, starts, goals and collision checker for everybody:

- plain OMPL: RRTConnect over SE(2), as a program that knows no wheels would do it;
- OMPL's Reeds–Shepp space with the tightest radius that is safe for the vehicle;
- ours: `omniplan.plan`.

A plan counts as drivable if `omniplan.time_path` finds a timing for it, with stops
wherever the direction of travel jumps, that `omniplan.validate` accepts. It counts as
driven free if that trajectory is proved to meet nothing as well.

Run ``python benchmarks/planning.py`` for the table, with ``--json`` for the figures.
"""

from __future__ import annotations

import argparse
import functools
import itertools
import json
import math
import statistics
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from typing import Any, TypeAlias

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

import configspace
import omniplan
from configspace import PermissibleSpace
from omniplan.obstacles import CollisionChecker, Obstacles
from omniplan.planning.moves import Move
from omniplan.planning.route import Route
from omniplan.sampling import PermittedIntervals, bounds_of, seeded, validity_checker
from omniplan.sampling.curves import arcs_of
from omniplan.sampling.line_radius import is_radius_permitted
from omniplan.sampling.ompl_bindings import base, geometric, quiet

Pose: TypeAlias = tuple[float, float, float]
Between: TypeAlias = Callable[[Any, Any, Any, float], list[Move]]

VEHICLES = ("mecanum", "ackermann", "ift-four-steered", "four-wheel-steering")
METHODS = ("plain OMPL", "Reeds–Shepp", "omniplan")
HALL = (0.0, 0.0, 16.0, 12.0)
APART = 7.0
"""Least distance between start and goal, m."""
LIMIT = 1.0
"""Time for one problem, s."""
GRID = 100
"""Intervals between two stops when a plan of OMPL is timed: whether it can be driven
does not depend on them, `validate` proves what comes out."""


@dataclass(frozen=True)
class Problem:
    """A hall with a start and a goal that are free for every vehicle."""

    seed: int
    obstacles: Obstacles
    start: Pose
    goal: Pose


@dataclass(frozen=True)
class Outcome:
    """How one method fared with one problem."""

    vehicle: str
    method: str
    seed: int
    solved: bool
    first: float
    """Time to the first solution, s; infinite without one."""
    drivable: bool
    free: bool
    duration: float
    """Of the timed plan, s; infinite if it cannot be driven."""
    why: str
    """What keeps a plan from being driven."""


@dataclass(frozen=True)
class Bench:
    """One vehicle: its space and its tightest radius, m."""

    space: PermissibleSpace
    radius: float


@functools.cache
def benches() -> tuple[Bench, ...]:
    """Return all vehicles."""
    spaces = [
        configspace.build_space(configspace.load_vehicle(name)) for name in VEHICLES
    ]
    return tuple(Bench(space, tightest_radius(space)) for space in spaces)


@functools.lru_cache(maxsize=8)
def problem_of(seed: int) -> Problem:
    """Return a hall with boxes and walls, a start and a goal."""
    rng = np.random.default_rng(seed)
    x0, y0, x1, y1 = HALL
    while True:
        boxes = []
        for _ in range(rng.integers(6, 12)):
            x, y = rng.uniform((x0, y0), (x1, y1))
            w, h = rng.uniform(0.4, 2.2, 2) if rng.random() < 0.7 else (0.3, 4.0)
            boxes.append([(x, y), (x + w, y), (x + w, y + h), (x, y + h)])
        obstacles = Obstacles.from_polygons(boxes)
        checkers = [
            CollisionChecker(bench.space, obstacles, bounds=HALL) for bench in benches()
        ]
        free: list[Pose] = []
        for _ in range(200):
            x, y = rng.uniform((x0, y0), (x1, y1)).tolist()
            pose = (x, y, float(rng.uniform(-math.pi, math.pi)))
            if not all(checker.is_free(pose) for checker in checkers):
                continue
            if not free or math.dist(free[0][:2], pose[:2]) > APART:
                free.append(pose)
            if len(free) == 2:
                return Problem(seed, obstacles, free[0], free[1])


def tightest_radius(space: PermissibleSpace) -> float:
    """Return the least radius with β = 0 that is permitted to both sides, m."""
    intervals = PermittedIntervals(space)
    low, high = 0.1, 50.0  # a vehicle that turns on the spot gets small curves
    if is_radius_permitted(intervals, low):
        return low
    for _ in range(50):
        middle = math.sqrt(low * high)
        if is_radius_permitted(intervals, middle):
            high = middle
        else:
            low = middle
    return high * (1 + 2e-3)  # so that splines through its arcs keep the limit


def by_ompl(method: str, bench: Bench, problem: Problem) -> Answer:
    """Run RRTConnect over SE(2) or over Reeds and Shepp's curves."""
    checker = CollisionChecker(bench.space, problem.obstacles, bounds=HALL)
    seeded(problem.seed + 1)
    begun = time.perf_counter()
    state_space, moves_between = RUNS[method](bench)
    state_space.setBounds(bounds_of(HALL))
    si = base.SpaceInformation(state_space)
    si.setStateValidityChecker(validity_checker(si, bench.space, checker))
    si.setup()
    ends = []
    for pose in (problem.start, problem.goal):
        state = state_space.allocState()
        state.setXY(pose[0], pose[1])
        state.setYaw(pose[2])
        ends.append(state)
    definition = base.ProblemDefinition(si)
    definition.setStartAndGoalStates(*ends)
    with quiet():
        planner = geometric.RRTConnect(si)
        planner.setProblemDefinition(definition)
        planner.setup()
        planner.solve(LIMIT)
    spent = time.perf_counter() - begun
    if not definition.hasExactSolution():
        return Answer(bench.space.name, method, problem.seed, math.inf, None)
    states = definition.getSolutionPath().getStates()
    moves: list[Move] = []
    for first, second in itertools.pairwise(states):
        moves += moves_between(state_space, first, second, bench.radius)
    return Answer(bench.space.name, method, problem.seed, spent, tuple(moves))


def _straight(_: Any, first: Any, second: Any, __: float) -> list[Move]:
    return [Move.straight(_pose(first), _pose(second))]


def _curve(state_space: Any, first: Any, second: Any, radius: float) -> list[Move]:
    between = state_space.allocState()

    def pose_at(share: float) -> Pose:
        state_space.interpolate(first, second, share, between)
        return _pose(between)

    length = state_space.distance(first, second)
    return arcs_of(pose_at, length, radius)


RUNS: dict[str, Callable[[Bench], tuple[Any, Between]]] = {
    METHODS[0]: lambda bench: (base.SE2StateSpace(), _straight),
    METHODS[1]: lambda bench: (base.ReedsSheppStateSpace(bench.radius), _curve),
}


def _pose(state: Any) -> Pose:
    return state.getX(), state.getY(), state.getYaw()


@dataclass(frozen=True)
class Answer:
    """What OMPL answered, to be judged afterwards."""

    vehicle: str
    method: str
    seed: int
    first: float
    moves: tuple[Move, ...] | None


def judged(answer: Answer) -> Outcome:
    """Return whether a plan of OMPL can be driven; runs in processes of its own."""
    bench = benches()[VEHICLES.index(answer.vehicle)]
    problem = problem_of(answer.seed)
    if answer.moves is None:
        return _outcome(bench, answer, False, None, False, "no plan")
    vehicle = bench.space.vehicle
    assert vehicle is not None
    k = vehicle.reference
    route = Route.from_moves(_joined(answer.moves))
    path = route.to_path("plan", (k.real, k.imag))
    timing = omniplan.time_path(path, bench.space, grid=GRID, steps=GRID)
    trajectory, free = _checked(bench, problem, timing.trajectory)
    return _outcome(bench, answer, True, trajectory, free, timing.message)


def _checked(
    bench: Bench, problem: Problem, trajectory: omniplan.Trajectory | None
) -> tuple[omniplan.Trajectory | None, bool]:
    """Return a trajectory if `validate` accepts it, and whether it meets nothing."""
    if trajectory is None or not omniplan.validate(trajectory, bench.space).valid:
        return None, False
    checker = CollisionChecker(bench.space, problem.obstacles, bounds=HALL)
    return trajectory, checker.first_hit_of_trajectory(trajectory) is None


def _joined(moves: Sequence[Move]) -> list[Move]:
    """Return moves of the same kinds that begin where the one before ends."""
    out: list[Move] = []
    for move in moves:
        start = out[-1].goal if out else move.start
        if move.shape == "straight":
            out.append(Move.straight(start, move.goal, turn=None))
        else:
            way = move.length * np.array([math.cos(move.beta_0), math.sin(move.beta_0)])
            out.append(Move.along(start, [*way, move.turn]))
    return out


def by_omniplan(bench: Bench, problem: Problem) -> Outcome:
    """Run ours; what it found is judged once more."""
    plan = omniplan.plan(
        problem.start,
        problem.goal,
        bench.space,
        problem.obstacles,
        bounds=HALL,
        time=LIMIT,
        seed=problem.seed + 1,
    )
    # A first way is known before it is timed; refused in the end, it is no solution.
    first = float(plan.statistics.get("time_to_first", math.inf))
    answer = Answer(bench.space.name, METHODS[2], problem.seed, first, None)
    trajectory, free = _checked(bench, problem, plan.trajectory)
    return _outcome(bench, answer, plan.is_found, trajectory, free, plan.message)


def _outcome(
    bench: Bench,
    answer: Answer,
    solved: bool,
    trajectory: omniplan.Trajectory | None,
    free: bool,
    why: str,
) -> Outcome:
    return Outcome(
        bench.space.name,
        answer.method,
        answer.seed,
        solved,
        answer.first,
        trajectory is not None,
        free,
        math.inf if trajectory is None else trajectory.duration,
        "" if trajectory is not None else why,
    )


def run(count: int, seed: int, show: bool) -> list[Outcome]:
    """Run everybody on everything, one after the other; judge OMPL's plans at last."""
    for bench in benches():  # compiled code is loaded before anybody is timed
        warm = problem_of(seed + 1_000_000)
        by_omniplan(bench, warm)
        for method in RUNS:
            by_ompl(method, bench, warm)
    ours: list[Outcome] = []
    answers: list[Answer] = []
    seeds = range(seed, seed + count)
    for number in track(seeds, "planning", disable=not show, transient=True):
        problem = problem_of(number)
        for bench in benches():
            answers += [by_ompl(method, bench, problem) for method in RUNS]
            ours.append(by_omniplan(bench, problem))
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        todo = pool.map(judged, answers)
        theirs = list(
            track(todo, "judging", len(answers), disable=not show, transient=True)
        )
    return ours + theirs


def summary(outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Return one row of figures per vehicle and method, and one over all vehicles."""
    rows = []
    for vehicle in (*VEHICLES, "all"):
        for method in METHODS:
            of = [
                o
                for o in outcomes
                if o.method == method and vehicle in {o.vehicle, "all"}
            ]
            solved = [o for o in of if o.solved]
            times = [o.first for o in solved]
            rows.append(
                {
                    "vehicle": vehicle,
                    "method": method,
                    "problems": len(of),
                    "solved": len(solved) / len(of),
                    "median_first": statistics.median(times) if times else None,
                    "mean_first": statistics.fmean(times) if times else None,
                    "drivable": sum(o.drivable for o in solved) / max(len(solved), 1),
                    "driven_free": sum(o.free for o in solved) / max(len(solved), 1),
                    "answered": sum(o.free for o in of) / len(of),
                }
            )
    return rows


def table_of(rows: Sequence[dict[str, Any]]) -> Table:
    """Return the figures as a table."""
    heads = (
        "vehicle", "method", "solved", "first, median ms", "first, mean ms",
        "of these drivable", "drivable and free", "of all problems",
    )  # fmt: skip
    table = Table(*heads)
    for row in rows:
        times = [
            "-" if row[key] is None else f"{row[key] * 1e3:.0f}"
            for key in ("median_first", "mean_first")
        ]
        shares = [f"{row[key]:.0%}" for key in ("drivable", "driven_free", "answered")]
        table.add_row(
            row["vehicle"], row["method"], f"{row['solved']:.0%}", *times, *shares
        )
    return table


def main() -> None:
    """Print the table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--problems", type=int, default=50, help="per vehicle")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true", help="print JSON")
    given = parser.parse_args()
    begun = time.perf_counter()
    outcomes = run(given.problems, given.seed, not given.json)
    rows = summary(outcomes)
    if given.json:
        found = [
            {k: None if v == math.inf else v for k, v in asdict(o).items()}
            for o in outcomes
        ]
        print(json.dumps({"summary": rows, "outcomes": found}, indent=1))  # noqa: T201
        return
    console = Console()
    console.print(table_of(rows))
    elapsed = time.perf_counter() - begun
    console.print(f"{len(outcomes)} plans in {elapsed:.0f} s, {LIMIT:g} s at most each")


if __name__ == "__main__":
    main()
