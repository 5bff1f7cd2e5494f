"""The command ``omniplan plan``: a plan from pose to pose, or a scenario."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from omniplan.shell import answers, loading
from omniplan.shell.writing import make_folder, require_file

if TYPE_CHECKING:
    from rich.table import Table

    from omniplan.obstacles import Obstacles
    from omniplan.scenarios import Scenario, Solution

__all__ = ["add_arguments", "plan"]

_OF_A_VEHICLE = ("vehicle", "start", "goal")
_BESIDE_THEM = (
    *("map", "obstacles", "bounds", "clearance", "planner", "method", "heading"),
    *("iterations", "plot"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command.

    Parameters
    ----------
    parser : ArgumentParser
    """
    # Else -1,2,90 is taken for an option: a minus and a digit begin numbers here.
    parser._negative_number_matcher = re.compile(r"^-[\d.]")
    parser.add_argument(
        "--scenario",
        metavar="NAME",
        help="parking, corner, docking, u-turn or pillar, with vehicles of its own",
    )
    parser.add_argument("--vehicle", help="catalogue name or vehicle file")
    pose = {"metavar": "X,Y,DEG"}
    parser.add_argument("--start", help="pose of K: m, m, degrees", **pose)  # type: ignore[arg-type]
    parser.add_argument("--goal", help="likewise", **pose)  # type: ignore[arg-type]
    parser.add_argument(
        "--map", type=Path, metavar="FILE.yaml", help="occupancy map of a map server"
    )
    parser.add_argument(
        "--obstacles",
        type=Path,
        metavar="FILE.json",
        help="polygons: a list of lists of corners, or names to them, m",
    )
    parser.add_argument(
        "--bounds", metavar="X0,Y0,X1,Y1", help="the footprint stays inside, m"
    )
    parser.add_argument(
        "--clearance", type=float, help="distance to keep, m; default 0"
    )
    parser.add_argument("--planner", help="of OMPL; default RRTConnect")
    parser.add_argument(
        "--time", type=float, help="for each search, s; default 5, 60 for scenarios"
    )
    parser.add_argument("--seed", type=int, help="default 1, or that of the scenario")
    parser.add_argument(
        "--iterations",
        type=int,
        help="motions checked at most: with enough time the same seed gives the same "
        "plan",
    )
    parser.add_argument(
        "--method", help="geometric (default), or control: rates as controls"
    )
    parser.add_argument(
        "--heading", help="free (default), or keep: the load keeps its heading"
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FILE|DIR",
        help="the trajectory as .csv or .parquet; of a scenario a folder for "
        "trajectories, picture and animation",
    )
    parser.add_argument(
        "--plot", type=Path, metavar="DIR", help="draw the plan and what validates it"
    )


def plan(options: argparse.Namespace) -> int:
    """Run the command and return its exit code: 1 if there is no plan."""
    from configspace import InvalidInput, Problem

    if options.scenario is not None:
        wrong = [
            Problem(f"--{name}", "given with --scenario", "one of them")
            for name in (*_OF_A_VEHICLE, *_BESIDE_THEM)
            if getattr(options, name) is not None
        ]
        if wrong:
            raise InvalidInput(wrong)
        return _scenario(options)
    missing = [
        Problem(f"--{name}", "missing", "needed without --scenario")
        for name in _OF_A_VEHICLE
        if getattr(options, name) is None
    ]
    if missing:
        raise InvalidInput(missing)
    return _vehicle(options)


def _scenario(options: argparse.Namespace) -> int:
    from omniplan.scenarios import scenario

    task = scenario(options.scenario)
    if options.out is not None:
        make_folder("--out", options.out)
    solutions = list(_solved(task, options))
    written = []
    if options.out is not None:
        written = _written(task, solutions, options.out)
    if options.json:
        answers.print_json(
            {
                "scenario": task.name,
                "solutions": [solution.to_dict() for solution in solutions],
                "written": [str(path) for path in written],
            }
        )
    else:
        answers.open_console().print(_table(task.title, solutions))
        for solution in solutions:
            if not solution.plan.is_found:
                print(solution.plan.message)
        for path in written:
            print(f"wrote {path}")
    return _code(solutions)


def _solved(task: Scenario, options: argparse.Namespace) -> Iterator[Solution]:
    from omniplan.scenarios import solve

    console = answers.progress_console()
    for vehicle in task.vehicles:
        with console.status(f"Planning for {vehicle}"):
            solution = solve(task, vehicle, time=options.time, seed=options.seed)
        yield solution


def _written(task: Scenario, solutions: Sequence[Solution], folder: Path) -> list[Path]:
    from configspace.plot import save_figure
    from omniplan.inputs.files import write_trajectories
    from omniplan.plots.animation import save_animation
    from omniplan.plots.plans import plot_plans

    written = []
    for solution in solutions:
        if solution.plan.trajectory is not None:
            path = folder / f"{task.name}-{solution.vehicle}.csv"
            write_trajectories(path, [solution.plan.trajectory])
            written.append(path)
    picture, film = folder / f"{task.name}.png", folder / f"{task.name}.gif"
    with answers.progress_console().status("Drawing"):
        save_figure(plot_plans(solutions, task.title), picture)
        save_animation(solutions, film, task.title)
    return [*written, picture, film]


def _vehicle(options: argparse.Namespace) -> int:
    from omniplan.inputs.files import write_trajectories
    from omniplan.planning.planner import plan as find
    from omniplan.scenarios import Solution

    start, goal = (_pose(options, name) for name in ("start", "goal"))
    bounds = None
    if options.bounds is not None:
        form = "X0,Y0,X1,Y1: four numbers, m"
        bounds = _numbers("--bounds", options.bounds, 4, form)
    obstacles = _obstacles(options)
    if options.out is not None:
        require_file("--out", options.out, ".csv", ".parquet")
    if options.plot is not None:
        make_folder("--plot", options.plot)
    space = loading.space_of(options.vehicle)
    with answers.progress_console().status("Planning"):
        found = find(
            start,
            goal,
            space,
            obstacles,
            bounds=bounds,
            clearance=0.0 if options.clearance is None else options.clearance,
            planner=options.planner or "RRTConnect",
            time=5.0 if options.time is None else options.time,
            seed=1 if options.seed is None else options.seed,
            iterations=options.iterations,
            method=options.method or "geometric",
            heading=options.heading or "free",
        )
    solution = Solution(space, obstacles, found, ends=(start, goal))
    if options.json:
        answers.print_json(solution.to_dict())
    else:
        print(found.message)
        if solution.swept_area is not None:
            print(f"swept area {solution.swept_area:.2f} m²")
    if found.trajectory is not None and options.out is not None:
        write_trajectories(options.out, [found.trajectory])
        answers.say(f"wrote {options.out}", options.json)
    if options.plot is not None:
        for path in _drawn(solution, options.plot):
            answers.say(f"wrote {path}", options.json)
    return _code([solution])


def _drawn(solution: Solution, folder: Path) -> Iterator[Path]:
    from configspace.plot import save_figure
    from omniplan.plots.pictures import plot_report
    from omniplan.plots.plans import plot_plans

    path = folder / f"plan-{solution.vehicle}.png"
    save_figure(plot_plans([solution]), path)
    yield path
    plan = solution.plan
    if plan.trajectory is not None and plan.report is not None:
        yield from plot_report(plan.report, plan.trajectory, solution.space, folder)


def _obstacles(options: argparse.Namespace) -> Obstacles:
    from omniplan.obstacles import Obstacles

    found = Obstacles()
    if options.map is not None:
        found |= Obstacles.from_map(options.map)
    if options.obstacles is not None:
        found |= Obstacles.from_json(options.obstacles)
    return found


def _pose(options: argparse.Namespace, name: str) -> tuple[float, float, float]:
    form = "X,Y,DEG: three numbers, m, m and degrees"
    x, y, degrees = _numbers(f"--{name}", getattr(options, name), 3, form)
    return x, y, math.radians(degrees)


def _numbers(where: str, text: str, n: int, allowed: str) -> tuple[float, ...]:
    from configspace import InvalidInput, Problem

    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError as error:
        raise InvalidInput(Problem(where, text, allowed)) from error
    if len(values) != n or not all(map(math.isfinite, values)):
        raise InvalidInput(Problem(where, text, allowed))
    return values


def _table(title: str, solutions: Sequence[Solution]) -> Table:
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    table.add_column("vehicle", no_wrap=True)
    for column in ("swept area", "time", "cusps", "stops"):
        table.add_column(column, justify="right")
    for solution in solutions:
        found, area = solution.plan, solution.swept_area
        cells: list[Any] = [f"[red]{found.status.value}[/]", "", "", ""]
        if area is not None:
            cells = [f"{area:.2f} m²", f"{found.duration:.1f} s"]
            cells += [str(found.cusps), str(found.stops)]
        table.add_row(solution.title, *cells)
    return table


def _code(solutions: Sequence[Solution]) -> int:
    is_found = all(solution.plan.is_found for solution in solutions)
    return answers.YES if is_found else answers.NO
