"""What a collision check tells of a hit."""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["Hit"]

Pose = tuple[float, float, float]


@dataclass(frozen=True)
class Hit:
    """Where a vehicle hits something, or comes nearer than the clearance."""

    obstacle: str
    """Name; ``bounds`` for the border of the area."""
    index: int
    """Of the obstacle; -1 for the bounds."""
    pose: Pose
    """(x, y, θ) of the vehicle, m, m, rad."""
    place: tuple[float, float]
    """The place of the obstacle that is hit or nearest, m."""
    distance: float
    """Distance left, m; 0 for a hit."""
    clearance: float
    """The distance asked for, m."""
    u: float = 0.0
    """Share of the motion that is free before, 0 to 1."""
    t: float | None = None
    """Time on a trajectory, s."""

    @property
    def message(self) -> str:
        """What is hit and where, in one line."""
        x, y, theta = self.pose
        at = f"at ({x:.3f} m, {y:.3f} m, {math.degrees(theta):.1f}°)"
        when = "" if self.t is None else f" at t = {self.t:.3f} s"
        where = f"{self.obstacle} near ({self.place[0]:.3f} m, {self.place[1]:.3f} m)"
        if self.distance == 0.0:
            return f"hits {where}: the vehicle stands {at}{when}"
        return (
            f"comes as near as {self.distance:.4f} m to {where}, "
            f"clearance {self.clearance:g} m: the vehicle stands {at}{when}"
        )
