"""Connette's long run with random set-points (spec/steered-wheels §5.5, B6).

A new twist is asked for again and again, uniform in (φ, θ). The dissertation reports
how controllers cope; here the quickest way of the wheels is planned. Not like for like:
its figures are of closed-loop simulations with dynamics, ours are kinematic.

Run ``python benchmarks/connette.py`` for the report.
"""

from __future__ import annotations

import cmath
import math
import sys
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

import configspace
from configspace import Vehicle
from configspace.spherical import spherical_to_omni_curve
from omniplan.standing.transitions import TransitionMap

D = 0.299082
"""Distance of the steering axes from K, m."""
RATE = 24.0
"""Largest steering rate, rad/s."""
SETS = {"set 1": 0.5 * math.pi, "set 2": math.pi, "set 3": 1.5 * math.pi}
"""Bounds on the path speed in (φ, θ), rad/s."""
INTERVAL = 1.0
"""Time from set-point to set-point in the dissertation, s."""
COUNT = 3600


@dataclass(frozen=True)
class LongRun:
    """What a run over random set-points gave."""

    n_reached: int
    """Set-points for which a way was found."""
    n_rejected: int
    """Set-points in the zone that the vehicle could not leave at the path speed."""
    mean_time: float
    """Mean time to a set-point, s."""
    median_time: float
    """Median, s."""
    share_in_time: float
    """Share of the reached ones within `INTERVAL`."""
    mean_max_rate: float
    """Mean over the set-points of the largest steering rate, rad/s."""
    max_steering_rate: float
    """Largest of them, rad/s."""
    max_steering_error: float
    """Largest angle between a wheel and the direction its contact moves in, rad."""


def care_o_bot() -> Vehicle:
    """Return the undercarriage as the dissertation's kinematics see it."""
    axes = [(0.235, 0.185), (-0.235, 0.185), (-0.235, -0.185), (0.235, -0.185)]
    wheels = [
        {
            "id": f"w{i}",
            "type": "steered",
            "x": x,
            "y": y,
            "max_speed": 1.0,
            "max_steering_rate_deg": math.degrees(RATE),
        }
        for i, (x, y) in enumerate(axes, 1)
    ]
    return configspace.vehicle_from_data(
        {"name": "cob", "kappa_g": 1 / D, "wheels": wheels}
    )


def long_run(
    vehicle: Vehicle, path_speed: float, rate: float, count: int, seed: int
) -> LongRun:
    """Plan the ways between `count` random set-points."""
    rng = np.random.default_rng(seed)
    phi = rng.uniform(-math.pi, math.pi, count)
    theta = rng.uniform(-math.pi / 2, math.pi / 2, count)
    surface = TransitionMap(vehicle, path_speed)
    at = (0.0, 0.0)
    times, rates, errors, rejected = [], [], [], 0
    for i in track(range(count), disable=not sys.stderr.isatty()):
        if gain(phi[i], theta[i]) > rate / path_speed:
            rejected += 1
            continue
        kappa_n, beta, _ = spherical_to_omni_curve(1.0, phi[i], theta[i])
        goal = (float(kappa_n), float(beta))
        found = surface.between(at, goal, mirrored=True)
        if found is None:
            rejected += 1
            continue
        times.append(found.time)
        rates.append(found.max_steering_rate)
        errors.append(steering_error(vehicle, found.way))
        at = (float(found.way[-1, 0]), float(found.way[-1, 1]))
    return LongRun(
        n_reached=len(times),
        n_rejected=rejected,
        mean_time=float(np.mean(times)),
        median_time=float(np.median(times)),
        share_in_time=float(np.mean(np.array(times) <= INTERVAL)),
        mean_max_rate=float(np.mean(rates)),
        max_steering_rate=max(rates),
        max_steering_error=max(errors),
    )


def gain(phi: float, theta: float) -> float:
    """Return the largest |dα_i| per length of a way in (φ, θ), in any direction.

    By central differences of the angles themselves, which shares nothing with the
    search.
    """
    step, worst = 1e-5, 0.0
    for x, y in ((0.235, 0.185), (-0.235, 0.185), (-0.235, -0.185), (0.235, -0.185)):

        def direction(p: float, t: float, at: complex = complex(x, y)) -> complex:
            return D * math.cos(t) * cmath.exp(1j * p) + 1j * at * math.sin(t)

        parts = [
            cmath.phase(direction(phi + a, theta + b) / direction(phi - a, theta - b))
            for a, b in ((step, 0.0), (0.0, step))
        ]
        worst = max(worst, math.hypot(*parts) / (2 * step))
    return worst


def steering_error(vehicle: Vehicle, way: np.ndarray) -> float:
    """Return how far wheels point off their contact's motion along a way, rad."""
    alpha, _ = configspace.wheel_states(vehicle, way[:, 0], way[:, 1], 1.0)
    twist = configspace.to_twist(way[:, 0], way[:, 1], 1.0, 1 / D)
    worst = 0.0
    for i, wheel in enumerate(vehicle.wheels):
        vx = twist[:, 0] - twist[:, 2] * wheel.y
        vy = twist[:, 1] + twist[:, 2] * wheel.x
        across = np.cos(alpha[:, i]) * vy - np.sin(alpha[:, i]) * vx
        speed = np.hypot(vx, vy)
        worst = max(worst, float((np.abs(across) / np.maximum(speed, 1e-12)).max()))
    return worst


def main() -> None:
    """Print the report."""
    table = Table(title=f"{COUNT} random set-points, Care-O-bot 3, {RATE:g} rad/s")
    columns = ("path speed", "rejected %", "mean s", "median s", "within 1 s %")
    for name in (*columns, "mean of max rate", "max rate rad/s", "error rad"):
        table.add_column(name, justify="right")
    for name, speed in SETS.items():
        run = long_run(care_o_bot(), speed, RATE, COUNT, seed=1)
        table.add_row(
            f"{name}: {speed:.2f} rad/s",
            f"{100 * run.n_rejected / COUNT:.2f}",
            f"{run.mean_time:.3f}",
            f"{run.median_time:.3f}",
            f"{100 * run.share_in_time:.1f}",
            f"{run.mean_max_rate:.2f}",
            f"{run.max_steering_rate:.2f}",
            f"{run.max_steering_error:.1e}",
        )
    Console(width=132).print(table)


if __name__ == "__main__":
    main()
