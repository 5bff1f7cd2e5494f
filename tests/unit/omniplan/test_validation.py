"""Every limit once, with numbers worked out by hand."""

import math
from typing import Any

import numpy as np
import pytest

import configspace
from configspace import Grid, PermissibleSpace, vehicle_from_data
from omniplan import Report, Tolerances, Trajectory, Violation, validate

GRID = Grid(40, 72)


def space(*wheels: dict[str, Any], **limits: float) -> PermissibleSpace:
    numbered = [{"id": f"w{i}", **wheel} for i, wheel in enumerate(wheels)]
    data = {"name": "hand", "kappa_g": 2.0, "wheels": numbered, "limits": limits}
    return configspace.build_space(vehicle_from_data(data), GRID, cache=False)


def steered(x: float, y: float, **more: Any) -> dict[str, Any]:
    return {"type": "steered", "x": x, "y": y, "max_speed": 5.0, **more}


def omnidirectional(**limits: float) -> PermissibleSpace:
    """Two wheels that turn freely, 0.5 m ahead and behind."""
    return space(steered(0.5, 0.0), steered(-0.5, 0.0), **limits)


def differential(**more: Any) -> PermissibleSpace:
    wheel = {"type": "fixed", "x": 0.0, "max_speed": 1.0, **more}
    return space({**wheel, "y": 0.25}, {**wheel, "y": -0.25})


def constant(*twist: float, t: float = 1.0) -> Trajectory:
    return Trajectory.from_twists([0, t], [twist, twist])


def only(report: Report, limit: str) -> Violation:
    assert not report.valid
    assert {v.limit for v in report.violations} == {limit}
    return report.headline or report.violations[0]


def assert_says(
    violation: Violation,
    value: float,
    bound: float,
    unit: str,
    wheel: str | None = None,
    index: int = 0,
) -> None:
    assert violation.value == pytest.approx(value, rel=1e-3)
    assert violation.bound == pytest.approx(bound, rel=1e-9)
    assert violation.unit == unit
    assert violation.wheel == wheel
    assert violation.index == index
    assert violation.is_proved


def test_wheel_speed() -> None:
    # ω = 2 rad/s at 0.6 m/s: right 0.6 + 2 * 0.25 = 1.1 m/s, left 0.1 m/s.
    report = validate(constant(0.6, 0.0, 2.0), differential())
    assert_says(only(report, "WHEEL_SPEED"), 1.1, 1.0, "m/s", "w1")
    assert report.margin == pytest.approx(-0.1)
    assert report.tightest == "WHEEL_SPEED w1"
    assert report.speed_factor == pytest.approx(1 / 1.1, rel=2e-3)
    assert report.fastest_duration == pytest.approx(1.1, rel=2e-3)
    (advice,) = report.advice
    assert advice.kind == "slow_down"
    assert advice.value == pytest.approx(1 / 1.1, rel=3e-3)


def test_mecanum_wheel_speed() -> None:
    wheels = [
        {"type": "mecanum", "x": x, "y": y, "roller_deg": -45.0 * x * y / 0.06,
         "max_speed": 1.0}
        for x, y in ((0.3, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.3, -0.2))
    ]  # fmt: skip
    # u = vx ± vy ± (a + b) ω with a + b = 0.5: 0.4 + 0.3 + 0.5 * 0.8 = 1.1.
    report = validate(constant(0.4, 0.3, 0.8), space(*wheels))
    assert_says(only(report, "WHEEL_SPEED"), 1.1, 1.0, "m/s", "w3")


def test_vehicle_speed_of_the_reference_point() -> None:
    report = validate(constant(0.3, 0.4, 0.1), omnidirectional(max_speed=0.4))
    assert_says(only(report, "SPEED"), 0.5, 0.4, "m/s")


def test_yaw_rate() -> None:
    report = validate(constant(0.3, 0.0, 1.0), omnidirectional(max_yaw_rate_deg=45.0))
    assert_says(only(report, "YAW_RATE"), 1.0, math.pi / 4, "rad/s")


def test_lateral_acceleration() -> None:
    limits = {"max_lateral_acceleration": 0.5}
    report = validate(constant(0.8, 0.0, 1.0), omnidirectional(**limits))
    assert_says(only(report, "LATERAL_ACCELERATION"), 0.8, 0.5, "m/s²")
    # The value grows with the square of the speed.
    assert report.speed_factor == pytest.approx(math.sqrt(0.5 / 0.8), rel=2e-3)


def test_acceleration_and_deceleration_with_their_rows() -> None:
    limits = {"max_acceleration": 0.4, "max_deceleration": 0.7}
    ramp = Trajectory.from_twists(
        [0, 1, 2, 3], [[0.0, 0, 0], [0.6, 0, 0], [0.8, 0, 0], [0.0, 0, 0]]
    )
    report = validate(ramp, omnidirectional(**limits))
    first, second = report.violations
    assert first.limit == "ACCELERATION"
    assert_says(first, 0.6, 0.4, "m/s²")
    # It is the same all along the ramp: of equals the first place is named. That is
    # just after the start, as at rest the speed has no direction yet.
    assert first.index == 0
    assert 0 < first.t < 0.01
    assert second.limit == "DECELERATION"
    assert_says(second, 0.8, 0.7, "m/s²", index=2)
    assert (first.t_start, second.t_end) == (0.0, 3.0)
    assert first.t_end == pytest.approx(1.0)
    assert second.t_start == pytest.approx(2.0)


def test_wheel_acceleration() -> None:
    # Left 0 to 0.8 m/s, right 0 to 0.2 m/s in one second.
    trajectory = Trajectory.from_twists([0.0, 1], [[0.0, 0, 0], [0.5, 0, -1.2]])
    report = validate(trajectory, differential(max_acceleration=0.7))
    assert_says(only(report, "WHEEL_ACCELERATION"), 0.8, 0.7, "m/s²", "w0")
    assert report.speed_factor == pytest.approx(math.sqrt(0.7 / 0.8), rel=2e-3)


def test_reverse_speed_of_an_axle() -> None:
    wheels = [
        {"type": "fixed", "x": 0.0, "y": y, "max_speed": 1.0} for y in (0.2, -0.2)
    ]
    slow = space(*wheels, max_reverse_speed=0.3)
    assert validate(constant(0.4, 0.0, 0.0), slow).valid
    violation = only(validate(constant(-0.4, 0.0, 0.0), slow), "REVERSE_SPEED")
    assert_says(violation, 0.4, 0.3, "m/s")


def test_reverse_speed_where_the_wheels_cannot_turn_round() -> None:
    ranged = {"steering_range_deg": (-100.0, 100.0)}
    slow = space(
        steered(0.5, 0.0, **ranged), steered(-0.5, 0.0, **ranged), max_reverse_speed=0.3
    )
    assert validate(constant(0.4, 0.0, 0.0), slow).valid
    report = validate(constant(-0.4, 0.0, 0.0), slow)
    violation = only(report, "REVERSE_SPEED")
    assert_says(violation, 0.4, 0.3, "m/s")
    assert violation.beta == pytest.approx(0.0)


def test_steering_range_at_either_stop() -> None:
    for sign, bound in ((1, 40.0), (-1, -20.0)):
        one = space(
            {"type": "fixed", "x": 0.0, "y": 0.2, "max_speed": 1.0},
            {"type": "fixed", "x": 0.0, "y": -0.2, "max_speed": 1.0},
            {
                "type": "steered",
                "x": 1.0,
                "y": 0.0,
                "steering_range_deg": (-20.0, 40.0),
            },
        )
        # tan α = 1 m * ω / v
        report = validate(constant(0.4, 0.0, sign * 0.4), one)
        violation = only(report, "STEER_RANGE")
        assert_says(
            violation, math.radians(sign * 45), math.radians(bound), "rad", "w2"
        )
        assert violation.kappa_n == pytest.approx(sign * 0.5)
        assert report.speed_factor == 0
        assert report.fastest_duration is None
        assert report.advice == ()


def test_steering_rate_with_its_place() -> None:
    one = space(
        {"type": "fixed", "x": 0.0, "y": 0.2, "max_speed": 1.0},
        {"type": "fixed", "x": 0.0, "y": -0.2, "max_speed": 1.0},
        {"type": "steered", "x": 1.0, "y": 0.0, "max_steering_rate_deg": 30.0},
    )
    # α = atan(ω / v): α̇ = ω̇ v / (v² + ω²), largest at ω = 0: 0.4 / 0.5 = 0.8 rad/s.
    trajectory = Trajectory.from_twists(
        [0, 1, 2, 3], [[0.5, 0, 0], [0.5, 0, 0], [0.5, 0, 0.4], [0.5, 0, 0.4]]
    )
    violation = only(validate(trajectory, one), "STEER_RATE")
    assert_says(violation, 0.8, math.radians(30), "rad/s", "w2", index=1)
    assert violation.t == pytest.approx(1.0, abs=1e-6)
    # 0.5 * 0.4 / (0.25 + ω²) falls to 30°/s where ω² = 0.2 / 0.5236 - 0.25.
    end = 1 + math.sqrt(0.2 / math.radians(30) - 0.25) / 0.4
    # A part that is broken at one end is not divided any further.
    assert end <= violation.t_end <= 2.0


def test_a_wheel_at_the_centre_of_rotation() -> None:
    report = validate(constant(0.0, -0.25, 0.5), omnidirectional())
    violation = only(report, "SINGULAR")
    assert violation.wheel == "w0"
    assert violation.value == pytest.approx(0.0, abs=1e-12)
    assert violation.bound == 0
    assert math.isinf(violation.excess)
    assert report.speed_factor == 0


def test_sideways_slip_of_a_fixed_wheel() -> None:
    report = validate(constant(0.5, 0.05, 0.0), differential())
    violation = only(report, "FIXED_WHEEL")
    slip = math.asin(0.05 / math.hypot(0.5, 0.05))
    assert_says(violation, slip, math.radians(1), "rad", "w0")
    assert report.speed_factor == 0


def test_slip_within_the_tolerances_is_none() -> None:
    assert validate(constant(0.5, 0.008, 0.0), differential()).valid
    assert validate(constant(0.05, 0.004, 0.0), differential()).valid
    strict = Tolerances(slip_angle=math.radians(0.5), slip_speed=1e-3)
    for twist in ((0.5, 0.008, 0.0), (0.05, 0.004, 0.0)):
        assert not validate(constant(*twist), differential(), strict).valid


def test_the_place_of_a_violation_in_a_path_of_poses() -> None:
    t = np.linspace(0, 10, 101)
    rate = np.interp(t, [0, 4, 5, 6, 10], [0, 0, 1.4, 0, 0])  # rad/s
    theta = np.concatenate([[0], np.cumsum((rate[1:] + rate[:-1]) / 2 * np.diff(t))])
    heading = (theta[1:] + theta[:-1]) / 2
    step = 0.7 * np.diff(t)
    x = np.concatenate([[0], np.cumsum(step * np.cos(heading))])
    y = np.concatenate([[0], np.cumsum(step * np.sin(heading))])
    trajectory = Trajectory.from_poses(t, np.stack([x, y, theta], axis=-1), name="bend")
    report = validate(trajectory, differential())
    violation = only(report, "WHEEL_SPEED")
    # At its peak the right wheel rolls at 0.7 + 1.4 * 0.25 = 1.05 m/s.
    assert violation.value == pytest.approx(1.05, abs=0.02)
    assert violation.wheel == "w1"
    assert violation.t == pytest.approx(5.0, abs=0.11)
    assert violation.index == int(np.searchsorted(t, violation.t + 1e-9) - 1)
    assert violation.pose is not None
    assert violation.pose[0] == pytest.approx(
        float(np.interp(violation.t, t, x)), abs=0.01
    )
    assert 4 < violation.t_start < violation.t < violation.t_end < 6
    assert report.trajectory == "bend"
    assert report.vehicle == "hand"


def test_margin_and_speed_factor_of_a_valid_motion() -> None:
    report = validate(constant(0.25, 0.0, 0.0, t=4.0), differential())
    assert report.valid
    assert report.headline is None
    assert report.margin == pytest.approx(0.75)
    assert report.tightest in {"WHEEL_SPEED w0", "WHEEL_SPEED w1"}
    assert report.speed_factor == pytest.approx(4.0)
    assert report.duration == 4.0
    assert report.fastest_duration == pytest.approx(1.0)
    assert report.top_speed == pytest.approx(0.25)


def test_own_parameters_are_shares_of_v_max() -> None:
    vehicle = configspace.load_vehicle("ift-four-steered")
    known = configspace.build_space(vehicle, GRID, cache=False)
    k = [1.0, 1.0]
    half = Trajectory.from_omni_curve([0, 1], k, [0, 0], [0.5, 0.5], vehicle)
    report = validate(half, known)
    assert report.valid
    assert report.speed_factor == pytest.approx(2.0)
    fastest = float(known.v_max(1.0, 0.0))
    assert report.top_speed == pytest.approx(0.5 * fastest)
    assert report.top_yaw_rate == pytest.approx(
        0.5 * fastest * vehicle.boundary_curvature
    )


def test_the_same_vehicle_is_recognised_by_its_data_sheet() -> None:
    vehicle = configspace.load_vehicle("ift-four-steered")
    sheet = configspace.parse_space(
        configspace.dump_space(configspace.build_space(vehicle, GRID, cache=False))
    )
    full = Trajectory.from_omni_curve([0, 1], [0.3, 0.3], [0, 0], [1, 1], vehicle)
    report = validate(full, sheet)
    assert report.valid
    assert report.speed_factor == pytest.approx(1.0)


def test_what_is_not_judged_is_said() -> None:
    vehicle = configspace.load_vehicle("ift-four-steered")
    known = configspace.build_space(vehicle, GRID, cache=False)
    sheet = configspace.parse_space(configspace.dump_space(known))
    own = Trajectory.from_omni_curve([0, 1], [0, 0], [0, 0], [1, 1], vehicle)
    assert "max_acceleration of the wheels" in validate(own, known).not_judged
    assert "limits.max_deceleration" in validate(own, known).not_judged
    twists = validate(constant(0.1, 0, 0), known)
    (text,) = twists.not_judged
    assert text.startswith("max_steering_acceleration_deg")
    poses = Trajectory.from_poses([0, 1], [[0.0, 0, 0], [0.1, 0, 0]])
    assert validate(poses, known).not_judged == ()
    assert any("change rates" in text for text in validate(own, sheet).not_judged)
    assert validate(constant(0.1, 0.0, 0.0), differential()).not_judged == ()


def test_a_sheet_names_limit_and_speed() -> None:
    known = omnidirectional(max_speed=0.4)
    sheet = configspace.parse_space(configspace.dump_space(known))
    assert validate(constant(0.39, 0.0, 0.0), sheet).valid
    violation = only(validate(constant(0.5, 0.0, 0.0), sheet), "SPEED")
    assert violation.value == pytest.approx(0.5)
    assert violation.bound == pytest.approx(0.4, rel=1e-3)
    assert violation.unit == "m/s"


def test_inputs_stay_as_they_are() -> None:
    trajectory, known = constant(0.6, 0.0, 2.0), differential()
    before = trajectory.samples.copy()
    assert validate(trajectory, known) == validate(trajectory, known)
    assert (trajectory.samples == before).all()


@pytest.mark.parametrize("start", [0.0, -40.0, 1.7e9])
def test_the_clock_may_start_anywhere(start: float) -> None:
    t = start + np.arange(0, 41) * 0.05
    x = 0.4 * np.arange(41) * 0.05
    trajectory = Trajectory.from_poses(t, np.stack([x, 0 * x, 0 * x], axis=-1))
    report = validate(trajectory, differential(max_acceleration=0.5))
    assert report.valid
    assert report.margin == pytest.approx(0.6, abs=1e-3)


def test_a_speed_factor_keeps_the_slip_within_the_tolerances() -> None:
    slow = constant(0.1, 0.0049, 0.0)
    report = validate(slow, differential())
    assert report.valid
    assert validate(slow.scaled(report.speed_factor * 0.998), differential()).valid


def test_a_speed_factor_leaves_the_wheels_time_to_turn() -> None:
    known = configspace.build_space(
        configspace.load_vehicle("ift-four-steered"), GRID, cache=False
    )
    f = np.linspace(0, 1, 21)
    smooth, zero = f**3 * (10 - 15 * f + 6 * f**2), 0 * f
    there = np.stack([smooth, zero, zero], axis=-1)
    aside = np.stack([1 + zero, 0.8 * smooth, zero], axis=-1)
    t = np.concatenate([3 * f, 3.8 + 3 * f])
    trajectory = Trajectory.from_poses(t, np.concatenate([there, aside]))
    report = validate(trajectory, known)
    assert report.valid
    assert validate(trajectory.scaled(report.speed_factor * 0.998), known).valid


@pytest.mark.parametrize("name", ["differential", "ackermann"])
@pytest.mark.parametrize("beta", [math.pi, math.radians(0.9)])
@pytest.mark.parametrize("by_sheet", [False, True])
def test_own_parameters_off_the_line_are_refused(
    name: str, beta: float, by_sheet: bool
) -> None:
    vehicle = configspace.load_vehicle(name)
    known = configspace.build_space(vehicle, GRID, cache=False)
    if by_sheet:
        known = configspace.parse_space(configspace.dump_space(known))
    assert not known.contains(0.0, beta, 0.1)
    own = Trajectory.from_omni_curve([0, 1], [0, 0], [beta] * 2, [0.5] * 2, vehicle)
    assert not validate(own, known).valid
