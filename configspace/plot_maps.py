"""Maps over the (κ_n, β) plane and curves over the one parameter that is free."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Colormap, ListedColormap, Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from configspace.limits import Reason
from configspace.omni_curve import components
from configspace.plot_data import blocked_ranges, cell_values, curve_values
from configspace.plot_facets import blocked_polygons
from configspace.plot_style import (
    BETA,
    BETA_TICKS,
    KAPPA,
    KAPPA_TICKS,
    SPEEDS,
    STEPS,
    V_MAX,
    legend_below,
    speed_scale,
)
from configspace.rotation_centre import singular_points
from configspace.space import PermissibleSpace

__all__ = ["draw_blocked", "draw_curve", "draw_map", "draw_tile"]

FloatArray = npt.NDArray[np.float64]

_MIXED_GREY = "0.6"
_REASONS = {
    Reason.STEER_RANGE: "steering range",
    Reason.SINGULAR: "centre of rotation on the wheel",
    Reason.FIXED_WHEEL: "fixed wheel",
}


def draw_map(axes: Axes, space: PermissibleSpace, reverse: bool) -> None:
    """Draw v_max as a colour map with contours, blocked cells black."""
    kappa_n, beta, v_max, mixed = cell_values(space, reverse=reverse)
    free = v_max[~np.isnan(v_max)]
    low, high = (free.min(), free.max()) if free.size else (0.0, 1.0)
    scale = speed_scale(float(low), float(high))
    _show(axes, v_max, scale)
    _overlay(axes, mixed)
    # A sliver of a space has no room for labels.
    if free.size > 0.15 * v_max.size and high - low > 1e-3 * high:
        _draw_contours(axes, kappa_n, beta, v_max, (float(low), float(high)))
    _label_plane(axes)
    _add_radius_axis(axes, space.kappa_g)
    bar = axes.figure.colorbar(ScalarMappable(scale, SPEEDS), ax=axes)
    bar.set_label(V_MAX)
    keys = [Patch(color="black", label="blocked")] if np.isnan(v_max).any() else []
    if mixed.any():
        keys.append(Patch(color=_MIXED_GREY, label="left open by a data sheet"))
    legend_below(axes, keys)


def draw_blocked(axes: Axes, space: PermissibleSpace) -> None:
    """Draw the blocked area and the singular points of steered wheels."""
    blocked = blocked_polygons(space)
    degrees = (1.0, 180 / np.pi)
    axes.add_collection(
        PolyCollection(
            [facet[:, :2] * degrees for facet in blocked],
            facecolors="black",
            edgecolors="black",
            linewidths=0.6,
            joinstyle="round",  # mitres would stick out
        ),
        autolim=False,
    )
    keys: list[Artist] = [Patch(color="black", label="blocked")] if blocked else []
    mark: dict[str, Any] = {
        "marker": "o",
        "markersize": 7,
        "markerfacecolor": "white",
        "markeredgecolor": "C3",
        "markeredgewidth": 1.5,
        "linestyle": "",
    }
    points = singular_points(space.vehicle) if space.vehicle is not None else ()
    for point in points:
        if point.beta is None:
            axes.axvline(point.kappa_n, color="C3", lw=3)
        else:
            axes.plot(point.kappa_n, np.degrees(point.beta), clip_on=False, **mark)
    if points:
        label = "centre of rotation on a steering axis"
        keys.append(Line2D([], [], label=label, **mark))
    axes.set(xlim=(-2, 2), ylim=(-180, 180))
    axes.grid(alpha=0.4)
    axes.set_axisbelow(True)
    _label_plane(axes)
    _add_radius_axis(axes, space.kappa_g)
    legend_below(axes, keys)


def draw_curve(axes: Axes, space: PermissibleSpace) -> None:
    """Draw v_max over κ_n, or over β where the vehicle cannot turn."""
    unit = 180 / np.pi if space.is_translating else 1.0
    along, forward = curve_values(space)
    is_two_way = len(space.tables.load) > 1
    _, backward = curve_values(space, reverse=True)
    top = max((v for v in (*forward, *backward) if v > 0), default=1.0)
    axes.fill_between(along * unit, 0, forward, color="0.9", linewidth=0)
    label = "forwards" if is_two_way else "forwards and backwards"
    axes.plot(along * unit, forward, color="C0", linewidth=2, label=label)
    if is_two_way:
        axes.plot(
            along * unit, backward, "--", color="C1", linewidth=2, label="backwards"
        )
    for number, (start, end) in enumerate(blocked_ranges(space)):
        # Below zero, so that the bar cannot be taken for a speed.
        axes.fill_between(
            [start * unit, end * unit],
            -0.05 * top,
            0,
            color="black",
            linewidth=0,
            zorder=3,
            label="" if number else "blocked",
        )
        if end - start > 0.15 * np.ptp(along):
            _label_range(axes, space, (start, end), unit, 0.03 * top)
    axes.axhline(0, color="black", linewidth=0.8)
    axes.set(ylim=(-0.05 * top, 1.1 * top), ylabel=V_MAX)
    axes.grid(alpha=0.3)
    if space.is_translating:
        axes.set(
            xlim=(-180, 180), xlabel=rf"{BETA} at $\kappa_n$ = 0: translation only"
        )
        axes.set_xticks(np.arange(-180, 181, 45))
    else:
        axes.set(xlim=(-2, 2), xlabel=KAPPA, xticks=np.arange(-2, 2.5, 0.5))
        _add_radius_axis(axes, space.kappa_g)
    legend_below(axes, axes.get_legend_handles_labels()[0])


def draw_tile(axes: Axes, space: PermissibleSpace) -> None:
    """Draw map or curve small, v_max as a share of the vehicle's largest."""
    if space.line_beta is None and not space.is_translating:
        _, _, v_max, _ = cell_values(space)
        # The largest is mostly at κ_n = 0, at the edge of cells.
        straight = space.v_max(0.0, np.linspace(-np.pi, np.pi, 73))
        top = max(np.nanmax(v_max, initial=0.0), straight.max())
        _show(axes, v_max, Normalize(0, top or 1.0), STEPS)
        axes.set(xticks=KAPPA_TICKS, yticks=BETA_TICKS)
    else:
        along, v_max = curve_values(space)
        top = np.nanmax(v_max, initial=0.0)
        share = v_max / (top or 1.0)
        axes.set(xlim=(along[0], along[-1]), ylim=(0, 1.15))
        axes.set(xticks=np.linspace(along[0], along[-1], 5), yticks=(0, 0.5, 1))
        axes.fill_between(along, 0, share, color="0.8", linewidth=0)
        axes.plot(along, share, color="black", linewidth=1)
        for start, end in blocked_ranges(space):
            axes.axvspan(start, end, color="black", linewidth=0)
    axes.tick_params(length=2, labelbottom=False, labelleft=False)
    text = f"{space.name}\n{top:.3g} m/s"
    axes.set_title(text, fontsize=7, parse_math=False, pad=2)


def _show(
    axes: Axes, v_max: FloatArray, scale: Normalize, speeds: Colormap = SPEEDS
) -> None:
    speeds = speeds.with_extremes(bad="black")
    _image(axes, np.ma.masked_invalid(v_max), speeds, scale)


def _overlay(axes: Axes, mixed: npt.NDArray[np.bool_]) -> None:
    grey = ListedColormap([_MIXED_GREY])
    _image(axes, np.ma.masked_where(~mixed, np.ones(mixed.shape)), grey, None)


def _image(
    axes: Axes, values: FloatArray, colours: Colormap, scale: Normalize | None
) -> None:
    axes.imshow(
        values.T,
        cmap=colours,
        norm=scale,
        extent=(-2, 2, -180, 180),
        origin="lower",
        aspect="auto",
        interpolation="nearest",
    )


def _draw_contours(
    axes: Axes,
    kappa_n: FloatArray,
    beta: FloatArray,
    v_max: FloatArray,
    limits: tuple[float, float],
) -> None:
    low, high = limits
    levels = [v for v in MaxNLocator(6).tick_values(low, high) if low < v < high]
    lines = axes.contour(
        kappa_n, np.degrees(beta), v_max.T, levels, colors="black", linewidths=0.7
    )
    labels = axes.clabel(
        lines, fmt="%.3g", fontsize="small", inline=False, colors="black"
    )
    for label in labels:
        x, y = label.get_position()
        if abs(x) > 1.9 or abs(y) > 155:  # would be cut off at the frame
            label.remove()
            continue
        label.set_path_effects([withStroke(linewidth=3, foreground="white")])


def _label_plane(axes: Axes) -> None:
    axes.set(xlabel=KAPPA, ylabel=BETA, xticks=KAPPA_TICKS, yticks=BETA_TICKS)


def _label_range(
    axes: Axes,
    space: PermissibleSpace,
    blocked: tuple[float, float],
    unit: float,
    height: float,
) -> None:
    middle = sum(blocked) / 2
    if space.line_beta is not None:
        why, who = space.explain(middle, space.line_beta)
    else:
        why, who = space.explain(0.0, middle)
    reasons = " or ".join(
        _REASONS.get(flag, str(flag.name)) for flag in Reason(int(why))
    )
    wheel = "\n" + space.header.wheel_ids[int(who)] if who >= 0 else ""
    axes.text(
        middle * unit,
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
