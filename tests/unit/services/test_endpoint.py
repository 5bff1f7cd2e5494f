from __future__ import annotations

import pytest

from services.endpoint import Endpoint


@pytest.mark.parametrize(
    "text", ["tcp/127.0.0.1:7447", "tcp/[::1]:0", "tcp/agv-hub:80"]
)
def test_text_and_back(text: str) -> None:
    assert str(Endpoint.parse("listen", text)) == text


@pytest.mark.parametrize(
    ("text", "is_loopback"),
    [
        ("tcp/127.0.0.1:1", True),
        ("tcp/localhost:1", True),
        ("tcp/[::1]:1", True),
        ("tcp/0.0.0.0:1", False),
        ("tcp/10.0.0.7:1", False),
    ],
)
def test_loopback_is_recognised(text: str, is_loopback: bool) -> None:
    assert Endpoint.parse("listen", text).is_loopback is is_loopback


def test_port_zero_becomes_a_free_one_and_others_stay() -> None:
    assert 0 < Endpoint("127.0.0.1", 0).concrete().port <= 65535
    assert Endpoint("127.0.0.1", 7).concrete() == Endpoint("127.0.0.1", 7)
