"""Inputs: curves against the textbook, files there and back, points of reference."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st
from naive_nurbs import blended
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree

import configspace
from configspace import Grid
from configspace.testing import VEHICLE_KINDS, random_vehicle
from omniplan import (
    InvalidTrajectory,
    Trajectory,
    read_trajectories,
    validate,
    write_trajectories,
)
from omniplan.inputs.nurbs import Nurbs
from omniplan.motion import stops_of
from omniplan.path import Path
from omniplan.timing.path_motion import pieces_of
from omniplan.trajectory import timed

FloatArray = npt.NDArray[np.float64]
seeds = st.integers(0, 2**32 - 1)


# --- curves


def random_curve(seed: int) -> tuple[Nurbs, dict[str, Any]]:
    """Random points, weights and knots, inner ones repeated now and then."""
    rng = np.random.default_rng(seed)
    degree = int(rng.integers(1, 6))
    k = degree + 1 + int(rng.integers(0, 6))
    inner = np.sort(rng.choice(rng.uniform(0.05, 0.95, 4), k - degree - 1))
    values, counts = np.unique(inner, return_counts=True)
    inner = np.repeat(values, np.minimum(counts, degree))
    k = degree + 1 + inner.size
    knots = np.concatenate([np.zeros(degree + 1), inner, np.ones(degree + 1)])
    points = np.cumsum(rng.normal(size=(k, 2)), axis=0)
    weights = 2 ** rng.uniform(-2, 2, k)
    data = {
        "control_points": points,
        "weights": weights,
        "knots": knots,
        "degree": degree,
    }
    return Nurbs.checked(points, weights, knots, degree), data


@given(seeds, st.lists(st.floats(0, 1), min_size=1, max_size=5))
@settings(max_examples=60, deadline=None)
def test_curves_are_those_of_the_recursion(seed: int, places: list[float]) -> None:
    curve, _ = random_curve(seed)
    for u in places:
        x, y = (
            blended(
                column.tolist(),
                curve.weights.tolist(),
                curve.knots.tolist(),
                curve.degree,
                u,
            )
            for column in curve.points.T
        )
        assert abs(curve.at(np.array([u]))[0] - complex(x, y)) < 1e-9


@given(seeds, st.floats(0.001, 0.999))
@settings(max_examples=60, deadline=None)
def test_derivatives_are_those_of_differences(seed: int, u: float) -> None:
    curve, _ = random_curve(seed)
    h = 1e-6
    if np.abs(curve.knots - u).min() < 2 * h:
        return
    before, behind = curve.at(np.array([u - h, u + h]))
    slope = curve.derivative(np.array([u]))[0]
    assert abs((behind - before) / (2 * h) - slope) < 1e-5 * max(1, abs(slope))


def off_curve(curve: Nurbs, poses: FloatArray) -> FloatArray:
    """Return distances of poses from a curve of 200,001 points and their tangents."""
    dense = curve.at(np.union1d(np.linspace(0, 1, 200_001), curve.knots))
    point = poses[:, 0] + 1j * poses[:, 1]
    tree = cKDTree(np.stack([dense.real, dense.imag], axis=-1))
    at = np.asarray(tree.query(poses[:, :2])[1])
    # The distance from the two chords beside the nearest point.
    gaps = []
    for step in (-1, 1):
        chord = dense[np.clip(at + step, 0, dense.size - 1)] - dense[at]
        size = np.maximum(np.abs(chord) ** 2, 1e-300)
        share = np.clip(((point - dense[at]) * chord.conj()).real / size, 0, 1)
        gaps.append(np.abs(point - dense[at] - share * chord))
    return np.asarray(np.minimum(*gaps))


@given(seeds, st.sampled_from(["TANGENTIAL", "GLOBAL"]), st.floats(-3, 3))
@settings(max_examples=15, deadline=None)
def test_splines_through_the_poses_keep_to_the_curve(
    seed: int, kind: Any, orientation: float
) -> None:
    curve, data = random_curve(seed)
    try:
        path = Path.from_nurbs(
            **data,
            orientation=orientation,
            orientation_type=kind,
            tolerance=1e-3,
            heading_tolerance=1e-2,
        )
    except InvalidTrajectory as error:  # one in fifty: a loop of a tenth millimetre
        assert "turns too tightly" in str(error)  # noqa: PT017
        reject()
    assert path.poses[0, :2] == pytest.approx(curve.points[0])
    assert path.poses[-1, :2] == pytest.approx(curve.points[-1])
    assert off_curve(curve, path.poses).max() < 1e-6
    stop = path.stops | stops_of(path.poses)
    bounds = sorted({0, len(stop) - 1, *np.flatnonzero(stop).tolist()})
    dense = []
    for first, last in itertools.pairwise(bounds):
        u = path.parameter[first : last + 1]
        ends: Any = "not-a-knot" if len(u) > 3 else "natural"
        spline = CubicSpline(u, path.poses[first : last + 1], bc_type=ends)
        dense.append(spline(np.linspace(u[0], u[-1], 200)))
    assert off_curve(curve, np.concatenate(dense)).max() < 1e-3


# --- files

names = st.text(
    st.characters(codec="utf-8", exclude_categories=("C", "Z")), min_size=1, max_size=20
).filter(lambda name: not name.startswith("#") and name.isprintable())


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> FilePath:
    return tmp_path_factory.mktemp("files")


@given(
    st.lists(names, min_size=1, max_size=4, unique=True),
    seeds,
    st.sampled_from(["poses", "twists", "path"]),
    st.sampled_from([".csv", ".parquet"]),
)
@settings(max_examples=60, deadline=None)
def test_what_is_written_is_read_again(
    folder: FilePath, labels: list[str], seed: int, form: str, suffix: str
) -> None:
    rng = np.random.default_rng(seed)
    made: list[Trajectory | Path] = []
    for name in labels:
        n = int(rng.integers(2, 9))
        t = rng.uniform(-1e9, 1e9) + np.cumsum(rng.uniform(0.01, 9, n))
        samples = rng.normal(size=(n, 3)) * [50, 50, 0.3]
        point = tuple(np.round(rng.uniform(-1, 1, 2), 3).tolist())
        if form == "path":
            caps = np.round(rng.uniform(0.1, 1, n - 1), 3)
            stops = np.flatnonzero(rng.random(n) < 0.3)
            made.append(
                Path.from_poses(
                    samples,
                    name=name,
                    reference_point=point,
                    max_speed=caps,
                    stops=stops,
                )
            )
        else:
            build = Trajectory.from_poses if form == "poses" else Trajectory.from_twists
            made.append(build(t, samples, name=name, reference_point=point))
    file = folder / f"file{suffix}"
    write_trajectories(file, made)
    digits = 1e-8 if suffix == ".csv" else 0
    for before, after in zip(made, read_trajectories(file), strict=True):
        assert after.name == before.name
        assert after.reference_point == before.reference_point
        if isinstance(before, Path):
            assert isinstance(after, Path)
            assert after.poses == pytest.approx(before.poses, rel=digits, abs=digits)
            assert (after.stops == before.stops).all()
            assert before.max_speed is not None
            assert after.max_speed is not None
            assert (after.max_speed == before.max_speed).all()
        else:
            after = timed(after)
            assert (after.t == before.t).all()
            assert after.samples == pytest.approx(
                before.samples, rel=digits, abs=digits
            )


# --- points of reference


def twists_at(twists: FloatArray, point: complex) -> FloatArray:
    """Return the twists of a point of the vehicle: v + ω × r."""
    vx, vy, omega = twists.T
    return np.stack([vx - omega * point.imag, vy + omega * point.real, omega], axis=-1)


def poses_at(poses: FloatArray, point: complex) -> FloatArray:
    """Return the poses of a point of the vehicle: p + R(θ) r."""
    x, y, theta = poses.T
    moved = x + 1j * y + np.exp(1j * theta) * point
    return np.stack([moved.real, moved.imag, theta], axis=-1)


def verdict(trajectory: Trajectory, space: configspace.PermissibleSpace) -> Any:
    report = validate(trajectory, space)
    margin = pytest.approx(report.margin, abs=1e-6, rel=1e-6)
    places = {(v.limit, v.wheel) for v in report.violations}
    return report.valid, margin, places


@given(seeds, st.sampled_from(VEHICLE_KINDS))
@settings(max_examples=12, deadline=None)
def test_twists_of_any_point_get_the_same_verdict(seed: int, kind: Any) -> None:
    rng = np.random.default_rng(seed)
    vehicle = random_vehicle(rng, kind)
    space = configspace.build_space(vehicle, Grid(20, 36), cache=False)
    start = rng.normal(size=3) * [0.3, 0.1, 0.2]
    twists = start + rng.normal(size=(3, 3)) * 0.05
    if rng.random() < 0.5:  # what every line-mobile vehicle can do, if slow enough
        twists[:, 1:] = 0
    t = [0.0, 1.0, 2.0]
    point = complex(*np.round(rng.uniform(-1, 1, 2), 3))
    one = Trajectory.from_twists(t, twists)
    other = Trajectory.from_twists(
        t, twists_at(twists, point), reference_point=(point.real, point.imag)
    )
    assert verdict(one, space) == verdict(other, space)


@given(seeds)
@settings(max_examples=8, deadline=None)
def test_poses_of_any_point_get_the_same_verdict_in_translation(seed: int) -> None:
    rng = np.random.default_rng(seed)
    space = configspace.build_space(
        configspace.load_vehicle("mecanum"), Grid(20, 36), cache=False
    )
    heading = rng.uniform(-3, 3)
    poses = np.column_stack(
        [np.cumsum(rng.normal(0.3, 0.1, (5, 2)), axis=0), np.full(5, heading)]
    )
    t = np.cumsum(rng.uniform(0.5, 2, 5))
    point = complex(*np.round(rng.uniform(-1, 1, 2), 3))
    one = Trajectory.from_poses(t, poses)
    other = Trajectory.from_poses(
        t, poses_at(poses, point), reference_point=(point.real, point.imag)
    )
    assert verdict(one, space) == verdict(other, space)


@given(seeds)
@settings(max_examples=6, deadline=None)
def test_closely_sampled_poses_of_any_point_get_the_same_margin(seed: int) -> None:
    """Splines through moved poses are not the moved splines, but close to them."""
    rng = np.random.default_rng(seed)
    space = configspace.build_space(
        configspace.load_vehicle("mecanum"), Grid(20, 36), cache=False
    )
    t = np.linspace(0, 4, 81)
    a, b, c = rng.uniform(0.1, 0.4, 3)
    poses = np.stack([a * t, b * np.sin(t), c * np.cos(t) + 0.2 * t], axis=-1)
    point = complex(*np.round(rng.uniform(-0.5, 0.5, 2), 3))
    one, other = (
        validate(each, space)
        for each in (
            Trajectory.from_poses(t, poses),
            Trajectory.from_poses(
                t, poses_at(poses, point), reference_point=(point.real, point.imag)
            ),
        )
    )
    assert other.margin == pytest.approx(one.margin, abs=1e-3)
    assert other.top_speed == pytest.approx(one.top_speed, rel=1e-3)


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_paths_of_any_point_are_the_same_way_of_the_vehicle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    s = np.linspace(0, math.pi, 61)
    a, b, c = rng.uniform(0.3, 0.8, 3)
    poses = np.stack([a * s, b * np.sin(s), c * np.sin(s / 2)], axis=-1)
    point = complex(*np.round(rng.uniform(-0.4, 0.4, 2), 3))
    ways = []
    for path in (
        Path.from_poses(poses),
        Path.from_poses(
            poses_at(poses, point), reference_point=(point.real, point.imag)
        ),
    ):
        (piece,) = pieces_of(path)
        dense = piece.poses_at(np.linspace(piece.u[0], piece.u[-1], 5001))
        ways.append(poses_at(dense, -piece.point))
    # Somewhere along the other way the vehicle stands the same.
    gap = np.asarray(cKDTree(ways[0]).query(ways[1])[0])
    assert gap.max() < 1e-3


def test_a_turn_about_a_point_stands_still_there(
    space_of: Callable[[str], configspace.PermissibleSpace],
) -> None:
    space = space_of("mecanum")
    t = np.linspace(0, 4, 41)
    still = np.stack([0 * t, 0 * t, 0.1 * t**2 * (3 - t / 2)], axis=-1)
    about = Trajectory.from_poses(t, still, reference_point=(0.4, 0.1))
    moved = Trajectory.from_poses(t, poses_at(still, -(0.4 + 0.1j)))
    assert validate(about, space).margin == pytest.approx(
        validate(moved, space).margin, abs=1e-3
    )
