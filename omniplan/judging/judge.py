"""Choosing who judges: the exact formulas or the data sheet."""

from __future__ import annotations

from configspace import PermissibleSpace
from configspace.sheet import fingerprint
from omniplan.judging.rows import Judge, Tolerances
from omniplan.judging.sheet_judge import SheetJudge
from omniplan.judging.vehicle_judge import VehicleJudge
from omniplan.motion import Motion, PoseMotion
from omniplan.trajectory import Trajectory

__all__ = ["is_own", "judge_for"]


def is_own(trajectory: Trajectory, space: PermissibleSpace) -> bool:
    """Return whether a trajectory is in the space's own Omni-Curve-Parameters."""
    owner = trajectory.vehicle
    if owner is None:
        return False
    if space.vehicle is not None:
        return owner == space.vehicle
    return fingerprint(owner, space.grid) == space.header.fingerprint


def judge_for(space: PermissibleSpace, motion: Motion, tolerances: Tolerances) -> Judge:
    """Return the exact judge if the vehicle is known, else that of the data sheet."""
    if space.vehicle is None:
        return SheetJudge(space, tolerances, is_own=motion.is_own)
    return VehicleJudge(
        space.vehicle,
        tolerances,
        is_own=motion.is_own,
        has_rates=motion.has_rates,
        has_swing=isinstance(motion, PoseMotion),
    )
