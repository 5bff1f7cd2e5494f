"""Standstills and own Omni-Curve-Parameters in the kernels, held against `validate`."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import configspace
from configspace import Grid, PermissibleSpace, build_space, vehicle_from_data
from configspace.kernels import BLOCKED, FREE
from omniplan import Tolerances, Trajectory
from omniplan.batch.chords import ROOM
from omniplan.batch.fleet import fleet_of
from omniplan.batch.many import Batch
from omniplan.batch.reaches import APART, CLOSE, CONNECTED, MARGIN, codes_of
from omniplan.batch.ways import change_time
from omniplan.judging.vehicle_judge import VehicleJudge
from omniplan.report import Report
from omniplan.standing.ways import Changer, _ways
from omniplan.validation import judged

FloatArray = npt.NDArray[np.float64]
GRID = Grid(40, 72)
TOLERANCES = Tolerances()
LIMITS = np.array(
    [
        TOLERANCES.standstill,
        math.sin(TOLERANCES.slip_angle),
        TOLERANCES.slip_speed,
        TOLERANCES.alignment,
    ]
)


def space_of(name: str, grid: Grid = GRID) -> PermissibleSpace:
    return build_space(configspace.load_vehicle(name), grid, cache=False)


def corner(
    first: float, second: float, dwell: float, slow: float, samples: int = 8
) -> Trajectory:
    """Two straight runs of 1 m in directions of the vehicle, a rest between."""
    share = np.linspace(0, 1, samples + 1)[1:]
    smooth = share**3 * (10 + share * (6 * share - 15))
    t, poses = [0.0], [np.zeros(3)]
    for direction in (first, second):
        base = poses[-1]
        for f in smooth:
            t.append(t[-1] + slow / samples)
            step = f * np.array([math.cos(direction), math.sin(direction), 0.0])
            poses.append(base + step)
        if direction == first and dwell:
            t.append(t[-1] + dwell)
            poses.append(poses[-1].copy())
    name = f"{math.degrees(second):.0f}° after {dwell} s in {slow} s, {samples}"
    return Trajectory.from_poses(t, np.array(poses), name=name)


def both(
    trajectories: list[Trajectory], spaces: list[PermissibleSpace]
) -> tuple[list[tuple[dict[str, Any], Report]], Batch]:
    """Rows of a batch with what `validate` says of the same pairs."""
    batch = Batch(trajectories, spaces)
    rows = [row for part in batch.verdicts() for row in part.to_pylist()]
    reports = [judged(t, s, TOLERANCES, False) for t in trajectories for s in spaces]
    return list(zip(rows, reports, strict=True)), batch


@pytest.mark.parametrize(
    "name", ["choreo-frc-swerve", "ift-three-steered", "mpo-700", "two-turntables"]
)
def test_ways_take_as_long_as_validate_proves(name: str) -> None:
    rng = np.random.default_rng(6)
    space = space_of(name)
    assert space.vehicle is not None
    judge = VehicleJudge(space.vehicle, TOLERANCES, is_own=False, has_rates=True)
    changer = Changer(judge, space, TOLERANCES)
    fleet, room = fleet_of([space.vehicle], TOLERANCES), np.zeros(ROOM)
    for _ in range(3):
        start, goal = ((rng.uniform(-2, 2), rng.uniform(-3, 3)) for _ in range(2))
        wanted = min(changer._way(legs).time for legs in _ways(start, goal))
        found = change_time(
            start, goal, fleet.own_rows, fleet.rows, fleet.bodies[0], LIMITS, room
        )
        assert found == pytest.approx(wanted, rel=1e-9), (start, goal)


def test_standstills_with_a_change_of_wheels_are_those_of_validate() -> None:
    spaces = [space_of(name) for name in ("choreo-frc-swerve", "raw3-short", "mpo-700")]
    trajectories = [
        corner(0.0, math.radians(angle), dwell, slow)
        for angle in (90.0, 40.0)
        for dwell, slow in ((3.0, 6.0), (0.2, 6.0))
    ]
    pairs, batch = both(trajectories, spaces)
    for row, report in pairs:
        assert row["valid"] == report.valid, report.headline
        if report.valid:
            assert row["margin"] == pytest.approx(report.margin, abs=2e-3)
        if row["limit"] == "RECONFIGURATION" and not report.valid:
            told = report.headline
            assert told is not None
            assert (told.limit, told.wheel) == (row["limit"], row["wheel"])
            for name in ("t", "value", "bound"):
                assert row[name] == pytest.approx(getattr(told, name), rel=1e-6)
            assert row["unit"] == "s"
    valid = [row["valid"] for row, _ in pairs]
    assert any(valid)
    assert not all(valid)
    assert batch.asked <= len(pairs) / 3


def test_dense_samples_around_a_rest_are_left_to_the_kernels() -> None:
    # The interval before the sample at rest ends slowly, but not at rest itself.
    spaces = [space_of(name) for name in ("choreo-frc-swerve", "mpo-700", "exomars")]
    pairs, batch = both(
        [
            corner(0.0, math.radians(angle), dwell, 6.0, samples)
            for samples in (60, 200)
            for angle in (90.0, 150.0)
            for dwell in (3.0, 0.0)
        ],
        spaces,
    )
    assert batch.asked <= 4  # the rover finds its way to 150° by search only
    for row, report in pairs:
        assert row["valid"] == report.valid
        told = report.headline
        if told is not None:
            assert (told.limit, told.wheel) == (row["limit"], row["wheel"])
            assert row["bound"] == pytest.approx(told.bound, rel=1e-9)


@pytest.mark.parametrize("name", ["romea-4ws", "four-wheel-steering", "robotis-ffw"])
def test_no_way_is_searched_to_where_wheels_cannot_stand(name: str) -> None:
    space = space_of(name)
    pairs, batch = both(
        [
            corner(0.0, math.radians(a), d, 6.0)
            for a in (100.0, 45.0)
            for d in (0.0, 3.0)
        ],
        [space],
    )
    for row, report in pairs:
        told = report.headline
        assert told is not None
        assert (row["valid"], row["limit"]) == (report.valid, told.limit)
        assert row["wheel"] == told.wheel
    assert batch.asked <= 1  # a limit that is touched


def own_trajectories(space: PermissibleSpace, count: int) -> list[Trajectory]:
    rng = np.random.default_rng(2)
    vehicle = space.vehicle
    assert vehicle is not None
    line, found = vehicle.mobility.line_beta, []
    for i in range(count):
        n = int(rng.integers(3, 12))
        t = np.cumsum(rng.uniform(0.2, 1.0, n))
        kappa_n = np.clip(np.cumsum(rng.normal(0, 0.2, n)), -2, 2)
        beta = np.cumsum(rng.normal(0, 0.2, n)) if line is None else np.full(n, line)
        v_n = np.clip(np.cumsum(rng.normal(0.1, 0.2, n)), -1, 1)
        own = Trajectory.from_omni_curve(t, kappa_n, beta, v_n, vehicle, name=f"{i}")
        found.append(own)
    return found


@pytest.mark.parametrize("name", ["raw3-short", "mecanum", "ackermann", "exomars"])
def test_own_omni_curve_parameters_are_judged_as_by_validate(name: str) -> None:
    space = space_of(name)
    pairs, batch = both(own_trajectories(space, 4), [space])
    for row, report in pairs:
        assert row["valid"] == report.valid
        if report.valid:
            assert 1 - row["margin"] == pytest.approx(1 - report.margin, rel=2.5e-3)
        else:
            told = report.headline
            assert told is not None
            assert row["limit"] == told.limit
    assert batch.asked <= 1


def test_cells_that_are_apart_are_marked_and_those_close_to_them() -> None:
    space = space_of("mpo-700", Grid())
    codes, reach, state = codes_of(space), space._reach, space.tables.state
    apart = np.argwhere((reach == BLOCKED) & (state != BLOCKED))
    assert len(apart)
    assert (codes[reach == FREE] == CONNECTED).all()
    columns = codes.shape[1]
    for row, column in apart:
        assert codes[row, column] == APART
        for step in (-MARGIN, MARGIN):
            if reach[row, (column + step) % columns] != FREE:
                assert codes[row, (column + step) % columns] in {CLOSE, APART}


def test_an_area_that_is_apart_leaves_most_pairs_to_the_kernels() -> None:
    space = space_of("mpo-700", Grid())
    trajectories = [corner(0.0, 0.5, 3.0, 8.0), corner(0.0, 0.0, 1.0, 8.0)]
    pairs, batch = both(trajectories, [space])
    for row, report in pairs:
        assert row["valid"] == report.valid
    assert batch.asked == 0


def islands() -> PermissibleSpace:
    """Two wheels one behind the other; wheel b points ahead in two ranges apart."""
    wheels = [
        {"id": "a", "type": "steered", "x": 0.4, "y": 0.0, "max_speed": 1.0,
         "steering_range_deg": (-50, 50), "max_steering_rate_deg": 90},
        {"id": "b", "type": "steered", "x": -0.4, "y": 0.0, "max_speed": 1.0,
         "steering_range_deg": (-20, 320), "max_steering_rate_deg": 90},
    ]  # fmt: skip
    data = {"name": "islands", "kappa_g": 2.5, "wheels": wheels}
    return build_space(vehicle_from_data(data), Grid(100, 180), cache=False)


def test_pieces_that_are_apart_are_refused_by_the_kernels_and_said_so() -> None:
    space, trajectories = islands(), []
    for angle in (10, -65):
        speed, lateral = 0.1, 0.1 * math.tan(math.radians(angle))
        twist = [speed, lateral / 2, -lateral / 0.8]
        still = [0.0, 0.0, 0.0]
        there = Trajectory.from_twists(
            [0.0, 1.0, 2.0, 3.0], [still, twist, twist, still], name=f"{angle}°"
        )
        trajectories.append(there)
    pairs, batch = both(trajectories, [space])
    (near, _), (far, report) = pairs
    assert near["valid"]
    told = report.headline
    assert told is not None
    assert (far["limit"], far["wheel"]) == (told.limit, None) == ("UNREACHABLE", None)
    assert (far["bound"], far["value"]) == (0.0, None)
    assert far["t"] == pytest.approx(told.t, abs=0.05)
    assert far["margin"] == pytest.approx(report.margin, abs=2e-3)
    assert batch.asked == 0
    allowed = Batch(trajectories, [space], allow_unreachable=True)
    rows = [row for part in allowed.verdicts() for row in part.to_pylist()]
    assert [row["valid"] for row in rows] == [True, True]
