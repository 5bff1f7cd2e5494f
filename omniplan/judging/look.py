"""Parts of a motion as a judge looks at them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from omniplan.judging.chords import Chord, ends_moving, speed_of
from omniplan.judging.rows import Bounds
from omniplan.motion import Enclosure

__all__ = ["Look"]

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Look:
    """m parts, and what more than one limit asks of them."""

    part: Enclosure
    body: Chord
    """Velocity of K."""
    owns: tuple[FloatArray, ...]
    """(m,) sign of v_s in every representation asked for."""
    kappa_g: float
    """1/m"""
    floor: float
    """At this |v_s| or below the vehicle stands, m/s; negative: it never does."""

    @cached_property
    def speed(self) -> Bounds:
        """Bounds on |v_s| without the factor on the twist."""
        return speed_of(self.part, self.body, self.kappa_g)

    @cached_property
    def moving(self) -> tuple[FloatArray, FloatArray]:
        """|v_s| at both ends without its factor; 0 where the vehicle stands."""
        return ends_moving(self.part, self.body, self.kappa_g, self.floor)
