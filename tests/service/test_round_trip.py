"""What a client gets is what the calls within Python give."""

from __future__ import annotations

import numpy as np
import pytest
from loopback import Fleet, Trajectories

import configspace
import omniplan
from services import Client, RemoteError, Server
from services.protocol.endpoint import Endpoint
from services.wire.session import Peer

pytestmark = pytest.mark.service


def test_validate_gives_the_reports_of_the_call(
    client: Client, fleet: Fleet, trajectories: Trajectories
) -> None:
    for space in fleet:
        expected = tuple(omniplan.validate(t, space) for t in trajectories)
        assert client.validate(trajectories, space.name) == expected


@pytest.mark.parametrize("by", ["duration", "margin"])
def test_select_gives_the_rankings_of_the_call(
    client: Client, fleet: Fleet, trajectories: Trajectories, by: str
) -> None:
    expected = omniplan.select(trajectories, fleet, by=by)
    assert client.select(trajectories, by=by) == expected


def test_select_compares_the_named_vehicles_only(
    client: Client, fleet: Fleet, trajectories: Trajectories
) -> None:
    expected = omniplan.select(trajectories, fleet[1:])
    assert client.select(trajectories, [fleet[1].name]) == expected


def test_omni_curve_trajectories_travel_with_their_vehicle(
    client: Client, fleet: Fleet
) -> None:
    vehicle = configspace.load_vehicle("ift-four-steered")
    trajectory = omniplan.Trajectory.from_omni_curve(
        [0, 1, 2], [0.0, 0.1, 0.2], [0.0, 0.1, 0.2], [0.1, 0.1, 0.1], vehicle
    )
    expected = (omniplan.validate(trajectory, fleet[0]),)
    assert client.validate([trajectory], "ift-four-steered") == expected


def test_no_trajectories_have_no_reports(client: Client) -> None:
    assert client.validate([], "differential") == ()


def test_vehicles_are_listed_in_the_order_of_the_fleet(client: Client) -> None:
    assert client.vehicles() == ("ift-four-steered", "differential")


def test_a_vehicle_comes_back_equal(client: Client, fleet: Fleet) -> None:
    assert [client.vehicle(space.name) for space in fleet] == [
        space.vehicle for space in fleet
    ]


def test_a_data_sheet_comes_back_equal(client: Client, fleet: Fleet) -> None:
    sheet = client.space("differential")
    assert sheet.header == fleet[1].header
    for name, table in vars(fleet[1].tables).items():
        np.testing.assert_array_equal(getattr(sheet.tables, name), table)


def test_a_vehicle_known_by_its_data_sheet_only_has_no_file(fleet: Fleet) -> None:
    sheet = configspace.parse_space(configspace.dump_space(fleet[0]))
    with (
        Server([sheet], listen="tcp/127.0.0.1:0") as server,
        Client(server.endpoint) as client,
        pytest.raises(RemoteError, match="data sheet") as caught,
    ):
        client.vehicle(sheet.name)
    assert caught.value.code == "no_vehicle_file"


def test_health_counts_requests_and_errors(client: Client, server: Server) -> None:
    client.vehicles()
    with pytest.raises(RemoteError):
        client.vehicle("nobody")
    health = client.health()
    assert (health.requests, health.errors, health.vehicles) == (3, 1, 2)
    assert (health.queue_length, health.queue_size) == (0, 64)
    assert health.instance == server.health().instance
    assert 0 < health.uptime < 3600


def test_sites_do_not_see_each_other(fleet: Fleet) -> None:
    with (
        Server(fleet[:1], site="hall-2", listen="tcp/127.0.0.1:0") as server,
        Client(server.endpoint, site="hall-2") as client,
    ):
        assert client.vehicles() == ("ift-four-steered",)


def test_a_wildcard_is_answered_under_each_concrete_key(server: Server) -> None:
    peer = Peer.connected(Endpoint.parse("endpoint", server.endpoint), 5.0, 0.0)
    answers = peer.ask("omniplan/v1/*/vehicles/*", None, "", 10.0)
    assert sorted(b"wheels" in answer.payload for answer in answers) == [True, True]
    (health,) = peer.ask("omniplan/v1/*/health", None, "", 10.0)
    assert not health.is_error
    assert peer.ask("omniplan/v1/*/nothing", None, "", 10.0) == []
    peer.close()


def test_a_wildcard_with_a_payload_asks_questions_only(
    server: Server, validate_message: bytes
) -> None:
    peer = Peer.connected(Endpoint.parse("endpoint", server.endpoint), 5.0, 0.0)
    key = "omniplan/v1/*/validate"
    (answer,) = peer.ask(key, validate_message, "application/json", 30.0)
    assert not answer.is_error
    peer.close()
