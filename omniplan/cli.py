"""The command ``omniplan``: the one place where all three packages meet.

Exit codes: 0 yes, 1 no, 2 bad input, 3 failure. Heavy libraries are imported by the
commands that use them, so that ``omniplan --help`` is quick.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

    from configspace import PermissibleSpace
    from omniplan.report import Ranking, Report
    from omniplan.trajectory import Trajectory

__all__ = ["main"]

YES, NO, BAD_INPUT, FAILURE = 0, 1, 2, 3
DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Default those of the process.
    """
    options = _parser().parse_args(arguments)
    from configspace.errors import InvalidInput, OmniplanError

    try:
        return int(options.run(options))
    except InvalidInput as error:
        _complain(error, options.json)
        return BAD_INPUT
    except OmniplanError as error:
        _complain(error, options.json)
        return FAILURE
    except KeyboardInterrupt:
        return FAILURE
    except BrokenPipeError:  # the reader, such as head, has seen enough
        sys.stderr.close()
        return FAILURE


def _complain(error: Exception, as_json: bool) -> None:
    if as_json:
        print(json.dumps({"error": type(error).__name__, "message": str(error)}))
    else:
        print(f"omniplan: {error}", file=sys.stderr)


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

    def command(name: str, run: Any, text: str) -> argparse.ArgumentParser:
        sub = commands.add_parser(name, help=text, description=text)
        sub.add_argument("--json", action="store_true", help="print JSON")
        sub.set_defaults(run=run)
        return sub

    demo = command("demo", _demo, "judge a mixed fleet over a real zenoh connection")
    demo.add_argument(
        "--output", type=Path, default=Path("demo-output"), help="folder for pictures"
    )

    inspect = command("inspect", _inspect, "show what a vehicle can do")
    inspect.add_argument("vehicle", help="catalogue name or vehicle file")
    inspect.add_argument("--plot", type=Path, metavar="DIR", help="draw its space")

    check = command("check", _check, "judge trajectories for one vehicle")
    _trajectory_arguments(check)
    check.add_argument(
        "--vehicle", required=True, help="catalogue name, vehicle file or data sheet"
    )
    check.add_argument("--plot", type=Path, metavar="DIR", help="draw the trajectories")

    select = command("select", _select, "rank the vehicles of a fleet")
    _trajectory_arguments(select)
    select.add_argument(
        "--fleet", nargs="+", metavar="VEHICLE", help="default: the whole catalogue"
    )
    select.add_argument("--by", default="duration", help="duration (default) or margin")

    serve = command("serve", _serve, "answer questions about a fleet over zenoh")
    serve.add_argument(
        "--fleet", nargs="+", metavar="VEHICLE", help="default: the whole catalogue"
    )
    serve.add_argument("--site", default="default")
    serve.add_argument("--listen", default=DEFAULT_ENDPOINT, help="%(default)s")

    query = command("query", _query, "ask a server")
    query.add_argument(
        "what", choices=["health", "vehicles", "check", "select", "sheet"]
    )
    query.add_argument("trajectories", nargs="*", type=Path, help="CSV files")
    query.add_argument("--vehicle", help="for check and sheet")
    query.add_argument("--fleet", nargs="+", metavar="VEHICLE", help="for select")
    query.add_argument("--by", default="duration", help="for select")
    query.add_argument("--output", type=Path, help="for sheet: the file to write")
    query.add_argument("--site", default="default")
    query.add_argument("--connect", default=DEFAULT_ENDPOINT, help="%(default)s")
    query.add_argument("--timeout", type=float, default=10.0, help="%(default)s s")

    export = command("export", _export, "write a vehicle's data sheet or its solid")
    export.add_argument("vehicle", help="catalogue name or vehicle file")
    export.add_argument(
        "output", type=Path, help="FILE.safetensors, or FILE.glb, .stl, .ply for a mesh"
    )

    schema = command("schema", _schema, "print a JSON Schema")
    schema.add_argument("what", choices=["vehicle"])

    command("catalog", _catalog, "list the ready vehicles")
    return parser


def _trajectory_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("trajectories", nargs="+", type=Path, help="CSV files")
    parser.add_argument(
        "--parameters-of",
        metavar="VEHICLE",
        help="the vehicle whose kappa_n, beta, v_n the files hold",
    )


def _demo(options: argparse.Namespace) -> int:
    from omniplan import demo
    from services import Client, Server

    console = _console()
    fleet = _fleet(demo.DEMO_FLEET, console)
    trajectories = demo.manoeuvres()
    with (
        Server(fleet, site="demo", listen="tcp/127.0.0.1:0") as server,
        Client(server.endpoint, site="demo", timeout=60.0) as client,
    ):
        rankings = client.select(trajectories, demo.DEMO_FLEET)
        endpoint = server.endpoint
    if options.json:
        _print_json([ranking.to_dict() for ranking in rankings])
    else:
        console.print(
            f"{len(trajectories)} manoeuvres, {len(fleet)} vehicles, judged over zenoh "
            f"at {endpoint}\n"
        )
        demo.show(rankings, console)
    pictures = demo.draw(rankings, options.output, _progress_console())
    if not options.json:
        console.print(f"Pictures: {', '.join(str(path) for path in pictures)}")
    return YES


def _inspect(options: argparse.Namespace) -> int:
    from omniplan.inspection import inspect_space, inspection_table

    space = _space(options.vehicle)
    facts = inspect_space(space)
    if options.json:
        _print_json(facts)
    else:
        _console().print(inspection_table(space.name, facts))
    if options.plot is not None:
        from configspace.plot import plot_space, save_figure

        options.plot.mkdir(parents=True, exist_ok=True)
        path = options.plot / f"space-{space.name}.png"
        save_figure(plot_space(space), path)
        _say(f"wrote {path}", options.json)
    return YES


def _check(options: argparse.Namespace) -> int:
    from omniplan.validation import validate

    space = _space(options.vehicle)
    trajectories = _trajectories(options.trajectories, options.parameters_of)
    reports = [validate(trajectory, space) for trajectory in trajectories]
    if options.plot is not None:
        from configspace.plot import save_figure
        from omniplan.plot import plot_trajectory

        options.plot.mkdir(parents=True, exist_ok=True)
        for trajectory in trajectories:
            path = options.plot / f"{trajectory.name}.png"
            footprint = space.header.footprint or None
            save_figure(plot_trajectory(trajectory, footprint=footprint), path)
            _say(f"wrote {path}", options.json)
    return _answer_reports(reports, options.json)


def _select(options: argparse.Namespace) -> int:
    from omniplan.fleet import select

    trajectories = _trajectories(options.trajectories, options.parameters_of)
    fleet = _fleet(options.fleet, _progress_console())
    return _answer_rankings(select(trajectories, fleet, options.by), options.json)


def _serve(options: argparse.Namespace) -> int:
    import signal

    from services import Server

    fleet = _fleet(options.fleet, _progress_console())
    # As if Ctrl-C were pressed: close() belongs to the main thread, not to a handler.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with (
        contextlib.suppress(KeyboardInterrupt),
        Server(fleet, site=options.site, listen=options.listen) as server,
    ):
        names = [space.name for space in fleet]
        if options.json:
            _print_json({"endpoint": server.endpoint, "vehicles": names})
        else:
            print(
                f"serving {len(names)} vehicles at {server.endpoint}, "
                f"site {server.site}; Ctrl-C stops",
                flush=True,
            )
        server.wait()
    return YES


def _query(options: argparse.Namespace) -> int:
    from configspace import InvalidInput, Problem
    from services import Client

    needs = {"check": ("vehicle", "trajectories"), "select": ("trajectories",)}
    needs["sheet"] = ("vehicle", "output")
    for name in needs.get(options.what, ()):
        if not getattr(options, name):
            raise InvalidInput(Problem(f"query {options.what}", f"no {name}", "needed"))
    with Client(options.connect, site=options.site, timeout=options.timeout) as client:
        if options.what == "health":
            _print_json(client.health().model_dump())
        elif options.what == "vehicles":
            names = client.vehicles()
            _print_json(names) if options.json else print("\n".join(names))
        elif options.what == "sheet":
            client.space(options.vehicle).save(options.output)
            _say(f"wrote {options.output}", options.json)
        elif options.what == "check":
            trajectories = _trajectories(options.trajectories, None)
            reports = client.validate(trajectories, options.vehicle)
            return _answer_reports(reports, options.json)
        else:
            trajectories = _trajectories(options.trajectories, None)
            rankings = client.select(trajectories, options.fleet, options.by)
            return _answer_rankings(rankings, options.json)
    return YES


def _export(options: argparse.Namespace) -> int:
    space = _space(options.vehicle)
    if options.output.suffix == ".safetensors":
        space.save(options.output)
    else:
        from configspace.mesh import export

        export(space.to_mesh(), options.output)
    _say(f"wrote {options.output}", options.json)
    return YES


def _schema(options: argparse.Namespace) -> int:
    from configspace import vehicle_schema

    _print_json({"vehicle": vehicle_schema}[options.what]())
    return YES


def _catalog(options: argparse.Namespace) -> int:
    from configspace import catalog

    _print_json(catalog()) if options.json else print("\n".join(catalog()))
    return YES


def _space(name: str) -> PermissibleSpace:
    """Return the space of a catalogue name, a vehicle file or a data sheet."""
    from configspace import build_space, load_space, load_vehicle

    if name.endswith(".safetensors"):
        return load_space(name)
    return build_space(load_vehicle(name))


def _fleet(names: Sequence[str] | None, console: Console) -> list[PermissibleSpace]:
    from rich.progress import track

    from configspace import catalog

    chosen = names or catalog()
    return [
        _space(name)
        for name in track(chosen, "Loading spaces", console=console, transient=True)
    ]


def _trajectories(paths: Sequence[Path], parameters_of: str | None) -> list[Trajectory]:
    from configspace import load_vehicle
    from omniplan.trajectory_io import read_trajectories

    vehicle = load_vehicle(parameters_of) if parameters_of else None
    return [found for path in paths for found in read_trajectories(path, vehicle)]


def _answer_reports(reports: Sequence[Report], as_json: bool) -> int:
    from omniplan.wording import report_lines

    if as_json:
        _print_json([report.to_dict() for report in reports])
    else:
        for report in reports:
            print("\n".join(report_lines(report)))
    return YES if all(report.valid for report in reports) else NO


def _answer_rankings(rankings: Sequence[Ranking], as_json: bool) -> int:
    from omniplan.wording import ranking_lines

    if as_json:
        _print_json([ranking.to_dict() for ranking in rankings])
    else:
        for ranking in rankings:
            print("\n".join(ranking_lines(ranking)))
    return YES if all(ranking.best for ranking in rankings) else NO


def _console() -> Console:
    from rich.console import Console

    return Console()


def _progress_console() -> Console:
    from rich.console import Console

    return Console(stderr=True)


def _say(text: str, as_json: bool) -> None:
    """Print a remark where it does not disturb JSON."""
    print(text, file=sys.stderr if as_json else sys.stdout)


def _print_json(data: object) -> None:
    print(json.dumps(data, indent=2, allow_nan=False), flush=True)


if __name__ == "__main__":
    sys.exit(main())
