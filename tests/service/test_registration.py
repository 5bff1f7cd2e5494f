"""Vehicles that are registered, changed and removed while a server runs."""

from __future__ import annotations

import contextlib
import json
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from loopback import ANY_PORT, Ask, Fleet, Trajectories

import configspace
import omniplan
from services import Client, Registry, RemoteError, Server
from services.protocol.endpoint import Endpoint
from services.protocol.keys import Keys
from services.registering.registry_messages import VehicleEvent
from services.wire.exchange import Publication
from services.wire.session import Peer

pytestmark = pytest.mark.service

GRID = configspace.Grid(40, 72)
KEYS = Keys("default")
AGV = configspace.load_vehicle("mecanum")
FASTER = AGV.model_copy(update={"description": "the same, said otherwise"})


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "store"


@pytest.fixture
def server(fleet: Fleet, folder: Path) -> Iterator[Server]:
    """Takes the place of the server that takes no registrations."""
    with (
        Registry.open(fleet, folder, grid=GRID) as registry,
        Server(registry=registry, listen=ANY_PORT) as server,
    ):
        yield server


@pytest.fixture
def peer(server: Server) -> Iterator[Peer]:
    peer = Peer.connected(Endpoint.parse("endpoint", server.endpoint), 5.0, 0.0)
    with contextlib.closing(peer):
        yield peer


class Events:
    """What a server publishes."""

    def __init__(self, peer: Peer) -> None:
        self._heard: list[VehicleEvent] = []
        self._changed = threading.Condition()
        peer.follow(KEYS.events, self._hear)

    def _hear(self, publication: Publication) -> None:
        event = VehicleEvent.model_validate_json(publication.read())
        assert publication.key == KEYS.event(event.id)
        with self._changed:
            self._heard.append(event)
            self._changed.notify_all()

    def wait(self, n: int) -> list[VehicleEvent]:
        """Return the events heard so far, at least n."""
        with self._changed:
            assert self._changed.wait_for(lambda: len(self._heard) >= n, 30)
            return list(self._heard)


def code_of(caught: pytest.ExceptionInfo[RemoteError]) -> tuple[str, str | None]:
    return caught.value.code, caught.value.field


def test_a_registered_vehicle_is_answered_for_as_in_process(
    client: Client, trajectories: Trajectories
) -> None:
    assert "mecanum" not in client.vehicles()
    version = client.register(AGV)
    assert client.vehicles() == ("ift-four-steered", "differential", "mecanum")
    assert client.vehicle("mecanum") == AGV
    space = configspace.build_space(AGV, GRID, cache=False)
    assert client.space("mecanum").header == space.header
    expected = tuple(omniplan.validate(each, space) for each in trajectories)
    assert client.validate(trajectories, "mecanum") == expected
    assert client.register(AGV) == version
    assert client.register(AGV, "absent") == version


def test_versions_guard_against_lost_updates(client: Client) -> None:
    first = client.register(AGV, "absent")
    second = client.register(FASTER, first)
    assert second != first
    with pytest.raises(RemoteError, match=f"mecanum is {second}") as caught:
        client.register(AGV, first)
    assert code_of(caught) == ("conflict", "expected_version")
    # The answer to the first one may have been lost.
    assert client.register(FASTER, first) == second
    with pytest.raises(RemoteError, match="conflict"):
        client.unregister("mecanum", first)
    gone = client.unregister("mecanum", second)
    assert client.unregister("mecanum", second) == gone
    assert "mecanum" not in client.vehicles()
    with pytest.raises(RemoteError) as caught:
        client.space("mecanum")
    assert caught.value.code == "unknown_vehicle"
    assert client.register(AGV, "absent") not in (first, second, gone)


def test_events_tell_what_has_changed(peer: Peer, client: Client) -> None:
    events = Events(peer)
    # Answered in zenoh's order: the subscription is known by now.
    client.vehicles()
    first = client.register(AGV)
    client.register(AGV)
    second = client.register(FASTER)
    gone = client.unregister("mecanum")
    heard = events.wait(3)
    assert [event.version for event in heard] == [first, second, gone]
    assert [event.kind for event in heard] == ["put", "put", "delete"]
    assert {event.id for event in heard} == {"mecanum"}
    assert {event.server for event in heard} == {client.health().instance}
    header = configspace.build_space(AGV, GRID, cache=False).header
    assert heard[0].fingerprint == header.fingerprint
    assert heard[2].fingerprint == ""


def test_a_client_learns_that_its_data_sheet_is_outdated(
    server: Server, client: Client
) -> None:
    client.register(AGV)
    with Client(server.endpoint, timeout=30.0) as planner:
        assert planner.space("mecanum").header.description == AGV.description
        client.register(FASTER)
        deadline = threading.Event()
        for _ in range(200):
            if planner.space("mecanum").header.description == FASTER.description:
                break
            deadline.wait(0.05)
        assert planner.space("mecanum").header.description == FASTER.description


def test_registered_vehicles_are_there_after_a_restart(
    fleet: Fleet, folder: Path
) -> None:
    @contextlib.contextmanager
    def started() -> Iterator[Client]:
        with (
            Registry.open(fleet, folder, grid=GRID) as registry,
            Server(registry=registry, listen=ANY_PORT) as server,
            Client(server.endpoint, timeout=30.0) as client,
        ):
            yield client

    with started() as client:
        version = client.register(AGV)
    with started() as client:
        assert client.vehicle("mecanum") == AGV
        assert client.register(AGV) == version
        client.unregister("mecanum", version)
    with started() as client:
        assert "mecanum" not in client.vehicles()


def test_zenohs_own_put_and_delete_register_too(peer: Peer, client: Client) -> None:
    events = Events(peer)
    client.vehicles()
    file = AGV.model_dump_json(exclude_none=True)
    peer.publish(KEYS.files.replace("*", "mecanum"), file.encode(), "text/plain")
    (event,) = events.wait(1)
    assert client.vehicle("mecanum") == AGV
    assert client.register(AGV) == event.version
    peer.erase(KEYS.files.replace("*", "mecanum"))
    assert events.wait(2)[1].kind == "delete"
    assert "mecanum" not in client.vehicles()


def test_puts_that_are_none_change_nothing(
    peer: Peer, client: Client, caplog: pytest.LogCaptureFixture
) -> None:
    known = client.vehicles()
    version = client.register(AGV)
    events = Events(peer)
    client.vehicles()
    for key in ("cart", "mecanum", "differential", "..", "*", "@x"):
        for payload in (b"", b"\xff", b"name: cart", b"{" * 1000):
            peer.publish(KEYS.files.replace("*", key), payload, "text/plain")
    for key in ("*", "differential", "nobody"):
        peer.erase(KEYS.files.replace("*", key))
    client.register(FASTER, version)
    # What was sent before has been answered before, or is waiting; the last event is
    # that of the last change all the same.
    client.unregister("mecanum")
    assert [event.kind for event in events.wait(2)] == ["put", "delete"]
    assert client.vehicles() == known


@pytest.mark.parametrize(
    ("key", "message", "code", "field"),
    [
        ("register/cart", b"", "invalid_message", "payload"),
        ("register/cart", b"{}", "invalid_message", "vehicle"),
        ("register/cart", b'{"vehicle": 3}', "invalid_message", None),
        ("register/cart", b'{"vehicle": "\\ud800"}', "invalid_message", None),
        ("register/cart", b'{"vehicle": {}}', "invalid_vehicle", "name"),
        ("register/cart", b'{"vehicle": "a: ["}', "invalid_vehicle", None),
        ("register/differential", b'{"vehicle": {}}', "read_only", "vehicle"),
        ("unregister/differential", b"", "read_only", "vehicle"),
        ("unregister/nobody", b"", "unknown_vehicle", "vehicle"),
        ("unregister/nobody", b'{"force": true}', "invalid_message", "force"),
        (
            "unregister/nobody",
            b'{"expected_version": "1"}',
            "invalid_input",
            "expected_version",
        ),
        ("vehicles/cart", b'{"vehicle": {}}', "invalid_message", "payload"),
    ],
)
def test_what_cannot_be_registered_is_answered_so(
    ask: Ask, key: str, message: bytes, code: str, field: str | None
) -> None:
    (reply,) = ask(key, message)
    error = json.loads(reply.payload)
    assert (reply.is_error, error["code"]) == (True, code)
    if field is not None:
        assert error["field"] == field


def test_no_wildcard_registers_or_removes(ask: Ask, client: Client) -> None:
    client.register(AGV)
    request = json.dumps({"vehicle": AGV.model_dump(mode="json", exclude_none=True)})
    for key in ("register/*", "unregister/*", "*/mecanum", "**"):
        for payload in (request.encode(), b"{}"):
            for reply in ask(key, payload):
                assert reply.is_error
    assert ask("unregister/*") == []
    assert client.vehicle("mecanum") == AGV


def test_what_servers_say_among_themselves_is_out_of_reach(ask: Ask) -> None:
    replies = ask("**")
    assert replies
    assert not any(b'"versions"' in reply.payload for reply in replies)


def test_registration_is_off_unless_asked_for(fleet: Fleet) -> None:
    with (
        Server(fleet, listen=ANY_PORT) as server,
        Client(server.endpoint, timeout=30.0) as client,
    ):
        with pytest.raises(RemoteError) as caught:
            client.register(AGV)
        assert caught.value.code == "registration_off"
        with pytest.raises(RemoteError) as caught:
            client.unregister("differential")
        assert caught.value.code == "registration_off"
        assert client.vehicles() == ("ift-four-steered", "differential")


def test_only_vehicles_that_are_online_are_selected(
    server: Server, client: Client, trajectories: Trajectories
) -> None:
    with Client(server.endpoint, timeout=30.0) as vehicle:
        with vehicle.announce("differential"), vehicle.announce("stranger"):
            await_online(client, trajectories, {"differential"})
        await_online(client, trajectories, set())
        with vehicle.announce("ift-four-steered"):
            await_online(client, trajectories, {"ift-four-steered"})
    await_online(client, trajectories, set())


def await_online(
    client: Client, trajectories: Trajectories, expected: set[str]
) -> None:
    """Wait until exactly these vehicles are compared."""
    pause = threading.Event()
    for _ in range(200):
        if compared(client, trajectories) == expected:
            return
        pause.wait(0.05)
    assert compared(client, trajectories) == expected


def compared(client: Client, trajectories: Trajectories) -> set[str]:
    try:
        (ranking,) = client.select(trajectories[:1], online_only=True)
    except RemoteError as error:
        if "no vehicle is online" in str(error):
            return set()
        raise
    suitable = {candidate.vehicle for candidate in ranking.suitable}
    return suitable | {report.vehicle for report in ranking.refused}


def test_a_vehicle_cannot_announce_what_is_no_name(client: Client) -> None:
    with pytest.raises(configspace.InvalidInput), client.announce("a/*"):
        pass


def test_a_server_takes_a_fleet_or_a_registry(fleet: Fleet) -> None:
    with pytest.raises(configspace.InvalidInput, match="fleet: 2 vehicles; none"):
        Server(fleet, registry=Registry(fleet))
    with pytest.raises(configspace.InvalidInput, match=r"peers\[1\]"):
        Server(fleet, peers=["tcp/127.0.0.1:7448", "nowhere"])
