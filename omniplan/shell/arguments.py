"""Arguments that several commands share."""

from __future__ import annotations

import argparse
from pathlib import Path

__all__ = [
    "DEFAULT_ENDPOINT",
    "VEHICLE",
    "add_allow_unreachable",
    "add_ranking_arguments",
    "add_trajectory_arguments",
]

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
VEHICLE = "catalogue name, vehicle file or data sheet"
"""What may stand for a vehicle."""


def add_trajectory_arguments(
    parser: argparse.ArgumentParser, number: str = "+"
) -> None:
    """Add the files of trajectories and how they are taken.

    Parameters
    ----------
    parser : ArgumentParser
    number : str
        How many files, in words of argparse.
    """
    parser.add_argument(
        "trajectories",
        nargs=number,
        type=Path,
        help="CSV, Parquet or VDA 5050 files: .csv, .parquet, .json",
    )
    parser.add_argument(
        "--parameters-of",
        metavar="VEHICLE",
        help="the vehicle whose kappa_n, beta, v_n the files hold",
    )
    add_allow_unreachable(
        parser,
        "permit motions that no way inside the space leads to from straight ahead",
    )


def add_allow_unreachable(parser: argparse.ArgumentParser, text: str) -> None:
    """Add the switch that permits what no way leads to.

    Parameters
    ----------
    parser : ArgumentParser
    text : str
        Its help.
    """
    parser.add_argument("--allow-unreachable", action="store_true", help=text)


def add_ranking_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what a fleet is ranked by and what is asked of it.

    Parameters
    ----------
    parser : ArgumentParser
    """
    parser.add_argument(
        "--by",
        default="duration",
        help="for select: duration (default), margin or manoeuvrability",
    )
    parser.add_argument(
        "--require",
        action="append",
        default=[],
        metavar="TEXT",
        help="for select: a requirement, in quotes; may be repeated. One of: "
        "turn on the spot [at W deg/s]; crab A deg [at V m/s]; radius R m [at V m/s] "
        "[forwards|backwards|both ways]; speed V m/s [forwards|backwards|both ways]; "
        "payload M kg; footprint L m x W m; no mirroring; passable backwards",
    )
