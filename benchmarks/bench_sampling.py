"""Validity callbacks through OMPL against Python callbacks that return True.

Run it as a program for the ratios: the cases take turns, so that other work on the
machine meets all of them, and the least time of many short rounds counts.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from rich.console import Console
from rich.table import Table

import configspace
from omniplan import sampling
from omniplan.obstacles import CollisionChecker, Obstacles
from omniplan.sampling.ompl_bindings import base

VEHICLES = ("ift-four-steered", "mecanum", "heavy-load-24")
CALLS, ROUNDS = 2000, 120


class Yes(base.StateValidityChecker):  # type: ignore[misc]
    """Every state is valid."""

    def isValid(self, state: Any) -> bool:
        """Return True."""
        return True


class Always(base.MotionValidator):  # type: ignore[misc]
    """Every motion is valid."""

    def checkMotion(self, first: Any, second: Any) -> bool:
        """Return True."""
        return True


def information() -> tuple[Any, Any, Any]:
    """Return a space information and two states 3.2 m and 57° apart."""
    state_space = base.SE2StateSpace()
    state_space.setBounds(sampling.bounds_of((0, 0, 10, 10)))
    first, second = state_space.allocState(), state_space.allocState()
    first.setXY(1.0, 2.0)
    first.setYaw(0.3)
    second.setXY(4.0, 1.0)
    second.setYaw(1.3)
    return base.SpaceInformation(state_space), first, second


def cases() -> dict[str, Callable[[], bool]]:
    """Return calls of OMPL, by name."""
    out: dict[str, Callable[[], bool]] = {}

    def add(name: str, si: Any, first: Any, second: Any) -> None:
        out[f"isValid, {name}"] = partial(si.isValid, first)
        out[f"checkMotion, {name}"] = partial(si.checkMotion, first, second)

    si, first, second = information()
    si.setStateValidityChecker(Yes(si))
    si.setMotionValidator(Always(si))
    add("True", si, first, second)
    si, first, second = information()
    si.setStateValidityChecker(Yes(si))
    si.setup()
    out["checkMotion, OMPL's own over True"] = partial(si.checkMotion, first, second)
    for name in VEHICLES:
        space = configspace.build_space(configspace.load_vehicle(name))
        si, first, second = information()
        sampling.equip(si, space)
        add(name, si, first, second)
    space = configspace.build_space(configspace.load_vehicle("mecanum"))
    pillar = Obstacles.from_polygons([[(2, 4), (3, 4), (3, 5), (2, 5)]])
    si, first, second = information()
    sampling.equip(si, space, CollisionChecker(space, pillar))
    add("mecanum, one obstacle", si, first, second)
    return out


@pytest.fixture(scope="module")
def calls() -> dict[str, Callable[[], bool]]:
    return cases()


@pytest.mark.parametrize("name", ["True", *VEHICLES, "mecanum, one obstacle"])
@pytest.mark.parametrize("kind", ["isValid", "checkMotion"])
def test_callback(
    benchmark: BenchmarkFixture,
    calls: dict[str, Callable[[], bool]],
    kind: str,
    name: str,
) -> None:
    """One call of OMPL."""
    benchmark(calls[f"{kind}, {name}"])


def least(calls: dict[str, Callable[[], bool]]) -> dict[str, float]:
    """Return the least time per call, s, of cases that take turns."""
    found = dict.fromkeys(calls, float("inf"))
    for _ in range(ROUNDS):
        for name, call in calls.items():
            start = time.perf_counter()
            for _ in range(CALLS):
                call()
            found[name] = min(found[name], (time.perf_counter() - start) / CALLS)
    return found


def main() -> None:
    """Print all cases with their ratio to the callback that returns True."""
    calls = cases()
    for call in calls.values():
        call()
    found = least(calls)
    table = Table("through OMPL", "ns", "times a callback that returns True")
    for name, seconds in found.items():
        reference = found[f"{name.split(',')[0]}, True"]
        table.add_row(name, f"{seconds * 1e9:.0f}", f"{seconds / reference:.2f}")
    Console().print(table)


if __name__ == "__main__":
    main()
