"""Several servers of one site know the same registered vehicles.

Every server sends its own changes to all others. Besides, each compares versions with
all others, and fetches what is newer, when it hears of a change, when it starts, when
another one comes, and every few seconds: nothing stays missed after a lost message or a
time without connection. The greater version wins everywhere, so all end up with the
same, whatever the order in which they hear of it.
"""

from __future__ import annotations

import contextlib
import logging
import queue
import random
import threading
import time

from configspace.errors import InvalidInput
from services.errors import InvalidMessage, RegistrationRefused, ServiceError
from services.protocol.keys import Keys
from services.protocol.messages import JSON, decode, encode
from services.registering.registry import Registry
from services.registering.registry_messages import (
    MAX_WANTED,
    Digest,
    RecordEntry,
    Records,
    VehicleEvent,
    Wanted,
)
from services.registering.snapshot import Change, Snapshot
from services.registering.versions import Version
from services.wire.exchange import Publication, Request
from services.wire.session import Peer

__all__ = ["Sync"]

MEET_WITHIN = 1.0
"""How long a server that starts waits for another one to be there, s."""
CATCH_UP_WITHIN = 30.0
"""How long it fetches what it has missed before it answers questions, s."""
ANSWER_WITHIN = 3.0
"""How long an answer of another server is waited for, s."""
MAX_EVENT = 4096
"""Longer publications are no events, bytes."""
MAX_CHANGED = 4 * 2**20
"""Longer records are fetched, not taken as they are sent, bytes."""
MAX_WAITING = 64
"""Questions, and changes, of other servers that wait; more are asked for again."""

_log = logging.getLogger(__name__)


class Sync:
    """Publishes the changes of a registry and fetches those of other servers.

    Parameters
    ----------
    peer : Peer
        The session of the server.
    keys : Keys
    registry : Registry
        One that takes registrations.
    interval : float, s, > 0
        Between comparisons of versions.
    """

    def __init__(
        self, peer: Peer, keys: Keys, registry: Registry, *, interval: float = 3.0
    ) -> None:
        self._peer = peer
        self._keys = keys
        self._registry = registry
        self._interval = interval
        self._servers: set[str] = set()
        self._reported: set[tuple[str, Version]] = set()
        self._wake = threading.Event()
        self._is_closed = False
        self._questions: queue.Queue[Request | None] = queue.Queue(MAX_WAITING)
        self._changed: queue.Queue[Publication] = queue.Queue(MAX_WAITING)
        self._threads = [
            threading.Thread(target=target, name=f"omniplan-{name}", daemon=True)
            for name, target in (("sync", self._run), ("sync-answer", self._answer))
        ]

    def start(self, expects_others: bool) -> None:
        """Catch up with the others, then stay so.

        Parameters
        ----------
        expects_others : bool
            Wait a little for another server to be there.
        """
        self._unsubscribe = self._registry.subscribe(self._publish)
        self._peer.serve(self._keys.sync(self._peer.instance, "*"), self._receive)
        self._peer.follow(self._keys.sync("*", "changed"), self._take)
        self._peer.follow(self._keys.events, self._hear)
        self._peer.watch(self._keys.servers, self._meet)
        self._threads[1].start()
        if expects_others:
            self._peer.wait_for_token(self._keys.servers, MEET_WITHIN)
        self.compare(CATCH_UP_WITHIN)
        self._threads[0].start()

    def close(self) -> None:
        """End it; what is under way is finished."""
        self._is_closed = True
        self._unsubscribe()
        self._wake.set()
        self._questions.put(None)
        for thread in self._threads:
            if thread.is_alive():
                thread.join()

    def compare(self, within: float) -> None:
        """Compare versions with all other servers and fetch what is newer.

        Parameters
        ----------
        within : float, s
            What takes longer is left to the next time.
        """
        deadline = time.monotonic() + within
        own = Digest(state=self._registry.snapshot.state, versions={})
        answers = self._gather(self._keys.sync("*", "digest"), encode(own))
        for key, payload in answers.items():
            instance = key.split("/")[-2]
            try:
                newer = decode(Digest, payload).newer_than(self._registry.snapshot)
                self._fetch(instance, list(newer), deadline)
            except InvalidMessage as error:
                _log.warning("server %s: %s", instance, error)

    def _fetch(self, instance: str, names: list[str], deadline: float) -> None:
        """Take over the records of these names from one server."""
        key = self._keys.sync(instance, "records")
        while names and not self._is_closed and time.monotonic() < deadline:
            wanted = Wanted(names=tuple(names[:MAX_WANTED]))
            answers = self._gather(key, encode(wanted))
            entries = [e for a in answers.values() for e in decode(Records, a).records]
            if not entries:
                return  # it has gone; whoever else has them is asked next time
            for entry in entries:
                self._merge(entry)
            got = {entry.id for entry in entries}
            names = [name for name in names if name not in got]

    def _merge(self, entry: RecordEntry) -> None:
        try:
            record = entry.value()
        except InvalidInput as error:
            _log.warning("a record of another server: %s", error)
            return
        try:
            self._registry.merge(record)
        except RegistrationRefused as error:
            # It is tried again each time, as what is in the way may pass.
            seen = (record.id, record.version)
            if seen not in self._reported and len(self._reported) < 1000:
                self._reported.add(seen)
                _log.error("registration of another server not taken: %s", error)

    def _gather(self, key: str, payload: bytes) -> dict[str, bytes]:
        try:
            return self._peer.gather(key, payload, JSON, ANSWER_WITHIN)
        except ServiceError as error:
            _log.warning("%s", error)
            return {}

    def _run(self) -> None:
        while not self._is_closed:
            # Not all servers at the same moment.
            self._wake.wait(self._interval * random.uniform(0.8, 1.2))
            self._wake.clear()
            self._merge_changed()
            if self._servers and not self._is_closed:
                self.compare(CATCH_UP_WITHIN)

    def _publish(self, change: Change) -> None:
        """Send a change: to the servers, if it was made here, and its event to all."""
        me = self._peer.instance
        event = encode(VehicleEvent.by(change, me))
        try:
            if change.version.instance == self._registry.instance:
                records = encode(Records.of(self._registry.snapshot, [change.id]))
                self._peer.publish(self._keys.sync(me, "changed"), records, JSON)
            self._peer.publish(self._keys.event(change.id), event, JSON)
        except ServiceError as error:
            _log.warning("%s", error)

    def _take(self, sample: Publication) -> None:
        """Note what another server has sent; called by zenoh."""
        if not sample.is_delete and sample.n_bytes <= MAX_CHANGED:
            with contextlib.suppress(queue.Full):  # it is fetched instead
                self._changed.put_nowait(sample)
        self._wake.set()

    def _merge_changed(self) -> None:
        """Take over what other servers have sent."""
        with contextlib.suppress(queue.Empty):
            while not self._is_closed:
                sample = self._changed.get_nowait()
                try:
                    for entry in decode(Records, sample.read()).records:
                        self._merge(entry)
                except InvalidMessage as error:
                    _log.warning("%s: %s", sample.key, error)

    def _hear(self, sample: Publication) -> None:
        """Look at another server's event; called by zenoh."""
        if sample.is_delete or sample.n_bytes > MAX_EVENT:
            return
        try:
            event = decode(VehicleEvent, sample.read())
            version = Version.parse(event.version)
        except InvalidInput:
            return
        own = self._registry.snapshot.records.get(event.id)
        if own is None or own.version < version:
            self._wake.set()

    def _meet(self, token: str, is_there: bool) -> None:
        """Note that a server has come or gone; called by zenoh."""
        instance = token.rpartition("/")[2]
        if instance == self._peer.instance:
            return
        if is_there:
            self._servers.add(instance)
            self._wake.set()
        else:
            self._servers.discard(instance)

    def _receive(self, request: Request) -> None:
        """Take a question of another server; called by zenoh."""
        try:
            self._questions.put_nowait(request)
        except queue.Full:
            with request:
                pass  # it asks again

    def _answer(self) -> None:
        while (request := self._questions.get()) is not None:
            with request:
                if not request.is_wild:
                    keys = [request.key]
                else:
                    keys = [
                        self._keys.sync(self._peer.instance, what)
                        for what in ("digest", "records")
                    ]
                try:
                    for key in filter(request.matches, keys):
                        answer = _answer_to(
                            key, request.payload, self._registry.snapshot
                        )
                        request.reply(key, answer, JSON)
                except (InvalidMessage, ServiceError) as error:
                    _log.warning("question of another server: %s", error)


def _answer_to(key: str, payload: bytes, snapshot: Snapshot) -> bytes:
    if key.endswith("/digest"):
        return encode(Digest.of(snapshot, decode(Digest, payload).state))
    return encode(Records.of(snapshot, decode(Wanted, payload).names))
