"""Pictures of a permissible space: surface, map, curve and undercarriage sketch.

The pictures of the package to import; matplotlib is imported here and in the
``plot_…`` modules that draw the parts, never before a picture is wanted. Figures are
made without pyplot, so there is no global state.
"""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from configspace.plot_data import require_curve, require_plane
from configspace.plot_facets import wheel_index
from configspace.plot_maps import draw_blocked, draw_curve, draw_map, draw_tile
from configspace.plot_sketch import draw_sketch
from configspace.plot_style import STEPS, new_figure, save_figure, side_by_side, title
from configspace.plot_surfaces import (
    draw_rolling_speed,
    draw_steering_angle,
    draw_surface,
)
from configspace.space import PermissibleSpace

__all__ = [
    "plot_blocked",
    "plot_catalog",
    "plot_curve",
    "plot_map",
    "plot_rolling_speed",
    "plot_space",
    "plot_steering_angle",
    "plot_surface",
    "save_figure",
]


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
        If the space is a curve: the vehicle is line-mobile or cannot turn.

    References
    ----------
    Brenner and Colomb 2022, figures 12 and 13.
    """
    require_plane(space)
    figure = new_figure(5.8, 4.3)
    draw_surface(figure, space, reverse)
    figure.suptitle(title(space, reverse=reverse))
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
        If the space is a curve: the vehicle is line-mobile or cannot turn.
    """
    require_plane(space)
    figure = new_figure(7.0, 5.2)
    draw_map(figure.add_subplot(), space, reverse)
    figure.suptitle(title(space, reverse=reverse))
    return figure


def plot_blocked(space: PermissibleSpace) -> Figure:
    """Draw the blocked area of the (κ_n, β) plane alone.

    Parameters
    ----------
    space : PermissibleSpace
        The singular points of steered wheels are marked if its vehicle is known.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        If the space is a curve: the vehicle is line-mobile or cannot turn.

    References
    ----------
    Brenner and Colomb 2022, figure 9.
    """
    require_plane(space)
    figure = new_figure(5.8, 5.0)
    draw_blocked(figure.add_subplot(), space)
    figure.suptitle(_named(space, "blocked configurations"), fontsize="medium")
    return figure


def plot_curve(space: PermissibleSpace) -> Figure:
    """Draw v_max over the one parameter that is free, blocked ranges black.

    That is κ_n for a line-mobile vehicle and β for one that cannot turn. Driving
    backwards is drawn where it has limits of its own.

    Parameters
    ----------
    space : PermissibleSpace

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        If the space is a surface.

    References
    ----------
    Brenner and Colomb 2022, section 4.3: a cut through the surface.
    """
    require_curve(space)
    figure = new_figure(7.0, 4.2)
    draw_curve(figure.add_subplot(), space)
    figure.suptitle(title(space))
    return figure


def plot_steering_angle(space: PermissibleSpace, wheel: int | str) -> Figure:
    """Draw the steering angle of one wheel over (κ_n, β), the blocked area at α = 0.

    At its singular point, the centre of rotation on the wheel, the angle jumps.

    Parameters
    ----------
    space : PermissibleSpace
        With its vehicle.
    wheel : int or str
        Index, from 0, or id.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        If the space is a curve, its vehicle is not known, has no such wheel or the
        wheel does not steer.

    References
    ----------
    Brenner and Colomb 2022, figure 10.
    """
    require_plane(space)
    index = wheel_index(space, wheel)
    figure = new_figure(5.8, 4.6)
    draw_steering_angle(figure, space, index, index + 1)
    what = _named(space, f"steering angle of {_called(space, index)}")
    figure.suptitle(what, fontsize="medium")
    return figure


def plot_rolling_speed(space: PermissibleSpace, wheel: int | str) -> Figure:
    """Draw the rolling speed of one wheel at v_s = 1 m/s over (κ_n, β).

    Parameters
    ----------
    space : PermissibleSpace
        With its vehicle.
    wheel : int or str
        Index, from 0, or id.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        If the space is a curve, its vehicle is not known, has no such wheel or the
        wheel is a castor.

    References
    ----------
    Brenner and Colomb 2022, figure 11.
    """
    require_plane(space)
    index = wheel_index(space, wheel)
    figure = new_figure(5.8, 4.4)
    draw_rolling_speed(figure, space, index, index + 1)
    what = _named(space, f"rolling speed of {_called(space, index)}")
    figure.suptitle(rf"{what}, at $v_s$ = 1 m/s", fontsize="medium")
    return figure


def plot_space(space: PermissibleSpace) -> Figure:
    """Draw the overview: the space and a sketch of the undercarriage.

    Parameters
    ----------
    space : PermissibleSpace
        Wheels and load are drawn if its vehicle is known.

    Returns
    -------
    Figure
    """
    if space.line_beta is not None or space.is_translating:
        figure = new_figure(11.0, 4.4)
        parts = side_by_side(figure, (1.6, 1.0))
        draw_curve(parts[0].add_subplot(), space)
    else:
        figure = new_figure(15.0, 4.6)
        parts = side_by_side(figure, (1.35, 1.2, 1.0))
        draw_surface(parts[0], space, False)
        draw_map(parts[1].add_subplot(), space, False)
    draw_sketch(parts[-1].add_subplot(), space)
    figure.suptitle(title(space), fontsize="x-large")
    return figure


def plot_catalog(spaces: Sequence[PermissibleSpace], columns: int = 8) -> Figure:
    """Draw the spaces of many vehicles small, side by side.

    Maps over (κ_n, β) and curves over the free parameter, each as a share of the
    vehicle's own largest speed, which is written above.

    Parameters
    ----------
    spaces : sequence of PermissibleSpace
        At least one.
    columns : int

    Returns
    -------
    Figure
    """
    rows = -(-len(spaces) // columns)
    figure = new_figure(1.3 * columns + 0.8, 1.35 * rows + 0.8)
    tiles = figure.subplots(rows, columns, squeeze=False)
    for axes, space in zip(tiles.flat, spaces, strict=False):
        draw_tile(axes, space)
    for axes in tiles.flat[len(spaces) :]:
        axes.set_axis_off()
    scale = ScalarMappable(Normalize(0, 1), STEPS)
    bar = figure.colorbar(scale, ax=tiles, aspect=60, fraction=0.02, pad=0.01)
    bar.set_label(
        r"$v_{\max}$ per largest $v_{\max}$ of the vehicle [1]; black: blocked"
    )
    figure.supxlabel(
        r"$\kappa_n$ from −2 to 2 (synchro drive: $\beta$ from −180° to 180°)",
        fontsize="medium",
    )
    figure.supylabel(
        r"maps: $\beta$ from −180° to 180°; curves: $v_{\max}$", fontsize="medium"
    )
    return figure


def _named(space: PermissibleSpace, what: str) -> str:
    return f"{space.name}: {what}".replace("$", r"\$")  # not a formula


def _called(space: PermissibleSpace, index: int) -> str:
    return f"wheel {index + 1} ({space.header.wheel_ids[index]})"
