"""The solver's formulas against a simulation that shares no code with them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import naive_limits
import naive_motion
import numpy as np
import numpy.typing as npt
import pytest
import random_motions
from timing_cases import demanding_vehicle

from configspace import Vehicle, catalog, load_vehicle
from configspace.testing import VehicleKind, random_vehicle
from omniplan.optimising.cubics import Cubic, Rest, corners, twists_at
from omniplan.optimising.limits import (
    Bound,
    Functions,
    Rules,
    Tightness,
    rules_of,
    speed_bounds,
    turn_angles,
)
from omniplan.optimising.realising import trajectory_of
from omniplan.optimising.setting import Guess, Leg
from omniplan.optimising.warm_start import leg_through

FloatArray = npt.NDArray[np.float64]
NUMBERS = Functions(np.sin, np.cos, np.sqrt, np.arctan2)
NONE = Tightness(0.0, 0.0)
SQUARES = {"SPEED", "REVERSE_SPEED", "LATERAL_ACCELERATION"}


def random_leg(rng: np.random.Generator, n: int = 5) -> Leg:
    """A leg from rest to rest that wanders."""
    s = np.linspace(0, 1, n + 1)
    ease = 3 * s**2 - 2 * s**3
    way = rng.uniform(-1, 1, 3) * [1.5, 1.5, 0.8]
    bend = rng.uniform(-0.3, 0.3, 3)
    poses = ease[:, None] * way + (ease * (1 - ease))[:, None] * bend
    return leg_through(np.full(n, rng.uniform(1.0, 2.0) / n), poses)


def cubic_of(leg: Leg, k: int) -> Cubic:
    p, v = leg.poses, leg.rates
    return Cubic(p[k], p[k + 1], v[k], v[k + 1], leg.h[k])


def rest_of(leg: Leg, k: int) -> Rest:
    return "start" if k == 0 else "end" if k == len(leg.h) - 1 else "none"


def bounds_along(rules: Rules, leg: Leg, sign: int, shares: FloatArray) -> list[Bound]:
    return [
        bound
        for k in range(len(leg.h))
        for share in shares
        for bound in speed_bounds(
            rules,
            *twists_at(cubic_of(leg, k), float(share), rest_of(leg, k), NUMBERS)[1:],
            sign,
            NUMBERS,
            NONE,
        )
    ]


def shares_used(
    bounds: Sequence[Bound], vehicle: Vehicle
) -> dict[tuple[str, int], float]:
    """The largest use of every limit, as a share of it."""
    used: dict[tuple[str, int], float] = {}
    for bound in bounds:
        value = float(bound.value)
        if bound.limit == "STEER_RANGE":
            share = math.acos(np.clip(value, -1, 1)) / math.acos(bound.least)
        else:
            share = max(
                value / bound.largest if math.isfinite(bound.largest) else -math.inf,
                value / bound.least if math.isfinite(bound.least) else -math.inf,
            )
            steered = bound.wheel >= 0 and hasattr(
                vehicle.wheels[bound.wheel], "offsets"
            )
            beside = steered and (
                any(vehicle.wheels[bound.wheel].offsets)  # type: ignore[union-attr]
                or vehicle.wheels[bound.wheel].steering_coupling  # type: ignore[union-attr]
            )
            if bound.limit in SQUARES or (
                bound.limit == "WHEEL_SPEED" and steered and not beside
            ):
                share = math.sqrt(max(share, 0.0))
        key = bound.limit, bound.wheel
        used[key] = max(used.get(key, 0.0), share)
    return used


@pytest.mark.parametrize(
    "kind",
    ["steered", "mecanum", "offset", "turntable", "loaded"],
)
def test_limits_are_used_as_much_as_a_simulation_says(kind: VehicleKind) -> None:
    compared = set()
    for seed in range(2):
        rng = np.random.default_rng(seed)
        vehicle = demanding_vehicle(rng, kind)
        rules, leg = rules_of(vehicle), random_leg(rng)
        sign = int(rng.choice([-1, 1])) if rules.has_configuration else 1
        # Wheels that pass near the centre of rotation swing too fast to sample.
        inner = np.linspace(0.002, 0.998, 40)
        used = shares_used(bounds_along(rules, leg, sign, inner), vehicle)
        trajectory = trajectory_of(Guess((leg,), ()), vehicle.reference, "leg")
        simulation = naive_motion.simulate(
            vehicle,
            trajectory.t,
            random_motions.motion_of(trajectory),
            has_swing=True,
        )
        if len(simulation.pieces) != 1:
            continue
        ids = [wheel.id for wheel in vehicle.wheels]
        seen: dict[tuple[str, int], float] = {}
        for use in naive_limits.uses(simulation, [sign]):
            key = use.limit, -1 if use.wheel is None else ids.index(use.wheel)
            seen[key] = max(seen.get(key, 0.0), use.share)
        for key, share in used.items():
            if key not in seen or share > 20 or key[0] in {"STEER_ACCELERATION"}:
                continue
            assert share == pytest.approx(seen[key], rel=0.03, abs=0.01), key
            compared.add(key[0])
    assert {"WHEEL_ACCELERATION", "ACCELERATION", "DECELERATION"} <= compared


def test_steering_ranges_are_those_of_the_simulation() -> None:
    compared = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        vehicle = random_vehicle(rng, "steered")
        rules, leg = rules_of(vehicle), random_leg(rng)
        if not any(math.isfinite(sector.half) for sector in rules.sectors):
            continue
        used = shares_used(
            bounds_along(rules, leg, 1, np.linspace(0.01, 0.99, 40)), vehicle
        )
        trajectory = trajectory_of(Guess((leg,), ()), vehicle.reference, "leg")
        simulation = naive_motion.simulate(
            vehicle, trajectory.t, random_motions.motion_of(trajectory)
        )
        if len(simulation.pieces) != 1 or not simulation.is_clear():
            continue
        (piece,) = simulation.pieces
        for sector in rules.sectors:
            alpha = simulation.steering(sector.wheel, 1, piece)
            off = np.abs(np.angle(np.exp(1j * (alpha - sector.middle)))).max()
            share = used["STEER_RANGE", sector.wheel]
            assert share * sector.half == pytest.approx(off, abs=0.03)
            compared += 1
    assert compared > 5


def test_the_guaranteed_rates_block_where_the_exact_formula_does() -> None:
    from configspace import exact_v_max, vehicle_from_data
    from omniplan.optimising.limits import Pair, Twist

    data = load_vehicle("four-wheel-steering").model_dump(
        mode="json", exclude_none=True
    )
    data["guaranteed"] = {"kappa_rate": 0.3, "beta_rate_deg": 25}
    for wheel in data["wheels"]:
        wheel.pop("steering_range_deg", None)
    vehicle = vehicle_from_data(data)
    rules, rng = rules_of(vehicle), np.random.default_rng(0)
    agree = blocked = 0
    for kappa_n, beta in zip(
        rng.uniform(-1.95, 1.95, 400), rng.uniform(-3.1, 3.1, 400), strict=True
    ):
        c, s = (
            (1.0, kappa_n)
            if abs(kappa_n) < 1
            else (2 - abs(kappa_n), math.copysign(1, kappa_n))
        )
        still = Pair(0.0, 0.0)
        body = Pair(c * math.cos(beta), c * math.sin(beta))
        twist = Twist((body, still, still), (s * vehicle.boundary_curvature, 0.0, 0.0))
        zone = [
            bound.value / bound.largest
            for bound in speed_bounds(rules, twist, twist, 1, NUMBERS, NONE)
            if bound.limit == "SINGULAR_ZONE"
        ]
        is_blocked = float(exact_v_max(vehicle, kappa_n, beta)) == 0
        blocked += is_blocked
        agree += is_blocked == (max(zone) > 1)
    assert blocked > 20
    assert agree >= 398  # rounding at the very border


def test_derivatives_of_twists_are_right_and_directions_are_along_them() -> None:
    rng = np.random.default_rng(3)
    leg, arm, step = random_leg(rng), 0.4 + 0.3j, 1e-5
    for k in range(len(leg.h)):
        cubic = cubic_of(leg, k)
        for share in (0.3, 0.6):
            at = [
                twists_at(
                    cubic, share + side * step / leg.h[k], rest_of(leg, k), NUMBERS
                )
                for side in (-1, 0, 1)
            ]
            for u in (  # the twist and its direction
                [twist.at(arm) for _, twist, _ in at],
                [direction.at(arm) for _, _, direction in at],
            ):
                for order in (0, 1):
                    for axis in ("x", "y"):
                        low, high = (getattr(u[i][order], axis) for i in (0, 2))
                        exact = getattr(u[1][order + 1], axis)
                        assert (high - low) / (2 * step) == pytest.approx(
                            exact, rel=1e-5, abs=1e-5
                        )
            v, d = at[1][1].at(arm)[0], at[1][2].at(arm)[0]
            assert abs(v.cross(d)) < 1e-12
            assert v.dot(d) > 0


def test_directions_do_not_vanish_at_rest() -> None:
    leg = random_leg(np.random.default_rng(5))
    for k, share in ((0, 0.0), (len(leg.h) - 1, 1.0)):
        _, twist, direction = twists_at(
            cubic_of(leg, k), share, rest_of(leg, k), NUMBERS
        )
        assert twist.v[0].square < 1e-20
        assert direction.v[0].square > 1e-3
        # A moment away from rest the twist points there.
        near = share + (1e-5 if k == 0 else -1e-5)
        moving = twists_at(cubic_of(leg, k), near, rest_of(leg, k), NUMBERS)[1]
        across = moving.v[0].cross(direction.v[0])
        size = math.sqrt(moving.v[0].square * direction.v[0].square)
        assert abs(across) < 1e-4 * size
        assert moving.v[0].dot(direction.v[0]) > 0


def test_every_limit_of_the_catalogue_has_a_formula() -> None:
    leg, kinds = random_leg(np.random.default_rng(7)), set()
    twist, direction = twists_at(cubic_of(leg, 2), 0.4, "none", NUMBERS)[1:]
    for name in catalog():
        rules = rules_of(load_vehicle(name))
        bounds = list(speed_bounds(rules, twist, direction, -1, NUMBERS, NONE))
        assert {b.limit for b in bounds} >= {row.limit for row in rules.rows}
        assert all(np.isfinite(b.value) and b.least < b.largest for b in bounds)
        assert any(b.is_swing for b in bounds) == rules.bounds_swing
        kinds |= {row.kind for row in rules.rows}
    assert len(kinds) >= 12


def test_wheels_turn_at_a_corner_as_seen() -> None:
    vehicle = load_vehicle("ift-four-steered")
    rules = rules_of(vehicle)
    ahead, aside = (
        leg_through(np.full(4, 0.5), np.linspace(0, 1, 5)[:, None] ** 2 * np.array(way))
        for way in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    )
    start = twists_at(cubic_of(ahead, 3), 1.0, "end", NUMBERS)[2]
    leave = twists_at(cubic_of(aside, 0), 0.0, "start", NUMBERS)[2]
    for sign, angle in ((1, math.pi / 2), (-1, -math.pi / 2)):
        turned = list(turn_angles(rules, start, leave, sign, NUMBERS))
        assert len(turned) == 4
        for value, rate in turned:
            assert value == pytest.approx(angle)
            assert rate == pytest.approx(math.pi)


def test_corners_are_where_the_body_is() -> None:
    (corner,) = corners([1.0, 2.0, math.pi / 2], [0.5 + 0.25j], NUMBERS)
    assert (corner.x, corner.y) == pytest.approx((0.75, 2.5))
