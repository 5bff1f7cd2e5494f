"""Pictures of trajectories and verdicts.

The module to import for pictures; matplotlib is imported here and in the ``plot_…``
modules that draw the parts, never before a picture is wanted.
`configspace.plot.save_figure` writes the figures.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from configspace import InvalidInput, PermissibleSpace, Problem
from configspace.plot_style import new_figure, save_figure
from omniplan.plots.data import Drive, drive_of, marks_of
from omniplan.plots.map import draw_on_space
from omniplan.plots.path import draw_way
from omniplan.plots.style import GOAL, PATH, START, legend_below, plain
from omniplan.plots.time import draw_times, panels_of
from omniplan.plots.verdicts import plot_verdicts
from omniplan.report import Report
from omniplan.trajectory import Trajectory

__all__ = [
    "plot_manoeuvres",
    "plot_on_space",
    "plot_report",
    "plot_times",
    "plot_trajectory",
    "plot_verdicts",
    "plot_way",
]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
Outline: TypeAlias = Sequence[tuple[float, float]]
"""Corners of a footprint in the frame of the vehicle file, m."""

CUSP = math.radians(80)
"""A larger turn of the direction of travel from step to step is a cusp or corner."""


def plot_report(
    report: Report,
    trajectory: Trajectory,
    space: PermissibleSpace,
    folder: str | Path,
    *,
    allow_unreachable: bool = False,
) -> tuple[Path, ...]:
    """Draw a verdict and write it: the way, the map of v_max, and all over time.

    Parameters
    ----------
    report : Report
        Of `validate`; its violations are numbered in all three pictures.
    trajectory : Trajectory
    space : PermissibleSpace
        Wheels are drawn if its vehicle is known.
    folder : str or Path
        Created where it does not exist.
    allow_unreachable : bool
        As for the `validate` that gave the report.

    Returns
    -------
    paths : tuple of Path
        ``TRAJECTORY-VEHICLE-way.png``, ``…-space.png`` and ``…-times.png``.

    Raises
    ------
    InvalidInput
        If a file cannot be written.
    """
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        given = f"{folder}: {error.strerror}"
        raise InvalidInput(Problem("folder", given, "must be writable")) from error
    drive = drive_of(trajectory, space, allow_unreachable=allow_unreachable)
    stem = re.sub(r"[^\w.-]+", "_", f"{trajectory.name}-{report.vehicle}")[:150]
    paths = []
    for name, figure in (
        ("way", plot_way(drive, report, trajectory)),
        ("space", plot_on_space(drive, report)),
        ("times", plot_times(drive, report)),
    ):
        paths.append(folder / f"{stem}-{name}.png")
        save_figure(figure, paths[-1])
    return tuple(paths)


def plot_way(drive: Drive, report: Report, trajectory: Trajectory) -> Figure:
    """Draw the way over the ground with footprint and steered wheels.

    Parameters
    ----------
    drive : Drive
        Of `omniplan.plots.data.drive_of`.
    report : Report
    trajectory : Trajectory
        The way of its reference point is drawn, coloured by margin.

    Returns
    -------
    Figure
    """
    figure, marks = new_figure(9.0, 6.2), marks_of(report)
    keys = draw_way(figure.add_subplot(), drive, trajectory.reference_point, marks)
    return _framed(figure, report, keys)


def plot_on_space(drive: Drive, report: Report) -> Figure:
    """Draw what is driven on the permissible space of the vehicle.

    Parameters
    ----------
    drive : Drive
    report : Report

    Returns
    -------
    Figure
    """
    figure, marks = new_figure(8.6, 6.4), marks_of(report)
    keys = draw_on_space(figure.add_subplot(), drive, marks)
    return _framed(figure, report, keys)


def plot_times(drive: Drive, report: Report) -> Figure:
    """Draw speeds, steering angles and margin over time, with their limits.

    Parameters
    ----------
    drive : Drive
    report : Report

    Returns
    -------
    Figure
    """
    n_panels, marks = panels_of(drive), marks_of(report)
    figure = new_figure(9.6, 1.2 + 1.75 * n_panels + 0.2 * len(marks))
    panels = list(figure.subplots(n_panels, 1, sharex=True))
    draw_times(panels, drive, report, marks)
    figure.align_ylabels(panels)
    return _framed(figure, report, [])


def _framed(figure: Figure, report: Report, keys: list[Artist]) -> Figure:
    """Return a figure with the verdict above it, keys and violations below."""
    figure.suptitle(_headline(report), fontsize="medium")
    legend_below(figure, keys, marks_of(report))
    return figure


def _headline(report: Report) -> str:
    verdict = "permitted" if report.valid else "not permitted"
    name = f"{plain(report.trajectory, 40)} by {plain(report.vehicle, 40)}"
    # Where a limit has no ratio to its bound the margin says nothing more.
    left = f", margin {report.margin:.1%}" if report.margin > -10 else ""
    return f"{name}: {verdict}{left}"


def plot_trajectory(
    trajectory: Trajectory, *, footprint: Outline | None = None, outlines: int = 12
) -> Figure:
    """Draw the path of the reference point and the footprint along it.

    Parameters
    ----------
    trajectory : Trajectory
        Of form ``poses``.
    footprint : sequence of (x, y), m, optional
        Outline of the vehicle, in the frame of its file.
    outlines : int
        How many outlines to draw between start and goal, at most; they darken with
        time.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        If the trajectory is not made of poses.
    """
    figure = new_figure(7.0, 5.5)
    axes = figure.add_subplot()
    keys = _draw_trajectory(axes, trajectory, footprint, outlines)
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.set_title(f"{plain(trajectory.name)}, {trajectory.duration:.3g} s")
    figure.legend(handles=keys, loc="outside lower center", ncols=4, frameon=False)
    return figure


def plot_manoeuvres(
    trajectories: Sequence[Trajectory], footprints: Sequence[Outline | None]
) -> Figure:
    """Draw several trajectories side by side, each to its own scale.

    Parameters
    ----------
    trajectories : sequence of Trajectory
        Each of form ``poses``.
    footprints : sequence of (sequence of (x, y), m, or None)
        One outline for each trajectory.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        If a trajectory is not made of poses, there is none, or the numbers differ.
    """
    if not trajectories or len(trajectories) != len(footprints):
        raise InvalidInput(
            Problem(
                "footprints",
                f"{len(footprints)} for {len(trajectories)} trajectories",
                "one footprint for each of at least one trajectory",
            )
        )
    columns = min(len(trajectories), 3 if len(trajectories) != 4 else 2)
    rows = math.ceil(len(trajectories) / columns)
    figure = new_figure(4.2 * columns, 3.7 * rows + 0.4)
    keys: dict[object, Artist] = {}
    for place, (trajectory, footprint) in enumerate(
        zip(trajectories, footprints, strict=True)
    ):
        axes = figure.add_subplot(rows, columns, place + 1)
        for key in _draw_trajectory(axes, trajectory, footprint, 9):
            keys.setdefault(key.get_label(), key)
        axes.set_title(plain(trajectory.name, 36))
        if place + columns >= len(trajectories):
            axes.set_xlabel("x [m]")
        if place % columns == 0:
            axes.set_ylabel("y [m]")
    figure.legend(
        handles=list(keys.values()), loc="outside lower center", ncols=4, frameon=False
    )
    return figure


def outlines_along(trajectory: Trajectory, footprint: Outline) -> FloatArray:
    """Return the footprint at every sample of a trajectory.

    Parameters
    ----------
    trajectory : Trajectory
        Of form ``poses``, n samples.
    footprint : sequence of m (x, y), m

    Returns
    -------
    outlines : (n, m, 2) float, m
    """
    x, y, theta = trajectory.samples.T
    corners = np.asarray(footprint, dtype=np.float64) - trajectory.reference_point
    turned = np.exp(1j * theta)[:, np.newaxis] * (corners[:, 0] + 1j * corners[:, 1])
    placed = (x + 1j * y)[:, np.newaxis] + turned
    return np.stack([placed.real, placed.imag], axis=-1)


def cusps(trajectory: Trajectory) -> IntArray:
    """Return the samples at which the direction of travel jumps.

    Parameters
    ----------
    trajectory : Trajectory
        Of form ``poses``.

    Returns
    -------
    index : (m,) int
        Reversals and sharp corners (more than 80°); the last sample of a standstill
        or of a turn on the spot between two ways.
    """
    step = np.diff(trajectory.samples[:, 0] + 1j * trajectory.samples[:, 1])
    moving = np.flatnonzero(np.abs(step) > 1e-6)
    way = step[moving]
    turn = np.angle(way[1:] * np.conj(way[:-1]))
    return np.asarray(moving[1:][np.abs(turn) > CUSP], dtype=np.int64)


def _draw_trajectory(
    axes: Axes, trajectory: Trajectory, footprint: Outline | None, outlines: int
) -> list[Artist]:
    """Draw a trajectory and return the keys of its legend."""
    if trajectory.form != "poses":
        raise InvalidInput(
            Problem(
                f"trajectory {trajectory.name}",
                f"of form {trajectory.form}",
                "only trajectories of form poses can be drawn",
            )
        )
    x, y, _ = trajectory.samples.T
    keys: list[Artist] = []
    chosen = _spread(trajectory, outlines)
    if footprint:
        _draw_outlines(axes, outlines_along(trajectory, footprint), chosen)
    keys += axes.plot(x, y, color=PATH, lw=1.5, zorder=4, label="reference point")
    size = _extent(trajectory, footprint)
    ends = ((0, START, "o", "start"), (-1, GOAL, "s", "goal"))
    for index, colour, marker, label in ends:
        keys += axes.plot(
            x[index],
            y[index],
            marker,
            color=colour,
            mec="black",
            ms=9 if index == 0 else 6,
            zorder=6,
            label=label,
        )
    for index in chosen:
        _draw_heading(axes, trajectory.samples[index], 0.09 * size, PATH, 1.0)
    for index, colour, _, _ in ends:
        _draw_heading(axes, trajectory.samples[index], 0.16 * size, colour, 2.5)
    sharp = cusps(trajectory)
    if sharp.size:
        keys += axes.plot(
            x[sharp], y[sharp], "X", color="white", mec="black", ms=9, zorder=7,
            ls="none", label="cusp or corner",
        )  # fmt: skip
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)
    axes.grid(alpha=0.3)
    return keys


def _spread(trajectory: Trajectory, number: int) -> IntArray:
    """Return the samples to draw: evenly along way and turning, without the ends."""
    x, y, theta = trajectory.samples.T
    effort = np.hypot(np.diff(x), np.diff(y)) + 0.5 * np.abs(np.diff(theta))
    done = np.concatenate([[0.0], np.cumsum(effort)])
    wanted = np.linspace(0, done[-1], number + 2)[1:-1]
    index = np.unique(np.searchsorted(done, wanted))
    return np.asarray(index[(index > 0) & (index < x.size - 1)], dtype=np.int64)


def _draw_outlines(axes: Axes, corners: FloatArray, chosen: IntArray) -> None:
    for index in chosen:
        grey = 0.8 - 0.45 * index / len(corners)
        axes.add_patch(Polygon(corners[index], fc="none", ec=str(grey), lw=0.9))
    for index, colour, style in ((0, START, "-"), (-1, GOAL, "--")):
        axes.add_patch(Polygon(corners[index], fc=colour, ec="none", alpha=0.15))
        axes.add_patch(
            Polygon(corners[index], fc="none", ec=colour, lw=2, ls=style, zorder=3)
        )


def _draw_heading(
    axes: Axes, pose: FloatArray, length: float, colour: str, width: float
) -> None:
    x, y, theta = pose
    tip = (x + length * math.cos(theta), y + length * math.sin(theta))
    axes.annotate(
        "",
        tip,
        (x, y),
        arrowprops={
            "arrowstyle": "-|>",
            "color": colour,
            "lw": width,
            "shrinkA": 0,
            "shrinkB": 0,
        },
        zorder=5,
    )


def _extent(trajectory: Trajectory, footprint: Outline | None) -> float:
    """Return the larger side of the box around all that is drawn, m."""
    points = trajectory.samples[:, :2]
    if footprint:
        points = outlines_along(trajectory, footprint).reshape(-1, 2)
    return float(np.ptp(points, axis=0).max()) or 1.0
