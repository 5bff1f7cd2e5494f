"""Addresses: ``tcp/HOST:PORT``."""

from __future__ import annotations

import re
import socket
from dataclasses import dataclass

from services.errors import InvalidEndpoint, ServiceError

__all__ = ["DEFAULT_ENDPOINT", "Endpoint"]

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
"""Loopback, on zenoh's usual port."""

_PATTERN = re.compile(r"tcp/(\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+):([0-9]{1,5})")


@dataclass(frozen=True)
class Endpoint:
    """Where a server listens."""

    host: str
    """Name or address; IPv6 in brackets."""
    port: int
    """0 to 65535; 0 lets the system choose one."""

    @classmethod
    def parse(cls, where: str, text: str) -> Endpoint:
        """Return the address; InvalidEndpoint names the argument `where`."""
        match = _PATTERN.fullmatch(text)
        if match is None or int(match[2]) > 65535:
            raise InvalidEndpoint(where, text)
        return cls(match[1], int(match[2]))

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine can reach it."""
        return self.host in ("localhost", "[::1]") or self.host.startswith("127.")

    def concrete(self) -> Endpoint:
        """Return it with a port that is free now, where the port is 0."""
        if self.port:
            return self
        host = self.host.strip("[]")
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        try:
            with socket.create_server((host, 0), family=family) as probe:
                return Endpoint(self.host, int(probe.getsockname()[1]))
        except OSError as error:
            raise ServiceError(f"cannot listen at {self}: {error.strerror}") from error

    def __str__(self) -> str:
        """Return ``tcp/HOST:PORT``."""
        return f"tcp/{self.host}:{self.port}"
