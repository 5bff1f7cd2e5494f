"""What the command line reads: vehicles, fleets, trajectories and paths."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

    import omniplan.path
    from configspace import PermissibleSpace
    from omniplan.timing.result import Timing
    from omniplan.trajectory import Trajectory

__all__ = [
    "fleet_of",
    "motions_of",
    "named_fleet_of",
    "space_of",
    "timing_of",
    "trajectories_of",
    "with_times",
]


def space_of(name: str) -> PermissibleSpace:
    """Return the space of a catalogue name, a vehicle file or a data sheet.

    A data sheet that cannot be read is the user's mistake; a damaged entry of the cache
    is none: it is computed anew, with a line in the log.
    """
    from configspace import (
        CacheError,
        InvalidInput,
        Problem,
        build_space,
        load_space,
        load_vehicle,
    )

    if name.endswith((".csv", ".parquet")):
        allowed = "a vehicle is needed here; trajectories stand before --fleet"
        raise InvalidInput(Problem("vehicle", name, allowed))
    if name.endswith(".safetensors"):
        try:
            return load_space(name)
        except CacheError as error:
            given, allowed = f"{error}", "a sound data sheet of this version"
            raise InvalidInput(Problem("vehicle", given, allowed)) from error
    return build_space(load_vehicle(name))


def fleet_of(names: Sequence[str] | None, console: Console) -> list[PermissibleSpace]:
    """Return the spaces of these vehicles, default of the whole catalogue."""
    from rich.progress import track

    from configspace import catalog

    chosen = names or catalog()
    return [
        space_of(name)
        for name in track(
            chosen,
            "Loading spaces",
            console=console,
            transient=True,
            disable=not console.is_terminal,
        )
    ]


def named_fleet_of(
    given: Sequence[str] | None, console: Console
) -> list[tuple[str, PermissibleSpace]]:
    """Return the fleet of ``[NAME=]VEHICLE`` texts, each vehicle loaded once."""
    from configspace import catalog

    pairs = [
        ("", text) if Path(text).exists() else text.rpartition("=")[::2]
        for text in given or catalog()
    ]
    files = list(dict.fromkeys(vehicle for _, vehicle in pairs))
    spaces = dict(zip(files, fleet_of(files, console), strict=True))
    return [(name or spaces[file].name, spaces[file]) for name, file in pairs]


def trajectories_of(
    paths: Sequence[Path], parameters_of: str | None
) -> list[Trajectory]:
    """Return what files hold; paths without time are errors."""
    from omniplan.trajectory import timed

    return [timed(motion) for motion in motions_of(paths, parameters_of)]


def motions_of(
    paths: Sequence[Path], parameters_of: str | None
) -> list[Trajectory | omniplan.path.Path]:
    """Return the trajectories and paths of files."""
    from configspace import load_vehicle
    from omniplan.inputs.files import read_trajectories

    vehicle = load_vehicle(parameters_of) if parameters_of else None
    return [motion for path in paths for motion in read_trajectories(path, vehicle)]


def timing_of(
    motion: Trajectory | omniplan.path.Path,
    space: PermissibleSpace,
    allow_unreachable: bool,
) -> Timing | None:
    """Return the fastest timing of a path, None for what has times."""
    from omniplan.trajectory import Trajectory

    if isinstance(motion, Trajectory):
        return None
    from omniplan.timing.fastest import time_path

    return time_path(motion, space, allow_unreachable=allow_unreachable)


def with_times(
    motion: Trajectory | omniplan.path.Path, timing: Timing | None
) -> Trajectory | None:
    """Return a trajectory, that of the timing for a path; None if it has none."""
    from omniplan.trajectory import Trajectory

    if isinstance(motion, Trajectory):
        return motion
    return None if timing is None else timing.trajectory
