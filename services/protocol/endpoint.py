"""Addresses: ``tcp/HOST:PORT``, and ``tls/HOST:PORT`` with certificates."""

from __future__ import annotations

import ipaddress
import re
import socket
from dataclasses import dataclass, replace

from services.errors import InvalidEndpoint, ServiceError

__all__ = ["DEFAULT_ENDPOINT", "Endpoint"]

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
"""Loopback, on zenoh's usual port."""

_PATTERN = re.compile(r"(tcp|tls)/(\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+):([0-9]{1,5})")


@dataclass(frozen=True)
class Endpoint:
    """Where a server listens."""

    host: str
    """Name or address; IPv6 in brackets."""
    port: int
    """0 to 65535; 0 lets the system choose one."""
    protocol: str = "tcp"
    """``tcp`` or ``tls``."""

    @classmethod
    def parse(cls, where: str, text: str) -> Endpoint:
        """Return the address; InvalidEndpoint names the argument `where`."""
        match = _PATTERN.fullmatch(text)
        if match is None or int(match[3]) > 65535:
            raise InvalidEndpoint(where, text)
        return cls(match[2], int(match[3]), match[1])

    @property
    def is_tls(self) -> bool:
        """Whether it is asked for with certificates."""
        return self.protocol == "tls"

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine can reach it.

        Of names only ``localhost``: what another one stands for may change.
        """
        if self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host.strip("[]")).is_loopback
        except ValueError:
            return False

    def concrete(self) -> Endpoint:
        """Return it with a port that is free now, where the port is 0."""
        if self.port:
            return self
        host = self.host.strip("[]")
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        try:
            with socket.create_server((host, 0), family=family) as probe:
                return replace(self, port=int(probe.getsockname()[1]))
        except OSError as error:
            raise ServiceError(f"cannot listen at {self}: {error.strerror}") from error

    def __str__(self) -> str:
        """Return ``PROTOCOL/HOST:PORT``."""
        return f"{self.protocol}/{self.host}:{self.port}"
