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
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from loopback import Fleet, Trajectories
from mutations import Rng, choose, other_arrow, other_bytes, other_json

import configspace
import omniplan
from omniplan.batch import SCHEMA
from services import Client, Registry
from services.arrow import ARROW
from services.batch_messages import BatchPart
from services.endpoint import Endpoint
from services.errors import CODES, ServiceError
from services.messages import (
    JSON,
    ErrorReply,
    Health,
    SelectReply,
    ValidateReply,
    decode,
    encode,
)
from services.registry_messages import RegisterReply
from services.session import Peer, Reply, Stop
from services.versions import Version

pytestmark = pytest.mark.service

ROOT = "omniplan/v1/default"
GRID = configspace.Grid(40, 72)
FIXED = ["ift-four-steered", "differential"]
IN_FLIGHT = 12
MEMORY_SLACK = 96 * 2**20
"""What a server may hold more after all requests than after the first fifth, bytes."""

SERVER = """
import json, sys
import configspace
from services import Registry, Server
from services.launch import warm_up
from services.logs import configure

folder, fleet = json.loads(sys.argv[1])
configure("warning", "json")
grid = configspace.Grid(40, 72)
spaces = [
    configspace.build_space(configspace.load_vehicle(n), grid, cache=False)
    for n in fleet
]
warm_up(spaces)
limits = {"max_bytes": 2**17, "max_samples": 500, "max_batch_samples": 2000}
with Registry.open(spaces, folder, grid=grid, max_vehicles=60) as registry:
    with Server(
        registry=registry, listen="tcp/127.0.0.1:0", max_time=30.0, **limits
    ) as server:
        print(server.endpoint, flush=True)
        server.wait()
"""


@dataclass(frozen=True)
class Question:
    """One request, or something that is published."""

    kind: str
    key: str
    payload: bytes | None = None
    encoding: str = JSON

    @property
    def verb(self) -> str:
        return self.key.removeprefix(f"{ROOT}/").partition("?")[0]

    @property
    def is_answered(self) -> bool:
        """Whether a server owes an answer: it is asked one concrete key of the site."""
        path = self.key.partition("?")[0]
        is_ours = path.startswith(f"{ROOT}/") and path.isascii()
        return self.kind == "ask" and is_ours and not set("*@$") & set(path)


class Live:
    """A server in a process of its own, and a session that asks anything."""

    def __init__(self, folder: Path) -> None:
        self.store = folder / "store"
        self._log_path = folder / "log"
        with self._log_path.open("wb") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-c", SERVER, json.dumps([str(self.store), FIXED])],
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
        self.peer.close()
        self.kill()


@pytest.fixture
def live(tmp_path: Path) -> Iterator[Live]:
    with contextlib.closing(Live(tmp_path)) as live:
        yield live


@dataclass
class Source:
    """Makes questions: few are sound, most are nearly so."""

    rng: Rng
    trajectories: Trajectories
    vehicle: dict[str, Any] = field(init=False)
    motions: list[dict[str, Any]] = field(init=False)
    table: pa.Table = field(init=False)
    twists: pa.Table = field(init=False)

    def __post_init__(self) -> None:
        cart = configspace.load_vehicle("mecanum")
        self.vehicle = json.loads(cart.model_dump_json(exclude_none=True))
        t = [0.0, 0.5, 1.5, 2.0]
        rows = [[0.3, 0.0, 0.1], [0.3, 0.0, 0.4], [0.2, 0.0, 0.0], [0.1, 0.0, 0.0]]
        curve = [[0.2, 0.1, 0.3], [0.2, 0.2, 0.3], [0.1, 0.2, 0.3], [0.1, 0.1, 0.3]]
        agv = configspace.load_vehicle(FIXED[0])
        more = (
            omniplan.Trajectory.from_twists(t, rows, name="twists"),
            omniplan.Trajectory.from_omni_curve(
                t, *np.transpose(curve), agv, name="curve"
            ),
        )
        known = [*self.trajectories, *more]
        self.motions = [json.loads(json.dumps(one.to_dict())) for one in known]
        names = pa.array([x.name for x in self.trajectories for _ in x.t])
        poses = np.concatenate([x.samples for x in self.trajectories]).T
        columns = {"t": np.concatenate([x.t for x in self.trajectories])}
        columns |= dict(zip(("x", "y", "theta"), poses, strict=True))
        owner = names.dictionary_encode()
        self.table = pa.table({"trajectory": owner, **columns})
        speeds = np.random.default_rng(5).normal(0.0, 0.5, (60, 3))
        self.twists = pa.table(dict(zip(("vx", "vy", "omega"), speeds.T, strict=True)))

    def next(self) -> Question:
        makers: list[tuple[float, Callable[[], Question]]] = [
            (0.24, self._validate),
            (0.12, self._select),
            (0.16, self._batch_validate),
            (0.14, self._batch_twists),
            (0.10, self._register),
            (0.03, self._unregister),
            (0.07, self._publication),
            (0.10, self._odd_key),
            (0.04, self._wrong_encoding),
        ]
        shares = [share for share, _ in makers]
        return makers[int(self.rng.choice(len(makers), p=shares))][1]()

    def _is_sound(self) -> bool:
        return bool(self.rng.random() < 0.05)

    def _json(self, verb: str, data: Any) -> Question:
        sound = self._is_sound()
        payload = json.dumps(data).encode() if sound else other_json(self.rng, data)
        return Question("ask", f"{ROOT}/{verb}", payload)

    def _some(self) -> list[dict[str, Any]]:
        n = int(self.rng.integers(1, 3))
        return [choose(self.rng, self.motions) for _ in range(n)]

    def _validate(self) -> Question:
        name = choose(self.rng, FIXED)
        return self._json("validate", {"vehicle": name, "trajectories": self._some()})

    def _select(self) -> Question:
        data: dict[str, Any] = {"trajectories": self._some(), "vehicles": FIXED}
        data["by"] = choose(self.rng, ["duration", "margin", "manoeuvrability"])
        if self.rng.random() < 0.3:
            data["requirements"] = ["crab 90 deg at 0.5 m/s", "speed 0.4 m/s both ways"]
        if self.rng.random() < 0.2:
            data |= {"request": "a", "deadline": 20.0, "allow_unreachable": True}
        return self._json("select", data)

    def _arrow(self, verb: str, table: pa.Table, data: Any) -> Question:
        payload = other_arrow(self.rng, table, data)
        return Question("ask", f"{ROOT}/batches/{verb}", payload, ARROW)

    def _batch_validate(self) -> Question:
        return self._arrow("validate", self.table, {"vehicles": FIXED})

    def _batch_twists(self) -> Question:
        return self._arrow("twists", self.twists, {"vehicle": choose(self.rng, FIXED)})

    def _cart(self, name: str) -> bytes:
        """Return a vehicle file, a sound one with one of few contents."""
        file = {**self.vehicle, "name": name}
        if self.rng.random() < 0.15:
            file["description"] = f"version {self.rng.integers(3)}"
            return json.dumps(file).encode()
        return other_json(self.rng, file)

    def _register(self) -> Question:
        name = choose(self.rng, ["asked-0", "asked-1", "asked-2", FIXED[1]])
        file = self._cart(name)
        data: dict[str, Any] = {"vehicle": file.decode(errors="replace")}
        if self.rng.random() < 0.5:
            with contextlib.suppress(ValueError, RecursionError):
                data["vehicle"] = json.loads(file)
        if self.rng.random() < 0.3:
            data["expected_version"] = "absent"
        payload = json.dumps(data).encode()
        if self.rng.random() < 0.3:
            payload = other_bytes(self.rng, payload)
        return Question("ask", f"{ROOT}/register/{name}", payload)

    def _unregister(self) -> Question:
        name = choose(self.rng, ["asked-0", "asked-1", "never", FIXED[0]])
        data = {"expected_version": choose(self.rng, [None, "absent", "7-0", "x"])}
        return self._json(f"unregister/{name}", data)

    def _publication(self) -> Question:
        name = choose(self.rng, ["put-0", "put-1", FIXED[0], "*", "**"])
        if self.rng.random() < 0.15:
            return Question("erase", f"{ROOT}/vehicles/{name}")
        if self.rng.random() < 0.6:
            file = self._cart(name)
            return Question("put", f"{ROOT}/vehicles/{name}", file, self._encoding())
        record = {"id": name, "version": "1-00000000000000aa", "vehicle": "{}"}
        keys = ["@sync/rogue/changed", "events/vehicles/put-0", "servers/rogue"]
        keys += ["validate", "vehicles", "health", "**", "@sync/*/changed", "x/y"]
        payload = other_json(self.rng, {"records": [record]})
        return Question("put", f"{ROOT}/{choose(self.rng, keys)}", payload)

    def _odd_key(self) -> Question:
        rng = self.rng
        keys = ["vehicles", "health", "spaces/*", "vehicles/*", "**", "*", "*/*"]
        keys += ["vehicles/..", "spaces/../../etc/passwd", "spaces/%2e%2e", "batches/*"]
        keys += ["@sync/*/digest", "@sync/*/records", "@sync/**", "cancel/*", "x" * 300]
        keys += ["cancel/a", "register/*", "unregister/*", "unregister/asked-*/x"]
        keys += ["health?a=1;b=2", "vehicles/differential?_anyke", "spaces/none", "é"]
        keys += ["vehicles/dif$*", "validate/x", "events/**", "a/b/c/d/e", "servers/*"]
        key = str(choose(rng, keys))
        if rng.random() < 0.3:
            key = other_bytes(rng, key.encode()).decode(errors="replace")
        root = choose(rng, [ROOT] * 8 + ["omniplan/v1/*", "omniplan/*/default", "**"])
        payload = None
        if rng.random() < 0.4:
            payload = other_json(rng, {"names": FIXED, "state": "x", "versions": {}})
        return Question("ask", f"{root}/{key}", payload)

    def _encoding(self) -> str:
        # Above 255 bytes zenoh panics where they are sent, not where they arrive.
        known = [JSON, ARROW, "zenoh/bytes", "text/plain", f"{JSON};x", "", "x" * 250]
        return str(choose(self.rng, [*known, "application/json ", "é\u0001", "a;b;c"]))

    def _wrong_encoding(self) -> Question:
        asked = self._validate() if self.rng.random() < 0.5 else self._batch_twists()
        payload = asked.payload
        if self.rng.random() < 0.05:
            payload = b" " * (2**17 + 1)
        return Question("ask", asked.key, payload, self._encoding())


def equal_nans(data: Any) -> str:
    return json.dumps(data, sort_keys=True)


def read_motions(items: list[Any]) -> list[omniplan.Trajectory]:
    return [omniplan.Trajectory.from_dict(item) for item in items]


@dataclass
class Judge:
    """Knows what is right, from the request alone and without the service's readers."""

    spaces: dict[str, configspace.PermissibleSpace]
    changes: list[RegisterReply] = field(default_factory=list)

    def check(self, question: Question, replies: list[Reply]) -> str:
        """Return the code of an answer; AssertionError for a wrong one."""
        for reply in replies:
            if reply.is_error:
                error = decode(ErrorReply, reply.payload)
                assert error.code in CODES
                assert error.code != "internal"
                assert 0 < len(error.message) <= 4000
        if not question.is_answered:
            return "any"
        assert replies, "no answer"
        if replies[-1].is_error:
            return decode(ErrorReply, replies[-1].payload).code
        assert question.verb.startswith("batches/") or len(replies) == 1
        check = {
            "validate": self._check_validate,
            "select": self._check_select,
            "batches/validate": self._check_batch,
            "batches/twists": self._check_twists,
        }.get(question.verb)
        if check is not None:
            assert question.payload is not None
            check(question.payload, replies)
        elif question.verb.startswith(("register/", "unregister/")):
            change = decode(RegisterReply, replies[0].payload)
            assert change.id == question.verb.partition("/")[2]
            self.changes.append(change)
        return "ok"

    def _check_validate(self, payload: bytes, replies: list[Reply]) -> None:
        asked = json.loads(payload)
        space = self.spaces[asked["vehicle"]]
        allow = asked.get("allow_unreachable", False)
        reports = [
            omniplan.validate(motion, space, allow_unreachable=allow)
            for motion in read_motions(asked["trajectories"])
        ]
        assert replies[0].payload == encode(ValidateReply.of(reports))

    def _check_select(self, payload: bytes, replies: list[Reply]) -> None:
        asked = json.loads(payload)
        names = asked.get("vehicles")
        fleet = [self.spaces[n] for n in (self.spaces if names is None else names)]
        rankings = [
            omniplan.select(
                [motion],
                fleet,
                by=asked.get("by", "duration"),
                requirements=asked.get("requirements", ()),
                allow_unreachable=asked.get("allow_unreachable", False),
            )[0]
            for motion in read_motions(asked["trajectories"])
        ]
        expected = [ranking.to_dict() for ranking in rankings]
        given = [r.to_dict() for r in decode(SelectReply, replies[0].payload).values()]
        if names is None:
            # All that the server knew in that moment: also what was registered.
            given = [self._only_fixed(ranking) for ranking in given]
        assert equal_nans(given) == equal_nans(expected)

    def _only_fixed(self, ranking: dict[str, Any]) -> dict[str, Any]:
        lists = {
            name: [x for x in ranking[name] if x["vehicle"] in self.spaces]
            for name in ("suitable", "refused", "unfit")
        }
        return {**ranking, **lists}

    def _rows(self, replies: list[Reply]) -> pa.Table:
        """Return the rows of all parts, whose numbers must be in order."""
        done = 0
        tables = []
        for index, reply in enumerate(replies):
            table = pa.ipc.open_stream(reply.payload).read_all()
            part = decode(BatchPart, table.schema.metadata[b"omniplan"])
            assert (part.sequence, part.first) == (index, done)
            done += table.num_rows
            assert part.done == done
            assert part.is_last == (reply is replies[-1]) == (done == part.total)
            tables.append(table.replace_schema_metadata(None))
        return pa.concat_tables(tables)

    def _read(self, payload: bytes) -> tuple[dict[str, Any], dict[str, Any]]:
        with pa.ipc.open_stream(payload) as reader:
            table = reader.read_all()
        table.validate(full=True)
        asked = json.loads(table.schema.metadata[b"omniplan"])
        return asked, {name: table[name].to_numpy() for name in table.column_names}

    def _check_batch(self, payload: bytes, replies: list[Reply]) -> None:
        asked, columns = self._read(payload)
        t = columns["t"].astype(float)
        names = columns.get("trajectory", np.full(t.size, "trajectory", dtype=object))
        point = np.zeros((t.size, 2))
        if "reference_x" in columns:
            point = np.column_stack([columns["reference_x"], columns["reference_y"]])
        motions = []
        for name in dict.fromkeys(names):
            mine = names == name
            form = ("x", "y", "theta") if "x" in columns else ("vx", "vy", "omega")
            rows = np.column_stack([columns[c][mine].astype(float) for c in form])
            make = (
                omniplan.Trajectory.from_poses
                if "x" in columns
                else omniplan.Trajectory.from_twists
            )
            where = tuple(point[mine][0].tolist())
            motions.append(make(t[mine], rows, name=name, reference_point=where))
        chosen = asked.get("vehicles")
        fleet = [self.spaces[n] for n in (self.spaces if chosen is None else chosen)]
        allow = asked.get("allow_unreachable", False)
        expected = omniplan.validate_many(motions, fleet, allow_unreachable=allow)
        given = self._rows(replies).cast(SCHEMA).to_pylist()
        given = [row for row in given if row["vehicle"] in self.spaces]
        assert equal_nans(given) == equal_nans(expected.to_pylist())

    def _check_twists(self, payload: bytes, replies: list[Reply]) -> None:
        asked, columns = self._read(payload)
        twists = np.column_stack([columns[c] for c in ("vx", "vy", "omega")])
        expected = omniplan.check_twists(twists, self.spaces[asked["vehicle"]])
        given = self._rows(replies)["permitted"].to_numpy()
        assert np.array_equal(given, expected)


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
    assert not [line for line in live.log() if json.loads(line)["level"] == "error"]
    assert not [line for line in live.log() if "Traceback" in line]
    check_known(live, running.judge, sent)
    return running.codes


def check_codes(codes: Counter[str]) -> None:
    """The mutations reach far: many kinds of refusals, and answers."""
    assert codes["ok"] > 0.03 * codes.total()
    needed = {"invalid_message", "invalid_trajectory", "invalid_vehicle", "too_large"}
    needed |= {"unknown_key", "unknown_vehicle", "wrong_encoding", "read_only"}
    assert needed <= set(codes)


def test_two_thousand_mutated_requests(
    live: Live, fleet: Fleet, trajectories: Trajectories
) -> None:
    check_codes(run(live, fleet, trajectories, 2000))


@pytest.mark.slow
@pytest.mark.timeout(3000)
def test_a_hundred_thousand_mutated_requests(
    live: Live, fleet: Fleet, trajectories: Trajectories
) -> None:
    check_codes(run(live, fleet, trajectories, 100_000))
