"""Data sheets as files: safetensors, self-describing, checksummed, no pickle."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, fields
from pathlib import Path

import numpy as np
import numpy.typing as npt
from safetensors import SafetensorError
from safetensors import numpy as safetensors

from configspace.errors import CacheError
from configspace.files import reason_of, whole_file
from configspace.grid import Grid
from configspace.kernels import MIXED
from configspace.omni_curve import boundary_curvature
from configspace.rate_cells import SHARES, CellRates
from configspace.sheet import (
    ALGORITHM_VERSION,
    FORMAT_VERSION,
    SheetHeader,
    Tables,
)
from configspace.space import PermissibleSpace

__all__ = ["dump_space", "load_space", "parse_space", "save_space"]

_FORMAT = "omniplan data sheet"
_ENTRY = "omniplan"
_DTYPES = {
    "load": np.float32,
    "v_lo": np.float32,
    "v_hi": np.float32,
    "state": np.uint8,
    "parts": np.uint16,
    "reason": np.uint16,
    "wheel": np.int16,
}
_RATES = tuple(field.name for field in fields(CellRates))
_PREFIX = "rates."


def dump_space(space: PermissibleSpace) -> bytes:
    """Return the data sheet as bytes."""
    tensors = {
        name: np.ascontiguousarray(getattr(space.tables, name)) for name in _DTYPES
    }
    for name in _RATES:
        tensors[_PREFIX + name] = np.ascontiguousarray(getattr(space.rates, name))
    header = json.dumps(asdict(space.header), sort_keys=True)
    description = {
        "format": _FORMAT,
        "format_version": str(FORMAT_VERSION),
        "algorithm_version": str(ALGORITHM_VERSION),
        "header": header,
        "checksum": _checksum(header, tensors),
    }
    # One entry, as safetensors writes several in a random order.
    metadata = {_ENTRY: json.dumps(description, sort_keys=True)}
    return bytes(safetensors.save(tensors, metadata=metadata))


def save_space(space: PermissibleSpace, path: Path) -> None:
    """Write a data sheet: to a temporary name, synced, then renamed.

    Raises
    ------
    CacheError
        If it cannot be written; nothing half written is left behind.
    """
    try:
        with whole_file(path, sync=True) as temporary:
            temporary.write_bytes(dump_space(space))
    except OSError as error:
        why = reason_of(error)
        raise CacheError(f"data sheet {path}: cannot be written: {why}") from error


def load_space(path: str | Path) -> PermissibleSpace:
    """Read a data sheet; the space answers without knowing the vehicle's insides.

    Raises
    ------
    CacheError
        If the file is missing, damaged or of another version.
    """
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise CacheError(f"data sheet {path}: cannot be read: {error}") from error
    return parse_space(content, subject=f"data sheet {path}")


def parse_space(content: bytes, subject: str = "data sheet") -> PermissibleSpace:
    """Return the space that a data sheet's bytes describe.

    Raises
    ------
    CacheError
        If the bytes are damaged or of another version.
    """
    metadata = _metadata(content, subject)
    if metadata.get("format") != _FORMAT:
        raise CacheError(f"{subject}: not an {_FORMAT}")
    for key, known in (
        ("format_version", FORMAT_VERSION),
        ("algorithm_version", ALGORITHM_VERSION),
    ):
        if metadata.get(key) != str(known):
            raise CacheError(
                f"{subject}: {key} {metadata.get(key)}; this program reads {known}"
            )
    try:
        tensors = safetensors.load(content)
    except (SafetensorError, ValueError) as error:
        raise CacheError(f"{subject}: damaged: {error}") from error
    header_text = metadata.get("header", "")
    if _checksum(header_text, tensors) != metadata.get("checksum"):
        raise CacheError(f"{subject}: damaged: the checksum does not match")
    try:
        header = _header(header_text)
        tables = Tables(**{name: tensors[name] for name in _DTYPES})
        _reject_impossible(header, tables)
        rates = CellRates(**{name: tensors[_PREFIX + name] for name in _RATES})
        _reject_impossible_rates(header, rates)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise CacheError(f"{subject}: damaged: {error!r}") from error
    return PermissibleSpace(header=header, tables=tables, rates=rates)


def _metadata(content: bytes, subject: str) -> dict[str, str]:
    """Return the free-text part of a safetensors header."""
    try:
        size = int.from_bytes(content[:8], "little")
        if len(content) < 8 or size > len(content) - 8:
            raise ValueError("truncated")
        header = json.loads(content[8 : 8 + size])
        metadata = json.loads(header["__metadata__"][_ENTRY])
        return {str(key): str(value) for key, value in metadata.items()}
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise CacheError(f"{subject}: damaged: {error!r}") from error


def _header(text: str) -> SheetHeader:
    data = json.loads(text)
    x, y = data.pop("reference")
    return SheetHeader(
        **{
            **data,
            "reference": (x, y),
            "grid": Grid(**data["grid"]),
            "footprint": tuple((px, py) for px, py in data["footprint"]),
            "wheel_ids": tuple(data["wheel_ids"]),
        }
    )


def _reject_impossible(header: SheetHeader, tables: Tables) -> None:
    """Raise ValueError unless tables and header fit: a sheet may be a stranger's."""
    rows = 1 if header.is_translating else header.grid.n_kappa
    columns = header.grid.n_beta if header.line_beta is None else 1
    directions = tables.load.shape[0] if tables.load.ndim else 0
    if directions not in (1, 2):
        raise ValueError(f"{directions} driving directions")
    cells = (directions, rows, columns)
    shapes = {
        "load": (directions, rows + 1, columns + 1),
        "v_lo": cells,
        "v_hi": cells,
        "state": cells[1:],
        "parts": cells[1:],
        "reason": cells,
        "wheel": cells,
    }
    for name, dtype in _DTYPES.items():
        array = getattr(tables, name)
        if array.shape != shapes[name] or array.dtype != dtype:
            raise ValueError(f"{name} is {array.dtype} {array.shape}")
    if not (np.isfinite(tables.load).all() and (tables.load > 0).all()):
        raise ValueError("load must be finite and positive")
    if not ((tables.v_lo >= 0) & (tables.v_lo <= tables.v_hi)).all():
        raise ValueError("0 ≤ v_lo ≤ v_hi must hold")
    if tables.state.max() > MIXED:
        raise ValueError("a state of a cell is unknown")
    if tables.wheel.min() < -1 or tables.wheel.max() >= len(header.wheel_ids):
        raise ValueError("a wheel is unknown")
    boundary_curvature(header.kappa_g)
    numbers = (*header.reference, header.line_beta or 0.0)
    if not np.isfinite(numbers).all():
        raise ValueError("the header's numbers must be finite")


def _reject_impossible_rates(header: SheetHeader, rates: CellRates) -> None:
    """Raise ValueError unless the change rates fit the header."""
    rows, columns = rates.v_s_dot.shape
    one_row, one_column = header.is_translating, header.line_beta is not None
    if (rows == 1) != one_row or (columns == 1) != one_column:
        raise ValueError(f"change rates over {rows} × {columns} cells")
    if not one_row and rows % 4:
        raise ValueError(f"change rates over {rows} rows")
    for name in _RATES:
        array = getattr(rates, name)
        stacked = (SHARES.size,) if name.endswith("headroom") else ()
        if array.shape != (*stacked, rows, columns) or array.dtype != np.float32:
            raise ValueError(f"{name} is {array.dtype} {array.shape}")
        if not (array >= 0).all():
            raise ValueError(f"{name} must not be negative")


def _checksum(header: str, tensors: dict[str, npt.NDArray[np.generic]]) -> str:
    digest = hashlib.sha256(header.encode())
    for name in sorted(tensors):
        array = np.ascontiguousarray(tensors[name])
        digest.update(f"{name}{array.dtype.str}{array.shape}".encode())
        digest.update(array.data)
    return digest.hexdigest()
