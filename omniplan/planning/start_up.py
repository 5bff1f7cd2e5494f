"""Before the clock of a search starts: kernels are compiled, tables made, OMPL loaded.

A first plan without compiled kernels in numba's cache would otherwise spend its time on
compiling, and end with "timeout".
"""

from __future__ import annotations

from functools import lru_cache

from omniplan.planning.blend import rounded_off
from omniplan.planning.connect import Connector
from omniplan.planning.improve import moves_of
from omniplan.planning.route import Route
from omniplan.planning.task import Budget, Task

__all__ = ["make_ready"]

AWAY = ((1.3, 0.9, 0.6), (1.3, 0.9, 0.0), (1.3, 0.0, 0.0))
"""A vehicle plans to the first of these poses that it has moves to; the last ones are
for those that keep their heading or drive along a line."""
PLENTY = 3600.0
"""Time for it, s."""


@lru_cache(maxsize=64)
def make_ready(connector: Connector, method: str) -> None:
    """Do once what a search does, for a vehicle without obstacles.

    Parameters
    ----------
    connector : Connector
    method : {"geometric", "control"}
    """
    from omniplan.sampling import ompl_bindings  # noqa: F401

    task = _somewhere(connector)
    if method == "control":
        from omniplan.planning import controls

        controls.make_ready(task, connector)
        return
    for goal in AWAY:
        connector.quick(task.start, goal)
        chains = connector.thorough(task.start, goal)
        if chains:
            # The longest one has corners.
            moves = moves_of(max((chain for _, chain in chains), key=len))
            rounded_off(task, connector.permits, Route.from_moves(moves))
            return


def _somewhere(connector: Connector) -> Task:
    permits, goal = connector.permits, AWAY[0]
    return Task(
        (0.0, 0.0, 0.0),
        goal,
        permits.space,
        permits.vehicle,
        None,
        (-5.0, -5.0, 5.0, 5.0),
        "RRTConnect",
        1,
        Budget(PLENTY),
    )
