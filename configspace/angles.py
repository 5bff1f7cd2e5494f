"""Angles in radians."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = ["wrap"]


def wrap(angle: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return the equivalent angle in (-π, π].

    Parameters
    ----------
    angle : (...,) float, rad

    Examples
    --------
    >>> wrap([0.0, -np.pi, 3 * np.pi / 2]) / np.pi
    array([ 0. ,  1. , -0.5])
    """
    angle = np.asarray(angle, dtype=np.float64)
    # Sine and cosine reduce by the true π, also where an angle counts many turns.
    wrapped = np.arctan2(np.sin(angle), np.cos(angle))
    wrapped = np.where(wrapped <= -np.pi, np.pi, wrapped)
    # An angle that is in range already is returned to the last bit.
    return np.where((angle > -np.pi) & (angle <= np.pi), angle, wrapped)
