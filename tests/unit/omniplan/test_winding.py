"""Wheels with a range of more than a full turn: followed, started, unwound."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

import configspace
from configspace import Grid, PermissibleSpace, vehicle_from_data
from omniplan import Report, Trajectory, Violation, validate

DEGREE = math.pi / 180
AREA = [(-0.4, -0.3), (-0.4, 0.3), (0.4, -0.3), (0.4, 0.3)]


def vehicle_space(
    steering_range: tuple[float, float] | None = (-270.0, 270.0),
    rate: float | None = None,
    at: list[tuple[float, float]] | None = None,
    **limits: float,
) -> PermissibleSpace:
    wheels = [
        {"id": f"w{i}", "type": "steered", "x": x, "y": y, "max_speed": 2.0,
         "steering_range_deg": steering_range, "max_steering_rate_deg": rate}
        for i, (x, y) in enumerate(at or AREA)
    ]  # fmt: skip
    data = {"name": "winder", "kappa_g": 2.0, "wheels": wheels, "limits": limits}
    return configspace.build_space(vehicle_from_data(data), Grid(40, 72), cache=False)


def crab(*corners: float, speed: float = 0.5) -> Trajectory:
    """Translation whose direction turns from corner to corner (degrees), v_s > 0."""
    beta = np.concatenate(
        [
            np.linspace(a, b, max(int(abs(b - a)), 2))[:-1]
            for a, b in itertools.pairwise(corners)
        ]
        + [np.array(corners[-1:])]
    )
    v = speed * np.exp(1j * beta * DEGREE)
    twists = np.stack([v.real, v.imag, 0 * beta], axis=-1)
    return Trajectory.from_twists(np.arange(len(beta)) * 0.1, twists)


def own(space: PermissibleSpace, *beta: float) -> Trajectory:
    """The same in the vehicle's own parameters: the representation is given."""
    assert space.vehicle is not None
    n = len(beta)
    return Trajectory.from_omni_curve(
        np.arange(n) * 100.0,
        np.zeros(n),
        np.array(beta) * DEGREE,
        np.full(n, 0.5),
        space.vehicle,
    )


def limits(report: Report) -> set[str]:
    return {violation.limit for violation in report.violations}


def first(report: Report) -> Violation:
    violation = report.headline
    assert violation is not None
    return violation


@pytest.mark.parametrize("direction", [1, -1])
def test_a_given_representation_winds_up_to_the_stop(direction: int) -> None:
    space = vehicle_space((-270, 270))
    # From β = 0 the wheels may start at 0 only: a full turn more is out of range.
    for end, valid in ((269.9, True), (269.999, True), (270.1, False), (360, False)):
        beta = [direction * end * f for f in (0, 0.25, 0.5, 0.75, 1)]
        report = validate(own(space, *beta), space)
        assert report.valid == valid
        if not valid:
            violation = first(report)
            assert limits(report) == {"STEER_RANGE"}
            assert {v.wheel for v in report.violations} == {"w0", "w1", "w2", "w3"}
            assert violation.value == pytest.approx(direction * end * DEGREE)
            assert violation.bound == pytest.approx(direction * 270 * DEGREE)
            assert violation.is_proved
            assert violation.t == pytest.approx(400)
            assert violation.t_start == pytest.approx(400 * 270 / end, abs=0.1)
            assert violation.excess == pytest.approx((end - 270) / 270, rel=1e-6)
            assert f"{direction * end:.1f}°" in str(violation)


@pytest.mark.parametrize(("start", "end"), [(100, 620), (100, 640), (-200, 320)])
def test_the_start_is_chosen_so_that_all_fits(start: float, end: float) -> None:
    # 540° of range hold any 520° that start in the right place, and 540.1 nowhere.
    space = vehicle_space((-270, 270))
    turns = [start + (end - start) * f for f in (0, 0.25, 0.5, 0.75, 1)]
    starts = [start + 360 * k for k in range(-3, 4)]
    fits = any(s >= -270 and s + end - start <= 270 for s in starts)
    assert validate(own(space, *turns), space).valid == fits


def test_margin_and_utilisation_are_those_of_the_followed_angle() -> None:
    space = vehicle_space((-270, 270))
    report = validate(own(space, 0, 90, 180, 216), space)
    assert report.valid
    assert report.margin == pytest.approx(1 - 216 / 270, abs=1e-6)
    assert report.tightest.startswith("STEER_RANGE")
    # 90° to 260° fits as such and, a turn back, as -270° to -100°: nearer to a stop.
    report = validate(own(space, 90, 180, 260), space)
    assert report.margin == pytest.approx(1 - 260 / 270, abs=1e-6)


def test_the_other_representation_may_fit_where_the_first_does_not() -> None:
    space = vehicle_space((-270, 270))
    # Forwards 0° to 360° fits nowhere, driven as v_s < 0 it is -180° to 180°.
    assert validate(crab(0, 360), space).valid
    assert validate(crab(0, 449), space).valid
    report = validate(crab(0, 451), space)
    assert limits(report) == {"STEER_RANGE"}
    # Without driving backwards that fast it does not.
    slow = vehicle_space((-270, 270), max_reverse_speed=0.1)
    assert not validate(crab(0, 360), slow).valid
    assert validate(crab(0, 269), slow).valid


def test_twice_around_a_wheel_next_to_the_centre_of_rotation() -> None:
    """The centre of rotation goes round a wheel, which turns with it, all else less."""

    # A single wheel at (0.5, 0); ω = 1: the twist v = -j ω p puts the centre on p.
    def circle(turns: float) -> Trajectory:
        angle = np.linspace(0, 2 * math.pi * turns, int(60 * turns) + 1)
        centre = 0.5 + 0.2 * np.exp(1j * angle)
        v = -1j * centre
        twists = np.stack([v.real, v.imag, np.ones_like(angle)], axis=-1)
        return Trajectory.from_twists(np.arange(angle.size) * 0.5, twists)

    space = vehicle_space((-270, 270), at=[(0.5, 0.0), (-0.5, 0.0)])
    # u = jω (w - p) = -0.2 j e^{j angle}: from -90° on, so 270° - -90° = 360°,
    # in the other representation from 90° - 360° = -270°: 540°.
    assert validate(circle(1.0), space).valid
    assert validate(circle(1.49), space).valid
    report = validate(circle(2.0), space)
    assert limits(report) == {"STEER_RANGE"}
    assert {v.wheel for v in report.violations} == {"w0"}
    assert validate(circle(2.0), vehicle_space((-451, 271), at=[(0.5, 0.0)])).valid
    assert not validate(circle(2.0), vehicle_space((-360, 361), at=[(0.5, 0.0)])).valid
    assert validate(circle(2.0), vehicle_space(None, at=[(0.5, 0.0)])).valid


def halves(dwell: float, *turns: float) -> Trajectory:
    """Crab circles, forwards, each of which starts where the last one ended at rest."""
    t, twists, now = [0.0], [(0.0, 0.0, 0.0)], 0.0
    for turn in turns:
        if len(t) > 1 and dwell:
            t.append(t[-1] + dwell)
            twists.append((0.0, 0.0, 0.0))
        steps = np.linspace(now, now + turn, 30)
        for beta in steps:
            v = 0.5 * complex(math.cos(beta * DEGREE), math.sin(beta * DEGREE))
            t.append(t[-1] + 1.0)
            twists.append((v.real, v.imag, 0.0))
        t.append(t[-1] + 1.0)
        twists.append((0.0, 0.0, 0.0))
        now += turn
    return Trajectory.from_twists(t, twists)


def test_wheels_unwind_at_a_standstill() -> None:
    # From -180° by 440° to 260° (v_s < 0); 440° more fit from -180° or, in the other
    # representation, from 0° only - 100° of them are beyond 270° otherwise.
    space = vehicle_space((-270, 270), 180)
    assert validate(halves(0, 440), space).valid
    for dwell, valid in ((0.5, False), (1.9, False), (2.1, True), (9.0, True)):
        report = validate(halves(dwell, 440, 360), space)
        assert report.valid == valid
        if not valid:
            (violation,) = report.violations
            assert violation.limit == "RECONFIGURATION"
            assert violation.value == pytest.approx(2.0, abs=0.02)
            assert violation.bound == pytest.approx(dwell, abs=0.01)
            assert violation.wheel in {"w0", "w1", "w2", "w3"}
            assert violation.is_proved
            assert "unwind" in str(violation)


def laps(count: float, rest: bool = False) -> Trajectory:
    """A vehicle that keeps its heading drives round a circle, by poses."""

    def arc(start: float, end: float) -> tuple[list[float], list[list[float]]]:
        steps = int(48 * (end - start)) + 1
        f = np.linspace(0, 1, steps)
        # From rest to rest where it stops, so that the splines keep close.
        f = f**3 * (10 - 15 * f + 6 * f**2) if rest else f
        angle = 2 * math.pi * (start + (end - start) * f)
        poses = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
        return np.linspace(0, 40 * (end - start), steps).tolist(), poses.tolist()

    t, poses = arc(0, 1 if rest else count)
    if rest:
        later, more = arc(1, 1 + count)
        t, poses = [*t, *(t[-1] + 0.5 + x for x in later)], [*poses, *more]
    return Trajectory.from_poses(t, poses)


def test_a_circle_driven_twice_with_a_constant_heading() -> None:
    # The direction of travel starts at 90°, so at -270° 550° are left; v_s < 0 starts
    # at -90° with 370° left.
    space = vehicle_space((-280, 280))
    assert validate(laps(1.0), space).valid
    assert validate(laps(1.52), space).valid
    report = validate(laps(2.0), space)
    assert limits(report) == {"STEER_RANGE"}
    # The stop is met after 550° of 720° at the latest.
    assert min(v.t_start for v in report.violations) <= 80 * 550 / 720 + 1
    assert validate(laps(2.0), vehicle_space((-455, 275))).valid
    assert not validate(laps(2.0), vehicle_space((-350, 375))).valid
    assert validate(laps(2.0), vehicle_space(None)).valid


def test_a_longer_dwell_that_lets_the_wheels_unwind_is_advised() -> None:
    # After one lap a full turn back, or half of one into the other representation.
    space = vehicle_space((-280, 280), 45)
    report = validate(laps(1.0, rest=True), space)
    assert limits(report) == {"RECONFIGURATION"}
    assert first(report).value == pytest.approx(4.0, rel=2e-2)
    advice = {advice.kind: advice.value for advice in report.advice}
    assert advice["dwell"] == pytest.approx(4.0, rel=2e-2)


def test_a_turn_at_rest_goes_round_by_the_way_that_is_free() -> None:
    # At 265° the quarter turn to 355° is barred: back by 270° to -5°, in 1.5 s.
    space = vehicle_space((-270, 270), 180, max_reverse_speed=0.1)
    for dwell, valid in ((1.2, False), (1.6, True)):
        trajectory = turned(dwell, 265, 90)
        report = validate(trajectory, space)
        assert report.valid == valid
        if not valid:
            (violation,) = report.violations
            assert violation.limit == "RECONFIGURATION"
            assert violation.value == pytest.approx(1.5, rel=2e-2)
    # Without the stop the quarter turn takes 0.5 s.
    assert validate(turned(0.6, 265, 90), vehicle_space(None, 180)).valid


def turned(dwell: float, first: float, at_rest: float) -> Trajectory:
    """Forwards; the direction turns under way and then at rest."""
    t, twists = [0.0], [(0.0, 0.0, 0.0)]
    for start, end in ((0.0, first), (first + at_rest, first + at_rest)):
        if len(t) > 1:
            t.append(t[-1] + dwell)
            twists.append((0.0, 0.0, 0.0))
        for beta in np.linspace(start, end, 30):
            v = 0.5 * complex(math.cos(beta * DEGREE), math.sin(beta * DEGREE))
            t.append(t[-1] + 1.0)
            twists.append((v.real, v.imag, 0.0))
        t.append(t[-1] + 1.0)
        twists.append((0.0, 0.0, 0.0))
    return Trajectory.from_twists(t, twists)


def test_wheels_without_a_steering_rate_unwind_in_no_time() -> None:
    space = vehicle_space((-270, 270))
    assert validate(halves(0, 440, 360), space).valid


def test_only_the_wheels_that_must_unwind_count() -> None:
    at = [(0.5, 0.0), (-0.5, 0.0)]
    data = vehicle_space((-270, 270), 90, at).vehicle
    assert data is not None
    plain = data.model_dump(mode="json")
    plain["wheels"][1]["steering_range_deg"] = None
    plain["wheels"][1]["max_steering_rate_deg"] = 20.0
    vehicle = vehicle_from_data(plain)
    space = configspace.build_space(vehicle, Grid(40, 72), cache=False)
    report = validate(halves(1.0, 440, 360), space)
    (violation,) = (v for v in report.violations if v.limit == "RECONFIGURATION")
    assert violation.wheel == "w0"
    assert violation.value == pytest.approx(4.0, abs=0.05)


def test_a_wheel_is_followed_through_a_pole_and_through_rest() -> None:
    """In the vehicle's own parameters nothing is cut, at v_n = 0 neither."""
    space = vehicle_space((-270, 270))
    assert space.vehicle is not None

    def judged(beta: list[float], v_n: list[float], kappa_n: list[float]) -> Report:
        trajectory = Trajectory.from_omni_curve(
            np.arange(len(beta)) * 100.0,
            kappa_n,
            np.array(beta) * DEGREE,
            v_n,
            space.vehicle,  # type: ignore[arg-type]
        )
        return validate(trajectory, space)

    beta = [0.0, 100.0, 200.0, 300.0]
    assert limits(judged(beta, [0.5] * 4, [0.0] * 4)) == {"STEER_RANGE"}
    # Backwards and through rest it is the same configuration, so it is followed on.
    assert limits(judged(beta, [0.5, 0.2, -0.2, -0.5], [0.0] * 4)) == {"STEER_RANGE"}
    assert judged([0.0, 100.0, 260.0], [0.5, -0.2, 0.5], [0.0] * 3).valid
    # Beyond |κ_n| = 1.25, where all centres of rotation are, β winds no wheel.
    turns = [0.0, 120.0, 240.0, 360.0, 480.0, 600.0, 720.0]
    assert judged(turns, [0.5] * 7, [1.8] * 7).valid
    # In through the pole at one β and out at another the wheel does not jump.
    assert judged([0.0, 0.0, 170.0, 170.0], [0.5] * 4, [1.8, 2.0, 2.0, 1.8]).valid


def test_a_data_sheet_alone_does_not_wind() -> None:
    space = vehicle_space((-270, 270))
    sheet = configspace.parse_space(configspace.dump_space(space))
    assert validate(crab(-150, 150), sheet).valid
    # Across the cut no table can tell the turns: refused, which is never wrong.
    assert not validate(crab(0, 360), sheet).valid


@pytest.mark.parametrize("beyond", [0.0, 1e-13])
def test_a_range_of_a_full_turn_is_no_range_to_wind_in(beyond: float) -> None:
    full = 180 * (1 + beyond)
    for own_end, valid in ((179.0, True), (181.0, False)):
        space = vehicle_space((-full, full))
        report = validate(own(space, 0, 90, own_end), space)
        assert report.valid == valid


def test_a_range_of_many_turns_is_judged_as_well() -> None:
    space = vehicle_space((-36000, 36000), 180)
    report = validate(crab(0, 1500), space)
    assert report.valid
    # By far most is left in the middle of the range: the stops are not what is near.
    assert not report.tightest.startswith("STEER_RANGE")


@pytest.mark.parametrize("free", [(-270, 150), (-150, 270)])
def test_a_direction_at_rest_does_not_wind_a_wheel(
    free: tuple[float, float],
) -> None:
    """Other limits are broken, so the parts beside rest are not cut for its sake."""
    ranges = [free, (100, 260), (-80, 80), (-80, 80)]
    wheels = [
        {"id": f"w{i}", "type": "steered", "x": x, "y": y, "max_speed": 2.0,
         "steering_range_deg": range_}
        for i, ((x, y), range_) in enumerate(zip(AREA, ranges, strict=True))
    ]  # fmt: skip
    rates = {"max_acceleration": 1.0, "max_deceleration": 1.0}
    vehicle = vehicle_from_data({"name": "stuck", "wheels": wheels, "limits": rates})
    space = configspace.build_space(vehicle, Grid(40, 72), cache=False)
    u = np.linspace(0, 1, 5)
    x = -u * u * (3 - 2 * u)
    t = np.concatenate([[0], 2 + 4 * u])
    poses = np.stack([np.concatenate([x[:1], x]), 0 * t, 0 * t], axis=-1)
    report = validate(Trajectory.from_poses(t, poses), space, allow_unreachable=True)
    # Backwards one wheel less is beyond its stops, the free one among those within.
    (violation,) = report.violations
    assert (violation.wheel, violation.limit) == ("w1", "STEER_RANGE")
    assert violation.is_proved
