"""Passing a path more slowly just where its samples break limits, and no longer there.

The samples of a profile are judged part by part. What a part asks for, as a factor on
its time, tightens the limits of the profile around it; where limits were tightened and
are now kept with room to spare, they are loosened again.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from omniplan.judging.proof import ROUNDING
from omniplan.proving import Proved

__all__ = ["slowdowns_of", "tightened"]

FloatArray = npt.NDArray[np.float64]
SignArray = npt.NDArray[np.int64]

SPARE = 1e-3
"""By this share more than was asked for a place is passed more slowly ..."""
MORE = 1.3
"""... and by this much more than is missing, as samples move, ..."""
MOST = 1.25
"""... but at most so many times more slowly at once ..."""
LEAST = 0.9
"""... and at most so much faster."""
UNDECIDED = 1.01
"""What is neither kept nor shown to be broken counts as used so much at most."""


def slowdowns_of(proved: Proved, sign: SignArray) -> FloatArray:
    """Return how many times more slowly every part had to be passed, (m,).

    At most 1 where all limits are kept that driving slower mends; where one is neither
    kept nor shown to be broken a little more than 1.

    Parameters
    ----------
    proved : Proved
    sign : (m,) int, {-1, 1}
        The representation that was timed, of every part. Where limits are broken the
        proof may have chosen the other.
    """
    rows = proved.judge.rows
    low, high = proved.parts.picked(sign)
    mends = np.array([row.scaling != "none" for row in rows], dtype=bool)
    power = np.array([0.5 if row.scaling == "acceleration" else 1.0 for row in rows])
    low, high = low[:, mends], high[:, mends]
    is_kept, is_broken = high <= 1 + ROUNDING, low > 1 + ROUNDING
    # Where one limit is surely broken the others were not pursued to the end.
    is_open = ~is_kept & ~is_broken.any(axis=1, keepdims=True)
    used = np.where(is_kept, high, low)
    used = np.where(is_open, np.clip(high, 1.0, UNDECIDED), used) ** power[mends]
    return np.asarray(used.max(axis=1, initial=0.0))


def tightened(
    weight: FloatArray,
    times: FloatArray,
    spans: tuple[FloatArray, FloatArray],
    slowdowns: FloatArray,
    pad: FloatArray,
    *,
    loosens: bool,
) -> FloatArray:
    """Return by how much the limits are to be tightened at every node of a profile.

    Parameters
    ----------
    weight : (n,) float, ≥ 1
        By how much they were.
    times : (n,) float, s
        When the nodes were passed.
    spans : two (m,) float, s
        Start and end of the parts, one after the other.
    slowdowns : (m,) float
        What the parts ask for.
    pad : (n,) float, s
        Parts so near to a node count.
    loosens : bool
        Whether limits are loosened that are kept with room to spare.
    """
    first = np.searchsorted(spans[1], times - pad)
    last = np.searchsorted(spans[0], times + pad, side="right")
    first = np.minimum(first, slowdowns.size - 1)
    ends = np.stack([first, np.maximum(last, first + 1)], axis=1).ravel()
    padded = np.append(slowdowns, 0.0)  # an end may be just after the last part
    asked = np.maximum.reduceat(padded, ends)[::2] * (1 + SPARE)
    asked = np.where(asked > 1, 1 + (asked - 1) * MORE, asked)
    relaxed = np.maximum(np.sqrt(np.minimum(asked, 1.0)), LEAST)
    relaxed = relaxed if loosens else np.ones_like(asked)
    # What is just kept stays as it is.
    change = np.where(asked > 1 + SPARE * MORE, np.minimum(asked, MOST), relaxed)
    return np.asarray(np.maximum(weight * change, 1.0))


def any_is_tight(weights: Sequence[FloatArray]) -> bool:
    """Return whether any limit was tightened anywhere."""
    return any(bool((weight > 1).any()) for weight in weights)
