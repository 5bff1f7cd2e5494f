"""Trajectories with their verdicts, for the property tests of `validate`."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import random_motions

import configspace
from configspace import Grid, PermissibleSpace, Vehicle
from omniplan import InvalidTrajectory, Report, Trajectory, validate

GRID = Grid(40, 72)

DIFFERENT_KINDS = (
    "ackermann",  # line-mobile, steered, slower backwards
    "drive-steer-offset",  # wheels beside their axis, on either side
    "husky",  # skid-steered
    "mecanum-8",  # rollers, tipping
    "mpo-700",  # offset and guaranteed rates
    "rover-mirrored-stops",
    "rox-argo",  # rolling and steering share their motors
    "synchro-drive",
    "tricycle",  # tips, lateral acceleration
    "two-turntables",
)
"""Of every kind of undercarriage and limit one vehicle of the catalogue."""

Draw = Callable[[np.random.Generator, Vehicle, PermissibleSpace], Trajectory]


@dataclass(frozen=True)
class Case:
    vehicle: Vehicle
    space: PermissibleSpace
    trajectory: Trajectory
    report: Report


def judged(trajectory: Trajectory, space: PermissibleSpace) -> Report:
    """The verdict by the limits alone.

    Whether configurations can be reached from straight ahead is another question.
    """
    return validate(trajectory, space, allow_unreachable=True)


@cache
def catalogue_cases(name: str, count: int, seed: int = 1) -> tuple[Case, ...]:
    """Cases of a vehicle of the catalogue, the same ones whenever asked for."""
    return cases_of(configspace.load_vehicle(name), count, seed)


def cases_of(vehicle: Vehicle, count: int, seed: int) -> tuple[Case, ...]:
    """Of `count` motions in each form: one at the limit, one beyond, one below.

    Motions of which no speed is permitted come as they are drawn.
    """
    rng = np.random.default_rng([seed, zlib.crc32(vehicle.name.encode())])
    space = configspace.build_space(vehicle, GRID, cache=False)
    cases = []
    draws: list[Draw] = [
        random_motions.random_twists,
        random_motions.random_poses,
        random_motions.random_parameters,
    ]
    for draw in draws * count:
        below = float(rng.uniform(0.3, 0.9))
        try:
            drawn = draw(rng, vehicle, space)
        except InvalidTrajectory:
            continue  # turns by more than a quarter turn per sample
        report = judged(drawn, space)
        fastest = report.speed_factor
        if fastest == 0:
            cases.append(Case(vehicle, space, drawn, report))
            continue
        shares = [0.9999, below]
        if drawn.form != "omni_curve":  # v_n stays in [-1, 1]
            shares.append(1.01)
        for share in shares:
            trajectory = drawn.scaled(fastest * share)
            report = judged(trajectory, space)
            cases.append(Case(vehicle, space, trajectory, report))
    return tuple(cases)


def with_rates(rng: np.random.Generator, vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with limits on rates and accelerations here and there."""
    data = vehicle.model_dump(mode="json")
    for wheel in data["wheels"]:
        if wheel["type"] in {"steered", "turntable"} and rng.random() < 0.6:
            wheel["max_steering_rate_deg"] = float(rng.uniform(30, 400))
        if wheel["type"] in {"steered", "turntable"} and rng.random() < 0.3:
            swing = float(10 ** rng.uniform(1.5, 3.5))
            wheel["max_steering_acceleration_deg"] = swing
        if wheel["type"] != "castor" and rng.random() < 0.5:
            wheel["max_acceleration"] = float(rng.uniform(0.3, 3))
    for name, low, high in (
        ("max_acceleration", 0.3, 2.0),
        ("max_deceleration", 0.3, 2.0),
        ("max_reverse_speed", 0.1, 1.5),
    ):
        if rng.random() < 0.4:
            data["limits"][name] = float(rng.uniform(low, high))
    return configspace.vehicle_from_data(data)
