"""Trajectories as CSV files; lines that start with ``#`` are comments.

pyarrow parses the columns. A file that it does not take whole is read again line by
line, to say where the mistake stands.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import numpy.typing as npt

from configspace import Problem
from configspace.files import reason_of
from omniplan.errors import InvalidTrajectory
from omniplan.inputs.table import Header, Table, header_of, merged, span

__all__ = ["read_csv", "write_csv"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

COMMENT = re.compile(rb"^[ \t]*#[^\r\n]*", re.MULTILINE)


def read_csv(path: FilePath) -> Table:
    """Return the table of a CSV file.

    Raises
    ------
    InvalidTrajectory
        With the line of the first mistake.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InvalidTrajectory(
            Problem(f"{path}", reason_of(error), "a readable UTF-8 CSV file")
        ) from error
    # Comments become empty lines, so that lines keep their numbers.
    data = COMMENT.sub(b"", data.removeprefix(b"\xef\xbb\xbf"))
    plain = data.count(b"\r") == data.count(b"\r\n")
    table = _parsed(path, data) if plain else None
    return table or _read_slowly(path, data)


def _parsed(path: FilePath, data: bytes) -> Table | None:
    """Return the table, or None if pyarrow does not take the file."""
    import pyarrow as pa
    from pyarrow import csv as arrow_csv

    head = re.search(rb"[^\r\n]+", data)
    if head is None:
        return None
    try:
        names = [name.strip() for name in next(csv.reader([head[0].decode()]))]
        header = header_of(f"{path}", names)
        types = {name: pa.float64() for name in header.numbers}
        source: Any = pa.py_buffer(data[head.end() :])
        parsed = arrow_csv.read_csv(
            source,
            read_options=arrow_csv.ReadOptions(column_names=names),
            convert_options=arrow_csv.ConvertOptions(
                column_types=types | {"trajectory": pa.large_string()}, null_values=[]
            ),
        )
    except (pa.ArrowException, UnicodeDecodeError, csv.Error):
        return None
    if not parsed.num_rows:
        return None
    columns = {name: parsed[name].to_numpy() for name in header.numbers}
    if header.is_named:
        encoded = parsed["trajectory"].combine_chunks().dictionary_encode()
        names, code = merged(
            [str(name) for name in encoded.dictionary.to_pylist()],
            encoded.indices.to_numpy().astype(np.int64),
            path.stem,
        )
    else:
        names, code = [path.stem], np.zeros(parsed.num_rows, dtype=np.int64)
    return Table(f"{path}", header, columns, names, code, _lines(data))


def _lines(data: bytes) -> Callable[[int, int], str]:
    """Return words for rows, by the numbers of their lines."""

    def place(first: int, last: int) -> str:
        text = np.frombuffer(data, dtype=np.uint8)
        ends = np.append(np.flatnonzero(text == ord("\n")), text.size)
        starts = np.insert(ends[:-1] + 1, 0, 0)
        size = ends - starts
        size -= (size > 0) & (text[np.maximum(ends - 1, 0)] == ord("\r"))
        line = np.flatnonzero(size > 0)[1:] + 1  # without the header, from 1
        return span("line", int(line[first]), int(line[last]))

    return place


def _read_slowly(path: FilePath, data: bytes) -> Table:
    """Return the table line by line, or raise with the first line that is wrong."""
    try:
        lines = data.decode().splitlines()
    except UnicodeDecodeError as error:
        raise InvalidTrajectory(
            Problem(f"{path}", reason_of(error), "a readable UTF-8 CSV file")
        ) from error
    reader = csv.reader(lines)
    numbers: list[list[float]] = []
    names: list[str] = []
    places: list[int] = []
    try:
        head = next((row for row in reader if row), None)
        if head is None:
            raise InvalidTrajectory(Problem(f"{path}", "no header", "a line of names"))
        head = [name.strip() for name in head]
        header = header_of(f"{path}", head)
        for row in reader:
            if row:
                numbers.append(_numbers(path, reader.line_num, row, head, header))
                named = row[head.index("trajectory")] if header.is_named else ""
                names.append(named.strip() or path.stem)
                places.append(reader.line_num)
    except csv.Error as error:
        raise InvalidTrajectory(
            Problem(f"{path}: line {reader.line_num}", str(error), "a CSV file")
        ) from error
    if not numbers:
        raise InvalidTrajectory(Problem(f"{path}", "no rows", "at least two rows"))
    columns = dict(zip(header.numbers, np.array(numbers).T, strict=True))
    labels, code = merged(names, np.arange(len(names)), path.stem)
    return Table(
        f"{path}",
        header,
        columns,
        labels,
        code,
        lambda first, last: span("line", places[first], places[last]),
    )


def _numbers(
    path: FilePath, line: int, row: list[str], head: list[str], header: Header
) -> list[float]:
    if len(row) != len(head):
        raise InvalidTrajectory(
            Problem(
                f"{path}: line {line}",
                f"{len(row)} values",
                f"{len(head)}, as the header has",
            )
        )
    values = []
    for name in header.numbers:
        text = row[head.index(name)]
        try:
            values.append(float(text))
        except ValueError as error:
            raise InvalidTrajectory(
                Problem(f"{path}: line {line}, {name}", repr(text)[:60], "a number")
            ) from error
    return values


def write_csv(
    path: FilePath, names: list[str], sizes: IntArray, columns: dict[str, FloatArray]
) -> None:
    """Write a table to a CSV file."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["trajectory", *columns])
        owners = (name for name, n in zip(names, sizes, strict=True) for _ in range(n))
        texts = [map(_text, columns[key]) for key in columns]
        writer.writerows(zip(owners, *texts, strict=True))


def _text(value: float) -> str:
    """Return a number with all its digits: a plan uses its limits up to the last."""
    short = f"{value:.9g}"
    return short if float(short) == value else repr(float(value))
