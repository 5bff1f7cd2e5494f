"""Commands that show what there is: demo, inspect, export, schema, bench, catalog."""

from __future__ import annotations

import argparse
from pathlib import Path

from omniplan.shell import answers, loading
from omniplan.shell.arguments import VEHICLE
from omniplan.shell.writing import make_folder

__all__ = [
    "add_bench_arguments",
    "add_demo_arguments",
    "add_export_arguments",
    "add_inspect_arguments",
    "add_schema_arguments",
    "bench",
    "catalog",
    "demo",
    "export",
    "inspect",
    "schema",
]


def add_demo_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``omniplan demo``."""
    parser.add_argument(
        "--output",
        type=Path,
        default=Path("demo-output"),
        metavar="DIR",
        help="folder for pictures; default: %(default)s",
    )


def demo(options: argparse.Namespace) -> int:
    """Judge a mixed fleet over a real zenoh connection, and draw it."""
    from omniplan.demo import DEMO_FLEET, draw, manoeuvres, show
    from services import Client, Server

    make_folder("--output", options.output)
    console = answers.open_console()
    fleet = loading.fleet_of(DEMO_FLEET, console)
    trajectories = manoeuvres()
    with (
        Server(fleet, site="demo", listen="tcp/127.0.0.1:0") as server,
        Client(server.endpoint, site="demo", timeout=60.0) as client,
    ):
        rankings = client.select(trajectories, DEMO_FLEET)
        endpoint = server.endpoint
    if options.json:
        answers.print_json([ranking.to_dict() for ranking in rankings])
    else:
        console.print(
            f"{len(trajectories)} manoeuvres, {len(fleet)} vehicles, judged over zenoh "
            f"at {endpoint}\n"
        )
        show(rankings, console)
    for path in draw(rankings, options.output, answers.progress_console()):
        answers.say(f"wrote {path}", options.json)
    return answers.YES


def add_inspect_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``omniplan inspect``."""
    parser.add_argument("vehicle", help=VEHICLE)
    parser.add_argument("--plot", type=Path, metavar="DIR", help="draw its space")


def inspect(options: argparse.Namespace) -> int:
    """Show what a vehicle can do."""
    from omniplan.inspection import inspect_space, inspection_table

    if options.plot is not None:
        make_folder("--plot", options.plot)
    space = loading.space_of(options.vehicle)
    facts = inspect_space(space)
    if options.json:
        answers.print_json(facts)
    else:
        answers.open_console().print(inspection_table(space.name, facts))
    if options.plot is not None:
        from configspace.plot import plot_space, save_figure

        path = options.plot / f"space-{space.name}.png"
        save_figure(plot_space(space), path)
        answers.say(f"wrote {path}", options.json)
    return answers.YES


def add_export_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``omniplan export``."""
    parser.add_argument("vehicle", help=VEHICLE)
    parser.add_argument(
        "output", type=Path, help="FILE.safetensors, or FILE.glb, .stl, .ply for a mesh"
    )


def export(options: argparse.Namespace) -> int:
    """Write a vehicle's data sheet or its solid."""
    space = loading.space_of(options.vehicle)
    if options.output.suffix == ".safetensors":
        space.save(options.output)
    else:
        from configspace.mesh import export as export_mesh

        export_mesh(space.to_mesh(), options.output)
    answers.say_written(options.output, options.json)
    return answers.YES


def add_schema_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``omniplan schema``."""
    parser.add_argument(
        "what",
        help="vehicle; service: its configuration; messages: the names of all messages "
        "of the service, or one of them",
    )


def schema(options: argparse.Namespace) -> int:
    """Print a JSON Schema, or the names of those of messages."""
    from configspace import vehicle_schema
    from services.operating.config import service_schema
    from services.schemas import MESSAGES, message_schema

    schemas = {"service": service_schema, "vehicle": vehicle_schema}
    if options.what == "messages":
        answers.print_names(list(MESSAGES), options.json)
    elif options.what in schemas:
        answers.print_json(schemas[options.what]())
    else:
        answers.print_json(message_schema(options.what))
    return answers.YES


def add_bench_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``omniplan bench``."""
    parser.add_argument(
        "--quick", action="store_true", help="a hundredth of the work, less exact"
    )


def bench(options: argparse.Namespace) -> int:
    """Measure how fast batches are on this machine."""
    from omniplan.bench import QUICK, bench_table
    from omniplan.bench import bench as measured

    console = answers.progress_console()
    with console.status("Measuring; takes a minute or two"):
        found = measured(QUICK if options.quick else None)
    if options.json:
        answers.print_json(found)
    else:
        answers.open_console().print(bench_table(found))
    return answers.YES


def catalog(options: argparse.Namespace) -> int:
    """List the ready vehicles."""
    from configspace import catalog as names

    answers.print_names(names(), options.json)
    return answers.YES
