"""The examples of `examples/deploy` are what the command line takes."""

from __future__ import annotations

import configparser
import json
import re
import shlex
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

from omniplan import cli
from omniplan.shell import asking, serving
from omniplan.shell.answers import BAD_INPUT
from services.operating.config import ServiceConfig, load_config, variables

FOLDER = Path(__file__).parents[3] / "examples" / "deploy"
CONFIG = FOLDER / "server.toml"
CONTAINER = (FOLDER / "Containerfile").read_text("utf-8")
OURS = re.compile(r"OMNIPLAN_\w+")


@pytest.fixture
def unit() -> dict[str, list[str]]:
    """The entries of the unit, with all values of those that repeat."""
    found: dict[str, list[str]] = {}
    for line in (FOLDER / "omniplan.service").read_text("utf-8").splitlines():
        name, sign, value = line.partition("=")
        if sign and not line.startswith("#"):
            found.setdefault(name, []).append(value)
    return found


def test_the_unit_is_well_formed(unit: dict[str, list[str]]) -> None:
    parser = configparser.ConfigParser(strict=False, interpolation=None)
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read(FOLDER / "omniplan.service")
    assert parser.sections() == ["Unit", "Service", "Install"]
    assert unit["DynamicUser"] == ["yes"]
    assert unit["NoNewPrivileges"] == ["yes"]
    assert unit["RestartPreventExitStatus"] == [str(BAD_INPUT)]


def test_the_units_command_line_is_taken(unit: dict[str, list[str]]) -> None:
    program, *arguments = shlex.split(unit["ExecStart"][0])
    assert program.endswith("/bin/omniplan")
    options = cli._parser().parse_args(arguments)
    assert options.config == "/etc/omniplan/server.toml"
    assert options.run is serving.serve


def test_the_kill_comes_after_the_time_to_stop(unit: dict[str, list[str]]) -> None:
    assert int(unit["TimeoutStopSec"][0]) > ServiceConfig().stop_within


def test_the_unit_leaves_room_for_the_registered_vehicles(
    unit: dict[str, list[str]],
) -> None:
    (most,) = unit["MemoryMax"]
    assert most.endswith("G")
    # The program itself and its work take half a gigabyte.
    least = ServiceConfig().registration.max_memory + 2**29
    assert int(most[:-1]) * 2**30 >= least


def test_every_variable_of_the_examples_is_known(unit: dict[str, list[str]]) -> None:
    known = {*variables(), "OMNIPLAN_CACHE", "OMNIPLAN_CONFIG"}
    named = set(OURS.findall(" ".join(unit["Environment"]))) | set(
        OURS.findall(CONTAINER)
    )
    assert named
    assert named <= known


def test_the_config_parses_and_shows_the_defaults() -> None:
    config = load_config(CONFIG)
    shown = config.model_dump()
    # What a remark says to be no default.
    shown["fleet"] = None
    shown["log"]["format"] = "text"
    assert shown == ServiceConfig().model_dump()


def test_what_is_commented_out_parses_too(tmp_path: Path) -> None:
    text = re.sub(r"^# (?=\w+ = |\[)", "", CONFIG.read_text("utf-8"), flags=re.M)
    path = tmp_path / "all.toml"
    path.write_text(text)
    config = load_config(path)
    assert config.security is not None
    assert config.security.planners == ("planner-1",)
    assert config.registration.store == Path("/var/lib/omniplan")
    named = {
        f"{table}.{key}" if isinstance(value, dict) else table
        for table, value in tomllib.loads(text).items()
        for key in (value if isinstance(value, dict) else [""])
    }
    # Listening without certificates is not what an example should offer.
    assert named == set(variables().values()) - {"allow_insecure"}


def test_the_container_runs_as_nobody_in_particular() -> None:
    users = re.findall(r"^USER (.*)$", CONTAINER, re.M)
    assert users[-1] == "10001"
    (entry,) = re.findall(r"^ENTRYPOINT (.*)$", CONTAINER, re.M)
    command = json.loads(entry)
    assert cli._parser().parse_args(command[1:]).run is serving.serve
    (health,) = re.findall(r"^    CMD (\[.*\])$", CONTAINER, re.M)
    assert cli._parser().parse_args(json.loads(health)[1:]).run is asking.query


@pytest.mark.skipif(not shutil.which("systemd-analyze"), reason="no systemd here")
def test_systemd_finds_no_mistake_in_the_unit(tmp_path: Path) -> None:
    text = (FOLDER / "omniplan.service").read_text("utf-8")
    unit = tmp_path / "omniplan.service"
    # The program of the example is not installed here.
    unit.write_text(re.sub(r"(?<=ExecStart=)\S+", "/bin/true", text))
    run = subprocess.run(
        ["systemd-analyze", "verify", str(unit)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert "omniplan.service" not in run.stderr
