"""Plans as a moving picture: all vehicles start together, on one clock."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.patches import Polygon
from PIL import Image

from configspace import InvalidInput, Problem
from configspace.files import reason_of, whole_file
from omniplan.plots.plan_data import Film, film_of
from omniplan.plots.plans import SWEPT, draw_scene, numbers_of, panels
from omniplan.plots.style import GOAL, PATH, START
from omniplan.scenarios.solving import Solution

__all__ = ["save_animation"]

FloatArray = npt.NDArray[np.float64]

FRAMES_PER_SECOND = 10
DPI, PANEL = 72, 4.0
"""Dots per inch, and inches per panel: the files stay well below a megabyte."""
COLOURS = 48
HOLD = 1.5
"""The last picture stays for so long, s."""
MOST_FRAMES = 150
BETWEEN = 4
"""So many outlines per frame paint what is swept."""


def save_animation(
    solutions: Sequence[Solution],
    path: str | Path,
    title: str = "",
    *,
    speed: float = 2.0,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write a GIF of the plans, side by side.

    Parameters
    ----------
    solutions : sequence of Solution
        At least one; vehicles without a plan stay away.
    path : str or Path
        Ends in ``.gif``.
    title : str
    speed : float, > 0
        So many times as fast as they drive, or more if the film would be too long.
    progress : function, optional
        Called with the frames that are done and their number.

    Raises
    ------
    InvalidInput
        If the suffix is another one or the file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".gif":
        raise InvalidInput(Problem("path", str(path), "must end in .gif"))
    longest = max((one.plan.duration or 0.0 for one in solutions), default=0.0)
    step = max(speed / FRAMES_PER_SECOND, longest / MOST_FRAMES)
    n = int(np.ceil(longest / step)) + 1
    figure, axes = panels(solutions, title, PANEL, below=0.0)
    actors = [_Actor(*each) for each in zip(axes, solutions, strict=True)]
    canvas: Any = FigureCanvasAgg(figure)  # without types
    figure.set_dpi(DPI)
    frames: list[Image.Image] = []
    for i in range(n):
        for actor in actors:
            actor.show(i * step, i * step - step)
        canvas.draw()
        picture = Image.fromarray(np.asarray(canvas.buffer_rgba()).copy())
        frames.append(picture.convert("RGB"))
        if progress is not None:
            progress(i + 1, n)
    _write(frames, path)


class _Actor:
    """One vehicle in its panel."""

    def __init__(self, axes: Axes, solution: Solution) -> None:
        self._axes, self._solution = axes, solution
        draw_scene(axes, solution)
        trajectory = solution.plan.trajectory
        self._duration = 0.0 if trajectory is None else trajectory.duration
        self._moving: list[Artist] = []
        self._film: Film | None = None
        axes.set_xlabel(" ")
        if trajectory is None:
            axes.set_xlabel(numbers_of(solution))
            return
        self._film = film_of(trajectory, solution.space)
        for index, colour in ((0, START), (-1, GOAL)):
            outline = self._film.outlines[index]
            axes.add_patch(
                Polygon(outline, fc="none", ec=colour, lw=1.2, ls="--", zorder=3)
            )
            axes.add_patch(
                Polygon(self._film.noses[index], fc=colour, ec="none", zorder=3)
            )

    def show(self, t: float, before: float) -> None:
        """Show the vehicle at a time; what it has swept since `before` stays."""
        if self._film is None:
            return
        for artist in self._moving:
            artist.remove()
        moments = np.linspace(max(before, 0.0), t, BETWEEN + 1)
        moments = np.minimum(moments, self._duration)
        at = film_at(self._film, moments)
        self._axes.add_collection(_filled(at.outlines, SWEPT, zorder=1))
        line = self._axes.plot(*at.k.T, color=PATH, lw=1.2, zorder=6)
        del line  # the path stays
        body = Polygon(at.outlines[-1], fc="white", ec="black", lw=1.6, zorder=4)
        wheels = _filled(at.wheels[-1], "black", zorder=5)
        nose = Polygon(at.noses[-1], fc="black", ec="none", zorder=5)
        self._axes.add_patch(body)
        self._axes.add_patch(nose)
        self._axes.add_collection(wheels)
        self._moving = [body, nose, wheels]
        now = f"{min(t, self._duration):4.1f} s"
        is_there = t >= self._duration
        self._axes.set_xlabel(numbers_of(self._solution) if is_there else now)


def film_at(film: Film, t: FloatArray) -> Film:
    """Return a film at other moments, between its own ones straight."""

    def between(values: FloatArray) -> FloatArray:
        flat = values.reshape(len(values), -1)
        columns = [np.interp(t, film.t, column) for column in flat.T]
        return np.stack(columns, axis=-1).reshape(len(t), *values.shape[1:])

    shapes = film.outlines, film.wheels, film.noses, film.k
    return Film(t, *map(between, shapes))


def _filled(outlines: FloatArray, colour: str, zorder: float) -> PolyCollection:
    look: dict[str, Any] = {"fc": colour, "ec": colour, "lw": 0.5, "zorder": zorder}
    return PolyCollection(list(outlines), **look)


def _write(frames: Sequence[Image.Image], path: Path) -> None:
    """Write frames with one palette."""
    width, height = frames[0].size
    samples = [frames[0], frames[len(frames) // 2], frames[-1]]
    sheet = Image.new("RGB", (width, height * len(samples)))
    for i, sample in enumerate(samples):
        sheet.paste(sample, (0, i * height))
    palette = sheet.quantize(COLOURS, dither=Image.Dither.NONE)
    small = [
        each.quantize(palette=palette, dither=Image.Dither.NONE) for each in frames
    ]
    each = round(1000 / FRAMES_PER_SECOND)
    durations = [each] * (len(small) - 1) + [each + round(1000 * HOLD)]
    try:
        with whole_file(path) as temporary:
            small[0].save(
                temporary,
                format="GIF",
                save_all=True,
                append_images=small[1:],
                duration=durations,
                loop=0,
                optimize=False,
            )
    except OSError as error:
        raise InvalidInput(
            Problem("path", f"{path}: {reason_of(error)}", "must be writable")
        ) from error
