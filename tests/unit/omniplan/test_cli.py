"""The command line as its user sees it: output, exit codes, error messages."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from omniplan import cli
from omniplan.choosing.requirements import PHRASES

MANOEUVRES = Path(__file__).parents[3] / "examples" / "manoeuvres"
Capture = pytest.CaptureFixture[str]


def manoeuvre(name: str) -> str:
    return str(MANOEUVRES / f"{name}.csv")


def run_json(capsys: Capture, *arguments: str) -> object:
    cli.main([*arguments, "--json"])
    return json.loads(capsys.readouterr().out)


def test_help_needs_no_heavy_library() -> None:
    code = (
        "import sys, omniplan.cli\n"
        "try: omniplan.cli.main(['--help'])\n"
        "except SystemExit: pass\n"
        "heavy = {'numpy', 'numba', 'scipy', 'pydantic', 'zenoh', 'rich'}\n"
        "print('HEAVY', sorted(heavy & set(sys.modules)))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert "HEAVY []" in done.stdout


def test_permitted_exits_with_0(capsys: Capture) -> None:
    assert cli.main(["check", manoeuvre("docking"), "--vehicle", "ackermann"]) == 0
    assert "docking by ackermann: permitted" in capsys.readouterr().out


def test_refused_exits_with_1_and_names_wheel_limit_place_and_numbers(
    capsys: Capture,
) -> None:
    assert cli.main(["check", manoeuvre("crab-corner"), "--vehicle", "ackermann"]) == 1
    out = capsys.readouterr().out
    assert "wheel front-left: steering angle 90.1°, at most 40.0° permitted at t" in out
    assert "[STEER_RANGE]" in out


def test_bad_input_exits_with_2(capsys: Capture) -> None:
    assert cli.main(["check", "nowhere.csv", "--vehicle", "mecanum"]) == 2
    assert "nowhere.csv" in capsys.readouterr().err


def test_unknown_vehicle_lists_the_catalogue(capsys: Capture) -> None:
    assert cli.main(["inspect", "hovercraft"]) == 2
    assert "ift-four-steered" in capsys.readouterr().err


def test_unknown_criterion_is_bad_input(capsys: Capture) -> None:
    arguments = ["select", manoeuvre("docking"), "--fleet", "mecanum", "--by", "beauty"]
    assert cli.main(arguments) == 2
    assert "one of duration, margin" in capsys.readouterr().err


def test_damaged_data_sheet_is_bad_input(tmp_path: Path, capsys: Capture) -> None:
    sheet = tmp_path / "bad.safetensors"
    sheet.write_bytes(b"nothing of use")
    assert cli.main(["check", manoeuvre("docking"), "--vehicle", str(sheet)]) == 2
    assert "damaged" in capsys.readouterr().err


def test_errors_are_json_where_json_is_asked_for(capsys: Capture) -> None:
    answer = run_json(capsys, "inspect", "hovercraft")
    assert isinstance(answer, dict)
    assert answer["error"] == "InvalidVehicle"


def test_check_as_json_is_a_list_of_reports(capsys: Capture) -> None:
    answer = run_json(
        capsys, "check", manoeuvre("crab-corner"), "--vehicle", "differential"
    )
    assert isinstance(answer, list)
    assert answer[0]["valid"] is False
    assert answer[0]["violations"][0]["limit"] == "FIXED_WHEEL"


def test_select_ranks_and_refuses(capsys: Capture) -> None:
    arguments = ["select", manoeuvre("parking-sideways")]
    arguments += ["--fleet", "ift-four-steered", "mecanum"]
    assert cli.main(arguments) == 0
    out = capsys.readouterr().out
    assert "│ 1. │ mecanum │" in out
    assert "no ift-four-steered: wheel" in out
    # 90° at 180°/s and 720°/s², from rest to rest: 0.5 s + 0.25 s.
    assert "advice: stand still for 0.75 s at t = 3.00 s" in out


def test_select_says_what_is_unfit(capsys: Capture) -> None:
    arguments = ["select", manoeuvre("docking"), "--by", "manoeuvrability"]
    arguments += ["--fleet", "agv-1=mecanum", "agv-2=mecanum", "ackermann"]
    arguments += ["--require", "crab 90 deg at 0.5 m/s", "--require", "no mirroring"]
    assert cli.main(arguments) == 0
    out = capsys.readouterr().out
    assert "│ agv-1   │" in out
    assert "│ agv-2   │" in out
    assert "180.0°" in out
    line = "unfit ackermann: crab 90 deg at 0.5 m/s: to the left and to the right, "
    assert (
        line + "0.5 m/s asked, nothing offered [STEER_RANGE, FIXED_WHEEL of wheel front"
        in out
    )


def test_requirements_need_no_trajectory(capsys: Capture) -> None:
    asked = ["--require", "turn-on-the-spot"]
    fleet = ["--fleet", "mecanum", "ackermann"]
    assert cli.main(["select", *fleet, *asked]) == 0
    assert "mecanum" in capsys.readouterr().out
    answer = run_json(capsys, "select", *fleet, *asked)
    assert isinstance(answer, dict)
    assert answer["suitable"] == ["mecanum"]
    assert answer["unfit"][0]["shortfalls"][0]["limit"] == "STEER_RANGE"
    assert cli.main(["select", *fleet, "--require", "payload 10 kg"]) == 1
    assert "the vehicle does not say" in capsys.readouterr().out


def test_select_needs_a_trajectory_or_a_requirement(capsys: Capture) -> None:
    assert cli.main(["select", "--fleet", "mecanum"]) == 2
    assert "no trajectory and no --require" in capsys.readouterr().err
    assert cli.main(["select", "--fleet", "mecanum", "--require", "fly"]) == 2
    assert "radius R m [at V m/s]" in capsys.readouterr().err


def test_help_of_select_lists_the_requirements(capsys: Capture) -> None:
    with pytest.raises(SystemExit):
        cli.main(["select", "--help"])
    out = capsys.readouterr().out
    for phrase in PHRASES:  # argparse breaks lines anywhere
        assert "".join(phrase.split()) in "".join(out.split())


def test_exported_sheet_judges_without_the_vehicle(
    tmp_path: Path, capsys: Capture
) -> None:
    sheet = tmp_path / "mecanum.safetensors"
    assert cli.main(["export", "mecanum", str(sheet)]) == 0
    assert cli.main(["check", manoeuvre("docking"), "--vehicle", str(sheet)]) == 0
    assert "not judged: change rates" in capsys.readouterr().out


def test_inspect_shows_the_figures_of_the_paper(
    tmp_path: Path, capsys: Capture
) -> None:
    arguments = ["inspect", "ift-four-steered", "--plot", str(tmp_path)]
    assert cli.main(arguments) == 0
    out = capsys.readouterr().out
    assert "4.1013 1/m" in out
    assert (tmp_path / "space-ift-four-steered.png").stat().st_size > 10_000


def test_check_draws_trajectories(tmp_path: Path) -> None:
    arguments = ["check", manoeuvre("docking"), "--vehicle", "mecanum"]
    assert cli.main([*arguments, "--plot", str(tmp_path)]) == 0
    for kind in ("way", "space", "times"):
        assert (tmp_path / f"docking-mecanum-{kind}.png").stat().st_size > 5_000


def test_catalog_and_schema_print_json(capsys: Capture) -> None:
    names = run_json(capsys, "catalog")
    assert isinstance(names, list)
    assert {"ackermann", "differential", "ift-four-steered", "mecanum"} <= set(names)
    schema = run_json(capsys, "schema", "vehicle")
    assert isinstance(schema, dict)
    assert "wheels" in schema["properties"]


def test_query_without_a_server_is_a_failure(capsys: Capture) -> None:
    arguments = ["query", "health", "--connect", "tcp/127.0.0.1:1", "--timeout", "1"]
    assert cli.main(arguments) == 3
    assert "tcp/127.0.0.1:1" in capsys.readouterr().err


def test_query_needs_what_it_asks_about(capsys: Capture) -> None:
    assert cli.main(["query", "check", manoeuvre("docking")]) == 2
    assert "no vehicle" in capsys.readouterr().err


@pytest.mark.service
def test_demo_judges_over_zenoh_and_draws(tmp_path: Path, capsys: Capture) -> None:
    rankings = run_json(capsys, "demo", "--output", str(tmp_path))
    assert isinstance(rankings, list)
    assert len(rankings) >= 6
    refused = [report for ranking in rankings for report in ranking["refused"]]
    assert refused
    for report in refused:
        assert report["violations"]
    assert len(list(tmp_path.glob("space-*.png"))) == 4
    assert (tmp_path / "manoeuvres.png").exists()


@pytest.mark.service
def test_serve_answers_queries_until_it_is_stopped(
    tmp_path: Path, capsys: Capture
) -> None:
    command = [sys.executable, "-m", "omniplan.cli", "serve", "--json"]
    command += ["--fleet", "mecanum", "--listen", "tcp/127.0.0.1:0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout is not None
            lines = []
            for line in server.stdout:  # the JSON it prints once it listens
                lines.append(line)
                if line == "}\n":
                    break
            endpoint = json.loads("".join(lines))["endpoint"]
            to_it = ["--connect", endpoint]
            assert cli.main(["query", "vehicles", *to_it]) == 0
            assert capsys.readouterr().out == "mecanum\n"
            turn = manoeuvre("turn-on-the-spot")
            query = ["query", "check", turn, "--vehicle", "mecanum", *to_it]
            assert cli.main(query) == 0
            assert cli.main(["query", "select", turn, *to_it]) == 0
            assert "│ mecanum │" in capsys.readouterr().out
            file = str(tmp_path / "verdicts.parquet")
            many = ["query", "many", turn, "--output", file, *to_it]
            assert run_json(capsys, *many) == {"output": file, "pairs": 1, "valid": 1}
            file = str(tmp_path / "mecanum.safetensors")
            sheet = ["query", "sheet", "--vehicle", "mecanum", "--output", file]
            assert run_json(capsys, *sheet, *to_it) == {"output": file}
        finally:
            server.terminate()
        assert server.wait(timeout=20) == 0


def test_mistakes_in_a_servers_configuration_are_bad_input(
    tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "server.toml"
    file.write_text("[queue]\nlength = 3")
    monkeypatch.setenv("OMNIPLAN_WORKERS", "0")
    monkeypatch.setenv("OMNIPLAN_CONFIG", str(file))
    assert cli.main(["serve", "--site", "a/b"]) == 2
    message = capsys.readouterr().err
    assert "queue.length: unknown key; allowed are size, bytes" in message
    assert "OMNIPLAN_WORKERS: 0; " in message
    assert "--site: 'a/b'; " in message


def test_the_schema_of_every_message_is_published(capsys: Capture) -> None:
    names = run_json(capsys, "schema", "messages")
    assert isinstance(names, list)
    assert "BatchValidateRequest" in names
    for name in names:
        schema = run_json(capsys, "schema", name)
        assert isinstance(schema, dict)
        assert schema["title"] == name
    assert cli.main(["schema", "nothing"]) == 2
    assert "ValidateRequest" in capsys.readouterr().err


def test_the_schema_of_a_servers_configuration_is_published(capsys: Capture) -> None:
    assert cli.main(["schema", "service"]) == 0
    schema = json.loads(capsys.readouterr().out)
    assert "queue" in schema["properties"]


def piped(*arguments: str) -> subprocess.CompletedProcess[str]:
    """The command as a process whose output nobody watches."""
    command = [sys.executable, "-m", "omniplan.cli", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_a_fleet_leaves_no_blank_lines_where_nobody_watches(tmp_path: Path) -> None:
    out = str(tmp_path / "verdicts.parquet")
    done = piped("check", manoeuvre("docking"), "--fleet", "ackermann", "--out", out)
    assert done.returncode == 0
    assert done.stderr == ""
    lines = [f"{x},0,0\n" for x in (0, 1, 2)]
    path = tmp_path / "path.csv"
    path.write_text("x,y,theta\n" + "".join(lines))
    done = piped("check", str(path), "--fleet", "ackermann", "--out", out)
    assert (done.returncode, done.stderr) == (0, "")


def test_angles_of_requirements_are_answered_in_degrees(capsys: Capture) -> None:
    assert cli.main(["select", "--fleet", "mecanum", "--require", "crab 400 deg"]) == 2
    err = capsys.readouterr().err
    assert "400 deg" in err
    assert "180 deg" in err
    assert "rad" not in err
