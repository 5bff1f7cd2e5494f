"""Draw the figures of this folder: ``make docs``."""

from pathlib import Path

from rich.console import Console

from configspace import build_space, load_vehicle
from omniplan import select
from omniplan.demo import DEMO_FLEET, draw, manoeuvres

if __name__ == "__main__":
    fleet = [build_space(load_vehicle(name)) for name in DEMO_FLEET]
    folder = Path(__file__).parent / "figures"
    draw(select(manoeuvres(), fleet), folder, Console(stderr=True))
