"""A trajectory on the vehicle's permissible space."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from configspace.plot_maps import draw_curve, draw_map
from omniplan.plots.data import Drive, Mark
from omniplan.plots.style import BROKEN, GOAL, START, add_marks, edged

__all__ = ["draw_on_space", "joined"]

FloatArray = npt.NDArray[np.float64]

SEAM = 90.0
"""A larger step of β is one over ±180° or through a pole, degrees."""
AT_POLE = 1e-6
"""So close to κ_n = ±2 every β is the same configuration."""


def draw_on_space(axes: Axes, drive: Drive, marks: tuple[Mark, ...]) -> list[Artist]:
    """Draw what is driven on the map of v_max, or on its curve.

    Of a line-mobile vehicle, and of one that cannot turn, the speeds that are driven
    are drawn over the one parameter that is free.

    Parameters
    ----------
    axes : Axes
    drive : Drive
    marks : tuple of Mark

    Returns
    -------
    keys : list of Artist
        For a legend, without those of the map itself.
    """
    space = drive.space
    broken = np.repeat(drive.trace.margin < 0, 2)
    if space.line_beta is not None or space.is_translating:
        draw_curve(axes, space)
        x = np.degrees(drive.beta) if space.is_translating else drive.kappa_n
        y = np.abs(drive.v_s)
        top = float(np.nanmax(y, initial=0.0))
        axes.set_ylim(top=max(axes.get_ylim()[1], 1.1 * top))
        seam = _joined_over if space.is_translating else _as_they_are
        keys = _draw_ways(axes, seam, x, y, drive.v_s, broken)
    else:
        draw_map(axes, space, _is_reversed(drive))
        x, y = drive.kappa_n, np.degrees(drive.beta)
        _draw_poles(axes, drive)
        # There the edge of the map is drawn: β means nothing.
        y_line = np.where(np.abs(drive.kappa_n) > 2 - AT_POLE, np.nan, y)
        keys = _draw_ways(axes, joined, x, y_line, drive.v_s, broken)
    known = np.flatnonzero(np.isfinite(x + y))
    if known.size:
        for index, colour, marker, label in (
            (known[0], START, "o", "start"),
            (known[-1], GOAL, "s", "goal"),
        ):
            look: dict[str, Any] = {"color": colour, "mec": "black", "zorder": 8}
            size = 10 if label == "start" else 7
            keys += axes.plot(
                x[index], y[index], marker, ms=size, label=label, clip_on=False, **look
            )
        near = [
            known[np.abs(drive.t[known] - mark.violation.t).argmin()] for mark in marks
        ]
        add_marks(axes, marks, x[near], y[near])
    return keys


def joined(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a line in the (κ_n, β) plane, cut where it goes over a seam.

    Parameters
    ----------
    x : (n,) float, 1
    y : (n,) float, degrees, [-180, 180]
        NaN cuts the line too.

    Returns
    -------
    x, y : (m,) float
        At ±180° the line goes on to the edge on both sides.
    """
    with np.errstate(invalid="ignore"):
        step = np.diff(y)
        cuts = np.flatnonzero(np.abs(step) > SEAM)
    rows: list[list[float]] = []
    at: list[int] = []
    for cut in cuts.tolist():
        side = float(np.sign(y[cut]))
        gap = 360 - abs(step[cut])
        if gap < SEAM / 2:  # over the seam; else through a pole
            share = (180 - abs(y[cut])) / gap if gap > 0 else 0.5
            edge = float(x[cut] + share * (x[cut + 1] - x[cut]))
            rows += [[edge, side * 180], [np.nan, np.nan], [edge, -side * 180]]
            at += [cut + 1] * 3
        else:
            rows.append([np.nan, np.nan])
            at.append(cut + 1)
    points = np.stack([x, y], axis=-1)
    if rows:
        points = np.insert(points, at, rows, axis=0)
    return points[:, 0], points[:, 1]


def _is_reversed(drive: Drive) -> bool:
    """Return whether the vehicle only drives backwards."""
    moving = drive.v_s[np.abs(drive.v_s) > 0]
    return bool(moving.size and (moving < 0).all())


def _joined_over(beta: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a line over β, cut at ±180°."""
    return joined(v, beta)[::-1]


def _as_they_are(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    return x, y


def _draw_ways(
    axes: Axes,
    cut: Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]],
    x: FloatArray,
    y: FloatArray,
    v_s: FloatArray,
    broken: npt.NDArray[np.bool_],
) -> list[Artist]:
    """Draw what is driven forwards, backwards and beyond a limit."""
    keys: list[Artist] = []
    for mask, style, width, colour, label in (
        (v_s >= 0, "-", 2.6, "white", "driven, v_s > 0"),
        (v_s < 0, (0, (2, 1.2)), 2.6, "white", "driven, v_s < 0"),
        (broken, "-", 4.0, BROKEN, "a limit is broken"),
    ):
        shown = mask & np.isfinite(x + y)
        if not shown.any():
            continue
        line = cut(np.where(shown, x, np.nan), np.where(shown, y, np.nan))
        look: dict[str, Any] = {"color": colour, "lw": width, "ls": style}
        effects = edged(width)
        zorder = 7 if label.startswith("a") else 6
        axes.plot(*line, **look, path_effects=effects, zorder=zorder, clip_on=False)
        math = label.replace("v_s", r"$v_s$")
        keys.append(Line2D([], [], **look, path_effects=effects, label=math))
    return keys


def _draw_poles(axes: Axes, drive: Drive) -> None:
    """Draw turning about K as the whole edge of the map: β means nothing there."""
    for pole in (-2.0, 2.0):
        if (np.abs(drive.kappa_n - pole) < AT_POLE).any():
            axes.plot(
                [pole, pole],
                [-180, 180],
                color="white",
                lw=5,
                path_effects=edged(5),
                clip_on=False,
                zorder=5,
            )
            axes.text(
                pole,
                150,
                " on the spot " if pole < 0 else " on the spot  ",
                ha="left" if pole < 0 else "right",
                fontsize="small",
                bbox={"fc": "white", "ec": "none", "pad": 1.5},
                zorder=8,
            )
