"""From a request received to its last reply: lanes, deadlines, counters and the log.

zenoh's thread only measures a request and puts it into the queue (`receive`); workers
decode, answer and reply part by part (`_steps`). What takes less time than handing it
over is answered by zenoh's thread itself.
"""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Callable, Generator, Iterable, Iterator

from services.answering.calls import Call, Calls
from services.answering.cores import share_cores
from services.answering.handlers import Answer, Handlers, Parts, check_size, error_reply
from services.answering.metrics import Metrics
from services.answering.workers import PoolLimits, WorkerPool
from services.errors import CODES, CallStopped, InvalidMessage, ServiceError
from services.protocol.keys import Keys, Route
from services.protocol.messages import JSON, CancelReply, ErrorReply, encode
from services.wire.exchange import Request

__all__ = ["Dispatcher", "estimated_time"]

SMALL = 0.025
"""A request whose work is estimated to take longer, s, is a large one."""
PER_VERDICT = 0.004
"""Least time for one trajectory and one vehicle, s."""
PER_BYTE = 1e-7
"""Time for a byte of a payload and one vehicle, s: 4 µs to 10 µs for each sample."""
BUILDERS = ("register", "unregister")
"""Verbs that are always large: a data sheet is built."""
AT_ONCE = ("vehicles", "health")
"""Verbs answered, without a payload, in some 20 µs and a few hundred bytes: also where
the queue is full."""
WILD, UNKNOWN = "wildcard", "unknown"
"""Beside the verbs, what requests are counted as."""

_log = logging.getLogger(__name__)
_requests_log = logging.getLogger("services.requests")


class Dispatcher:
    """Answers requests in its own threads, which begin to wait for them at once.

    Parameters
    ----------
    keys : Keys
    handlers : Handlers
    limits : PoolLimits
    """

    def __init__(self, keys: Keys, handlers: Handlers, limits: PoolLimits) -> None:
        self._keys = keys
        self._handlers = handlers
        self._calls = Calls()
        self._is_open = True
        self._lock = threading.Lock()
        self._n_requests = 0
        self._n_errors = 0
        self.metrics = Metrics()
        """Answers by key and code."""
        self.pool: WorkerPool[tuple[Request, Call]] = WorkerPool(
            lambda job: self._steps(*job),
            limits,
            share_cores,
        )
        """The queue and its workers."""

    @property
    def n_requests(self) -> int:
        """Requests received."""
        return self._n_requests

    @property
    def n_errors(self) -> int:
        """Error replies."""
        return self._n_errors

    def receive(self, request: Request) -> None:
        """Take a request from zenoh's thread: no decoding, no waiting."""
        with self._lock:
            self._n_requests += 1
        limits = self._handlers.limits
        call = Call(self._calls, request.key, request.n_bytes, limits.max_time)
        try:
            # Looked at here so that the queue never holds what is too large.
            check_size(request.n_bytes, limits)
        except InvalidMessage as error:
            self._refuse(request, call, error_reply(error))
            return
        route = self._route(request.key)
        if route is not None and route.verb == "cancel":
            self._cancel(request, call, route.id)
            return
        self._calls.begin(call)
        if route is not None and route.verb in AT_ONCE and not request.n_bytes:
            for _ in self._steps(request, call):
                pass
            if route.verb == "health":
                # While nobody waits: the next one finds its own figures ready.
                self.metrics.figures()
            return
        is_large = self._is_large(request, route)
        job = (request, call)
        if not self.pool.submit(job, is_large=is_large, n_bytes=request.n_bytes):
            self._refuse(request, call, _coded("busy" if self._is_open else "closing"))

    def close(self, within: float) -> bool:
        """Stop: waiting requests are answered ``closing``, others may finish.

        Parameters
        ----------
        within : float, s
            Those that take longer are stopped at their next part.

        Returns
        -------
        is_clean : bool
            Whether all that had begun were finished.
        """
        self._is_open = False
        for request, call in self.pool.stop():
            self._refuse(request, call, _coded("closing"))
        if self.pool.join(within):
            return True
        _log.warning("stopping %d requests after %g s", len(self._calls), within)
        self._calls.stop_all("closing")
        if not self.pool.join(GRACE):
            _log.error("%d requests cannot be stopped", len(self._calls))
        return False

    def _steps(self, request: Request, call: Call) -> Iterator[None]:
        """Work at a request, part by part; the boundary that no error passes."""
        with request:
            for key in self._asked(request):
                try:
                    call.check()
                    yield from self._answer(key, request, call)
                except Exception as error:
                    self._fail(request, call, error_reply(error))
                    if isinstance(error, CallStopped):
                        break
        self._note(call)

    def _answer(self, key: str, request: Request, call: Call) -> Iterator[None]:
        """Answer one concrete key and send every part."""
        route = self._keys.route(key)
        handlers = self._handlers
        found = handlers.answer(route, request.payload, request.encoding, call)
        last: Answer | None
        if isinstance(found, Answer):
            last = found
        else:
            with contextlib.closing(found) as parts:
                last = yield from self._send_parts(key, request, call, parts)
        if last is not None:
            self._send(key, request, last)

    def _send_parts(
        self, key: str, request: Request, call: Call, parts: Parts
    ) -> Generator[None, None, Answer | None]:
        """Send all parts but the last, which is returned; yield after each."""
        while True:
            try:
                part = next(parts)
            except StopIteration as end:
                last: Answer | None = end.value
                return last
            if part is not None:
                self._send(key, request, part)
            yield
            call.check()

    def _send(self, key: str, request: Request, answer: Answer) -> None:
        self._try(lambda: request.reply(key, answer.payload, answer.encoding))

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

    def _cancel(self, request: Request, call: Call, name: str) -> None:
        """Stop the request of a name; done at once, the queue may be full of it."""
        with request:
            reply = CancelReply(cancelled=self._calls.cancel(name))
            self._send(request.key, request, Answer(encode(reply)))
        self._note(call)

    def _is_large(self, request: Request, route: Route | None) -> bool:
        """Return whether a request may have to wait for others."""
        if route is None:
            n_spaces = len(self._handlers.fleet) if request.is_wild else 0
        elif route.verb in BUILDERS:
            return True
        else:
            n_spaces = len(self._handlers.fleet) if route.verb == "select" else 1
        return estimated_time(request.n_bytes, n_spaces) > SMALL

    def _route(self, key: str) -> Route | None:
        """Return what a key asks for; None for a wildcard or one that is unknown."""
        try:
            return self._keys.route(key)
        except InvalidMessage:
            return None

    def _refuse(self, request: Request, call: Call, reply: ErrorReply) -> None:
        with request:
            self._fail(request, call, reply)
        self._note(call)

    def _fail(self, request: Request, call: Call, reply: ErrorReply) -> None:
        call.code = reply.code
        with self._lock:
            self._n_errors += 1
        self._try(lambda: request.fail(encode(reply), JSON))

    def _try(self, send: Callable[[], None]) -> None:
        """Send; a caller who has gone is no reason to fail."""
        try:
            send()
        except ServiceError as error:
            _log.warning("%s", error)

    def _note(self, call: Call) -> None:
        """Count and log a request that has had its last reply."""
        self._calls.end(call)
        seconds = call.age
        self.metrics.count(self._kind(call.key), call.code, seconds)
        if _requests_log.isEnabledFor(logging.INFO):
            fields = {
                "key": call.key[:200],
                "id": call.id,
                "bytes": call.n_bytes,
                "samples": call.n_samples,
                "ms": round(seconds * 1e3, 3),
                "code": call.code,
            }
            _requests_log.info("request", extra={"fields": fields})

    def _kind(self, key: str) -> str:
        """Return what a request is counted as: bounded, whatever is sent."""
        route = self._route(key)
        if route is not None:
            return route.verb
        return WILD if "*" in key else UNKNOWN


GRACE = 1.0
"""Time for requests to notice that they are stopped, s."""


def estimated_time(n_bytes: int, n_spaces: int) -> float:
    """Return how long the work of a request may take, s, from its size alone.

    Parameters
    ----------
    n_bytes : int
        Of the payload; without one there is nothing to judge.
    n_spaces : int
        Vehicles asked for.
    """
    return n_spaces * (PER_VERDICT + PER_BYTE * n_bytes) if n_bytes else 0.0


def _coded(code: str) -> ErrorReply:
    return ErrorReply(code=code, message=CODES[code])
