"""When a question is asked again, and when not."""

from __future__ import annotations

import pytest

from services.asking.asker import Asker, Attempts, error_of
from services.errors import (
    RemoteError,
    ServiceError,
    ServiceRefused,
    ServiceTimeout,
    ServiceUnreachable,
)
from services.protocol.endpoint import Endpoint
from services.protocol.keys import Keys
from services.wire.exchange import Reply, Stop

PLACE = Endpoint("127.0.0.1", 7447)
GONE = ServiceUnreachable("tcp/127.0.0.1:7447", "nobody answers")


def asker(*, retry: bool = True, has_met: bool = True) -> Asker:
    found = Asker([PLACE], Keys("default"), {}, 5.0, retry=retry)
    if has_met:
        found.met()
    return found


@pytest.mark.parametrize(
    ("error", "again"),
    [
        (RemoteError("busy", ""), True),
        (RemoteError("closing", ""), True),
        (RemoteError("unknown_vehicle", ""), False),
        (RemoteError("deadline_exceeded", ""), False),
        (RemoteError("internal", ""), False),
        (GONE, True),
        (ServiceTimeout("health", 1.0), True),
        (ServiceRefused("tls/agv:7447", "unknown authority"), False),
        (ServiceError("cannot be read"), False),
    ],
)
def test_only_what_may_turn_out_better_is_asked_again(
    error: ServiceError, again: bool
) -> None:
    assert asker().may_repeat(error) == again
    assert not asker(retry=False).may_repeat(error)


def test_who_was_never_there_is_not_asked_again() -> None:
    assert not asker(has_met=False).may_repeat(GONE)


def test_pauses_end_with_the_time_for_the_question() -> None:
    attempts = Attempts(asker(), "health", 0.2)

    def go_on() -> None:
        for _ in range(100):
            attempts.pause_after(GONE)

    with pytest.raises(ServiceUnreachable):
        go_on()


def test_pauses_grow(monkeypatch: pytest.MonkeyPatch) -> None:
    pauses: list[float] = []
    monkeypatch.setattr("services.asking.asker.time.sleep", pauses.append)
    attempts = Attempts(asker(), "health", 1000.0)
    for _ in range(12):
        attempts.pause_after(GONE)
    for number, pause in enumerate(pauses):
        full = min(0.02 * 2**number, 1.0)
        assert full / 2 <= pause <= full


def test_after_a_timeout_everybody_is_asked() -> None:
    attempts = Attempts(asker(), "health", 10.0)
    assert not attempts.is_everyone_asked
    attempts.pause_after(RemoteError("busy", ""))
    assert not attempts.is_everyone_asked
    attempts.pause_after(ServiceTimeout("health", 1.0))
    assert attempts.is_everyone_asked


def test_a_question_that_is_stopped_is_not_asked_again() -> None:
    stop = Stop()
    stop.set()
    with pytest.raises(ServiceUnreachable):
        Attempts(asker(), "health", 10.0, stop).pause_after(GONE)


def test_an_attempt_never_takes_longer_than_all_may() -> None:
    assert Attempts(asker(), "health", 60.0).next_timeout() == 5.0
    assert Attempts(asker(), "health", 2.0).next_timeout() <= 2.0


def test_an_error_reply_is_the_error_it_names() -> None:
    payload = b'{"code": "busy", "message": "later", "field": null}'
    error = error_of(Reply(True, payload, "application/json"))
    assert isinstance(error, RemoteError)
    assert (error.code, error.message, error.field) == ("busy", "later", None)
    unread = error_of(Reply(True, b"\xff" * 10**6, ""))
    assert not isinstance(unread, RemoteError)
    assert len(str(unread)) < 1000
