"""Mutual TLS between server and clients, with certificates made for the test."""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from authority import SERVER_ONLY, Authority
from loopback import ANY_PORT, ANY_TLS_PORT, Fleet, Trajectories

import configspace
import omniplan
from services import (
    Client,
    InvalidSecurity,
    Roles,
    Security,
    Server,
    ServiceError,
    ServiceRefused,
    ServiceUnreachable,
)
from services.guarding.security import zenoh_entries
from services.protocol.endpoint import Endpoint
from services.protocol.keys import Keys, Route
from services.protocol.messages import JSON
from services.registering.registry import Registry
from services.wire.session import Peer

pytestmark = pytest.mark.service

KEYS = Keys("default")
TLS = "transport/link/tls/"
ROLES = Roles(
    planners=("planner-1",),
    fleet_managers=("manager",),
    vehicles=("differential",),
)


@pytest.fixture(scope="module")
def authority(tmp_path_factory: pytest.TempPathFactory) -> Authority:
    return Authority(tmp_path_factory.mktemp("security"))


@pytest.fixture(scope="module")
def planner(authority: Authority) -> Security:
    return authority.issue("planner-1")


@pytest.fixture(scope="module")
def secure(authority: Authority, fleet: Fleet) -> Iterator[Server]:
    security = authority.issue("server-1", roles=ROLES)
    with Server(fleet, listen=ANY_TLS_PORT, security=security) as server:
        yield server


def test_a_planner_gets_the_answers_that_the_library_gives(
    secure: Server, planner: Security, fleet: Fleet, trajectories: Trajectories
) -> None:
    with Client(secure.endpoint, timeout=30.0, security=planner) as client:
        client.wait_until_ready()
        assert client.vehicles() == tuple(space.name for space in fleet)
        for space in fleet:
            expected = tuple(omniplan.validate(t, space) for t in trajectories)
            assert client.validate(trajectories, space.name) == expected
            assert client.vehicle(space.name) == space.vehicle
        assert client.select(trajectories) == omniplan.select(trajectories, fleet)
        assert client.health().vehicles == len(fleet)


def test_who_has_a_certificate_but_no_role_is_not_answered(
    secure: Server, authority: Authority
) -> None:
    with Client(
        secure.endpoint, timeout=5.0, security=authority.issue("stranger")
    ) as client:
        with pytest.raises(ServiceUnreachable, match="nobody answers"):
            client.health()
        with pytest.raises(ServiceUnreachable, match="no server of site"):
            client.wait_until_ready(0.3)


def raw(security: Security, **changes: object) -> dict[str, object]:
    """Return entries that were not checked: those of an attacker."""
    certificate, key = str(security.certificate), str(security.key)
    options: dict[str, object] = {
        "root_ca_certificate": str(security.ca),
        "connect_certificate": certificate,
        "connect_private_key": key,
        "enable_mtls": True,
        **changes,
    }
    return {f"{TLS}{option}": value for option, value in options.items()}


def day(offset: int) -> datetime:
    return datetime.now(UTC) + timedelta(days=offset)


INTRUDERS: dict[str, tuple[Callable[[Authority, Path], dict[str, object]], str]] = {
    "no certificate": (
        lambda authority, _: {
            f"{TLS}root_ca_certificate": str(authority.ca),
            f"{TLS}enable_mtls": False,
        },
        "got none",
    ),
    "another authority's certificate": (
        lambda authority, folder: raw(
            replace(Authority(folder, "other").issue("planner-1"), ca=authority.ca)
        ),
        "our certificate is not of its authority",
    ),
    "a namesake's certificate": (
        lambda authority, folder: raw(
            replace(Authority(folder, "authority").issue("planner-1"), ca=authority.ca)
        ),
        "our certificate is not of its authority",
    ),
    "expired": (
        lambda authority, _: raw(
            authority.issue("planner-1", valid_until=day(-1), file="expired")
        ),
        "our certificate is not valid now",
    ),
    "not yet valid": (
        lambda authority, _: raw(
            authority.issue("planner-1", valid_from=day(1), file="early")
        ),
        "our certificate is not valid now",
    ),
    "trusts another authority": (
        lambda authority, folder: raw(
            replace(authority.issue("planner-2"), ca=Authority(folder, "other").ca)
        ),
        "its certificate is not of `ca`",
    ),
}


@pytest.mark.parametrize(("entries", "words"), INTRUDERS.values(), ids=INTRUDERS)
@pytest.mark.parametrize("patience", [0.0, 10.0])
def test_whoever_has_no_valid_certificate_gets_no_connection_and_a_reason(
    secure: Server,
    authority: Authority,
    planner: Security,
    tmp_path: Path,
    entries: Callable[[Authority, Path], dict[str, object]],
    words: str,
    patience: float,
) -> None:
    endpoint = Endpoint.parse("endpoint", secure.endpoint)
    before = secure.health()
    with pytest.raises(ServiceRefused) as caught:
        Peer.connected(endpoint, 5.0, patience, entries(authority, tmp_path))
    assert words in caught.value.reason
    assert str(endpoint) in str(caught.value)
    assert secure.health().requests == before.requests
    with Client(secure.endpoint, timeout=30.0, security=planner) as client:
        assert client.vehicles()


def test_a_plain_connection_to_a_tls_port_fails(secure: Server) -> None:
    plain = secure.endpoint.replace("tls/", "tcp/")
    with Client(plain, timeout=3.0) as client, pytest.raises(ServiceUnreachable):
        client.health()


def test_a_tls_connection_to_a_plain_port_fails(
    server: Server, planner: Security
) -> None:
    tls = server.endpoint.replace("tcp/", "tls/")
    with (
        Client(tls, timeout=1.0, security=planner) as client,
        pytest.raises(ServiceError),
    ):
        client.health()


def test_where_nobody_listens_tls_says_the_same_as_tcp(planner: Security) -> None:
    endpoint = str(Endpoint.parse("endpoint", ANY_TLS_PORT).concrete())
    with (
        Client(endpoint, timeout=3.0, security=planner) as client,
        pytest.raises(ServiceUnreachable, match="nobody listens there") as caught,
    ):
        client.health()
    assert not isinstance(caught.value, ServiceRefused)


def test_a_server_without_a_certificate_for_its_host_is_refused(
    authority: Authority, planner: Security, fleet: Fleet
) -> None:
    security = authority.issue("server-9", host="10.9.8.7", roles=ROLES)
    with (
        Server(fleet, listen=ANY_TLS_PORT, security=security) as server,
        Client(server.endpoint, timeout=5.0, security=planner) as client,
        pytest.raises(ServiceRefused, match="not for this host"),
    ):
        client.health()


def test_a_client_may_wait_for_a_server_that_starts_later(
    authority: Authority, planner: Security, fleet: Fleet
) -> None:
    endpoint = str(Endpoint.parse("endpoint", ANY_TLS_PORT).concrete())
    security = authority.issue("server-3", roles=ROLES)
    ready = threading.Event()

    def wait() -> None:
        with Client(endpoint, timeout=30.0, security=planner) as client:
            client.wait_until_ready()
            assert client.vehicles()
            ready.set()

    waiting = threading.Thread(target=wait)
    waiting.start()
    with Server(fleet, listen=endpoint, security=security):
        assert ready.wait(30)
    waiting.join(30)


def test_tls_errors_name_no_place_in_zenohs_sources(
    authority: Authority, tmp_path: Path
) -> None:
    # A key that OpenSSL takes for good and that is gone when zenoh reads it.
    security = authority.issue("server-4", roles=ROLES)
    entries = zenoh_entries(security, "server", KEYS)
    security.key.unlink()
    with pytest.raises(ServiceError) as caught:
        Peer.listening(Endpoint.parse("listen", ANY_TLS_PORT), entries)
    message = str(caught.value)
    assert ".rs:" not in message
    assert "root_ca_certificate_file" not in message


@pytest.mark.slow
def test_a_connection_ends_with_the_certificate(
    secure: Server, authority: Authority
) -> None:
    soon = datetime.now(UTC) + timedelta(seconds=4)
    security = authority.issue("planner-1", valid_until=soon, file="short")
    with Client(secure.endpoint, timeout=5.0, security=security) as client:
        assert client.vehicles()
        deadline = time.monotonic() + 60
        while is_answered(client):
            assert time.monotonic() < deadline
            threading.Event().wait(0.1)


def is_answered(client: Client) -> bool:
    try:
        return bool(client.vehicles())
    except ServiceError:
        return False


@pytest.fixture
def stored(authority: Authority, fleet: Fleet, tmp_path: Path) -> Iterator[Server]:
    """A server that takes registrations from those who may."""
    security = authority.issue("server-1", roles=ROLES, file="stored")
    registry = Registry.open(fleet, tmp_path / "store")
    with Server(
        (), listen=ANY_TLS_PORT, security=security, registry=registry
    ) as server:
        yield server


@contextmanager
def opened(server: Server, security: Security) -> Iterator[Peer]:
    """Connect below the client, which asks more than one thing at a time."""
    entries = zenoh_entries(security, "client", KEYS)
    endpoint = Endpoint.parse("endpoint", server.endpoint)
    with closing(Peer.connected(endpoint, 10.0, 0.0, entries)) as peer:
        yield peer


def registration() -> bytes:
    vehicle = configspace.load_vehicle("mecanum").model_dump_json(exclude_none=True)
    return json.dumps({"vehicle": {**json.loads(vehicle), "name": "new"}}).encode()


def test_the_fleet_manager_registers_and_removes_and_a_planner_cannot(
    stored: Server, authority: Authority, planner: Security, trajectories: Trajectories
) -> None:
    register, unregister = (
        KEYS.of(Route(v, "new")) for v in ("register", "unregister")
    )
    with (
        opened(stored, planner) as planning,
        opened(stored, authority.issue("manager")) as managing,
        Client(stored.endpoint, timeout=30.0, security=planner) as client,
    ):
        before = client.vehicles()
        for _ in range(2):
            assert planning.ask(register, registration(), JSON, 30.0) == []
            # Nor does a payload make a question about a vehicle a registration.
            (reply,) = planning.ask(
                KEYS.of(Route("vehicle", "new")), registration(), JSON, 30.0
            )
            assert reply.is_error
        assert client.vehicles() == before

        (reply,) = managing.ask(register, registration(), JSON, 60.0)
        assert not reply.is_error, reply
        assert client.vehicles() == (*before, "new")
        assert client.validate(trajectories[:1], "new")[0].valid

        assert planning.ask(unregister, b"{}", JSON, 30.0) == []
        assert client.vehicles() == (*before, "new")
        (reply,) = managing.ask(unregister, b"{}", JSON, 30.0)
        assert not reply.is_error, reply
        assert client.vehicles() == before


def test_what_a_planner_puts_is_not_stored(
    stored: Server, authority: Authority, planner: Security
) -> None:
    content = json.dumps(json.loads(registration())["vehicle"]).encode()
    changed = threading.Semaphore(0)
    with (
        opened(stored, planner) as planning,
        opened(stored, authority.issue("manager")) as managing,
        Client(stored.endpoint, timeout=30.0, security=planner) as client,
    ):
        managing.follow(KEYS.events, lambda _: changed.release())
        before = client.vehicles()
        planning.publish(f"{KEYS.root}/vehicles/new", content, JSON)
        assert planning.ask(f"{KEYS.root}/health", None, "", 30.0)
        assert managing.ask(f"{KEYS.root}/health", None, "", 30.0)
        managing.publish(f"{KEYS.root}/vehicles/new", content, JSON)
        assert changed.acquire(timeout=30)
        assert client.vehicles() == (*before, "new")
        # Only one thing has happened: a later event would be the planner's.
        assert not changed.acquire(timeout=0.2)


def test_servers_that_know_each_other_share_registrations(
    authority: Authority, planner: Security, fleet: Fleet, tmp_path: Path
) -> None:
    roles = replace(ROLES, servers=("server-1", "server-2"))
    one = authority.issue("server-1", roles=roles, file="one")
    two = authority.issue("server-2", roles=roles, file="two")
    arrived = threading.Event()
    with Server(
        (),
        listen=ANY_TLS_PORT,
        security=one,
        registry=Registry.open(fleet, tmp_path / "1"),
    ) as first:
        other = Registry.open(fleet, tmp_path / "2")
        other.subscribe(lambda _: arrived.set())
        with Server(
            (),
            listen=ANY_TLS_PORT,
            security=two,
            registry=other,
            peers=[first.endpoint],
        ) as second:
            key = KEYS.of(Route("register", "new"))
            with opened(first, authority.issue("manager")) as managing:
                (reply,) = managing.ask(key, registration(), JSON, 60.0)
            assert not reply.is_error, reply
            assert arrived.wait(30)
            with Client(second.endpoint, timeout=30.0, security=planner) as client:
                assert "new" in client.vehicles()


@pytest.mark.parametrize("is_known", [True, False])
def test_a_server_learns_from_another_only_if_that_one_knows_it(
    authority: Authority, fleet: Fleet, tmp_path: Path, is_known: bool
) -> None:
    both = replace(ROLES, servers=("server-1", "server-2"))
    one = authority.issue("server-1", roles=both if is_known else ROLES, file="one")
    two = authority.issue("server-2", roles=both, file="two")
    first, second = (Registry.open(fleet, tmp_path / name) for name in "12")
    first.put("new", json.dumps(json.loads(registration())["vehicle"]).encode())
    with (
        Server((), listen=ANY_TLS_PORT, security=one, registry=first) as server,
        Server(
            (),
            listen=ANY_TLS_PORT,
            security=two,
            registry=second,
            peers=[server.endpoint],
        ),
    ):
        # A server that has started has caught up with those that it may ask.
        assert ("new" in second.fleet) is is_known


def test_registration_is_off_by_default(secure: Server, authority: Authority) -> None:
    key = KEYS.of(Route("register", "new"))
    with opened(secure, authority.issue("manager")) as managing:
        (reply,) = managing.ask(key, registration(), JSON, 30.0)
    assert json.loads(reply.payload)["code"] == "registration_off"


def test_a_server_needs_a_certificate_for_both_sides_to_have_peers(
    authority: Authority,
) -> None:
    security = authority.issue("server-5", usages=SERVER_ONLY)
    Server([], listen=ANY_TLS_PORT, security=security)
    with pytest.raises(InvalidSecurity, match="for a TLS client"):
        Server([], listen=ANY_TLS_PORT, security=security, peers=["tls/127.0.0.1:7448"])


def test_the_whole_client_works_with_certificates(
    stored: Server,
    authority: Authority,
    planner: Security,
    fleet: Fleet,
    trajectories: Trajectories,
) -> None:
    space = fleet[1]
    twists = [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [9.0, 0.0, 0.0]]
    manager = authority.issue("manager")
    vehicle = configspace.load_vehicle("mecanum")
    with (
        Client(stored.endpoint, timeout=30.0, security=planner) as planning,
        Client(stored.endpoint, timeout=30.0, security=manager) as managing,
    ):
        table = planning.validate_many(trajectories, [space.name])
        expected = omniplan.validate_many(trajectories, [space])
        assert table.select(["valid"]) == expected.select(["valid"])
        permitted = planning.check_twists(twists, space.name)
        assert permitted.tolist() == omniplan.check_twists(twists, space).tolist()
        assert planning.space(space.name).header == space.header

        with pytest.raises(ServiceRefused, match=r"may not ask .*/register/mecanum"):
            planning.register(vehicle)
        assert vehicle.name not in planning.vehicles()
        version = managing.register(vehicle, expected_version="absent")
        assert vehicle.name in planning.vehicles()
        with pytest.raises(ServiceRefused, match=r"may not ask .*/unregister/mecanum"):
            planning.unregister(vehicle.name)
        managing.unregister(vehicle.name, expected_version=version)
        assert vehicle.name not in planning.vehicles()


def test_a_vehicle_is_online_with_its_certificate_and_only_as_itself(
    secure: Server, authority: Authority, planner: Security, trajectories: Trajectories
) -> None:
    def compared() -> set[str]:
        (ranking,) = planning.select(trajectories[:1], online_only=True)
        return {
            report.vehicle
            for report in (*(r.report for r in ranking.suitable), *ranking.refused)
        }

    security = authority.issue("differential")
    with (
        Client(secure.endpoint, timeout=30.0, security=planner) as planning,
        Client(secure.endpoint, timeout=30.0, security=security) as vehicle,
        vehicle.announce("ift-four-steered"),
        vehicle.announce("differential"),
    ):
        deadline = time.monotonic() + 30
        while "differential" not in compared():
            assert time.monotonic() < deadline
        assert compared() == {"differential"}
        with pytest.raises(ServiceUnreachable, match="nobody answers"):
            vehicle.vehicles()


class Opened:
    """Notes every file that this process opens, while it is on."""

    def __init__(self) -> None:
        self.is_on = False
        self.paths: list[str] = []
        sys.addaudithook(self._notice)  # stays until the process ends

    def _notice(self, event: str, arguments: tuple[object, ...]) -> None:
        if self.is_on and event in ("open", "os.listdir", "os.scandir", "import"):
            # Absolute as it was at that moment.
            self.paths.append(os.path.abspath(str(arguments[0])))


OPENED = Opened()


def requests_with(path: str, trajectory: dict[str, object]) -> Iterator[Any]:
    """Return (key, payload) with a path in every place that takes a name."""
    curve = {
        "t": [0, 1],
        "omni_curve": [[0, 0, 0.1]] * 2,
    }
    one: Sequence[object] = [trajectory]
    yield "validate", {"vehicle": path, "trajectories": one}
    yield "validate", {"vehicle": "differential", "trajectories": path}
    yield "validate", {"vehicle": "differential", "trajectories": [path]}
    for field in ("name", "vehicle", "reference_point", "t", "poses"):
        changed = [{**trajectory, field: path}]
        yield "validate", {"vehicle": "differential", "trajectories": changed}
    for vehicle in (path, {"name": path}, {"$ref": path}, [path]):
        curved = [{**curve, "vehicle": vehicle}]
        yield "validate", {"vehicle": "differential", "trajectories": curved}
    yield "select", {"trajectories": one, "vehicles": [path]}
    yield "select", {"trajectories": one, "by": path}
    yield "select", {"trajectories": one, "requirements": [path]}
    for field in ("include", "file", "path", "request", "fleet"):
        yield "select", {"trajectories": one, field: path}
    name = path.strip("/").replace("/", "_")
    for key in (f"vehicles/{name}", f"spaces/{name}", "vehicles/..", "spaces/../.."):
        yield key, None
    for vehicle in (path, {"name": path}, {"$ref": path}, f"!include {path}"):
        yield "register/new", {"vehicle": vehicle, "expected_version": None}
    yield f"vehicles/{path.strip('/')}", None


@pytest.mark.parametrize("is_absolute", [True, False])
def test_no_path_of_a_request_is_opened(
    fleet: Fleet,
    tmp_path: Path,
    trajectories: Trajectories,
    monkeypatch: pytest.MonkeyPatch,
    is_absolute: bool,
) -> None:
    secret = tmp_path / "secret.yaml"
    secret.write_text("name: secret\nwheels: []\n")
    # What is meant relative to the current folder would be found as well.
    monkeypatch.chdir(tmp_path)
    path = str(secret) if is_absolute else secret.name
    trajectory = trajectories[0].to_dict()
    registry = Registry.open(fleet, tmp_path / "store")
    with Server((), listen=ANY_PORT, registry=registry) as server:
        peer = Peer.connected(Endpoint.parse("endpoint", server.endpoint), 5.0, 0.0)
        OPENED.paths.clear()
        OPENED.is_on = True
        try:
            Path(path).read_text()
            assert str(secret) in OPENED.paths
            OPENED.paths.clear()
            for key, message in requests_with(path, trajectory):
                payload = None if message is None else json.dumps(message).encode()
                replies = peer.ask(f"{KEYS.root}/{key}", payload, JSON, 30.0)
                assert replies, key
                assert all(b"wheels: []" not in reply.payload for reply in replies)
        finally:
            OPENED.is_on = False
            peer.close()
    assert str(secret) not in OPENED.paths
