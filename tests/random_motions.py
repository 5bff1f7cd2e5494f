"""Random smooth motions that suit a vehicle: curves in twists, manoeuvres in poses."""

from __future__ import annotations

from dataclasses import dataclass

import naive
import naive_motion
import numpy as np
import numpy.typing as npt

from configspace import PermissibleSpace, Vehicle, wheel_directions
from configspace.vehicle import SteerableWheel
from omniplan import Trajectory

FloatArray = npt.NDArray[np.float64]
Point = tuple[float, float]

FASTEST = 3.0  # m/s, where a vehicle's speed is not limited


@dataclass(frozen=True)
class Way:
    """A straight way in the (κ_n, β) plane, permitted all along, and its v_max."""

    kappa_n: FloatArray
    beta: FloatArray
    v_max: FloatArray


def random_way(
    rng: np.random.Generator,
    vehicle: Vehicle,
    space: PermissibleSpace,
    n: int,
    start: tuple[float, float] | None = None,
) -> Way:
    """A way of n places; of many drawn the first that is permitted."""
    tries, fine = 150, np.linspace(0, 1, 25)
    size = rng.choice([0.0, 0.05, 0.3, 1.0], (tries, 1))
    first = np.stack([rng.uniform(-2, 2, tries), rng.uniform(-3.1, 3.1, tries)], 1)
    near = rng.random(tries) < 0.3  # about straight ahead, where little is permitted
    first[near] *= 0.1
    if start is not None:
        first[:] = start
    step = rng.uniform(-1, 1, (tries, 2)) * size
    first, step = (
        np.vstack([first, first[:1], [[0, 0]]]),
        np.vstack([step, [[0, 0]] * 2]),
    )
    line = naive.constant_beta(vehicle)
    if line is not None:
        first[:, 1], step[:, 1] = line, 0.0
    if vehicle.synchro:
        first[:, 0], step[:, 0] = 0.0, 0.0
    kappa_n = np.clip(first[:, :1] + step[:, :1] * fine, -2, 2)
    beta = first[:, 1:] + step[:, 1:] * fine
    ways = np.minimum(*(space.v_max(kappa_n, beta, reverse=r) for r in (False, True)))
    # Near a singular point wheels turn so fast that little else is tested.
    calm = np.ones(tries + 2, dtype=bool)
    steers = [isinstance(wheel, SteerableWheel) for wheel in vehicle.wheels]
    if any(steers) and rng.random() < 0.7:
        z = np.abs(wheel_directions(vehicle, kappa_n, beta))[..., steers]
        calm = z.min(axis=(1, 2)) > 0.15
    permitted = ways.min(axis=1) > 0
    options = np.flatnonzero(permitted & calm)
    if not options.size:
        options = np.append(np.flatnonzero(permitted), tries + 1)
    pick = int(options[0])
    f = np.linspace(0, 1, n)
    k = np.clip(first[pick, 0] + step[pick, 0] * f, -2, 2)
    b = first[pick, 1] + step[pick, 1] * f
    v_max = np.interp(f, fine, ways[pick])
    return Way(k, b, np.minimum(np.where(v_max > 0, v_max, 0.3), FASTEST))


def twists_along(
    way: Way, v_s: FloatArray, vehicle: Vehicle, point: Point
) -> FloatArray:
    """Twists (n, 3) of a point of the vehicle."""
    kappa_g, (kx, ky), (x, y) = naive.kappa_g(vehicle), naive.reference(vehicle), point
    rows = np.stack([way.kappa_n, way.beta, v_s], axis=-1).tolist()
    twists = np.array([naive.twist(k, b, v, kappa_g) for k, b, v in rows])
    twists[:, 0] -= twists[:, 2] * (y - ky)
    twists[:, 1] += twists[:, 2] * (x - kx)
    return twists


def random_point(rng: np.random.Generator) -> Point:
    if rng.random() < 0.6:
        return 0.0, 0.0
    return float(rng.uniform(-0.5, 0.5)), float(rng.uniform(-0.5, 0.5))


def random_twists(
    rng: np.random.Generator, vehicle: Vehicle, space: PermissibleSpace
) -> Trajectory:
    """A curve whose speed swells and fades; at times through rest, or backwards."""
    n = int(rng.integers(4, 13))
    t = np.linspace(0, rng.uniform(0.5, 1.5) * n, n)
    way = random_way(rng, vehicle, space, n)
    f = np.linspace(0, 1, n)
    share = 0.6 + 0.35 * np.sin(2 * np.pi * (rng.uniform(0.2, 1) * f + rng.random()))
    match int(rng.integers(4)):
        case 0:  # from rest to rest
            share = share * np.sin(np.pi * f)
        case 1:  # there and back, through rest between two samples or on one
            share = share * np.cos(np.pi * f)
    v_s = share * way.v_max * rng.choice([-1, 1])
    point = random_point(rng)
    twists = twists_along(way, v_s, vehicle, point)
    return Trajectory.from_twists(t, twists, reference_point=point)


def random_poses(
    rng: np.random.Generator, vehicle: Vehicle, space: PermissibleSpace
) -> Trajectory:
    """A manoeuvre of one to three legs from rest to rest, with cusps and stops."""
    point, m = random_point(rng), 24
    times, poses = [np.zeros(1)], [np.zeros((1, 3))]
    start, sign = None, float(rng.choice([-1, 1]))
    for leg in range(int(rng.integers(1, 4))):
        if leg and rng.random() < 0.5:  # stand a while, then go on anyhow
            seconds = rng.uniform(0.5, 4.0)
            times.append(times[-1][-1:] + seconds)
            poses.append(poses[-1][-1:])
            if rng.random() < 0.6:
                start, sign = None, float(rng.choice([-1, 1]))
        elif leg:  # a cusp: the wheels stay as they are
            sign = -sign
        way = random_way(rng, vehicle, space, 321, start)
        f = np.linspace(0, 1, 321)
        length = rng.uniform(0.2, 1.5) * min(1.0, 1 / naive.kappa_g(vehicle))
        duration = 2 * length / float(way.v_max.min())
        v_s = sign * way.v_max.min() * 16 * f**2 * (1 - f) ** 2
        path = integrated(duration * f, twists_along(way, v_s, vehicle, point))
        times.append(times[-1][-1] + duration * f[:: 320 // (m - 4)][1:])
        poses.append(placed(poses[-1][-1], path[:: 320 // (m - 4)][1:]))
        start = float(way.kappa_n[-1]), float(way.beta[-1])
    t, samples = np.concatenate(times), np.concatenate(poses)
    return Trajectory.from_poses(t, samples, reference_point=point)


def random_parameters(
    rng: np.random.Generator, vehicle: Vehicle, space: PermissibleSpace
) -> Trajectory:
    """A few places on a way, in the vehicle's own parameters."""
    n = int(rng.integers(2, 5))
    way = random_way(rng, vehicle, space, n)
    v_n = rng.uniform(0.3, 0.9) * rng.uniform(0.5, 1, n) * rng.choice([-1, 1])
    t = np.linspace(0, rng.uniform(1, 5) * n, n)
    return Trajectory.from_omni_curve(t, way.kappa_n, way.beta, v_n, vehicle)


def integrated(t: FloatArray, twists: FloatArray) -> FloatArray:
    """Poses (n, 3) from the origin on, by the trapezoidal rule."""
    dt = np.diff(t)
    omega = twists[:, 2]
    theta = np.concatenate([[0.0], np.cumsum((omega[1:] + omega[:-1]) / 2 * dt)])
    world = (twists[:, 0] + 1j * twists[:, 1]) * np.exp(1j * theta)
    p = np.concatenate([[0.0], np.cumsum((world[1:] + world[:-1]) / 2 * dt)])
    return np.stack([p.real, p.imag, theta], axis=-1)


def placed(pose: FloatArray, path: FloatArray) -> FloatArray:
    """A path that starts at the origin, from a pose on."""
    x, y, theta = pose
    p = x + 1j * y + np.exp(1j * theta) * (path[:, 0] + 1j * path[:, 1])
    return np.stack([p.real, p.imag, theta + path[:, 2]], axis=-1)


def motion_of(trajectory: Trajectory) -> naive_motion.TwistAt:
    """The motion by the naive simulation's own interpolation."""
    t, samples = trajectory.t, trajectory.samples
    if trajectory.form == "poses":
        return naive_motion.pose_motion(t, samples, *trajectory.reference_point)
    if trajectory.form == "twists":
        return naive_motion.twist_motion(t, samples, *trajectory.reference_point)
    assert trajectory.vehicle is not None
    return naive_motion.omni_curve_motion(t, samples, trajectory.vehicle)


def driven_signs(
    trajectory: Trajectory, simulation: naive_motion.Simulation
) -> list[int] | None:
    """The sign of v_s over each piece, where the trajectory gives it."""
    if trajectory.form != "omni_curve":
        return None
    t, v_n = trajectory.t, trajectory.samples[:, 2]
    middles = [
        (simulation.t[piece.first] + simulation.t[piece.last]) / 2
        for piece in simulation.pieces
    ]
    return [1 if np.interp(when, t, v_n) >= 0 else -1 for when in middles]


def simulated(
    vehicle: Vehicle, trajectory: Trajectory, per_interval: int = 20
) -> naive_motion.Simulation:
    return naive_motion.simulate(
        vehicle,
        trajectory.t,
        motion_of(trajectory),
        per_interval,
        has_accelerations=trajectory.form != "omni_curve",
        has_swing=trajectory.form == "poses",
    )
