"""The protocol page says what the code does."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from services import schemas
from services.errors import CODES
from services.protocol import batch_messages, messages
from services.protocol.keys import Keys, Route
from services.registering import registry_messages

PAGE = (Path(__file__).parents[2] / "docs" / "service.md").read_text("utf-8")
BLOCKS: list[tuple[str, str]] = re.findall(
    r"^```(\w+(?: \w+)?)\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL
)


SCRIPTS = [text for kind, text in BLOCKS if kind == "python"]
PRINTED = [text for kind, text in BLOCKS if kind == "text"]


@pytest.mark.service
@pytest.mark.parametrize(
    ("script", "printed"),
    list(zip(SCRIPTS, PRINTED, strict=True)),
    ids=["first", "many"],
)
def test_the_python_examples_print_what_the_page_says(
    script: str, printed: str, tmp_path: Path
) -> None:
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", script],
        capture_output=True,
        env={**os.environ, "OMNIPLAN_CACHE": str(tmp_path)},
        text=True,
        timeout=100,
        check=False,
    )
    assert run.stderr == ""
    # Into how many parts an answer is cut depends on the machine.
    assert run.stdout.replace("]\n[", ", ") == printed.replace("]\n[", ", ")


@pytest.mark.parametrize(
    ("name", "text"),
    [(kind.split()[1], text) for kind, text in BLOCKS if kind.startswith("json ")],
)
def test_every_example_message_fits_its_model(name: str, text: str) -> None:
    message = messages.decode(schemas.MESSAGES[name], text.encode())
    if isinstance(message, messages.ValidateReply | messages.SelectReply):
        assert message.values()
    if isinstance(message, messages.ValidateRequest | messages.SelectRequest):
        limits = messages.RequestLimits()
        assert messages.trajectories_from(message.trajectories, limits)


def test_every_message_has_an_example() -> None:
    shown = {kind.split()[1] for kind, _ in BLOCKS if kind.startswith("json ")}
    elsewhere = set(registry_messages.__all__)
    assert shown == set(schemas.MESSAGES) - elsewhere


def test_every_public_message_has_a_schema() -> None:
    modules = (messages, batch_messages, registry_messages)
    names = {name for module in modules for name in module.__all__}
    among_servers = {"Digest", "RecordEntry", "Records", "Wanted"}
    ends = ("Request", "Reply", "Part", "Event")
    assert {name for name in names - among_servers if name.endswith(ends)} | {
        "Health"
    } == set(schemas.MESSAGES)
    for name in schemas.MESSAGES:
        schema = schemas.message_schema(name)
        assert schema["title"] == name
        assert schema["additionalProperties"] is False
        assert all(
            "description" in one or "$ref" in one
            for one in schema["properties"].values()
        )


def test_the_table_of_codes_is_complete() -> None:
    table = dict(re.findall(r"^\| `(\w+)` \| (.*) \|$", PAGE, re.MULTILINE))
    assert {code: table.get(code) for code in CODES} == dict(CODES)


def test_every_key_is_in_the_table() -> None:
    root = Keys("default").root
    keys = Keys("default")
    for key in (*keys.all_of(["id"]), keys.of(Route("cancel", "id"))):
        relative = key.removeprefix(f"{root}/").replace("/id", "/{id}")
        relative = relative.replace("cancel/{id}", "cancel/{request}")
        assert f"| `{relative}` |" in PAGE
