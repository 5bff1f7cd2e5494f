"""Surfaces over the (κ_n, β) plane in three dimensions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import MaxNLocator, MultipleLocator
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from configspace.plot_facets import (
    Facets,
    rolling_polygons,
    steering_polygons,
    surface_polygons,
)
from configspace.plot_style import (
    BETA,
    BETA_TICKS,
    KAPPA,
    KAPPA_TICKS,
    SPEEDS,
    V_MAX,
    speed_scale,
)
from configspace.space import PermissibleSpace

if TYPE_CHECKING:
    from mpl_toolkits.mplot3d import Axes3D

__all__ = ["draw_rolling_speed", "draw_steering_angle", "draw_surface"]

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Look:
    """How the height of a surface is shown."""

    label: str
    low: float
    high: float
    step: float | None = None
    """Between the ticks; None to choose."""
    unit: float = 1.0
    """Factor from the facets' heights to the axis."""
    elevation: float = 46.0
    """Of the eye, degrees."""
    azimuth: float = -32.0
    """Of the eye, degrees."""
    rise: float = 0.45
    """Height of the box per its length over κ_n."""


def draw_surface(
    figure: Figure | SubFigure, space: PermissibleSpace, reverse: bool
) -> None:
    """Draw v_max, the blocked area black on the ground."""
    permitted, blocked = surface_polygons(space, reverse=reverse)
    top = max((float(facet[:, 2].max()) for facet in permitted), default=1.0)
    _draw(figure, permitted, blocked, _Look(V_MAX, 0.0, 1.05 * top))


def draw_steering_angle(
    figure: Figure, space: PermissibleSpace, wheel: int | str, number: int
) -> None:
    """Draw the steering angle of a wheel, the blocked area black at α = 0."""
    permitted, blocked = steering_polygons(space, wheel)
    heights = np.degrees(_heights(permitted))
    low, high = (heights.min(), heights.max()) if heights.size else (-180, 180)
    # Whole steps, and the ground at 0 within.
    look = _Look(
        rf"$\alpha_{{{number}}}$ [°]",
        min(90 * np.floor(low / 90 + 0.01), 0),
        max(90 * np.ceil(high / 90 - 0.01), 0),
        step=90,
        unit=180 / np.pi,
        rise=0.7,
    )
    _draw(figure, permitted, blocked, look)


def draw_rolling_speed(
    figure: Figure, space: PermissibleSpace, wheel: int | str, number: int
) -> None:
    """Draw the rolling speed of a wheel, the blocked area black at u = 0."""
    permitted, blocked = rolling_polygons(space, wheel)
    heights = _heights(permitted)
    low, high = (heights.min(), heights.max()) if heights.size else (0.0, 1.0)
    look = _Look(
        rf"$u_{{{number}}}$ [m/s]",
        min(1.05 * low, 0.0),
        max(1.05 * high, 0.1),
        rise=0.6,
    )
    _draw(figure, permitted, blocked, look)


def _draw(
    figure: Figure | SubFigure, permitted: Facets, blocked: Facets, look: _Look
) -> None:
    axes: Axes3D = figure.add_subplot(projection="3d", computed_zorder=False)
    height = np.array([facet[:, 2].mean() for facet in permitted]) * look.unit
    low, high = (height.min(), height.max()) if height.size else (0.0, 1.0)
    scale = speed_scale(low, high)
    colours = SPEEDS(scale(height)).reshape(-1, 4)
    # Opaque edges: clear ones would let the black ground shine through the seams.
    shade = 1 - 0.2 * _sizes(permitted)
    edges = colours * np.column_stack([shade, shade, shade, np.ones(len(shade))])
    black = np.tile((0.0, 0.0, 0.0, 1.0), (len(blocked), 1))
    axes.set(
        xlim=(-2, 2),
        ylim=(-180, 180),
        zlim=(look.low, look.high),
        xticks=KAPPA_TICKS,
        yticks=BETA_TICKS,
        xlabel=KAPPA,
        ylabel=BETA,
        zlabel=look.label,
    )
    if low >= 0:
        # Seen from above, the surface is always before the ground.
        _add(axes, blocked, look.unit, black, black, 1)
        _add(axes, permitted, look.unit, colours, edges, 2)
    else:
        both = np.concatenate([black, colours]), np.concatenate([black, edges])
        _add(axes, blocked + permitted, look.unit, *both, 1)
    locator = (
        MultipleLocator(look.step) if look.step else MaxNLocator(5, steps=[1, 2, 5, 10])
    )
    axes.zaxis.set_major_locator(locator)
    # Where two axes meet their last labels must not: each is led away from the corner.
    for text in axes.get_xticklabels():
        text.set_horizontalalignment("right")
    for text in axes.get_yticklabels():
        text.set_horizontalalignment("left")
    for text in axes.get_zticklabels():
        text.set(horizontalalignment="left", verticalalignment="bottom")
    axes.set_box_aspect((1.0, 1.15, look.rise), zoom=0.95)
    axes.view_init(elev=look.elevation, azim=look.azimuth)


def _add(
    axes: Axes3D,
    facets: Facets,
    unit: float,
    faces: FloatArray,
    edges: FloatArray,
    order: int,
) -> None:
    """Add facets, each in its colours."""
    collection = Poly3DCollection(
        _of_one_length(facets) * (1.0, 180 / np.pi, unit),
        facecolors=faces,
        edgecolors=edges,
        linewidths=0.4,
        # No hairlines between black facets.
        antialiaseds=bool(faces[:, :3].any()),
        zorder=order,
        rasterized=True,
    )
    axes.add_collection3d(collection, autolim=False)


def _of_one_length(facets: Facets) -> FloatArray:
    """Return facets as one array, the last corner repeated where one has fewer.

    Matplotlib (3.11) fills up facets of unequal length with uninitialised memory, whose
    projection may overflow.
    """
    longest = max((len(facet) for facet in facets), default=3)
    return np.array(
        [np.pad(f, ((0, longest - len(f)), (0, 0)), mode="edge") for f in facets]
    ).reshape(-1, longest, 3)


def _sizes(facets: Facets) -> FloatArray:
    """Return 1 for the facets of a regular net, less for small ones.

    Lines around them all would darken a dense part of the net.
    """
    spans = [np.ptp(facet[:, :2], axis=0) / (1 / 12, np.pi / 30) for facet in facets]
    least = np.min(np.reshape(spans, (-1, 2)), axis=1)
    return np.asarray(np.clip(least, 0, 1) ** 2)


def _heights(facets: Facets) -> FloatArray:
    return np.concatenate([np.empty((0, 3)), *facets])[:, 2]
