import numpy as np
import pytest

from configspace import (
    Grid,
    InvalidInput,
    PermissibleSpace,
    build_space,
    dump_space,
    load_vehicle,
    parse_space,
    singular_points,
    wheel_states,
)
from configspace.plot_facets import (
    Facets,
    blocked_polygons,
    rolling_polygons,
    steering_polygons,
    surface_polygons,
    wheel_index,
)

GRID = Grid(80, 120)
NAMES = (
    "ift-four-steered",
    "drive-steer-offset",
    "two-turntables",
    "mecanum",
    "ackermann",
    "synchro-drive",
)


@pytest.fixture(scope="module")
def spaces() -> dict[str, PermissibleSpace]:
    return {n: build_space(load_vehicle(n), GRID, cache=False) for n in NAMES}


@pytest.fixture
def four_steered(spaces: dict[str, PermissibleSpace]) -> PermissibleSpace:
    return spaces["ift-four-steered"]


def area(facets: Facets) -> float:
    """Area over the (κ_n, β) plane, by the shoelace formula."""
    total = 0.0
    for corners in facets:
        x, y = corners[:, 0], corners[:, 1]
        total += abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2
    return total


def test_steering_facets_carry_the_steering_angle(
    four_steered: PermissibleSpace,
) -> None:
    facets, blocked = steering_polygons(four_steered, 1)
    kappa_n, beta, angle = np.concatenate(facets).T
    assert four_steered.vehicle is not None
    alpha = wheel_states(four_steered.vehicle, kappa_n, beta, 1.0)[0][:, 1]
    np.testing.assert_allclose(angle, alpha, atol=1e-12)
    assert (four_steered.v_max(kappa_n, beta) > 0).all()
    assert np.degrees(np.abs(angle)).max() == pytest.approx(155, abs=0.01)
    assert (np.concatenate(blocked)[:, 2] == 0).all()


def test_steering_facets_leave_out_only_the_blocked_area(
    four_steered: PermissibleSpace,
) -> None:
    facets, blocked = steering_polygons(four_steered, "front-right")
    assert area(facets) + area(blocked) == pytest.approx(8 * np.pi, rel=1e-4)


@pytest.mark.parametrize("name", ["drive-steer-offset", "two-turntables"])
def test_free_steering_has_no_wall_where_the_angle_wraps(
    spaces: dict[str, PermissibleSpace], name: str
) -> None:
    facets, blocked = steering_polygons(spaces[name], 0)
    angles = np.concatenate(facets)[:, 2]
    assert np.abs(angles).max() == pytest.approx(np.pi)
    # Away from the singular points a facet is as flat as the net is fine.
    spans = np.array([np.ptp(facet[:, 2]) for facet in facets])
    middles = np.array([facet.mean(axis=0) for facet in facets])
    vehicle = spaces[name].vehicle
    assert vehicle is not None
    points = [(p.kappa_n, p.beta or 0) for p in singular_points(vehicle) if not p.wheel]
    far = np.all([np.hypot(*(middles[:, :2] - p).T) > 0.3 for p in points], axis=0)
    assert spans[far].max() < 0.5
    assert spans.max() < 2.6
    # Cut at the wrap, and nothing of it lost or drawn twice.
    assert area(facets) + area(blocked) == pytest.approx(8 * np.pi, rel=1e-3)


def test_steering_angle_jumps_at_the_singular_point(
    four_steered: PermissibleSpace,
) -> None:
    assert four_steered.vehicle is not None
    at = next(
        p
        for p in singular_points(four_steered.vehicle)
        if p.wheel == 1 and p.kappa_n < 0
    )
    assert at.beta is not None
    corners = np.concatenate(steering_polygons(four_steered, 1)[0])
    near = np.hypot(corners[:, 0] - at.kappa_n, corners[:, 1] - at.beta) < 0.02
    assert np.ptp(corners[near, 2]) > np.radians(120)


def test_diagonal_wheel_rolls_at_twice_the_speed(
    four_steered: PermissibleSpace,
) -> None:
    facets, _ = rolling_polygons(four_steered, 3)
    kappa_n, beta, u = np.concatenate(facets).T
    assert u.max() == pytest.approx(2.0, abs=1e-3)
    fastest = u.argmax()
    # The centre of rotation is on W_1.
    assert kappa_n[fastest] == pytest.approx(1.0, abs=0.01)
    assert np.tan(beta[fastest]) == pytest.approx(-0.215 / 0.115, abs=0.05)
    np.testing.assert_allclose(u[kappa_n == 0], 1.0)


@pytest.mark.parametrize("name", ["ift-four-steered", "drive-steer-offset", "mecanum"])
def test_no_wheel_rolls_faster_than_it_can_at_v_max(
    spaces: dict[str, PermissibleSpace], name: str
) -> None:
    space = spaces[name]
    assert space.vehicle is not None
    shares = []
    for index, wheel in enumerate(space.vehicle.wheels):
        limit = getattr(wheel, "max_speed", None)
        if limit is None:
            continue
        kappa_n, beta, u = np.concatenate(rolling_polygons(space, index)[0]).T
        shares.append(np.abs(u) * space.v_max(kappa_n, beta) / limit)
    share = np.concatenate(shares)
    assert share.max() <= 1 + 1e-6
    # And each of them is the one that binds somewhere.
    assert all(wheel.max() > 0.99 for wheel in shares)


def test_blocked_area_alone_is_that_below_the_surface(
    four_steered: PermissibleSpace,
) -> None:
    fine = blocked_polygons(four_steered)
    assert area(fine) == pytest.approx(
        area(surface_polygons(four_steered)[1]), rel=0.01
    )
    # Its tips reach the singular points, where κ_n = ±1 and tan β = 0.215 / 0.115.
    corners = np.concatenate(fine)
    least = np.abs(corners[:, 1]).min()
    assert least == pytest.approx(np.arctan2(0.215, 0.115), abs=0.02)
    assert blocked_polygons(parse_space(dump_space(four_steered)))


def test_wheels_are_named_by_index_or_id(four_steered: PermissibleSpace) -> None:
    assert wheel_index(four_steered, "rear-left") == wheel_index(four_steered, 2) == 2
    for wrong in ("W_2", 4, -1):
        with pytest.raises(InvalidInput, match="0 to 3 or one of front-left, "):
            wheel_index(four_steered, wrong)


def test_wheel_facets_need_a_known_vehicle_with_such_a_wheel(
    spaces: dict[str, PermissibleSpace],
) -> None:
    sheet = parse_space(dump_space(spaces["ift-four-steered"]))
    for polygons in (steering_polygons, rolling_polygons):
        with pytest.raises(InvalidInput, match="data sheet"):
            polygons(sheet, 0)
        with pytest.raises(InvalidInput, match="curve over κ_n"):
            polygons(spaces["ackermann"], 0)
        with pytest.raises(InvalidInput, match="curve over β"):
            polygons(spaces["synchro-drive"], 0)
    with pytest.raises(InvalidInput, match="mecanum"):
        steering_polygons(spaces["mecanum"], 0)
    with pytest.raises(InvalidInput, match="castor"):
        rolling_polygons(spaces["drive-steer-offset"], "castor-rear")
