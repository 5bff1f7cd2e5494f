import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import configspace
from configspace.constraints import no_slip_rows, steering_residual
from configspace.forward import twist_from_pair, twist_from_wheels
from configspace.testing import VEHICLE_KINDS, VehicleKind, random_vehicle
from configspace.vehicle import Castor, FixedWheel, SteerableWheel, Vehicle

KINKS = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])


def of(*wheels: dict[str, object], **more: object) -> Vehicle:
    named = [
        {"id": f"w{i}", "max_speed": 1.0, **wheel} for i, wheel in enumerate(wheels)
    ]
    for wheel in named:
        if wheel["type"] == "castor" or wheel["max_speed"] is None:
            del wheel["max_speed"]
    return configspace.vehicle_from_data({"name": "v", "wheels": named, **more})


def at(kind: str, x: float, y: float, **more: object) -> dict[str, object]:
    return {"type": kind, "x": x, "y": y, **more}


def four(**more: object) -> Vehicle:
    places = ((0.4, 0.3), (-0.4, 0.3), (-0.5, -0.2), (0.3, -0.3))
    return of(*(at("steered", x, y, **more) for x, y in places))


def motions(
    vehicle: Vehicle, rng: np.random.Generator, count: int = 40
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Configurations and speeds, kinks included, that the vehicle can drive."""
    kappa_n = np.append(rng.uniform(-2, 2, count), KINKS)
    beta = rng.uniform(-np.pi, np.pi, kappa_n.shape)
    if vehicle.mobility.line_beta is not None:
        beta = np.full(kappa_n.shape, vehicle.mobility.line_beta)
    if vehicle.mobility.is_translating:
        kappa_n = np.zeros(kappa_n.shape)
    return kappa_n, beta, rng.uniform(-2, 2, kappa_n.shape)


def is_determined(vehicle: Vehicle) -> bool:
    """Whether the rows can tell the twist: not for a single standard wheel."""
    places = {
        w.position for w in vehicle.wheels if isinstance(w, SteerableWheel | FixedWheel)
    }
    return len(places) != 1


def truth(
    vehicle: Vehicle, kappa_n: np.ndarray, beta: np.ndarray, v_s: np.ndarray
) -> np.ndarray:
    return configspace.to_twist(kappa_n, beta, v_s, vehicle.boundary_curvature)


# --- all wheels


@pytest.mark.parametrize("kind", VEHICLE_KINDS)
def test_forward_undoes_inverse(kind: VehicleKind) -> None:
    rng = np.random.default_rng(20)
    for _ in range(25):
        vehicle = random_vehicle(rng, kind)
        state = motions(vehicle, rng)
        alpha, u = configspace.wheel_states(vehicle, *state)
        if not is_determined(vehicle):
            with pytest.raises(configspace.InvalidInput, match="2 of the 3"):
                twist_from_wheels(vehicle, alpha, u)
            continue
        twist, residual = twist_from_wheels(vehicle, alpha, u)
        np.testing.assert_allclose(twist, truth(vehicle, *state), atol=1e-10)
        assert residual.max() < 1e-12


def test_steered_wheels_near_one_another_still_tell() -> None:
    agv = of(at("steered", 0.3, 0.0), at("steered", 0.3, 1e-5), at("castor", -1, 0))
    alpha, u = configspace.wheel_states(agv, 0.7, 0.4, 1.0)
    expected = configspace.to_twist(0.7, 0.4, 1.0, agv.boundary_curvature)
    np.testing.assert_allclose(twist_from_wheels(agv, alpha, u)[0], expected, atol=1e-9)


def test_synchro_skid_steer_and_turntables() -> None:
    corners = ((0.4, 0.3), (-0.4, 0.3), (-0.4, -0.3), (0.4, -0.3))
    rng = np.random.default_rng(21)
    for vehicle in (
        of(*(at("steered", *w) for w in corners), synchro=True),
        of(*(at("fixed", *w) for w in corners), skid_steer={"effective_track": 0.9}),
        of(at("turntable", 0.5, 0.0, track=0.2), at("turntable", -0.5, 0.1, track=0.3)),
        of(at("turntable", 0.5, 0, track=0.2), at("fixed", 0, 1), at("fixed", 0, -1)),
    ):
        state = motions(vehicle, rng)
        twist, residual = twist_from_wheels(
            vehicle, *configspace.wheel_states(vehicle, *state)
        )
        np.testing.assert_allclose(twist, truth(vehicle, *state), atol=1e-12)
        assert residual.max() < 1e-12


def test_skid_steer_turns_as_its_effective_track_says() -> None:
    corners = ((0.4, 0.3), (-0.4, 0.3), (-0.4, -0.3), (0.4, -0.3))
    agv = of(*(at("fixed", *w) for w in corners), skid_steer={"effective_track": 0.9})
    twist, _ = twist_from_wheels(agv, np.zeros(4), [-0.9, -0.9, 0.9, 0.9])
    np.testing.assert_allclose(twist, [0, 0, 2.0], atol=1e-12)


@given(st.integers(0, 2**32 - 1), st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))
def test_lateral_offsets_and_steering_rates(seed: int, one: float, two: float) -> None:
    rng = np.random.default_rng(seed)
    offset = np.array([one, two, 0.0])
    agv = of(
        at("steered", 0.5, 0.3, offset=one),
        at("steered", -0.6, 0.1, offset=two),
        at("turntable", 0.1, -0.7, track=0.3),
    )
    kappa_n, beta, v_s = motions(agv, rng, 5)
    rate = rng.uniform(-5, 5, (len(v_s), 3))
    alpha, u = configspace.wheel_states(agv, kappa_n, beta, v_s)
    expected = truth(agv, kappa_n, beta, v_s)
    rolled = u - (expected[:, 2:] + rate) * offset  # (B.10), D = -l
    # Where an offset lets two wheels say the same, the twist is not known.
    try:
        twist, residual = twist_from_wheels(agv, alpha, rolled, alpha_dot=rate)
    except configspace.InvalidInput:
        assume(False)
        raise
    np.testing.assert_allclose(twist, expected, atol=1e-7)
    assert residual.max() < 1e-9
    plain, _ = twist_from_wheels(agv, alpha, u)
    np.testing.assert_allclose(plain, expected, atol=1e-12)


def test_the_wheels_of_a_turntable_average_to_its_axis() -> None:
    agv = of(
        at("turntable", 0.5, 0.0, track=0.2), at("turntable", -0.5, 0.0, track=0.4)
    )
    alpha, u = configspace.wheel_states(agv, 0.6, 0.3, 0.8)
    omega, rate = 0.48 * agv.boundary_curvature, 2.0
    sides = np.array([w.offsets for w in agv.wheels if isinstance(w, SteerableWheel)])
    both = u[:, None] - (omega + rate) * sides
    twist, residual = twist_from_wheels(agv, alpha, both.mean(axis=1), alpha_dot=rate)
    assert twist[2] == pytest.approx(omega, abs=1e-12)
    assert residual < 1e-12


def test_unmeasured_wheels_are_left_out() -> None:
    agv = four()
    alpha, u = configspace.wheel_states(agv, 0.8, 0.5, 1.0)
    expected = configspace.to_twist(0.8, 0.5, 1.0, agv.boundary_curvature)
    wrong = alpha.copy()
    wrong[1] += 0.3
    assert twist_from_wheels(agv, wrong, u)[1] > 0.03
    wrong[1] = np.nan
    twist, residual = twist_from_wheels(agv, wrong, u)
    np.testing.assert_allclose(twist, expected, atol=1e-12)
    assert residual < 1e-12
    # One speed and the directions of the others are enough.
    one = np.array([np.nan, np.nan, u[2], np.nan])
    twist, residual = twist_from_wheels(agv, alpha, one)
    np.testing.assert_allclose(twist, expected, atol=1e-12)
    # Without trust is without measurement.
    wrong[1] = alpha[1] + 0.3
    twist, residual = twist_from_wheels(agv, wrong, u, weights=[1, 0, 1, 1])
    np.testing.assert_allclose(twist, expected, atol=1e-12)
    assert residual < 1e-12


def test_passive_wheels_need_no_encoder() -> None:
    agv = of(
        at("fixed", 0, 0.3, max_speed=None),
        at("fixed", 0, -0.3, max_speed=None),
        at("steered", 0.9, 0.0),
        at("castor", -0.5, 0.2),
    )
    alpha, u = configspace.wheel_states(agv, 0.4, 0.0, 0.9)
    u[:2] = np.nan
    twist, _ = twist_from_wheels(agv, alpha, u)
    expected = configspace.to_twist(0.4, 0.0, 0.9, agv.boundary_curvature)
    np.testing.assert_allclose(twist, expected, atol=1e-12)


def test_weights_are_inverse_variances() -> None:
    """Two mean speeds that disagree: the weighted mean, as in one dimension."""
    agv = of(at("fixed", 0, 0.5), at("fixed", 0, -0.5))
    data = [at("omni", x, y) for x, y in ((0, 1), (0, -1), (0, 2), (0, -2))]
    data.append(at("omni", 0, 0, heading_deg=90))
    agv = of(*data)
    u = np.array([1.0, 1.0, 2.0, 2.0, 0.0])
    twist, residual = twist_from_wheels(agv, np.zeros(5), u, weights=[3, 3, 1, 1, 1])
    np.testing.assert_allclose(twist, [1.25, 0, 0], atol=1e-12)
    lacking = [0.25, 0.25, -0.75, -0.75, 0]
    mean = np.average(np.square(lacking), weights=[3, 3, 1, 1, 1])
    assert residual == pytest.approx(math.sqrt(mean))


def test_noise_stays_in_the_residual() -> None:
    """Of eight rows three fit, five lack: residual² averages 5/8 of the variance."""
    rng = np.random.default_rng(22)
    agv, sigma, count = four(), 0.01, 20000
    alpha, u = configspace.wheel_states(agv, 0.8, 0.5, 1.0)
    # Equal noise of the speed along and across each wheel.
    noisy_u = u + sigma * rng.standard_normal((count, 4))
    noisy_alpha = alpha + sigma * rng.standard_normal((count, 4)) / u
    twist, residual = twist_from_wheels(agv, noisy_alpha, noisy_u)
    assert math.sqrt((residual**2).mean()) == pytest.approx(
        sigma * math.sqrt(5 / 8), rel=0.02
    )
    expected = configspace.to_twist(0.8, 0.5, 1.0, agv.boundary_curvature)
    np.testing.assert_allclose(twist.mean(axis=0), expected, atol=1e-3)
    pairs = [twist_from_pair(agv, p, noisy_alpha, noisy_u) for p in ((0, 2), (1, 3))]
    for pair in pairs:
        assert (twist.std(axis=0) < pair.std(axis=0)).all()


@given(st.integers(0, 2**32 - 1))
def test_the_fit_is_a_least_squares_one(seed: int) -> None:
    """Against numpy, row by row."""
    rng = np.random.default_rng(seed)
    agv = four()
    alpha, u = rng.uniform(-3, 3, (2, 4))
    matrix, right = [], []
    for wheel, a, speed in zip(agv.wheels, alpha, u, strict=True):
        x, y = wheel.x, wheel.y
        sin, cos = math.sin(a), math.cos(a)
        matrix += [[cos, sin, x * sin - y * cos], [-sin, cos, x * cos + y * sin]]
        right += [speed, 0.0]
    fit, squares, _, _ = np.linalg.lstsq(np.array(matrix), np.array(right))
    twist, residual = twist_from_wheels(agv, alpha, u)
    np.testing.assert_allclose(twist, fit, atol=1e-11)
    assert residual == pytest.approx(math.sqrt(squares[0] / 8), abs=1e-11)


def test_batches_broadcast() -> None:
    agv = four()
    alpha, u = configspace.wheel_states(agv, 0.8, np.linspace(-1, 1, 6), 1.0)
    speeds = u * np.array([0.0, 0.5, -1.0])[:, None, None]
    twist, residual = twist_from_wheels(agv, alpha, speeds)
    assert twist.shape == (3, 6, 3)
    assert residual.shape == (3, 6)
    np.testing.assert_allclose(twist[0], 0)
    for i, k in itertools.product(range(3), range(6)):
        one = twist_from_wheels(agv, alpha[k], speeds[i, k])
        np.testing.assert_allclose(one[0], twist[i, k], atol=1e-15)
    assert twist_from_pair(agv, (0, 1), alpha, speeds).shape == (3, 6, 3)


# --- the matrices of the lecture, with b half the track and a + b of the rectangle


def test_lecture_differential() -> None:
    b = 0.22
    agv = of(at("fixed", 0, -b), at("fixed", 0, b))
    forward = np.array([[1, 1], [0, 0], [1 / b, -1 / b]]) / 2
    found = [twist_from_wheels(agv, np.zeros(2), u)[0] for u in np.eye(2)]
    np.testing.assert_allclose(np.transpose(found), forward, atol=1e-12)


def test_lecture_omni_three_wheels() -> None:
    b = 0.3
    agv = of(
        *(
            at(
                "omni",
                b * math.cos(math.radians(a)),
                b * math.sin(math.radians(a)),
                heading_deg=delta,
            )
            for delta, a in ((-90.0, 0), (30.0, 120), (150.0, -120))
        )
    )
    root = math.sqrt(3)
    forward = np.array([[0, root, -root], [-2, 1, 1], [-1 / b, -1 / b, -1 / b]]) / 3
    found = [twist_from_wheels(agv, np.zeros(3), u)[0] for u in np.eye(3)]
    np.testing.assert_allclose(np.transpose(found), forward, atol=1e-12)


def test_lecture_mecanum() -> None:
    a, b = 0.3, 0.25  # half length, half width
    corners = ((b, -a, 45), (b, a, -45), (-b, a, 45), (-b, -a, -45))
    agv = of(*(at("mecanum", x, y, roller_deg=g) for x, y, g in corners))
    c = 1 / (a + b)
    forward = np.array([[1, 1, 1, 1], [1, -1, 1, -1], [c, -c, -c, c]]) / 4
    found, residuals = zip(
        *(twist_from_wheels(agv, np.zeros(4), u) for u in np.eye(4)), strict=True
    )
    np.testing.assert_allclose(np.transpose(found), forward, atol=1e-12)
    # (1, 1, -1, -1) is what no motion makes: a quarter of each unit speed.
    np.testing.assert_allclose(residuals, 0.25)


# --- two wheels


@pytest.mark.parametrize("kind", ["steered", "mixed", "ackermann", "differential"])
def test_a_pair_tells_the_twist(kind: VehicleKind) -> None:
    rng = np.random.default_rng(23)
    for _ in range(15):
        vehicle = random_vehicle(rng, kind)
        standard = [
            i for i, w in enumerate(vehicle.wheels) if not isinstance(w, Castor)
        ]
        state = motions(vehicle, rng)
        alpha, u = configspace.wheel_states(vehicle, *state)
        for pair in itertools.permutations(standard, 2):
            twist = twist_from_pair(vehicle, pair, alpha, u)
            np.testing.assert_allclose(twist, truth(vehicle, *state), atol=1e-6)


def test_a_pair_with_the_centre_on_one_of_them() -> None:
    agv = four()
    for i, wheel in enumerate(agv.wheels):
        still = [wheel.y, -wheel.x, 1.0]
        state = configspace.from_twist(still, agv.boundary_curvature)
        alpha, u = configspace.wheel_states(agv, *state)
        alpha[i] = 1.234  # undefined there
        for k in range(4):
            if k == i:
                continue
            # Any angle of the wheel that stands still fits, only not with its axle
            # along the other's.
            twist = twist_from_pair(agv, (i, k), alpha, u)
            np.testing.assert_allclose(twist, still, atol=1e-12)
            again = twist_from_pair(agv, (k, i), alpha, u)
            np.testing.assert_array_equal(again, twist)


def test_a_pair_with_parallel_axles() -> None:
    agv = four()
    alpha, u = np.full(4, 0.3), np.full(4, -0.7)
    alpha[1], u[1] = 0.3 + np.pi, 0.7
    expected = [-0.7 * math.cos(0.3), -0.7 * math.sin(0.3), 0.0]
    for pair in itertools.permutations(range(4), 2):
        np.testing.assert_allclose(
            twist_from_pair(agv, pair, alpha, u), expected, atol=1e-12
        )


def test_a_pair_on_one_axle_is_a_differential_drive() -> None:
    agv = of(at("steered", 0.3, 0.4), at("steered", -0.1, -0.4))
    alpha = np.angle(-1j * (0.4 + 0.8j)) + np.array([0.0, np.pi])
    twist = twist_from_pair(agv, (0, 1), alpha, [0.5, 0.2])
    v = np.array([0.5, -0.2]) * np.exp(1j * alpha[0])
    for wheel, speed in zip(agv.wheels, v, strict=True):
        at_wheel = complex(twist[0] - twist[2] * wheel.y, twist[1] + twist[2] * wheel.x)
        assert at_wheel == pytest.approx(speed, abs=1e-12)


def test_what_is_not_measured_is_not_known() -> None:
    agv = four()
    alpha, u = configspace.wheel_states(agv, [0.5, 0.6], 0.2, 1.0)
    alpha[0, 1] = np.nan
    twist = twist_from_pair(agv, (0, 1), alpha, u)
    assert np.isnan(twist[0]).all()
    assert not np.isnan(twist[1]).any()


# --- one centre of rotation


@given(st.integers(0, 2**32 - 1))
def test_angles_of_a_motion_leave_no_residual(seed: int) -> None:
    rng = np.random.default_rng(seed)
    vehicle = random_vehicle(rng, ("steered", "mixed", "ackermann")[seed % 3])
    state = motions(vehicle, rng, 5)
    alpha, _ = configspace.wheel_states(vehicle, *state)
    assert steering_residual(vehicle, alpha).max() < 1e-12
    standard = [i for i, w in enumerate(vehicle.wheels) if not isinstance(w, Castor)]
    sideways = (no_slip_rows(vehicle, alpha) @ truth(vehicle, *state)[..., None])[
        ..., 0
    ]
    assert sideways.shape == (*state[0].shape, len(standard))
    assert np.abs(sideways).max() < 1e-11


def test_residual_is_about_the_steering_error() -> None:
    agv = four()
    alpha, _ = configspace.wheel_states(agv, 0.6, 0.9, 1.0)
    for error in (1e-3, 1e-2):
        off = steering_residual(agv, alpha + error * np.eye(4))
        assert (off < 1.5 * error).all()
        assert (off > 0.1 * error).all()


def test_two_wheels_always_have_a_centre() -> None:
    agv = of(at("steered", 0.3, 0.4), at("steered", -0.1, -0.4))
    assert steering_residual(agv, [[0.1, 2.0], [0.0, 0.0]]).tolist() == [0.0, 0.0]


# --- refusals


def test_unknown_twists_are_refused_with_the_wheels() -> None:
    agv = four()
    alpha, u = configspace.wheel_states(agv, [0.5, 0.6, 0.7], 0.2, 1.0)
    u[1] = np.nan
    with pytest.raises(configspace.InvalidInput) as error:
        twist_from_wheels(agv, alpha, u)
    assert str(error.value).startswith(
        "u[1]: rolling speeds of no wheel (not of w0, w1, w2, w3); "
    )
    assert "2 of the 3 components" in str(error.value)
    alone = of(at("steered", 0.3, 0.4), at("castor", -0.3, 0.4))
    with pytest.raises(configspace.InvalidInput, match="u: rolling speeds of w0; with"):
        twist_from_wheels(alone, [0.3, np.nan], [1.0, np.nan])


@pytest.mark.parametrize(
    ("alpha", "u", "more", "match"),
    [
        (np.zeros(3), np.zeros(4), {}, "alpha: shape"),
        (np.zeros(4), np.zeros((4, 1)), {}, "u: shape"),
        (np.zeros(4), np.full(4, np.inf), {}, r"u\[0\]: inf"),
        (np.full(4, "a"), np.zeros(4), {}, "alpha"),
        (np.zeros((2, 4)), np.zeros((3, 4)), {}, "broadcast"),
        (np.zeros(4), np.zeros(4), {"weights": [1, 1, 1, -1]}, "weights: -1"),
        (np.zeros(4), np.zeros(4), {"weights": [1, 1, 1, np.nan]}, "weights"),
        (np.zeros(4), np.zeros(4), {"alpha_dot": np.zeros(2)}, "alpha_dot: shape"),
    ],
)
def test_bad_measurements_are_named(
    alpha: np.ndarray, u: np.ndarray, more: dict[str, object], match: str
) -> None:
    with pytest.raises(configspace.InvalidInput, match=match):
        twist_from_wheels(four(), alpha, u, **more)  # type: ignore[arg-type]


def test_bad_pairs_are_named() -> None:
    agv = of(at("steered", 0.3, 0.4), at("steered", 0.3, 0.4), at("castor", -1.0, 0.0))
    zeros = np.zeros(3)
    for pair, match in (
        ((0, 1), "w0, w1; must stand in different places"),
        ((0, 0), "different places"),
        ((0, 2), r"w2 \(castor\)"),
        ((0, 3), r"must lie in \[0, 2\]"),
        ((-1, 0), "must lie in"),
    ):
        with pytest.raises(configspace.InvalidInput, match=match):
            twist_from_pair(agv, pair, zeros, zeros)
    with pytest.raises(configspace.InvalidInput, match="alpha"):
        no_slip_rows(agv, [0.0, np.nan, 0.0])
    with pytest.raises(configspace.InvalidInput, match="d: -1"):
        steering_residual(four(), np.zeros(4), d=-1.0)
