"""What a motion costs: against NumPy, derivatives against differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from configspace import PermissibleSpace, build_space, load_vehicle
from omniplan.optimising.limits import rules_of
from omniplan.optimising.prices import (
    ALONG,
    CALM,
    CHANGE,
    CHANGE_TIME,
    PRICE,
    SMOOTH,
)
from omniplan.optimising.problem import build_problem
from omniplan.optimising.setting import Guess, Leg, Objective, Setting
from omniplan.optimising.unknowns import BEGIN, STATE
from omniplan.optimising.warm_start import leg_through

N = 6


@pytest.fixture(scope="module")
def steered() -> PermissibleSpace:
    return build_space(load_vehicle("ift-four-steered"), cache=False)


def wandering(seed: int, start: float = 0.0) -> Leg:
    rng = np.random.default_rng(seed)
    s = np.linspace(0, 1, N + 1)[:, None]
    way = (3 * s**2 - 2 * s**3) * rng.uniform(0.5, 1.5, 3)
    bend = s * (1 - s) * rng.uniform(-0.5, 0.5, 3)
    return leg_through(np.full(N, rng.uniform(0.3, 0.6)), start + way + bend)


def guess_of(*seeds: int) -> Guess:
    legs = tuple(wandering(seed, start=float(seed)) for seed in seeds)
    return Guess(legs, (0.4,) * (len(legs) - 1))


def cost_of(guess: Guess, meant: Guess, objective: Objective, kappa_g: float) -> float:
    """The objective as it is told, by NumPy and SciPy's splines."""
    arm = np.array([1.0, 1.0, 1 / kappa_g])
    n = N * len(guess.legs)
    usual = meant.duration
    splines = [
        CubicSpline(np.append(0.0, np.cumsum(leg.h)), leg.poses, bc_type="clamped")
        for leg in guess.legs
    ]
    if objective == "time":
        given = PRICE * BEGIN * sum(leg.h.sum() for leg in guess.legs)
        calm = 0.0
        for leg, spline in zip(guess.legs, splines, strict=True):
            t = np.linspace(0, leg.duration, 20001)
            square = ((spline(t, 2) * arm) ** 2).sum(axis=1)
            calm += float(np.trapezoid(square, t))
        return float(guess.duration + CALM * calm + given)
    given = PRICE * BEGIN * n * usual / n
    if objective == "smooth":
        jerk = sum(
            float((((spline.c[0] * 6 * arm) ** 2).sum(axis=1)) @ leg.h)
            for leg, spline in zip(guess.legs, splines, strict=True)
        )
        length = sum(
            np.linalg.norm(np.diff(leg.poses, axis=0) * arm, axis=1).sum()
            for leg in meant.legs
        )
        return float(SMOOTH * usual**5 / length**2 * jerk + given)
    change = 0.0
    for leg, other in zip(guess.legs, meant.legs, strict=True):
        for pose, aim, rate in zip(leg.poses, other.poses, other.rates, strict=True):
            off, size = (pose - aim) * arm, np.linalg.norm(rate * arm)
            slid = 0.0 if size == 0 else float(off @ (rate * arm) / size)
            square = float(off @ off) - (1 - ALONG) * slid**2
            change += square / (N + 1) * kappa_g**2
    return float(CHANGE * change + CHANGE_TIME * guess.duration / usual + given)


@pytest.mark.parametrize("objective", ["time", "smooth", "change"])
def test_objectives_are_as_told_and_their_derivatives_are_exact(
    steered: PermissibleSpace, objective: Objective
) -> None:
    guess, meant = guess_of(1, 2), guess_of(3, 4)
    assert steered.vehicle is not None
    kappa_g = rules_of(steered.vehicle).kappa_g
    setting = Setting((N, N), (1, 1), objective)
    problem = build_problem(steered, setting, None if objective == "time" else meant)
    value, _ = problem.values(guess)
    expected = cost_of(guess, meant, objective, kappa_g)
    assert value == pytest.approx(expected, rel=1e-6)
    gradient, _ = problem.derivatives(guess)
    size = np.abs(gradient).max()
    checked = 0
    for leg in (0, 1):
        for name, first in (("poses", 0), ("rates", 3)):
            for row in range(N + 1):
                for column in range(3):
                    ends = []
                    for by in (-1e-5, 1e-5):
                        table = getattr(guess.legs[leg], name).copy()
                        table[row, column] += by
                        legs = list(guess.legs)
                        legs[leg] = replace(guess.legs[leg], **{name: table})
                        moved = replace(guess, legs=tuple(legs))
                        ends.append(problem.values(moved)[0])
                    at = STATE * ((N + 1) * leg + row) + first + column
                    slope = (ends[1] - ends[0]) / 2e-5
                    assert slope == pytest.approx(gradient[at], abs=2e-6 * size)
                    checked += abs(gradient[at]) > 1e-6 * size
    assert checked > 20
