from pathlib import Path

import numpy as np
import pytest

import configspace
from configspace import InvalidInput, Vehicle
from omniplan import (
    InvalidTrajectory,
    Trajectory,
    read_trajectories,
    write_trajectories,
)
from omniplan.trajectory import timed


def read(path: Path, vehicle: Vehicle | None = None) -> list[Trajectory]:
    return [timed(motion) for motion in read_trajectories(path, vehicle)]


def written(folder: Path, text: str | bytes) -> Path:
    path = folder / "file.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_one_trajectory_takes_the_name_of_the_file(tmp_path: Path) -> None:
    path = written(tmp_path, "t,x,y,theta\n0,1,2,0.5\n1,2,2,0.5\n")
    (trajectory,) = read(path)
    assert trajectory.name == "file"
    assert trajectory.form == "poses"
    assert trajectory.samples.tolist() == [[1, 2, 0.5], [2, 2, 0.5]]


def test_comments_blank_lines_spaces_and_any_column_order(tmp_path: Path) -> None:
    text = (
        "# a comment\n\n omega , vx ,trajectory, vy, t\n"
        "  # another\n0.5, 1, a , 0, 0\n\n0.6, 1, a, 0, 1\n"
    )
    (trajectory,) = read(written(tmp_path, text))
    assert trajectory.name == "a"
    assert trajectory.form == "twists"
    assert trajectory.samples.tolist() == [[1, 0, 0.5], [1, 0, 0.6]]


def test_many_trajectories_keep_their_order_and_may_interleave(tmp_path: Path) -> None:
    text = "trajectory,t,x,y,theta\nb,0,0,0,0\na,0,5,0,0\nb,1,1,0,0\na,2,6,0,0\n"
    b, a = read(written(tmp_path, text))
    assert (b.name, a.name) == ("b", "a")
    assert a.t.tolist() == [0, 2]


@pytest.mark.parametrize("start", ["\ufeff", ""])
@pytest.mark.parametrize("end", ["\r\n", "\n"])
def test_files_of_spreadsheets_are_read(tmp_path: Path, start: str, end: str) -> None:
    text = start + end.join(("t,x,y,theta", "0,0,0,0", "1,1,0,0", ""))
    (trajectory,) = read(written(tmp_path, text))
    assert trajectory.t.tolist() == [0, 1]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no header"),
        ("# only a comment\n", "no header"),
        ("t,x,y,theta\n", "no rows"),
        ("t,x,y\n0,0,0\n", "columns t, x, y"),
        ("vx,vy,omega\n0,0,0\n", "no column t"),
        ("t,x,y,theta,speed\n", "unknown column 'speed'"),
        ("t,x,x,y,theta\n", "column x twice"),
        ("t,x,y,theta,vx,vy,omega\n", "columns t, x"),
        ("t,x,y,theta\n0,0,0,0\n# c\n1,one,0,0\n", "line 4, x: 'one'; a number"),
        ("t,x,y,theta\n0,0,0,0\n1,,0,0\n", "line 3, x: ''; a number"),
        ("t,x,y,theta\n0,0,0,0\n1,0,0\n", "line 3: 3 values; 4"),
        ("t,x,y,theta\n0,0,0,0\n1,0,0,0,0\n", "line 3: 5 values; 4"),
        ("t,x,y,theta\n0,0,0,0\n", "at least two"),
        ("t,x,y,theta\n0,0,0,0\n1,nan,0,0\n", "row 1, x: nan"),
        ("t,x,y,theta\n0,0,0,0\n0,1,0,0\n", "row 1, t"),
        ("trajectory,t,x,y,theta\na,0,0,0,0\nb,0,0,0,0\n", "at least two"),
        ("t,kappa_n,beta,v_n\n0,0,0,0\n1,0,0,0\n", "name it: vehicle="),
        (bytes(range(256)), "UTF-8"),
        (b"\x00" * 100, "header"),
        ("t,x,y,theta\n0,0,0," + "1" * 200_000 + "\n", "line 2"),
    ],
)
def test_a_file_with_a_mistake_is_refused_with_the_place(
    tmp_path: Path, text: str | bytes, message: str
) -> None:
    with pytest.raises(InvalidTrajectory) as caught:
        read_trajectories(written(tmp_path, text))
    assert message in str(caught.value)
    assert "file.csv" in str(caught.value)


def test_a_missing_file_and_a_folder_are_refused(tmp_path: Path) -> None:
    for path in (tmp_path / "missing.csv", tmp_path):
        with pytest.raises(InvalidTrajectory, match="readable"):
            read_trajectories(path)


def test_rows_of_a_mistake_are_named_by_the_lines_of_the_file(tmp_path: Path) -> None:
    text = "# one\nt,x,y,theta\n0,0,0,0\n# two\n1,0,0,3\n"
    with pytest.raises(InvalidTrajectory, match=r"lines 3 to 5.*row 1, theta"):
        read_trajectories(written(tmp_path, text))


@pytest.mark.parametrize("start", [0.0, -3.25, 1.7e9])
def test_what_is_written_is_read_again(tmp_path: Path, start: float) -> None:
    rng = np.random.default_rng(1)
    t = start + np.cumsum(rng.uniform(0.01, 0.2, 20))
    one = Trajectory.from_poses(t, rng.normal(size=(20, 3)) * [9, 9, 0.3], name="one")
    two = Trajectory.from_poses(
        t, rng.normal(size=(20, 3)) * [9, 9, 0.3], name='a, "b"'
    )
    path = tmp_path / "out.csv"
    write_trajectories(path, [one, two])
    for before, after in zip((one, two), read(path), strict=True):
        assert after.name == before.name
        assert (after.t == before.t).all()
        assert (after.samples == before.samples).all()


def test_omni_curve_files_are_of_the_vehicle_that_is_named(tmp_path: Path) -> None:
    vehicle = configspace.load_vehicle("mecanum")
    t = [0.0, 1.0]
    own = Trajectory.from_omni_curve(t, [0, 1], [0.5, 1], [0, 0.5], vehicle, name="own")
    write_trajectories(tmp_path / "own.csv", [own])
    (back,) = read(tmp_path / "own.csv", vehicle)
    assert back.vehicle == vehicle
    assert (back.samples == own.samples).all()


def test_a_file_holds_one_form(tmp_path: Path) -> None:
    poses = Trajectory.from_poses([0, 1], np.zeros((2, 3)))
    twists = Trajectory.from_twists([0, 1], np.zeros((2, 3)))
    for mixed in ([poses, twists], []):
        with pytest.raises(InvalidInput, match="exactly one form"):
            write_trajectories(tmp_path / "no.csv", mixed)
    assert not (tmp_path / "no.csv").exists()


def test_swapped_arguments_are_said(tmp_path: Path) -> None:
    line = Trajectory.from_poses([0, 1], [[0, 0, 0], [1, 0, 0]])
    file = tmp_path / "one.csv"
    with pytest.raises(InvalidInput, match="the name of a file, before"):
        write_trajectories([line], file)  # type: ignore[arg-type]
    with pytest.raises(InvalidInput, match="a list of trajectories or paths"):
        write_trajectories(file, "one.csv")  # type: ignore[arg-type]
    with pytest.raises(InvalidInput, match=r"trajectories\[1\]: int"):
        write_trajectories(file, [line, 3])  # type: ignore[list-item]
    assert not file.exists()


@pytest.mark.parametrize(
    ("header", "hint"),
    [
        ("trajectory;t;x;y;theta", "columns are separated by commas"),
        ("Trajectory,t,x,y,theta", r"did you mean trajectory\?"),
        ("t,x,y,heading", "unknown column 'heading'; "),
    ],
)
def test_an_unknown_column_comes_with_what_may_be_meant(
    tmp_path: Path, header: str, hint: str
) -> None:
    with pytest.raises(InvalidInput, match=hint):
        read(written(tmp_path, f"{header}\n0,0,0,0,0\n1,1,0,0,0\n"))


def test_what_is_no_text_is_told_in_words(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match="byte 0xfc at 8 is not UTF-8"):
        read(written(tmp_path, b"t,x,y,th\xfc"))


def test_a_file_that_cannot_be_written_is_bad_input_and_leaves_nothing(
    tmp_path: Path,
) -> None:
    trajectory = Trajectory.from_poses([0, 1], [[0, 0, 0], [1, 0, 0]])
    for name in ("a.csv", "a.parquet"):
        with pytest.raises(InvalidInput, match="No such file or directory; must be"):
            write_trajectories(tmp_path / "nowhere" / name, [trajectory])
        (tmp_path / name).mkdir()
        with pytest.raises(InvalidInput, match="Is a directory; must be writable"):
            write_trajectories(tmp_path / name, [trajectory])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "a.parquet"]
