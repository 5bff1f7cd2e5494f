"""Speeds, steering angles and margin over time, with their limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from configspace.omni_curve import components
from configspace.vehicle import SteerableWheel, Vehicle
from omniplan.plots.data import Drive, Mark, telling_wheels
from omniplan.plots.style import BROKEN, plain
from omniplan.report import Report

__all__ = ["draw_times", "panels_of"]

FloatArray = npt.NDArray[np.float64]

ALL_WHEELS = 6
"""More wheels are drawn as a band, and the most telling ones one by one."""
SOME_WHEELS = 4
_STYLES: tuple[Any, ...] = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 2)))
_LIMIT: dict[str, Any] = {"color": BROKEN, "lw": 1.2, "ls": (0, (6, 3))}


def panels_of(drive: Drive) -> int:
    """Return how many panels `draw_times` needs."""
    steers = bool(np.isfinite(drive.alpha).any())
    return 3 + bool(drive.u.size) + steers


def draw_times(
    panels: Sequence[Axes], drive: Drive, report: Report, marks: tuple[Mark, ...]
) -> None:
    """Draw one panel per quantity, from top to bottom.

    Parameters
    ----------
    panels : sequence of Axes
        As many as `panels_of` says, with one axis of time.
    drive : Drive
    report : Report
    marks : tuple of Mark
    """
    left = iter(panels)
    _draw_speed(next(left), drive)
    _draw_yaw_rate(next(left), drive)
    vehicle = drive.space.vehicle
    if vehicle is not None and drive.u.size:
        wheels = telling_wheels(drive, report, _number(drive))
        _draw_rolling(next(left), drive, vehicle, wheels)
        if np.isfinite(drive.alpha).any():
            _draw_steering(next(left), drive, vehicle, wheels)
    _draw_margin(next(left), drive)
    for number, axes in enumerate(panels):
        _shade(axes, marks, with_numbers=number == 0)
        axes.grid(alpha=0.3)
        axes.set_xlim(drive.t[0], drive.t[-1])
    panels[-1].set_xlabel("t [s]")


def _number(drive: Drive) -> int:
    is_few = np.isfinite(drive.u).any(axis=0).sum() <= ALL_WHEELS
    return ALL_WHEELS if is_few else SOME_WHEELS


def _draw_speed(axes: Axes, drive: Drive) -> None:
    """Draw the signed speed of K within what the configuration permits."""
    c = components(np.nan_to_num(drive.kappa_n))[0]
    driven = drive.v_s * c
    _draw_room(axes, drive, drive.v_max * c, driven)
    axes.plot(drive.t, driven, color="black", lw=1.8, label="driven")
    axes.set_ylabel("speed of K\n[m/s]")
    vehicle = drive.space.vehicle
    if vehicle is not None:
        limits = vehicle.limits
        ahead = limits.max_speed or math.inf
        back = min(ahead, limits.max_reverse_speed or math.inf)
        _draw_limits(axes, (ahead, -back), driven)
    _legend(axes)


def _draw_yaw_rate(axes: Axes, drive: Drive) -> None:
    s = components(np.nan_to_num(drive.kappa_n))[1]
    size = drive.v_max * np.degrees(np.abs(s) * drive.space.kappa_g)
    omega = np.degrees(drive.twist[:, 2])
    # Turning left is driving forwards with κ_n > 0 or backwards with κ_n < 0.
    _draw_room(axes, drive, np.where(s < 0, size[::-1], size), omega)
    axes.plot(drive.t, omega, color="black", lw=1.8, label="driven")
    axes.set_ylabel("yaw rate ω\n[°/s]")
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, -1.0), max(high, 1.0))
    vehicle = drive.space.vehicle
    limit = vehicle.limits.max_yaw_rate_deg if vehicle is not None else None
    if limit is not None:
        _draw_limits(axes, (limit, -limit), omega)


def _draw_room(
    axes: Axes, drive: Drive, bounds: FloatArray, driven: FloatArray
) -> None:
    """Shade what v_max permits in the configuration, on the sides that are driven."""
    up, down = bounds
    axes.fill_between(
        drive.t,
        -down if _goes(-driven) else np.zeros_like(down),
        up if _goes(driven) or not _goes(-driven) else np.zeros_like(up),
        color="0.88",
        lw=0,
        label=r"permitted ($v_{\max}$)",
    )
    axes.axhline(0, color="0.4", lw=0.8)


def _goes(values: FloatArray) -> bool:
    """Return whether values are above zero somewhere, rounding aside."""
    return bool(np.nanmax(values, initial=0.0) > 1e-6)


def _draw_rolling(
    axes: Axes, drive: Drive, vehicle: Vehicle, wheels: Sequence[int]
) -> None:
    _draw_wheels(axes, drive, drive.u, wheels)
    limits = {getattr(vehicle.wheels[i], "max_speed", None) for i in wheels}
    _draw_limits(axes, [x for u in limits if u for x in (u, -u)], drive.u)
    axes.set_ylabel("rolling speed\n[m/s]")
    _legend(axes)


def _draw_steering(
    axes: Axes, drive: Drive, vehicle: Vehicle, wheels: Sequence[int]
) -> None:
    alpha = np.degrees(drive.alpha)
    _draw_wheels(axes, drive, alpha, wheels)
    stops: set[float] = set()
    for i in wheels:
        wheel = vehicle.wheels[i]
        if isinstance(wheel, SteerableWheel) and wheel.steering_range_deg is not None:
            stops |= set(wheel.steering_range_deg)
    _draw_limits(axes, sorted(stops), alpha)
    axes.set_ylabel("steering angle α\n[°]")


def _draw_wheels(
    axes: Axes, drive: Drive, values: FloatArray, wheels: Sequence[int]
) -> None:
    """Draw some wheels as lines, and all of them as a band if there are more."""
    ids = drive.space.header.wheel_ids
    known = np.asarray(np.isfinite(values).any(axis=0))
    if np.count_nonzero(known) > len(wheels):
        low = np.min(values[:, known], axis=1)
        high = np.max(values[:, known], axis=1)
        label = f"all {np.count_nonzero(known)} wheels"
        axes.fill_between(drive.t, low, high, color="0.8", lw=0, label=label)
    for number, i in enumerate(wheels):
        if not known[i]:
            continue
        axes.plot(
            drive.t,
            values[:, i],
            ls=_STYLES[number % len(_STYLES)],
            color=f"C{number}",
            lw=1.6,
            label=plain(ids[i], 24),
        )


def _draw_limits(
    axes: Axes, limits: Sequence[float | None], values: FloatArray
) -> None:
    """Draw limits; those far from all values would only flatten the lines.

    So would those of the other sign than all values.
    """
    span = float(np.nanmax(np.abs(values), initial=0.0)) or 1.0
    label: str | None = "limit"
    for limit in limits:
        if limit is None or not math.isfinite(limit) or abs(limit) > 6 * span:
            continue
        if _goes(values * np.sign(limit)):
            axes.axhline(limit, **_LIMIT, label=label)
            label = None


def _draw_margin(axes: Axes, drive: Drive) -> None:
    """Draw the margin of every stretch, what is broken below zero."""
    margin = np.repeat(np.maximum(drive.trace.margin, -1.0), 2)
    axes.plot(drive.t, 100 * margin, color="black", lw=1.5)
    axes.fill_between(drive.t, 0, 100 * margin, where=margin < 0, color=BROKEN)
    axes.axhline(0, **_LIMIT)
    lowest = int(drive.trace.margin.argmin())
    wheel = drive.trace.wheel[lowest]
    name = drive.trace.limit[lowest].lower().replace("_", " ")
    name = name.replace("steer ", "steering ")
    text = f"least: {name}" + (f" of {plain(wheel, 24)}" if wheel else "")
    if drive.trace.margin[lowest] < -1.0:  # cut off, or it would flatten the rest
        text += f", {drive.trace.margin[lowest]:.0%}, cut off at -100%"
    axes.set_title(text, loc="right", fontsize="small", pad=2)
    low = min(-5.0, 100 * float(margin.min()) - 5)
    axes.set(ylabel="margin\n[%]", ylim=(low, 105))


def _shade(axes: Axes, marks: tuple[Mark, ...], *, with_numbers: bool) -> None:
    """Shade when limits are broken."""
    for aside, mark in enumerate(marks):
        violation = mark.violation
        axes.axvspan(
            violation.t_start,
            violation.t_end,
            fc="none",
            ec=BROKEN,
            hatch="////",
            alpha=0.25,
            lw=0,
            zorder=0,
        )
        axes.axvline(violation.t, color=BROKEN, lw=1, zorder=0.5)
        if with_numbers:
            axes.annotate(
                str(mark.number),
                (violation.t, 1),
                xycoords=("data", "axes fraction"),
                xytext=(14 * (aside % 2), 9 + 13 * (aside // 2)),
                textcoords="offset points",
                ha="center",
                va="center",
                fontsize="small",
                fontweight="bold",
                bbox={"boxstyle": "circle,pad=0.15", "fc": "white", "ec": BROKEN},
                annotation_clip=False,
            )


def _legend(axes: Axes) -> None:
    axes.legend(
        loc="center left",
        bbox_to_anchor=(1.0, 0.5),
        fontsize="small",
        frameon=False,
    )
