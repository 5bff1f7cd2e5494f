"""Batches: many twists against a space, many trajectories against a fleet."""

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

import configspace
from omniplan import check_twists, validate_many
from omniplan.bench_cases import random_trajectories, random_vehicles


@pytest.mark.parametrize("name", ["ift-four-steered", "mecanum", "differential"])
def test_check_a_million_twists(benchmark: BenchmarkFixture, name: str) -> None:
    """float32, some of them too fast."""
    space = configspace.build_space(configspace.load_vehicle(name), cache=False)
    rng = np.random.default_rng(1)
    twists = rng.uniform(-1.2, 1.2, (1_000_000, 3)).astype(np.float32)
    benchmark(check_twists, twists, space)


def test_validate_a_hundred_by_a_hundred(benchmark: BenchmarkFixture) -> None:
    """Vehicles all different, 100 samples per trajectory."""
    rng = np.random.default_rng(1)
    grid = configspace.Grid(40, 72)
    spaces = [
        configspace.build_space(vehicle, grid, cache=False)
        for vehicle in random_vehicles(rng, 100)
    ]
    trajectories = random_trajectories(rng, 100)
    benchmark(validate_many, trajectories, spaces)
