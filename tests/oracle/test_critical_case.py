"""Connette's critical case with surrogate set-points (spec/steered-wheels §5.7, §5.8).

From s0 to s1 is harmless; the straight way from s1 to s2 crosses the axis of wheel 2,
that from s2 to s3 the one of wheel 3; s3* is the same twist as s3 with every wheel
mirrored, and close to s2.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from connette import RATE, SETS, care_o_bot, long_run

import configspace
from configspace.spherical import from_spherical, spherical_to_omni_curve
from omniplan import Report, Trajectory, validate
from omniplan.standing.transitions import TransitionMap

D = 0.299082
S0, S1, S2 = (0.0, 0.0), (0.2, math.pi / 4), (1.6, math.pi / 4)
S3 = (-1.404666, -1.099557)
S3_MIRRORED = (1.736927, 1.099557)


def omni_curve(point: tuple[float, float]) -> tuple[float, float]:
    kappa_n, beta, _ = spherical_to_omni_curve(1.0, *point)
    return float(kappa_n), float(beta)


@pytest.fixture(scope="module")
def space() -> configspace.PermissibleSpace:
    return configspace.build_space(care_o_bot(), cache=False)


def leg(
    space: configspace.PermissibleSpace,
    start: tuple[float, float],
    end: tuple[float, float],
    duration: float = 4.0,
) -> Report:
    """Judge the straight way in (φ, θ) at ρ = 0.5 m/s, as twists."""
    f = np.linspace(0, 1, 401)[:, None]
    points = np.array(start) + f * (np.array(end) - np.array(start))
    twists = from_spherical(0.5, points[:, 0], points[:, 1], D)
    trajectory = Trajectory.from_twists(f[:, 0] * duration, twists)
    return validate(trajectory, space)


def test_harmless_legs_are_valid(space: configspace.PermissibleSpace) -> None:
    assert leg(space, S0, S1).valid
    assert leg(space, S2, S3_MIRRORED).valid


@pytest.mark.parametrize(
    ("start", "end", "wheel", "fraction"),
    [(S1, S2, "w2", 0.502777), (S2, S3, "w3", 0.833333)],
)
def test_the_straight_way_over_a_wheel_is_refused_there(
    space: configspace.PermissibleSpace,
    start: tuple[float, float],
    end: tuple[float, float],
    wheel: str,
    fraction: float,
) -> None:
    report = leg(space, start, end)
    assert not report.valid
    assert {v.wheel for v in report.violations} == {wheel}
    assert {v.limit for v in report.violations} <= {"SINGULAR", "STEER_RATE"}
    worst = report.headline
    assert worst is not None
    assert worst.t / 4.0 == pytest.approx(fraction, abs=0.003)


def test_own_parameters_meet_the_singular_point(
    space: configspace.PermissibleSpace,
) -> None:
    # κ_n = 1 all along: the way is straight in (κ_n, β) as well.
    vehicle = care_o_bot()
    trajectory = Trajectory.from_omni_curve(
        [0.0, 1.0], [1.0, 1.0], [S1[0], S2[0]], [0.5, 0.5], vehicle
    )
    report = validate(trajectory, space)
    # D of the source is rounded, so the axis is missed by 1e-7 of it: that asks for a
    # turn by half a turn in no time.
    assert {v.wheel for v in report.violations} == {"w2"}
    assert {v.limit for v in report.violations} <= {"SINGULAR", "STEER_RATE"}
    assert report.headline is not None
    assert report.headline.t == pytest.approx(0.502777, abs=1e-3)


@pytest.mark.parametrize(
    ("start", "end", "length", "gain"),
    [(S0, S1, 0.81046, 2.5155), (S2, S3_MIRRORED, 0.34270, 2.7532)],
)
def test_gain_of_the_harmless_legs(
    start: tuple[float, float], end: tuple[float, float], length: float, gain: float
) -> None:
    a, b = np.array(start), np.array(end)
    assert np.linalg.norm(b - a) == pytest.approx(length, abs=1e-5)
    # With the path speed so small that steering never binds, the largest rate of any
    # wheel is the gain times the path speed.
    surface = TransitionMap(care_o_bot(), path_speed=1.0)
    found = surface.between(omni_curve(start), omni_curve(end))
    assert found is not None
    assert found.time == pytest.approx(length, rel=2e-3)
    assert found.max_steering_rate == pytest.approx(gain, rel=0.02)


@pytest.mark.parametrize(
    ("path_speed", "least"),
    [(SETS["set 1"], 0.892), (SETS["set 2"], 0.447), (SETS["set 3"], 0.300)],
)
def test_a_detour_around_wheel_2_takes_little_longer(
    path_speed: float, least: float
) -> None:
    """B2, O-50: two straight pieces at full path speed take `least`."""
    surface = TransitionMap(care_o_bot(), path_speed)
    found = surface.between(omni_curve(S1), omni_curve(S2))
    assert found is not None
    straight = (S2[0] - S1[0]) / path_speed
    assert straight < found.time < 1.3 * least
    assert found.time == pytest.approx(least, rel=5e-3)
    assert found.max_steering_rate <= RATE * (1 + 1e-9)
    assert found.wheel == "w2"


def test_the_mirrored_image_of_s3_is_chosen() -> None:
    """B5, O-51: the way to s3 itself is over eight times as long."""
    surface = TransitionMap(care_o_bot(), SETS["set 1"])
    plain = surface.between(omni_curve(S2), omni_curve(S3))
    free = surface.between(omni_curve(S2), omni_curve(S3), mirrored=True)
    assert plain is not None
    assert free is not None
    assert free.is_mirrored
    assert not plain.is_mirrored
    assert free.time == pytest.approx(0.34270 / SETS["set 1"], rel=2e-3)
    assert plain.time > 8 * free.time
    np.testing.assert_allclose(free.way[-1], omni_curve(S3_MIRRORED), atol=1e-6)


def test_turning_on_the_spot_and_aside_from_straight_ahead() -> None:
    """O-43 and O-41 without a bound on the path speed."""
    surface = TransitionMap(care_o_bot())
    spot = surface.between((0.0, 0.0), (2.0, 0.0))
    aside = surface.between((0.0, 0.0), (0.0, math.pi / 2))
    assert spot is not None
    assert aside is not None
    assert spot.time == pytest.approx(0.093238, abs=1e-6)
    assert math.degrees(spot.turn) == pytest.approx(128.211, abs=1e-3)
    assert aside.time == pytest.approx(0.06545, abs=1e-5)


def test_stops_are_kept_on_the_way() -> None:
    """With ranges of ±155° the short way over β = π is closed."""
    free = care_o_bot()
    wheels = [
        wheel.model_copy(update={"steering_range_deg": (-155.0, 155.0)})
        for wheel in free.wheels
    ]
    bound = free.model_copy(update={"wheels": tuple(wheels)})
    start, goal = (0.0, math.radians(150)), (0.0, math.radians(-150))
    short = TransitionMap(free).between(start, goal)
    long = TransitionMap(bound).between(start, goal)
    assert short is not None
    assert long is not None
    assert short.turn == pytest.approx(math.radians(60), rel=1e-3)
    assert long.turn > math.radians(200)
    z = configspace.wheel_directions(bound, long.way[:, 0], long.way[:, 1])
    assert (np.abs(np.angle(z)) <= math.radians(155) + 1e-9).all()
    blocked = TransitionMap(bound).between((0.0, 0.0), (0.0, math.pi))
    assert blocked is None


@pytest.mark.parametrize("bad", [{"path_speed": 0.0}, {"path_speed": math.nan}])
def test_path_speed_is_checked(bad: dict[str, float]) -> None:
    with pytest.raises(configspace.InvalidInput, match="path_speed"):
        TransitionMap(care_o_bot(), **bad)


@pytest.mark.parametrize("name", ["mecanum", "differential", "ackermann"])
def test_vehicles_without_free_steering_have_no_surface(name: str) -> None:
    vehicle = configspace.load_vehicle(name)
    with pytest.raises(configspace.InvalidInput, match=vehicle.name):
        TransitionMap(vehicle, path_speed=1.0)


@pytest.mark.slow
def test_3600_random_set_points() -> None:
    """B6: uniform in (φ, θ), one after the other; the figures are in benchmarks/."""
    for path_speed in SETS.values():
        run = long_run(care_o_bot(), path_speed, RATE, count=3600, seed=1)
        assert run.n_reached + run.n_rejected == 3600
        assert run.max_steering_rate <= RATE * (1 + 1e-9)
        # The rejected share is that of the zone of large gains (B1).
        zone = {0.5: 0.0068, 1.0: 0.0274, 1.5: 0.0622}[path_speed / math.pi]
        spread = 3 * math.sqrt(zone * (1 - zone) / 3600)
        assert run.n_rejected / 3600 == pytest.approx(zone, abs=spread + 0.003)
        assert run.max_steering_error < 1e-6


def test_random_set_points_in_short() -> None:
    run = long_run(care_o_bot(), SETS["set 2"], RATE, count=25, seed=2)
    assert run.n_reached + run.n_rejected == 25
    assert 0.1 < run.mean_time < 1.0
    assert run.max_steering_rate <= RATE * (1 + 1e-9)
    assert run.max_steering_error < 1e-6
    assert run.n_reached > 20
