"""Halving the parts of a motion until every limit is decided."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

import configspace
from omniplan import Trajectory, validate
from omniplan.judging import proof
from omniplan.judging.rows import Bounds
from omniplan.judging.vehicle_judge import VehicleJudge
from omniplan.motion import Enclosure, motion_of
from omniplan.proving import prove


@pytest.fixture(scope="module")
def space() -> configspace.PermissibleSpace:
    """Four wheels of ±100°, so that most motions fit one representation only."""
    wheels = [
        {
            "id": f"w{i}",
            "type": "steered",
            "x": x,
            "y": y,
            "max_speed": 5.0,
            "steering_range_deg": [-100, 100],
        }
        for i, (x, y) in enumerate([(0.5, 0.3), (-0.5, 0.3), (-0.5, -0.3), (0.5, -0.3)])
    ]
    vehicle = configspace.vehicle_from_data(
        {"name": "limited", "wheels": wheels, "limits": {"max_speed": 1.0}}
    )
    return configspace.build_space(vehicle, cache=False)


def backwards(seed: int) -> Trajectory:
    rng = np.random.default_rng(seed)
    heading = np.cumsum(rng.normal(0, 0.4, 6))
    course = heading + np.cumsum(rng.normal(0, 0.4, 6))
    steps = -0.6 * np.stack([np.cos(course), np.sin(course)], axis=1)
    poses = np.concatenate([np.cumsum(steps, axis=0), heading[:, None]], axis=1)
    return Trajectory.from_poses(np.linspace(0, 4, 6), poses)


@pytest.mark.parametrize("seed", [12, 15, 22, 39, 42, 50, 56])
def test_too_fast_hides_nothing_of_the_configuration(
    space: configspace.PermissibleSpace, seed: int
) -> None:
    """What is only too fast is not also reported as out of a steering range."""
    trajectory = backwards(seed)
    factor = validate(trajectory, space).speed_factor
    assert factor > 1
    report = validate(trajectory.scaled(1.02 * factor), space)
    assert {v.limit for v in report.violations} == {"SPEED"}
    assert report.speed_factor == pytest.approx(1 / 1.02, rel=2e-3)


def steered_so_far(to: float) -> configspace.PermissibleSpace:
    """The four-wheel vehicle whose first wheel turns to one side only."""
    data = configspace.load_vehicle("ift-four-steered").model_dump(
        mode="json", exclude_none=True
    )
    data["wheels"][0]["steering_range_deg"] = [-155.0, to]
    return configspace.build_space(
        configspace.vehicle_from_data(data), configspace.Grid(20, 36), cache=False
    )


def turning_about(space: configspace.PermissibleSpace, share: float) -> Trajectory:
    """Every wheel turns at a share of its largest steering rate, in and out again."""
    beta = np.radians([0.0, -90.0, -45.0, 0.0])
    t = np.array([0.0, 0.5, 0.75, 1.0]) / share
    assert space.vehicle is not None
    return Trajectory.from_omni_curve(t, [0.0] * 4, beta, [0.5] * 4, space.vehicle)


@pytest.mark.parametrize("share", [1.0, 1 - 1e-9, 1 - 1e-6, 1 + 1e-9])
def test_at_a_limit_all_along_few_parts_are_needed(share: float) -> None:
    space = steered_so_far(0.0)
    assert prove(turning_about(space, share), space).parts.stands.size < 5000


def test_a_wheel_may_leave_and_reach_its_very_stop() -> None:
    space = steered_so_far(0.0)
    assert validate(turning_about(space, 0.9), space).valid
    beyond = steered_so_far(-1e-6)
    report = validate(turning_about(beyond, 0.9), beyond)
    assert {(v.limit, v.wheel) for v in report.violations} == {
        ("STEER_RANGE", "front-left")
    }
    assert {v.t for v in report.violations} == {0.0, 1 / 0.9}


def front_steered(stop: float) -> configspace.PermissibleSpace:
    """The tricycle whose front wheel turns by so many degrees to either side."""
    data = configspace.load_vehicle("tricycle").model_dump(
        mode="json", exclude_none=True
    )
    data["wheels"][0]["steering_range_deg"] = [-stop, stop]
    return configspace.build_space(
        configspace.vehicle_from_data(data), configspace.Grid(20, 36), cache=False
    )


def on_the_spot(turn: float, drift: float = 0.0) -> Trajectory:
    """Turning by an angle in 4 s, K `drift` metres ahead of where it turns about."""
    u = np.linspace(0, 1, 21)
    heading = 0.3 + turn * u * u * (3 - 2 * u)
    at = 1.2345 - 3.21j + drift * np.exp(1j * heading)
    return Trajectory.from_poses(4 * u, np.column_stack([at.real, at.imag, heading]))


@pytest.mark.parametrize("turn", [1.0, -1.0, 0.01])
def test_a_wheel_may_turn_the_vehicle_on_the_spot_at_its_very_stop(
    turn: float,
) -> None:
    assert validate(on_the_spot(turn), front_steered(90.0)).valid
    assert validate(on_the_spot(turn), front_steered(90.0 + 1e-6)).valid
    report = validate(on_the_spot(turn), front_steered(90.0 - 1e-6))
    assert {v.limit for v in report.violations} == {"STEER_RANGE"}
    assert all(v.is_proved for v in report.violations)


@pytest.mark.parametrize("drift", [1e-6, -1e-6])
@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_nearly_on_the_spot_a_wheel_at_its_stop_is_beyond_it(
    turn: float, drift: float
) -> None:
    """A spline is no circle: now and then K moves a little ahead or back."""
    report = validate(on_the_spot(turn, drift), front_steered(90.0))
    assert {v.limit for v in report.violations} == {"STEER_RANGE"}
    nearly = on_the_spot(turn, drift)
    assert validate(nearly, front_steered(90.1)).valid


def test_what_is_decided_is_not_judged_again(monkeypatch: pytest.MonkeyPatch) -> None:
    space = steered_so_far(155.0)
    trajectory = turning_about(space, 0.999)
    seen = []
    ask = VehicleJudge.utilisations

    def counted(
        self: VehicleJudge, part: Enclosure, signs: Sequence[int]
    ) -> dict[int, Bounds]:
        seen.append(part.dt.size)
        return ask(self, part, signs)

    monkeypatch.setattr(VehicleJudge, "utilisations", counted)
    parts = prove(trajectory, space).parts
    # Each part and each of those it comes from, once; a few more were judged ahead.
    assert sum(seen) <= 4 * parts.stands.size


def test_what_its_own_vehicle_cannot_drive_is_a_standstill() -> None:
    """Where it is blocked v_max is 0: v_n is a share of nothing, for any vehicle."""
    owner, other = steered_so_far(0.0).vehicle, steered_so_far(155.0)
    assert owner is not None
    t, kappa_n = [0.0, 0.5, 1.5, 2.0], [0.2, 0.2, 0.1, 0.1]
    own = Trajectory.from_omni_curve(t, kappa_n, [0.1, 0.2, 0.2, 0.1], [0.3] * 4, owner)
    assert prove(own, other).parts.stands.all()
    assert prove(own, other).parts.stands.size < 20
    assert validate(own, other).valid


def test_long_motions_are_halved_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
    """How many parts there may be counts from those of the samples."""
    monkeypatch.setattr(proof, "MAX_PARTS", 40)
    space = steered_so_far(155.0)
    assert space.vehicle is not None
    t = np.linspace(0.0, 40.0, 81)
    beta = 0.3 * np.sin(t)
    ones = np.ones_like(t)
    own = Trajectory.from_omni_curve(t, 0.3 * ones, beta, 0.5 * ones, space.vehicle)
    quick = own.scaled(0.98 * validate(own, space).speed_factor)
    assert validate(quick, space).valid


def test_merged_parts_are_those_evaluated_as_a_whole(
    space: configspace.PermissibleSpace,
) -> None:
    parts = prove(backwards(12), space).parts
    motion = motion_of(backwards(12), is_own=False)
    whole = motion.enclose(parts.spans)
    assert parts.stands.size > 10
    for name, values in vars(whole).items():
        if name != "swing":
            np.testing.assert_array_equal(getattr(parts.enclosure, name), values)
    assert whole.swing is not None
    assert parts.enclosure.swing is not None
    merged = parts.enclosure.swing
    for name in ("dt", "h", "knot"):
        np.testing.assert_array_equal(getattr(merged, name), getattr(whole.swing, name))
    np.testing.assert_array_equal(merged.directions.v, whole.swing.directions.v)
