"""The command ``omniplan serve``: a server from flags, variables and a file."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from omniplan.shell import answers, loading
from omniplan.shell.arguments import DEFAULT_ENDPOINT

if TYPE_CHECKING:
    from rich.console import Console

    from configspace import PermissibleSpace
    from services import Server

__all__ = ["add_arguments", "serve"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what overrides the configuration; each dest is a place within that.

    Parameters
    ----------
    parser : ArgumentParser
    """
    parser.add_argument("--config", metavar="FILE", help="TOML; see docs/operation.md")
    parser.add_argument(
        "--fleet",
        nargs="+",
        metavar="VEHICLE",
        help="catalogue names, files or folders of them; default: the whole catalogue",
    )
    parser.add_argument("--site", help="default: default")
    parser.add_argument("--listen", help=f"default: {DEFAULT_ENDPOINT}")
    parser.add_argument("--workers", type=int, help="threads; default: 3")
    parser.add_argument(
        "--allow-insecure",
        action="store_true",
        default=None,
        help="listen beyond this machine without certificates",
    )
    parser.add_argument(
        "--log-level",
        dest="log.level",
        metavar="LEVEL",
        help="debug, info (default), warning, error",
    )
    parser.add_argument(
        "--log-format",
        dest="log.format",
        metavar="FORMAT",
        help="text (default), json",
    )


def serve(options: argparse.Namespace) -> int:
    """Run the command until it is stopped; yes if everything under way was answered."""
    import os
    import signal

    from services.operating import logs
    from services.operating.config import load_config, variables
    from services.operating.launch import registry_of, server_of, settle, warm_up

    file = options.config or os.environ.get("OMNIPLAN_CONFIG")
    flags = {p: getattr(options, p, None) for p in variables().values()}
    config = load_config(file, os.environ, flags)
    logs.configure(config.log.level, config.log.format)
    # As if Ctrl-C were pressed: close() belongs to the main thread, not to a handler.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    console = answers.progress_console()
    fleet = _fleet_of_entries(config.fleet, console)
    _say_getting_ready()
    with console.status("Getting ready"):
        warm_up(fleet)
    with registry_of(config, fleet) as registry:
        settle()
        server = server_of(config, registry)
        server.start()
        try:
            _say_serving(server, options.json)
            with contextlib.suppress(KeyboardInterrupt):
                server.wait()
        finally:
            # A second Ctrl-C ends this, too, and the process with FAILURE.
            is_clean = server.close()
    return answers.YES if is_clean else answers.FAILURE


def _say_getting_ready() -> None:
    """Log why nothing answers for a while: nobody may watch a terminal."""
    import logging

    logging.getLogger(__name__).info(
        "getting ready; the first start compiles kernels, which takes a minute or two"
    )


def _say_serving(server: Server, as_json: bool) -> None:
    vehicles = server.vehicles
    if as_json:
        answers.print_json({"endpoint": server.endpoint, "vehicles": vehicles})
    else:
        print(
            f"serving {len(vehicles)} vehicles at {server.endpoint}, "
            f"site {server.site}; Ctrl-C stops",
            flush=True,
        )


def _fleet_of_entries(
    entries: Sequence[str] | None, console: Console
) -> list[PermissibleSpace]:
    """Return the vehicles of a configuration; a folder stands for all within it."""
    from services.registering.folder import fleet_of_folder

    folders = [entry for entry in entries or () if Path(entry).is_dir()]
    if not folders:
        return loading.fleet_of(entries, console)
    names = [entry for entry in entries or () if entry not in folders]
    spaces = loading.fleet_of(names, console) if names else []
    return [*spaces, *(s for folder in folders for s in fleet_of_folder(folder))]
