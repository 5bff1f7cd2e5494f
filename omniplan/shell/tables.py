"""Rankings and suitability as tables, for people at a terminal."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from omniplan.choosing.fitness import Suitability
from omniplan.choosing.shortfalls import Shortfall, Unfit
from omniplan.report import Candidate, Ranking
from omniplan.wording import refusal

__all__ = ["show_ranking", "show_suitability"]


def show_ranking(ranking: Ranking, console: Console) -> None:
    """Print who can drive a trajectory, best first, and why the others cannot.

    Parameters
    ----------
    ranking : Ranking
    console : Console
    """
    title = f"{ranking.trajectory}, by {ranking.criterion}"
    if ranking.suitable:
        console.print(_ranking_table(title, ranking))
    else:
        console.print(f"{escape(title)}: no vehicle can")
    for report in ranking.refused:
        # soft_wrap: the terminal breaks lines, so that one refusal is one line.
        console.print(
            f"no [bold]{escape(report.vehicle)}[/]: {escape(refusal(report))}",
            soft_wrap=True,
        )
        for advice in report.advice:
            console.print(f"   advice: {escape(advice.text)}", soft_wrap=True)
    for one in ranking.undrivable:
        console.print(
            f"no [bold]{escape(one.vehicle)}[/]: {escape(str(one))}", soft_wrap=True
        )
    _show_unfit(ranking.unfit, console)


def _ranking_table(title: str, ranking: Ranking) -> Table:
    table = Table(title=escape(title), title_justify="left")
    table.add_column("", justify="right")
    table.add_column("vehicle", no_wrap=True)
    table.add_column("at best", justify="right")
    if ranking.criterion not in ("duration", "margin"):
        table.add_column(escape(ranking.criterion), justify="right")
    table.add_column("margin", justify="right")
    table.add_column("tightest limit")
    for place, candidate in enumerate(ranking.suitable, start=1):
        report = candidate.report
        # A valid report always has a fastest duration.
        cells = [
            f"{place}.",
            escape(candidate.vehicle),
            f"{report.fastest_duration:.2f} s",
        ]
        if ranking.criterion not in ("duration", "margin"):
            cells.append(_score(candidate, ranking.criterion))
        table.add_row(*cells, f"{report.margin:.1%}", escape(report.tightest))
    return table


def _score(candidate: Candidate, criterion: str) -> str:
    if criterion == "manoeuvrability":
        return f"{math.degrees(-candidate.score):.1f}°"
    return f"{candidate.score:.4g}"


def show_suitability(suitability: Suitability, console: Console) -> None:
    """Print which vehicles meet requirements, and what the others fall short of.

    Parameters
    ----------
    suitability : Suitability
    console : Console
    """
    if suitability.suitable:
        table = Table()
        table.add_column("meets all requirements", no_wrap=True)
        for name in suitability.suitable:
            table.add_row(escape(name))
        console.print(table)
    else:
        console.print("no vehicle meets all requirements")
    _show_unfit(suitability.unfit, console)


def _show_unfit(unfit: Iterable[Unfit], console: Console) -> None:
    for one in unfit:
        # To the left and to the right it is mostly the same: one line.
        ways: dict[Shortfall, list[str]] = {}
        for short in one.shortfalls:
            ways.setdefault(replace(short, what=""), []).append(short.what)
        for short, what in ways.items():
            line = str(replace(short, what=" and ".join(filter(None, what))))
            text = f"unfit [bold]{escape(one.vehicle)}[/]: {escape(line)}"
            console.print(text, soft_wrap=True)
