from __future__ import annotations

import io
import json
import logging
import threading
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.operating.logs import (
    JsonFormatter,
    LogFormat,
    Relay,
    TextFormatter,
    configure,
)


@pytest.fixture
def root() -> Iterator[logging.Logger]:
    logger = logging.getLogger()
    level, handlers = logger.level, list(logger.handlers)
    yield logger
    logger.setLevel(level)
    logger.handlers[:] = handlers


def record(message: str, **fields: object) -> logging.LogRecord:
    made = logging.LogRecord("a.b", logging.INFO, "", 0, message, None, None)
    made.created, made.msecs = 1_700_000_000.25, 250.0
    made.fields = fields
    return made


def test_a_json_line_has_time_level_logger_message_and_fields() -> None:
    line = JsonFormatter().format(record("request", key="k", ms=1.5))
    assert json.loads(line) == {
        "time": "2023-11-14T22:13:20.250Z",
        "level": "info",
        "logger": "a.b",
        "message": "request",
        "key": "k",
        "ms": 1.5,
    }


def test_a_text_line_has_the_same() -> None:
    line = TextFormatter().format(record("request", key="k", ms=1.5))
    assert line == "2023-11-14T22:13:20.250Z INFO a.b request key=k ms=1.5"


@given(st.text())
def test_what_others_send_cannot_begin_a_line(text: str) -> None:
    for formatter in (JsonFormatter(), TextFormatter()):
        line = formatter.format(record("request", key=text))
        assert len(line.splitlines()) == 1
    assert json.loads(JsonFormatter().format(record("m", key=text)))["key"] == text


def test_a_value_cannot_pass_for_another_field() -> None:
    line = TextFormatter().format(record("request", key="x code=ok"))
    assert line.endswith('key="x code=ok"')


@pytest.mark.parametrize("format", ["text", "json"])
def test_errors_are_logged_with_their_traceback(
    root: logging.Logger, format: LogFormat
) -> None:
    stream = io.StringIO()
    relay = configure("warning", format, stream)
    log = logging.getLogger("services.test")
    log.info("left out")
    try:
        raise ValueError("broken")
    except ValueError:
        log.exception("failed")
    assert relay.drain(5.0)
    text = stream.getvalue()
    assert "left out" not in text
    assert "ValueError: broken" in text
    if format == "json":
        (line,) = text.splitlines()
        assert "Traceback" in json.loads(line)["exception"]


def test_a_reader_who_stops_reading_stops_nobody() -> None:
    """The writer hangs, as at a full pipe; records are dropped, callers go on."""
    is_free, is_begun = threading.Event(), threading.Event()

    class Hanging(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            is_begun.set()
            is_free.wait(30)

    relay = Relay(Hanging(), size=4)
    relay.handle(record("first"))
    assert is_begun.wait(10)
    for i in range(10):
        relay.handle(record(f"record {i}"))
    assert relay.n_dropped == 6
    assert not relay.drain(0.02)
    is_free.set()
    assert relay.drain(10.0)
