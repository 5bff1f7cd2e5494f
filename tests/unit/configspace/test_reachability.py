import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import configspace
from configspace import Grid, Reason
from configspace.testing import ALL_KINDS, random_configurations, vehicles

GRID = Grid(80, 144)


def built(name: str) -> configspace.PermissibleSpace:
    return configspace.build_space(configspace.load_vehicle(name), GRID, cache=False)


def test_all_of_the_paper_vehicle_hangs_together() -> None:
    space = built("ift-four-steered")
    kappa_n, beta = np.meshgrid(np.linspace(-2, 2, 41), np.linspace(-3, 3, 37))
    is_free = space.v_max(kappa_n, beta) > 0
    reached = space.is_reachable(kappa_n, beta)
    assert reached[~is_free].sum() == 0
    assert reached.sum() > 0.95 * is_free.sum()
    why = space.reason(kappa_n, beta)
    assert not (why & Reason.UNREACHABLE).any()


@pytest.mark.parametrize("by_sheet", [False, True])
def test_another_component_is_permitted_but_kept_apart(by_sheet: bool) -> None:
    # A square that guarantees 1.1/s of nominal curvature with wheels that steer at
    # 1 rad/s: at |κ_n| = 1 some wheel is too near the centre of rotation for every β.
    wheels = [
        {
            "id": f"{x} {y}",
            "type": "steered",
            "x": 0.3 * x,
            "y": 0.3 * y,
            "max_speed": 1.0,
            "max_steering_rate_deg": 57.3,
        }
        for x in (1, -1)
        for y in (1, -1)
    ]
    description = {
        "name": "square",
        "wheels": wheels,
        "guaranteed": {"kappa_rate": 1.1},
    }
    vehicle = configspace.vehicle_from_data(description)
    space = configspace.build_space(vehicle, GRID, cache=False)
    if by_sheet:
        space = configspace.parse_space(configspace.dump_space(space))
    assert space.is_reachable(0.0, [0.0, 0.05]).all()
    on_the_spot = space.reason([1.95, -1.95], 0.05)
    assert (space.v_max([1.95, -1.95], 0.05) > 0).all()
    assert ((on_the_spot & Reason.UNREACHABLE) > 0).all()
    assert not space.is_reachable([1.95, -1.95], 0.05).any()
    assert not space.reason(0.01, 0.05) & Reason.UNREACHABLE
    apart = {"reachable_only": True}
    for reverse in (False, True):
        v_max = space.v_max([1.95, -1.95, 0.01], 0.05, reverse=reverse)
        reached = space.v_max([1.95, -1.95, 0.01], 0.05, reverse=reverse, **apart)
        np.testing.assert_array_equal(reached, [0, 0, v_max[2]])
        sign = -1 if reverse else 1
        assert space.contains(1.95, 0.05, 0.01 * sign)
        assert not space.contains(1.95, 0.05, 0.01 * sign, **apart)
        assert space.contains(0.01, 0.05, 0.01 * sign, **apart)


@settings(deadline=None, max_examples=10)
@given(vehicles(ALL_KINDS), st.integers(0, 2**32 - 1), st.booleans())
def test_what_is_left_out_is_apart_for_sure(
    vehicle: configspace.Vehicle, seed: int, reverse: bool
) -> None:
    """Against a flood over the exact formula on a lattice of another step."""
    rng = np.random.default_rng(seed)
    space = configspace.build_space(vehicle, Grid(48, 72), cache=False)
    kappa_n, beta = random_configurations(rng, vehicle, 300)
    full = space.v_max(kappa_n, beta, reverse=reverse)
    kept = space.v_max(kappa_n, beta, reverse=reverse, reachable_only=True)
    left_out = kept != full
    assert (kept[left_out] == 0).all()
    assert not (space.is_reachable(kappa_n, beta) & left_out).any()
    why = space.reason(kappa_n, beta, reverse=reverse)
    np.testing.assert_array_equal((why & Reason.UNREACHABLE) > 0, left_out)
    sign = -1 if reverse else 1
    held = space.contains(kappa_n, beta, sign * full, reachable_only=True)
    np.testing.assert_array_equal(held, (full > 0) & ~left_out)
    if vehicle.mobility.line_beta is not None or vehicle.mobility.is_translating:
        return
    reached = flooded(vehicle, 61, 90)
    if reached is None:
        return
    assert (space.v_max(*reached, reachable_only=True) > 0).all()


def flooded(
    vehicle: configspace.Vehicle, rows: int, columns: int
) -> tuple[np.ndarray, np.ndarray] | None:
    """Configurations with a way from straight ahead, sampled along every step."""
    kappa = np.linspace(-2, 2, rows)
    beta = np.linspace(-np.pi, np.pi, columns, endpoint=False)
    fine = np.meshgrid(
        np.linspace(-2, 2, 6 * (rows - 1) + 1),
        np.linspace(-np.pi, np.pi, 6 * columns, endpoint=False),
        indexing="ij",
    )
    open_ = configspace.exact_v_max(vehicle, *fine) > 0
    start = (rows // 2, columns // 2)
    if not open_[6 * start[0], 6 * start[1]]:
        return None
    seen, todo = {start}, [start]
    while todo:
        i, j = todo.pop()
        for di, dj in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            k, m = i + di, (j + dj) % columns
            if not 0 <= k < rows or (k, m) in seen:
                continue
            step = [open_[6 * i + n * di, (6 * j + n * dj) % len(open_[0])]
                    for n in range(7)]  # fmt: skip
            if all(step):
                seen.add((k, m))
                todo.append((k, m))
    at = np.array(sorted(seen))
    return kappa[at[:, 0]], beta[at[:, 1]]


def test_a_robot_whose_straight_ahead_is_blocked_has_its_largest_component() -> None:
    space = built("robotis-ffw")
    assert not space.contains(0.0, 0.0, 0.1)
    assert space.is_reachable(2.0, 0.0)
    assert not space.reason(2.0, 0.0) & Reason.UNREACHABLE


def test_a_line_mobile_vehicle_is_reached_along_its_line_only() -> None:
    space = built("ackermann")
    assert space.is_reachable(0.3, 0.0)
    assert not space.is_reachable(1.0, 0.0)
    assert not space.is_reachable(0.3, 0.2)


def test_a_synchro_drive_reaches_every_direction() -> None:
    space = built("synchro-drive")
    assert space.is_reachable(0.0, np.linspace(-3, 3, 13)).all()
    assert not space.is_reachable(0.5, 0.0)
