"""Why a path cannot be driven, as plain frozen values and in words."""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["Fault", "Undrivable"]


@dataclass(frozen=True)
class Fault:
    """Why a path cannot be driven or timed, and where."""

    limit: str
    """As in `omniplan.Violation`; also ``PATH_SPEED`` and ``PATH_YAW_RATE``."""
    wheel: str | None
    """Id of the wheel; None for the vehicle as a whole."""
    u: float
    """How far along the path, m (see `Path.parameter`)."""
    pose: tuple[float, float, float]
    """m, m, rad"""
    text: str
    """What is wrong, in words and numbers."""

    def __str__(self) -> str:
        """Return one line with wheel, limit, numbers and place."""
        who = f"wheel {self.wheel}: " if self.wheel else ""
        x, y, theta = self.pose
        return (
            f"{who}{self.text}, at x = {x:z.2f} m, y = {y:z.2f} m, "
            f"θ = {math.degrees(theta):z.0f}°, {self.u:.2f} m along the path "
            f"[{self.limit}]"
        )


@dataclass(frozen=True)
class Undrivable:
    """A vehicle for which a path has no timing, and why."""

    vehicle: str
    status: str
    """As of `omniplan.TimingStatus`, or ``vehicle not known``: only its data sheet is,
    which does not tell all limits that timing needs."""
    fault: Fault | None
    """What is in the way and where; None if the vehicle is not known."""

    def __str__(self) -> str:
        """Return one line: status, wheel, limit, numbers and place."""
        if self.fault is None:
            return f"{self.status}: a data sheet alone does not tell all its limits"
        return f"{self.status}: {self.fault}"
