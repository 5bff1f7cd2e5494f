"""Requests, replies and publications of zenoh as plain values; its errors as ours."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import Any
from weakref import WeakSet

import zenoh

from services.errors import ServiceError

__all__ = [
    "Publication",
    "Reply",
    "Request",
    "Stop",
    "Stream",
    "encoding_of",
    "published",
    "reason_of",
    "received",
    "wrapped",
]

# Where in zenoh's sources an error arose says nothing to our users.
# Nor do the options that it appends to an address.
_NOISE = re.compile(r" at /[^ ]*\.rs:\d+\.?|#(?:[\w.]+=[^ ;]*;?)+(?=: )")


class Request:
    """One request received; use it in a ``with`` block, or the caller waits in vain."""

    def __init__(self, query: zenoh.Query) -> None:
        self._query = query
        self.key = str(query.key_expr)
        """What was asked; may have wildcards."""
        payload = query.payload
        self.n_bytes = 0 if payload is None else len(payload)
        """Size of the payload."""

    @property
    def is_wild(self) -> bool:
        """Whether the key has wildcards."""
        return "*" in self.key

    @property
    def payload(self) -> bytes:
        """The payload, copied; empty if there is none."""
        payload = self._query.payload
        return b"" if payload is None else payload.to_bytes()

    @property
    def encoding(self) -> str:
        """Encoding of the payload as zenoh names it; empty if there is none."""
        encoding = self._query.encoding
        return "" if encoding is None else str(encoding)

    def matches(self, key: str) -> bool:
        """Return whether a concrete key was asked."""
        return self._query.key_expr.intersects(zenoh.KeyExpr(key))

    def reply(self, key: str, payload: bytes, encoding: str) -> None:
        """Send one reply under its concrete key."""
        with wrapped(f"reply to {self.key}"):
            self._query.reply(key, payload, encoding=encoding_of(encoding))

    def fail(self, payload: bytes, encoding: str) -> None:
        """Send an error reply."""
        with wrapped(f"reply to {self.key}"):
            self._query.reply_err(payload, encoding=encoding_of(encoding))

    def __enter__(self) -> Request:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        # Dropping tells the caller that there is no more to come.
        self._query.drop()  # type: ignore[no-untyped-call]


@dataclass(frozen=True)
class Publication:
    """What was put, or that a key was deleted."""

    key: str
    is_delete: bool
    n_bytes: int
    read: Callable[[], bytes]
    """Returns the payload, copied."""


@dataclass(frozen=True)
class Reply:
    """One reply received."""

    is_error: bool
    payload: bytes
    encoding: str

    @property
    def is_timeout(self) -> bool:
        """Whether it is zenoh's own word that somebody has not answered in time."""
        return self.is_error and self.payload == b"Timeout"


class Stop:
    """Ends questions from another thread; one may be given to many."""

    def __init__(self) -> None:
        self.token = zenoh.CancellationToken()
        """For questions whose replies zenoh itself keeps.

        Where they go to a function of ours, zenoh waits until that has returned, and
        was seen to wait for ever.
        """
        self._ended: WeakSet[Stream | Stop] = WeakSet()
        self._lock = threading.Lock()
        self._event = threading.Event()

    @property
    def is_set(self) -> bool:
        """Whether nobody waits for an answer any longer."""
        return self._event.is_set()

    def set(self) -> None:
        """End the questions: they look as if nobody had more to say."""
        with self._lock:
            self._event.set()
            ended = list(self._ended)
        for one in ended:
            one.set()
        self.token.cancel()  # type: ignore[no-untyped-call]

    def ends(self, other: Stream | Stop) -> None:
        """Let it end a stream, or what another one ends, too."""
        with self._lock:
            self._ended.add(other)
        if self.is_set:
            other.set()

    def wait(self, timeout: float) -> bool:
        """Wait until it is set, or for so many seconds; return whether it is."""
        return self._event.wait(timeout)


class Stream:
    """The replies to one question in their order, as they come."""

    def __init__(self) -> None:
        self._replies: SimpleQueue[Reply | None] = SimpleQueue()

    def receive(self, timeout: float) -> Reply | None:
        """Return the next reply; None if there are no more.

        Raises
        ------
        TimeoutError
            If neither is known in time, s.
        """
        try:
            return self._replies.get(timeout=timeout)
        except Empty:
            raise TimeoutError from None

    def put(self, reply: Reply) -> None:
        """Add a reply."""
        self._replies.put(reply)

    def set(self) -> None:
        """Add the end."""
        self._replies.put(None)


@lru_cache(maxsize=64)
def encoding_of(text: str) -> zenoh.Encoding:
    """Return zenoh's encoding of a name."""
    return zenoh.Encoding(text)


@contextmanager
def wrapped(doing: str) -> Iterator[None]:
    """Turn zenoh's errors into ServiceError."""
    try:
        yield
    except zenoh.ZError as error:
        raise ServiceError(f"cannot {doing}: {reason_of(error)}") from error


def reason_of(error: zenoh.ZError) -> str:
    """Return what zenoh says, without where in its sources."""
    return _NOISE.sub("", str(error))[:500]


def published(sample: zenoh.Sample) -> Publication:
    """Return what a subscriber is given, as a value; the payload is not read yet."""
    is_delete = sample.kind == zenoh.SampleKind.DELETE
    payload = sample.payload
    return Publication(
        str(sample.key_expr), is_delete, len(payload), lambda: payload.to_bytes()
    )


def received(reply: zenoh.Reply) -> Reply:
    """Return a reply as a value."""
    ok = reply.ok
    if ok is not None:
        return Reply(False, ok.payload.to_bytes(), str(ok.encoding))
    # A reply is one or the other.
    error: Any = reply.err
    return Reply(True, error.payload.to_bytes(), str(error.encoding))
