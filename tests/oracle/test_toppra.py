"""The optimum of toppra, on problems that both can state.

toppra gets the splines of the path, or the coefficients of the rows on the same grid.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import toppra
import toppra.constraint
from timing_cases import demanding_vehicle, smooth_path

import configspace
from configspace.testing import VehicleKind
from omniplan import Path
from omniplan.timing.path_motion import PathPiece, pieces_of
from omniplan.timing.rows import FIRST_RATE, ONE_SIDED
from omniplan.timing.solver import TimingProblem

FloatArray = npt.NDArray[np.float64]


class SameRows(toppra.constraint.LinearConstraint):  # type: ignore[misc]
    """The rows of a timing problem, at the grid points of one piece."""

    def __init__(self, problem: TimingProblem, piece: int, sigma: int) -> None:
        super().__init__()
        self._problem, self._piece, self._sigma = problem, piece, sigma
        self.identical = False
        self.dof = 1

    def compute_constraint_params(
        self, path: Any, gridpoints: FloatArray, *_: Any
    ) -> tuple[Any, ...]:
        u = gridpoints + self._problem.pieces[self._piece].u[0]
        a, b = self._problem.coefficients(self._piece, self._sigma, u)
        kinds = np.array([row.kind for row in self._problem.rows])
        rate = kinds >= FIRST_RATE
        load = b[:, ~rate].max(axis=1, initial=1e-9)
        both = ~np.isin(kinds[rate], ONE_SIDED)
        a, b = a[:, rate], b[:, rate]
        a = np.concatenate([a, -a[:, both]], axis=1)
        b = np.concatenate([b, -b[:, both]], axis=1)
        n, m = a.shape
        eye = np.broadcast_to(np.eye(m), (n, m, m))
        bound = np.stack([np.zeros(n), 1 / load], axis=1)
        one = -np.ones_like(a)
        # Rows hold at both ends of every interval, as they do in our kernel.
        rows = toppra.constraint.canlinear_colloc_to_interpolate(
            a, b, one, eye, np.zeros_like(a), None, bound, gridpoints, identical=False
        )
        return tuple(rows)


def toppra_duration(problem: TimingProblem, piece: int, sigma: int) -> float:
    """The optimum from rest to rest on the problem's own grid."""
    grid = problem.nodes(piece) - problem.pieces[piece].u[0]
    way = toppra.SplineInterpolator([0, grid[-1]], [[0.0], [1.0]])
    solver = toppra.algorithm.TOPPRA(
        [SameRows(problem, piece, sigma)], way, gridpoints=grid, solver_wrapper="seidel"
    )
    _, speed, _ = solver.compute_parameterization(0, 0)
    assert speed is not None
    return float((2 * np.diff(grid) / (speed[1:] + speed[:-1])).sum())


def optimum(problem: TimingProblem, piece: int, sigma: int) -> float:
    return problem.solve([piece], [sigma])[0].duration


def one_piece(path: Path) -> PathPiece:
    """A path whose spline is a single cubic, so that its rows are smooth."""
    (piece,) = pieces_of(path)
    assert (np.ptp(piece.position[0]), np.ptp(piece.heading[0])) == pytest.approx(
        (0, 0), abs=1e-9
    )
    return piece


@pytest.mark.parametrize("kind", ["mecanum", "omni", "steered", "loaded", "offset"])
def test_same_optimum_with_the_same_rows(kind: VehicleKind) -> None:
    rng = np.random.default_rng(7)
    seen = 0
    while seen < 4:
        vehicle, path = demanding_vehicle(rng, kind), smooth_path(rng, 4)
        problem = TimingProblem([one_piece(path)], vehicle, 200)
        own = optimum(problem, 0, 1)
        if own > 60:  # next to a singular point toppra's solver gives up
            continue
        assert own == pytest.approx(toppra_duration(problem, 0, 1), rel=1e-3)
        seen += 1


def test_same_optimum_with_the_same_rows_over_many_knots() -> None:
    rng = np.random.default_rng(8)
    for _ in range(3):
        # C² splines: all but the steering acceleration is continuous at the knots
        vehicle = demanding_vehicle(rng, "mecanum")
        problem = TimingProblem(pieces_of(smooth_path(rng, 9)), vehicle, 300)
        own = optimum(problem, 0, 1)
        assert own == pytest.approx(toppra_duration(problem, 0, 1), rel=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_same_optimum_as_toppras_own_joint_limits(seed: int) -> None:
    """Position and heading as joints: speed and acceleration of x, y and θ."""
    rng = np.random.default_rng(seed)
    course = rng.uniform(-0.5, 0.5, 6).cumsum()
    p = np.cumsum(0.6 * np.exp(1j * course))
    # Driven without turning by omni wheels along x and y: their rolling is the joints'.
    wheels = [
        {"id": "x", "type": "omni", "x": 0.0, "y": 0.3, "heading_deg": 0.0},
        {"id": "y", "type": "omni", "x": 0.3, "y": 0.0, "heading_deg": 90.0},
        {"id": "z", "type": "omni", "x": 0.0, "y": -0.3, "heading_deg": 0.0},
    ]
    speed, acceleration = rng.uniform(0.5, 1.5, 2), rng.uniform(0.3, 1.0, 2)
    for wheel, joint in zip(wheels, (0, 1, 0), strict=True):
        wheel["max_speed"] = float(speed[joint])
        wheel["max_acceleration"] = float(acceleration[joint])
    vehicle = configspace.vehicle_from_data({"name": "xy", "wheels": wheels})
    poses = np.stack([p.real, p.imag, np.zeros(6)], axis=1)
    path = Path.from_poses(poses)
    problem = TimingProblem(pieces_of(path), vehicle, 400)
    way = toppra.SplineInterpolator(path.parameter, poses[:, :2], bc_type="not-a-knot")
    limits = [
        toppra.constraint.JointVelocityConstraint(np.stack([-speed, speed], axis=1)),
        toppra.constraint.JointAccelerationConstraint(
            np.stack([-acceleration, acceleration], axis=1)
        ),
    ]
    solver = toppra.algorithm.TOPPRA(limits, way, gridpoints=problem.nodes(0))
    _, found, _ = solver.compute_parameterization(0, 0)
    step = np.diff(problem.nodes(0))
    theirs = float((2 * step / (found[1:] + found[:-1])).sum())
    assert optimum(problem, 0, 1) == pytest.approx(theirs, rel=1e-3)
