"""How others ask: the questions of omniplan over zenoh, without a router.

A `Server` answers for a fleet, a `Client` asks; keys and messages are described in
``docs/service.md``.
"""

import logging

from services.async_client import AsyncClient
from services.client import Client
from services.errors import (
    InvalidEndpoint,
    InvalidMessage,
    InvalidSecurity,
    RegistrationRefused,
    RemoteError,
    ServiceError,
    ServiceRefused,
    ServiceTimeout,
    ServiceUnreachable,
    StoreError,
)
from services.messages import Health
from services.registry import Registry
from services.security import Roles, Security
from services.server import Server

__all__ = [
    "AsyncClient",
    "Client",
    "Health",
    "InvalidEndpoint",
    "InvalidMessage",
    "InvalidSecurity",
    "RegistrationRefused",
    "Registry",
    "RemoteError",
    "Roles",
    "Security",
    "Server",
    "ServiceError",
    "ServiceRefused",
    "ServiceTimeout",
    "ServiceUnreachable",
    "StoreError",
]

logging.getLogger(__name__).addHandler(logging.NullHandler())
