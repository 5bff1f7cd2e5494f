"""Whatever bytes are read as Arrow: a table that is sound, or an error."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.errors import InvalidMessage
from services.protocol.arrow import MAX_COLUMNS, MAX_PIECES, parameters_of, read_table
from services.protocol.arrow import write_table as written

END = b"\xff\xff\xff\xff\0\0\0\0"
TABLE = pa.table(
    {
        "trajectory": pa.array(["a", "a", "b", "b"]).dictionary_encode(),
        "t": np.arange(4.0),
        "name": pa.array(["x", "", "y", "z"]),
    }
)


def stream(table: pa.Table, **options: Any) -> bytes:
    """Return a table as others may write it."""
    sink = pa.BufferOutputStream()
    options_ = pa.ipc.IpcWriteOptions(**options)
    with pa.ipc.new_stream(sink, table.schema, options=options_) as writer:
        writer.write_table(table)
    return sink.getvalue().to_pybytes()


def test_a_table_and_its_parameters_come_back_equal() -> None:
    back = read_table(written(TABLE, b'{"a": 1}'), 4)
    assert back.equals(TABLE)
    assert parameters_of(back) == b'{"a": 1}'
    assert parameters_of(TABLE) == b""
    (batch,) = TABLE.to_batches()
    assert written(batch, b"{}") == written(TABLE, b"{}")


def test_a_table_without_rows_is_one() -> None:
    assert read_table(written(TABLE.slice(0, 0), b""), 1).num_rows == 0


def test_a_truncated_stream_is_refused_wherever_it_ends() -> None:
    payload = written(TABLE, b"{}")
    for size in range(len(payload)):
        with pytest.raises(InvalidMessage) as caught:
            read_table(payload[:size], 4)
        assert caught.value.code == "invalid_message"


def test_a_stream_cut_between_two_pieces_is_refused() -> None:
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, TABLE.schema) as writer:
        writer.write_table(TABLE, max_chunksize=2)
        first = sink.tell()
        writer.write_table(TABLE.slice(0, 0))
    payload = sink.getvalue().to_pybytes()
    assert read_table(payload, 4).num_rows == 4
    with pytest.raises(InvalidMessage, match="end marker"):
        read_table(payload[:first], 4)


@pytest.mark.parametrize("codec", ["lz4", "zstd"])
def test_a_compressed_bomb_is_refused_unopened(codec: str) -> None:
    zeros = pa.table({"t": np.zeros(1 << 22)})
    payload = stream(zeros, compression=codec)
    assert len(payload) < zeros.nbytes / 100
    before = pa.total_allocated_bytes()
    with pytest.raises(InvalidMessage, match="compressed"):
        read_table(payload, 1 << 30)
    assert pa.total_allocated_bytes() - before < 1 << 16


def test_a_compressed_dictionary_is_refused() -> None:
    names = pa.array(["x" * 1000] * 4).dictionary_encode()
    rows = pa.table({"trajectory": names})
    with pytest.raises(InvalidMessage, match="compressed"):
        read_table(stream(rows, compression="zstd"), 4)


def test_too_many_rows_are_too_large() -> None:
    with pytest.raises(InvalidMessage, match="4 rows") as caught:
        read_table(written(TABLE, b""), 3)
    assert caught.value.code == "too_large"


def test_too_many_pieces_are_refused() -> None:
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, TABLE.schema) as writer:
        for _ in range(MAX_PIECES + 1):
            writer.write_table(TABLE.slice(0, 1))
    with pytest.raises(InvalidMessage, match="257 record batch messages"):
        read_table(sink.getvalue().to_pybytes(), 10**6)


FOREIGN: dict[str, pa.Table] = {
    "a list": pa.table({"t": pa.array([[1.0], [2.0]])}),
    "a struct": pa.table({"t": pa.array([{"x": 1.0}])}),
    "nulls only": pa.table({"t": pa.nulls(3)}),
    "bytes": pa.table({"trajectory": pa.array([b"a"])}),
    "dates": pa.table({"t": pa.array([0], pa.timestamp("s"))}),
    "views": pa.table({"trajectory": pa.array(["a"], pa.string_view())}),
    "runs": pa.table(
        {
            "t": pa.RunEndEncodedArray.from_arrays(
                pa.array([10**6], pa.int32()), pa.array([1.0])
            )
        }
    ),
    "dictionary of numbers": pa.table({"t": pa.array([1.0]).dictionary_encode()}),
    "decimals": pa.table({"t": pa.array([1], pa.decimal128(38))}),
}


@pytest.mark.parametrize("table", FOREIGN.values(), ids=FOREIGN)
def test_columns_other_than_numbers_and_texts_are_refused(table: pa.Table) -> None:
    with pytest.raises(InvalidMessage, match=r"column .*numbers or texts"):
        read_table(stream(table), 10**9)


def test_too_many_columns_are_refused() -> None:
    wide = pa.table({f"c{i}": [0.0] for i in range(MAX_COLUMNS + 1)})
    with pytest.raises(InvalidMessage, match="at most 16"):
        read_table(stream(wide), 10)


def deep(n: int) -> pa.Table:
    kind: pa.DataType = pa.float64()
    for _ in range(n):
        kind = pa.list_(kind)
    return pa.table({"t": pa.array([], kind)})


STRANGE: dict[str, Callable[[], bytes]] = {
    "nothing": lambda: b"",
    "only the end": lambda: END,
    "zeros": lambda: bytes(64) + END,
    "text": lambda: b"trajectory,t\n" + END,
    "metadata of 2 GiB": lambda: b"\xff\xff\xff\xff\xf0\xff\xff\x7f" + bytes(64) + END,
    "metadata below zero": lambda: b"\xff\xff\xff\xff\xfb\xff\xff\xff" + END,
    "a file instead of a stream": lambda: b"ARROW1\0\0" + stream(TABLE) + b"ARROW1",
    "schema twice": lambda: stream(TABLE)[:-8] + stream(TABLE),
    "very deep": lambda: stream(deep(50)),
    "a name that is no text": lambda: stream(TABLE).replace(b"name", b"n\xffme"),
}


@pytest.mark.parametrize("payload", STRANGE.values(), ids=STRANGE)
def test_what_is_no_stream_is_refused(payload: Callable[[], bytes]) -> None:
    with pytest.raises(InvalidMessage):
        read_table(payload(), 10**6)


def test_lengths_and_indices_that_point_outside_are_refused() -> None:
    payload = written(TABLE, b"")
    # Every aligned place of eight bytes, as a length: none may be believed.
    claims = 0
    for place in range(0, len(payload) - 8, 8):
        for claim in (-1, 1 << 20, 1 << 40, 1 << 62):
            changed = bytearray(payload)
            struct.pack_into("<q", changed, place, claim)
            claims += not is_sound(bytes(changed))
    assert claims > 50


@given(st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), min_size=1))
def test_changed_bytes_are_refused_or_read_safely(
    changes: list[tuple[int, int]],
) -> None:
    changed = bytearray(written(TABLE, b"{}"))
    for place, value in changes:
        changed[place % len(changed)] = value
    is_sound(bytes(changed))


def is_sound(payload: bytes) -> bool:
    """Return whether a payload is read; every value of it can be looked at then."""
    try:
        table = read_table(payload, 10**6)
    except InvalidMessage:
        return False
    assert len(table.to_pylist()) == table.num_rows
    return True
