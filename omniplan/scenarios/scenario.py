"""What is asked in each scenario.

All vehicles are platforms of 1.2 m × 0.7 m with their wheels in the same places, so
that what differs is the undercarriage alone. Poses are those of the middle of the
platform, wherever K of a vehicle is.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from types import MappingProxyType
from typing import Literal

from configspace import InvalidInput, PermissibleSpace, Problem, build_space
from configspace.vehicle_io import parse_vehicle

__all__ = ["SCENARIOS", "TITLES", "Scenario", "scenario", "space_of_platform"]

Pose = tuple[float, float, float]
Polygon = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Scenario:
    """A task."""

    name: str
    title: str
    """What the vehicles have to do, for pictures."""
    vehicles: tuple[str, ...]
    """Platforms: names of the files in ``vehicles/``."""
    start: Pose
    """(x, y, θ) of the middle of the platform, m, m, rad."""
    goal: Pose
    obstacles: Mapping[str, Polygon]
    """Corners of every obstacle, m, by name."""
    bounds: tuple[float, float, float, float]
    """(x0, y0, x1, y1) that the platform stays in, m."""
    clearance: float = 0.02
    """Distance kept, m."""
    seed: int = 1
    iterations: int = 4000
    """Motions that are checked in the search of each plan at most."""
    heading: Literal["free", "keep"] = "free"
    """As of `omniplan.plan`."""

    def __post_init__(self) -> None:
        """Keep the obstacles from being changed."""
        object.__setattr__(self, "obstacles", MappingProxyType(dict(self.obstacles)))


def scenario(name: str) -> Scenario:
    """Return a scenario by its name.

    Raises
    ------
    InvalidInput
        If there is none of that name.

    Examples
    --------
    >>> scenario("parking").vehicles
    ('ackermann', 'all-wheel', 'mecanum')
    """
    for each in SCENARIOS:
        if each.name == name:
            return each
    known = [each.name for each in SCENARIOS]
    close = difflib.get_close_matches(name, known, n=1)
    hint = f"did you mean {close[0]}? " if close else ""
    raise InvalidInput(Problem("scenario", name, f"{hint}one of {', '.join(known)}"))


TITLES = {
    "ackermann": "Ackermann steering",
    "all-wheel": "four steered wheels, ±35°",
    "mecanum": "Mecanum wheels",
    "swerve": "four steered wheels, ±155°",
    "synchro": "synchro drive",
}
"""What pictures and tables call the platforms."""


def space_of_platform(name: str) -> PermissibleSpace:
    """Return the space of a platform of the scenarios.

    Parameters
    ----------
    name : str
        As in `Scenario.vehicles`.
    """
    file = resources.files("omniplan.scenarios") / "vehicles" / f"{name}.yaml"
    return build_space(parse_vehicle(file.read_text("utf-8"), f"platform {name}"))


def _box(x0: float, y0: float, x1: float, y1: float) -> Polygon:
    return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))


def _polygon(corners: str) -> Polygon:
    pairs = (corner.split() for corner in corners.split(","))
    return tuple((float(x), float(y)) for x, y in pairs)


_GAP = 2.3
"""Length of the parking gap, m."""
_PARKING = Scenario(
    name="parking",
    title="Parallel parking in a gap of 2.3 m",
    vehicles=("ackermann", "all-wheel", "mecanum"),
    start=(0.0, 0.95, 0.0),
    goal=(0.0, 0.0, 0.0),
    obstacles={
        "kerb": _box(-2.8, -0.75, 2.8, -0.4),
        "vehicle behind": _box(-_GAP / 2 - 1.2, -0.35, -_GAP / 2, 0.35),
        "vehicle ahead": _box(_GAP / 2, -0.35, _GAP / 2 + 1.2, 0.35),
    },
    bounds=(-2.8, -0.75, 2.8, 2.2),
)
_CORNER = Scenario(
    name="corner",
    title="Around the corner of an aisle of 1.5 m",
    vehicles=("ackermann", "all-wheel", "mecanum"),
    start=(-2.2, 0.0, 0.0),
    goal=(1.0, 3.2, math.pi / 2),
    obstacles={
        "rack inside": _box(-3.4, 0.75, 0.25, 4.4),
        "rack outside": _polygon(
            "-3.4 -1.1, 2.1 -1.1, 2.1 4.4, 1.75 4.4, 1.75 -0.75, -3.4 -0.75"
        ),
    },
    bounds=(-3.4, -1.1, 2.1, 4.4),
)
_DOCKING = Scenario(
    name="docking",
    title="Docking sideways in an alcove of 1.4 m",
    vehicles=("swerve", "mecanum"),
    start=(-2.2, 0.0, 0.0),
    goal=(0.6, -0.85, 0.0),
    obstacles={
        "station": _polygon(
            "-3.4 -1.6, 2.4 -1.6, 2.4 -0.5, 1.3 -0.5, "
            "1.3 -1.25, -0.1 -1.25, -0.1 -0.5, -3.4 -0.5"
        ),
        "rack": _box(-3.4, 0.8, 2.4, 1.1),
    },
    bounds=(-3.4, -1.6, 2.4, 1.1),
)
_U_TURN = Scenario(
    name="u-turn",
    title="U-turn in an aisle of 2.2 m",
    vehicles=("ackermann", "all-wheel", "mecanum"),
    start=(0.0, -0.55, 0.0),
    goal=(0.0, 0.55, math.pi),
    obstacles={
        "rack below": _box(-3.0, -1.4, 3.0, -1.1),
        "rack above": _box(-3.0, 1.1, 3.0, 1.4),
    },
    bounds=(-3.0, -1.4, 3.0, 1.4),
)
_PILLAR = Scenario(
    name="pillar",
    title="Around a pillar while the load keeps its heading",
    vehicles=("synchro", "all-wheel", "mecanum"),
    start=(-1.8, 0.0, 0.0),
    goal=(1.8, 0.0, 0.0),
    obstacles={
        "pillar": _box(-0.25, -0.25, 0.25, 0.25),
        "rack": _box(-3.0, -1.4, 3.0, -0.7),
    },
    bounds=(-3.0, -1.4, 3.0, 1.6),
    heading="keep",
)
SCENARIOS: tuple[Scenario, ...] = (_PARKING, _CORNER, _DOCKING, _U_TURN, _PILLAR)
"""All scenarios, figure 1 of the paper first."""
