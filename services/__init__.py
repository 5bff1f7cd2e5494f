"""How others ask: the questions of omniplan over zenoh, without a router.

A `Server` answers for a fleet, a `Client` asks; keys and messages are described in
``docs/service.md``.
"""

import logging

from services.answering.server import Server
from services.asking.async_client import AsyncClient
from services.asking.client import Client
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
from services.guarding.security import Roles, Security
from services.protocol.messages import Health
from services.registering.registry import Registry

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
