"""A client: asks a server, with the same values as the calls within Python."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Self, TypeVar

from configspace.errors import CacheError, InvalidInput, Problem
from configspace.space import PermissibleSpace
from configspace.storage import parse_space
from configspace.vehicle import Vehicle
from configspace.vehicle_io import parse_vehicle
from omniplan.report import Ranking, Report
from omniplan.trajectory import Trajectory
from services.endpoint import DEFAULT_ENDPOINT, Endpoint
from services.errors import (
    InvalidMessage,
    RemoteError,
    ServiceError,
    ServiceUnreachable,
)
from services.keys import Keys, Route
from services.messages import (
    JSON,
    ErrorReply,
    Health,
    SelectReply,
    SelectRequest,
    ValidateReply,
    ValidateRequest,
    VehiclesReply,
    decode,
    encode,
)
from services.session import Peer, Reply

__all__ = ["Client"]

T = TypeVar("T")


class Client:
    """Asks a server; use it in a ``with`` block. It may be shared by threads.

    The connection is made by the first question and made again by itself after a loss.

    Every question raises `ServiceUnreachable` if nobody is there, `ServiceTimeout` if
    the answer takes too long, `RemoteError` if the answer is an error, and
    `ServiceError` if it cannot be understood.

    Parameters
    ----------
    endpoint : str
        Where the server listens, ``tcp/HOST:PORT``.
    site : str
        The site the server answers for.
    timeout : float, s, > 0
        For each question.

    Raises
    ------
    InvalidInput
        If a value is not allowed, InvalidEndpoint for the address.
    """

    def __init__(
        self,
        endpoint: str = DEFAULT_ENDPOINT,
        *,
        site: str = "default",
        timeout: float = 10.0,
    ) -> None:
        self._endpoint = Endpoint.parse("endpoint", endpoint)
        self._keys = Keys(site)
        self._timeout = _checked_timeout(timeout)
        self._lock = threading.Lock()
        self._peer: Peer | None = None
        self._is_closed = False

    def validate(
        self, trajectories: Sequence[Trajectory], vehicle: str
    ) -> tuple[Report, ...]:
        """Ask whether a vehicle can drive trajectories.

        Parameters
        ----------
        trajectories : sequence of Trajectory
        vehicle : str
            One of `vehicles`.

        Returns
        -------
        reports : tuple of Report
            One for each trajectory, as `omniplan.validate` gives them.
        """
        request = ValidateRequest.of(trajectories, vehicle)
        payload = self._ask(Route("validate"), encode(request))
        reports = _read(lambda: decode(ValidateReply, payload).values())
        return _one_each(reports, trajectories)

    def select(
        self,
        trajectories: Sequence[Trajectory],
        vehicles: Sequence[str] | None = None,
        by: str = "duration",
    ) -> tuple[Ranking, ...]:
        """Ask which vehicles can drive trajectories, best first.

        Parameters
        ----------
        trajectories : sequence of Trajectory
        vehicles : sequence of str, optional
            Which to compare; default all that the server knows.
        by : {"duration", "margin"}

        Returns
        -------
        rankings : tuple of Ranking
            One for each trajectory, as `omniplan.select` gives them.
        """
        request = SelectRequest.of(trajectories, vehicles, by)
        payload = self._ask(Route("select"), encode(request))
        rankings = _read(lambda: decode(SelectReply, payload).values())
        return _one_each(rankings, trajectories)

    def vehicles(self) -> tuple[str, ...]:
        """Return the names of the vehicles that the server knows."""
        payload = self._ask(Route("vehicles"))
        return _read(lambda: decode(VehiclesReply, payload).vehicles)

    def vehicle(self, name: str) -> Vehicle:
        """Return a vehicle."""
        payload = self._ask(Route("vehicle", name))
        return _read(lambda: parse_vehicle(payload.decode()))

    def space(self, name: str) -> PermissibleSpace:
        """Return a vehicle's data sheet."""
        payload = self._ask(Route("space", name))
        return _read(lambda: parse_space(payload))

    def health(self) -> Health:
        """Return the state of the server."""
        payload = self._ask(Route("health"))
        return _read(lambda: decode(Health, payload))

    def wait_until_ready(self, timeout: float | None = None) -> None:
        """Wait until a server of the site can be asked, also one that starts later.

        Parameters
        ----------
        timeout : float, s, > 0, optional
            Default the timeout of the client.

        Raises
        ------
        ServiceUnreachable
            If there is none in time.
        """
        timeout = self._timeout if timeout is None else _checked_timeout(timeout)
        deadline = time.monotonic() + timeout
        peer = self._connected(timeout, patience=timeout)
        left = max(0.0, deadline - time.monotonic())
        if not peer.wait_for_token(self._keys.servers, left):
            reason = f"no server of site {self._keys.site!r} within {timeout:g} s"
            raise ServiceUnreachable(str(self._endpoint), reason)

    def close(self) -> None:
        """End the connection; more questions are errors."""
        with self._lock:
            self._is_closed = True
            peer, self._peer = self._peer, None
        if peer is not None:
            peer.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def _connected(self, timeout: float, patience: float = 0.0) -> Peer:
        """Return the session, opened if there is none yet."""
        with self._lock:
            if self._is_closed:
                raise ServiceError("the client is closed")
            if self._peer is None:
                self._peer = Peer.connected(self._endpoint, timeout, patience)
            return self._peer

    def _ask(self, route: Route, payload: bytes | None = None) -> bytes:
        """Return the payload of the answer to one question."""
        key = self._keys.of(route)
        deadline = time.monotonic() + self._timeout
        peer = self._connected(self._timeout)
        left = max(0.001, deadline - time.monotonic())
        replies = peer.ask(key, payload, JSON, left)
        if not replies:
            raise ServiceUnreachable(str(self._endpoint), f"nobody answers {key}")
        # One server is enough, whatever others say.
        reply = min(replies, key=lambda reply: reply.is_error)
        if reply.is_error:
            raise _remote_error(reply)
        return reply.payload


def _remote_error(reply: Reply) -> ServiceError:
    try:
        error = decode(ErrorReply, reply.payload)
    except InvalidMessage:
        shown = repr(reply.payload[:80])
        return ServiceError(f"the server sent an error that cannot be read: {shown}")
    return RemoteError(error.code, error.message, error.field)


def _read(parse: Callable[[], T]) -> T:
    """Return what an answer says; ServiceError if it cannot be understood."""
    try:
        return parse()
    except (CacheError, ValueError) as error:
        raise ServiceError(f"the server's answer cannot be read: {error}") from error


def _one_each(
    answers: tuple[T, ...], trajectories: Sequence[Trajectory]
) -> tuple[T, ...]:
    if len(answers) != len(trajectories):
        raise ServiceError(
            f"the server's answer cannot be read: {len(answers)} verdicts on "
            f"{len(trajectories)} trajectories"
        )
    return answers


def _checked_timeout(timeout: float) -> float:
    if not (math.isfinite(timeout) and timeout > 0):
        raise InvalidInput(Problem("timeout", f"{timeout} s", "positive and finite"))
    return timeout
