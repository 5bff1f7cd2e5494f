import math

import numpy as np
import pytest

import configspace
from configspace.undercarriage import WheelPlace, mobility_of


def fixed(name: str, x: float, y: float, heading: float = 0.0) -> WheelPlace:
    return WheelPlace(name, "fixed", complex(x, y), heading, driven=True)


def test_steered_wheels_leave_beta_free() -> None:
    wheel = WheelPlace("a", "steered", 1 + 0j, 0.0, driven=True)
    mobility = mobility_of([wheel], 0.2 + 0.1j)
    assert mobility.line_beta is None
    assert mobility.reference == 0.2 + 0.1j


def test_k_is_moved_onto_the_axle() -> None:
    mobility = mobility_of([fixed("l", 0.3, 0.2), fixed("r", 0.3, -0.2)], 0j)
    assert mobility.reference == pytest.approx(0.3 + 0j)
    assert mobility.line_beta == 0.0


def test_k_on_the_axle_stays_to_the_last_bit() -> None:
    k = 0.1 + 0.05j
    mobility = mobility_of([fixed("l", 0.1, 0.2), fixed("r", 0.1, -0.2)], k)
    assert mobility.reference == k


@pytest.mark.parametrize("degrees", [-179, -120, -90, -45, 0, 30, 90, 91, 135, 180])
def test_beta_is_the_rolling_direction_that_points_forward(degrees: float) -> None:
    heading = math.radians(degrees)
    mobility = mobility_of([fixed("l", 0.3, 0.2, heading)], 0j)
    beta = mobility.line_beta
    assert beta is not None
    assert math.cos(beta) >= -1e-6
    assert abs(math.sin(beta - heading)) < 1e-12
    # K is beside the wheel: on its axle line.
    arm = mobility.reference - (0.3 + 0.2j)
    assert (arm * np.exp(-1j * heading)).real == pytest.approx(0, abs=1e-12)


def test_fixed_wheels_do_not_slip_sideways() -> None:
    heading = 30.0
    axle = np.exp(1j * math.radians(heading + 90))
    wheels = []
    for name, offset in (("l", 0.4), ("r", -0.3)):
        place = 0.2 - 0.1j + offset * axle
        wheels.append(
            {
                "id": name,
                "type": "fixed",
                "x": place.real,
                "y": place.imag,
                "heading_deg": heading,
                "max_speed": 1.0,
            }
        )
    vehicle = configspace.vehicle_from_data({"name": "v", "wheels": wheels})
    beta = vehicle.mobility.line_beta
    assert beta is not None
    assert beta == pytest.approx(math.radians(heading))
    z = configspace.wheel_directions(vehicle, np.linspace(-2, 2, 41), beta)
    side = (z * np.exp(-1j * math.radians(heading))).imag
    np.testing.assert_allclose(side, 0, atol=1e-12)


def test_wheels_a_micrometre_apart_share_an_axle() -> None:
    near = [fixed("l", 0.0, 0.2), fixed("r", 5e-7, -0.2)]
    assert mobility_of(near, 0j).line_beta == 0
    apart = [fixed("l", 0.0, 0.2), fixed("r", 1e-4, -0.2)]
    with pytest.raises(ValueError, match="parallel"):
        mobility_of(apart, 0j)


def test_passive_standard_wheels_may_stand_beside_mecanum() -> None:
    rollers = WheelPlace("m", "mecanum", 1 + 0j, 0.0, driven=True)
    passive = WheelPlace("s", "steered", -1 + 0j, 0.0, driven=False)
    assert mobility_of([rollers, passive], 0j).line_beta is None
