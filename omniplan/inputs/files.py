"""Reading and writing trajectories and paths: CSV, Parquet, VDA 5050 orders.

The end of the file's name says which: ``.parquet``, ``.json`` (VDA 5050), else CSV.
The columns are those of `omniplan.inputs.table`.
"""

from __future__ import annotations

from collections.abc import Iterable
from os import PathLike
from pathlib import Path as FilePath

import numpy as np
import numpy.typing as npt

from configspace import InvalidInput, Problem, Vehicle
from configspace.files import reason_of, whole_file
from omniplan.errors import InvalidTrajectory
from omniplan.inputs.table import columns_of, trajectories_of
from omniplan.path import Path
from omniplan.trajectory import Trajectory

__all__ = ["read_trajectories", "write_trajectories"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


def read_trajectories(
    path: str | FilePath, vehicle: Vehicle | None = None
) -> tuple[Trajectory | Path, ...]:
    """Read trajectories or paths, in the order in which they first appear.

    Parameters
    ----------
    path : str or Path
        A ``.parquet`` file, a ``.json`` file with VDA 5050 orders, or a CSV file.
    vehicle : Vehicle, optional
        The vehicle whose parameters a file of ``kappa_n, beta, v_n`` holds.

    Returns
    -------
    tuple of Trajectory or Path
        Paths where the file has no times.

    Raises
    ------
    InvalidTrajectory
        If the file cannot be read or has mistakes; with the line, the row and column,
        or the JSON path.
    """
    path = FilePath(path)
    match path.suffix.lower():
        case ".json":
            from omniplan.inputs.vda5050 import read_orders

            return read_orders(path)
        case ".parquet":
            from omniplan.inputs.parquet_files import read_parquet

            return trajectories_of(read_parquet(path), vehicle)
        case _:
            from omniplan.inputs.csv_files import read_csv

            return trajectories_of(read_csv(path), vehicle)


def write_trajectories(
    path: str | FilePath, trajectories: Iterable[Trajectory | Path]
) -> None:
    """Write trajectories of one form, or paths, to a Parquet or a CSV file.

    Both keep every digit.

    Parameters
    ----------
    path : str or Path
        Ends in ``.parquet``, or is a CSV file.
    trajectories : iterable of Trajectory or Path

    Raises
    ------
    InvalidInput
        If there are none, their forms differ, the arguments are swapped, or the file
        cannot be written; an older file of that name stays as it is.
    InvalidTrajectory
        If the name of the file ends in ``.json``.
    """
    if not isinstance(path, str | PathLike):
        allowed = "the name of a file, before what is written to it"
        raise InvalidInput(Problem("path", type(path).__name__, allowed))
    trajectories = _listed(trajectories)
    path = FilePath(path)
    if path.suffix.lower() == ".json":
        raise InvalidTrajectory(Problem(f"{path}", "JSON", ".csv or .parquet"))
    table = columns_of(trajectories)
    try:
        with whole_file(path) as temporary:
            _write(temporary, *table)
    except OSError as error:
        allowed = "must be writable"
        raise InvalidInput(
            Problem("path", f"{path}: {reason_of(error)}", allowed)
        ) from error


def _write(
    path: FilePath, names: list[str], sizes: IntArray, columns: dict[str, FloatArray]
) -> None:
    if path.suffix.lower() == ".parquet":
        from omniplan.inputs.parquet_files import write_parquet

        write_parquet(path, names, sizes, columns)
    else:
        from omniplan.inputs.csv_files import write_csv

        write_csv(path, names, sizes, columns)


def _listed(motions: object) -> tuple[Trajectory | Path, ...]:
    """Return what is to be written; InvalidInput for anything else."""
    allowed = "a list of trajectories or paths"
    if isinstance(motions, str) or not isinstance(motions, Iterable):
        raise InvalidInput(Problem("trajectories", type(motions).__name__, allowed))
    found = tuple(motions)
    for i, one in enumerate(found):
        if not isinstance(one, Trajectory | Path):
            where = f"trajectories[{i}]"
            raise InvalidInput(Problem(where, type(one).__name__, allowed))
    return found
