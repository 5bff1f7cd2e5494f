"""Batches of paths: a row for every vehicle, timed by itself."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path as FilePath

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import configspace
from configspace import InvalidInput, PermissibleSpace
from omniplan import Path, Trajectory, select, validate, validate_many
from omniplan.batch.paths import PathBatch
from omniplan.cli import main

SpaceOf = Callable[[str], PermissibleSpace]
NAMES = ("mecanum", "differential", "ift-four-steered")
LINE = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]
ASIDE = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]


def test_rows_are_those_of_select_and_of_batches(space_of: SpaceOf) -> None:
    fleet = [space_of(name) for name in NAMES]
    timed = Trajectory.from_poses([0, 30], LINE, name="timed")
    motions: list[Path | Trajectory] = [
        Path.from_poses(ASIDE, name="aside"),
        timed,
        Path.from_poses(LINE, name="line"),
    ]
    batch = PathBatch(motions, fleet)
    rows = pa.Table.from_batches(list(batch.verdicts())).to_pylist()
    assert batch.pairs == len(rows) == 9
    pairs = [(row["trajectory"], row["vehicle"]) for row in rows]
    assert pairs == [(motion.name, name) for motion in motions for name in NAMES]
    by_pair = dict(zip(pairs, rows, strict=True))
    for ranking in select(motions, fleet):
        for candidate in ranking.suitable:
            row = by_pair[ranking.trajectory, candidate.vehicle]
            assert row["valid"]
            assert row["duration"] == candidate.report.duration
            assert row["margin"] == pytest.approx(candidate.report.margin, abs=2e-3)
        for one in ranking.undrivable:
            row = by_pair[ranking.trajectory, one.vehicle]
            assert not row["valid"]
            assert one.fault is not None
            assert (row["limit"], row["wheel"]) == (one.fault.limit, one.fault.wheel)
            assert row["duration"] == math.inf
            assert math.isnan(row["margin"])
            assert row["value"] is None
            assert row["u"] == one.fault.u
    path = motions[0]
    assert isinstance(path, Path)
    assert 0 <= by_pair["aside", "differential"]["u"] <= path.parameter[-1]
    assert by_pair["line", "mecanum"]["u"] is None
    assert not by_pair["aside", "differential"]["valid"]
    expected = validate_many([timed], fleet).to_pylist()
    assert [by_pair["timed", name] for name in NAMES] == expected
    assert validate(timed, fleet[0]).valid


def test_a_data_sheet_alone_says_so(space_of: SpaceOf) -> None:
    sheet = configspace.parse_space(configspace.dump_space(space_of("mecanum")))
    batch = PathBatch([Path.from_poses(LINE)], [sheet])
    (row,) = pa.Table.from_batches(list(batch.verdicts())).to_pylist()
    assert row["limit"] == "VEHICLE_NOT_KNOWN"
    assert row["u"] is None
    assert not row["valid"]


def test_names_must_differ(space_of: SpaceOf) -> None:
    path = Path.from_poses(LINE)
    with pytest.raises(InvalidInput, match="trajectories: a name more than once"):
        PathBatch([path, path], [space_of("mecanum")])
    with pytest.raises(InvalidInput, match="spaces: empty"):
        PathBatch([path], [])


def test_the_command_line_times_paths_for_a_fleet(
    tmp_path: FilePath, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = tmp_path / "corner.csv", tmp_path / "verdicts.parquet"
    file.write_text("trajectory,x,y,theta\nc,0,0,0\nc,1,0,0\nc,1,1,0\n")
    fleet = ["--fleet", "mecanum", "differential"]
    assert main(["check", str(file), *fleet, "--out", str(out)]) == 1
    assert "1 of 2 pairs are valid" in capsys.readouterr().out
    rows = pq.read_table(out).to_pylist()
    assert [row["valid"] for row in rows] == [True, False]
    assert rows[1]["limit"] == "FIXED_WHEEL"


def test_the_command_line_ranks_vehicles_for_a_path(
    tmp_path: FilePath, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "corner.csv"
    file.write_text("trajectory,x,y,theta\nc,0,0,0\nc,1,0,0\nc,1,1,0\n")
    arguments = ["select", str(file), "--fleet", "mecanum", "differential"]
    assert main(arguments) == 0
    out = capsys.readouterr().out
    assert "│ 1. │ mecanum │" in out
    assert "no differential: blocked: wheel" in out
    assert "1.00 m along the path [FIXED_WHEEL]" in out
