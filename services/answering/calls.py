"""One request under way: what handler, scheduler and caller tell each other.

A handler works in parts; between them the server asks `Call.check` whether to go on. So
a deadline, a caller who has lost interest and a server that stops are noticed within
one part, whatever the handler does.
"""

from __future__ import annotations

import itertools
import math
import threading
import time
from collections import OrderedDict

from services.errors import CallStopped
from services.protocol.keys import checked_chunk

__all__ = ["Call", "Calls"]

REMEMBERED = 1024
"""Names of cancelled calls that are kept for requests still on their way."""


class Call:
    """One request from its arrival to its last reply.

    Parameters
    ----------
    calls : Calls
        Where it is known by its name.
    key : str
        What is asked.
    n_bytes : int
        Size of the payload.
    max_time : float, s, > 0
        After which it is given up, whatever the caller asks for.
    """

    def __init__(
        self, calls: Calls, key: str, n_bytes: int = 0, max_time: float = math.inf
    ) -> None:
        self.key = key
        self.n_bytes = n_bytes
        self.received_at = time.monotonic()
        """When it arrived, s, monotonic clock."""
        self.id = calls.next_id()
        """For the log: a number, or the name that the caller gave it."""
        self.n_samples = 0
        """Samples in the request, for the log; the handler counts them."""
        self.code = "ok"
        """How it ended: ``ok`` or one of `CODES`."""
        self._calls = calls
        self._expires_at = self.received_at + max_time
        self._stopped = ""

    @classmethod
    def local(cls, key: str = "") -> Call:
        """Return a call that comes from nowhere, to use handlers without a server."""
        return cls(Calls(), key)

    @property
    def age(self) -> float:
        """Time since its arrival, s."""
        return time.monotonic() - self.received_at

    def begin(self, name: str | None, deadline: float | None) -> None:
        """Take over what a request says of itself: see `expires_in` and `named`."""
        self.expires_in(deadline)
        if name is not None:
            self.named(name)

    def expires_in(self, seconds: float | None) -> None:
        """Set the deadline that the caller asks for; raises if it has passed.

        Parameters
        ----------
        seconds : float, s, optional
            Counted from the arrival. A later deadline than that known changes nothing.

        Raises
        ------
        CallStopped
            As `check`.
        """
        if seconds is not None:
            self._expires_at = min(self._expires_at, self.received_at + seconds)
        self.check()

    def named(self, name: str) -> None:
        """Make it known by the name under which its caller may cancel it.

        Raises
        ------
        CallStopped
            If it was cancelled before.
        InvalidInput
            If the name cannot be one chunk of a key.
        """
        self.id = checked_chunk("request", name)
        self._calls.enter(name, self)
        self.check()

    def stop(self, code: str) -> None:
        """Let the next `check` raise; the first code stays."""
        self._stopped = self._stopped or code

    def check(self) -> None:
        """Raise CallStopped if there is no use to go on."""
        if not self._stopped and time.monotonic() >= self._expires_at:
            self._stopped = "deadline_exceeded"
        if self._stopped:
            raise CallStopped(self._stopped)


class Calls:
    """The calls under way; safe with several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._ids = itertools.count(1)
        self._open: set[Call] = set()
        self._named: dict[str, Call] = {}
        self._cancelled: OrderedDict[str, None] = OrderedDict()

    def __len__(self) -> int:
        """Return how many calls are under way."""
        return len(self._open)

    def next_id(self) -> str:
        """Return a number for the log."""
        return str(next(self._ids))

    def begin(self, call: Call) -> None:
        """Count a call as under way."""
        with self._lock:
            self._open.add(call)

    def end(self, call: Call) -> None:
        """Forget a call."""
        with self._lock:
            self._open.discard(call)
            if self._named.get(call.id) is call:
                del self._named[call.id]

    def enter(self, name: str, call: Call) -> None:
        """Make a call known by its name; stops it if that was cancelled before."""
        with self._lock:
            is_cancelled = name in self._cancelled
            # A name that comes twice stays with the first: nobody can take over
            # what another one would cancel.
            self._named.setdefault(name, call)
        if is_cancelled:
            call.stop("cancelled")

    def cancel(self, name: str) -> bool:
        """Stop the call of a name; return whether it is under way.

        One that is still to come, or waits undecoded, is stopped when it is named.
        """
        with self._lock:
            call = self._named.get(name)
            self._cancelled[name] = None
            self._cancelled.move_to_end(name)
            if len(self._cancelled) > REMEMBERED:
                self._cancelled.popitem(last=False)
        if call is not None:
            call.stop("cancelled")
        return call is not None

    def stop_all(self, code: str) -> None:
        """Stop every call that is under way."""
        with self._lock:
            under_way = list(self._open)
        for call in under_way:
            call.stop(code)
