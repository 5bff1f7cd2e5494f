"""The protocol page says what the code does."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from services import messages
from services.errors import CODES
from services.keys import Keys

PAGE = (Path(__file__).parents[2] / "docs" / "service.md").read_text("utf-8")
BLOCKS: list[tuple[str, str]] = re.findall(
    r"^```(\w+(?: \w+)?)\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL
)


@pytest.mark.service
def test_the_python_example_prints_what_the_page_says(tmp_path: Path) -> None:
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


@pytest.mark.parametrize(
    ("name", "text"),
    [(kind.split()[1], text) for kind, text in BLOCKS if kind.startswith("json ")],
)
def test_every_example_message_fits_its_model(name: str, text: str) -> None:
    message = messages.decode(getattr(messages, name), text.encode())
    if isinstance(message, messages.ValidateReply | messages.SelectReply):
        assert message.values()
    if isinstance(message, messages.ValidateRequest | messages.SelectRequest):
        limits = messages.RequestLimits()
        assert messages.trajectories_from(message.trajectories, limits)


def test_every_message_has_an_example() -> None:
    shown = {kind.split()[1] for kind, _ in BLOCKS if kind.startswith("json ")}
    names = {name for name in messages.__all__ if name.endswith(("Request", "Reply"))}
    assert shown == names | {"Health"}


def test_the_table_of_codes_is_complete() -> None:
    table = dict(re.findall(r"^\| `(\w+)` \| (.*) \|$", PAGE, re.MULTILINE))
    assert {code: table.get(code) for code in CODES} == dict(CODES)


def test_every_key_is_in_the_table() -> None:
    root = Keys("default").root
    for key in Keys("default").all_of(["id"]):
        relative = key.removeprefix(f"{root}/").replace("/id", "/{id}")
        assert f"| `{relative}` |" in PAGE
