"""The store against a dictionary, against damage, and against kill -9."""

from __future__ import annotations

import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
)

from configspace import InvalidInput
from services.errors import StoreError
from services.registering.store import Record, VehicleStore
from services.registering.versions import Version

INSTANCE = "0123456789abcdef"


def record(id: str = "agv", counter: int = 1, vehicle: str | None = "{}") -> Record:
    return Record(id, Version(counter, INSTANCE), vehicle)


def vehicle_files(folder: Path) -> list[Path]:
    return sorted((folder / "vehicles").iterdir())


NAMES = st.text("aAbB9._-", min_size=1, max_size=64).filter(lambda s: s[0] in "aAbB9")
FILES = st.none() | st.text(max_size=40)


class StoreMachine(RuleBasedStateMachine):
    """What was written is there, also after opening it again and after damage."""

    def __init__(self) -> None:
        super().__init__()
        self.expected: dict[str, Record] = {}
        self.n_damaged = 0

    @initialize()
    def make(self) -> None:
        self.stack = contextlib.ExitStack()
        self.folder = Path(self.stack.enter_context(tempfile.TemporaryDirectory()))
        self.store = VehicleStore(self.folder)
        self.instance = self.store.instance

    @rule(
        name=NAMES,
        counter=st.integers(1, 10),
        vehicle=FILES,
        requests=st.lists(NAMES, max_size=3).map(tuple),
    )
    def write(
        self, name: str, counter: int, vehicle: str | None, requests: tuple[str, ...]
    ) -> None:
        self.expected[name] = replace(record(name, counter, vehicle), requests=requests)
        self.store.write(self.expected[name])

    @rule()
    def reopen(self) -> None:
        self.store.close()
        self.store = VehicleStore(self.folder)
        assert self.store.damaged == ()

    @rule(content=st.binary(max_size=40))
    def leave_a_write_unfinished(self, content: bytes) -> None:
        (self.folder / "vehicles" / f".tmp-{len(content)}").write_bytes(content)
        self.reopen()

    @precondition(lambda self: self.expected)
    @rule(data=st.data())
    def damage(self, data: st.DataObject) -> None:
        path = data.draw(st.sampled_from(vehicle_files(self.folder)))
        content = bytearray(path.read_bytes())
        place = data.draw(st.integers(0, len(content) - 1))
        name = json.loads(content)["id"]
        if data.draw(st.booleans()):
            content = content[:place]
        else:
            content[place] ^= data.draw(st.sampled_from([1, 2, 4, 128]))
        path.write_bytes(content)
        self.store.close()
        self.store = VehicleStore(self.folder)
        # Two texts of JSON may mean the same; else it is set aside.
        if name not in self.store.records:
            (report,) = self.store.damaged
            assert path.name in report
            del self.expected[name]
            self.n_damaged += 1

    @invariant()
    def holds_what_was_written(self) -> None:
        assert dict(self.store.records) == self.expected
        # Requests are no part of what a record says, and are kept all the same.
        for name, record in self.expected.items():
            assert self.store.records[name].requests == record.requests
        assert self.store.instance == self.instance
        assert len(vehicle_files(self.folder)) == len(self.expected)
        assert len(list((self.folder / "damaged").iterdir())) == self.n_damaged

    def teardown(self) -> None:
        self.store.close()
        self.stack.close()


StoreMachine.TestCase.settings = settings(
    max_examples=20, stateful_step_count=20, deadline=None
)
TestStore = StoreMachine.TestCase


def test_names_that_differ_in_case_have_files_of_their_own(tmp_path: Path) -> None:
    with VehicleStore(tmp_path) as store:
        store.write(record("agv"))
        store.write(record("AGV"))
    names = [path.name.lower() for path in vehicle_files(tmp_path)]
    assert len(set(names)) == 2


def test_one_program_at_a_time(tmp_path: Path) -> None:
    with (
        VehicleStore(tmp_path),
        pytest.raises(StoreError, match="another program uses it"),
    ):
        VehicleStore(tmp_path)
    VehicleStore(tmp_path).close()


def test_a_closed_store_writes_no_more(tmp_path: Path) -> None:
    store = VehicleStore(tmp_path)
    store.close()
    store.close()
    with pytest.raises(StoreError, match="is closed"):
        store.write(record())


def test_a_record_under_the_name_of_another_is_set_aside(tmp_path: Path) -> None:
    with VehicleStore(tmp_path) as store:
        store.write(record("agv"))
    (path,) = vehicle_files(tmp_path)
    path.rename(path.with_name("cart.json"))
    with VehicleStore(tmp_path) as store:
        assert store.records == {}
        assert "is the record of 'agv'" in store.damaged[0]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "damaged"),
        (b"[1]", "damaged"),
        (b'{"format": "omniplan vehicle store 1"}', "damaged"),
        (b'{"format": "omniplan vehicle store 2", "instance": ""}', "store 2"),
    ],
)
def test_a_store_of_unknown_format_is_left_alone(
    tmp_path: Path, content: bytes, words: str
) -> None:
    with VehicleStore(tmp_path) as store:
        store.write(record())
    (tmp_path / "store.json").write_bytes(content)
    with pytest.raises(StoreError, match=words):
        VehicleStore(tmp_path)
    assert len(vehicle_files(tmp_path)) == 1


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "file", tmp_path / "file" / "in", tmp_path / "no" / "in"):
        with pytest.raises(StoreError, match=f"vehicle store {folder}: cannot be"):
            VehicleStore(folder)


def test_a_write_that_fails_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    with VehicleStore(tmp_path) as store:
        store.write(record(counter=1))
        for name in ("fsync", "replace"):
            with monkeypatch.context() as patch:
                patch.setattr(f"services.registering.store.os.{name}", full)
                with pytest.raises(StoreError, match="No space left"):
                    store.write(record(counter=2))
            assert store.records["agv"].version.counter == 1
            assert len(vehicle_files(tmp_path)) == 1
    with VehicleStore(tmp_path) as store:
        assert store.records["agv"].version.counter == 1


def test_a_record_has_a_name_that_can_be_a_key() -> None:
    for id in ("../agv", "a/b", "", ".agv", "a" * 65, "agv\n"):
        with pytest.raises(InvalidInput, match="vehicle: "):
            record(id)


WRITER = """
import os, sys
from services.registering.store import Record, VehicleStore
from services.registering.versions import Version

def tell(text):
    os.write(1, f"{text}\\n".encode())  # at once, lines of both processes whole

def write(folder):
    store = VehicleStore(folder)
    n = max((r.version.counter for r in store.records.values()), default=0)
    tell("open")
    while True:
        n += 1
        name = "abc"[n % 3]
        content = None if n % 7 == 0 else f"{name} {n} " * 3000
        store.write(Record(name, Version(n, store.instance), content))
        tell(n)

for line in sys.stdin:
    child = os.fork()
    if not child:
        write(sys.argv[1])
    tell(f"child {child}")
    os.waitpid(child, 0)
    tell("end")
"""


class Writer:
    """A program that writes until it is killed, again and again."""

    def __init__(self, folder: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", WRITER, str(folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def killed_after(self, seconds: float) -> int:
        """Return the last write that was acknowledged before it was killed."""
        assert self._process.stdin is not None
        self._process.stdin.write("go\n")
        self._process.stdin.flush()
        lines = [self._line(), self._line()]
        (child,) = (int(line.split()[1]) for line in lines if line.startswith("child"))
        assert "open" in lines
        time.sleep(seconds)  # the moment of the kill is what is tried
        os.kill(child, signal.SIGKILL)
        while (line := self._line()) != "end":
            lines.append(line)
        return max((int(line) for line in lines if line.isdigit()), default=0)

    def _line(self) -> str:
        assert self._process.stdout is not None
        return self._process.stdout.readline().strip() or "end"

    def __enter__(self) -> Writer:
        return self

    def __exit__(self, *_: object) -> None:
        with self._process as process:
            process.kill()


def check_killed_writers(folder: Path, n_kills: int) -> int:
    rng = random.Random(5)
    last = 0
    with Writer(folder) as writer:
        for _ in range(n_kills):
            last = max(last, writer.killed_after(rng.uniform(0.0, 0.2)))
            last = check_all_is_there(folder, last)
    return last


def check_all_is_there(folder: Path, last: int) -> int:
    """Check the store after a kill; return the number of its newest write."""
    with VehicleStore(folder) as store:
        records = store.records
    assert store.damaged == ()
    newest = max((r.version.counter for r in records.values()), default=0)
    # One write may have been stored whose acknowledgement was cut off.
    assert newest in (last, last + 1)
    for name in "abc":
        due = [n for n in range(1, newest + 1) if "abc"[n % 3] == name]
        if due:
            counter = records[name].version.counter
            assert counter == due[-1]
            vehicle = None if counter % 7 == 0 else f"{name} {counter} " * 3000
            assert records[name].vehicle == vehicle
    return newest


def test_what_was_acknowledged_survives_kill_9(tmp_path: Path) -> None:
    assert check_killed_writers(tmp_path, 12) >= 30


@pytest.mark.slow
def test_what_was_acknowledged_survives_kill_9_many_times(tmp_path: Path) -> None:
    assert check_killed_writers(tmp_path, 200) >= 500
