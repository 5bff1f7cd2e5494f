"""Oracles of spec/steered-wheels §7 on twists, wheels, classification and topology."""

import itertools
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import configspace
from configspace.classification import classify, configuration_rank, is_admissible
from configspace.constraints import no_slip_rows, steering_residual
from configspace.equivalence import omni_curve_representations, representations
from configspace.forward import twist_from_pair, twist_from_wheels
from configspace.rotation_centre import icr, icr_of, singular_points
from configspace.spherical import (
    from_spherical,
    omni_curve_to_spherical,
    spherical_to_omni_curve,
    to_spherical,
    translate,
)
from configspace.vehicle import Vehicle

SPEC: dict[str, Any] = tomllib.loads(
    (Path(__file__).parent / "steered_wheels.toml").read_text()
)
COB = SPEC["care_o_bot"]
D = COB["d"]
TWISTS = SPEC["twists"]
O_01 = np.array(TWISTS[0]["twist"])
ids = [case["oracle"] for case in TWISTS]


def of(*wheels: dict[str, object], **more: object) -> Vehicle:
    named = [{"id": f"w{i}", **wheel} for i, wheel in enumerate(wheels)]
    return configspace.vehicle_from_data({"name": "v", "wheels": named, **more})


def steered(x: float, y: float, **more: object) -> dict[str, object]:
    return {"type": "steered", "x": x, "y": y, "max_speed": 1.0, **more}


def fixed(x: float, y: float) -> dict[str, object]:
    return {"type": "fixed", "x": x, "y": y, "max_speed": 1.0}


def castor(x: float, y: float) -> dict[str, object]:
    return {"type": "castor", "x": x, "y": y}


@pytest.fixture
def cob() -> Vehicle:
    return of(*(steered(x, y) for x, y in COB["wheels"]))


def states(vehicle: Vehicle, twist: object) -> tuple[np.ndarray, np.ndarray]:
    """Steering angles and rolling speeds of a twist."""
    state = configspace.from_twist(np.asarray(twist), vehicle.boundary_curvature)
    return configspace.wheel_states(vehicle, *state)


def assert_angles(actual: object, expected: object, atol: float = 1e-6) -> None:
    apart = np.exp(1j * np.asarray(actual)) - np.exp(1j * np.asarray(expected))
    np.testing.assert_allclose(np.abs(apart), 0, atol=atol)


# --- conversions


def test_kappa_g_is_that_of_the_farthest_wheel(cob: Vehicle) -> None:
    assert cob.boundary_curvature == pytest.approx(COB["kappa_g"], rel=1e-9)
    assert 1 / cob.boundary_curvature == pytest.approx(D, rel=1e-9)


@pytest.mark.parametrize("case", TWISTS, ids=ids)
def test_conversions_of_a_twist(case: dict[str, Any]) -> None:
    """O-01 to O-05."""
    spherical = to_spherical(case["twist"], D)
    np.testing.assert_allclose(spherical, case["spherical"], atol=1e-6)
    np.testing.assert_allclose(icr(case["twist"]), case["icr"], atol=1e-6)
    state = spherical_to_omni_curve(*spherical)
    np.testing.assert_allclose(state, case["omni_curve"], atol=1e-6)
    np.testing.assert_allclose(
        configspace.from_twist(case["twist"], 1 / D), case["omni_curve"], atol=1e-6
    )
    np.testing.assert_allclose(from_spherical(*spherical, D), case["twist"], atol=1e-9)
    np.testing.assert_allclose(
        icr_of(state[0], state[1], 1 / D), case["icr"], atol=1e-6
    )


def test_four_representations_are_one_twist() -> None:
    """O-06."""
    rng = np.random.default_rng(6)
    rho = rng.uniform(-2, 2, 500)
    phi, theta = rng.uniform(-np.pi, np.pi, (2, 500))
    four = representations(rho, phi, theta)
    twist = from_spherical(rho, phi, theta, D)
    for i in range(4):
        same = from_spherical(four[:, i, 0], four[:, i, 1], four[:, i, 2], D)
        np.testing.assert_allclose(same, twist, atol=1e-12 / D)


def test_reversed_state_is_the_same_twist() -> None:
    """O-07."""
    rng = np.random.default_rng(7)
    kappa_n = np.append(rng.uniform(-2, 2, 200), [-2, -1, 0, 1, 2])
    beta, v_s = rng.uniform(-3, 3, (2, 205))
    np.testing.assert_allclose(
        configspace.to_twist(kappa_n, beta, v_s, 1 / D),
        configspace.to_twist(-kappa_n, beta + np.pi, -v_s, 1 / D),
        atol=1e-12,
    )
    rho, _, theta = omni_curve_to_spherical(kappa_n, beta, v_s)
    np.testing.assert_allclose(
        rho * np.maximum(np.cos(theta), np.abs(np.sin(theta))), v_s, atol=1e-12
    )


def test_latitude_grows_with_nominal_curvature() -> None:
    """O-08."""
    kappa_n = np.array(SPEC["latitude"]["kappa_n"])
    theta = omni_curve_to_spherical(kappa_n, 0.3, 1.0)[2]
    np.testing.assert_allclose(theta, SPEC["latitude"]["theta"], atol=1e-6)
    np.testing.assert_array_equal(omni_curve_to_spherical(-kappa_n, 0, 1)[2], -theta)
    fine = omni_curve_to_spherical(np.linspace(-4, 4, 4002)[1:], 0, 1)[2]
    assert (np.diff(fine) > 0).all()


def test_kinetic_energy_is_that_of_rho() -> None:
    """O-09."""
    m = COB["mass"]
    vx, vy, omega = O_01
    rho = to_spherical(O_01, D)[0]
    energy = m * (vx**2 + vy**2) / 2 + m * D**2 * omega**2 / 2
    assert energy == pytest.approx(SPEC["energy"]["joule"], abs=1e-6)
    assert m * rho**2 / 2 == pytest.approx(SPEC["energy"]["joule"], abs=1e-6)


# --- inverse and forward kinematics


@pytest.mark.parametrize(
    "case", [case for case in TWISTS if "u" in case], ids=lambda case: case["oracle"]
)
def test_wheel_states_and_back(cob: Vehicle, case: dict[str, Any]) -> None:
    """O-10, O-11, O-13."""
    alpha, u = states(cob, case["twist"])
    expected = case.get("alpha") or np.radians(case["alpha_deg"])
    assert_angles(alpha, expected)
    np.testing.assert_allclose(u, case["u"], atol=1e-6)
    twist, residual = twist_from_wheels(cob, expected, case["u"])
    np.testing.assert_allclose(twist, case["twist"], atol=5e-6)
    assert residual < 1e-6


def test_drive_rates(cob: Vehicle) -> None:
    """O-10."""
    np.testing.assert_allclose(
        states(cob, O_01)[1] / COB["wheel_radius"],
        SPEC["drive_rates"]["rad_per_s"],
        atol=2e-6,
    )


def test_translation_points_every_wheel_alike(cob: Vehicle) -> None:
    """O-12."""
    for psi in np.linspace(-3, 3, 7):
        alpha, u = configspace.wheel_states(cob, 0.0, psi, 0.7)
        assert_angles(alpha, psi, 1e-12)
        np.testing.assert_allclose(u, 0.7, rtol=1e-12)
        twist, _ = twist_from_wheels(cob, np.full(4, psi), np.full(4, 0.7))
        expected = [0.7 * np.cos(psi), 0.7 * np.sin(psi), 0]
        np.testing.assert_allclose(twist, expected, atol=1e-12)


def test_boundary_curvature(cob: Vehicle) -> None:
    """O-15."""
    case = SPEC["boundary"]
    _, u = configspace.wheel_states(cob, case["kappa_n"], case["beta"], case["v_s"])
    np.testing.assert_allclose(u, case["u"], atol=1e-6)
    np.testing.assert_allclose(icr_of(1.0, 0.0, 1 / D), case["icr"], atol=1e-6)
    assert case["v_s"] / u.max() == pytest.approx(case["v_max_per_u_lim"], abs=1e-6)


def test_every_pair_finds_the_centre(cob: Vehicle) -> None:
    """O-23."""
    alpha, u = TWISTS[0]["alpha"], TWISTS[0]["u"]
    np.testing.assert_allclose(
        states(cob, O_01)[1] / O_01[2], SPEC["pairs"]["lambda"], atol=2e-6
    )
    for pair in itertools.permutations(range(4), 2):
        twist = twist_from_pair(cob, pair, alpha, u)
        np.testing.assert_allclose(twist, O_01, atol=1e-5)
        np.testing.assert_allclose(icr(twist), TWISTS[0]["icr"], atol=1e-5)
    _, values, axes = np.linalg.svd(no_slip_rows(cob, alpha))
    np.testing.assert_allclose(values, SPEC["pairs"]["singular_values"], atol=1e-6)
    null = axes[2] / axes[2][0] * O_01[0]
    np.testing.assert_allclose(null, O_01, atol=1e-5)


def test_far_point_approximation_is_not_used(cob: Vehicle) -> None:
    """O-24."""
    alpha, u = states(cob, O_01)
    theta = to_spherical(O_01, D)[2]
    case = SPEC["far_point"]
    np.testing.assert_allclose(u / np.cos(theta), case["approximate_rho"], atol=1e-6)
    for k in range(4):
        twist = twist_from_pair(cob, ((k + 1) % 4, k), alpha, u)
        assert to_spherical(twist, D)[0] == pytest.approx(case["rho"], abs=1e-6)


def test_classification() -> None:
    """O-25."""
    axle = [fixed(0, 0.3), fixed(0, -0.3)]
    mecanum = [
        {"type": "mecanum", "x": x, "y": y, "roller_deg": g, "max_speed": 1.0}
        for x, y, g in ((1, 1, -45), (-1, 1, 45), (-1, -1, -45), (1, -1, 45))
    ]
    castors = [castor(0.5, 0.2), castor(-0.5, -0.2)]
    corners = [steered(x, y) for x, y in COB["wheels"]]
    assert classify(of(*axle, *castors)).degrees == (2, 0, 2)
    assert classify(of(*axle, steered(0.9, 0.1))).degrees == (1, 1, 2)
    assert classify(of(*corners)).degrees == (1, 2, 3)
    assert classify(of(*mecanum)).degrees == (3, 0, 3)
    assert classify(of(steered(0.4, 0.0), *castors)).degrees == (2, 1, 3)


def test_invalid_steering_angles_block(cob: Vehicle) -> None:
    """O-26."""
    case = SPEC["invalid"]
    values = np.linalg.svd(no_slip_rows(cob, case["alpha"]), compute_uv=False)
    np.testing.assert_allclose(values, case["singular_values"], atol=1e-6)
    assert configuration_rank(cob, case["alpha"]) == 3
    assert not is_admissible(cob, case["alpha"])
    assert configuration_rank(cob, states(cob, O_01)[0]) == 2
    a = np.radians(case["skewed_deg"])[:, None] * [-1, 1, -1, 1]
    residual = steering_residual(cob, a, d=1.0)
    np.testing.assert_allclose(residual, case["skewed_smallest"], atol=1e-6)
    assert not is_admissible(cob, a).any()


def test_lateral_offset_is_signed() -> None:
    """O-27: the row (B.10) gives what the forward kinematics takes back."""
    case = SPEC["lateral_offset"]
    wheels = COB["wheels"]
    beside = steered(*wheels[0], offset=case["offset"])
    agv = of(beside, *(steered(x, y) for x, y in wheels[1:]))
    rolling = np.array([np.cos(case["alpha"]), np.sin(case["alpha"]), 0.0])
    x, y = wheels[0]
    rolling[2] = x * rolling[1] - y * rolling[0]
    turned = O_01[2] + case["alpha_dot"]
    measured = float(rolling @ O_01) - turned * case["offset"]
    assert measured == pytest.approx(case["rolling_speed"], abs=1e-6)
    # The same at the angle that this twist needs, against three plain wheels.
    alpha, u = states(agv, O_01)
    rate = np.array([case["alpha_dot"], 0, 0, 0])
    u[0] -= turned * case["offset"]
    twist, residual = twist_from_wheels(agv, alpha, u, alpha_dot=rate)
    np.testing.assert_allclose(twist, O_01, atol=1e-12)
    assert residual < 1e-12
    assert twist_from_wheels(agv, alpha, u, alpha_dot=-rate)[1] > 1e-3


def test_mecanum_rows() -> None:
    """O-28."""
    case = SPEC["mecanum"]
    x, y = case["half_length"], case["half_width"]
    corners = ((x, y), (-x, y), (-x, -y), (x, -y))
    agv = of(
        *(
            {"type": "mecanum", "x": x, "y": y, "roller_deg": g, "max_speed": 1.0}
            for (x, y), g in zip(corners, case["roller_deg"], strict=True)
        )
    )
    np.testing.assert_allclose(states(agv, O_01)[1], case["u"], atol=1e-12)
    twist, residual = twist_from_wheels(agv, np.zeros(4), case["u"])
    np.testing.assert_allclose(twist, O_01, atol=1e-12)
    assert residual < 1e-12


# --- singular points and topology


def test_singular_points(cob: Vehicle) -> None:
    """O-29: 8 in T, 16 with the images past the poles."""
    points = singular_points(cob)
    case = SPEC["singular"]
    assert [p.wheel for p in points] == [0, 0, 1, 1, 2, 2, 3, 3]
    kappa_n = np.array([p.kappa_n for p in points])
    np.testing.assert_allclose(kappa_n, [1, -1] * 4, atol=1e-12)
    beta = np.array([p.beta for p in points], dtype=float)
    assert_angles(beta[::2], np.radians(case["beta_positive_deg"]), 1e-5)
    assert_angles(beta[1::2], beta[::2] + np.pi)
    _, phi, theta = omni_curve_to_spherical(kappa_n, beta, 1.0)
    assert_angles(phi[::2], case["phi_positive"])
    np.testing.assert_allclose(np.abs(theta), np.pi / 4, atol=1e-12)
    images = representations(1.0, phi, theta)[..., 1:].reshape(-1, 2)
    distinct = {tuple(np.round(np.exp(1j * image), 6)) for image in images}
    assert len(distinct) == 16


def test_one_wheel_stands_still_at_its_singular_point(cob: Vehicle) -> None:
    """O-30."""
    for point in singular_points(cob):
        assert point.beta is not None
        v_s = 1 / np.hypot(1, 1)  # rho = 1
        z = configspace.wheel_directions(cob, point.kappa_n, point.beta)
        u = v_s * np.abs(z)
        assert u[point.wheel] < 1e-15
        assert (u < 1e-15).sum() == 1
        assert u[(point.wheel + 2) % 4] == pytest.approx(np.sqrt(2), abs=1e-12)


@pytest.mark.parametrize(
    ("m", "size"),
    list(zip(SPEC["distance"]["kappa_g_w"], SPEC["distance"]["size"], strict=True)),
)
def test_singular_points_of_near_and_far_wheels(m: float, size: float) -> None:
    """O-31."""
    agv = of(steered(0.3, 0.4), steered(-0.5, 0.0), kappa_g=2 * m)
    points = singular_points(agv)
    assert [abs(p.kappa_n) for p in points] == pytest.approx([size] * 4)
    for p in points:
        assert p.beta is not None
        z = configspace.wheel_directions(agv, p.kappa_n, p.beta)
        assert abs(z[p.wheel]) < 1e-15


def test_zone_of_large_gains(cob: Vehicle) -> None:
    """O-33, by differences of the direction of rolling; exactly 0.37230, 0.08551."""
    case = SPEC["zone"]
    w = complex(*COB["wheels"][0])
    point = singular_points(cob)[0]
    _, phi_s, theta_s = omni_curve_to_spherical(point.kappa_n, point.beta or 0.0, 1.0)

    def gain(phi: np.ndarray, theta: np.ndarray) -> np.ndarray:
        h = 1e-6
        z = [
            translate(1.0, phi + h * a, theta + h * b, w, D)[1]
            for a, b in ((1, 0), (-1, 0), (0, 1), (0, -1))
        ]
        by_phi, by_theta = (
            np.angle(np.exp(1j * (z[i] - z[i + 1]))) / (2 * h) for i in (0, 2)
        )
        return np.asarray(np.hypot(by_phi, by_theta))

    away = np.linspace(0.05, 0.6, 11001)
    for i, sign in enumerate((1, -1)):
        beyond = gain(phi_s + sign * away, theta_s) < case["gain"]
        assert away[beyond][0] == pytest.approx(case["half_width_phi"][i], abs=5e-4)
        beyond = gain(phi_s, theta_s + sign * away) < case["gain"]
        assert away[beyond][0] == pytest.approx(case["half_width_theta"][i], abs=5e-4)


def test_centre_jumps_where_the_motion_is_smooth(cob: Vehicle) -> None:
    """O-34."""
    case = SPEC["jump"]
    omega = case["omega"]
    twist = np.array([[0.5, 0, omega], [0.5, 0, -omega]])
    np.testing.assert_allclose(icr(twist)[1], [case["icr_y"], -case["icr_y"]])
    theta = to_spherical(twist, D)[2]
    np.testing.assert_allclose(theta, [case["theta"], -case["theta"]], atol=5e-6)
    alpha, _ = states(cob, twist)
    assert np.abs(alpha[1] - alpha[0]).max() < case["largest_steering"]


def test_a_way_through_the_pole(cob: Vehicle) -> None:
    """O-35."""
    up = np.linspace(1.5, 2.5, 20001)
    state = spherical_to_omni_curve(*omni_curve_to_spherical(up, 0.0, 1.0))
    assert state[0][[0, -1]] == pytest.approx([1.5, 1.5])
    assert_angles(state[1][[0, -1]], [0, np.pi])
    alpha, _ = configspace.wheel_states(cob, *state)
    steps = np.diff(np.unwrap(alpha, axis=0), axis=0)
    net = np.degrees(steps.sum(axis=0))
    case = SPEC["pole"]
    np.testing.assert_allclose(net, case["net_deg"], atol=5e-4)
    total = np.degrees(np.abs(steps).sum(axis=0))
    np.testing.assert_allclose(total, np.abs(case["net_deg"]), atol=5e-4)
    beta = np.linspace(0, np.pi, 20001)
    alpha, _ = configspace.wheel_states(cob, 1.5, beta, 1.0)
    steps = np.diff(np.unwrap(alpha, axis=0), axis=0)
    np.testing.assert_allclose(np.degrees(steps.sum(axis=0)), net, atol=1e-6)
    total = np.degrees(np.abs(steps).sum(axis=0))
    np.testing.assert_allclose(total, case["detour_total_deg"], atol=5e-4)


def test_nearest_wheel_has_the_largest_latitude() -> None:
    """O-37."""
    case = SPEC["nearest"]
    places = [complex(x, y) for x, y in COB["wheels"]]
    centre = complex(*map(float, icr(O_01)))
    np.testing.assert_allclose(
        [abs(centre - w) for w in places], case["distance"], atol=1e-6
    )
    spherical = to_spherical(O_01, D)
    theta = [float(translate(*spherical, w, D)[2]) for w in places]
    np.testing.assert_allclose(theta, case["theta"], atol=1e-6)
    assert int(np.argmax(np.abs(theta))) == case["wheel"]


def test_winding_of_steering_angles(cob: Vehicle) -> None:
    """O-38."""
    beta = np.linspace(-np.pi, np.pi, 4001)
    for kappa_n, turns in zip(*SPEC["winding"].values(), strict=True):
        alpha, _ = configspace.wheel_states(cob, kappa_n, beta, 1.0)
        swept = np.unwrap(alpha, axis=0)
        wound = (swept[-1] - swept[0]) / (2 * np.pi)
        np.testing.assert_allclose(wound, turns, atol=1e-9)


def test_wheel_orientations_of_one_centre(cob: Vehicle) -> None:
    """O-40: 2^N orientations, all admissible, in 2^(N-1) relative classes."""
    alpha, u = states(cob, O_01)
    flips = np.array(list(itertools.product([0, 1], repeat=4)))
    turned, signed = alpha + np.pi * flips, u * (1 - 2 * flips)
    assert len(flips) == 16
    assert is_admissible(cob, turned).all()
    twist, residual = twist_from_wheels(cob, turned, signed)
    np.testing.assert_allclose(twist, np.broadcast_to(O_01, (16, 3)), atol=1e-12)
    assert residual.max() < 1e-12
    classes = {tuple(flip ^ flip[0]) for flip in flips}
    assert len(classes) == 8
    # Only two of the sixteen are configurations of Omni-Curve-Parameters.
    reached = omni_curve_representations(
        *configspace.from_twist(O_01, cob.boundary_curvature)
    )
    own = [
        configspace.wheel_states(
            cob, *spherical_to_omni_curve(*omni_curve_to_spherical(*state))
        )[0]
        for state in reached
    ]
    assert len({tuple(np.round(np.exp(1j * a), 9)) for a in own}) == 2


@pytest.mark.parametrize(
    ("pair", "key"), [((0, 2), "pair_1_3_deg"), ((0, 1), "pair_1_2_deg")]
)
@pytest.mark.parametrize("case", [0, 1])
def test_noise_of_the_direction(
    cob: Vehicle, pair: tuple[int, int], key: str, case: int
) -> None:
    """O-46, by the linear law of propagation."""
    height = SPEC["noise"]["icr_y"][case]
    alpha, u = states(cob, [height, 0.0, 1.0])
    step = 1e-6
    gains = []
    for wheel in pair:
        ends = []
        for sign in (1, -1):
            moved = alpha.copy()
            moved[wheel] += sign * step
            ends.append(to_spherical(twist_from_pair(cob, pair, moved, u), D)[1])
        gains.append(float(ends[0] - ends[1]) / (2 * step))
    assert np.linalg.norm(gains) == pytest.approx(SPEC["noise"][key][case], abs=0.005)


def test_the_centre_passes_over_a_wheel(cob: Vehicle) -> None:
    """O-42: with a sign of its speed the wheel keeps its angle, the others turn on."""
    case = SPEC["over_wheel"]
    along = np.exp(1j * np.radians(case["direction_deg"]))
    for side, key in ((1, "others_before_deg"), (-1, "others_after_deg")):
        centre = complex(*COB["wheels"][0]) + side * case["apart"] * 1j * along
        alpha, u = states(cob, [centre.imag, -centre.real, 1.0])
        velocity = u * np.exp(1j * alpha)
        signed = velocity[0] * along.conjugate()
        assert signed == pytest.approx(side * case["apart"], abs=1e-12)
        assert_angles(2 * alpha[1:], 2 * np.radians(case[key]), 4e-6)
    there = complex(*COB["wheels"][0])
    _, u = states(cob, [there.imag, -there.real, 1.0])
    assert u[0] == pytest.approx(0, abs=1e-12)


def test_backwards_needs_no_steering(cob: Vehicle) -> None:
    """O-44: the sign of v_s turns the rolling, the other representation the wheels."""
    rng = np.random.default_rng(44)
    kappa_n, beta = rng.uniform(-2, 2, 50), rng.uniform(-3, 3, 50)
    alpha, u = configspace.wheel_states(cob, kappa_n, beta, 0.5)
    back, backwards = configspace.wheel_states(cob, kappa_n, beta, -0.5)
    np.testing.assert_array_equal(back, alpha)
    np.testing.assert_array_equal(backwards, -u)
    turned, forwards = configspace.wheel_states(cob, -kappa_n, beta + np.pi, 0.5)
    assert_angles(turned, alpha + np.pi, 1e-9)
    np.testing.assert_allclose(forwards, u, atol=1e-12)
