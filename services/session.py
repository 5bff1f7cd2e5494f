"""The one importer of zenoh: sessions, requests and replies as plain values.

Errors of zenoh become ServiceError here. Sessions are peers that talk to the given
endpoints only: no multicast, no gossip, no shared memory, nothing read from the
environment.
"""

from __future__ import annotations

import json
import re
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import TracebackType
from typing import Any

import zenoh

from services.endpoint import Endpoint
from services.errors import ServiceError, ServiceTimeout, ServiceUnreachable

__all__ = ["Peer", "Reply", "Request"]

MAX_MESSAGE = 64 * 2**20
"""A longer message ends the connection, bytes; requests end well below."""
# Where in zenoh's sources an error arose says nothing to our users.
_SOURCE_PLACE = re.compile(r" at /[^ ]*\.rs:\d+\.?")


class Request:
    """One request received; use it in a ``with`` block, or the caller waits in vain."""

    def __init__(self, query: zenoh.Query) -> None:
        self._query = query
        self.key = str(query.key_expr)
        """What was asked; may have wildcards."""
        self.n_bytes = 0 if query.payload is None else len(query.payload)
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
        with _wrapped(f"reply to {self.key}"):
            self._query.reply(key, payload, encoding=zenoh.Encoding(encoding))

    def fail(self, payload: bytes, encoding: str) -> None:
        """Send an error reply."""
        with _wrapped(f"reply to {self.key}"):
            self._query.reply_err(payload, encoding=zenoh.Encoding(encoding))

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
class Reply:
    """One reply received."""

    is_error: bool
    payload: bytes
    encoding: str


class Peer:
    """A zenoh session; `listening` and `connected` open one."""

    def __init__(self, session: zenoh.Session, endpoint: Endpoint) -> None:
        self._session = session
        self.endpoint = endpoint
        """Where it listens or whom it asks."""
        self._declared: list[Any] = []

    @classmethod
    def listening(cls, endpoint: Endpoint) -> Peer:
        """Return a session that others can connect to.

        Raises
        ------
        ServiceError
            If it cannot listen there.
        """
        endpoint = endpoint.concrete()
        try:
            session = zenoh.open(_config(listen=[str(endpoint)]))
        except zenoh.ZError as error:
            reason = _reason(error)
            if "Address already in use" in reason:
                reason = "the port is in use"
            raise ServiceError(f"cannot listen at {endpoint}: {reason}") from error
        return cls(session, endpoint)

    @classmethod
    def connected(cls, endpoint: Endpoint, timeout: float, patience: float) -> Peer:
        """Return a session that is connected; it reconnects by itself.

        Parameters
        ----------
        endpoint : Endpoint
        timeout : float, s
            For one attempt.
        patience : float, s
            How long to try again while nobody listens there; 0: try once.

        Raises
        ------
        ServiceUnreachable
            If it cannot connect.
        """
        config = _config(
            connect=[str(endpoint)],
            open_timeout=max(1, round(timeout * 1000)),
            connect_timeout=round(patience * 1000),
        )
        try:
            session = zenoh.open(config)
        except zenoh.ZError as error:
            reason = _reason(error)
            if "Connection refused" in reason:
                reason = "nobody listens there"
            elif "deadline" in reason or "Timeout" in reason:
                reason = f"no connection within {max(timeout, patience):g} s"
            raise ServiceUnreachable(str(endpoint), reason) from error
        return cls(session, endpoint)

    @property
    def instance(self) -> str:
        """Name of the session, unique."""
        return str(self._session.zid())

    def serve(self, key: str, receive: Callable[[Request], None]) -> None:
        """Pass every request below a key expression to `receive`; it must not block."""
        with _wrapped(f"serve {key}"):
            queryable = self._session.declare_queryable(
                key, lambda query: receive(Request(query)), complete=True
            )
        self._declared.append(queryable)

    def announce(self, key: str) -> None:
        """Declare a liveliness token; it goes when the session does."""
        with _wrapped(f"announce {key}"):
            self._declared.append(self._session.liveliness().declare_token(key))

    def withdraw(self) -> None:
        """Receive no more requests; those received can still be answered."""
        with _wrapped("withdraw"):
            while self._declared:
                self._declared.pop().undeclare()

    def ask(
        self, key: str, payload: bytes | None, encoding: str, timeout: float
    ) -> list[Reply]:
        """Ask, and wait until all have answered; nobody there: an empty list.

        Raises
        ------
        ServiceTimeout
            If somebody is there and does not answer in time.
        """
        with _wrapped(f"ask {key}"):
            channel = self._session.get(
                key,
                payload=payload,
                encoding=None if payload is None else zenoh.Encoding(encoding),
                timeout=timeout,
            )
            replies = [_received(reply) for reply in channel]
        # zenoh reports its own timeout as an error reply that is no JSON.
        in_time = [r for r in replies if not (r.is_error and r.payload == b"Timeout")]
        if replies and not in_time:
            raise ServiceTimeout(key, timeout)
        return in_time

    def wait_for_token(self, key: str, timeout: float) -> bool:
        """Return whether a liveliness token is there, or comes in time."""
        seen = threading.Event()

        def notice(sample: zenoh.Sample) -> None:
            if sample.kind == zenoh.SampleKind.PUT:
                seen.set()

        with _wrapped(f"wait for {key}"):
            subscriber = self._session.liveliness().declare_subscriber(
                key, notice, history=True
            )
            try:
                return seen.wait(timeout)
            finally:
                subscriber.undeclare()  # type: ignore[no-untyped-call]

    def close(self) -> None:
        """End the session."""
        with _wrapped("close the session"):
            self._session.close()  # type: ignore[no-untyped-call]


def _config(
    listen: list[str] | None = None,
    connect: list[str] | None = None,
    open_timeout: int = 10_000,
    connect_timeout: int = 0,
) -> zenoh.Config:
    """Return a configuration; timeouts in ms."""
    config = zenoh.Config()
    retry = {
        "period_init_ms": 20,
        "period_max_ms": 500,
        "period_increase_factor": 1.5,
    }
    for key, value in {
        "mode": "peer",
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/shared_memory/enabled": False,
        "transport/unicast/open_timeout": open_timeout,
        "transport/link/rx/max_message_size": MAX_MESSAGE,
        "listen/endpoints": listen or [],
        "connect/endpoints": connect or [],
        "connect/timeout_ms": connect_timeout,
        "connect/exit_on_failure": True,
        "connect/retry": retry,
    }.items():
        config.insert_json5(key, json.dumps(value))
    return config


@contextmanager
def _wrapped(doing: str) -> Iterator[None]:
    """Turn zenoh's errors into ServiceError."""
    try:
        yield
    except zenoh.ZError as error:
        raise ServiceError(f"cannot {doing}: {_reason(error)}") from error


def _reason(error: zenoh.ZError) -> str:
    return _SOURCE_PLACE.sub("", str(error))[:500]


def _received(reply: zenoh.Reply) -> Reply:
    if reply.ok is not None:
        return Reply(False, reply.ok.payload.to_bytes(), str(reply.ok.encoding))
    # A reply is one or the other.
    error: Any = reply.err
    return Reply(True, error.payload.to_bytes(), str(error.encoding))
