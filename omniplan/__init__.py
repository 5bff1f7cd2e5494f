"""What planners and fleet managers ask: validate, select."""

import logging

from omniplan.errors import InvalidTrajectory
from omniplan.fleet import select
from omniplan.report import Advice, Candidate, Ranking, Report, Violation
from omniplan.trajectory import Trajectory
from omniplan.trajectory_io import read_trajectories, write_trajectories
from omniplan.validate import validate

__all__ = [
    "Advice",
    "Candidate",
    "InvalidTrajectory",
    "Ranking",
    "Report",
    "Trajectory",
    "Violation",
    "read_trajectories",
    "select",
    "validate",
    "write_trajectories",
]

logging.getLogger(__name__).addHandler(logging.NullHandler())
