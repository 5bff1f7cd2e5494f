"""Building and looking up spaces."""

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

import configspace


def platform(n_wheels: int) -> configspace.Vehicle:
    """Return a platform with a regular array of steered wheels in two columns."""
    rows = n_wheels // 2
    wheels = [
        {
            "id": f"w{row}-{side}",
            "type": "steered",
            "x": (row - (rows - 1) / 2) * 0.7,
            "y": 0.9 if side == "left" else -0.9,
            "max_speed": 1.0,
            "steering_range_deg": [-155, 155],
        }
        for row in range(rows)
        for side in ("left", "right")
    ]
    return configspace.vehicle_from_data(
        {"name": f"platform-{n_wheels}", "wheels": wheels}
    )


@pytest.mark.parametrize("n_wheels", [4, 16, 40, 100, 200, 300, 400])
def test_build_a_sound_space(benchmark: BenchmarkFixture, n_wheels: int) -> None:
    """400 × 720 cells, warm, over the number of wheels."""
    build(benchmark, platform(n_wheels), configspace.Grid())


@pytest.mark.parametrize(
    ("n_kappa", "n_beta"), [(100, 180), (200, 360), (400, 720), (800, 1440)]
)
def test_build_over_the_grid(
    benchmark: BenchmarkFixture, n_kappa: int, n_beta: int
) -> None:
    """Four wheels, warm, over the number of cells."""
    build(benchmark, platform(4), configspace.Grid(n_kappa, n_beta))


def build(
    benchmark: BenchmarkFixture, vehicle: configspace.Vehicle, grid: configspace.Grid
) -> None:
    """Measure several warm builds; the least of them is what the machine can do."""
    configspace.build_space(vehicle, grid, cache=False)
    benchmark(configspace.build_space, vehicle, grid, cache=False)


def test_read_a_space_from_the_cache(
    benchmark: BenchmarkFixture, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """400 × 720 cells, checksum included."""
    folder = tmp_path_factory.mktemp("cache")
    vehicle = configspace.load_vehicle("ift-four-steered")
    configspace.build_space(vehicle, cache=folder)
    benchmark(configspace.build_space, vehicle, cache=folder)


def test_look_up_a_million_configurations(benchmark: BenchmarkFixture) -> None:
    """NumPy path of `contains`."""
    space = configspace.build_space(
        configspace.load_vehicle("ift-four-steered"), cache=False
    )
    rng = np.random.default_rng(1)
    kappa_n = rng.uniform(-2, 2, 1_000_000)
    beta = rng.uniform(-np.pi, np.pi, 1_000_000)
    benchmark(space.contains, kappa_n, beta, 0.6)
