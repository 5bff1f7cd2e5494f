"""The sketch of an undercarriage, seen from above."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Polygon, Rectangle, Wedge
from matplotlib.patheffects import withStroke
from matplotlib.transforms import Affine2D, Transform

from configspace.plot_data import steering_span, support_polygon, wheel_bodies
from configspace.plot_style import legend_below
from configspace.space import PermissibleSpace
from configspace.vehicle import (
    Castor,
    FixedWheel,
    Load,
    MecanumWheel,
    SteerableWheel,
    Turntable,
    Vehicle,
    Wheel,
)

__all__ = ["draw_sketch"]

_TREAD = 0.4
"""Width of a wheel per length."""
_DRIVEN, _PASSIVE = "0.35", "0.85"
_LOAD = "#8a3ffc"


def draw_sketch(axes: Axes, space: PermissibleSpace) -> None:
    """Draw footprint, K and, as far as they are known, wheels and load.

    Parameters
    ----------
    axes : Axes
    space : PermissibleSpace
    """
    header, vehicle = space.header, space.vehicle
    k_x, k_y = header.reference
    circle = 1 / space.kappa_g
    low, high = _extent(space)
    size = float(np.max(high - low))
    if header.footprint:
        axes.add_patch(Polygon(header.footprint, fc="0.95", ec="0.3", lw=1.5))
    axes.add_patch(Circle((k_x, k_y), circle, fc="none", ec="0.4", ls=":"))
    keys: list[Artist] = [
        Line2D(
            [],
            [],
            color="0.4",
            ls=":",
            label=rf"$1/\kappa_g$ = {circle:.2g} m around K",
        )
    ]
    if vehicle is not None:
        length = _wheel_length(vehicle, size)
        for wheel in vehicle.wheels:
            _draw_wheel(axes, wheel, length)
        keys += _wheel_keys(vehicle.wheels)
        if vehicle.skid_steer is not None:
            keys += _draw_effective_track(axes, vehicle, length)
        if vehicle.load is not None:
            keys += _draw_load(axes, vehicle, vehicle.load, 0.03 * size)
    _draw_frame(axes, k_x, k_y, 0.1 * size)
    legend_below(axes, keys, columns=2)
    margin = 0.07 * size
    axes.set(
        xlim=(low[0] - margin, high[0] + margin),
        ylim=(low[1] - margin, high[1] + margin),
        xlabel="x [m], forward",
        ylabel="y [m], left",
        aspect="equal",
    )


def _extent(
    space: PermissibleSpace,
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return the lower left and the upper right corner of everything drawn."""
    header, vehicle = space.header, space.vehicle
    k_x, k_y = header.reference
    circle = 1 / space.kappa_g
    points = [
        *header.footprint,
        (k_x - circle, k_y - circle),
        (k_x + circle, k_y + circle),
    ]
    for wheel in vehicle.wheels if vehicle is not None else ():
        points += [(place.real, place.imag) for place, _ in wheel_bodies(wheel)]
    for place in vehicle.contacts if vehicle is not None else ():
        points.append((place.real, place.imag))
    corners = np.array(points)
    # Half a wheel may stand out.
    reach = 0.065 * float(np.max(np.ptp(corners, axis=0)))
    return corners.min(axis=0) - reach, corners.max(axis=0) + reach


def _wheel_length(vehicle: Vehicle, size: float) -> float:
    """Return a length of wheels that leaves room between them, m."""
    places = [p for wheel in vehicle.wheels for p, _ in wheel_bodies(wheel)]
    apart = (abs(a - b) for a, b in combinations(places, 2))
    return min([0.13 * size, *(0.85 * d for d in apart if d > 0.01 * size)])


def _draw_frame(axes: Axes, k_x: float, k_y: float, length: float) -> None:
    """Draw K and the directions of x and y."""
    texts = []
    for dx, dy, name in ((1, 0, "x"), (0, 1, "y")):
        tip = (k_x + length * dx, k_y + length * dy)
        arrow = {"arrowstyle": "->", "color": "C3"}
        axes.annotate("", tip, (k_x, k_y), arrowprops=arrow, zorder=6)
        texts.append(axes.text(*tip, f" {name}", ha="left", va="bottom"))
    axes.plot(k_x, k_y, "o", color="C3", markersize=6, zorder=6)
    texts.append(axes.text(k_x, k_y, "K  ", ha="right", va="top"))
    for text in texts:
        text.set(color="C3", zorder=7)
        text.set_path_effects([withStroke(linewidth=2, foreground="white")])


def _draw_wheel(axes: Axes, wheel: Wheel, length: float) -> None:
    place = (wheel.x, wheel.y)
    if isinstance(wheel, Castor):
        axes.add_patch(Circle(place, length / 4, fc="white", ec="black", zorder=3))
        return
    bodies = wheel_bodies(wheel)
    if isinstance(wheel, SteerableWheel):
        _draw_steering(axes, wheel, length)
    face = _DRIVEN if wheel.max_speed is not None else _PASSIVE
    for body, heading in bodies:
        turn = Affine2D().rotate(heading).translate(body.real, body.imag)
        turned = turn + axes.transData
        axes.add_patch(_tread(length, turned, fc=face, ec="black", zorder=3))
        if isinstance(wheel, MecanumWheel):
            _draw_rollers(axes, wheel, length, turned)


def _draw_steering(axes: Axes, wheel: SteerableWheel, length: float) -> None:
    """Draw the range, the axis where a wheel stands beside it, and the plate."""
    x, y = place = (wheel.x, wheel.y)
    reach = max(abs(d) for d in wheel.offsets)
    radius = math.hypot(reach + (_TREAD * length / 2 if reach else 0.0), length / 2)
    middle, half = np.degrees(steering_span(wheel))
    wedge = Wedge(
        place,
        length if not reach else max(1.15 * radius, length),
        middle - half,
        middle + half,
        fc="C0",
        ec="C0",
        alpha=0.3,
    )
    axes.add_patch(wedge)
    if isinstance(wheel, Turntable):
        axes.add_patch(Circle(place, radius, fc="0.9", ec="0.3", zorder=2))
    if reach:
        axle = [body for body, _ in wheel_bodies(wheel)]
        xs, ys = [p.real for p in axle], [p.imag for p in axle]
        axes.plot([x, *xs], [y, *ys], color="black", lw=1.5, zorder=3.5)
        axes.plot(x, y, **_AXIS)


_AXIS: dict[str, Any] = {
    "marker": "o",
    "markersize": 6,
    "markerfacecolor": "black",
    "markeredgecolor": "white",
    "linestyle": "",
    "zorder": 4,
}


def _tread(length: float, turn: Transform, **look: Any) -> Rectangle:
    corner = (-length / 2, -_TREAD * length / 2)
    return Rectangle(corner, length, _TREAD * length, transform=turn, **look)


def _draw_rollers(
    axes: Axes, wheel: MecanumWheel, length: float, turn: Transform
) -> None:
    """Draw the axles of the rollers that are seen from above."""
    # A roller on the ground has its axle at γ; one on top leans the other way.
    y = _TREAD * length / 2
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


def _draw_effective_track(axes: Axes, vehicle: Vehicle, length: float) -> list[Artist]:
    """Draw the differential drive that stands for a skid-steered vehicle."""
    sides = {
        contact: wheel.heading
        for wheel, contact in zip(vehicle.wheels, vehicle.contacts, strict=True)
        if isinstance(wheel, FixedWheel)
    }
    for contact, heading in sides.items():
        turn = Affine2D().rotate(heading).translate(contact.real, contact.imag)
        turned = turn + axes.transData
        axes.add_patch(_tread(length, turned, fc="none", ec="C1", ls="--", zorder=4))
    first, second = list(sides)[:2]
    look: dict[str, Any] = {"color": "C1", "linestyle": "--", "linewidth": 1.2}
    axes.plot([first.real, second.real], [first.imag, second.imag], **look, zorder=4)
    track = f"effective track {abs(first - second):.3g} m"
    return [Line2D([], [], **look, label=track)]


def _draw_load(axes: Axes, vehicle: Vehicle, load: Load, radius: float) -> list[Artist]:
    """Draw the centre of gravity and the polygon it has to stay over."""
    x, y, height = load.center_of_gravity
    outline: dict[str, Any] = {"ec": _LOAD, "ls": "-.", "lw": 1.2}
    axes.add_patch(Polygon(support_polygon(vehicle), fc="none", zorder=2.5, **outline))
    axes.add_patch(Circle((x, y), radius, fc="white", ec=_LOAD, zorder=5))
    for start in (0, 180):
        axes.add_patch(Wedge((x, y), radius, start, start + 90, fc=_LOAD, zorder=5))
    mark: dict[str, Any] = {"marker": "o", "linestyle": "", "mfc": "white"}
    cog = f"centre of gravity, {height:.2g} m high"
    return [
        Line2D([], [], color=_LOAD, label=cog, **mark),
        Line2D([], [], color=_LOAD, ls="-.", lw=1.2, label="support polygon"),
    ]


def _wheel_keys(wheels: Sequence[Wheel]) -> Iterator[Artist]:
    """Yield what the legend says of wheels."""
    steered = [wheel for wheel in wheels if isinstance(wheel, SteerableWheel)]
    if steered:
        yield Patch(fc="C0", ec="C0", alpha=0.3, label="steering range")
    if any(any(wheel.offsets) for wheel in steered):
        yield Line2D([], [], label="steering axis", **_AXIS)
    rolling = [wheel for wheel in wheels if not isinstance(wheel, Castor)]
    if any(wheel.max_speed is None for wheel in rolling):
        yield Patch(fc=_PASSIVE, ec="black", label="wheel without drive")
    if len(rolling) < len(wheels):
        mark: dict[str, Any] = {"marker": "o", "mfc": "white", "linestyle": ""}
        yield Line2D([], [], color="black", label="castor", **mark)
