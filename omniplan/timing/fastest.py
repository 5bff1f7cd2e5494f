"""Fastest timing: the time-optimal speed profile of a path under all limits.

Along the splines of a path every limit of a vehicle bounds ``(ü, u̇²)`` linearly; the
optimum follows by reachability analysis (see `omniplan.timing.kernels`). Between two
stops the representation is the permitted one that makes the whole fastest, the time to
turn the wheels at the stops included. The result is sampled so that the C² splines of a
pose trajectory keep the limits, and `validate` has the last word.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable

import numpy as np

from configspace import InvalidInput, PermissibleSpace, Problem
from configspace.space import require_space
from omniplan.judging.rows import Tolerances
from omniplan.path import Path
from omniplan.timing.path_motion import path_of, pieces_of
from omniplan.timing.result import Timing
from omniplan.timing.search import Timer
from omniplan.timing.solver import GRID, TimingProblem
from omniplan.trajectory import Trajectory

__all__ = ["fastest", "time_path", "time_paths"]

STEPS = 500
"""Least number of samples of the trajectory between two stops."""


def fastest(
    path: Path | Trajectory,
    space: PermissibleSpace,
    tolerances: Tolerances | None = None,
    *,
    allow_unreachable: bool = False,
) -> Trajectory:
    """Return the fastest permitted timing of a path as a trajectory of poses.

    Parameters
    ----------
    path : Path or Trajectory
        The times of a trajectory of poses are dropped; it still stops where it stood.
    space : PermissibleSpace
        With its vehicle: a data sheet alone does not tell all limits.
    tolerances : Tolerances, optional
        What counts as standing and as free of slip.
    allow_unreachable : bool
        Whether configurations may be used to which no way leads from straight ahead.

    Raises
    ------
    NotDrivable
        If the vehicle cannot drive the path; `time_path` gives that as a value.
    InvalidInput
        If the space does not know its vehicle, or a trajectory is not one of poses.

    Examples
    --------
    >>> import configspace, omniplan
    >>> space = configspace.build_space(
    ...     configspace.load_vehicle("mecanum"), cache=False)
    >>> line = omniplan.Path.from_poses([[0, 0, 0], [2, 0, 0]])
    >>> round(omniplan.fastest(line, space).duration, 1)
    2.5
    """
    timing = time_path(path, space, tolerances, allow_unreachable=allow_unreachable)
    return timing.raise_for_status()


def time_path(
    path: Path | Trajectory,
    space: PermissibleSpace,
    tolerances: Tolerances | None = None,
    *,
    allow_unreachable: bool = False,
    grid: int = GRID,
    steps: int = STEPS,
    checkpoint: Callable[[], None] | None = None,
) -> Timing:
    """Return the fastest permitted timing of a path, or why there is none.

    Parameters
    ----------
    path, space, tolerances, allow_unreachable
        As of `fastest`.
    grid : int, ≥ 2
        Least number of grid intervals between two stops, for the optimum.
    steps : int, ≥ 4
        Least number of samples between two stops, for the trajectory.
    checkpoint : callable, optional
        Called again and again; what it raises ends the work.

    References
    ----------
    spec/omni-curve §5, "Fastest timing of a path".
    """
    return time_paths(
        (path,),
        space,
        tolerances,
        allow_unreachable=allow_unreachable,
        grid=grid,
        steps=steps,
        checkpoint=checkpoint,
    )[0]


def time_paths(
    paths: Iterable[Path | Trajectory],
    space: PermissibleSpace,
    tolerances: Tolerances | None = None,
    *,
    allow_unreachable: bool = False,
    grid: int = GRID,
    steps: int = STEPS,
    checkpoint: Callable[[], None] | None = None,
) -> tuple[Timing, ...]:
    """Time many paths for one vehicle; the optima are computed together, in parallel.

    Parameters
    ----------
    paths : iterable of Path or Trajectory
    space, tolerances, allow_unreachable, grid, steps, checkpoint
        As of `time_path`.

    Returns
    -------
    timings : tuple of Timing
        In the order of the paths.
    """
    require_space(space)
    if space.vehicle is None:
        given = f"{space.name}: a data sheet alone"
        allowed = "timing needs the vehicle: a data sheet does not hold all its rates"
        raise InvalidInput(Problem("space", given, allowed))
    for name, value, least in (("grid", grid, 2), ("steps", steps, 4)):
        if value < least:
            raise InvalidInput(Problem(name, f"{value}", f"at least {least}"))
    routes = [path_of(path) for path in paths]
    if not routes:
        return ()
    timer = Timer(
        space, tolerances or Tolerances(), allow_unreachable, steps, checkpoint
    )
    pieces = [pieces_of(route) for route in routes]
    problem = TimingProblem([p for some in pieces for p in some], space.vehicle, grid)
    signs = timer.signs(pieces[0][0])
    jobs = [(k, sign) for k in range(len(problem.pieces)) for sign in signs]
    profiles = problem.solve(*zip(*jobs, strict=True))
    by_job = dict(zip(jobs, profiles, strict=True))
    finer = problem.refined(
        [[by_job[k, sign] for sign in signs] for k in range(len(problem.pieces))]
    )
    if finer is not problem:
        problem, profiles = finer, finer.solve(*zip(*jobs, strict=True))
        by_job = dict(zip(jobs, profiles, strict=True))
    starts = np.cumsum([0, *(len(some) for some in pieces)]).tolist()
    return tuple(
        timer.time(route, problem, range(*span), by_job)
        for route, span in zip(routes, itertools.pairwise(starts), strict=True)
    )
