"""What a judge says: one row per limit, a utilisation enclosed from both sides.

`low` is taken at an end of a part, so ``low > 1`` proves a violation; `high` bounds the
whole part, so ``high ≤ 1`` proves that the limit is kept all along it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from omniplan.motion import Enclosure

__all__ = ["Bounds", "Judge", "Row", "Tolerances", "WindingWheel"]

FloatArray = npt.NDArray[np.float64]
Bounds: TypeAlias = tuple[FloatArray, FloatArray]
Scaling: TypeAlias = Literal["none", "speed", "acceleration"]


@dataclass(frozen=True)
class Tolerances:
    """What counts as standing still and as rolling without slip.

    They absorb the rounding and the interpolation of sampled poses; a report is about
    the motion within them.
    """

    standstill: float = 1e-3
    """Below this |v_s| the vehicle stands and its configuration is not judged, m/s."""
    slip_angle: float = math.radians(1.0)
    """Sideways slip of a fixed wheel relative to the vehicle's speed, rad."""
    slip_speed: float = 5e-3
    """Sideways slip of a fixed wheel that is allowed at any speed, m/s."""
    alignment: float = math.radians(1.0)
    """Steering angles before and after a standstill that count as equal, rad."""


@dataclass(frozen=True)
class Row:
    """One limit of one wheel or of the vehicle."""

    limit: str
    wheel: int
    """Index of the wheel, -1 for the vehicle."""
    bound: float
    unit: str
    scaling: Scaling
    """How the value grows when the motion is driven faster."""
    is_free_at_rest: bool = False
    """Whether it is about the configuration, which is free while the vehicle stands."""


@dataclass(frozen=True)
class WindingWheel:
    """A steered wheel with a finite range of more than a full turn.

    Its row is filled in by `omniplan.standing.winding`, as no part of a motion alone
    can tell how often the wheel has turned before.
    """

    index: int
    column: int
    """Of its steering range among the rows."""
    contact: complex
    """Position in the file's frame, m."""
    least: float
    """rad"""
    largest: float
    """rad"""
    rate: float
    """Largest steering rate at rest, rad/s; infinite where nothing bounds it."""
    acceleration: float = math.inf
    """Largest steering acceleration, rad/s²; likewise."""

    @property
    def middle(self) -> float:
        """Middle of the range, rad."""
        return (self.least + self.largest) / 2

    @property
    def half(self) -> float:
        """Half the range, rad, above π."""
        return (self.largest - self.least) / 2


class Judge(Protocol):
    """Judges parts of motions for one vehicle or one data sheet."""

    rows: tuple[Row, ...]
    kappa_g: float
    reference: complex
    wheel_ids: tuple[str, ...]
    needs_configuration: bool
    """Whether it matters which of the two representations is driven."""
    winding_wheels: tuple[WindingWheel, ...]

    def utilisation(self, part: Enclosure, sign: int) -> Bounds:
        """Return low and high utilisation, (m, rows), of representation `sign`."""
        ...

    def utilisations(self, part: Enclosure, signs: Sequence[int]) -> dict[int, Bounds]:
        """Return low and high utilisation, (m, rows), of every representation."""
        ...
