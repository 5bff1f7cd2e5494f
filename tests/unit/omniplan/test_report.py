import json
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import configspace
from configspace import Grid, PermissibleSpace, vehicle_from_data
from omniplan import Ranking, Report, Trajectory, Violation, select, validate

SpaceOf = Callable[[str], PermissibleSpace]
NAMES = ("ackermann", "differential", "ift-four-steered", "mecanum")


def wheel(x: float, y: float) -> dict[str, Any]:
    return {
        "id": f"{x}/{y}", "type": "steered", "x": x, "y": y, "max_speed": 1.0,
        "steering_range_deg": (-155, 155), "max_steering_rate_deg": 180,
    }  # fmt: skip


@pytest.fixture(scope="module")
def spaces() -> tuple[PermissibleSpace, PermissibleSpace]:
    wheels = [wheel(x, y) for x in (0.4, -0.4) for y in (0.3, -0.3)]
    vehicle = vehicle_from_data({"name": "four", "wheels": wheels})
    known = configspace.build_space(vehicle, Grid(100, 180), cache=False)
    return known, configspace.parse_space(configspace.dump_space(known))


def trajectories() -> Iterator[Trajectory]:
    """Motions through and past the centre of a wheel, at rest, and far too fast."""
    # v = -ω x w at the wheel (0.4, 0.3) with ω = -0.5: (-0.15, 0.2).
    on, up, nothing = np.array([-0.15, 0.2, -0.5]), np.array([0, 0.05, 0]), np.zeros(3)
    pairs = [
        (on, on),
        (2 * on, on),
        (on - up, on + up),
        (on - 0.3 * up, on + up),
        (nothing, on),
        (nothing, nothing),
        (1e6 * on, -1e6 * on),
        (np.array([0.3, 0, 0]), np.array([0, 0.3, 0])),
    ]
    for beside in (1e-13, 1e-5, 0.05):
        aside = np.array([beside, 0, 0])
        pairs += [
            (on - up - aside, on + up - aside),
            (on - up - aside, on + up + aside),
        ]
    for first, last in pairs:
        yield Trajectory.from_twists([0.0, 1], [first, last], name="twists")
    yield Trajectory.from_twists([0, 1e-6], [[0.0, 0, 0], [1e6, 1e6, 1e6]], name="wild")
    yield Trajectory.from_poses(
        [0, 1, 1.1, 2], [[0.0, 0, 0], [1.0, 0, 0], [1.0, 0, 0], [1.0, 1, 0]]
    )
    yield Trajectory.from_poses([0, 1e-6, 1], [[0.0, 0, 0], [1e6, 0, 0], [-1e6, 0, 1]])


def reports(spaces: tuple[PermissibleSpace, ...]) -> Iterator[Report]:
    for trajectory in trajectories():
        for space in spaces:
            yield validate(trajectory, space)


def test_every_report_travels_as_strict_json(
    spaces: tuple[PermissibleSpace, PermissibleSpace],
) -> None:
    verdicts = []
    for report in reports(spaces):
        text = json.dumps(report.to_dict(), allow_nan=False)
        assert Report.from_dict(json.loads(text)) == report
        verdicts.append(report.valid)
    assert True in verdicts
    assert False in verdicts


def test_an_invalid_report_has_violations_and_a_valid_one_none(
    spaces: tuple[PermissibleSpace, PermissibleSpace],
) -> None:
    for report in reports(spaces):
        assert report.valid == (not report.violations)
        assert report.valid == (report.headline is None)
        assert math.isfinite(report.margin)
        assert math.isfinite(report.speed_factor)
        assert report.valid or report.margin <= 0 or report.speed_factor == 0
        for violation in report.violations:
            assert violation.t_start <= violation.t <= violation.t_end


@pytest.mark.parametrize("data", [None, {}, [], {"vehicle": "a"}, "report"])
def test_what_is_no_report_is_refused(data: Any) -> None:
    with pytest.raises(ValueError, match="validation error"):
        Report.from_dict(data)
    with pytest.raises(ValueError, match="validation error"):
        Ranking.from_dict(data)


def test_a_ranking_travels_as_strict_json(space_of: SpaceOf) -> None:
    fleet = [space_of(name) for name in NAMES]
    aside = Trajectory.from_twists([0, 1], [[0, 0.3, 0]] * 2)
    (ranking,) = select(aside, fleet)
    text = json.dumps(ranking.to_dict(), allow_nan=False)
    assert Ranking.from_dict(json.loads(text)) == ranking


def violation(limit: str, value: float | None, bound: float, proved: bool) -> Violation:
    return Violation(
        limit, None, value, bound, "m/s", 0, 0.0, 0.0, 1.0, 0.0, 0.0, None, proved
    )


def test_the_headline_is_proved_at_a_sample_of_the_shape_the_largest() -> None:
    report = validate(
        Trajectory.from_twists([0, 1], [[0.1, 0, 0]] * 2),
        configspace.build_space(
            configspace.load_vehicle("mecanum"), Grid(40, 72), cache=False
        ),
    )
    speed, faster = violation("SPEED", 2, 1, True), violation("SPEED", 3, 1, True)
    shape = violation("STEER_RANGE", 2, 1, True)
    maybe = violation("SINGULAR", 0, 0, False)
    between = replace(shape, excess_at_samples=0.0)
    for chosen, given in (
        (speed, (between, speed)),
        (between, (maybe, between)),
        (faster, (speed, faster)),
        (shape, (faster, shape)),
        (speed, (maybe, speed)),
        (maybe, (maybe,)),
    ):
        assert replace(report, valid=False, violations=given).headline == chosen


def test_what_is_broken_between_samples_only_is_told_where_halving_finds_it() -> None:
    """Poses 2 s apart: what is too fast between them is found in their middle."""
    space = configspace.build_space(
        configspace.load_vehicle("mecanum"), Grid(40, 72), cache=False
    )
    still = np.zeros(3)
    for far, at_samples in ((3.0, False), (8.0, False), (3.0, True)):
        aside = np.array([far, 0.1 * far, 0.2])
        poses, t = [still, still, aside, aside], np.array([0.0, 1.0, 3.0, 4.0])
        if at_samples:
            poses.insert(2, aside / 2)
            t = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
        report = validate(Trajectory.from_poses(t, poses), space)
        told = report.headline
        assert told is not None
        # All wheels of a side are alike in neither motion; the worst one is told.
        worst = max((v for v in report.violations), key=lambda v: v.excess)
        assert (told.limit, told.wheel) == (worst.limit, worst.wheel)
        assert told.excess_at_samples == pytest.approx(worst.excess, rel=1e-2)


def test_excess_is_how_far_beyond_the_bound_on_its_own_scale() -> None:
    assert violation("SPEED", 3, 2, True).excess == 0.5
    assert violation("SPEED", 1.9, 2, True).excess == 0
    assert violation("SINGULAR", 0, 0, True).excess == math.inf
    assert violation("RECONFIGURATION", None, 1, False).excess == math.inf
    assert violation("UNREACHABLE", None, 0, True).excess == math.inf


@pytest.mark.parametrize(
    ("value", "bound", "half", "excess"),
    [
        (-3, -2, 2, 0.5),
        (3, 2, 2, 0.5),
        (-0.5, 0, 1, 0.5),  # range [0, 2]: the bound itself is no scale
        (0.5, 1, 1, 0.5),  # range [1, 3]: below a positive stop
        (-0.5, -1, 1, 0.5),  # range [-3, -1]
    ],
)
def test_a_steering_angle_is_beyond_its_stop_by_a_share_of_half_the_range(
    value: float, bound: float, half: float, excess: float
) -> None:
    angle = replace(violation("STEER_RANGE", value, bound, True), scale=half)
    assert angle.excess == excess
    assert replace(angle, is_proved=False).excess == 0
