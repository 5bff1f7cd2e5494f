"""Pieces of constant κ_n: "permitted" is never wrong, and little else is refused."""

from __future__ import annotations

import functools

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import configspace
from configspace import PermissibleSpace, Vehicle, testing
from configspace.grid import Grid
from omniplan.sampling.intervals import PermittedIntervals

FloatArray = npt.NDArray[np.float64]

DENSE = 241
"""Places along a piece that the truth is asked at, beside both ends."""


@functools.lru_cache(maxsize=64)
def _space_of(seed: int, kind: testing.VehicleKind) -> PermissibleSpace:
    vehicle = testing.random_vehicle(np.random.default_rng(seed), kind)
    return configspace.build_space(vehicle, Grid(32, 48), cache=False)


def _sheet(space: PermissibleSpace) -> PermissibleSpace:
    return PermissibleSpace(space.header, space.tables, space.rates)


def _pieces(
    rng: np.random.Generator, vehicle: Vehicle, count: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return κ_n, β_0 and β_1; many begin where something happens."""
    kappa_n, beta_0 = testing.random_configurations(rng, vehicle, count)
    size = rng.choice([0.0, 1e-9, 1e-3, 0.1, 1.0, 3.0, 7.0], count)
    turn = rng.uniform(-1, 1, count) * size
    line = vehicle.mobility.line_beta
    if line is not None:
        turn = np.where(rng.random(count) < 0.8, 0.0, turn)
    return kappa_n, beta_0, beta_0 + turn


def _along(beta_0: FloatArray, beta_1: FloatArray) -> FloatArray:
    return beta_0[:, None] + np.linspace(0, 1, DENSE) * (beta_1 - beta_0)[:, None]


@settings(deadline=None, max_examples=25)
@given(
    st.integers(0, 2**32 - 1), st.integers(0, 15), st.sampled_from(testing.ALL_KINDS)
)
def test_a_permitted_piece_is_permitted_all_along(
    seed: int, number: int, kind: testing.VehicleKind
) -> None:
    space = _space_of(number, kind)
    vehicle = space.vehicle
    assert vehicle is not None
    kappa_n, beta_0, beta_1 = _pieces(np.random.default_rng(seed), vehicle, 300)
    along = _along(beta_0, beta_1)
    at = np.broadcast_to(kappa_n[:, None], along.shape)
    truth = testing.rigid_body(vehicle, at, along)
    for each in (space, _sheet(space)):
        intervals = PermittedIntervals(each, reachable_only=False)
        permitted = intervals.is_permitted(kappa_n, beta_0, beta_1)
        assert not (permitted[:, None] & truth.is_blocked).any()


@settings(deadline=None, max_examples=15)
@given(
    st.integers(0, 2**32 - 1), st.integers(0, 15), st.sampled_from(testing.ALL_KINDS)
)
def test_with_the_vehicle_only_what_touches_a_border_is_refused(
    seed: int, number: int, kind: testing.VehicleKind
) -> None:
    space = _space_of(number, kind)
    vehicle = space.vehicle
    assert vehicle is not None
    kappa_n, beta_0, beta_1 = _pieces(np.random.default_rng(seed), vehicle, 300)
    along = _along(beta_0, beta_1)
    at = np.broadcast_to(kappa_n[:, None], along.shape)
    # Farther from every border than a piece may leave it between two places.
    room = 1e-5 + 8 * np.abs(beta_1 - beta_0) / (DENSE - 1)
    clear = testing.rigid_body(vehicle, at, along)
    open_ = (clear.margin > room[:, None]) & (clear.stillness > room[:, None])
    open_ &= clear.spare > 8 * room[:, None]
    # A range of a full turn or more is cut where it ends, as in the table.
    intervals = PermittedIntervals(space, reachable_only=False)
    refused = ~intervals.is_permitted(kappa_n, beta_0, beta_1)
    whole = [
        w
        for w in vehicle.wheels
        if isinstance(w, configspace.vehicle.SteerableWheel)
        and np.isfinite(w.steering_range[1])
        and w.steering_range[1] - w.steering_range[0] >= 2 * np.pi
    ]
    if not whole:
        assert not (refused & open_.all(axis=1)).any()


@settings(deadline=None, max_examples=15)
@given(
    st.integers(0, 2**32 - 1), st.integers(0, 15), st.sampled_from(testing.ALL_KINDS)
)
def test_the_speed_of_a_piece_is_permitted_all_along(
    seed: int, number: int, kind: testing.VehicleKind
) -> None:
    space = _space_of(number, kind)
    vehicle = space.vehicle
    assert vehicle is not None
    kappa_n, beta_0, beta_1 = _pieces(np.random.default_rng(seed), vehicle, 200)
    along = _along(beta_0, beta_1)
    at = np.broadcast_to(kappa_n[:, None], along.shape)
    intervals = PermittedIntervals(space)
    for reverse in (False, True):
        speed = intervals.v_max(kappa_n, beta_0, beta_1, reverse=reverse)
        truth = testing.rigid_body(vehicle, at, along, reverse=reverse)
        moving = speed > 0
        too_fast = speed[:, None] > truth.v_max * (1 + 1e-12)
        assert not too_fast[moving].any()
        sign = -1 if reverse else 1
        asked = intervals.is_permitted(kappa_n, beta_0, beta_1, v_s=sign * speed)
        assert (asked == intervals.is_permitted(kappa_n, beta_0, beta_1)).all()
        over = sign * speed * (1 + 1e-6)
        assert not intervals.is_permitted(
            kappa_n[moving], beta_0[moving], beta_1[moving], v_s=over[moving]
        ).any()


@settings(deadline=None, max_examples=15)
@given(
    st.integers(0, 2**32 - 1), st.integers(0, 15), st.sampled_from(testing.ALL_KINDS)
)
def test_what_the_sheet_permits_the_vehicle_permits(
    seed: int, number: int, kind: testing.VehicleKind
) -> None:
    space = _space_of(number, kind)
    assert space.vehicle is not None
    pieces = _pieces(np.random.default_rng(seed), space.vehicle, 300)
    for reachable_only in (False, True):
        by_sheet = PermittedIntervals(_sheet(space), reachable_only)
        by_vehicle = PermittedIntervals(space, reachable_only)
        implied = by_vehicle.is_permitted(*pieces) | ~by_sheet.is_permitted(*pieces)
        assert implied.all()


@settings(deadline=None, max_examples=15)
@given(
    st.integers(0, 2**32 - 1), st.integers(0, 15), st.sampled_from(testing.ALL_KINDS)
)
def test_less_of_a_piece_is_permitted_as_well_and_so_is_its_reverse(
    seed: int, number: int, kind: testing.VehicleKind
) -> None:
    space = _space_of(number, kind)
    assert space.vehicle is not None
    rng = np.random.default_rng(seed)
    kappa_n, beta_0, beta_1 = _pieces(rng, space.vehicle, 300)
    intervals = PermittedIntervals(space)
    permitted = intervals.is_permitted(kappa_n, beta_0, beta_1)
    swapped = intervals.is_permitted(kappa_n, beta_1, beta_0)
    # Sums of angles are rounded: a piece next to a border may be seen either way.
    assert (permitted != swapped).mean() < 0.02
    shares = np.sort(rng.random((2, 300)), axis=0)
    part = [beta_0 + u * (beta_1 - beta_0) for u in shares]
    inner = intervals.is_permitted(kappa_n, *part)
    assert (inner | ~permitted).all()


@pytest.mark.parametrize("name", configspace.catalog())
@pytest.mark.slow
def test_the_catalogue_against_dense_sampling(name: str) -> None:
    space = configspace.build_space(configspace.load_vehicle(name))
    assert space.vehicle is not None
    rng = np.random.default_rng(5)
    kappa_n, beta_0, beta_1 = _pieces(rng, space.vehicle, 3000)
    along = _along(beta_0, beta_1)
    at = np.broadcast_to(kappa_n[:, None], along.shape)
    free = (space.v_max(at, along, reachable_only=True) > 0).all(axis=1)
    permitted = PermittedIntervals(space).is_permitted(kappa_n, beta_0, beta_1)
    wrong = permitted & ~free
    if wrong.any():
        truth = testing.rigid_body(space.vehicle, at[wrong], along[wrong])
        assert not truth.is_blocked.any()
    sheet = PermittedIntervals(_sheet(space)).is_permitted(kappa_n, beta_0, beta_1)
    assert (permitted | ~sheet).all()
