"""Bytes that are nearly a message: seeded mutations of JSON and of Arrow streams."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
import pyarrow as pa

Rng: TypeAlias = np.random.Generator
Column: TypeAlias = "pa.Array[Any]"

DEEP = 3000
"""Levels of nesting: more than any reader of JSON takes."""
VALUES: list[Any] = [
    *(None, True, False, 0, -1, 1, 0.5, -0.0, 1e308, -1e308, 5e-324, 1e-12),
    *(2**31, 2**53 + 1, 2**63, -(2**63) - 1, 10**400, float("nan"), float("inf")),
    *("", " ", "0", "1e9", "NaN", "null", "é\u0000\u202e", "\ud800", "a" * 70, "../x"),
    *("differential", "x" * 3000, "😀" * 40, "*", "**", "a/b", "@sync", "%s%n{0}"),
    *([], {}, [[]], [{}], [0.0], [[0.0, 0.0, 0.0]], {"": None}, [None] * 50),
]
KEYS = ["", "name", "t", "poses", "twists", "omni_curve", "vehicle", "vehicles", "by"]
KEYS += ["request", "deadline", "__class__", "$ref", "wheels", "limits", "x\u0000"]
LITERALS = [b"NaN", b"-Infinity", b"1e999", b"-", b"[", b"{", b'"', b",", b"\\u", b"01"]
LITERALS += [
    b"\x00",
    b"\xff",
    b"\xed\xa0\x80",
    b"\xef\xbb\xbf",
    b"/*",
    b"'",
    b"9" * 400,
]


def choose(rng: Rng, things: list[Any]) -> Any:
    return things[int(rng.integers(len(things)))]


def other_bytes(rng: Rng, payload: bytes) -> bytes:
    """Flip, cut out, cut off, double or insert some bytes."""
    data = bytearray(payload)
    for _ in range(int(rng.integers(1, 4))):
        start, end = sorted(int(i) for i in rng.integers(0, len(data) + 1, 2))
        match int(rng.integers(7)):
            case 0 | 1 if data:
                data[start % len(data)] ^= 1 << int(rng.integers(8))
            case 2 if data:
                data[start % len(data)] = int(rng.integers(256))
            case 3:
                del data[start:]
            case 4:
                del data[start : min(end, start + 16)]
            case 5:
                data[start:start] = data[start : min(end, start + 200)]
            case _:
                data[start:start] = rng.bytes(int(rng.integers(1, 9)))
    return bytes(data)


def places(data: Any) -> list[tuple[Any, Any]]:
    """Return container and key of every value inside JSON data."""
    found: list[tuple[Any, Any]] = []
    stack = [data]
    while stack:
        inside = stack.pop()
        items = inside.items() if isinstance(inside, dict) else enumerate(inside)
        for key, value in items:
            found.append((inside, key))
            if isinstance(value, dict | list):
                stack.append(value)
    return found


def other_data(rng: Rng, data: Any) -> Any:
    """Change, drop, double, swap or rename some values of JSON data."""
    data = copy.deepcopy(data)
    for _ in range(int(rng.integers(1, 3))):
        known = places(data)
        if not known:
            return choose(rng, VALUES)
        inside, key = choose(rng, known)
        match int(rng.integers(8)):
            case 0:
                inside.pop(key)
            case 1 if isinstance(inside, dict):
                inside[choose(rng, KEYS)] = inside.pop(key)
            case 1:
                inside.insert(key, inside[key])
            case 2 if isinstance(inside, dict):
                inside[choose(rng, KEYS)] = choose(rng, VALUES)
            case 2:
                inside[:] = [copy.deepcopy(inside[key])] * int(rng.integers(1, 60))
            case 3:
                there, name = choose(rng, known)
                inside[key] = copy.deepcopy(there[name])
            case 4 if isinstance(inside[key], int | float):
                inside[key] *= float(choose(rng, [-1.0, 1e3, 1e-3, 1e12, 0.999]))
            case 5 if isinstance(inside[key], int | float):
                inside[key] = float(rng.normal(0.0, 10.0 ** rng.integers(-6, 7)))
            case _:
                inside[key] = copy.deepcopy(choose(rng, VALUES))
    return data


def other_text(rng: Rng, text: bytes) -> bytes:
    """Break the text of JSON: literals, keys that stand twice, nesting, encodings."""
    at = int(rng.integers(len(text) + 1))
    match int(rng.integers(6)):
        case 0:
            return text[:at] + bytes(choose(rng, LITERALS)) + text[at:]
        case 1 if text.startswith(b"{") and len(text) > 2:
            # The last of two equal keys wins, for us as for Python.
            return b"{" + text[1:].split(b":")[0] + b": 3, " + text[1:]
        case 2:
            brackets = choose(rng, [b"[", b'{"a":', b"[["])
            return text[:at] + bytes(brackets) * int(rng.integers(1, DEEP)) + text[at:]
        case 3:
            codec = choose(rng, ["utf-16", "utf-32", "utf-8-sig", "utf-7"])
            return text.decode(errors="replace").encode(codec)
        case 4:
            return b" \n" * int(rng.integers(500)) + text + b"\t"
        case _:
            return text + bytes(choose(rng, [b"x", b"{}", text, b"\x00"]))


def other_json(rng: Rng, data: Any) -> bytes:
    """Return a message in JSON with something wrong, or with other values."""
    kind = rng.random()
    if kind < 0.55:
        # What is no JSON, NaN, is written as Python does.
        return json.dumps(other_data(rng, data)).encode()
    text = json.dumps(data).encode()
    if kind < 0.8:
        return other_bytes(rng, text)
    if kind < 0.97:
        return other_text(rng, text)
    return bytes(choose(rng, [b"", b"null", b"[]", b"3", rng.bytes(100), b'"a"']))


def stream_of(table: pa.Table, metadata: bytes | None, **options: Any) -> bytes:
    """Return an IPC stream, written in other ways than ours are."""
    if metadata is not None:
        table = table.replace_schema_metadata({b"omniplan": metadata})
    sink = pa.BufferOutputStream()
    chunk = options.pop("chunk", None)
    written = pa.ipc.IpcWriteOptions(**options)
    with pa.ipc.new_stream(sink, table.schema, options=written) as writer:
        writer.write_table(table, max_chunksize=chunk)
    return sink.getvalue().to_pybytes()


def _other_lengths(rng: Rng, stream: bytes) -> bytes:
    """Write other numbers over what may be a length or an offset."""
    data = bytearray(stream)
    numbers = [0, -1, 1, 7, 8, 255, 2**15, 2**31 - 1, -(2**31), len(data)]
    for _ in range(int(rng.integers(1, 3))):
        size = int(choose(rng, [4, 8]))
        at = 4 * int(rng.integers(max(len(data) // 4 - 2, 1)))
        number = int(choose(rng, numbers)) * (1 if size == 4 else 2**20 + 1)
        data[at : at + size] = (number % 2 ** (8 * size)).to_bytes(size, "little")
    return bytes(data)


def _cast(rng: Rng, column: Column) -> Column:
    kinds = [pa.float16(), pa.float32(), pa.int8(), pa.uint64(), pa.string()]
    kinds += [pa.bool_(), pa.binary(), pa.large_string(), pa.date32(), pa.null()]
    kinds += [pa.decimal128(9, 2), pa.list_(pa.float64()), pa.duration("s")]
    kind = choose(rng, kinds)
    try:
        cast: Column = column.cast(kind)
    except pa.ArrowException:
        cast = pa.nulls(len(column), kind)
    return cast


def _with_value(rng: Rng, column: Column, value: object) -> Column:
    values = column.to_pylist()
    if values:
        values[int(rng.integers(len(values)))] = value
    try:
        changed: Column = pa.array(values, column.type)
    except (pa.ArrowException, OverflowError, TypeError):
        return column
    return changed


def other_table(rng: Rng, table: pa.Table) -> pa.Table:
    """Change columns, their types, names, order, and single values."""
    for _ in range(int(rng.integers(1, 3))):
        i = int(rng.integers(table.num_columns))
        name, column = table.column_names[i], table.column(i).combine_chunks()
        match int(rng.integers(8)):
            case 0:
                table = table.set_column(i, name, _cast(rng, column))
            case 1 if table.num_columns > 1:
                table = table.remove_column(i)
            case 2:
                table = table.append_column(choose(rng, [name, "x", "extra"]), column)
            case 3:
                names = [*table.column_names]
                names[i] = choose(rng, ["", "x", "t", "omega", "é\u0000", "n" * 500])
                table = table.rename_columns(names)
            case 4:
                order = rng.permutation(table.num_columns)
                table = table.select([int(k) for k in order])
            case 5:
                start, n = (int(k) for k in rng.integers(0, table.num_rows + 1, 2))
                table = table.slice(start, n)
            case 6:
                table = table.take(rng.permutation(table.num_rows))
            case _:
                values = [None, float("nan"), float("inf"), -1e300, 0.0, 3.5, "other"]
                changed = _with_value(rng, column, choose(rng, values))
                table = table.set_column(i, name, changed)
    return table


def other_arrow(rng: Rng, table: pa.Table, data: Any) -> bytes:
    """Return a request in Arrow with something wrong, or with other values."""
    metadata = json.dumps(data).encode()
    breaks: list[Callable[[], bytes]] = [
        lambda: other_bytes(rng, stream_of(table, metadata)),
        lambda: _other_lengths(rng, stream_of(table, metadata)),
        lambda: stream_of(table, other_json(rng, data)),
        lambda: stream_of(other_table(rng, table), metadata),
        lambda: stream_of(other_table(rng, table), None),
        lambda: stream_of(table, metadata, chunk=int(rng.integers(1, 40))),
        lambda: stream_of(table, metadata, compression=choose(rng, ["lz4", "zstd"])),
        lambda: stream_of(table, metadata) + rng.bytes(int(rng.integers(1, 20))),
        lambda: other_bytes(rng, stream_of(other_table(rng, table), metadata)),
        lambda: _other_lengths(rng, stream_of(other_table(rng, table), metadata)),
    ]
    return bytes(choose(rng, breaks)())
