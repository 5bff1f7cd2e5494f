"""A server: answers for a fleet until it is closed."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Sequence
from importlib.metadata import version
from types import TracebackType
from typing import Self

from configspace.errors import InvalidInput, Problem
from configspace.space import PermissibleSpace
from services.answering.cores import large_at_once
from services.answering.dispatch import Dispatcher
from services.answering.handlers import Handlers
from services.answering.metrics import resident_bytes
from services.answering.upkeep import Upkeep
from services.answering.workers import PoolLimits
from services.errors import ServiceError
from services.guarding.security import (
    Security,
    check_listen,
    check_peers,
    zenoh_entries,
)
from services.protocol.endpoint import DEFAULT_ENDPOINT, Endpoint
from services.protocol.keys import Keys
from services.protocol.messages import Health, RequestLimits
from services.registering.registry import Registry
from services.wire.session import Peer

__all__ = ["Server"]

_log = logging.getLogger(__name__)


class Server:
    """Answers the questions of clients about a fleet; use it in a ``with`` block.

    Requests go through a bounded queue to worker threads; what finds the queue full is
    answered ``busy`` at once. Large requests are worked at in parts and take turns, so
    that small ones never wait for them. Nothing a client sends changes the server,
    unless its `registry` takes registrations.

    Parameters
    ----------
    fleet : sequence of PermissibleSpace
        The vehicles, each name once; no request changes them.
    site : str
        Chunk of the keys that tells servers of different places apart.
    listen : str
        ``tcp/HOST:PORT``, or ``tls/HOST:PORT`` with `security`; port 0 takes a free
        one, see `endpoint`. The default is reached from this machine only.
    workers : int, 1 to 64
        Threads that answer; of two or more, one is kept for small requests.
    queue_size : int, ≥ 1
        Requests that may wait, half of them large.
    queue_bytes : int, bytes, ≥ max_bytes
        Large requests that wait or are worked at, together.
    max_bytes : int, bytes, 1 to 32 MiB
        Largest payload of a request.
    max_samples : int, ≥ 1
        Largest number of samples in one request.
    max_batch_samples : int, ≥ 1
        Likewise in a request of arrays.
    max_time : float, s, > 0
        For a request from its arrival; then it is answered ``deadline_exceeded``.
    stop_within : float, s, ≥ 0
        How long `close` lets requests finish that have begun.
    security : Security, optional
        Certificates, and who may do what; see ``docs/security.md``.
    allow_insecure : bool
        Listen without `security` also where other machines reach it: whoever does may
        ask anything.
    registry : Registry, optional
        In place of a fleet: vehicles that may be registered and removed. It is for the
        one who made it to close it, after the server.
    peers : sequence of str
        Where other servers of the site listen, as `listen`; those that are there share
        their registered vehicles. It is enough if one of two lists the other.

    Raises
    ------
    InvalidInput
        If a name or number is not allowed, InvalidEndpoint for the address.

    Examples
    --------
    >>> import configspace
    >>> from services import Client, Server
    >>> vehicle = configspace.load_vehicle("mecanum")
    >>> space = configspace.build_space(vehicle, configspace.Grid(40, 72), cache=False)
    >>> with Server([space], listen="tcp/127.0.0.1:0") as server:
    ...     with Client(server.endpoint) as client:
    ...         client.vehicles()
    ('mecanum',)
    """

    def __init__(
        self,
        fleet: Sequence[PermissibleSpace] = (),
        *,
        site: str = "default",
        listen: str = DEFAULT_ENDPOINT,
        workers: int = 3,
        queue_size: int = 64,
        max_bytes: int = 8 * 2**20,
        max_samples: int = 100_000,
        queue_bytes: int = 64 * 2**20,
        max_batch_samples: int = 1_000_000,
        max_time: float = 60.0,
        stop_within: float = 10.0,
        security: Security | None = None,
        allow_insecure: bool = False,
        registry: Registry | None = None,
        peers: Sequence[str] = (),
    ) -> None:
        self._keys = Keys(site)
        self._listen = Endpoint.parse("listen", listen)
        check_listen(self._listen, security, allow_insecure)
        self._entries = zenoh_entries(security, "server", self._keys)
        if not 1 <= workers <= 64:
            raise InvalidInput(Problem("workers", f"{workers}", "1 to 64"))
        if queue_size < 1:
            raise InvalidInput(Problem("queue_size", f"{queue_size}", "at least 1"))
        if queue_bytes < max_bytes:
            allowed = f"at least max_bytes, {max_bytes}"
            raise InvalidInput(Problem("queue_bytes", f"{queue_bytes}", allowed))
        if not 0 <= stop_within < math.inf:
            raise InvalidInput(
                Problem("stop_within", f"{stop_within} s", "finite, not negative")
            )
        self._pool_limits = PoolLimits(
            workers,
            queue_size,
            queue_bytes,
            n_large=large_at_once(workers, is_alone=False),
            n_large_alone=large_at_once(workers, is_alone=True),
        )
        self._stop_within = stop_within
        limits = RequestLimits(
            max_bytes=max_bytes,
            max_samples=max_samples,
            max_batch_samples=max_batch_samples,
            max_time=max_time,
        )
        if registry is not None and fleet:
            allowed = "none, as a registry has its own"
            raise InvalidInput(Problem("fleet", f"{len(fleet)} vehicles", allowed))
        self._peers = [Endpoint.parse(f"peers[{i}]", p) for i, p in enumerate(peers)]
        check_peers(self._peers, security)
        self._registry = Registry(fleet) if registry is None else registry
        self._handlers = Handlers(self._registry, self.health, limits, self._online)
        self._version = version("omniplan")
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._is_clean = True
        self._started_at = time.monotonic()
        self._peer: Peer | None = None
        self._dispatcher: Dispatcher | None = None
        self._upkeep: Upkeep | None = None

    def start(self) -> None:
        """Begin to answer; a server starts once.

        Until it is closed it keeps the process alive.

        Raises
        ------
        ServiceError
            If the address is in use or cannot be listened at, or on a second start.
        """
        if self._peer is not None or self._closed.is_set():
            raise ServiceError("the server was started before; make a new one")
        self._peer = Peer.listening(self._listen, self._entries, self._peers)
        self._started_at = time.monotonic()
        self._dispatcher = Dispatcher(self._keys, self._handlers, self._pool_limits)
        receive = self._dispatcher.receive
        try:
            self._upkeep = Upkeep(
                self._peer,
                self._keys,
                self._registry,
                receive,
                expects_others=bool(self._peers),
            )
            self._peer.serve(self._keys.everything, receive)
            # The token comes last: who sees it can ask.
            self._peer.announce(self._keys.server(self._peer.instance))
        except BaseException:
            self.close()
            raise
        _log.info("%s answers at %s", self._keys.root, self.endpoint)

    def close(self, within: float | None = None) -> bool:
        """Stop: requests that have begun may finish, others are answered ``closing``.

        Parameters
        ----------
        within : float, s, ≥ 0, optional
            What takes longer is stopped as well; default `stop_within`.

        Returns
        -------
        is_clean : bool
            Whether all that had begun were finished; on a second call the same.
        """
        with self._lock:
            if not self._closed.is_set():
                self._is_clean = self._close(within)
                self._closed.set()
            return self._is_clean

    def _close(self, within: float | None) -> bool:
        if self._peer is None or self._dispatcher is None:
            return True
        try:
            self._peer.withdraw()
            is_clean = self._dispatcher.close(
                self._stop_within if within is None else within
            )
        finally:
            if self._upkeep is not None:
                self._upkeep.close()
            self._peer.close()
        _log.info("%s closed", self._keys.root)
        return is_clean

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until `close` was called by another thread; Ctrl-C ends the wait.

        Parameters
        ----------
        timeout : float, s, optional
            None waits for ever.

        Returns
        -------
        is_closed : bool
        """
        return self._closed.wait(timeout)

    @property
    def endpoint(self) -> str:
        """Where it listens; with the port taken once it has started."""
        return str(self._listen if self._peer is None else self._peer.endpoint)

    @property
    def site(self) -> str:
        """The site that it answers for."""
        return self._keys.site

    @property
    def vehicles(self) -> tuple[str, ...]:
        """Names of the vehicles that it answers for now."""
        return tuple(self._handlers.fleet)

    def health(self) -> Health:
        """Return the state, as the key ``health`` does."""
        at_work = self._dispatcher
        return Health(
            version=self._version,
            instance="" if self._peer is None else self._peer.instance,
            vehicles=len(self._handlers.fleet),
            queue_length=0 if at_work is None else len(at_work.pool),
            queue_size=self._pool_limits.queue_size,
            queue_bytes=0 if at_work is None else at_work.pool.n_bytes,
            running=0 if at_work is None else at_work.pool.n_running,
            requests=0 if at_work is None else at_work.n_requests,
            errors=0 if at_work is None else at_work.n_errors,
            uptime=time.monotonic() - self._started_at,
            memory=resident_bytes(),
            sheet_bytes=self._registry.snapshot.n_bytes,
            keys={} if at_work is None else at_work.metrics.figures(),
        )

    def _online(self) -> frozenset[str]:
        """Return the names of the vehicles that are online."""
        upkeep = self._upkeep
        return frozenset() if upkeep is None else upkeep.presence.online()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()
