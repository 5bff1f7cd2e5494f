"""Verdicts on every kind of vehicle against a simulation that shares no code."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator

import naive_limits
import numpy as np
import pytest
import random_motions
from naive_limits import Use
from naive_motion import Simulation
from verdict_cases import (
    DIFFERENT_KINDS,
    Case,
    cases_of,
    catalogue_cases,
    with_rates,
)

import configspace
from configspace.testing import ALL_KINDS, random_vehicle
from omniplan import Violation

FORMS = 3
WAYS = ("forwards", "backwards", "left", "right", "with stops")

ELSEWHERE = {"RECONFIGURATION", "SINGULAR", "UNREACHABLE"}
"""Kinds of violations that are not a value beyond a bound, sample by sample."""


RESOLVED = 1e-3
"""A peak that breaks a limit by less may lie between the samples of the simulation."""


def uses_named(simulation: Simulation, violation: Violation) -> list[Use]:
    """The limits in the representation that the violation names, over its piece."""
    uses = list(naive_limits.whole_uses(simulation))
    k, side = abs(violation.kappa_n), math.copysign(1.0, violation.kappa_n)
    c, s = min(1.0, 2 - k), min(1.0, k) * side
    for piece in simulation.pieces:
        t = simulation.t[piece.rows]
        if t[0] - 1e-6 <= violation.t <= t[-1] + 1e-6:
            row = piece.first + int(np.abs(t - violation.t).argmin())
            ahead = simulation.kx[row] * math.cos(violation.beta)
            ahead += simulation.ky[row] * math.sin(violation.beta)
            turn = simulation.omega[row] / simulation.kappa_g
            sign = 1 if c * ahead + s * turn > 0 else -1
            uses += naive_limits.piece_uses(simulation, piece, sign)
    return uses


def assert_simulation_agrees(cases: Iterable[Case]) -> Counter[str]:
    """Valid motions break no limit; what is proved to be broken breaks here as well."""
    seen: Counter[str] = Counter()
    for case in cases:
        simulation = random_motions.simulated(case.vehicle, case.trajectory)
        signs = random_motions.driven_signs(case.trajectory, simulation)
        uses = naive_limits.uses(simulation, signs)
        broken = [one for one in uses if one.is_broken]
        if case.report.valid:
            assert broken == [], (case.vehicle.name, case.report.tightest)
            seen["valid"] += 1
            shares = [one.share for one in uses if one.bound > 0]
            seen["near a limit"] += max(shares, default=0.0) > 0.95
            seen["left"] += bool((simulation.omega > 0.01).any())
            seen["right"] += bool((simulation.omega < -0.01).any())
            seen["forwards"] += bool((simulation.kx > 0.01).any())
            seen["backwards"] += bool((simulation.kx < -0.01).any())
            seen["with stops"] += len(simulation.pieces) > 1
        else:
            proved = [
                v
                for v in case.report.violations
                if v.is_proved and v.limit not in ELSEWHERE
            ]
            assert broken or not proved
            for violation in proved:
                if violation.excess < RESOLVED:
                    continue
                found = {
                    (one.limit, one.wheel)
                    for one in uses_named(simulation, violation)
                    if one.is_broken
                }
                assert (violation.limit, violation.wheel) in found, violation
            seen["violations found"] += len(proved)
    return seen


@pytest.mark.parametrize("name", DIFFERENT_KINDS)
def test_valid_motions_of_a_vehicle_break_no_limit(name: str) -> None:
    seen = assert_simulation_agrees(catalogue_cases(name, 1))
    assert seen["valid"] >= 2
    assert seen["near a limit"] >= 1


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("name", configspace.catalog())
def test_many_valid_motions_of_a_vehicle_break_no_limit(name: str) -> None:
    count = 8
    seen = assert_simulation_agrees(catalogue_cases(name, count, 2))
    # Most motions can be driven: each is then valid at its limit and below it.
    assert seen["valid"] >= count * FORMS
    assert seen["near a limit"] >= count
    assert min(seen["forwards"], seen["backwards"], seen["with stops"]) >= 1
    if not configspace.load_vehicle(name).synchro:
        assert min(seen["left"], seen["right"]) >= 2


def random_cases(seed: int, vehicles: int) -> Iterator[Case]:
    rng = np.random.default_rng(seed)
    for i in range(vehicles):
        vehicle = random_vehicle(rng, ALL_KINDS[i % len(ALL_KINDS)])
        yield from cases_of(with_rates(rng, vehicle), 1, seed + i)


def test_valid_motions_of_random_vehicles_break_no_limit() -> None:
    seen = assert_simulation_agrees(random_cases(1, len(ALL_KINDS)))
    assert seen["valid"] > 3 * len(ALL_KINDS)
    assert seen["near a limit"] > seen["valid"] / 3
    assert min(seen[way] for way in WAYS) > 3


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("seed", [2, 3])
def test_many_valid_motions_of_random_vehicles_break_no_limit(seed: int) -> None:
    vehicles = 20 * len(ALL_KINDS)
    seen = assert_simulation_agrees(random_cases(1000 * seed, vehicles))
    assert seen["valid"] > 3 * vehicles
    assert seen["near a limit"] > seen["valid"] / 3
    assert min(seen[way] for way in WAYS) > vehicles / 4
