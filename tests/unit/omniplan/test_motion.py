import math
from collections.abc import Callable

import naive
import naive_motion
import numpy as np
import numpy.typing as npt
import pytest

import configspace
from configspace import Vehicle
from omniplan import Trajectory
from omniplan.motion import (
    Enclosure,
    Intervals,
    Motion,
    motion_of,
    starts_at_rest,
    stops_of,
)

FloatArray = npt.NDArray[np.float64]
TwistAt = Callable[[FloatArray], FloatArray]
POINT = (0.3, -0.2)


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    return configspace.load_vehicle("ift-four-steered")


def own_twists(vehicle: Vehicle, t: FloatArray, samples: FloatArray) -> TwistAt:
    """Direction (c e^{jβ}, s κ_g) times the sign of v_n, from the paper's cases."""

    def at(when: FloatArray) -> FloatArray:
        k, b, v = (np.interp(when, t, column) for column in samples.T)
        kappa_g = naive.kappa_g(vehicle)
        sign = np.where(v < 0, -1.0, 1.0)
        rows = zip(k.tolist(), b.tolist(), sign.tolist(), strict=True)
        return np.array([naive.twist(x, y, s, kappa_g) for x, y, s in rows])

    return at


def poses(rng: np.random.Generator) -> tuple[Motion, TwistAt, FloatArray]:
    t = np.cumsum(rng.uniform(0.1, 0.6, 8))
    samples = np.cumsum(rng.normal(size=(8, 3)) * [0.3, 0.3, 0.4], axis=0)
    trajectory = Trajectory.from_poses(t, samples, reference_point=POINT)
    at = naive_motion.pose_motion(t, trajectory.samples, *POINT)
    return motion_of(trajectory, is_own=False), at, t


def twists(rng: np.random.Generator) -> tuple[Motion, TwistAt, FloatArray]:
    t = np.cumsum(rng.uniform(0.1, 0.6, 8))
    samples = rng.normal(size=(8, 3))
    trajectory = Trajectory.from_twists(t, samples, reference_point=POINT)
    at = naive_motion.twist_motion(t, samples, *POINT)
    return motion_of(trajectory, is_own=False), at, t


def own(rng: np.random.Generator) -> tuple[Motion, TwistAt, FloatArray]:
    vehicle = configspace.load_vehicle("ift-four-steered")
    t = np.cumsum(rng.uniform(0.1, 0.6, 8))
    samples = np.stack(
        [rng.uniform(-2, 2, 8), np.cumsum(rng.normal(size=8)), rng.uniform(0.1, 1, 8)],
        axis=-1,
    )
    trajectory = Trajectory.from_omni_curve(
        t, samples[:, 0], samples[:, 1], samples[:, 2], vehicle
    )
    at = own_twists(vehicle, t, trajectory.samples)
    return motion_of(trajectory, is_own=True), at, t


KINDS = pytest.mark.parametrize("make", [poses, twists, own])
Make = Callable[[np.random.Generator], tuple[Motion, TwistAt, FloatArray]]


def random_parts(rng: np.random.Generator, motion: Motion) -> Intervals:
    whole = motion.intervals()
    f = np.sort(rng.uniform(0, 1, (2, whole.t0.size)), axis=0)
    span = whole.t1 - whole.t0
    return Intervals(whole.knot, whole.t0 + f[0] * span, whole.t0 + f[1] * span)


def excess(e: Enclosure, i: int, twists: FloatArray) -> tuple[float, float]:
    """How far dense twists stand off the enclosure of part i (≤ 0: within)."""
    v, omega = twists[:, 0] + 1j * twists[:, 1], twists[:, 2]
    chord = e.v1[i] - e.v0[i]
    f = ((v - e.v0[i]) * np.conj(chord)).real / max(abs(chord) ** 2, 1e-300)
    off = np.abs(v - (e.v0[i] + np.clip(f, 0, 1) * chord))
    low, high = sorted((e.omega0[i], e.omega1[i]))
    off_omega = np.maximum(low - omega, omega - high)
    radius = e.dt[i] ** 2 / 8
    return (
        float(off.max() - radius * e.v_ddot[i]),
        float(off_omega.max() - radius * e.omega_ddot[i]),
    )


@KINDS
def test_the_enclosure_holds_the_motion_over_any_part(make: Make) -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        motion, at, _ = make(rng)
        parts = random_parts(rng, motion)
        e = motion.enclose(parts)
        for i in range(parts.t0.size):
            when = np.linspace(parts.t0[i], parts.t1[i], 200)
            assert max(excess(e, i, at(when))) < 1e-9


@KINDS
def test_the_ends_and_their_derivatives_are_exact(make: Make) -> None:
    rng = np.random.default_rng(2)
    motion, at, _ = make(rng)
    parts = random_parts(rng, motion)
    e = motion.enclose(parts)
    h = 1e-6
    for t, v, omega, v_dot, omega_dot in (
        (parts.t0, e.v0, e.omega0, e.v_dot0, e.omega_dot0),
        (parts.t1, e.v1, e.omega1, e.v_dot1, e.omega_dot1),
    ):
        here, later, earlier = at(t), at(t + h), at(t - h)
        assert v.real == pytest.approx(here[:, 0], abs=1e-9)
        assert v.imag == pytest.approx(here[:, 1], abs=1e-9)
        assert omega == pytest.approx(here[:, 2], abs=1e-9)
        rate = (later - earlier) / (2 * h)
        assert v_dot.real == pytest.approx(rate[:, 0], abs=1e-4)
        assert v_dot.imag == pytest.approx(rate[:, 1], abs=1e-4)
        assert omega_dot == pytest.approx(rate[:, 2], abs=1e-4)


@KINDS
def test_the_bounds_on_second_derivatives_hold(make: Make) -> None:
    rng = np.random.default_rng(3)
    for _ in range(5):
        motion, at, _ = make(rng)
        parts = motion.intervals()
        e = motion.enclose(parts)
        for i in range(parts.t0.size):
            when = np.linspace(parts.t0[i], parts.t1[i], 300)
            bent = np.diff(at(when), 2, axis=0) / (when[1] - when[0]) ** 2
            assert np.hypot(bent[:, 0], bent[:, 1]).max() <= e.v_ddot[i] + 1e-3
            assert np.abs(bent[:, 2]).max() <= e.omega_ddot[i] + 1e-3


@KINDS
def test_the_excess_shrinks_with_the_square_of_the_step(make: Make) -> None:
    motion, _, _ = make(np.random.default_rng(4))
    parts = motion.intervals()
    every = np.ones(parts.t0.shape, dtype=bool)

    def radius(parts: Intervals) -> float:
        e = motion.enclose(parts)
        return float((e.dt**2 * (e.v_ddot + e.omega_ddot)).max())

    once = parts.halved(every)
    twice = once.halved(np.ones(once.t0.shape, dtype=bool))
    whole, half, quarter = radius(parts), radius(once), radius(twice)
    # A quarter each time, up to a little that the bound on the speed itself moves.
    assert half <= whole / 4 * 1.2
    assert quarter <= half / 4 * 1.05


def test_halving_keeps_the_order_and_covers_the_whole() -> None:
    parts = Intervals(np.arange(3), np.array([0.0, 1, 3]), np.array([1.0, 3, 4]))
    halved = parts.halved(np.array([True, False, True]))
    assert halved.knot.tolist() == [0, 0, 1, 2, 2]
    assert halved.t0.tolist() == [0, 0.5, 1, 3, 3.5]
    assert halved.t1.tolist() == [0.5, 1, 3, 3.5, 4]
    assert parts.t0.tolist() == [0, 1, 3]


def test_a_spline_goes_through_its_poses() -> None:
    rng = np.random.default_rng(5)
    t = np.cumsum(rng.uniform(0.1, 0.6, 9))
    samples = np.cumsum(rng.normal(size=(9, 3)) * 0.3, axis=0)
    motion = motion_of(Trajectory.from_poses(t, samples), is_own=False)
    at = motion.poses_at(t)  # type: ignore[attr-defined]
    assert at == pytest.approx(samples, abs=1e-12)


@pytest.mark.parametrize(
    ("samples", "stops"),
    [
        ([[0, 0, 0], [1, 0, 0], [2, 0, 0]], []),
        ([[0, 0, 0], [1, 0, 0], [0, 0, 0]], [1]),  # cusp
        ([[0, 0, 0], [1, 0, 0], [1, 1, 0]], [1]),  # corner of 90°
        ([[0, 0, 0], [1, 0, 0], [1.5, 0.5, 0]], []),  # bend of 45°
        ([[0, 0, 0], [1, 0, 0], [1, 0, 0], [2, 0, 0]], [1, 2]),  # dwell
        ([[0, 0, 0], [0, 0, 1], [0, 0, 0]], [1]),  # turning back
        ([[0, 0, 0], [1, 0, 0], [1, 0, 1]], [1]),  # driving, then turning on the spot
        ([[0, 0, 0], [0, 0, 0]], [0, 1]),
    ],
)
def test_cusps_corners_and_dwells_are_stops(
    samples: list[list[float]], stops: list[int]
) -> None:
    assert np.flatnonzero(stops_of(np.array(samples, dtype=float))).tolist() == stops


def test_a_motion_may_start_from_rest_or_in_full_drive() -> None:
    f = np.linspace(0, 1, 11)
    smooth = f**3 * (10 - 15 * f + 6 * f**2)
    zero = 0 * f
    assert starts_at_rest(f, np.stack([smooth, zero, zero], axis=-1))
    assert starts_at_rest(f, np.stack([f**2, zero, zero], axis=-1))
    assert starts_at_rest(f, np.stack([zero, zero, smooth], axis=-1))
    assert not starts_at_rest(f, np.stack([f, zero, zero], axis=-1))
    assert not starts_at_rest(f[:2], np.stack([f, zero, zero], axis=-1)[:2])


def test_a_spline_rests_at_a_cusp_and_does_not_swing_around_it() -> None:
    t = np.linspace(0, 4, 9)
    x = np.minimum(t, 4 - t)
    trajectory = Trajectory.from_poses(t, np.stack([x, 0 * x, 0 * x], axis=-1))
    motion = motion_of(trajectory, is_own=False)
    parts = motion.intervals()
    e = motion.enclose(parts)
    assert abs(e.v1[3]) < 1e-12
    assert abs(e.v0[4]) < 1e-12
    fine = motion.poses_at(np.linspace(0, 4, 801))  # type: ignore[attr-defined]
    assert fine[:, 0].max() <= 2 + 1e-12


def test_a_twist_that_turns_into_its_opposite_rests_in_between() -> None:
    trajectory = Trajectory.from_twists([0, 3], [[1, 0.5, 0.2], [-2, -1, -0.4]])
    parts = motion_of(trajectory, is_own=False).intervals()
    assert parts.t1.tolist() == pytest.approx([1, 3])


def test_a_twist_that_passes_zero_closely_has_no_stop() -> None:
    trajectory = Trajectory.from_twists([0, 3], [[1, 0.5, 0.2], [-2, -1, -0.5]])
    assert motion_of(trajectory, is_own=False).intervals().t0.size == 1


def test_own_parameters_are_cut_where_v_n_and_the_kinks_are_crossed(
    vehicle: Vehicle,
) -> None:
    trajectory = Trajectory.from_omni_curve(
        [0, 4], [-1.5, 1.5], [0.0, 0.0], [-0.2, 0.6], vehicle
    )
    parts = motion_of(trajectory, is_own=True).intervals()
    assert parts.t0.tolist() == pytest.approx([0, 2 / 3, 1, 10 / 3])
    e = motion_of(trajectory, is_own=True).enclose(parts)
    assert e.sign.tolist() == [-1, -1, 1, 1]


def test_a_foreign_motion_is_as_fast_as_its_owner_may(vehicle: Vehicle) -> None:
    rng = np.random.default_rng(6)
    for _ in range(30):
        t = np.array([0.0, 1.0])
        k = np.clip(rng.uniform(-2, 2) + rng.uniform(-0.2, 0.2, 2), -2, 2)
        b = rng.uniform(-1, 1) + rng.uniform(-0.2, 0.2, 2)
        v_n = rng.uniform(0.1, 1, 2)
        trajectory = Trajectory.from_omni_curve(t, k, b, v_n, vehicle)
        motion = motion_of(trajectory, is_own=False)
        parts = motion.intervals()
        e = motion.enclose(parts)
        for i in range(parts.t0.size):
            when = np.linspace(parts.t0[i], parts.t1[i], 100)
            kk, bb, vv = (np.interp(when, t, x) for x in (k, b, v_n))
            speed = vv * configspace.exact_v_max(vehicle, kk, bb)
            assert e.scale0[i] == pytest.approx(speed[0], rel=1e-9)
            assert e.scale1[i] == pytest.approx(speed[-1], rel=1e-9)
            assert speed.max() <= e.scale_high[i] * (1 + 1e-12)


@pytest.mark.parametrize("name", configspace.catalog())
def test_the_speed_of_every_owner_is_bounded_and_closely_so(name: str) -> None:
    """By limits of every kind: offsets, lateral acceleration and tipping among them."""
    owner, rng = configspace.load_vehicle(name), np.random.default_rng(4)
    line, n = owner.mobility.line_beta, 5
    kappa_n = np.clip(np.cumsum(rng.normal(0, 0.6, n)), -2, 2)
    if owner.mobility.is_translating:
        kappa_n[:] = 0
    beta = np.cumsum(rng.normal(0, 0.5, n)) if line is None else np.full(n, line)
    v_n = np.clip(np.cumsum(rng.normal(0, 0.5, n)), -1, 1)
    given = Trajectory.from_omni_curve(np.arange(n), kappa_n, beta, v_n, owner)
    motion = motion_of(given, is_own=False)
    parts = motion.intervals()
    for _ in range(4):
        parts = parts.halved(np.ones(parts.t0.shape, dtype=bool))
    e = motion.enclose(parts)
    most = np.zeros(parts.t0.shape)
    for f in np.linspace(0, 1, 17):
        t = parts.t0 + f * (parts.t1 - parts.t0)
        most = np.maximum(most, motion.enclose(Intervals(parts.knot, t, t)).scale0)
    assert (most <= e.scale_high * (1 + 1e-9) + 1e-12).all()
    moving = most > 0.05 * most.max()
    if moving.any():
        assert np.median((e.scale_high / np.maximum(most, 1e-12))[moving]) < 1.05


def test_the_reference_point_moves_with_the_body() -> None:
    # Turning at 1 rad/s about a point 0.5 m ahead of the described one.
    trajectory = Trajectory.from_twists(
        [0, 1], [[0, -0.5, 1], [0, -0.5, 1]], reference_point=(0.5, 0.0)
    )
    motion = motion_of(trajectory, is_own=False)
    e = motion.enclose(motion.intervals())
    # At the origin: v = v_p - ω × p = (0, -0.5 - 0.5).
    assert e.v0[0] == pytest.approx(-1j)
    assert math.isclose(float(e.omega0[0]), 1.0)
