"""The kernels of timing against their plain twins."""

from __future__ import annotations

import math
from collections import defaultdict

import naive_timing
import numpy as np
import pytest
from timing_cases import demanding_vehicle, smooth_path

from configspace.testing import ALL_KINDS, VehicleKind
from omniplan.timing.kernels import sweep
from omniplan.timing.path_motion import pieces_of
from omniplan.timing.rows import FIRST_RATE
from omniplan.timing.solver import TimingProblem


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_rows_are_what_finite_differences_say(kind: VehicleKind) -> None:
    rng = np.random.default_rng(len(kind))
    seen = 0
    for _ in range(6):
        vehicle, path = demanding_vehicle(rng, kind), smooth_path(rng)
        pieces = pieces_of(path)
        problem = TimingProblem(pieces, vehicle, 4)
        for k, piece in enumerate(pieces):
            sigma = int(rng.choice([-1, 1]))
            twin = naive_timing.NaiveLimits(vehicle, piece, sigma)
            at = rng.integers(0, piece.u.size - 1)
            share = rng.uniform(0.1, 0.9)
            u = float(piece.u[at] + share * (piece.u[at + 1] - piece.u[at]))
            a, b = problem.coefficients(k, sigma, np.array([u]))
            found: dict[naive_timing.Key, list[tuple[float, float]]] = defaultdict(list)
            for row, row_a, row_b in zip(problem.rows, a[0], b[0], strict=True):
                found[row.limit, row.wheel].append((row_a, row_b))
            expected: dict[naive_timing.Key, list[tuple[float, float]]]
            expected = defaultdict(list)
            for key, load in twin.loads(u):
                expected[key].append((0.0, load))
            for key, twin_a, twin_b, _ in twin.rates(u):
                expected[key].append((twin_a, twin_b))
            own = {"PATH_SPEED", "PATH_YAW_RATE", "SAMPLING"}
            assert set(found) - {(name, -1) for name in own} == set(expected)
            for key, values in expected.items():
                # Third derivatives by differences of differences.
                is_swing = key[0] == "STEER_ACCELERATION"
                is_beside = key[0] == "WHEEL_ACCELERATION" and kind != "steered"
                calm = 2e-3 if is_swing else (2e-4 if is_beside else 1e-5)
                np.testing.assert_allclose(
                    sorted(found[key]), sorted(values), rtol=calm, atol=10 * calm
                )
                seen += len(values)
    assert seen > 20


def test_the_sweep_is_that_of_linear_programmes() -> None:
    rng = np.random.default_rng(3)
    for trial in range(12):
        n, m = 25, int(rng.integers(0, 7))
        step = rng.uniform(0.02, 0.1, n)
        # smooth coefficients that change sign, as on a path
        phase = rng.uniform(0, 6, (4, m))
        u = np.concatenate([[0], np.cumsum(step)])[:, None]
        a = np.sin(phase[0] + 2 * phase[1] * u) * rng.uniform(0.1, 2, m)
        b = np.sin(phase[2] + 2 * phase[3] * u) * rng.uniform(0.1, 2, m)
        half = a[:-1] / (2 * step[:, None]), a[1:] / (2 * step[:, None])
        p = np.concatenate([half[0], half[1] + b[1:]], axis=1)
        q = np.concatenate([b[:-1] - half[0], -half[1]], axis=1)
        low = np.tile(np.where(rng.random(m) < 0.3, -np.inf, -1.0), 2)
        cap = rng.uniform(0.2, 2, n + 1)
        x = np.empty(n + 1)
        slope, ends = -q / p, np.sort([1 / p, low / p], axis=0)
        assert sweep(slope, ends[1], ends[0], cap, x) == -1
        twin = naive_timing.sweep(step, p, q, low, cap)
        np.testing.assert_allclose(x, twin, rtol=1e-6, atol=1e-7, err_msg=f"{trial}")
        assert x[0] == x[-1] == 0


def test_what_cannot_be_passed_stops_the_sweep() -> None:
    cap, x = np.ones(5), np.empty(5)
    cap[2:4] = 0.0
    nothing = np.zeros((4, 0))
    assert sweep(nothing, nothing, nothing, cap, x) == 2


def test_rows_that_involve_acceleration_come_last() -> None:
    rng = np.random.default_rng(1)
    vehicle = demanding_vehicle(rng, "mecanum")
    problem = TimingProblem(pieces_of(smooth_path(rng)), vehicle)
    kinds = [row.kind for row in problem.rows]
    assert kinds == sorted(kinds, key=lambda kind: kind >= FIRST_RATE)
    assert problem.rows[-1].limit == "SAMPLING"


def test_grids_end_in_the_knots_and_are_fine_enough() -> None:
    rng = np.random.default_rng(2)
    pieces = pieces_of(smooth_path(rng, 9))
    problem = TimingProblem(pieces, demanding_vehicle(rng, "steered"), 40)
    for k, piece in enumerate(pieces):
        u = problem.nodes(k)
        assert u.size > 40
        assert (np.diff(u) > 0).all()
        for knot in piece.u:
            assert math.isclose(np.abs(u - knot).min(), 0, abs_tol=1e-12)
