"""From a request about registrations to its reply, without zenoh."""

from __future__ import annotations

import logging
from types import TracebackType

from configspace.errors import InvalidVehicle, Problem
from services.protocol.keys import Keys, Route
from services.protocol.messages import JSON, ErrorReply, decode, encode
from services.registering.registry import Registry
from services.registering.registry_messages import (
    RegisterReply,
    RegisterRequest,
    UnregisterRequest,
)
from services.wire.exchange import Publication, Request

__all__ = ["PutRequest", "change"]

_log = logging.getLogger(__name__)


def change(registry: Registry, route: Route, payload: bytes) -> bytes:
    """Register or remove a vehicle and return the reply.

    Parameters
    ----------
    registry : Registry
    route : Route
        ``register`` or ``unregister``.
    payload : bytes
        A RegisterRequest or UnregisterRequest; the latter may be empty.

    Raises
    ------
    RegistrationRefused, InvalidInput
        As `Registry.put` and `Registry.delete`.
    """
    if route.verb == "register":
        asked = decode(RegisterRequest, payload)
        done = registry.put(
            route.id, asked.content(), asked.expected_version, asked.request
        )
    else:
        removed = decode(UnregisterRequest, payload or b"{}")
        done = registry.delete(route.id, removed.expected_version, removed.request)
    return encode(RegisterReply.of(done))


class PutRequest(Request):
    """A zenoh put or delete of a vehicle's key, taken as a request nobody waits for.

    Parameters
    ----------
    keys : Keys
    sample : Publication
        What was published on ``vehicles/{id}``.
    """

    def __init__(self, keys: Keys, sample: Publication) -> None:
        verb = "unregister" if sample.is_delete else "register"
        name = sample.key.rpartition("/")[2]
        # With a wildcard it is a key that nobody knows.
        self.key = f"{keys.root}/{verb}/{name}"
        self.n_bytes = sample.n_bytes
        self._sample = sample

    @property
    def is_wild(self) -> bool:
        """Never: no wildcard changes anything."""
        return False

    @property
    def payload(self) -> bytes:
        """The request that the publication stands for."""
        if self._sample.is_delete:
            return b""
        try:
            text = self._sample.read().decode()
        except UnicodeDecodeError as error:
            problem = Problem("vehicle", str(error), "UTF-8 text is needed")
            raise InvalidVehicle(problem) from error
        return encode(RegisterRequest(vehicle=text))

    @property
    def encoding(self) -> str:
        """That of `payload`; any will do for what was put."""
        return JSON

    def reply(self, key: str, payload: bytes, encoding: str) -> None:
        """Nobody waits; the change is published as an event."""

    def fail(self, payload: bytes, encoding: str) -> None:
        """Tell the log, as nobody waits."""
        error = decode(ErrorReply, payload)
        _log.warning("%s refused: %s (%s)", self.key, error.message, error.code)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        pass
