"""Start, load, stop: what clients meet when a server is busy, gone or not there yet."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from loopback import ANY_PORT, Fleet, Trajectories

import omniplan
from services import (
    Client,
    InvalidEndpoint,
    RemoteError,
    Server,
    ServiceError,
    ServiceTimeout,
    ServiceUnreachable,
)

pytestmark = pytest.mark.service


@pytest.fixture
def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        return int(probe.getsockname()[1])


@pytest.fixture
def narrow(fleet: Fleet) -> Iterator[Server]:
    """One worker, one place to wait."""
    with Server(fleet, listen=ANY_PORT, workers=1, queue_size=1) as server:
        yield server


def test_a_full_queue_answers_busy_at_once(
    narrow: Server,
    gate: Any,
    submitted: threading.Semaphore,
    in_background: ThreadPoolExecutor,
    trajectories: Trajectories,
) -> None:
    with Client(narrow.endpoint, timeout=30.0, retry=False) as client:
        running = in_background.submit(
            client.validate, trajectories[:1], "differential"
        )
        gate.wait_until_entered()
        assert submitted.acquire(timeout=30)
        waiting = in_background.submit(client.vehicle, "differential")
        assert submitted.acquire(timeout=30)
        assert narrow.health().queue_length == 1
        with pytest.raises(RemoteError) as caught:
            client.vehicle("differential")
        assert caught.value.code == "busy"
        # What takes no work is answered all the same.
        assert client.health().queue_length == 1
        assert len(client.vehicles()) == 2
        gate.opened.set()
        assert len(running.result()) == 1
        assert waiting.result().name == "differential"
        assert client.health().errors == 1


def test_other_workers_answer_while_one_is_held(
    server: Server,
    client: Client,
    gate: Any,
    in_background: ThreadPoolExecutor,
    trajectories: Trajectories,
) -> None:
    running = in_background.submit(client.validate, trajectories[:1], "differential")
    gate.wait_until_entered()
    assert len(client.vehicles()) == 2
    gate.opened.set()
    assert len(running.result()) == 1


def test_closing_finishes_what_runs_and_refuses_what_waits(
    fleet: Fleet,
    narrow: Server,
    gate: Any,
    submitted: threading.Semaphore,
    in_background: ThreadPoolExecutor,
    trajectories: Trajectories,
) -> None:
    with Client(narrow.endpoint, timeout=30.0, retry=False) as client:
        running = in_background.submit(
            client.validate, trajectories[:1], "differential"
        )
        gate.wait_until_entered()
        assert submitted.acquire(timeout=30)
        waiting = in_background.submit(client.vehicle, "differential")
        assert submitted.acquire(timeout=30)
        closing = in_background.submit(narrow.close)
        with pytest.raises(RemoteError) as caught:
            waiting.result(30)
        assert caught.value.code == "closing"
        assert not closing.done()
        gate.opened.set()
        closing.result(30)
        expected = (omniplan.validate(trajectories[0], fleet[1]),)
        assert running.result(30) == expected
        with pytest.raises(ServiceUnreachable):
            client.health()


def test_many_clients_at_once_all_get_their_own_answer(
    server: Server, in_background: ThreadPoolExecutor, trajectories: Trajectories
) -> None:
    def ask(index: int) -> bool:
        trajectory = trajectories[index % len(trajectories)]
        with Client(server.endpoint, timeout=30.0) as client:
            (report,) = client.validate([trajectory], "differential")
        return report.trajectory == trajectory.name

    assert all(in_background.map(ask, range(24)))


def test_without_a_server_a_question_fails_quickly(free_port: int) -> None:
    began = time.monotonic()
    with (
        Client(f"tcp/127.0.0.1:{free_port}") as client,
        pytest.raises(ServiceUnreachable, match="nobody listens there"),
    ):
        client.health()
    assert time.monotonic() - began < 5


def test_a_listener_that_says_nothing_is_unreachable_in_time() -> None:
    with socket.create_server(("127.0.0.1", 0)) as mute:
        endpoint = f"tcp/127.0.0.1:{mute.getsockname()[1]}"
        began = time.monotonic()
        with (
            Client(endpoint, timeout=0.2) as client,
            pytest.raises(ServiceUnreachable, match=r"within 0\.2 s"),
        ):
            client.health()
        assert time.monotonic() - began < 5


def test_another_site_is_unreachable_quickly(server: Server) -> None:
    began = time.monotonic()
    with (
        Client(server.endpoint, site="elsewhere") as client,
        pytest.raises(ServiceUnreachable, match="omniplan/v1/elsewhere/health"),
    ):
        client.health()
    assert time.monotonic() - began < 5


def test_a_server_that_is_too_slow_is_a_timeout(
    server: Server, gate: Any, trajectories: Trajectories
) -> None:
    with Client(server.endpoint, timeout=0.2) as client:
        with pytest.raises(
            ServiceTimeout, match=r"validate: no answer within 0\.\d+ s"
        ):
            client.validate(trajectories[:1], "differential")
        # The server is there all the same.
        assert len(client.vehicles()) == 2
    gate.opened.set()


def test_a_caller_who_has_gone_does_no_harm(
    server: Server,
    client: Client,
    gate: Any,
    trajectories: Trajectories,
) -> None:
    with (
        Client(server.endpoint, timeout=0.1) as hasty,
        pytest.raises(ServiceTimeout),
    ):
        hasty.validate(trajectories[:1], "differential")
    gate.opened.set()
    assert len(client.validate(trajectories[:1], "differential")) == 1


def test_ready_waits_for_a_server_that_starts_later(
    fleet: Fleet, free_port: int, in_background: ThreadPoolExecutor
) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port}"
    with Client(endpoint) as client:
        ready = in_background.submit(client.wait_until_ready, 30.0)
        with Server(fleet, listen=endpoint):
            ready.result(30)
            assert len(client.vehicles()) == 2


def test_ready_gives_up_in_time(free_port: int, server: Server) -> None:
    with (
        Client(f"tcp/127.0.0.1:{free_port}") as client,
        pytest.raises(ServiceUnreachable, match=r"within 0\.1 s"),
    ):
        client.wait_until_ready(0.1)
    with (
        Client(server.endpoint, site="elsewhere") as client,
        pytest.raises(ServiceUnreachable, match="site 'elsewhere'"),
    ):
        client.wait_until_ready(0.1)


def test_a_client_finds_a_restarted_server_again(fleet: Fleet, free_port: int) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port}"
    with Client(endpoint) as client:
        with Server(fleet, listen=endpoint):
            first = client.health().instance
        with pytest.raises(ServiceUnreachable):
            client.health()
        with Server(fleet, listen=endpoint):
            client.wait_until_ready(30.0)
            assert client.health().instance != first


def test_a_port_in_use_is_named(server: Server, fleet: Fleet) -> None:
    with pytest.raises(ServiceError, match=f"{server.endpoint}: the port is in use"):
        Server(fleet, listen=server.endpoint).start()


@pytest.mark.parametrize(
    "endpoint",
    [
        "tcp/127.0.0.1:65536",
        "tcp/127.0.0.1:-1",
        "tcp/127.0.0.1:",
        "tcp/127.0.0.1:7447#iface=lo",
        "udp/127.0.0.1:7447",
        "127.0.0.1:7447",
        "",
    ],
)
def test_an_address_that_is_none_is_refused(endpoint: str) -> None:
    for open_it in (lambda: Server([], listen=endpoint), lambda: Client(endpoint)):
        with pytest.raises(InvalidEndpoint, match="tcp/HOST:PORT"):
            open_it()


def test_an_address_of_another_machine_cannot_be_listened_at(fleet: Fleet) -> None:
    for port in (0, 7447):
        with pytest.raises(ServiceError, match="cannot listen at"):
            Server(fleet, listen=f"tcp/192.0.2.1:{port}", allow_insecure=True).start()


def test_a_server_starts_once_and_closes_any_number_of_times(fleet: Fleet) -> None:
    server = Server(fleet, listen=ANY_PORT)
    assert not server.wait(0)
    server.start()
    with pytest.raises(ServiceError, match="started before"):
        server.start()
    server.close()
    server.close()
    assert server.wait(0)
    with pytest.raises(ServiceError, match="started before"):
        server.start()


def test_closing_leaves_no_thread_behind(fleet: Fleet) -> None:
    with Server(fleet, listen=ANY_PORT) as server, Client(server.endpoint) as client:
        client.vehicles()
    names = {thread.name for thread in threading.enumerate()}
    assert not {name for name in names if name.startswith("omniplan-worker")}


def test_a_closed_client_asks_no_more(server: Server) -> None:
    client = Client(server.endpoint)
    client.vehicles()
    client.close()
    client.close()
    with pytest.raises(ServiceError, match="closed"):
        client.vehicles()


def test_an_answer_that_is_none_of_ours_is_an_error(
    server: Server,
    client: Client,
    monkeypatch: pytest.MonkeyPatch,
    trajectories: Trajectories,
) -> None:
    from services.answering.handlers import Answer

    for payload in (b"", b"\xff", b"{}", b'{"reports": [{}]}', b'{"reports": []}'):
        answer = Answer(payload)
        monkeypatch.setattr(
            "services.answering.handlers.Handlers.answer",
            lambda *_, answer=answer: answer,
        )
        for question in (
            lambda: client.validate(trajectories, "differential"),
            lambda: client.select(trajectories),
            client.vehicles,
            client.health,
            lambda: client.vehicle("differential"),
            lambda: client.space("differential"),
        ):
            with pytest.raises(ServiceError, match="cannot be read"):
                question()
