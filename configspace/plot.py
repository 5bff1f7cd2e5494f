"""Pictures of a permissible space: surface, map, curve and undercarriage sketch.

The one module of the package that imports matplotlib; nothing imports it before a
picture is wanted. Figures are made without pyplot, so there is no global state.
"""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from matplotlib import colormaps, rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, ListedColormap, Normalize
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Polygon, Rectangle, Wedge
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Affine2D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from configspace.errors import InvalidInput, Problem
from configspace.kernels import MIXED
from configspace.limits import Reason
from configspace.omni_curve import components
from configspace.space import PermissibleSpace
from configspace.vehicle import Castor, MecanumWheel, SteerableWheel, Wheel

if TYPE_CHECKING:
    from mpl_toolkits.mplot3d import Axes3D

__all__ = ["plot_curve", "plot_map", "plot_space", "plot_surface", "save_figure"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

MAX_PNG_BYTES = 300_000
"""`save_figure` lowers the resolution of a PNG until it is smaller."""

_KAPPA = r"$\kappa_n$ [1]"
_BETA = r"$\beta$ [°]"
_V_MAX = r"$v_{\max}$ [m/s]"
_BETA_TICKS = (-180, -90, 0, 90, 180)
_MIXED_GREY = "0.6"
_REASONS = {
    Reason.STEER_RANGE: "steering range",
    Reason.SINGULAR: "centre of rotation on the wheel",
    Reason.FIXED_WHEEL: "fixed wheel",
}
# The dark end is cut off: in greyscale no speed may look like the black of "blocked".
_SPEEDS: Colormap = ListedColormap(colormaps["viridis"](np.linspace(0.3, 1.0, 256)))


def plot_surface(space: PermissibleSpace, *, reverse: bool = False) -> Figure:
    """Draw v_max over (κ_n, β) as a surface, the blocked area black on the ground.

    Parameters
    ----------
    space : PermissibleSpace
    reverse : bool
        For v_n < 0 rather than v_n > 0.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        If the vehicle is line-mobile: its space is a curve.

    References
    ----------
    Brenner and Colomb 2022, figures 12 and 13.
    """
    _require_planar(space)
    figure = _new_figure(7.0, 5.2)
    _draw_surface(figure, space, reverse)
    figure.suptitle(_title(space, reverse))
    return figure


def plot_map(space: PermissibleSpace, *, reverse: bool = False) -> Figure:
    """Draw v_max over (κ_n, β) as a colour map with contours, blocked cells black.

    Parameters
    ----------
    space : PermissibleSpace
    reverse : bool
        For v_n < 0 rather than v_n > 0.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        If the vehicle is line-mobile: its space is a curve.

    References
    ----------
    Brenner and Colomb 2022, figure 9.
    """
    _require_planar(space)
    figure = _new_figure(7.0, 5.2)
    _draw_map(figure.add_subplot(), space, reverse)
    figure.suptitle(_title(space, reverse))
    return figure


def plot_curve(space: PermissibleSpace) -> Figure:
    """Draw v_max over κ_n for a line-mobile vehicle, blocked ranges black.

    Driving backwards is drawn where it has limits of its own.

    Parameters
    ----------
    space : PermissibleSpace

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        If the vehicle is not line-mobile.

    References
    ----------
    Brenner and Colomb 2022, section 4.3: a cut through the surface.
    """
    _line_beta(space)
    figure = _new_figure(7.0, 4.2)
    _draw_curve(figure.add_subplot(), space)
    figure.suptitle(_title(space))
    return figure


def plot_space(space: PermissibleSpace) -> Figure:
    """Draw the overview: the space and a sketch of the undercarriage.

    Parameters
    ----------
    space : PermissibleSpace
        Wheels are drawn if its vehicle is known.

    Returns
    -------
    Figure
    """
    if space.line_beta is not None:
        figure = _new_figure(11.0, 4.4)
        parts = _side_by_side(figure, (1.6, 1.0))
        _draw_curve(parts[0].add_subplot(), space)
    else:
        figure = _new_figure(15.0, 4.6)
        parts = _side_by_side(figure, (1.25, 1.2, 1.0))
        _draw_surface(parts[0], space, False)
        _draw_map(parts[1].add_subplot(), space, False)
    _draw_sketch(parts[-1].add_subplot(), space)
    figure.suptitle(_title(space), fontsize="x-large")
    return figure


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
        If the suffix is another one or the file cannot be written.
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
            figure.savefig(buffer, format="png", dpi=dpi)
            if buffer.tell() < MAX_PNG_BYTES:
                break
    try:
        path.write_bytes(buffer.getvalue())
    except OSError as error:
        raise InvalidInput(
            Problem("path", f"{path}: {error.strerror}", "must be writable")
        ) from error


def cell_values(
    space: PermissibleSpace, *, reverse: bool = False
) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Return what the map shows: v_max at the middle of every cell.

    Parameters
    ----------
    space : PermissibleSpace
    reverse : bool

    Returns
    -------
    kappa_n : (k,) float, 1
    beta : (m,) float, rad
    v_max : (k, m) float, m/s
        NaN where blocked.
    mixed : (k, m) bool
        The cells a data sheet alone cannot settle.
    """
    # A coarse table is looked up several times per cell, so the map stays smooth.
    per_row = math.ceil(200 / space.grid.n_kappa)
    per_column = math.ceil(200 / space.grid.n_beta)
    kappa_n = _middles(np.linspace(-2, 2, space.grid.n_kappa * per_row + 1))
    beta = _middles(np.linspace(-np.pi, np.pi, space.grid.n_beta * per_column + 1))
    v_max = space.v_max(kappa_n[:, np.newaxis], beta, reverse=reverse)
    mixed = np.repeat(space.tables.state == MIXED, per_row, axis=0)
    mixed = np.repeat(mixed, per_column, axis=1)
    return kappa_n, beta, np.where(v_max > 0, v_max, np.nan), mixed


def surface_polygons(
    space: PermissibleSpace, *, reverse: bool = False
) -> tuple[list[FloatArray], list[FloatArray]]:
    """Return the facets of the surface and the blocked area beneath.

    A coarse net of nodes, cut along the edge of the blocked area, which is found by
    bisection; so the edge is sharp and no facet falls down to the ground.

    Parameters
    ----------
    space : PermissibleSpace
    reverse : bool

    Returns
    -------
    permitted : list of (p, 3) float
        Corners (κ_n, β, v_max) in 1, rad, m/s; v_max > 0 at each.
    blocked : list of (p, 3) float
        Corners (κ_n, β, 0).
    """
    kappa_n = np.linspace(-2, 2, 49)  # 0 and ±1, where the surface has kinks, are nodes
    beta = np.linspace(-np.pi, np.pi, 61)
    k, b = np.meshgrid(kappa_n, beta, indexing="ij")
    nodes = np.stack([k, b, space.v_max(k, b, reverse=reverse)], axis=-1)
    along_kappa = _crossings(space, nodes[:-1], nodes[1:], reverse)
    along_beta = _crossings(space, nodes[:, :-1], nodes[:, 1:], reverse)
    permitted, blocked = [], []
    for i, j in np.ndindex(kappa_n.size - 1, beta.size - 1):
        # Around the cell: corner, crossing of the side that follows, next corner, ...
        ring = np.array(
            [
                nodes[i, j],
                along_kappa[i, j],
                nodes[i + 1, j],
                along_beta[i + 1, j],
                nodes[i + 1, j + 1],
                along_kappa[i, j + 1],
                nodes[i, j + 1],
                along_beta[i, j],
            ]
        )
        free = ring[:, 2] > 0
        if free.any():
            permitted.append(ring[free])
        if not free[::2].all():
            # A crossing belongs to both, a corner to one.
            ground = ring[~np.isnan(ring[:, 2]) & (~free | (np.arange(8) % 2 == 1))]
            blocked.append(ground * (1.0, 1.0, 0.0))
    return permitted, blocked


def blocked_ranges(space: PermissibleSpace) -> list[tuple[float, float]]:
    """Return the ranges of κ_n that a line-mobile vehicle cannot take.

    Parameters
    ----------
    space : PermissibleSpace
        Of a line-mobile vehicle.

    Returns
    -------
    list of (float, float), 1
        From low to high, as far as they are wider than 0.002.
    """
    kappa_n = np.linspace(-2, 2, 2001)
    nodes = _on_line(space, kappa_n, False)
    edges = _crossings(space, nodes[:-1], nodes[1:], False)[:, 0]
    is_blocked = nodes[:, 2] == 0
    starts = [-2.0] if is_blocked[0] else []
    starts += edges[~is_blocked[:-1] & is_blocked[1:]].tolist()
    ends = edges[is_blocked[:-1] & ~is_blocked[1:]].tolist()
    ends += [2.0] if is_blocked[-1] else []
    return list(zip(starts, ends, strict=True))


def _crossings(
    space: PermissibleSpace, first: FloatArray, second: FloatArray, reverse: bool
) -> FloatArray:
    """Return where lines between nodes cross the edge of the blocked area.

    The last point that is permitted, with its v_max; NaN where nothing is crossed.
    """
    crossing = np.full(first.shape, np.nan)
    cut = (first[..., 2] > 0) != (second[..., 2] > 0)
    starts_free = (first[cut][:, 2] > 0)[:, np.newaxis]
    inside = np.where(starts_free, first[cut], second[cut])
    outside = np.where(starts_free, second[cut], first[cut])
    for _ in range(20):
        middle = (inside + outside) / 2
        middle[:, 2] = space.v_max(middle[:, 0], middle[:, 1], reverse=reverse)
        free = middle[:, 2] > 0
        inside[free] = middle[free]
        outside[~free] = middle[~free]
    crossing[cut] = inside
    return crossing


def _on_line(space: PermissibleSpace, kappa_n: FloatArray, reverse: bool) -> FloatArray:
    """Return the nodes (κ_n, β, v_max) of a line-mobile vehicle, (n, 3)."""
    beta = np.full_like(kappa_n, _line_beta(space))
    v_max = space.v_max(kappa_n, beta, reverse=reverse)
    return np.stack([kappa_n, beta, v_max], axis=-1)


def _middles(edges: FloatArray) -> FloatArray:
    return (edges[:-1] + edges[1:]) / 2


def _require_planar(space: PermissibleSpace) -> None:
    if space.line_beta is not None:
        raise InvalidInput(
            Problem(
                f"space of {space.name}",
                "line-mobile: its space is a curve over κ_n",
                "draw it with plot_curve or plot_space",
            )
        )


def _line_beta(space: PermissibleSpace) -> float:
    if space.line_beta is None:
        raise InvalidInput(
            Problem(
                f"space of {space.name}",
                "not line-mobile: its space is a surface over (κ_n, β)",
                "draw it with plot_surface, plot_map or plot_space",
            )
        )
    return space.line_beta


def _new_figure(width: float, height: float) -> Figure:
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _side_by_side(figure: Figure, widths: tuple[float, ...]) -> list[SubFigure]:
    return list(
        figure.subfigures(1, len(widths), squeeze=False, width_ratios=widths)[0]
    )


def _title(space: PermissibleSpace, reverse: bool = False) -> str:
    name = space.name.replace("$", r"\$")  # not a formula
    way = ""
    if space.line_beta is None and len(space.tables.load) > 1:
        way = ", backwards" if reverse else ", forwards"
    return rf"{name}{way},  $\kappa_g$ = {space.kappa_g:.3g} m$^{{-1}}$"


def _speed_scale(low: float, high: float) -> Normalize:
    # A space of one speed only still needs a scale of some width.
    return Normalize(min(low, high / 2), high)


def _draw_surface(
    figure: Figure | SubFigure, space: PermissibleSpace, reverse: bool
) -> None:
    permitted, blocked = surface_polygons(space, reverse=reverse)
    height = np.array([facet[:, 2].mean() for facet in permitted])
    top = max((float(facet[:, 2].max()) for facet in permitted), default=1.0)
    low = float(height.min()) if height.size else 0.0
    degrees = (1.0, 180 / np.pi, 1.0)
    axes: Axes3D = figure.add_subplot(projection="3d", computed_zorder=False)
    # Seen from above, the surface is always before the ground.
    ground = Poly3DCollection(
        [facet * degrees for facet in blocked],
        facecolors="black",
        edgecolors="black",
        linewidths=0.6,
        antialiaseds=False,  # no hairlines between the facets
        zorder=1,
    )
    colours = _SPEEDS(_speed_scale(low, top)(height))
    # Opaque edges: clear ones would let the black ground shine through the seams.
    edges = colours * (0.8, 0.8, 0.8, 1.0)
    surface = Poly3DCollection(
        [facet * degrees for facet in permitted],
        facecolors=colours,
        edgecolors=edges,
        linewidths=0.4,
        zorder=2,
        rasterized=True,
    )
    for collection in (ground, surface):
        # The limits are set below; taken from facets of unequal length they would be
        # those of uninitialised memory (matplotlib 3.11).
        axes.add_collection3d(collection, autolim=False)
    axes.set(
        xlim=(-2, 2),
        ylim=(-180, 180),
        zlim=(0, top * 1.05),
        xticks=(-2, -1, 0, 1, 2),
        yticks=_BETA_TICKS,
        xlabel=_KAPPA,
        ylabel=_BETA,
        zlabel=_V_MAX,
    )
    axes.zaxis.set_major_locator(MaxNLocator(4))
    axes.set_box_aspect((1.0, 1.15, 0.45), zoom=0.95)
    axes.view_init(elev=46, azim=-32)


def _draw_map(axes: Axes, space: PermissibleSpace, reverse: bool) -> None:
    kappa_n, beta, v_max, mixed = cell_values(space, reverse=reverse)
    degrees = np.degrees(beta)
    free = v_max[~np.isnan(v_max)]
    low, top = (free.min(), free.max()) if free.size else (0.0, 1.0)
    speeds = _SPEEDS.with_extremes(bad="black")
    scale = _speed_scale(float(low), float(top))
    look: dict[str, Any] = {
        "extent": (-2, 2, -180, 180),
        "origin": "lower",
        "aspect": "auto",
        "interpolation": "nearest",
    }
    axes.imshow(np.ma.masked_invalid(v_max).T, cmap=speeds, norm=scale, **look)
    is_mixed = np.ma.masked_where(~mixed, np.ones_like(v_max))
    axes.imshow(is_mixed.T, cmap=ListedColormap([_MIXED_GREY]), **look)
    levels = [v for v in MaxNLocator(6).tick_values(low, top) if low < v < top]
    if levels and top - low > 1e-3 * top:
        lines = axes.contour(
            kappa_n, degrees, v_max.T, levels, colors="black", linewidths=0.7
        )
        labels = axes.clabel(
            lines, fmt="%.3g m/s", fontsize="small", inline=False, colors="black"
        )
        for label in labels:
            if abs(label.get_position()[1]) > 155:  # would be cut off at the frame
                label.remove()
                continue
            label.set_path_effects([withStroke(linewidth=3, foreground="white")])
    axes.set(xlabel=_KAPPA, ylabel=_BETA, xticks=(-2, -1, 0, 1, 2), yticks=_BETA_TICKS)
    _add_radius_axis(axes, space.kappa_g)
    bar = axes.figure.colorbar(ScalarMappable(scale, speeds), ax=axes)
    bar.set_label(_V_MAX)
    keys = [Patch(color="black", label="blocked")] if np.isnan(v_max).any() else []
    if mixed.any():
        keys.append(Patch(color=_MIXED_GREY, label="mixed cells"))
    _legend_below(axes, keys)


def _draw_curve(axes: Axes, space: PermissibleSpace) -> None:
    kappa_n = np.linspace(-2, 2, 2001)
    forward = _on_line(space, kappa_n, False)[:, 2]
    is_two_way = len(space.tables.load) > 1
    backward = _on_line(space, kappa_n, True)[:, 2] if is_two_way else forward
    top = max(float(forward.max()), float(backward.max())) or 1.0
    curve = np.where(forward > 0, forward, np.nan)
    axes.fill_between(kappa_n, 0, curve, color="0.9", linewidth=0)
    label = "forwards" if is_two_way else "forwards and backwards"
    axes.plot(kappa_n, curve, color="C0", linewidth=2, label=label)
    if is_two_way:
        curve = np.where(backward > 0, backward, np.nan)
        axes.plot(kappa_n, curve, "--", color="C1", linewidth=2, label="backwards")
    for number, (start, end) in enumerate(blocked_ranges(space)):
        # Below zero, so that the bar cannot be taken for a speed.
        axes.fill_between(
            [start, end],
            -0.05 * top,
            0,
            color="black",
            linewidth=0,
            zorder=3,
            label="" if number else "blocked",
        )
        if end - start > 0.6:
            _label_range(axes, space, start, end, 0.03 * top)
    axes.axhline(0, color="black", linewidth=0.8)
    axes.set(
        xlim=(-2, 2),
        ylim=(-0.05 * top, 1.1 * top),
        xlabel=_KAPPA,
        ylabel=_V_MAX,
        xticks=np.arange(-2, 2.5, 0.5),
    )
    axes.grid(alpha=0.3)
    _legend_below(axes, axes.get_legend_handles_labels()[0])
    _add_radius_axis(axes, space.kappa_g)


def _label_range(
    axes: Axes, space: PermissibleSpace, start: float, end: float, height: float
) -> None:
    middle = (start + end) / 2
    why, who = space.explain(middle, _line_beta(space))
    reasons = " or ".join(
        _REASONS.get(flag, str(flag.name)) for flag in Reason(int(why))
    )
    wheel = "\n" + space.header.wheel_ids[int(who)] if who >= 0 else ""
    axes.text(
        middle,
        height,
        f"blocked: {reasons}{wheel}",
        parse_math=False,
        ha="center",
        va="bottom",
    )


def _add_radius_axis(axes: Axes, kappa_g: float) -> None:
    """Add the distance from K to the centre of rotation along the top."""
    ticks = np.arange(-2, 2.5, 0.5)
    c, s = components(ticks)
    texts = [
        "∞" if turn == 0 else f"{way / turn / kappa_g + 0.0:.2g}".replace("-", "−")
        for way, turn in zip(c, s, strict=True)
    ]
    top = axes.secondary_xaxis("top")
    top.set_xticks(ticks, texts, fontsize="small")
    top.set_xlabel("turning radius of K [m], positive to the left", fontsize="small")


def _draw_sketch(axes: Axes, space: PermissibleSpace) -> None:
    header = space.header
    wheels = space.vehicle.wheels if space.vehicle is not None else ()
    k_x, k_y = header.reference
    circle = 1 / space.kappa_g
    points = np.array(
        [
            *header.footprint,
            *((wheel.x, wheel.y) for wheel in wheels),
            (k_x - circle, k_y - circle),
            (k_x + circle, k_y + circle),
        ]
    )
    low, high = points.min(axis=0), points.max(axis=0)
    size = float(np.max(high - low))
    if header.footprint:
        axes.add_patch(Polygon(header.footprint, fc="0.95", ec="0.3", lw=1.5))
    axes.add_patch(Circle((k_x, k_y), circle, fc="none", ec="0.4", ls=":"))
    for wheel in wheels:
        _draw_wheel(axes, wheel, 0.13 * size)
    texts = []
    for dx, dy, name in ((1, 0, "x"), (0, 1, "y")):
        tip = (k_x + 0.1 * size * dx, k_y + 0.1 * size * dy)
        axes.annotate(
            "", tip, (k_x, k_y), arrowprops={"arrowstyle": "->", "color": "C3"}
        )
        texts.append(axes.text(*tip, f" {name}", ha="left", va="bottom"))
    axes.plot(k_x, k_y, "o", color="C3", markersize=6, zorder=5)
    texts.append(axes.text(k_x, k_y, "K  ", ha="right", va="top"))
    for text in texts:
        text.set(color="C3", zorder=6)
        text.set_path_effects([withStroke(linewidth=2, foreground="white")])
    _legend_below(axes, _sketch_keys(wheels, circle))
    margin = 0.16 * size
    axes.set(
        xlim=(low[0] - margin, high[0] + margin),
        ylim=(low[1] - margin, high[1] + margin),
        xlabel="x [m], forward",
        ylabel="y [m], left",
        aspect="equal",
    )


def _sketch_keys(wheels: Sequence[Wheel], circle: float) -> list[Artist]:
    text = rf"$1/\kappa_g$ = {circle:.2g} m"
    keys: list[Artist] = [Line2D([], [], color="0.4", ls=":", label=text)]
    if any(isinstance(wheel, SteerableWheel) for wheel in wheels):
        keys.append(Patch(fc="C0", ec="C0", alpha=0.3, label="steering range"))
    return keys


def _legend_below(axes: Axes, handles: Sequence[Artist]) -> None:
    if handles:
        axes.figure.legend(
            handles=handles,
            loc="outside lower center",
            ncols=3,
            fontsize="small",
            frameon=False,
        )


def _draw_wheel(axes: Axes, wheel: Wheel, length: float) -> None:
    place = (wheel.x, wheel.y)
    if isinstance(wheel, Castor):
        axes.add_patch(Circle(place, length / 4, fc="white", ec="black", zorder=3))
        return
    if isinstance(wheel, SteerableWheel):
        least, largest = wheel.steering_range_deg or (0.0, 360.0)
        if largest - least >= 360:
            least, largest = 0.0, 360.0
        axes.add_patch(
            Wedge(place, length, least, largest, fc="C0", ec="C0", alpha=0.3)
        )
    heading = getattr(wheel, "heading_deg", 0.0)
    turn = Affine2D().rotate_deg(heading).translate(*place) + axes.transData
    corner, width = (-length / 2, -length / 5), 0.4 * length
    axes.add_patch(
        Rectangle(
            corner, length, width, fc="0.35", ec="black", transform=turn, zorder=3
        )
    )
    if isinstance(wheel, MecanumWheel):
        _draw_rollers(axes, wheel, length, turn)


def _draw_rollers(axes: Axes, wheel: MecanumWheel, length: float, turn: Any) -> None:
    """Draw the axles of the rollers that are seen from above."""
    # A roller on the ground has its axle at γ; one on top leans the other way.
    y = 0.2 * length
    x = -y * math.copysign(
        min(1.0, 1 / max(abs(math.tan(wheel.roller)), 0.1)), wheel.roller
    )
    for middle in np.linspace(-0.3, 0.3, 4) * length:
        axes.plot(
            (middle - x, middle + x),
            (-y, y),
            color="white",
            linewidth=1,
            transform=turn,
            zorder=4,
        )
