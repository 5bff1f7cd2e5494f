from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import configspace
from configspace import PermissibleSpace, Reason
from configspace.kernels import BLOCKED, FREE, MIXED
from configspace.testing import rigid_body

SpaceOf = Callable[[str], PermissibleSpace]


def sheet_of(space: PermissibleSpace) -> PermissibleSpace:
    return configspace.parse_space(configspace.dump_space(space))


@pytest.fixture
def ift(space_of: SpaceOf) -> PermissibleSpace:
    return space_of("ift-four-steered")


@pytest.fixture
def ackermann(space_of: SpaceOf) -> PermissibleSpace:
    return space_of("ackermann")


def test_v_max_is_a_little_below_the_exact_one_and_never_above(
    space_of: SpaceOf,
) -> None:
    rng = np.random.default_rng(0)
    kappa_n, beta = rng.uniform(-2, 2, 20_000), rng.uniform(-np.pi, np.pi, 20_000)
    for name in ("ift-four-steered", "mecanum"):
        vehicle = configspace.load_vehicle(name)
        exact = configspace.exact_v_max(vehicle, kappa_n, beta)
        v_max = space_of(name).v_max(kappa_n, beta)
        assert (v_max <= exact).all()
        loss = (exact - v_max)[exact > 0] / exact[exact > 0]
        assert loss.max() < 1e-3
        assert loss.mean() < 2e-4


def test_reverse_speed_may_be_smaller(ackermann: PermissibleSpace) -> None:
    assert float(ackermann.v_max(0.0, 0.0)) == pytest.approx(1.5, rel=1e-6)
    assert float(ackermann.v_max(0.0, 0.0, reverse=True)) == pytest.approx(
        0.8, rel=1e-6
    )
    v_s = np.array([1.4, -1.4, -0.79, -0.81, 0.0])
    np.testing.assert_array_equal(
        ackermann.contains(0.0, 0.0, v_s), [True, False, True, False, True]
    )


def test_reverse_is_the_same_where_no_limit_differs(ift: PermissibleSpace) -> None:
    assert ift.tables.load.shape[0] == 1
    kappa_n = np.linspace(-2, 2, 50)
    np.testing.assert_array_equal(
        ift.v_max(kappa_n, 0.3), ift.v_max(kappa_n, 0.3, reverse=True)
    )


@pytest.mark.parametrize("with_vehicle", [True, False])
def test_line_mobile_vehicles_keep_to_their_line(
    ackermann: PermissibleSpace, with_vehicle: bool
) -> None:
    space = ackermann if with_vehicle else sheet_of(ackermann)
    assert space.line_beta == 0.0
    beta = np.array([0.0, 1e-10, -1e-10, 2 * np.pi, 1e-7, -1e-7, 0.3, np.pi])
    expected = [True, True, True, True, False, False, False, False]
    np.testing.assert_array_equal(space.v_max(0.1, beta) > 0, expected)
    assert int(space.reason(0.1, 0.3)) & Reason.FIXED_WHEEL


def test_line_mobile_vehicles_turn_about_k_at_any_beta(space_of: SpaceOf) -> None:
    space = space_of("differential")
    beta = np.linspace(-np.pi, np.pi, 7)
    for either in (space, sheet_of(space)):
        for pole in (-2.0, 2.0):
            v_max = either.v_max(pole, beta)
            np.testing.assert_allclose(v_max, 1.0, rtol=1e-6)


def test_pole_is_one_configuration(ift: PermissibleSpace) -> None:
    for either in (ift, sheet_of(ift)):
        v_max = either.v_max(2.0, np.linspace(-np.pi, np.pi, 400))
        np.testing.assert_allclose(v_max, 1.0, rtol=1e-6)
        np.testing.assert_allclose(either.v_max(-2.0, 1.0), 1.0, rtol=1e-6)


def test_beta_is_periodic(ift: PermissibleSpace) -> None:
    rng = np.random.default_rng(1)
    kappa_n, beta = rng.uniform(-2, 2, 2000), rng.uniform(-np.pi, np.pi, 2000)
    for turns in (-3, 1, 10):
        np.testing.assert_allclose(
            ift.v_max(kappa_n, beta + turns * 2 * np.pi),
            ift.v_max(kappa_n, beta),
            rtol=1e-12,
        )
    np.testing.assert_allclose(ift.v_max(1.5, np.pi), ift.v_max(1.5, -np.pi), rtol=1e-9)


def test_answers_do_not_depend_on_the_size_of_beta(space_of: SpaceOf) -> None:
    space = space_of("mecanum")
    vehicle = configspace.load_vehicle("mecanum")
    rng = np.random.default_rng(2)
    kappa_n = rng.uniform(-2, 2, 500)
    for size in (1e3, 1e6, 1e9, 1e12):
        beta = rng.uniform(-size, size, 500)
        exact = rigid_body(vehicle, kappa_n, beta).v_max
        assert (space.v_max(kappa_n, beta) <= exact * (1 + 1e-12)).all()


def test_shapes_broadcast(ift: PermissibleSpace) -> None:
    assert ift.v_max(0.0, 0.0).shape == ()
    assert ift.v_max(np.zeros((4, 1)), np.zeros(3)).shape == (4, 3)
    assert ift.v_max(np.zeros(0), 0.0).shape == (0,)
    assert ift.contains(np.zeros((2, 1)), np.zeros(3), np.zeros((5, 1, 1))).shape == (
        5,
        2,
        3,
    )
    why, who = ift.explain(np.zeros((4, 1)), np.zeros(3))
    assert why.shape == who.shape == (4, 3)
    v_max = ift.v_max([0.0, 0.5], [[0.0], [3.0]])
    for i, beta in enumerate((0.0, 3.0)):
        for j, kappa_n in enumerate((0.0, 0.5)):
            assert v_max[i, j] == ift.v_max(kappa_n, beta)


def test_shapes_that_do_not_broadcast_are_errors(ift: PermissibleSpace) -> None:
    with pytest.raises(ValueError, match="shape"):
        ift.v_max(np.zeros(3), np.zeros(4))


@pytest.mark.parametrize(
    ("kappa_n", "beta"),
    [
        (np.nan, 0.0),
        (np.inf, 0.0),
        (2.0001, 0.0),
        (-2.0001, 0.0),
        (0.0, np.nan),
        (0.0, -np.inf),
        ("a", 0.0),
        (0.0, None),
        (1j, 0.0),
    ],
)
def test_refuses_what_is_not_a_configuration(
    ift: PermissibleSpace, kappa_n: Any, beta: Any
) -> None:
    for query in (ift.v_max, ift.reason, ift.explain):
        with pytest.raises(configspace.InvalidInput):
            query(kappa_n, beta)
    with pytest.raises(configspace.InvalidInput):
        ift.contains(kappa_n, beta, 0.0)
    with pytest.raises(configspace.InvalidInput):
        ift.contains(0.0, 0.0, np.nan)


def test_arrays_are_read_only(ift: PermissibleSpace) -> None:
    for space in (ift, sheet_of(ift)):
        for array in vars(space.tables).values():
            with pytest.raises(ValueError, match="read-only"):
                array[..., 0] = 0


def test_spaces_are_frozen(ift: PermissibleSpace) -> None:
    with pytest.raises(AttributeError):
        ift.vehicle = None  # type: ignore[misc]


def test_inputs_are_not_changed(ift: PermissibleSpace) -> None:
    kappa_n, beta = np.array([0.2, 1.0]), np.array([3.0, -3.0])
    ift.contains(kappa_n, beta, 0.5)
    np.testing.assert_array_equal(kappa_n, [0.2, 1.0])
    np.testing.assert_array_equal(beta, [3.0, -3.0])


def test_contains_standstill_only_where_permitted(ift: PermissibleSpace) -> None:
    assert bool(ift.contains(0.0, 0.0, 0.0))
    assert not bool(ift.contains(0.0, 3.0, 0.0))


def test_reasons_name_the_limit_and_the_wheel(ift: PermissibleSpace) -> None:
    assert int(ift.reason(0.0, 3.0)) == Reason.STEER_RANGE
    # At κ_n = 2 every wheel binds, the first is named; K does not move.
    why, who = ift.explain(2.0, 0.0)
    assert (int(why), int(who)) == (Reason.WHEEL_SPEED, 0)
    # A left turn: the outer wheels, on the right, bind.
    why, who = ift.explain(0.5, 0.0)
    assert int(why) == Reason.WHEEL_SPEED
    assert ift.header.wheel_ids[int(who)] in {"front-right", "rear-right"}
    vehicle = configspace.load_vehicle("ift-four-steered")
    w = vehicle.wheels[0].position
    singular = np.angle(1j * -w)
    why, who = ift.explain(1.0, singular)
    assert int(why) & Reason.SINGULAR
    assert int(who) == 0


def test_reasons_of_the_sheet_include_the_exact_ones(space_of: SpaceOf) -> None:
    rng = np.random.default_rng(3)
    for name in ("ift-four-steered", "mecanum"):
        space = space_of(name)
        sheet = sheet_of(space)
        kappa_n, beta = rng.uniform(-2, 2, 5000), rng.uniform(-np.pi, np.pi, 5000)
        row = np.searchsorted(space.grid.kappa_edges, kappa_n) - 1
        column = np.searchsorted(space.grid.beta_edges, beta) - 1
        settled = space.tables.state[row, column] != MIXED
        exact, table = space.reason(kappa_n, beta), sheet.reason(kappa_n, beta)
        assert (exact & ~table)[settled].max() == 0


def part(space: PermissibleSpace, index: int) -> tuple[np.ndarray, np.ndarray]:
    """Middles of one of the sixteen parts of all mixed cells."""
    mixed = np.argwhere(space.tables.state == MIXED)
    k, b = space.grid.kappa_edges, space.grid.beta_edges
    kappa_n = k[mixed[:, 0]] + (index // 4 + 0.5) / 4 * (k[1] - k[0])
    beta = b[mixed[:, 1]] + (index % 4 + 0.5) / 4 * (b[1] - b[0])
    return kappa_n, beta


def test_sheet_permits_the_free_parts_of_mixed_cells(ift: PermissibleSpace) -> None:
    sheet = sheet_of(ift)
    assert sheet.vehicle is None
    mixed = ift.tables.state == MIXED
    seen = 0
    for index in range(16):
        free = (ift.tables.parts[mixed] >> index) & 1 == 1
        at = part(ift, index)
        np.testing.assert_array_equal(sheet.v_max(*at) > 0, free)
        assert (ift.v_max(*at)[free] > 0).all()
        seen += int(free.sum())
    assert 0.2 < seen / (16 * mixed.sum()) < 0.8


def test_box_inside_a_free_part_of_a_mixed_cell_is_free(ift: PermissibleSpace) -> None:
    mixed = ift.tables.state == MIXED
    size = 0.1 * np.array([4 / ift.grid.n_kappa, 2 * np.pi / ift.grid.n_beta])
    for index in range(16):
        free = (ift.tables.parts[mixed] >> index) & 1 == 1
        kappa_n, beta = part(ift, index)
        state, v_low = ift.box(
            kappa_n - size[0], kappa_n + size[0], beta - size[1], beta + size[1]
        )
        np.testing.assert_array_equal(state, np.where(free, FREE, MIXED))
        truth = rigid_body(configspace.load_vehicle("ift-four-steered"), kappa_n, beta)
        assert (v_low <= truth.v_max).all()


@pytest.mark.parametrize("with_vehicle", [True, False])
def test_synchro_drives_translate_only(space_of: SpaceOf, with_vehicle: bool) -> None:
    known = space_of("synchro-drive")
    space = known if with_vehicle else sheet_of(known)
    assert space.is_translating
    assert space.line_beta is None
    kappa_n = np.array([0.0, 1e-10, -1e-10, 1e-7, -0.3, 1.0, 2.0, -2.0])
    expected = [True, True, True, False, False, False, False, False]
    np.testing.assert_array_equal(space.v_max(kappa_n, 0.7) > 0, expected)
    assert int(space.reason(0.3, 0.0)) & Reason.PARALLEL_WHEELS
    assert not int(space.reason(0.0, 0.0)) & Reason.PARALLEL_WHEELS
    zero, pi = np.zeros(1), np.array([np.pi])
    assert space.box(zero, zero, zero, zero + 1e-3)[0][0] == FREE
    for low, high in ((zero, zero + 0.1), (zero + 0.1, zero + 0.2), (zero - 2, zero)):
        assert space.box(low, high, zero, zero + 1e-3)[0][0] != FREE
    assert space.box(zero, zero, -pi, pi)[0][0] == FREE


def test_box_inside_one_free_cell_is_free(ift: PermissibleSpace) -> None:
    one = np.array([0.011])
    state, v_low = ift.box(one, one + 0.005, one, one + 0.005)
    assert state[0] == FREE
    exact = configspace.exact_v_max(
        configspace.load_vehicle("ift-four-steered"), 0.016, 0.013
    )
    assert v_low[0] <= float(exact)
    assert v_low[0] > 0.95


def test_box_inside_the_blocked_area_is_blocked(ift: PermissibleSpace) -> None:
    state, _ = ift.box(
        np.array([0.001]), np.array([0.002]), np.array([3.0]), np.array([3.001])
    )
    assert state[0] == BLOCKED


def test_large_boxes_are_to_be_divided(ift: PermissibleSpace) -> None:
    state, _ = ift.box(
        np.array([0.0]), np.array([1.0]), np.array([0.0]), np.array([1.0])
    )
    assert state[0] == MIXED


def test_box_over_all_beta_at_the_pole(ift: PermissibleSpace) -> None:
    pi = np.array([np.pi])
    state, v_low = ift.box(np.array([1.995]), np.array([2.0]), -pi, pi)
    assert state[0] == FREE
    assert v_low[0] == pytest.approx(1.0, abs=0.02)


def test_lateral_acceleration_binds_between_translation_and_rotation() -> None:
    vehicle = configspace.load_vehicle("mecanum")
    limit = 0.3
    slow = vehicle.model_copy(
        update={
            "limits": vehicle.limits.model_copy(
                update={"max_lateral_acceleration": limit}
            )
        }
    )
    space = configspace.build_space(slow, cache=False)
    kappa_n = 1.0
    v = float(space.v_max(kappa_n, 0.0))
    vx, vy, omega = configspace.to_twist(kappa_n, 0.0, v, space.kappa_g)
    assert np.hypot(vx, vy) * omega == pytest.approx(limit, rel=1e-3)
    assert int(space.reason(kappa_n, 0.0)) == Reason.LATERAL_ACCELERATION
    assert float(space.v_max(2.0, 0.0)) == pytest.approx(
        float(configspace.exact_v_max(vehicle, 2.0, 0.0)), rel=1e-6
    )


def test_name_and_constants_come_from_the_vehicle(ackermann: PermissibleSpace) -> None:
    vehicle = configspace.load_vehicle("ackermann")
    for space in (ackermann, sheet_of(ackermann)):
        assert space.name == "ackermann"
        assert space.kappa_g == vehicle.boundary_curvature
        assert space.header.wheel_ids == tuple(w.id for w in vehicle.wheels)
        assert space.header.footprint == vehicle.footprint


def test_forgetting_the_vehicle_never_permits_more(ift: PermissibleSpace) -> None:
    rng = np.random.default_rng(4)
    kappa_n, beta = rng.uniform(-2, 2, 20_000), rng.uniform(-np.pi, np.pi, 20_000)
    unknown = replace(ift, vehicle=None)
    assert (unknown.v_max(kappa_n, beta) <= ift.v_max(kappa_n, beta)).all()
