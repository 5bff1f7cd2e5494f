"""What the pictures of a verdict share: colours, marks, legends."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patheffects import AbstractPathEffect, withStroke

from configspace.plot_style import SPEEDS
from omniplan.plots.data import Mark

__all__ = [
    "BROKEN",
    "GOAL",
    "MARGINS",
    "MARGIN_SCALE",
    "PATH",
    "START",
    "add_marks",
    "edged",
    "legend_below",
    "plain",
]

FloatArray = npt.NDArray[np.float64]

NUMBER_ROOM, NUMBER_STEP = 18.0, 4.0
"""Numbers keep so far from each other, and move aside in such steps, points."""
START, GOAL, PATH = "tab:blue", "tab:orange", "black"
BROKEN = "#b4132a"
"""Where a limit is broken; drawn thick with a black edge, so that grey tells it too."""
MARGINS: Colormap = ListedColormap(SPEEDS(np.linspace(0.15, 1.0, 256)))
MARGIN_SCALE = Normalize(0, 1)

_NUMBER: dict[str, Any] = {
    "boxstyle": "circle,pad=0.2",
    "fc": "white",
    "ec": BROKEN,
    "lw": 1.5,
}


def plain(name: str, longest: int = 60) -> str:
    """Return a name that is not too long and that is not taken for a formula."""
    short = name if len(name) <= longest else f"{name[: longest - 1]}…"
    return short.replace("$", r"\$")


def add_marks(axes: Axes, marks: Sequence[Mark], x: FloatArray, y: FloatArray) -> None:
    """Point at violations with their numbers, those of one place side by side."""
    numbers: list[complex] = []
    points = axes.figure.dpi / 72
    for mark, place in zip(marks, zip(x, y, strict=True), strict=True):
        at = complex(*axes.transData.transform(place)) / points
        offset = complex(12, 12)
        while any(abs(at + offset - other) < NUMBER_ROOM for other in numbers):
            offset += NUMBER_STEP
        numbers.append(at + offset)
        axes.plot(*place, "o", ms=5, color=BROKEN, mec="black", zorder=9)
        axes.annotate(
            str(mark.number),
            place,
            xytext=(offset.real, offset.imag),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize="small",
            fontweight="bold",
            bbox=_NUMBER,
            arrowprops={"arrowstyle": "-", "color": BROKEN, "lw": 1.2},
            zorder=10,
        )


def legend_below(figure: Figure, keys: Sequence[Artist], marks: Sequence[Mark]) -> None:
    """Add a legend below: what legends there are, keys, one line per violation.

    Legends of the figure that axes have brought along are taken over.
    """
    for legend in list(figure.legends):
        handles = [handle for handle in legend.legend_handles if handle is not None]
        for handle, text in zip(handles, legend.get_texts(), strict=True):
            handle.set_label(text.get_text())
        keys = [*keys, *handles]
        legend.remove()
    lines = "\n".join(f"({mark.number})  {plain(mark.text, 110)}" for mark in marks)
    if keys:
        legend = figure.legend(
            handles=list(keys),
            loc="outside lower center",
            ncols=min(len(keys), 4),
            fontsize="small",
            frameon=False,
            title=lines or None,
            title_fontsize="small",
            alignment="left",
        )
        legend.get_title().set_color(BROKEN)
    elif lines:
        figure.supxlabel(lines, fontsize="small", color=BROKEN, x=0.02, ha="left")


def edged(width: float) -> list[AbstractPathEffect]:
    """Return a black edge around a line of this width, points."""
    return [withStroke(linewidth=width + 1.6, foreground="black")]
