"""Steering accelerations against closed forms and differences."""

import math

import naive_motion
import numpy as np
import numpy.typing as npt
import pytest

import configspace
from configspace import Grid, vehicle_from_data
from configspace.testing import random_vehicle
from omniplan import Tolerances, Trajectory, validate
from omniplan.judging.swing import Pieces, Swing
from omniplan.judging.vehicle_judge import VehicleJudge
from omniplan.motion import Intervals, OmniCurveMotion, PoseMotion, motion_of

FloatArray = npt.NDArray[np.float64]
EVERYWHERE = (np.array([True]), np.array([True]))


def two_wheels(limit: float | None) -> configspace.Vehicle:
    wheels = [
        {
            "id": f"w{i}", "type": "steered", "x": x, "y": 0.1, "max_speed": 9.0,
            "max_steering_acceleration_deg": limit,
        }
        for i, x in enumerate((0.5, -0.5))
    ]  # fmt: skip
    return vehicle_from_data({"name": "two", "kappa_g": 2.0, "wheels": wheels})


def cut(motion: PoseMotion, halvings: int) -> Intervals:
    parts = motion.intervals()
    for _ in range(halvings):
        parts = parts.halved(np.ones(parts.t0.shape, dtype=bool))
    return parts


def pose_motion(trajectory: Trajectory) -> PoseMotion:
    motion = motion_of(trajectory, is_own=False)
    assert isinstance(motion, PoseMotion)
    return motion


def straightened(t: FloatArray, x: FloatArray, y: FloatArray) -> Trajectory:
    return Trajectory.from_poses(t, np.stack([x, y, 0 * t], axis=-1))


def test_a_parabola_of_directions_in_closed_form() -> None:
    # p' = 1 + j k t²: α = atan(k t²); splines of cubics are exact.
    t, k = np.linspace(-1, 1, 9), 1.7
    motion = pose_motion(straightened(t, t, k * t**3 / 3))
    parts = cut(motion, 3)
    swing = motion.enclose(parts).swing
    assert swing is not None
    for point in (0j, 0.4 - 0.3j):  # without turning all points move alike
        ends, bound = swing.directions.accelerations(point)
        for row, when in enumerate((parts.t0, parts.t1)):
            exact = 2 * k * (1 - 3 * k**2 * when**4) / (1 + k**2 * when**4) ** 2
            np.testing.assert_allclose(ends[row], exact, atol=1e-9)
        inside = parts.t0 + np.linspace(0, 1, 50)[:, None] * (parts.t1 - parts.t0)
        exact = 2 * k * (1 - 3 * k**2 * inside**4) / (1 + k**2 * inside**4) ** 2
        assert (np.abs(exact).max(axis=0) <= bound + 1e-9).all()
        assert (bound <= np.abs(exact).max(axis=0) + 0.2).all()


@pytest.mark.parametrize("turned", [False, True])
def test_leaving_and_reaching_rest_the_steering_acceleration_is_finite(
    turned: bool,
) -> None:
    # p' = t + j k t²: α = atan(k t), though U is 0 at t = 0.
    t, k = np.linspace(0, 1, 9), 2.0
    x, y = t**2 / 2, k * t**3 / 3
    when = np.insert(t + 1, 0, 0.0)  # a dwell before
    x, y = np.insert(x, 0, 0.0), np.insert(y, 0, 0.0)
    if turned:
        when, x, y = 2 - when[::-1], x[::-1], y[::-1]
    motion = pose_motion(straightened(when, x, y))
    parts = motion.intervals()
    swing = motion.enclose(parts).swing
    assert swing is not None
    ends, bound = swing.directions.accelerations(0j)
    dwell, first = (-1, -2) if turned else (0, 1)
    assert bound[dwell] == math.inf  # no direction at all
    moving = np.arange(parts.t0.size) != dwell % parts.t0.size
    s0, s1 = (np.abs(w - 1.0) for w in (parts.t0, parts.t1))
    for row, s in enumerate((s0, s1)):
        exact = -2 * k**3 * s / (1 + k**2 * s**2) ** 2
        np.testing.assert_allclose(ends[row][moving], exact[moving], atol=1e-8)
    assert bound[first] < 6.0
    assert np.isfinite(bound[moving]).all()


def test_a_stop_to_stop_interval_is_factored_at_both_ends() -> None:
    motion = pose_motion(straightened(np.array([0.0, 2.0]), np.array([0.0, 1.0]),
                                      np.array([0.0, 0.5])))  # fmt: skip
    assert motion.rest is not None
    motion.rest[:] = True
    motion.position[:] = np.array([[-2.0], [6.0], [0.0], [0.0]]) * (1 + 0.5j) / 8 * 2
    swing = motion.enclose(motion.intervals()).swing
    assert swing is not None
    ends, bound = swing.directions.accelerations(0.3j)
    assert np.abs(ends).max() < 1e-12
    assert bound.max() < 1e-9


def test_an_instant_at_which_a_wheel_stands_has_no_bound() -> None:
    # The vehicle starts to move ahead while it turns about its origin.
    pieces = Pieces(
        speed=np.array([[0.0], [1.0], [0.0], [0.0]], dtype=np.complex128),
        turn=np.array([[0.0], [0.0], [1.0], [0.0]]),
        since=np.array([np.inf]),
        heading=np.array([[0.0], [0.0], [1.0], [0.0]]),
        point=0j,
    )
    knot = np.zeros(1, dtype=np.int64)
    instant = Swing(np.zeros(1), np.zeros((2, 1)), knot, lambda: pieces).directions
    for values in (instant.accelerations, instant.rates):
        ends, bound = values(0j)
        assert (ends == 0).all()
        assert bound[0] == math.inf
        _, bound = values(0.5j)
        assert np.isfinite(bound).all()


def test_a_sinusoidal_side_slip_has_the_acceleration_of_a_sine() -> None:
    t = np.linspace(0, 4, 401)
    amplitude, pace = 0.5, 2.0
    beta = amplitude * np.sin(pace * t)
    fine = np.linspace(0, 4, 40001)
    v = 0.5 * np.exp(1j * amplitude * np.sin(pace * fine))
    p = np.concatenate([[0], np.cumsum((v[1:] + v[:-1]) / 2 * np.diff(fine))])[::100]
    assert beta.shape == p.shape
    trajectory = straightened(t, p.real, p.imag)
    largest = math.degrees(amplitude * pace**2)  # 114.6°/s²
    for limit, valid in ((0.98 * largest, False), (1.02 * largest, True)):
        space = configspace.build_space(two_wheels(limit), Grid(40, 72), cache=False)
        report = validate(trajectory, space)
        assert report.valid == valid
        used = 1 - report.margin
        assert used == pytest.approx(largest / limit, rel=5e-3)
        assert report.tightest.startswith("STEER_ACCELERATION")
        if not valid:
            assert {v.limit for v in report.violations} == {"STEER_ACCELERATION"}
            worst = report.headline
            assert worst is not None
            assert worst.unit == "rad/s²"
            assert worst.value == pytest.approx(amplitude * pace**2, rel=5e-3)
            assert "°/s²" in str(worst)
            # Grows with the square of the speed.
            (advice,) = report.advice
            assert advice.value == pytest.approx(math.sqrt(limit / largest), rel=5e-3)


def test_without_the_limit_nothing_changes() -> None:
    t = np.linspace(0, 2, 9)
    poses = np.stack([t, np.sin(3 * t) / 3, 0 * t], axis=-1)
    report = validate(
        Trajectory.from_poses(t, poses),
        configspace.build_space(two_wheels(None), Grid(40, 72), cache=False),
    )
    assert "STEER_ACCELERATION" not in report.tightest
    assert report.valid


@pytest.mark.parametrize("seed", range(4))
def test_bounds_hold_against_differences(seed: int) -> None:
    rng = np.random.default_rng(seed)
    close = checked = 0
    for _ in range(15):
        vehicle = random_vehicle(rng)
        data = vehicle.model_dump(mode="json")
        steered = [w for w in data["wheels"] if w["type"] == "steered"]
        if not steered:
            continue
        for wheel in steered:
            wheel["max_steering_acceleration_deg"] = 200.0
        vehicle = vehicle_from_data(data)
        t = np.cumsum(rng.uniform(0.2, 0.6, 6))
        poses = np.cumsum(rng.normal(size=(6, 3)) * [0.2, 0.2, 0.3], axis=0)
        point = (0.2, -0.1)
        trajectory = Trajectory.from_poses(t, poses, reference_point=point)
        motion = pose_motion(trajectory)
        judge = VehicleJudge(
            vehicle, Tolerances(), is_own=False, has_rates=True, has_swing=True
        )
        parts = cut(motion, int(rng.integers(0, 7)))
        low, high = judge.utilisation(motion.enclose(parts), 1)
        twist_at = naive_motion.pose_motion(t, poses, *point)
        for column, row in enumerate(judge.rows):
            if row.limit != "STEER_ACCELERATION":
                continue
            at = vehicle.contacts[row.wheel]
            for i in rng.choice(parts.t0.size, 4):
                when = np.linspace(parts.t0[i], parts.t1[i], 2001)
                u = naive_motion.point_velocity(twist_at(when), at.real, at.imag)
                if np.abs(u).min() < 1e-2:
                    continue
                alpha = np.unwrap(np.angle(u))
                step = when[1] - when[0]
                bent = np.abs(np.diff(alpha, 2)) / step**2 / row.bound
                noise = 1e-14 / step**2 / row.bound
                assert bent.max() <= high[i, column] * (1 + 1e-9) + noise + 1e-9
                slack = 5e-2 * bent.max() + noise + 1e-6
                if np.abs(u).min() > 0.1:
                    assert low[i, column] <= bent.max() + slack
                checked += 1
                close += high[i, column] < 1.5 * bent.max() + 0.1
    assert checked > 20
    assert close > checked / 4


@pytest.mark.parametrize("divided", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_derivatives_and_their_bounds(seed: int, divided: bool) -> None:
    """Each derivative is the difference of the one before, and within its bound."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.3, 0.6, 6))
    poses = np.cumsum(rng.normal(size=(6, 3)) * 0.3, axis=0)
    motion = pose_motion(Trajectory.from_poses(t, poses, reference_point=(0.3, 0.1)))
    if divided:  # by a time with any origin
        motion.rest, motion.since = None, t[:-1] - t[0] + 0.4
        motion.since[3:] = t[3:-1] - t[-1] - 0.4
    whole = motion.intervals()
    bounds = motion.enclose(whole).swing
    assert bounds is not None
    for i in range(whole.t0.size):
        when = np.linspace(whole.t0[i], whole.t1[i], 4001)
        knot = np.full(4000, whole.knot[i])
        swing = motion.enclose(Intervals(knot, when[:-1], when[1:])).swing
        assert swing is not None
        for values, most in (
            (swing.directions.v, bounds.directions.v_most[:, i]),
            (swing.directions.omega, bounds.directions.omega_most[:, i]),
        ):
            step = np.diff(when)
            for order in (0, 1):
                mean = (values[order, 1] - values[order, 0]) / step
                middle = (values[order + 1, 0] + values[order + 1, 1]) / 2
                assert np.abs(mean - middle).max() < 1e-4 * (1 + np.abs(middle).max())
                assert np.abs(values[order + 1]).max() <= most[order] + 1e-12
            third = np.abs(values[2, 1] - values[2, 0]) / step
            assert third.max() <= most[2] + 1e-6 * (1 + most[2])
            fourth = np.abs(np.diff(values[2, 0], 2)) / step[2:] ** 2
            assert fourth.max() <= most[3] * (1 + 1e-6) + 1e-5 * (1 + most[2])


@pytest.mark.parametrize("seed", range(3))
def test_legs_in_kappa_n_and_beta_against_differences(seed: int) -> None:
    rng = np.random.default_rng(seed)
    vehicle = configspace.load_vehicle("ift-three-steered")
    corners = np.stack(
        [rng.uniform(-2, 2, 5), rng.uniform(-2, 2, 5), np.zeros(5)], axis=-1
    )
    motion = OmniCurveMotion(
        np.arange(5.0), corners, vehicle.boundary_curvature, vehicle.reference
    )
    parts = motion.intervals()
    directions = motion.directions(parts)
    for i, wheel in enumerate(vehicle.wheels):
        if wheel.type != "steered":
            continue
        rates, steepest = directions.rates(vehicle.contacts[i])
        bends, most = directions.accelerations(vehicle.contacts[i])
        for k in range(parts.t0.size):
            when = np.linspace(parts.t0[k], parts.t1[k], 4001)
            at = [np.interp(when, np.arange(5.0), corners[:, j]) for j in (0, 1)]
            z = configspace.wheel_directions(vehicle, *at)[:, i]
            if np.abs(z).min() < 0.05:
                continue
            alpha, step = np.unwrap(np.angle(z)), when[1] - when[0]
            slope, bent = np.diff(alpha) / step, np.diff(alpha, 2) / step**2
            scale = 1 + np.abs(bent).max()
            assert np.abs(slope).max() <= steepest[k] + 1e-9
            assert np.abs(bent).max() <= most[k] + 1e-4
            assert abs(slope[0] - rates[0, k]) < step * scale
            assert abs(slope[-1] - rates[1, k]) < step * scale
            assert abs(bent[0] - bends[0, k]) < 5e-2 * scale
            assert abs(bent[-1] - bends[1, k]) < 5e-2 * scale


def test_halving_closes_the_bound_with_the_square_of_the_length() -> None:
    t = np.linspace(0, 2, 6)
    poses = np.stack([t, np.sin(2 * t) / 2, 0.3 * np.cos(t)], axis=-1)
    motion = pose_motion(Trajectory.from_poses(t, poses))
    gaps = []
    for halvings in (5, 6, 7):
        parts = cut(motion, halvings)
        swing = motion.enclose(parts).swing
        assert swing is not None
        ends, bound = swing.directions.accelerations(0.3 + 0.2j)
        gaps.append(float((bound - np.abs(ends).max(axis=0)).max()))
    assert gaps[1] < gaps[0] / 3
    assert gaps[2] < gaps[1] / 3


@pytest.mark.parametrize("turned", [False, True])
def test_near_rest_few_parts_tell_how_directions_swing(turned: bool) -> None:
    """Divided by the time since rest, a twist that grows with it hardly changes."""
    t = np.concatenate([[0.0, 1e-3], np.geomspace(2e-3, 1.0, 60)])
    u = t**2 / 2
    poses = np.stack([u, 0.4 * u**2 + u, 0.3 * u], axis=-1)
    when = t
    if turned:
        when, poses = 1 - t[::-1], poses[::-1]
    motion = pose_motion(Trajectory.from_poses(when, poses))
    assert np.isfinite(motion.since[1:-1]).all()
    parts = cut(motion, 2)
    swing = motion.enclose(parts).swing
    assert swing is not None
    ends, bound = swing.directions.accelerations(0.3 + 0.2j)
    plain = motion_of(Trajectory.from_poses(when, poses), is_own=False)
    assert isinstance(plain, PoseMotion)
    plain.since = np.full(when.size - 1, np.inf)
    undivided = plain.enclose(parts).swing
    assert undivided is not None
    others, loose = undivided.directions.accelerations(0.3 + 0.2j)
    np.testing.assert_allclose(ends, others, rtol=1e-6, atol=1e-6)
    reached = np.abs(ends).max(axis=0)
    assert np.median(bound - reached) < 0.1 * np.median(loose - reached)
