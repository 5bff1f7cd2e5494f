"""Several servers of one site: they know the same, and one may be killed."""

from __future__ import annotations

import contextlib
import itertools
import json
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import TracebackType
from typing import Self

import pytest
from loopback import Fleet, Trajectories

import configspace
import omniplan
from services import Client, Registry, RemoteError, Server
from services.protocol.endpoint import Endpoint
from services.protocol.keys import Keys, Route
from services.registering.sync import Sync
from services.registering.versions import Version
from services.wire.exchange import Request
from services.wire.session import Peer

pytestmark = pytest.mark.service

GRID = configspace.Grid(40, 72)
AGV = configspace.load_vehicle("mecanum")


def described(text: str, name: str = "mecanum") -> configspace.Vehicle:
    """Return another version of a vehicle."""
    return AGV.model_copy(update={"name": name, "description": text})


def free_endpoints(n: int) -> list[str]:
    with contextlib.ExitStack() as stack:
        probes = [
            stack.enter_context(socket.create_server(("127.0.0.1", 0)))
            for _ in range(n)
        ]
        return [f"tcp/127.0.0.1:{probe.getsockname()[1]}" for probe in probes]


class Site:
    """Servers of one site, each with a store of its own."""

    def __init__(self, fleet: Fleet, folder: Path, n: int) -> None:
        self._fleet = fleet
        self._folder = folder
        self.endpoints = free_endpoints(n)
        self.registries: dict[int, Registry] = {}
        self._running: dict[int, contextlib.ExitStack] = {}

    def start(self, index: int, peers: list[int] | None = None) -> Registry:
        """Start one, connected to those before it unless others are given."""
        stack = contextlib.ExitStack()
        folder = self._folder / f"store-{index}"
        registry = Registry.open(self._fleet, folder, grid=GRID)
        stack.enter_context(registry)
        others = range(index) if peers is None else peers
        server = Server(
            registry=registry,
            listen=self.endpoints[index],
            peers=[self.endpoints[i] for i in others],
        )
        stack.enter_context(server)
        self.registries[index] = registry
        self._running[index] = stack
        return registry

    def stop(self, index: int) -> None:
        self._running.pop(index).close()
        del self.registries[index]

    def client(self, index: int) -> Client:
        return Client(self.endpoints[index], timeout=30.0)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        for index in list(self._running):
            self.stop(index)


@pytest.fixture
def site(fleet: Fleet, tmp_path: Path) -> Iterator[Site]:
    with Site(fleet, tmp_path, 3) as site:
        yield site


def wait_for(is_so: Callable[[], bool]) -> None:
    pause = threading.Event()
    for _ in range(600):
        if is_so():
            return
        pause.wait(0.05)
    raise AssertionError("not within 30 s")


def wait_until_alike(*registries: Registry) -> None:
    wait_for(lambda: len({each.snapshot.state for each in registries}) == 1)
    first = registries[0].snapshot
    for registry in registries[1:]:
        names = list(first.fleet)
        assert list(registry.fleet) == names
        prints = [registry.snapshot.fingerprint(name) for name in names]
        assert prints == [first.fingerprint(name) for name in names]


def test_registrations_and_removals_reach_all_servers(site: Site) -> None:
    registries = [site.start(i) for i in range(3)]
    with site.client(0) as one, site.client(2) as other:
        version = one.register(AGV)
        wait_for(lambda: "mecanum" in registries[2].fleet)
        assert other.vehicle("mecanum") == AGV
        # The version is the same everywhere, so the precondition holds everywhere.
        second = other.register(described("newer"), version)
        wait_until_alike(*registries)
        with pytest.raises(RemoteError, match="conflict"):
            one.register(AGV, version)
        gone = one.unregister("mecanum", second)
        wait_until_alike(*registries)
        assert "mecanum" not in other.vehicles()
        assert other.unregister("mecanum") == gone


def test_who_comes_late_has_caught_up_before_it_answers(site: Site) -> None:
    site.start(0)
    with site.client(0) as client:
        for i in range(5):
            client.register(described("", f"agv-{i}"))
        client.unregister("agv-3")
    late = site.start(1)
    # No waiting: what it missed is there as soon as it has started.
    assert late.snapshot.state == site.registries[0].snapshot.state
    assert [name for name in late.fleet if name.startswith("agv")] == [
        "agv-0",
        "agv-1",
        "agv-2",
        "agv-4",
    ]


def test_servers_that_were_apart_agree_again(site: Site) -> None:
    first = site.start(0)
    second = site.start(1)
    with site.client(0) as client:
        client.register(described("both"))
        client.register(described("", "gone"))
    wait_until_alike(first, second)
    site.stop(1)
    with site.client(0) as client:
        client.register(described("changed at the first"))
        client.unregister("gone")
        client.register(described("", "at-first"))
    site.stop(0)
    # Meanwhile the other one runs alone, and changes the same vehicle later.
    second = site.start(1, peers=[0])
    assert "gone" in second.fleet
    with site.client(1) as client:
        client.register(described("changed at the second"))
        client.register(described("", "at-second"))
    # It finds the first one again by itself.
    first = site.start(0, peers=[])
    wait_until_alike(first, second)
    for registry in (first, second):
        assert "gone" not in registry.fleet
        assert {"at-first", "at-second"} <= set(registry.fleet)
        vehicle = registry.fleet["mecanum"].vehicle
        assert vehicle is not None
        assert vehicle.description == "changed at the second"


def test_a_change_arrives_without_being_asked_for(
    site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    site.start(0)
    second = site.start(1)
    # From now on nobody can fetch anything: as if the sender were killed after it.
    monkeypatch.setattr(Sync, "compare", lambda *_: None)
    with site.client(0) as client:
        version = client.register(AGV)
        wait_for(lambda: "mecanum" in second.fleet)
        assert str(second.snapshot.records["mecanum"].version) == version
        client.unregister("mecanum")
        wait_for(lambda: "mecanum" not in second.fleet)


def test_zenohs_own_put_at_two_servers_ends_as_one_version(site: Site) -> None:
    registries = [site.start(i) for i in range(2)]
    endpoints = [Endpoint.parse("endpoint", each) for each in site.endpoints[:2]]
    key = Keys("default").of(Route("vehicle", "mecanum"))
    peer = Peer.connected_any(endpoints, 5.0, 5.0)
    with contextlib.closing(peer):
        for description in ("first", "second"):
            file = described(description).model_dump_json(exclude_none=True)
            wait_for(
                lambda file=file: publish_until_known(peer, key, file, registries)  # type: ignore[misc]
            )
            wait_until_alike(*registries)
    wait_until_alike(*registries)


def publish_until_known(
    peer: Peer, key: str, file: str, registries: list[Registry]
) -> bool:
    """Put a vehicle: a put that comes before the subscription is known vanishes."""
    vehicle = configspace.parse_vehicle(file)
    peer.publish(key, file.encode(), "application/json")
    found = [registry.fleet.get("mecanum") for registry in registries]
    return all(space is not None and space.vehicle == vehicle for space in found)


NO_RECORDS = [
    b"",
    b"\xff",
    b"[]",
    b'{"records": 3}',
    b'{"records": [{"id": "../x", "version": "7-00000000000000aa"}]}',
    b'{"records": [{"id": "x", "version": "0-00000000000000aa"}]}',
    b'{"records": [{"id": "x", "version": "9007199254740991-00000000000000aa"}]}',
    b'{"state": "x", "versions": {"x": 3}}',
    b'{"state": "x", "versions": {"../x": "7-00000000000000aa", "x": "7"}}',
]


def test_nonsense_from_another_server_changes_nothing(site: Site) -> None:
    first = site.start(0)
    keys = Keys("default")
    endpoint = Endpoint.parse("endpoint", site.endpoints[0])
    rogue = Peer.connected(endpoint, 5.0, 0.0)
    answers = itertools.cycle(NO_RECORDS)
    n_asked = threading.Semaphore(0)

    def answer(request: Request) -> None:
        with request:
            key = keys.sync("rogue", "digest")
            request.reply(key, next(answers), "application/json")
            n_asked.release()

    with contextlib.closing(rogue), site.client(0) as client:
        version = client.register(AGV)
        before = first.snapshot
        rogue.serve(keys.sync("rogue", "digest"), answer)
        rogue.announce(keys.server("rogue"))
        for payload in NO_RECORDS:
            rogue.publish(keys.sync("rogue", "changed"), payload, "application/json")
            rogue.publish(keys.event("mecanum"), payload, "application/json")
            for what in ("digest", "records", "nonsense"):
                key = keys.sync("*", what)
                rogue.gather(key, payload, "application/json", 30.0)
            # Each change wakes it, and it asks all others.
            assert n_asked.acquire(timeout=30)
        assert first.snapshot is before
        # And it goes on to work with those that talk sense.
        second = site.start(1)
        assert second.snapshot.records == before.records
        assert client.register(AGV) == version


def test_changes_at_all_servers_at_once_end_alike(site: Site) -> None:
    registries = [site.start(i) for i in range(3)]

    def change(index: int) -> None:
        with site.client(index) as client:
            for i in range(8):
                client.register(described(f"{index} {i}", f"agv-{i % 3}"))
                if i % 3 == 2:
                    client.unregister(f"agv-{(i + index) % 3}")

    with ThreadPoolExecutor(3) as pool:
        list(pool.map(change, range(3)))
    wait_until_alike(*registries)
    records = registries[0].snapshot.records
    assert set(records) == {"agv-0", "agv-1", "agv-2"}
    for registry in registries[1:]:
        assert registry.snapshot.records == records


def test_a_server_of_another_site_or_without_registration_is_left_alone(
    site: Site, fleet: Fleet, tmp_path: Path
) -> None:
    first = site.start(0)
    peers = [site.endpoints[0]]
    with (
        Server(fleet, listen=site.endpoints[1], peers=peers),
        Registry.open(fleet, tmp_path / "other", grid=GRID) as registry,
        Server(
            registry=registry, listen=site.endpoints[2], peers=peers, site="elsewhere"
        ),
        site.client(0) as client,
        site.client(1) as reader,
    ):
        client.register(AGV)
        assert "mecanum" in first.fleet
        assert reader.vehicles() == ("ift-four-steered", "differential")
        assert registry.snapshot.records == {}


def test_a_vehicle_at_one_server_is_online_at_all(
    site: Site, trajectories: Trajectories
) -> None:
    for i in range(2):
        site.start(i)

    def online(client: Client) -> set[str]:
        try:
            (ranking,) = client.select(trajectories[:1], online_only=True)
        except RemoteError:
            return set()
        suitable = {candidate.vehicle for candidate in ranking.suitable}
        return suitable | {report.vehicle for report in ranking.refused}

    with site.client(0) as vehicle, site.client(1) as planner:
        with vehicle.announce("differential"):
            wait_for(lambda: online(planner) == {"differential"})
            # And again when another server starts, or the one that it was at is back.
            site.start(2)
            with site.client(2) as late:
                wait_for(lambda: online(late) == {"differential"})
            site.stop(0)
            wait_for(lambda: not online(planner))
            site.start(0, peers=[1, 2])
            wait_for(lambda: online(planner) == {"differential"})
        wait_for(lambda: not online(planner))


SERVER = """
import json, sys, threading
import configspace
from services import Registry, Server

listen, peers, folder, fleet = json.loads(sys.argv[1])
grid = configspace.Grid(40, 72)
spaces = [
    configspace.build_space(configspace.load_vehicle(name), grid) for name in fleet
]
with Registry.open(spaces, folder, grid=grid) as registry:
    with Server(registry=registry, listen=listen, peers=peers) as server:
        print("ready", flush=True)
        server.wait()
"""


class Process:
    """A server in a process of its own."""

    def __init__(self, endpoints: list[str], index: int, folder: Path) -> None:
        peers = [other for other in endpoints if other != endpoints[index]]
        fleet = ["ift-four-steered", "differential"]
        arguments = [endpoints[index], peers, str(folder / f"store-{index}"), fleet]
        self._process = subprocess.Popen(
            [sys.executable, "-c", SERVER, json.dumps(arguments)],
            stdout=subprocess.PIPE,
            text=True,
        )

    def wait_until_ready(self) -> None:
        assert self._process.stdout is not None
        assert self._process.stdout.readline() == "ready\n"

    def kill(self) -> None:
        """Kill it with SIGKILL; does nothing if it has ended before."""
        self._process.kill()
        self._process.wait()
        assert self._process.stdout is not None
        self._process.stdout.close()


def kill_all(processes: list[Process]) -> None:
    for process in processes:
        process.kill()


class Load:
    """Threads that ask without pause and compare every answer."""

    def __init__(
        self, endpoints: list[str], fleet: Fleet, trajectories: Trajectories, n: int
    ) -> None:
        self._expected = {
            (space.name, each.name): omniplan.validate(each, space)
            for space in fleet
            for each in trajectories
        }
        self._by_name = {each.name: each for each in trajectories}
        self._is_over = threading.Event()
        self._counts = [0] * n
        self._pool = ThreadPoolExecutor(n)
        self._tasks = [
            # Each prefers another server.
            self._pool.submit(self._ask, i, endpoints[i % 3 :] + endpoints[: i % 3])
            for i in range(n)
        ]

    def _ask(self, index: int, endpoints: list[str]) -> None:
        with Client(endpoints, timeout=30.0) as client:
            while not self._is_over.is_set():
                for (vehicle, name), expected in self._expected.items():
                    (report,) = client.validate([self._by_name[name]], vehicle)
                    assert report == expected
                    self._counts[index] += 1

    def wait_for_more(self, n: int) -> None:
        """Wait until every thread has had so many further answers."""
        due = [count + n for count in self._counts]

        def is_so() -> bool:
            for task in self._tasks:
                if task.done():
                    task.result()
            pairs = zip(self._counts, due, strict=True)
            return all(count >= least for count, least in pairs)

        wait_for(is_so)

    def finish(self) -> int:
        """Return how many answers there were, all of them right."""
        self._is_over.set()
        for task in self._tasks:
            task.result(40)
        self._pool.shutdown()
        return sum(self._counts)


def run_kills(fleet: Fleet, trajectories: Trajectories, folder: Path, n: int) -> None:
    """Kill one of three servers n times under load; nothing is lost or wrong."""
    endpoints = free_endpoints(3)
    with contextlib.ExitStack() as stack:
        processes = [Process(endpoints, i, folder) for i in range(3)]
        for process in processes:
            process.wait_until_ready()
        stack.callback(lambda: kill_all(processes))
        manager = stack.enter_context(Client(endpoints, timeout=30.0))
        manager.wait_until_ready()
        load = Load(endpoints, fleet, trajectories, 4)
        version = manager.register(described("0"), "absent")
        for i in range(n):
            load.wait_for_more(2)
            processes[i % 3].kill()
            # Nothing that may be asked again fails while it is away.
            newer = manager.register(described(f"{i + 1}"), version)
            assert Version.parse(newer) > Version.parse(version)
            version = newer
            load.wait_for_more(2)
            processes[i % 3] = Process(endpoints, i % 3, folder)
            processes[i % 3].wait_until_ready()
        assert load.finish() >= 4 * 4 * n
        for endpoint in endpoints:
            with Client(endpoint, timeout=30.0) as client:
                wait_for(lambda: client.vehicle("mecanum").description == f"{n}")
                assert client.register(described(f"{n}")) == version


def test_no_question_fails_when_a_server_is_killed(
    fleet: Fleet, trajectories: Trajectories, tmp_path: Path
) -> None:
    run_kills(fleet, trajectories, tmp_path, 1)


@pytest.mark.slow
@pytest.mark.timeout(400)
def test_no_question_fails_when_servers_are_killed_again_and_again(
    fleet: Fleet, trajectories: Trajectories, tmp_path: Path
) -> None:
    run_kills(fleet, trajectories, tmp_path, 12)
