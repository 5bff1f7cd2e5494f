"""Arrow: tables out of bytes that nobody vouches for, and bytes out of tables.

A payload is one IPC stream, uncompressed and closed by its end marker, so that one cut
off between two of its pieces is noticed. Reading takes no copy: what is not in the
payload cannot be asked for, whatever lengths it claims. The schema is looked at before
any piece is, and every piece is checked in full before a value is.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping

import pyarrow as pa
from pyarrow import ipc, types

from configspace.errors import Problem
from services.errors import InvalidMessage

__all__ = ["ARROW", "parameters_of", "read_table", "write_table"]

ARROW = "application/vnd.apache.arrow.stream"
"""Encoding of an Arrow IPC stream."""
MAX_COLUMNS = 16
MAX_PIECES = 256
"""More record batches, or more dictionaries, are refused: each has its cost."""

_KEY = b"omniplan"
_END = b"\xff\xff\xff\xff\0\0\0\0"
_ALLOWED = "an Arrow IPC stream, uncompressed, with its end marker"
# Where the fields of Arrow's flatbuffers stand: format/Message.fbs.
_HEADER_TYPE, _HEADER = 1, 2
_DICTIONARY_BATCH, _RECORD_BATCH = 2, 3
_COMPRESSION = 3
_DATA_OF_DICTIONARY = 1


def write_table(table: pa.Table | pa.RecordBatch, parameters: bytes) -> bytes:
    """Return a table as an IPC stream with JSON in the metadata of its schema."""
    schema = table.schema.with_metadata({_KEY: parameters})
    sink = pa.BufferOutputStream()
    with ipc.new_stream(sink, schema) as writer:
        if isinstance(table, pa.RecordBatch):
            writer.write_batch(table.replace_schema_metadata(schema.metadata))
        else:
            writer.write_table(table)
    return sink.getvalue().to_pybytes()


def parameters_of(table: pa.Table) -> bytes:
    """Return the JSON in the metadata of a table's schema; empty if there is none."""
    metadata: Mapping[bytes, bytes] = table.schema.metadata or {}
    return metadata.get(_KEY, b"")


def read_table(payload: bytes, max_rows: int) -> pa.Table:
    """Return the table of an IPC stream, checked in full.

    Columns are numbers, booleans or texts (these also as dictionaries), without nulls
    in columns that say so; nothing nested.

    Parameters
    ----------
    payload : bytes
    max_rows : int

    Raises
    ------
    InvalidMessage
        If it is none, truncated, compressed, has other columns, or indices, offsets or
        lengths that point outside; with code ``too_large`` for too many rows.
    """
    buffer = pa.py_buffer(payload)
    try:
        _check_messages(payload, buffer)
        with ipc.open_stream(buffer) as reader:
            _check_schema(reader.schema)
            return _checked_table(reader, max_rows)
    except (pa.ArrowException, OSError, EOFError, UnicodeError, struct.error) as error:
        # The first line of these errors says what is wrong.
        given = (str(error).splitlines() or [type(error).__name__])[0]
        raise InvalidMessage(Problem("payload", given[:200], _ALLOWED)) from error


def _check_messages(payload: bytes, buffer: pa.Buffer) -> None:
    """Raise unless a stream has few pieces, none of them compressed."""
    if not payload.endswith(_END):
        raise InvalidMessage(Problem("payload", "no end marker", _ALLOWED))
    kinds = []
    for kind, metadata in _messages(buffer):
        kinds.append(kind)
        if kind == "schema" and len(kinds) == 1:
            continue
        if kind not in ("record batch", "dictionary") or len(kinds) == 1:
            raise InvalidMessage(Problem("payload", f"a message {kind!r}", _ALLOWED))
        if _is_compressed(metadata):
            raise InvalidMessage(Problem("payload", "compressed", _ALLOWED))
    for kind in ("record batch", "dictionary"):
        if kinds.count(kind) > MAX_PIECES:
            given = f"{kinds.count(kind)} {kind} messages"
            raise InvalidMessage(Problem("payload", given, f"at most {MAX_PIECES}"))


def _messages(buffer: pa.Buffer) -> Iterator[tuple[str, bytes]]:
    """Yield kind and flatbuffer of every message of a stream; bodies stay unread."""
    reader = ipc.MessageReader.open_stream(buffer)
    while True:
        try:
            message = reader.read_next_message()
        except StopIteration:
            return
        yield message.type, message.metadata.to_pybytes()


def _is_compressed(metadata: bytes) -> bool:
    """Return whether a record batch or dictionary says that its buffers are.

    A small compressed buffer may stand for a large one, and pyarrow offers no bound.
    """
    (message,) = struct.unpack_from("<I", metadata, 0)
    (kind,) = struct.unpack_from(
        "<B", metadata, _place(metadata, message, _HEADER_TYPE)
    )
    batch = _table(metadata, message, _HEADER)
    if kind == _DICTIONARY_BATCH:
        batch = _table(metadata, batch, _DATA_OF_DICTIONARY)
    elif kind != _RECORD_BATCH:
        raise struct.error("header of unknown type")
    return _place(metadata, batch, _COMPRESSION, is_optional=True) != 0


def _place(
    metadata: bytes, table: int, field: int, *, is_optional: bool = False
) -> int:
    """Return where a field of a flatbuffer's table stands; 0 if it is left out."""
    (back,) = struct.unpack_from("<i", metadata, _inside(table))
    (size,) = struct.unpack_from("<H", metadata, _inside(table - back))
    slot = 4 + 2 * field
    offset = 0
    if slot + 2 <= size:
        (offset,) = struct.unpack_from("<H", metadata, _inside(table - back + slot))
    if not offset and not is_optional:
        raise struct.error("a header lacks a field")
    return table + offset if offset else 0


def _table(metadata: bytes, table: int, field: int) -> int:
    """Return where the table stands that a field points to."""
    place = _place(metadata, table, field)
    (offset,) = struct.unpack_from("<I", metadata, place)
    return _inside(place + int(offset))


def _inside(place: int) -> int:
    # A negative place would be counted from the end.
    if place < 0:
        raise struct.error("an offset points outside")
    return place


def _check_schema(schema: pa.Schema) -> None:
    """Raise unless the columns are few and plain; also for names that are no text."""
    if len(schema) > MAX_COLUMNS:
        problem = Problem("columns", f"{len(schema)}", f"at most {MAX_COLUMNS}")
        raise InvalidMessage(problem)
    problems = [
        Problem(f"column {name[:40]!r}", str(kind)[:60], "numbers or texts")
        for name, kind in zip(schema.names, schema.types, strict=True)
        if not _is_plain(kind)
    ]
    if problems:
        raise InvalidMessage(problems)


def _is_plain(kind: pa.DataType) -> bool:
    if isinstance(kind, pa.DictionaryType):
        return _is_text(kind.value_type)
    is_number = types.is_floating(kind) or types.is_integer(kind)
    return is_number or types.is_boolean(kind) or _is_text(kind)


def _is_text(kind: pa.DataType) -> bool:
    return types.is_string(kind) or types.is_large_string(kind)


def _checked_table(reader: pa.RecordBatchReader, max_rows: int) -> pa.Table:
    pieces = []
    n_rows = 0
    for piece in reader:
        # Lengths, offsets, indices and texts: up to here they are claims.
        piece.validate(full=True)
        n_rows += piece.num_rows
        if n_rows > max_rows:
            raise InvalidMessage(
                Problem("payload", f"{n_rows} rows", f"at most {max_rows}"),
                code="too_large",
            )
        pieces.append(piece)
    return pa.Table.from_batches(pieces, reader.schema)
