"""The quick reading of the table is held against the exact one."""

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import configspace
from configspace import Grid, build_space
from configspace.testing import random_vehicle
from omniplan.batch.narrow import ANGLE_ERROR, arc_tangent, narrow
from omniplan.batch.settle import settle, sheet_of

OPEN = 2
sizes = st.floats(-1e3, 1e3).filter(lambda value: value == 0 or abs(value) > 1e-12)


@settings(deadline=None)  # the first call compiles
@given(y=sizes, x=sizes)
def test_the_quick_arc_tangent_is_close(y: float, x: float) -> None:
    off = arc_tangent(y, x) - math.atan2(y, x)
    assert abs(math.remainder(off, math.tau)) <= ANGLE_ERROR


@pytest.mark.parametrize("kind", ["steered", "mecanum", "mixed"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_what_is_decided_is_decided_as_exactly(
    kind: str, dtype: type[np.floating[npt.NBitBase]]
) -> None:
    rng = np.random.default_rng(12)
    decided = []
    for _ in range(4):
        vehicle = random_vehicle(rng, kind)  # type: ignore[arg-type]
        if vehicle.mobility.line_beta is not None or vehicle.mobility.is_translating:
            continue
        space = build_space(vehicle, Grid(40, 72), cache=False)
        x, y = space.header.reference
        kappa_g, count = space.kappa_g, 20_000
        twists = rng.normal(0, 1, (count, 3)) * [1, 1, kappa_g]
        twists[:100] = np.round(twists[:100])  # on axes and borders of cells
        twists[100] = np.nan, 0, 1
        twists[101] = 0, np.inf, 0
        flat = twists.astype(dtype).reshape(-1)
        sheet, point = sheet_of(space), (x, y, kappa_g)
        open_, quick = np.arange(count, dtype=np.int32), np.full(count, OPEN, np.uint8)
        room = tuple(np.empty((3, count)))
        left = narrow(flat, open_, count, quick, point, sheet.tables, room)
        assert {100, 101} <= set(open_[:left].tolist())
        known = np.setdiff1d(np.arange(count), open_[:left]).astype(np.int32)
        exact = np.full(count, OPEN, np.uint8)
        bound = (0, 0, 0.0, math.sin(0.017), 0.005)
        bad = settle(
            flat, known, known.size, exact, point, bound, sheet.tables, sheet.loads,
            sheet.sectors, sheet.is_exact,
        )  # fmt: skip
        assert bad == -1
        np.testing.assert_array_equal(quick[known], exact[known])
        decided.append(known.size / count)
    assert decided
    assert np.mean(decided) > 0.6


def test_most_twists_near_the_limit_are_decided() -> None:
    space = build_space(configspace.load_vehicle("mecanum"), cache=False)
    rng = np.random.default_rng(1)
    count = 10_000
    kappa_n, beta = rng.uniform(-2, 2, count), rng.uniform(-math.pi, math.pi, count)
    v_s = space.v_max(kappa_n, beta) * rng.uniform(0.99, 1.01, count)
    twists = configspace.to_twist(kappa_n, beta, v_s, space.kappa_g)
    x, y = space.header.reference
    twists[:, 0] += twists[:, 2] * y
    twists[:, 1] -= twists[:, 2] * x
    open_, codes = np.arange(count, dtype=np.int32), np.zeros(count, np.uint8)
    left = narrow(
        twists.reshape(-1), open_, count, codes, (x, y, space.kappa_g),
        sheet_of(space).tables, tuple(np.empty((3, count))),
    )  # fmt: skip
    assert left < 0.02 * count
