"""The log of a server: one line per record, as text for people or JSON for programs.

A record may carry fields: ``log.info("request", extra={"fields": {...}})``. What others
have sent stands in them quoted, so that no request can write a line of its own.
"""

from __future__ import annotations

import json
import logging
import sys
import time
from typing import Literal, TextIO, TypeAlias

__all__ = ["JsonFormatter", "LogFormat", "LogLevel", "TextFormatter", "configure"]

LogLevel: TypeAlias = Literal["debug", "info", "warning", "error"]
LogFormat: TypeAlias = Literal["text", "json"]


def configure(
    level: LogLevel, format: LogFormat, stream: TextIO | None = None
) -> logging.Handler:
    """Send the records of this process to a stream.

    Parameters
    ----------
    level : {"debug", "info", "warning", "error"}
        What is less is left out.
    format : {"text", "json"}
    stream : text file, optional
        Default standard error.

    Returns
    -------
    handler : logging.Handler
        The one added to the root logger.
    """
    handler = logging.StreamHandler(stream or sys.stderr)
    handler.setFormatter(JsonFormatter() if format == "json" else TextFormatter())
    root = logging.getLogger()
    root.addHandler(handler)
    root.setLevel(level.upper())
    return handler


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
