"""The page on security does what it says, from the first command on."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest
from loopback import ANY_TLS_PORT, Fleet

import services
from omniplan.cli import main
from services import Client, Security
from services.guarding.access import _QUESTIONS, _REGISTRATION, Roles, access_control
from services.guarding.certificates import _REFUSALS
from services.operating.config import load_config
from services.operating.launch import registry_of, server_of
from services.protocol.keys import Keys

PAGE = (Path(__file__).parents[2] / "docs" / "security.md").read_text("utf-8")
BLOCKS: dict[str, str] = dict(
    re.findall(r"^```(\w+)\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
)
FILES = ("ca.pem", "planner-1.pem", "planner-1.key")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files that the page's commands make."""
    if shutil.which("openssl") is None:
        pytest.skip("openssl is not here")
    folder = tmp_path_factory.mktemp("page")
    subprocess.run(
        ["sh", "-e", "-c", BLOCKS["sh"]],
        cwd=folder,
        check=True,
        capture_output=True,
        timeout=60,
    )
    return folder


@pytest.mark.service
def test_the_python_example_prints_what_the_page_says(folder: Path) -> None:
    root = str(Path(services.__file__).parents[1])
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", BLOCKS["python"]],
        capture_output=True,
        cwd=folder,
        env={
            **os.environ,
            "OMNIPLAN_CACHE": str(folder / "cache"),
            "PYTHONPATH": root,
        },
        text=True,
        timeout=100,
        check=False,
    )
    assert (run.stdout, run.stderr) == (BLOCKS["text"], "")


@pytest.mark.service
def test_the_configuration_makes_a_server_that_a_planner_can_ask(
    folder: Path, fleet: Fleet
) -> None:
    path = folder / "server.toml"
    path.write_text(BLOCKS["toml"])
    config = load_config(path, {}, {"listen": ANY_TLS_PORT})
    ca, certificate, key = (folder / name for name in FILES)
    with (
        closing(registry_of(config, fleet)) as registry,
        server_of(config, registry) as server,
        Client(
            server.endpoint, timeout=30.0, security=Security(ca, certificate, key)
        ) as client,
    ):
        assert client.vehicles() == tuple(space.name for space in fleet)


@pytest.mark.service
def test_the_command_line_asks_with_certificates(
    folder: Path, fleet: Fleet, capsys: pytest.CaptureFixture[str]
) -> None:
    path = folder / "served.toml"
    path.write_text(BLOCKS["toml"])
    config = load_config(
        path, {}, {"listen": ANY_TLS_PORT, "registration.store": folder / "other"}
    )
    flags = [
        word
        for option, name in zip(("--ca", "--certificate", "--key"), FILES, strict=True)
        for word in (option, str(folder / name))
    ]
    with (
        closing(registry_of(config, fleet)) as registry,
        server_of(config, registry) as server,
    ):
        query = ["query", "vehicles", "--connect", server.endpoint, *flags]
        assert main([*query, "--trust", "server-1"]) == 0
        names = [space.name for space in fleet]
        assert capsys.readouterr().out.split() == names
        # The server is none of those.
        assert main([*query, "--trust", "server-2"]) == 3
        assert "nobody answers" in capsys.readouterr().err
        assert main(query[:-2]) == 2
        assert "--key: not given" in capsys.readouterr().err
        assert main(query[:4]) == 2
        assert "certificates (security)" in capsys.readouterr().err


def test_every_key_of_a_role_is_on_the_page() -> None:
    table = PAGE[PAGE.index("| role |") : PAGE.index("## Certificates")]
    for key in (*_QUESTIONS, *_REGISTRATION):
        shown = key.replace("/*", "/{id}")
        assert f"`{shown}`" in table or f"`{key}`" in table or key == "cancel/*", key
    rules = access_control(Roles(vehicles=("agv-7",)), Keys("default"))["rules"]
    assert "vehicles/agv-7/online" in str(rules)


def test_every_refusal_on_the_page_is_one_that_is_raised() -> None:
    table = PAGE[PAGE.index("| reason |") :]
    shown = re.findall(r"^\| ([^|]+) \| ", table, re.MULTILINE)[1:]
    assert len(shown) >= 7
    assert shown.pop() == "a server is there, but this certificate may not ask ..."
    assert set(shown) <= {words for _, words in _REFUSALS}
