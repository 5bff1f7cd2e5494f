"""Wheels that wind on: verdicts against `np.unwrap` on fine samples and brute force."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any

import naive_limits
import numpy as np
import numpy.typing as npt
import pytest
import random_motions

import configspace
from configspace import Grid, PermissibleSpace, Vehicle, vehicle_from_data
from configspace.vehicle import SteeredWheel
from omniplan import Report, Trajectory, Violation, validate

FloatArray = npt.NDArray[np.float64]
TURN = 2 * math.pi
RATE = 1.5  # rad/s
FINE = 40
"""Steps per interval of the simulation."""
CLOSE = 2e-3
"""So near to a stop the simulation does not decide, rad."""


@dataclass(frozen=True)
class Case:
    vehicle: Vehicle
    space: PermissibleSpace
    trajectory: Trajectory
    pieces: tuple[tuple[int, int], ...]
    """First and last moving sample of every piece."""

    def sweeps(self) -> list[list[tuple[float, float, float, float]]]:
        """Start, end, least and largest angle of every wheel over every piece."""
        out = []
        for a, b in self.pieces:
            t = self.trajectory.t[a : b + 1]
            fine = np.linspace(t[0], t[-1], (b - a) * FINE + 1)
            vx, vy, omega = (
                np.interp(fine, t, column)
                for column in self.trajectory.samples[a : b + 1].T
            )
            each = []
            for wheel in self.vehicle.wheels:
                ux, uy = vx - omega * wheel.y, vy + omega * wheel.x
                alpha = np.unwrap(np.arctan2(uy, ux))
                each.append((alpha[0], alpha[-1], alpha.min(), alpha.max()))
            out.append(each)
        return out

    def is_clear(self) -> bool:
        """Whether the simulation can follow every wheel."""
        for a, b in self.pieces:
            samples = self.trajectory.samples[a : b + 1]
            f = np.linspace(0, 1, FINE)[:, None, None]
            vx, vy, omega = np.moveaxis(
                samples[:-1] + f * (samples[1:] - samples[:-1]), -1, 0
            )
            for wheel in self.vehicle.wheels:
                size = np.hypot(vx - omega * wheel.y, vy + omega * wheel.x)
                if size.min() < 5e-3:
                    return False
        return True


def wheel_range(vehicle: Vehicle, i: int) -> tuple[float, float]:
    wheel = vehicle.wheels[i]
    assert isinstance(wheel, SteeredWheel)
    assert wheel.steering_range_deg is not None
    least, largest = wheel.steering_range_deg
    return math.radians(least), math.radians(largest)


def room(
    sweep: tuple[float, float, float, float],
    bounds: tuple[float, float],
    k: int,
    flip: float,
) -> float:
    """Least distance to the stops, negative beyond."""
    shift = flip + k * TURN
    return min(sweep[2] + shift - bounds[0], bounds[1] - sweep[3] - shift)


def random_case(rng: np.random.Generator, stops: int, backwards: bool) -> Case:
    wheels = []
    for i in range(int(rng.integers(1, 4))):
        width = 362 + 718 * rng.random() ** 2
        middle = rng.uniform(-200, 200)
        wheels.append(
            {
                "id": f"w{i}",
                "type": "steered",
                "x": float(rng.uniform(-0.5, 0.5)),
                "y": float(rng.uniform(-0.5, 0.5)),
                "steering_range_deg": (middle - width / 2, middle + width / 2),
                "max_steering_rate_deg": math.degrees(RATE),
            }
        )
    limits = {} if backwards else {"max_reverse_speed": 1e-2}
    wheels[0]["max_speed"] = 50.0
    data = {"name": "random", "kappa_g": 2.0, "wheels": wheels, "limits": limits}
    vehicle = vehicle_from_data(data)
    space = configspace.build_space(vehicle, Grid(20, 36), cache=False)
    return Case(vehicle, space, *random_motion(rng, stops))


def random_motion(
    rng: np.random.Generator, stops: int
) -> tuple[Trajectory, tuple[tuple[int, int], ...]]:
    """Directions that wander by some turns; at every stop the wheels stay aligned."""
    times, samples, pieces = [0.0], [np.zeros(3)], []
    beta = rng.uniform(-math.pi, math.pi)
    for piece in range(stops + 1):
        steps = int(rng.integers(15, 30))
        turn = rng.uniform(-2, 2) * TURN / math.sqrt(stops + 1)
        ease = np.linspace(0, 1, steps)
        bend = np.sin(ease * math.pi * rng.integers(1, 4))
        direction = beta + turn * ease + rng.uniform(-0.5, 0.5) * bend
        beta = float(direction[-1])
        v = rng.uniform(0.3, 0.6) * np.exp(1j * direction)
        omega = rng.uniform(-1.2, 1.2) * bend
        moving = np.stack([v.real, v.imag, omega], axis=-1)
        if piece:
            times.append(times[-1] + float(rng.uniform(0.2, 10)))
            samples.append(np.zeros(3))
        pieces.append((len(times), len(times) + steps - 1))
        times += [times[-1] + 2.0 * (n + 1) for n in range(steps)]
        samples += [*moving]
        times.append(times[-1] + 2.0)
        samples.append(np.zeros(3))
    return Trajectory.from_twists(times, samples), tuple(pieces)


def limits(report: Report) -> set[str]:
    return {violation.limit for violation in report.violations}


MANY = pytest.mark.parametrize("count", [20, pytest.param(200, marks=pytest.mark.slow)])


@MANY
@pytest.mark.parametrize("backwards", [True, False])
def test_one_piece_is_valid_where_a_start_fits_both_stops(
    backwards: bool, count: int
) -> None:
    rng = np.random.default_rng(count)
    verdicts = []
    for _ in range(count):
        case = random_case(rng, 0, backwards)
        report = validate(case.trajectory, case.space)
        if not case.is_clear() or not limits(report) <= {"STEER_RANGE"}:
            continue
        (sweeps,) = case.sweeps()
        best = max(
            min(
                max(
                    room(sweep, wheel_range(case.vehicle, i), k, flip)
                    for k in range(-5, 6)
                )
                for i, sweep in enumerate(sweeps)
            )
            for flip in ((0.0, math.pi) if backwards else (0.0,))
        )
        if abs(best) < CLOSE:
            continue
        assert report.valid == (best > 0), (best, report.violations)
        verdicts.append(report.valid)
        for violation in report.violations:
            assert_beyond(case, violation)
    assert count / 5 < sum(verdicts) < len(verdicts) - count / 10


def assert_beyond(case: Case, violation: Violation) -> None:
    """The angle is one the wheel really has then, beyond the stop that is named."""
    i = [w.id for w in case.vehicle.wheels].index(str(violation.wheel))
    least, largest = wheel_range(case.vehicle, i)
    value = violation.value
    assert value is not None
    assert value < least or value > largest
    assert violation.bound == pytest.approx(least if value < least else largest)
    assert violation.t_start <= violation.t <= violation.t_end
    wheel = case.vehicle.wheels[i]
    vx, vy, omega = (
        np.interp(violation.t, case.trajectory.t, column)
        for column in case.trajectory.samples.T
    )
    angle = math.atan2(vy + omega * wheel.x, vx - omega * wheel.y)
    assert math.remainder(value - angle, math.pi) == pytest.approx(0, abs=1e-6)


def brute_force(case: Case, margin: float) -> bool:
    """Whether turns k for all pieces exist, with time to unwind in between."""
    t = case.trajectory.t
    rests = [
        t[b[0] - 1] - t[a[1] + 1] for a, b in itertools.pairwise(case.pieces)
    ]  # fmt: skip
    sweeps = case.sweeps()
    for i in range(len(case.vehicle.wheels)):
        bounds = wheel_range(case.vehicle, i)
        found = False
        for turns in itertools.product(range(-4, 5), repeat=len(case.pieces)):
            fits = all(
                room(each[i], bounds, k, 0.0) > margin
                for each, k in zip(sweeps, turns, strict=True)
            )
            if not fits:
                continue
            in_time = True
            for n, rest in enumerate(rests):
                end = sweeps[n][i][1] + TURN * turns[n]
                start = sweeps[n + 1][i][0] + TURN * turns[n + 1]
                unwinding = abs(round((start - end) / TURN)) * TURN / RATE
                # Around the rest the vehicle creeps below the standstill speed.
                in_time &= unwinding <= rest - 50 * margin
            found |= in_time
        if not found:
            return False
    return True


@MANY
def test_with_stops_a_motion_is_valid_where_brute_force_finds_turns(
    count: int,
) -> None:
    rng = np.random.default_rng(1 + count)
    verdicts, short = [], 0
    for _ in range(count):
        case = random_case(rng, int(rng.integers(1, 3)), backwards=False)
        report = validate(case.trajectory, case.space)
        known = {"STEER_RANGE", "RECONFIGURATION"}
        if not case.is_clear() or not limits(report) <= known:
            continue
        strict, lenient = (brute_force(case, m) for m in (CLOSE, -CLOSE))
        if strict != lenient:
            continue
        assert report.valid == strict, report.violations
        verdicts.append(report.valid)
        for violation in report.violations:
            if violation.limit == "RECONFIGURATION":
                assert violation.value is not None
                turns = violation.value * RATE / TURN
                assert turns == pytest.approx(round(turns), abs=1e-6)
                assert turns > 0
                short += 1
    assert count / 8 < sum(verdicts) < len(verdicts) - count / 8
    assert short > count / 20


@MANY
def test_a_motion_with_stops_and_both_representations_is_never_wrongly_valid(
    count: int,
) -> None:
    rng = np.random.default_rng(2 + count)
    valid = 0
    for _ in range(count // 2):
        case = random_case(rng, 1, backwards=True)
        if not case.is_clear() or not validate(case.trajectory, case.space).valid:
            continue
        valid += 1
        for each in case.sweeps():
            assert any(
                all(
                    any(
                        room(sweep, wheel_range(case.vehicle, i), k, flip) > -CLOSE
                        for k in range(-5, 6)
                    )
                    for i, sweep in enumerate(each)
                )
                for flip in (0.0, math.pi)
            )
    assert valid > count / 10


@pytest.mark.parametrize("swing_deg", [None, 50.0])
@pytest.mark.parametrize(
    "rate_deg", [None, pytest.param(4000.0, marks=pytest.mark.slow), 20.0]
)
@pytest.mark.parametrize(
    ("wheel", "rolled"),
    [
        ({"offset": 0.4}, 0.4),
        ({"offset": -0.4}, 0.4),
        ({"steering_coupling": 0.3}, 0.3),
        ({"offset": -0.3, "steering_coupling": 0.2}, 0.5),
        ({"type": "turntable", "track": 0.8}, 0.4),
    ],
)
def test_unwinding_takes_the_time_that_rolling_beside_the_axis_asks(
    wheel: dict[str, Any],
    rolled: float,
    rate_deg: float | None,
    swing_deg: float | None,
) -> None:
    speed = 0.5
    axis = {
        "id": "w", "type": "steered", "x": 0.0, "y": 0.0, "max_speed": speed,
        "steering_range_deg": (-70.0, 370.0), "max_steering_rate_deg": rate_deg,
        "max_steering_acceleration_deg": swing_deg,
    }  # fmt: skip
    data = {
        "name": "one",
        "kappa_g": 2.0,
        "wheels": [{**axis, **wheel}],
        "limits": {"max_reverse_speed": 1e-2, "max_yaw_rate_deg": 90.0},
    }
    vehicle = vehicle_from_data(data)
    space = configspace.build_space(vehicle, Grid(20, 36), cache=False)
    rates = [speed / rolled] + ([math.radians(rate_deg)] if rate_deg else [])
    needed = TURN / min(rates)
    if swing_deg:  # gaining and losing the rate, well within a turn
        needed += min(rates) / math.radians(swing_deg)
    for rest in (0.95 * needed, 1.02 * needed):
        trajectory = twice_round_by_300_degrees(rest)
        report = validate(trajectory, space)
        enough = rest > needed
        assert report.valid == enough
        broken = naive_limits.breaches(random_motions.simulated(vehicle, trajectory))
        assert (broken == []) == enough
        if not enough:
            (violation,) = report.violations
            assert violation.limit == "RECONFIGURATION"
            assert violation.value == pytest.approx(needed, rel=1e-6)


def twice_round_by_300_degrees(rest: float) -> Trajectory:
    """From 0° to 300°, a rest, from there by as much again: the wheel must go back."""
    steps = 61
    direction = np.exp(1j * np.radians(np.linspace(0, 300, steps)))
    direction = np.concatenate([direction, direction * direction[-1]])
    v = np.concatenate(
        [[0], 0.2 * direction[:steps], [0], [0], 0.2 * direction[steps:], [0]]
    )
    t = 2.0 * np.arange(steps + 2)
    return Trajectory.from_twists(
        np.concatenate([t, t + t[-1] + rest]),
        np.stack([v.real, v.imag, 0 * v.real], -1),
    )
