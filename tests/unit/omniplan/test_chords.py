"""Bounds on directions of velocities, against velocities at many times."""

from __future__ import annotations

import numpy as np
import pytest

from omniplan import Trajectory
from omniplan.judging.chords import Chord, spot_spread
from omniplan.motion import Intervals, motion_of


def turning_with_drift(seed: int, drift: float) -> Trajectory:
    """A turn one way, while the origin moves by about `drift` metres."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 1, 6)
    aside = drift * rng.normal(size=(6, 2))
    heading = np.cumsum(rng.uniform(0.18, 0.22, 6))
    return Trajectory.from_poses(t, np.column_stack([aside, heading]))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("drift", [1e-3, 1e-5, 0.0])
@pytest.mark.parametrize("reference", [0j, 0.3 - 0.2j])
def test_near_a_turn_on_the_spot_directions_differ_by_little(
    seed: int, drift: float, reference: complex
) -> None:
    motion = motion_of(turning_with_drift(seed, drift), is_own=False)
    spans = motion.intervals()
    part = motion.enclose(spans)
    body, wheel = Chord.of(part, reference), Chord.of(part, 1.2 + 0.7j)
    bound = spot_spread(body, wheel)
    share = np.linspace(0, 1, 101)
    differences = []
    for i in range(spans.t0.size):
        times = spans.t0[i] + share * (spans.t1[i] - spans.t0[i])
        # Parts of no length: the twist itself.
        at = Intervals(np.full(share.size, i), times, times)
        u = Chord.of(motion.enclose(at), 1.2 + 0.7j).a
        differences.append(np.ptp(np.angle(u / u[0])))
    assert (np.array(differences) <= bound + 1e-14).all()
    if reference == 0:
        assert (bound < 1e3 * drift + 1e-14).all()
    if drift == 0 and reference == 0:
        assert (bound == 0).all()


def test_where_the_reference_is_as_fast_nothing_is_bounded() -> None:
    motion = motion_of(turning_with_drift(0, 10.0), is_own=False)
    part = motion.enclose(motion.intervals())
    body = Chord.of(part, 0j)
    assert np.isinf(spot_spread(body, body)).all()
