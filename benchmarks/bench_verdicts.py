"""Verdicts in process; over zenoh see `bench_service.py`."""

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

import configspace
import omniplan
from omniplan.demo import DEMO_FLEET, manoeuvres


@pytest.mark.parametrize("name", DEMO_FLEET)
def test_validate_the_manoeuvres(benchmark: BenchmarkFixture, name: str) -> None:
    """Eight manoeuvres of 100 to 280 samples."""
    space = configspace.build_space(configspace.load_vehicle(name))
    trajectories = manoeuvres()
    benchmark(lambda: [omniplan.validate(t, space) for t in trajectories])
