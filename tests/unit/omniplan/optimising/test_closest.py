"""The closest way that wheels can follow, against wheel equations by hand."""

from __future__ import annotations

import math

import nearest_ways
import numpy as np
import numpy.typing as npt
import pytest
from nearest_ways import NearestWay
from scipy.integrate import solve_ivp
from spoiled_motions import spoiled

from configspace import Vehicle, build_space, load_vehicle
from omniplan import optimise
from omniplan.motion import PoseMotion
from omniplan.optimising.closest import Aim, Way, closest
from omniplan.optimising.half_planes import Side
from omniplan.optimising.limits import rules_of

FloatArray = npt.NDArray[np.float64]
N = 30


def arc(radius: float, angle: float) -> FloatArray:
    a = np.linspace(0, angle, N + 1)
    return np.stack([radius * np.sin(a), radius * (1 - np.cos(a)), a], axis=-1)


def bend(radius: float) -> FloatArray:
    """Straight, a turn by 60°, straight."""
    turn = np.linspace(0, math.pi / 3, 400)
    a = np.concatenate([np.zeros(400), turn, np.full(400, math.pi / 3)])
    step = np.repeat([2.0, radius * math.pi / 3, 2.0], 400) / 400
    z = np.cumsum(step * np.exp(1j * a))
    at = np.linspace(0, step.sum(), N + 1)
    gone = np.cumsum(step)
    rows = [np.interp(at, gone, row) for row in (z.real, z.imag, a)]
    return np.stack(rows, axis=-1)


def along(poses: FloatArray) -> Way:
    rates = np.gradient(poses, axis=0)
    body = (rates[:, 0] + 1j * rates[:, 1]) * np.exp(-1j * poses[:, 2])
    return Way(poses, np.stack([body.real, body.imag, rates[:, 2]], axis=-1))


def aim(poses: FloatArray, vehicle: Vehicle, sides: tuple[Side, ...] = ()) -> Aim:
    scale = [1.0, 1.0, 1 / vehicle.boundary_curvature]
    ahead = np.gradient(poses, axis=0) * scale
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    shares = np.full(N + 1, 1 / (N + 1))
    return Aim(poses, ahead, 0.05, shares, 0.05, (True, True), 1, 0.0, 1e-3, sides)


def wheel_angles(vehicle: Vehicle, way: Way) -> FloatArray:
    """(n, wheels) by ``atan2`` of each wheel's velocity, densely between the knots."""
    share = np.linspace(0, 1, 8, endpoint=False)[:, None, None]
    twists = (way.twists[:-1] + share * np.diff(way.twists, axis=0)).reshape(-1, 3)
    return np.stack(
        [
            np.arctan2(
                twists[:, 1] + twists[:, 2] * (w.x - vehicle.reference.real),
                twists[:, 0] - twists[:, 2] * (w.y - vehicle.reference.imag),
            )
            for w in vehicle.wheels
        ],
        axis=-1,
    )


def test_wheels_keep_their_ranges_and_twists_lead_from_pose_to_pose() -> None:
    vehicle = load_vehicle("ackermann")
    given = bend(1.1)  # 1.23 m is the least
    way = closest(along(given), aim(given, vehicle), rules_of(vehicle), 10.0)
    assert way is not None
    angles = np.degrees(wheel_angles(vehicle, way))
    assert np.abs(angles[:, :2]).max() < 0.01
    assert 39.9 < np.abs(angles[:, 2:]).max() <= 40.01
    np.testing.assert_allclose(way.poses[[0, -1]], given[[0, -1]], atol=1e-5)

    def rate(t: float, pose: FloatArray) -> list[float]:
        k = min(int(t), N - 1)
        x, y, w = way.twists[k] + (t - k) * (way.twists[k + 1] - way.twists[k])
        s, c = math.sin(pose[2]), math.cos(pose[2])
        return [c * x - s * y, s * x + c * y, w]

    driven = solve_ivp(
        rate, (0, N), way.poses[0], t_eval=np.arange(N + 1), rtol=1e-8, max_step=0.5
    )
    np.testing.assert_allclose(driven.y.T, way.poses, atol=1e-3)


def test_what_can_be_driven_stays() -> None:
    vehicle = load_vehicle("ackermann")
    given = arc(2.0, 1.2)
    way = closest(along(given), aim(given, vehicle), rules_of(vehicle), 10.0)
    assert way is not None
    assert np.abs(way.poses - given).max() < 2e-3


def test_corners_keep_to_their_half_planes() -> None:
    vehicle = load_vehicle("mecanum")
    given = np.linspace([0.0, 0, 0], [3, 0, 0], N + 1)
    arms = np.array([0.45 + 0.32j, -0.45 + 0.32j])
    side = Side(N // 2, arms, -1j, -0.2)  # no corner above y = 0.2 m
    way = closest(along(given), aim(given, vehicle, (side,)), rules_of(vehicle), 10.0)
    assert way is not None
    x, y, theta = way.poses[N // 2]
    corners = complex(x, y) + np.exp(1j * theta) * arms
    assert corners.imag.max() == pytest.approx(0.2, abs=1e-3)
    assert np.abs(way.poses[:, 1]).max() < 0.16


def test_without_a_way_there_is_none() -> None:
    """The goal is beside the start, and there is no room to get there."""
    vehicle = load_vehicle("ackermann")
    given = np.linspace([0.0, 0, 0], [0, 0.3, 0], N + 1)
    assert closest(along(given), aim(given, vehicle), rules_of(vehicle), 10.0) is None
    bent = bend(1.1)
    assert closest(along(bent), aim(bent, vehicle), rules_of(vehicle), 0.0) is None


@pytest.mark.slow
def test_a_second_solver_finds_no_way_that_is_much_closer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(nearest_ways, "STEPS", 24)
    vehicle = load_vehicle("ackermann")
    space = build_space(vehicle, cache=False)
    given = spoiled(np.random.default_rng(1), "ackermann", "aslant").trajectory
    plan = optimise(given, space, objective="change", time=60.0)
    assert plan.statistics["way"] == "nearest"
    ways = []
    for one in (given, plan.raise_for_status()):
        t = np.linspace(one.t[0], one.t[-1], 400)
        ways.append(PoseMotion(one.t, one.samples, 0j).poses_at(t))
    search = NearestWay(vehicle, ways[0])
    best = search.best(ways, np.random.default_rng(0), extra=0)
    assert best is not None
    ours = search.change(ways[1])
    assert ours == pytest.approx(float(plan.statistics["after"]), rel=0.01)
    assert ours < 1.15 * search.change(best)
