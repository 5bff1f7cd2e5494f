"""The command ``omniplan query``: questions to a server."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from omniplan.shell import answers, loading
from omniplan.shell.arguments import (
    DEFAULT_ENDPOINT,
    add_allow_unreachable,
    add_ranking_arguments,
)

if TYPE_CHECKING:
    from services import Client, Security

__all__ = ["add_arguments", "query"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command.

    Parameters
    ----------
    parser : ArgumentParser
    """
    parser.add_argument("what", choices=list(_QUESTIONS))
    parser.add_argument(
        "trajectories",
        nargs="*",
        type=Path,
        help="CSV, Parquet or VDA 5050 files; what they hold has times",
    )
    parser.add_argument("--vehicle", help="for check and sheet")
    parser.add_argument(
        "--fleet", nargs="+", metavar="VEHICLE", help="for many and select"
    )
    add_ranking_arguments(parser)
    add_allow_unreachable(parser, "for check, many and select")
    parser.add_argument(
        "--online-only", action="store_true", help="for select: vehicles online now"
    )
    parser.add_argument(
        "--output",
        type=Path,
        metavar="FILE",
        help="the file to write: a sheet, or for many the verdicts, FILE.parquet",
    )
    parser.add_argument("--site", default="default", help="default: %(default)s")
    parser.add_argument(
        "--connect",
        nargs="+",
        default=[DEFAULT_ENDPOINT],
        metavar="ENDPOINT",
        help="where servers of the site listen, any may answer; default: "
        f"{DEFAULT_ENDPOINT}",
    )
    parser.add_argument(
        "--timeout", type=float, default=10.0, help="s; default: %(default)s"
    )
    _add_certificates(parser)


def _add_certificates(parser: argparse.ArgumentParser) -> None:
    for name, what in (
        ("ca", "the authority's certificate"),
        ("certificate", "ours"),
        ("key", "its key"),
    ):
        parser.add_argument(
            f"--{name}", type=Path, metavar="FILE.pem", help=f"for tls/: {what}"
        )
    parser.add_argument(
        "--trust",
        nargs="+",
        default=(),
        metavar="NAME",
        help="for tls/: names on the certificates of servers; others are not asked",
    )


def query(options: argparse.Namespace) -> int:
    """Run the command; check, many and select are yes as the commands here are."""
    from configspace import InvalidInput, Problem
    from services import Client

    for name in _NEEDS.get(options.what, ()):
        if not getattr(options, name):
            raise InvalidInput(Problem(f"query {options.what}", f"no {name}", "needed"))
    with Client(
        options.connect,
        site=options.site,
        timeout=options.timeout,
        security=_security(options),
    ) as client:
        return _QUESTIONS[options.what](client, options)


def _security(options: argparse.Namespace) -> Security | None:
    """Return the certificates that are given; all three files or none."""
    from configspace import InvalidInput, Problem
    from services import Roles, Security

    files = {name: getattr(options, name) for name in ("ca", "certificate", "key")}
    if not any(files.values()) and not options.trust:
        return None
    missing = [
        Problem(f"--{name}", "not given", "ca, certificate and key together")
        for name, path in files.items()
        if path is None
    ]
    if missing:
        raise InvalidInput(missing)
    return Security(**files, roles=Roles(servers=tuple(options.trust)))


def _health(client: Client, options: argparse.Namespace) -> int:
    answers.print_json(client.health().model_dump())
    return answers.YES


def _vehicles(client: Client, options: argparse.Namespace) -> int:
    answers.print_names(client.vehicles(), options.json)
    return answers.YES


def _sheet(client: Client, options: argparse.Namespace) -> int:
    client.space(options.vehicle).save(options.output)
    answers.say_written(options.output, options.json)
    return answers.YES


def _check(client: Client, options: argparse.Namespace) -> int:
    reports = client.validate(
        loading.trajectories_of(options.trajectories, None),
        options.vehicle,
        allow_unreachable=options.allow_unreachable,
    )
    return answers.answer_reports(reports, options.json)


def _select(client: Client, options: argparse.Namespace) -> int:
    rankings = client.select(
        loading.trajectories_of(options.trajectories, None),
        options.fleet,
        options.by,
        requirements=options.require,
        allow_unreachable=options.allow_unreachable,
        online_only=options.online_only,
    )
    return answers.answer_rankings(rankings, options.json)


def _many(client: Client, options: argparse.Namespace) -> int:
    """Ask about a whole batch, and write the verdicts."""
    import pyarrow as pa
    import pyarrow.compute as pc
    from pyarrow import parquet
    from rich.progress import Progress

    from configspace import OmniplanError

    trajectories = loading.trajectories_of(options.trajectories, None)
    console = answers.progress_console()
    # Where nobody watches even an invisible bar ends with a blank line.
    is_hidden = not console.is_terminal
    with Progress(console=console, transient=True, disable=is_hidden) as bar:
        task = bar.add_task("Judging", total=None)
        table = client.validate_many(
            trajectories,
            options.fleet,
            allow_unreachable=options.allow_unreachable,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )
    try:
        parquet.write_table(table, options.output)
    except (OSError, pa.ArrowException) as error:
        raise OmniplanError(f"cannot write {options.output}: {error}") from error
    valid = pc.sum(table["valid"]).as_py() or 0
    if options.json:
        found = {"output": str(options.output), "pairs": table.num_rows, "valid": valid}
        answers.print_json(found)
    else:
        print(f"{valid} of {table.num_rows} pairs are valid; wrote {options.output}")
    return answers.YES if valid == table.num_rows else answers.NO


_QUESTIONS: Mapping[str, Callable[[Client, argparse.Namespace], int]] = {
    "health": _health,
    "vehicles": _vehicles,
    "check": _check,
    "many": _many,
    "select": _select,
    "sheet": _sheet,
}
_NEEDS: Mapping[str, tuple[str, ...]] = {
    "check": ("vehicle", "trajectories"),
    "many": ("trajectories", "output"),
    "select": ("trajectories",),
    "sheet": ("vehicle", "output"),
}
