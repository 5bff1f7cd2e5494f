"""A verdict "valid" is held against formulas and simulations that share no code."""

from __future__ import annotations

import itertools
import json
import logging
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import naive
import naive_limits
import naive_motion
import numpy as np
import numpy.typing as npt
import pytest
from verdict_cases import with_rates

import configspace
from configspace import Grid, PermissibleSpace, Vehicle
from configspace.testing import VEHICLE_KINDS, random_vehicle, rigid_body
from configspace.vehicle import SteeredWheel
from omniplan import (
    InvalidTrajectory,
    Report,
    Tolerances,
    Trajectory,
    Violation,
    validate,
)
from omniplan.validation import judged

FloatArray = npt.NDArray[np.float64]
GRID = Grid(100, 180)
COARSE = Grid(40, 72)


# --- straight pieces in the (κ_n, β) plane


@dataclass(frozen=True)
class Piece:
    vehicle: Vehicle
    space: PermissibleSpace
    sheet: PermissibleSpace
    kappa_n: FloatArray
    beta: FloatArray
    v_n: FloatArray

    @property
    def trajectory(self) -> Trajectory:
        t = [0.0, 100.0]
        return Trajectory.from_omni_curve(
            t, self.kappa_n, self.beta, self.v_n, self.vehicle
        )

    def places(self, count: int = 601) -> tuple[FloatArray, FloatArray]:
        """Places along the piece, many of them around the kinks."""
        f = [np.linspace(0, 1, count)]
        near = [s * 10.0**-e for e in range(3, 13, 3) for s in (-1, 1)]
        span = self.kappa_n[1] - self.kappa_n[0]
        for kink in (-1.0, 0.0, 1.0):
            if span != 0:
                f.append((kink - self.kappa_n[0]) / span + np.array([0.0, *near]))
        at = np.concatenate(f)
        at = at[(at >= 0) & (at <= 1)]
        k = np.clip(self.kappa_n[0] + at * span, -2, 2)
        return k, self.beta[0] + at * (self.beta[1] - self.beta[0])

    def tips(self) -> tuple[FloatArray, FloatArray]:
        """Places of the piece next to the ICR of a steered wheel, densely."""
        k, b = self.places()
        z = np.abs(configspace.wheel_directions(self.vehicle, k, b))
        z = np.where(np.isnan(z), np.inf, z)
        f = []
        for i, wheel in enumerate(self.vehicle.wheels):
            if isinstance(wheel, SteeredWheel):
                order = np.argsort(
                    np.abs(k - self.kappa_n[0]) + np.abs(b - self.beta[0])
                )
                nearest = int(np.argmin(z[order, i])) / max(len(order) - 1, 1)
                f.append(np.clip(nearest + np.linspace(-0.003, 0.003, 61), 0, 1))
        at = np.concatenate(f) if f else np.zeros(1)
        k = np.clip(self.kappa_n[0] + at * (self.kappa_n[1] - self.kappa_n[0]), -2, 2)
        return k, self.beta[0] + at * (self.beta[1] - self.beta[0])

    def permits(self) -> tuple[bool, bool]:
        """Whether every place is permitted; whether all are, by a clear distance."""
        k, b = (
            np.concatenate(both)
            for both in zip(self.places(), self.tips(), strict=True)
        )
        truth = rigid_body(self.vehicle, k, b, reverse=bool(self.v_n[0] < 0))
        # An angle is as exact as rounding and the wheel's own speed let it be.
        fine = (truth.margin > -1e-9) & (truth.stillness > 1e-12) & (truth.v_max > 0)
        room = min(float(truth.margin.min()), self.seam_room(k, b))
        clear = room > 1e-3 and float(truth.stillness.min()) > 1e-3
        return bool(fine.all()), clear

    def seam_room(self, k: FloatArray, b: FloatArray) -> float:
        """Room to the seam of wheels that turn by a full turn or more, not freely."""
        z = configspace.wheel_directions(self.vehicle, k, b)
        room = math.inf
        for i, wheel in enumerate(self.vehicle.wheels):
            if not isinstance(wheel, SteeredWheel) or wheel.steering_range_deg is None:
                continue
            least, largest = map(math.radians, wheel.steering_range_deg)
            if largest - least >= 2 * math.pi:
                middle = np.exp(1j * (least + largest) / 2)
                aside = np.abs(np.angle(z[:, i] / middle))
                room = min(room, math.pi - float(aside.max()))
        return room


def pieces(seed: int, vehicles: int, each: int) -> Iterator[Piece]:
    """Random pieces of random vehicles; every tenth is the paper's."""
    rng = np.random.default_rng(seed)
    paper = configspace.load_vehicle("ift-four-steered")
    for count in range(vehicles):
        vehicle = paper if count % 10 == 0 else random_vehicle(rng)
        space = configspace.build_space(vehicle, GRID, cache=False)
        sheet = configspace.parse_space(configspace.dump_space(space))
        line = naive.constant_beta(vehicle)
        for _ in range(each):
            size = rng.choice([0.02, 0.2, 1.0, 3.0])
            k0 = rng.uniform(-2, 2)
            k1 = np.clip(k0 + rng.uniform(-1, 1) * size, -2, 2)
            b0 = rng.uniform(-np.pi, np.pi)
            b1 = b0 + np.clip(rng.uniform(-1, 1) * size, -3, 3)
            if line is not None:
                # Beside the line clearly: within a degree is a tolerance for slip.
                aside = 0.0 if rng.random() < 0.9 else rng.uniform(0.1, 1.4)
                b0 = b1 = line + aside
                if aside:
                    k0, k1 = np.clip((k0, k1), -1.5, 1.5)
            v_n = rng.uniform(0.05, 1, 2) * rng.choice([-1, 1])
            k, b = np.array([k0, k1]), np.array([b0, b1])
            yield Piece(vehicle, space, sheet, k, b, v_n)


def assert_pieces_are_sound(seed: int, vehicles: int, each: int) -> None:
    """Judge pieces without advice, which costs as much again as the verdict."""
    permitted = clear = by_vehicle = by_sheet = 0
    for piece in pieces(seed, vehicles, each):
        trajectory = piece.trajectory
        known, published = (
            judged(trajectory, space, Tolerances(), False).valid
            for space in (piece.space, piece.sheet)
        )
        is_permitted, is_clear = piece.permits()
        where = (piece.vehicle.wheels, piece.kappa_n, piece.beta, piece.v_n)
        assert is_permitted or not known, where
        assert is_permitted or not published, where
        permitted += is_permitted
        clear += is_clear
        by_vehicle += is_clear and known
        by_sheet += is_clear and published
    figures = (
        f"{vehicles * each} pieces, {permitted} permitted, {clear} clearly; of these "
        f"valid by the vehicle {by_vehicle}, by the data sheet {by_sheet}"
    )
    logging.getLogger(__name__).info(figures)
    assert clear > 0.3 * vehicles * each
    assert by_vehicle > 0.99 * clear
    # A piece through a mixed cell of the table is refused.
    assert by_sheet > 0.9 * clear


def test_valid_pieces_are_permitted_all_along() -> None:
    assert_pieces_are_sound(1, vehicles=20, each=20)


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("seed", range(2, 14))  # 24,000 pieces
def test_many_more_valid_pieces_are_permitted_all_along(seed: int) -> None:
    assert_pieces_are_sound(seed, vehicles=100, each=20)


def test_twists_are_refused_beyond_v_max_and_taken_just_below() -> None:
    rng = np.random.default_rng(4)
    taken = 0
    for _ in range(40):
        vehicle = random_vehicle(rng)
        space = configspace.build_space(vehicle, COARSE, cache=False)
        sheet = configspace.parse_space(configspace.dump_space(space))
        line = naive.constant_beta(vehicle)
        k = float(rng.uniform(-2, 2))
        b = float(rng.uniform(-3, 3)) if line is None else line
        forward = naive.exact(vehicle, k, b)
        backward = naive.exact(vehicle, -k, b + math.pi, reverse=True)
        if line is not None:
            backward = forward
        fastest = max(forward.permitted, backward.permitted)
        kx, ky = naive.reference(vehicle)
        for share in (0.999, 1.001):
            v_s = share * (fastest or 0.5)
            vx, vy, omega = naive.twist(k, b, v_s, naive.kappa_g(vehicle))
            twist = [vx + omega * ky, vy - omega * kx, omega]
            trajectory = Trajectory.from_twists([0, 1], [twist, twist])
            known = validate(trajectory, space).valid
            assert known == (share < 1 and fastest > 0)
            assert known or not validate(trajectory, sheet).valid
            taken += known
    assert taken > 10


# --- motions against a simulation


@dataclass(frozen=True)
class Case:
    vehicle: Vehicle
    space: PermissibleSpace
    trajectory: Trajectory
    twist_at: naive_motion.TwistAt
    per_interval: int

    @cached_property
    def simulation(self) -> naive_motion.Simulation:
        t = self.trajectory.t
        return naive_motion.simulate(
            self.vehicle,
            t,
            self.twist_at,
            self.per_interval,
            has_swing=self.trajectory.form == "poses",
        )


def random_twists(
    rng: np.random.Generator, vehicle: Vehicle, point: tuple[float, float]
) -> tuple[FloatArray, FloatArray]:
    """Twists that follow the vehicle's mobility; with stops, cusps, both directions."""
    n = int(rng.integers(3, 9))
    t = np.concatenate([[0.0], np.cumsum(rng.uniform(0.3, 2.0, n - 1))])
    wander = rng.choice([0.0, 0.05, 0.3], 2)
    k = np.clip(rng.uniform(-1.8, 1.8) + np.cumsum(rng.normal(0, wander[0], n)), -2, 2)
    b = rng.uniform(-np.pi, np.pi) + np.cumsum(rng.normal(0, wander[1], n))
    line = naive.constant_beta(vehicle)
    if line is not None:
        b = np.full(n, line)
    share = rng.uniform(0.1, 1) * rng.uniform(0.3, 1, n) * rng.choice([-1, 1])
    ends = rng.integers(4)
    if ends == 0:
        share[[0, -1]] = 0
    elif ends == 1 and n > 4:
        share[n // 2] = 0
        share[n // 2 + 1 :] *= rng.choice([-1, 1])
    permitted = configspace.exact_v_max(vehicle, k, b)
    v_s = share * np.where(permitted > 0, np.minimum(permitted, 3.0), 0.3)
    kappa_g, (kx, ky), (x, y) = naive.kappa_g(vehicle), naive.reference(vehicle), point
    rows = np.stack([k, b, v_s], axis=-1).tolist()
    twists = np.array([naive.twist(kn, be, v, kappa_g) for kn, be, v in rows])
    twists[:, 0] -= twists[:, 2] * (y - ky)
    twists[:, 1] += twists[:, 2] * (x - kx)
    return t, twists


def integrated(t: FloatArray, twists: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Poses that twists lead through, eight per interval."""
    when = naive_motion.instants(t, 160)
    v = np.stack([np.interp(when, t, column) for column in twists.T], axis=-1)
    dt = np.diff(when)
    theta = np.concatenate([[0.0], np.cumsum((v[1:, 2] + v[:-1, 2]) / 2 * dt)])
    world = (v[:, 0] + 1j * v[:, 1]) * np.exp(1j * theta)
    p = np.concatenate([[0.0], np.cumsum((world[1:] + world[:-1]) / 2 * dt)])
    return when[::20], np.stack([p.real, p.imag, theta], axis=-1)[::20]


def cases(seed: int, form: str, vehicles: int, each: int = 4) -> Iterator[Case]:
    rng = np.random.default_rng(seed)
    for count in range(vehicles):
        kind = VEHICLE_KINDS[count % len(VEHICLE_KINDS)]
        vehicle = with_rates(rng, random_vehicle(rng, kind))
        space = configspace.build_space(vehicle, COARSE, cache=False)
        for _ in range(each):
            point = (0.0, 0.0)
            if rng.random() < 0.4:
                point = (float(rng.uniform(-0.5, 0.5)), float(rng.uniform(-0.5, 0.5)))
            t, samples = random_twists(rng, vehicle, point)
            if form == "poses":
                t, samples = integrated(t, samples)
                try:
                    trajectory = Trajectory.from_poses(
                        t, samples, reference_point=point
                    )
                except InvalidTrajectory:
                    continue  # turns by more than a quarter turn per sample
                at = naive_motion.pose_motion(t, samples, *point)
                steps = 20
            else:
                trajectory = Trajectory.from_twists(t, samples, reference_point=point)
                at = naive_motion.twist_motion(t, samples, *point)
                steps = 60
            yield Case(vehicle, space, trajectory, at, steps)


@pytest.mark.parametrize(("form", "seed"), [("twists", 10), ("poses", 11)])
def test_a_valid_motion_breaks_no_limit_in_a_simulation(form: str, seed: int) -> None:
    valid = forwards = backwards = left = right = 0
    for case in cases(seed, form, vehicles=48):
        if not validate(case.trajectory, case.space).valid:
            continue
        simulation = case.simulation
        assert naive_limits.breaches(simulation) == []
        valid += 1
        forwards += bool((simulation.kx > 0.01).any())
        backwards += bool((simulation.kx < -0.01).any())
        left += bool((simulation.omega > 0.01).any())
        right += bool((simulation.omega < -0.01).any())
    assert min(forwards, backwards, left, right) > 12
    assert valid > 60


@pytest.mark.parametrize(("form", "seed"), [("twists", 12), ("poses", 13)])
def test_a_proved_violation_is_found_there_by_the_simulation(
    form: str, seed: int
) -> None:
    seen: dict[str, int] = {}
    for case in cases(seed, form, vehicles=60):
        report = validate(case.trajectory, case.space)
        for violation in report.violations:
            if violation.is_proved and violation.limit != "RECONFIGURATION":
                assert_is_taken(case, violation)
                seen[violation.limit] = seen.get(violation.limit, 0) + 1
    assert {"STEER_RANGE", "STEER_RATE", "WHEEL_ACCELERATION"} <= set(seen)


def assert_is_taken(case: Case, violation: Violation) -> None:
    """The value is taken at the time named, from one side of it or the other."""
    assert violation.value is not None
    if violation.limit == "STEER_RANGE":
        assert is_outside(case.vehicle, violation)
    elif violation.limit != "SINGULAR":
        assert violation.excess > 0
    assert violation.t_start <= violation.t <= violation.t_end
    t = case.trajectory.t
    assert t[violation.index] <= violation.t + 1e-9
    if violation.limit == "STEER_ACCELERATION":
        assert_swings_so(case, violation)
        return
    h = 1e-6
    values = []
    for first in (violation.t - h, violation.t):
        when = np.array([first, first + h])
        if when[0] < t[0] or when[1] > t[-1]:
            continue
        here = naive_motion.Simulation(case.vehicle, when, case.twist_at(when))
        values.append(value_of(here, violation))
    assert any(
        np.isclose(value, violation.value, rtol=2e-3, atol=2e-4) for value in values
    ), (violation, values)


def assert_swings_so(case: Case, violation: Violation) -> None:
    """The value is that of differences before or after the time named.

    Second ones of third order, as an acceleration may jump there.
    """
    (wheel,) = (w for w in case.vehicle.wheels if w.id == violation.wheel)
    assert violation.value is not None
    values = []
    for h in (3e-5, -3e-5):
        when: FloatArray = violation.t + h * np.arange(5.0)
        if when.min() < case.trajectory.t[0] or when.max() > case.trajectory.t[-1]:
            continue
        u = naive_motion.point_velocity(case.twist_at(when), wheel.x, wheel.y)
        alpha = np.unwrap(np.angle(u))
        values.append(abs(float(alpha @ [35, -104, 114, -56, 11])) / 12 / h**2)
    assert any(
        np.isclose(value, violation.value, rtol=2e-3, atol=1e-2) for value in values
    ), (violation, values)


def is_outside(vehicle: Vehicle, violation: Violation) -> bool:
    """Whether the angle is outside the range, which ends at the bound."""
    (wheel,) = (w for w in vehicle.wheels if w.id == violation.wheel)
    assert isinstance(wheel, SteeredWheel)
    assert wheel.steering_range_deg is not None
    assert violation.value is not None
    least, largest = map(math.radians, wheel.steering_range_deg)
    full = largest - least >= 2 * math.pi
    at_bound = full or min(abs(violation.bound - x) for x in (least, largest)) < 1e-9
    return at_bound and not least <= violation.value <= largest


def value_of(here: naive_motion.Simulation, violation: Violation) -> float:
    """The value of a limit over one tiny step of a simulation."""
    dt = float(here.t[1] - here.t[0])
    speed_gain = float(here.speed[1] - here.speed[0]) / dt
    whole: dict[str, float] = {
        "SPEED": float(here.speed.max()),
        "REVERSE_SPEED": float(here.speed.max()),
        "YAW_RATE": float(np.abs(here.omega).max()),
        "LATERAL_ACCELERATION": float((np.abs(here.omega) * here.speed).max()),
        "ACCELERATION": speed_gain,
        "DECELERATION": -speed_gain,
    }
    if violation.wheel is None:
        return whole[violation.limit]
    ids = [wheel.id for wheel in here.vehicle.wheels]
    i = ids.index(violation.wheel)
    ux, uy = here.wheel_velocity(i)
    if violation.limit == "FIXED_WHEEL":
        wheel: Any = here.vehicle.wheels[i]
        delta = math.radians(wheel.heading_deg)
        aside = np.abs(uy * math.cos(delta) - ux * math.sin(delta))
        allowed = np.maximum(math.sin(naive_motion.SLIP_ANGLE) * here.v_s, 5e-3)
        worst = float((aside / allowed).max()) * math.sin(naive_motion.SLIP_ANGLE)
        return math.asin(min(worst, 1.0))
    if violation.limit in {"STEER_RANGE", "STEER_RATE"}:
        alpha = np.unwrap(np.arctan2(uy, ux))
        if violation.limit == "STEER_RATE":
            return float(abs(alpha[1] - alpha[0])) / dt
        # In the representation that is named: half a turn on where v_s < 0.
        direction = math.atan2(here.ky[0], here.kx[0])
        opposite = math.cos(violation.beta - direction) < 0
        sign = -1 if opposite else 1
        if here.speed[0] < 1e-6:  # rotation about K: the sign of ω tells
            sign = 1 if violation.kappa_n * here.omega[0] > 0 else -1
        angle = math.atan2(sign * uy[0], sign * ux[0])
        assert violation.value is not None
        return violation.value + math.remainder(angle - violation.value, 2 * math.pi)
    if violation.limit == "SINGULAR":
        return float(np.hypot(ux, uy).min())
    u = here.rolling(i)
    if violation.limit == "WHEEL_SPEED":
        return float(np.abs(u).max())
    assert violation.limit == "WHEEL_ACCELERATION"
    return float(abs(u[1] - u[0])) / dt


# --- relations between verdicts; test_verdicts_relations has more


FORMS = pytest.mark.parametrize(("form", "seed"), [("twists", 20), ("poses", 21)])


@FORMS
def test_at_the_speed_factor_a_motion_is_valid(form: str, seed: int) -> None:
    faster = slower = 0
    for case in cases(seed + 30, form, vehicles=48, each=3):
        report = validate(case.trajectory, case.space)
        if report.speed_factor > 0:
            scaled = case.trajectory.scaled(report.speed_factor * 0.998)
            limits = {v.limit for v in validate(scaled, case.space).violations}
            # See test_validation: a standstill shrinks by more than the factor.
            assert limits <= {"RECONFIGURATION"}
            faster += report.valid
            slower += not report.valid
        if not report.valid:
            assert report.speed_factor < 1
    assert faster > 20
    assert slower > 2


@FORMS
def test_plain_data_gives_the_same_verdict(form: str, seed: int) -> None:
    for case in cases(seed + 40, form, vehicles=12, each=2):
        report = validate(case.trajectory, case.space)
        text = json.dumps(case.trajectory.to_dict(), allow_nan=False)
        assert validate(Trajectory.from_dict(json.loads(text)), case.space) == report
        text = json.dumps(report.to_dict(), allow_nan=False)
        assert Report.from_dict(json.loads(text)) == report


@FORMS
def test_advice_makes_the_trajectory_valid(form: str, seed: int) -> None:
    given = 0
    for case in cases(seed + 50, form, vehicles=48, each=3):
        report = validate(case.trajectory, case.space)
        assert not (report.valid and report.advice)
        for advice in report.advice:
            if advice.kind == "slow_down":
                slower = case.trajectory.scaled(advice.value)
                assert validate(slower, case.space).valid
                given += 1
    assert given > 2


@pytest.mark.parametrize(
    "vehicles",
    [10, pytest.param(30, marks=[pytest.mark.slow, pytest.mark.timeout(600)])],
)
def test_a_foreign_omni_curve_motion_is_judged_by_its_twists(vehicles: int) -> None:
    rng = np.random.default_rng(70)
    valid = 0
    for _ in range(vehicles):
        owner, other = random_vehicle(rng), with_rates(rng, random_vehicle(rng))
        space = configspace.build_space(other, COARSE, cache=False)
        line = naive.constant_beta(owner)
        kappa_g, (kx, ky) = naive.kappa_g(owner), naive.reference(owner)
        for _ in range(4):
            n, size = int(rng.integers(2, 5)), rng.choice([0.02, 0.2, 1.0])
            t: FloatArray = np.linspace(0.0, 10.0 * (n - 1), n)
            k = np.clip(
                rng.uniform(-2, 2) + np.cumsum(rng.uniform(-1, 1, n)) * size, -2, 2
            )
            b = rng.uniform(-3, 3) + np.cumsum(rng.uniform(-1, 1, n)) * size
            if line is not None:
                b = np.full(n, line)
            v_n = rng.uniform(0.05, 0.5) * rng.uniform(0.3, 1, n) * rng.choice([-1, 1])

            def twist_at(
                when: FloatArray,
                t: FloatArray = t,
                samples: tuple[FloatArray, FloatArray, FloatArray] = (k, b, v_n),
                owner: Vehicle = owner,
                frame: tuple[float, float, float] = (kappa_g, kx, ky),
            ) -> FloatArray:
                kk, bb, vv = (np.interp(when, t, column) for column in samples)
                back = bool(vv[0] < 0)
                kk = np.clip(kk, -2, 2)
                v_s = vv * configspace.exact_v_max(owner, kk, bb, reverse=back)
                rows = np.stack([kk, bb, v_s], axis=-1).tolist()
                twists = np.array(
                    [naive.twist(kn, be, v, frame[0]) for kn, be, v in rows]
                )
                twists[:, 0] += twists[:, 2] * frame[2]
                twists[:, 1] -= twists[:, 2] * frame[1]
                return twists

            trajectory = Trajectory.from_omni_curve(t, k, b, v_n, owner)
            if not judged(trajectory, space, Tolerances(), False).valid:
                continue
            simulation = naive_motion.simulate(
                other, t, twist_at, 40, has_accelerations=False
            )
            assert naive_limits.breaches(simulation) == []
            valid += 1
    assert valid > vehicles / 2


def test_pairs_of_headings_and_representations_give_the_same_twist() -> None:
    # Fact 1 of the specification, on which the naive simulation rests as well.
    for k, b in itertools.product((-1.5, -0.3, 0.0, 0.8, 2.0), (-2.0, 0.0, 1.0)):
        one = naive.twist(k, b, 0.7, 4.0)
        other = naive.twist(-k, b + math.pi, -0.7, 4.0)
        assert one == pytest.approx(other, abs=1e-12)
