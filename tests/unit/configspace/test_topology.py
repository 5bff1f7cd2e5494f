"""Components, reachability and winding, also against a plain flood fill."""

from collections import deque

import numpy as np
import numpy.typing as npt
import pytest

from configspace import Grid, InvalidInput, build_space, load_vehicle, vehicle_from_data
from configspace.kernels import BLOCKED, FREE, MIXED
from configspace.testing import random_vehicle
from configspace.topology import (
    REACHABLE,
    UNDECIDED,
    UNREACHABLE,
    components,
    part_states,
    reachable,
    summary,
    winding,
)
from configspace.vehicle import Vehicle

States = npt.NDArray[np.uint8]


def cells(*rows: str) -> States:
    """Return states: ``.`` free, ``#`` blocked, ``?`` mixed."""
    return np.array([[".#?".index(x) for x in row] for row in rows], dtype=np.uint8)


def edges(state: States) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    k, m = state.shape
    return np.linspace(-2, 2, k + 1), np.linspace(-np.pi, np.pi, m + 1)


def steered(least: float, largest: float) -> Vehicle:
    data = load_vehicle("ift-four-steered").model_dump(mode="json", exclude_none=True)
    for wheel in data["wheels"]:
        wheel["steering_range_deg"] = (least, largest)
    return vehicle_from_data(data)


def flood(state: States, possible: bool, line: bool) -> npt.NDArray[np.int64]:
    """Return labels cell by cell, in no order."""
    k, m = state.shape
    labels = np.zeros((k, m), dtype=np.int64)
    open_ = (state != BLOCKED) if possible else (state == FREE)
    count = 0
    for at in zip(*np.nonzero(open_), strict=True):
        if labels[at]:
            continue
        count += 1
        labels[at] = count
        queue = deque([at])
        while queue:
            i, j = queue.popleft()
            near = [(i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)]
            if not line:
                near = [(a, b % m) for a, b in near]
                if i in (0, k - 1) and (
                    (state[i] == FREE).any() or (state[i] != BLOCKED).all()
                ):
                    near += [(i, b) for b in range(m)]
            for a, b in near:
                if 0 <= a < k and 0 <= b < m and open_[a, b] and not labels[a, b]:
                    labels[a, b] = count
                    queue.append((a, b))
    return labels


@pytest.mark.parametrize("possible", [False, True])
@pytest.mark.parametrize("line", [False, True])
def test_components_are_those_of_a_flood_fill(possible: bool, line: bool) -> None:
    rng = np.random.default_rng(3)
    for _ in range(60):
        shape = rng.integers(2, 12, 2)
        state = rng.choice([0, 1, 2], shape, p=[0.5, 0.35, 0.15]).astype(np.uint8)
        found = components(state, possible=possible, line=line)
        naive = flood(state, possible, line)
        assert ((found > 0) == (naive > 0)).all()
        pairs = np.unique(np.stack([found, naive]).reshape(2, -1), axis=1)
        assert pairs.shape[1] == np.unique(found).size == np.unique(naive).size
        sizes = np.bincount(found.ravel())[1:]
        assert (np.diff(sizes) <= 0).all()


def test_a_component_goes_on_beyond_the_seam() -> None:
    state = cells("####", ".#..", "####")
    assert components(state).max() == 1
    assert components(state, line=True).max() == 2


def test_cells_meet_in_a_free_pole() -> None:
    state = cells("#####", "#####", ".?.?.")
    assert components(state).max() == 1
    assert components(state, line=True).max() == 3


def test_no_way_leads_through_a_blocked_pole() -> None:
    state = cells(".....", "#####", "?#?##")
    assert components(state, possible=True).max() == 3


def test_corners_do_not_connect() -> None:
    assert components(cells("####", ".###", "#.##", "####")).max() == 2


def test_one_row_has_no_pole() -> None:
    assert components(cells(".#.#")).max() == 2
    assert components(cells("..#.")).max() == 1


def test_certain_components_lie_within_possible_ones() -> None:
    rng = np.random.default_rng(4)
    state = rng.choice([0, 1, 2], (30, 40), p=[0.5, 0.4, 0.1]).astype(np.uint8)
    certain, maybe = components(state), components(state, possible=True)
    for label in range(1, certain.max() + 1):
        assert np.unique(maybe[certain == label]).size == 1


def test_nothing_permitted_gives_no_component() -> None:
    assert components(cells("###", "###")).max() == 0


def test_an_array_that_is_no_table_is_refused() -> None:
    with pytest.raises(InvalidInput, match="state: shape"):
        components(np.zeros(3, dtype=np.uint8))


def test_cells_are_reachable_or_not_or_undecided() -> None:
    state = cells(
        "########",
        "##...###",
        "##...#?.",
        "##...###",
        "##?#####",
        "##.##.##",
    )
    code = reachable(state, *edges(state))
    assert (code[1:4, 2:5] == REACHABLE).all()
    assert code[4, 2] == code[5, 2] == UNDECIDED
    assert code[2, 7] == UNREACHABLE
    # Through the pole the last two cells are one component.
    assert code[5, 5] == UNDECIDED
    assert (code[state == BLOCKED] == UNREACHABLE).all()


def test_nothing_is_reachable_from_a_blocked_start() -> None:
    state = cells("....", ".#..", ".#..", "....")
    assert (reachable(state, *edges(state)) == UNREACHABLE).all()
    assert (reachable(state, *edges(state), (1.5, 0.0)) == REACHABLE).sum() == 14


def test_an_undecided_start_reaches_nothing_for_sure() -> None:
    state = cells("####", "#??.", "#??#", "####")
    code = reachable(state, *edges(state))
    assert (code[state != BLOCKED] == UNDECIDED).all()


def test_without_a_start_the_largest_component_counts() -> None:
    state = cells("#####", "..#.#", "..###", "#####")
    code = reachable(state, *edges(state), start=None)
    assert (code[1:3, :2] == REACHABLE).all()
    assert code[1, 3] == UNREACHABLE


def test_a_start_on_the_seam_or_at_a_pole_touches_both_sides() -> None:
    state = cells("####", ".##.", "####", ".#.#")
    assert (reachable(state, *edges(state), (-0.5, np.pi)) == REACHABLE).sum() == 2
    assert (reachable(state, *edges(state), (-0.5, -np.pi)) == REACHABLE).sum() == 2
    state = cells("####", "####", "####", ".?..")
    assert (reachable(state, *edges(state), (2.0, 1.0)) == REACHABLE).sum() == 3


def test_a_line_mobile_vehicle_needs_no_beta() -> None:
    state = cells("#", ".", ".", "#", ".")
    code = reachable(state, np.linspace(-2, 2, 6), np.zeros(2))
    assert code.ravel().tolist() == [1, 0, 0, 1, 1]


@pytest.mark.parametrize("start", [(3.0, 0.0), (np.nan, 0.0), (0.0, np.inf)])
def test_an_impossible_start_is_refused(start: tuple[float, float]) -> None:
    state = cells("..", "..")
    with pytest.raises(InvalidInput):
        reachable(state, *edges(state), start)


def test_edges_that_do_not_fit_are_refused() -> None:
    state = cells("..", "..")
    with pytest.raises(InvalidInput, match="one edge more"):
        reachable(state, np.linspace(-2, 2, 4), np.linspace(-np.pi, np.pi, 3))


@pytest.mark.parametrize(
    ("name", "shape"),
    [
        ("ift-four-steered", (160, 288)),
        ("ackermann", (160, 1)),
        ("synchro-drive", (1, 288)),
    ],
)
def test_parts_are_free_where_their_bits_say(name: str, shape: tuple[int, int]) -> None:
    space = build_space(load_vehicle(name), Grid(40, 72), cache=False)
    state, kappa, beta = part_states(space)
    assert state.shape == shape == (kappa.size - 1, beta.size - 1)
    k, b = (kappa[:-1] + kappa[1:]) / 2, (beta[:-1] + beta[1:]) / 2
    free = space.v_max(*np.meshgrid(k, b, indexing="ij")) > 0
    assert free[state == FREE].all()
    assert not free[state == BLOCKED].any()
    if min(shape) > 1:
        sheet_share = (space.tables.state == MIXED).mean()
        assert 0 < (state == MIXED).mean() < 0.7 * sheet_share


def test_the_four_wheeled_example_hangs_together() -> None:
    found = summary(build_space(steered(-155, 155), Grid(80, 144), cache=False))
    assert (found.n_certain, found.n_possible) == (1, 1)
    assert found.reachable == pytest.approx(found.shares[0])
    assert found.unreachable == 0
    assert 0 < found.undecided < 0.03


def test_a_range_without_straight_ahead_reaches_nothing() -> None:
    space = build_space(steered(60, 200), Grid(80, 144), cache=False)
    found = summary(space)
    assert found.reachable == 0
    assert found.unreachable == pytest.approx(sum(found.shares))
    assert summary(space, start=None).reachable == pytest.approx(found.shares[0])


def test_a_finer_table_never_contradicts_a_coarser_one() -> None:
    rng = np.random.default_rng(11)
    joined = 0
    for _ in range(12):
        vehicle = random_vehicle(rng, "steered")
        coarse, fine = (
            build_space(vehicle, grid, cache=False).tables.state
            for grid in (Grid(16, 24), Grid(64, 96))
        )
        certain, maybe = components(coarse), components(coarse, possible=True)
        fine_certain = components(fine)
        over = np.ones((4, 4), dtype=np.int64)
        both = (np.kron(certain, over) > 0) & (fine_certain > 0)
        pairs = np.stack([np.kron(certain, over)[both], fine_certain[both]])
        # What is connected for sure stays so: one fine label each.
        assert np.unique(pairs, axis=1).shape[1] == np.unique(pairs[0]).size
        joined += pairs.shape[1]
        there = fine_certain > 0
        pairs = np.stack([fine_certain[there], np.kron(maybe, over)[there]])
        assert (pairs[1] > 0).all()
        assert np.unique(pairs, axis=1).shape[1] == np.unique(pairs[0]).size
    assert joined > 1000


@pytest.mark.parametrize("sign", [1, -1])
def test_winding_is_that_of_oracle_38(sign: int) -> None:
    vehicle = load_vehicle("ift-four-steered")
    kappa_n = sign * np.array([0, 0.5, 0.99, 1.01, 1.5, 2])
    turns = winding(vehicle, kappa_n)
    assert turns.tolist() == [[1] * 4] * 3 + [[0] * 4] * 3


def test_winding_changes_where_the_centre_of_rotation_meets_the_wheel() -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        vehicle = random_vehicle(rng, "steered")
        w = np.array([abs(x.position - vehicle.reference) for x in vehicle.wheels])
        ratio = vehicle.boundary_curvature * w
        singular = np.where(ratio > 1, 1 / ratio, 2 - ratio)
        kappa_n = rng.uniform(-2, 2, 50)
        clear = (np.abs(np.abs(kappa_n[:, None]) - singular) > 1e-9).all(axis=1)
        expected = np.abs(kappa_n[clear, None]) < singular
        assert (winding(vehicle, kappa_n[clear]) == expected).all()


def test_winding_next_to_a_singular_point_skips_no_turn() -> None:
    vehicle = load_vehicle("ift-four-steered")
    turns = winding(vehicle, [1 - 1e-7, 1 + 1e-7])
    assert turns.tolist() == [[1] * 4, [0] * 4]


def test_winding_on_a_singular_point_is_refused() -> None:
    vehicle = load_vehicle("ift-four-steered")
    with pytest.raises(InvalidInput, match="meets wheel"):
        winding(vehicle, 1.0)


def test_winding_keeps_the_shape() -> None:
    vehicle = load_vehicle("ift-four-steered")
    assert winding(vehicle, 0.3).shape == (4,)
    assert winding(vehicle, np.zeros((2, 3))).shape == (2, 3, 4)
    assert winding(vehicle, []).shape == (0, 4)
