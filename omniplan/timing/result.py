"""What timing a path answers; "no" is a value."""

from __future__ import annotations

import enum
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from omniplan.choosing.faults import Fault, Undrivable
from omniplan.errors import NotDrivable
from omniplan.trajectory import Trajectory

__all__ = ["SpeedProfile", "Timing", "TimingStatus"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


class TimingStatus(enum.Enum):
    """How timing a path ended."""

    FOUND = "found"
    """There is a trajectory, and `validate` has proved it."""
    BLOCKED = "blocked"
    """The vehicle cannot drive the path, however slowly."""
    NO_WAY = "no way"
    """At a stop the wheels find no way to their new angles inside the space."""
    STUCK = "stuck"
    """Some place can only be passed infinitely slowly, by the limits on rates."""
    NOT_PROVED = "not proved"
    """A timing was computed, but `validate` did not accept it, nor when slowed down."""


@dataclass(frozen=True, eq=False)
class SpeedProfile:
    """The fastest way along a path, on a grid.

    Every stop appears twice, as the end of one piece and the start of the next.
    """

    u: FloatArray
    """(n,) m, how far along the path (see `Path.parameter`)."""
    t: FloatArray
    """(n,) s, the time at stops included."""
    speed: FloatArray
    """(n,) u̇, m/s."""
    limit: tuple[str, ...]
    """(n,) the limit that is used most, as in `Violation`; also
    ``STEER_ACCELERATION``, and ``PATH_SPEED`` and ``PATH_YAW_RATE`` for caps of the
    path."""
    wheel: tuple[str | None, ...]
    """(n,) the id of its wheel; None for the vehicle or the path."""
    utilisation: FloatArray
    """(n,) how much of it is used: 1, but next to where speeding up turns into slowing
    down."""
    representation: IntArray
    """(n,) 1 or -1: the sign of v_s."""

    @property
    def duration(self) -> float:
        """Duration of the optimum, s."""
        return float(self.t[-1])


@dataclass(frozen=True, eq=False)
class Timing:
    """The fastest permitted timing of one path for one vehicle, or why there is none.

    The profile is the optimum itself; the trajectory is its proved realisation and a
    little slower. Where steering accelerations count, the path's jumps of the third
    derivative are rounded off on the way (`omniplan.timing.rounding`), so that it may
    also be a little faster.
    """

    vehicle: str
    path: str
    status: TimingStatus
    trajectory: Trajectory | None = None
    profile: SpeedProfile | None = None
    fault: Fault | None = None
    """What is in the way, and where; only if there is no trajectory."""
    message: str = ""
    """The answer in one line."""

    @property
    def duration(self) -> float | None:
        """Duration of the trajectory, s; None if there is none."""
        return None if self.trajectory is None else self.trajectory.duration

    def to_dict(self) -> dict[str, Any]:
        """Return the answer as plain data (JSON types only), without the samples."""
        return {
            "vehicle": self.vehicle,
            "path": self.path,
            "status": self.status.value,
            "duration": self.duration,
            "optimum": None if self.profile is None else self.profile.duration,
            "fault": None if self.fault is None else asdict(self.fault),
            "message": self.message,
        }

    def refusal(self) -> Undrivable:
        """Return why there is no trajectory, as a value that rankings hold."""
        return Undrivable(self.vehicle, self.status.value, self.fault)

    def raise_for_status(self) -> Trajectory:
        """Return the trajectory.

        Raises
        ------
        NotDrivable
            If there is none; with the message.
        """
        if self.trajectory is None:
            raise NotDrivable(self.message)
        return self.trajectory
