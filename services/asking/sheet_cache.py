"""The data sheets a client has, until it is told that one has changed."""

from __future__ import annotations

import threading

from configspace.space import PermissibleSpace
from services.asking.asker import Asker
from services.wire.exchange import Publication
from services.wire.session import Peer

__all__ = ["SheetCache"]


class SheetCache:
    """Data sheets by the name of their vehicle; safe with several threads.

    One is forgotten when a server publishes that its vehicle has changed; all are when
    a server is no longer seen, for then nobody may tell.
    """

    def __init__(self, asker: Asker) -> None:
        self._asker = asker
        self._lock = threading.Lock()
        self._spaces: dict[str, PermissibleSpace] = {}
        self._followed: Peer | None = None
        self._n_changes = 0

    def __len__(self) -> int:
        """Return how many data sheets are held."""
        return len(self._spaces)

    def get(self, name: str) -> PermissibleSpace | None:
        """Return a data sheet that is known to be current."""
        with self._lock:
            return self._spaces.get(name)

    def follow(self, peer: Peer) -> int:
        """Let changes be told from now on; return a mark for `put`."""
        with self._lock:
            is_new = self._followed is not peer
            self._followed = peer
        if is_new:
            peer.follow(self._asker.keys.events, self._published)
            peer.watch(self._asker.keys.servers, self._seen)
        return self._n_changes

    def put(self, name: str, space: PermissibleSpace, mark: int) -> None:
        """Keep a data sheet, unless something has changed since the mark."""
        with self._lock:
            if mark == self._n_changes:
                self._spaces[name] = space

    def _published(self, publication: Publication) -> None:
        with self._lock:
            self._n_changes += 1
            self._spaces.pop(publication.key.rpartition("/")[2], None)

    def _seen(self, token: str, is_there: bool) -> None:
        if is_there:
            return
        with self._lock:
            self._n_changes += 1
            self._spaces.clear()
