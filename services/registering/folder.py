"""The fleet that a server starts with, from a folder of files."""

from __future__ import annotations

from pathlib import Path

from configspace.build import build_space
from configspace.errors import CacheError, InvalidInput, Problem
from configspace.grid import Grid
from configspace.space import PermissibleSpace
from configspace.storage import load_space
from configspace.vehicle_io import load_vehicle

__all__ = ["fleet_of_folder"]

_VEHICLES = (".yaml", ".yml", ".json")
_SHEETS = (".safetensors",)


def fleet_of_folder(
    folder: str | Path, grid: Grid | None = None
) -> tuple[PermissibleSpace, ...]:
    """Read every vehicle file and data sheet of a folder.

    Parameters
    ----------
    folder : path
        Files that end in .yaml, .yml or .json are vehicles, .safetensors are data
        sheets; hidden files, others and folders are left out.
    grid : Grid, optional
        Of the data sheets that are computed; default as for `build_space`.

    Returns
    -------
    fleet : tuple of PermissibleSpace
        In the order of the files' names.

    Raises
    ------
    InvalidInput
        With every mistake of all files at once; two vehicles of one name are one, too.
    """
    folder = Path(folder)
    try:
        paths = sorted(path for path in folder.iterdir() if _is_wanted(path))
    except OSError as error:
        reason = error.strerror or str(error)
        problem = Problem("fleet", f"{folder}: {reason}", "a folder of vehicle files")
        raise InvalidInput(problem) from error
    problems: list[Problem] = []
    found: dict[str, tuple[Path, PermissibleSpace]] = {}
    for path in paths:
        try:
            space = _read(path, grid)
        except InvalidInput as error:
            problems += (
                Problem(f"{path.name}: {p.where}", p.given, p.allowed)
                for p in error.problems
            )
        except CacheError as error:
            problems.append(Problem(path.name, str(error), "a sound data sheet"))
        else:
            first, _ = found.setdefault(space.name, (path, space))
            if first != path:
                allowed = f"{first.name} has a vehicle of this name"
                problems.append(Problem(f"{path.name}: name", space.name, allowed))
    if problems:
        raise InvalidInput(problems, f"fleet folder {folder}")
    return tuple(space for _, space in found.values())


def _is_wanted(path: Path) -> bool:
    is_known = path.suffix.lower() in (*_VEHICLES, *_SHEETS)
    return is_known and not path.name.startswith(".") and path.is_file()


def _read(path: Path, grid: Grid | None) -> PermissibleSpace:
    if path.suffix.lower() in _SHEETS:
        return load_space(path)
    return build_space(load_vehicle(path), grid)
