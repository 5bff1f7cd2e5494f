from __future__ import annotations

import json
from pathlib import Path

import pytest

import configspace
from configspace import Grid, InvalidInput
from services.registering.folder import fleet_of_folder

GRID = Grid(8, 16)


def wheels(speed: float = 1.0) -> list[dict[str, object]]:
    return [
        {"id": str(y), "type": "fixed", "x": 0.0, "y": y, "max_speed": speed}
        for y in (0.2, -0.2)
    ]


def test_vehicles_and_data_sheets_are_read_in_the_order_of_their_files(
    tmp_path: Path,
) -> None:
    vehicle = {"name": "second", "wheels": wheels()}
    (tmp_path / "b.json").write_text(json.dumps(vehicle))
    (tmp_path / "c.YML").write_text(f"name: third\nwheels: {json.dumps(wheels())}")
    sheet = configspace.build_space(configspace.load_vehicle("mecanum"), GRID)
    sheet.save(tmp_path / "a.safetensors")
    (tmp_path / "readme.txt").write_text("no vehicle")
    (tmp_path / ".hidden.json").write_text("{")
    (tmp_path / "folder.json").mkdir()
    fleet = fleet_of_folder(tmp_path, GRID)
    assert [space.name for space in fleet] == ["mecanum", "second", "third"]
    assert fleet[0].vehicle is None
    assert fleet[1].vehicle == configspace.vehicle_from_data(vehicle)


def test_all_mistakes_of_all_files_are_reported_at_once(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(json.dumps({"name": "x", "wheels": wheels()}))
    (tmp_path / "b.json").write_text(json.dumps({"name": "x", "wheels": wheels()}))
    (tmp_path / "c.json").write_text(json.dumps({"name": "y", "wheels": wheels(-1.0)}))
    (tmp_path / "d.safetensors").write_bytes(b"none")
    with pytest.raises(InvalidInput) as caught:
        fleet_of_folder(tmp_path, GRID)
    places = [problem.where for problem in caught.value.problems]
    assert places == [
        "b.json: name",
        "c.json: wheels[0].max_speed",
        "c.json: wheels[1].max_speed",
        "d.safetensors",
    ]
    assert "a.json has a vehicle of this name" in str(caught.value)


def test_a_folder_that_is_none_is_named(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match=f"fleet: {tmp_path / 'no'}: No such file"):
        fleet_of_folder(tmp_path / "no")
    assert fleet_of_folder(tmp_path) == ()
