import naive
import numpy as np
import pytest

from configspace import kernels
from configspace.build import _load_table, _sector_table
from configspace.exact import active_rows
from configspace.grid import Grid
from configspace.limits import rows_of
from configspace.omni_curve import components
from configspace.testing import VEHICLE_KINDS, VehicleKind, random_vehicle


def random_grid(rng: np.random.Generator) -> Grid:
    return Grid(4 * int(rng.integers(1, 20)), int(rng.integers(8, 70)))


@pytest.mark.parametrize("kind", VEHICLE_KINDS)
def test_loads_at_nodes_agree_with_the_plain_twin(kind: VehicleKind) -> None:
    rng = np.random.default_rng(0)
    for _ in range(10):
        loads, sectors = rows_of(random_vehicle(rng, kind))
        table, grid = _load_table(loads), random_grid(rng)
        c, s = components(grid.kappa_edges)
        e = np.exp(1j * grid.beta_edges)
        nodes, *_ = kernels.cell_tables(c, s, e, table, _sector_table(sectors))
        expected = naive.node_loads(c, s, e, table[:4], np.zeros_like(c))
        np.testing.assert_allclose(nodes, expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("kind", VEHICLE_KINDS)
def test_cell_bounds_agree_with_a_search_of_the_cell(kind: VehicleKind) -> None:
    rng = np.random.default_rng(1)
    for _ in range(8):
        loads, sectors = rows_of(random_vehicle(rng, kind))
        rows, grid = active_rows(loads, True), random_grid(rng)
        table = _load_table(rows)
        kappa, beta = grid.kappa_edges, grid.beta_edges
        c, s = components(kappa)
        _, low, high, state, *_ = kernels.cell_tables(
            c, s, np.exp(1j * beta), table, _sector_table(sectors)
        )
        for k, m in rng.permutation(np.argwhere(state != kernels.BLOCKED))[:6]:
            each = [
                naive.load_bounds(
                    [column[i] for column in table[:4]],
                    (float(kappa[k]), float(kappa[k + 1])),
                    (float(beta[m]), float(beta[m + 1])),
                )
                for i in range(len(rows))
            ]
            least, largest = (max(values) for values in zip(*each, strict=True))
            scale = max(largest, 1.0)
            # The searched extremes lie within the bounds: largest ones are at
            # candidates, least ones may be between them.
            assert high[k, m] == pytest.approx(largest, rel=1e-9)
            assert low[k, m] <= least + 1e-9 * scale
            assert low[k, m] >= least - 0.02 * scale


@pytest.mark.parametrize("kind", VEHICLE_KINDS)
def test_working_in_blocks_changes_nothing(
    kind: VehicleKind, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(2)
    for _ in range(5):
        loads, sectors = rows_of(random_vehicle(rng, kind))
        grid = Grid(96, 130)
        c, s = components(grid.kappa_edges)
        e = np.exp(1j * grid.beta_edges)
        tables = _load_table(loads), _sector_table(sectors)
        found = kernels.cell_tables(c, s, e, *tables)
        monkeypatch.setattr(kernels, "_BLOCK", 1)
        nodes, low, high, state, _, _ = kernels.cell_tables(c, s, e, *tables)
        monkeypatch.undo()
        np.testing.assert_array_equal(found[0], nodes)
        np.testing.assert_array_equal(found[3], state)
        settled = state != kernels.BLOCKED
        np.testing.assert_array_equal(found[1][settled], low[settled])
        np.testing.assert_array_equal(found[2][settled], high[settled])


def test_blocks_cover_all_cells_and_are_small() -> None:
    for n_cells in range(1, 200):
        edges = kernels.block_edges(n_cells, 12)
        assert edges[0] == 0
        assert edges[-1] == n_cells
        assert (np.diff(edges) >= 1).all()
        assert (np.diff(edges) <= 12).all()
