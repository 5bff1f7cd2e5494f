"""Sessions of zenoh.

They are peers that talk to the given endpoints only: no multicast, no gossip, no shared
memory, nothing read from the environment.
"""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any

import zenoh

from services.errors import (
    ServiceError,
    ServiceRefused,
    ServiceTimeout,
    ServiceUnreachable,
)
from services.guarding.certificates import refusal
from services.protocol.endpoint import Endpoint
from services.wire.exchange import (
    Publication,
    Reply,
    Request,
    Stop,
    Stream,
    encoding_of,
    published,
    reason_of,
    received,
    wrapped,
)

__all__ = ["Peer"]

AT_ONCE = 0.25
"""One of several endpoints that is there is connected to within this time, s."""
MAX_MESSAGE = 64 * 2**20
"""A longer message ends the connection, bytes; requests end well below."""


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
            More of zenoh's configuration, as of `zenoh_entries`.
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
            reason = reason_of(error)
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
            More of zenoh's configuration, as of `zenoh_entries`.

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
            reason = reason_of(error)
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
        with wrapped("connect"):
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
        with wrapped(f"serve {key}"):
            queryable = self._session.declare_queryable(
                key, lambda query: receive(Request(query)), complete=True
            )
        self._declared.append(queryable)

    def announce(self, key: str) -> Callable[[], None]:
        """Declare a liveliness token and return how to take it back.

        It goes when the session does.
        """
        with wrapped(f"announce {key}"):
            token = self._session.liveliness().declare_token(key)
        return self._declare(token)

    def publish(self, key: str, payload: bytes, encoding: str) -> None:
        """Send to all who follow a key; waits while the way to one of them is full."""
        with wrapped(f"publish {key}"):
            self._session.put(
                key,
                payload,
                encoding=encoding_of(encoding),
                congestion_control=zenoh.CongestionControl.BLOCK,
            )

    def erase(self, key: str) -> None:
        """Publish that a key is deleted."""
        with wrapped(f"erase {key}"):
            self._session.delete(key, congestion_control=zenoh.CongestionControl.BLOCK)

    def follow(
        self, key: str, receive: Callable[[Publication], None]
    ) -> Callable[[], None]:
        """Pass what others publish to `receive`; return how to end that.

        It must not block.
        """
        with wrapped(f"follow {key}"):
            subscriber = self._session.declare_subscriber(
                key,
                lambda sample: receive(published(sample)),
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
        with wrapped(f"watch {key}"):
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
        with wrapped("withdraw"):
            while self._declared:
                self._declared.pop().undeclare()

    def gather(
        self, key: str, payload: bytes, encoding: str, timeout: float
    ) -> dict[str, bytes]:
        """Ask all others, and return their answers by key.

        Error replies, and answers that do not come in time, are left out.
        """
        with wrapped(f"ask {key}"):
            channel = self._session.get(
                key,
                payload=payload,
                encoding=encoding_of(encoding),
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
        with wrapped(f"ask {key}"):
            channel = self._session.get(
                key,
                payload=payload,
                encoding=None if payload is None else encoding_of(encoding),
                timeout=timeout,
                target=zenoh.QueryTarget.ALL if everyone else None,
                # Otherwise the first reply is held back until there are no more.
                consolidation=zenoh.ConsolidationMode.NONE if first else None,
                cancellation_token=None if stop is None else stop.token,
            )
            for reply in channel:
                replies.append(received(reply))
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
            lambda reply: stream.put(received(reply)), stream.set
        )
        with wrapped(f"ask {key}"):
            self._session.get(
                key,
                receive,
                payload=payload,
                encoding=encoding_of(encoding),
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
        with wrapped(f"tell {key}"):
            self._session.get(
                key, lambda _: None, timeout=timeout, target=zenoh.QueryTarget.ALL
            )

    def wait_for_token(self, key: str, timeout: float) -> bool:
        """Return whether a liveliness token is there, or comes in time."""
        seen = threading.Event()

        def notice(sample: zenoh.Sample) -> None:
            if sample.kind == zenoh.SampleKind.PUT:
                seen.set()

        with wrapped(f"wait for {key}"):
            subscriber = self._session.liveliness().declare_subscriber(
                key, notice, history=True
            )
            try:
                return seen.wait(timeout)
            finally:
                subscriber.undeclare()  # type: ignore[no-untyped-call]

    def close(self) -> None:
        """End the session."""
        with wrapped("close the session"):
            self._session.close()  # type: ignore[no-untyped-call]

    def _declare(self, thing: Any) -> Callable[[], None]:
        """Keep what was declared until `withdraw`; return how to end it before."""
        self._declared.append(thing)

        def undeclare() -> None:
            with suppress(ValueError):  # withdrawn already
                self._declared.remove(thing)
                with wrapped("undeclare"):
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
