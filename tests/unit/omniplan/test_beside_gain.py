"""What steering asks of the acceleration of wheels beside their axis."""

from __future__ import annotations

from typing import Any

import naive_limits
import naive_motion
import numpy as np
import pytest
import random_motions

import configspace
from configspace import Grid, Vehicle, build_space, vehicle_from_data
from configspace.testing import random_vehicle
from omniplan import Path, Tolerances, Trajectory, time_path, validate
from omniplan.judging.vehicle_judge import VehicleJudge
from omniplan.motion import Intervals, motion_of

FAST = 0.05  # m/s: well above standstill


def beside(rng: np.random.Generator, kind: Any) -> Vehicle:
    """A random vehicle whose wheels are limited in their acceleration only."""
    data = random_vehicle(rng, kind).model_dump(mode="json", exclude_none=True)
    for wheel in data["wheels"]:
        if wheel["type"] in {"steered", "turntable"}:
            wheel.pop("steering_range_deg", None)
            wheel["max_acceleration"] = float(rng.uniform(0.3, 2))
            if rng.random() < 0.4:
                wheel["steering_coupling"] = float(rng.uniform(0.02, 0.1))
    return vehicle_from_data(data)


def wavy(rng: np.random.Generator) -> Trajectory:
    t = np.linspace(0, 4, 25)
    course = rng.uniform(-3, 3) + rng.uniform(0.2, 0.9) * np.sin(
        t * rng.uniform(0.5, 2) + rng.uniform(0, 6)
    )
    speed = 0.5 + 0.2 * np.sin(rng.uniform(0.5, 2) * t)
    step = speed[1:] * np.exp(1j * course[1:]) * np.diff(t)
    p = np.concatenate([[0], np.cumsum(step)])
    theta = rng.uniform(-0.4, 0.4) * np.sin(rng.uniform(0.5, 1.5) * t)
    return Trajectory.from_poses(t, np.stack([p.real, p.imag, theta], axis=-1))


@pytest.mark.parametrize("kind", ["offset", "turntable"])
def test_the_change_of_rolling_is_enclosed(kind: str) -> None:
    rng = np.random.default_rng(5)
    checked, close = 0, 0
    for _ in range(12):
        vehicle, trajectory = beside(rng, kind), wavy(rng)
        judge = VehicleJudge(
            vehicle, Tolerances(), is_own=False, has_rates=True, has_swing=True
        )
        motion = motion_of(trajectory, is_own=False)
        at = random_motions.motion_of(trajectory)
        parts = motion.intervals()
        for _ in range(4):
            parts = parts.halved(np.ones(parts.t0.shape, dtype=bool))
        keep = rng.choice(parts.t0.size, 12)
        some = Intervals(parts.knot[keep], parts.t0[keep], parts.t1[keep])
        for sign in (1, -1):
            low, high = judge.utilisation(motion.enclose(some), sign)
            for k in range(keep.size):
                when = np.linspace(some.t0[k], some.t1[k] - 3e-4, 60)
                simulation = naive_motion.Simulation(
                    vehicle,
                    when,
                    at(when),
                    at(when + naive_motion.MOMENT),
                    ahead=naive_motion.look_ahead(vehicle, when, at),
                )
                piece = naive_motion.Piece(0, when.size - 1)
                if simulation.v_s.min() < FAST:
                    continue
                reached = gains(simulation, piece, sign)
                for column, wheel, value in columns(judge, reached):
                    u = simulation.velocity(*simulation.places[wheel])
                    if np.abs(u).min() < FAST:
                        continue
                    assert value <= high[k, column] * (1 + 1e-6) + 1e-4
                    assert low[k, column] <= value * 1.02 + 2e-2
                    checked += 1
                    close += high[k, column] < 1.2 * value + 0.05
    assert checked > 300
    assert close > 0.8 * checked


def gains(
    sim: naive_motion.Simulation, piece: naive_motion.Piece, sign: int
) -> dict[int, list[float]]:
    """What the simulation sees of every steered wheel, offset by offset."""
    found: dict[int, list[float]] = {}
    for i, wheel in enumerate(sim.vehicle.wheels):
        if not isinstance(wheel, configspace.vehicle.SteerableWheel):
            continue
        for offset in naive_limits.offsets_of(wheel):
            gain = sim.contact_gain(i, offset, sign)
            gain = gain + wheel.steering_coupling * sim.swinging(i)
            found.setdefault(i, []).append(float(gain.max()))
    return found


def columns(
    judge: VehicleJudge, reached: dict[int, list[float]]
) -> list[tuple[int, int, float]]:
    """Column, wheel and utilisation seen, of every row about it."""
    out = []
    seen = {i: list(values) for i, values in reached.items()}
    for column, row in enumerate(judge.rows):
        if row.limit == "WHEEL_ACCELERATION" and row.wheel in seen:
            out.append((column, row.wheel, seen[row.wheel].pop(0) / row.bound))
    assert not any(seen.values())
    return out


def slalom() -> Trajectory:
    """Looking ahead, to the left and to the right."""
    t = np.linspace(0, 6, 61)
    x, y = 0.8 * t, 0.3 * np.sin(1.5 * t)
    theta = np.unwrap(np.arctan2(np.gradient(y), np.gradient(x)))
    return Trajectory.from_poses(t, np.stack([x, y, theta], axis=-1))


def with_acceleration(limit: float, offset: float) -> configspace.PermissibleSpace:
    wheels = [
        {
            "id": f"w{i}", "type": "steered", "x": x, "y": y, "max_speed": 9.0,
            "offset": offset, "max_acceleration": limit,
        }
        for i, (x, y) in enumerate([(0.3, 0.2), (-0.3, 0.2), (-0.3, -0.2)])
    ]  # fmt: skip
    vehicle = vehicle_from_data({"name": "beside", "kappa_g": 2.0, "wheels": wheels})
    return build_space(vehicle, Grid(20, 36), cache=False)


def test_a_wheel_beside_its_axis_needs_more() -> None:
    limit = 1 - validate(slalom(), with_acceleration(1.0, 0.0)).margin
    on_axis, off_axis = (
        with_acceleration(1.05 * limit, offset) for offset in (0.0, 0.1)
    )
    assert validate(slalom(), on_axis).valid
    report = validate(slalom(), off_axis)
    assert {v.limit for v in report.violations} == {"WHEEL_ACCELERATION"}
    assert report.not_judged == ()
    worst = report.headline
    assert worst is not None
    simulation = random_motions.simulated(off_axis.vehicle, slalom())  # type: ignore[arg-type]
    seen = [
        max(
            use.value
            for use in naive_limits.piece_uses(simulation, simulation.pieces[0], sign)
            if use.limit == "WHEEL_ACCELERATION"
        )
        for sign in (1, -1)
    ]
    assert worst.value == pytest.approx(min(seen), rel=2e-2)


@pytest.mark.parametrize("kind", ["offset", "turntable"])
def test_the_fastest_timing_keeps_it(kind: str) -> None:
    rng = np.random.default_rng(8)
    x = np.linspace(0, 3, 7)
    poses = np.stack([x, 0.25 * np.sin(2 * x), 0.2 * np.cos(x)], axis=-1)
    for _ in range(3):
        vehicle = beside(rng, kind)
        space = build_space(vehicle, Grid(20, 36), cache=False)
        timing = time_path(Path.from_poses(poses), space)
        assert timing.trajectory is not None, timing.message
        assert timing.profile is not None
        assert timing.trajectory.duration < 1.01 * timing.profile.duration
        assert "WHEEL_ACCELERATION" in timing.profile.limit
        simulation = random_motions.simulated(vehicle, timing.trajectory, 4)
        assert naive_limits.breaches(simulation) == []
