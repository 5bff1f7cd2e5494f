from __future__ import annotations

import ast
import logging
import os
from pathlib import Path
from typing import Any

import pytest
from authority import Authority

import services
from configspace import InvalidInput
from services import Client, InvalidEndpoint, InvalidSecurity, Roles, Security, Server
from services.guarding.security import check_endpoint, check_listen, zenoh_entries
from services.protocol.endpoint import Endpoint
from services.protocol.keys import Keys
from services.protocol.messages import RequestLimits

KEYS = Keys("default")
TLS = "transport/link/tls/"
PACKAGES = [
    Path(package.__file__ or "").parent
    for package in (services, __import__("omniplan"), __import__("configspace"))
]


@pytest.fixture
def authority(tmp_path: Path) -> Authority:
    return Authority(tmp_path)


def test_both_sides_show_and_ask_for_certificates(authority: Authority) -> None:
    security = authority.issue("server-1")
    for side in ("client", "server"):
        entries = zenoh_entries(
            security, "client" if side == "client" else "server", KEYS
        )
        assert entries[f"{TLS}root_ca_certificate"] == str(security.ca)
        for end in ("listen", "connect"):
            assert entries[f"{TLS}{end}_certificate"] == str(security.certificate)
            assert entries[f"{TLS}{end}_private_key"] == str(security.key)
        for option in (
            "enable_mtls",
            "verify_name_on_connect",
            "close_link_on_expiration",
        ):
            assert entries[f"{TLS}{option}"] is True


def test_a_server_always_has_access_control_a_client_where_it_lists_servers(
    authority: Authority,
) -> None:
    plain = authority.issue("a")
    choosy = authority.issue("b", roles=Roles(servers=("server-1",)))
    assert "access_control" in zenoh_entries(plain, "server", KEYS)
    assert "access_control" not in zenoh_entries(plain, "client", KEYS)
    assert "access_control" in zenoh_entries(choosy, "client", KEYS)


def test_without_security_nothing_is_added() -> None:
    assert zenoh_entries(None, "server", KEYS) == {}


def test_paths_do_not_depend_on_the_current_folder_later(
    authority: Authority, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    issued = authority.issue("planner-1")
    monkeypatch.chdir(authority.folder)
    relative: Any = [
        os.path.basename(path) for path in (issued.ca, issued.certificate, issued.key)
    ]
    security = Security(*relative)
    monkeypatch.chdir(tmp_path)
    assert security == issued
    assert zenoh_entries(security, "client", KEYS)


@pytest.mark.parametrize("given", [None, "", 3])
def test_a_path_is_needed(given: Any) -> None:
    with pytest.raises(InvalidInput, match=r"security\.key: .*; path of a PEM file"):
        Security(Path("ca.pem"), Path("a.pem"), given)


def test_a_key_that_everybody_can_read_is_warned_of(
    authority: Authority, caplog: pytest.LogCaptureFixture
) -> None:
    security = authority.issue("planner-1")
    zenoh_entries(security, "client", KEYS)
    assert not caplog.records
    security.key.chmod(0o644)
    zenoh_entries(security, "client", KEYS)
    assert f"{security.key}: every user" in caplog.text


def test_a_server_and_a_client_look_at_their_files_at_once(
    authority: Authority,
) -> None:
    security = Security(
        authority.ca, authority.folder / "none.pem", authority.folder / "none.key"
    )
    with pytest.raises(InvalidSecurity, match=r"none\.pem"):
        Server([], listen="tls/127.0.0.1:0", security=security)
    with pytest.raises(InvalidSecurity, match=r"none\.pem"):
        Client("tls/127.0.0.1:7447", security=security)


def test_tls_and_certificates_come_together(authority: Authority) -> None:
    security = authority.issue("planner-1")
    for address, given in (("tcp/127.0.0.1:1", security), ("tls/127.0.0.1:1", None)):
        endpoint = Endpoint.parse("listen", address)
        with pytest.raises(InvalidEndpoint, match=r"listen: .*\(security\)"):
            check_listen(endpoint, given, allow_insecure=True)
        with pytest.raises(InvalidEndpoint, match="endpoint"):
            check_endpoint("endpoint", endpoint, given)
        with pytest.raises(InvalidEndpoint, match="listen"):
            Server([], listen=address, security=given)
        with pytest.raises(InvalidEndpoint, match="endpoint"):
            Client(address, security=given)


@pytest.mark.parametrize(
    "listen",
    [
        "tcp/0.0.0.0:0",
        "tcp/[::]:0",
        "tcp/10.0.0.7:0",
        "tcp/agv-hub:0",
        "tcp/127.evil.example:0",
        "tcp/localhost.evil.example:0",
    ],
)
def test_without_certificates_only_this_machine_is_served_unless_asked_for(
    listen: str, caplog: pytest.LogCaptureFixture
) -> None:
    with pytest.raises(InvalidEndpoint, match="allow_insecure"):
        Server([], listen=listen)
    assert not caplog.records
    Server([], listen=listen, allow_insecure=True)
    assert "whoever reaches it may ask" in caplog.text


@pytest.mark.parametrize(
    "listen", ["tcp/127.0.0.1:0", "tcp/127.8.9.1:0", "tcp/localhost:0", "tcp/[::1]:0"]
)
def test_this_machine_is_served_without_more(
    listen: str, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        Server([], listen=listen)
    assert not caplog.records


def test_with_certificates_other_machines_are_served(authority: Authority) -> None:
    Server([], listen="tls/0.0.0.0:0", security=authority.issue("server-1"))


def test_defaults_are_safe() -> None:
    server = Server([])
    assert Endpoint.parse("listen", server.endpoint).is_loopback
    limits = RequestLimits()
    assert 0 < limits.max_bytes <= 32 * 2**20
    assert 0 < limits.max_samples <= 10**6


FORBIDDEN = {
    "pickle",
    "cPickle",
    "cloudpickle",
    "dill",
    "joblib",
    "marshal",
    "shelve",
    "jsonpickle",
}
CALLS = {"eval", "exec", "compile", "__import__"}


@pytest.mark.parametrize(
    "path",
    [path for folder in PACKAGES for path in sorted(folder.rglob("*.py"))],
    ids=lambda path: f"{path.parent.name}.{path.stem}",
)
def test_nothing_is_unpickled_or_evaluated(path: Path) -> None:
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            roots = {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            roots = {(node.module or "").partition(".")[0]}
        else:
            roots = set()
        assert not roots & FORBIDDEN
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            assert node.func.id not in CALLS, node.lineno
        if isinstance(node, ast.Attribute):
            # yaml without a safe loader, Arrow's own unpickling
            assert node.attr not in ("unsafe_load", "full_load", "UnsafeLoader"), path
        if isinstance(node, ast.keyword) and node.arg == "allow_pickle":
            assert isinstance(node.value, ast.Constant), node.value.lineno
            assert node.value.value is False, node.value.lineno


def test_only_the_seam_imports_zenoh() -> None:
    importers = {
        path.parent.name
        for folder in PACKAGES
        for path in folder.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if (
            isinstance(node, ast.Import)
            and any(alias.name.partition(".")[0] == "zenoh" for alias in node.names)
        )
        or (
            isinstance(node, ast.ImportFrom)
            and (node.module or "").partition(".")[0] == "zenoh"
        )
    }
    assert importers == {"wire"}
