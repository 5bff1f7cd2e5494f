"""What a server does beside answering: knows who is online, keeps up with the others.

It also takes zenoh's own put and delete of a vehicle's key as registrations.
"""

from __future__ import annotations

from collections.abc import Callable

from services.protocol.keys import Keys
from services.registering.presence import Presence
from services.registering.registration import PutRequest
from services.registering.registry import Registry
from services.registering.sync import Sync
from services.wire.exchange import Request
from services.wire.session import Peer

__all__ = ["Upkeep"]


class Upkeep:
    """Runs from its making until it is closed.

    Parameters
    ----------
    peer : Peer
        The session of the server.
    keys : Keys
    registry : Registry
        If it takes registrations, it has caught up with other servers on return.
    receive : callable
        Takes a request; must not block.
    expects_others : bool
        Wait a little for another server to be there.
    """

    def __init__(
        self,
        peer: Peer,
        keys: Keys,
        registry: Registry,
        receive: Callable[[Request], None],
        *,
        expects_others: bool,
    ) -> None:
        self.presence = Presence(peer, keys)
        """Which vehicles are online."""
        self._sync: Sync | None = None
        if registry.takes_registrations:
            self._sync = Sync(peer, keys, registry)
            self._sync.start(expects_others)
            peer.follow(keys.files, lambda sample: receive(PutRequest(keys, sample)))

    def close(self) -> None:
        """End it; what is under way is finished."""
        if self._sync is not None:
            self._sync.close()
        self.presence.close()
