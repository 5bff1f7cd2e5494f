"""Motions through body twists: linear between the samples."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from omniplan.motion.crossings import with_zero_crossings
from omniplan.motion.enclosure import Enclosure, Intervals

__all__ = ["TwistMotion"]

FloatArray = npt.NDArray[np.float64]


class TwistMotion:
    """Body twists, linear in time between the samples.

    Attributes `t` (n,), `v` (n,) and `omega` (n,) tell all of it.
    """

    is_own = False
    has_rates = True
    interpolation = "body twist linear between the samples"

    def __init__(self, t: FloatArray, samples: FloatArray, point: complex) -> None:
        t, samples = with_zero_crossings(t, samples)
        self.t = t
        self.omega = samples[:, 2]
        self.v = samples[:, 0] + 1j * samples[:, 1] - 1j * self.omega * point

    def intervals(self) -> Intervals:
        """Return the intervals between the samples."""
        return Intervals(np.arange(len(self.t) - 1), self.t[:-1], self.t[1:])

    def enclose(self, parts: Intervals) -> Enclosure:
        """Return an enclosure of every part; it has no excess."""
        k = parts.knot
        span = self.t[k + 1] - self.t[k]
        v_dot = (self.v[k + 1] - self.v[k]) / span
        omega_dot = (self.omega[k + 1] - self.omega[k]) / span
        f0, f1 = ((t - self.t[k]) / span for t in (parts.t0, parts.t1))
        v0, v1 = ((1 - f) * self.v[k] + f * self.v[k + 1] for f in (f0, f1))
        o0, o1 = ((1 - f) * self.omega[k] + f * self.omega[k + 1] for f in (f0, f1))
        zero, one = np.zeros_like(span), np.ones_like(span)
        return Enclosure(
            parts.t1 - parts.t0,
            v0,
            v1,
            o0,
            o1,
            v_dot,
            v_dot,
            omega_dot,
            omega_dot,
            *(zero, zero, zero, zero),
            one,
            one,
            one,
            one,
        )
