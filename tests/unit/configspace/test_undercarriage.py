import math

import numpy as np
import pytest

import configspace
from configspace.undercarriage import WheelPlace, mobility_of, skid_contacts


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


def side(y: float, *xs: float, heading: float = 0.0) -> list[WheelPlace]:
    turn = np.exp(1j * heading)
    return [
        WheelPlace(f"{y}-{x}", "fixed", complex(turn * complex(x, y)), heading, True)
        for x in xs
    ]


@pytest.mark.parametrize("degrees", [0, 30, -120, 180])
def test_skid_steered_wheels_gather_beside_their_middle(degrees: float) -> None:
    heading = math.radians(degrees)
    wheels = [
        *side(0.3, -0.2, 0.4, heading=heading),
        WheelPlace("c", "castor", 1 + 1j, 0.0, driven=False),
        *side(-0.3, -0.2, 0.4, heading=heading),
    ]
    turn = np.exp(1j * heading)
    left, right = turn * (0.1 + 0.5j), turn * (0.1 - 0.5j)
    contacts = skid_contacts(wheels, 1.0)
    np.testing.assert_allclose(contacts, [left, left, 1 + 1j, right, right])


def test_skid_steered_wheels_may_be_mounted_backwards() -> None:
    wheels = [*side(0.3, 0.2), *side(0.3, -0.2, heading=math.pi)]
    # The second stands at -0.2 (-1) = 0.2 ahead and on the right.
    np.testing.assert_allclose(skid_contacts(wheels, 1.0), [0.2 + 0.5j, 0.2 - 0.5j])


@pytest.mark.parametrize(
    ("wheels", "words"),
    [
        (side(0.3, -0.2, 0.2), "two sides"),
        ([*side(0.3, 0.2), *side(-0.3, 0.2), *side(0.0, 0.2)], "two sides"),
        ([*side(0.3, 0.2), *side(-0.3, 0.2, heading=0.1)], "parallel"),
        ([*side(0.3, 0.2), WheelPlace("s", "steered", 0j, 0.0, True)], "s is steered"),
        ([*side(0.3, 0.2), WheelPlace("o", "omni", 0j, 0.0, True)], "o is omni"),
        ([WheelPlace("c", "castor", 0j, 0.0, False)], "castors only"),
    ],
)
def test_skid_steered_wheels_form_two_sides(
    wheels: list[WheelPlace], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        skid_contacts(wheels, 1.0)


def test_synchro_drives_translate_only() -> None:
    steered = WheelPlace("a", "steered", 1 + 0j, 0.0, driven=True)
    table = WheelPlace("t", "turntable", -1 + 0j, 0.0, driven=True)
    castor = WheelPlace("c", "castor", 1j, 0.0, driven=False)
    mobility = mobility_of([steered, table, castor], 0.1j, synchro=True)
    assert mobility.is_translating
    assert mobility.line_beta is None
    assert mobility.reference == 0.1j
    with pytest.raises(ValueError, match="f is fixed"):
        mobility_of([steered, fixed("f", 0, 0)], 0j, synchro=True)
    with pytest.raises(ValueError, match="castor"):
        mobility_of([castor], 0j, synchro=True)


def test_turntables_steer_and_do_not_mix_with_driven_rollers() -> None:
    table = WheelPlace("t", "turntable", -1 + 0j, 0.0, driven=True)
    assert mobility_of([table], 0j).line_beta is None
    rollers = WheelPlace("m", "mecanum", 1 + 0j, 0.0, driven=True)
    with pytest.raises(ValueError, match="driven standard wheel t"):
        mobility_of([rollers, table], 0j)
