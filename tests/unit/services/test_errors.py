from __future__ import annotations

import pytest

from configspace import CacheError, InvalidInput, InvalidVehicle, Problem
from omniplan.errors import InvalidTrajectory
from services.answering.handlers import error_reply
from services.errors import (
    CODES,
    InvalidEndpoint,
    InvalidMessage,
    RemoteError,
    ServiceError,
    ServiceTimeout,
    ServiceUnreachable,
)

PROBLEM = Problem("t[3]", "NaN", "must be finite")


def test_classes_word_their_messages() -> None:
    assert str(ServiceTimeout("a/b", 0.5)) == "a/b: no answer within 0.5 s"
    unreachable = ServiceUnreachable("tcp/[::1]:7447", "nobody listens there")
    assert str(unreachable) == "no service at tcp/[::1]:7447: nobody listens there"
    remote = RemoteError("busy", "the queue is full")
    assert str(remote) == "the queue is full (busy)"
    assert remote.field is None


def test_a_bad_address_is_both_bad_input_and_a_service_error() -> None:
    error = InvalidEndpoint("listen", "x")
    assert isinstance(error, InvalidInput)
    assert isinstance(error, ServiceError)


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (InvalidMessage(PROBLEM), "invalid_message"),
        (InvalidMessage(PROBLEM, code="too_large"), "too_large"),
        (InvalidTrajectory(PROBLEM), "invalid_trajectory"),
        (InvalidVehicle(PROBLEM), "invalid_vehicle"),
        (InvalidInput(PROBLEM), "invalid_input"),
    ],
)
def test_bad_input_is_reported_with_code_words_and_place(
    error: InvalidInput, code: str
) -> None:
    reply = error_reply(error)
    assert (reply.code, reply.field) == (code, "t[3]")
    assert reply.message == "t[3]: NaN; must be finite"
    assert code in CODES


@pytest.mark.parametrize(
    "error", [CacheError("/srv/secret"), OSError("/srv"), KeyError(1)]
)
def test_any_other_error_shows_nothing(error: Exception) -> None:
    reply = error_reply(error)
    assert reply.code == "internal"
    assert reply.message == CODES["internal"]


def test_an_error_that_repeats_its_input_is_shortened() -> None:
    assert len(error_reply(InvalidInput(Problem("x", "y" * 10**6, "z"))).message) < 5000
