"""Proofs given up, proofs that start where another ended, judges asked at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import configspace
from configspace import Grid, PermissibleSpace
from omniplan import Tolerances, Trajectory, validate
from omniplan.judging import vehicle_judge
from omniplan.judging.vehicle_judge import VehicleJudge
from omniplan.motion import motion_of
from omniplan.proving import prove
from omniplan.validation import judged

NAMES = ("mecanum", "ift-four-steered", "ackermann", "two-turntables", "rox-argo")


class GivenUpError(Exception):
    """Raised by a checkpoint."""


@pytest.fixture(scope="module", params=NAMES)
def space(request: pytest.FixtureRequest) -> PermissibleSpace:
    vehicle = configspace.load_vehicle(request.param)
    return configspace.build_space(vehicle, Grid(40, 72), cache=False)


def curve(speed: float, n: int = 12) -> Trajectory:
    """An arc of twists that swell."""
    t = np.linspace(0.0, 6.0, n)
    v = 0.2 + 0.1 * np.sin(t)
    twists = np.stack([v, 0 * v, 0.1 * v], axis=-1)
    return Trajectory.from_twists(t, twists).scaled(speed)


def after(calls: int) -> Callable[[], None]:
    """A checkpoint that gives up when it is called that often."""
    left = [calls]

    def check() -> None:
        left[0] -= 1
        if left[0] < 0:
            raise GivenUpError

    return check


@pytest.mark.parametrize("speed", [1.0, 40.0])
def test_a_checkpoint_ends_the_work(space: PermissibleSpace, speed: float) -> None:
    trajectory, calls = curve(speed), [0]

    def count() -> None:
        calls[0] += 1

    expected = validate(trajectory, space)
    assert validate(trajectory, space, checkpoint=count) == expected
    assert calls[0] >= 2
    for n in range(calls[0]):
        with pytest.raises(GivenUpError):
            validate(trajectory, space, checkpoint=after(n))


@pytest.mark.parametrize("speed", [0.5, 2.0, 8.0, 30.0])
def test_a_proof_like_another_decides_alike(
    space: PermissibleSpace, speed: float
) -> None:
    whole = prove(curve(1.0), space)
    faster = curve(1.0).scaled(speed)
    alike = prove(faster, space, like=whole)
    assert alike.parts.stands.size >= whole.parts.stands.size
    assert alike.is_valid == prove(faster, space).is_valid
    tolerances = Tolerances()
    assert alike.is_valid == judged(faster, space, tolerances, False).valid
    # The first intervals are known all the same.
    assert alike.first.stands.size == whole.first.stands.size


def test_a_proof_of_other_intervals_starts_anew(space: PermissibleSpace) -> None:
    whole = prove(curve(1.0), space)
    other = prove(curve(1.0, n=9), space, like=whole)
    assert other.is_valid == prove(curve(1.0, n=9), space).is_valid


def test_parts_are_judged_alike_few_or_many_at_once(
    space: PermissibleSpace, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert space.vehicle is not None
    poses = np.cumsum(np.random.default_rng(4).normal(size=(9, 3)) * 0.2, axis=0)
    motion = motion_of(Trajectory.from_poses(np.arange(9.0), poses), is_own=False)
    judge = VehicleJudge(
        space.vehicle, Tolerances(), is_own=False, has_rates=True, has_swing=True
    )
    parts = motion.enclose(motion.intervals())
    at_once = judge.utilisations(parts, (1, -1))
    monkeypatch.setattr(vehicle_judge, "AT_ONCE", 20)
    for sign, bounds in at_once.items():
        for some in (
            judge.utilisation(parts, sign),
            judge.utilisations(parts, (-1, 1))[sign],
        ):
            for found, expected in zip(some, bounds, strict=True):
                np.testing.assert_array_equal(found, expected)
