"""The demonstration: a mixed fleet, eight manoeuvres, one verdict each."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import track
from rich.table import Table

from configspace import PermissibleSpace, build_space, load_vehicle
from omniplan.inputs.files import read_trajectories
from omniplan.report import Ranking, Report
from omniplan.trajectory import Trajectory, timed
from omniplan.wording import refusal

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["DEMO_FLEET", "draw", "manoeuvres", "show"]

DEMO_FLEET = ("ift-four-steered", "mecanum", "ackermann", "differential")


def manoeuvres() -> tuple[Trajectory, ...]:
    """Return the manoeuvres that come with the package, sorted by name."""
    here = Path(__file__).parent
    # In a wheel they lie in the package, in a checkout in the examples.
    folders = (here / "manoeuvres", here.parent / "examples" / "manoeuvres")
    folder = next(folder for folder in folders if folder.is_dir())
    return tuple(
        timed(trajectory)
        for path in sorted(folder.glob("*.csv"))
        for trajectory in read_trajectories(path)
    )


def show(rankings: Sequence[Ranking], console: Console) -> None:
    """Print who can drive what, how fast, and why not.

    Parameters
    ----------
    rankings : sequence of Ranking
    console : Console
    """
    console.print(verdict_table(rankings))
    console.print(
        "Shown are the time and the top speed at the vehicle's own fastest uniform "
        "pace; ★ is the quickest.\n"
    )
    console.print("[bold]Why not[/]")
    for ranking in rankings:
        for report in ranking.refused:
            # Square brackets are markup to rich.
            reason = refusal(report).replace("[", r"\[")
            console.print(f"[bold]{ranking.trajectory}[/], {report.vehicle}: {reason}")
            for advice in report.advice:
                console.print(f"    advice: {advice.text}", style="green")
    console.print()


def verdict_table(rankings: Sequence[Ranking]) -> Table:
    """Return the table of manoeuvres and vehicles."""
    table = Table(
        title="Who can drive what, and how fast", title_justify="left", pad_edge=False
    )
    table.add_column("manoeuvre", no_wrap=True)
    for name in DEMO_FLEET:
        table.add_column(name.replace("-", "-\n", 1), justify="right")
    for ranking in rankings:
        reports = {c.vehicle: c.report for c in ranking.suitable}
        best = ranking.best.vehicle if ranking.best is not None else None
        cells = [_cell(reports.get(name), is_best=name == best) for name in DEMO_FLEET]
        table.add_row(ranking.trajectory, *cells)
    return table


def _cell(report: Report | None, *, is_best: bool) -> str:
    if report is None or report.fastest_duration is None:
        return "[red]no[/]"
    star = "★ " if is_best else ""
    speed = f"{report.top_speed * report.speed_factor:.2f} m/s"
    if report.top_speed < 1e-3:
        rate = math.degrees(report.top_yaw_rate * report.speed_factor)
        speed = f"{rate:.0f} °/s"
    return f"{star}[green]{report.fastest_duration:.1f} s[/]\n{speed}"


def draw(
    rankings: Sequence[Ranking], folder: Path, console: Console
) -> tuple[Path, ...]:
    """Draw the vehicles' spaces, the manoeuvres and the verdicts into a folder.

    Parameters
    ----------
    rankings : sequence of Ranking
    folder : Path
        Created where it does not exist.
    console : Console
        For the progress bar.
    """
    from configspace.plot import save_figure

    folder.mkdir(parents=True, exist_ok=True)
    written = []
    pictures = list(_pictures(rankings))
    for name, make in track(pictures, "Drawing", console=console, transient=True):
        path = folder / f"{name}.png"
        save_figure(make(), path)
        written.append(path)
    return tuple(written)


def _pictures(
    rankings: Sequence[Ranking],
) -> Iterator[tuple[str, Callable[[], Figure]]]:
    from configspace.plot import plot_space
    from omniplan.plots.pictures import plot_manoeuvres, plot_verdicts

    spaces = [build_space(load_vehicle(name)) for name in DEMO_FLEET]
    for space in spaces:
        yield f"space-{space.name}", partial(plot_space, space)
    trajectories = manoeuvres()
    footprints = [_footprint(ranking, spaces) for ranking in rankings]
    yield "manoeuvres", partial(plot_manoeuvres, trajectories, footprints)
    yield "verdicts", partial(plot_verdicts, rankings)


def _footprint(
    ranking: Ranking, spaces: Sequence[PermissibleSpace]
) -> tuple[tuple[float, float], ...] | None:
    """Return the outline of the slowest suitable vehicle, mostly the least agile."""
    if not ranking.suitable:
        return None
    outlines = {space.name: space.header.footprint for space in spaces}
    return outlines[ranking.suitable[-1].vehicle] or None
