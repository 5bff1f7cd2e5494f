"""The one importer of zenoh: sessions, requests and replies as plain values.

Errors of zenoh become ServiceError here. Sessions are peers that talk to the given
endpoints only: no multicast, no gossip, no shared memory, nothing read from the
environment.
"""

from __future__ import annotations

import json
import re
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import lru_cache
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import Any
from weakref import WeakSet

import zenoh

from services.certificates import refusal
from services.endpoint import Endpoint
from services.errors import (
    ServiceError,
    ServiceRefused,
    ServiceTimeout,
    ServiceUnreachable,
)

__all__ = ["Peer", "Publication", "Reply", "Request", "Stop", "Stream"]

AT_ONCE = 0.25
"""One of several endpoints that is there is connected to within this time, s."""
MAX_MESSAGE = 64 * 2**20
"""A longer message ends the connection, bytes; requests end well below."""
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
        with _wrapped(f"reply to {self.key}"):
            self._query.reply(key, payload, encoding=_encoding(encoding))

    def fail(self, payload: bytes, encoding: str) -> None:
        """Send an error reply."""
        with _wrapped(f"reply to {self.key}"):
            self._query.reply_err(payload, encoding=_encoding(encoding))

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


class Peer:
    """A zenoh session; `listening` and `connected` open one."""

    def __init__(self, session: zenoh.Session, endpoint: Endpoint) -> None:
        self._session = session
        self.endpoint = endpoint
        """Where it listens or whom it asks."""
        self._declared: list[Any] = []

    @classmethod
    def listening(
        cls,
        endpoint: Endpoint,
        entries: Mapping[str, object] | None = None,
        peers: Sequence[Endpoint] = (),
    ) -> Peer:
        """Return a session that others can connect to.

        Parameters
        ----------
        endpoint : Endpoint
        entries : mapping, optional
            More of zenoh's configuration, as of `services.security.zenoh_entries`.
        peers : sequence of Endpoint, optional
            Others to connect to whenever they are there; none has to be.

        Raises
        ------
        ServiceError
            If it cannot listen there.
        """
        endpoint = endpoint.concrete()
        try:
            session = zenoh.open(
                _config(
                    listen=[str(endpoint)],
                    connect=[str(peer) for peer in peers],
                    connect_timeout=-1 if peers else 0,
                    entries={"connect/exit_on_failure": not peers, **(entries or {})},
                )
            )
        except zenoh.ZError as error:
            reason = _reason(error)
            if "Address already in use" in reason:
                reason = "the port is in use"
            raise ServiceError(f"cannot listen at {endpoint}: {reason}") from error
        return cls(session, endpoint)

    @classmethod
    def connected(
        cls,
        endpoint: Endpoint,
        timeout: float,
        patience: float,
        entries: Mapping[str, object] | None = None,
    ) -> Peer:
        """Return a session that is connected; it reconnects by itself.

        Parameters
        ----------
        endpoint : Endpoint
        timeout : float, s
            For one attempt.
        patience : float, s
            How long to try again while nobody listens there; 0: try once.
        entries : mapping, optional
            More of zenoh's configuration, as of `services.security.zenoh_entries`.

        Raises
        ------
        ServiceUnreachable
            If it cannot connect; ServiceRefused if TLS refuses.
        """
        if patience and endpoint.is_tls:
            # zenoh does not say why it was refused when it has tried for long.
            try:
                return cls.connected(endpoint, timeout, 0, entries)
            except ServiceUnreachable as error:
                if isinstance(error, ServiceRefused):
                    raise
        config = _config(
            connect=[str(endpoint)],
            open_timeout=max(1, round(timeout * 1000)),
            connect_timeout=round(patience * 1000),
            entries=entries,
        )
        try:
            session = zenoh.open(config)
        except zenoh.ZError as error:
            reason = _reason(error)
            refused = refusal(reason)
            if refused is not None:
                raise ServiceRefused(str(endpoint), refused) from error
            if "Connection refused" in reason:
                reason = "nobody listens there"
            elif "early eof" in reason and not endpoint.is_tls:
                reason = "it ended the connection; it may ask for tls/"
            elif "deadline" in reason or "Timeout" in reason:
                reason = f"no connection within {max(timeout, patience):.3g} s"
            raise ServiceUnreachable(str(endpoint), reason) from error
        return cls(session, endpoint)

    @classmethod
    def connected_any(
        cls,
        endpoints: Sequence[Endpoint],
        timeout: float,
        patience: float,
        entries: Mapping[str, object] | None = None,
    ) -> Peer:
        """Return a session that is connected to one endpoint at least.

        It connects to the others whenever they are there.

        Parameters
        ----------
        endpoints : sequence of Endpoint
        timeout, patience, entries
            As for `connected`.

        Raises
        ------
        ServiceUnreachable
            If it cannot connect to any of them, with the reason of each.
        """
        if len(endpoints) == 1:
            return cls.connected(endpoints[0], timeout, patience, entries)
        config = _config(
            connect=[str(endpoint) for endpoint in endpoints],
            open_timeout=max(1, round(timeout * 1000)),
            connect_timeout=-1,
            entries={
                "connect/exit_on_failure": False,
                # Or opening takes half a second as soon as one of them is missing.
                "open/return_conditions/connect_scouted": False,
                **(entries or {}),
            },
        )
        with _wrapped("connect"):
            peer = cls(zenoh.open(config), endpoints[0])
        if not peer.wait_until_met(max(patience, min(timeout, AT_ONCE))):
            try:
                _explain(endpoints, timeout / len(endpoints), entries)
                peer._require_met(endpoints, timeout)
            except ServiceError:
                peer.close()
                raise
        return peer

    def wait_until_met(self, timeout: float) -> bool:
        """Return whether the session is connected to anybody, or is so in time."""
        deadline = time.monotonic() + timeout
        while not self._session.info.peers_zid() + self._session.info.routers_zid():
            if time.monotonic() >= deadline:
                return False
            time.sleep(0.002)  # zenoh offers no way to wait for it
        return True

    def _require_met(self, endpoints: Sequence[Endpoint], timeout: float) -> None:
        if not self.wait_until_met(timeout):
            where = ", ".join(map(str, endpoints))
            raise ServiceUnreachable(where, f"no connection within {timeout:.3g} s")

    def is_connected_to(self, instance: str) -> bool:
        """Return whether there is a connection to the session of this name."""
        return any(str(one) == instance for one in self._session.info.peers_zid())

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

    def announce(self, key: str) -> Callable[[], None]:
        """Declare a liveliness token and return how to take it back.

        It goes when the session does.
        """
        with _wrapped(f"announce {key}"):
            token = self._session.liveliness().declare_token(key)
        return self._declare(token)

    def publish(self, key: str, payload: bytes, encoding: str) -> None:
        """Send to all who follow a key; waits while the way to one of them is full."""
        with _wrapped(f"publish {key}"):
            self._session.put(
                key,
                payload,
                encoding=_encoding(encoding),
                congestion_control=zenoh.CongestionControl.BLOCK,
            )

    def erase(self, key: str) -> None:
        """Publish that a key is deleted."""
        with _wrapped(f"erase {key}"):
            self._session.delete(key, congestion_control=zenoh.CongestionControl.BLOCK)

    def follow(
        self, key: str, receive: Callable[[Publication], None]
    ) -> Callable[[], None]:
        """Pass what others publish to `receive`; return how to end that.

        It must not block.
        """
        with _wrapped(f"follow {key}"):
            subscriber = self._session.declare_subscriber(
                key,
                lambda sample: receive(_published(sample)),
                allowed_origin=zenoh.Locality.REMOTE,
            )
        return self._declare(subscriber)

    def watch(
        self, key: str, notice: Callable[[str, bool], None]
    ) -> Callable[[], None]:
        """Tell which liveliness tokens are there, come and go; return how to end that.

        Parameters
        ----------
        key : str
            Expression for the tokens.
        notice : callable
            Is given the key of a token and whether it is there; must not block.
        """
        with _wrapped(f"watch {key}"):
            subscriber = self._session.liveliness().declare_subscriber(
                key,
                lambda sample: notice(
                    str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT
                ),
                history=True,
            )
        return self._declare(subscriber)

    def withdraw(self) -> None:
        """Receive no more requests; those received can still be answered."""
        with _wrapped("withdraw"):
            while self._declared:
                self._declared.pop().undeclare()

    def gather(
        self, key: str, payload: bytes, encoding: str, timeout: float
    ) -> dict[str, bytes]:
        """Ask all others, and return their answers by key.

        Error replies, and answers that do not come in time, are left out.
        """
        with _wrapped(f"ask {key}"):
            channel = self._session.get(
                key,
                payload=payload,
                encoding=_encoding(encoding),
                timeout=timeout,
                target=zenoh.QueryTarget.ALL,
                consolidation=zenoh.ConsolidationMode.NONE,
                allowed_destination=zenoh.Locality.REMOTE,
            )
            return {
                str(reply.ok.key_expr): reply.ok.payload.to_bytes()
                for reply in channel
                if reply.ok is not None
            }

    def ask(
        self,
        key: str,
        payload: bytes | None,
        encoding: str,
        timeout: float,
        *,
        first: bool = False,
        everyone: bool = False,
        stop: Stop | None = None,
    ) -> list[Reply]:
        """Ask, and wait until all have answered; nobody there: an empty list.

        Parameters
        ----------
        key : str
        payload : bytes, optional
        encoding : str
            Of the payload.
        timeout : float, s
        first : bool
            Wait no longer than for the first answer that is no error.
        everyone : bool
            Ask all servers and not only the nearest.
        stop : Stop, optional
            Ends the wait.

        Raises
        ------
        ServiceTimeout
            If somebody is there and does not answer in time.
        """
        replies = []
        with _wrapped(f"ask {key}"):
            channel = self._session.get(
                key,
                payload=payload,
                encoding=None if payload is None else _encoding(encoding),
                timeout=timeout,
                target=zenoh.QueryTarget.ALL if everyone else None,
                cancellation_token=None if stop is None else stop.token,
            )
            for reply in channel:
                replies.append(_received(reply))
                if first and not replies[-1].is_error:
                    break
        # zenoh reports its own timeout as an error reply that is no JSON.
        in_time = [r for r in replies if not r.is_timeout]
        if replies and not in_time:
            raise ServiceTimeout(key, timeout)
        return in_time

    def stream(
        self,
        key: str,
        payload: bytes,
        encoding: str,
        timeout: float,
        *,
        everyone: bool = False,
        stop: Stop,
    ) -> Stream:
        """Ask what is answered in several replies; parameters as for `ask`."""
        stream = Stream()
        stop.ends(stream)
        # zenoh's annotations leave open what the callback is given.
        receive: Any = zenoh.handlers.Callback(
            lambda reply: stream.put(_received(reply)), stream.set
        )
        with _wrapped(f"ask {key}"):
            self._session.get(
                key,
                receive,
                payload=payload,
                encoding=_encoding(encoding),
                timeout=timeout,
                # Otherwise all replies but the last of a key are left out.
                consolidation=zenoh.ConsolidationMode.NONE,
                target=zenoh.QueryTarget.ALL if everyone else None,
                # Small questions go first; the replies have the same priority.
                priority=zenoh.Priority.DATA_LOW,
            )
        return stream

    def tell(self, key: str, timeout: float) -> None:
        """Ask all servers and let nobody wait for the answer."""
        with _wrapped(f"tell {key}"):
            self._session.get(
                key, lambda _: None, timeout=timeout, target=zenoh.QueryTarget.ALL
            )

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

    def _declare(self, thing: Any) -> Callable[[], None]:
        """Keep what was declared until `withdraw`; return how to end it before."""
        self._declared.append(thing)

        def undeclare() -> None:
            with suppress(ValueError):  # withdrawn already
                self._declared.remove(thing)
                with _wrapped("undeclare"):
                    thing.undeclare()

        return undeclare


def _config(
    listen: list[str] | None = None,
    connect: list[str] | None = None,
    open_timeout: int = 10_000,
    connect_timeout: int = 0,
    entries: Mapping[str, object] | None = None,
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
        "adminspace/enabled": False,
        "transport/unicast/open_timeout": open_timeout,
        "transport/link/rx/max_message_size": MAX_MESSAGE,
        "listen/endpoints": listen or [],
        "connect/endpoints": connect or [],
        "connect/timeout_ms": connect_timeout,
        "connect/exit_on_failure": True,
        "connect/retry": retry,
        **(entries or {}),
    }.items():
        config.insert_json5(key, json.dumps(value))
    return config


def _explain(
    endpoints: Sequence[Endpoint], timeout: float, entries: Mapping[str, object] | None
) -> None:
    """Raise with the reasons why none of several endpoints can be connected to."""
    reasons = []
    is_refused = True
    for endpoint in endpoints:
        try:
            Peer.connected(endpoint, timeout, 0, entries).close()
        except ServiceUnreachable as error:
            reasons.append(f"{endpoint}: {error.reason}")
            is_refused &= isinstance(error, ServiceRefused)
        else:
            return
    kind = ServiceRefused if is_refused else ServiceUnreachable
    raise kind("any of several addresses", "; ".join(reasons))


@lru_cache(maxsize=64)
def _encoding(text: str) -> zenoh.Encoding:
    return zenoh.Encoding(text)


@contextmanager
def _wrapped(doing: str) -> Iterator[None]:
    """Turn zenoh's errors into ServiceError."""
    try:
        yield
    except zenoh.ZError as error:
        raise ServiceError(f"cannot {doing}: {_reason(error)}") from error


def _reason(error: zenoh.ZError) -> str:
    return _NOISE.sub("", str(error))[:500]


def _published(sample: zenoh.Sample) -> Publication:
    is_delete = sample.kind == zenoh.SampleKind.DELETE
    payload = sample.payload
    return Publication(
        str(sample.key_expr), is_delete, len(payload), lambda: payload.to_bytes()
    )


def _received(reply: zenoh.Reply) -> Reply:
    ok = reply.ok
    if ok is not None:
        return Reply(False, ok.payload.to_bytes(), str(ok.encoding))
    # A reply is one or the other.
    error: Any = reply.err
    return Reply(True, error.payload.to_bytes(), str(error.encoding))
