"""Batches without zenoh: parts, their order, and that they are the verdicts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pyarrow as pa
import pytest

import configspace
import omniplan
from configspace import InvalidInput, PermissibleSpace
from omniplan import Trajectory
from services.answering import batches
from services.answering.answers import Answer, Parts
from services.answering.calls import Call, Calls
from services.errors import CallStopped, InvalidMessage
from services.protocol.arrow import ARROW, parameters_of, read_table, write_table
from services.protocol.arrow_motions import table_of_trajectories, table_of_twists
from services.protocol.batch_messages import (
    BatchPart,
    BatchTwistsRequest,
    BatchValidateRequest,
)
from services.protocol.messages import RequestLimits, decode, encode

LIMITS = RequestLimits(max_batch_samples=300)


@pytest.fixture(scope="module")
def fleet() -> list[PermissibleSpace]:
    grid = configspace.Grid(40, 72)
    return [
        configspace.build_space(configspace.load_vehicle(name), grid, cache=False)
        for name in ("ift-four-steered", "differential")
    ]


@pytest.fixture(scope="module")
def trajectories() -> list[Trajectory]:
    t = np.arange(5.0)
    zero = np.zeros(5)
    return [
        Trajectory.from_poses(
            t,
            np.stack([0.1 * i * t, 0.02 * t * (i % 2), zero], axis=-1),
            name=f"run {i}",
        )
        for i in range(20)
    ]


@pytest.fixture(autouse=True)
def _small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the first part be one trajectory for two vehicles."""
    monkeypatch.setattr(batches, "FIRST", 10)


def chooser(fleet: Sequence[PermissibleSpace]) -> batches.Choose:
    by_name = {space.name: space for space in fleet}
    return lambda names: [by_name[name] for name in names or by_name]


def question(trajectories: Sequence[Trajectory], **parameters: object) -> bytes:
    request = BatchValidateRequest.model_validate(parameters)
    return write_table(table_of_trajectories(trajectories), encode(request))


def parts_of(parts: Parts) -> list[tuple[BatchPart, pa.Table]]:
    """Return all parts; those that only give way are left out."""
    answers: list[Answer | None] = []
    while True:
        try:
            answers.append(next(parts))
        except StopIteration as end:
            answers.append(end.value)
            break
    found = []
    for answer in answers:
        if answer is not None:
            assert answer.encoding == ARROW
            table = read_table(answer.payload, 10**6)
            part = decode(BatchPart, parameters_of(table))
            found.append((part, table.replace_schema_metadata(None)))
    return found


def test_the_parts_are_the_verdicts_of_the_call_in_their_order(
    fleet: list[PermissibleSpace], trajectories: list[Trajectory]
) -> None:
    call = Call.local()
    payload = question(trajectories)
    found = parts_of(batches.validate_batch(payload, chooser(fleet), LIMITS, call))
    table = pa.concat_tables([rows for _, rows in found])
    expected = omniplan.validate_many(trajectories, fleet)
    assert table.to_pylist() == expected.to_pylist()
    assert call.n_samples == 100
    assert len(found) > 1
    done = 0
    for number, (part, rows) in enumerate(found):
        assert (part.sequence, part.first) == (number, done)
        done += rows.num_rows
        assert (part.done, part.total) == (done, 40)
        assert part.is_last == (number == len(found) - 1)
        assert part.fleet == batches.fleet_digest(fleet)
    asked = int(expected.schema.metadata[b"omniplan.asked"])
    assert sum(part.asked for part, _ in found) == asked


def test_only_the_vehicles_asked_for_are_judged(
    fleet: list[PermissibleSpace], trajectories: list[Trajectory]
) -> None:
    payload = question(trajectories, vehicles=["differential"])
    found = parts_of(
        batches.validate_batch(payload, chooser(fleet), LIMITS, Call.local())
    )
    names = {row["vehicle"] for _, rows in found for row in rows.to_pylist()}
    assert names == {"differential"}


def test_parameters_of_a_vehicle_are_judged_as_its_own(
    fleet: list[PermissibleSpace],
) -> None:
    vehicle = fleet[0].vehicle
    assert vehicle is not None
    own = Trajectory.from_omni_curve(
        [0, 1, 2], [0, 0.1, 0.2], [0, 0.1, 0.2], [0.1] * 3, vehicle
    )
    payload = question([own], parameters_of=vehicle.model_dump(mode="json"))
    ((_, rows),) = parts_of(
        batches.validate_batch(payload, chooser(fleet), LIMITS, Call.local())
    )
    assert rows.to_pylist() == omniplan.validate_many([own], fleet).to_pylist()


def test_nothing_is_sent_where_a_later_trajectory_is_unusable(
    fleet: list[PermissibleSpace], trajectories: list[Trajectory]
) -> None:
    table = table_of_trajectories(trajectories)
    spoilt = table["x"].to_numpy().copy()
    spoilt[-1] = np.nan
    table = table.set_column(table.schema.get_field_index("x"), "x", pa.array(spoilt))
    payload = write_table(table, encode(BatchValidateRequest()))
    parts = batches.validate_batch(payload, chooser(fleet), LIMITS, Call.local())
    with pytest.raises(InvalidInput, match=r"run 19.*row 4, x: nan"):
        next(answer for answer in parts if answer is not None)


def test_too_many_samples_are_too_large(
    fleet: list[PermissibleSpace], trajectories: list[Trajectory]
) -> None:
    limits = RequestLimits(max_batch_samples=99)
    parts = batches.validate_batch(
        question(trajectories), chooser(fleet), limits, Call.local()
    )
    with pytest.raises(InvalidMessage) as caught:
        next(parts)
    assert caught.value.code == "too_large"


def test_metadata_that_are_no_request_are_refused(
    fleet: list[PermissibleSpace], trajectories: list[Trajectory]
) -> None:
    table = table_of_trajectories(trajectories)
    for parameters in (b"", b"{}}", b'{"vehicle": "differential"}'):
        payload = write_table(table, parameters)
        parts = batches.validate_batch(payload, chooser(fleet), LIMITS, Call.local())
        with pytest.raises(InvalidMessage, match="BatchValidateRequest"):
            next(parts)


def test_a_cancelled_batch_is_not_begun(
    fleet: list[PermissibleSpace], trajectories: list[Trajectory]
) -> None:
    calls = Calls()
    calls.cancel("mine")
    payload = question(trajectories, request="mine")
    call = Call(calls, "batches/validate")
    with pytest.raises(CallStopped, match="cancelled"):
        next(batches.validate_batch(payload, chooser(fleet), LIMITS, call))


def test_twists_are_told_in_parts_as_the_call_does(
    fleet: list[PermissibleSpace], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(batches, "TWISTS", 64)
    twists = np.random.default_rng(3).uniform(-1.5, 1.5, (200, 3)).astype(np.float32)
    request = BatchTwistsRequest(vehicle="differential")
    payload = write_table(table_of_twists(twists), encode(request))
    found = parts_of(
        batches.judge_twists(payload, chooser(fleet), LIMITS, Call.local())
    )
    assert [part.done for part, _ in found] == [64, 128, 192, 200]
    assert [part.is_last for part, _ in found] == [False, False, False, True]
    permitted = pa.concat_tables([rows for _, rows in found])["permitted"].to_numpy()
    np.testing.assert_array_equal(permitted, omniplan.check_twists(twists, fleet[1]))


def test_no_twists_have_an_answer_without_rows(fleet: list[PermissibleSpace]) -> None:
    request = BatchTwistsRequest(vehicle="differential")
    payload = write_table(table_of_twists(np.zeros((0, 3))), encode(request))
    ((part, rows),) = parts_of(
        batches.judge_twists(payload, chooser(fleet), LIMITS, Call.local())
    )
    assert (part.total, part.is_last, rows.num_rows) == (0, True, 0)


def test_the_digest_tells_other_vehicles_and_another_order(
    fleet: list[PermissibleSpace],
) -> None:
    digests = {batches.fleet_digest(f) for f in (fleet, fleet[:1], fleet[::-1], [])}
    assert len(digests) == 4
