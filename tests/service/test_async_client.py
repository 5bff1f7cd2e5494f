"""The client for asyncio: the same answers, and tasks that can be cancelled."""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Coroutine
from typing import Any, TypeVar

import numpy as np
import pytest
from loopback import Fleet, Trajectories

import configspace
import omniplan
from services import AsyncClient, Client, RemoteError, Server
from services.answering.calls import Calls

pytestmark = pytest.mark.service
T = TypeVar("T")


def run(coroutine: Coroutine[Any, Any, T]) -> T:
    return asyncio.run(asyncio.wait_for(coroutine, 60))


def public(kind: type) -> dict[str, inspect.Signature]:
    return {
        name: inspect.signature(member)
        for name, member in inspect.getmembers(kind, inspect.isfunction)
        if not name.startswith("_")
    }


def test_it_has_the_names_and_parameters_of_the_client() -> None:
    own, others = public(AsyncClient), public(Client)
    # A context manager, and what makes the asynchronous client.
    assert others.keys() - own.keys() == {"announce", "stoppable"}
    for name in own:
        assert own[name].parameters == others[name].parameters, name
    signature = inspect.signature(AsyncClient).parameters
    for name, parameter in inspect.signature(Client).parameters.items():
        assert signature[name] == parameter


def test_answers_are_those_of_the_calls(
    server: Server, fleet: Fleet, trajectories: Trajectories
) -> None:
    async def ask() -> None:
        async with AsyncClient(server.endpoint, timeout=30.0) as client:
            await client.wait_until_ready()
            vehicles, health, reports, rankings, table = await asyncio.gather(
                client.vehicles(),
                client.health(),
                client.validate(trajectories, "differential"),
                client.select(trajectories, by="margin"),
                client.validate_many(trajectories),
            )
            assert vehicles == ("ift-four-steered", "differential")
            assert health.vehicles == 2
            assert reports == tuple(
                omniplan.validate(one, fleet[1]) for one in trajectories
            )
            assert rankings == omniplan.select(trajectories, fleet, by="margin")
            expected = omniplan.validate_many(trajectories, fleet)
            assert table.to_pylist() == expected.to_pylist()
            assert await client.vehicle("differential") == fleet[1].vehicle
            sheet = await client.space("differential")
            assert sheet is await client.space("differential")
            twists = np.array([[0.1, 0.0, 0.0], [9.0, 9.0, 9.0]])
            permitted = await client.check_twists(twists, "differential")
            expected_twists = omniplan.check_twists(twists, fleet[1])
            np.testing.assert_array_equal(permitted, expected_twists)
            with pytest.raises(RemoteError):
                await client.vehicle("nobody")

    run(ask())


def test_parts_come_one_after_the_other(
    server: Server, fleet: Fleet, trajectories: Trajectories
) -> None:
    told: list[tuple[int, int]] = []

    async def ask() -> list[dict[str, Any]]:
        rows = []
        async with AsyncClient(server.endpoint, timeout=30.0) as client:
            async for part in client.verdicts(
                trajectories, progress=lambda *at: told.append(at)
            ):
                rows += part.to_pylist()
        return rows

    assert run(ask()) == omniplan.validate_many(trajectories, fleet).to_pylist()
    assert told[-1] == (6, 6)


def test_a_cancelled_task_cancels_its_question(
    server: Server, gate: Any, trajectories: Trajectories,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    names: list[str] = []
    cancel = Calls.cancel

    async def ask() -> None:
        loop = asyncio.get_running_loop()
        cancelled = asyncio.Event()

        def noticed(calls: Calls, name: str) -> bool:
            found = cancel(calls, name)
            names.append(name)
            loop.call_soon_threadsafe(cancelled.set)
            return found

        monkeypatch.setattr(Calls, "cancel", noticed)
        async with AsyncClient(server.endpoint, timeout=30.0) as client:
            task = asyncio.create_task(client.validate(trajectories, "differential"))
            await asyncio.to_thread(gate.wait_until_entered)
            task.cancel()
            with pytest.raises(asyncio.CancelledError):
                await task
            await asyncio.wait_for(cancelled.wait(), 30)
            gate.opened.set()
            while "validate" not in (await client.health()).keys:
                await asyncio.sleep(0.01)
            assert (await client.health()).keys["validate"].codes == {"cancelled": 1}

    run(ask())
    assert [len(name) for name in names] == [32]


def test_closing_the_parts_cancels_what_is_left(
    server: Server, trajectories: Trajectories, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("services.answering.batches.FIRST", 1)
    monkeypatch.setattr("services.answering.batches._next_size", lambda *_: 1)

    async def ask() -> None:
        async with AsyncClient(server.endpoint, timeout=30.0) as client:
            parts = client.verdicts(trajectories)
            assert (await anext(parts)).num_rows == 2
            await parts.aclose()
            while "cancel" not in (await client.health()).keys:
                await asyncio.sleep(0.01)

    run(ask())


def test_at_least_one_question_may_be_under_way() -> None:
    with pytest.raises(configspace.InvalidInput, match="max_concurrent"):
        AsyncClient(max_concurrent=0)
