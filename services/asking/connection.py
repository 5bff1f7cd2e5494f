"""The connection of a client: opened by the first question, shared by threads."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Self

from configspace.errors import InvalidInput, Problem
from services.asking.asker import Asker
from services.asking.sheet_cache import SheetCache
from services.errors import ServiceUnreachable
from services.guarding.security import Security, check_endpoint, zenoh_entries
from services.protocol.endpoint import DEFAULT_ENDPOINT, Endpoint
from services.protocol.keys import Keys, Route
from services.protocol.messages import Question, encode
from services.wire.exchange import Stop

__all__ = ["Connection", "checked_timeout"]


class Connection:
    """Asks servers of one site; parameters and errors are those of `Client`."""

    def __init__(
        self,
        endpoint: str | Sequence[str] = DEFAULT_ENDPOINT,
        *,
        site: str = "default",
        timeout: float = 10.0,
        attempt_timeout: float | None = None,
        retry: bool = True,
        security: Security | None = None,
    ) -> None:
        keys = Keys(site)
        self._timeout = checked_timeout("timeout", timeout)
        if attempt_timeout is not None:
            checked_timeout("attempt_timeout", attempt_timeout)
        self._asker = Asker(
            _endpoints(endpoint, security),
            keys,
            zenoh_entries(security, "client", keys),
            min(timeout, attempt_timeout or timeout),
            retry=retry,
        )
        self._sheets = SheetCache(self._asker)
        self._stop: Stop | None = None

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
        if timeout is None:
            timeout = self._timeout
        deadline = time.monotonic() + checked_timeout("timeout", timeout)
        peer = self._asker.peer(timeout, patience=timeout)
        left = max(0.0, deadline - time.monotonic())
        keys = self._asker.keys
        if not peer.wait_for_token(keys.servers, left):
            reason = f"no server of site {keys.site!r} within {timeout:g} s"
            raise ServiceUnreachable(self._asker.where, reason)
        self._asker.met()

    def close(self) -> None:
        """End the connection; more questions are errors."""
        self._asker.close()

    def stoppable(self, stop: Stop) -> Self:
        """Return this client, with the same connection, for questions that `stop` ends.

        Parameters
        ----------
        stop : Stop
            May be set by any thread; then the server is told, too.
        """
        view = copy.copy(self)
        view._stop = stop
        return view

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def _ask(self, route: Route, payload: bytes | None = None) -> bytes:
        """Return the payload of the answer to one question."""
        return self._asker.ask(route, payload, self._timeout, self._stop)

    def _ask_question(self, route: Route, question: Question) -> bytes:
        """Likewise for one that can be cancelled and has a deadline."""

        def payload(name: str, timeout: float) -> bytes:
            own = {"request": name, "deadline": timeout}
            return encode(question.model_copy(update=own))

        return self._asker.ask(route, payload, self._timeout, self._stop)


def _endpoints(
    endpoint: str | Sequence[str], security: Security | None
) -> list[Endpoint]:
    """Return the addresses, or raise for the first that is none."""
    if isinstance(endpoint, str):
        places = {"endpoint": endpoint}
    else:
        places = {f"endpoint[{i}]": text for i, text in enumerate(endpoint)}
    if not places:
        raise InvalidInput(Problem("endpoint", "an empty list", "at least one address"))
    found = []
    for where, text in places.items():
        found.append(Endpoint.parse(where, text))
        check_endpoint(where, found[-1], security)
    return found


def checked_timeout(where: str, timeout: float) -> float:
    """Return a time, s; InvalidInput if it is not positive and finite."""
    if not (math.isfinite(timeout) and timeout > 0):
        raise InvalidInput(Problem(where, f"{timeout} s", "positive and finite"))
    return timeout
