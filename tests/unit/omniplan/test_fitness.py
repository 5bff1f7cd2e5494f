import math
from collections.abc import Callable
from dataclasses import replace

import pytest

import configspace
from configspace import InvalidInput, PermissibleSpace
from omniplan import FleetVehicle, Shortfall, suitable
from omniplan.choosing.fitness import FleetEntry, fleet_of, requirements_of, shortfalls
from omniplan.choosing.requirements import Crab, Payload, Radius, Speed, TurnOnTheSpot

SpaceOf = Callable[[str], PermissibleSpace]


def short(space: PermissibleSpace, *asked: str) -> tuple[Shortfall, ...]:
    return shortfalls(FleetVehicle("agv", space), requirements_of(asked))


def test_top_speed_itself_is_met_and_nothing_above(space_of: SpaceOf) -> None:
    space = space_of("ackermann")  # 1.5 m/s ahead, 0.8 m/s backwards
    assert short(space, "speed 1.5 m/s", "speed 0.8 m/s both ways") == ()
    (one,) = short(space, "speed 1.5000001 m/s")
    assert (one.what, one.asked, one.limit) == ("forwards", 1.5000001, "SPEED")
    assert one.offered == pytest.approx(1.5, rel=1e-14)
    assert "1.5000001 m/s asked, 1.5 m/s offered" in str(one)
    (back,) = short(space, "speed 1 m/s both ways")
    assert (back.what, back.unit) == ("backwards", "m/s")
    assert back.offered == pytest.approx(0.8)


def test_radius_is_that_of_the_differential_formula(space_of: SpaceOf) -> None:
    space = space_of("differential")
    vehicle = space.vehicle
    assert vehicle is not None
    half = max(abs(wheel.y) for wheel in vehicle.wheels)
    # The outer wheel rolls v (1 + b / r) and may roll 1 m/s.
    fastest = 1.0 / (1 + half / 0.8)
    assert short(space, f"radius 0.8 m at {fastest * (1 - 1e-9):.12g} m/s") == ()
    found = short(space, "radius 0.8 m at 1 m/s both ways")
    assert [one.what for one in found] == [
        "forwards, centre to the left",
        "forwards, centre to the right",
        "backwards, centre to the left",
        "backwards, centre to the right",
    ]
    assert [one.wheel for one in found] == ["right", "left", "right", "left"]
    for one in found:
        assert one.offered == pytest.approx(fastest, rel=1e-12)
        assert one.limit == "WHEEL_SPEED"


def test_smallest_radius_of_an_ackermann_steered_vehicle(space_of: SpaceOf) -> None:
    space = space_of("ackermann")  # wheelbase 0.8 m, track 0.55 m, inner wheel 40°
    smallest = 0.8 / math.tan(math.radians(40)) + 0.275
    assert short(space, f"radius {smallest * 1.0001} m both ways") == ()
    found = short(space, f"radius {smallest * 0.9999} m")
    assert [one.wheel for one in found] == ["front-left", "front-right"]
    assert {one.limit for one in found} == {"STEER_RANGE"}
    assert "any speed asked, nothing offered [STEER_RANGE of wheel" in str(found[0])


def test_a_smaller_radius_will_do() -> None:
    """With the centre on a wheel nothing goes, on a smaller circle it does."""
    wheels = [
        {"id": f"w{i}", "type": "steered", "x": x, "y": y, "max_speed": 1.0}
        for i, (x, y) in enumerate([(0.0, 0.5), (0.5, -0.4), (-0.5, -0.4)])
    ]
    vehicle = configspace.vehicle_from_data({"name": "three", "wheels": wheels})
    space = configspace.build_space(vehicle, cache=False)
    kappa_n, beta, _ = configspace.from_twist((1.0, 0.0, 1 / 0.5), space.kappa_g)
    assert float(configspace.exact_v_max(vehicle, kappa_n, beta)) == 0
    assert short(space, "radius 0.5 m") == ()
    # K is the slower the smaller the circle: the farthest wheel rolls 1 m/s.
    fastest = 0.5 / math.hypot(0.5, 0.9)
    assert short(space, f"radius 0.5 m at {fastest * 0.97:.6g} m/s") == ()
    (left, *_) = short(space, f"radius 0.5 m at {fastest * 1.01:.6g} m/s")
    assert 0.97 * fastest < (left.offered or 0.0) < fastest
    assert left.limit == "SINGULAR"


def test_turning_on_the_spot_is_limited_by_the_farthest_wheel(
    space_of: SpaceOf,
) -> None:
    space = space_of("ift-four-steered")
    rate = 1.0 / math.hypot(0.215, 0.115)
    assert shortfalls(FleetVehicle("a", space), [TurnOnTheSpot(rate)]) == ()
    left, right = shortfalls(FleetVehicle("a", space), [TurnOnTheSpot(rate * 1.01)])
    assert (left.what, right.what) == ("to the left", "to the right")
    assert left.offered == pytest.approx(rate, rel=1e-12)
    assert "°/s offered" in str(left)


def test_crab_angle_is_limited_by_the_steering_range(space_of: SpaceOf) -> None:
    vehicle = FleetVehicle("a", space_of("four-wheel-steering"))  # ±40°, 1.5 m/s
    assert shortfalls(vehicle, [Crab(math.radians(40), 1.5)]) == ()
    left, right = shortfalls(vehicle, [Crab(math.radians(40.01), 1.5)])
    assert (left.what, right.what) == ("to the left", "to the right")
    assert (left.offered, left.limit) == (0.0, "STEER_RANGE")


def test_either_representation_will_do(space_of: SpaceOf) -> None:
    # 170° aside is out of the range of ±155°, -10° and backwards is not.
    vehicle = FleetVehicle("a", space_of("ift-four-steered"))
    assert shortfalls(vehicle, [Crab(math.radians(170), 0.5)]) == ()


def test_parallel_wheels_and_fixed_wheels_are_named(space_of: SpaceOf) -> None:
    (left, _) = short(space_of("synchro-drive"), "turn on the spot")
    assert left.limit == "PARALLEL_WHEELS"
    (left, _) = short(space_of("differential"), "crab 90 deg")
    assert left.limit == "FIXED_WHEEL"


def test_payload_is_met_only_where_it_is_stated(space_of: SpaceOf) -> None:
    space = space_of("mecanum")
    (one,) = shortfalls(FleetVehicle("agv", space), [Payload(10.0)])
    assert one.offered is None
    assert str(one) == "payload 10 kg: 10 kg asked, the vehicle does not say"
    assert shortfalls(FleetVehicle("agv", space, 10.0), [Payload(10.0)]) == ()
    (one,) = shortfalls(FleetVehicle("agv", space, 9.5), [Payload(10.0)])
    assert str(one) == "payload 10 kg: 10 kg asked, 9.5 kg offered"


def test_payload_of_the_vehicle_file_counts(space_of: SpaceOf) -> None:
    space = space_of("mecanum")
    assert space.vehicle is not None
    stated = space.vehicle.model_copy(update={"max_payload": 20.0})
    with_payload = replace(space, vehicle=stated)
    assert short(with_payload, "payload 20 kg") == ()
    # What the fleet says of one vehicle goes before.
    worn = FleetVehicle("worn", with_payload, 5.0)
    assert shortfalls(worn, [Payload(20.0)])[0].offered == 5.0


def test_footprint_has_a_length_and_a_width(space_of: SpaceOf) -> None:
    space = space_of("ift-four-steered")  # 0.7 m by 0.4 m
    assert short(space, "footprint 0.7 m x 0.4 m") == ()
    length, width = short(space, "footprint 0.6 m x 0.3 m")
    assert length.what == "length"
    assert length.offered == pytest.approx(0.7)
    assert (width.what, width.asked, width.unit) == ("width", 0.3, "m")
    bare = replace(space, header=replace(space.header, footprint=()))
    assert short(bare, "footprint 9 m x 9 m")[0].offered is None


def test_a_data_sheet_promises_no_more_than_the_vehicle(space_of: SpaceOf) -> None:
    known = space_of("ift-four-steered")
    sheet = configspace.parse_space(configspace.dump_space(known))
    for asked in (
        Radius(0.8, 0.85),
        Radius(0.8, 0.8),
        Speed(1.0),
        Speed(0.99),
        Crab(2.7, 0.5),
        Crab(2.6, 0.5),
    ):
        by_sheet = shortfalls(FleetVehicle("a", sheet), [asked])
        by_vehicle = shortfalls(FleetVehicle("a", known), [asked])
        assert by_sheet or not by_vehicle
    assert shortfalls(FleetVehicle("a", sheet), [Speed(0.99), Crab(2.6, 0.5)]) == ()


def test_suitable_sorts_a_fleet(space_of: SpaceOf) -> None:
    mecanum, ackermann = space_of("mecanum"), space_of("ackermann")
    fleet: list[FleetEntry] = [("b", mecanum), FleetVehicle("a", mecanum), ackermann]
    answer = suitable(fleet, ["crab 90 deg", "speed 1.3 m/s", "no mirroring"])
    assert answer.suitable == ()
    assert [one.vehicle for one in answer.unfit] == ["b", "a", "ackermann"]
    assert [len(one.shortfalls) for one in answer.unfit] == [1, 1, 2]
    answer = suitable(fleet, [Crab(math.pi / 2, 0.5)])
    assert answer.suitable == ("b", "a")
    data = answer.to_dict()
    assert data["unfit"][0]["shortfalls"][0]["limit"] == "STEER_RANGE, FIXED_WHEEL"


def test_unreachable_motions_count_only_where_it_is_allowed() -> None:
    # On the spot every wheel is within its range, but no way leads there.
    places = ((0.3, 0.3), (0.3, -0.3), (-0.3, 0.0))
    ranges = ((-270.0, 70.0), (-40.0, 80.0), (-10.0, 290.0))
    wheels = [
        {
            "type": "steered",
            "id": f"w{i}",
            "x": x,
            "y": y,
            "max_speed": 1.0,
            "steering_range_deg": span,
        }
        for i, ((x, y), span) in enumerate(zip(places, ranges, strict=True))
    ]
    vehicle = configspace.vehicle_from_data({"name": "v", "wheels": wheels})
    space = configspace.build_space(vehicle, configspace.Grid(100, 180), cache=False)
    asked = [TurnOnTheSpot(1.0)]
    strict = shortfalls(FleetVehicle("v", space), asked)
    assert len(strict) == 2
    assert all("UNREACHABLE" in (one.limit or "") for one in strict)
    assert {one.offered for one in strict} == {0.0}
    loose = shortfalls(FleetVehicle("v", space), asked, allow_unreachable=True)
    assert loose == ()


def test_fleets_that_cannot_be_told_apart_are_refused(space_of: SpaceOf) -> None:
    space = space_of("mecanum")
    with pytest.raises(InvalidInput, match=r"mecanum twice.*pairs \(name, space\)"):
        fleet_of([space, space])
    with pytest.raises(InvalidInput, match="at least one vehicle"):
        suitable([], [])
    with pytest.raises(InvalidInput, match="1 to 200 characters"):
        FleetVehicle("", space)
    with pytest.raises(InvalidInput, match="max_payload: -1"):
        FleetVehicle("a", space, -1)


def test_all_phrases_that_are_none_are_named_at_once() -> None:
    with pytest.raises(InvalidInput) as caught:
        requirements_of(["fly", "turn on the spot", "crab 200 deg"])
    text = str(caught.value)
    assert "requirements[0], phrase: 'fly'" in text
    assert "requirements[2], crab: angle" in text
