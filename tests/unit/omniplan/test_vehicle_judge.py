import math
from collections.abc import Iterator

import naive_motion
import numpy as np
import pytest

import configspace
from configspace import Vehicle
from configspace.testing import random_vehicle
from configspace.vehicle import SteeredWheel
from omniplan import Tolerances, Trajectory
from omniplan.judging.proof import Proof
from omniplan.judging.rows import Row
from omniplan.judging.vehicle_judge import VehicleJudge
from omniplan.motion import Intervals, motion_of

FAST = 0.05  # m/s: well above standstill


def everything_limited(rng: np.random.Generator) -> Vehicle:
    data = random_vehicle(rng).model_dump(mode="json")
    for wheel in data["wheels"]:
        if wheel["type"] == "steered":
            wheel["max_steering_rate_deg"] = 90.0
        if wheel["type"] != "castor":
            wheel["max_acceleration"] = 0.7
    data["limits"] |= {
        "max_speed": 0.8,
        "max_reverse_speed": 0.3,
        "max_yaw_rate_deg": 40.0,
        "max_lateral_acceleration": 0.4,
        "max_acceleration": 0.5,
        "max_deceleration": 0.6,
    }
    return configspace.vehicle_from_data(data)


def dense(simulation: naive_motion.Simulation, row: Row, sign: int) -> float:
    """Largest value of a row over the samples, divided by its bound."""
    s, dt = simulation, np.diff(simulation.t)
    whole = {
        "SPEED": s.speed,
        "YAW_RATE": np.abs(s.omega),
        "LATERAL_ACCELERATION": np.abs(s.omega) * s.speed,
        "ACCELERATION": np.diff(s.speed) / dt,
        "DECELERATION": -np.diff(s.speed) / dt,
    }
    if row.limit in whole:
        return max(float(whole[row.limit].max()), 0.0) / row.bound
    wheel = s.vehicle.wheels[row.wheel]
    piece = naive_motion.Piece(0, len(s.t) - 1)
    if row.limit == "STEER_RATE":
        alpha = s.steering(row.wheel, sign, piece)
        return float((np.abs(np.diff(alpha)) / dt).max()) / row.bound
    if row.limit == "STEER_RANGE":
        assert isinstance(wheel, SteeredWheel)
        middle = sum(wheel.steering_range) / 2
        ux, uy = s.wheel_velocity(row.wheel)
        off = np.arctan2(sign * uy, sign * ux) - middle
        off = np.abs(np.arctan2(np.sin(off), np.cos(off)))
        return float(off.max()) / row.bound
    if row.limit == "WHEEL_SPEED":
        return float(np.abs(s.rolling(row.wheel)).max()) / row.bound
    if row.limit == "WHEEL_ACCELERATION":
        return float((np.abs(np.diff(s.rolling(row.wheel))) / dt).max()) / row.bound
    assert row.limit == "FIXED_WHEEL"
    ux, uy = s.wheel_velocity(row.wheel)
    delta = wheel.heading  # type: ignore[union-attr]
    aside = np.abs(uy * math.cos(delta) - ux * math.sin(delta))
    allowed = np.maximum(math.sin(naive_motion.SLIP_ANGLE) * s.v_s, 5e-3)
    return float((aside / allowed).max())


def random_parts(
    seed: int, form: str
) -> Iterator[
    tuple[VehicleJudge, Trajectory, Intervals, naive_motion.TwistAt, Vehicle]
]:
    rng = np.random.default_rng(seed)
    for _ in range(40):
        vehicle = everything_limited(rng)
        t = np.cumsum(rng.uniform(0.2, 0.6, 7))
        if form == "poses":
            samples = np.cumsum(rng.normal(size=(7, 3)) * [0.2, 0.2, 0.3], axis=0)
            trajectory = Trajectory.from_poses(t, samples)
            at = naive_motion.pose_motion(t, samples, 0.0, 0.0)
        else:
            samples = rng.normal(size=(7, 3)) * 0.5
            trajectory = Trajectory.from_twists(t, samples)
            at = naive_motion.twist_motion(t, samples, 0.0, 0.0)
        judge = VehicleJudge(vehicle, Tolerances(), is_own=False, has_rates=True)
        parts = motion_of(trajectory, is_own=False).intervals()
        for _ in range(int(rng.integers(0, 7))):
            parts = parts.halved(np.ones(parts.t0.shape, dtype=bool))
        keep = rng.choice(parts.t0.size, 6)
        some = Intervals(parts.knot[keep], parts.t0[keep], parts.t1[keep])
        yield judge, trajectory, some, at, vehicle


@pytest.mark.parametrize(("form", "seed"), [("twists", 1), ("poses", 2)])
@pytest.mark.parametrize("sign", [1, -1])
def test_every_utilisation_is_enclosed(form: str, seed: int, sign: int) -> None:
    seen: dict[str, int] = {}
    for judge, trajectory, parts, at, vehicle in random_parts(seed, form):
        enclosure = motion_of(trajectory, is_own=False).enclose(parts)
        low, high = judge.utilisation(enclosure, sign)
        assert (low <= high * (1 + 1e-9) + 1e-9).all()
        followed = {wheel.column for wheel in judge.winding_wheels}
        for i in range(parts.t0.size):
            # Tiny first and last steps: differences there are the rates at the ends.
            f = np.concatenate([[0, 1e-6], np.linspace(0, 1, 400)[1:-1], [1 - 1e-6, 1]])
            when = parts.t0[i] + f * (parts.t1[i] - parts.t0[i])
            simulation = naive_motion.Simulation(vehicle, when, at(when))
            if simulation.v_s.min() < FAST:
                continue
            for column, row in enumerate(judge.rows):
                if row.limit in {"SINGULAR", "REVERSE_SPEED"} or column in followed:
                    continue
                if not math.isfinite(high[i, column]):
                    continue
                reached = dense(simulation, row, sign)
                where = (row, reached, low[i, column], high[i, column])
                assert reached <= high[i, column] * (1 + 1e-6) + 1e-7, where
                assert low[i, column] <= reached * (1 + 1e-3) + 1e-4, where
                seen[row.limit] = seen.get(row.limit, 0) + 1
    assert len(seen) == 10
    assert min(seen.values()) > 10


def test_halving_closes_the_enclosure() -> None:
    for judge, trajectory, parts, _, _ in random_parts(3, "poses"):
        motion = motion_of(trajectory, is_own=False)
        means = []
        for _ in range(12):
            parts = parts.halved(np.ones(parts.t0.shape, dtype=bool))
            low, high = judge.utilisation(motion.enclose(parts), 1)
            finite = np.isfinite(low) & np.isfinite(high)
            means.append(float((high - low)[finite].mean()))
        assert means[-1] < 0.2 * means[4]


def test_reverse_speed_is_judged_where_the_configuration_is_driven_backwards() -> None:
    vehicle = configspace.load_vehicle("ift-four-steered")
    judge = VehicleJudge(vehicle, Tolerances(), is_own=False, has_rates=True)
    trajectory = Trajectory.from_twists([0, 1], [[-0.5, 0, 0]] * 2)
    motion = motion_of(trajectory, is_own=False)
    enclosure = motion.enclose(motion.intervals())
    column = [row.limit for row in judge.rows].index("REVERSE_SPEED")
    assert judge.utilisation(enclosure, 1)[1][0, column] == 0
    assert judge.utilisation(enclosure, -1)[0][0, column] == pytest.approx(0.5)


def test_a_wheel_under_the_centre_of_rotation_is_singular() -> None:
    vehicle = configspace.load_vehicle("ift-four-steered")
    wheel = vehicle.wheels[0]
    v = [wheel.y * 0.5, -wheel.x * 0.5, 0.5]  # v = -ω x w
    judge = VehicleJudge(vehicle, Tolerances(), is_own=False, has_rates=True)
    motion = motion_of(Trajectory.from_twists([0, 1], [v, v]), is_own=False)
    low, high = judge.utilisation(motion.enclose(motion.intervals()), 1)
    singular = [i for i, row in enumerate(judge.rows) if row.limit == "SINGULAR"]
    assert np.isinf(low[0, singular]).tolist() == [True, False, False, False]
    assert np.isinf(high[0, singular]).tolist() == [True, False, False, False]


def test_the_proof_decides_or_reaches_its_resolution() -> None:
    vehicle = configspace.load_vehicle("differential")
    trajectory = Trajectory.from_twists(
        [0.0, 1, 2], [[0.0, 0, 0], [1.0, 0, 0], [0.5, 0, 1]]
    )
    motion = motion_of(trajectory, is_own=False)
    judge = VehicleJudge(vehicle, Tolerances(), is_own=False, has_rates=True)
    proof = Proof(motion, judge, Tolerances())
    proof.decide()
    spans = proof.parts.spans
    assert spans.t0[0] == 0
    assert spans.t1[-1] == 2
    assert (spans.t0[1:] == spans.t1[:-1]).all()
    low, high = proof.parts.low[1], proof.parts.high[1]
    assert ((high <= 1 + 1e-12) | (low > 1) | (high - low < 1e-6)).all()


def brake(limits: dict[str, float], speeds: list[float]) -> list[str]:
    from omniplan import validate

    data = configspace.load_vehicle("differential").model_dump(mode="json")
    for wheel in data["wheels"]:
        wheel.pop("max_acceleration", None)
    data["limits"] = limits
    space = configspace.build_space(configspace.vehicle_from_data(data), cache=False)
    twists = [[speed, 0, 0] for speed in speeds]
    trajectory = Trajectory.from_twists(np.arange(len(speeds)) * 1.0, twists)
    return [v.limit for v in validate(trajectory, space).violations]


@pytest.mark.parametrize("direction", [1, -1])
def test_braking_to_rest_is_no_acceleration(direction: int) -> None:
    speeds = [0.9 * direction, 0.0]
    assert brake({"max_acceleration": 0.1, "max_deceleration": 1.0}, speeds) == []
    assert brake({"max_acceleration": 0.1, "max_deceleration": 0.8}, speeds) == [
        "DECELERATION"
    ]


@pytest.mark.parametrize("direction", [1, -1])
def test_starting_from_rest_is_no_deceleration(direction: int) -> None:
    speeds = [0.0, 0.9 * direction]
    assert brake({"max_acceleration": 1.0, "max_deceleration": 0.1}, speeds) == []
    assert brake({"max_acceleration": 0.8, "max_deceleration": 0.1}, speeds) == [
        "ACCELERATION"
    ]


def test_reversing_brakes_and_starts() -> None:
    speeds = [0.5, -0.4]
    assert brake({"max_acceleration": 1.0, "max_deceleration": 1.0}, speeds) == []
    for slow in ("max_acceleration", "max_deceleration"):
        limits = {"max_acceleration": 1.0, "max_deceleration": 1.0, slow: 0.8}
        assert brake(limits, speeds) == [slow.removeprefix("max_").upper()]


def test_braking_poses_to_rest_is_no_acceleration() -> None:
    from omniplan import validate

    data = configspace.load_vehicle("differential").model_dump(mode="json")
    data["limits"] = {"max_acceleration": 0.45, "max_deceleration": 1.0}
    space = configspace.build_space(configspace.vehicle_from_data(data), cache=False)
    t = np.linspace(0, 1, 21)
    x = 0.8 * t - 0.4 * t**2  # from 0.8 m/s to rest at 0.8 m/s²
    trajectory = Trajectory.from_poses(t, np.stack([x, 0 * x, 0 * x], axis=-1))
    assert validate(trajectory, space).valid
