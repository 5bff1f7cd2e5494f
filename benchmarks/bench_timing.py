"""Fastest timing of many paths for one vehicle, against toppra in the same run.

Both solve the same rows on the same grid, at both ends of every interval. Ours
computes the rows from the splines as well; toppra gets them ready made, evaluated
before its clock starts. ``python benchmarks/bench_timing.py`` prints the ratios.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import numba
import numpy as np
import numpy.typing as npt
import pytest
import toppra
import toppra.constraint
from pytest_benchmark.fixture import BenchmarkFixture

import configspace
from configspace import Vehicle
from omniplan import Path, time_path
from omniplan.timing.path_motion import pieces_of
from omniplan.timing.rows import FIRST_RATE, ONE_SIDED
from omniplan.timing.solver import TimingProblem

FloatArray = npt.NDArray[np.float64]

VEHICLES = ("differential", "mecanum", "ift-four-steered")
GRID = 200
N_PATHS = 500
N_TOPPRA = 10


class ReadyRows(toppra.constraint.LinearConstraint):  # type: ignore[misc]
    """The rows of a timing problem at the grid points, evaluated beforehand."""

    def __init__(self, problem: TimingProblem, piece: int) -> None:
        super().__init__()
        self.identical, self.dof = True, 1
        u = problem.nodes(piece)
        a, b = problem.coefficients(piece, 1, u)
        kinds = np.array([row.kind for row in problem.rows])
        # What never binds is left out: caps of the path and what sampling asks for.
        named = np.array(
            ["PATH" in r.limit or r.limit == "SAMPLING" for r in problem.rows]
        )
        rate = (kinds >= FIRST_RATE) & ~named
        both = ~np.isin(kinds[rate], ONE_SIDED)
        load = b[:, kinds < FIRST_RATE].max(axis=1)
        a, b = a[:, rate], b[:, rate]
        # Strips |a ü + b x| ≤ 1 as one column each, with F = [[1], [-1]].
        n, m = a.shape
        eye = np.concatenate([np.eye(m), -np.eye(m)[both]])
        bound = np.stack([np.zeros(n), 1 / load], axis=1)
        self._rows = toppra.constraint.canlinear_colloc_to_interpolate(
            a,
            b,
            np.zeros_like(a),
            eye,
            np.ones(len(eye)),
            None,
            bound,
            u,
            identical=True,
        )

    def compute_constraint_params(self, *_: Any) -> tuple[Any, ...]:
        """Return what was evaluated."""
        return tuple(self._rows)


def some_paths(vehicle: Vehicle, count: int) -> list[Path]:
    """Return slaloms of nine poses; the vehicle looks ahead."""
    rng = np.random.default_rng(1)
    x = np.linspace(0, 6, 9)
    found = []
    for _ in range(count):
        y = rng.uniform(0.1, 0.4) * np.sin(
            rng.uniform(0.8, 1.4) * x + rng.uniform(0, 6)
        )
        theta = np.arctan2(np.gradient(y, x), 1.0)
        reference = vehicle.reference
        point = (reference.real, reference.imag)
        found.append(
            Path.from_poses(np.stack([x, y, theta], axis=1), reference_point=point)
        )
    return found


def problem_of(name: str, count: int) -> TimingProblem:
    vehicle = configspace.load_vehicle(name)
    pieces = [p for path in some_paths(vehicle, count) for p in pieces_of(path)]
    return TimingProblem(pieces, vehicle, GRID)


def solve(problem: TimingProblem) -> Sequence[float]:
    count = len(problem.pieces)
    return [p.duration for p in problem.solve(range(count), [1] * count)]


def ready_rows(problem: TimingProblem, count: int) -> list[ReadyRows]:
    return [ReadyRows(problem, piece) for piece in range(count)]


def solve_by_toppra(problem: TimingProblem, rows: list[ReadyRows]) -> list[float]:
    durations = []
    for piece, row in enumerate(rows):
        u = problem.nodes(piece)
        way = toppra.SplineInterpolator([u[0], u[-1]], [[0.0], [1.0]])
        solver = toppra.algorithm.TOPPRA(
            [row], way, gridpoints=u, solver_wrapper="seidel"
        )
        _, speed, _ = solver.compute_parameterization(0, 0)
        durations.append(float((2 * np.diff(u) / (speed[1:] + speed[:-1])).sum()))
    return durations


@pytest.mark.parametrize("name", VEHICLES)
def test_time_many_paths(benchmark: BenchmarkFixture, name: str) -> None:
    """Five hundred paths, rows included."""
    problem = problem_of(name, N_PATHS)
    solve(problem)
    benchmark(solve, problem)


@pytest.mark.parametrize("name", VEHICLES)
def test_time_ten_paths_by_toppra(benchmark: BenchmarkFixture, name: str) -> None:
    """Ten paths, their rows ready made."""
    problem = problem_of(name, N_TOPPRA)
    theirs = benchmark(solve_by_toppra, problem, ready_rows(problem, N_TOPPRA))
    assert theirs == pytest.approx(solve(problem), rel=1e-3)


@pytest.mark.parametrize("name", VEHICLES)
def test_time_one_path_and_prove_it(benchmark: BenchmarkFixture, name: str) -> None:
    """One slalom to the end: optimum, samples, validation."""
    vehicle = configspace.load_vehicle(name)
    space = configspace.build_space(vehicle)
    (path,) = some_paths(vehicle, 1)
    benchmark(time_path, path, space)


def measured(clock: Callable[[], float], name: str) -> str:
    """Return one line: how long a path takes here and in toppra, by a clock."""
    problem = problem_of(name, N_PATHS)
    rows = ready_rows(problem, N_TOPPRA)
    solve(problem)
    ours, theirs = [], []
    for _ in range(7):
        start = clock()
        durations = solve(problem)
        ours.append((clock() - start) / N_PATHS)
        start = clock()
        expected = solve_by_toppra(problem, rows)
        theirs.append((clock() - start) / N_TOPPRA)
    apart = np.abs(np.array(durations[:N_TOPPRA]) / expected - 1).max()
    return (
        f"{name}, {len(problem.rows)} rows, {problem.nodes(0).size - 1} intervals: "
        f"{min(ours) * 1e6:.0f} µs a path, toppra {min(theirs) * 1e3:.1f} ms: "
        f"{min(theirs) / min(ours):.0f} times as fast, optimum within {apart:.0e}"
    )


def main() -> None:
    most = numba.get_num_threads()
    for threads, clock, what in (
        (most, time.perf_counter, f"elapsed, {most} threads"),
        (1, time.process_time, "processor time, one thread"),
    ):
        numba.set_num_threads(threads)
        for name in VEHICLES:
            sys.stdout.write(f"{what}: {measured(clock, name)}\n")


if __name__ == "__main__":
    main()
