"""Something else than a space, vehicle or trajectory is told, never a crash."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias

import pytest

import configspace
import omniplan
from configspace import InvalidInput, InvalidVehicle
from omniplan.cli import main

Capture: TypeAlias = pytest.CaptureFixture[str]
VEHICLE = configspace.load_vehicle("differential")
LINE = omniplan.Trajectory.from_poses([0, 4], [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]])
PATH = omniplan.Path.from_poses([[0, 0, 0], [1, 0, 0]])
DOCKING = "examples/manoeuvres/docking.csv"
FLEET_CHECK = ("check", DOCKING, "--fleet", "mecanum")


def _space() -> configspace.PermissibleSpace:
    return configspace.build_space(VEHICLE)


CALLS: dict[str, tuple[Callable[[Any], Any], Any, str]] = {
    "validate": (lambda x: omniplan.validate(LINE, x), VEHICLE, "space: Vehicle; "),
    "fastest": (lambda x: omniplan.fastest(PATH, x), VEHICLE, "space: Vehicle; "),
    "time_paths": (lambda x: omniplan.time_paths([PATH], x), "a", "space: str; "),
    "build_space": (configspace.build_space, "mecanum", "vehicle: 'mecanum'; "),
    "check_twists": (
        lambda x: omniplan.check_twists([[0.1, 0.0, 0.0]], x),
        VEHICLE,
        "space: Vehicle; ",
    ),
    "validate_many": (
        lambda x: omniplan.validate_many([LINE], [x]),
        VEHICLE,
        "spaces[0]: Vehicle; ",
    ),
    "fleet": (lambda x: omniplan.select(LINE, x), [VEHICLE], "fleet: Vehicle; "),
    "pair": (lambda x: omniplan.select(LINE, x), [("a", 1)], "fleet: a: int; "),
    "trajectories": (
        lambda x: omniplan.select(x, [_space()]),
        "a.csv",
        "trajectories[0]: 'a'; ",
    ),
    "trajectory": (lambda x: omniplan.validate(x, _space()), 7, "trajectory: 7; "),
}


@pytest.mark.parametrize("name", CALLS)
def test_another_thing_is_named(name: str) -> None:
    call, given, expected = CALLS[name]
    with pytest.raises(InvalidInput, match=re.escape(expected)):
        call(given)


def test_a_space_is_no_fleet() -> None:
    space: Any = _space()
    with pytest.raises(InvalidInput, match="fleet: one PermissibleSpace"):
        omniplan.select(LINE, space)


def test_all_mistakes_of_a_wheel_and_the_footprint_are_told() -> None:
    wheel = {"id": "a", "type": "steered", "x": "far", "y": 0}
    data = {
        "name": "a",
        "footprint": [[0, 0], [1, 0]],
        "wheels": [
            {**wheel, "steering_range_deg": [10, -10]},
            {**wheel, "x": 0, "id": "b", "steering_range_deg": [10, -10]},
            {"id": "c", "type": "round", "x": 0, "y": 0},
            {"id": "d", "x": 0, "y": 0},
        ],
    }
    with pytest.raises(InvalidVehicle) as caught:
        configspace.vehicle_from_data(data)
    assert sorted(problem.where for problem in caught.value.problems) == [
        "footprint",
        "wheels[0].steering_range_deg",
        "wheels[0].x",
        "wheels[1].steering_range_deg",
        "wheels[2].type",
        "wheels[3].type",
    ]


def test_no_wheels_and_no_text_are_told_plainly() -> None:
    with pytest.raises(InvalidVehicle, match="wheels: none; at least one"):
        configspace.vehicle_from_data({"name": "a", "wheels": []})
    with pytest.raises(InvalidVehicle, match="the text: nothing; a mapping"):
        configspace.parse_vehicle("")


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["select", "--fleet", "mecanum", DOCKING], "stand before --fleet"),
        (
            ["select", DOCKING, "--fleet", "mecanum", DOCKING],
            "docking.csv; a vehicle is needed here; trajectories stand before --fleet",
        ),
        (
            [*FLEET_CHECK, "--out", "a.csv"],
            "--out: a.csv; must end in .parquet",
        ),
        (
            [*FLEET_CHECK, "--out", "nowhere/a.parquet"],
            "the folder must exist",
        ),
        (
            [*FLEET_CHECK, "--out", "a.parquet", "--plot", "pictures"],
            "--plot with --fleet; needs --vehicle",
        ),
    ],
)
def test_arguments_that_do_not_fit_are_bad_input(
    capsys: Capture, arguments: list[str], expected: str
) -> None:
    assert main(arguments) == 2
    assert expected in capsys.readouterr().err


def test_export_prints_json(capsys: Capture, tmp_path: Path) -> None:
    output = tmp_path / "a.safetensors"
    assert main(["export", "differential", str(output), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"output": str(output)}


def test_a_synchro_drive_has_no_line(capsys: Capture) -> None:
    assert main(["inspect", "synchro-drive"]) == 0
    out = capsys.readouterr().out
    assert "of the motions without turning" in out
    assert "line" not in out
