"""Servers and clients on loopback; nothing here sleeps."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from loopback import ANY_PORT, Ask, Fleet, Trajectories

import configspace
import omniplan
from services import Client, Server
from services.answering.workers import WorkerPool
from services.protocol.endpoint import Endpoint
from services.wire.exchange import Reply
from services.wire.session import Peer


@pytest.fixture(scope="session")
def fleet() -> tuple[configspace.PermissibleSpace, ...]:
    grid = configspace.Grid(40, 72)
    return tuple(
        configspace.build_space(configspace.load_vehicle(name), grid, cache=False)
        for name in ("ift-four-steered", "differential")
    )


@pytest.fixture(scope="session")
def trajectories() -> tuple[omniplan.Trajectory, ...]:
    t = [0.0, 1.0, 2.0, 3.0]
    straight = [[0.2 * x, 0.0, 0.0] for x in t]
    sideways = [[0.0, 0.2 * x, 0.0] for x in t]
    fast = [[5.0 * x, 0.0, 0.0] for x in t]
    return tuple(
        omniplan.Trajectory.from_poses(t, poses, name=name)
        for name, poses in (
            ("straight", straight),
            ("sideways", sideways),
            ("fast", fast),
        )
    )


@pytest.fixture
def server(fleet: Fleet) -> Iterator[Server]:
    with Server(fleet, listen=ANY_PORT) as server:
        yield server


@pytest.fixture
def client(server: Server) -> Iterator[Client]:
    with Client(server.endpoint, timeout=30.0) as client:
        yield client


@pytest.fixture
def ask(server: Server) -> Iterator[Ask]:
    """Ask with any bytes, as a program in another language might."""
    peer = Peer.connected(Endpoint.parse("endpoint", server.endpoint), 5.0, 0.0)

    def ask(
        key: str, payload: bytes | None = None, encoding: str = "application/json"
    ) -> list[Reply]:
        return peer.ask(f"omniplan/v1/default/{key}", payload, encoding, 30.0)

    yield ask
    peer.close()


@pytest.fixture
def validate_message(trajectories: Trajectories) -> bytes:
    """A request that is answered without error."""
    data = {
        "vehicle": "ift-four-steered",
        "trajectories": [trajectories[0].to_dict()],
    }
    return json.dumps(data).encode()


class Gate:
    """Holds `validate` in the worker until it is opened."""

    def __init__(self) -> None:
        self.entered = threading.Semaphore(0)
        self.opened = threading.Event()

    def wait_until_entered(self) -> None:
        assert self.entered.acquire(timeout=30)


@pytest.fixture
def gate(monkeypatch: pytest.MonkeyPatch) -> Iterator[Gate]:
    gate = Gate()

    def held(
        trajectory: omniplan.Trajectory,
        space: configspace.PermissibleSpace,
        *,
        allow_unreachable: bool = False,
        checkpoint: Callable[[], None],
    ) -> omniplan.Report:
        gate.entered.release()
        assert gate.opened.wait(30)
        return omniplan.validate(
            trajectory,
            space,
            allow_unreachable=allow_unreachable,
            checkpoint=checkpoint,
        )

    monkeypatch.setattr("services.answering.handlers.validate", held)
    yield gate
    gate.opened.set()


@pytest.fixture
def submitted(monkeypatch: pytest.MonkeyPatch) -> threading.Semaphore:
    """Released once for each request that has found its place in the queue, or none."""
    semaphore = threading.Semaphore(0)
    submit = WorkerPool.submit

    def counted(pool: WorkerPool[object], job: object, **options: Any) -> bool:
        try:
            return submit(pool, job, **options)
        finally:
            semaphore.release()

    monkeypatch.setattr(WorkerPool, "submit", counted)
    return semaphore


@pytest.fixture
def in_background() -> Iterator[ThreadPoolExecutor]:
    with ThreadPoolExecutor(max_workers=8) as executor:
        yield executor
