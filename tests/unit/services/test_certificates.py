from __future__ import annotations

import os
import re
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from authority import CLIENT_ONLY, Authority

from services import InvalidSecurity, Security, ServiceError
from services.guarding.certificates import Side, checked_name, is_open_to_all, refusal

SIDES: tuple[Side, ...] = ("client", "server")


@pytest.fixture(scope="module")
def authority(tmp_path_factory: pytest.TempPathFactory) -> Authority:
    return Authority(tmp_path_factory.mktemp("certificates"))


@pytest.fixture(scope="module")
def good(authority: Authority) -> Security:
    return authority.issue("planner-1")


def named(security: Security, side: Side) -> str:
    return checked_name(security.ca, security.certificate, security.key, side)


@pytest.mark.parametrize("side", SIDES)
def test_a_good_certificate_gives_its_common_name(good: Security, side: Side) -> None:
    assert named(good, side) == "planner-1"


def now() -> datetime:
    return datetime.now(UTC)


def foreign(authority: Authority, good: Security) -> Security:
    other = Authority(authority.folder, "other")
    return replace(other.issue("planner-1"), ca=authority.ca)


SPOILT: dict[str, tuple[Callable[[Authority, Security], Security], str]] = {
    "no ca": (
        lambda authority, good: replace(good, ca=Path("/nowhere/ca.pem")),
        r"security\.ca: /nowhere/ca\.pem; .*No such file",
    ),
    "no certificate": (
        lambda authority, good: replace(good, certificate=Path("/nowhere/c.pem")),
        r"security\.certificate: /nowhere/c\.pem; .*No such file",
    ),
    "no key": (
        lambda authority, good: replace(good, key=Path("/nowhere/k.pem")),
        r"security\.key: /nowhere/k\.pem; .*No such file",
    ),
    "a folder": (
        lambda authority, good: replace(good, key=authority.folder),
        r"security\.key: .*; .*a PEM file$",
    ),
    "ca and key interchanged": (
        lambda authority, good: replace(good, ca=good.key),
        r"security\.ca: .*planner-1\.key; .*PEM file with certificates",
    ),
    "certificate is a key": (
        lambda authority, good: replace(good, certificate=good.key),
        r"security\.certificate: .*planner-1\.key; .*a PEM certificate",
    ),
    "key is a certificate": (
        lambda authority, good: replace(good, key=good.certificate),
        r"security\.key: .*planner-1\.pem; .*a PEM key",
    ),
    "another's key": (
        lambda authority, good: replace(good, key=authority.issue("agv-9").key),
        r"security\.key: .*agv-9\.key; .*the key of certificate .*planner-1\.pem",
    ),
    "key with password": (
        lambda authority, good: authority.issue("locked", password=b"secret"),
        r"security\.key: .*locked\.key; .*without password",
    ),
    "expired": (
        lambda authority, good: authority.issue(
            "late", valid_until=now() - timedelta(days=1)
        ),
        r"security\.certificate: .*late\.pem; .*valid now, .* UTC .*expired",
    ),
    "not yet valid": (
        lambda authority, good: authority.issue(
            "early", valid_from=now() + timedelta(days=1)
        ),
        r"security\.certificate: .*early\.pem; .*valid now, .*not yet valid",
    ),
    "another authority": (
        foreign,
        r"security\.certificate: .*other/planner-1\.pem; .*authority .*ca\.pem",
    ),
    "no common name": (
        lambda authority, good: authority.issue(""),
        r"security\.certificate: .*unnamed\.pem; .*common name",
    ),
}


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize(("spoil", "words"), SPOILT.values(), ids=SPOILT)
def test_a_file_that_cannot_be_used_is_named_with_the_reason(
    tmp_path: Path,
    side: Side,
    spoil: Callable[[Authority, Security], Security],
    words: str,
) -> None:
    authority = Authority(tmp_path)
    spoilt = spoil(authority, authority.issue("planner-1"))
    with pytest.raises(InvalidSecurity) as caught:
        named(spoilt, side)
    assert re.search(words, str(caught.value)), str(caught.value)
    assert isinstance(caught.value, ServiceError)
    assert len(caught.value.problems) == 1


def test_all_missing_files_are_named_at_once(tmp_path: Path) -> None:
    paths = tmp_path / "ca.pem", tmp_path / "server.pem", tmp_path / "server.key"
    with pytest.raises(InvalidSecurity) as caught:
        checked_name(*paths, "server")
    assert [problem.where for problem in caught.value.problems] == [
        "security.ca",
        "security.certificate",
        "security.key",
    ]


def test_a_clients_certificate_is_none_for_a_server(authority: Authority) -> None:
    security = authority.issue("client-only", usages=CLIENT_ONLY)
    assert named(security, "client") == "client-only"
    with pytest.raises(InvalidSecurity, match="for a TLS server"):
        named(security, "server")


@pytest.mark.skipif(os.geteuid() == 0, reason="root reads every file")
def test_a_file_without_permission_is_named(authority: Authority) -> None:
    security = authority.issue("hidden")
    security.key.chmod(0)
    with pytest.raises(InvalidSecurity, match=r"hidden\.key; .*Permission denied"):
        named(security, "client")


@pytest.mark.parametrize(
    ("mode", "is_open"), [(0o600, False), (0o640, False), (0o644, True), (0o602, True)]
)
def test_a_key_that_everybody_reaches_is_recognised(
    authority: Authority, mode: int, is_open: bool
) -> None:
    key = authority.issue("open").key
    key.chmod(mode)
    assert is_open_to_all(key) is is_open


@pytest.mark.parametrize(
    ("reason", "words"),
    [
        ("invalid peer certificate: UnknownIssuer", "is not of `ca`"),
        ("invalid peer certificate: BadSignature", "is not of `ca`"),
        (
            'invalid peer certificate: certificate not valid for name "a"; certificate '
            "is only valid for b",
            "not for this host",
        ),
        (
            "invalid peer certificate: certificate expired: verification time 9",
            "its certificate has expired",
        ),
        ("invalid peer certificate: certificate not valid yet: at", "not valid yet"),
        (
            "invalid peer certificate: certificate does not allow extended key usage "
            "for server authentication",
            "not for a server",
        ),
        ("invalid peer certificate: BadEncoding", "not valid (BadEncoding)"),
        ("received fatal alert: UnknownCA", "our certificate is not of its"),
        ("received fatal alert: DecryptError", "our certificate is not of its"),
        ("received fatal alert: CertificateExpired", "our certificate is not valid"),
        ("received fatal alert: CertificateRequired", "got none"),
        ("received fatal alert: BadCertificate", "(BadCertificate)"),
        ("received fatal alert: ProtocolVersion", "(ProtocolVersion)"),
        ("received corrupt message of type InvalidContentType", "TLS"),
    ],
)
def test_what_tls_says_is_put_into_words(reason: str, words: str) -> None:
    assert words in (refusal(reason) or "")


@pytest.mark.parametrize(
    "reason",
    ["Connection refused (os error 111)", "early eof", "alert: InternalError", ""],
)
def test_other_failures_are_no_refusals(reason: str) -> None:
    assert refusal(reason) is None
