"""The way of a vehicle over the ground, with footprint and steered wheels."""

from __future__ import annotations

import cmath
from itertools import combinations

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from configspace.vehicle import Castor, SteerableWheel, Vehicle
from omniplan.plots.data import Drive, Mark
from omniplan.plots.style import (
    BROKEN,
    GOAL,
    MARGIN_SCALE,
    MARGINS,
    START,
    add_marks,
)

__all__ = ["draw_way", "wheel_corners"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

OUTLINES = 8
"""Poses drawn between start and goal, at most."""
TREAD = 0.4
"""Width of a wheel per length."""


def draw_way(
    axes: Axes, drive: Drive, point: tuple[float, float], marks: tuple[Mark, ...]
) -> list[Artist]:
    """Draw the way of a point, coloured by margin, and the vehicle along it.

    Parameters
    ----------
    axes : Axes
    drive : Drive
    point : (float, float), m
        The reference point of the trajectory, in the frame of the vehicle file.
    marks : tuple of Mark

    Returns
    -------
    keys : list of Artist
        For a legend.
    """
    way = _placed(np.array([complex(*point)]), drive.poses)[:, 0]
    chosen = _spread(drive)
    keys = _draw_vehicles(axes, drive, chosen)
    keys += _draw_line(axes, drive, way)
    for index, colour, marker, label in (
        (0, START, "o", "start"),
        (-1, GOAL, "s", "goal"),
    ):
        keys += axes.plot(
            way[index].real,
            way[index].imag,
            marker,
            color=colour,
            mec="black",
            ms=9 if index == 0 else 7,
            zorder=8,
            label=label,
        )
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.06)
    axes.grid(alpha=0.3)
    axes.set(xlabel="x [m]", ylabel="y [m]")
    near = [int(np.argmin(np.abs(drive.t - mark.violation.t))) for mark in marks]
    add_marks(axes, marks, way[near].real, way[near].imag)
    bar = axes.figure.colorbar(
        ScalarMappable(MARGIN_SCALE, MARGINS), ax=axes, shrink=0.8, pad=0.02
    )
    bar.set_label("margin: share of the tightest limit that is left [1]")
    return keys


def wheel_corners(
    vehicle: Vehicle, alpha: FloatArray, length: float
) -> list[npt.NDArray[np.complex128]]:
    """Return the corners of all wheels but castors, in the vehicle file's frame, m.

    Parameters
    ----------
    vehicle : Vehicle
    alpha : (wheels,) float, rad
        Steering angles; NaN: as mounted, or in the middle of the range.
    length : float, m
        Of a wheel.
    """
    tread = np.array([1 + TREAD * 1j, -1 + TREAD * 1j, -1 - TREAD * 1j, 1 - TREAD * 1j])
    corners = []
    for wheel, angle in zip(vehicle.wheels, alpha, strict=True):
        if isinstance(wheel, Castor):
            continue
        if isinstance(wheel, SteerableWheel):
            turn = cmath.exp(1j * (float(angle) if np.isfinite(angle) else 0.0))
            offsets = wheel.offsets
        else:
            turn, offsets = cmath.exp(1j * wheel.heading), (0.0,)
        for offset in offsets:
            place = wheel.position + 1j * turn * offset
            corners.append(place + turn * tread * length / 2)
    return corners


def _placed(
    points: npt.NDArray[np.complex128], poses: FloatArray
) -> npt.NDArray[np.complex128]:
    """Return points of the vehicle at poses, (poses, points)."""
    place = poses[:, 0] + 1j * poses[:, 1]
    turned = np.exp(1j * poses[:, 2])[:, None] * points
    return np.asarray(place[:, None] + turned)


def _spread(drive: Drive) -> IntArray:
    """Return the moments to draw: both ends, and evenly along way and turning.

    So few that most of every vehicle is seen.
    """
    poses = drive.poses
    corners = np.array(drive.space.header.footprint or [(0.0, 0.0)])
    size = float(np.ptp(corners, axis=0).max()) or 0.5
    steps = np.hypot(np.diff(poses[:, 0]), np.diff(poses[:, 1]))
    steps = steps + 0.5 * size * np.abs(np.diff(poses[:, 2]))
    done = np.concatenate([[0.0], np.cumsum(steps)])
    number = min(max(round(done[-1] / (0.6 * size)), 2), OUTLINES)
    index = np.searchsorted(done, np.linspace(0, done[-1], number + 2)[1:-1])
    return np.unique(np.concatenate([[0], index, [len(poses) - 1]]))


def _draw_vehicles(axes: Axes, drive: Drive, chosen: IntArray) -> list[Artist]:
    """Draw footprint and wheels at some moments, darker with time."""
    header, vehicle = drive.space.header, drive.space.vehicle
    outline = np.array([complex(*corner) for corner in header.footprint])
    length = _wheel_length(vehicle, outline) if vehicle is not None else 0.0
    for number, index in enumerate(chosen):
        pose = drive.poses[index : index + 1]
        is_end = number in (0, len(chosen) - 1)
        shade = str(0.75 - 0.35 * number / len(chosen))
        edge = START if number == 0 else GOAL if is_end else shade
        width = 1.8 if is_end else 0.9
        if outline.size:
            _add(axes, [_placed(outline, pose)[0]], "none", edge, width)
        if vehicle is not None:
            alpha = drive.alpha[_near_known(drive.alpha, int(index))]
            wheels = wheel_corners(vehicle, alpha, length)
            placed = [_placed(corners, pose)[0] for corners in wheels]
            face = "0.25" if is_end else "white"
            _add(axes, placed, face, "0.25" if is_end else shade, width)
    keys: list[Artist] = []
    if outline.size:
        keys.append(Patch(fc="none", ec="0.5", label="footprint"))
    if vehicle is not None:
        keys.append(Patch(fc="0.25", label="wheels, as they are steered"))
    return keys


def _near_known(alpha: FloatArray, index: int) -> int:
    """Return the moment nearest to one at which the wheels stand somewhere."""
    known = np.flatnonzero(np.isfinite(alpha).any(axis=1))
    return int(known[np.abs(known - index).argmin()]) if known.size else index


def _wheel_length(vehicle: Vehicle, outline: npt.NDArray[np.complex128]) -> float:
    """Return a length of wheels that leaves room between them, m."""
    places = [w.position for w in vehicle.wheels if not isinstance(w, Castor)]
    points = np.array([*places, *outline])
    size = max(np.ptp(points.real), np.ptp(points.imag), 1e-3)
    apart = (abs(a - b) for a, b in combinations(places, 2))
    room = (0.8 * d for d in apart if d > 0.01 * size)
    return float(min([0.13 * size, *room]))


def _add(
    axes: Axes,
    polygons: list[npt.NDArray[np.complex128]],
    face: str,
    edge: str,
    width: float,
) -> None:
    corners = [np.stack([p.real, p.imag], axis=-1) for p in polygons]
    axes.add_collection(
        PolyCollection(
            corners, facecolors=face, edgecolors=edge, linewidths=width, zorder=3
        )
    )


def _draw_line(
    axes: Axes, drive: Drive, way: npt.NDArray[np.complex128]
) -> list[Artist]:
    """Draw the way, one segment per stretch."""
    ends = way.reshape(-1, 2)
    segments = np.stack([ends.real, ends.imag], axis=-1)
    margin = drive.trace.margin
    broken = margin < 0
    axes.plot(way.real, way.imag, color="black", lw=5.0, zorder=5)
    line = LineCollection(
        list(segments[~broken]), cmap=MARGINS, norm=MARGIN_SCALE, lw=3.2, zorder=7
    )
    line.set_array(margin[~broken])
    axes.add_collection(line)
    if not broken.any():
        return []
    for colour, width in (("black", 8.0), (BROKEN, 5.5)):
        axes.add_collection(
            LineCollection(list(segments[broken]), colors=colour, lw=width, zorder=6)
        )
    return [Line2D([], [], color=BROKEN, lw=5, label="a limit is broken")]
