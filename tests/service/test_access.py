"""What zenoh's access control lets through, with real certificates on loopback."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest
from authority import CLIENT_ONLY, Authority
from loopback import ANY_TLS_PORT

from services import Roles, Security, ServiceRefused
from services.guarding.security import zenoh_entries
from services.protocol.endpoint import Endpoint
from services.protocol.keys import Keys
from services.wire.exchange import Publication, Request
from services.wire.session import Peer

pytestmark = pytest.mark.service

KEYS = Keys("default")
ROLES = Roles(
    planners=("planner-1",),
    fleet_managers=("manager",),
    vehicles=("agv-7",),
    servers=("server-1", "server-2"),
)
NAMES = ("planner-1", "manager", "agv-7", "server-2", "nobody")


@dataclass
class Hub:
    """A server's session that answers everything and notes what it hears."""

    peer: Peer
    queries: list[str] = field(default_factory=list)
    published: list[tuple[str, bool]] = field(default_factory=list)
    tokens: list[tuple[str, bool]] = field(default_factory=list)
    changed: threading.Condition = field(default_factory=threading.Condition)

    def answer(self, request: Request) -> None:
        with request:
            self.queries.append(request.key)
            # To an expression the answer comes under a key that it includes.
            key = request.key.replace("**", "x").replace("*", "x")
            request.reply(key, b"right", "text/plain")

    def hear(self, publication: Publication) -> None:
        with self.changed:
            self.published.append((publication.key, not publication.is_delete))
            self.changed.notify_all()

    def notice(self, key: str, is_there: bool) -> None:
        with self.changed:
            self.tokens.append((key, is_there))
            self.changed.notify_all()

    def heard(self, list: list[tuple[str, bool]], entry: tuple[str, bool]) -> bool:
        with self.changed:
            return self.changed.wait_for(lambda: entry in list, timeout=10)


@pytest.fixture(scope="module")
def authority(tmp_path_factory: pytest.TempPathFactory) -> Authority:
    return Authority(tmp_path_factory.mktemp("access"))


@pytest.fixture(scope="module")
def issued(authority: Authority) -> dict[str, Security]:
    return {name: authority.issue(name) for name in NAMES}


@pytest.fixture(scope="module")
def shared(authority: Authority) -> Iterator[Hub]:
    security = authority.issue("server-1", roles=ROLES)
    entries = zenoh_entries(security, "server", KEYS)
    hub = Hub(Peer.listening(Endpoint.parse("listen", ANY_TLS_PORT), entries))
    hub.peer.serve(KEYS.everything, hub.answer)
    hub.peer.serve(f"{KEYS.root}/@sync/**", hub.answer)
    hub.peer.serve("omniplan/v1/elsewhere/**", hub.answer)
    hub.peer.follow(f"{KEYS.root}/vehicles/*", hub.hear)
    hub.peer.follow(f"{KEYS.root}/events/**", hub.hear)
    hub.peer.watch(f"{KEYS.root}/vehicles/*/online", hub.notice)
    hub.peer.announce(KEYS.server("one"))
    yield hub
    hub.peer.close()


@pytest.fixture
def hub(shared: Hub) -> Hub:
    shared.queries.clear()
    shared.published.clear()
    shared.tokens.clear()
    return shared


def connected(hub: Hub, security: Security) -> Peer:
    entries = zenoh_entries(security, "client", KEYS)
    return Peer.connected(hub.peer.endpoint, 10.0, 0.0, entries)


def settle(peer: Peer) -> None:
    """Wait until the server has taken, or refused, all that was sent to it."""
    peer.ask(f"{KEYS.root}/health", None, "", 10.0)


@pytest.fixture
def peers(hub: Hub, issued: dict[str, Security]) -> Iterator[dict[str, Peer]]:
    peers = {name: connected(hub, security) for name, security in issued.items()}
    yield peers
    for peer in peers.values():
        peer.close()


QUESTIONS = {
    *KEYS.all_of(["a"]),
    f"{KEYS.root}/batches/validate",
    f"{KEYS.root}/cancel/7f3a",
    f"{KEYS.root}/vehicles/*",
    f"{KEYS.root}/spaces/*",
}
REGISTRATION = {
    f"{KEYS.root}/{verb}/{id}" for verb in ("register", "unregister") for id in "a*"
}
AMONG_SERVERS = {f"{KEYS.root}/@sync/one/digest"}
WIDE = {f"{KEYS.root}/{key}" for key in ("**", "*", "*/a", "vehicles/**", "nothing")}
OTHER = {"omniplan/v1/elsewhere/health", "omniplan/v1/*/health", "**"}
ALLOWED = {
    "planner-1": QUESTIONS,
    "manager": QUESTIONS | REGISTRATION,
    "agv-7": set(),
    "server-2": QUESTIONS | REGISTRATION | AMONG_SERVERS | WIDE,
    "nobody": set(),
}


@pytest.mark.parametrize("payload", [None, b"{}"])
def test_every_role_is_answered_what_it_may_ask_and_nothing_else(
    hub: Hub, peers: dict[str, Peer], payload: bytes | None
) -> None:
    administration = {f"@/{hub.peer.instance}/**"}
    every = QUESTIONS | REGISTRATION | AMONG_SERVERS | WIDE | OTHER | administration
    for name, peer in peers.items():
        hub.queries.clear()
        answered = {
            key for key in every if peer.ask(key, payload, "application/json", 10.0)
        }
        assert answered == ALLOWED[name], name
        # Not only the answer stays away: the question does not arrive.
        assert set(hub.queries) == ALLOWED[name], name


def test_only_the_fleet_manager_stores_and_removes(
    hub: Hub, peers: dict[str, Peer]
) -> None:
    for name, peer in peers.items():
        peer.publish(f"{KEYS.root}/vehicles/by-{name}", b"{}", "application/json")
        peer._session.delete(f"{KEYS.root}/vehicles/by-{name}")
    expected = {
        (f"{KEYS.root}/vehicles/by-{name}", is_put)
        for name in ("manager", "server-2")
        for is_put in (True, False)
    }
    for entry in expected:
        assert hub.heard(hub.published, entry), entry
    for peer in peers.values():
        settle(peer)
    assert set(hub.published) == expected


def test_events_come_from_servers_only(
    hub: Hub, issued: dict[str, Security], peers: dict[str, Peer]
) -> None:
    event = f"{KEYS.root}/events/vehicles/a"
    arrived: dict[str, threading.Event] = {}
    for name, peer in peers.items():
        arrived[name] = seen = threading.Event()
        peer.follow(event, lambda _, seen=seen: seen.set())  # type: ignore[misc]
    for name in ("planner-1", "manager", "agv-7", "nobody"):
        peers[name].publish(event, b"false", "application/json")
        settle(peers[name])
    assert hub.published == []
    assert not any(seen.is_set() for seen in arrived.values())
    hub.peer.publish(event, b"true", "application/json")
    for name in ("planner-1", "manager", "server-2"):
        assert arrived[name].wait(10), name
    assert not arrived["agv-7"].is_set()
    assert not arrived["nobody"].is_set()


def test_a_vehicle_is_online_under_its_own_name_only(
    hub: Hub, peers: dict[str, Peer]
) -> None:
    def token(name: str) -> str:
        return f"{KEYS.root}/vehicles/{name}/online"

    for name in ("planner-1", "manager", "nobody"):
        peers[name].announce(token(name))
        peers[name].announce(token("agv-7"))
        settle(peers[name])
    vehicle = peers["agv-7"]
    vehicle.announce(token("agv-8"))
    vehicle.announce(KEYS.server("fake"))
    assert hub.tokens == []
    end = vehicle.announce(token("agv-7"))
    # The refused ones were sent before on the same way.
    assert hub.heard(hub.tokens, (token("agv-7"), True))
    end()
    assert hub.heard(hub.tokens, (token("agv-7"), False))
    assert len(hub.tokens) == 2


def test_planners_see_the_servers_and_others_see_nothing(
    peers: dict[str, Peer],
) -> None:
    for name, sees in (("planner-1", True), ("manager", True), ("server-2", True)):
        assert peers[name].wait_for_token(KEYS.servers, 10.0) is sees, name
    for name in ("agv-7", "nobody"):
        assert not peers[name].wait_for_token(KEYS.servers, 0.2), name


def test_nobody_can_answer_in_the_servers_place(
    hub: Hub, peers: dict[str, Peer]
) -> None:
    asked = threading.Event()

    def false(request: Request) -> None:
        asked.set()
        with request:
            request.reply(request.key, b"false", "text/plain")

    for name in ("manager", "agv-7", "nobody"):
        peers[name].serve(f"{KEYS.root}/validate", false)
        settle(peers[name])
    question = f"{KEYS.root}/validate"
    (reply,) = peers["planner-1"].ask(question, None, "", 10.0)
    assert reply.payload == b"right"
    assert hub.peer.gather(question, b"", "", 10.0) == {}
    assert not asked.is_set()


def test_a_client_that_lists_servers_takes_no_answer_from_others(
    authority: Authority,
) -> None:
    # A certificate of the same authority for the same host, but no server's name.
    false = Hub(
        Peer.listening(
            Endpoint.parse("listen", ANY_TLS_PORT),
            zenoh_entries(
                authority.issue("planner-2", roles=Roles(planners=("planner-3",))),
                "server",
                KEYS,
            ),
        )
    )
    false.peer.serve(KEYS.everything, false.answer)
    trusting = connected(false, authority.issue("planner-3"))
    choosy = connected(
        false, authority.issue("planner-3", roles=Roles(servers=("server-1",)))
    )
    try:
        assert trusting.ask(f"{KEYS.root}/health", None, "", 10.0)
        assert choosy.ask(f"{KEYS.root}/health", None, "", 10.0) == []
        assert len(false.queries) == 1
    finally:
        for peer in (trusting, choosy, false.peer):
            peer.close()


def test_a_clients_certificate_does_not_make_a_server(
    authority: Authority, issued: dict[str, Security]
) -> None:
    security = authority.issue("client-only", usages=CLIENT_ONLY)
    # As a client so that our own check lets it pass.
    entries = zenoh_entries(security, "client", KEYS)
    false = Hub(Peer.listening(Endpoint.parse("listen", ANY_TLS_PORT), entries))
    try:
        with pytest.raises(ServiceRefused, match="not for a server"):
            connected(false, issued["planner-1"])
    finally:
        false.peer.close()


def test_without_roles_nobody_may_anything(
    authority: Authority, issued: dict[str, Security]
) -> None:
    entries = zenoh_entries(authority.issue("server-1"), "server", KEYS)
    hub = Hub(Peer.listening(Endpoint.parse("listen", ANY_TLS_PORT), entries))
    hub.peer.serve(KEYS.everything, hub.answer)
    try:
        for name in NAMES:
            peer = connected(hub, issued[name])
            assert peer.ask(f"{KEYS.root}/health", None, "", 10.0) == []
            peer.close()
        assert hub.queries == []
    finally:
        hub.peer.close()
