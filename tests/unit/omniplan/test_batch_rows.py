"""The rows of the kernels are held against `VehicleJudge`, part by part."""

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import configspace
from configspace import Vehicle
from configspace.testing import ALL_KINDS, random_vehicle
from omniplan import Tolerances, Trajectory
from omniplan.batch.chords import HIGH, LOW, ROOM
from omniplan.batch.fleet import fleet_of
from omniplan.batch.motions import FIELDS, LANES, motions_of
from omniplan.batch.refine import YES, load, one_row
from omniplan.batch.swings import widened
from omniplan.bench_cases import random_trajectories
from omniplan.judging.rows import Judge
from omniplan.judging.vehicle_judge import VehicleJudge
from omniplan.motion import Intervals, PoseMotion, motion_of

FloatArray = npt.NDArray[np.float64]

TOLERANCES = Tolerances()
LIMITS = np.array(
    [
        TOLERANCES.standstill,
        np.sin(TOLERANCES.slip_angle),
        TOLERANCES.slip_speed,
        TOLERANCES.alignment,
    ]
)
WHOLE = {"FIXED_WHEEL", "PARALLEL_WHEELS", "REVERSE_SPEED"}
"""Limits for which both ends count together."""
INSIDE = 5
"""Times inside a part at which rows are evaluated."""
NAMES = (
    "care-o-bot-3",
    "care-o-bot-4",
    "exomars",
    "ift-three-steered",
    "mpo-700",
    "romea-4ws",
    "rox-argo",
    "two-turntables",
    "bmw-320i",
    "ridgeback",
)


def some_trajectories(rng: np.random.Generator) -> list[Trajectory]:
    t = np.linspace(0, 5, 30)
    phase, pace = rng.uniform(0, 6, 3), rng.uniform(0.5, 1.5, 3)
    waves = np.sin(np.outer(t, pace) + phase) * rng.uniform(0.1, 0.8, 3)
    poses = np.cumsum(np.abs(rng.normal(0.1, 0.03, (12, 3))), axis=0)
    return [
        *random_trajectories(rng, 2, samples=30),
        Trajectory.from_poses(
            np.arange(12) * 0.3, poses, name="on-the-way", reference_point=(0.2, 0.1)
        ),
        Trajectory.from_twists(t, waves, name="twists"),
    ]


def rows_of_kernel(
    trajectory: Trajectory, vehicle: Vehicle
) -> dict[tuple[str, str, float], list[tuple[FloatArray, FloatArray]]]:
    """(limit, wheel, representation) to what is reached and never exceeded."""
    motions, fleet = motions_of([trajectory]), fleet_of([vehicle], TOLERANCES)
    count, room = motions.count[0], np.zeros(ROOM)
    wide = widened(motions.blocks, motions.knot_of, motions.knots, motions.forms[0])
    found: dict[tuple[str, str, float], list[tuple[FloatArray, FloatArray]]] = {}
    for r, label in enumerate(fleet.labels):
        low, high = np.empty((2, len(wide) * LANES))
        for b in range(len(wide)):
            load(wide, b, room, True)
            one_row_alone(room, fleet.rows, r, fleet.bodies[0])
            at = slice(b * LANES, (b + 1) * LANES)
            low[at], high[at] = room[LOW : LOW + LANES], room[HIGH : HIGH + LANES]
        sign = fleet.rows[r, 2]
        for one in (1.0, -1.0) if sign == 0 else (sign,):
            key = label.limit, label.wheel, one
            found.setdefault(key, []).append((low[:count], high[:count]))
    return found


def one_row_alone(room: FloatArray, rows: FloatArray, r: Any, body: FloatArray) -> None:
    one_row(room, rows, r, body, LIMITS, YES)


def times_of(trajectory: Trajectory) -> tuple[npt.NDArray[np.int64], FloatArray]:
    """Knots (parts,) and times (INSIDE + 2, parts) at the ends and inside of parts."""
    motions = motions_of([trajectory])
    fields = motions.blocks.transpose(1, 0, 2).reshape(FIELDS, -1)
    share = np.linspace(0, 1, INSIDE + 2)[:, None]
    times = fields[15] + share * (fields[16] - fields[15])
    count = motions.count[0]
    return motions.knot_of.ravel()[:count], times[:, :count]


def rows_of_judge(
    trajectory: Trajectory, judge: Judge
) -> dict[tuple[str, str, float], list[FloatArray]]:
    """(limit, wheel, representation) to what is reached, (INSIDE + 2, parts)."""
    motion, (knot, times) = motion_of(trajectory, is_own=False), times_of(trajectory)
    found: dict[tuple[str, str, float], list[FloatArray]] = {}
    for sign in (1, -1):
        lows = [
            judge.utilisation(motion.enclose(Intervals(knot, t, t)), sign)[0]
            for t in times
        ]
        for i, row in enumerate(judge.rows):
            wheel = judge.wheel_ids[row.wheel] if row.wheel >= 0 else ""
            key = row.limit, wheel, float(sign)
            found.setdefault(key, []).append(np.stack([low[:, i] for low in lows]))
    return found


def bounds_of_judge(
    trajectory: Trajectory, judge: Judge
) -> dict[tuple[str, str, float], list[FloatArray]]:
    """(limit, wheel, representation) to what is never exceeded, (parts,)."""
    motion, (knot, times) = motion_of(trajectory, is_own=False), times_of(trajectory)
    part = motion.enclose(Intervals(knot, times[0], times[-1]))
    found: dict[tuple[str, str, float], list[FloatArray]] = {}
    for sign in (1, -1):
        high = judge.utilisation(part, sign)[1]
        for i, row in enumerate(judge.rows):
            wheel = judge.wheel_ids[row.wheel] if row.wheel >= 0 else ""
            found.setdefault((row.limit, wheel, float(sign)), []).append(high[:, i])
    return found


def assert_rows_alike(trajectory: Trajectory, vehicle: Vehicle) -> set[str]:
    """Hold what is reached at the ends, and bounds against what is reached inside."""
    is_pose = isinstance(motion_of(trajectory, is_own=False), PoseMotion)
    judge = VehicleJudge(
        vehicle, TOLERANCES, is_own=False, has_rates=True, has_swing=is_pose
    )
    wanted = rows_of_judge(trajectory, judge)
    found = rows_of_kernel(trajectory, vehicle)
    moving = ~standing(trajectory, vehicle)
    theirs = bounds_of_judge(trajectory, judge)
    seen = set()
    for (limit, wheel, sign), columns in wanted.items():
        if limit == "REVERSE_SPEED" and sign > 0:
            continue  # a row of the other representation only
        if limit == "STEER_RANGE" and judge.winding_wheels:
            continue  # left to `validate`
        # Rows of one name are alike as a set: the largest of them counts.
        reached = np.max(columns, axis=0)[:, moving]
        low, high = (
            np.max(column, axis=0)[moving]
            for column in zip(*found[limit, wheel, sign], strict=True)
        )
        at = f"{vehicle.name} {trajectory.name} {limit} {wheel} {sign}"
        ends = np.maximum(reached[0], reached[-1])
        if limit not in WHOLE:
            np.testing.assert_allclose(low, ends, rtol=1e-6, atol=2e-7, err_msg=at)
        inside = reached.max(axis=0)
        bound = np.max(theirs[limit, wheel, sign], axis=0)[moving]
        assert (inside <= bound * (1 + 1e-9) + 1e-7).all(), at
        assert (inside <= high * (1 + 1e-9) + 1e-7).all(), at
        seen.add(limit)
    return seen


def standing(trajectory: Trajectory, vehicle: Vehicle) -> npt.NDArray[np.bool_]:
    """Whether the vehicle nearly stands somewhere on a part: there rows may be free."""
    motion, (knot, times) = motion_of(trajectory, is_own=False), times_of(trajectory)
    slowest = np.full(knot.shape, np.inf)
    for t in times:
        e = motion.enclose(Intervals(knot, t, t))
        v = np.abs(e.v0 + 1j * e.omega0 * vehicle.reference)
        speed = np.maximum(v, np.abs(e.omega0) / vehicle.boundary_curvature)
        slowest = np.minimum(slowest, speed)
    return np.asarray(slowest <= 1.1 * TOLERANCES.standstill)


@pytest.mark.parametrize("name", NAMES)
def test_rows_are_those_of_the_vehicle_judge(name: str) -> None:
    rng = np.random.default_rng(5)
    vehicle = configspace.load_vehicle(name)
    seen = set()
    for trajectory in some_trajectories(rng):
        seen |= assert_rows_alike(trajectory, vehicle)
    assert seen


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_rows_are_those_of_the_vehicle_judge_for_random_vehicles(kind: Any) -> None:
    rng = np.random.default_rng(9)
    for _ in range(2):
        vehicle = random_vehicle(rng, kind)
        assert_rows_alike(some_trajectories(rng)[0], vehicle)
