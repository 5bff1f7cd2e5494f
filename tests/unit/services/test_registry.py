"""What a registry knows after any sequence of changes; several of them alike."""

from __future__ import annotations

import contextlib
import json
import tempfile
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

import configspace
from configspace import Grid, InvalidInput, InvalidVehicle
from services.errors import InvalidMessage, RegistrationRefused
from services.registering.registry import ABSENT, MAX_VEHICLE_BYTES, Registry
from services.registering.registry_messages import Digest, RecordEntry, Records
from services.registering.snapshot import Change, sheet_bytes
from services.registering.store import MAX_REQUESTS, Record
from services.registering.versions import Version

GRID = Grid(8, 16)
NAMES = ("a", "b", "c")
SPEEDS = (0.5, 1.0, 2.0)


def vehicle_file(name: str = "agv", speed: float = 1.0) -> bytes:
    wheels = [
        {"id": id, "type": "fixed", "x": 0.0, "y": y, "max_speed": speed}
        for id, y in (("left", 0.2), ("right", -0.2))
    ]
    return json.dumps({"name": name, "wheels": wheels}).encode()


def fingerprint(name: str, speed: float) -> str:
    vehicle = configspace.parse_vehicle(vehicle_file(name, speed).decode())
    return configspace.build_space(vehicle, GRID).header.fingerprint


def space(name: str) -> configspace.PermissibleSpace:
    vehicle = configspace.parse_vehicle(vehicle_file(name).decode())
    return configspace.build_space(vehicle, GRID)


def opened(folder: Path, **options: object) -> Registry:
    return Registry.open((), folder, grid=GRID, **options)  # type: ignore[arg-type]


@pytest.fixture
def registry(tmp_path: Path) -> Registry:
    return opened(tmp_path / "store")


def refusal(
    registry: Registry, *request: object, verb: str = "put"
) -> RegistrationRefused:
    """Return why a request is refused; nothing has changed then."""
    before = registry.snapshot
    with pytest.raises(RegistrationRefused) as caught:
        getattr(registry, verb)(*request)
    assert registry.snapshot is before
    return caught.value


class RegistryMachine(RuleBasedStateMachine):
    """Against a dictionary of speeds and one of versions."""

    @initialize()
    def make(self) -> None:
        self.stack = contextlib.ExitStack()
        self.folder = Path(self.stack.enter_context(tempfile.TemporaryDirectory()))
        self.registry = opened(self.folder)
        self.changes: list[Change] = []
        self.registry.subscribe(self.changes.append)
        self.speeds: dict[str, float] = {}
        self.versions: dict[str, Version] = {}
        self.newest = Version(1, "0" * 16)

    def note(self, change: Change, speed: float | None) -> None:
        """Check one change that must have happened, and take it over."""
        assert self.changes.pop() == change
        assert not self.changes
        assert change.version > self.newest
        self.newest = self.versions[change.id] = change.version
        if speed is None:
            del self.speeds[change.id]
            assert (change.kind, change.fingerprint) == ("delete", "")
        else:
            self.speeds[change.id] = speed
            assert change.fingerprint == fingerprint(change.id, speed)

    @rule(name=st.sampled_from(NAMES), speed=st.sampled_from(SPEEDS))
    def put(self, name: str, speed: float) -> None:
        change = self.registry.put(name, vehicle_file(name, speed))
        if self.speeds.get(name) == speed:
            assert change.version == self.versions[name]
            assert not self.changes
        else:
            self.note(change, speed)

    @rule(
        name=st.sampled_from(NAMES),
        speed=st.sampled_from(SPEEDS),
        expected=st.sampled_from([*NAMES, ABSENT]),
    )
    def put_expecting(self, name: str, speed: float, expected: str) -> None:
        version = expected
        if expected != ABSENT:
            version = str(self.versions.get(expected, Version(1, "0" * 16)))
        is_there = name in self.speeds
        fits = expected == name if is_there else expected == ABSENT
        if fits or self.speeds.get(name) == speed:
            before = self.versions.get(name)
            change = self.registry.put(name, vehicle_file(name, speed), version)
            if self.speeds.get(name) == speed:
                assert change.version == before
            else:
                self.note(change, speed)
        else:
            error = refusal(self.registry, name, vehicle_file(name, speed), version)
            assert error.code == "conflict"

    @rule(name=st.sampled_from(NAMES))
    def delete(self, name: str) -> None:
        if name in self.speeds:
            self.note(self.registry.delete(name), None)
        elif name in self.versions:
            assert self.registry.delete(name).version == self.versions[name]
            assert not self.changes
        else:
            error = refusal(self.registry, name, verb="delete")
            assert error.code == "unknown_vehicle"

    @rule()
    def reopen(self) -> None:
        self.registry.close()
        self.registry = opened(self.folder)
        self.registry.subscribe(self.changes.append)

    @invariant()
    def knows_what_is_registered(self) -> None:
        snapshot = self.registry.snapshot
        assert list(snapshot.fleet) == sorted(self.speeds)
        for name, speed in self.speeds.items():
            assert snapshot.fingerprint(name) == fingerprint(name, speed)
            assert snapshot.fleet[name].vehicle is not None
        found = {name: r.version for name, r in snapshot.records.items()}
        assert found == self.versions
        assert snapshot.problems == {}

    def teardown(self) -> None:
        self.registry.close()
        self.stack.close()


RegistryMachine.TestCase.settings = settings(
    max_examples=15, stateful_step_count=20, deadline=None
)
TestRegistry = RegistryMachine.TestCase


@settings(max_examples=15, deadline=None)
@given(st.data())
def test_servers_that_hear_of_all_changes_in_any_order_end_alike(
    data: st.DataObject,
) -> None:
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        servers = [opened(folder / str(i)) for i in range(3)]
        for server in servers:
            stack.callback(server.close)
        for _ in range(data.draw(st.integers(1, 8))):
            server = data.draw(st.sampled_from(servers))
            name = data.draw(st.sampled_from(NAMES))
            speed = data.draw(st.sampled_from([None, *SPEEDS]))
            if speed is not None:
                server.put(name, vehicle_file(name, speed))
            elif name in server.snapshot.records:
                server.delete(name)
            if data.draw(st.booleans()):
                exchange(data.draw(st.sampled_from(servers)), server)
        # Whoever has the greatest version of a name wins, deletions included.
        newest: dict[str, Record] = {}
        for server in servers:
            for name, r in server.snapshot.records.items():
                if name not in newest or newest[name].version < r.version:
                    newest[name] = r
        # Every pair twice: what went the long way round has then arrived.
        for i, j in data.draw(st.permutations([(0, 1), (1, 2), (2, 0)])) * 2:
            exchange(servers[i], servers[j])
            exchange(servers[j], servers[i])
        assert len({server.snapshot.state for server in servers}) == 1
        prints = []
        for server in servers:
            assert dict(server.snapshot.records) == newest
            prints.append([server.snapshot.fingerprint(name) for name in NAMES])
        assert prints[0] == prints[1] == prints[2]


def exchange(to: Registry, source: Registry) -> None:
    """Let one server take over what another one has, as `sync` does."""
    digest = Digest.of(source.snapshot, to.snapshot.state)
    names = digest.newer_than(to.snapshot)
    for entry in Records.of(source.snapshot, names).records:
        assert to.merge(entry.value())
        assert not to.merge(entry.value())
    assert not Digest.of(source.snapshot, "").newer_than(to.snapshot)


def test_the_vehicles_of_the_start_cannot_be_changed(tmp_path: Path) -> None:
    fixed = space("agv")
    with contextlib.closing(Registry.open([fixed], tmp_path, grid=GRID)) as registry:
        for verb, arguments in (("put", (vehicle_file(),)), ("delete", ())):
            error = refusal(registry, "agv", *arguments, verb=verb)
            assert (error.code, error.field) == ("read_only", "vehicle")
        # Nor by another server, whose record is kept all the same.
        other = Record("agv", Version(5, "b" * 16), vehicle_file("agv", 9.0).decode())
        assert registry.merge(other)
        assert registry.fleet["agv"] is fixed
        assert "started with another" in registry.snapshot.problems["agv"]


def test_without_registration_nothing_can_be_changed(tmp_path: Path) -> None:
    with contextlib.closing(opened(tmp_path)) as registry:
        registry.put("agv", vehicle_file())
    stored = opened(tmp_path, registration=False)
    assert list(stored.fleet) == ["agv"]
    entry = Record("b", Version(5, "b" * 16), None)
    for registry in (stored, Registry([space("agv")])):
        assert not registry.takes_registrations
        assert refusal(registry, "b", vehicle_file("b")).code == "registration_off"
        assert refusal(registry, "agv", verb="delete").code == "registration_off"
        assert refusal(registry, entry, verb="merge").code == "registration_off"
    stored.close()


def test_registration_needs_a_store_and_room() -> None:
    with pytest.raises(
        InvalidInput, match="registration: on; registered vehicles need a"
    ):
        Registry(registration=True)
    with pytest.raises(InvalidInput, match="max_vehicles: 0"):
        Registry(max_vehicles=0)
    with pytest.raises(InvalidInput, match=r"fleet\[1\].name: 'agv' again"):
        Registry([space("agv"), space("agv")])


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("agv", b"", "mapping with name and wheels"),
        ("agv", b"\xff", "UTF-8"),
        ("agv", vehicle_file()[:-2], "vehicle"),
        ("agv", b'{"name": "agv", "wheels": []}', "wheels"),
        ("agv", vehicle_file("cart"), "name: 'cart'; the key says 'agv'"),
        ("agv", vehicle_file("agv", -1.0), "max_speed"),
        ("a/b", vehicle_file("a/b"), "vehicle: 'a/b'"),
        ("../agv", vehicle_file("../agv"), "vehicle: '../agv'"),
    ],
)
def test_what_is_no_vehicle_is_refused_and_nothing_stored(
    registry: Registry, tmp_path: Path, name: str, content: bytes, words: str
) -> None:
    with pytest.raises(InvalidInput, match=words):
        registry.put(name, content)
    assert registry.snapshot.records == {}
    assert not list((tmp_path / "store" / "vehicles").iterdir())


def test_a_vehicle_without_any_limit_is_refused(registry: Registry) -> None:
    with pytest.raises(InvalidVehicle):
        registry.put(
            "agv", b'{"name": "agv", "wheels": [{"id": "a", "type": "castor"}]}'
        )


def test_a_file_that_is_too_long_is_not_read(registry: Registry) -> None:
    with pytest.raises(InvalidMessage, match=f"at most {MAX_VEHICLE_BYTES}") as caught:
        registry.put("agv", b" " * (MAX_VEHICLE_BYTES + 1))
    assert caught.value.code == "too_large"


def test_yaml_and_json_of_one_vehicle_are_one_version(registry: Registry) -> None:
    first = registry.put("agv", vehicle_file())
    yaml = b"# the same\n" + vehicle_file().replace(b'"left"', b"left")
    assert registry.put("agv", yaml) == first


def test_an_expected_version_that_is_none_is_named(registry: Registry) -> None:
    for verb, arguments in (("put", (vehicle_file(),)), ("delete", ())):
        with pytest.raises(InvalidInput, match="expected_version: '7'"):
            getattr(registry, verb)("agv", *arguments, "7")


def test_there_is_room_for_so_many_names_and_no_more(tmp_path: Path) -> None:
    with contextlib.closing(opened(tmp_path, max_vehicles=2)) as registry:
        registry.put("a", vehicle_file("a"))
        registry.put("b", vehicle_file("b"))
        registry.delete("b")
        error = refusal(registry, "c", vehicle_file("c"))
        assert error.code == "registry_full"
        assert "2 names" in str(error)
        other = Record("c", Version(5, "b" * 16), None)
        assert refusal(registry, other, verb="merge").code == "registry_full"
        registry.put("b", vehicle_file("b", 2.0))


def test_data_sheets_take_so_much_memory_and_no_more(tmp_path: Path) -> None:
    most = 2 * sheet_bytes(space("a"))
    with contextlib.closing(opened(tmp_path, max_memory=most)) as registry:
        registry.put("a", vehicle_file("a"))
        registry.put("b", vehicle_file("b"))
        assert registry.snapshot.n_bytes == most
        error = refusal(registry, "c", vehicle_file("c"))
        assert error.code == "registry_full"
        assert str(most) in str(error)
        # A new version takes the place of the old one.
        registry.put("b", vehicle_file("b", 2.0))
        # What another server has is kept, but not used.
        other = Record("c", Version(5, "b" * 16), vehicle_file("c").decode())
        assert registry.merge(other)
        assert set(registry.fleet) == {"a", "b"}
        assert "bytes" in registry.snapshot.problems["c"]
        registry.delete("b")
        registry.put("c", vehicle_file("c", 2.0))
        assert set(registry.fleet) == {"a", "c"}
        assert registry.snapshot.n_bytes == most
    with contextlib.closing(opened(tmp_path, max_memory=most // 2)) as registry:
        assert set(registry.fleet) == {"a"}
        assert "bytes" in registry.snapshot.problems["c"]
    with pytest.raises(InvalidInput, match="max_memory: 0"):
        Registry(max_memory=0)


def test_what_is_asked_again_does_not_undo_what_followed(tmp_path: Path) -> None:
    with contextlib.closing(opened(tmp_path / "one")) as registry:
        first = registry.put("agv", vehicle_file(), request="mine")
        assert registry.put("agv", vehicle_file(), request="mine") == first
        theirs = registry.put("agv", vehicle_file("agv", 2.0), request="theirs")
        error = refusal(registry, "agv", vehicle_file(), None, "mine")
        assert (error.code, error.field) == ("conflict", "request")
        assert str(theirs.version) in str(error)
        # A removal likewise, and it does not undo a registration that followed.
        removed = registry.delete("agv", request="away")
        assert registry.delete("agv", request="away") == removed
        assert refusal(registry, "agv", vehicle_file(), None, "mine").code == "conflict"
        back = registry.put("agv", vehicle_file("agv", 0.5), request="back")
        error = refusal(registry, "agv", None, "away", verb="delete")
        assert error.code == "conflict"
        records = Records.of(registry.snapshot, ["agv"]).records
    # After a restart, and at another server, as well.
    with contextlib.closing(opened(tmp_path / "one")) as registry:
        assert refusal(registry, "agv", vehicle_file(), None, "mine").code == "conflict"
        assert registry.put("agv", vehicle_file("agv", 0.5), request="back") == back
    with contextlib.closing(opened(tmp_path / "two")) as registry:
        assert registry.merge(records[0].value())
        assert refusal(registry, "agv", vehicle_file(), None, "mine").code == "conflict"
        # A change of one's own is another request.
        registry.put("agv", vehicle_file(), request="mine-again")


def test_requests_are_known_where_two_servers_changed_a_vehicle(tmp_path: Path) -> None:
    with contextlib.closing(opened(tmp_path)) as registry:
        registry.put("agv", vehicle_file(), request="mine")
        (record,) = registry.snapshot.records.values()
        newer = Version(record.version.counter + 1, "b" * 16)
        content = vehicle_file("agv", 2.0).decode()
        assert registry.merge(Record("agv", newer, content, ("theirs",)))
        for name in ("mine", "theirs"):
            error = refusal(registry, "agv", vehicle_file("agv", 0.5), None, name)
            assert error.code == "conflict"


def test_few_requests_are_remembered_and_their_names_are_checked(
    registry: Registry,
) -> None:
    for i in range(MAX_REQUESTS + 3):
        registry.put("agv", vehicle_file("agv", 1.0 + i), request=f"r{i}")
    (record,) = registry.snapshot.records.values()
    assert record.requests == tuple(f"r{i + 3}" for i in range(MAX_REQUESTS))
    with pytest.raises(InvalidInput, match="request"):
        registry.put("agv", vehicle_file(), request="a/b")


def test_what_cannot_be_stored_is_not_registered(
    registry: Registry, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = registry.put("agv", vehicle_file())

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("services.registering.store.os.replace", full)
    error = refusal(registry, "agv", vehicle_file("agv", 2.0))
    assert error.code == "not_stored"
    assert "No space left" in str(error)
    assert registry.put("agv", vehicle_file()) == first


def test_a_version_that_none_could_follow_is_not_taken_over(registry: Registry) -> None:
    entry = Record("agv", Version(2**53 - 1, "b" * 16), None)
    assert "none could follow" in str(refusal(registry, entry, verb="merge"))


def test_a_wrong_clock_elsewhere_does_not_stop_changes(registry: Registry) -> None:
    year_3000 = Version(32503680000000, "b" * 16)
    assert registry.merge(Record("agv", year_3000, vehicle_file().decode()))
    change = registry.put("agv", vehicle_file("agv", 2.0), str(year_3000))
    assert change.version > year_3000


def test_a_record_that_cannot_be_read_here_takes_the_vehicle_out_of_use(
    registry: Registry, tmp_path: Path
) -> None:
    first = registry.put("agv", vehicle_file()).version
    newer = Version(first.counter + 1, "b" * 16)
    assert registry.merge(Record("agv", newer, '{"name": "agv", "hover": 1}'))
    for _ in range(2):
        assert "agv" not in registry.fleet
        assert registry.snapshot.records["agv"].version == newer
        assert "hover" in registry.snapshot.problems["agv"]
        registry.close()
        registry = opened(tmp_path / "store")
    assert registry.put("agv", vehicle_file()).version > newer
    assert registry.snapshot.problems == {}


def test_records_fill_messages_of_bounded_size(registry: Registry) -> None:
    from services.registering.registry_messages import MAX_RECORDS_BYTES

    long = "x" * (MAX_RECORDS_BYTES // 2 + 1)
    for name in NAMES:
        registry.merge(Record(name, Version(5, "b" * 16), long))
    names = list(NAMES)
    while names:
        (entry,) = Records.of(registry.snapshot, names).records
        assert isinstance(entry, RecordEntry)
        assert entry.value() == registry.snapshot.records[names.pop(0)]
    assert Records.of(registry.snapshot, ["nobody"]).records == ()


def test_of_many_writers_that_expect_the_same_version_one_wins(
    registry: Registry,
) -> None:
    version = str(registry.put("agv", vehicle_file()).version)
    barrier = threading.Barrier(8)

    def write(i: int) -> str:
        barrier.wait()
        try:
            registry.put("agv", vehicle_file("agv", 2.0 + i), version)
        except RegistrationRefused as error:
            return error.code
        return "won"

    with ThreadPoolExecutor(8) as pool:
        results = sorted(pool.map(write, range(8)))
    assert results == ["conflict"] * 7 + ["won"]


def test_listeners_hear_of_changes_until_they_do_not_want_to(
    registry: Registry,
) -> None:
    heard: list[Change] = []
    unsubscribe = registry.subscribe(heard.append)
    change = registry.put("agv", vehicle_file())
    assert heard == [change]
    unsubscribe()
    registry.delete("agv")
    assert heard == [change]


def test_a_closed_registry_can_be_read_and_not_changed(registry: Registry) -> None:
    registry.put("agv", vehicle_file())
    registry.close()
    assert list(registry.fleet) == ["agv"]
    assert refusal(registry, "b", vehicle_file("b")).code == "registration_off"
