"""The one module that imports OMPL, and what it wants told for the whole process.

What of OMPL 2.0.1's Python bindings `omniplan.sampling` relies on is kept by
``tests/unit/omniplan/test_ompl_bindings.py``: C++ calls `isValid`, `clearance` and
`checkMotion` with two states of Python classes. It never asks Python for the last valid
state of a motion (`checkMotion` with three arguments is answered by the one with two,
and "nothing of it" stays as the share): see `MotionValidator.last_valid`.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ompl import base, control, geometric, util

from configspace.errors import InvalidInput, Problem
from configspace.omni_curve import finite

__all__ = ["base", "bounds_of", "control", "geometric", "quiet", "seeded", "util"]


def bounds_of(bounds: tuple[float, float, float, float]) -> Any:
    """Return bounds for the position.

    Parameters
    ----------
    bounds : (x_min, y_min, x_max, y_max), m

    Returns
    -------
    bounds : ompl.base.RealVectorBounds

    Raises
    ------
    InvalidInput
        Unless the numbers are finite and least ones are less than largest ones.
    """
    numbers = finite("bounds", bounds, "m")
    if numbers.shape != (4,) or not (numbers[:2] < numbers[2:]).all():
        allowed = "(x_min, y_min, x_max, y_max) in m, least below largest"
        raise InvalidInput(Problem("bounds", f"{bounds}", allowed))
    x_min, y_min, x_max, y_max = numbers.tolist()
    out = base.RealVectorBounds(2)
    for axis, low, high in ((0, x_min, x_max), (1, y_min, y_max)):
        out.setLow(axis, low)
        out.setHigh(axis, high)
    return out


@contextmanager
def quiet() -> Iterator[None]:
    """Keep OMPL from printing; its log level holds for the whole process."""
    before = util.getLogLevel()
    util.setLogLevel(util.LogLevel.LOG_NONE)
    try:
        yield
    finally:
        util.setLogLevel(before)


def seeded(seed: int) -> None:
    """Make OMPL's random numbers repeatable from here on, for the whole process.

    Parameters
    ----------
    seed : int, 1 to 2**32 - 1
        What is made afterwards - samplers, planners - is repeatable, although OMPL says
        otherwise after the first time; that line is kept from being printed.

    Raises
    ------
    InvalidInput
        If the seed is out of range; 0 would mean the time of day to OMPL.
    """
    if not 1 <= seed < 2**32:
        raise InvalidInput(Problem("seed", f"{seed}", "1 to 4294967295"))
    with quiet():
        util.RNG.setSeed(int(seed))
