"""Certificate files: looked at before zenoh reads them, so that errors name the file.

The checks are OpenSSL's, by a handshake in memory; zenoh's own TLS checks again, on
every connection.
"""

from __future__ import annotations

import os
import re
import ssl
import stat
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal, Never, TypeAlias

from configspace.errors import Problem
from services.errors import InvalidSecurity

__all__ = ["Side", "checked_name", "is_open_to_all", "refusal"]

Side: TypeAlias = Literal["client", "server"]
"""Which end of a connection a certificate is for."""

# What zenoh's TLS says, and what it means; the first that is found.
_REFUSALS = (
    (r"certificate: (?:UnknownIssuer|BadSignature)", "its certificate is not of `ca`"),
    (r"certificate: .*not valid for name", "its certificate is not for this host"),
    (r"certificate: .*expired", "its certificate has expired"),
    (r"certificate: .*valid yet", "its certificate is not valid yet"),
    (r"certificate: .*key usage", "its certificate is not for a server"),
    (r"invalid peer certificate: (.*)", "its certificate is not valid ({0})"),
    (r"alert: (?:UnknownCA|DecryptError)", "our certificate is not of its authority"),
    (r"alert: CertificateExpired", "our certificate is not valid now"),
    (r"alert: CertificateRequired", "it asks for a certificate and got none"),
    (r"alert: (\w*Certificate\w*|AccessDenied)", "it refuses our certificate ({0})"),
    (r"alert: (HandshakeFailure|ProtocolVersion)", "no common version of TLS ({0})"),
    (r"InvalidContentType", "it does not speak TLS"),
)


def checked_name(ca: Path, certificate: Path, key: Path, side: Side) -> str:
    """Return the common name on a certificate that can be used.

    Parameters
    ----------
    ca, certificate, key : Path
        PEM files: the authority, the certificate with those between it and the
        authority, its key without password.
    side : {"client", "server"}
        What the certificate is for.

    Raises
    ------
    InvalidSecurity
        If a file cannot be read or is no such file, the key is of another certificate,
        or the certificate is not of this authority, not for this side, not yet or no
        longer valid, or has no common name.
    """
    files = {"ca": ca, "certificate": certificate, "key": key}
    unreadable = [
        problem for name, path in files.items() for problem in _unreadable(name, path)
    ]
    if unreadable:
        raise InvalidSecurity(unreadable)
    ours, theirs = _contexts(ca, certificate, key, side)
    try:
        subject = _subject(ours, theirs, side)
    except ssl.SSLCertVerificationError as error:
        raise _invalid("certificate", certificate, _why_not(error, ca, side)) from error
    except ssl.SSLError as error:
        raise _invalid(
            "certificate", certificate, f"usable for TLS ({_words(error)})"
        ) from error
    for parts in subject:
        for field, value in parts:
            if field == "commonName" and value.strip():
                return value
    raise _invalid("certificate", certificate, "with a common name: the roles go by it")


def is_open_to_all(key: Path) -> bool:
    """Return whether every user of this machine may read or change a key."""
    return bool(key.stat().st_mode & (stat.S_IROTH | stat.S_IWOTH))


def refusal(reason: str) -> str | None:
    """Return what zenoh's words on a failed connection mean; None if not TLS's doing.

    Parameters
    ----------
    reason : str
        The text of zenoh's error.
    """
    for pattern, words in _REFUSALS:
        found = re.search(pattern, reason)
        if found is not None:
            return words.format(*found.groups())
    return None


def _unreadable(name: str, path: Path) -> list[Problem]:
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            return [_problem(name, path, "a PEM file")]
        with path.open("rb"):
            return []
    except OSError as error:
        reason = error.strerror or str(error)
        return [_problem(name, path, f"a PEM file that can be read ({reason})")]


def _contexts(
    ca: Path, certificate: Path, key: Path, side: Side
) -> tuple[ssl.SSLContext, ssl.SSLContext]:
    """Return both ends: the one with the certificate and the one that looks at it."""
    client = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    server = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    client.check_hostname = False
    client.verify_mode = ssl.CERT_NONE
    ours, theirs = (server, client) if side == "server" else (client, server)
    # A server shows a certificate in any case; here the same one.
    for context in {server, ours}:
        _load(context, certificate, key)
    try:
        theirs.load_verify_locations(ca)
    except ssl.SSLError as error:
        raise _invalid(
            "ca", ca, f"a PEM file with certificates ({_words(error)})"
        ) from error
    theirs.verify_mode = ssl.CERT_REQUIRED
    return ours, theirs


def _load(context: ssl.SSLContext, certificate: Path, key: Path) -> None:
    def ask() -> Never:
        raise _HasPasswordError

    try:
        # Looked at alone so that the error can name the right file.
        ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT).load_verify_locations(certificate)
    except ssl.SSLError as error:
        raise _invalid(
            "certificate", certificate, f"a PEM certificate ({_words(error)})"
        ) from error
    try:
        context.load_cert_chain(certificate, key, password=ask)
    except _HasPasswordError:
        raise _invalid("key", key, "a PEM key without password") from None
    except ssl.SSLError as error:
        if error.reason == "KEY_VALUES_MISMATCH":
            raise _invalid(
                "key", key, f"the key of certificate {certificate}"
            ) from error
        raise _invalid("key", key, f"a PEM key ({_words(error)})") from error


def _subject(
    ours: ssl.SSLContext, theirs: ssl.SSLContext, side: Side
) -> tuple[tuple[tuple[str, str], ...], ...]:
    """Return the subject of our certificate as the other end has verified it."""
    to_server, to_client = ssl.MemoryBIO(), ssl.MemoryBIO()
    server, client = (ours, theirs) if side == "server" else (theirs, ours)
    ends = (
        client.wrap_bio(to_client, to_server),
        server.wrap_bio(to_server, to_client, server_side=True),
    )
    # One end waits for the other a few times; the last word is the server's.
    for _ in range(4):
        for end in ends:
            with suppress(ssl.SSLWantReadError):
                end.do_handshake()
    seen: dict[str, Any] = ends[0 if side == "server" else 1].getpeercert() or {}
    return tuple(seen.get("subject", ()))


def _why_not(error: ssl.SSLCertVerificationError, ca: Path, side: Side) -> str:
    words = error.verify_message
    now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    if "expired" in words or "not yet valid" in words:
        return f"a certificate that is valid now, {now} ({words})"
    if "purpose" in words:
        return f"a certificate for a TLS {side} ({words})"
    return f"a certificate of the authority {ca} ({words})"


def _words(error: ssl.SSLError) -> str:
    return (error.reason or "no PEM").replace("_", " ").lower()


def _problem(name: str, path: Path, allowed: str) -> Problem:
    return Problem(f"security.{name}", os.fspath(path), allowed)


def _invalid(name: str, path: Path, allowed: str) -> InvalidSecurity:
    return InvalidSecurity(_problem(name, path, allowed))


class _HasPasswordError(Exception):
    """A key asks for its password; there is nobody to ask."""
