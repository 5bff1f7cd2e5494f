"""How near the mended way is to the nearest one: against a second solver.

`nearest_ways` writes wheel equations by hand and asks SciPy's SLSQP, from the way given
and from our own answer. The way of either that is nearer counts as the best known.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from nearest_ways import NearestWay, Pillar
from spoiled_motions import CLEARANCE, Mistake, Spoiled, spoiled

from configspace import Vehicle, build_space, load_vehicle
from omniplan import Trajectory, optimise
from omniplan.motion import PoseMotion

FloatArray = npt.NDArray[np.float64]

MISTAKES: tuple[Mistake, ...] = ("narrow", "aslant", "noisy", "pillar")
MEDIAN, WORST = 1.15, 2.0
"""Bounds on our change over the least one known."""


def dense(trajectory: Trajectory) -> FloatArray:
    t = np.linspace(trajectory.t[0], trajectory.t[-1], 600)
    motion = PoseMotion(trajectory.t, trajectory.samples, 0j)
    return np.asarray(motion.poses_at(t))


def pillar_of(case: Spoiled, vehicle: Vehicle) -> Pillar | None:
    if case.obstacles is None:
        return None
    ring = np.array(case.obstacles.pieces[0].exterior.coords)[:-1]
    assert vehicle.footprint is not None
    body = np.array(vehicle.footprint) @ [1, 1j] - vehicle.reference
    return Pillar(ring @ [1, 1j], body, CLEARANCE)


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_the_change_is_near_the_least_that_is_known() -> None:
    ratios = {}
    for name in ("ackermann", "four-wheel-steering"):
        vehicle = load_vehicle(name)
        space = build_space(vehicle, cache=False)
        for mistake in MISTAKES:
            for seed in range(4):
                rng = np.random.default_rng(seed)
                case = spoiled(rng, name, mistake)
                plan = optimise(
                    case.trajectory,
                    space,
                    case.obstacles,
                    objective="change",
                    clearance=0.0 if case.obstacles is None else CLEARANCE,
                    time=60.0,
                )
                given, made = dense(case.trajectory), dense(plan.raise_for_status())
                pillar = pillar_of(case, vehicle)
                search = NearestWay(vehicle, given, pillar=pillar)
                ours = search.change(made)
                other = search.best([given, made], rng, extra=0)
                best = ours if other is None else min(ours, search.change(other))
                ratios[name, mistake, seed] = ours / best
    assert len(ratios) == 32
    found = np.array(list(ratios.values()))
    assert np.median(found) < MEDIAN, ratios
    assert found.max() < WORST, ratios
