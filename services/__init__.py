"""How others ask: the questions of omniplan over zenoh, without a router.

A `Server` answers for a fleet, a `Client` asks; keys and messages are described in
``docs/service.md``.
"""

import logging

from services.client import Client
from services.errors import (
    InvalidEndpoint,
    InvalidMessage,
    RemoteError,
    ServiceError,
    ServiceTimeout,
    ServiceUnreachable,
)
from services.messages import Health
from services.server import Server

__all__ = [
    "Client",
    "Health",
    "InvalidEndpoint",
    "InvalidMessage",
    "RemoteError",
    "Server",
    "ServiceError",
    "ServiceTimeout",
    "ServiceUnreachable",
]

logging.getLogger(__name__).addHandler(logging.NullHandler())
