"""A question may be asked of everyone after a timeout; a change of one server only."""

from __future__ import annotations

from typing import Any

import pytest

from services.asking.asker import Asker
from services.errors import ServiceTimeout
from services.protocol.endpoint import Endpoint
from services.protocol.keys import Keys, Route
from services.wire.exchange import Reply


class Peer:
    """Loses the first request, answers the second."""

    def __init__(self) -> None:
        self.asked_everyone: list[bool] = []

    def ask(self, key: str, *_: object, everyone: bool, **__: object) -> list[Reply]:
        self.asked_everyone.append(everyone)
        if len(self.asked_everyone) == 1:
            raise ServiceTimeout(key, 0.1)
        return [Reply(False, b"{}", "application/json")]


@pytest.mark.parametrize(
    ("route", "expected"),
    [
        (Route("health"), [False, True]),
        (Route("register", "agv"), [False, False]),
        (Route("unregister", "agv"), [False, False]),
    ],
)
def test_a_lost_change_is_asked_again_of_one_server(
    monkeypatch: pytest.MonkeyPatch, route: Route, expected: list[bool]
) -> None:
    peer: Any = Peer()
    monkeypatch.setattr(Asker, "peer", lambda *_: peer)
    endpoint = Endpoint.parse("endpoint", "tcp/127.0.0.1:7447")
    asker = Asker([endpoint], Keys("default"), {}, 0.1, retry=True)
    assert asker.ask(route, b"{}", 5.0) == b"{}"
    # Each server that takes a change gives it a version of its own.
    assert peer.asked_everyone == expected
