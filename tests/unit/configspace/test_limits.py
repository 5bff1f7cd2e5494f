import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import configspace
from configspace import Reason, exact_v_max
from configspace.limits import LoadRow, SectorRow, rows_of
from configspace.rates import rate_limits, rate_polytope
from configspace.testing import random_configurations, vehicles
from configspace.vehicle import SteerableWheel, Vehicle

WHEEL = {"type": "steered", "x": 0.5, "y": 0.0, "max_speed": 1.0}
PASSIVE = {"type": "steered", "x": 1.0, "y": 0.0}
SQUARE = [{"type": "castor", "x": x, "y": y} for x in (-0.5, 0.5) for y in (-0.5, 0.5)]


def of(*wheels: dict[str, Any], **more: Any) -> Vehicle:
    named = [{"id": f"w{i}", **wheel} for i, wheel in enumerate(wheels)]
    return configspace.vehicle_from_data({"name": "v", "wheels": named, **more})


def loads_of(vehicle: Vehicle, reason: Reason) -> list[LoadRow]:
    return [row for row in rows_of(vehicle)[0] if row.reason == reason]


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


# --- vehicles solvable by head; κ_g is 2 1/m for a wheel half a metre ahead


@pytest.mark.parametrize(
    ("offset", "left", "right"),
    [(0.0, 1.0, 1.0), (0.1, 1 / 0.8, 1 / 1.2), (-0.1, 1 / 1.2, 1 / 0.8)],
)
def test_a_wheel_beside_its_axis_rolls_less_in_turns_to_its_side(
    offset: float, left: float, right: float
) -> None:
    # On the spot the axis moves with 1 m/s, the vehicle turns with 2 rad/s.
    vehicle = of({**WHEEL, "offset": offset})
    assert float(exact_v_max(vehicle, 2.0, 0.0)) == pytest.approx(left)
    assert float(exact_v_max(vehicle, -2.0, 0.0)) == pytest.approx(right)
    assert float(exact_v_max(vehicle, 0.0, 1.0)) == pytest.approx(1.0)


def test_the_outer_wheel_of_a_turntable_binds() -> None:
    vehicle = of({**WHEEL, "type": "turntable", "track": 0.4})
    np.testing.assert_allclose(exact_v_max(vehicle, [-2.0, 2.0], 0.0), 1 / 1.4)
    assert len(loads_of(vehicle, Reason.WHEEL_SPEED)) == 2


def test_a_turntable_is_two_wheels_beside_one_axis() -> None:
    table = of({**WHEEL, "type": "turntable", "track": 0.4}, kappa_g=2.0)
    pair = of({**WHEEL, "offset": 0.2}, {**WHEEL, "offset": -0.2}, kappa_g=2.0)
    rng = np.random.default_rng(0)
    kappa_n, beta = rng.uniform(-2, 2, 500), rng.uniform(-np.pi, np.pi, 500)
    np.testing.assert_array_equal(
        exact_v_max(table, kappa_n, beta), exact_v_max(pair, kappa_n, beta)
    )


def test_coupled_steering_costs_nothing_at_rest() -> None:
    one, other = of(WHEEL), of({**WHEEL, "steering_coupling": 0.3})
    assert rows_of(one) == rows_of(other)


def test_lateral_acceleration_counts_where_it_is_asked_for() -> None:
    load = {"center_of_gravity": [0.25, 0.0, 0.1]}
    limits = {"max_lateral_acceleration": 0.5, "max_speed": 9}
    at_k = of(WHEEL, *SQUARE, load=load, limits=limits)
    limits["lateral_acceleration_at"] = "center_of_gravity"  # type: ignore[assignment]
    at_load = of(WHEEL, *SQUARE, load=load, limits=limits)
    assert loads_of(at_k, Reason.LATERAL_ACCELERATION)[0].b == 0
    # On the spot K stands still; the load goes round with v_s 0.5 and 2 v_s.
    assert float(exact_v_max(at_k, 2.0, 0.0)) == pytest.approx(1.0)
    assert float(exact_v_max(at_load, 2.0, 0.0)) == pytest.approx(math.sqrt(0.5))
    # At κ_n = 1 ahead K drives v_s, the load hypot(1, 0.5) v_s.
    assert float(exact_v_max(at_k, 1.0, 0.0)) == pytest.approx(0.5)
    expected = math.sqrt(0.25 / math.hypot(1, 0.5))
    assert float(exact_v_max(at_load, 1.0, 0.0)) == pytest.approx(expected)


@pytest.mark.parametrize("factor", [1.0, 2.0])
def test_a_load_tips_over_the_outer_edge(factor: float) -> None:
    load = {"center_of_gravity": [0.0, 0.2, 1.5], "tipping_factor": factor}
    passive = {**PASSIVE, "x": 0.0, "y": 0.0}
    vehicle = of(passive, *SQUARE, load=load, kappa_g=2.0)
    assert len(loads_of(vehicle, Reason.TIPPING)) == 4
    # A left turn at κ_n = 1: a = 2 v_s² (1 - 0.4) to the left, also -0 ahead; the
    # load may move 0.7 m to the right, or 0.3 m to the left in a right turn.
    arms = {1.0: (0.7, 2 * (1 - 0.4)), -1.0: (0.3, 2 * (1 + 0.4))}
    for kappa_n, (room, acceleration) in arms.items():
        expected = math.sqrt(room * 9.81 / (1.5 * factor) / acceleration)
        assert float(exact_v_max(vehicle, kappa_n, 0.0)) == pytest.approx(expected)
        why, who = configspace.exact_reason(vehicle, kappa_n, 0.0)
        assert (int(why), int(who)) == (Reason.TIPPING, -1)
    assert float(exact_v_max(vehicle, 0.0, 0.0)) == np.inf


def test_mass_does_not_matter_for_tipping() -> None:
    load = {"center_of_gravity": [0.0, 0.2, 1.5]}
    assert rows_of(of(WHEEL, *SQUARE, load=load)) == rows_of(
        of(WHEEL, *SQUARE, load={**load, "mass": 500})
    )


@pytest.mark.parametrize(
    ("kappa_rate", "beta_rate", "is_permitted"),
    [
        (0.9, 0.0, True),
        (1.1, 0.0, False),
        (0.0, 0.9, True),
        (0.0, 1.1, False),
        (0.5, 0.45, True),
        (0.5, 0.55, False),
    ],
)
def test_guaranteed_rates_must_be_followed_by_the_wheels(
    kappa_rate: float, beta_rate: float, is_permitted: bool
) -> None:
    # Straight ahead ∂α/∂κ_n = κ_g x = 1 and ∂α/∂β = 1; the wheel steers 1 rad/s.
    wheel = {**WHEEL, "max_steering_rate_deg": math.degrees(1.0)}
    rates = {"kappa_rate": kappa_rate, "beta_rate_deg": math.degrees(beta_rate)}
    vehicle = of(wheel, guaranteed=rates)
    assert (float(exact_v_max(vehicle, 0.0, 0.0)) > 0) == is_permitted
    if not is_permitted:
        why, who = configspace.exact_reason(vehicle, 0.0, 0.0)
        assert (int(why), int(who)) == (Reason.SINGULAR, 0)


def test_wheels_without_a_steering_rate_follow_any_guarantee() -> None:
    vehicle = of(WHEEL, guaranteed={"kappa_rate": 100, "beta_rate_deg": 1e4})
    assert rows_of(vehicle) == rows_of(of(WHEEL))


def test_the_singular_zone_grows_with_the_guarantee() -> None:
    wheels = [{**WHEEL, "x": x, "max_steering_rate_deg": 90} for x in (0.5, -0.5)]
    rng = np.random.default_rng(1)
    kappa_n, beta = rng.uniform(-2, 2, 4000), rng.uniform(-np.pi, np.pi, 4000)
    shares = []
    for rate in (0.0, 0.1, 0.4, 0.8):
        vehicle = of(*wheels, guaranteed={"kappa_rate": rate})
        shares.append((exact_v_max(vehicle, kappa_n, beta) == 0).mean())
    assert shares[0] == 0
    assert shares == sorted(shares)
    assert shares[-1] > 0.05


def test_a_skid_steered_vehicle_drives_as_its_differential_drive() -> None:
    wheels = [
        {"type": "fixed", "x": x, "y": y, "max_speed": 1.0}
        for x in (-0.3, 0.3)
        for y in (-0.2, 0.2)
    ]
    skid = of(*wheels, skid_steer={"effective_track": 0.8})
    pair = [{"type": "fixed", "x": 0.0, "y": y, "max_speed": 1.0} for y in (-0.4, 0.4)]
    kappa_n = np.linspace(-2, 2, 81)
    np.testing.assert_allclose(
        exact_v_max(skid, kappa_n, 0.0), exact_v_max(of(*pair), kappa_n, 0.0)
    )
    assert skid.boundary_curvature == pytest.approx(1 / 0.4)


def test_a_synchro_drive_does_not_turn() -> None:
    wheels = [{**WHEEL, "x": x, "steering_range_deg": [-90, 90]} for x in (0.5, -0.5)]
    vehicle = of(*wheels, synchro=True)
    beta = np.radians([0, 89, 91, 180])
    np.testing.assert_array_equal(exact_v_max(vehicle, 0.0, beta), [1, 1, 0, 0])
    np.testing.assert_array_equal(exact_v_max(vehicle, [0.1, -2.0, 1e-8], 0.0), 0)
    why, who = configspace.exact_reason(vehicle, [0.1, -2.0], 0.0)
    np.testing.assert_array_equal(why, Reason.PARALLEL_WHEELS)
    np.testing.assert_array_equal(who, -1)


@pytest.mark.parametrize(
    ("changes", "rate"),
    [
        ({"offset": 0.2}, 5.0),
        ({"offset": -0.2}, 5.0),
        ({"steering_coupling": 0.1}, 10.0),
        ({"offset": -0.2, "steering_coupling": 0.05}, 4.0),
        ({"offset": 0.2, "max_speed": None}, math.inf),
        ({"offset": 0.2, "max_steering_rate_deg": 90}, math.pi / 2),
        ({"offset": 0.2, "max_steering_rate_deg": 360}, 5.0),
        ({"type": "turntable", "track": 0.5}, 4.0),
        ({}, math.inf),
    ],
)
def test_steering_at_standstill_may_cost_rolling(
    changes: dict[str, Any], rate: float
) -> None:
    (wheel,) = of({**WHEEL, **changes}).wheels
    assert isinstance(wheel, SteerableWheel)
    assert wheel.standing_steering_rate == pytest.approx(rate)
    vehicle = of({**WHEEL, **changes}, limits={"max_speed": 1, "max_yaw_rate_deg": 90})
    # As the rate limits see it: straight ahead ∂α/∂β = 1 and ∂α/∂κ_n = κ_g x = 1.
    kappa_n_dot, beta_dot, _ = rate_limits(vehicle, 0.0, 0.0, 0.0, 1.0)
    assert float(kappa_n_dot) == pytest.approx(rate)
    assert float(beta_dot) == pytest.approx(rate)
    # The singular zone begins where the guaranteed rates ask for just this much.
    for factor, is_permitted in ((0.999, True), (1.001, not math.isfinite(rate))):
        asked = factor * min(rate, 10.0) / 2
        guaranteed = {"kappa_rate": asked, "beta_rate_deg": math.degrees(asked)}
        data = vehicle.model_dump(mode="json") | {"guaranteed": guaranteed}
        guarding = configspace.vehicle_from_data(data)
        assert (float(exact_v_max(guarding, 0.0, 0.0)) > 0) == is_permitted


@given(vehicles(("guaranteed", "offset", "turntable")), st.integers(0, 2**32))
def test_permitted_configurations_offer_the_guaranteed_rates_from_standstill(
    vehicle: Vehicle, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    data = vehicle.model_dump(mode="json")
    data["guaranteed"] = data["guaranteed"] or {"kappa_rate": 0.4, "beta_rate_deg": 0}
    if data["synchro"]:
        data["guaranteed"]["kappa_rate"] = 0
    for wheel in data["wheels"]:
        if wheel["type"] in {"steered", "turntable"}:
            wheel["steering_coupling"] = float(rng.uniform(0, 0.3))
    vehicle = configspace.vehicle_from_data(data)
    assert vehicle.guaranteed is not None
    kappa_n, beta = random_configurations(rng, vehicle, 60)
    open_ = exact_v_max(vehicle, kappa_n, beta) > 0
    kappa_n, beta = kappa_n[open_], beta[open_]
    for at in zip(kappa_n.tolist(), beta.tolist(), strict=True):
        polytope = rate_polytope(vehicle, *at, 0.0)
        for sign in (1, -1):
            rates = np.array(
                [
                    vehicle.guaranteed.kappa_rate,
                    sign * math.radians(vehicle.guaranteed.beta_rate_deg),
                    0.0,
                ]
            )
            asked = polytope.A @ rates
            for limit, a, b in zip(polytope.limits, asked, polytope.b, strict=True):
                if limit in {"steering_rate", "wheel_speed"}:
                    assert abs(a) <= b * (1 + 1e-6)
