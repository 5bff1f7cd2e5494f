import math
from collections.abc import Callable

import numpy as np
import pytest

import configspace
from configspace import Grid, PermissibleSpace, vehicle_from_data
from omniplan import Report, Tolerances, Trajectory, validate
from omniplan.judging.judge import judge_for
from omniplan.judging.proof import Proof
from omniplan.motion import motion_of
from omniplan.standing.standstill import Choice, choose_configurations

SpaceOf = Callable[[str], PermissibleSpace]


def rectangle(
    steering_range: tuple[float, float] | None, rate: float | None = None
) -> PermissibleSpace:
    """A four-wheel vehicle, 0.8 m by 0.6 m, whose wheels are all alike."""
    wheels = [
        {
            "id": f"{'front' if x > 0 else 'rear'}-{'left' if y > 0 else 'right'}",
            "type": "steered",
            "x": x,
            "y": y,
            "max_speed": 1.0,
            "steering_range_deg": steering_range,
            "max_steering_rate_deg": rate,
        }
        for x in (0.4, -0.4)
        for y in (0.3, -0.3)
    ]
    vehicle = vehicle_from_data({"name": "rectangle", "wheels": wheels})
    return configspace.build_space(vehicle, Grid(100, 180), cache=False)


def legs(
    *directions: complex, dwell: float = 0.0, speed: float = 0.5, turn: float = 0.0
) -> Trajectory:
    """Twists that drive one direction after the other, each from rest to rest."""
    t, twists = [0.0], [(0.0, 0.0, 0.0)]
    for direction in directions:
        if len(t) > 1 and dwell > 0:
            t.append(t[-1] + dwell)
            twists.append((0.0, 0.0, 0.0))
        v = speed * direction
        for size in (1.0, 1.0, 0.0):
            t.append(t[-1] + 1.0)
            twists.append((size * v.real, size * v.imag, size * turn))
    return Trajectory.from_twists(t, twists)


def chosen(trajectory: Trajectory, space: PermissibleSpace) -> Choice:
    motion = motion_of(trajectory, is_own=False)
    judge = judge_for(space, motion, Tolerances())
    proof = Proof(motion, judge, Tolerances())
    proof.decide()
    return choose_configurations(proof, judge, space, Tolerances())


def limits(report: Report) -> set[str]:
    return {violation.limit for violation in report.violations}


def test_a_quarter_turn_at_180_degrees_per_second_takes_half_a_second() -> None:
    space = rectangle((-155, 155), 180)
    for dwell, valid in ((0.4, False), (0.48, False), (0.52, True), (0.6, True)):
        report = validate(legs(1, 1j, dwell=dwell), space)
        assert report.valid == valid
        if not valid:
            (violation,) = report.violations
            assert violation.limit == "RECONFIGURATION"
            assert violation.value == pytest.approx(0.5, rel=1e-2)
            assert violation.bound == pytest.approx(dwell, abs=0.01)
            assert violation.unit == "s"
            assert violation.t == pytest.approx(3 + dwell / 2, abs=0.01)
            assert violation.is_proved


def test_the_paper_vehicle_needs_a_quarter_second_more_to_swing(
    space_of: SpaceOf,
) -> None:
    f = np.linspace(0, 1, 41)
    smooth = f**3 * (10 - 15 * f + 6 * f**2)
    zero = 0 * f
    there = np.stack([smooth, zero, zero], axis=-1)
    aside = np.stack([1 + zero, 0.8 * smooth, zero], axis=-1)
    for dwell, valid in ((0.3, False), (0.6, False), (0.8, True)):  # 180°/s, 720°/s²
        t = np.concatenate([3 * f, 3 + dwell + 3 * f])
        trajectory = Trajectory.from_poses(t, np.concatenate([there, aside]))
        report = validate(trajectory, space_of("ift-four-steered"))
        assert report.valid == valid


def test_a_corner_without_a_dwell_is_refused() -> None:
    report = validate(legs(1, 1j), rectangle((-155, 155), 180))
    assert not report.valid


def test_a_mecanum_vehicle_turns_no_wheels(space_of: SpaceOf) -> None:
    assert validate(legs(1, 1j, speed=0.3), space_of("mecanum")).valid


@pytest.mark.parametrize("way", [1, -1])
def test_of_two_refused_representations_the_one_that_breaks_less_is_named(
    way: int,
) -> None:
    # Straight ahead breaks the range of one wheel, half a turn on those of two.
    ranges = {"one": (100.0, 220.0), "two": (-20.0, 20.0), "three": (-30.0, 10.0)}
    wheels = [
        {"id": name, "type": "steered", "x": x, "y": 0.2, "max_speed": 1.0,
         "steering_range_deg": ranges[name]}
        for x, name in enumerate(ranges)
    ]  # fmt: skip
    vehicle = vehicle_from_data({"name": "three", "wheels": wheels})
    space = configspace.build_space(vehicle, Grid(40, 72), cache=False)
    report = validate(legs(way + 0j), space)
    assert {(v.limit, v.wheel) for v in report.violations} == {("STEER_RANGE", "one")}


def test_a_cusp_keeps_the_configuration() -> None:
    for steering_range in ((-155.0, 155.0), None):
        space = rectangle(steering_range, 180)
        choice = chosen(legs(1, -1), space)
        assert choice.signs == (1, -1)
        assert choice.standstills[0].change.time == 0
        assert validate(legs(1, -1), space).valid


def test_driving_backwards_straight_is_a_negative_v_s() -> None:
    space = rectangle((-155, 155))
    report = validate(legs(-1), space)
    assert report.valid
    assert chosen(legs(-1), space).signs == (-1,)
    # The same motion with every wheel turned by half a turn is out of range.
    assert not space.contains(0.0, math.pi, 0.5)
    assert space.contains(0.0, 0.0, -0.5)
    assert space.vehicle is not None
    own = Trajectory.from_omni_curve(
        [0, 1], [0, 0], [math.pi, math.pi], [0.5, 0.5], space.vehicle
    )
    assert limits(validate(own, space)) == {"STEER_RANGE"}
    back = Trajectory.from_omni_curve(
        [0, 1], [0, 0], [0, 0], [-0.5, -0.5], space.vehicle
    )
    assert validate(back, space).valid


def test_a_sheet_alone_knows_both_representations_as_well() -> None:
    space = rectangle((-155, 155))
    sheet = configspace.parse_space(configspace.dump_space(space))
    assert validate(legs(-1), sheet).valid
    assert validate(legs(1, -1), sheet).valid


@pytest.mark.parametrize("dwell", [0.0, 5.0])
@pytest.mark.parametrize("angle", [0.0, 0.7, 1.3, 2.0, 2.9])
def test_directions_out_of_range_are_out_of_reach(angle: float, dwell: float) -> None:
    # With ±60° (1.05 rad) the wheels reach 0.7 and, driven backwards, 2.9 = π - 0.24.
    space = rectangle((-60, 60))
    direction = complex(math.cos(angle), math.sin(angle))
    report = validate(legs(1, direction, dwell=dwell), space)
    assert report.valid == (angle in {0.0, 0.7, 2.9})


def islands() -> PermissibleSpace:
    """Two wheels at the same y, so that both move ahead or both move back.

    Wheel a cannot point back, so wheel b never passes 180°: it stands at 80° to 90° or
    at 270° to 280°, and no way joins the two.
    """
    wheels = [
        {"id": "a", "type": "steered", "x": 0.4, "y": -0.05, "max_speed": 1.0,
         "steering_range_deg": (-80, 90), "max_steering_rate_deg": 90},
        {"id": "b", "type": "steered", "x": -0.4, "y": -0.05, "max_speed": 1.0,
         "steering_range_deg": (80, 280), "max_steering_rate_deg": 90},
    ]  # fmt: skip
    vehicle = vehicle_from_data({"name": "islands", "wheels": wheels})
    return configspace.build_space(vehicle, Grid(100, 180), cache=False)


def test_configurations_that_no_way_joins_are_not_joined() -> None:
    space = islands()
    angle = math.radians(85)
    aside = [0.3 * math.cos(angle), 0.3 * math.sin(angle), 0.0]
    rest, spin = [0.0, 0.0, 0.0], [0.0, 0.0, 0.5]
    for alone in (aside, spin):
        trajectory = Trajectory.from_twists([0, 1, 2], [rest, alone, rest])
        assert validate(trajectory, space).valid
    report = validate(
        Trajectory.from_twists(
            [0, 1, 2, 12, 13, 14], [rest, aside, rest, rest, spin, rest]
        ),
        space,
    )
    (violation,) = report.violations
    assert violation.limit == "RECONFIGURATION"
    assert violation.wheel == "b"
    assert violation.value is None
    assert not violation.is_proved
    assert report.speed_factor == 0
    assert report.advice == ()


def test_wheels_of_too_large_a_turn_wait_longer() -> None:
    space = rectangle((-155, 155), 90)
    for angle, needed in ((30, 1 / 3), (60, 2 / 3), (90, 1.0)):
        direction = complex(
            math.cos(math.radians(angle)), math.sin(math.radians(angle))
        )
        choice = chosen(legs(1, direction, dwell=5.0), space)
        assert choice.signs == (1, 1)
        assert choice.standstills[0].change.time == pytest.approx(needed, rel=1e-2)
        assert choice.standstills[0].change.turn == pytest.approx(math.radians(angle))


def test_the_shorter_of_two_representations_is_driven() -> None:
    # From 0° to 120° is further than from 0° to -60°, driven backwards.
    direction = complex(math.cos(2 * math.pi / 3), math.sin(2 * math.pi / 3))
    choice = chosen(legs(1, direction, dwell=5.0), rectangle((-155, 155), 90))
    assert choice.signs == (1, -1)
    assert choice.standstills[0].change.time == pytest.approx(2 / 3, rel=1e-2)


def test_within_the_alignment_nothing_turns() -> None:
    angle = math.radians(0.9)
    direction = complex(math.cos(angle), math.sin(angle))
    space = rectangle((-155, 155), 180)
    assert chosen(legs(1, direction), space).standstills[0].change.time == 0
    assert validate(legs(1, direction), space).valid


@pytest.mark.parametrize("flip", [1, -1])
def test_a_stop_reached_exactly_keeps_the_configuration_before_it(flip: int) -> None:
    """Found by a mirrored trajectory: rounding made the last part miss the zero, and
    the wheels seemed to stand straight ahead, where this vehicle's cannot."""
    wheels = [
        {"id": "w", "type": "steered", "x": -0.26, "y": -0.517 * flip, "max_speed": 1.0,
         "steering_range_deg": sorted([159.0 * flip, 250.0 * flip])},
    ]  # fmt: skip
    data = {"name": "one", "wheels": wheels, "limits": {"max_yaw_rate_deg": 90.0}}
    space = configspace.build_space(vehicle_from_data(data), Grid(40, 72), cache=False)
    rng = np.random.default_rng(1)
    for _ in range(40):
        size = rng.uniform(0.05, 1.0)
        twist = size * np.array([-0.0092, -0.2218 * flip, -0.18 * flip])
        samples = [twist, 0 * twist, 1.3 * twist]
        trajectory = Trajectory.from_twists([0, 1.049, 2.407], samples)
        assert validate(trajectory, space).valid


def test_a_refused_part_that_begins_at_rest_tells_where_its_wheels_stand() -> None:
    """It is not cut any further, and at rest itself the twist has no direction."""
    space = rectangle((-60, 60), 180)
    direction = complex(math.cos(1.75), math.sin(1.75))
    report = validate(legs(1, direction, dwell=0.0), space)
    assert limits(report) == {"STEER_RANGE", "RECONFIGURATION"}
    (stop,) = chosen(legs(1, direction), space).standstills
    assert abs(stop.change.goal[1]) == pytest.approx(1.75, abs=1e-3)


def test_a_motion_that_never_moves_is_valid(space_of: SpaceOf) -> None:
    still = Trajectory.from_poses([0, 1, 2], np.ones((3, 3)))
    for name in ("ackermann", "differential", "ift-four-steered", "mecanum"):
        assert validate(still, space_of(name)).valid


def test_at_rest_the_wheels_may_stand_anyhow() -> None:
    # Below the standstill speed the direction turns once around.
    angle = np.linspace(0, 2 * np.pi, 9)
    creep = 5e-4 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    trajectory = Trajectory.from_twists(np.arange(9.0), creep)
    assert validate(trajectory, rectangle((-60, 60), 10)).valid


@pytest.mark.parametrize("off", [0.0, 1e-15, 1e-14, 1e-13, 1e-12, 1e-11])
@pytest.mark.parametrize("side", [1, -1])
def test_a_wheel_of_one_full_turn_does_not_jump_from_stop_to_stop(
    off: float, side: int
) -> None:
    """A sample that rounding puts just beyond a stop seems to be at the other one."""
    space = rectangle((-180, 180))
    seam = np.array([0.5, 1.5, 2.5, np.pi, 4, 5, 6, 2 * np.pi, 7])
    seam[[3, 7]] += side * off
    samples = 0.5 * np.stack([np.cos(seam), np.sin(seam), 0 * seam], axis=-1)
    for direction in (1, -1):
        twists = samples * [1, direction, direction]
        trajectory = Trajectory.from_twists(np.arange(9) * 10.0, twists)
        report = validate(trajectory, space)
        assert limits(report) == {"STEER_RANGE"}
    # Nine tenths of the turn are within.
    assert validate(
        Trajectory.from_twists(np.arange(3) * 10.0, samples[:3]), space
    ).valid


def test_a_wheel_that_turns_freely_goes_round_and_round() -> None:
    angle = np.linspace(0, 4 * np.pi, 33)
    samples = 0.5 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    trajectory = Trajectory.from_twists(np.arange(33) * 1.0, samples)
    assert validate(trajectory, rectangle(None)).valid
    assert not validate(trajectory, rectangle((-155, 155))).valid
