import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import configspace
from configspace import Grid
from configspace.grid import edges_of
from configspace.rates import (
    CellRates,
    build_cell_rates,
    cell_rate_limits,
    rate_limits,
    rate_polytope,
)
from configspace.vehicle import Castor, FixedWheel, SteerableWheel, Vehicle

FloatArray = npt.NDArray[np.float64]
CORNERS = [(0.235, 0.185), (-0.235, 0.185), (-0.235, -0.185), (0.235, -0.185)]
ON_WHEEL = math.atan2(0.185, 0.235) - math.pi / 2  # O-29: β of wheel 0 at κ_n = 1


def care_o_bot(limits: dict[str, float] | None = None, **wheel: object) -> Vehicle:
    wheel = {"type": "steered", "max_speed": 1.0, **wheel}
    wheels = [{"id": f"w{i}", "x": x, "y": y} for i, (x, y) in enumerate(CORNERS)]
    return of(*({**place, **wheel} for place in wheels), limits=limits or {})


def of(*wheels: dict[str, Any], **more: object) -> Vehicle:
    return configspace.vehicle_from_data({"name": "v", "wheels": wheels, **more})


FAST_STEERING = care_o_bot(max_steering_rate_deg=math.degrees(24.0))


def axes(vehicle: Vehicle, *at: float) -> list[float]:
    return [float(rate) for rate in rate_limits(vehicle, *at)]


def test_o_21_axis_values_under_a_steering_rate() -> None:
    kappa, beta, v = axes(FAST_STEERING, 0.5, 0.0, 1.0, 0.7)
    assert kappa == pytest.approx(19.2871, abs=1e-4)
    assert beta == pytest.approx(21.9402, abs=1e-4)
    assert math.isinf(v)
    polytope = rate_polytope(FAST_STEERING, 0.5, 0.0, 0.7)
    assert polytope.max_along((1, 0, 0)) == pytest.approx(kappa, rel=1e-12)
    assert polytope.contains((19.28, 0.0, 100.0))
    assert not polytope.contains((19.30, 0.0, 0.0))
    # Both at once is more than either limit permits alone.
    assert not polytope.contains((12.0, 12.0, 0.0))


def test_in_translation_beta_is_as_fast_as_the_wheels_steer() -> None:
    for beta in (-3.0, 0.0, 1.2):
        rates = axes(FAST_STEERING, 0.0, beta, 0.5, 1.0)
        assert rates[1] == pytest.approx(24.0, rel=1e-12)


@pytest.mark.parametrize("kappa_n", [-2.0, 2.0])
def test_at_the_poles_steering_does_not_bound_beta(kappa_n: float) -> None:
    kappa, beta, _ = axes(FAST_STEERING, kappa_n, 0.4, 1.0, 1.0)
    assert math.isinf(beta)
    assert math.isfinite(kappa)
    cells = build_cell_rates(FAST_STEERING)
    row, column = cells.locate(kappa_n, 0.4)
    assert cells.beta_steer[row, column] > 500


def test_rates_vanish_towards_a_singular_point() -> None:
    apart = 10.0 ** -np.arange(1, 9)
    for kappa_n, beta in ((1 - apart, ON_WHEEL), (1.0, ON_WHEEL + apart)):
        kappa, turn, _ = rate_limits(FAST_STEERING, kappa_n, beta, 0.0, 1.0)
        slower = np.minimum(kappa, turn)
        assert (np.diff(slower) < 0).all()
        assert slower[-1] < 1e-6 * slower[0]


def test_at_a_singular_point_only_the_speed_may_change() -> None:
    vehicle = care_o_bot(max_acceleration=1.0)
    assert axes(vehicle, 1.0, ON_WHEEL, 0.5, 1.0)[:2] == [0.0, 0.0]
    polytope = rate_polytope(vehicle, 1.0, ON_WHEEL, 0.5)
    assert polytope.max_along((1, 1, 0)) == 0.0
    assert polytope.limits[polytope.binding_along((1, 0, 0))] == "singular"
    assert polytope.max_along((0, 0, 1)) == pytest.approx(1 / 2)  # wheel 2: |z| = 2
    cells = build_cell_rates(vehicle)
    at = cells.locate(1.0, ON_WHEEL)
    assert cells.kappa_steer[at] == cells.beta_steer[at] == 0.0


def test_a_blocked_configuration_has_no_speed_to_change() -> None:
    vehicle = care_o_bot(max_acceleration=1.0)
    assert axes(vehicle, 0.3, 0.0, 0.5, 0.0)[2] == 0.0
    assert float(cell_rate_limits(build_cell_rates(vehicle), 3, 3, 0.5, 0.0)[2]) == 0.0


def test_a_vehicle_without_rates_is_bounded_by_nothing() -> None:
    assert axes(care_o_bot(), 0.4, 0.2, 1.0, 1.0) == [math.inf] * 3
    polytope = rate_polytope(care_o_bot(), 0.4, 0.2, 1.0)
    assert polytope.A.shape == (0, 3)
    assert polytope.contains([1e9, 1e9, 1e9])
    assert math.isinf(polytope.max_along((1, 2, 3)))
    assert polytope.binding_along((1, 2, 3)) == -1
    found = cell_rate_limits(build_cell_rates(care_o_bot()), 40, 70, 1.0, 1.0)
    assert [float(x) for x in found] == [math.inf] * 3


def test_wheel_acceleration_bounds_less_the_slower_the_vehicle_is() -> None:
    vehicle = care_o_bot(max_acceleration=2.0)
    slow, fast = (axes(vehicle, 0.5, 0.3, 1.0, v) for v in (0.1, 0.4))
    assert slow[0] == pytest.approx(4 * fast[0])
    assert slow[1] == pytest.approx(4 * fast[1])
    assert slow[2] * 0.1 == pytest.approx(fast[2] * 0.4)
    assert axes(vehicle, 0.5, 0.3, 0.0, 1.0)[:2] == [math.inf, math.inf]


def test_at_the_kink_the_gradients_of_both_sides_bound() -> None:
    vehicle = care_o_bot(max_acceleration=2.0)
    below, at, above = (axes(vehicle, k, 0.3, 1.0, 0.5)[0] for k in (0.9999, 1, 1.0001))
    assert at <= min(below, above) * (1 + 1e-3)
    n_rows = [rate_polytope(vehicle, k, 0.3, 0.5).b.size for k in (0.9, 1.0)]
    assert n_rows[1] == 2 * n_rows[0]


@pytest.mark.parametrize("v_s", [0.5, -0.5])
def test_acceleration_is_growth_of_the_speed_whatever_the_direction(
    v_s: float,
) -> None:
    vehicle = care_o_bot({"max_acceleration": 0.5, "max_deceleration": 2.0})
    polytope = rate_polytope(vehicle, 1.5, 0.0, v_s)  # c = 1/2
    faster = np.array([0.0, 0.0, math.copysign(1.0, v_s)])
    assert polytope.max_along(faster) == pytest.approx(1.0)
    assert polytope.limits[polytope.binding_along(faster)] == "acceleration"
    assert polytope.max_along(-faster) == pytest.approx(4.0)
    assert polytope.limits[polytope.binding_along(-faster)] == "deceleration"
    # A sharper turn at the same v_s is slower for K.
    assert polytope.max_along((1, 0, 0)) == pytest.approx(2.0 / 0.5)
    assert polytope.max_along((-1, 0, 0)) == pytest.approx(0.5 / 0.5)


def test_from_rest_both_directions_accelerate() -> None:
    vehicle = care_o_bot({"max_acceleration": 0.5, "max_deceleration": 0.1})
    polytope = rate_polytope(vehicle, 0.0, 0.0, 0.0)
    assert polytope.max_along((0, 0, 1)) == polytope.max_along((0, 0, -1)) == 0.5
    braking_only = care_o_bot({"max_deceleration": 0.1})
    assert rate_polytope(braking_only, 0.0, 0.0, 0.0).b.size == 0


def test_o_27_the_offset_is_signed_in_both_terms() -> None:
    # The contact 22 mm right of its rolling direction: D = -0.022.
    angle, turn = 0.6, 1.3
    straight = 0.4 * math.cos(angle) + 0.3 * math.sin(angle)
    straight += 0.5 * (0.235 * math.sin(angle) - 0.185 * math.cos(angle))
    assert straight + 0.022 * (0.5 + turn) == pytest.approx(0.5291289, abs=1e-7)
    # At the wheel's own direction (O-10) u = 0.518520.
    vehicle = care_o_bot(offset=-0.022)
    kappa_n, beta, v_s = configspace.from_twist(
        [0.4, 0.3, 0.5], vehicle.boundary_curvature
    )
    polytope = rate_polytope(vehicle, float(kappa_n), float(beta), float(v_s))
    row = next(i for i, w in enumerate(polytope.wheels) if w == 0 and polytope.b[i] < 1)
    assert polytope.limits[row] == "wheel_speed"
    assert polytope.b[row] == pytest.approx(1 - (0.518520 + 0.022 * 0.5), abs=1e-6)
    steering = rate_polytope(
        care_o_bot(max_steering_rate_deg=1.0), float(kappa_n), float(beta), float(v_s)
    )
    turning = steering.A[0] / (steering.A[0] @ steering.A[0]) * turn  # α̇ of wheel 0
    assert polytope.A[row] @ turning == pytest.approx(0.022 * turn, rel=1e-9)


def test_the_wheels_of_a_turntable_pay_for_steering_on_both_sides() -> None:
    place = {"type": "turntable", "id": "t", "x": 0.5, "y": 0.0, "max_speed": 1.0}
    vehicle = of({**place, "track": 0.4})
    # Straight ahead at half speed the faster wheel has 0.5 m/s left, 0.2 m away.
    assert axes(vehicle, 0.0, 0.0, 0.5, 1.0)[1] == pytest.approx(0.5 / 0.2)
    assert axes(vehicle, 0.0, 0.0, 1.0, 1.0)[1] == 0.0
    assert axes(vehicle, 0.0, 0.0, -0.5, 1.0)[1] == pytest.approx(0.5 / 0.2)


def test_motors_that_steer_and_roll_share_their_speed() -> None:
    vehicle = care_o_bot(steering_coupling=0.1)
    assert axes(vehicle, 0.0, 0.0, 0.4, 1.0)[1] == pytest.approx(0.6 / 0.1)
    polytope = rate_polytope(vehicle, 0.0, 0.0, 0.4)
    assert polytope.max_along((0, 1, 0)) == polytope.max_along((0, -1, 0))


def test_a_configuration_too_fast_for_its_offset_wheels_offers_nothing() -> None:
    vehicle = care_o_bot(offset=0.05)
    polytope = rate_polytope(vehicle, 0.5, 0.0, 5.0)
    assert not polytope.contains(np.zeros(3))
    assert polytope.max_along((0, 1, 0)) == 0.0
    assert axes(vehicle, 0.5, 0.0, 1.0, 5.0)[:2] == [0.0, 0.0]


def test_fixed_wheels_hold_beta_and_synchro_drives_hold_kappa() -> None:
    car = differential()
    assert axes(car, 0.5, 0.0, 0.5, 1.0)[1] == 0.0
    assert rate_polytope(car, 0.5, 0.0, 0.5).max_along((0, 1, 0)) == 0.0
    assert build_cell_rates(car).beta_steer.shape == (100, 1)
    steered = {"type": "steered", "max_speed": 1.0, "max_steering_rate_deg": 60.0}
    synchro = of(
        *({**steered, "id": f"w{i}", "x": x, "y": 0.2} for i, x in enumerate((0, 1))),
        synchro=True,
    )
    assert axes(synchro, 0.0, 0.5, 0.5, 1.0)[0] == 0.0
    cells = build_cell_rates(synchro)
    assert cells.kappa_steer.shape == (1, 180)
    found = cell_rate_limits(cells, *cells.locate(0.0, 0.5), 0.5, 1.0)
    assert float(found[0]) == 0.0
    assert float(found[1]) == pytest.approx(math.radians(60))


def differential() -> Vehicle:
    wheel = {"type": "fixed", "x": 0.0, "max_speed": 1.0, "max_acceleration": 1.0}
    return of({**wheel, "id": "l", "y": 0.25}, {**wheel, "id": "r", "y": -0.25})


def test_a_differential_drive_by_hand() -> None:
    # u = v_s (c ∓ s) on the boundary circle; κ_n = 1/2: 0.5 and 1.5 per v_s.
    kappa, _, v = axes(differential(), 0.5, 0.0, 0.5, 0.8)
    assert kappa == pytest.approx(1 / 0.4)  # |∂u/∂κ_n| = v_s
    assert v * 0.8 == pytest.approx(1 / 1.5)


def test_inputs_are_checked_and_outputs_read_only() -> None:
    with pytest.raises(configspace.InvalidInput, match="one number each"):
        rate_polytope(FAST_STEERING, [0.0, 1.0], 0.0, 0.0)  # type: ignore[arg-type]
    with pytest.raises(configspace.InvalidInput, match="v_n"):
        rate_limits(FAST_STEERING, 0.0, 0.0, math.nan, 1.0)
    polytope = rate_polytope(FAST_STEERING, 0.0, 0.0, 0.0)
    with pytest.raises(configspace.InvalidInput, match="rates"):
        polytope.contains([math.nan, 0, 0])
    for array in (polytope.A, polytope.b, build_cell_rates(FAST_STEERING).v_s_dot):
        assert not array.flags.writeable


def test_many_configurations_at_once_broadcast() -> None:
    found = rate_limits(FAST_STEERING, [[0.0], [0.5]], [0.0, 0.1, 0.2], 0.5, 1.0)
    assert [x.shape for x in found] == [(2, 3)] * 3
    cells = build_cell_rates(FAST_STEERING)
    row, column = cells.locate([[0.0], [0.5]], [0.0, 0.1, 0.2])
    found = cell_rate_limits(cells, row, column, 0.5, 1.0)
    assert [x.shape for x in found] == [(2, 3)] * 3


# --- the kernel's plain twin


def cosine_range(size: float, phase: float, b0: float, b1: float) -> list[float]:
    """Least and largest ``size cos(β - phase)`` for β from b0 to b1."""
    tops = [phase + k * math.pi for k in range(-4, 5)]
    at = [b0, b1, *(x for x in tops if b0 < x < b1)]
    values = [size * math.cos(x - phase) for x in at]
    return [min(values), max(values)]


def plain_wheel(
    vehicle: Vehicle, i: int, k: tuple[float, float], b: tuple[float, float]
) -> dict[str, float]:
    """The bounds for one wheel that steers, by the formulas of the specification."""
    place = (vehicle.contacts[i] - vehicle.reference) * vehicle.boundary_curvature
    r, bearing = abs(place), math.atan2(place.imag, place.real)
    outer = max(map(abs, k)) > 1
    sign = 1.0 if sum(k) > 0 else -1.0
    parts = [(2 - abs(x), sign) if outer else (1.0, x) for x in k]
    # f = X sin β - Y cos β, g = X cos β + Y sin β
    fs = cosine_range(r, bearing + math.pi / 2, *b)
    g = max(map(abs, cosine_range(r, bearing, *b)))
    points = list(parts)
    for f in fs:
        if outer:  # c² + 2 c s f + r²
            vertex = -sign * f
            low, high = sorted(c for c, _ in parts)
            points += [(min(max(vertex, low), high), sign)]
            points += [(min(max(vertex / 2, low), high), sign)]
        elif r > 0:  # 1 + 2 κ f + κ² r²
            points += [(1.0, min(max(-f / r**2, min(k)), max(k)))]
    qs = [c * c + (s * r) ** 2 + 2 * c * s * f for c, s in points for f in fs]
    q, q_max = (
        min(qs),
        max(c * c + (s * r) ** 2 + 2 * c * s * f for c, s in parts for f in fs),
    )
    if q <= 1e-9:
        return {"q": 0.0, "far": math.sqrt(q_max)}
    z, c_max = math.sqrt(q), max(c for c, _ in parts)
    ratios = [(c * c - (s * r) ** 2) / x for c, s in parts for x in (q, q_max)]
    terms = max(abs(c * (c + s * f)) for c, s in points for f in fs)
    slopes = {
        True: min(1.0, max(abs(c + s * f) for c, s in parts for f in fs) / z),
        False: min(r, max(abs(f + s * r * r) for _, s in parts for f in fs) / z),
    }
    speed = slopes[outer]
    if 1.0 in map(abs, k):  # the other side of the kink, at the kink
        others = (1 + sign * f if not outer else f + sign * r * r for f in fs)
        beyond = max(map(abs, others)) / z
        speed = max(speed, min(1.0 if not outer else r, beyond))
    once = max(abs(1 + x) for x in ratios) / 2
    return {
        "q": q,
        "alpha_kappa": min(g / q, (1.0 if outer else r) / z),
        "alpha_beta": min(terms / q, once, c_max / z),
        "speed_kappa": speed,
        "speed_beta": min(max(c * abs(s) for c, s in parts) * g / z, c_max),
        "near": z,
        "far": math.sqrt(q_max),
    }


@pytest.mark.parametrize("name", ["care-o-bot-3", "ift-three-steered"])
def test_the_kernel_equals_its_plain_twin(name: str) -> None:
    data = configspace.load_vehicle(name).model_dump(mode="json", exclude_none=True)
    for i, wheel in enumerate(data["wheels"]):
        wheel.update(max_steering_rate_deg=90.0 + i, max_acceleration=1.0 + i)
    data["limits"] = {"max_speed": 1.0, "max_yaw_rate_deg": 90.0}
    vehicle = configspace.vehicle_from_data(data)
    grid = Grid(12, 16)
    cells = build_cell_rates(vehicle, grid)
    kappa, beta = edges_of(vehicle.mobility, grid)
    steered = [i for i, w in enumerate(vehicle.wheels) if isinstance(w, SteerableWheel)]
    for row in range(12):
        for column in range(16):
            k = (float(kappa[row]), float(kappa[row + 1]))
            b = (float(beta[column]), float(beta[column + 1]))
            plain = [plain_wheel(vehicle, i, k, b) for i in steered]
            assert_cell(vehicle, cells, (row, column), steered, plain)


def assert_cell(
    vehicle: Vehicle,
    cells: CellRates,
    at: tuple[int, int],
    steered: list[int],
    plain: list[dict[str, float]],
) -> None:
    wheels: list[Any] = [vehicle.wheels[i] for i in steered]
    rates = [math.radians(w.max_steering_rate_deg) for w in wheels]
    accelerations = [w.max_acceleration for w in wheels]
    pairs = list(zip(accelerations, plain, strict=True))
    expected = min(a / p["far"] for a, p in pairs)
    assert cells.v_s_dot[at] == pytest.approx(expected, rel=1e-6)
    if any(p["q"] == 0 for p in plain):
        assert cells.kappa_steer[at] == cells.beta_steer[at] == 0
        return
    for name in ("kappa", "beta"):
        turns = [p[f"alpha_{name}"] for p in plain]
        expected = min(x / t for x, t in zip(rates, turns, strict=True))
        table = getattr(cells, f"{name}_steer")
        assert table[at] == pytest.approx(expected, rel=1e-6)
        expected = min(a / p[f"speed_{name}"] for a, p in pairs)
        table = getattr(cells, f"{name}_accel")
        assert table[at] == pytest.approx(expected, rel=1e-6)


def test_headroom_is_least_of_all_wheels_at_every_share() -> None:
    vehicle = care_o_bot(offset=0.03)
    cells = build_cell_rates(vehicle, Grid(40, 60))
    row, column = cells.locate(0.33, 0.7)
    load = float(cells.headroom_load[row, column])
    for share in (0.0, 0.5, 0.75, 0.9, 0.97, 1.0, 1.3):
        promised = cell_rate_limits(cells, row, column, share / load, 1.0)
        exact = rate_limits(vehicle, 0.33, 0.7, share / load, 1.0)
        assert 0 <= promised[0] <= exact[0]
        assert 0 <= promised[1] <= exact[1]
        assert share > 0.8 or promised[1] > 0.7 * exact[1]


def test_castors_and_unlimited_wheels_bound_nothing() -> None:
    castor = {"type": "castor", "id": "c", "x": 0.1, "y": 0.2}
    car = differential()
    with_castor = of(castor, *(w.model_dump(exclude_none=True) for w in car.wheels))
    assert isinstance(with_castor.wheels[0], Castor)
    assert isinstance(with_castor.wheels[1], FixedWheel)
    one, other = build_cell_rates(car), build_cell_rates(with_castor)
    for name, table in vars(one).items():
        np.testing.assert_array_equal(table, getattr(other, name))


def test_an_offset_wheel_may_roll_backwards_and_its_load_counts_all_the_same() -> None:
    # Turning about a point between the steering axis and the wheel beside it.
    vehicle = of(
        {"type": "steered", "id": "w", "x": 0.5, "y": 0.0, "max_speed": 1.0}
        | {"offset": 0.6}
    )
    cells = build_cell_rates(vehicle, Grid(20, 36))
    kappa_n, beta = np.meshgrid(
        np.linspace(0.5, 1.5, 101), np.linspace(-2.5, -0.6, 101)
    )
    z = configspace.wheel_directions(vehicle, kappa_n, beta)[..., 0]
    rolls = np.abs(z) - 0.6 * 2.0 * np.minimum(kappa_n, 1)
    assert rolls.min() < -1.0
    assert (np.abs(rolls) <= cells.headroom_load[cells.locate(kappa_n, beta)]).all()
