"""Checks that every list of samples passes, and the words for what fails them."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from configspace import Problem
from configspace.angles import wrap
from omniplan.errors import InvalidTrajectory

__all__ = [
    "HEADING_LENGTH",
    "MAX_VALUE",
    "checked_name",
    "checked_point",
    "invalid_row",
    "joined_headings",
    "locked",
    "numbers",
    "reject_outside",
    "unwrapped",
    "whole_number",
]

FloatArray = npt.NDArray[np.float64]
Scalar = TypeVar("Scalar", bound=np.generic)

MAX_VALUE = 1e6
"""Largest size of any value but a time: m, m/s, rad or rad/s."""
MAX_HEADING_STEP = math.pi / 2 + 1e-9
"""A larger turn from sample to sample is ambiguous, rad."""
HEADING_LENGTH = 0.5
"""Metres that one radian of heading counts in the length of a path."""


def checked_name(name: object) -> str:
    """Return a name that files can hold, or raise."""
    if (
        isinstance(name, str)
        and 0 < len(name) <= 200
        and not name.startswith("#")
        and name.isprintable()
    ):
        return name
    allowed = "a text of 1 to 200 characters, printable, that does not start with #"
    raise InvalidTrajectory(Problem("name", repr(name)[:60], allowed))


def checked_point(name: str, value: Any) -> tuple[float, float]:
    """Return a reference point, or raise."""
    if isinstance(value, list | tuple) and len(value) == 2:
        x, y = numbers(name, ("reference_point",), value)
        if abs(x) <= 100 and abs(y) <= 100:
            return float(x), float(y)
    allowed = "two finite numbers, in m"
    raise InvalidTrajectory(
        Problem(f"{name}: reference_point", repr(value)[:60], allowed)
    )


def numbers(name: str, labels: Sequence[str], values: npt.ArrayLike) -> FloatArray:
    """Return a new float array, or raise unless all values are numbers.

    `labels` name the columns of a table, or the one of a list.
    """
    try:
        array = np.array(values)
    except (TypeError, ValueError) as error:
        raise InvalidTrajectory(
            Problem(name, "rows of different lengths", f"{', '.join(labels)} in each")
        ) from error
    if array.size and array.dtype.kind not in "fiu":
        raise InvalidTrajectory(_not_a_number(name, labels, array))
    return array.astype(np.float64)


def _not_a_number(
    name: str, labels: Sequence[str], array: npt.NDArray[np.generic]
) -> Problem:
    """Return where the first value stands that is not a number."""
    for place, value in np.ndenumerate(array):
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or abs(value) > sys.float_info.max:
            known = len(place) > 1 and place[1] < len(labels)
            label = labels[place[1]] if known else ", ".join(labels)
            where = f"{name}: row {place[0]}, {label}" if place else f"{name}: {label}"
            return Problem(where, repr(value)[:60], "must be a number")
    return Problem(name, "values that are not numbers", "numbers only")


def whole_number(name: str, label: str, value: object) -> int:
    """Return a whole number, or raise."""
    if isinstance(value, int | np.integer) and not isinstance(value, bool):
        return int(value)
    raise InvalidTrajectory(
        Problem(f"{name}: {label}", repr(value)[:60], "a whole number")
    )


def reject_outside(name: str, column: FloatArray, label: str, limit: float) -> None:
    """Raise with the row of the first value that is not finite or too large."""
    bad = np.flatnonzero(~(np.abs(column) <= limit))
    if bad.size:
        row = int(bad[0])
        allowed = f"must be finite, at most {limit:g} in size"
        raise invalid_row(name, row, label, f"{column[row]}", allowed)


def joined_headings(name: str, headings: FloatArray) -> FloatArray:
    """Return headings joined the shorter way round, or raise where that is not clear.

    Parameters
    ----------
    name : str
        Of the trajectory or path.
    headings : (n,) float, rad
        Wrapped or not.

    Raises
    ------
    InvalidTrajectory
        With the row of the first turn of more than 90°, or of a step that no way of
        counting angles explains: such headings are degrees.
    """
    step = np.diff(headings)
    far = np.flatnonzero(np.abs(step) > 2 * math.pi + MAX_HEADING_STEP)
    if far.size:
        row = int(far[0])
        given = f"{headings[row + 1]:g} after {headings[row]:g}"
        allowed = "radians, at most a turn and a quarter apart"
        raise invalid_row(name, row + 1, "theta", given, allowed)
    turn = wrap(step)
    jump = np.flatnonzero(np.abs(turn) > MAX_HEADING_STEP)
    if jump.size:
        row = int(jump[0])
        given = f"the heading turns by {math.degrees(turn[row]):.1f}° from row {row}"
        allowed = "at most 90° per row, or the way round is not clear"
        raise invalid_row(name, row + 1, "theta", given, allowed)
    return unwrapped(headings)


def unwrapped(angles: FloatArray) -> FloatArray:
    """Return angles joined the shorter way round, from the first one on."""
    step = np.diff(angles)
    # Whole turns are added, so that angles that need none keep all their digits.
    turns = np.cumsum(np.rint((wrap(step) - step) / (2 * math.pi)))
    return np.concatenate([angles[:1], angles[1:] + 2 * math.pi * turns])


def invalid_row(
    name: str, row: int, column: str, given: str, allowed: str
) -> InvalidTrajectory:
    """Return the error of one value."""
    return InvalidTrajectory(Problem(f"{name}: row {row}, {column}", given, allowed))


def locked(values: npt.NDArray[Scalar]) -> npt.NDArray[Scalar]:
    """Return the array, made read-only."""
    values.flags.writeable = False
    return values
