import numpy as np

from configspace.kernels import BLOCKED, FREE, MIXED
from configspace.rounding import round_tables


def test_tables_are_rounded_to_the_safe_side_and_no_further() -> None:
    rng = np.random.default_rng(0)
    for rows, columns in ((1, 9), (8, 1), (12, 17)):
        shape = (rows, columns)
        nodes = 10 ** rng.uniform(-8, 4, (rows + 1, columns + 1))
        row_pad = 10 ** rng.uniform(-9, -2, rows + 1)
        cell_pad = np.where(rng.random(shape) < 0.5, rng.random(shape), 0.0)
        low = np.where(rng.random(shape) < 0.2, 0.0, 10 ** rng.uniform(-8, 4, shape))
        high = low + rng.random(shape) + 1e-3
        state = rng.choice([FREE, BLOCKED, MIXED], shape).astype(np.uint8)
        load, v_lo, v_hi = round_tables(nodes, row_pad, cell_pad, low, high, state)
        around = np.pad(cell_pad, 1)
        pads = [
            around[i : i + rows + 1, j : j + columns + 1] for i, j in np.ndindex(2, 2)
        ]
        expected = nodes + row_pad[:, None] + np.max(pads, axis=0)
        assert load.dtype == v_lo.dtype == v_hi.dtype == np.float32
        assert (load.astype(float) >= expected).all()
        np.testing.assert_allclose(load, expected, rtol=2e-7)
        with np.errstate(divide="ignore"):
            slowest, fastest = 1 / np.sqrt(high), np.minimum(1 / np.sqrt(low), 3e38)
        assert (v_lo.astype(float) <= np.where(state == FREE, slowest, 0)).all()
        assert (v_hi.astype(float) >= np.where(state == BLOCKED, 0, fastest)).all()
        np.testing.assert_allclose(v_lo, np.where(state == FREE, slowest, 0), rtol=2e-7)
        np.testing.assert_allclose(
            v_hi, np.where(state == BLOCKED, 0, fastest), rtol=2e-7
        )


def test_a_load_is_never_nothing() -> None:
    flat = np.zeros((2, 2))
    one = np.zeros((1, 1))
    state = np.full((1, 1), MIXED, np.uint8)
    load, v_lo, v_hi = round_tables(flat, np.zeros(2), one, one, one + 1, state)
    assert (load > 0).all()
    assert v_lo[0, 0] == 0
    assert np.isfinite(v_hi[0, 0])
