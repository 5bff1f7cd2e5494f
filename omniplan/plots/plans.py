"""Pictures of plans: the way among obstacles, what is swept, and the numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch, Polygon
from matplotlib.path import Path
from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar

from configspace.plot_style import new_figure
from omniplan.motion import stops_of
from omniplan.plots.plan_data import film_of, nose_at, outline_at, spread_along
from omniplan.plots.style import BROKEN, GOAL, PATH, START, plain
from omniplan.scenarios.solving import Solution

__all__ = ["draw_scene", "numbers_of", "panels", "plot_plans"]

FloatArray = npt.NDArray[np.float64]
Bounds = tuple[float, float, float, float]

SWEPT = "#cfe3f2"
OBSTACLE = "0.35"
FOOTPRINT_STEP = 0.3
"""Between two outlines no corner moves much farther than this share of the vehicle."""


def plot_plans(solutions: Sequence[Solution], title: str = "") -> Figure:
    """Draw plans side by side, in one scale.

    Parameters
    ----------
    solutions : sequence of Solution
        At least one; plans that were not found are drawn without a way.
    title : str
    """
    figure, axes = panels(solutions, title)
    for each, solution in zip(axes, solutions, strict=True):
        draw_scene(each, solution)
        _draw_way(each, solution)
        each.set_xlabel(numbers_of(solution), fontsize="medium")
    figure.legend(
        handles=_keys(solutions),
        loc="outside lower center",
        ncols=5,
        frameon=False,
        fontsize="small",
    )
    return figure


def panels(
    solutions: Sequence[Solution],
    title: str,
    width: float = 4.2,
    below: float = 0.35,
) -> tuple[Figure, list[Axes]]:
    """Return a figure with one panel per plan in one scale, and the panels.

    Parameters
    ----------
    solutions : sequence of Solution
    title : str
    width : float
        Of a panel, inches.
    below : float
        Room for a legend, inches.
    """
    x0, y0, x1, y1 = _common(solutions)
    n = len(solutions)
    columns = n if (y1 - y0) > 0.45 * (x1 - x0) or n == 1 else 1
    rows = -(-n // columns)
    wide = width if columns > 1 else 1.6 * width
    tall = wide * (y1 - y0) / (x1 - x0) + 0.5
    figure = new_figure(wide * columns, tall * rows + below + (0.35 if title else 0.0))
    if title:
        figure.suptitle(plain(title, 100), fontweight="bold")
    axes = [figure.add_subplot(rows, columns, i + 1) for i in range(n)]
    for each, solution in zip(axes, solutions, strict=True):
        each.set(xlim=(x0, x1), ylim=(y0, y1), aspect="equal")
        each.set_xticks([])
        each.set_yticks([])
        each.set_title(
            plain(solution.title[:1].upper() + solution.title[1:]), fontsize="medium"
        )
    _draw_scale(axes[0], x1 - x0)
    return figure, axes


def _draw_scale(axes: Axes, width: float) -> None:
    """Draw a bar of a round length, at most a quarter of the width, m."""
    step = 10.0 ** math.floor(math.log10(width / 4))
    length = max(n * step for n in (1, 2, 5) if n * step <= width / 4)
    bar = AnchoredSizeBar(
        axes.transData,
        length,
        f"{length:g} m",
        "lower right",
        pad=0.3,
        borderpad=0.7,
        sep=3,
        size_vertical=0.004 * width,
        prop={"size": "small"},
    )
    bar.patch.set(alpha=0.8, ec="none")
    bar.set_zorder(8)
    axes.add_artist(bar)


def draw_scene(axes: Axes, solution: Solution) -> None:
    """Draw what stands in the hall."""
    for rings in solution.obstacles.rings():
        axes.add_patch(
            PathPatch(_path(rings), fc=OBSTACLE, ec="black", lw=0.6, zorder=2)
        )


def numbers_of(solution: Solution) -> str:
    """Return swept area, time, cusps and stops of a plan, or why there is none."""
    plan = solution.plan
    if plan.trajectory is None:
        return f"no plan: {plan.status.value}"
    cusps = "1 cusp" if plan.cusps == 1 else f"{plan.cusps} cusps"
    stops = "1 stop" if plan.stops == 1 else f"{plan.stops} stops"
    area = solution.swept_area
    return f"{area:.2f} m² swept · {plan.duration:.1f} s · {cusps} · {stops}"


def _draw_way(axes: Axes, solution: Solution) -> None:
    trajectory, swept = solution.plan.trajectory, solution.swept
    if trajectory is None or swept is None:
        _draw_failure(axes, solution)
        return
    axes.add_patch(PathPatch(_path(swept.rings), fc=SWEPT, ec="none", zorder=1))
    film = film_of(trajectory, solution.space)
    size = float(np.ptp(film.outlines[0], axis=0).max())
    chosen = spread_along(film, FOOTPRINT_STEP * size)[1:-1]
    axes.add_collection(
        PolyCollection(
            list(film.outlines[chosen]), fc="none", ec="0.45", lw=0.6, zorder=3
        )
    )
    for index, colour, style in ((0, START, "-"), (-1, GOAL, "-")):
        axes.add_patch(
            Polygon(
                film.outlines[index], fc="none", ec=colour, lw=2, ls=style, zorder=5
            )
        )
        axes.add_collection(
            PolyCollection(list(film.wheels[index]), fc=colour, ec="none", zorder=4)
        )
        axes.add_patch(Polygon(film.noses[index], fc=colour, ec="none", zorder=5))
    axes.plot(*film.k.T, color=PATH, lw=1.4, zorder=6)
    stands = _standstills(solution)
    axes.plot(*stands.T, "o", ms=5, color="white", mec=BROKEN, mew=1.5, zorder=7)


def _draw_failure(axes: Axes, solution: Solution) -> None:
    """Draw start and goal, and where the plan failed."""
    looks = ((START, "-", 2.0), (GOAL, "-", 2.0))
    shown = list(zip(solution.ends, looks, strict=False))
    place = solution.plan.place
    if place is not None:
        shown.append((place, (BROKEN, "--", 1.4)))
        axes.plot(*place[:2], "X", ms=9, color=BROKEN, mec="black", zorder=7)
    for pose, (colour, style, width) in shown:
        outline = outline_at(pose, solution.space)
        axes.add_patch(
            Polygon(outline, fc="none", ec=colour, lw=width, ls=style, zorder=5)
        )
        nose = nose_at(pose, solution.space)
        axes.add_patch(Polygon(nose, fc=colour, ec="none", zorder=5))
        axes.plot(*pose[:2], "+", ms=6, color=colour, mew=1.5, zorder=6)


def _standstills(solution: Solution) -> FloatArray:
    """Return where K stands on the way, (n, 2) m."""
    trajectory = solution.plan.trajectory
    assert trajectory is not None
    samples = trajectory.samples
    stands = stops_of(samples)
    stands[:2] = stands[-2:] = False
    inner = samples[stands, :2]
    far = np.linalg.norm(inner - samples[0, :2], axis=1) > 1e-6
    far &= np.linalg.norm(inner - samples[-1, :2], axis=1) > 1e-6
    return np.asarray(inner[far])


def _keys(solutions: Sequence[Solution]) -> list[Artist]:
    keys: list[Artist] = [
        Patch(fc="none", ec=START, lw=2, label="start"),
        Patch(fc="none", ec=GOAL, lw=2, label="goal"),
        Patch(fc=SWEPT, ec="none", label="swept area"),
        Line2D([], [], color=PATH, lw=1.4, label="path of K"),
    ]
    look = {"marker": "o", "ls": "none", "mfc": "white", "mec": BROKEN, "mew": 1.5}
    if not any(solution.plan.is_found for solution in solutions):
        keys = keys[:2]
    if any(_fails_somewhere(solution) for solution in solutions):
        cross = {"marker": "X", "ls": "none", "mfc": BROKEN, "mec": "black", "ms": 9}
        keys.append(Line2D([], [], label="where it fails", **cross))  # type: ignore[arg-type]
    if any(solution.plan.stops for solution in solutions):
        keys.append(Line2D([], [], label="stop", **look))  # type: ignore[arg-type]
    return keys


def _fails_somewhere(solution: Solution) -> bool:
    return not solution.plan.is_found and solution.plan.place is not None


def _common(solutions: Sequence[Solution]) -> Bounds:
    """Return a box around all that is shown."""
    boxes = [box for solution in solutions for box in _boxes(solution)]
    if not boxes:
        return (-1.0, -1.0, 1.0, 1.0)
    x0, y0, _, _ = np.min(boxes, axis=0).tolist()
    _, _, x1, y1 = np.max(boxes, axis=0).tolist()
    margin = 0.02 * max(x1 - x0, y1 - y0)
    return x0 - margin, y0 - margin, x1 + margin, y1 + margin


def _boxes(solution: Solution) -> list[Bounds]:
    """Return boxes around the way, or start and goal, and what stands around it."""
    hall = solution.obstacles.bounds
    around: list[Bounds] = []
    if solution.swept is not None:
        around.append(solution.swept.bounds)
    else:
        poses = (*solution.ends, solution.plan.place)
        for pose in (pose for pose in poses if pose is not None):
            outline = outline_at(pose, solution.space)
            around.append((*outline.min(axis=0), *outline.max(axis=0)))
    if not around or hall is None:
        return around if hall is None else [hall]
    x0, y0 = np.min(around, axis=0)[:2].tolist()
    x1, y1 = np.max(around, axis=0)[2:].tolist()
    room = max(x1 - x0, y1 - y0)  # what is farther away would make the way tiny
    near = (
        max(hall[0], x0 - room), max(hall[1], y0 - room),
        min(hall[2], x1 + room), min(hall[3], y1 + room),
    )  # fmt: skip
    return [*around, near]


def _path(rings: Sequence[FloatArray]) -> Path:
    return Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))
