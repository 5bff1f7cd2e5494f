"""A folder of data sheets named by content; safe with many processes.

An entry is written under a temporary name and renamed, so a reader sees all of it or
nothing. A damaged or outdated entry is reported to the log and computed anew.
"""

from __future__ import annotations

import logging
import os
from dataclasses import replace
from pathlib import Path

import platformdirs

from configspace.errors import CacheError
from configspace.grid import Grid
from configspace.sheet import fingerprint
from configspace.space import PermissibleSpace
from configspace.storage import load_space, save_space
from configspace.vehicle import Vehicle

__all__ = ["default_folder", "read", "write"]

_log = logging.getLogger(__name__)


def default_folder() -> Path:
    """Return the folder named by ``OMNIPLAN_CACHE``, or the platform's."""
    named = os.environ.get("OMNIPLAN_CACHE")
    return Path(named) if named else Path(platformdirs.user_cache_dir("omniplan"))


def read(folder: Path, vehicle: Vehicle, grid: Grid) -> PermissibleSpace | None:
    """Return the cached space, or None if there is no sound one."""
    key = fingerprint(vehicle, grid)
    path = folder / f"{key}.safetensors"
    if not os.path.exists(path):  # unlike Path.exists: False where it may not look
        return None
    try:
        space = load_space(path)
    except CacheError as error:
        _log.warning("%s; it is computed anew", error)
        return None
    if space.header.fingerprint != key:
        _log.warning("cache entry %s is of another vehicle; it is computed anew", path)
        return None
    return replace(space, vehicle=vehicle)


def write(folder: Path, space: PermissibleSpace) -> None:
    """Keep a space; a cache that cannot be written is reported to the log only."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        save_space(space, folder / f"{space.header.fingerprint}.safetensors")
    except (OSError, CacheError) as error:
        _log.warning("cache %s: not written: %s", folder, error)
