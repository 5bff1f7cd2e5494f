"""What every plan must keep, checked without the planner's own geometry."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
import shapely  # noqa: TID251
from shapely import affinity  # noqa: TID251

from configspace import PermissibleSpace
from omniplan import Plan, PlanStatus, validate
from omniplan.motion import PoseMotion

FloatArray = npt.NDArray[np.float64]
Corners = Sequence[tuple[float, float]]

SAMPLES = 1500
NOTHING = 1e-9


def assert_drivable(
    found: Plan,
    space: PermissibleSpace,
    start: Sequence[float],
    goal: Sequence[float],
    polygons: Mapping[str, Corners],
    clearance: float = 0.0,
    bounds: tuple[float, float, float, float] | None = None,
) -> None:
    """Assert that a plan is found, valid, free, and goes from start to goal at rest."""
    assert found.status is PlanStatus.FOUND, found.message
    trajectory = found.trajectory
    assert trajectory is not None
    assert validate(trajectory, space).valid
    vehicle = space.vehicle
    assert vehicle is not None
    reference = vehicle.reference
    assert trajectory.reference_point == (reference.real, reference.imag)
    for at, pose in ((0, start), (-1, goal)):
        x, y, theta = trajectory.samples[at]
        np.testing.assert_allclose([x, y], pose[:2], atol=1e-6)
        assert math.cos(theta - pose[2]) > 1 - 1e-12
    motion = PoseMotion(trajectory.t, trajectory.samples, reference)
    t0, t1 = float(trajectory.t[0]), float(trajectory.t[-1])
    for end, next_ in ((t0, trajectory.t[1]), (t1, trajectory.t[-2])):
        # At rest: far slower than on the first step as a whole.
        step = float(next_ - end)
        ends = motion.poses_at(np.array([end, end + 1e-3 * step, next_]))
        early, whole = np.linalg.norm(ends[1:] - ends[0], axis=1)
        assert early <= 1e-3 * 0.02 * whole + 1e-12
    poses = motion.poses_at(np.linspace(t0, t1, SAMPLES))
    assert_free(poses, space, polygons, clearance, bounds)


def assert_free(
    poses: FloatArray,
    space: PermissibleSpace,
    polygons: Mapping[str, Corners],
    clearance: float,
    bounds: tuple[float, float, float, float] | None,
) -> None:
    """Assert that the footprint keeps its distance, pose by pose."""
    vehicle = space.vehicle
    assert vehicle is not None
    assert vehicle.footprint is not None
    k = vehicle.reference
    outline = shapely.Polygon([(x - k.real, y - k.imag) for x, y in vehicle.footprint])
    hall = shapely.unary_union([shapely.Polygon(each) for each in polygons.values()])
    for x, y, theta in poses.tolist():
        body = affinity.rotate(outline, theta, origin=(0, 0), use_radians=True)
        body = affinity.translate(body, x, y)
        if not hall.is_empty:
            assert body.distance(hall) > clearance - NOTHING
        if bounds is not None:
            assert shapely.box(*bounds).contains(body)
