"""What all pictures of a permissible space share: labels, colours, legends, files."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Colormap, ListedColormap, Normalize
from matplotlib.figure import Figure, SubFigure

from configspace.errors import InvalidInput, Problem
from configspace.files import reason_of, whole_file
from configspace.space import PermissibleSpace

__all__ = [
    "BETA",
    "BETA_TICKS",
    "KAPPA",
    "KAPPA_TICKS",
    "SPEEDS",
    "STEPS",
    "V_MAX",
    "legend_below",
    "new_figure",
    "save_figure",
    "side_by_side",
    "speed_scale",
    "title",
]

KAPPA = r"$\kappa_n$ [1]"
BETA = r"$\beta$ [°]"
V_MAX = r"$v_{\max}$ [m/s]"
KAPPA_TICKS = (-2, -1, 0, 1, 2)
BETA_TICKS = (-180, -90, 0, 90, 180)

# The dark end is cut off: in greyscale no speed may look like the black of "blocked".
SPEEDS: Colormap = ListedColormap(colormaps["viridis"](np.linspace(0.3, 1.0, 256)))
STEPS = SPEEDS.resampled(20)
"""The same in steps: bands in place of contours, and smaller files."""

MAX_PNG_BYTES = 300_000
"""`save_figure` lowers the resolution of a PNG until it is smaller."""


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of a size in inches that needs no pyplot."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def side_by_side(figure: Figure, widths: tuple[float, ...]) -> list[SubFigure]:
    """Return parts of a figure, from left to right."""
    return list(
        figure.subfigures(1, len(widths), squeeze=False, width_ratios=widths)[0]
    )


def title(space: PermissibleSpace, *, reverse: bool = False) -> str:
    """Return a title that says forwards or backwards where they differ."""
    name = space.name.replace("$", r"\$")  # not a formula
    way = ""
    is_plane = space.line_beta is None and not space.is_translating
    if is_plane and len(space.tables.load) > 1:
        way = ", backwards" if reverse else ", forwards"
    return rf"{name}{way},  $\kappa_g$ = {space.kappa_g:.3g} m$^{{-1}}$"


def speed_scale(low: float, high: float) -> Normalize:
    """Return a scale of some width, also for a space of one speed only."""
    return Normalize(min(low, high / 2), high)


def legend_below(axes: Axes, handles: Sequence[Artist], columns: int = 3) -> None:
    """Add a legend below everything else, if there is anything to tell."""
    if handles:
        axes.figure.legend(
            handles=handles,
            loc="outside lower center",
            ncols=columns,
            fontsize="small",
            frameon=False,
        )


def save_figure(figure: Figure, path: str | Path) -> None:
    """Write a figure as PNG (smaller than 300 kB) or SVG, by the suffix.

    Parameters
    ----------
    figure : Figure
    path : str or Path
        Ends in ``.png`` or ``.svg``.

    Raises
    ------
    InvalidInput
        If the suffix is another one or the file cannot be written; an older file of
        that name stays as it is.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in {".png", ".svg"}:
        raise InvalidInput(Problem("path", str(path), "must end in .png or .svg"))
    buffer = io.BytesIO()
    if suffix == ".svg":
        # Without a date and with a fixed salt the same figure gives the same file.
        with rc_context({"svg.hashsalt": "omniplan"}):
            figure.savefig(buffer, format="svg", dpi=150, metadata={"Date": None})
    else:
        for dpi in (150, 130, 115, 100, 85, 70, 50):
            buffer = io.BytesIO()
            figure.savefig(buffer, format="png", dpi=dpi, pil_kwargs={"optimize": True})
            if buffer.tell() < MAX_PNG_BYTES:
                break
    try:
        with whole_file(path) as temporary:
            temporary.write_bytes(buffer.getvalue())
    except OSError as error:
        raise InvalidInput(
            Problem("path", f"{path}: {reason_of(error)}", "must be writable")
        ) from error
