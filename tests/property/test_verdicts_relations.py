"""Verdicts of motions that are slower, mirrored or reversed, on every kind of vehicle.

Half of the motions are at their limit or just beyond it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np
import numpy.typing as npt
import pytest
from verdict_cases import (
    DIFFERENT_KINDS,
    GRID,
    Case,
    cases_of,
    catalogue_cases,
    judged,
    with_rates,
)

import configspace
from configspace import Vehicle
from configspace.testing import ALL_KINDS, random_vehicle
from omniplan import Report, Trajectory

FloatArray = npt.NDArray[np.float64]
Change = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]
"""From times and samples to others of the same form."""


def changed(
    trajectory: Trajectory,
    change: Change,
    vehicle: Vehicle,
    *,
    point: tuple[float, float] | None = None,
) -> Trajectory:
    """Return the trajectory of changed samples; parameters are those of `vehicle`."""
    t, samples = change(trajectory.t, trajectory.samples)
    if trajectory.form == "omni_curve":
        kappa_n, beta, v_n = samples.T
        return Trajectory.from_omni_curve(t, kappa_n, beta, v_n, vehicle)
    build = getattr(Trajectory, f"from_{trajectory.form}")
    out: Trajectory = build(
        t, samples, reference_point=point or trajectory.reference_point
    )
    return out


def random_cases(seed: int, vehicles: int) -> Iterator[Case]:
    rng = np.random.default_rng(seed)
    for i in range(vehicles):
        vehicle = random_vehicle(rng, ALL_KINDS[i % len(ALL_KINDS)])
        yield from cases_of(with_rates(rng, vehicle), 1, seed + i)


# --- mirrored


def mirrored(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with left and right exchanged."""
    data = vehicle.model_dump(mode="json")
    for wheel in data["wheels"]:
        for key in ("y", "heading_deg", "roller_deg", "offset"):
            if key in wheel:
                wheel[key] = -wheel[key]
        if wheel.get("steering_range_deg"):
            least, largest = wheel["steering_range_deg"]
            wheel["steering_range_deg"] = [-largest, -least]
    if data["reference_point"]:
        x, y = data["reference_point"]
        data["reference_point"] = [x, -y]
    if data["load"]:
        x, y, z = data["load"]["center_of_gravity"]
        data["load"]["center_of_gravity"] = [x, -y, z]
    data["footprint"] = [[x, -y] for x, y in data["footprint"]][::-1]
    return configspace.vehicle_from_data(data)


def mirror(t: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
    return t, samples * [1, -1, -1]


def mirror_parameters(
    t: FloatArray, samples: FloatArray
) -> tuple[FloatArray, FloatArray]:
    return t, samples * [-1, -1, 1]


def assert_mirrored_alike(cases: Iterable[Case]) -> tuple[int, int]:
    """Return how many were valid and how many not."""
    verdicts = [0, 0]
    for case in cases:
        vehicle = mirrored(case.vehicle)
        space = configspace.build_space(vehicle, GRID, cache=False)
        x, y = case.trajectory.reference_point
        change = mirror_parameters if case.trajectory.form == "omni_curve" else mirror
        flipped = changed(case.trajectory, change, vehicle, point=(x, -y))
        one, two = case.report, judged(flipped, space)
        assert one.valid == two.valid
        assert broken(one) == broken(two)
        assert one.margin == pytest.approx(two.margin, rel=1e-6, abs=1e-6)
        assert one.speed_factor == pytest.approx(two.speed_factor, rel=1e-6)
        verdicts[one.valid] += 1
    return verdicts[True], verdicts[False]


def broken(report: Report) -> list[tuple[str, str, bool, float]]:
    """Kind, wheel, whether it is proved, and the size of the value."""
    return sorted(
        (v.limit, v.wheel or "", v.is_proved, float(f"{abs(v.value or 0.0):.6g}"))
        for v in report.violations
    )


@pytest.mark.parametrize("name", DIFFERENT_KINDS)
def test_a_mirrored_motion_has_the_mirrored_verdict(name: str) -> None:
    valid, refused = assert_mirrored_alike(catalogue_cases(name, 1))
    assert valid >= 2
    assert refused >= 1


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_many_mirrored_motions_have_the_mirrored_verdicts() -> None:
    valid, refused = assert_mirrored_alike(random_cases(4, 10 * len(ALL_KINDS)))
    assert min(valid, refused) > 10 * len(ALL_KINDS)


# --- reversed


def symmetric(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle that brakes and drives backwards as it goes forwards."""
    data = vehicle.model_dump(mode="json")
    limits = data["limits"]
    limits["max_deceleration"] = limits["max_acceleration"]
    limits["max_reverse_speed"] = limits["max_speed"]
    return configspace.vehicle_from_data(data)


def reverse(t: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
    return -t[::-1], samples[::-1]


def reverse_twists(t: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
    return -t[::-1], -samples[::-1]


def reverse_parameters(
    t: FloatArray, samples: FloatArray
) -> tuple[FloatArray, FloatArray]:
    return -t[::-1], samples[::-1] * [1, 1, -1]


REVERSALS = {
    "poses": reverse,
    "twists": reverse_twists,
    "omni_curve": reverse_parameters,
}


BACKWARDS = {"ACCELERATION": "DECELERATION", "DECELERATION": "ACCELERATION"}


def kinds(report: Report, names: dict[str, str]) -> set[tuple[str, str | None]]:
    """What is proved to be broken, renamed.

    Where the speed is too high it is so backwards as well, at the same limit.
    """
    return {
        (names.get(v.limit, v.limit), v.wheel)
        for v in report.violations
        if v.is_proved and v.limit != "REVERSE_SPEED"
    }


def by_choice(found: set[tuple[str, str | None]]) -> set[tuple[str, str | None]]:
    """Of these what another representation may keep."""
    return {(limit, w) for limit, w in found if limit in {"STEER_RANGE", "WHEEL_SPEED"}}


def assert_reversed_alike(vehicle: Vehicle, cases: Iterable[Case]) -> int:
    """Return how many were valid. The cases are those of a symmetric vehicle."""
    valid = 0
    for case in cases:
        change = REVERSALS[case.trajectory.form]
        back = judged(changed(case.trajectory, change, vehicle), case.space)
        assert back.valid == case.report.valid, (case.report.violations, back)
        one, two = kinds(case.report, {}), kinds(back, BACKWARDS)
        # Of representations that are as bad the one with v_s > 0 is named.
        if by_choice(one) == by_choice(two):
            assert one == two, case.vehicle.name
        valid += case.report.valid
    return valid


@pytest.mark.parametrize("name", DIFFERENT_KINDS)
def test_a_reversed_motion_is_as_valid_where_limits_are_symmetric(name: str) -> None:
    vehicle = symmetric(configspace.load_vehicle(name))
    assert assert_reversed_alike(vehicle, cases_of(vehicle, 1, 1)) >= 2


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_many_reversed_motions_are_as_valid_where_limits_are_symmetric() -> None:
    rng = np.random.default_rng(5)
    valid, vehicles = 0, 10 * len(ALL_KINDS)
    for i in range(vehicles):
        drawn = with_rates(rng, random_vehicle(rng, ALL_KINDS[i % len(ALL_KINDS)]))
        vehicle = symmetric(drawn)
        valid += assert_reversed_alike(vehicle, cases_of(vehicle, 1, i))
    assert valid > 3 * vehicles


# --- slower


def assert_slower_stays_valid(cases: Iterable[Case], seed: int) -> int:
    """Return how many were valid."""
    rng, valid = np.random.default_rng(seed), 0
    for case in cases:
        if case.report.valid:
            factor = float(10 ** rng.uniform(-1.5, 0))
            slower = judged(case.trajectory.scaled(factor), case.space)
            assert slower.valid, (factor, case.vehicle.name, slower.violations)
            valid += 1
    return valid


@pytest.mark.parametrize("name", DIFFERENT_KINDS)
def test_driving_slower_stays_valid(name: str) -> None:
    assert assert_slower_stays_valid(catalogue_cases(name, 1), 1) >= 2


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("name", configspace.catalog())
def test_driving_much_slower_stays_valid(name: str) -> None:
    assert assert_slower_stays_valid(catalogue_cases(name, 4, 2), 2) >= 16


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_driving_random_vehicles_slower_stays_valid() -> None:
    vehicles = 10 * len(ALL_KINDS)
    cases = random_cases(6, vehicles)
    assert assert_slower_stays_valid(cases, 6) > 3 * vehicles
