import math

import naive
import numpy as np
import pytest

import configspace
from configspace.testing import VEHICLE_KINDS, VehicleKind, random_vehicle
from configspace.vehicle import SteeredWheel, Vehicle


def of(*wheels: dict[str, object], **more: object) -> Vehicle:
    named = [{"id": f"w{i}", **wheel} for i, wheel in enumerate(wheels)]
    return configspace.vehicle_from_data({"name": "v", "wheels": named, **more})


def steered(x: float, y: float, speed: float | None = 1.0) -> dict[str, object]:
    return {"type": "steered", "x": x, "y": y, "max_speed": speed}


def test_boundary_curvature_is_that_of_the_busiest_wheel() -> None:
    # Section 3.2: |w|/u_lim is 0.5 for the near but slow wheel, 0.4 for the far one.
    vehicle = of(steered(0.3, 0.4, 1.0), steered(0.8, 0.0, 2.0))
    assert vehicle.boundary_curvature == pytest.approx(1 / 0.5)


def test_boundary_curvature_of_rollers_is_that_of_the_farthest_wheel() -> None:
    near = {"type": "omni", "x": 0.1, "y": 0, "max_speed": 0.1}
    far = {"type": "omni", "x": 0.8, "y": 0, "max_speed": 5}
    assert of(near, far).boundary_curvature == pytest.approx(1 / 0.8)


def test_boundary_curvature_counts_from_k() -> None:
    vehicle = of(steered(0.5, 0), steered(0.0, 0), reference_point=[0.4, 0])
    assert vehicle.boundary_curvature == pytest.approx(1 / 0.4)


def test_castors_and_passive_wheels_do_not_set_the_boundary_curvature() -> None:
    castor = {"type": "castor", "x": 5, "y": 0}
    vehicle = of(steered(0.5, 0), castor, steered(3, 0, None))
    assert vehicle.boundary_curvature == pytest.approx(1 / 0.5)


def test_single_track_has_the_wheelbase_as_radius() -> None:
    # Section 3.6: κ_g = 1/a, whichever wheel is driven.
    rear = {"type": "fixed", "x": 0, "y": 0}
    for rear_speed, front_speed in ((1.0, None), (None, 1.0), (1.0, 1.0)):
        vehicle = of({**rear, "max_speed": rear_speed}, steered(0.8, 0, front_speed))
        assert vehicle.boundary_curvature == pytest.approx(1 / 0.8)


def test_boundary_curvature_may_be_given() -> None:
    assert of(steered(0.5, 0), kappa_g=3.0).boundary_curvature == 3.0


def test_example_vehicle_has_the_papers_dimensions() -> None:
    vehicle = configspace.load_vehicle("ift-four-steered")
    assert vehicle.boundary_curvature == pytest.approx(2 / math.hypot(0.43, 0.23))


@pytest.mark.parametrize("kind", VEHICLE_KINDS)
def test_derived_numbers_agree_with_the_naive_ones(kind: VehicleKind) -> None:
    rng = np.random.default_rng(0)
    for _ in range(40):
        vehicle = random_vehicle(rng, kind)
        assert vehicle.boundary_curvature == pytest.approx(naive.kappa_g(vehicle))
        k = complex(*naive.reference(vehicle))
        assert abs(vehicle.reference - k) < 1e-12
        line, expected = vehicle.mobility.line_beta, naive.constant_beta(vehicle)
        assert (line is None) == (expected is None)
        if line is not None and expected is not None:
            assert abs(math.remainder(line - expected, 2 * math.pi)) < 1e-9


def test_random_vehicles_repeat_with_their_seed() -> None:
    one = random_vehicle(np.random.default_rng(5))
    assert one == random_vehicle(np.random.default_rng(5))


def test_angles_are_radians() -> None:
    vehicle = configspace.load_vehicle("ift-four-steered")
    wheel = vehicle.wheels[0]
    assert isinstance(wheel, SteeredWheel)
    assert wheel.steering_range == pytest.approx(
        (-math.radians(155), math.radians(155))
    )


def test_a_wheel_without_range_turns_freely() -> None:
    wheel = of(steered(0.5, 0)).wheels[0]
    assert isinstance(wheel, SteeredWheel)
    assert wheel.steering_range == (-math.inf, math.inf)
