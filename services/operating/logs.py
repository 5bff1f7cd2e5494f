"""The log of a server: one line per record, as text for people or JSON for programs.

A record may carry fields: ``log.info("request", extra={"fields": {...}})``. What others
have sent stands in them quoted, so that no request can write a line of its own.
"""

from __future__ import annotations

import atexit
import json
import logging
import logging.handlers
import queue
import sys
import time
from typing import Literal, TextIO, TypeAlias

__all__ = [
    "JsonFormatter",
    "LogFormat",
    "LogLevel",
    "Relay",
    "TextFormatter",
    "configure",
]

QUEUE_SIZE = 10_000
"""Records that may wait to be written; more are dropped."""
LAST_WORDS = 1.0
"""How long the end of the process waits for records to be written, s."""

LogLevel: TypeAlias = Literal["debug", "info", "warning", "error"]
LogFormat: TypeAlias = Literal["text", "json"]


def configure(
    level: LogLevel, format: LogFormat, stream: TextIO | None = None
) -> Relay:
    """Send the records of this process to a stream, from a thread of its own.

    A reader who has stopped reading stops no request: records that find the queue full
    are dropped and counted.

    Parameters
    ----------
    level : {"debug", "info", "warning", "error"}
        What is less is left out.
    format : {"text", "json"}
    stream : text file, optional
        Default standard error.

    Returns
    -------
    handler : Relay
        The one added to the root logger.
    """
    writer = logging.StreamHandler(stream or sys.stderr)
    writer.setFormatter(JsonFormatter() if format == "json" else TextFormatter())
    handler = Relay(writer)
    root = logging.getLogger()
    root.addHandler(handler)
    root.setLevel(level.upper())
    atexit.register(handler.drain, LAST_WORDS)
    return handler


class Relay(logging.handlers.QueueHandler):
    """Hands records to a thread that writes them; never waits.

    Parameters
    ----------
    writer : logging.Handler
    size : int
        Records that may wait.
    """

    def __init__(self, writer: logging.Handler, size: int = QUEUE_SIZE) -> None:
        self._records: queue.Queue[logging.LogRecord] = queue.Queue(size)
        super().__init__(self._records)
        self.n_dropped = 0
        """Records that found the queue full."""
        logging.handlers.QueueListener(self._records, writer).start()

    def prepare(self, record: logging.LogRecord) -> logging.LogRecord:
        """Return the record as it is: it stays within the process."""
        return record

    def enqueue(self, record: logging.LogRecord) -> None:
        """Put a record into the queue, or drop it."""
        try:
            self._records.put_nowait(record)
        except queue.Full:
            self.n_dropped += 1

    def drain(self, timeout: float) -> bool:
        """Wait until all records are written; return whether they are.

        Parameters
        ----------
        timeout : float, s
        """
        deadline = time.monotonic() + timeout
        while self._records.unfinished_tasks and time.monotonic() < deadline:
            time.sleep(0.005)
        return not self._records.unfinished_tasks


class JsonFormatter(logging.Formatter):
    """One JSON object per line: time (UTC), level, logger, message, the fields."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line."""
        data = {
            "time": _utc(record),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
            **_fields(record),
        }
        if record.exc_info:
            data["exception"] = self.formatException(record.exc_info)
        return json.dumps(data, default=str)


class TextFormatter(logging.Formatter):
    """Time (UTC), level, logger, message, then ``name=value`` for the fields."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line; a traceback follows on lines of its own."""
        parts = [_utc(record), record.levelname, record.name, record.getMessage()]
        parts += [f"{name}={_plain(value)}" for name, value in _fields(record).items()]
        line = " ".join(parts)
        if record.exc_info:
            line += "\n" + self.formatException(record.exc_info)
        return line


def _fields(record: logging.LogRecord) -> dict[str, object]:
    fields: dict[str, object] = getattr(record, "fields", {})
    return fields


def _utc(record: logging.LogRecord) -> str:
    whole = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(record.created))
    return f"{whole}.{int(record.msecs):03d}Z"


def _plain(value: object) -> str:
    """Return a value as one word; quoted where it would not be one."""
    text = str(value)
    is_word = text.isascii() and text.isprintable() and not set(text) & set(' "=')
    return text if text and is_word else json.dumps(text)
