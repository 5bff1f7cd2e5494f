"""Order, bounds, deadlines, stopping: what a server does with more than it can do.

Handlers are replaced by steps that wait for the test, so that the order of events is
known; nothing is measured.
"""

from __future__ import annotations

import json
import logging
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from loopback import ANY_PORT, Ask, Fleet

import omniplan
from services import Client, RemoteError, Server
from services.answering.calls import Call
from services.answering.handlers import Answer, Handlers, Parts
from services.protocol.endpoint import Endpoint
from services.protocol.keys import Route
from services.wire.exchange import Reply
from services.wire.session import Peer

pytestmark = pytest.mark.service

LARGE = b"x" * 600_000
"""By its size a large request."""


class Steps:
    """Answers `validate` in parts; each waits until it is let go, and is recorded."""

    def __init__(self) -> None:
        self.events: queue.Queue[str] = queue.Queue()
        self.go = threading.Semaphore(0)
        self.n_parts = 3

    def answer(self, payload: bytes, call: Call) -> Parts:
        name = "large" if len(payload) > 1000 else "small"
        self.events.put(f"{name} begins")
        for index in range(self.n_parts if name == "large" else 1):
            if index:
                yield Answer(f"{index}".encode())
            assert self.go.acquire(timeout=30)
            self.events.put(f"{name} {index}")
        return Answer(b"last")

    def next(self) -> str:
        return self.events.get(timeout=30)


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> Iterator[Steps]:
    steps = Steps()
    answer = Handlers.answer

    def replaced(
        handlers: Handlers,
        route: Route,
        payload: bytes = b"",
        encoding: str = "",
        call: Call | None = None,
    ) -> Answer | Parts:
        assert call is not None
        if route.verb == "validate":
            return steps.answer(payload, call)
        return answer(handlers, route, payload, encoding, call)

    monkeypatch.setattr(Handlers, "answer", replaced)
    yield steps
    steps.go.release(1000)


@contextmanager
def asking(server: Server) -> Iterator[Ask]:
    peer = Peer.connected(Endpoint.parse("endpoint", server.endpoint), 5.0, 0.0)

    def ask(
        key: str, payload: bytes | None = None, encoding: str = "application/json"
    ) -> list[Reply]:
        return peer.ask(f"omniplan/v1/default/{key}", payload, encoding, 30.0)

    yield ask
    peer.close()


@contextmanager
def serving(fleet: Fleet, **options: Any) -> Iterator[tuple[Server, Ask]]:
    with (
        Server(fleet, listen=ANY_PORT, **options) as server,
        asking(server) as ask,
    ):
        yield server, ask


def code(replies: list[Reply]) -> str:
    """Return the code of the last reply."""
    return str(json.loads(replies[-1].payload)["code"])


def wait_until(condition: Callable[[], bool]) -> None:
    until = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.001)


def test_small_requests_pass_a_large_one_between_its_parts(
    fleet: Fleet, steps: Steps, in_background: ThreadPoolExecutor
) -> None:
    with serving(fleet, workers=1) as (server, ask):
        large = in_background.submit(ask, "validate", LARGE)
        assert steps.next() == "large begins"
        small = in_background.submit(ask, "validate", b"{}")
        wait_until(lambda: server.health().queue_length == 1)
        steps.go.release(2)
        assert [steps.next() for _ in range(3)] == [
            "large 0",
            "small begins",
            "small 0",
        ]
        assert [r.payload for r in small.result(30)] == [b"last"]
        # The large one has not got further than its first part.
        assert not large.done()
        steps.go.release(2)
        assert [r.payload for r in large.result(30)][-1] == b"last"


def test_with_two_workers_a_large_part_delays_no_small_request(
    fleet: Fleet, steps: Steps, in_background: ThreadPoolExecutor
) -> None:
    with serving(fleet) as (_, ask):
        large = [in_background.submit(ask, "validate", LARGE) for _ in range(3)]
        assert steps.next() == "large begins"
        # None of the large ones can go on, and all small ones are answered.
        for _ in range(5):
            (reply,) = ask("vehicles")
            assert not reply.is_error
        assert not any(each.done() for each in large)
        steps.go.release(100)
        assert [each.result(30)[-1].payload for each in large] == [b"last"] * 3


def test_large_requests_that_hold_too_many_bytes_are_busy(
    fleet: Fleet, steps: Steps, in_background: ThreadPoolExecutor
) -> None:
    options = {"max_bytes": 700_000, "queue_bytes": 1_000_000}
    with serving(fleet, **options) as (server, ask):
        large = in_background.submit(ask, "validate", LARGE)
        assert steps.next() == "large begins"
        assert server.health().queue_bytes == len(LARGE)
        assert code(ask("validate", LARGE)) == "busy"
        assert not ask("vehicles")[0].is_error
        steps.go.release(3)
        assert large.result(30)[-1].payload == b"last"
        # The reply is there a little before the place is free.
        wait_until(lambda: server.health().queue_bytes == 0)


def test_a_request_that_waits_too_long_is_not_even_begun(
    fleet: Fleet, steps: Steps, in_background: ThreadPoolExecutor
) -> None:
    with serving(fleet, workers=1, max_time=0.05) as (server, ask):
        small = in_background.submit(ask, "validate", b"{}")
        assert steps.next() == "small begins"
        began = time.monotonic()
        late = in_background.submit(ask, "validate", b"{}")
        wait_until(lambda: server.health().queue_length == 1)
        wait_until(lambda: time.monotonic() > began + 0.1)
        steps.go.release(1)
        small.result(30)
        assert code(late.result(30)) == "deadline_exceeded"
        assert steps.next() == "small 0"
        assert steps.events.empty()


def endless(monkeypatch: pytest.MonkeyPatch) -> threading.Event:
    """Let `validate` go on for ever, and return what its first part sets."""
    begun = threading.Event()

    def steps(handlers: Handlers, payload: bytes, call: Call) -> Parts:
        call.named("mine")
        while True:
            begun.set()
            yield None

    monkeypatch.setattr(Handlers, "validate", steps)
    return begun


def test_a_request_is_given_up_when_its_time_is_over(
    fleet: Fleet, monkeypatch: pytest.MonkeyPatch
) -> None:
    endless(monkeypatch)
    with serving(fleet, max_time=0.1) as (server, ask):
        assert code(ask("validate", b"{}")) == "deadline_exceeded"
        assert not ask("vehicles")[0].is_error
        wait_until(lambda: "validate" in server.health().keys)
        keys = server.health().keys
        assert keys["validate"].codes == {"deadline_exceeded": 1}
        assert keys["validate"].p99 >= 0.1


def test_a_request_can_be_cancelled_while_it_is_worked_at(
    fleet: Fleet,
    monkeypatch: pytest.MonkeyPatch,
    in_background: ThreadPoolExecutor,
) -> None:
    begun = endless(monkeypatch)
    with serving(fleet, workers=1) as (server, ask):
        running = in_background.submit(ask, "validate", b"{}")
        assert begun.wait(30)
        (reply,) = ask("cancel/mine")
        assert json.loads(reply.payload) == {"cancelled": True}
        assert code(running.result(30)) == "cancelled"
        wait_until(lambda: "validate" in server.health().keys)
        (reply,) = ask("cancel/mine")
        assert json.loads(reply.payload) == {"cancelled": False}


def test_a_stop_ends_what_does_not_finish_in_time(
    fleet: Fleet,
    monkeypatch: pytest.MonkeyPatch,
    in_background: ThreadPoolExecutor,
) -> None:
    begun = endless(monkeypatch)
    with serving(fleet) as (server, ask):
        running = in_background.submit(ask, "validate", b"{}")
        assert begun.wait(30)
        assert not server.close(within=0.0)
        assert code(running.result(30)) == "closing"
        assert not server.close()


def test_health_counts_answers_by_key_and_code(server: Server, ask: Ask) -> None:
    for key in ("vehicles", "vehicles", "vehicles/nobody", "nothing", "*/health"):
        ask(key)
    wait_until(lambda: len(server.health().keys) == 4)
    health = server.health()
    assert {kind: figures.codes for kind, figures in health.keys.items()} == {
        "vehicles": {"ok": 2},
        "vehicle": {"unknown_vehicle": 1},
        "unknown": {"unknown_key": 1},
        "wildcard": {"ok": 1},
    }
    for figures in health.keys.values():
        assert 0 < figures.p50 <= figures.p90 <= figures.p99
    assert health.requests == 5
    assert health.errors == 2


def test_every_request_is_one_line_of_the_log_without_its_contents(
    server: Server, ask: Ask, validate_message: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.INFO, logger="services.requests"):
        ask("validate", validate_message)
        ask("validate", b'{"secret": 1}')
        wait_until(lambda: len(fields(caplog)) == 2)
    good, bad = sorted(fields(caplog), key=lambda f: f["bytes"], reverse=True)
    assert good["key"] == bad["key"] == "omniplan/v1/default/validate"
    assert good["bytes"] == len(validate_message)
    assert good["samples"] == 4
    assert good["code"] == "ok"
    assert bad["code"] == "invalid_message"
    assert good["id"] != bad["id"]
    assert good["ms"] > 0
    assert "secret" not in caplog.text


def fields(caplog: pytest.LogCaptureFixture) -> list[dict[str, Any]]:
    found = (r for r in caplog.records if r.name == "services.requests")
    return [r.__dict__["fields"] for r in found]


@contextmanager
def process(
    log: Path, **environment: str
) -> Iterator[tuple[subprocess.Popen[str], Client]]:
    """Run `omniplan serve`, and a client of it that asks once; log into a file.

    A pipe that nobody reads would be full some time, and the server wait for it.
    """
    command = [sys.executable, "-m", "omniplan.cli", "serve", "--json"]
    command += ["--fleet", "differential", "--listen", ANY_PORT]
    with (
        log.open("w") as stderr,
        subprocess.Popen(
            command,
            env={**os.environ, **environment},
            stdout=subprocess.PIPE,
            stderr=stderr,
            text=True,
        ) as server,
    ):
        try:
            assert server.stdout is not None
            text = ""
            while line := server.stdout.readline():
                text += line
                if line == "}\n":
                    break
            started = json.loads(text)
            assert started["vehicles"] == ["differential"]
            with Client(started["endpoint"], timeout=60.0, retry=False) as client:
                client.wait_until_ready(30.0)
                yield server, client
        finally:
            server.kill()


def many(n: int) -> list[omniplan.Trajectory]:
    """Return work of some ms for each."""
    t = np.linspace(0.0, 2.0, 20)
    poses = np.column_stack([0.1 * t, 0.0 * t, 0.0 * t])
    return [omniplan.Trajectory.from_poses(t, poses, name=f"{i}") for i in range(n)]


def running(client: Client, work: Future[Any]) -> bool:
    """Return whether the server works at something beside this question."""
    assert not work.done()
    health = client.health()
    return health.running + health.queue_length > 0


@pytest.mark.parametrize(
    "number",
    [signal.SIGTERM, pytest.param(signal.SIGINT, marks=pytest.mark.slow)],
)
def test_a_signal_lets_a_running_request_finish(
    number: signal.Signals, in_background: ThreadPoolExecutor, tmp_path: Path
) -> None:
    log = tmp_path / "log"
    with process(log, OMNIPLAN_STOP_WITHIN="100") as (server, client):
        work = in_background.submit(client.validate, many(100), "differential")
        wait_until(lambda: running(client, work))
        server.send_signal(number)
        assert len(work.result(100)) == 100
        assert server.wait(30) == 0
    text = log.read_text()
    assert "omniplan/v1/default closed" in text
    assert "code=ok" in text


def test_a_signal_ends_a_request_that_takes_too_long(
    in_background: ThreadPoolExecutor, tmp_path: Path
) -> None:
    log = tmp_path / "log"
    environment = {"OMNIPLAN_STOP_WITHIN": "0", "OMNIPLAN_LOG_FORMAT": "json"}
    with process(log, **environment) as (server, client):
        work = in_background.submit(client.validate, many(1000), "differential")
        wait_until(lambda: running(client, work))
        server.terminate()
        with pytest.raises(RemoteError) as caught:
            work.result(100)
        assert caught.value.code == "closing"
        assert server.wait(30) == 3
    lines = map(json.loads, filter(None, log.read_text().splitlines()))
    assert [x["code"] for x in lines if x.get("bytes", 0) > 1000] == ["closing"]


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_small_requests_come_through_while_a_large_batch_is_judged(
    in_background: ThreadPoolExecutor, tmp_path: Path
) -> None:
    """10⁷ samples; between a small question and its answer only few parts are done."""
    t = np.linspace(0.0, 20.0, 10_000)
    poses = np.column_stack([0.2 * t, 0.05 * np.sin(t), 0.1 * np.sin(t)])
    base = omniplan.Trajectory.from_poses(t, poses)
    batch = [replace(base, name=f"{i}") for i in range(1000)]
    parts = 0

    def count(done: int, total: int) -> None:
        nonlocal parts
        parts += 1

    passed: list[int] = []
    with process(tmp_path / "log") as (_, client):
        large = in_background.submit(
            client.validate_many, batch, ["differential"], progress=count
        )
        wait_until(lambda: parts > 0 or large.done())
        (short,) = many(1)
        while not large.done():
            before = parts
            (report,) = client.validate([short], "differential")
            assert report.valid
            passed.append(parts - before)
        assert large.result().num_rows == len(batch)
    assert parts >= 50
    assert len(passed) >= parts / 10
    # Hardly ever more parts than are on their way to the client already.
    assert sorted(passed)[int(0.99 * (len(passed) - 1))] <= 20
