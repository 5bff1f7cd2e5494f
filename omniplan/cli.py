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

    def command(
        name: str, run: Callable[[argparse.Namespace], int], text: str
    ) -> argparse.ArgumentParser:
        sub = commands.add_parser(name, help=text, description=text)
        sub.add_argument("--json", action="store_true", help="print JSON")
        sub.set_defaults(run=run)
        return sub

    looking.add_demo_arguments(
        command(
            "demo", looking.demo, "judge a mixed fleet over a real zenoh connection"
        )
    )
    looking.add_inspect_arguments(
        command("inspect", looking.inspect, "show what a vehicle can do")
    )
    checking.add_arguments(
        command("check", checking.check, "judge trajectories for one vehicle or many")
    )
    selecting.add_arguments(
        command("select", selecting.select, "rank the vehicles of a fleet")
    )
    planning.add_arguments(
        command("plan", planning.plan, "find a trajectory among obstacles")
    )
    serving.add_arguments(
        command("serve", serving.serve, "answer questions about a fleet over zenoh")
    )
    asking.add_arguments(command("query", asking.query, "ask a server"))
    looking.add_export_arguments(
        command("export", looking.export, "write a vehicle's data sheet or its solid")
    )
    looking.add_schema_arguments(
        command("schema", looking.schema, "print a JSON Schema")
    )
    looking.add_bench_arguments(
        command("bench", looking.bench, "measure batches on this machine")
    )
    command("catalog", looking.catalog, "list the ready vehicles")
    return parser


if __name__ == "__main__":
    sys.exit(main())
