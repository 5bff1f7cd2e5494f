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
import sys
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from configspace import Problem, Vehicle, vehicle_from_data
from configspace.angles import wrap
from omniplan.errors import InvalidTrajectory

__all__ = ["Trajectory"]

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
MAX_VALUE = 1e6
"""Largest size of any other value: m, m/s, rad or rad/s."""
MAX_HEADING_STEP = math.pi / 2 + 1e-9
"""A larger turn from sample to sample is ambiguous, rad."""


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

    @classmethod
    def from_poses(
        cls,
        t: npt.ArrayLike,
        poses: npt.ArrayLike,
        *,
        name: str = "trajectory",
        reference_point: tuple[float, float] = (0.0, 0.0),
    ) -> Trajectory:
        """Return the trajectory through timed poses.

        Parameters
        ----------
        t : (n,) float, s
            Strictly increasing, n ≥ 2.
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
        times, samples = _checked(name, t, poses, COLUMNS["poses"])
        step = wrap(np.diff(samples[:, 2]))
        _reject_jump(name, "theta", "the heading", step)
        samples[1:, 2] = samples[0, 2] + np.cumsum(step)
        point = _point(name, reference_point)
        return cls(name, "poses", _locked(times), _locked(samples), point)

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
        point = _point(name, reference_point)
        return cls(name, "twists", _locked(times), _locked(samples), point)

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
            _numbers(name, (label,), column)
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
                raise _invalid(
                    name,
                    int(outside[0]),
                    COLUMNS["omni_curve"][column],
                    f"{samples[outside[0], column]:g}",
                    f"must lie in {allowed}",
                )
        step = wrap(np.diff(samples[:, 1]))
        half = np.flatnonzero(np.abs(step) > math.pi - 1e-9)
        if half.size:
            raise _invalid(
                name,
                int(half[0]) + 1,
                "beta",
                "turns by half a turn",
                "the way round must be clear: less than half a turn per row",
            )
        samples[1:, 1] = samples[0, 1] + np.cumsum(step)
        return cls(
            name, "omni_curve", _locked(times), _locked(samples), vehicle=vehicle
        )

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
            _locked(t),
            _locked(samples),
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
            _locked(np.insert(t, row + 1, self.t[row] + seconds)),
            _locked(np.insert(self.samples, row + 1, self.samples[row], axis=0)),
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
        name = data.get("name", "trajectory")
        if not isinstance(name, str) or not name or len(name) > 200:
            raise InvalidTrajectory(
                Problem("name", repr(name)[:60], "a text of 1 to 200 characters")
            )
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
        point = _point(name, data.get("reference_point", (0.0, 0.0)))
        build = cls.from_poses if form == "poses" else cls.from_twists
        return build(data["t"], data[form], name=name, reference_point=point)


def _numbers(name: str, labels: tuple[str, ...], values: npt.ArrayLike) -> FloatArray:
    """Return a new float array, or raise unless all values are numbers.

    `labels` name the columns of a table, or the one of a list.
    """
    try:
        array = np.array(values)
    except (TypeError, ValueError) as error:
        raise InvalidTrajectory(
            Problem(name, "rows of different lengths", f"{', '.join(labels)} in each")
        ) from error
    if array.size and array.dtype.kind not in "fiu":
        raise InvalidTrajectory(_not_a_number(name, labels, array))
    return array.astype(np.float64)


def _not_a_number(
    name: str, labels: tuple[str, ...], array: npt.NDArray[np.generic]
) -> Problem:
    """Return where the first value stands that is not a number."""
    for place, value in np.ndenumerate(array):
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or abs(value) > sys.float_info.max:
            known = len(place) > 1 and place[1] < len(labels)
            label = labels[place[1]] if known else ", ".join(labels)
            where = f"{name}: row {place[0]}, {label}" if place else f"{name}: {label}"
            return Problem(where, repr(value)[:60], "must be a number")
    return Problem(name, "values that are not numbers", "numbers only")


def _point(name: str, value: Any) -> tuple[float, float]:
    if isinstance(value, list | tuple) and len(value) == 2:
        x, y = _numbers(name, ("reference_point",), value)
        if abs(x) <= 100 and abs(y) <= 100:
            return float(x), float(y)
    raise InvalidTrajectory(
        Problem(
            f"{name}: reference_point", repr(value)[:60], "two finite numbers, in m"
        )
    )


def _checked(
    name: str, t: npt.ArrayLike, samples: npt.ArrayLike, columns: tuple[str, str, str]
) -> tuple[FloatArray, FloatArray]:
    """Return times and samples as new float arrays, or raise with the row."""
    if not 0 < len(str(name)) <= 200 or str(name).startswith("#"):
        allowed = "a text of 1 to 200 characters that does not start with #"
        raise InvalidTrajectory(Problem("name", repr(name)[:60], allowed))
    times, values = _numbers(name, ("t",), t), _numbers(name, columns, samples)
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
    for column, label, limit in (
        (times, "t", MAX_TIME),
        *(
            (column, label, MAX_VALUE)
            for column, label in zip(values.T, columns, strict=True)
        ),
    ):
        bad = np.flatnonzero(~(np.abs(column) <= limit))
        if bad.size:
            row = int(bad[0])
            allowed = f"must be finite, at most {limit:g} in size"
            raise _invalid(name, row, label, f"{column[row]}", allowed)
    back = np.flatnonzero(np.diff(times) < MIN_STEP)
    if back.size:
        row = int(back[0]) + 1
        raise _invalid(
            name,
            row,
            "t",
            f"{times[row]:g} s after {times[row - 1]:g} s",
            "must increase from row to row, by at least a microsecond",
        )
    return times, values


def _reject_jump(name: str, column: str, what: str, step: FloatArray) -> None:
    jump = np.flatnonzero(np.abs(step) > MAX_HEADING_STEP)
    if jump.size:
        row = int(jump[0])
        raise _invalid(
            name,
            row + 1,
            column,
            f"{what} turns by {math.degrees(step[row]):.1f}° from row {row}",
            "at most 90° per row, or the way round is not clear",
        )


def _invalid(
    name: str, row: int, column: str, given: str, allowed: str
) -> InvalidTrajectory:
    return InvalidTrajectory(Problem(f"{name}: row {row}, {column}", given, allowed))


def _locked(values: FloatArray) -> FloatArray:
    values.flags.writeable = False
    return values
