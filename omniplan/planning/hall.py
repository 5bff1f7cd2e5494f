"""What stands around the vehicle, and where it is looked for."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from configspace import InvalidInput, PermissibleSpace, Problem
from omniplan.planning.connect import Connector
from omniplan.planning.task import Bounds, Checker, Pose

__all__ = ["area_of", "checkers"]

ROOM = 5.0
"""Where no bounds are given, poses are looked for within this distance at least, m."""
RADII = 4.0
"""... and within so many least radii ..."""
SHARE = 0.5
"""... and within this share of the size of the hall."""
SPARE = 1e-3
"""Moves keep so much more distance than asked for, where start and goal allow it, m:
the splines of a trajectory leave them by less."""
LEAST_SPARE = 1e-5
"""Less than this is not worth a second checker, m."""


def checkers(
    space: PermissibleSpace,
    obstacles: object,
    bounds: npt.ArrayLike | None,
    clearance: float,
    ends: tuple[Pose, Pose],
) -> tuple[Checker | None, Checker | None]:
    """Return the checker that was asked for, and one that keeps a little more off.

    Parameters
    ----------
    space, obstacles, bounds, clearance
        As of `omniplan.plan`.
    ends : (start, goal)
    """
    from omniplan.obstacles import CollisionChecker, Obstacles
    from omniplan.obstacles.asked import checked_clearance

    if isinstance(obstacles, CollisionChecker):
        if bounds is not None or clearance != 0.0:
            allowed = "a CollisionChecker brings its own bounds and clearance"
            raise InvalidInput(Problem("bounds, clearance", "given as well", allowed))
        obstacles.require_body_of(space)
        strict = obstacles
    elif obstacles is None and bounds is None:
        checked_clearance(clearance)
        return None, None
    elif obstacles is not None and not isinstance(obstacles, Obstacles):
        allowed = "Obstacles, or a CollisionChecker"
        raise InvalidInput(Problem("obstacles", type(obstacles).__name__, allowed))
    else:
        area = None if bounds is None else np.asarray(bounds).ravel().tolist()
        strict = CollisionChecker(space, obstacles, clearance, area)
    room = min(strict.distance(pose) for pose in ends) - strict.clearance
    spare = min(SPARE, room / 2)
    # What a class of the user's own asks beside is not known.
    if spare < LEAST_SPARE or type(strict) is not CollisionChecker:
        return strict, strict
    return strict, strict.with_clearance(strict.clearance + spare)


def area_of(
    checker: Checker | None, connector: Connector, ends: tuple[Pose, Pose]
) -> Bounds:
    """Return where K is looked for.

    Parameters
    ----------
    checker : Checker, optional
    connector : Connector
    ends : (start, goal)
    """
    x = [pose[0] for pose in ends]
    y = [pose[1] for pose in ends]
    bounds = getattr(checker, "bounds", None)
    if bounds is not None:
        return (
            min(bounds[0], *x), min(bounds[1], *y),
            max(bounds[2], *x), max(bounds[3], *y),
        )  # fmt: skip
    hall = getattr(getattr(checker, "obstacles", None), "bounds", None)
    if hall is not None:
        x, y = [*x, hall[0], hall[2]], [*y, hall[1], hall[3]]
    size = max(max(x) - min(x), max(y) - min(y))
    room = max(ROOM, SHARE * size, RADII * (connector.radius or 0.0))
    return min(x) - room, min(y) - room, max(x) + room, max(y) + room
