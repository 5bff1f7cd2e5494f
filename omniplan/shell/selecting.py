"""The command ``omniplan select``: which vehicle of a fleet."""

from __future__ import annotations

import argparse

from omniplan.shell import answers, loading
from omniplan.shell.arguments import add_ranking_arguments, add_trajectory_arguments

__all__ = ["add_arguments", "select"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command.

    Parameters
    ----------
    parser : ArgumentParser
    """
    add_trajectory_arguments(parser, "*")
    parser.add_argument(
        "--fleet",
        nargs="+",
        metavar="[NAME=]VEHICLE",
        help="after the trajectories; default: the whole catalogue; names tell "
        "vehicles of one type apart",
    )
    add_ranking_arguments(parser)


def select(options: argparse.Namespace) -> int:
    """Run the command; yes if some vehicle can drive each, or meets what is asked."""
    from rich.progress import track

    from configspace import InvalidInput, Problem
    from omniplan.choosing.fitness import requirements_of, suitable
    from omniplan.choosing.fleet import ranked_by

    asked = requirements_of(options.require)
    if not options.trajectories and not asked:
        given = "no trajectory and no --require"
        allowed = "at least one is needed; trajectories stand before --fleet"
        raise InvalidInput(Problem("select", given, allowed))
    motions = loading.motions_of(options.trajectories, options.parameters_of)
    console = answers.progress_console()
    fleet = loading.named_fleet_of(options.fleet, console)
    if not options.trajectories:
        answer = suitable(fleet, asked, allow_unreachable=options.allow_unreachable)
        return answers.answer_suitability(answer, options.json)
    ranked = ranked_by(
        fleet,
        options.by,
        requirements=asked,
        allow_unreachable=options.allow_unreachable,
    )
    progress = track(
        motions,
        "Judging",
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )
    return answers.answer_rankings([ranked(one) for one in progress], options.json)
