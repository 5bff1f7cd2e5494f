"""Distances to what is blocked, against brute force over the exact formula."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import configspace
from configspace import (
    Grid,
    PermissibleSpace,
    angular_distance,
    clearance_map,
    path_clearance,
    sphere_point,
)
from configspace.testing import (
    ALL_KINDS,
    random_configurations,
    rigid_body,
    vehicles,
)
from configspace.vehicle import Vehicle

SEEDS = st.integers(0, 2**32 - 1)
GRID = Grid(48, 72)


def built(vehicle: str | Vehicle, grid: Grid = GRID) -> PermissibleSpace:
    if isinstance(vehicle, str):
        vehicle = configspace.load_vehicle(vehicle)
    return configspace.build_space(vehicle, grid, cache=False)


def plainly(kappa_n: np.ndarray, beta: np.ndarray, scale: float) -> np.ndarray:
    """Longitude and latitude of configurations, by cases."""
    size = np.abs(kappa_n)
    with np.errstate(divide="ignore"):
        ratio = np.where(size < 1, size, 1 / (2 - size))
    theta = np.copysign(np.arctan(scale * ratio), kappa_n)
    return np.stack(
        [np.cos(theta) * np.cos(beta), np.cos(theta) * np.sin(beta), np.sin(theta)],
        axis=-1,
    )


@settings(deadline=None, max_examples=15)
@given(vehicles(ALL_KINDS), SEEDS, st.sampled_from([0.3, 1.0, 2.5]))
def test_nothing_blocked_is_nearer(vehicle: Vehicle, seed: int, factor: float) -> None:
    """Against every blocked configuration of a random set, by the rigid body."""
    rng = np.random.default_rng(seed)
    space = built(vehicle)
    clearance = clearance_map(space, factor / space.kappa_g)
    kappa_n, beta = random_configurations(rng, vehicle, 3000)
    if vehicle.mobility.line_beta is not None:
        beta = np.full(beta.shape, vehicle.mobility.line_beta)
    if vehicle.mobility.is_translating:
        kappa_n = np.zeros(kappa_n.shape)
    blocked = rigid_body(vehicle, kappa_n, beta).is_blocked
    said = clearance(kappa_n[:100], beta[:100])
    assert (said[blocked[:100]] == 0).all()
    assert (said >= 0).all()
    if not blocked.any():
        return
    points = plainly(kappa_n, beta, factor)
    cosine = np.clip(points[:100] @ points[blocked].T, -1, 1)
    nearest = np.arccos(cosine.max(axis=1))
    assert (said <= nearest + 2e-8).all()  # arccos near 1


def test_it_is_the_distance_but_for_the_size_of_a_part() -> None:
    """A dense set of the blocked area of the paper's vehicle."""
    space = built("ift-four-steered", Grid(200, 360))
    assert space.vehicle is not None
    clearance = clearance_map(space)
    kappa_n, beta = np.meshgrid(
        np.linspace(-2, 2, 601), np.linspace(-np.pi, np.pi, 901), indexing="ij"
    )
    blocked = configspace.exact_v_max(space.vehicle, kappa_n, beta) == 0
    points = plainly(kappa_n[blocked], beta[blocked], 1.0)
    rng = np.random.default_rng(8)
    at = rng.uniform(-2, 2, 60), rng.uniform(-np.pi, np.pi, 60)
    nearest = np.arccos(np.clip(plainly(*at, 1.0) @ points.T, -1, 1).max(axis=1))
    said = clearance(*at)
    assert (said <= nearest + 1e-9).all()
    # Beside the parts: the samples of the blocked area are up to 0.006 apart.
    assert (said >= nearest - 3 * clearance.radius - 6e-3).all()
    assert said.max() > 0.5
    assert clearance.radius < 0.008


def test_neither_the_seam_nor_a_pole_is_a_border() -> None:
    space = built("ift-four-steered", Grid(200, 360))
    clearance = clearance_map(space)
    # Over the pole to the other side: all β are one configuration there.
    at_pole = clearance(2.0, np.linspace(-3, 3, 7))
    assert at_pole.min() > 0.1
    np.testing.assert_allclose(at_pole, at_pole[0], atol=1e-12)
    beyond = clearance([1.95, 1.95], [0.3, 0.3 - np.pi])
    apart = angular_distance(sphere_point(1.95, 0.3), sphere_point(1.95, 0.3 - np.pi))
    assert abs(beyond[0] - beyond[1]) <= apart
    free = built("synchro-drive")
    assert np.isinf(clearance_map(free)(0.0, [-np.pi, 0.0, np.pi])).all()
    assert clearance_map(free)(0.3, 0.0) == 0


def test_a_line_mobile_vehicle_has_distances_along_its_line() -> None:
    space = built("ackermann", Grid(400, 8))
    assert space.vehicle is not None
    clearance = clearance_map(space)
    kappa_n = np.linspace(-2, 2, 100001)
    open_ = configspace.exact_v_max(space.vehicle, kappa_n, 0.0) > 0
    most = np.arctan(kappa_n[open_].max())
    at = np.array([0.0, 0.1, 0.2])
    said = clearance(at, 0.0)
    assert (said <= most - np.arctan(at) + 1e-4).all()
    assert (said >= most - np.arctan(at) - 2 * clearance.radius - 1e-4).all()
    assert clearance(0.1, 0.2) == 0
    assert np.isinf(clearance_map(built("differential"))(1.0, 0.0))


def test_where_nothing_is_blocked_it_is_infinite() -> None:
    assert np.isinf(clearance_map(built("mecanum"))([0.0, 2.0], [3.0, 0.0])).all()


@settings(deadline=None, max_examples=15)
@given(vehicles(("steered",)), SEEDS)
def test_a_way_keeps_its_clearance_between_the_samples(
    vehicle: Vehicle, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    space = built(vehicle)
    clearance = clearance_map(space)
    kappa_n = np.cumsum(rng.normal(0, 0.1, 6))
    beta = np.cumsum(rng.normal(0, 0.1, 6))
    kappa_n = np.clip(kappa_n, -2, 2)
    margin = path_clearance(clearance, kappa_n, beta)
    assert margin <= clearance(kappa_n, beta).min()
    points = sphere_point(kappa_n, beta)
    share = np.linspace(0, 1, 50)[:, None]
    for a, b in itertools.pairwise(points):
        way = (1 - share) * a + share * b  # its direction runs along the great circle
        flat = np.hypot(way[:, 0], way[:, 1])
        on = curvature(flat, way[:, 2]), np.arctan2(way[:, 1], way[:, 0])
        if margin > 0:
            assert (space.v_max(*on) > 0).all()
        assert (clearance(*on) >= margin - 2 * clearance.radius - 1e-9).all()


def curvature(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    state = configspace.from_twist(np.stack([p, np.zeros_like(p), q], axis=-1), 1.0)
    return state[0]


def test_a_single_configuration_is_a_way() -> None:
    clearance = clearance_map(built("ift-four-steered"))
    assert path_clearance(clearance, [0.2], [0.1]) == clearance(0.2, 0.1)


@pytest.mark.parametrize("d", [0.0, -1.0, np.nan, np.inf])
def test_a_length_that_is_none_is_refused(d: float) -> None:
    with pytest.raises(configspace.InvalidInput):
        clearance_map(built("ackermann"), d)
