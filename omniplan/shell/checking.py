"""The command ``omniplan check``: trajectories for one vehicle, or for many."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

from omniplan.shell import answers, loading
from omniplan.shell.arguments import VEHICLE, add_trajectory_arguments
from omniplan.shell.writing import make_folder, require_file

__all__ = ["add_arguments", "check"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command.

    Parameters
    ----------
    parser : ArgumentParser
    """
    add_trajectory_arguments(parser)
    who = parser.add_mutually_exclusive_group(required=True)
    who.add_argument("--vehicle", help=VEHICLE)
    who.add_argument(
        "--fleet",
        nargs="+",
        metavar="VEHICLE",
        help="several, after the trajectories; needs --out",
    )
    parser.add_argument(
        "--out", type=Path, metavar="FILE.parquet", help="for a fleet: the verdicts"
    )
    parser.add_argument(
        "--plot", type=Path, metavar="DIR", help="for one: draw the trajectories"
    )


def check(options: argparse.Namespace) -> int:
    """Run the command; yes if every vehicle can drive every trajectory."""
    from configspace import InvalidInput, Problem

    if (options.fleet is None) != (options.out is None):
        raise InvalidInput(
            Problem("check", "one of --fleet and --out", "both or none of them")
        )
    if options.fleet is None:
        return _check_one(options)
    require_file("--out", options.out, ".parquet")
    if options.plot is not None:
        raise InvalidInput(Problem("check", "--plot with --fleet", "needs --vehicle"))
    return _check_fleet(options)


def _check_one(options: argparse.Namespace) -> int:
    from omniplan.validation import validate

    allow = options.allow_unreachable
    if options.plot is not None:
        make_folder("--plot", options.plot)
    space = loading.space_of(options.vehicle)
    motions = loading.motions_of(options.trajectories, options.parameters_of)
    timings = [loading.timing_of(motion, space, allow) for motion in motions]
    trajectories = [
        found
        for motion, timing in zip(motions, timings, strict=True)
        if (found := loading.with_times(motion, timing)) is not None
    ]
    reports = [
        validate(trajectory, space, allow_unreachable=allow)
        for trajectory in trajectories
    ]
    if options.plot is not None:
        from omniplan.plots.pictures import plot_report

        for report, trajectory in zip(reports, trajectories, strict=True):
            for path in plot_report(
                report, trajectory, space, options.plot, allow_unreachable=allow
            ):
                answers.say(f"wrote {path}", options.json)
    return answers.answer_timed(timings, reports, options.json)


def _check_fleet(options: argparse.Namespace) -> int:
    from omniplan.batch.files import write_verdicts
    from omniplan.batch.many import Batch
    from omniplan.batch.paths import PathBatch
    from omniplan.trajectory import Trajectory

    motions = loading.motions_of(options.trajectories, options.parameters_of)
    trajectories = [one for one in motions if isinstance(one, Trajectory)]
    fleet = loading.fleet_of(options.fleet, answers.progress_console())
    allow = options.allow_unreachable
    batch: Batch | PathBatch
    if len(trajectories) == len(motions):
        batch = Batch(trajectories, fleet, allow_unreachable=allow)
    else:
        batch = PathBatch(motions, fleet, allow_unreachable=allow)
    written = write_verdicts(options.out, batch, progress=True)
    if options.json:
        answers.print_json({"output": str(options.out), **dataclasses.asdict(written)})
    else:
        print(
            f"{written.valid} of {written.pairs} pairs are valid; wrote {options.out}"
        )
    return answers.YES if written.valid == written.pairs else answers.NO
