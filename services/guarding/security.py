"""Mutual TLS: files and roles, and what they mean in zenoh's configuration."""

from __future__ import annotations

import logging
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from configspace.errors import InvalidInput, Problem
from services.errors import InvalidEndpoint
from services.guarding.access import Roles, access_control, servers_only
from services.guarding.certificates import Side, checked_name, is_open_to_all
from services.protocol.endpoint import Endpoint
from services.protocol.keys import Keys

__all__ = [
    "Roles",
    "Security",
    "check_endpoint",
    "check_listen",
    "check_peers",
    "zenoh_entries",
]

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Security:
    """Who we are, whom we trust, and who may do what.

    The files are read when a server or client is made, and again by each connection.

    Parameters
    ----------
    ca : path
        PEM file of the authority whose certificates are trusted.
    certificate : path
        PEM file of our certificate; those between it and the authority follow it.
    key : path
        PEM file of its key, without password.
    roles : Roles
        On a server, what others may do: without roles nothing. On a client only
        ``servers`` counts: if given, others are not asked.
    """

    ca: Path
    certificate: Path
    key: Path
    roles: Roles = field(default_factory=Roles)

    def __post_init__(self) -> None:
        for name in ("ca", "certificate", "key"):
            given = getattr(self, name)
            if not isinstance(given, str | os.PathLike) or not os.fspath(given):
                raise InvalidInput(
                    Problem(f"security.{name}", repr(given), "path of a PEM file")
                )
            # zenoh reads them again later, when the current folder may be another.
            object.__setattr__(self, name, Path(given).absolute())


def zenoh_entries(
    security: Security | None, side: Side, keys: Keys
) -> dict[str, object]:
    """Return the entries of zenoh's configuration; none without security.

    Parameters
    ----------
    security : Security or None
    side : {"client", "server"}
    keys : Keys
        Of the site that the roles are for.

    Returns
    -------
    entries : dict of str to object
        Values by their path in the configuration.

    Raises
    ------
    InvalidSecurity
        If a file cannot be used.
    """
    if security is None:
        return {}
    ca, certificate, key = security.ca, security.certificate, security.key
    name = checked_name(ca, certificate, key, side)
    if is_open_to_all(key):
        _log.warning("%s: every user of this machine has access to this key", key)
    _log.info("%s with the certificate of %r", side, name)
    tls = {
        "root_ca_certificate": str(ca),
        "listen_certificate": str(certificate),
        "listen_private_key": str(key),
        "connect_certificate": str(certificate),
        "connect_private_key": str(key),
        "enable_mtls": True,
        "verify_name_on_connect": True,
        "close_link_on_expiration": True,
    }
    entries: dict[str, object] = {
        f"transport/link/tls/{option}": value for option, value in tls.items()
    }
    roles = security.roles
    if side == "server":
        entries["access_control"] = access_control(roles, keys)
    elif roles.servers:
        entries["access_control"] = servers_only(roles.servers, keys)
    return entries


def check_endpoint(where: str, endpoint: Endpoint, security: Security | None) -> None:
    """Raise InvalidEndpoint unless ``tls/`` and security come together."""
    if security is None and endpoint.is_tls:
        allowed = "tcp/HOST:PORT, or tls/ with certificates (security)"
        raise InvalidEndpoint(where, str(endpoint), allowed)
    if security is not None and not endpoint.is_tls:
        allowed = "tls/HOST:PORT, as certificates (security) are given"
        raise InvalidEndpoint(where, str(endpoint), allowed)


def check_peers(endpoints: Sequence[Endpoint], security: Security | None) -> None:
    """Raise InvalidInput if a server cannot connect to others that listen there.

    Towards them it is a client: its certificate must be for that, too.
    """
    for index, endpoint in enumerate(endpoints):
        check_endpoint(f"peers[{index}]", endpoint, security)
    if endpoints and security is not None:
        checked_name(security.ca, security.certificate, security.key, "client")


def check_listen(
    endpoint: Endpoint, security: Security | None, allow_insecure: bool
) -> None:
    """Raise InvalidEndpoint if a server must not listen there.

    Without security only this machine may reach it, unless that is asked for.
    """
    check_endpoint("listen", endpoint, security)
    if security is None and not endpoint.is_loopback:
        if not allow_insecure:
            allowed = (
                "a loopback address such as tcp/127.0.0.1:7447, or tls/HOST:PORT with "
                "certificates (security), or allow_insecure: whoever reaches it may ask"
            )
            raise InvalidEndpoint("listen", str(endpoint), allowed)
        _log.warning("%s: whoever reaches it may ask", endpoint)
