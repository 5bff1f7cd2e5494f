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
    # An angle that is in range already is returned to the last bit.
    is_within = (angle > -np.pi) & (angle <= np.pi)
    if is_within.all():
        return angle.copy()
    # Sine and cosine reduce by the true π, also where an angle counts many turns.
    wrapped = np.arctan2(np.sin(angle), np.cos(angle))
    wrapped = np.where(wrapped <= -np.pi, np.pi, wrapped)
    return np.where(is_within, angle, wrapped)
