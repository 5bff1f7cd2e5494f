"""How far plans are from what no vehicle can beat, known from elsewhere.

- Vehicles that drive to any side, in an empty hall: full acceleration, full speed and
  full braking on the straight line, by hand from the limits of their wheels;
- Ackermann steering, in an empty hall: the length of Reeds and Shepp's way with the
  least radius, by OMPL, at the largest speed; steering and cusps are for nothing;
- a round vehicle that turns on the spot, among boxes: the shortest way of its middle
  through the visibility graph of the grown boxes (shapely), at the largest speed;
  turning is for nothing.

The last two are lower bounds that cannot be reached. Run
``python benchmarks/planning_optima.py`` for the table.
"""

from __future__ import annotations

import argparse
import functools
import itertools
import math
import statistics
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import shapely  # noqa: TID251
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.sparse import coo_array, csgraph

import configspace
import omniplan
from configspace import PermissibleSpace
from omniplan.obstacles import CollisionChecker, Obstacles
from omniplan.sampling.ompl_bindings import base

Pose = tuple[float, float, float]

ANGLES = range(0, 360, 30)
"""Directions of the straight lines, degrees."""
LINE = 3.0
"""Their length, m."""
RADIUS = 0.275 + 0.8 / math.tan(math.radians(40.0))
"""The inner front wheel of ``ackermann`` is 0.8 m ahead and 0.275 m aside of the middle
of the axle, and steers by 40°: least radius of that middle, m."""
BODY = 0.45
"""Radius of the round vehicle, m."""
CORNERS = 48
"""Of the polygon that stands for it."""
HALL = (0.0, 0.0, 10.0, 8.0)
QUARTER = 64
"""Segments of a quarter of a circle in grown boxes."""

ROUGH = 1e-3
"""Borders of grown boxes lose corners that matter less than this, m."""


@dataclass(frozen=True)
class Case:
    """A problem with a time that is known."""

    space: PermissibleSpace
    start: Pose
    goal: Pose
    bound: float
    """s."""
    checker: CollisionChecker | None = None

    def ratio(self, seconds: float, iterations: int | None = None) -> float:
        """Return the time of the plan, in times that of the bound; inf without one."""
        found = omniplan.plan(
            self.start,
            self.goal,
            self.space,
            self.checker,
            time=seconds,
            iterations=iterations,
        )
        return math.inf if found.duration is None else found.duration / self.bound


def rest_to_rest(way: float, speed: float, faster: float, slower: float) -> float:
    """Return the least time along a way, s.

    Parameters
    ----------
    way : float, m
    speed : float, m/s
    faster, slower : float, m/s²
        Largest acceleration and deceleration.
    """
    ramps = speed**2 / 2 * (1 / faster + 1 / slower)
    if way >= ramps:
        return (way - ramps) / speed + speed / faster + speed / slower
    top = math.sqrt(2 * way / (1 / faster + 1 / slower))
    return top / faster + top / slower


@functools.cache
def space_of(name: str) -> PermissibleSpace:
    """Return the space of a ready vehicle."""
    return configspace.build_space(configspace.load_vehicle(name))


def straight_lines(name: str) -> Iterator[Case]:
    """Yield straight lines to all sides, and the time of the quickest ride on them."""
    for degrees in ANGLES:
        angle = math.radians(degrees)
        c, s = math.cos(angle), math.sin(angle)
        goal = (LINE * c, LINE * s, 0.0)
        # Rollers at 45°: every wheel rolls at v_x ± v_y, 1.2 m/s and 1.5 m/s² at most.
        share = 1 / (abs(c) + abs(s))
        limits = 1.2 * share, 1.5 * share, 1.5 * share
        if name == "ift-four-steered":  # 1 m/s and 1 m/s² in whatever direction
            limits = 1.0, 1.0, 1.0
        yield Case(space_of(name), (0, 0, 0), goal, rest_to_rest(LINE, *limits))


def reeds_shepp(count: int) -> Iterator[Case]:
    """Yield random goals of Ackermann steering, and a time that none can beat."""
    rng, space = np.random.default_rng(5), base.ReedsSheppStateSpace(RADIUS)
    for _ in range(count):
        x, y, theta = rng.uniform((-5, -5, -math.pi), (5, 5, math.pi)).tolist()
        states = [space.allocState(), space.allocState()]
        for state, pose in zip(states, ((0.0, 0.0, 0.0), (x, y, theta)), strict=True):
            state.setXY(*pose[:2])
            state.setYaw(pose[2])
        bound = rest_to_rest(space.distance(*states), 1.5, 1.0, 1.5)
        yield Case(space_of("ackermann"), (0, 0, 0), (x, y, theta), bound)


def among_boxes(count: int) -> Iterator[Case]:
    """Yield halls for a round vehicle, and a time that none can beat."""
    rng, space = np.random.default_rng(7), space_of("differential")
    angles = np.arange(CORNERS) * 2 * math.pi / CORNERS
    body = BODY / math.cos(math.pi / CORNERS) * np.exp(1j * angles)
    corners = np.stack([body.real, body.imag], axis=-1)
    made = 0
    while made < count:
        boxes = []
        for _ in range(4):
            x, y = rng.uniform((2, 0), (8, 8))
            w, h = rng.uniform(0.3, 3.0, 2)
            boxes.append(shapely.box(x - w / 2, y - h / 2, x + w / 2, y + h / 2))
        y0, y1 = rng.uniform(1, 7, 2).tolist()
        length = shortest(boxes, (1.0, y0), (9.0, y1))
        if length is None or length < 1.02 * math.hypot(8.0, y1 - y0):
            continue
        made += 1
        rings = [np.asarray(box.exterior.coords)[:-1] for box in boxes]
        hall = Obstacles.from_polygons(rings)
        checker = CollisionChecker(corners, hall, bounds=HALL)
        bound = rest_to_rest(length, 1.0, 1.0, 1.0)
        yield Case(space, (1.0, y0, 0.0), (9.0, y1, 0.0), bound, checker)


def shortest(
    boxes: list[shapely.Polygon], start: tuple[float, float], goal: tuple[float, float]
) -> float | None:
    """Return the length of the shortest way of the round vehicle's middle, m.

    None if there is none by far: grown by 0.05 m more, the boxes close the hall. The
    boxes are grown by less than the vehicle's radius, so that no way is shorter.
    """
    wide = shapely.union_all([box.buffer(BODY + 0.05) for box in boxes])
    parts = shapely.get_parts(shapely.box(*HALL).buffer(-BODY - 0.05) - wide)
    ends = shapely.points([start, goal])
    if not any(shapely.contains(part, ends).all() for part in parts):
        return None
    walls = shapely.union_all([box.buffer(BODY, quad_segs=QUARTER) for box in boxes])
    near = shapely.box(*HALL).buffer(-BODY + 1e-6)
    # Chords of the border cut off less than that: they are seen, and no way is shorter.
    block = walls.buffer(-2 * ROUGH)
    shapely.prepare(block)
    border = shapely.get_coordinates(walls.simplify(ROUGH))
    places = np.concatenate([[start, goal], border])
    places = places[shapely.contains_xy(near, places)]
    pairs = np.array(list(itertools.combinations(range(len(places)), 2)))
    lines = shapely.linestrings(places[pairs])
    seen = pairs[~shapely.intersects(block, lines)]
    lengths = np.linalg.norm(places[seen[:, 0]] - places[seen[:, 1]], axis=1)
    graph = coo_array((lengths, seen.T), shape=(len(places), len(places)))
    lengths = csgraph.shortest_path(graph.tocsr(), directed=False, indices=0)
    found = lengths[1]
    return float(found) if math.isfinite(found) else None


CASES: dict[str, Callable[[int], Iterator[Case]]] = {
    "mecanum, straight": lambda _: straight_lines("mecanum"),
    "ift-four-steered, straight": lambda _: straight_lines("ift-four-steered"),
    "ackermann, Reeds–Shepp": reeds_shepp,
    "round differential, visibility graph": among_boxes,
}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=30, help="random problems of each")
    parser.add_argument("--time", type=float, default=1.0, help="for a search, s")
    given = parser.parse_args()
    table = Table("vehicle, what is known", "problems", "found", "median", "worst")
    for name, cases in CASES.items():
        todo = list(cases(given.count))
        todo[0].ratio(given.time)  # compiled code is loaded before
        ratios = [case.ratio(given.time) for case in track(todo, name, transient=True)]
        found = [ratio for ratio in ratios if math.isfinite(ratio)]
        median, worst = statistics.median(found), max(found)
        table.add_row(
            name, f"{len(todo)}", f"{len(found)}", f"{median:.3f}", f"{worst:.3f}"
        )
    Console().print(table)


if __name__ == "__main__":
    main()
