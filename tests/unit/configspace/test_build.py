import numpy as np
import pytest

import configspace
from configspace import Grid


def test_build_refuses_vehicles_without_any_speed_limit() -> None:
    passive = {"id": "a", "type": "steered", "x": 0.4, "y": 0.2}
    for limits in (
        {},
        {"max_speed": 1},
        {"max_yaw_rate_deg": 9},
        {"max_reverse_speed": 1},
    ):
        vehicle = configspace.vehicle_from_data(
            {"name": "v", "wheels": [passive], "limits": limits}
        )
        with pytest.raises(configspace.InvalidVehicle, match="limit"):
            configspace.build_space(vehicle, Grid(4, 8), cache=False)


def test_speed_and_yaw_rate_bound_a_vehicle_without_driven_wheels() -> None:
    vehicle = configspace.vehicle_from_data(
        {
            "name": "v",
            "wheels": [{"id": "a", "type": "steered", "x": 0.5, "y": 0}],
            "limits": {"max_speed": 2, "max_yaw_rate_deg": 90},
        }
    )
    space = configspace.build_space(vehicle, Grid(40, 72), cache=False)
    assert float(space.v_max(0.0, 0.0)) == pytest.approx(2, rel=1e-3)
    # v_s κ_g = π/2 rad/s with κ_g = 2 1/m
    assert float(space.v_max(2.0, 0.0)) == pytest.approx(np.pi / 4, rel=1e-3)


def test_a_single_driven_wheel_is_judged_alike_wherever_it_stands() -> None:
    outcomes = []
    for y in (0.0, 0.1):
        wheel = {"id": "a", "type": "steered", "x": 1.0, "y": y, "max_speed": 1.0}
        vehicle = configspace.vehicle_from_data({"name": "v", "wheels": [wheel]})
        try:
            configspace.build_space(vehicle, cache=False)
            outcomes.append("built")
        except configspace.InvalidVehicle:
            outcomes.append("refused")
    assert outcomes[0] == outcomes[1]


def test_building_twice_gives_the_same_tables() -> None:
    vehicle = configspace.load_vehicle("ift-four-steered")
    one, two = (
        configspace.build_space(vehicle, Grid(16, 24), cache=False) for _ in "12"
    )
    for name, array in vars(one.tables).items():
        np.testing.assert_array_equal(array, getattr(two.tables, name))


def test_tables_have_the_shape_of_the_grid() -> None:
    for name, shape in (("mecanum", (1, 16, 24)), ("ackermann", (2, 16, 1))):
        space = configspace.build_space(
            configspace.load_vehicle(name), Grid(16, 24), cache=False
        )
        d, k, m = shape
        assert space.tables.load.shape == (d, k + 1, m + 1)
        assert space.tables.v_lo.shape == space.tables.v_hi.shape == shape
        assert space.tables.state.shape == (k, m)


def test_interpolated_loads_are_never_too_small_and_cells_agree_with_nodes() -> None:
    vehicle = configspace.load_vehicle("mecanum")
    space = configspace.build_space(vehicle, Grid(16, 24), cache=False)
    kappa_n, beta = np.meshgrid(
        space.grid.kappa_edges, space.grid.beta_edges, indexing="ij"
    )
    exact = configspace.exact_v_max(vehicle, kappa_n, beta)
    assert (space.tables.load[0] >= exact**-2.0).all()
    assert (space.tables.v_lo[0] <= exact[:-1, :-1]).all()
    assert (space.tables.v_hi[0] >= exact[1:, 1:]).all()


OFFSET = {"type": "steered", "max_speed": 1.0, "offset": 0.5}


def build(grid: Grid, *wheels: dict[str, object], **more: object) -> object:
    named = [{"id": f"w{i}", **wheel} for i, wheel in enumerate(wheels)]
    vehicle = configspace.vehicle_from_data({"name": "v", "wheels": named, **more})
    return configspace.build_space(vehicle, grid, cache=False)


@pytest.mark.parametrize("grid", [Grid(4, 8), Grid(16, 24), Grid(44, 90), Grid()])
def test_wheels_that_can_stand_still_together_bound_no_speed(grid: Grid) -> None:
    # The centre of rotation may be under both wheels, half a metre beside both axes.
    pair = [{**OFFSET, "x": x, "y": 0.0} for x in (0.3, -0.3)]
    with pytest.raises(configspace.InvalidVehicle, match="limit"):
        build(grid, *pair)
    apart = [{**wheel, "x": 2 * float(str(wheel["x"]))} for wheel in pair]
    build(grid, *apart)  # 1.2 m apart: no such point
    other = [pair[0], {**pair[1], "offset": -0.5}]
    build(grid, *other)  # one of them stands in left turns, the other in right turns


@pytest.mark.parametrize("grid", [Grid(4, 8), Grid(8, 12), Grid(16, 24)])
@pytest.mark.parametrize("place", ["reference", "center_of_gravity"])
def test_fast_vehicles_with_slow_loads_are_built_on_coarse_grids(
    grid: Grid, place: str
) -> None:
    wheels = [
        {
            "type": "omni",
            "x": 0.3 * np.cos(at),
            "y": 0.3 * np.sin(at),
            "heading_deg": np.degrees(at) + 90,
            "max_speed": speed,
        }
        for at, speed in ((0.0, 60.0), (2.1, 50.0), (4.2, 40.0))
    ]
    limits = {"max_lateral_acceleration": 1.0, "lateral_acceleration_at": place}
    load = {"center_of_gravity": [0.02, 0.0, 1.0]}
    build(grid, *wheels, limits=limits, load=load)


def test_a_turntable_alone_bounds_the_speed() -> None:
    # Its wheels cannot both stand still where the vehicle moves.
    table = {"type": "turntable", "x": 0.5, "y": 0.1, "track": 0.3, "max_speed": 1.0}
    build(Grid(), table)


def test_lateral_acceleration_and_tipping_alone_do_not_bound_translation() -> None:
    wheel = {"type": "steered", "x": 0.5, "y": 0.0}
    castors = [{"type": "castor", "x": -0.5, "y": y} for y in (-0.5, 0.5)]
    load = {"center_of_gravity": [0.0, 0.0, 1.0]}
    with pytest.raises(configspace.InvalidVehicle, match="limit"):
        build(
            Grid(16, 24),
            wheel,
            *castors,
            load=load,
            limits={"max_lateral_acceleration": 1.0},
        )


def test_synchro_drives_have_one_row_of_cells() -> None:
    space = configspace.build_space(
        configspace.load_vehicle("synchro-drive"), Grid(16, 24), cache=False
    )
    assert space.tables.state.shape == (1, 24)
    assert space.tables.load.shape[1:] == (2, 25)
