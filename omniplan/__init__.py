"""What planners and fleet managers ask: validate, select.

The names are loaded when they are first used, so that the command line starts quickly.
"""

import importlib
import logging
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from omniplan.errors import InvalidTrajectory
    from omniplan.fleet import select
    from omniplan.report import Advice, Candidate, Ranking, Report, Violation
    from omniplan.rows import Tolerances
    from omniplan.trajectory import Trajectory
    from omniplan.trajectory_io import read_trajectories, write_trajectories
    from omniplan.validation import validate

__all__ = [
    "Advice",
    "Candidate",
    "InvalidTrajectory",
    "Ranking",
    "Report",
    "Tolerances",
    "Trajectory",
    "Violation",
    "read_trajectories",
    "select",
    "validate",
    "write_trajectories",
]

_HOMES = {
    "InvalidTrajectory": "errors",
    "Tolerances": "rows",
    "Trajectory": "trajectory",
    "read_trajectories": "trajectory_io",
    "select": "fleet",
    "validate": "validation",
    "write_trajectories": "trajectory_io",
}

logging.getLogger(__name__).addHandler(logging.NullHandler())


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home = _HOMES.get(name, "report")
    value = getattr(importlib.import_module(f"{__name__}.{home}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
