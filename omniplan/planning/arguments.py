"""Arguments of planning: taken as they are meant, or refused with what is allowed."""

from __future__ import annotations

import math
import operator
from typing import cast

import numpy as np
import numpy.typing as npt

from configspace import InvalidInput, Problem
from configspace.omni_curve import nominal_curvature
from omniplan.planning.permits import Configuration
from omniplan.planning.task import Pose
from omniplan.samples import MAX_VALUE

__all__ = ["end", "one_of", "positive", "whole"]


def end(name: str, value: npt.ArrayLike) -> tuple[Pose, Configuration | None]:
    """Return pose and configuration of the start or the goal.

    Parameters
    ----------
    name : str
    value : (3,) or (5,) float, m, m, rad, 1, rad
    """
    allowed = "(x, y, θ) or (x, y, θ, κ_n, β): finite numbers, m, m, rad, 1, rad"
    try:
        given = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidInput(Problem(name, repr(value)[:60], allowed)) from error
    if given.shape not in ((3,), (5,)) or not np.isfinite(given).all():
        raise InvalidInput(Problem(name, repr(value)[:60], allowed))
    if np.abs(given).max() > MAX_VALUE:
        allowed = f"numbers of at most {MAX_VALUE:g}"
        raise InvalidInput(Problem(name, repr(value)[:60], allowed))
    x, y, theta, *rest = given.tolist()
    if not rest:
        return (x, y, theta), None
    try:
        nominal_curvature(rest[0])
    except InvalidInput as error:
        raise InvalidInput(error.problems, name) from error
    return (x, y, theta), (rest[0], math.remainder(rest[1], 2 * math.pi))


def one_of(name: str, value: object, allowed: tuple[str, ...]) -> str:
    """Return one of several names."""
    if not isinstance(value, str) or value not in allowed:
        choice = f"one of {', '.join(allowed)}"
        raise InvalidInput(Problem(name, repr(value)[:60], choice))
    return value


def positive(name: str, value: object, unit: str) -> float:
    """Return a positive number."""
    is_number = isinstance(value, int | float | np.number) and value is not True
    if not is_number or not 0 < cast(float, value) < math.inf:
        allowed = f"a positive, finite number of {unit}"
        raise InvalidInput(Problem(name, repr(value)[:60], allowed))
    return float(cast(float, value))


def whole(name: str, value: object, least: int, largest: int | None) -> int:
    """Return a whole number in a range; with no largest one if that is None."""
    allowed = f"a whole number, at least {least}"
    if largest is not None:
        allowed += f", at most {largest}"
    try:
        number = operator.index(cast(int, value))
    except TypeError as error:
        raise InvalidInput(Problem(name, repr(value)[:60], allowed)) from error
    if isinstance(value, bool) or number < least or number > (largest or number):
        raise InvalidInput(Problem(name, repr(value)[:60], allowed))
    return number
