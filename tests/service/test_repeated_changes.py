"""A change whose answer is lost is asked again: it is done once, and undoes nothing."""

from __future__ import annotations

import contextlib
import json
import socket
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Literal, TypeAlias

import pytest

import configspace
from services import Client, Registry, RemoteError, Server

pytestmark = pytest.mark.service

Verb: TypeAlias = Literal["register", "unregister"]

GRID = configspace.Grid(8, 16)
AGV = configspace.load_vehicle("mecanum")

# Does what it is asked, and is killed before it can say so.
SERVER = """
import json, os, signal, sys
import configspace
import services.answering.handlers as handlers
from services import Registry, Server

listen, peer, folder, fatal = json.loads(sys.argv[1])
change = handlers.change

def change_and_die(registry, route, payload):
    answer = change(registry, route, payload)
    if route.verb == fatal:
        print("done", flush=True)
        sys.stdin.readline()
        os.kill(os.getpid(), signal.SIGKILL)
    return answer

handlers.change = change_and_die
with Registry.open([], folder, grid=configspace.Grid(8, 16)) as registry:
    with Server(registry=registry, listen=listen, peers=[peer]) as server:
        print("ready", flush=True)
        server.wait()
"""


class Doomed:
    """A server in a process of its own that is killed before it answers a change."""

    def __init__(self, listen: str, peer: str, folder: Path, fatal: Verb) -> None:
        given = json.dumps([listen, peer, str(folder), fatal])
        self._process = subprocess.Popen(
            [sys.executable, "-c", SERVER, given],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def wait_until(self, word: Literal["ready", "done"]) -> None:
        assert self._process.stdout is not None
        assert self._process.stdout.readline() == f"{word}\n"

    def die(self) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        assert self._process.wait(30) == -9

    def close(self) -> None:
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            with contextlib.suppress(BrokenPipeError):
                pipe.close()


def free_endpoints() -> tuple[str, str]:
    with (
        socket.create_server(("127.0.0.1", 0)) as one,
        socket.create_server(("127.0.0.1", 0)) as other,
    ):
        first, second = (f"tcp/127.0.0.1:{x.getsockname()[1]}" for x in (one, other))
        return first, second


@contextlib.contextmanager
def lost_answer(
    verb: Verb, folder: Path, in_background: ThreadPoolExecutor
) -> Iterator[tuple[Registry, Doomed, Future[str]]]:
    """Yield while one server has made a change that it will not answer.

    The other server knows of it; it is the one that will be asked again.
    """
    first, second = free_endpoints()
    with contextlib.ExitStack() as stack:
        doomed = Doomed(first, second, folder / "first", verb)
        stack.callback(doomed.close)
        doomed.wait_until("ready")
        client = stack.enter_context(Client([first, second], timeout=60.0))
        client.wait_until_ready()
        if verb == "unregister":
            client.register(AGV)
            task = in_background.submit(client.unregister, AGV.name)
        else:
            task = in_background.submit(client.register, AGV)
        doomed.wait_until("done")
        registry = stack.enter_context(Registry.open([], folder / "second", grid=GRID))
        stack.enter_context(Server(registry=registry, listen=second, peers=[first]))
        assert AGV.name in registry.snapshot.records
        yield registry, doomed, task


@pytest.mark.parametrize("verb", ["register", "unregister"])
def test_a_change_that_was_done_is_not_done_again(
    verb: Verb, in_background: ThreadPoolExecutor, tmp_path: Path
) -> None:
    with lost_answer(verb, tmp_path, in_background) as (registry, doomed, task):
        before = registry.snapshot.records[AGV.name]
        assert before.is_deleted == (verb == "unregister")
        doomed.die()
        assert task.result(60) == str(before.version)
        assert registry.snapshot.records[AGV.name] == before


@pytest.mark.parametrize("verb", ["register", "unregister"])
def test_what_somebody_else_has_changed_since_is_not_undone(
    verb: Verb, in_background: ThreadPoolExecutor, tmp_path: Path
) -> None:
    with lost_answer(verb, tmp_path, in_background) as (registry, doomed, task):
        theirs = AGV.model_copy(update={"description": "theirs"})
        registry.put(AGV.name, theirs.model_dump_json(exclude_none=True).encode())
        after = registry.snapshot.records[AGV.name]
        doomed.die()
        with pytest.raises(RemoteError, match="another change followed") as caught:
            task.result(60)
        assert (caught.value.code, caught.value.field) == ("conflict", "request")
        assert registry.snapshot.records[AGV.name] == after


def test_after_a_restart_a_change_is_known_to_be_done(
    in_background: ThreadPoolExecutor, tmp_path: Path
) -> None:
    endpoint, nobody = free_endpoints()
    with contextlib.ExitStack() as stack:
        doomed = Doomed(endpoint, nobody, tmp_path / "store", "register")
        stack.callback(doomed.close)
        doomed.wait_until("ready")
        client = stack.enter_context(Client(endpoint, timeout=60.0))
        client.wait_until_ready()
        task = in_background.submit(client.register, AGV)
        doomed.wait_until("done")
        doomed.die()
        registry = stack.enter_context(Registry.open([], tmp_path / "store", grid=GRID))
        (record,) = registry.snapshot.records.values()
        stack.enter_context(Server(registry=registry, listen=endpoint))
        assert task.result(60) == str(record.version)
        assert registry.snapshot.records == {AGV.name: record}
