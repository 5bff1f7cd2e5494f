"""The promise of a space: an answer "permitted" is never wrong."""

import math
from dataclasses import replace

import naive
import numpy as np
import pytest
from hypothesis import given, settings

import configspace
from configspace import Grid, PermissibleSpace
from configspace.grid import edges_of
from configspace.kernels import BLOCKED, FREE, MIXED
from configspace.testing import (
    ALL_KINDS,
    VehicleKind,
    assert_sound,
    configurations,
    grids,
    random_configurations,
    random_vehicle,
    rigid_body,
    vehicles,
)
from configspace.vehicle import Vehicle


def build(vehicle: Vehicle, grid: Grid) -> PermissibleSpace:
    return configspace.build_space(vehicle, grid, cache=False)


def sheet_of(space: PermissibleSpace) -> PermissibleSpace:
    return configspace.parse_space(configspace.dump_space(space))


def random_grid(rng: np.random.Generator) -> Grid:
    return Grid(4 * int(rng.integers(4, 26)), int(rng.integers(24, 181)))


def sweep(seed: int, n_vehicles: int, per_vehicle: int) -> None:
    rng = np.random.default_rng(seed)
    for i in range(n_vehicles):
        vehicle = random_vehicle(rng, ALL_KINDS[i % len(ALL_KINDS)])
        space = build(vehicle, random_grid(rng))
        kappa_n, beta = random_configurations(rng, vehicle, per_vehicle)
        assert_sound(space, vehicle, kappa_n, beta)
        assert_sound(sheet_of(space), vehicle, kappa_n, beta)


@pytest.mark.parametrize("seed", range(4))
def test_a_hundred_thousand_configurations_are_sound(seed: int) -> None:
    sweep(seed, 60, 500)


def test_a_bounded_vehicle_is_built_on_the_coarsest_grid() -> None:
    vehicle = random_vehicle(np.random.default_rng(210), "omni")
    kappa_n, beta = np.meshgrid(
        np.linspace(-2, 2, 401), np.linspace(-np.pi, np.pi, 721)
    )
    assert rigid_body(vehicle, kappa_n, beta).v_max.max() < 10
    build(vehicle, Grid(4, 8))


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_ten_million_configurations_are_sound() -> None:
    sweep(1000, 1000, 10_000)


@given(vehicles(ALL_KINDS), configurations(), grids())
@settings(max_examples=150, deadline=None)
def test_any_configuration_is_sound(
    vehicle: Vehicle, configuration: tuple[float, float], grid: Grid
) -> None:
    space = build(vehicle, grid)
    assert_sound(space, vehicle, *configuration)
    assert_sound(sheet_of(space), vehicle, *configuration)


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_sound_by_the_loop_over_wheels_too(kind: VehicleKind) -> None:
    rng = np.random.default_rng(7)
    for _ in range(15):
        vehicle = random_vehicle(rng, kind)
        space = build(vehicle, random_grid(rng))
        kappa_n, beta = random_configurations(rng, vehicle, 60)
        for reverse in (False, True):
            known = space.v_max(kappa_n, beta, reverse=reverse)
            alone = sheet_of(space).v_max(kappa_n, beta, reverse=reverse)
            for j in range(kappa_n.size):
                truth = naive.exact(vehicle, kappa_n[j], beta[j], reverse=reverse)
                bound = truth.v_max * (1 + 1e-9)
                # The rates are found by differences, which are not as exact.
                if truth.spare < -1e-6 / max(truth.stillness, 1e-9) ** 2:
                    bound = 0.0
                if truth.margin < -1e-9 / max(truth.stillness, 1e-9):
                    bound = 0.0
                assert alone[j] <= bound
                assert known[j] <= bound


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_answers_are_not_vacuous(kind: VehicleKind) -> None:
    rng = np.random.default_rng(8)
    speed: list[float] = []
    seen = lost = 0
    for _ in range(8):
        vehicle = random_vehicle(rng, kind)
        space = build(vehicle, Grid())
        kappa_n, beta = rng.uniform(-2, 2, 4000), rng.uniform(-np.pi, np.pi, 4000)
        if vehicle.mobility.line_beta is not None:
            beta = np.full_like(beta, vehicle.mobility.line_beta)
        if vehicle.mobility.is_translating:
            kappa_n = np.zeros_like(kappa_n)
        truth = rigid_body(vehicle, kappa_n, beta)
        open_ = truth.is_clear() & (truth.permitted > 0)
        v_max = truth.v_max[open_]
        known = space.v_max(kappa_n, beta)[open_]
        assert (known > 0).all()
        assert (known >= 0.9 * v_max).all()  # least at peaks far above the mean
        alone = sheet_of(space).v_max(kappa_n, beta)[open_]
        both = alone > 0
        speed.extend(1 - alone[both] / v_max[both])
        seen, lost = seen + both.size, lost + int((~both).sum())
    assert np.mean(speed) < 3e-4
    assert lost < 0.03 * seen


def inside(
    rng: np.random.Generator,
    space: PermissibleSpace,
    vehicle: Vehicle,
    row: np.ndarray,
    column: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Points of cells, (cell, point): corners, edges, centre and random ones.

    `row` and `column` may be fractions: the last axis is then the extent, in cells.
    """
    place = rng.random((2, row.shape[0], 24))
    place[:, :, :4] = np.array([[0, 0, 1, 1], [0, 1, 0, 1]])[:, None, :]
    place[0, :, 4:8] = [0, 1, 0, 1]
    place[1, :, 8:12] = [0, 1, 0, 1]
    place[:, :, 12] = 0.5
    found = []
    for edges, at, share in zip(
        edges_of(vehicle.mobility, space.grid), (row, column), place, strict=True
    ):
        least, largest = at[:, :1], at[:, 1:]
        where = least + share * (largest - least)
        found.append(np.interp(where, np.arange(edges.size), edges))
    return found[0], found[1]


def whole(index: np.ndarray) -> np.ndarray:
    return np.stack([index, index + 1], axis=-1).astype(float)


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_cells_bound_what_is_inside_them(kind: VehicleKind) -> None:
    rng = np.random.default_rng(9)
    for _ in range(12):
        vehicle = random_vehicle(rng, kind)
        space = build(
            vehicle, Grid(4 * int(rng.integers(4, 12)), 24 + int(rng.integers(60)))
        )
        tables = space.tables
        rows, columns = tables.state.shape
        row, column = rng.integers(0, rows, 300), rng.integers(0, columns, 300)
        kappa_n, beta = inside(rng, space, vehicle, whole(row), whole(column))
        for reverse in (False, True):
            d = 1 if reverse and len(tables.load) > 1 else 0
            truth = rigid_body(vehicle, kappa_n, beta, reverse=reverse)
            low = tables.v_lo[d, row, column][:, None]
            high = tables.v_hi[d, row, column][:, None]
            state = tables.state[row, column][:, None]
            free = np.broadcast_to(state == FREE, kappa_n.shape)
            blocked = np.broadcast_to(state == BLOCKED, kappa_n.shape)
            assert not truth.is_blocked[free].any()
            assert not truth.is_open[blocked].any()
            assert (low <= truth.v_max * (1 + 1e-12))[free].all()
            assert ((low > 0) == (state == FREE)).all()
            regular = ~blocked & (truth.v_max < 1e6)
            assert (high >= truth.v_max * (1 - 1e-12))[regular].all()
            # Tight, too: the bounds are reached somewhere in the cell.
            reached = truth.v_max.min(axis=1)[state[:, 0] == FREE]
            assert (low[:, 0][state[:, 0] == FREE] >= 0.4 * reached).all()


STEERABLE: tuple[VehicleKind, ...] = (
    "steered",
    "mixed",
    "ackermann",
    "offset",
    "turntable",
    "loaded",
    "guaranteed",
    "synchro",
)


@pytest.mark.parametrize("kind", STEERABLE)
def test_free_parts_of_mixed_cells_are_permitted_all_over(kind: VehicleKind) -> None:
    rng = np.random.default_rng(19)
    seen = 0
    for _ in range(25):
        vehicle = random_vehicle(rng, kind)
        space = build(vehicle, random_grid(rng))
        cells = np.argwhere((space.tables.state == MIXED) & (space.tables.parts != 0))
        cells = rng.permutation(cells)[:100]
        if not len(cells):
            continue
        at = 4 * np.repeat(cells, 16, axis=0)
        bit = np.tile(np.arange(16), len(cells))
        at = at + np.stack([bit // 4, bit % 4], axis=-1)
        parts = space.tables.parts[cells[:, 0], cells[:, 1]].astype(int)
        free = (np.repeat(parts, 16) >> bit) & 1 == 1
        corners = np.stack([at[free], at[free] + 1], axis=-1) / 4
        kappa_n, beta = inside(rng, space, vehicle, corners[:, 0], corners[:, 1])
        assert not rigid_body(vehicle, kappa_n, beta).is_blocked.any()
        assert_sound(replace(space, vehicle=None), vehicle, kappa_n, beta)
        # The sheet uses them.
        middle = kappa_n[:, 12], beta[:, 12]
        assert (replace(space, vehicle=None).v_max(*middle) > 0).all()
        seen += int(free.sum())
    assert seen > (20 if kind in {"ackermann", "synchro"} else 1000)


def random_boxes(
    rng: np.random.Generator, space: PermissibleSpace, vehicle: Vehicle, count: int
) -> tuple[np.ndarray, ...]:
    """Boxes around interesting configurations: tiny, cell-sized, some over all β."""
    kappa_n, beta = random_configurations(rng, vehicle, count)
    share = 10.0 ** rng.uniform(-9, 0.3, (2, count))
    half_k = share[0] * 2 / space.grid.n_kappa
    half_b = share[1] * np.pi / space.grid.n_beta
    case = rng.integers(0, 6, count)
    beta = np.where(case == 0, np.pi, beta)  # across the seam
    kappa_n = np.where(case == 1, np.copysign(2, kappa_n), kappa_n)  # at a pole
    half_b = np.where((case == 1) & (beta > 0), np.pi, half_b)  # the whole ring
    half_k = np.where(case == 2, 0.0, half_k)
    if space.is_translating:
        half_k = np.where(rng.random(count) < 0.9, 0.0, half_k)
    half_b = np.where(case == 3, 0.0, half_b)
    return (
        np.clip(kappa_n - half_k, -2, 2),
        np.clip(kappa_n + half_k, -2, 2),
        beta - half_b,
        beta + half_b,
    )


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_free_boxes_are_permitted_all_over(kind: VehicleKind) -> None:
    rng = np.random.default_rng(10)
    seen = np.zeros(3, int)
    for _ in range(20):
        vehicle = random_vehicle(rng, kind)
        space = build(vehicle, random_grid(rng))
        k0, k1, b0, b1 = random_boxes(rng, space, vehicle, 400)
        place = rng.random((2, 400, 20))
        place[:, :, :4] = np.array([[0, 0, 1, 1], [0, 1, 0, 1]])[:, None, :]
        kappa_n = k0[:, None] + place[0] * (k1 - k0)[:, None]
        beta = b0[:, None] + place[1] * (b1 - b0)[:, None]
        if space.line_beta is not None:
            beta = np.full_like(beta, space.line_beta)
        for reverse in (False, True):
            truth = rigid_body(vehicle, kappa_n, beta, reverse=reverse)
            blocked, clear = truth.is_blocked, truth.is_open
            for one in (space, replace(space, vehicle=None)):
                state, v_low = one.box(k0, k1, b0, b1, reverse=reverse)
                assert set(np.unique(state)) <= {FREE, BLOCKED, MIXED}
                assert not blocked[state == FREE].any()
                assert not clear[state == BLOCKED].any()
                slowest = truth.v_max.min(axis=1)
                assert (v_low <= slowest * (1 + 1e-12))[state == FREE].all()
            seen += np.bincount(state, minlength=3)
    assert seen[FREE] > (0.03 if kind == "guaranteed" else 0.1) * seen.sum()


def trace(
    space: PermissibleSpace, start: np.ndarray, end: np.ndarray, depth: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut straight pieces (n, 2) into boxes until they are settled or `depth` is out.

    Returns the index of the piece, the shares (least, largest) of it and v_low, of the
    parts that are free.
    """
    which = np.repeat(np.arange(len(start)), 8)
    share = np.tile(
        np.stack([np.arange(8) / 8, np.arange(1, 9) / 8], axis=-1), (len(start), 1)
    )
    found = []
    for _ in range(depth):
        at = start[which][:, None] + share[..., None] * (end - start)[which][:, None]
        low, high = at.min(axis=1), at.max(axis=1)
        state, v_low = space.box(low[:, 0], high[:, 0], low[:, 1], high[:, 1])
        free, mixed = state == FREE, state == MIXED
        found.append((which[free], share[free], v_low[free]))
        middle = share[mixed].mean(axis=1)
        share = np.concatenate(
            [
                np.stack([share[mixed][:, 0], middle], axis=-1),
                np.stack([middle, share[mixed][:, 1]], axis=-1),
            ]
        )
        which = np.tile(which[mixed], 2)
    return tuple(np.concatenate(part) for part in zip(*found, strict=True))  # type: ignore[return-value]


def pieces(
    rng: np.random.Generator, space: PermissibleSpace, vehicle: Vehicle, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Straight pieces in the plane, from a tenth of a cell to twenty cells long."""
    start = np.stack(random_configurations(rng, vehicle, count), axis=-1)
    cells = 10.0 ** rng.uniform(-1, 1.3, count)
    angle = rng.uniform(-np.pi, np.pi, count)
    step = np.stack(
        [
            4 / space.grid.n_kappa * np.cos(angle),
            2 * np.pi / space.grid.n_beta * np.sin(angle),
        ],
        axis=-1,
    )
    end = start + cells[:, None] * step
    end[:, 0] = np.clip(end[:, 0], -2, 2)
    if space.line_beta is not None:
        start[:, 1] = end[:, 1] = space.line_beta
    if space.is_translating:
        start[:, 0] = end[:, 0] = 0.0
    return start, end


def follow(
    seed: int, n_vehicles: int, per_vehicle: int, samples: int
) -> tuple[int, int]:
    """Trace pieces and hold what is free against dense samples; count both."""
    rng = np.random.default_rng(seed)
    n_free = n_samples = 0
    for i in range(n_vehicles):
        vehicle = random_vehicle(rng, ALL_KINDS[i % len(ALL_KINDS)])
        space = build(vehicle, random_grid(rng))
        start, end = pieces(rng, space, vehicle, per_vehicle)
        for one in (space, replace(space, vehicle=None)):
            which, share, v_low = trace(one, start, end, 6)
            place = rng.random((which.size, samples))
            place[:, :2] = 0, 1
            at = share[:, :1] + place * (share[:, 1:] - share[:, :1])
            points = (
                start[which][:, None] + at[..., None] * (end - start)[which][:, None]
            )
            truth = rigid_body(vehicle, points[..., 0], points[..., 1])
            assert not truth.is_blocked.any()
            assert (v_low[:, None] <= truth.v_max * (1 + 1e-12)).all()
        n_free, n_samples = n_free + which.size, n_samples + at.size
    return n_free, n_samples


def test_free_parts_of_straight_pieces_are_permitted() -> None:
    n_free, _ = follow(20, 24, 100, 8)
    assert n_free > 5000


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_a_hundred_thousand_straight_pieces_are_sound() -> None:
    n_free, n_samples = follow(2000, 200, 500, 12)
    assert n_free > 400_000
    assert n_samples > 5_000_000


def test_tiny_boxes_are_as_fast_as_points() -> None:
    vehicle = configspace.load_vehicle("mecanum")
    space = build(vehicle, Grid())
    rng = np.random.default_rng(11)
    kappa_n, beta = rng.uniform(-1.99, 1.99, 2000), rng.uniform(-np.pi, np.pi, 2000)
    state, v_low = space.box(kappa_n, kappa_n, beta, beta)
    assert (state == FREE).all()
    np.testing.assert_allclose(v_low, space.v_max(kappa_n, beta), rtol=1e-9)


# --- tightness of the data sheet alone


def lost_by_the_sheet(name: str, count: int) -> tuple[float, float, float]:
    """Shares of mixed cells, of permitted area lost and of mean speed lost."""
    rng = np.random.default_rng(21)
    vehicle = configspace.load_vehicle(name)
    space = build(vehicle, Grid())
    sheet = sheet_of(space)
    permitted = lost = 0
    slower = 0.0
    for _ in range(count // 100_000):
        kappa_n = rng.uniform(-2, 2, 100_000)
        beta = rng.uniform(-np.pi, np.pi, 100_000)
        if space.line_beta is not None:
            beta = np.full_like(beta, space.line_beta)
        if space.is_translating:
            kappa_n = np.zeros_like(kappa_n)
        exact = configspace.exact_v_max(vehicle, kappa_n, beta)
        alone = sheet.v_max(kappa_n, beta)
        both = (exact > 0) & (alone > 0)
        permitted += int((exact > 0).sum())
        lost += int(((exact > 0) & ~both).sum())
        slower += float((1 - alone[both] / exact[both]).sum())
    mixed = float((space.tables.state == MIXED).mean())
    return mixed, lost / permitted, slower / (permitted - lost)


def table_of_losses(
    names: tuple[str, ...], count: int
) -> dict[str, tuple[float, float, float]]:
    """Print and return what every sheet loses."""
    losses = {name: lost_by_the_sheet(name, count) for name in names}
    print(f"\n{'vehicle':24} mixed cells  area lost  mean speed lost")  # noqa: T201
    for name, (mixed, area, speed) in losses.items():
        print(f"{name:24} {mixed:11.3%} {area:10.4%} {speed:16.5%}")  # noqa: T201
    return losses


def test_the_sheet_of_the_papers_vehicle_loses_little() -> None:
    ((_, area, speed),) = table_of_losses(("ift-four-steered",), 200_000).values()
    assert area < 0.005
    assert speed < 0.0001


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_sheets_of_the_catalogue_lose_less_than_a_hundredth() -> None:
    losses = table_of_losses(configspace.catalog(), 1_000_000)
    above = {n: loss for n, loss in losses.items() if loss[1] > 1e-2 or loss[2] > 1e-3}
    assert not above


# --- relations between vehicles


def mirrored(vehicle: Vehicle) -> Vehicle:
    """The vehicle seen in a mirror: left and right exchanged."""
    data = vehicle.model_dump(mode="json")
    for wheel in data["wheels"]:
        wheel["y"] = -wheel["y"]
        for key in ("heading_deg", "roller_deg"):
            if key in wheel:
                wheel[key] = -wheel[key]
        if "offset" in wheel:
            wheel["offset"] = -wheel["offset"]
        if wheel.get("steering_range_deg"):
            least, largest = wheel["steering_range_deg"]
            wheel["steering_range_deg"] = [-largest, -least]
    if data["reference_point"]:
        data["reference_point"][1] *= -1
    if data["load"]:
        data["load"]["center_of_gravity"][1] *= -1
    return configspace.vehicle_from_data(data)


@given(vehicles(ALL_KINDS))
@settings(max_examples=60, deadline=None)
def test_a_mirrored_vehicle_has_the_mirrored_space(vehicle: Vehicle) -> None:
    rng = np.random.default_rng(12)
    other = mirrored(vehicle)
    kappa_n, beta = random_configurations(rng, vehicle, 200)
    clear = rigid_body(vehicle, kappa_n, beta).is_clear(1e-7)
    one = configspace.exact_v_max(vehicle, kappa_n, beta)[clear]
    two = configspace.exact_v_max(other, -kappa_n, -beta)[clear]
    np.testing.assert_allclose(one, two, rtol=1e-7)
    grid = Grid(16, 24)
    left, right = build(vehicle, grid).tables, build(other, grid).tables
    np.testing.assert_allclose(left.v_lo, right.v_lo[:, ::-1, ::-1], rtol=1e-5)


@given(vehicles(ALL_KINDS))
@settings(max_examples=60, deadline=None)
def test_tighter_limits_never_permit_more(vehicle: Vehicle) -> None:
    rng = np.random.default_rng(13)
    data = vehicle.model_dump(mode="json")
    data["kappa_g"] = vehicle.boundary_curvature
    for wheel in data["wheels"]:
        if wheel.get("max_speed") and rng.random() < 0.5:
            wheel["max_speed"] *= rng.uniform(0.2, 1)
        if wheel.get("steering_range_deg"):
            least, largest = wheel["steering_range_deg"]
            if largest - least < 360:
                narrower = 0.1 * (largest - least) * rng.random(2)
                wheel["steering_range_deg"] = [
                    least + narrower[0],
                    largest - narrower[1],
                ]
        if wheel.get("max_steering_rate_deg") and rng.random() < 0.5:
            wheel["max_steering_rate_deg"] *= rng.uniform(0.3, 1)
    for key, value in data["limits"].items():
        if isinstance(value, float) and rng.random() < 0.5:
            data["limits"][key] = value * rng.uniform(0.2, 1)
    if data["load"]:
        data["load"]["tipping_factor"] *= rng.uniform(1, 2)
    for key, value in (data["guaranteed"] or {}).items():
        data["guaranteed"][key] = value * rng.uniform(1, 2)
    tighter = configspace.vehicle_from_data(data)
    kappa_n, beta = random_configurations(rng, vehicle, 200)
    clear = rigid_body(vehicle, kappa_n, beta).is_clear(1e-7)
    grid = Grid(16, 24)
    for reverse in (False, True):
        less = configspace.exact_v_max(tighter, kappa_n, beta, reverse=reverse)
        more = configspace.exact_v_max(vehicle, kappa_n, beta, reverse=reverse)
        assert (less <= more * (1 + 1e-9))[clear].all()
    narrow, wide = build(tighter, grid).tables, build(vehicle, grid).tables
    # A cell free under the narrower ranges may be left mixed under the wider ones.
    assert (wide.state[narrow.state == FREE] != BLOCKED).all()
    both = (narrow.state == FREE) & (wide.state == FREE)
    assert (narrow.v_lo[0] <= wide.v_lo[0] * np.float32(1 + 1e-6))[both].all()
    assert (narrow.v_lo[0] <= wide.v_hi[0] * np.float32(1 + 1e-6)).all()


@given(vehicles(ALL_KINDS))
@settings(max_examples=60, deadline=None)
def test_speeds_scale_with_the_limits(vehicle: Vehicle) -> None:
    rng = np.random.default_rng(14)
    data = vehicle.model_dump(mode="json")
    data["kappa_g"] = vehicle.boundary_curvature
    factor = 1.7
    for wheel in data["wheels"]:
        # Steering rolls a wheel beside its axis: a zone of guaranteed rates stays where
        # it is if all of them are quicker alike.
        for key in ("max_speed", "max_steering_rate_deg"):
            if wheel.get(key):
                wheel[key] *= factor
    for key, value in (data["guaranteed"] or {}).items():
        data["guaranteed"][key] = value * factor
    for key, value in data["limits"].items():
        if isinstance(value, float):
            power = 2 if key == "max_lateral_acceleration" else 1
            data["limits"][key] = value * factor**power
    if data["load"]:  # what keeps the vehicle upright grows with 1 / height
        data["load"]["center_of_gravity"][2] /= factor**2
    faster = configspace.vehicle_from_data(data)
    kappa_n, beta = random_configurations(rng, vehicle, 300)
    np.testing.assert_allclose(
        configspace.exact_v_max(faster, kappa_n, beta),
        factor * configspace.exact_v_max(vehicle, kappa_n, beta),
        rtol=1e-9,
    )


@given(vehicles(ALL_KINDS))
@settings(max_examples=60, deadline=None)
def test_a_smaller_vehicle_has_the_same_space(vehicle: Vehicle) -> None:
    # κ_n is relative to the vehicle: lengths and limits shrink alike.
    rng = np.random.default_rng(15)
    factor = 0.7
    data = vehicle.model_dump(mode="json")
    data["kappa_g"] = vehicle.boundary_curvature / factor
    for wheel in data["wheels"]:
        for key in ("x", "y", "offset", "track", "steering_coupling"):
            if key in wheel:
                wheel[key] *= factor
        # At the same speeds a smaller vehicle has its angles change more quickly.
        if wheel.get("max_steering_rate_deg"):
            wheel["max_steering_rate_deg"] /= factor
    if data["guaranteed"]:
        data["guaranteed"] = {
            key: rate and rate / factor for key, rate in data["guaranteed"].items()
        }
    if data["reference_point"]:
        data["reference_point"] = [factor * x for x in data["reference_point"]]
    if data["skid_steer"]:
        data["skid_steer"]["effective_track"] *= factor
    if data["load"]:
        x, y, z = data["load"]["center_of_gravity"]
        # Accelerations are v²/r, tipping ones of the width over the height.
        data["load"]["center_of_gravity"] = [factor * x, factor * y, factor**2 * z]
    limits = data["limits"]
    if limits["max_yaw_rate_deg"]:
        limits["max_yaw_rate_deg"] /= factor
    if limits["max_lateral_acceleration"]:
        limits["max_lateral_acceleration"] /= factor
    smaller = configspace.vehicle_from_data(data)
    kappa_n, beta = random_configurations(rng, vehicle, 200)
    clear = rigid_body(vehicle, kappa_n, beta).is_clear(1e-6)
    np.testing.assert_allclose(
        configspace.exact_v_max(smaller, kappa_n, beta)[clear],
        configspace.exact_v_max(vehicle, kappa_n, beta)[clear],
        rtol=1e-6,
    )


@given(vehicles(ALL_KINDS), configurations())
@settings(max_examples=60, deadline=None)
def test_a_finer_grid_answers_alike_when_the_vehicle_is_known(
    vehicle: Vehicle, configuration: tuple[float, float]
) -> None:
    exact = float(configspace.exact_v_max(vehicle, *configuration))
    for grid in (Grid(16, 24), Grid(40, 90)):
        v_max = float(build(vehicle, grid).v_max(*configuration))
        assert v_max <= exact * (1 + 1e-12)
        if math.isfinite(exact) and rigid_body(vehicle, *configuration).is_clear():
            assert (v_max > 0) == (exact > 0)
