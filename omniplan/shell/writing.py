"""Where results go: folders and files, asked for before the work is done."""

from __future__ import annotations

import tempfile
from pathlib import Path

__all__ = ["make_folder", "require_file"]


def make_folder(where: str, folder: Path) -> None:
    """Make a folder.

    Parameters
    ----------
    where : str
        The argument that names it.
    folder : Path

    Raises
    ------
    InvalidInput
        If it cannot be made, or takes no files.
    """
    from configspace import InvalidInput, Problem
    from configspace.files import reason_of

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        given = f"{folder}: {reason_of(error)}"
        raise InvalidInput(Problem(where, given, "a folder")) from error
    _require_writable(where, folder)


def require_file(where: str, path: Path, *suffixes: str) -> None:
    """Raise unless a file can be written as it is asked for.

    Parameters
    ----------
    where : str
        The argument that names it.
    path : Path
    *suffixes : str
        Its name ends in one of them.

    Raises
    ------
    InvalidInput
        If its name ends otherwise, is that of a folder, or its folder does not exist
        or takes no files.
    """
    from configspace import InvalidInput, Problem

    if path.suffix.lower() not in suffixes:
        allowed = f"must end in {' or '.join(suffixes)}"
        raise InvalidInput(Problem(where, str(path), allowed))
    if not path.parent.is_dir():
        raise InvalidInput(Problem(where, str(path), "the folder must exist"))
    if path.is_dir():
        raise InvalidInput(Problem(where, f"{path}: is a folder", "a file"))
    _require_writable(where, path.parent)


def _require_writable(where: str, folder: Path) -> None:
    """Raise unless a file can be made in a folder; the way to know is to make one."""
    from configspace import InvalidInput, Problem
    from configspace.files import reason_of

    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        given, allowed = f"{folder}: {reason_of(error)}", "a folder that takes files"
        raise InvalidInput(Problem(where, given, allowed)) from error
