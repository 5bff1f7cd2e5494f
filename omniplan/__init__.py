"""What planners and fleet managers ask: validate, select.

The names are loaded when they are first used, so that the command line starts quickly.
"""

import importlib
import logging
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from omniplan.batch.many import validate_many
    from omniplan.batch.twists import check_twists
    from omniplan.choosing.faults import Fault, Undrivable
    from omniplan.choosing.fitness import FleetVehicle, Suitability, suitable
    from omniplan.choosing.fleet import select
    from omniplan.choosing.requirements import parse_requirement
    from omniplan.choosing.shortfalls import Shortfall, Unfit
    from omniplan.errors import (
        InvalidTrajectory,
        NoPlanFound,
        NotDrivable,
        OptimisationFailed,
        PlanningError,
    )
    from omniplan.inputs.files import read_trajectories, write_trajectories
    from omniplan.judging.rows import Tolerances
    from omniplan.obstacles import CollisionChecker, Obstacles
    from omniplan.optimising.improving import optimise
    from omniplan.path import Path
    from omniplan.planning.planner import plan
    from omniplan.planning.result import Plan, PlanStatus
    from omniplan.plots.pictures import plot_report
    from omniplan.report import Advice, Candidate, Ranking, Report, Violation
    from omniplan.timing.fastest import fastest, time_path, time_paths
    from omniplan.timing.result import SpeedProfile, Timing, TimingStatus
    from omniplan.trace import Trace, margins
    from omniplan.trajectory import Trajectory
    from omniplan.validation import validate

__all__ = [
    "Advice",
    "Candidate",
    "CollisionChecker",
    "Fault",
    "FleetVehicle",
    "InvalidTrajectory",
    "NoPlanFound",
    "NotDrivable",
    "Obstacles",
    "OptimisationFailed",
    "Path",
    "Plan",
    "PlanStatus",
    "PlanningError",
    "Ranking",
    "Report",
    "Shortfall",
    "SpeedProfile",
    "Suitability",
    "Timing",
    "TimingStatus",
    "Tolerances",
    "Trace",
    "Trajectory",
    "Undrivable",
    "Unfit",
    "Violation",
    "check_twists",
    "fastest",
    "margins",
    "optimise",
    "parse_requirement",
    "plan",
    "plot_report",
    "read_trajectories",
    "select",
    "suitable",
    "time_path",
    "time_paths",
    "validate",
    "validate_many",
    "write_trajectories",
]

_HOMES = {
    "CollisionChecker": "obstacles",
    "Fault": "choosing.faults",
    "FleetVehicle": "choosing.fitness",
    "InvalidTrajectory": "errors",
    "NoPlanFound": "errors",
    "NotDrivable": "errors",
    "Obstacles": "obstacles",
    "OptimisationFailed": "errors",
    "Path": "path",
    "Plan": "planning.result",
    "PlanStatus": "planning.result",
    "PlanningError": "errors",
    "Shortfall": "choosing.shortfalls",
    "SpeedProfile": "timing.result",
    "Suitability": "choosing.fitness",
    "Timing": "timing.result",
    "TimingStatus": "timing.result",
    "Tolerances": "judging.rows",
    "Trace": "trace",
    "Trajectory": "trajectory",
    "Undrivable": "choosing.faults",
    "Unfit": "choosing.shortfalls",
    "check_twists": "batch.twists",
    "fastest": "timing.fastest",
    "margins": "trace",
    "optimise": "optimising.improving",
    "parse_requirement": "choosing.requirements",
    "plan": "planning.planner",
    "plot_report": "plots.pictures",
    "read_trajectories": "inputs.files",
    "select": "choosing.fleet",
    "suitable": "choosing.fitness",
    "time_path": "timing.fastest",
    "time_paths": "timing.fastest",
    "validate": "validation",
    "validate_many": "batch.many",
    "write_trajectories": "inputs.files",
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
