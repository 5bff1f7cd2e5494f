"""Trajectories and twists as Arrow tables: the columns of their files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
from pyarrow import types

from configspace.errors import InvalidInput, Problem
from configspace.vehicle import Vehicle
from omniplan import InvalidTrajectory
from omniplan.inputs.table import (
    Table,
    columns_of,
    each_of,
    header_of,
    span,
)
from omniplan.path import Path
from omniplan.trajectory import Trajectory, timed
from services.errors import InvalidMessage

__all__ = [
    "TWIST",
    "table_of_trajectories",
    "table_of_twists",
    "trajectories_in",
    "twists_in",
]

IntArray = npt.NDArray[np.int64]
Twists = npt.NDArray[np.float32] | npt.NDArray[np.float64]

TWIST = ("vx", "vy", "omega")
"""The columns of twists."""
_SOURCE = "trajectories"


def table_of_trajectories(trajectories: Sequence[Trajectory | Path]) -> pa.Table:
    """Return trajectories of one form as one table in long form.

    Columns as in Parquet files, see `omniplan.inputs.table`; the vehicle of
    ``omni_curve`` trajectories is not among them.

    Raises
    ------
    InvalidInput
        If there are none, or their forms differ.
    """
    names, sizes, columns = columns_of([timed(one) for one in trajectories])
    # One byte for each row rather than four, where there are few names.
    kind: Any = next(
        k for k in (np.int8, np.int16, np.int32) if len(names) <= np.iinfo(k).max
    )
    owner = np.repeat(np.arange(len(names), dtype=kind), sizes)
    owners = pa.DictionaryArray.from_arrays(owner, pa.array(names, pa.string()))
    return pa.table({"trajectory": owners, **columns})


def trajectories_in(table: pa.Table, vehicle: Vehicle | None) -> Iterator[Trajectory]:
    """Yield the trajectories of a table in the order in which their names appear.

    Parameters
    ----------
    table : pyarrow.Table
    vehicle : Vehicle, optional
        Whose parameters ``kappa_n, beta, v_n`` are.

    Raises
    ------
    InvalidTrajectory
        With the rows and what is wrong in them; for a path, which cannot be judged.
    """
    header = header_of(_SOURCE, table.schema.names)
    for name in header.numbers:
        _check_number(table.schema.field(name))
    if header.is_named and not _is_text(table.schema.field("trajectory").type):
        kind = table.schema.field("trajectory").type
        raise InvalidMessage(Problem("column trajectory", f"{kind}", "texts"))
    if not table.num_rows:
        raise InvalidTrajectory(Problem(_SOURCE, "no rows", "at least two rows"))
    columns = {
        name: _column(table, name).to_numpy().astype(np.float64, copy=False)
        for name in header.numbers
    }
    names, code = ["trajectory"], np.zeros(table.num_rows, dtype=np.int64)
    if header.is_named:
        names, code = _named(_column(table, "trajectory"))
    place = _rows_between
    found = each_of(Table(_SOURCE, header, columns, names, code, place), vehicle)
    return map(timed, found)


def table_of_twists(twists: npt.ArrayLike) -> pa.Table:
    """Return (n, 3) twists as three columns; float32 stays so, all else is float64.

    Raises
    ------
    InvalidInput
        If the shape is another or they are no numbers.
    """
    try:
        rows = np.asarray(twists)
        if rows.dtype != np.float32:
            rows = rows.astype(np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidInput(
            Problem("twists", repr(twists)[:60], "numbers in m/s and rad/s")
        ) from error
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise InvalidInput(Problem("twists", f"shape {rows.shape}", "shape (n, 3)"))
    columns = np.ascontiguousarray(rows.T)
    return pa.table(dict(zip(TWIST, columns, strict=True)))


def twists_in(table: pa.Table) -> Twists:
    """Return the twists of a table, (n, 3).

    Raises
    ------
    InvalidMessage
        If the columns are others, or a value is missing or not finite; with its row.
    """
    if sorted(table.schema.names) != sorted(TWIST):
        given = f"columns {', '.join(table.schema.names)[:80]}"
        raise InvalidMessage(Problem("twists", given, ", ".join(TWIST)))
    for name in TWIST:
        _check_number(table.schema.field(name))
    kinds = {table.schema.field(name).type for name in TWIST}
    dtype = np.float32 if kinds == {pa.float32()} else np.float64
    rows = np.empty((table.num_rows, 3), dtype)
    for i, name in enumerate(TWIST):
        rows[:, i] = values = _column(table, name).to_numpy()
        if not np.isfinite(values).all():
            row = int(np.flatnonzero(~np.isfinite(values))[0])
            problem = Problem(f"twists[{row}], {name}", f"{values[row]}", "finite")
            raise InvalidMessage(problem)
    return rows


def _rows_between(first: int, last: int) -> str:
    return span("row", first, last)


def _is_text(kind: pa.DataType) -> bool:
    if isinstance(kind, pa.DictionaryType):
        kind = kind.value_type
    return types.is_string(kind) or types.is_large_string(kind)


def _check_number(field: pa.Field[Any]) -> None:
    if not (types.is_floating(field.type) or types.is_integer(field.type)):
        raise InvalidMessage(
            Problem(f"column {field.name}", f"{field.type}", "numbers")
        )


def _column(table: pa.Table, name: str) -> pa.ChunkedArray[Any]:
    """Return a column, or raise with its first row without a value."""
    column = table[name]
    if column.null_count:
        row = 0
        for chunk in column.chunks:
            if chunk.null_count:
                row += int(np.flatnonzero(chunk.is_null().to_numpy(False))[0])
                break
            row += len(chunk)
        raise InvalidMessage(
            Problem(f"row {row}, {name}", "no value", "a value in every row")
        )
    return column


def _named(column: pa.ChunkedArray[Any]) -> tuple[list[str], IntArray]:
    """Return the names in the order of their first rows, and which each row has.

    Only the names in use are taken out of a dictionary, and each once: an index of four
    bytes must not become a text of a megabyte.
    """
    number: dict[str | None, int] = {}
    codes = [np.zeros(0, dtype=np.int64)]
    for chunk in column.chunks:
        encoded: Any = chunk
        if not types.is_dictionary(chunk.type):
            encoded = chunk.dictionary_encode()
        index = encoded.indices.to_numpy(zero_copy_only=False)
        # Most rows have the name of the row before.
        starts = np.flatnonzero(np.diff(index, prepend=index[:1] - 1))
        used, first, inverse = np.unique(
            index[starts], return_index=True, return_inverse=True
        )
        texts = encoded.dictionary.take(pa.array(used)).to_pylist()
        code = np.empty(used.size, dtype=np.int64)
        for k in np.argsort(first):
            code[k] = number.setdefault(texts[k], len(number))
        codes.append(np.repeat(code[inverse], np.diff(starts, append=index.size)))
    if None in number:
        problem = Problem("column trajectory", "a name is null", "a text")
        raise InvalidMessage(problem)
    return [str(name) for name in number], np.concatenate(codes)
