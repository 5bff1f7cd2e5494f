import math

import numpy as np
import pytest

import configspace
from configspace import PermissibleSpace
from omniplan import Trajectory, validate
from omniplan.choosing.passages import backwards, passage_shortfalls
from omniplan.choosing.requirements import NoMirroring, PassableBackwards
from omniplan.proving import prove


@pytest.fixture(scope="module")
def space() -> PermissibleSpace:
    """Four wheels that steer from -10° to 190°."""
    wheels = [
        {
            "type": "steered",
            "id": f"w{x}{y}",
            "x": 0.3 * x,
            "y": 0.2 * y,
            "max_speed": 1.0,
            "steering_range_deg": [-10.0, 190.0],
            "max_steering_rate_deg": 180.0,
        }
        for x in (1, -1)
        for y in (1, -1)
    ]
    vehicle = configspace.vehicle_from_data({"name": "half-round", "wheels": wheels})
    return configspace.build_space(vehicle, configspace.Grid(40, 72), cache=False)


def corner(first: float, second: float) -> Trajectory:
    """Move in one direction, rest, move in another one; degrees."""
    v = [0.3 * np.exp(1j * math.radians(angle)) for angle in (first, second)]
    t = [0, 1, 2, 6, 7, 8]
    twists = [[0, 0, 0], [v[0].real, v[0].imag, 0], [0, 0, 0]]
    twists += [[0, 0, 0], [v[1].real, v[1].imag, 0], [0, 0, 0]]
    return Trajectory.from_twists(t, twists, name=f"{first:g} then {second:g}")


@pytest.mark.parametrize(
    ("first", "second", "mirrors"),
    [
        (5, 5, False),
        (5, 90, False),
        (5, -175, False),  # straight back: the same configuration, reversed
        (15, -20, True),  # -20° and 195° are out of range: 160°, reversed
        (5, -20, False),  # 185° and 160°, both reversed
        (170, -15, False),  # -15° is 165° reversed
    ],
)
def test_mirroring_is_seen_at_standstills(
    space: PermissibleSpace, first: float, second: float, mirrors: bool
) -> None:
    trajectory = corner(first, second)
    assert validate(trajectory, space).valid
    found = passage_shortfalls(
        prove(trajectory, space), [NoMirroring()], allow_unreachable=False
    )
    assert bool(found) == mirrors
    if mirrors:
        assert "no mirroring: at the standstill at t = 4.00 s" in str(found[0])
        assert found[0].limit == "RECONFIGURATION"
        assert found[0].wheel in {"w11", "w1-1", "w-11", "w-1-1"}


def test_way_back_is_judged_with_the_limits_of_driving_backwards() -> None:
    vehicle = configspace.load_vehicle("ackermann")  # 0.8 m/s backwards
    space = configspace.build_space(vehicle, configspace.Grid(40, 72), cache=False)
    for speed, ok in ((0.7, True), (1.0, False)):
        ahead = Trajectory.from_twists([0, 4], [[speed, 0, 0]] * 2)
        assert validate(ahead, space).valid
        found = passage_shortfalls(
            prove(ahead, space), [PassableBackwards()], allow_unreachable=False
        )
        assert (not found) == ok
    assert found[0].limit == "REVERSE_SPEED"
    assert "speed backwards 1.000 m/s, at most 0.800 m/s" in str(found[0])


def test_reversing_twice_gives_the_trajectory_back() -> None:
    vehicle = configspace.load_vehicle("mecanum")
    t = [1.0, 1.5, 4.0]
    for trajectory in (
        Trajectory.from_poses(t, [[0.0, 0, 0], [1, 0, 0.2], [2, 1, 0.4]]),
        Trajectory.from_twists(t, [[0.0, 0, 0], [1, 0, 0.2], [0.2, 1, 0.4]]),
        Trajectory.from_omni_curve(t, [0, 0.1, 0.2], [0, 0.1, 0], [0, 0.5, 1], vehicle),
    ):
        once = backwards(trajectory)
        assert once.t[0] == trajectory.t[0]
        assert once.duration == trajectory.duration
        assert not once.samples.flags.writeable
        twice = backwards(once)
        np.testing.assert_allclose(twice.t, trajectory.t, rtol=1e-15)
        np.testing.assert_array_equal(twice.samples, trajectory.samples)
    poses = backwards(Trajectory.from_poses(t, [[0, 0, 0], [1, 0, 0], [2, 0, 0]]))
    np.testing.assert_array_equal(poses.samples[:, 0], [2, 1, 0])
    np.testing.assert_allclose(poses.t, [1.0, 3.5, 4.0])
