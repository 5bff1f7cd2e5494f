"""Draw the figures of this folder: ``make docs``."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rich.console import Console

from configspace import Grid, build_space, catalog, load_vehicle
from configspace.plot import (
    plot_blocked,
    plot_catalog,
    plot_rolling_speed,
    plot_steering_angle,
    plot_surface,
    save_figure,
)
from omniplan import select
from omniplan.demo import DEMO_FLEET, draw, manoeuvres
from omniplan.plots.animation import save_animation
from omniplan.plots.plans import plot_plans
from omniplan.scenarios import SCENARIOS, solve_all

FOLDER = Path(__file__).parent / "figures"
TILE_GRID = Grid(160, 288)
"""Cells enough for a tile of the catalogue."""


def paper_figures() -> Iterator[tuple[str, Any]]:
    """Yield figures 9 to 13 of Brenner and Colomb 2022."""
    four = build_space(load_vehicle("ift-four-steered"))
    three = build_space(load_vehicle("ift-three-steered"))
    yield "fig09-blocked-map", plot_blocked(four)
    yield "fig10-steering-angle", plot_steering_angle(four, 1)  # W_2
    yield "fig11-rolling-speed", plot_rolling_speed(four, 3)  # W_4
    yield "fig12-v-max", plot_surface(four)
    yield "fig13-v-max-three-steered", plot_surface(three)


def catalogue() -> Any:
    """Return the overview of all vehicles."""
    vehicles = [load_vehicle(name) for name in catalog()]
    return plot_catalog([build_space(v, TILE_GRID, cache=False) for v in vehicles])


def scenarios() -> None:
    """Draw the plans of all scenarios, and a film of figure 1 of the paper."""
    for task in SCENARIOS:
        solutions = list(solve_all(task))
        save_figure(plot_plans(solutions, task.title), FOLDER / f"{task.name}.png")
        if task.name == "parking":
            save_animation(solutions, FOLDER / "parking.gif", task.title)


if __name__ == "__main__":
    fleet = [build_space(load_vehicle(name)) for name in DEMO_FLEET]
    draw(select(manoeuvres(), fleet), FOLDER, Console(stderr=True))
    for name, figure in paper_figures():
        save_figure(figure, FOLDER / f"{name}.png")
    save_figure(catalogue(), FOLDER / "catalog.png")
    scenarios()
