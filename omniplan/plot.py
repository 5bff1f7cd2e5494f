"""Pictures of trajectories and verdicts.

The one module of the package that imports matplotlib; nothing imports it before a
picture is wanted. `configspace.plot.save_figure` writes the figures.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Polygon, Rectangle

from configspace import InvalidInput, Problem
from omniplan.report import Ranking, Report
from omniplan.trajectory import Trajectory

__all__ = ["plot_manoeuvres", "plot_trajectory", "plot_verdicts"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
Outline: TypeAlias = Sequence[tuple[float, float]]
"""Corners of a footprint in the frame of the vehicle file, m."""

CUSP = math.radians(80)
"""A larger turn of the direction of travel from step to step is a cusp or corner."""

_START, _GOAL, _PATH = "tab:blue", "tab:orange", "black"
_FREE, _REFUSED = "#cdeccd", "#a86a6a"


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
    figure = _new_figure(7.0, 5.5)
    axes = figure.add_subplot()
    keys = _draw_trajectory(axes, trajectory, footprint, outlines)
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.set_title(f"{_plain(trajectory.name)}, {trajectory.duration:.3g} s")
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
    figure = _new_figure(4.2 * columns, 3.7 * rows + 0.4)
    keys: dict[object, Artist] = {}
    for place, (trajectory, footprint) in enumerate(
        zip(trajectories, footprints, strict=True)
    ):
        axes = figure.add_subplot(rows, columns, place + 1)
        for key in _draw_trajectory(axes, trajectory, footprint, 9):
            keys.setdefault(key.get_label(), key)
        axes.set_title(_plain(trajectory.name, 36))
        if place + columns >= len(trajectories):
            axes.set_xlabel("x [m]")
        if place % columns == 0:
            axes.set_ylabel("y [m]")
    figure.legend(
        handles=list(keys.values()), loc="outside lower center", ncols=4, frameon=False
    )
    return figure


def plot_verdicts(rankings: Sequence[Ranking]) -> Figure:
    """Draw who can drive what: vehicles down, trajectories across.

    A light cell says how fast the vehicle can be, a hatched one which limit it breaks
    first and with which wheel. The best vehicle of a trajectory has a thick frame.

    Parameters
    ----------
    rankings : sequence of Ranking
        One for each trajectory, as `select` gives them.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        If there is no ranking, or none has a vehicle.
    """
    cells = verdicts(rankings)
    vehicles = sorted({vehicle for vehicle, _ in cells})
    if not vehicles:
        raise InvalidInput(Problem("rankings", "no vehicle", "at least one is needed"))
    names = [ranking.trajectory for ranking in rankings]
    figure = _new_figure(2.0 + 1.75 * len(names), 1.5 + 0.75 * len(vehicles))
    axes = figure.add_subplot()
    for row, vehicle in enumerate(vehicles):
        for column, ranking in enumerate(rankings):
            report = cells.get((vehicle, column))
            is_best = ranking.best is not None and ranking.best.vehicle == vehicle
            _draw_cell(axes, column, row, report, is_best)
    axes.set(
        xlim=(-0.5, len(names) - 0.5),
        ylim=(len(vehicles) - 0.5, -0.5),
        xticks=range(len(names)),
        yticks=range(len(vehicles)),
    )
    # Spaces let a long name go over several lines.
    spaced = [name.replace("_", " ").replace("-", " ") for name in names]
    axes.set_xticklabels([textwrap.fill(_plain(name), 18) for name in spaced])
    axes.set_yticklabels([_plain(vehicle) for vehicle in vehicles])
    axes.tick_params(length=0, top=True, labeltop=True, bottom=False, labelbottom=False)
    axes.spines[:].set_visible(False)
    keys = [
        Patch(fc=_FREE, ec="black", label="can, fastest duration"),
        Patch(fc=_REFUSED, ec="white", hatch="///", label="cannot, first limit"),
        Patch(fc=_FREE, ec="black", lw=2.5, label="best"),
    ]
    figure.legend(handles=keys, loc="outside lower center", ncols=3, frameon=False)
    return figure


def verdicts(rankings: Sequence[Ranking]) -> dict[tuple[str, int], Report]:
    """Return the report of every cell, by vehicle and number of the ranking."""
    return {
        (report.vehicle, column): report
        for column, ranking in enumerate(rankings)
        for report in (
            *(candidate.report for candidate in ranking.suitable),
            *ranking.refused,
        )
    }


def verdict_text(report: Report) -> str:
    """Return what a cell of the verdicts says.

    Parameters
    ----------
    report : Report

    Returns
    -------
    str
        The fastest duration, or the limit that is broken first and its wheel.
    """
    if report.valid:
        fastest = report.fastest_duration
        return f"{report.duration if fastest is None else fastest:.3g} s"
    first = report.headline
    if first is None:
        return "refused"
    limit = first.limit.lower().replace("_", " ").replace("steer ", "steering ")
    return f"{limit}\n{_plain(first.wheel or 'vehicle', 22)}"


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


def _plain(name: str, longest: int = 60) -> str:
    """Return a name that is not too long and that is not taken for a formula."""
    short = name if len(name) <= longest else f"{name[: longest - 1]}…"
    return short.replace("$", r"\$")


def _new_figure(width: float, height: float) -> Figure:
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


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
    keys += axes.plot(x, y, color=_PATH, lw=1.5, zorder=4, label="reference point")
    size = _extent(trajectory, footprint)
    ends = ((0, _START, "o", "start"), (-1, _GOAL, "s", "goal"))
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
        _draw_heading(axes, trajectory.samples[index], 0.09 * size, _PATH, 1.0)
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
    for index, colour, style in ((0, _START, "-"), (-1, _GOAL, "--")):
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


def _draw_cell(
    axes: Axes, column: int, row: int, report: Report | None, is_best: bool
) -> None:
    corner = (column - 0.47, row - 0.44)
    if report is None:
        axes.text(column, row, "not asked", ha="center", va="center", color="0.5")
        return
    cell = Rectangle(corner, 0.94, 0.88, fc=_FREE, ec="black")
    if not report.valid:
        cell.set(facecolor=_REFUSED, edgecolor="white", hatch="///")
    cell.set_linewidth(2.5 if is_best else 0.5)
    axes.add_patch(cell)
    axes.text(
        column,
        row,
        verdict_text(report),
        ha="center",
        va="center",
        fontsize="large" if report.valid else "small",
        fontweight="bold" if is_best else "normal",
        bbox=None if report.valid else {"fc": "white", "ec": "none", "pad": 1.5},
    )
