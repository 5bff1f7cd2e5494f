"""Trajectories as Parquet files: the columns of `trajectory_table`."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from configspace import Problem
from configspace.files import reason_of
from omniplan.errors import InvalidTrajectory
from omniplan.inputs.table import Table, header_of, merged, span

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = ["read_parquet", "write_parquet"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


def read_parquet(path: FilePath) -> Table:
    """Return the table of a Parquet file.

    Raises
    ------
    InvalidTrajectory
        If the file is none or damaged, or with the column and row of a mistake.
    """
    import pyarrow as pa
    from pyarrow import parquet

    try:
        with parquet.ParquetFile(path, memory_map=True) as file:
            schema = file.schema_arrow
            header = header_of(f"{path}", schema.names)
            _check_types(path, schema)
            table = file.read()
    except (pa.ArrowException, OSError, EOFError) as error:
        raise InvalidTrajectory(
            Problem(f"{path}", reason_of(error), "a readable Parquet file")
        ) from error
    if not table.num_rows:
        raise InvalidTrajectory(Problem(f"{path}", "no rows", "at least two rows"))
    columns = {
        name: _column(path, table, name).to_numpy().astype(np.float64, copy=False)
        for name in header.numbers
    }
    names, code = [path.stem], np.zeros(table.num_rows, dtype=np.int64)
    if header.is_named:
        text = _column(path, table, "trajectory").cast(pa.large_string())
        encoded = text.combine_chunks().dictionary_encode()
        found = [str(name) for name in encoded.dictionary.to_pylist()]
        names, code = merged(found, encoded.indices.to_numpy(), path.stem)
    return Table(
        f"{path}",
        header,
        columns,
        names,
        code,
        lambda first, last: span("row", first, last),
    )


def _check_types(path: FilePath, schema: pa.Schema) -> None:
    """Raise with every column that is of a wrong type."""
    from pyarrow import types

    problems = []
    for field in schema:
        kind = field.type
        if field.name == "trajectory":
            while types.is_dictionary(kind):
                kind = kind.value_type
            fits = types.is_string(kind) or types.is_large_string(kind)
        else:
            fits = types.is_floating(kind) or types.is_integer(kind)
        if not fits:
            allowed = "text" if field.name == "trajectory" else "numbers"
            problems.append(
                Problem(f"{path}: column {field.name}", f"{field.type}", allowed)
            )
    if problems:
        raise InvalidTrajectory(problems)


def _column(path: FilePath, table: pa.Table, name: str) -> pa.ChunkedArray[Any]:
    """Return a column, or raise with its first row without a value."""
    from pyarrow import compute

    column = table[name]
    if column.null_count:
        row = compute.index(compute.is_null(column), True).as_py()
        raise InvalidTrajectory(
            Problem(f"{path}: row {row}, {name}", "no value", "a value in every row")
        )
    return column


def write_parquet(
    path: FilePath, names: list[str], sizes: IntArray, columns: dict[str, FloatArray]
) -> None:
    """Write a table to a Parquet file."""
    import pyarrow as pa
    from pyarrow import parquet

    code = np.repeat(np.arange(len(names), dtype=np.int32), sizes)
    owners = pa.DictionaryArray.from_arrays(code, pa.array(names, pa.string()))
    parquet.write_table(pa.table({"trajectory": owners, **columns}), path)
