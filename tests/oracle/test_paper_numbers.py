import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import naive
import numpy as np
import pytest
from scipy import ndimage

import configspace
from configspace import PermissibleSpace, Reason
from configspace.vehicle import Vehicle

PAPER: dict[str, Any] = tomllib.loads(
    (Path(__file__).parent / "paper_numbers.toml").read_text()
)
FOUR = PAPER["four_steered"]
U_LIM = FOUR["u_lim"]
STOP = np.radians(FOUR["steering_limit_deg"])
BETA = np.linspace(-STOP, STOP, 311)
SpaceOf = Callable[[str], PermissibleSpace]


@pytest.fixture
def ift() -> Vehicle:
    return configspace.load_vehicle(FOUR["catalogue_name"])


@pytest.fixture
def space(space_of: SpaceOf) -> PermissibleSpace:
    return space_of(FOUR["catalogue_name"])


def singular_beta(vehicle: Vehicle, wheel: int, kappa_n: float) -> float:
    """β at which the centre of rotation is on a wheel."""
    w = vehicle.wheels[wheel].position - vehicle.reference
    return float(np.angle(-1j * kappa_n * w))


def test_dimensions_are_those_of_the_paper(ift: Vehicle) -> None:
    for wheel in ift.wheels:
        assert abs(wheel.x) == pytest.approx(FOUR["a"] / 2)
        assert abs(wheel.y) == pytest.approx(FOUR["b"] / 2)


@pytest.mark.parametrize(
    ("kappa_n", "key"), [(0.0, "translation"), (2.0, "rotation"), (-2.0, "rotation")]
)
def test_translation_and_rotation_reach_the_wheels_limit(
    ift: Vehicle, space: PermissibleSpace, kappa_n: float, key: str
) -> None:
    expected = FOUR["v_max"][key] * U_LIM
    exact = configspace.exact_v_max(ift, kappa_n, BETA)
    np.testing.assert_allclose(exact, expected, rtol=1e-12)
    table = configspace.parse_space(configspace.dump_space(space))
    v_max = table.v_max(kappa_n, BETA[1:-1])
    settled = v_max > 0  # next to the stop the table alone knows less
    assert settled.mean() > 0.98
    np.testing.assert_allclose(v_max[settled], expected, rtol=1e-6)
    assert (v_max <= expected).all()


@pytest.mark.parametrize("kappa_n", [-1.0, 1.0])
@pytest.mark.parametrize("wheel", range(4))
def test_local_minima_are_where_the_centre_is_on_a_wheel(
    ift: Vehicle, kappa_n: float, wheel: int
) -> None:
    beta = singular_beta(ift, wheel, kappa_n)
    assert float(configspace.exact_v_max(ift, kappa_n, beta)) == 0
    assert int(configspace.exact_reason(ift, kappa_n, beta)[0]) & Reason.SINGULAR
    expected = FOUR["v_max"]["local_minimum"] * U_LIM
    angle = np.linspace(-np.pi, np.pi, 721)
    ring = configspace.exact_v_max(
        ift, kappa_n + 1e-7 * np.cos(angle), beta + 1e-7 * np.sin(angle)
    )
    permitted = ring > 0
    # Figure 10 shows the tip of W_2 at κ_n = -1; the point at κ_n = +1 lies within
    # what the other wheels block, as one of the two points of every wheel does.
    visible = FOUR["blocked"]["visible_tips"][wheel] == kappa_n
    assert permitted.any() == visible
    if not visible:
        return
    np.testing.assert_allclose(ring[permitted], expected, rtol=2e-7)
    wide = configspace.exact_v_max(
        ift, kappa_n + 0.05 * np.cos(angle), beta + 0.05 * np.sin(angle)
    )
    assert (wide[wide > 0] > expected).all()


def test_nothing_permitted_is_slower_than_the_minima_or_faster_than_the_limit(
    ift: Vehicle,
) -> None:
    kappa_n, beta = np.meshgrid(
        np.linspace(-2, 2, 401), np.linspace(-np.pi, np.pi, 721)
    )
    v_max = configspace.exact_v_max(ift, kappa_n, beta)
    permitted = v_max[v_max > 0]
    assert permitted.min() >= FOUR["v_max"]["local_minimum"] * U_LIM
    assert permitted.max() <= U_LIM * (1 + 1e-12)


def test_the_diagonal_wheel_is_twice_as_fast(ift: Vehicle) -> None:
    for kappa_n in (-1.0, 1.0):
        beta = singular_beta(ift, 0, kappa_n)
        _, u = configspace.wheel_states(ift, kappa_n, beta, 1.0)
        assert u[0] == pytest.approx(0, abs=1e-12)
        assert u[3] == pytest.approx(FOUR["wheel_speed"]["largest_u_4"], abs=1e-12)
    mesh = np.meshgrid(np.linspace(-2, 2, 401), np.linspace(-np.pi, np.pi, 721))
    _, u = configspace.wheel_states(ift, mesh[0], mesh[1], 1.0)
    assert u.max() <= FOUR["wheel_speed"]["largest_u_4"] + 1e-12


def test_translation_is_blocked_beyond_the_steering_limit(
    ift: Vehicle, space: PermissibleSpace
) -> None:
    stop = np.radians(FOUR["blocked"]["beta_at_translation_deg"])
    beyond = np.concatenate([np.linspace(stop + 1e-12, np.pi, 99), [stop + 1e-6]])
    for beta in (stop, -stop):
        assert float(configspace.exact_v_max(ift, 0.0, beta)) == U_LIM
        assert float(space.v_max(0.0, beta)) > 0
    for sign in (-1, 1):
        assert (configspace.exact_v_max(ift, 0.0, sign * beyond) == 0).all()
        assert (space.v_max(0.0, sign * beyond) == 0).all()
        assert (space.v_max(0.0, sign * np.linspace(0, stop, 99)) > 0).all()
    # All wheels hit the stop together.
    alpha, _ = configspace.wheel_states(ift, 0.0, stop, 1.0)
    np.testing.assert_allclose(alpha, stop)


@pytest.mark.parametrize("wheel", range(4))
@pytest.mark.parametrize("kappa_n", [-1.0, 1.0])
def test_blocked_areas_start_at_the_singular_points(
    ift: Vehicle, wheel: int, kappa_n: float
) -> None:
    # All wheels are equally far from K, so all tips are at |κ_n| = 1.
    assert abs(kappa_n) == FOUR["blocked"]["tip_kappa_n"]
    beta = singular_beta(ift, wheel, kappa_n)
    angle = np.linspace(-np.pi, np.pi, 36_001)
    for radius in (1e-3, 1e-6):
        z = configspace.wheel_directions(
            ift, kappa_n + radius * np.cos(angle), beta + radius * np.sin(angle)
        )[:, wheel]
        blocked = np.abs(np.angle(z)) > STOP
        # A sector as wide as the forbidden angles, by one connected arc.
        assert blocked.mean() == pytest.approx(50 / 360, abs=2e-3)
        assert (np.diff(blocked.astype(int)) != 0).sum() <= 2


@pytest.mark.parametrize("wheel", range(4))
def test_a_wheels_blocked_areas_meet_the_permitted_ones_only_at_the_stop(
    ift: Vehicle, wheel: int
) -> None:
    kappa_n, beta = np.meshgrid(
        np.linspace(-2, 2, 801), np.linspace(-np.pi, np.pi, 1441), indexing="ij"
    )
    alpha = configspace.wheel_states(ift, kappa_n, beta, 1.0)[0][..., wheel]
    # |α| jumps nowhere but next to the tips.
    jump = np.abs(np.diff(np.abs(alpha), axis=0)) > 0.5
    rows, columns = np.nonzero(jump)
    assert rows.size > 0
    np.testing.assert_allclose(np.abs(kappa_n[rows, columns]), 1.0, atol=0.05)


def test_one_permitted_region_and_one_blocked_region(ift: Vehicle) -> None:
    # Figure 9: the blocked strips meet at β = ±π; everything else hangs together.
    kappa_n, beta = np.meshgrid(
        np.linspace(-2, 2, 401), np.linspace(-np.pi, np.pi, 720, False), indexing="ij"
    )
    v_max = configspace.exact_v_max(ift, kappa_n, beta)
    for region in (v_max > 0, v_max == 0):
        twice, _ = ndimage.label(np.hstack([region, region]))
        joined = twice[:, 360:1080]  # the seam is inside now
        ids, sizes = np.unique(joined[joined > 0], return_counts=True)
        assert sizes.max() > 0.999 * sizes.sum(), (ids, sizes)


def test_space_of_the_symmetric_vehicle_is_symmetric(ift: Vehicle) -> None:
    rng = np.random.default_rng(0)
    kappa_n, beta = rng.uniform(-2, 2, 5000), rng.uniform(-np.pi, np.pi, 5000)
    v_max = configspace.exact_v_max(ift, kappa_n, beta)
    np.testing.assert_allclose(
        configspace.exact_v_max(ift, -kappa_n, -beta), v_max, rtol=1e-12
    )
    # Turning the other way about the opposite side: front and rear change places.
    speed = np.max(configspace.wheel_states(ift, kappa_n, beta, 1.0)[1], axis=-1)
    other = np.max(configspace.wheel_states(ift, -kappa_n, beta, 1.0)[1], axis=-1)
    np.testing.assert_allclose(speed, other, rtol=1e-12)


def test_an_offset_front_wheel_gives_maxima_near_the_pole() -> None:
    # Figure 13: beside |κ_n| ≈ 1.8 all wheels are below their limit at v_s = u_lim.
    places = ((0.3, 0.08), (-0.2, 0.15), (-0.2, -0.15))
    wheels = [
        {"id": f"w{i}", "type": "steered", "x": x, "y": y, "max_speed": U_LIM}
        for i, (x, y) in enumerate(places)
    ]
    vehicle = configspace.vehicle_from_data({"name": "three", "wheels": wheels})
    kappa_n, beta = np.meshgrid(
        np.linspace(-2, 2, 401), np.linspace(-np.pi, np.pi, 721), indexing="ij"
    )
    v_max = configspace.exact_v_max(vehicle, kappa_n, beta)
    np.testing.assert_allclose(v_max[[0, 200, 400]], U_LIM, rtol=1e-12)
    row, column = np.unravel_index(v_max.argmax(), v_max.shape)
    assert v_max.max() > U_LIM * 1.05
    assert 1.5 < abs(kappa_n[row, column]) < 1.95
    # β is about at right angles to the position of the odd wheel.
    off = beta[row, column] - np.arctan2(0.08, 0.3)
    assert abs(np.cos(off)) < 0.3


def test_differential_wheel_speeds_are_those_of_the_paper() -> None:
    table = PAPER["differential"]
    vehicle = configspace.load_vehicle(table["catalogue_name"])
    _, u = configspace.wheel_states(vehicle, table["kappa_n"], 0.0, 1.0)
    np.testing.assert_allclose(u[:, 0], table["u_1"], atol=1e-12)
    np.testing.assert_allclose(u[:, 1], table["u_2"], atol=1e-12)
    track = 2 / vehicle.boundary_curvature
    for kappa_n in np.linspace(-2, 2, 41):
        closed = naive.differential_closed(kappa_n, 0.7)
        raw = naive.differential(kappa_n, 0.7, vehicle.boundary_curvature, track)
        assert closed == pytest.approx(raw, abs=1e-12)
        _, pair = configspace.wheel_states(vehicle, kappa_n, 0.0, 0.7)
        assert pair[:2] == pytest.approx(closed, abs=1e-12)


def test_single_track_is_that_of_the_paper() -> None:
    table = PAPER["single_track"]
    a = table["wheelbase"]
    vehicle = configspace.vehicle_from_data(
        {
            "name": "bicycle",
            "wheels": [
                {"id": "w1", "type": "steered", "x": a, "y": 0, "max_speed": 1},
                {"id": "w2", "type": "fixed", "x": 0, "y": 0, "max_speed": 1},
            ],
        }
    )
    assert vehicle.boundary_curvature == pytest.approx(1 / a)
    assert vehicle.mobility.line_beta == 0
    for kappa_n in np.linspace(-2, 2, 401):
        alpha, u = configspace.wheel_states(vehicle, kappa_n, 0.0, 0.9)
        u_1, u_2, alpha_1 = naive.single_track(kappa_n, 0.9)
        assert u[0] == pytest.approx(u_1, abs=1e-12)
        assert u[1] == pytest.approx(u_2, abs=1e-12)
        assert alpha[0] == pytest.approx(alpha_1, abs=1e-9)
        assert alpha[1] == 0
        linear = table["alpha_is_nearly"] * kappa_n
        assert alpha[0] == pytest.approx(linear, abs=table["nearly"])


def test_catalogue_ackermann_angles_meet_in_one_centre() -> None:
    vehicle = configspace.load_vehicle("ackermann")
    kappa_n = np.linspace(0.01, 0.2, 20)
    alpha, _ = configspace.wheel_states(vehicle, kappa_n, 0.0, 1.0)
    radius = 1 / (kappa_n * vehicle.boundary_curvature)
    for i in (2, 3):
        wheel = vehicle.wheels[i]
        expected = np.arctan2(wheel.x, radius - wheel.y)
        np.testing.assert_allclose(alpha[:, i], expected, atol=1e-12)
