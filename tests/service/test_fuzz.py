"""Bad input: mutated requests to a live server, whose process is looked at afterwards.

Every one is answered with an error reply of a known code, or with what the same request
means within this process. The server lives, its memory is bounded, its log has no
traceback, and it knows what was registered and nothing else, also after SIGKILL.
"""

from __future__ import annotations

import contextlib
import json
import socket
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from answer_judge import Judge
from loopback import Fleet, Trajectories
from mutations import Rng
from odd_requests import FIXED, MAX_BYTES, ROOT, Question, Source

import configspace
from services import Client, Registry
from services.errors import ServiceError
from services.protocol.endpoint import Endpoint
from services.protocol.messages import JSON, Health, decode
from services.registering.registry_messages import RegisterReply
from services.registering.versions import Version
from services.wire.exchange import Reply, Stop
from services.wire.session import Peer

pytestmark = pytest.mark.service

GRID = configspace.Grid(40, 72)
IN_FLIGHT = 12
# What is built when it is first needed, such as maps of the wheels' ways, counts too.
MEMORY_SLACK = 320 * 2**20
"""What a server may hold more after all requests than after the first fifth, bytes."""

SERVER = """
import json, sys
import configspace
from services import Registry, Server
from services.operating.launch import warm_up
from services.operating.logs import configure

folder, fleet, max_bytes = json.loads(sys.argv[1])
configure("warning", "json")
grid = configspace.Grid(40, 72)
spaces = [
    configspace.build_space(configspace.load_vehicle(n), grid, cache=False)
    for n in fleet
]
warm_up(spaces)
limits = {"max_samples": 500, "max_batch_samples": 2000, "max_bytes": max_bytes}
with Registry.open(spaces, folder, grid=grid, max_vehicles=60) as registry:
    with Server(
        registry=registry, listen="tcp/127.0.0.1:0", max_time=30.0, **limits
    ) as server:
        print(server.endpoint, flush=True)
        server.wait()
"""


class Live:
    """A server in a process of its own, and a session that asks anything."""

    def __init__(self, folder: Path) -> None:
        self.store = folder / "store"
        self._log_path = folder / "log"
        with self._log_path.open("wb") as log:
            given = json.dumps([str(self.store), FIXED, MAX_BYTES])
            self._process = subprocess.Popen(
                [sys.executable, "-c", SERVER, given],
                stdout=subprocess.PIPE,
                stderr=log,
                text=True,
            )
        assert self._process.stdout is not None
        self.endpoint = self._process.stdout.readline().strip()
        assert self.endpoint, self.log()
        self.peer = Peer.connected(Endpoint.parse("e", self.endpoint), 10.0, 0.0)

    def log(self) -> list[str]:
        return self._log_path.read_text("utf-8").splitlines()

    def health(self) -> Health:
        (reply,) = self.peer.ask(f"{ROOT}/health", None, JSON, 60.0)
        return decode(Health, reply.payload)

    @property
    def is_alive(self) -> bool:
        return self._process.poll() is None

    def throw(self, rng: Rng) -> None:
        """Send what is no zenoh at all."""
        address, _, port = self.endpoint.removeprefix("tcp/").rpartition(":")
        with socket.create_connection((address, int(port)), 10.0) as link:
            link.sendall(rng.bytes(int(rng.integers(1, 400))))

    def answer(self, question: Question) -> list[Reply]:
        """Ask, and return all replies in their order."""
        key, payload = question.key, question.payload
        if payload is None:
            return self.peer.ask(key, None, JSON, 60.0, everyone=True)
        stream = self.peer.stream(key, payload, question.encoding, 60.0, stop=Stop())
        return list(iter(lambda: stream.receive(70.0), None))

    def kill(self) -> None:
        self._process.kill()
        self._process.wait()
        assert self._process.stdout is not None
        self._process.stdout.close()

    def close(self) -> None:
        try:
            self.peer.close()
        finally:
            self.kill()


@pytest.fixture
def live(tmp_path: Path) -> Iterator[Live]:
    with contextlib.closing(Live(tmp_path)) as live:
        yield live


@dataclass
class Run:
    """Sends questions, many at a time, and keeps what is wrong."""

    live: Live
    judge: Judge
    codes: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)

    def send(self, question: Question) -> None:
        try:
            code = self._sent(question)
        except Exception as error:
            self.wrong.append(f"{type(error).__name__}: {error} on {question}")
            code = "WRONG"
        self.codes[code] += 1

    def _sent(self, question: Question) -> str:
        try:
            if question.kind == "put":
                assert question.payload is not None
                encoding = question.encoding
                self.live.peer.publish(question.key, question.payload, encoding)
                return "published"
            if question.kind == "erase":
                self.live.peer.erase(question.key)
                return "published"
            replies = self.live.answer(question)
        except ServiceError as error:
            # zenoh itself refuses what is no key.
            if "Invalid Key Expr" not in str(error):
                raise
            return "no key"
        return self.judge.check(question, replies)


def state_of(live: Live) -> dict[str, bytes]:
    """Return vehicle files and data sheets of the vehicles of the start."""
    keys = [f"{kind}/{name}" for kind in ("vehicles", "spaces") for name in FIXED]
    found = {}
    for key in keys:
        (reply,) = live.peer.ask(f"{ROOT}/{key}", None, JSON, 60.0)
        assert not reply.is_error
        found[key] = reply.payload
    return found


def check_known(live: Live, judge: Judge, sent: list[Question]) -> None:
    """Compare what is registered with what was answered and sent."""
    newest: dict[str, RegisterReply] = {}
    for change in judge.changes:
        old = newest.get(change.id)
        if old is None or Version.parse(old.version) < Version.parse(change.version):
            newest[change.id] = change
    with Client(live.endpoint, timeout=60.0) as client:
        known = client.vehicles()
        assert known[: len(FIXED)] == tuple(FIXED)
        registered = set(known[len(FIXED) :])
        asked = {name for name in registered if not name.startswith("put-")}
        assert asked == {c.id for c in newest.values() if c.kind == "put"}
        for name in asked:
            assert client.space(name).header.fingerprint == newest[name].fingerprint
        for name in registered - asked:
            assert client.vehicle(name) in put_vehicles(sent, name)
    live.kill()
    # What a server says that it knows is on the disk.
    with Registry.open([], live.store, grid=GRID) as registry:
        assert set(registry.fleet) == registered
        for name, change in newest.items():
            assert str(registry.snapshot.records[name].version) == change.version


def put_vehicles(sent: list[Question], name: str) -> list[configspace.Vehicle]:
    """Return the sound vehicle files that were published for a name."""
    vehicles = []
    for question in sent:
        if question.kind == "put" and question.payload is not None:
            with contextlib.suppress(ValueError):
                vehicle = configspace.parse_vehicle(question.payload.decode())
                if vehicle.name == name:
                    vehicles.append(vehicle)
    return vehicles


def run(live: Live, fleet: Fleet, trajectories: Trajectories, n: int) -> Counter[str]:
    rng = np.random.default_rng(20261122)
    source = Source(rng, trajectories)
    running = Run(live, Judge({space.name: space for space in fleet}))
    before = state_of(live)
    sent: list[Question] = []
    memory = 0
    with ThreadPoolExecutor(IN_FLIGHT) as pool:
        for part in range(5):
            questions = [source.next() for _ in range(n // 5)]
            for _ in pool.map(running.send, questions):
                pass
            live.throw(rng)
            assert live.is_alive, live.log()[-20:]
            assert not running.wrong, "\n".join(running.wrong[:5])
            memory = memory if part else live.health().memory or 0
            sent += [q for q in questions if q.kind != "ask"]
    health = live.health()
    assert health.memory is not None
    assert health.memory < memory + MEMORY_SLACK
    assert not any("internal" in key.codes for key in health.keys.values())
    assert health.queue_bytes == 0
    assert state_of(live) == before
    lines = [json.loads(line) for line in live.log()]
    assert not [x for x in lines if "exception" in x]
    # What other servers say and cannot be used is told as an error; nothing else is.
    errors = {x["logger"] for x in lines if x["level"] == "error"}
    assert errors <= {"services.registering.registry", "services.registering.sync"}
    check_known(live, running.judge, sent)
    return running.codes


def check_codes(codes: Counter[str]) -> None:
    """The mutations reach far: many kinds of refusals, and answers."""
    assert codes["ok"] > 0.03 * codes.total()
    needed = {"invalid_message", "invalid_trajectory", "invalid_vehicle", "too_large"}
    needed |= {"unknown_key", "unknown_vehicle", "wrong_encoding", "read_only"}
    assert needed <= set(codes)


@pytest.mark.timeout(300)
def test_a_thousand_mutated_requests(
    live: Live, fleet: Fleet, trajectories: Trajectories
) -> None:
    check_codes(run(live, fleet, trajectories, 1000))


@pytest.mark.slow
@pytest.mark.timeout(3000)
def test_a_hundred_thousand_mutated_requests(
    live: Live, fleet: Fleet, trajectories: Trajectories
) -> None:
    check_codes(run(live, fleet, trajectories, 100_000))
