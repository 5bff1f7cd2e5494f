import math
import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import configspace
from configspace import Grid, PermissibleSpace, Reason, vehicle_from_data
from omniplan import Trajectory, Violation, select, validate
from omniplan.wording import describe, quantity, ranking_lines, refusal, report_lines

SpaceOf = Callable[[str], PermissibleSpace]
NAMES = ("ackermann", "differential", "ift-four-steered", "mecanum")

UNITS = {
    "STEER_RANGE": "rad", "SINGULAR": "m/s", "WHEEL_SPEED": "m/s", "SPEED": "m/s",
    "REVERSE_SPEED": "m/s", "YAW_RATE": "rad/s", "LATERAL_ACCELERATION": "m/s²",
    "FIXED_WHEEL": "rad", "STEER_RATE": "rad/s", "WHEEL_ACCELERATION": "m/s²",
    "ACCELERATION": "m/s²", "DECELERATION": "m/s²", "RECONFIGURATION": "s",
    "STEER_ACCELERATION": "rad/s²", "V_MAX": "1",
}  # fmt: skip
"""Every limit that a verdict names, with its unit."""


def violation(
    limit: str,
    value: float | None = 2.0,
    bound: float = 1.0,
    *,
    is_proved: bool = True,
    pose: tuple[float, float, float] | None = None,
) -> Violation:
    return Violation(
        limit=limit,
        wheel="front-left",
        value=value,
        bound=bound,
        unit=UNITS[limit],
        index=3,
        t=1.5,
        t_start=1.0,
        t_end=2.0,
        kappa_n=0.25,
        beta=math.pi / 6,
        pose=pose,
        is_proved=is_proved,
    )


def assert_readable(line: str) -> None:
    assert not re.search(r"\b(inf|nan|None)\b", line), line


@pytest.mark.parametrize("limit", sorted(UNITS))
@pytest.mark.parametrize("is_proved", [True, False])
def test_every_limit_has_words(limit: str, is_proved: bool) -> None:
    text = describe(violation(limit, is_proved=is_proved))
    assert text.startswith("wheel front-left: ")
    assert text.endswith(f"[{limit}]")
    before = text.removesuffix(f"[{limit}]")
    assert limit not in before
    assert "t = 1.50 s (1.00 to 2.00 s), row 3" in before
    assert "κ_n = +0.250, β = +30.0°" in before
    assert_readable(text)


def test_every_reason_of_a_judged_space_has_words() -> None:
    judged = ("STEER_RANGE", "SINGULAR", "WHEEL_SPEED", "SPEED", "YAW_RATE")
    for reason in Reason:
        if reason.name in (*judged, "LATERAL_ACCELERATION", "FIXED_WHEEL"):
            assert reason.name in UNITS


def test_angles_are_in_degrees_and_numbers_have_units() -> None:
    assert quantity(math.pi, "rad") == "180.0°"
    assert quantity(math.pi / 2, "rad/s") == "90.0°/s"
    assert quantity(1.2345, "m/s²") == "1.234 m/s²"
    assert quantity(0.5, "1") == "0.500"


def test_the_pose_is_named_where_there_is_one() -> None:
    text = describe(violation("SPEED", pose=(1.0, -2.0, math.pi / 2)))
    assert "at x = 1.00 m, y = -2.00 m, θ = 90°" in text


def test_what_is_not_proved_is_said_so() -> None:
    assert "cannot be excluded" in describe(violation("SPEED", is_proved=False))
    assert "cannot be excluded" not in describe(violation("SPEED"))


def test_a_standstill_says_what_is_needed_and_what_there_is() -> None:
    text = describe(violation("RECONFIGURATION", 0.5, 0.3))
    assert "need 0.50 s" in text
    assert "there are 0.30 s" in text
    assert "no way" in describe(
        violation("RECONFIGURATION", None, 0.3, is_proved=False)
    )


@pytest.mark.parametrize(
    ("value", "bound", "is_proved", "words"),
    [
        (50, 40, True, "at most 40.0° permitted"),
        (-50, -40, True, "at least -40.0° permitted"),
        (-10, 0, True, "at least 0.0° permitted"),  # range [0, 90]
        (10, 0, True, "at most 0.0° permitted"),  # range [-90, 0]
        (60, 80, True, "at least 80.0° permitted"),  # range [80, 280]
        (-60, -80, True, "at most -80.0° permitted"),  # range [-280, -80]
        (179.9, 180, False, "at most 180.0° permitted"),
        (-179.9, -180, False, "at least -180.0° permitted"),
    ],
)
def test_a_steering_angle_is_held_against_the_stop_it_passes(
    value: float, bound: float, is_proved: bool, words: str
) -> None:
    text = describe(
        violation(
            "STEER_RANGE", math.radians(value), math.radians(bound), is_proved=is_proved
        )
    )
    assert words in text


def test_a_place_that_no_way_leads_to_needs_no_numbers() -> None:
    text = describe(replace(violation("SPEED", None, 0.0), limit="UNREACHABLE"))
    assert "permitted, but no way inside the space leads there" in text
    assert text.endswith("β = +30.0° [UNREACHABLE]")
    assert_readable(text)


def one_sided() -> PermissibleSpace:
    axle = [
        {"id": f"f{y}", "type": "fixed", "x": 0.0, "y": y, "max_speed": 1.0}
        for y in (0.2, -0.2)
    ]
    front = {"id": "front", "type": "steered", "x": 1.0, "y": 0.0}
    vehicle = vehicle_from_data(
        {"name": "one", "wheels": [*axle, {**front, "steering_range_deg": (0, 60)}]}
    )
    return configspace.build_space(vehicle, Grid(40, 72), cache=False)


def test_a_wheel_that_steers_to_one_side_only() -> None:
    right = Trajectory.from_twists([0, 1], [[0.4, 0, -0.1]] * 2)
    text = refusal(validate(right, one_sided()))
    assert "steering angle -14.0°, at least 0.0° permitted" in text
    assert str(validate(right, one_sided()).headline) in text


def test_reports_and_rankings_are_readable(space_of: SpaceOf) -> None:
    fleet = [space_of(name) for name in NAMES]
    fleet += [
        configspace.parse_space(configspace.dump_space(space_of("ift-four-steered")))
    ]
    singular = np.array([0.115 * 0.5, -0.215 * 0.5, 0.5])
    for trajectory in (
        Trajectory.from_twists([0, 1], [[0.3, 0, 0]] * 2, name="ahead"),
        Trajectory.from_twists([0, 1], [[0, 0, 0]] * 2, name="still"),
        Trajectory.from_twists([0, 1], [singular] * 2, name="singular"),
        Trajectory.from_twists([0.0, 1], [singular * 0.9, singular * 1.1], name="near"),
        Trajectory.from_twists([0.0, 1], [[9.0, 0, 0], [0.0, 9, 9]], name="wild"),
        Trajectory.from_poses(
            [0.0, 1, 2], [[0.0, 0, 0], [0.5, 0, 0], [0.5, 0.5, 0]], name="corner"
        ),
    ):
        for space in fleet:
            report = validate(trajectory, space)
            lines = list(report_lines(report))
            verdict = "permitted" if report.valid else "not permitted"
            assert lines[0] == f"{trajectory.name} by {space.name}: {verdict}"
            for line in lines:
                assert_readable(line)
            if not report.valid:
                assert_readable(refusal(report))
        (ranking,) = select(trajectory, fleet[:4])
        for line in ranking_lines(ranking):
            assert_readable(line)


def test_more_than_one_violation_is_counted(space_of: SpaceOf) -> None:
    fast = Trajectory.from_twists([0, 1], [[3.0, 0, 0]] * 2)
    report = validate(fast, space_of("differential"))
    assert len(report.violations) == 2
    assert refusal(report).endswith("and 1 more")
    assert list(report_lines(report))[1].endswith("and 1 more of this kind")


def test_rounded_zeros_have_no_minus() -> None:
    space = configspace.build_space(configspace.load_vehicle("differential"))
    poses = [[0.0, 0.0, 0.0], [3.0, -1e-6, -1e-6]]
    line = Trajectory.from_poses([0.0, 1.0], poses)
    report = validate(line, space)
    text = "\n".join(report_lines(report))
    assert "y = 0.00 m, θ = 0°" in text
    assert not re.search(r"-0(\.0+)?[^.0-9]", text)
