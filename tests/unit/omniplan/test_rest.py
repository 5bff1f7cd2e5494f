"""Where standstills begin and end, held against dense sampling and the kernels."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import configspace
from omniplan import Tolerances, Trajectory, validate
from omniplan.batch.chords import ROOM
from omniplan.batch.fleet import fleet_of
from omniplan.batch.motions import knots_of
from omniplan.batch.rests import edge_at
from omniplan.judging.vehicle_judge import VehicleJudge
from omniplan.motion import Intervals, Motion, motion_of
from omniplan.standing.rest import Edge, edge_of

STANDSTILL = Tolerances().standstill
VEHICLE = configspace.load_vehicle("choreo-frc-swerve")
JUDGE = VehicleJudge(VEHICLE, Tolerances(), is_own=False, has_rates=True)


def stop_and_go(samples: int, dwell: float, form: str) -> Trajectory:
    """Ahead with a turn, a rest, then aside; evenly sampled."""
    t = np.linspace(0.0, 8.0 + dwell, samples)
    share = np.clip(t / 4, 0, 1), np.clip((t - 4 - dwell) / 4, 0, 1)
    x, y = (f**3 * (10 + f * (6 * f - 15)) for f in share)
    poses = np.stack([x, 0.8 * y, 0.3 * x - 0.2 * y], axis=-1)
    if form == "poses":
        return Trajectory.from_poses(t, poses, name=f"{samples}")
    rates = [30 * f**2 * (1 - f) ** 2 / 4 for f in share]
    twists = np.stack([rates[0], 0.8 * rates[1], 0.3 * rates[0] - 0.2 * rates[1]], -1)
    return Trajectory.from_twists(t, twists, name=f"{samples}")


def speeds(motion: Motion, t: Any) -> Any:
    """Return max(|v| of K, |ω|/κ_g) at times."""
    whole = motion.intervals()
    knot = np.clip(np.searchsorted(whole.t0, t, side="right") - 1, 0, whole.t0.size - 1)
    e = motion.enclose(Intervals(knot, t, t))
    v = np.abs(e.v0 + 1j * e.omega0 * VEHICLE.reference)
    return np.maximum(v, np.abs(e.omega0) / VEHICLE.boundary_curvature)


def edges(motion: Motion, t: float) -> tuple[Edge, Edge]:
    """Return both ends of the standstill at a time, from the intervals that move."""
    whole = motion.intervals()
    middle = np.flatnonzero((whole.t0 <= t) & (t <= whole.t1))
    before = edge_of(motion, JUDGE, STANDSTILL, int(middle[0]), is_start=True)
    after = edge_of(motion, JUDGE, STANDSTILL, int(middle[-1]), is_start=False)
    assert before is not None
    assert after is not None
    return before, after


@pytest.mark.parametrize("form", ["poses", "twists"])
@pytest.mark.parametrize("samples", [13, 25, 61, 241])
@pytest.mark.parametrize("dwell", [0.0, 1.0])
def test_a_standstill_is_all_of_the_stretch_that_stands(
    form: str, samples: int, dwell: float
) -> None:
    motion = motion_of(stop_and_go(samples, dwell, form), is_own=False)
    before, after = edges(motion, 4 + dwell / 2)
    assert (speeds(motion, np.linspace(before.t, after.t, 2001)) <= STANDSTILL).all()
    # It is longer by no more than a part on either side.
    longest = np.diff(motion.intervals().t0).max() / 32
    beyond = np.array([before.t - longest / 16, after.t + longest / 16])
    assert (speeds(motion, beyond) > 0.9 * STANDSTILL).all()


@pytest.mark.parametrize("form", ["poses", "twists"])
@pytest.mark.parametrize("samples", [13, 61, 241])
def test_the_kernels_find_the_same_ends(form: str, samples: int) -> None:
    for dwell in (0.0, 1.0):
        trajectory = stop_and_go(samples, dwell, form)
        motion = motion_of(trajectory, is_own=False)
        whole = motion.intervals()
        knots = knots_of([trajectory])
        fleet = fleet_of([VEHICLE], Tolerances())
        room, out = np.zeros(ROOM), np.zeros(4)
        limits = np.array([STANDSTILL, 0.0, 0.0, 0.0])
        for knot in range(whole.t0.size):
            for is_start in (True, False):
                wanted = edge_of(motion, JUDGE, STANDSTILL, knot, is_start=is_start)
                found = edge_at(
                    knots.knots, knot, (0, whole.t0.size - 1), int(knots.forms[0]),
                    is_start, fleet.bodies[0], limits, room, out,
                )  # fmt: skip
                assert found == (wanted is not None)
                if wanted is None:
                    continue
                v = wanted.v + 1j * wanted.omega * VEHICLE.reference
                assert out[0] == wanted.t
                assert out[1:].tolist() == pytest.approx(
                    [v.real, v.imag, wanted.omega], rel=1e-9, abs=1e-12
                )


def test_how_long_a_standstill_is_does_not_depend_on_other_limits() -> None:
    """A narrow limit has parts cut finer; the time at rest stays the same."""
    bounds = []
    for limit in (None, 0.4, 0.01):
        vehicle = VEHICLE.model_copy(
            update={"limits": VEHICLE.limits.model_copy(update={"max_speed": limit})}
        )
        space = configspace.build_space(vehicle, configspace.Grid(40, 72), cache=False)
        report = validate(stop_and_go(61, 0.0, "poses"), space)
        bounds += [v.bound for v in report.violations if v.limit == "RECONFIGURATION"]
    assert len(bounds) == 3
    assert len(set(bounds)) == 1
