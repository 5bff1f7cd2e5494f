from __future__ import annotations

from typing import Any

import pytest

import configspace
from services import Client, InvalidEndpoint, Server


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"site": "a/b"}, "site"),
        ({"workers": 0}, "workers: 0"),
        ({"queue_size": 0}, "queue_size: 0"),
        ({"max_bytes": -1}, "max_bytes: -1"),
        ({"max_samples": 0}, "max_samples: 0"),
        ({"listen": "tcp/127.0.0.1"}, "listen: .*tcp/HOST:PORT"),
    ],
)
def test_a_server_refuses_what_is_not_allowed(
    arguments: dict[str, Any], words: str
) -> None:
    with pytest.raises(configspace.InvalidInput, match=words):
        Server([], **arguments)


def test_a_vehicle_stands_in_a_fleet_once() -> None:
    vehicle = configspace.load_vehicle("differential")
    space = configspace.build_space(vehicle, configspace.Grid(4, 8), cache=False)
    with pytest.raises(configspace.InvalidInput, match=r"fleet\[1\].name.*again"):
        Server([space, space])


@pytest.mark.parametrize("timeout", [0.0, -1.0, float("nan"), float("inf")])
def test_a_client_always_has_a_timeout(timeout: float) -> None:
    with pytest.raises(configspace.InvalidInput, match="timeout"):
        Client(timeout=timeout)
    with Client() as client, pytest.raises(configspace.InvalidInput, match="timeout"):
        client.wait_until_ready(timeout)


def test_a_client_names_what_it_cannot_ask() -> None:
    with Client() as client, pytest.raises(configspace.InvalidInput, match="vehicle"):
        client.space("a/b")
    with pytest.raises(configspace.InvalidInput, match="site"):
        Client(site="**")
    with pytest.raises(InvalidEndpoint, match="endpoint"):
        Client("localhost")
