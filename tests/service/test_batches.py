"""Batches over real sessions: the verdicts of the call, in parts, and their end."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence

import numpy as np
import pyarrow as pa
import pytest
from loopback import ANY_PORT, Ask, Fleet, Trajectories

import configspace
import omniplan
from omniplan import InvalidTrajectory, Path, Trajectory
from services import Client, RemoteError, Server, ServiceError, ServiceTimeout
from services.answering.calls import Calls
from services.asking import batch_client as batch_client_module
from services.protocol.arrow import ARROW, read_table, write_table
from services.protocol.arrow_motions import table_of_trajectories, table_of_twists
from services.protocol.batch_messages import BatchTwistsRequest, BatchValidateRequest
from services.protocol.messages import ErrorReply, decode, encode
from services.wire.exchange import Reply

pytestmark = pytest.mark.service


@pytest.fixture(scope="module")
def many() -> list[Trajectory]:
    """Of two forms, drivable and not."""
    t = np.linspace(0.0, 4.0, 6)
    found = []
    for i in range(40):
        speed = np.full(6, 0.05 * i)
        twists = np.stack([speed, 0.01 * (i % 3) * speed, 0.0 * t], axis=-1)
        form = Trajectory.from_twists if i % 4 else Trajectory.from_poses
        samples = twists if i % 4 else twists * t[:, None]
        found.append(form(t, samples, name=f"run {i}"))
    return found


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let requests hold few samples, so that a batch is cut into many."""
    monkeypatch.setattr(batch_client_module, "SAMPLES", 16)


class Held:
    """Holds the server between two parts of a batch."""

    def __init__(self) -> None:
        self.entered = threading.Semaphore(0)
        self.opened = threading.Event()
        self.n_parts = 0


@pytest.fixture
def held(monkeypatch: pytest.MonkeyPatch) -> Iterator[Held]:
    held = Held()

    def one_by_one(size: int, took: float, n_vehicles: int) -> int:
        held.n_parts += 1
        held.entered.release()
        assert held.opened.wait(30)
        return 1

    monkeypatch.setattr("services.answering.batches.FIRST", 1)
    monkeypatch.setattr("services.answering.batches._next_size", one_by_one)
    yield held
    held.opened.set()


def test_the_table_is_that_of_the_call(
    client: Client, fleet: Fleet, many: list[Trajectory]
) -> None:
    expected = omniplan.validate_many(many, fleet)
    table = client.validate_many(many, [space.name for space in fleet])
    assert table.schema.equals(expected.schema, check_metadata=True)
    assert table.to_pylist() == expected.to_pylist()


@pytest.mark.usefixtures("short")
def test_a_batch_of_many_requests_is_in_the_order_of_the_question(
    client: Client, server: Server, fleet: Fleet, many: list[Trajectory]
) -> None:
    told: list[tuple[int, int]] = []
    table = client.validate_many(many, progress=lambda *at: told.append(at))
    assert table.to_pylist() == omniplan.validate_many(many, fleet).to_pylist()
    assert server.health().keys["batch_validate"].codes["ok"] > 10
    assert told == sorted(told)
    assert told[-1] == (80, 80)
    assert {total for _, total in told} == {80}


def test_every_form_can_be_in_one_batch(client: Client, fleet: Fleet) -> None:
    vehicle = configspace.load_vehicle("ift-four-steered")
    t = [0.0, 1.0, 2.0]
    own = Trajectory.from_omni_curve(t, [0.0, 0.1, 0.2], [0, 0, 0], [0.1] * 3, vehicle)
    aside = Trajectory.from_poses(
        t, [[0, 0.1 * x, 0] for x in t], name="aside", reference_point=(0.2, 0.1)
    )
    twists = Trajectory.from_twists(t, [[0.1, 0, 0]] * 3, name="twists")
    batch = [own, aside, twists]
    table = client.validate_many(batch)
    assert table.to_pylist() == omniplan.validate_many(batch, fleet).to_pylist()


def test_unreachable_motions_are_permitted_where_asked_for(
    client: Client, fleet: Fleet, many: list[Trajectory]
) -> None:
    expected = omniplan.validate_many(many[:8], fleet, allow_unreachable=True)
    table = client.validate_many(many[:8], allow_unreachable=True)
    assert table.to_pylist() == expected.to_pylist()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_twists_are_checked_as_by_the_call(
    client: Client, fleet: Fleet, dtype: type[np.float32] | type[np.float64],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr(batch_client_module, "SAMPLES", 500)
    rng = np.random.default_rng(7)
    twists = rng.uniform(-1.5, 1.5, (9001, 3)).astype(dtype)
    told: list[tuple[int, int]] = []
    for space in fleet:
        found = client.check_twists(
            twists, space.name, progress=lambda *at: told.append(at)
        )
        expected = omniplan.check_twists(twists, space)
        np.testing.assert_array_equal(found, expected)
        assert 0 < found.sum() < found.size
    assert told[-1] == (9001, 9001)
    assert client.check_twists(np.zeros((0, 3)), "differential").shape == (0,)


def test_what_is_no_batch_is_not_even_sent(
    client: Client, trajectories: Trajectories
) -> None:
    path = Path.from_poses([[0, 0, 0], [1, 0, 0]])
    with pytest.raises(InvalidTrajectory, match="no times"):
        client.validate_many([path])  # type: ignore[list-item]
    with pytest.raises(configspace.InvalidInput, match="empty"):
        client.validate_many([])
    with pytest.raises(configspace.InvalidInput, match="more than once"):
        client.validate_many([trajectories[0]] * 2)
    with pytest.raises(configspace.InvalidInput, match="shape"):
        client.check_twists([[1, 2]], "differential")
    with pytest.raises(configspace.InvalidInput, match="timeout"):
        client.validate_many(trajectories, timeout=0.0)


def test_errors_of_the_server_end_the_batch(
    client: Client, trajectories: Trajectories
) -> None:
    with pytest.raises(RemoteError) as caught:
        client.validate_many(trajectories, ["nobody"])
    assert caught.value.code == "unknown_vehicle"
    with pytest.raises(RemoteError) as caught:
        client.check_twists([[0, 0, 0]], "nobody")
    assert caught.value.code == "unknown_vehicle"


def test_parts_come_before_the_whole_is_done(
    client: Client, held: Held, many: list[Trajectory]
) -> None:
    parts = client.verdicts(many[1:4])
    assert next(parts).num_rows == 2
    assert held.entered.acquire(timeout=30)
    assert held.n_parts == 1
    held.opened.set()
    assert sum(rows.num_rows for rows in parts) == 4


def test_closing_the_iterator_stops_the_server_between_two_parts(
    client: Client,
    server: Server,
    held: Held,
    many: list[Trajectory],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    cancelled = threading.Event()
    cancel = Calls.cancel

    def noticed(calls: Calls, name: str) -> bool:
        try:
            return cancel(calls, name)
        finally:
            cancelled.set()

    monkeypatch.setattr(Calls, "cancel", noticed)
    parts = client.verdicts([one for one in many if one.form == "twists"])
    next(parts)
    assert held.entered.acquire(timeout=30)
    parts.close()
    assert cancelled.wait(30)
    held.opened.set()
    wait_until_idle(server)
    assert held.n_parts == 1
    assert server.health().keys["batch_validate"].codes == {"cancelled": 1}


def wait_until_idle(server: Server) -> None:
    done = threading.Event()
    for _ in range(3000):
        health = server.health()
        if not health.running and "batch_validate" in health.keys:
            return
        done.wait(0.01)
    pytest.fail("the server still works")


def test_a_batch_has_an_overall_deadline(
    client: Client, held: Held, many: list[Trajectory]
) -> None:
    parts = client.verdicts(many[1:4], timeout=0.3)
    next(parts)
    with pytest.raises(ServiceTimeout, match=r"0\.3 s"):
        next(parts)


def test_a_part_must_come_within_the_timeout(
    server: Server, held: Held, many: list[Trajectory]
) -> None:
    with Client(server.endpoint, timeout=0.3, retry=False) as client:
        parts = client.verdicts(many[1:4])
        next(parts)
        with pytest.raises(ServiceTimeout, match=r"within 0\.3 s"):
            next(parts)


def test_a_batch_goes_on_where_its_server_has_gone(
    fleet: Fleet, held: Held, many: list[Trajectory]
) -> None:
    with (
        Server(fleet, listen=ANY_PORT, stop_within=0.0) as one,
        Server(fleet, listen=ANY_PORT, stop_within=0.0) as other,
        Client([one.endpoint, other.endpoint], timeout=30.0) as client,
    ):
        client.wait_until_ready()
        parts = client.verdicts(many[1:4])
        rows = next(parts).to_pylist()
        assert held.entered.acquire(timeout=30)
        used, spare = (one, other) if one.health().running else (other, one)
        closing = threading.Thread(target=used.close)
        closing.start()
        held.opened.set()
        for part in parts:
            rows += part.to_pylist()
        closing.join(30)
        assert not closing.is_alive()
        wait_until_idle(spare)
        # Asked once or again, it answers; a question may be repeated under load.
        assert spare.health().keys["batch_validate"].codes.keys() == {"ok"}
    assert rows == omniplan.validate_many(many[1:4], fleet).to_pylist()


def test_a_vehicle_that_changes_ends_the_batch(
    fleet: Fleet, held: Held, many: list[Trajectory], monkeypatch: pytest.MonkeyPatch
) -> None:
    digests = iter("abcdef")
    monkeypatch.setattr(
        "services.answering.batches.fleet_digest", lambda _: next(digests)
    )
    monkeypatch.setattr(batch_client_module, "SAMPLES", 6)
    held.opened.set()
    with (
        Server(fleet, listen=ANY_PORT) as server,
        Client(server.endpoint) as client,
        pytest.raises(ServiceError, match="has changed meanwhile"),
    ):
        client.validate_many(many[1:4])


def batch_payload(trajectories: Sequence[Trajectory], **parameters: object) -> bytes:
    request = BatchValidateRequest.model_validate(parameters)
    return write_table(table_of_trajectories(trajectories), encode(request))


def code_of(replies: list[Reply]) -> str:
    (reply,) = replies
    assert reply.is_error
    return decode(ErrorReply, reply.payload).code


def compressed() -> bytes:
    table = pa.table({name: np.zeros(10**6) for name in ("vx", "vy", "omega")})
    parameters = encode(BatchTwistsRequest(vehicle="differential"))
    table = table.replace_schema_metadata({b"omniplan": parameters})
    sink = pa.BufferOutputStream()
    options = pa.ipc.IpcWriteOptions(compression="zstd")
    with pa.ipc.new_stream(sink, table.schema, options=options) as writer:
        writer.write_table(table)
    return sink.getvalue().to_pybytes()


def test_hostile_arrow_is_refused_and_the_server_lives(
    ask: Ask, client: Client, trajectories: Trajectories
) -> None:
    good = batch_payload(trajectories)
    assert code_of(ask("batches/twists", compressed(), ARROW)) == "invalid_message"
    for size in (0, 1, 100, len(good) // 2, len(good) - 8):
        spoilt = good[:size] or None
        assert code_of(ask("batches/validate", spoilt, ARROW)) == "invalid_message"
    assert code_of(ask("batches/validate", b"{}", ARROW)) == "invalid_message"
    assert code_of(ask("batches/validate", good)) == "wrong_encoding"
    assert code_of(ask("validate", good, ARROW)) == "wrong_encoding"
    foreign = write_table(pa.table({"t": pa.array([[1.0]])}), b"{}")
    assert code_of(ask("batches/validate", foreign, ARROW)) == "invalid_message"
    bomb = pa.table({name: pa.array([0] * 2**21, pa.int8()) for name in "ab"})
    assert code_of(ask("batches/twists", write_table(bomb, b"{}"), ARROW)) == (
        "too_large"
    )
    assert client.validate_many(trajectories).num_rows == 6


def test_anybody_can_read_the_answer_as_arrow(
    ask: Ask, trajectories: Trajectories
) -> None:
    twists = table_of_twists([[0.0, 0.0, 0.0]])
    parameters = encode(BatchTwistsRequest(vehicle="differential"))
    (reply,) = ask("batches/twists", write_table(twists, parameters), ARROW)
    assert reply.encoding == ARROW
    assert read_table(reply.payload, 1).to_pylist() == [{"permitted": True}]
