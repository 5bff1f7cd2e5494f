"""The headlines of `validate_many` are those of `validate`: limit, wheel and place."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import random_motions

from configspace import Grid, PermissibleSpace, build_space
from configspace.testing import ALL_KINDS, random_vehicle
from omniplan import Report, Tolerances, Trajectory, validate_many
from omniplan.bench_cases import random_trajectories, random_vehicles
from omniplan.validation import judged

GRID = Grid(40, 72)


def told_alike(
    trajectories: Sequence[Trajectory], spaces: Sequence[PermissibleSpace]
) -> tuple[int, int]:
    """Assert that headlines are alike; return how many pairs are refused and asked."""
    table = validate_many(trajectories, spaces)
    rows = iter(table.to_pylist())
    refused = 0
    for trajectory in trajectories:
        for space in spaces:
            report = judged(trajectory, space, Tolerances(), False)
            row = next(rows)
            assert row["valid"] == report.valid, (trajectory.name, space.name)
            if not report.valid:
                refused += 1
                assert_told(row, report)
    assert table.schema.metadata is not None
    return refused, int(table.schema.metadata[b"omniplan.asked"])


def assert_told(row: dict[str, Any], report: Report) -> None:
    """Assert that a row tells the headline of a report."""
    told = report.headline
    assert told is not None
    at = f"{report.trajectory} {report.vehicle}: {told}"
    assert (row["limit"], row["wheel"]) == (told.limit, told.wheel), at
    assert row["unit"] == told.unit, at
    if told.value is None:
        assert row["value"] is None, at
        return
    if told.limit == "RECONFIGURATION":
        for name in ("t", "value", "bound"):
            assert row[name] == pytest.approx(getattr(told, name), rel=1e-6), at
        return
    alike = [
        v for v in report.violations if (v.limit, v.wheel) == (told.limit, told.wheel)
    ]
    assert any(v.t_start - 1e-9 <= row["t"] <= v.t_end + 1e-9 for v in alike), at
    # The value is taken at a sample, the report's somewhere: it is at least as bad.
    if told.scale is None and told.bound > 0:
        assert row["bound"] == pytest.approx(told.bound), at
        worst = max(abs(v.value or 0.0) for v in alike)
        assert abs(row["value"]) <= worst * (1 + 1e-6), at
        # Over a whole interval slip is held against the largest speed in it.
        least = told.bound * (1 + (told.excess_at_samples or 0.0))
        assert abs(row["value"]) >= least * (1 - 1e-6), at


def some_motions(
    rng: np.random.Generator, space: PermissibleSpace, count: int
) -> list[Trajectory]:
    """Motions that suit a vehicle, driven up to two times as fast."""
    assert space.vehicle is not None
    made = []
    for i in range(count):
        make = (random_motions.random_twists, random_motions.random_poses)[i % 2]
        motion = make(rng, space.vehicle, space)
        factor = float(rng.choice([1.0, 1.05, 1.5, 2.0]))
        t, form = motion.t / factor, motion.form
        point, name = motion.reference_point, f"{space.name}-{form}-{i}"
        speeds = factor if form == "twists" else 1.0
        build = Trajectory.from_twists if form == "twists" else Trajectory.from_poses
        made.append(build(t, motion.samples * speeds, name=name, reference_point=point))
    return made


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_of_motions_that_suit_a_random_vehicle(kind: Any) -> None:
    rng = np.random.default_rng(5)
    space = build_space(random_vehicle(rng, kind), GRID, cache=False)
    told_alike(some_motions(rng, space, 4), [space])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("kind", ALL_KINDS)
def test_of_many_random_vehicles(kind: Any, seed: int) -> None:
    rng = np.random.default_rng((17, seed))
    space = build_space(random_vehicle(rng, kind), GRID, cache=False)
    told_alike(some_motions(rng, space, 12), [space])


def test_of_wheels_alike() -> None:
    # Straight ahead all wheels are used alike: the first by name is told.
    rng = np.random.default_rng(1)
    spaces = [build_space(v, GRID, cache=False) for v in random_vehicles(rng, 12)]
    t = np.linspace(0, 2, 21)
    ahead = np.stack([3 * np.sin(np.pi * t / 2), 0 * t, 0 * t], axis=-1)
    refused, asked = told_alike([Trajectory.from_twists(t, ahead, name="a")], spaces)
    assert refused == 12
    assert asked == 0


@pytest.mark.slow
def test_of_the_benchmark() -> None:
    rng = np.random.default_rng(1)
    spaces = [build_space(v, GRID, cache=False) for v in random_vehicles(rng, 24)]
    refused, asked = told_alike(random_trajectories(rng, 30), spaces)
    assert refused > 100
    assert asked <= 2
