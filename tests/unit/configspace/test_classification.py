import numpy as np
import pytest

import configspace
from configspace.classification import (
    Classification,
    classify,
    configuration_rank,
    is_admissible,
)
from configspace.testing import VEHICLE_KINDS, VehicleKind, random_vehicle
from configspace.vehicle import SteerableWheel, Vehicle

CORNERS = ((0.4, 0.3), (-0.4, 0.3), (-0.4, -0.3), (0.4, -0.3))


def of(*wheels: dict[str, object], **more: object) -> Vehicle:
    named = [{"id": f"w{i}", **wheel} for i, wheel in enumerate(wheels)]
    return configspace.vehicle_from_data({"name": "v", "wheels": named, **more})


def at(kind: str, x: float, y: float, **more: object) -> dict[str, object]:
    speed = {} if kind == "castor" else {"max_speed": 1.0}
    return {"type": kind, "x": x, "y": y, **speed, **more}


def each(kind: str, **more: object) -> list[dict[str, object]]:
    return [at(kind, x, y, **more) for x, y in CORNERS]


AXLE = [at("fixed", 0, 0.3), at("fixed", 0, -0.3)]


@pytest.mark.parametrize(
    ("wheels", "degrees", "name"),
    [
        (AXLE, (2, 0, 2), "differential"),
        ([*AXLE, at("steered", 0.9, 0.2)], (1, 1, 2), "tricycle"),
        ([*AXLE, *each("steered")], (1, 1, 2), "Ackermann"),  # a Mars rover
        ([*AXLE, at("turntable", 0.9, 0.0, track=0.2)], (1, 1, 2), "tricycle"),
        (each("steered"), (1, 2, 3), "all standard wheels steered"),
        (each("turntable", track=0.1), (1, 2, 3), "all standard wheels steered"),
        ([at("steered", 0.4, 0.1), *each("castor")], (2, 1, 3), "one steered axle"),
        ([at("fixed", 0.4, 0.1), *each("castor")], (2, 0, 2), "differential"),
        (each("mecanum", roller_deg=45.0), (3, 0, 3), "omnidirectional"),
        (each("omni"), (3, 0, 3), "omnidirectional"),
        # Two steered wheels on one axis turn together, or not at all.
        ([at("steered", 0.4, 0.1), at("steered", 0.4, 0.1)], (2, 1, 3), "one steered"),
        # A steered wheel on the axle of fixed ones adds nothing.
        ([*AXLE, at("steered", 0.0, 0.9)], (2, 0, 2), "differential"),
        (
            [*each("omni"), at("steered", 1, 0, max_speed=None)],
            (2, 1, 3),
            "one steered",
        ),
        ([*each("omni"), at("fixed", 1, 0, max_speed=None)], (2, 0, 2), "differential"),
    ],
)
def test_types(
    wheels: list[dict[str, object]], degrees: tuple[int, int, int], name: str
) -> None:
    found = classify(of(*wheels))
    assert found.degrees == degrees
    assert (found.delta_m, found.delta_s, found.delta_M) == degrees
    assert name in found.name
    assert "ICR" in found.rule


def test_degrees_are_plain_numbers() -> None:
    assert all(type(n) is int for n in classify(of(*each("steered"))).degrees)


@pytest.mark.parametrize(
    ("kind", "degrees"),
    [
        ("differential", (2, 0, 2)),
        ("ackermann", (1, 1, 2)),
        ("mecanum", (3, 0, 3)),
        ("omni", (3, 0, 3)),
        ("mixed", (1, 2, 3)),
    ],
)
def test_random_vehicles(kind: VehicleKind, degrees: tuple[int, int, int]) -> None:
    rng = np.random.default_rng(30)
    for _ in range(30):
        assert classify(random_vehicle(rng, kind)).degrees == degrees


def test_catalogue() -> None:
    found = {
        name: classify(configspace.load_vehicle(name)).degrees
        for name in ("ackermann", "differential", "ift-four-steered", "mecanum")
    }
    assert list(found.values()) == [(1, 1, 2), (2, 0, 2), (1, 2, 3), (3, 0, 3)]


@pytest.mark.parametrize("kind", VEHICLE_KINDS)
def test_size_and_place_do_not_matter(kind: VehicleKind) -> None:
    rng = np.random.default_rng(31)
    for _ in range(10):
        vehicle = random_vehicle(rng, kind)
        data = vehicle.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
        for wheel, own in zip(data["wheels"], vehicle.wheels, strict=True):
            wheel["type"] = own.type
            wheel["x"], wheel["y"] = 0.05 * own.x + 3, 0.05 * own.y - 2
        data["kappa_g"] = 0.1
        small = configspace.vehicle_from_data(data)
        assert classify(small).degrees == classify(vehicle).degrees


def test_wheels_in_line_with_a_centre_do_not_mislead() -> None:
    """Any one generic centre may be in line with two wheels."""
    for angle in np.arange(1, 9) * 2.399963:
        e = np.exp(1j * angle)
        pair = [at("steered", r * e.real, r * e.imag) for r in (-1.0, 0.3)]
        assert classify(of(*pair)).degrees == (1, 2, 3)


def test_synchro_has_one_steering_direction() -> None:
    found = classify(of(*each("steered"), synchro=True))
    assert found.degrees == (1, 1, 2)
    assert "infinity" in found.rule
    # As declared: its wheels alone would allow more.
    alone = classify(of(at("steered", 0.3, 0.1), at("castor", 0, 0), synchro=True))
    assert alone.degrees == (1, 1, 2)


def test_synchro_ranks_are_those_of_parallel_axles() -> None:
    agv = of(*each("steered"), synchro=True)
    alike = np.linspace(-3, 3, 7)[:, None] * np.ones(4)
    assert (configuration_rank(agv, alike) == 2).all()


def test_skid_steer_is_a_differential_drive() -> None:
    agv = of(*each("fixed"), skid_steer={"effective_track": 0.8})
    found = classify(agv)
    assert found.degrees == (2, 0, 2)
    assert "skid" in found.name
    assert "slip" in found.rule
    assert configuration_rank(agv, np.zeros(4)) == 1


def test_ranks_at_steering_angles() -> None:
    agv = of(*each("steered"))
    alpha, _ = configspace.wheel_states(agv, [0.0, 0.7, 1.5, 2.0], 0.3, 1.0)
    assert configuration_rank(agv, alpha).tolist() == [2, 2, 2, 2]
    assert is_admissible(agv, alpha).all()
    off = alpha + 0.02 * np.eye(4)[2]
    assert configuration_rank(agv, off).tolist() == [3, 3, 3, 3]
    assert not is_admissible(agv, off).any()
    assert is_admissible(agv, off, tolerance=0.03).all()
    # Two by two on one axle line each: the line of both at once is one condition.
    bicycle = of(at("steered", 0.0, 0.4), at("steered", 0.0, -0.4))
    assert configuration_rank(bicycle, [[0.0, 0.0], [0.3, 0.3]]).tolist() == [1, 2]


def test_wheels_without_conditions_have_rank_zero() -> None:
    agv = of(*each("omni"))
    assert configuration_rank(agv, np.zeros((5, 4))).tolist() == [0] * 5
    assert is_admissible(agv, np.zeros((5, 4))).all()


def test_rank_and_admissibility_agree() -> None:
    rng = np.random.default_rng(32)
    for _ in range(40):
        vehicle = random_vehicle(rng, "steered")
        n = len(vehicle.wheels)
        steers = [isinstance(w, SteerableWheel) for w in vehicle.wheels]
        alpha = np.where(steers, rng.uniform(-3, 3, (20, n)), np.nan)
        np.testing.assert_array_equal(
            is_admissible(vehicle, alpha), configuration_rank(vehicle, alpha) < 3
        )
        assert is_admissible(vehicle, alpha).all() == (sum(steers) < 3)


def test_ackermann_angles() -> None:
    agv = of(*AXLE, at("steered", 0.9, 0.3), at("steered", 0.9, -0.3))
    alpha, _ = configspace.wheel_states(agv, 0.5, 0.0, 1.0)
    assert is_admissible(agv, alpha)
    parallel = np.array([0.0, 0.0, 0.3, 0.3])
    assert not is_admissible(agv, parallel)


def test_a_classification_is_a_value() -> None:
    one = Classification(1, 2, "a", "b")
    assert one == Classification(1, 2, "a", "b")
    with pytest.raises(AttributeError):
        one.delta_m = 3  # type: ignore[misc]


def test_bad_angles_are_named() -> None:
    agv = of(*each("steered"))
    with pytest.raises(configspace.InvalidInput, match="alpha: shape"):
        configuration_rank(agv, np.zeros(3))
    with pytest.raises(configspace.InvalidInput, match="alpha"):
        is_admissible(agv, [0.0, 0.0, np.nan, 0.0])
    with pytest.raises(configspace.InvalidInput, match="tolerance"):
        is_admissible(agv, np.zeros(4), tolerance=np.nan)
