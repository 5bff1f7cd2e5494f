"""Trajectories: timed samples of a planar motion and how they are joined.

Three forms, each with its interpolation:

======================  ====================================================
poses (x, y, θ)         C² cubic splines of x, y and the unwrapped heading; at a
                        cusp or standstill the speed is 0 and a new one starts
twists (vx, vy, ω)      linear in the body twist
(κ_n, β, v_n)           linear, β the shorter way round; a straight piece in the plane
======================  ====================================================
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias, overload

import numpy as np
import numpy.typing as npt

from configspace import Problem, Vehicle, vehicle_from_data
from configspace.angles import wrap
from omniplan.errors import InvalidTrajectory
from omniplan.path import Path
from omniplan.samples import (
    MAX_VALUE,
    checked_name,
    checked_point,
    invalid_row,
    joined_headings,
    locked,
    numbers,
    reject_outside,
    unwrapped,
)

__all__ = ["Trajectory", "require_motion", "timed"]

FloatArray = npt.NDArray[np.float64]
Form: TypeAlias = Literal["poses", "twists", "omni_curve"]

COLUMNS: dict[Form, tuple[str, str, str]] = {
    "poses": ("x", "y", "theta"),
    "twists": ("vx", "vy", "omega"),
    "omni_curve": ("kappa_n", "beta", "v_n"),
}
"""The three columns of each form, as in CSV files."""

MAX_TIME = 1e10
"""Largest |t|, s: room for the seconds since 1970 and far more."""
MIN_STEP = 1e-6
"""Least time from sample to sample, s."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A timed motion. Build one with `from_poses`, `from_twists`, `from_omni_curve`."""

    name: str
    form: Form
    t: FloatArray
    """(n,) s, strictly increasing."""
    samples: FloatArray
    """(n, 3) the three columns of the form; headings and β unwrapped."""
    reference_point: tuple[float, float] = (0.0, 0.0)
    """The point of the vehicle that the samples describe, in its file's frame, m."""
    vehicle: Vehicle | None = None
    """The vehicle whose κ_n and v_n are meant; only for ``omni_curve``."""

    @overload
    @classmethod
    def from_poses(
        cls,
        t: None,
        poses: npt.ArrayLike,
        *,
        name: str = "trajectory",
        reference_point: tuple[float, float] = (0.0, 0.0),
    ) -> Path: ...

    @overload
    @classmethod
    def from_poses(
        cls,
        t: npt.ArrayLike,
        poses: npt.ArrayLike,
        *,
        name: str = "trajectory",
        reference_point: tuple[float, float] = (0.0, 0.0),
    ) -> Trajectory: ...

    @classmethod
    def from_poses(
        cls,
        t: npt.ArrayLike | None,
        poses: npt.ArrayLike,
        *,
        name: str = "trajectory",
        reference_point: tuple[float, float] = (0.0, 0.0),
    ) -> Trajectory | Path:
        """Return the trajectory through timed poses, or the path through poses.

        Parameters
        ----------
        t : (n,) float, s, or None
            Strictly increasing, n ≥ 2. None: a `Path`; `omniplan.fastest` times it.
        poses : (n, 3) float, m, m, rad
            (x, y, θ) of the reference point. Headings may be wrapped; from sample to
            sample the vehicle turns by at most a quarter turn.
        name : str
        reference_point : (float, float), m
            The point described, in the frame of the vehicle files.

        Raises
        ------
        InvalidTrajectory
            With the number of the first offending row.

        Examples
        --------
        >>> Trajectory.from_poses([0, 1, 2], [[0, 0, 0], [1, 0, 0], [2, 0, 0]]).duration
        2.0
        """
        if t is None:
            return Path.from_poses(poses, name=name, reference_point=reference_point)
        times, samples = _checked(name, t, poses, COLUMNS["poses"])
        samples[:, 2] = joined_headings(name, samples[:, 2])
        point = checked_point(name, reference_point)
        return cls(name, "poses", locked(times), locked(samples), point)

    @classmethod
    def from_twists(
        cls,
        t: npt.ArrayLike,
        twists: npt.ArrayLike,
        *,
        name: str = "trajectory",
        reference_point: tuple[float, float] = (0.0, 0.0),
    ) -> Trajectory:
        """Return the trajectory through timed body twists.

        Parameters
        ----------
        t : (n,) float, s
            Strictly increasing, n ≥ 2.
        twists : (n, 3) float, m/s, m/s, rad/s
            (vx, vy, ω) of the reference point in the vehicle frame.
        name : str
        reference_point : (float, float), m

        Raises
        ------
        InvalidTrajectory
            With the number of the first offending row.
        """
        times, samples = _checked(name, t, twists, COLUMNS["twists"])
        point = checked_point(name, reference_point)
        return cls(name, "twists", locked(times), locked(samples), point)

    @classmethod
    def from_omni_curve(
        cls,
        t: npt.ArrayLike,
        kappa_n: npt.ArrayLike,
        beta: npt.ArrayLike,
        v_n: npt.ArrayLike,
        vehicle: Vehicle,
        *,
        name: str = "trajectory",
    ) -> Trajectory:
        """Return the trajectory through timed Omni-Curve-Parameters of one vehicle.

        Parameters
        ----------
        t : (n,) float, s
            Strictly increasing, n ≥ 2.
        kappa_n : (n,) float, 1, [-2, 2]
        beta : (n,) float, rad
            Joined the shorter way round, less than half a turn from row to row.
        v_n : (n,) float, 1, [-1, 1]
            Share of the vehicle's v_max at each place; may change sign at 0 only.
        vehicle : Vehicle
            The vehicle whose parameters these are.
        name : str

        Raises
        ------
        InvalidTrajectory
            With the number of the first offending row.
        """
        labels = COLUMNS["omni_curve"]
        columns = [
            numbers(name, (label,), column)
            for label, column in zip(labels, (kappa_n, beta, v_n), strict=True)
        ]
        if len({column.shape for column in columns}) > 1:
            shapes = ", ".join(str(column.shape) for column in columns)
            raise InvalidTrajectory(
                Problem(
                    name, f"{', '.join(labels)} of shapes {shapes}", "one shape (n,)"
                )
            )
        times, samples = _checked(name, t, np.stack(columns, axis=-1), labels)
        for column, limit, allowed in ((0, 2.0, "[-2, 2]"), (2, 1.0, "[-1, 1]")):
            outside = np.flatnonzero(np.abs(samples[:, column]) > limit)
            if outside.size:
                raise invalid_row(
                    name,
                    int(outside[0]),
                    COLUMNS["omni_curve"][column],
                    f"{samples[outside[0], column]:g}",
                    f"must lie in {allowed}",
                )
        step = wrap(np.diff(samples[:, 1]))
        half = np.flatnonzero(np.abs(step) > math.pi - 1e-9)
        if half.size:
            raise invalid_row(
                name,
                int(half[0]) + 1,
                "beta",
                "turns by half a turn",
                "the way round must be clear: less than half a turn per row",
            )
        samples[:, 1] = unwrapped(samples[:, 1])
        return cls(name, "omni_curve", locked(times), locked(samples), vehicle=vehicle)

    @property
    def duration(self) -> float:
        """Duration, s."""
        return float(self.t[-1] - self.t[0])

    def scaled(self, factor: float) -> Trajectory:
        """Return the same path driven `factor` times as fast.

        Parameters
        ----------
        factor : float, 1, > 0

        Raises
        ------
        InvalidTrajectory
            If the factor is not positive, or v_n would leave [-1, 1].
        """
        if not (math.isfinite(factor) and factor > 0):
            raise InvalidTrajectory(Problem("factor", f"{factor}", "must be positive"))
        t = self.t[0] + (self.t - self.t[0]) / factor
        samples = self.samples.copy()
        if self.form == "twists":
            samples *= factor
        elif self.form == "omni_curve":
            samples[:, 2] *= factor
            if np.abs(samples[:, 2]).max() > 1:
                raise InvalidTrajectory(
                    Problem("factor", f"{factor:g}", "v_n must stay in [-1, 1]")
                )
        return Trajectory(
            self.name,
            self.form,
            locked(t),
            locked(samples),
            self.reference_point,
            self.vehicle,
        )

    def with_dwell(self, row: int, seconds: float) -> Trajectory:
        """Return the trajectory with a standstill added after a row of poses.

        Parameters
        ----------
        row : int
        seconds : float, s, > 0

        Raises
        ------
        InvalidTrajectory
            If the samples are not poses, or row or time are out of range.
        """
        if (
            self.form != "poses"
            or not 0 <= row < self.t.size
            or not 0 < seconds < math.inf
        ):
            raise InvalidTrajectory(
                Problem(
                    self.name,
                    f"a standstill of {seconds} s after row {row} of {self.form}",
                    f"poses, a row from 0 to {self.t.size - 1}, a positive time",
                )
            )
        t = self.t + np.where(np.arange(self.t.size) > row, seconds, 0.0)
        return Trajectory(
            self.name,
            self.form,
            locked(np.insert(t, row + 1, self.t[row] + seconds)),
            locked(np.insert(self.samples, row + 1, self.samples[row], axis=0)),
            self.reference_point,
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the trajectory as plain data (JSON types only)."""
        data: dict[str, Any] = {
            "name": self.name,
            "t": self.t.tolist(),
            self.form: self.samples.tolist(),
        }
        if self.reference_point != (0.0, 0.0):
            data["reference_point"] = list(self.reference_point)
        if self.vehicle is not None:
            data["vehicle"] = self.vehicle.model_dump(mode="json")
        return data

    @classmethod
    def from_dict(cls, data: object) -> Trajectory:
        """Return the trajectory that plain data describes, as `to_dict` gives it.

        Raises
        ------
        InvalidTrajectory
            If keys are missing or unknown, or values are wrong.
        InvalidVehicle
            If the vehicle of an ``omni_curve`` trajectory is.
        """
        if not isinstance(data, dict):
            raise InvalidTrajectory(
                Problem("trajectory", type(data).__name__, "a mapping is needed")
            )
        name = checked_name(data.get("name", "trajectory"))
        known = {"name", "t", "reference_point", "vehicle", *COLUMNS}
        unknown = sorted(str(key) for key in set(data) - known)
        forms = [form for form in COLUMNS if form in data]
        if unknown or len(forms) != 1 or "t" not in data:
            given = f"unknown key {unknown[0]}" if unknown else f"keys {sorted(data)}"
            raise InvalidTrajectory(
                Problem(name, given, f"t and exactly one of {', '.join(COLUMNS)}")
            )
        form = forms[0]
        if form == "omni_curve":
            vehicle = vehicle_from_data(data.get("vehicle"), f"{name}: vehicle")
            times, samples = _checked(name, data["t"], data[form], COLUMNS[form])
            kappa_n, beta, v_n = samples.T
            return cls.from_omni_curve(times, kappa_n, beta, v_n, vehicle, name=name)
        point = checked_point(name, data.get("reference_point", (0.0, 0.0)))
        build = cls.from_poses if form == "poses" else cls.from_twists
        times = numbers(name, ("t",), data["t"])
        return build(times, data[form], name=name, reference_point=point)


def _checked(
    name: str, t: npt.ArrayLike, samples: npt.ArrayLike, columns: tuple[str, str, str]
) -> tuple[FloatArray, FloatArray]:
    """Return times and samples as new float arrays, or raise with the row."""
    name = checked_name(name)
    times, values = numbers(name, ("t",), t), numbers(name, columns, samples)
    if times.ndim != 1 or values.shape != (times.size, 3):
        raise InvalidTrajectory(
            Problem(
                name,
                f"t of shape {times.shape}, samples of shape {values.shape}",
                "shapes (n,) and (n, 3)",
            )
        )
    if times.size < 2:
        raise InvalidTrajectory(
            Problem(name, f"{times.size} sample(s)", "at least two are needed")
        )
    reject_outside(name, times, "t", MAX_TIME)
    for column, label in zip(values.T, columns, strict=True):
        reject_outside(name, column, label, MAX_VALUE)
    back = np.flatnonzero(np.diff(times) < MIN_STEP)
    if back.size:
        row = int(back[0]) + 1
        raise invalid_row(
            name,
            row,
            "t",
            f"{times[row]:g} s after {times[row - 1]:g} s",
            "must increase from row to row, by at least a microsecond",
        )
    return times, values


def timed(motion: Trajectory | Path) -> Trajectory:
    """Return a trajectory as it is.

    Raises
    ------
    InvalidTrajectory
        For a path: only a motion with times can be judged. For anything else, too.
    """
    require_motion(motion, "trajectory")
    if isinstance(motion, Path):
        raise InvalidTrajectory(
            Problem(
                motion.name,
                "a path, which has no times",
                "omniplan.fastest(path, space) finds them",
            )
        )
    return motion


def require_motion(given: object, where: str) -> None:
    """Raise InvalidTrajectory unless a value is a trajectory or a path."""
    if not isinstance(given, Trajectory | Path):
        allowed = "a Trajectory or a Path, as read_trajectories returns"
        raise InvalidTrajectory(Problem(where, repr(given)[:60], allowed))
