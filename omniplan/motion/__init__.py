"""The continuous motion between the samples of a trajectory, with enclosures.

A motion is cut at its knots into intervals. On a part ``[t0, t1]`` of an interval the
body twist is ``scale · (v, ω)`` with

    v(t) ∈ chord [v(t0), v(t1)] ⊕ disc of radius Δt²/8 · max |v̈|

and likewise for ω. Everything `judge` decides between the samples rests on that
enclosure, whose excess shrinks with the square of Δt.

Twists are those of the origin of the vehicle files' frame, ``v = vx + j vy``.
"""

from __future__ import annotations

from omniplan.motion.enclosure import Enclosure, Intervals, Motion
from omniplan.motion.parameters import OmniCurveMotion
from omniplan.motion.poses import PoseMotion, starts_at_rest, stops_of
from omniplan.motion.twists import TwistMotion
from omniplan.trajectory import Trajectory

__all__ = [
    "Enclosure",
    "Intervals",
    "Motion",
    "OmniCurveMotion",
    "PoseMotion",
    "TwistMotion",
    "motion_of",
    "starts_at_rest",
    "stops_of",
]


def motion_of(trajectory: Trajectory, *, is_own: bool) -> Motion:
    """Return the motion of a trajectory.

    Parameters
    ----------
    trajectory : Trajectory
    is_own : bool
        Whether the vehicle that is judged is the trajectory's own: then its
        Omni-Curve-Parameters are taken as they are, otherwise as twists.
    """
    point = complex(*trajectory.reference_point)
    if trajectory.form == "poses":
        return PoseMotion(trajectory.t, trajectory.samples, point)
    if trajectory.form == "twists":
        return TwistMotion(trajectory.t, trajectory.samples, point)
    owner = trajectory.vehicle
    assert owner is not None
    return OmniCurveMotion(
        trajectory.t,
        trajectory.samples,
        owner.boundary_curvature,
        owner.reference,
        None if is_own else owner,
    )
