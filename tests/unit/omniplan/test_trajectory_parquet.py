"""Parquet files, and what they share with CSV: paths, reference points, big tables."""

import math
import re
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

import configspace
from omniplan import (
    InvalidTrajectory,
    Trajectory,
    read_trajectories,
    write_trajectories,
)
from omniplan.path import Path
from omniplan.trajectory import timed

SUFFIXES = pytest.mark.parametrize("suffix", [".parquet", ".csv"])
POSES = [[0.0, 0, 0], [1.0, 0, 0.5], [2.0, 1, 1]]


def stored(folder: FilePath, **columns: Any) -> FilePath:
    path = folder / "file.parquet"
    parquet.write_table(pa.table(columns), path)
    return path


def good(**change: Any) -> dict[str, Any]:
    columns: dict[str, Any] = {
        "t": [0.0, 1.0, 2.0],
        **dict(zip(("x", "y", "theta"), np.array(POSES).T, strict=True)),
        **change,
    }
    return {key: value for key, value in columns.items() if value is not ...}


def test_parquet_keeps_every_digit(tmp_path: FilePath) -> None:
    rng = np.random.default_rng(3)
    made = [
        Trajectory.from_twists(
            np.cumsum(rng.uniform(0.1, 1, n)), rng.normal(size=(n, 3))
        )
        for n in (2, 50)
    ]
    made = [
        Trajectory.from_twists(one.t, one.samples, name=f"{i}, “ö”", reference_point=p)
        for i, (one, p) in enumerate(
            zip(made, ((0.1, -1 / 3), (0.0, 0.0)), strict=True)
        )
    ]
    path = tmp_path / "made.parquet"
    write_trajectories(path, made)
    for before, after in zip(made, map(timed, read_trajectories(path)), strict=True):
        assert after.name == before.name
        assert after.form == before.form
        assert after.reference_point == before.reference_point
        assert (after.t == before.t).all()
        assert (after.samples == before.samples).all()


@SUFFIXES
def test_paths_keep_caps_and_stops(tmp_path: FilePath, suffix: str) -> None:
    one = Path.from_poses(
        POSES,
        name="one",
        reference_point=(0.5, 0.25),
        max_speed=[0.5, math.inf],
        max_yaw_rate=0.25,
        stops=[1],
    )
    two = Path.from_poses(POSES, name="two")
    path = tmp_path / f"paths{suffix}"
    write_trajectories(path, [one, two])
    for before, after in zip((one, two), read_trajectories(path), strict=True):
        assert isinstance(after, Path)
        assert after.name == before.name
        assert after.reference_point == before.reference_point
        assert after.poses == pytest.approx(before.poses)
        assert (after.stops == before.stops).all()
        for key in ("max_speed", "max_yaw_rate"):
            was, now = getattr(before, key), getattr(after, key)
            assert now is was is None or (now == was).all()


@SUFFIXES
def test_columns_that_say_nothing_are_not_written(
    tmp_path: FilePath, suffix: str
) -> None:
    path = tmp_path / f"plain{suffix}"
    write_trajectories(path, [Path.from_poses(POSES)])
    names = (
        parquet.read_schema(path).names
        if suffix == ".parquet"
        else path.read_text().splitlines()[0].split(",")
    )
    assert names == ["trajectory", "x", "y", "theta"]


@SUFFIXES
def test_a_reference_point_is_kept(tmp_path: FilePath, suffix: str) -> None:
    path = tmp_path / f"point{suffix}"
    made = Trajectory.from_poses([0, 1, 2], POSES, reference_point=(0.5, -0.25))
    write_trajectories(path, [made])
    assert timed(*read_trajectories(path)).reference_point == (0.5, -0.25)


@SUFFIXES
def test_rows_may_interleave(tmp_path: FilePath, suffix: str) -> None:
    columns: dict[str, Any] = {
        "trajectory": ["b", "a", "b", "a"],
        **dict.fromkeys(("y", "theta"), [0.0] * 4),
        "t": [0.0, 5.0, 1.0, 6.0],
        "x": [0.0, 0.0, 2.0, 4.0],
    }
    path = stored(tmp_path, **columns)
    if suffix == ".csv":
        path = tmp_path / "file.csv"
        rows = zip(*columns.values(), strict=True)
        lines = [",".join(columns), *(",".join(map(str, row)) for row in rows)]
        path.write_text("\n".join(lines))
    b, a = map(timed, read_trajectories(path))
    assert (b.name, a.name) == ("b", "a")
    assert b.t.tolist() == [0, 1]
    assert a.samples[:, 0].tolist() == [0, 4]


def test_omni_curve_files_are_of_the_vehicle_that_is_named(tmp_path: FilePath) -> None:
    vehicle = configspace.load_vehicle("mecanum")
    t = [0.0, 1.0]
    own = Trajectory.from_omni_curve(t, [0, 1], [0.5, 1], [0, 0.5], vehicle, name="own")
    path = tmp_path / "own.parquet"
    write_trajectories(path, [own])
    back = timed(*read_trajectories(path, vehicle))
    assert back.vehicle == vehicle
    assert (back.samples == own.samples).all()
    with pytest.raises(InvalidTrajectory, match="name it: vehicle="):
        read_trajectories(path)


@pytest.mark.parametrize("kind", [pa.float32(), pa.int16(), pa.int64(), pa.uint8()])
def test_all_kinds_of_numbers_are_read(tmp_path: FilePath, kind: Any) -> None:
    path = stored(tmp_path, **good(t=pa.array([0, 1, 2], kind)))
    assert timed(*read_trajectories(path)).t.tolist() == [0, 1, 2]


@pytest.mark.parametrize(
    "kind", [pa.string(), pa.large_string(), pa.dictionary(pa.int8(), pa.string())]
)
def test_all_kinds_of_text_are_read(tmp_path: FilePath, kind: Any) -> None:
    names = pa.array(["a", "a", "a"]).cast(kind)
    (one,) = read_trajectories(stored(tmp_path, **good(trajectory=names)))
    assert one.name == "a"


def test_a_file_without_names_gives_its_own(tmp_path: FilePath) -> None:
    (one,) = read_trajectories(stored(tmp_path, **good()))
    assert one.name == "file"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"t": ["0", "1", "2"]}, "column t: string; numbers"),
        ({"x": [True, False, True]}, "column x: bool; numbers"),
        ({"y": [None, 1.0, 2.0]}, "row 0, y: no value"),
        ({"theta": [0.0, None, None]}, "row 1, theta: no value"),
        ({"x": [None, None, None]}, "column x: null; numbers"),
        ({"trajectory": ["a", None, "a"]}, "row 1, trajectory: no value"),
        ({"trajectory": [1, 2, 3]}, "column trajectory: int64; text"),
        ({"t": pa.array([0, 1, 2], pa.timestamp("s"))}, "column t: timestamp"),
        ({"t": pa.array([0, 1, 2], pa.duration("s"))}, "column t: duration"),
        ({"x": [[0.0], [1.0], [2.0]]}, "column x: list"),
        ({"speed": [0.0, 0.0, 0.0]}, "unknown column 'speed'"),
        ({"theta": ...}, "columns t, x, y"),
        ({"vx": [0.0] * 3}, "columns t, x, y, theta, vx"),
        ({"reference_x": [0.0] * 3}, "reference_x and reference_y"),
        (
            {"reference_x": [0.0, 0.0, 1.0], "reference_y": [0.0] * 3},
            "row 2, reference_x: 1 after 0; the same",
        ),
        ({"stop": [0, 1, 0]}, "column stop beside t"),
        ({"t": ..., "stop": [0, 2, 0]}, "row 1, stop: 2; 0 or 1"),
        ({"t": ..., "max_speed": [0.5, 0.0, 1.0]}, "row 1, max_speed: 0"),
        ({"t": [0.0, 2.0, 1.0]}, "(rows 0 to 2): file: row 2, t: 1 s after 2 s"),
        ({"t": [0.0, math.nan, 1.0]}, "row 1, t: nan"),
        ({"trajectory": ["a", "b", "b"]}, "(row 0): a: 1 sample(s)"),
    ],
)
def test_mistakes_are_refused_with_file_row_and_column(
    tmp_path: FilePath, change: dict[str, Any], message: str
) -> None:
    path = stored(tmp_path, **good(**change))
    with pytest.raises(InvalidTrajectory, match=re.escape(message)) as caught:
        read_trajectories(path)
    assert "file.parquet" in str(caught.value)


def test_twice_the_same_column_is_refused(tmp_path: FilePath) -> None:
    path = tmp_path / "file.parquet"
    columns = [pa.array([0.0, 1.0])] * 5
    parquet.write_table(pa.table(columns, ["t", "x", "x", "y", "theta"]), path)
    with pytest.raises(InvalidTrajectory, match="column x twice"):
        read_trajectories(path)


def test_a_file_without_rows_is_refused(tmp_path: FilePath) -> None:
    none = {key: pa.array([], pa.float64()) for key in good()}
    with pytest.raises(InvalidTrajectory, match="no rows"):
        read_trajectories(stored(tmp_path, **none))


@pytest.mark.parametrize(
    "content", [b"", b"PAR1", b"t,x,y,theta\n0,0,0,0\n", bytes(99)]
)
def test_a_foreign_file_is_refused(tmp_path: FilePath, content: bytes) -> None:
    path = tmp_path / "file.parquet"
    path.write_bytes(content)
    with pytest.raises(InvalidTrajectory, match=r"file\.parquet.*Parquet"):
        read_trajectories(path)


def test_a_missing_file_and_a_folder_are_refused(tmp_path: FilePath) -> None:
    (tmp_path / "folder.parquet").mkdir()
    for name in ("missing.parquet", "folder.parquet"):
        with pytest.raises(InvalidTrajectory, match=r"readable Parquet"):
            read_trajectories(tmp_path / name)


def test_a_damaged_file_is_refused_or_read_as_it_was(tmp_path: FilePath) -> None:
    path = tmp_path / "file.parquet"
    rng = np.random.default_rng(5)
    t = np.arange(2000.0)
    samples = rng.normal(size=(2000, 3)) * [1, 1, 0.1]
    whole = Trajectory.from_poses(t, samples, name="a")
    write_trajectories(path, [whole])
    data = path.read_bytes()
    for size in rng.integers(0, len(data), 30):
        path.write_bytes(data[:size])
        with pytest.raises(InvalidTrajectory):
            read_trajectories(path)
    for at in rng.integers(0, len(data), 60):
        path.write_bytes(data[:at] + bytes([data[at] ^ 0xFF]) + data[at + 1 :])
        try:  # A byte of a value may change; nothing else may happen.
            read_trajectories(path)
        except InvalidTrajectory:
            continue


def test_orders_are_not_written(tmp_path: FilePath) -> None:
    with pytest.raises(InvalidTrajectory, match=r"\.csv or \.parquet"):
        write_trajectories(tmp_path / "a.json", [Path.from_poses(POSES)])


@SUFFIXES
def test_many_trajectories_in_one_table(tmp_path: FilePath, suffix: str) -> None:
    n, k = 300, 40
    rng = np.random.default_rng(1)
    t = np.arange(float(k))
    made = [
        Trajectory.from_poses(t, rng.normal(size=(k, 3)) * 0.1, name=f"t{i}")
        for i in range(n)
    ]
    path = tmp_path / f"many{suffix}"
    write_trajectories(path, made)
    back = list(map(timed, read_trajectories(path)))
    assert [one.name for one in back] == [one.name for one in made]
    for before, after in zip(made, back, strict=True):
        assert np.abs(after.samples - before.samples).max() < 1e-9


def test_lines_of_a_large_csv_file_are_told(tmp_path: FilePath) -> None:
    rows = [f"{i // 100},{i % 100},0,0,0" for i in range(5000)]
    rows[4321] = "43,21,nan,0,0"
    path = tmp_path / "large.csv"
    path.write_text("# made\ntrajectory,t,x,y,theta\r\n" + "\r\n".join(rows))
    with pytest.raises(
        InvalidTrajectory, match=r"lines 4303 to 4402\): 43: row 21, x: nan"
    ):
        read_trajectories(path)
    rows[4321] = "43,21,oops,0,0"
    path.write_text("# made\ntrajectory,t,x,y,theta\r\n" + "\r\n".join(rows))
    with pytest.raises(InvalidTrajectory, match=r"line 4324, x: 'oops'; a number"):
        read_trajectories(path)
