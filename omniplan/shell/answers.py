"""What the command line prints, and the exit code that goes with it."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from rich.console import Console

    from configspace import OmniplanError
    from omniplan.choosing.fitness import Suitability
    from omniplan.report import Ranking, Report
    from omniplan.timing.result import Timing

__all__ = [
    "BAD_INPUT",
    "FAILURE",
    "NO",
    "YES",
    "answer_rankings",
    "answer_reports",
    "answer_suitability",
    "answer_timed",
    "code_of",
    "complain",
    "open_console",
    "print_json",
    "print_names",
    "progress_console",
    "say",
    "say_written",
]

YES, NO, BAD_INPUT, FAILURE = 0, 1, 2, 3

ASKED_WRONGLY = {
    "invalid_input",
    "invalid_message",
    "invalid_trajectory",
    "invalid_vehicle",
    "no_vehicle_file",
    "too_large",
    "unknown_vehicle",
}
"""Codes by which a server says what is bad input here."""


def code_of(error: OmniplanError) -> int:
    """Return the exit code of an error: bad input or failure."""
    from configspace import InvalidInput

    is_input = isinstance(error, InvalidInput)
    return (
        BAD_INPUT if is_input or vars(error).get("code") in ASKED_WRONGLY else FAILURE
    )


def complain(error: Exception, as_json: bool) -> None:
    """Print an error, on standard output where JSON is read there."""
    if as_json:
        print(json.dumps({"error": type(error).__name__, "message": str(error)}))
    else:
        print(f"omniplan: {error}", file=sys.stderr)


def answer_timed(
    timings: Sequence[Timing | None], reports: Sequence[Report], as_json: bool
) -> int:
    """Answer with a report for all that has times; paths also with their timing."""
    from omniplan.wording import report_lines

    judged, found = iter(reports), []
    for timing in timings:
        report = None
        if timing is None or timing.trajectory is not None:
            report = next(judged)
        if not as_json:
            if timing is not None:
                print(f"timed: {timing.message}")
            if report is not None:
                is_timed = timing is not None
                print("\n".join(report_lines(report, is_timed=is_timed)))
        data = {"valid": False} if report is None else report.to_dict()
        found.append(data if timing is None else {**data, "timing": timing.to_dict()})
    if as_json:
        print_json(found)
    return YES if all(one["valid"] for one in found) else NO


def answer_reports(reports: Sequence[Report], as_json: bool) -> int:
    """Answer with verdicts."""
    from omniplan.wording import report_lines

    if as_json:
        print_json([report.to_dict() for report in reports])
    else:
        for report in reports:
            print("\n".join(report_lines(report)))
    return YES if all(report.valid for report in reports) else NO


def answer_rankings(rankings: Sequence[Ranking], as_json: bool) -> int:
    """Answer with rankings; yes if every trajectory has a vehicle."""
    from omniplan.shell.tables import show_ranking

    if as_json:
        print_json([ranking.to_dict() for ranking in rankings])
    else:
        console = open_console()
        for ranking in rankings:
            show_ranking(ranking, console)
    return YES if all(ranking.best for ranking in rankings) else NO


def answer_suitability(answer: Suitability, as_json: bool) -> int:
    """Answer with what meets the requirements."""
    from omniplan.shell.tables import show_suitability

    if as_json:
        print_json(answer.to_dict())
    else:
        show_suitability(answer, open_console())
    return YES if answer.suitable else NO


def open_console() -> Console:
    """Return a console for standard output."""
    from rich.console import Console

    return Console()


def progress_console() -> Console:
    """Return a console for progress bars, on standard error."""
    from rich.console import Console

    return Console(stderr=True)


def say(text: str, as_json: bool) -> None:
    """Print a remark where it does not disturb JSON."""
    print(text, file=sys.stderr if as_json else sys.stdout)


def say_written(path: Path, as_json: bool) -> None:
    """Print which file was written."""
    if as_json:
        print_json({"output": str(path)})
    else:
        print(f"wrote {path}")


def print_names(names: Sequence[str], as_json: bool) -> None:
    """Print names, one a line or as JSON."""
    if as_json:
        print_json(list(names))
    else:
        print("\n".join(names))


def print_json(data: object) -> None:
    """Print data as JSON."""
    print(json.dumps(data, indent=2, allow_nan=False), flush=True)
