"""The promises of change rates: polytopes match motion, cells never promise more."""

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
    RatePolytope,
    build_cell_rates,
    cell_rate_limits,
    rate_limits,
    rate_polytope,
)
from configspace.testing import VEHICLE_KINDS, random_configurations, random_vehicle
from configspace.vehicle import Castor, FixedWheel, SteerableWheel, Vehicle

FloatArray = npt.NDArray[np.float64]


def equipped(rng: np.random.Generator, index: int) -> Vehicle:
    """A random vehicle of each kind in turn, with rates, offsets and accelerations."""
    kind = VEHICLE_KINDS[index % len(VEHICLE_KINDS)]
    data = random_vehicle(rng, kind).model_dump(mode="json", exclude_none=True)
    for wheel in data["wheels"]:
        if wheel["type"] != "castor" and rng.random() < 0.7:
            wheel["max_acceleration"] = float(rng.uniform(0.2, 3.0))
        if wheel["type"] == "steered":
            equip_steering(rng, wheel)
    for name in ("max_acceleration", "max_deceleration"):
        if rng.random() < 0.5:
            data["limits"][name] = float(rng.uniform(0.2, 3.0))
    steered = {w["type"] for w in data["wheels"]} <= {"steered", "castor"}
    data["synchro"] = bool(steered and rng.random() < 0.1)
    return configspace.vehicle_from_data(data)


def equip_steering(rng: np.random.Generator, wheel: dict[str, Any]) -> None:
    if rng.random() < 0.8:
        wheel["max_steering_rate_deg"] = float(rng.uniform(20, 1000))
    case = int(rng.integers(5))
    if case == 1:
        wheel["offset"] = float(rng.uniform(-0.2, 0.2))
    elif case == 2:
        wheel.pop("offset", None)
        wheel.update(type="turntable", track=float(rng.uniform(0.1, 0.6)))
    if case == 3 or rng.random() < 0.1:
        wheel["steering_coupling"] = float(rng.uniform(0.01, 0.3))


def places(
    rng: np.random.Generator, vehicle: Vehicle, count: int
) -> tuple[FloatArray, FloatArray]:
    """Configurations that the mobility permits."""
    kappa_n, beta = random_configurations(rng, vehicle, count)
    if vehicle.mobility.line_beta is not None:
        beta = np.full(count, vehicle.mobility.line_beta)
    if vehicle.mobility.is_translating:
        kappa_n = np.zeros(count)
    return kappa_n, beta


def speeds(
    rng: np.random.Generator, vehicle: Vehicle, kappa_n: FloatArray, beta: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """v_n and v_max: what is permitted, or anything."""
    v_n = rng.choice([-1.0, 0.0, 1.0, 0.3, 0.9], kappa_n.size)
    v_n = np.where(rng.random(v_n.size) < 0.5, rng.uniform(-1, 1, v_n.size), v_n)
    anything = 10 ** rng.uniform(-3, 1, v_n.size)
    permitted = configspace.exact_v_max(vehicle, kappa_n, beta)
    some = (rng.random(v_n.size) < 0.5) & np.isfinite(permitted)
    return v_n, np.where(some, permitted, anything)


def in_cells(
    rng: np.random.Generator, vehicle: Vehicle, grid: Grid, count: int
) -> tuple[npt.NDArray[Any], ...]:
    """Rows and columns of random cells, and a point of each, often on an edge."""
    kappa, beta = edges_of(vehicle.mobility, grid)
    row = rng.integers(0, kappa.size - 1, count)
    column = rng.integers(0, beta.size - 1, count)
    f, g = rng.choice([0.0, 0.5, 1.0], (2, count))
    inside = rng.random(count) < 0.7
    f, g = (np.where(inside, rng.random(count), x) for x in (f, g))
    at_kappa = (1 - f) * kappa[row] + f * kappa[row + 1]
    at_beta = (1 - g) * beta[column] + g * beta[column + 1]
    return row, column, at_kappa, at_beta


def assert_sound(
    vehicle: Vehicle,
    promised: tuple[FloatArray, ...],
    true: tuple[FloatArray, ...],
    *at: FloatArray,
) -> None:
    for name, bound, exact in zip(("kappa", "beta", "v"), promised, true, strict=True):
        assert not np.isnan(bound).any()
        assert not np.isnan(exact).any()
        wrong = np.flatnonzero(bound > exact)
        if wrong.size:
            i = wrong[0]
            where = [float(x[i]) for x in at]
            text = f"{name}: {bound[i]!r} > {exact[i]!r} at {where}"
            raise AssertionError(f"{text}, {wrong.size} times, {vehicle!r}")


def sweep(seed: int, n_vehicles: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    for index in range(n_vehicles):
        vehicle = equipped(rng, index)
        grid = Grid(4 * int(rng.integers(1, 26)), int(rng.integers(8, 181)))
        cells = build_cell_rates(vehicle, grid)
        row, column, kappa_n, beta = in_cells(rng, vehicle, grid, count // 2)
        v_n, v_max = speeds(rng, vehicle, kappa_n, beta)
        promised = cell_rate_limits(cells, row, column, v_n, v_max)
        true = rate_limits(vehicle, kappa_n, beta, v_n, v_max)
        assert_sound(vehicle, promised, true, kappa_n, beta, v_n, v_max)
        kappa_n, beta = places(rng, vehicle, count // 2)
        v_n, v_max = speeds(rng, vehicle, kappa_n, beta)
        here = cells.locate(kappa_n, beta)
        promised = cell_rate_limits(cells, *here, v_n, v_max)
        true = rate_limits(vehicle, kappa_n, beta, v_n, v_max)
        assert_sound(vehicle, promised, true, kappa_n, beta, v_n, v_max)


@pytest.mark.parametrize("seed", range(4))
def test_cells_promise_no_more_than_any_of_their_points_offers(seed: int) -> None:
    sweep(seed, 30, 1000)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4, 24))
def test_cells_promise_no_more_than_any_of_many_points_offers(seed: int) -> None:
    sweep(seed, 120, 5000)


def tightness(cells: CellRates, vehicle: Vehicle, v_n: float = 0.3) -> list[float]:
    """Median of bound / exact for κ̇_n, β̇, v̇_n at a third of the permitted speed."""
    rng = np.random.default_rng(5)
    kappa_n, beta = rng.uniform(-2, 2, 20000), rng.uniform(-np.pi, np.pi, 20000)
    v_max = configspace.exact_v_max(vehicle, kappa_n, beta)
    moves = v_max > 0
    kappa_n, beta, v_max = kappa_n[moves], beta[moves], v_max[moves]
    true = rate_limits(vehicle, kappa_n, beta, v_n, v_max)
    here = cells.locate(kappa_n, beta)
    promised = cell_rate_limits(cells, *here, v_n, v_max)
    return [float(np.median(p / t)) for p, t in zip(promised, true, strict=True)]


@pytest.mark.parametrize(
    ("grid", "least"), [(Grid(100, 180), 0.92), (Grid(400, 720), 0.97)]
)
@pytest.mark.parametrize("name", ["care-o-bot-3", "two-turntables", "mecanum"])
def test_cells_promise_most_of_what_there_is(
    name: str, grid: Grid, least: float
) -> None:
    vehicle = configspace.load_vehicle(name)
    ratios = tightness(build_cell_rates(vehicle, grid), vehicle)
    assert all(least < ratio <= 1 for ratio in ratios), ratios


# --- the polytope against motion, wheel by wheel in real numbers


def wheel_motion(
    vehicle: Vehicle, i: int, kappa_n: float, beta: float
) -> tuple[float, float]:
    """Steering angle and rolling speed per v_s, by v + ω x w."""
    gentle = abs(kappa_n) < 1
    v = 1.0 if gentle else 2 - abs(kappa_n)
    omega = vehicle.boundary_curvature * (
        kappa_n if gentle else math.copysign(1, kappa_n)
    )
    place = vehicle.contacts[i] - vehicle.reference
    ux = v * math.cos(beta) - omega * place.imag
    uy = v * math.sin(beta) + omega * place.real
    wheel = vehicle.wheels[i]
    if isinstance(wheel, SteerableWheel):
        return math.atan2(uy, ux), math.hypot(ux, uy)
    assert not isinstance(wheel, Castor)
    gamma = 0.0 if isinstance(wheel, FixedWheel) else wheel.roller
    angle = wheel.heading + gamma
    return 0.0, (ux * math.cos(angle) + uy * math.sin(angle)) / math.cos(gamma)


def shares(
    vehicle: Vehicle, at: FloatArray, rates: FloatArray
) -> dict[tuple[str, int], float]:
    """What moving on at these rates takes of each limit, by central differences."""
    h = 1e-6 / max(1.0, float(np.abs(rates).max()))
    before, after = at - h * rates, at + h * rates
    taken: dict[tuple[str, int], float] = {}
    for i, wheel in enumerate(vehicle.wheels):
        if isinstance(wheel, Castor):
            continue
        (a0, r0), (_, r), (a1, r1) = (
            wheel_motion(vehicle, i, float(q[0]), float(q[1]))
            for q in (before, at, after)
        )
        if wheel.max_acceleration is not None:
            change = (after[2] * r1 - before[2] * r0) / (2 * h)
            taken["wheel_acceleration", i] = abs(change) / wheel.max_acceleration
        if not isinstance(wheel, SteerableWheel):
            continue
        turn = math.remainder(a1 - a0, 2 * math.pi) / (2 * h)
        if wheel.max_steering_rate_deg is not None:
            limit = math.radians(wheel.max_steering_rate_deg)
            taken["steering_rate", i] = abs(turn) / limit
        steering_rolls = wheel.steering_coupling > 0 or any(wheel.offsets)
        if wheel.max_speed is not None and steering_rolls:
            omega = at[2] * max(-1.0, min(1.0, at[0])) * vehicle.boundary_curvature
            coupled = wheel.steering_coupling * abs(turn)
            rolls = [abs(at[2] * r - d * (omega + turn)) for d in wheel.offsets]
            taken["wheel_speed", i] = (max(rolls) + coupled) / wheel.max_speed
    pace = [abs(q[2]) * min(1.0, 2 - abs(q[0])) for q in (before, after)]
    growth = (pace[1] - pace[0]) / (2 * h)
    taken["acceleration", -1] = growth / (vehicle.limits.max_acceleration or np.inf)
    taken["deceleration", -1] = -growth / (vehicle.limits.max_deceleration or np.inf)
    return taken


def regular_place(
    rng: np.random.Generator, vehicle: Vehicle
) -> tuple[float, float, float]:
    """A configuration away from kinks and singular points, and a v_s it can have."""
    wheels = [i for i, w in enumerate(vehicle.wheels) if not isinstance(w, Castor)]
    while True:
        kappa_n, beta = (float(x[0]) for x in places(rng, vehicle, 1))
        if vehicle.mobility.is_translating:
            break
        near = min(abs(abs(kappa_n) - kink) for kink in (1, 2))
        steered = [i for i in wheels if isinstance(vehicle.wheels[i], SteerableWheel)]
        slowest = min(
            (wheel_motion(vehicle, i, kappa_n, beta)[1] for i in steered), default=1.0
        )
        if near > 1e-3 and slowest > 0.03:
            break
    v_s = float(rng.uniform(0.05, 1.0) * rng.choice([-1, 1]))
    return kappa_n, beta, v_s


def random_direction(
    rng: np.random.Generator, vehicle: Vehicle, polytope: RatePolytope
) -> FloatArray:
    reach = [min(polytope.max_along(e), polytope.max_along(-e)) for e in np.eye(3)]
    direction = rng.normal(size=3) * np.clip(reach, 0.1, 10)
    if vehicle.mobility.line_beta is not None:
        direction[1] = 0.0
    if vehicle.mobility.is_translating:
        direction[0] = 0.0
    return np.asarray(direction)


@pytest.mark.parametrize("seed", range(6))
def test_rates_inside_keep_every_limit_and_beyond_a_face_break_the_named_one(
    seed: int,
) -> None:
    rng = np.random.default_rng(300 + seed)
    broken = set()
    for index in range(150):
        vehicle = equipped(rng, index)
        at = np.array(regular_place(rng, vehicle))
        polytope = rate_polytope(vehicle, *at)
        if not polytope.contains(np.zeros(3)):
            worst = max(shares(vehicle, at, np.zeros(3)).values())
            assert worst > 1  # too fast as it is
            continue
        direction = random_direction(rng, vehicle, polytope)
        t = polytope.max_along(direction)
        inside = direction * min(0.999 * t, 1.0)
        assert polytope.contains(inside)
        assert max(shares(vehicle, at, inside).values()) <= 1 + 1e-6
        if math.isinf(t):
            continue
        row = polytope.binding_along(direction)
        name, wheel = polytope.limits[row], polytope.wheels[row]
        beyond = shares(vehicle, at, 1.01 * t * direction)
        assert not polytope.contains(1.01 * t * direction)
        if polytope.b[row] > 1e-3:
            assert beyond[name, wheel] > 1
            broken.add(name)
    assert broken >= {"steering_rate", "wheel_acceleration", "wheel_speed"}


def test_axis_values_are_those_of_the_polytope() -> None:
    rng = np.random.default_rng(400)
    for index in range(120):
        vehicle = equipped(rng, index)
        kappa_n, beta = places(rng, vehicle, 4)
        v_n, v_max = rng.uniform(-1, 1, 4), rng.uniform(0.1, 0.5, 4)
        v_n[0] = 0.0
        axes = rate_limits(vehicle, kappa_n, beta, v_n, v_max)
        for i in range(4):
            v_s = float(v_n[i] * v_max[i])
            polytope = rate_polytope(vehicle, float(kappa_n[i]), float(beta[i]), v_s)
            if not polytope.contains(np.zeros(3)):
                continue
            scale = (1.0, 1.0, float(v_max[i]))
            for axis, rates, e in zip(range(3), axes, np.eye(3), strict=True):
                both = min(polytope.max_along(e), polytope.max_along(-e))
                assert rates[i] * scale[axis] == pytest.approx(both, rel=1e-12)


def test_the_singular_zone_is_where_the_polytope_lacks_the_guaranteed_rates() -> None:
    checked = 0
    for name in configspace.catalog():
        vehicle = configspace.load_vehicle(name)
        if vehicle.guaranteed is None:
            continue
        kappa = vehicle.guaranteed.kappa_rate
        beta = math.radians(vehicle.guaranteed.beta_rate_deg)
        corners = np.array([[kappa, beta, 0.0], [kappa, -beta, 0.0]])
        rng = np.random.default_rng(7)
        for at in zip(*places(rng, vehicle, 100), strict=True):
            if configspace.exact_v_max(vehicle, *at) > 0:
                polytope = rate_polytope(vehicle, float(at[0]), float(at[1]), 0.0)
                steering = np.array([x == "steering_rate" for x in polytope.limits])
                taken = np.abs(polytope.A[steering] @ corners.T)
                assert (taken <= polytope.b[steering, None] * (1 + 1e-9)).all(), name
                checked += 1
    assert checked > 50
