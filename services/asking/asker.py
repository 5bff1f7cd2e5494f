"""How a client asks: one connection, deadlines, and asking again where that is safe.

Every question leaves the server as it was, or may be repeated without doing more. So it
is asked again, until its time is over, when nobody answered or the server said that it
was busy or about to stop; with pauses that grow and differ from client to client.
"""

from __future__ import annotations

import random
import threading
import time
import uuid
from collections.abc import Callable, Mapping, Sequence
from weakref import WeakSet

from services.errors import (
    InvalidMessage,
    RemoteError,
    ServiceError,
    ServiceRefused,
    ServiceTimeout,
    ServiceUnreachable,
)
from services.protocol.endpoint import Endpoint
from services.protocol.keys import Keys, Route
from services.protocol.messages import JSON, ErrorReply, decode
from services.wire.exchange import Reply, Stop
from services.wire.session import Peer

__all__ = ["Asker", "Attempts", "error_of"]

AGAIN = ("busy", "closing")
"""Codes after which the same question may be answered by another server, or later."""
GONE_FOR = 0.1
"""A server must be gone for so long before what was asked is asked again, s."""
FIRST_PAUSE, LONGEST_PAUSE = 0.02, 1.0
"""Between two attempts, s."""
SEEN_WITHIN = 0.2
"""How long it is looked for servers where nobody answers, s."""
IGNORED = 3
"""After so many attempts that no server answered, access control refuses them."""

Payload = Callable[[str, float], bytes]
"""Returns the payload for the name of a request and the time for it, s."""


class Asker:
    """Asks the servers of a site; safe with several threads.

    Parameters
    ----------
    endpoints : sequence of Endpoint
    keys : Keys
    entries : mapping
        Of `services.guarding.security.zenoh_entries`.
    attempt_timeout : float, s
        Time for one attempt.
    retry : bool
        Whether to ask again.
    """

    def __init__(
        self,
        endpoints: Sequence[Endpoint],
        keys: Keys,
        entries: Mapping[str, object],
        attempt_timeout: float,
        *,
        retry: bool,
    ) -> None:
        self.keys = keys
        self.attempt_timeout = attempt_timeout
        self.retry = retry
        self._endpoints = tuple(endpoints)
        self._entries = entries
        self._lock = threading.Lock()
        self._peer: Peer | None = None
        self._is_closed = False
        self._has_met = False
        self._attempts: WeakSet[Stop] = WeakSet()
        self._lost_one = Stop()
        """Ends the attempts that nothing else ends; a new one after each loss."""

    @property
    def where(self) -> str:
        """The addresses, for messages."""
        return " or ".join(map(str, self._endpoints))

    def peer(self, timeout: float, patience: float = 0.0) -> Peer:
        """Return the session, opened if there is none yet."""
        with self._lock:
            if self._is_closed:
                raise ServiceError("the client is closed")
            if self._peer is None:
                self._peer = Peer.connected_any(
                    self._endpoints, timeout, patience, self._entries
                )
                # Of several the nearest may be one that is about to go.
                self._has_met |= len(self._endpoints) > 1
                if self.retry:
                    self._peer.watch(self.keys.servers, self._seen)
            return self._peer

    def close(self) -> None:
        """End the connection; more questions are errors."""
        with self._lock:
            self._is_closed = True
            peer, self._peer = self._peer, None
        if peer is not None:
            peer.close()

    def ask(
        self,
        route: Route,
        payload: bytes | Payload | None,
        timeout: float,
        stop: Stop | None = None,
    ) -> bytes:
        """Return the payload of the answer to one question, asked until it comes."""
        key = self.keys.of(route)
        attempts = Attempts(self, key, timeout, stop, is_change=route.is_change)
        while True:
            try:
                return self._asked(key, payload, attempts, stop)
            except ServiceError as error:
                attempts.pause_after(error)

    def met(self) -> None:
        """Note that somebody has answered."""
        self._has_met = True

    def may_repeat(self, error: Exception) -> bool:
        """Return whether to ask again after an error."""
        if not self.retry or isinstance(error, ServiceRefused):
            return False
        if isinstance(error, RemoteError):
            return error.code in AGAIN
        if isinstance(error, ServiceUnreachable):
            # Who has never had an answer asks the wrong place, or too early.
            return self._has_met
        return isinstance(error, ServiceTimeout)

    def cancel(self, peer: Peer, name: str) -> None:
        """Tell the servers that nobody waits for an answer any longer."""
        peer.tell(self.keys.of(Route("cancel", name)), self.attempt_timeout)

    def attempt(self, stop: Stop | None) -> Stop:
        """Return what ends one attempt: the given one, or that a server goes."""
        if stop is None:
            return self._lost_one
        own = Stop()
        stop.ends(own)
        with self._lock:
            self._attempts.add(own)
        return own

    def _seen(self, token: str, is_there: bool) -> None:
        """Notice that a server has gone; called in zenoh's thread."""
        if is_there:
            return
        instance = token.rpartition("/")[2]
        timer = threading.Timer(GONE_FOR, self._lost, [instance])
        timer.daemon = True
        timer.start()

    def _lost(self, instance: str) -> None:
        """End the attempts under way where a server has been lost.

        zenoh may leave unanswered what was asked while the connection broke. A server
        that is still connected stops gently, and will answer.
        """
        with self._lock:
            if self._peer is None or self._peer.is_connected_to(instance):
                return
            under_way = [*self._attempts, self._lost_one]
            self._lost_one = Stop()
        for attempt in under_way:
            attempt.set()

    def _asked(
        self,
        key: str,
        payload: bytes | Payload | None,
        attempts: Attempts,
        stop: Stop | None,
    ) -> bytes:
        """Return the payload of the answer to one attempt."""
        began = time.monotonic()
        timeout = attempts.next_timeout()
        peer = self.peer(timeout)
        attempt = self.attempt(stop)
        name = uuid.uuid4().hex if callable(payload) else ""
        replies = peer.ask(
            key,
            payload(name, timeout) if callable(payload) else payload,
            JSON,
            max(0.001, timeout - (time.monotonic() - began)),
            first=True,
            everyone=attempts.is_everyone_asked,
            stop=attempt,
        )
        if attempt.is_set and not replies:
            if name:
                self.cancel(peer, name)
            if stop is not None and stop.is_set:
                raise ServiceError(f"{key}: the question was cancelled")
            raise ServiceUnreachable(self.where, "the server has gone")
        if not replies:
            raise self._unanswered(peer, key, attempts)
        self.met()
        # One server is enough, whatever others say.
        reply = min(replies, key=lambda reply: reply.is_error)
        if reply.is_error:
            raise error_of(reply)
        return reply.payload

    def _unanswered(
        self, peer: Peer, key: str, attempts: Attempts
    ) -> ServiceUnreachable:
        """Return what it means that nobody answers: nobody is there, or may not ask."""
        unreachable = ServiceUnreachable(self.where, f"nobody answers {key}")
        if not (self._entries and peer.wait_for_token(self.keys.servers, SEEN_WITHIN)):
            return unreachable
        self.met()
        attempts.n_ignored += 1
        # Once or twice: the server that was asked may have gone, and another be there.
        if attempts.n_ignored < IGNORED:
            return unreachable
        reason = f"a server is there, but this certificate may not ask {key}"
        return ServiceRefused(self.where, reason)


class Attempts:
    """The attempts at one question, with pauses, until its time is over.

    Parameters
    ----------
    asker : Asker
    key : str
        What is asked.
    timeout : float, s
        For all attempts together.
    stop : Stop, optional
        Ends a pause.
    is_change : bool
        Never ask everyone: each server would give the change a version of its own.
    """

    def __init__(
        self,
        asker: Asker,
        key: str,
        timeout: float,
        stop: Stop | None = None,
        *,
        is_change: bool = False,
    ) -> None:
        self._asker, self._key, self._stop = asker, key, stop
        self._timeout = timeout
        self._is_change = is_change
        self.is_everyone_asked = False
        """Whether all servers are asked, not only the nearest."""
        self.n_ignored = 0
        """How often nobody answered although a server was there."""
        self.begin()

    def begin(self) -> None:
        """Let the time begin anew."""
        self._deadline = time.monotonic() + self._timeout
        self._pause = FIRST_PAUSE

    def next_timeout(self) -> float:
        """Return the time for the next attempt, s."""
        left = self._deadline - time.monotonic()
        return max(0.001, min(left, self._asker.attempt_timeout))

    def pause_after(self, error: ServiceError) -> None:
        """Wait until the next attempt; raises if there is no use in one.

        Raises
        ------
        ServiceError
            The one given, or ServiceTimeout for all attempts.
        """
        if isinstance(error, ServiceTimeout):
            # Who was asked may hang: now whoever is there.
            self.is_everyone_asked = not self._is_change
        # Differs from client to client, so that they do not come back together.
        seconds = self._pause * random.uniform(0.5, 1.0)
        self._pause = min(2 * self._pause, LONGEST_PAUSE)
        is_late = time.monotonic() + seconds >= self._deadline
        if is_late or not self._asker.may_repeat(error):
            raise error
        if self._stop is None:
            time.sleep(seconds)
        elif self._stop.wait(seconds):
            raise error


def error_of(reply: Reply) -> ServiceError:
    """Return the error that an error reply stands for."""
    try:
        error = decode(ErrorReply, reply.payload)
    except InvalidMessage:
        shown = repr(reply.payload[:80])
        return ServiceError(f"the server sent an error that cannot be read: {shown}")
    return RemoteError(error.code, error.message, error.field)
