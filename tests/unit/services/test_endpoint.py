from __future__ import annotations

import pytest

from services import InvalidEndpoint
from services.protocol.endpoint import Endpoint


@pytest.mark.parametrize(
    "text", ["tcp/127.0.0.1:7447", "tcp/[::1]:0", "tcp/agv-hub:80", "tls/agv-hub:7447"]
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


@pytest.mark.parametrize("host", ["127.evil.example", "localhost.example", "127.1"])
def test_a_name_is_not_taken_for_loopback(host: str) -> None:
    assert not Endpoint.parse("listen", f"tcp/{host}:1").is_loopback


def test_tls_stays_tls() -> None:
    endpoint = Endpoint.parse("listen", "tls/127.0.0.1:0")
    assert endpoint.is_tls
    assert not Endpoint.parse("listen", "tcp/127.0.0.1:0").is_tls
    assert str(endpoint.concrete()).startswith("tls/127.0.0.1:")


@pytest.mark.parametrize(
    "text", ["udp/a:1", "quic/a:1", "a:1", "tls/a", "tls/a:65536", "tls/a:1#x=y", ""]
)
def test_no_other_protocol_or_option_is_taken(text: str) -> None:
    with pytest.raises(InvalidEndpoint, match=r"listen: .*tls/HOST:PORT"):
        Endpoint.parse("listen", text)
