import naive
import numpy as np
import pytest

from configspace import kernels
from configspace.build import _load_table, _sector_table
from configspace.exact import active_rows, turning_excess
from configspace.grid import Grid, edges_of
from configspace.limits import LoadRow, Reason, SectorRow, rows_of
from configspace.omni_curve import components
from configspace.testing import ALL_KINDS, VehicleKind, random_vehicle
from configspace.vehicle import Vehicle

EXACT_KINDS = {naive.DISC, naive.STRIP}


def random_edges(
    rng: np.random.Generator, vehicle: Vehicle
) -> tuple[np.ndarray, np.ndarray]:
    grid = Grid(4 * int(rng.integers(1, 20)), int(rng.integers(8, 70)))
    return edges_of(vehicle.mobility, grid)


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_loads_at_nodes_agree_with_the_plain_twin(kind: VehicleKind) -> None:
    rng = np.random.default_rng(0)
    for _ in range(5):
        vehicle = random_vehicle(rng, kind)
        loads, sectors = rows_of(vehicle)
        table, edges = _load_table(loads), random_edges(rng, vehicle)
        found = kernels.cell_tables(*edges, table, _sector_table(sectors))
        expected = naive.node_loads(*edges, table)
        np.testing.assert_allclose(found[0], expected, rtol=1e-9, atol=1e-12)


def within(
    row: LoadRow, kappa: tuple[float, float], beta: tuple[float, float]
) -> tuple[float, float]:
    columns = [column[0] for column in _load_table([row])]
    return naive.load_bounds(columns, kappa, beta)


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_cell_bounds_agree_with_a_search_of_the_cell(kind: VehicleKind) -> None:
    rng = np.random.default_rng(1)
    for _ in range(8):
        vehicle = random_vehicle(rng, kind)
        loads, sectors = rows_of(vehicle)
        rows = active_rows(loads, True)
        table = _load_table(rows)
        kappa, beta = random_edges(rng, vehicle)
        _, _, low, high, state, *_ = kernels.cell_tables(
            kappa, beta, table, _sector_table(sectors)
        )
        is_exact = set(table[0]) <= EXACT_KINDS
        step = (kappa[1] - kappa[0]) + (beta[1] - beta[0])
        for k, m in rng.permutation(np.argwhere(state != kernels.BLOCKED))[:6]:
            cell = (
                (float(kappa[k]), float(kappa[k + 1])),
                (float(beta[m]), float(beta[m + 1])),
            )
            each = [within(row, *cell) for row in rows]
            least, largest = (max(values) for values in zip(*each, strict=True))
            scale = max(largest, 1.0)
            # The searched extremes lie within the bounds: largest ones are at
            # candidates, least ones may be between them. Products of two terms and
            # what stands beside an axis are bounded term by term.
            assert high[k, m] >= largest * (1 - 1e-9)
            assert low[k, m] <= least + 1e-9 * scale
            if is_exact:
                assert high[k, m] == pytest.approx(largest, rel=1e-9)
                assert low[k, m] >= least - 0.02 * scale
            else:
                steepest = max(load_slope(row) for row in rows)
                assert high[k, m] <= largest + step * steepest
                assert low[k, m] >= least - step * steepest - 0.02 * scale


def load_slope(row: LoadRow) -> float:
    """A bound on the slope of a row's load, doubled."""
    if row.kind in {"lateral", "edge"}:
        return 4 * row.p * (1 + abs(row.b))
    return 4 * (row.p + abs(row.b) + abs(row.d)) ** 2


@pytest.mark.parametrize("kind", ["disc", "strip", "offset", "lateral", "edge"])
def test_rows_of_one_kind_are_bounded_over_any_cell(kind: str) -> None:
    rng = np.random.default_rng(3)
    none = _sector_table([])
    for _ in range(12):
        row = LoadRow(
            Reason.WHEEL_SPEED,
            kind,  # type: ignore[arg-type]
            p=float(rng.uniform(0.1, 3)),
            b=complex(*rng.normal(size=2)),
            nu=float(rng.uniform(-np.pi, np.pi)),
            d=float(rng.normal()) if kind == "offset" else 0.0,
        )
        grid = Grid(4 * int(rng.integers(1, 12)), int(rng.integers(8, 60)))
        kappa, beta = grid.kappa_edges, grid.beta_edges
        nodes, pad, low, high, *_ = kernels.cell_tables(
            kappa, beta, _load_table([row]), none
        )
        assert (pad > 0).any() == (kind == "offset")
        for k, m in rng.permutation(np.argwhere(low <= high))[:25]:
            cell = (
                (float(kappa[k]), float(kappa[k + 1])),
                (float(beta[m]), float(beta[m + 1])),
            )
            least, largest = within(row, *cell)
            assert low[k, m] <= least + 1e-9
            assert high[k, m] >= largest - 1e-9
            if kind in {"disc", "strip"}:
                assert high[k, m] == pytest.approx(largest, rel=1e-9, abs=1e-12)
            if kind == "offset":
                # The padded corners, interpolated, are nowhere too low.
                x, y = rng.random((2, 30))
                between = (1 - x) * (1 - y) * nodes[k, m] + x * y * nodes[k + 1, m + 1]
                between += x * (1 - y) * nodes[k + 1, m] + (1 - x) * y * nodes[k, m + 1]
                columns = [column[0] for column in _load_table([row])]
                for i in range(30):
                    at = kappa[k] + x[i] * (kappa[k + 1] - kappa[k])
                    angle = beta[m] + y[i] * (beta[m + 1] - beta[m])
                    load = naive.row_load(columns, *naive.split(float(at)), angle)
                    assert between[i] + pad[k, m] >= load - 1e-12


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_working_in_blocks_changes_nothing(
    kind: VehicleKind, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(2)
    for _ in range(4):
        vehicle = random_vehicle(rng, kind)
        loads, sectors = rows_of(vehicle)
        edges = edges_of(vehicle.mobility, Grid(96, 130))
        tables = _load_table(loads), _sector_table(sectors)
        found = kernels.cell_tables(*edges, *tables)
        monkeypatch.setattr(kernels, "_BLOCK", 1)
        nodes, pad, low, high, state, parts, _, _ = kernels.cell_tables(*edges, *tables)
        monkeypatch.undo()
        np.testing.assert_array_equal(found[0], nodes)
        np.testing.assert_array_equal(found[4], state)
        np.testing.assert_array_equal(found[5], parts)
        settled = state != kernels.BLOCKED
        for one, other in zip(found[1:4], (pad, low, high), strict=True):
            np.testing.assert_array_equal(one[settled], other[settled])


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_parts_agree_with_the_state(kind: VehicleKind) -> None:
    rng = np.random.default_rng(4)
    for _ in range(6):
        vehicle = random_vehicle(rng, kind)
        loads, sectors = rows_of(vehicle)
        *_, state, parts, reason, wheel = kernels.cell_tables(
            *random_edges(rng, vehicle), _load_table(loads), _sector_table(sectors)
        )
        assert (parts[state == kernels.FREE] == 0xFFFF).all()
        assert (parts[state == kernels.BLOCKED] == 0).all()
        assert (parts[state == kernels.MIXED] != 0xFFFF).all()
        assert (reason != 0).all()
        assert ((wheel >= -1) & (wheel < len(vehicle.wheels))).all()
        blocks = Reason.STEER_RANGE | Reason.SINGULAR
        assert ((reason & blocks != 0) == (state != kernels.FREE)).all()


def test_free_cells_keep_clear_of_the_singular_zone() -> None:
    rng = np.random.default_rng(5)
    place = np.linspace(0, 1, 9)
    seen = np.zeros(3, int)
    for _ in range(150):
        b = complex(*rng.normal(size=2))
        shares = rng.uniform(0, 1.2, 2) * rng.permutation(
            np.array([1, int(rng.integers(2))])
        )
        row = SectorRow(b, 0.0, np.inf, 0, *(float(share) for share in shares))
        grid = Grid(4 * int(rng.integers(1, 8)), int(rng.integers(8, 40)))
        kappa, beta = grid.kappa_edges, grid.beta_edges
        load = _load_table([LoadRow(Reason.SPEED, "disc", 1.0, 1j)])
        state = kernels.cell_tables(kappa, beta, load, _sector_table([row]))[4]
        k = kappa[:-1, None] + place * np.diff(kappa)[:, None]
        m = beta[:-1, None] + place * np.diff(beta)[:, None]
        c, s = components(k[:, None, :, None])
        e = np.exp(1j * m[None, :, None, :])
        excess = turning_excess(row, c, s, e)
        assert (excess.max(axis=(2, 3))[state == kernels.FREE] <= 1e-12).all()
        assert (excess.min(axis=(2, 3))[state == kernels.BLOCKED] >= -1e-12).all()
        seen += np.bincount(state.ravel(), minlength=3)
    assert (seen > 1000).all()


def test_blocks_cover_all_cells_and_are_small() -> None:
    for n_cells in range(1, 200):
        edges = kernels.block_edges(n_cells, 12)
        assert edges[0] == 0
        assert edges[-1] == n_cells
        assert (np.diff(edges) >= 1).all()
        assert (np.diff(edges) <= 12).all()
