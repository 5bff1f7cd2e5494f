"""The pages list every key, message and code of the service, and none there is not."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

from services import schemas
from services.errors import CODES
from services.protocol import keys
from services.protocol.keys import Keys, Verb

ROOT = Path(__file__).parents[2]
SERVICE = (ROOT / "docs" / "service.md").read_text("utf-8")
REGISTRATION = (ROOT / "docs" / "registration.md").read_text("utf-8")
SOURCES = [path.read_text("utf-8") for path in (ROOT / "services").rglob("*.py")]


def section(page: str, title: str) -> str:
    """Return what stands below a heading, up to the next of the same level."""
    level = title.partition(" ")[0]
    (text,) = re.findall(
        rf"^{re.escape(title)}\n(.*?)(?=^{level} |\Z)", page, re.MULTILINE | re.DOTALL
    )
    return str(text)


def first_cells(text: str) -> list[str]:
    """Return what stands in backticks in the first column of tables."""
    rows = re.findall(r"^\| (`.*?) \|", text, re.MULTILINE)
    return [name for row in rows for name in re.findall(r"`([^`]+)`", row)]


def test_the_table_of_keys_has_every_verb_and_no_key_there_is_not() -> None:
    known = Keys("default")
    rows = first_cells(section(SERVICE, "## Keys"))
    routes = [
        known.route(f"{known.root}/{re.sub(r'{[a-z]+}', 'some', row)}") for row in rows
    ]
    assert sorted(route.verb for route in routes) == sorted(get_args(Verb))
    for row, route in zip(rows, routes, strict=True):
        key = known.of(route).removeprefix(f"{known.root}/")
        assert re.sub(r"{[a-z]+}", "some", row) == key


def test_every_key_of_the_module_is_on_a_page() -> None:
    assert keys.__doc__ is not None
    listed = re.findall(r"^omniplan/v1/\{site\}/(\S+)", keys.__doc__, re.MULTILINE)
    assert len(listed) >= len(get_args(Verb))
    for key in listed:
        if key.startswith("@sync"):
            continue  # among servers only
        assert f"{key}`" in SERVICE + REGISTRATION


def test_the_table_of_codes_has_no_code_there_is_not() -> None:
    assert first_cells(section(SERVICE, "### ErrorReply")) == sorted(CODES)


def test_every_code_is_sent_somewhere_and_every_one_sent_is_known() -> None:
    code = r"""(?:code=|code = |Refused\(|_coded\(|_refused\(|stop\(|stop_all\()\s*"""
    sent = {x for text in SOURCES for x in re.findall(rf'{code}"([a-z_]+)"', text)}
    # What ends a request for the caller is no error of it.
    sent -= {"ok"}
    assert sent <= set(CODES)
    # The table of the codes itself is no use of one.
    used = [re.sub(r"(?s)^CODES: Mapping.*?^\)", "", x, flags=re.M) for x in SOURCES]
    quoted = {x for text in used for x in re.findall(r'"([a-z_]+)"', text)}
    assert set(CODES) <= quoted


def test_every_message_in_the_tables_of_keys_exists() -> None:
    tables = section(SERVICE, "## Keys") + section(REGISTRATION, "## Keys")
    named = set(re.findall(r"\b[A-Z]\w+(?:Request|Reply|Event|Part)\b", tables))
    assert named <= set(schemas.MESSAGES)
    # An ErrorReply may come from every key.
    assert set(schemas.MESSAGES) - named == {"Health", "ErrorReply"}
    assert "Health" in tables
