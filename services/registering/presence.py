"""Which vehicles are online: those whose liveliness token is there.

A vehicle may be connected to one server only, and zenoh's peers pass nothing on. So a
server announces to the other servers which vehicles it sees, by tokens of its own that
go when it goes.
"""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Callable

from services.errors import ServiceError
from services.protocol.keys import Keys
from services.wire.session import Peer

__all__ = ["Presence"]

MAX_ONLINE = 10_000
"""Vehicles that are kept track of; more are not noticed."""


class Presence:
    """Keeps track of the vehicles that are online, from the start on.

    Parameters
    ----------
    peer : Peer
        The session of the server.
    keys : Keys
    """

    def __init__(self, peer: Peer, keys: Keys) -> None:
        self._peer = peer
        self._keys = keys
        self._own = keys.sync(peer.instance, "online", "*").removesuffix("*")
        self._lock = threading.Lock()
        self._direct: set[str] = set()
        self._relayed: dict[str, set[str]] = {}
        self._changes: queue.SimpleQueue[tuple[str, bool] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(
            target=self._relay, name="omniplan-presence", daemon=True
        )
        self._thread.start()
        peer.watch(keys.all_online, self._notice)
        peer.watch(keys.sync("*", "online", "*"), self._notice_relayed)

    def online(self) -> frozenset[str]:
        """Return the names of the vehicles that are online now."""
        with self._lock:
            return frozenset(self._direct).union(self._relayed)

    def close(self) -> None:
        """End the relay; the session withdraws the tokens."""
        self._changes.put(None)
        self._thread.join()

    def _notice(self, key: str, is_there: bool) -> None:
        """Note a vehicle's own token; called by zenoh."""
        id = key.split("/")[-2]
        with self._lock:
            if not is_there:
                self._direct.discard(id)
            elif len(self._direct) < MAX_ONLINE:
                self._direct.add(id)
            else:
                return
        self._changes.put((id, is_there))

    def _notice_relayed(self, key: str, is_there: bool) -> None:
        """Note what another server announces; called by zenoh."""
        if key.startswith(self._own):
            return
        id = key.rpartition("/")[2]
        with self._lock:
            if not is_there:
                self._relayed.get(id, set()).discard(key)
                if not self._relayed.get(id):
                    self._relayed.pop(id, None)
            elif id in self._relayed or len(self._relayed) < MAX_ONLINE:
                self._relayed.setdefault(id, set()).add(key)

    def _relay(self) -> None:
        """Announce the vehicles seen, outside of zenoh's own threads."""
        undo: dict[str, Callable[[], None]] = {}
        while (change := self._changes.get()) is not None:
            id, is_there = change
            # A session that ends meanwhile takes its tokens along, and a name that
            # fits no key is no vehicle's.
            with contextlib.suppress(ServiceError, ValueError):
                if not is_there:
                    undo.pop(id, lambda: None)()
                elif id not in undo:
                    key = self._keys.sync(self._peer.instance, "online", id)
                    undo[id] = self._peer.announce(key)
