"""``omniplan plan`` as its user sees it."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from omniplan import cli, read_trajectories

Capture = pytest.CaptureFixture[str]
WALL = {"wall": [[1, -9], [1.2, -9], [1.2, 0.8], [1, 0.8]]}


def answer(capsys: Capture, *arguments: str) -> tuple[int, dict[str, object]]:
    code = cli.main(["plan", *arguments, "--json"])
    return code, json.loads(capsys.readouterr().out)


def test_a_plan_is_found_written_and_drawn(capsys: Capture, tmp_path: Path) -> None:
    hall, out = tmp_path / "hall.json", tmp_path / "way.csv"
    hall.write_text(json.dumps(WALL))
    words = (
        "plan --vehicle mecanum --start -0.5,0,0 --goal 2.5,0,90 --bounds=-2,-2,4,4 "
        f"--obstacles {hall} --clearance 0.05 --time 0.5 --out {out} "
        f"--plot {tmp_path / 'pictures'}"
    )
    code = cli.main(words.split())
    said = capsys.readouterr().out
    assert code == 0
    assert "mecanum: " in said
    assert "swept area" in said
    (trajectory,) = read_trajectories(out)
    ends = trajectory.samples[[0, -1]]  # type: ignore[union-attr]
    expected = np.array([[-0.5, 0, 0], [2.5, 0, np.pi / 2]])
    assert ends == pytest.approx(expected, abs=1e-6)
    names = {path.name for path in (tmp_path / "pictures").iterdir()}
    assert "plan-mecanum.png" in names
    assert len(names) > 1


def test_what_a_plan_writes_is_permitted_when_it_is_read(
    capsys: Capture, tmp_path: Path
) -> None:
    # A plan uses its limits up: digits that are cut off would break them.
    for vehicle in ("ackermann", "four-wheel-steering", "differential"):
        out = tmp_path / f"{vehicle}.csv"
        words = f"plan --vehicle {vehicle} --start 0,0,0 --goal 2.5,0.7,30 --time 0.5"
        assert cli.main([*words.split(), "--iterations", "300", "--out", f"{out}"]) == 0
        assert cli.main(["check", f"{out}", "--vehicle", vehicle]) == 0
    capsys.readouterr()


def test_the_load_keeps_its_heading_if_asked(capsys: Capture, tmp_path: Path) -> None:
    out = tmp_path / "way.csv"
    ways = ["--vehicle", "mecanum", "--start=0,0,0", "--goal=2,1,0", "--out", f"{out}"]
    assert answer(capsys, *ways, "--heading", "keep")[0] == 0
    (trajectory,) = read_trajectories(out)
    assert (trajectory.samples[:, 2] == 0).all()  # type: ignore[union-attr]
    code, found = answer(
        capsys, *ways[:2], "--start=0,0,0", "--goal=2,1,30", "--heading", "keep"
    )
    assert code == 1
    assert "keep its heading" in str(found["plan"]["message"])  # type: ignore[index]


def test_rates_may_be_the_controls(capsys: Capture) -> None:
    ways = ["--vehicle", "mecanum", "--start=0,0,0", "--goal=1,0,0"]
    code, found = answer(capsys, *ways, "--method", "control", "--time", "20")
    assert code == 0, found


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs Linux")
@pytest.mark.parametrize("argument", ["--out", "--plot"])
def test_places_that_take_no_files_are_refused_before_the_search(
    capsys: Capture, tmp_path: Path, argument: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unasked(*_: object, **__: object) -> None:
        raise AssertionError("the search has begun")

    monkeypatch.setattr("omniplan.planning.planner.plan", unasked)
    ways = ["plan", "--vehicle", "mecanum", "--start=0,0,0", "--goal=1,0,0"]
    (tmp_path / "taken.csv").mkdir()
    (tmp_path / "file").write_text("")
    places = {
        "--out": [tmp_path / "taken.csv", Path("/proc/way.csv")],
        "--plot": [tmp_path / "file", Path("/proc")],
    }
    for place in places[argument]:
        assert cli.main([*ways, argument, f"{place}"]) == 2
        assert (
            f"{argument}: {place}".removesuffix("/way.csv") in capsys.readouterr().err
        )


def test_json_holds_plan_and_area(capsys: Capture) -> None:
    arguments = ["--vehicle", "mecanum", "--start=0,0,0", "--goal=1,0,0"]
    code, found = answer(capsys, *arguments)
    assert code == 0
    assert found["swept_area"] == pytest.approx(0.9 * 0.64 + 0.64, abs=1e-6)
    plan = found["plan"]
    assert isinstance(plan, dict)
    assert plan["status"] == "found"


def test_a_blocked_goal_is_a_no(capsys: Capture, tmp_path: Path) -> None:
    Image.fromarray(np.zeros((20, 20), dtype=np.uint8)).save(tmp_path / "map.png")
    (tmp_path / "map.yaml").write_text(
        "{image: map.png, resolution: 0.05, origin: [2, -0.5, 0], negate: 0, "
        "occupied_thresh: 0.65, free_thresh: 0.196}"
    )
    arguments = ["--vehicle", "mecanum", "--start", "0,0,0", "--goal", "2.5,0,0"]
    code, found = answer(capsys, *arguments, "--map", str(tmp_path / "map.yaml"))
    assert code == 1
    plan = found["plan"]
    assert isinstance(plan, dict)
    assert plan["status"] == "goal blocked"
    assert "map.yaml near" in str(plan["message"])
    assert found["swept_area"] is None


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "3 problems"),
        (["--vehicle", "mecanum", "--start", "0,0,0"], "--goal: missing"),
        (["--scenario", "parcing"], "did you mean parking"),
        (["--scenario", "parking", "--vehicle", "mecanum"], "--vehicle: given with"),
        (
            ["--vehicle", "mecanum", "--start", "0,0", "--goal", "1,0,0"],
            "--start: 0,0;",
        ),
        (["--vehicle", "mecanum", "--start", "0,0,x", "--goal", "1,0,0"], "X,Y,DEG"),
        (["--vehicle", "mecanum", "--start", "0,0,nan", "--goal", "1,0,0"], "--start"),
        (
            ["--vehicle", "mecanum", "--start=0,0,0", "--goal=1,0,0", "--bounds=1,2,3"],
            "--bounds: 1,2,3; X0,Y0,X1,Y1",
        ),
        (
            ["--vehicle", "mecanum", "--start=0,0,0", "--goal=1,0,0", "--out=a.txt"],
            "--out: a.txt; must end in .csv",
        ),
        (
            ["--vehicle", "mecanum", "--start=0,0,0", "--goal=1,0,0", "--time", "0"],
            "time",
        ),
        (
            ["--vehicle=mecanum", "--start=0,0,0", "--goal=1,0,0", "--method=guess"],
            "method: 'guess'; one of geometric, control",
        ),
        (
            ["--vehicle=mecanum", "--start=0,0,0", "--goal=1,0,0", "--heading=north"],
            "heading: 'north'; one of free, keep",
        ),
        (
            ["--vehicle=mecanum", "--start=0,0,0", "--goal=1,0,0", "--iterations=0"],
            "iterations: 0; a whole number, at least 1",
        ),
        (["--scenario", "pillar", "--heading", "keep"], "--heading: given with"),
        (
            [
                "--vehicle",
                "mecanum",
                "--start=0,0,0",
                "--goal=1,0,0",
                "--map",
                "no.yaml",
            ],
            "map no.yaml",
        ),
    ],
)
def test_bad_input_is_told(capsys: Capture, arguments: list[str], words: str) -> None:
    assert cli.main(["plan", *arguments]) == 2
    told = capsys.readouterr().err
    assert words in told or words == "3 problems"
    if words == "3 problems":
        assert all(
            f"--{name}: missing" in told for name in ("vehicle", "start", "goal")
        )


def test_a_scenario_writes_its_folder(capsys: Capture, tmp_path: Path) -> None:
    code, found = answer(capsys, "--scenario", "pillar", "--out", str(tmp_path / "out"))
    assert code == 0
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert names == [
        "pillar-platform-all-wheel.csv",
        "pillar-platform-mecanum.csv",
        "pillar-platform-synchro.csv",
        "pillar.gif",
        "pillar.png",
    ]
    assert (tmp_path / "out" / "pillar.gif").stat().st_size < 1_000_000
    solutions = found["solutions"]
    assert isinstance(solutions, list)
    synchro, all_wheel, mecanum = solutions
    assert synchro["vehicle"] == "platform-synchro"
    assert all(each["swept_area"] > 3 for each in (synchro, all_wheel, mecanum))


def test_a_scenario_prints_a_table(capsys: Capture) -> None:
    assert cli.main(["plan", "--scenario", "pillar"]) == 0
    said = capsys.readouterr().out
    assert "Around a pillar" in said
    assert "synchro drive" in said
    assert "m²" in said


def test_too_little_time_is_a_no(capsys: Capture) -> None:
    assert cli.main(["plan", "--scenario", "pillar", "--time", "1e-9"]) == 1
    assert "no way was found" in capsys.readouterr().out


SEARCHING = """
import sys
from omniplan import cli
from omniplan.planning import task

start = task.Budget.start


def told(budget):
    print("begins", file=sys.stderr, flush=True)
    start(budget)


task.Budget.start = told
sys.exit(cli.main(sys.argv[1:]))
"""


@pytest.mark.skipif(
    signal.getsignal(signal.SIGINT) is signal.SIG_IGN,
    reason="interrupts are ignored, as in the background of a shell",
)
@pytest.mark.slow
@pytest.mark.parametrize("begun", [0.3, 2.0])
def test_ctrl_c_ends_a_plan_quietly(tmp_path: Path, begun: float) -> None:
    """In the search, which is within OMPL's C++ for the most part; 3 is failure."""
    hall = tmp_path / "hall.json"
    hall.write_text(json.dumps(WALL))
    words = (
        "plan --vehicle ackermann --start -0.5,0,0 --goal 2.5,0,90 --planner RRTstar "
        f"--obstacles {hall} --time 300"
    )
    with subprocess.Popen(
        [sys.executable, "-c", SEARCHING, *words.split()],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stderr is not None
        assert process.stderr.readline() == "begins\n"
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(timeout=begun)
        process.send_signal(signal.SIGINT)
        out, told = process.communicate(timeout=60)
    assert process.returncode == 3
    assert out == ""
    assert told.splitlines()[-1] == "omniplan: interrupted"
    assert "Traceback" not in told
    assert "leaked" not in told
