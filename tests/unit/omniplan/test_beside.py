"""The singular zone over parts of motions agrees with single configurations."""

import math

import numpy as np
import pytest

import configspace
from configspace import exact_v_max
from configspace.exact import turning_excess
from configspace.limits import rows_of
from configspace.omni_curve import POLE
from configspace.testing import random_vehicle
from omniplan import Tolerances, Trajectory, validate
from omniplan.judging.vehicle_judge import VehicleJudge
from omniplan.motion import Intervals, motion_of


def asked(vehicle: configspace.Vehicle, wheel: int, twist: np.ndarray) -> np.ndarray:
    """What the guaranteed rates ask for per what is there, at twists (m, 3) at K."""
    row = next(row for row in rows_of(vehicle)[1] if row.wheel == wheel)
    v, q = twist[:, 0] + 1j * twist[:, 1], twist[:, 2] / vehicle.boundary_curvature
    v_s = np.maximum(np.abs(v), np.abs(q))
    c, s, e = np.abs(v) / v_s, q / v_s, np.exp(1j * np.angle(v))
    room = np.abs(c * e + s * row.b) ** 2
    return np.asarray((turning_excess(row, c, s, e) + room * (1 + 1e-14)) / room)


def through_the_pole(rng: np.random.Generator) -> np.ndarray:
    """Twists that turn about K at a sample or between two."""
    v = rng.normal(size=2) * 10.0 ** rng.uniform(-13, -1)
    share = rng.choice([0.0, 0.5, rng.random()])
    omega = rng.normal() + np.array([0.0, 0.1 * rng.normal()])
    ends = np.array([-share * v, (1 - share) * v])
    return np.column_stack([ends, omega])


def test_parts_enclose_the_zone_at_poles_too() -> None:
    rng = np.random.default_rng(0)
    checked = poles = 0
    for _ in range(400):
        vehicle = random_vehicle(rng, "guaranteed")
        if vehicle.mobility.is_translating or vehicle.reference != 0:
            continue
        twists = (
            through_the_pole(rng) if rng.random() < 0.7 else rng.normal(size=(2, 3))
        )
        if vehicle.mobility.line_beta is not None:
            along = np.exp(1j * vehicle.mobility.line_beta)
            twists[:, :2] = twists[:, :1] * np.array([along.real, along.imag])
        trajectory = Trajectory.from_twists([0.0, 1.0], twists)
        judge = VehicleJudge(vehicle, Tolerances(), is_own=False, has_rates=True)
        motion = motion_of(trajectory, is_own=False)
        t0 = float(rng.choice([0.0, rng.random() * 0.9]))
        t1 = t0 + (1 - t0) * float(10.0 ** rng.uniform(-6, 0))
        part = Intervals(np.array([0]), np.array([t0]), np.array([t1]))
        low, high = judge.utilisation(motion.enclose(part), 1)
        f = np.concatenate([np.linspace(0, 1, 201), [0.5]])[:, None]
        at = t0 + f * (t1 - t0)
        dense = (1 - at) * twists[0] + at * twists[1]
        if np.abs(dense).max(axis=1).min() < 1e-3:
            continue
        c = np.hypot(dense[:, 0], dense[:, 1]) / np.maximum(
            np.hypot(dense[:, 0], dense[:, 1]),
            np.abs(dense[:, 2]) / vehicle.boundary_curvature,
        )
        poles += int((c <= POLE).any())
        for column, row in enumerate(judge.rows):
            if row.limit != "SINGULAR_ZONE" or not math.isfinite(high[0, column]):
                continue
            reached = asked(vehicle, row.wheel, dense).max()
            assert reached <= high[0, column] * (1 + 1e-6) + 1e-9
            assert low[0, column] <= reached * (1 + 1e-6) + 1e-9
            checked += 1
    assert checked > 150
    assert poles > 30


@pytest.mark.parametrize(("rate", "is_permitted"), [(0.97, True), (1.03, False)])
@pytest.mark.parametrize("direction", [0.0, np.pi / 2, 1.0])
def test_turning_on_the_spot_is_judged_alike_whatever_comes_before(
    rate: float, is_permitted: bool, direction: float
) -> None:
    # At the pole the wheel needs 1 rad per unit of κ_n at worst, 0 for leaving along y.
    wheels = [
        {"id": f"w{i}", "type": "steered", "x": x, "y": 0.0, "max_speed": 1.0}
        for i, x in enumerate((0.5, -0.5))
    ]
    for wheel in wheels:
        wheel["max_steering_rate_deg"] = math.degrees(1.0)
    guaranteed = {"kappa_rate": rate}
    vehicle = configspace.vehicle_from_data(
        {"name": "v", "wheels": wheels, "guaranteed": guaranteed}
    )
    space = configspace.build_space(vehicle, configspace.Grid(40, 72), cache=False)
    assert (float(exact_v_max(vehicle, 2.0, direction)) > 0) == is_permitted
    assert (float(space.v_max(2.0, direction)) > 0) == is_permitted
    spin = Trajectory.from_twists([0.0, 1.0, 2.0], [[0, 0, 0.5]] * 3)
    assert validate(spin, space).valid == is_permitted
    # Through the pole along one direction, slowly; the pole is between two samples.
    v = 1e-3 * np.array([math.cos(direction), math.sin(direction), 0.0])
    twists = np.array([[0, 0, 0.5] - v, [0, 0, 0.5] + 2 * v])
    through = Trajectory.from_twists([0.0, 1.0], twists)
    assert validate(through, space).valid == is_permitted
