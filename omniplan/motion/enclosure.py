"""Parts of a motion, and what encloses the twist over them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from omniplan.judging.swing import Swing

__all__ = ["Enclosure", "Intervals", "Motion"]

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Intervals:
    """Parts of a motion, in order of time."""

    knot: IntArray
    """(m,) the interval each part belongs to."""
    t0: FloatArray
    """(m,) s."""
    t1: FloatArray
    """(m,) s."""

    def joined(self, others: Intervals) -> Intervals:
        """Return these intervals and then others."""
        return Intervals(
            np.concatenate([self.knot, others.knot]),
            np.concatenate([self.t0, others.t0]),
            np.concatenate([self.t1, others.t1]),
        )

    def halved(self, mask: npt.NDArray[np.bool_]) -> Intervals:
        """Return the intervals with those of `mask` cut in two."""
        half = (self.t0[mask] + self.t1[mask]) / 2
        origin = np.repeat(np.arange(mask.size), np.where(mask, 2, 1))
        at = np.flatnonzero(mask) + np.arange(half.size)
        t0, t1 = self.t0[origin], self.t1[origin]
        t1[at], t0[at + 1] = half, half
        return Intervals(self.knot[origin], t0, t1)


@dataclass(frozen=True)
class Enclosure:
    """The twist over m parts; 0 and 1 are their ends."""

    dt: FloatArray
    v0: ComplexArray
    v1: ComplexArray
    omega0: FloatArray
    omega1: FloatArray
    v_dot0: ComplexArray
    v_dot1: ComplexArray
    omega_dot0: FloatArray
    omega_dot1: FloatArray
    v_ddot: FloatArray
    """Bound on |v̈|, per s²."""
    omega_ddot: FloatArray
    """Bound on |ω̈|, per s²."""
    v_dddot: FloatArray
    """Bound on |v⃛|, per s³."""
    omega_dddot: FloatArray
    """Bound on |ω⃛|, per s³."""
    scale0: FloatArray
    scale1: FloatArray
    scale_high: FloatArray
    """Bound on the factor on the twist over the part, ≥ 0."""
    sign: FloatArray
    """Sign of v_s of the configuration that is meant (omni_curve), else 1."""
    swing: Swing | None = None
    """How directions swing; None where the twist may bend without bound."""

    def rows(self, rows: slice | IntArray) -> Enclosure:
        """Return some of the parts."""
        swing = None if self.swing is None else self.swing.rows(rows)
        fields = {
            name: values[rows] for name, values in vars(self).items() if name != "swing"
        }
        return Enclosure(**fields, swing=swing)

    def merged(self, others: Enclosure, order: IntArray) -> Enclosure:
        """Return parts of both: these and then the others, in a new order.

        Parameters
        ----------
        others : Enclosure
            Of the same motion.
        order : (n,) int
            Indices into all of them.
        """
        swing = self.swing
        if swing is not None and others.swing is not None:
            swing = swing.merged(others.swing, order)
        fields = {
            name: np.concatenate([values, getattr(others, name)])[order]
            for name, values in vars(self).items()
            if name != "swing"
        }
        return Enclosure(**fields, swing=swing)


class Motion(Protocol):
    """What `judge` needs to know of a motion."""

    is_own: bool
    """The samples are this vehicle's own (κ_n, β, v_n): the configuration is given and
    the factor on the twist is |v_n|, a share of v_max."""
    has_rates: bool
    """Whether accelerations are known."""
    interpolation: str

    def intervals(self) -> Intervals:
        """Return the intervals between the knots."""
        ...

    def enclose(self, parts: Intervals) -> Enclosure:
        """Return an enclosure of every part."""
        ...
