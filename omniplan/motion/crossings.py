"""Samples inserted where the motion between two of them has a kink."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from omniplan.samples import HEADING_LENGTH

__all__ = ["with_crossings", "with_zero_crossings"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


def with_crossings(
    t: FloatArray, samples: FloatArray, column: int, level: float
) -> tuple[FloatArray, FloatArray]:
    """Insert samples where a column crosses a level, exactly at the level."""
    values = samples[:, column] - level
    at = np.flatnonzero(values[:-1] * values[1:] < 0)
    if not at.size:
        return t, samples
    f = values[at] / (values[at] - values[at + 1])
    new = samples[at] + f[:, None] * (samples[at + 1] - samples[at])
    new[:, column] = level
    return _inserted(t, samples, at, t[at] + f * (t[at + 1] - t[at]), new)


def with_zero_crossings(
    t: FloatArray, samples: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Insert standstills where a twist turns into its opposite."""
    scaled = samples * [1.0, 1.0, HEADING_LENGTH]
    size = np.linalg.norm(scaled, axis=1)
    dot = np.einsum("ij,ij->i", scaled[:-1], scaled[1:])
    both = size[:-1] * size[1:]
    at = np.flatnonzero((both > 0) & (dot < -(1 - 1e-12) * both))
    f = size[at] / (size[at] + size[at + 1])
    when = t[at] + f * (t[at + 1] - t[at])
    return _inserted(t, samples, at, when, np.zeros((at.size, 3)))


def _inserted(
    t: FloatArray,
    samples: FloatArray,
    at: IntArray,
    when: FloatArray,
    new: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Insert rows after rows `at`, unless rounding puts them on an existing time."""
    inside = (when > t[at]) & (when < t[at + 1])
    at, when, new = at[inside], when[inside], new[inside]
    return np.insert(t, at + 1, when), np.insert(samples, at + 1, new, axis=0)
