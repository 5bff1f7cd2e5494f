"""Choosing who judges: the exact formulas or the data sheet."""

from __future__ import annotations

from functools import lru_cache

from configspace import PermissibleSpace, Vehicle
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
    has_swing = isinstance(motion, PoseMotion)
    return _vehicle_judge(
        space.vehicle, tolerances, motion.is_own, motion.has_rates, has_swing
    )


@lru_cache(maxsize=64)
def _vehicle_judge(
    vehicle: Vehicle,
    tolerances: Tolerances,
    is_own: bool,
    has_rates: bool,
    has_swing: bool,
) -> VehicleJudge:
    """Return a judge, which keeps nothing of what it judges."""
    return VehicleJudge(
        vehicle, tolerances, is_own=is_own, has_rates=has_rates, has_swing=has_swing
    )
