"""What building needs does not grow with the number of wheels (DESIGN, speed)."""

import tracemalloc

import configspace
from configspace import Grid, Vehicle


def platform(n_wheels: int) -> Vehicle:
    wheels = [
        {
            "id": f"w{i}",
            "type": "steered",
            "x": (i // 2 - (n_wheels // 2 - 1) / 2) * 0.7,
            "y": 0.9 if i % 2 else -0.9,
            "max_speed": 1.0,
            "steering_range_deg": [-155, 155],
        }
        for i in range(n_wheels)
    ]
    return configspace.vehicle_from_data({"name": "platform", "wheels": wheels})


def peak_bytes(vehicle: Vehicle, grid: Grid) -> tuple[int, int]:
    """Peak of what NumPy and Python allocate, numba's arrays among it, and the result.

    NumPy reports its memory to tracemalloc; numba's small buffers inside kernels are
    one row or block each.
    """
    configspace.build_space(vehicle, grid, cache=False)  # compiled and loaded
    tracemalloc.start()
    try:
        space = configspace.build_space(vehicle, grid, cache=False)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    tables = [*vars(space.tables).values(), *vars(space.rates).values()]
    return peak, sum(array.nbytes for array in tables)


def test_memory_does_not_depend_on_the_number_of_wheels() -> None:
    grid = Grid(200, 360)
    few, few_tables = peak_bytes(platform(4), grid)
    many, many_tables = peak_bytes(platform(300), grid)
    assert few_tables == many_tables
    assert few > few_tables
    # The rows of limits are some hundred bytes a wheel; the tables are megabytes.
    assert many - few < 300 * 4000
    assert many < 1.15 * few
