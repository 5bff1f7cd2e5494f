"""Verdicts, in process and over zenoh."""

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

import configspace
import omniplan
from omniplan.demo import DEMO_FLEET, manoeuvres
from services import Client, Server


@pytest.mark.parametrize("name", DEMO_FLEET)
def test_validate_the_manoeuvres(benchmark: BenchmarkFixture, name: str) -> None:
    """Eight manoeuvres of 100 to 280 samples."""
    space = configspace.build_space(configspace.load_vehicle(name))
    trajectories = manoeuvres()
    benchmark(lambda: [omniplan.validate(t, space) for t in trajectories])


def test_ask_a_server_for_its_vehicles(benchmark: BenchmarkFixture) -> None:
    """One small query over TCP on loopback."""
    space = configspace.build_space(configspace.load_vehicle("mecanum"))
    with (
        Server([space], listen="tcp/127.0.0.1:0") as server,
        Client(server.endpoint) as client,
    ):
        client.wait_until_ready()
        benchmark(client.vehicles)
