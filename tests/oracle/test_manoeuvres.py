"""Figure 1 of the paper: which vehicle can drive which manoeuvre."""

from __future__ import annotations

import math
import runpy
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from configspace import PermissibleSpace
from omniplan import Report, Trajectory, read_trajectories, validate

EXAMPLES = Path(__file__).parents[2] / "examples"
FOLDER = EXAMPLES / "manoeuvres"
FLEET = ("ackermann", "differential", "ift-four-steered", "mecanum")
OMNI = {"ift-four-steered", "mecanum"}
WHO_CAN = {
    # Straight into an arc: the wheels of the others would have to swing too suddenly.
    "crab-corner": {"mecanum"},
    "docking": set(FLEET),
    "forward-stop-sideways": OMNI,
    "parking-ackermann": set(FLEET),
    "parking-limited-steering": OMNI,
    "parking-sideways": {"mecanum"},
    "turn-on-the-spot": set(FLEET) - {"ackermann"},
    "wide-curve-fast": {"ackermann"},
}

SpaceOf = Callable[[str], PermissibleSpace]


def report_on(name: str, space: PermissibleSpace) -> Report:
    (trajectory,) = read_trajectories(FOLDER / f"{name}.csv")
    return validate(trajectory, space)


def test_every_manoeuvre_has_its_row_here() -> None:
    assert {path.stem for path in FOLDER.glob("*.csv")} == set(WHO_CAN)


@pytest.mark.parametrize("name", sorted(WHO_CAN))
def test_who_can_drive_a_manoeuvre(name: str, space_of: SpaceOf) -> None:
    able = {v for v in FLEET if report_on(name, space_of(v)).valid}
    assert able == WHO_CAN[name]


@pytest.mark.parametrize("name", sorted(WHO_CAN))
def test_each_refusal_names_a_wheel_of_the_vehicle(
    name: str, space_of: SpaceOf
) -> None:
    for vehicle in set(FLEET) - WHO_CAN[name]:
        space = space_of(vehicle)
        headline = report_on(name, space).headline
        assert headline is not None
        assert headline.wheel in space.header.wheel_ids
        assert headline.is_proved


def test_parking_sideways_needs_the_wheels_to_turn_at_rest(space_of: SpaceOf) -> None:
    report = report_on("parking-sideways", space_of("ift-four-steered"))
    (violation,) = report.violations
    assert violation.limit == "RECONFIGURATION"
    # A quarter turn at 180°/s and 720°/s², where the trajectory has only a cusp.
    assert violation.value == pytest.approx(0.5 + 0.25, abs=0.01)
    assert violation.bound < 0.2
    assert violation.t == pytest.approx(3.0, abs=0.1)
    assert {advice.kind for advice in report.advice} == {"slow_down", "dwell"}


def test_the_crab_corner_asks_for_too_sudden_steering(space_of: SpaceOf) -> None:
    report = report_on("crab-corner", space_of("ift-four-steered"))
    assert {v.limit for v in report.violations} == {"STEER_ACCELERATION"}
    assert report.headline is not None
    # By differences of the steering angles along the splines: 1026.9°/s².
    assert report.headline.value == pytest.approx(math.radians(1027), rel=1e-3)
    (advice,) = report.advice
    assert advice.value == pytest.approx(math.sqrt(720 / 1026.9), rel=2e-3)


def test_a_quick_wide_curve_is_too_fast_for_the_others(space_of: SpaceOf) -> None:
    for vehicle in set(FLEET) - {"ackermann"}:
        report = report_on("wide-curve-fast", space_of(vehicle))
        assert any(v.limit == "WHEEL_SPEED" for v in report.violations)
        (advice,) = report.advice
        assert advice.kind == "slow_down"
        assert 0.5 < advice.value < 1


def test_vehicles_with_an_axle_slip_where_they_would_have_to_crab(
    space_of: SpaceOf,
) -> None:
    for name in ("crab-corner", "parking-sideways", "forward-stop-sideways"):
        for vehicle in ("ackermann", "differential"):
            limits = {v.limit for v in report_on(name, space_of(vehicle)).violations}
            assert "FIXED_WHEEL" in limits


def test_the_car_cannot_turn_on_the_spot_for_its_steering_range(
    space_of: SpaceOf,
) -> None:
    report = report_on("turn-on-the-spot", space_of("ackermann"))
    assert {v.limit for v in report.violations} == {"STEER_RANGE"}
    assert report.speed_factor == 0
    assert report.advice == ()


def test_the_files_are_what_the_script_writes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["make_manoeuvres.py"])
    script = runpy.run_path(str(EXAMPLES / "make_manoeuvres.py"), run_name="manoeuvres")
    made = {trajectory.name: trajectory for trajectory in script["manoeuvres"]()}
    assert set(made) == set(WHO_CAN)
    for name, trajectory in made.items():
        (stored,) = read_trajectories(FOLDER / f"{name}.csv")
        assert isinstance(stored, Trajectory)
        assert np.abs(stored.t - trajectory.t).max() < 1e-9
        assert np.abs(stored.samples - trajectory.samples).max() < 1e-8


def test_the_script_writes_the_same_bytes(tmp_path: Path) -> None:
    from omniplan import write_trajectories

    script = runpy.run_path(str(EXAMPLES / "make_manoeuvres.py"), run_name="manoeuvres")
    for trajectory in script["manoeuvres"]():
        path = tmp_path / f"{trajectory.name}.csv"
        write_trajectories(path, [trajectory])
        assert path.read_bytes() == (FOLDER / path.name).read_bytes()
