import cmath

import numpy as np
import pytest

from configspace import (
    Grid,
    InvalidInput,
    PermissibleSpace,
    build_space,
    load_vehicle,
    vehicle_from_data,
)
from configspace.plot_data import (
    blocked_ranges,
    cell_values,
    curve_values,
    require_curve,
    require_plane,
    support_polygon,
    wheel_bodies,
)
from configspace.vehicle import SteeredWheel

GRID = Grid(40, 60)


def space_of(name: str) -> PermissibleSpace:
    return build_space(load_vehicle(name), GRID, cache=False)


def synchro_with_stops() -> PermissibleSpace:
    data = load_vehicle("synchro-drive").model_dump(exclude_none=True)
    for wheel in data["wheels"]:
        wheel["steering_range_deg"] = (-150.0, 120.0)
    return build_space(vehicle_from_data(data, "stops"), GRID, cache=False)


@pytest.mark.parametrize("name", ["ackermann", "differential", "husky", "msl"])
def test_curve_is_what_the_space_answers(name: str) -> None:
    space = space_of(name)
    assert space.line_beta is not None
    for reverse in (False, True):
        kappa_n, v_max = curve_values(space, reverse=reverse)
        answers = space.v_max(kappa_n, space.line_beta, reverse=reverse)
        np.testing.assert_array_equal(np.nan_to_num(v_max), answers)
        assert kappa_n[0] == -2
        assert kappa_n[-1] == 2


def test_curve_of_a_synchro_drive_runs_over_beta() -> None:
    space = synchro_with_stops()
    beta, v_max = curve_values(space)
    assert beta[0] == -np.pi
    assert beta[-1] == np.pi
    np.testing.assert_array_equal(np.nan_to_num(v_max), space.v_max(0.0, beta))
    assert np.nanmax(v_max) == pytest.approx(0.6)
    expected = np.radians([(-180, -150), (120, 180)])
    np.testing.assert_allclose(blocked_ranges(space), expected, atol=1e-6)
    assert blocked_ranges(space_of("synchro-drive")) == []


def test_spaces_are_planes_or_curves() -> None:
    plane, line, translating = map(
        space_of, ("mecanum", "differential", "synchro-drive")
    )
    require_plane(plane)
    require_curve(line)
    require_curve(translating)
    with pytest.raises(InvalidInput, match="plot_surface"):
        require_curve(plane)
    for curve in (line, translating):
        with pytest.raises(InvalidInput, match="plot_curve"):
            require_plane(curve)
    with pytest.raises(InvalidInput, match="not line-mobile"):
        curve_values(plane)


def test_nothing_is_mixed_without_steering() -> None:
    *_, mixed = cell_values(space_of("mecanum"))
    assert not mixed.any()


def test_wheels_stand_beside_their_steering_axes() -> None:
    first, second, castor, _ = load_vehicle("drive-steer-offset").wheels
    for wheel, expected in (
        (first, 0.35 + 0.24j),
        (second, -0.35 - 0.24j),
        (castor, 0.35 - 0.2j),
    ):
        ((place, direction),) = wheel_bodies(wheel)
        assert place == pytest.approx(expected)
        assert direction == 0


def test_turntable_has_two_wheels_left_and_right() -> None:
    front = load_vehicle("two-turntables").wheels[0]
    places = [place for place, _ in wheel_bodies(front)]
    assert places == pytest.approx([0.55 + 0.2j, 0.55 - 0.2j])


def test_wheel_that_cannot_point_ahead_is_in_the_middle_of_its_range() -> None:
    wheel = SteeredWheel(
        id="w", x=1.0, y=0.0, offset=0.1, steering_range_deg=(80.0, 100.0)
    )
    ((place, alpha),) = wheel_bodies(wheel)
    assert alpha == pytest.approx(np.pi / 2)
    assert place == pytest.approx(1.0 + 0.1 * cmath.exp(1j * np.pi))
    whole_turn = wheel.model_copy(update={"steering_range_deg": (350.0, 370.0)})
    assert wheel_bodies(whole_turn) == ((1.0 + 0.1j, 0.0),)


def test_support_polygon_spans_the_outer_contacts() -> None:
    corners = support_polygon(load_vehicle("two-turntables"))
    expected = {(x, y) for x in (-0.75, 0.75) for y in (-0.3, 0.3)}
    assert {(float(x), float(y)) for x, y in corners} == expected
    x, y = corners.T
    assert np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)) == pytest.approx(1.8)
