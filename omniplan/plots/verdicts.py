"""Who can drive what, as a picture."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from configspace import InvalidInput, Problem
from configspace.plot_style import new_figure
from omniplan.choosing.faults import Undrivable
from omniplan.choosing.shortfalls import Unfit
from omniplan.plots.style import plain
from omniplan.report import Ranking, Report

__all__ = ["plot_verdicts", "verdict_text", "verdicts"]

_FREE, _REFUSED = "#cdeccd", "#a86a6a"


def plot_verdicts(rankings: Sequence[Ranking]) -> Figure:
    """Draw who can drive what: vehicles down, trajectories across.

    A light cell says how fast the vehicle can be, a hatched one which limit it breaks
    first and with which wheel. The best vehicle of a trajectory has a thick frame.

    Parameters
    ----------
    rankings : sequence of Ranking
        One for each trajectory, as `select` gives them.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        If there is no ranking, or none has a vehicle.
    """
    cells = verdicts(rankings)
    vehicles = sorted({vehicle for vehicle, _ in cells})
    if not vehicles:
        raise InvalidInput(Problem("rankings", "no vehicle", "at least one is needed"))
    names = [ranking.trajectory for ranking in rankings]
    figure = new_figure(2.0 + 1.75 * len(names), 1.5 + 0.75 * len(vehicles))
    axes = figure.add_subplot()
    for row, vehicle in enumerate(vehicles):
        for column, ranking in enumerate(rankings):
            report = cells.get((vehicle, column))
            is_best = ranking.best is not None and ranking.best.vehicle == vehicle
            _draw_cell(axes, column, row, report, is_best)
    axes.set(
        xlim=(-0.5, len(names) - 0.5),
        ylim=(len(vehicles) - 0.5, -0.5),
        xticks=range(len(names)),
        yticks=range(len(vehicles)),
    )
    # Spaces let a long name go over several lines.
    spaced = [name.replace("_", " ").replace("-", " ") for name in names]
    axes.set_xticklabels([textwrap.fill(plain(name), 18) for name in spaced])
    axes.set_yticklabels([plain(vehicle) for vehicle in vehicles])
    axes.tick_params(length=0, top=True, labeltop=True, bottom=False, labelbottom=False)
    axes.spines[:].set_visible(False)
    keys = [
        Patch(fc=_FREE, ec="black", label="can, fastest duration"),
        Patch(fc=_REFUSED, ec="white", hatch="///", label="cannot, first limit"),
        Patch(fc=_FREE, ec="black", lw=2.5, label="best"),
    ]
    figure.legend(handles=keys, loc="outside lower center", ncols=3, frameon=False)
    return figure


def verdicts(
    rankings: Sequence[Ranking],
) -> dict[tuple[str, int], Report | Unfit | Undrivable]:
    """Return what every cell shows, by vehicle and number of the ranking."""
    cells: dict[tuple[str, int], Report | Unfit | Undrivable] = {}
    for column, ranking in enumerate(rankings):
        suitable = [candidate.report for candidate in ranking.suitable]
        for report in (*suitable, *ranking.refused):
            cells[report.vehicle, column] = report
        for unfit in ranking.unfit:
            cells[unfit.vehicle, column] = unfit
        for undrivable in ranking.undrivable:
            cells[undrivable.vehicle, column] = undrivable
    return cells


def verdict_text(report: Report | Unfit | Undrivable) -> str:
    """Return what a cell of the verdicts says.

    Parameters
    ----------
    report : Report, Unfit or Undrivable

    Returns
    -------
    str
        The fastest duration, or the limit that is broken first and its wheel, or the
        requirement that is not met.
    """
    if isinstance(report, Unfit):
        return f"unfit:\n{plain(report.shortfalls[0].requirement, 24)}"
    if isinstance(report, Undrivable):
        if report.fault is None:
            return report.status
        return _limit_text(report.fault.limit, report.fault.wheel)
    if report.valid:
        fastest = report.fastest_duration
        duration = report.duration if fastest is None else fastest
        return f"{duration:.{2 if duration < 9.995 else 1}f} s"
    first = report.headline
    if first is None:
        return "refused"
    return _limit_text(first.limit, first.wheel)


def _limit_text(limit: str, wheel: str | None) -> str:
    name = limit.lower().replace("_", " ").replace("steer ", "steering ")
    return f"{name}\n{plain(wheel or 'vehicle', 22)}"


def _draw_cell(
    axes: Axes,
    column: int,
    row: int,
    report: Report | Unfit | Undrivable | None,
    is_best: bool,
) -> None:
    corner = (column - 0.47, row - 0.44)
    if report is None:
        axes.text(column, row, "not asked", ha="center", va="center", color="0.5")
        return
    cell = Rectangle(corner, 0.94, 0.88, fc=_FREE, ec="black")
    is_suitable = isinstance(report, Report) and report.valid
    if not is_suitable:
        cell.set(facecolor=_REFUSED, edgecolor="white", hatch="///")
    cell.set_linewidth(2.5 if is_best else 0.5)
    axes.add_patch(cell)
    axes.text(
        column,
        row,
        verdict_text(report),
        ha="center",
        va="center",
        fontsize="large" if is_suitable else "small",
        fontweight="bold" if is_best else "normal",
        bbox=None if is_suitable else {"fc": "white", "ec": "none", "pad": 1.5},
    )
