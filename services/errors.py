"""Errors of the service; the tree is in `configspace.errors`.

    InvalidInput
      InvalidMessage
      InvalidEndpoint         (also ServiceError)
      InvalidSecurity         (also ServiceError)
    ServiceError
      ServiceUnreachable      nobody is there, or nobody answers this key
        ServiceRefused        somebody is there and refuses: TLS or access control
      ServiceTimeout          somebody is there and did not answer in time
      RemoteError             somebody answered with an error
      CallStopped             within a server: there is no use to go on
      RegistrationRefused     within a server: a vehicle is not registered, or kept
      StoreError              registered vehicles cannot be kept, or read

"Could not reach" and "answered with an error" are separate, so that a caller knows
whether asking again, or asking differently, may help.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType

from configspace.errors import InvalidInput, OmniplanError, Problem

__all__ = [
    "CODES",
    "CallStopped",
    "InvalidEndpoint",
    "InvalidMessage",
    "InvalidSecurity",
    "RemoteError",
    "ServiceError",
    "ServiceRefused",
    "ServiceTimeout",
    "ServiceUnreachable",
]

CODES: Mapping[str, str] = MappingProxyType(
    {
        "busy": "the queue is full; ask again later",
        "cancelled": "the caller has cancelled the request",
        "closing": "the server is about to stop; ask again later or elsewhere",
        "conflict": "the vehicle is of another version than expected, or changed since",
        "deadline_exceeded": "the time for the request is over; nothing more comes",
        "internal": "the server failed; its log says why",
        "invalid_input": "a value is outside what is allowed",
        "invalid_message": "the payload is not the message that the key takes",
        "invalid_trajectory": "a trajectory cannot be used; `field` says which, where",
        "invalid_vehicle": "the vehicle inside a trajectory cannot be used",
        "no_vehicle_file": "of this vehicle only the data sheet is known",
        "not_stored": "the registration could not be stored; nothing has changed",
        "read_only": "the vehicle is one that the server was started with",
        "registration_off": "the server takes no registrations",
        "registry_full": "there is no room for one more vehicle",
        "too_large": "the payload, or the number of samples, is above the limit",
        "unknown_key": "there is no such key below the site",
        "unknown_vehicle": "the server does not know a vehicle of this name",
        "wrong_encoding": "the encoding is not the one that the key takes",
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
    """An address that is none, or that is not allowed.

    Parameters
    ----------
    where : str
        Name of the argument.
    given : str
    allowed : str
    """

    def __init__(
        self,
        where: str,
        given: str,
        allowed: str = "tcp/HOST:PORT or tls/HOST:PORT with a port from 0 to 65535",
    ) -> None:
        super().__init__(Problem(where, repr(given), allowed))


class InvalidSecurity(InvalidInput, ServiceError):
    """Certificate files that cannot be used, or roles that cannot be meant.

    Parameters
    ----------
    problems : Problem or iterable of Problem
    """


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


class ServiceRefused(ServiceUnreachable):
    """A server is there and refuses; to ask again does not help.

    TLS refuses a certificate, on either side, or access control what is asked with it.
    """


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


class CallStopped(ServiceError):
    """A request is not worked at any longer; raised between its parts.

    Parameters
    ----------
    code : str
        ``cancelled``, ``closing`` or ``deadline_exceeded``.
    """

    def __init__(self, code: str) -> None:
        self.code = code
        super().__init__(CODES[code])


class RegistrationRefused(ServiceError):
    """A vehicle is not registered, or not removed.

    Parameters
    ----------
    code : str
        ``conflict``, ``not_stored``, ``read_only``, ``registration_off``,
        ``registry_full`` or ``unknown_vehicle``.
    message : str
    field : str, optional
        Path of the offending value within the request.
    """

    def __init__(self, code: str, message: str, field: str | None = None) -> None:
        self.code = code
        self.field = field
        super().__init__(message)


class StoreError(ServiceError):
    """Registered vehicles cannot be kept, or read."""
