"""Files that are written whole or not at all, and why one cannot be read."""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Iterator
from pathlib import Path

__all__ = ["reason_of", "whole_file"]


@contextlib.contextmanager
def whole_file(path: Path, *, sync: bool = False) -> Iterator[Path]:
    """Yield a name beside a file; what is written there takes its place in the end.

    An older file of that name stays as it is until then, and for good if anything
    fails; nothing half written is left behind.

    Parameters
    ----------
    path : Path
        The file.
    sync : bool
        Wait until its content is on the disk before it gets its name.

    Yields
    ------
    temporary : Path
        In the same folder, with the same suffix. Not of `tempfile`: its files can be
        read by their owner only.

    Raises
    ------
    OSError
        If the file cannot take its place.
    """
    name = f".{path.stem[:100]}.{secrets.token_hex(8)}{path.suffix}"
    temporary = path.with_name(name)
    try:
        yield temporary
        if sync:
            with temporary.open("rb+") as file:
                os.fsync(file.fileno())
        os.replace(temporary, path)
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def reason_of(error: Exception) -> str:
    r"""Return in words why a file could not be read or written.

    Parameters
    ----------
    error : Exception
        Of the system, or of whoever read the file.

    Examples
    --------
    >>> reason_of(FileNotFoundError(2, "No such file or directory", "a.csv"))
    'No such file or directory'
    >>> try:
    ...     b"a\xff".decode()
    ... except UnicodeDecodeError as error:
    ...     reason_of(error)
    'byte 0xff at 1 is not UTF-8'
    """
    if isinstance(error, OSError) and error.errno is not None:
        return os.strerror(error.errno)
    if isinstance(error, UnicodeDecodeError):
        byte = error.object[error.start]
        return f"byte 0x{byte:02x} at {error.start} is not UTF-8"
    lines = str(error).splitlines() or [type(error).__name__]
    return lines[0][:200].rstrip(". ")
