"""Shares of configurations, against sampling of the exact formula."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import configspace
from configspace import Grid, PermissibleSpace, dexterity, manoeuvrability_index
from configspace.manoeuvrability import Measure
from configspace.spherical import spherical_to_omni_curve, translate
from configspace.testing import ALL_KINDS, rigid_body, vehicles
from configspace.vehicle import Vehicle

MEASURES: list[Measure] = ["angles", "sphere", "omni_curve"]
CORNERS = ((0.235, 0.185), (-0.235, 0.185), (-0.235, -0.185), (0.235, -0.185))


def built(vehicle: str | Vehicle, grid: Grid) -> PermissibleSpace:
    if isinstance(vehicle, str):
        vehicle = configspace.load_vehicle(vehicle)
    return configspace.build_space(vehicle, grid, cache=False)


def four_steered(**more: object) -> Vehicle:
    wheels = [
        {"id": f"w{i}", "type": "steered", "x": x, "y": y, "max_speed": 1.0, **more}
        for i, (x, y) in enumerate(CORNERS)
    ]
    return configspace.vehicle_from_data({"name": "v", "wheels": wheels})


def drawn(
    vehicle: Vehicle, measure: Measure, scale: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Random configurations, uniform in a measure, by the map of the other side."""
    count = 20000
    beta = rng.uniform(-np.pi, np.pi, count)
    if vehicle.mobility.line_beta is not None:
        beta = np.full(count, vehicle.mobility.line_beta)
        measure = "angles" if measure == "sphere" else measure
    if vehicle.mobility.is_translating:
        return np.zeros(count), beta
    if measure == "omni_curve":
        return rng.uniform(-2, 2, count), beta
    theta = rng.uniform(-np.pi / 2, np.pi / 2, count)
    if measure == "sphere":
        theta = np.arcsin(rng.uniform(-1, 1, count))
    # tan θ = d ω/v, and the same motion with d = 1/κ_g has tan θ / scale.
    theta = np.arctan(np.tan(theta) / scale)
    kappa_n = spherical_to_omni_curve(1.0, beta, theta)[0]
    return kappa_n, beta


@settings(deadline=None, max_examples=20)
@given(
    vehicles(ALL_KINDS),
    st.integers(0, 2**32 - 1),
    st.sampled_from(MEASURES),
    st.sampled_from([0.4, 1.0, 2.0]),
    st.booleans(),
)
def test_bounds_hold_what_is_sampled(
    vehicle: Vehicle, seed: int, measure: Measure, scale: float, reverse: bool
) -> None:
    rng = np.random.default_rng(seed)
    space = built(vehicle, Grid(48, 72))
    v_ref = float(rng.uniform(0.3, 2))
    index = manoeuvrability_index(
        space, measure=measure, d=scale / space.kappa_g, v_ref=v_ref, reverse=reverse
    )
    permitted = rigid_body(
        vehicle, *drawn(vehicle, measure, scale, rng), reverse=reverse
    ).permitted
    # Six standard deviations of a mean of numbers within [0, 1].
    for values, low, high in (
        (permitted > 0, index.share, index.share_high),
        (np.minimum(permitted / v_ref, 1), index.speed_share, index.speed_share_high),
    ):
        apart = 6 * max(float(values.std()), 0.01) / np.sqrt(values.size)
        assert 0 <= low <= values.mean() + apart
        assert values.mean() - apart <= high <= 1
        assert low <= high


@pytest.mark.parametrize("measure", MEASURES)
def test_a_fine_table_leaves_little_open(measure: Measure) -> None:
    index = manoeuvrability_index(
        built("ift-four-steered", Grid(400, 720)), measure=measure
    )
    assert index.dimension == 2
    assert index.share_high - index.share < 0.01
    assert index.speed_share_high - index.speed_share < 0.02
    assert index.speed_share < index.share


def test_shares_that_can_be_told_by_head() -> None:
    """Two wheels at K's circle that may point ±90° only."""
    everything = manoeuvrability_index(built("mecanum", Grid(40, 72)))
    assert (everything.share, everything.share_high) == pytest.approx((1.0, 1.0))
    narrow = configspace.vehicle_from_data(
        {
            "name": "v",
            "synchro": True,
            "wheels": [
                {"id": i, "type": "steered", "x": x, "y": 0.0, "max_speed": 0.5,
                 "steering_range_deg": [-45, 90]}
                for i, x in (("a", 0.3), ("b", -0.3))
            ],
        }
    )  # fmt: skip
    index = manoeuvrability_index(built(narrow, Grid(4, 7200)), v_ref=1.0)
    assert index.dimension == 1
    assert index.share <= 135 / 360 <= index.share_high
    assert index.share == pytest.approx(135 / 360, abs=1e-3)
    assert index.speed_share == pytest.approx(135 / 720, abs=1e-3)


def test_of_a_car_it_is_the_share_of_its_line() -> None:
    space = built("ackermann", Grid(400, 8))
    assert space.vehicle is not None
    kappa_n = np.linspace(-2, 2, 200001)
    open_ = configspace.exact_v_max(space.vehicle, kappa_n, 0.0) > 0
    reach = 2 * np.arctan(kappa_n[open_].max()) / np.pi
    for measure in ("angles", "sphere"):
        index = manoeuvrability_index(space, measure=measure)
        assert index.dimension == 1
        assert index.share == pytest.approx(reach, abs=2e-3)


def test_where_straight_ahead_is_blocked_the_fastest_is_the_reference() -> None:
    space = built("robotis-ffw", Grid(40, 72))
    index = manoeuvrability_index(space)
    assert index.v_ref == float(space.tables.v_lo[0].max())
    assert 0 < index.speed_share < index.share < 1


def test_reading_the_sheet_alone_gives_the_same() -> None:
    space = built("ift-three-steered", Grid(40, 72))
    sheet = configspace.parse_space(configspace.dump_space(space))
    one, other = manoeuvrability_index(space), manoeuvrability_index(sheet)
    assert one.share == other.share
    assert one.speed_share == pytest.approx(other.speed_share, rel=1e-6)


@pytest.mark.parametrize(
    "bad", [{"measure": "area"}, {"d": 0.0}, {"d": np.nan}, {"v_ref": -1.0}]
)
def test_what_makes_no_sense_is_refused(bad: dict[str, object]) -> None:
    space = built("mecanum", Grid(8, 8))
    with pytest.raises(configspace.InvalidInput):
        manoeuvrability_index(space, **bad)  # type: ignore[arg-type]


def test_dexterity_by_differences() -> None:
    rng = np.random.default_rng(9)
    agv = four_steered()
    d = 1 / agv.boundary_curvature
    phi, theta = rng.uniform(-3, 3, 300), rng.uniform(-1.5, 1.5, 300)
    kappa_n, beta, _ = spherical_to_omni_curve(1.0, phi, theta)
    found = dexterity(agv, kappa_n, beta)
    h = 1e-6
    for i, (x, y) in enumerate(CORNERS):
        ends = [
            translate(1.0, phi + a * h, theta + b * h, complex(x, y), d)[1]
            for a, b in ((1, 0), (-1, 0), (0, 1), (0, -1))
        ]
        gain = np.hypot(
            np.angle(np.exp(1j * (ends[0] - ends[1]))) / (2 * h),
            np.angle(np.exp(1j * (ends[2] - ends[3]))) / (2 * h),
        )
        np.testing.assert_allclose(found[:, i], 1 / gain, rtol=1e-4)


def test_dexterity_ends_at_a_singular_point() -> None:
    agv = configspace.load_vehicle("one-steered-castors")
    for point in configspace.singular_points(agv):
        assert point.beta is not None
        assert dexterity(agv, point.kappa_n, point.beta)[point.wheel] == 0
    assert np.isinf(dexterity(configspace.load_vehicle("mecanum"), 0.3, 0.1)).all()


def test_excluded_shares_of_care_o_bot() -> None:
    """spec/steered-wheels §3.6 and B1: at equal speed of the path in (φ, θ)."""
    agv = four_steered()
    assert agv.boundary_curvature == pytest.approx(3.3435654396, rel=1e-9)
    phi, theta = np.meshgrid(
        (np.arange(720) + 0.5) / 720 * 2 * np.pi - np.pi,
        (np.arange(360) + 0.5) / 360 * np.pi - np.pi / 2,
    )
    kappa_n, beta, _ = spherical_to_omni_curve(1.0, phi, theta)
    least = dexterity(agv, kappa_n, beta).min(axis=-1)
    for speed, limit, excluded in (
        (1.5 * np.pi, 8 * np.pi, 5.66),
        (0.5 * np.pi, 24.0, 0.68),
        (np.pi, 24.0, 2.74),
        (1.5 * np.pi, 24.0, 6.22),
        (0.5 * np.pi, 2 * np.pi, 10.1),
        (np.pi, 2 * np.pi, 37.4),
    ):
        share = 100 * (least < speed / limit).mean()
        assert share == pytest.approx(excluded, abs=0.06)
