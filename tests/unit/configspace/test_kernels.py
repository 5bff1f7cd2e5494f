import naive
import numpy as np
import pytest

from configspace import kernels
from configspace.build import _load_table, _sector_table
from configspace.exact import active_rows
from configspace.limits import rows_of
from configspace.omni_curve import components
from configspace.testing import VEHICLE_KINDS, VehicleKind, random_vehicle


@pytest.mark.parametrize("kind", VEHICLE_KINDS)
def test_node_loads_agree_with_the_plain_twin(kind: VehicleKind) -> None:
    rng = np.random.default_rng(0)
    for _ in range(10):
        loads, _ = rows_of(random_vehicle(rng, kind))
        table = _load_table(loads)
        c, s = components(rng.uniform(-2, 2, 17))
        e = np.exp(1j * rng.uniform(-np.pi, np.pi, 23))
        pad = rng.uniform(0, 0.1, c.size)
        found = kernels.node_loads(c, s, e, *table, pad)
        expected = naive.node_loads(c, s, e, table, pad)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("kind", VEHICLE_KINDS)
def test_cell_bounds_agree_with_a_search_of_the_cell(kind: VehicleKind) -> None:
    rng = np.random.default_rng(1)
    for _ in range(12):
        vehicle = random_vehicle(rng, kind)
        loads, sectors = rows_of(vehicle)
        rows = active_rows(loads, True)
        piece = float(rng.integers(-2, 2))
        kappa = np.sort(piece + rng.uniform(0, 1, 2))
        beta = rng.uniform(-np.pi, np.pi) + np.array([0, rng.uniform(1e-3, 0.8)])
        c, s = components(kappa)
        table = _load_table(rows)
        low, high, *_ = kernels.cell_bounds(
            c,
            s,
            np.exp(1j * beta),
            *table,
            np.array([int(row.reason) for row in rows]),
            np.array([row.wheel for row in rows]),
            *_sector_table(sectors),
        )
        each = [
            naive.load_bounds(
                [column[i] for column in table],
                (float(kappa[0]), float(kappa[1])),
                (float(beta[0]), float(beta[1])),
            )
            for i in range(len(rows))
        ]
        least, largest = (max(values) for values in zip(*each, strict=True))
        scale = max(largest, 1.0)
        # The searched extremes lie within the bounds: largest ones are at candidates,
        # least ones may be between them.
        assert high[0, 0] == pytest.approx(largest, rel=1e-9)
        assert low[0, 0] <= least + 1e-9 * scale
        assert low[0, 0] >= least - 0.02 * scale
