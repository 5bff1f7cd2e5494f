"""Strategies for hypothesis, which is imported when one is asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from configspace.grid import Grid
from configspace.testing.kinds import VEHICLE_KINDS, VehicleKind
from configspace.testing.random_vehicles import random_vehicle
from configspace.vehicle import Vehicle

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

__all__ = ["configurations", "grids", "vehicles"]


def vehicles(
    kinds: tuple[VehicleKind, ...] = VEHICLE_KINDS,
) -> SearchStrategy[Vehicle]:
    """Return a hypothesis strategy for vehicles of these kinds."""
    from hypothesis import strategies

    def build(kind: VehicleKind, seed: int) -> Vehicle:
        return random_vehicle(np.random.default_rng(seed), kind)

    seeds = strategies.integers(0, 2**32 - 1)
    return strategies.builds(build, strategies.sampled_from(kinds), seeds)


def configurations() -> SearchStrategy[tuple[float, float]]:
    """Return a hypothesis strategy for (κ_n, β), kinks and seam included."""
    from hypothesis import strategies as st

    tiny = st.sampled_from([0.0, 1e-16, -1e-16, 1e-12, -1e-12, 1e-6, -1e-6])
    kinks = st.sampled_from([-2.0, -1.0, 0.0, 1.0, 2.0])
    seams = st.sampled_from([-np.pi, -np.pi / 2, 0.0, np.pi / 2, np.pi])
    near_kink = st.builds(lambda k, d: min(2.0, max(-2.0, k + d)), kinks, tiny)
    near_seam = st.builds(lambda b, d: float(b + d), seams, tiny)
    return st.tuples(
        st.one_of(near_kink, st.floats(-2, 2)),
        st.one_of(near_seam, st.floats(-np.pi, np.pi)),
    )


def grids(largest: int = 48) -> SearchStrategy[Grid]:
    """Return a hypothesis strategy for coarse grids, from 16 × 24, quick to build."""
    from hypothesis import strategies as st

    quarters = st.integers(4, max(4, largest // 4))
    return st.builds(
        lambda quarter, n_beta: Grid(4 * quarter, n_beta),
        quarters,
        st.integers(24, max(24, largest)),
    )
