import math

import numpy as np
import pytest

import configspace
from configspace import Reason
from configspace.limits import SectorRow, rows_of


def test_every_limit_of_the_file_becomes_a_row() -> None:
    loads, sectors = rows_of(configspace.load_vehicle("ackermann"))
    assert len(sectors) == 2  # the steered wheels
    reasons = [row.reason for row in loads]
    assert reasons.count(Reason.WHEEL_SPEED) == 2  # the driven ones
    assert reasons.count(Reason.SPEED) == 2  # forwards and backwards
    assert sum(row.direction == "reverse" for row in loads) == 1


def test_a_looser_reverse_speed_adds_nothing() -> None:
    vehicle = configspace.load_vehicle("ift-four-steered")
    loads, _ = rows_of(vehicle)
    assert all(row.direction == "both" for row in loads)


@pytest.mark.parametrize(
    ("steering_range", "middle", "half"),
    [
        ((-155, 155), 0, 155),
        ((0, 180), 90, 90),
        ((-270, 270), 0, 180),
        ((10, 400), 205, 180),
        (None, 0, math.inf),
    ],
)
def test_a_range_becomes_a_sector_of_at_most_a_turn(
    steering_range: tuple[float, float] | None, middle: float, half: float
) -> None:
    wheel = {"id": "a", "type": "steered", "x": 1, "y": 0, "max_speed": 1}
    vehicle = configspace.vehicle_from_data(
        {"name": "v", "wheels": [{**wheel, "steering_range_deg": steering_range}]}
    )
    _, (row,) = rows_of(vehicle)
    assert isinstance(row, SectorRow)
    assert np.degrees(row.middle) == pytest.approx(middle)
    assert np.degrees(row.half) == pytest.approx(half)
    assert row.wheel == 0


def test_passive_wheels_and_castors_bound_no_speed() -> None:
    wheels = [
        {"id": "a", "type": "steered", "x": 1, "y": 0},
        {"id": "b", "type": "castor", "x": -1, "y": 0},
    ]
    loads, sectors = rows_of(
        configspace.vehicle_from_data({"name": "v", "wheels": wheels})
    )
    assert loads == ()
    assert len(sectors) == 1
