"""A server: answers for a fleet until it is closed."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Iterable, Sequence
from importlib.metadata import version
from types import TracebackType
from typing import Self

from configspace.errors import InvalidInput, Problem
from configspace.space import PermissibleSpace
from services.endpoint import DEFAULT_ENDPOINT, Endpoint
from services.errors import CODES, InvalidMessage, ServiceError
from services.handlers import Handlers, check_size, error_reply
from services.keys import Keys, checked_chunk
from services.messages import JSON, ErrorReply, Health, RequestLimits, encode
from services.session import Peer, Request
from services.workers import WorkerPool

__all__ = ["Server"]

_log = logging.getLogger(__name__)


class Server:
    """Answers the questions of clients about a fleet; use it in a ``with`` block.

    Requests go through a bounded queue to worker threads; what finds the queue full is
    answered ``busy`` at once. Nothing a client sends changes the server.

    Parameters
    ----------
    fleet : sequence of PermissibleSpace
        The vehicles, each name once.
    site : str
        Chunk of the keys that tells servers of different places apart.
    listen : str
        ``tcp/HOST:PORT``; port 0 takes a free one, see `endpoint`. The default is
        reached from this machine only; there is no access control yet.
    workers : int, 1 to 64
        Threads that answer.
    queue_size : int, ≥ 1
        Requests that may wait.
    max_bytes : int, bytes, 1 to 32 MiB
        Largest payload of a request.
    max_samples : int, ≥ 1
        Largest number of samples in one request.

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
        fleet: Sequence[PermissibleSpace],
        *,
        site: str = "default",
        listen: str = DEFAULT_ENDPOINT,
        workers: int = 2,
        queue_size: int = 64,
        max_bytes: int = 8 * 2**20,
        max_samples: int = 100_000,
    ) -> None:
        self._keys = Keys(site)
        self._listen = Endpoint.parse("listen", listen)
        if not 1 <= workers <= 64:
            raise InvalidInput(Problem("workers", f"{workers}", "1 to 64"))
        if queue_size < 1:
            raise InvalidInput(Problem("queue_size", f"{queue_size}", "at least 1"))
        self._n_workers = workers
        self._queue_size = queue_size
        limits = RequestLimits(max_bytes, max_samples)
        self._handlers = Handlers(_by_name(fleet), self.health, limits)
        self._version = version("omniplan")
        self._counts = {"requests": 0, "errors": 0}
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._started_at = time.monotonic()
        self._peer: Peer | None = None
        self._pool: WorkerPool[Request] | None = None

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
        if not self._listen.is_loopback:
            _log.warning("%s: whoever reaches it may ask", self._listen)
        self._peer = Peer.listening(self._listen)
        self._started_at = time.monotonic()
        self._pool = WorkerPool(self._work, self._n_workers, self._queue_size)
        try:
            self._peer.serve(self._keys.everything, self._receive)
            # The token comes last: who sees it can ask.
            self._peer.announce(self._keys.server(self._peer.instance))
        except ServiceError:
            self.close()
            raise
        _log.info("%s answers at %s", self._keys.root, self.endpoint)

    def close(self) -> None:
        """Stop: running requests are finished, waiting ones answered ``closing``."""
        with self._lock:
            if self._closed.is_set():
                return
            self._closed.set()
        if self._peer is None or self._pool is None:
            return
        try:
            self._peer.withdraw()
            for request in self._pool.stop():
                self._refuse(request, _coded("closing"))
            self._pool.join()
        finally:
            self._peer.close()
        _log.info("%s closed", self._keys.root)

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

    def health(self) -> Health:
        """Return the state, as the key ``health`` does."""
        with self._lock:
            counts = dict(self._counts)
        return Health(
            version=self._version,
            instance="" if self._peer is None else self._peer.instance,
            vehicles=len(self._handlers.fleet),
            queue_length=0 if self._pool is None else len(self._pool),
            queue_size=self._queue_size,
            uptime=time.monotonic() - self._started_at,
            **counts,
        )

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

    def _receive(self, request: Request) -> None:
        """Take a request from zenoh's thread: no decoding, no waiting."""
        self._count("requests")
        try:
            # Looked at here so that the queue never holds what is too large.
            check_size(request.n_bytes, self._handlers.limits)
        except InvalidMessage as error:
            self._refuse(request, error_reply(error))
            return
        if self._pool is None or not self._pool.submit(request):
            code = "closing" if self._closed.is_set() else "busy"
            self._refuse(request, _coded(code))

    def _work(self, request: Request) -> None:
        """Answer a request in a worker; the boundary that no error passes."""
        with request:
            for key in self._asked(request):
                try:
                    route = self._keys.route(key)
                    answer = self._handlers.answer(
                        route, request.payload, request.encoding
                    )
                    request.reply(key, answer.payload, answer.encoding)
                except ServiceError as error:
                    _log.warning("%s", error)
                except Exception as error:
                    self._fail(request, error_reply(error))

    def _asked(self, request: Request) -> Iterable[str]:
        """Return the concrete keys that a request asks for.

        A wildcard stands for what can be read or, with a payload, for questions.
        """
        if not request.is_wild:
            return (request.key,)
        has_payload = request.n_bytes > 0
        return [
            key
            for key in self._keys.all_of(self._handlers.fleet)
            if request.matches(key)
            and self._keys.route(key).takes_payload == has_payload
        ]

    def _refuse(self, request: Request, reply: ErrorReply) -> None:
        with request:
            self._fail(request, reply)

    def _fail(self, request: Request, reply: ErrorReply) -> None:
        self._count("errors")
        try:
            request.fail(encode(reply), JSON)
        except ServiceError as error:
            _log.warning("%s", error)

    def _count(self, what: str) -> None:
        with self._lock:
            self._counts[what] += 1


def _by_name(fleet: Sequence[PermissibleSpace]) -> dict[str, PermissibleSpace]:
    """Return the fleet by name, or raise where a name repeats or fits no key."""
    spaces: dict[str, PermissibleSpace] = {}
    for index, space in enumerate(fleet):
        where = f"fleet[{index}].name"
        if checked_chunk(where, space.name) in spaces:
            raise InvalidInput(
                Problem(where, f"{space.name!r} again", "each vehicle once")
            )
        spaces[space.name] = space
    return spaces


def _coded(code: str) -> ErrorReply:
    return ErrorReply(code=code, message=CODES[code])
