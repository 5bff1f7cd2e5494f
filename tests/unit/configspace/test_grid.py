import numpy as np
import pytest

import configspace
from configspace import Grid


@pytest.mark.parametrize("n_kappa", [4, 12, 28, 100, 400, 4000])
def test_kinks_are_edges_to_the_last_bit(n_kappa: int) -> None:
    edges = Grid(n_kappa, 8).kappa_edges
    assert edges.shape == (n_kappa + 1,)
    assert {-2.0, -1.0, 0.0, 1.0, 2.0} <= set(edges.tolist())
    assert (np.diff(edges) > 0).all()


@pytest.mark.parametrize("n_beta", [8, 9, 720, 7200])
def test_beta_runs_over_one_turn(n_beta: int) -> None:
    edges = Grid(4, n_beta).beta_edges
    assert edges.shape == (n_beta + 1,)
    assert (edges[0], edges[-1]) == (-np.pi, np.pi)
    np.testing.assert_allclose(np.diff(edges), 2 * np.pi / n_beta)


@pytest.mark.parametrize(
    ("n_kappa", "n_beta", "where"),
    [
        (0, 8, "n_kappa"),
        (6, 8, "n_kappa"),
        (4004, 8, "n_kappa"),
        (-4, 8, "n_kappa"),
        (4, 7, "n_beta"),
        (4, 7201, "n_beta"),
    ],
)
def test_other_sizes_are_errors(n_kappa: int, n_beta: int, where: str) -> None:
    with pytest.raises(configspace.InvalidInput, match=where):
        Grid(n_kappa, n_beta)


def test_edges_are_read_only() -> None:
    grid = Grid(4, 8)
    for edges in (grid.kappa_edges, grid.beta_edges):
        with pytest.raises(ValueError, match="read-only"):
            edges[0] = 1.0
