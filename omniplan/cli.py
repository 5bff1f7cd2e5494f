"""The command ``omniplan``: the one place where all three packages meet.

Exit codes: 0 yes, 1 no, 2 bad input, 3 failure. Heavy libraries are imported by the
commands that use them, so that ``omniplan --help`` is quick.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import json
import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from omniplan.shell import answers, loading, planning
from omniplan.shell.answers import BAD_INPUT, FAILURE, NO, YES

if TYPE_CHECKING:
    from rich.console import Console

    from configspace import PermissibleSpace
    from services import Client, Security, Server

__all__ = ["main"]

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
    inspect.add_argument("vehicle", help="catalogue name, vehicle file or data sheet")
    inspect.add_argument("--plot", type=Path, metavar="DIR", help="draw its space")

    check = command("check", _check, "judge trajectories for one vehicle or for many")
    _trajectory_arguments(check)
    who = check.add_mutually_exclusive_group(required=True)
    who.add_argument("--vehicle", help="catalogue name, vehicle file or data sheet")
    who.add_argument(
        "--fleet",
        nargs="+",
        metavar="VEHICLE",
        help="several, after the trajectories; needs --out",
    )
    check.add_argument(
        "--out", type=Path, metavar="FILE.parquet", help="for a fleet: the verdicts"
    )
    check.add_argument(
        "--plot", type=Path, metavar="DIR", help="for one: draw the trajectories"
    )

    select = command("select", _select, "rank the vehicles of a fleet")
    _trajectory_arguments(select, "*")
    select.add_argument(
        "--fleet",
        nargs="+",
        metavar="[NAME=]VEHICLE",
        help="after the trajectories; default: the whole catalogue; names tell "
        "vehicles of one type apart",
    )
    _ranking_arguments(select)

    planning.add_arguments(
        command("plan", planning.plan, "find a trajectory among obstacles")
    )

    serve = command("serve", _serve, "answer questions about a fleet over zenoh")
    _serve_arguments(serve)

    query = command("query", _query, "ask a server")
    query.add_argument(
        "what", choices=["health", "vehicles", "check", "many", "select", "sheet"]
    )
    query.add_argument(
        "trajectories", nargs="*", type=Path, help="CSV or Parquet files"
    )
    query.add_argument("--vehicle", help="for check and sheet")
    query.add_argument(
        "--fleet", nargs="+", metavar="VEHICLE", help="for many and select"
    )
    _ranking_arguments(query)
    query.add_argument(
        "--allow-unreachable", action="store_true", help="for check, many and select"
    )
    query.add_argument(
        "--online-only", action="store_true", help="for select: vehicles online now"
    )
    query.add_argument(
        "--output",
        type=Path,
        help="the file to write: a sheet, or for many the verdicts, FILE.parquet",
    )
    query.add_argument("--site", default="default")
    query.add_argument(
        "--connect",
        nargs="+",
        default=[DEFAULT_ENDPOINT],
        metavar="ENDPOINT",
        help=f"where servers of the site listen, any may answer; {DEFAULT_ENDPOINT}",
    )
    query.add_argument("--timeout", type=float, default=10.0, help="%(default)s s")
    _certificate_arguments(query)

    export = command("export", _export, "write a vehicle's data sheet or its solid")
    export.add_argument("vehicle", help="catalogue name, vehicle file or data sheet")
    export.add_argument(
        "output", type=Path, help="FILE.safetensors, or FILE.glb, .stl, .ply for a mesh"
    )

    schema = command("schema", _schema, "print a JSON Schema")
    schema.add_argument(
        "what",
        help="vehicle; service: its configuration; messages: the names of all messages "
        "of the service, or one of them",
    )

    bench = command("bench", _bench, "measure batches on this machine")
    bench.add_argument(
        "--quick", action="store_true", help="a hundredth of the work, less exact"
    )

    command("catalog", _catalog, "list the ready vehicles")
    return parser


def _trajectory_arguments(parser: argparse.ArgumentParser, number: str = "+") -> None:
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
    parser.add_argument(
        "--allow-unreachable",
        action="store_true",
        help="permit motions that no way inside the space leads to from straight ahead",
    )


def _serve_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what overrides the configuration; each dest is a place within that."""
    parser.add_argument("--config", metavar="FILE", help="TOML; see docs/operation.md")
    parser.add_argument(
        "--fleet",
        nargs="+",
        metavar="VEHICLE",
        help="catalogue names, files or folders of them; default: the whole catalogue",
    )
    parser.add_argument("--site", help="default: default")
    parser.add_argument("--listen", help=f"default: {DEFAULT_ENDPOINT}")
    parser.add_argument("--workers", type=int, help="threads; default: 2")
    parser.add_argument(
        "--allow-insecure",
        action="store_true",
        default=None,
        help="listen beyond this machine without certificates",
    )
    parser.add_argument(
        "--log-level", dest="log.level", help="debug, info (default), warning, error"
    )
    parser.add_argument("--log-format", dest="log.format", help="text (default), json")


def _ranking_arguments(parser: argparse.ArgumentParser) -> None:
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


def _demo(options: argparse.Namespace) -> int:
    from omniplan import demo
    from services import Client, Server

    console = answers.open_console()
    fleet = loading.fleet_of(demo.DEMO_FLEET, console)
    trajectories = demo.manoeuvres()
    with (
        Server(fleet, site="demo", listen="tcp/127.0.0.1:0") as server,
        Client(server.endpoint, site="demo", timeout=60.0) as client,
    ):
        rankings = client.select(trajectories, demo.DEMO_FLEET)
        endpoint = server.endpoint
    if options.json:
        answers.print_json([ranking.to_dict() for ranking in rankings])
    else:
        console.print(
            f"{len(trajectories)} manoeuvres, {len(fleet)} vehicles, judged over zenoh "
            f"at {endpoint}\n"
        )
        demo.show(rankings, console)
    pictures = demo.draw(rankings, options.output, answers.progress_console())
    if not options.json:
        console.print(f"Pictures: {', '.join(str(path) for path in pictures)}")
    return YES


def _inspect(options: argparse.Namespace) -> int:
    from omniplan.inspection import inspect_space, inspection_table

    space = loading.space_of(options.vehicle)
    facts = inspect_space(space)
    if options.json:
        answers.print_json(facts)
    else:
        answers.open_console().print(inspection_table(space.name, facts))
    if options.plot is not None:
        from configspace.plot import plot_space, save_figure

        options.plot.mkdir(parents=True, exist_ok=True)
        path = options.plot / f"space-{space.name}.png"
        save_figure(plot_space(space), path)
        answers.say(f"wrote {path}", options.json)
    return YES


def _check(options: argparse.Namespace) -> int:
    from configspace import InvalidInput, Problem
    from omniplan.validation import validate

    if (options.fleet is None) != (options.out is None):
        raise InvalidInput(
            Problem("check", "one of --fleet and --out", "both or none of them")
        )
    if options.fleet is not None:
        _require_table(options.out)
        if options.plot is not None:
            raise InvalidInput(
                Problem("check", "--plot with --fleet", "needs --vehicle")
            )
        return _check_fleet(options)
    space = loading.space_of(options.vehicle)
    motions = loading.motions_of(options.trajectories, options.parameters_of)
    timings = [
        loading.timing_of(motion, space, options.allow_unreachable)
        for motion in motions
    ]
    trajectories = [
        found
        for motion, timing in zip(motions, timings, strict=True)
        if (found := loading.with_times(motion, timing)) is not None
    ]
    reports = [
        validate(trajectory, space, allow_unreachable=options.allow_unreachable)
        for trajectory in trajectories
    ]
    if options.plot is not None:
        from omniplan.plots.pictures import plot_report

        for report, trajectory in zip(reports, trajectories, strict=True):
            for path in plot_report(
                report,
                trajectory,
                space,
                options.plot,
                allow_unreachable=options.allow_unreachable,
            ):
                answers.say(f"wrote {path}", options.json)
    return answers.answer_timed(timings, reports, options.json)


def _require_table(path: Path) -> None:
    """Raise before the work is done if its result cannot be written."""
    from configspace import InvalidInput, Problem

    if path.suffix.lower() != ".parquet":
        raise InvalidInput(Problem("--out", str(path), "must end in .parquet"))
    if not path.parent.is_dir():
        raise InvalidInput(Problem("--out", str(path), "the folder must exist"))


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
    return YES if written.valid == written.pairs else NO


def _select(options: argparse.Namespace) -> int:
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


def _serve(options: argparse.Namespace) -> int:
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
    fleet = _fleet_of_entries(config.fleet, answers.progress_console())
    with answers.progress_console().status("Getting ready"):
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
    return YES if is_clean else FAILURE


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


def _certificate_arguments(command: argparse.ArgumentParser) -> None:
    for name, what in (
        ("ca", "the authority's certificate"),
        ("certificate", "ours"),
        ("key", "its key"),
    ):
        command.add_argument(
            f"--{name}", type=Path, metavar="FILE.pem", help=f"for tls/: {what}"
        )
    command.add_argument(
        "--trust",
        nargs="+",
        default=(),
        metavar="NAME",
        help="for tls/: names on the certificates of servers; others are not asked",
    )


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


def _query(options: argparse.Namespace) -> int:
    from configspace import InvalidInput, Problem
    from services import Client

    needs = {"check": ("vehicle", "trajectories"), "select": ("trajectories",)}
    needs["sheet"] = ("vehicle", "output")
    needs["many"] = ("trajectories", "output")
    for name in needs.get(options.what, ()):
        if not getattr(options, name):
            raise InvalidInput(Problem(f"query {options.what}", f"no {name}", "needed"))
    with Client(
        options.connect,
        site=options.site,
        timeout=options.timeout,
        security=_security(options),
    ) as client:
        if options.what == "health":
            answers.print_json(client.health().model_dump())
        elif options.what == "vehicles":
            names = client.vehicles()
            answers.print_json(names) if options.json else print("\n".join(names))
        elif options.what == "sheet":
            client.space(options.vehicle).save(options.output)
            answers.say_written(options.output, options.json)
        elif options.what == "check":
            trajectories = loading.trajectories_of(options.trajectories, None)
            allow = options.allow_unreachable
            reports = client.validate(
                trajectories, options.vehicle, allow_unreachable=allow
            )
            return answers.answer_reports(reports, options.json)
        elif options.what == "many":
            return _query_many(client, options)
        else:
            trajectories = loading.trajectories_of(options.trajectories, None)
            rankings = client.select(
                trajectories,
                options.fleet,
                options.by,
                requirements=options.require,
                allow_unreachable=options.allow_unreachable,
                online_only=options.online_only,
            )
            return answers.answer_rankings(rankings, options.json)
    return YES


def _query_many(client: Client, options: argparse.Namespace) -> int:
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
    return YES if valid == table.num_rows else NO


def _export(options: argparse.Namespace) -> int:
    space = loading.space_of(options.vehicle)
    if options.output.suffix == ".safetensors":
        space.save(options.output)
    else:
        from configspace.mesh import export

        export(space.to_mesh(), options.output)
    answers.say_written(options.output, options.json)
    return YES


def _schema(options: argparse.Namespace) -> int:
    from configspace import vehicle_schema
    from services.operating.config import service_schema
    from services.schemas import MESSAGES, message_schema

    schemas = {"service": service_schema, "vehicle": vehicle_schema}
    if options.what == "messages":
        answers.print_json(list(MESSAGES)) if options.json else print(
            "\n".join(MESSAGES)
        )
    elif options.what in schemas:
        answers.print_json(schemas[options.what]())
    else:
        answers.print_json(message_schema(options.what))
    return YES


def _bench(options: argparse.Namespace) -> int:
    from omniplan.bench import QUICK, bench, bench_table

    console = answers.progress_console()
    with console.status("Measuring; takes a minute or two"):
        found = bench(QUICK if options.quick else None)
    if options.json:
        answers.print_json(found)
    else:
        answers.open_console().print(bench_table(found))
    return YES


def _catalog(options: argparse.Namespace) -> int:
    from configspace import catalog

    answers.print_json(catalog()) if options.json else print("\n".join(catalog()))
    return YES


if __name__ == "__main__":
    sys.exit(main())
