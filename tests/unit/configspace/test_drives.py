"""Speeds of drives, against contact points followed through the world."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import configspace
from configspace import drive_contacts, drive_speeds, rate_polytope, twist_from_drives
from configspace.testing import (
    ALL_KINDS,
    VehicleKind,
    random_vehicle,
    rigid_body,
    vehicles,
)
from configspace.vehicle import FixedWheel, SteerableWheel, Vehicle

SEEDS = st.integers(0, 2**32 - 1)


def of(*wheels: dict[str, object], **more: object) -> Vehicle:
    named = [
        {"id": f"w{i}", "type": "steered", "max_speed": 1.0, **wheel}
        for i, wheel in enumerate(wheels)
    ]
    return configspace.vehicle_from_data({"name": "v", "wheels": named, **more})


def motion_of(
    vehicle: Vehicle, rng: np.random.Generator
) -> tuple[float, float, float, float, float]:
    """A configuration away from kinks, its speed and rates, as the vehicle can."""
    kappa_n = rng.choice([-1, 1]) * (rng.choice([0, 1]) + rng.uniform(0.05, 0.95))
    beta, v_s = rng.uniform(-3, 3), rng.uniform(-1, 1)
    kappa_n_dot, beta_dot = rng.uniform(-1, 1, 2)
    if vehicle.mobility.line_beta is not None:
        beta, beta_dot = vehicle.mobility.line_beta, 0.0
    if vehicle.mobility.is_translating:
        kappa_n = kappa_n_dot = 0.0
    return float(kappa_n), float(beta), v_s, float(kappa_n_dot), float(beta_dot)


def simulated(
    vehicle: Vehicle, motion: tuple[float, float, float, float, float]
) -> np.ndarray:
    """Speeds along the rolling direction of contact points, through the world.

    The pose of K is integrated; where a contact is at two instants tells its speed.
    The point of the ground under a wheel's hub: w + j D e^{jα}, α unwrapped.
    """
    kappa_n, beta, v_s, kappa_n_dot, beta_dot = motion
    kappa_g = vehicle.boundary_curvature

    def state(t: float) -> tuple[float, float]:
        return kappa_n + kappa_n_dot * t, beta + beta_dot * t

    def pose_dot(t: float, pose: np.ndarray) -> list[float]:
        vx, vy, omega = configspace.to_twist(*state(t), v_s, kappa_g)
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        return [cos * vx - sin * vy, sin * vx + cos * vy, omega]

    h = 1e-5
    ends = []
    for sign in (-1, 1):
        span = (0.0, sign * h)
        run = solve_ivp(pose_dot, span, [0.3, -0.2, 0.7], rtol=1e-12, atol=1e-15)
        x, y, heading = run.y[:, -1]
        alpha, _ = configspace.wheel_states(vehicle, *state(sign * h), v_s)
        place = [
            vehicle.contacts[c.wheel]
            - vehicle.reference
            + 1j * c.offset * np.exp(1j * alpha[c.wheel])
            for c in drive_contacts(vehicle)
        ]
        ends.append(x + 1j * y + np.exp(1j * heading) * np.array(place))
    velocity = (ends[1] - ends[0]) / (2 * h) * np.exp(-0.7j)
    alpha, _ = configspace.wheel_states(vehicle, *state(0.0), v_s)
    rolling = []
    for contact, v in zip(drive_contacts(vehicle), velocity, strict=True):
        wheel = vehicle.wheels[contact.wheel]
        gamma = getattr(wheel, "roller", 0.0)
        along = np.exp(-1j * (alpha[contact.wheel] + gamma))
        rolling.append((v * along).real / np.cos(gamma))
    return np.array(rolling)


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_contacts_roll_as_they_move_through_the_world(kind: VehicleKind) -> None:
    rng = np.random.default_rng(31)
    for _ in range(6):
        vehicle = random_vehicle(rng, kind)
        motion = motion_of(vehicle, rng)
        z = configspace.wheel_directions(vehicle, *motion[:2])
        if np.abs(z).min() < 0.05:  # α turns too fast for differences
            continue
        found = drive_speeds(vehicle, *motion)
        np.testing.assert_allclose(found.rolling, simulated(vehicle, motion), atol=2e-6)


@pytest.mark.parametrize("offset", [0.12, -0.12])
@pytest.mark.parametrize("standing", [True, False])
def test_wheels_beside_their_axis_both_sides(offset: float, standing: bool) -> None:
    agv = of(
        {"x": 0.4, "y": 0.3, "offset": offset},
        {"x": -0.4, "y": 0.3},
        {"type": "turntable", "x": -0.4, "y": -0.3, "track": 0.2},
        {"x": 0.4, "y": -0.3, "steering_coupling": 0.05},
    )
    motion = (0.6, 0.4, 0.0 if standing else -0.7, 0.5, -0.8)
    found = drive_speeds(agv, *motion)
    assert found.names == ("w0", "w1", "w2/left", "w2/right", "w3")
    np.testing.assert_allclose(found.rolling, simulated(agv, motion), atol=1e-7)
    if standing:
        expected = -found.alpha_dot[[0, 2, 2]] * [offset, 0.1, -0.1]
        np.testing.assert_allclose(found.rolling[[0, 2, 3]], expected, atol=1e-15)
        assert np.abs(expected).min() > 0.01
    # A module with two motors, u ± k α̇, asks for the faster one.
    motors = found.rolling[4] + np.array([1, -1]) * 0.05 * found.alpha_dot[3]
    assert found.demand[4] == pytest.approx(np.abs(motors).max(), rel=1e-12)
    np.testing.assert_array_equal(found.demand[:4], np.abs(found.rolling[:4]))


def test_a_lateral_offset_of_the_specification() -> None:
    """O-27, by a motion whose steering rate is the given one."""
    corners = ((-0.235, 0.185), (-0.235, -0.185), (0.235, -0.185))
    plain = [dict[str, object](x=x, y=y) for x, y in corners]
    agv = of({"x": 0.235, "y": 0.185, "offset": -0.022}, *plain)
    state = configspace.from_twist([0.4, 0.3, 0.5], agv.boundary_curvature)
    by_beta = configspace.wheel_gradients(agv, *state[:2]).alpha_beta[0]
    found = drive_speeds(agv, *state, beta_dot=1.3 / by_beta)
    assert found.alpha_dot[0] == pytest.approx(1.3, rel=1e-12)
    assert found.rolling[0] == pytest.approx(0.518520 + 0.022 * (0.5 + 1.3), abs=1e-6)


@given(vehicles(ALL_KINDS), SEEDS)
def test_without_steering_it_is_the_rolling_of_v_max(
    vehicle: Vehicle, seed: int
) -> None:
    """Of the rigid-body formula that the soundness tests use, which is another's."""
    bare = vehicle.model_copy(
        update={"limits": type(vehicle.limits)(), "load": None, "guaranteed": None}
    )
    rng = np.random.default_rng(seed)
    kappa_n, beta, *_ = motion_of(bare, rng)
    contacts = drive_contacts(bare)
    if not contacts:
        return
    limit = np.array([contact.max_speed for contact in contacts])
    used = drive_speeds(bare, kappa_n, beta, 1.0).demand / limit
    v_max = rigid_body(bare, kappa_n, beta).v_max
    if not np.isfinite(v_max):
        assert used.max() == 0
        return
    assert used.max() * float(v_max) == pytest.approx(1.0, rel=1e-9)


@given(SEEDS)
def test_what_the_rates_permit_is_what_the_motors_can(seed: int) -> None:
    """On the border of the polytope some demand is at its limit and none above."""
    rng = np.random.default_rng(seed)
    agv = of(
        *(
            {"x": x, "y": y, "offset": d, "steering_coupling": k}
            for x, y, d, k in zip(
                *rng.uniform(-0.5, 0.5, (2, 3)),
                rng.uniform(-0.2, 0.2, 3),
                rng.choice([0.0, 0.1], 3),
                strict=True,
            )
        ),
        {"type": "turntable", "x": -0.5, "y": 0.1, "track": 0.3},
    )
    kappa_n, beta, v_s, *rates = motion_of(agv, rng)
    rest = drive_speeds(agv, kappa_n, beta, v_s).demand.max()
    v_s *= 0.9 / max(rest, 0.9)
    reach = rate_polytope(agv, kappa_n, beta, v_s).max_along((*rates, 0.0))
    found = drive_speeds(agv, kappa_n, beta, v_s, reach * rates[0], reach * rates[1])
    assert found.demand.max() == pytest.approx(1.0, rel=1e-9)


def is_determined(vehicle: Vehicle, alpha: np.ndarray) -> bool:
    """Whether no motion is left that no drive feels and no standard wheel resists."""
    places = [w - vehicle.reference for w in vehicle.contacts]
    felt = []
    for velocity, omega in ((1, 0), (1j, 0), (0, vehicle.boundary_curvature)):
        column = []
        for contact in drive_contacts(vehicle):
            a = alpha[contact.wheel] + getattr(
                vehicle.wheels[contact.wheel], "roller", 0.0
            )
            v = velocity + 1j * omega * places[contact.wheel]
            column.append((v * np.exp(-1j * a)).real - contact.offset * omega)
        for wheel, w, a in zip(vehicle.wheels, places, alpha, strict=True):
            if isinstance(wheel, SteerableWheel | FixedWheel):
                column.append(((velocity + 1j * omega * w) * np.exp(-1j * a)).imag)
        felt.append(column)
    return int(np.linalg.matrix_rank(felt, tol=1e-6)) == 3


@given(vehicles(ALL_KINDS), SEEDS)
def test_drives_tell_the_twist(vehicle: Vehicle, seed: int) -> None:
    rng = np.random.default_rng(seed)
    motion = motion_of(vehicle, rng)
    if np.abs(configspace.wheel_directions(vehicle, *motion[:2])).min() < 1e-3:
        return
    alpha, _ = configspace.wheel_states(vehicle, *motion[:3])
    found = drive_speeds(vehicle, *motion)
    if not is_determined(vehicle, alpha):
        with pytest.raises(configspace.InvalidInput, match="of the 3 components"):
            twist_from_drives(vehicle, alpha, found.rolling, found.alpha_dot)
        return
    twist, residual = twist_from_drives(vehicle, alpha, found.rolling, found.alpha_dot)
    truth = configspace.to_twist(*motion[:3], vehicle.boundary_curvature)
    np.testing.assert_allclose(twist, truth, atol=1e-6)
    assert residual < 1e-9


def test_one_turntable_and_a_castor_know_the_twist_by_their_difference() -> None:
    table = of({"type": "turntable", "x": 0.5, "y": 0.0, "track": 0.4})
    motion = (0.5, 0.3, 0.6, 0.2, -0.4)
    alpha, u = configspace.wheel_states(table, *motion[:3])
    found = drive_speeds(table, *motion)
    with pytest.raises(configspace.InvalidInput, match="2 of the 3"):
        configspace.twist_from_wheels(table, alpha, u)
    truth = configspace.to_twist(*motion[:3], table.boundary_curvature)
    twist, _ = twist_from_drives(table, alpha, found.rolling, found.alpha_dot)
    np.testing.assert_allclose(twist, truth, atol=1e-12)
    unknown = np.full(1, np.nan)
    with pytest.raises(configspace.InvalidInput, match=r"not of w0/left, w0/right"):
        twist_from_drives(table, alpha, found.rolling, unknown)


def test_batches_broadcast_and_results_are_read_only() -> None:
    agv = of({"x": 0.4, "y": 0.0, "offset": 0.1}, {"x": -0.4, "y": 0.0})
    beta = np.linspace(-1, 1, 5)
    found = drive_speeds(agv, 0.3, beta, 0.5, beta_dot=np.array([[0.2], [0.4], [0.6]]))
    assert found.rolling.shape == found.demand.shape == (3, 5, 2)
    assert found.alpha_dot.shape == (3, 5, 2)
    one = drive_speeds(agv, 0.3, beta[3], 0.5, beta_dot=0.6)
    np.testing.assert_array_equal(found.rolling[2, 3], one.rolling)
    with pytest.raises(ValueError, match="read-only"):
        found.rolling[:] = 0
    with pytest.raises(configspace.InvalidInput, match="beta_dot"):
        drive_speeds(agv, 0.3, 0.0, 0.5, beta_dot=np.inf)


def test_at_a_singular_point_only_what_steering_adds_is_unknown() -> None:
    agv = of(
        {"x": 0.3, "y": 0.4, "offset": 0.1},
        {"x": -0.3, "y": 0.4},
        kappa_g=2.0,
    )
    for wheel, rolling in ((0, np.nan), (1, 0.0)):
        point = next(p for p in configspace.singular_points(agv) if p.wheel == wheel)
        assert point.beta is not None
        there = (point.kappa_n, point.beta, 0.5)
        moving = drive_speeds(agv, *there, beta_dot=0.1)
        assert np.isnan(moving.alpha_dot[wheel])
        np.testing.assert_allclose(moving.rolling[wheel], rolling, atol=1e-12)
        still = drive_speeds(agv, *there)
        assert np.isfinite(still.rolling).all()
        assert still.alpha_dot[wheel] == 0


def test_passive_wheels_have_no_drive() -> None:
    agv = of({"x": 0.4, "y": 0.0}, {"x": -0.4, "y": 0.0, "max_speed": None})
    assert [contact.wheel for contact in drive_contacts(agv)] == [0]
    speeds = drive_speeds(configspace.load_vehicle("differential"), 1.0, 0.0, 0.5)
    assert len(speeds.names) == 2
    np.testing.assert_array_equal(speeds.demand, np.abs(speeds.rolling))
