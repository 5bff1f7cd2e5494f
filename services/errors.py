"""Errors of the service; the tree is in `configspace.errors`.

    InvalidInput
      InvalidMessage
      InvalidEndpoint         (also ServiceError)
    ServiceError
      ServiceUnreachable      nobody is there, or nobody answers this key
      ServiceTimeout          somebody is there and did not answer in time
      RemoteError             somebody answered with an error

"Could not reach" and "answered with an error" are separate, so that a caller knows
whether asking again, or asking differently, may help.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType

from configspace.errors import InvalidInput, OmniplanError, Problem

__all__ = [
    "CODES",
    "InvalidEndpoint",
    "InvalidMessage",
    "RemoteError",
    "ServiceError",
    "ServiceTimeout",
    "ServiceUnreachable",
]

CODES: Mapping[str, str] = MappingProxyType(
    {
        "busy": "the queue is full; ask again later",
        "closing": "the server is about to stop; ask again later or elsewhere",
        "internal": "the server failed; its log says why",
        "invalid_input": "a value is outside what is allowed",
        "invalid_message": "the payload is not the JSON message that the key takes",
        "invalid_trajectory": "a trajectory cannot be used; `field` says which, where",
        "invalid_vehicle": "the vehicle inside a trajectory cannot be used",
        "no_vehicle_file": "of this vehicle only the data sheet is known",
        "too_large": "the payload, or the number of samples, is above the limit",
        "unknown_key": "there is no such key below the site",
        "unknown_vehicle": "the server does not know a vehicle of this name",
        "wrong_encoding": "the encoding is not application/json",
    }
)
"""Every code of an error reply, and what it means."""


class InvalidMessage(InvalidInput):
    """A message that cannot be read or does not fit.

    Parameters
    ----------
    problems : Problem or iterable of Problem
    subject : str
        What was read, such as ``validate request``.
    code : str
        The code, one of `CODES`, under which a server reports it.
    """

    def __init__(
        self,
        problems: Problem | Iterable[Problem],
        subject: str = "",
        code: str = "invalid_message",
    ) -> None:
        super().__init__(problems, subject)
        self.code = code


class ServiceError(OmniplanError):
    """The service cannot be started, reached or understood."""


class InvalidEndpoint(InvalidInput, ServiceError):
    """An address that is not ``tcp/HOST:PORT``.

    Parameters
    ----------
    where : str
        Name of the argument.
    given : str
    """

    def __init__(self, where: str, given: str) -> None:
        super().__init__(
            Problem(where, repr(given), "tcp/HOST:PORT with a port from 0 to 65535")
        )


class ServiceUnreachable(ServiceError):
    """No server is there.

    Parameters
    ----------
    endpoint : str
        Where it was looked for.
    reason : str
    """

    def __init__(self, endpoint: str, reason: str) -> None:
        self.endpoint = endpoint
        self.reason = reason
        super().__init__(f"no service at {endpoint}: {reason}")


class ServiceTimeout(ServiceError):
    """A server is there but did not answer in time.

    Parameters
    ----------
    key : str
        What was asked.
    timeout : float, s
        How long was waited.
    """

    def __init__(self, key: str, timeout: float) -> None:
        self.key = key
        self.timeout = timeout
        super().__init__(f"{key}: no answer within {timeout:.3g} s")


class RemoteError(ServiceError):
    """A server answered with an error.

    Parameters
    ----------
    code : str
        One of `CODES`.
    message : str
    field : str, optional
        Path of the offending value within the request.
    """

    def __init__(self, code: str, message: str, field: str | None = None) -> None:
        self.code = code
        self.message = message
        self.field = field
        super().__init__(f"{message} ({code})")
