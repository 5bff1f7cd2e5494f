from __future__ import annotations

import math

import pytest

from configspace import InvalidInput
from services.answering.calls import REMEMBERED, Call, Calls
from services.errors import CODES, CallStopped


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The time, to be changed."""
    now = [100.0]
    monkeypatch.setattr("services.answering.calls.time.monotonic", lambda: now[0])
    return now


def stopped(call: Call) -> str:
    with pytest.raises(CallStopped) as caught:
        call.check()
    assert str(caught.value) == CODES[caught.value.code]
    return caught.value.code


def test_a_deadline_counts_from_the_arrival(clock: list[float]) -> None:
    call = Call.local()
    clock[0] += 4.0
    call.expires_in(5.0)
    clock[0] += 0.9
    call.check()
    assert call.age == pytest.approx(4.9)
    clock[0] += 0.2
    assert stopped(call) == "deadline_exceeded"


def test_a_deadline_that_has_passed_is_noticed_when_it_becomes_known(
    clock: list[float],
) -> None:
    call = Call.local()
    clock[0] += 1.0
    with pytest.raises(CallStopped):
        call.expires_in(0.5)


def test_the_earliest_deadline_counts(clock: list[float]) -> None:
    call = Call(Calls(), "key", max_time=2.0)
    call.expires_in(10.0)
    call.expires_in(math.inf)
    call.expires_in(None)
    clock[0] += 2.0
    assert stopped(call) == "deadline_exceeded"


def test_a_named_call_can_be_cancelled() -> None:
    calls = Calls()
    call, other = Call(calls, "a"), Call(calls, "b")
    for each in (call, other):
        calls.begin(each)
    call.named("first")
    other.named("second")
    assert calls.cancel("first")
    assert stopped(call) == "cancelled"
    other.check()
    calls.end(call)
    assert not calls.cancel("first")
    assert len(calls) == 1


def test_a_call_cancelled_before_it_is_named_stops_then() -> None:
    calls = Calls()
    assert not calls.cancel("early")
    with pytest.raises(CallStopped, match="cancelled"):
        Call(calls, "a").named("early")


def test_only_so_many_cancelled_names_are_remembered() -> None:
    calls = Calls()
    for index in range(REMEMBERED + 1):
        calls.cancel(f"n{index}")
    Call(calls, "a").named("n0")
    with pytest.raises(CallStopped):
        Call(calls, "a").named("n1")


def test_a_name_stays_with_the_call_that_had_it_first() -> None:
    calls = Calls()
    first, second = Call(calls, "a"), Call(calls, "b")
    first.named("same")
    second.named("same")
    calls.end(second)
    assert calls.cancel("same")
    assert stopped(first) == "cancelled"
    second.check()


@pytest.mark.parametrize("name", ["", "a/b", "*", "x" * 65])
def test_a_name_must_fit_a_key(name: str) -> None:
    with pytest.raises(InvalidInput, match="request"):
        Call.local().named(name)


def test_all_calls_can_be_stopped_and_the_first_reason_stays() -> None:
    calls = Calls()
    call = Call(calls, "a")
    calls.begin(call)
    call.stop("cancelled")
    later = Call(calls, "b")
    calls.begin(later)
    calls.stop_all("closing")
    assert stopped(call) == "cancelled"
    assert stopped(later) == "closing"


def test_every_call_has_its_own_number() -> None:
    calls = Calls()
    assert [Call(calls, "a").id for _ in range(3)] == ["1", "2", "3"]
