"""Random vehicles with footprints in random halls."""

from __future__ import annotations

import numpy as np
import shapely  # noqa: TID251

from configspace import Vehicle, vehicle_from_data
from configspace.testing import VehicleKind, random_vehicle

Corners = list[tuple[float, float]]


def bodied_vehicle(rng: np.random.Generator, kind: VehicleKind) -> Vehicle:
    """Return a random vehicle whose footprint holds its wheels and K."""
    vehicle = random_vehicle(rng, kind)
    points = [*vehicle.contacts, vehicle.reference]
    around = shapely.MultiPoint([(z.real, z.imag) for z in points]).buffer(0.15)
    hull = shapely.get_coordinates(around.simplify(0.02).convex_hull)
    data = vehicle.model_dump(mode="json", exclude_none=True)
    data["footprint"] = hull[:-1].tolist()
    return vehicle_from_data(data)


def size_of(vehicle: Vehicle) -> float:
    """Return the largest distance of the footprint from K, m."""
    assert vehicle.footprint is not None
    return max(
        abs(complex(*corner) - vehicle.reference) for corner in vehicle.footprint
    )


def random_hall(
    rng: np.random.Generator, size: float
) -> tuple[tuple[float, float, float], tuple[float, float, float], dict[str, Corners]]:
    """Return start, goal and obstacles that keep clear of both."""
    way = size * rng.uniform(4, 12)
    angle, start = rng.uniform(-np.pi, np.pi), (0.0, 0.0, float(rng.uniform(-3, 3)))
    x, y = float(way * np.cos(angle)), float(way * np.sin(angle))
    goal = (x, y, float(rng.uniform(-3, 3)))
    hall: dict[str, Corners] = {}
    for i in range(int(rng.integers(0, 5))):
        middle = rng.uniform(0.2, 0.8) * np.array([x, y]) + rng.normal(0, 2 * size, 2)
        half = rng.uniform(0.1, 1.2, 2) * size
        box = shapely.box(*(middle - half), *(middle + half))
        ends = shapely.MultiPoint([(0, 0), (x, y)])
        if box.distance(ends) > 1.2 * size:
            hall[f"box {i}"] = shapely.get_coordinates(box)[:-1].tolist()
    return start, goal, hall
