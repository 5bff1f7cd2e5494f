import numpy as np
import pytest

import configspace
from configspace import Grid, Reason

GRID = Grid(80, 144)


def built(name: str) -> configspace.PermissibleSpace:
    return configspace.build_space(configspace.load_vehicle(name), GRID, cache=False)


def test_all_of_the_paper_vehicle_hangs_together() -> None:
    space = built("ift-four-steered")
    kappa_n, beta = np.meshgrid(np.linspace(-2, 2, 41), np.linspace(-3, 3, 37))
    is_free = space.v_max(kappa_n, beta) > 0
    reached = space.is_reachable(kappa_n, beta)
    assert reached[~is_free].sum() == 0
    assert reached.sum() > 0.95 * is_free.sum()
    why = space.reason(kappa_n, beta)
    assert not (why & Reason.UNREACHABLE).any()


@pytest.mark.parametrize("by_sheet", [False, True])
def test_another_component_is_permitted_but_kept_apart(by_sheet: bool) -> None:
    # A square that guarantees 1.1/s of nominal curvature with wheels that steer at
    # 1 rad/s: at |κ_n| = 1 some wheel is too near the centre of rotation for every β.
    wheels = [
        {
            "id": f"{x} {y}",
            "type": "steered",
            "x": 0.3 * x,
            "y": 0.3 * y,
            "max_speed": 1.0,
            "max_steering_rate_deg": 57.3,
        }
        for x in (1, -1)
        for y in (1, -1)
    ]
    description = {
        "name": "square",
        "wheels": wheels,
        "guaranteed": {"kappa_rate": 1.1},
    }
    vehicle = configspace.vehicle_from_data(description)
    space = configspace.build_space(vehicle, GRID, cache=False)
    if by_sheet:
        space = configspace.parse_space(configspace.dump_space(space))
    assert space.is_reachable(0.0, [0.0, 0.05]).all()
    on_the_spot = space.reason([1.95, -1.95], 0.05)
    assert (space.v_max([1.95, -1.95], 0.05) > 0).all()
    assert ((on_the_spot & Reason.UNREACHABLE) > 0).all()
    assert not space.is_reachable([1.95, -1.95], 0.05).any()
    assert not space.reason(0.01, 0.05) & Reason.UNREACHABLE


def test_a_robot_whose_straight_ahead_is_blocked_has_its_largest_component() -> None:
    space = built("robotis-ffw")
    assert not space.contains(0.0, 0.0, 0.1)
    assert space.is_reachable(2.0, 0.0)
    assert not space.reason(2.0, 0.0) & Reason.UNREACHABLE


def test_a_line_mobile_vehicle_is_reached_along_its_line_only() -> None:
    space = built("ackermann")
    assert space.is_reachable(0.3, 0.0)
    assert not space.is_reachable(1.0, 0.0)
    assert not space.is_reachable(0.3, 0.2)


def test_a_synchro_drive_reaches_every_direction() -> None:
    space = built("synchro-drive")
    assert space.is_reachable(0.0, np.linspace(-3, 3, 13)).all()
    assert not space.is_reachable(0.5, 0.0)
