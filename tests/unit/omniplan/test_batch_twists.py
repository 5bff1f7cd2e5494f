import dataclasses
import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import configspace
from configspace import Grid, InvalidInput, PermissibleSpace, build_space
from configspace.omni_curve import from_twist
from configspace.testing import ALL_KINDS, random_configurations, random_vehicle
from omniplan import Tolerances, check_twists

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

GRID = Grid(40, 72)


def at_k(twists: FloatArray, space: PermissibleSpace) -> FloatArray:
    x, y = space.header.reference
    moved = twists.copy()
    moved[:, 0] -= twists[:, 2] * y
    moved[:, 1] += twists[:, 2] * x
    return moved


def by_contains(
    twists: npt.ArrayLike, space: PermissibleSpace, tolerances: Tolerances | None = None
) -> BoolArray:
    """The naive twin: `PermissibleSpace.contains` in both representations."""
    tolerances = tolerances or Tolerances()
    k = at_k(np.asarray(twists, np.float64), space)
    fits = np.ones(len(k), dtype=bool)
    line = space.line_beta
    if line is not None or space.is_translating:
        q = np.abs(k[:, 2]) / space.kappa_g
        v_s = np.maximum(np.hypot(k[:, 0], k[:, 1]), q)
        room = np.maximum(math.sin(tolerances.slip_angle) * v_s, tolerances.slip_speed)
        if line is None:
            fits = q <= room
            k[:, 2] = 0
        else:
            along = k[:, 0] * math.cos(line) + k[:, 1] * math.sin(line)
            aside = k[:, 1] * math.cos(line) - k[:, 0] * math.sin(line)
            fits = np.abs(aside) <= room
            k[:, 0], k[:, 1] = along, 0
    permitted = (k == 0).all(axis=1)
    for sign in (1, -1):
        kappa_n, beta, v_s = from_twist(k, space.kappa_g, sign)
        if line is not None:  # β is the line's wherever v_s has the sign of the motion
            forwards = sign * k[:, 0] >= 0
            permitted |= forwards & space.contains(kappa_n, line, v_s)
        else:
            permitted |= space.contains(kappa_n, beta, v_s)
    return np.asarray(fits & permitted)


def assert_alike(twists: npt.NDArray[Any], space: PermissibleSpace) -> BoolArray:
    """Assert the same answers, at the last digit of a threshold aside."""
    expected = by_contains(twists, space)
    exact = twists.astype(np.float64)
    sure = by_contains(exact * (1 + 1e-14), space) == by_contains(
        exact * (1 - 1e-14), space
    )
    assert sure.mean() > 0.7
    np.testing.assert_array_equal(check_twists(twists, space)[sure], expected[sure])
    return expected


def random_twists(
    rng: np.random.Generator, space: PermissibleSpace, count: int
) -> FloatArray:
    """Twists around the permitted speeds, many on kinks, poles and axes."""
    vehicle = space.vehicle
    assert vehicle is not None
    kappa_n, beta = random_configurations(rng, vehicle, count)
    v_max = space.v_max(kappa_n, beta)
    speed = np.where(v_max > 0, v_max, 1.0) * rng.choice(
        [1e-4, 0.5, 1 - 1e-7, 1.0, 1 + 1e-7, 1.02, 2.0], count
    )
    speed *= rng.choice([-1.0, 1.0], count)
    twists = configspace.to_twist(kappa_n, beta, speed, space.kappa_g)
    axis = rng.random((count, 3)) < 0.05
    twists[axis] = 0.0
    noise = rng.random(count) < 0.3
    twists[noise] *= 1 + rng.normal(0, 1e-2, (int(noise.sum()), 3))
    x, y = space.header.reference
    twists[:, 0] += twists[:, 2] * y
    twists[:, 1] -= twists[:, 2] * x
    return twists


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_agrees_with_contains_for_random_vehicles(kind: str) -> None:
    rng = np.random.default_rng(seed_of(kind))
    for _ in range(3):
        known = build_space(random_vehicle(rng, kind), GRID, cache=False)  # type: ignore[arg-type]
        twists = random_twists(rng, known, 4000)
        for space in (known, dataclasses.replace(known, vehicle=None)):
            for given in (twists, twists.astype(np.float32)):
                expected = assert_alike(given, space)
        assert expected.any()
        assert not expected.all()


def seed_of(kind: str) -> int:
    return 100 + list(ALL_KINDS).index(kind)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "name", ["ift-four-steered", "mecanum", "ackermann", "tricycle", "two-turntables"]
)
def test_agrees_with_contains_for_the_catalogue(name: str) -> None:
    space = build_space(configspace.load_vehicle(name), cache=False)
    rng = np.random.default_rng(5)
    twists = random_twists(rng, space, 30_000)
    expected = assert_alike(twists, space)
    assert 0.05 < expected.mean() < 0.95


def test_many_twists_go_through_the_threads_alike() -> None:
    space = build_space(configspace.load_vehicle("mecanum"), GRID, cache=False)
    twists = np.random.default_rng(2).uniform(-2, 2, (200_001, 3)).astype(np.float32)
    whole = check_twists(twists, space)
    parts = [check_twists(part, space) for part in np.array_split(twists, 11)]
    np.testing.assert_array_equal(whole, np.concatenate(parts))


def test_standing_still_is_permitted_even_where_straight_ahead_is_blocked() -> None:
    vehicle = configspace.vehicle_from_data(
        {
            "name": "sideways",
            "wheels": [
                {
                    "id": name,
                    "type": "steered",
                    "x": x,
                    "y": 0.0,
                    "max_speed": 1.0,
                    "steering_range_deg": [45, 135],
                }
                for name, x in (("a", 0.5), ("b", -0.5))
            ],
        }
    )
    space = build_space(vehicle, GRID, cache=False)
    twists = [[0.0, 0.0, 0.0], [0.5, 0, 0], [0, 0.5, 0], [0, -0.5, 0]]
    np.testing.assert_array_equal(
        check_twists(twists, space), [True, False, True, True]
    )


def test_backwards_has_its_own_limit() -> None:
    vehicle = configspace.vehicle_from_data(
        {
            "name": "slow-back",
            "wheels": [
                {
                    "id": "w",
                    "type": "steered",
                    "x": 0.5,
                    "y": 0.0,
                    "max_speed": 1.0,
                    "steering_range_deg": [-80, 80],
                },
                {"id": "c", "type": "castor", "x": -0.5, "y": 0.0},
            ],
            "limits": {"max_reverse_speed": 0.3},
        }
    )
    space = build_space(vehicle, GRID, cache=False)
    twists: list[list[float]] = [[0.9, 0, 0], [-0.9, 0, 0], [-0.29, 0, 0]]
    assert check_twists(twists, space).tolist() == [True, False, True]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_slip_of_a_line_mobile_vehicle_is_within_the_tolerances(
    dtype: type[np.floating[npt.NBitBase]],
) -> None:
    space = build_space(configspace.load_vehicle("differential"), GRID, cache=False)
    one_degree = math.tan(math.radians(1.0))
    twists = np.array(
        [
            [0.5, 0.5 * one_degree * 0.99, 0.0],
            [0.5, 0.5 * one_degree * 1.01, 0.0],
            [0.1, 0.0049, 0.0],
            [0.1, 0.0051, 0.0],
        ],
        dtype=dtype,
    )
    assert check_twists(twists, space).tolist() == [True, False, True, False]
    wide = Tolerances(slip_angle=math.radians(5.0))
    assert check_twists(twists, space, wide).all()


def test_a_synchro_drive_may_turn_within_the_tolerances() -> None:
    space = build_space(configspace.load_vehicle("synchro-drive"), GRID, cache=False)
    slow = 0.004 * space.kappa_g
    twists: list[list[float]] = [
        [0.1, 0.1, slow],
        [0.1, 0.1, 2 * slow],
        [0.0, 0.0, slow],
    ]
    assert check_twists(twists, space).tolist() == [True, False, True]


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("name", ["mecanum", "differential"])
@pytest.mark.parametrize("count", [10, 200_000])
def test_what_is_not_finite_is_named_by_its_row(
    value: float, dtype: type[np.floating[npt.NBitBase]], name: str, count: int
) -> None:
    space = build_space(configspace.load_vehicle(name), GRID, cache=False)
    twists = np.zeros((count, 3), dtype)
    for column in range(3):
        bad = twists.copy()
        bad[count - 3, column] = value
        with pytest.raises(InvalidInput, match=rf"twists\[{count - 3}\]"):
            check_twists(bad, space)


@pytest.mark.parametrize("size", [1e-300, 1e-40, 1e-31, 1e16, 1e38, 1e300])
def test_extreme_sizes_are_decided(size: float) -> None:
    space = build_space(configspace.load_vehicle("mecanum"), GRID, cache=False)
    twists = size * np.eye(3)
    np.testing.assert_array_equal(
        check_twists(twists, space), [size < 1, size < 1, size < 1]
    )


@pytest.mark.parametrize(
    "twists", [[1.0, 2.0, 3.0], np.zeros((2, 2)), "abc", [[1, 2], [3]], [["a"] * 3]]
)
def test_other_shapes_and_types_are_refused(twists: object) -> None:
    space = build_space(configspace.load_vehicle("mecanum"), GRID, cache=False)
    with pytest.raises(InvalidInput, match="twists"):
        check_twists(twists, space)  # type: ignore[arg-type]


def test_no_twists_are_no_answers_and_inputs_stay() -> None:
    space = build_space(configspace.load_vehicle("mecanum"), GRID, cache=False)
    assert check_twists(np.zeros((0, 3)), space).shape == (0,)
    twists = np.ones((4, 3))[::2]
    before = twists.copy()
    assert check_twists(twists, space).shape == (2,)
    np.testing.assert_array_equal(twists, before)
