"""The page on registration says what the code does."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from services.operating.config import load_config
from services.protocol import messages
from services.protocol.keys import Keys
from services.registering import registry_messages
from services.registering.registry import MAX_VEHICLE_BYTES
from services.registering.sync import CATCH_UP_WITHIN, MEET_WITHIN
from services.registering.versions import Version

PAGE = (Path(__file__).parents[2] / "docs" / "registration.md").read_text("utf-8")
BLOCKS: list[tuple[str, str]] = re.findall(
    r"^```(\w+(?: \w+)?)\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL
)
MESSAGES = {kind.split()[1]: text for kind, text in BLOCKS if kind.startswith("json ")}


@pytest.mark.service
def test_the_example_prints_what_the_page_says(tmp_path: Path) -> None:
    (script,) = (text for kind, text in BLOCKS if kind == "python")
    (printed,) = (text for kind, text in BLOCKS if kind == "text")
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", script],
        capture_output=True,
        env={**os.environ, "OMNIPLAN_CACHE": str(tmp_path)},
        text=True,
        timeout=100,
        check=False,
    )
    assert (run.stdout, run.stderr) == (printed, "")


@pytest.mark.parametrize("name", MESSAGES)
def test_every_example_message_fits_its_model(name: str) -> None:
    kind = getattr(registry_messages, name)
    message = messages.decode(kind, MESSAGES[name].encode())
    version = getattr(message, "version", None) or message.expected_version
    if version != "absent":
        Version.parse(version)


def test_every_message_of_clients_has_an_example() -> None:
    names = registry_messages.__all__
    shown = {name for name in names if name.endswith(("Request", "Reply", "Event"))}
    assert set(MESSAGES) == shown


def test_the_configuration_can_be_read(tmp_path: Path) -> None:
    (text,) = (text for kind, text in BLOCKS if kind == "toml")
    path = tmp_path / "service.toml"
    path.write_text(text)
    config = load_config(path)
    assert len(config.peers) == 2
    assert config.registration.enabled


def test_the_keys_and_numbers_are_those_of_the_code() -> None:
    keys = Keys("default")
    for key in (keys.event("id"), keys.online("id")):
        relative = key.removeprefix(f"{keys.root}/").replace("/id", "/{id}")
        assert f"| `{relative}` |" in PAGE
    assert MAX_VEHICLE_BYTES == 512 * 1024
    assert "512 KiB" in PAGE
    assert f"it waits {MEET_WITHIN:g} s" in PAGE
    assert f"and {CATCH_UP_WITHIN:g} s at most" in PAGE
