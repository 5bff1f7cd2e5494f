"""What a client does by itself: asks again, asks others, keeps what it was told."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from loopback import ANY_PORT, Fleet, Trajectories

import configspace
import omniplan
from services import Client, RemoteError, Server, ServiceUnreachable
from services.protocol.endpoint import Endpoint
from services.protocol.messages import SelectRequest

pytestmark = pytest.mark.service


@pytest.fixture
def pair(fleet: Fleet) -> Iterator[tuple[Server, Server]]:
    with (
        Server(fleet, listen=ANY_PORT) as one,
        Server(fleet, listen=ANY_PORT) as other,
    ):
        yield one, other


def test_busy_is_asked_again_until_there_is_room(
    fleet: Fleet,
    gate: Any,
    submitted: threading.Semaphore,
    in_background: ThreadPoolExecutor,
    trajectories: Trajectories,
) -> None:
    with (
        Server(fleet, listen=ANY_PORT, workers=1, queue_size=1) as server,
        Client(server.endpoint, timeout=30.0) as client,
    ):
        questions = [
            in_background.submit(client.validate, trajectories[:1], "differential")
            for _ in range(4)
        ]
        gate.wait_until_entered()
        while server.health().errors < 3:
            assert submitted.acquire(timeout=30)
        gate.opened.set()
        reports = {question.result(30) for question in questions}
        assert reports == {(omniplan.validate(trajectories[0], fleet[1]),)}


def test_any_of_several_servers_answers(
    pair: tuple[Server, Server], trajectories: Trajectories
) -> None:
    nobody = Endpoint.parse("", ANY_PORT).concrete()
    with Client([str(nobody), *(one.endpoint for one in pair)]) as client:
        first = client.health().instance
        used, spare = pair if pair[0].health().instance == first else pair[::-1]
        used.close()
        assert len(client.validate(trajectories, "differential")) == 3
        assert client.health().instance == spare.health().instance
        spare.close()
        with Server([], listen=str(nobody)):
            assert client.vehicles() == ()


def test_none_of_several_servers_is_told_with_the_reason_of_each() -> None:
    places = [str(Endpoint.parse("", ANY_PORT).concrete()) for _ in range(2)]
    with (
        Client(places, timeout=5.0) as client,
        pytest.raises(ServiceUnreachable) as caught,
    ):
        client.health()
    assert all(
        f"{place}: nobody listens there" in str(caught.value) for place in places
    )


def test_bad_places_and_times_are_named() -> None:
    for endpoint, where in (([], "endpoint"), ([ANY_PORT, "x"], r"endpoint\[1\]")):
        with pytest.raises(configspace.InvalidInput, match=where):
            Client(endpoint)
    with pytest.raises(configspace.InvalidInput, match="attempt_timeout"):
        Client(attempt_timeout=0.0)


def test_a_server_that_hangs_is_not_waited_for_where_another_answers(
    pair: tuple[Server, Server], gate: Any, trajectories: Trajectories
) -> None:
    endpoints = [one.endpoint for one in pair]
    with Client(endpoints, timeout=30.0, attempt_timeout=0.2) as client:
        asked = threading.Thread(target=gate.wait_until_entered)
        asked.start()
        opener = threading.Timer(1.0, gate.opened.set)
        opener.start()
        assert len(client.validate(trajectories[:1], "differential")) == 1
        asked.join(30)
        opener.join(30)


def test_the_deadline_of_a_question_is_told_to_the_server(
    server: Server, gate: Any, trajectories: Trajectories
) -> None:
    with Client(server.endpoint, timeout=0.3) as client:
        with pytest.raises(configspace.OmniplanError):
            client.validate(trajectories[:2], "differential")
        # It counts from the arrival, a little later than the client's own.
        gate.opened.wait(0.3)
        gate.opened.set()
    for _ in range(3000):
        codes = server.health().keys.get("validate")
        if codes is not None:
            assert codes.codes == {"deadline_exceeded": 1}
            return
        threading.Event().wait(0.01)
    pytest.fail("the request goes on")


def test_only_vehicles_online_are_compared_where_asked_for(
    client: Client, fleet: Fleet, trajectories: Trajectories
) -> None:
    with pytest.raises(RemoteError, match="no vehicle is online"):
        client.select(trajectories[:1], online_only=True)
    assert SelectRequest.of(trajectories, None, "margin", online_only=True).online_only


def test_a_data_sheet_is_asked_for_once(client: Client, server: Server) -> None:
    sheet = client.space("differential")
    before = server.health().requests
    assert client.space("differential") is sheet
    assert server.health().requests == before
    assert client.space("ift-four-steered") is not sheet


def test_a_local_check_with_the_data_sheet_needs_no_server(
    fleet: Fleet, trajectories: Trajectories
) -> None:
    with Server(fleet, listen=ANY_PORT) as server, Client(server.endpoint) as client:
        sheet = client.space("differential")
    expected = omniplan.validate(trajectories[0], configspace.parse_space(
        configspace.dump_space(fleet[1])))  # fmt: skip
    assert omniplan.validate(trajectories[0], sheet) == expected


def test_a_data_sheet_is_asked_for_anew_after_its_vehicle_has_changed(
    client: Client, server: Server
) -> None:
    old = client.space("differential")
    kept = client.space("ift-four-steered")
    peer = server._peer  # what a server says is published by its own session
    assert peer is not None
    event = json.dumps({"id": "differential", "kind": "put"}).encode()
    peer.publish(
        "omniplan/v1/default/events/vehicles/differential", event, "application/json"
    )
    for _ in range(3000):
        if client.space("differential") is not old:
            break
        threading.Event().wait(0.01)
    else:
        pytest.fail("the change was not noticed")
    assert client.space("ift-four-steered") is kept


def test_no_data_sheet_is_trusted_after_the_server_has_gone(fleet: Fleet) -> None:
    with Server(fleet, listen=ANY_PORT) as server, Client(server.endpoint) as client:
        sheet = client.space("differential")
        endpoint = server.endpoint
        server.close()
        for _ in range(3000):
            if client._sheets.get("differential") is None:
                break
            threading.Event().wait(0.01)
        with Server(fleet, listen=endpoint):
            again = client.space("differential")
        assert again is not sheet
        assert again.header == sheet.header


def test_what_is_under_way_is_asked_again_where_a_server_is_lost(
    pair: tuple[Server, Server],
    gate: Any,
    in_background: ThreadPoolExecutor,
    fleet: Fleet,
    trajectories: Trajectories,
) -> None:
    with Client([one.endpoint for one in pair], timeout=30.0) as client:
        client.wait_until_ready()
        question = in_background.submit(
            client.validate, trajectories[:1], "differential"
        )
        gate.wait_until_entered()
        # As if the connection to a server had broken; that to this one was not.
        client._asker._seen("omniplan/v1/default/servers/0123456789abcdef", False)
        gate.wait_until_entered()
        gate.opened.set()
        assert question.result(30) == (omniplan.validate(trajectories[0], fleet[1]),)


def test_a_server_that_stops_gently_still_answers_what_it_has_begun(
    fleet: Fleet,
    gate: Any,
    in_background: ThreadPoolExecutor,
    trajectories: Trajectories,
) -> None:
    with (
        Server(fleet, listen=ANY_PORT) as server,
        Client(server.endpoint, timeout=30.0) as client,
    ):
        client.wait_until_ready()
        question = in_background.submit(
            client.validate, trajectories[:1], "differential"
        )
        gate.wait_until_entered()
        closing = in_background.submit(server.close)
        # Longer than a client waits before it takes a server for lost.
        assert not gate.entered.acquire(timeout=0.4)
        gate.opened.set()
        assert len(question.result(30)) == 1
        closing.result(30)
