"""Verdicts of a batch as a Parquet file, in bounded memory."""

from __future__ import annotations

import contextlib
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from configspace import OmniplanError
from omniplan.batch.many import SCHEMA, Batch
from omniplan.batch.paths import PathBatch

__all__ = ["Written", "write_verdicts"]


@dataclass(frozen=True)
class Written:
    """What was written."""

    pairs: int
    valid: int
    """How many pairs are valid."""
    asked: int
    """For how many pairs `validate` was asked."""


def write_verdicts(
    path: str | Path, batch: Batch | PathBatch, *, progress: bool = False
) -> Written:
    """Judge a batch and write the rows of `validate_many` to a Parquet file.

    The file gets its name when it is complete; an older one stays until then.

    Parameters
    ----------
    path : str or Path
    batch : Batch or PathBatch
    progress : bool
        Show a progress bar on standard error.

    Raises
    ------
    OmniplanError
        If the file cannot be written.
    """
    path = Path(path)
    valid = 0
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        raise _unwritable(path, error) from error
    os.close(handle)
    try:
        with pq.ParquetWriter(name, SCHEMA) as writer:
            for rows in batch.verdicts(progress=progress):
                writer.write_batch(rows)
                valid += pc.sum(rows["valid"]).as_py() or 0
        Path(name).replace(path)
    except (OSError, pa.ArrowException) as error:
        raise _unwritable(path, error) from error
    finally:
        with contextlib.suppress(FileNotFoundError):
            Path(name).unlink()
    return Written(batch.pairs, valid, batch.asked)


def _unwritable(path: Path, error: Exception) -> OmniplanError:
    return OmniplanError(f"{path}: {error}; a place that can be written is needed")
