"""The command ``omniplan``: its commands and exit codes.

With `omniplan.shell`, where the commands are, the one place where all three packages
meet. Exit codes: 0 yes, 1 no, 2 bad input, 3 failure. Heavy libraries are imported by
the commands that use them, so that ``omniplan --help`` is quick.
"""

from __future__ import annotations

import argparse
import sys
import traceback
from collections.abc import Callable, Sequence
from importlib.metadata import version
from typing import TypeAlias

from omniplan.shell import (
    answers,
    asking,
    checking,
    looking,
    planning,
    selecting,
    serving,
)
from omniplan.shell.answers import FAILURE

__all__ = ["main"]

Run: TypeAlias = Callable[[argparse.Namespace], int]
AddArguments: TypeAlias = Callable[[argparse.ArgumentParser], None]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Default those of the process.
    """
    options = _parser().parse_args(arguments)
    from configspace.errors import OmniplanError

    try:
        return int(options.run(options))
    except OmniplanError as error:
        answers.complain(error, options.json)
        return answers.code_of(error)
    except KeyboardInterrupt:
        answers.complain(InterruptedError("interrupted"), options.json)
        return FAILURE
    except BrokenPipeError:  # the reader, such as head, has seen enough
        sys.stderr.close()
        return FAILURE
    except OSError as error:
        answers.complain(error, options.json)
        return FAILURE
    except Exception as error:
        # A mistake of ours. Python would exit with 1, and that is an answer: no.
        traceback.print_exc()
        answers.complain(error, options.json)
        return FAILURE


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="omniplan",
        description="Which AGV of a mixed fleet can drive which trajectory, how fast, "
        "and why not.",
        epilog="Exit codes: 0 yes, 1 no, 2 bad input, 3 failure.",
    )
    parser.add_argument(
        "--version", action="version", version=f"omniplan {version('omniplan')}"
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for name, run, add_arguments, text in _commands():
        command = commands.add_parser(name, help=text, description=text)
        command.add_argument("--json", action="store_true", help="print JSON")
        command.set_defaults(run=run)
        add_arguments(command)
    return parser


def _commands() -> tuple[tuple[str, Run, AddArguments, str], ...]:
    """Return the name of every command, what it does and takes, and its help."""
    return (
        (
            "demo",
            looking.demo,
            looking.add_demo_arguments,
            "judge a mixed fleet over a real zenoh connection",
        ),
        (
            "inspect",
            looking.inspect,
            looking.add_inspect_arguments,
            "show what a vehicle can do",
        ),
        (
            "check",
            checking.check,
            checking.add_arguments,
            "judge trajectories for one vehicle or for many",
        ),
        (
            "select",
            selecting.select,
            selecting.add_arguments,
            "rank the vehicles of a fleet",
        ),
        (
            "plan",
            planning.plan,
            planning.add_arguments,
            "find a trajectory among obstacles",
        ),
        (
            "serve",
            serving.serve,
            serving.add_arguments,
            "answer questions about a fleet over zenoh",
        ),
        ("query", asking.query, asking.add_arguments, "ask a server"),
        (
            "export",
            looking.export,
            looking.add_export_arguments,
            "write a vehicle's data sheet or its solid",
        ),
        ("schema", looking.schema, looking.add_schema_arguments, "print a JSON Schema"),
        (
            "bench",
            looking.bench,
            looking.add_bench_arguments,
            "measure batches on this machine",
        ),
        ("catalog", looking.catalog, lambda _: None, "list the ready vehicles"),
    )


if __name__ == "__main__":
    sys.exit(main())
