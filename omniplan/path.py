"""Paths: poses without times, with caps on the speed and required stops."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from configspace import Problem
from omniplan.errors import InvalidTrajectory
from omniplan.inputs.nurbs import Nurbs
from omniplan.inputs.route import Route, Tolerance
from omniplan.samples import (
    HEADING_LENGTH,
    MAX_VALUE,
    checked_name,
    checked_point,
    invalid_row,
    joined_headings,
    locked,
    numbers,
    reject_outside,
    unwrapped,
    whole_number,
)

__all__ = ["Path"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

MIN_MOVE = 1e-6
"""Least way from pose to pose, m; a radian of heading counts `HEADING_LENGTH`."""


@dataclass(frozen=True, eq=False)
class Path:
    """A motion without times. Build one with `from_poses` or `from_nurbs`.

    `omniplan.fastest` gives it the times that a vehicle needs.
    """

    name: str
    poses: FloatArray
    """(n, 3) m, m, rad: (x, y, θ) of the reference point, the heading unwrapped."""
    reference_point: tuple[float, float]
    """The point of the vehicle that the poses describe, in its file's frame, m."""
    max_speed: FloatArray | None
    """(n - 1,) m/s, > 0: cap on the speed between two poses, of whichever corner of the
    vehicle's footprint or the reference point is fastest; of the reference point alone
    for vehicles without a footprint. inf where there is none; None: no cap anywhere."""
    stops: BoolArray
    """(n,) where the vehicle must stand; cusps and corners need not be marked."""
    max_yaw_rate: FloatArray | None = None
    """(n - 1,) rad/s, > 0: cap on |ω|, likewise."""

    @classmethod
    def from_poses(
        cls,
        poses: npt.ArrayLike,
        *,
        name: str = "path",
        reference_point: tuple[float, float] = (0.0, 0.0),
        max_speed: npt.ArrayLike | None = None,
        max_yaw_rate: npt.ArrayLike | None = None,
        stops: npt.ArrayLike = (),
    ) -> Path:
        """Return the path through poses.

        Parameters
        ----------
        poses : (n, 3) float, m, m, rad, n ≥ 2
            (x, y, θ) of the reference point. Headings may be wrapped; from pose to pose
            the vehicle turns by at most a quarter turn, and moves.
        name : str
        reference_point : (float, float), m
            The point described, in the frame of the vehicle files.
        max_speed : float or (n - 1,) float, m/s, > 0, optional
            Cap on the speed of the vehicle's fastest point, pose to pose; inf: none.
        max_yaw_rate : float or (n - 1,) float, rad/s, > 0, optional
        stops : (k,) int, [0, n)
            Rows where the vehicle must stand.

        Raises
        ------
        InvalidTrajectory
            With the number of the first offending row.

        Examples
        --------
        >>> Path.from_poses([[0, 0, 0], [1, 0, 0], [2, 0, 0]], stops=[1]).stops
        array([False,  True, False])
        """
        name = checked_name(name)
        samples = numbers(name, ("x", "y", "theta"), poses)
        if samples.ndim != 2 or samples.shape[1] != 3 or len(samples) < 2:
            given = f"poses of shape {samples.shape}"
            allowed = "shape (n, 3), at least two rows"
            raise InvalidTrajectory(Problem(name, given, allowed))
        for column, label in enumerate(("x", "y", "theta")):
            reject_outside(name, samples[:, column], label, MAX_VALUE)
        samples[:, 2] = joined_headings(name, samples[:, 2])
        _reject_rest(name, samples)
        n = len(samples)
        return cls(
            name,
            locked(samples),
            checked_point(name, reference_point),
            _caps(name, "max_speed", max_speed, n - 1),
            _stops(name, stops, n),
            _caps(name, "max_yaw_rate", max_yaw_rate, n - 1),
        )

    @classmethod
    def from_nurbs(
        cls,
        control_points: npt.ArrayLike,
        weights: npt.ArrayLike | None = None,
        knots: npt.ArrayLike | None = None,
        degree: int = 1,
        *,
        orientation: npt.ArrayLike = 0.0,
        orientation_type: Literal["TANGENTIAL", "GLOBAL"] = "TANGENTIAL",
        name: str = "path",
        reference_point: tuple[float, float] = (0.0, 0.0),
        max_speed: float = np.inf,
        max_yaw_rate: float = np.inf,
        tolerance: float = 1e-4,
        heading_tolerance: float = 1e-4,
    ) -> Path:
        """Return the path along a NURBS, as VDA 5050 describes the edges of an order.

        The poses are chosen such that the C² splines through them (over `parameter`)
        keep to the curve. At a corner the vehicle stops and, if it is oriented along
        the curve, turns on the spot; at a cusp it stops and drives back.

        Parameters
        ----------
        control_points : (k, 2) float, m
        weights : (k,) float, > 0, optional
            Default 1.
        knots : (k + degree + 1,) float, optional
            Not decreasing, clamped: the ends degree + 1 times, inner ones at most
            degree times. Default equidistant from 0 to 1.
        degree : int, [1, 15]
        orientation : float or (k,) float, rad
            Heading of the vehicle, or one at every control point: these are global
            and are blended as the points are.
        orientation_type : {"TANGENTIAL", "GLOBAL"}
            Whether `orientation` is relative to the tangent or to the x axis.
        name : str
        reference_point : (float, float), m
            The point of the vehicle that follows the curve.
        max_speed : float, m/s, > 0
        max_yaw_rate : float, rad/s, > 0
        tolerance : float, m, [1e-7, 1]
            How far the splines through the poses may be off the curve.
        heading_tolerance : float, rad, [1e-7, 0.2]
            Likewise; corners of up to this angle are driven through.

        Raises
        ------
        InvalidTrajectory
            With every mistake of the curve and its place.

        References
        ----------
        VDA 5050, 3.0.0, 7.3 (trajectory); L. Piegl, W. Tiller, The NURBS Book, 4.1.

        Examples
        --------
        >>> bend = Path.from_nurbs([[1, 0], [1, 1], [0, 1]], [1, 0.5 ** 0.5, 1],
        ...                        degree=2)
        >>> abs(bend.poses[-1].round(6)).tolist()
        [0.0, 1.0, 3.141593]
        """
        name = checked_name(name)
        points = numbers(name, ("control_points",), control_points)
        curve = Nurbs.checked(
            points,
            None if weights is None else numbers(name, ("weights",), weights),
            None if knots is None else numbers(name, ("knots",), knots),
            whole_number(name, "degree", degree),
        )
        heading = _orientation(name, orientation, len(points))
        if orientation_type not in ("TANGENTIAL", "GLOBAL"):
            allowed = "TANGENTIAL or GLOBAL"
            raise InvalidTrajectory(
                Problem(f"{name}: orientation_type", repr(orientation_type), allowed)
            )
        route = Route(Tolerance(tolerance, heading_tolerance))
        route.follow(curve, heading, orientation_type == "GLOBAL")
        made = route.sampled()
        return cls.from_poses(
            made.poses,
            name=name,
            reference_point=reference_point,
            max_speed=max_speed,
            max_yaw_rate=max_yaw_rate,
            stops=made.stops,
        )

    @property
    def length(self) -> float:
        """Length of the way of the reference point from pose to pose, m."""
        return float(np.linalg.norm(np.diff(self.poses[:, :2], axis=0), axis=1).sum())

    @property
    def parameter(self) -> FloatArray:
        """(n,) m: chord length up to each pose, with the turn counted as well.

        The splines of a path are taken over this parameter.
        """
        return np.concatenate([[0.0], np.cumsum(_steps(self.poses))])


def _orientation(name: str, orientation: npt.ArrayLike, k: int) -> float | FloatArray:
    """Return one heading, or the unwrapped headings at k control points."""
    heading = numbers(name, ("orientation",), orientation)
    if heading.shape not in ((), (k,)):
        given = f"orientation of shape {heading.shape}"
        allowed = f"one number, or {k}: one per control point"
        raise InvalidTrajectory(Problem(name, given, allowed))
    reject_outside(name, heading.reshape(-1), "orientation", MAX_VALUE)
    if heading.ndim == 0:
        return float(heading)
    return unwrapped(heading)


def _steps(poses: FloatArray) -> FloatArray:
    """Return the way from pose to pose, (n - 1,) m."""
    way = np.diff(poses, axis=0) * [1.0, 1.0, HEADING_LENGTH]
    return np.asarray(np.linalg.norm(way, axis=1))


def _reject_rest(name: str, poses: FloatArray) -> None:
    still = np.flatnonzero(_steps(poses) < MIN_MOVE)
    if still.size:
        row = int(still[0]) + 1
        x, y, theta = poses[row]
        raise invalid_row(
            name,
            row,
            "x, y, theta",
            f"the same pose ({x:g}, {y:g}, {theta:g}) as in row {row - 1}",
            "a path moves from row to row; name rows to stand at in stops",
        )


def _caps(
    name: str,
    label: Literal["max_speed", "max_yaw_rate"],
    values: npt.ArrayLike | None,
    n: int,
) -> FloatArray | None:
    """Return a cap for each of n pieces; None where nothing is capped."""
    if values is None:
        return None
    caps = numbers(name, (label,), values)
    if caps.shape not in ((), (n,)):
        given = f"{label} of shape {caps.shape}"
        raise InvalidTrajectory(
            Problem(name, given, f"one number, or {n}: one per piece")
        )
    bad = np.flatnonzero(~(caps > 0))
    if bad.size:
        row, value = int(bad[0]), caps.flat[bad[0]]
        raise invalid_row(name, row, label, f"{value:g}", "must be positive")
    if np.isinf(caps).all():
        return None
    return locked(np.broadcast_to(caps, (n,)).copy())


def _stops(name: str, rows: npt.ArrayLike, n: int) -> BoolArray:
    """Return the mask of the rows that are named."""
    given = numbers(name, ("stops",), rows)
    whole = given.ndim == 1 and bool(np.all(given == np.rint(given)))
    if not whole or ((given < 0) | (given >= n)).any():
        shown = repr(given.tolist())[:60]
        allowed = f"a list of rows, each from 0 to {n - 1}"
        raise InvalidTrajectory(Problem(f"{name}: stops", shown, allowed))
    stops = np.zeros(n, dtype=bool)
    stops[given.astype(np.intp)] = True
    return locked(stops)
