"""What holds for every trajectory that `omniplan.optimise` returns."""

from __future__ import annotations

import naive_limits
import naive_motion
import random_motions

from configspace import PermissibleSpace
from omniplan import Trajectory, validate


def assert_kept(
    trajectory: Trajectory, space: PermissibleSpace, per_interval: int = 2
) -> naive_motion.Simulation:
    """By `validate`, and by a simulation that shares no code with it."""
    assert validate(trajectory, space).valid
    assert space.vehicle is not None
    simulation = naive_motion.simulate(
        space.vehicle,
        trajectory.t,
        random_motions.motion_of(trajectory),
        per_interval=per_interval,
        has_swing=True,
    )
    assert naive_limits.breaches(simulation) == []
    return simulation
