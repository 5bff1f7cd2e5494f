"""Random configurations, many of them where something happens."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from configspace.omni_curve import from_twist
from configspace.vehicle import SteerableWheel, Vehicle

__all__ = ["random_configurations"]

FloatArray = npt.NDArray[np.float64]


def random_configurations(
    rng: np.random.Generator, vehicle: Vehicle, count: int
) -> tuple[FloatArray, FloatArray]:
    """Return configurations, many of them where something happens.

    Half are uniform; the rest are at or next to the kinks κ_n = 0, ±1, ±2, the seam
    β = ±π, the singular points of wheels and the ends of steering ranges. For a
    line-mobile vehicle β is mostly its constant one.

    Parameters
    ----------
    rng : numpy.random.Generator
    vehicle : Vehicle
    count : int

    Returns
    -------
    kappa_n : (count,) float, 1, [-2, 2]
    beta : (count,) float, rad
    """
    kappa_n = rng.uniform(-2, 2, count)
    beta = rng.uniform(-np.pi, np.pi, count)
    near = rng.choice([-1.0, 0.0, 1.0], count) * 10.0 ** rng.uniform(-17, -1, count)
    case = rng.integers(0, 10, count)
    kinks = rng.choice([-2.0, -1.0, 0.0, 1.0, 2.0], count)
    kappa_n = np.where(case == 5, kinks + near, kappa_n)
    seams = rng.choice([-np.pi, -np.pi / 2, 0.0, np.pi / 2, np.pi], count)
    beta = np.where((case == 6) | ((case == 5) & (near > 0)), seams + near, beta)
    steered = [w for w in vehicle.wheels if isinstance(w, SteerableWheel)]
    if steered:
        pick = rng.integers(0, len(steered), count)
        w = np.array([wheel.position - vehicle.reference for wheel in steered])[pick]
        # The centre of rotation on the wheel: v = -ω x w.
        omega = rng.choice([-1.0, 1.0], count)
        still = np.stack([omega * w.imag, -omega * w.real, omega], axis=-1)
        on_k, on_beta, _ = from_twist(still, vehicle.boundary_curvature)
        apart = near * rng.uniform(-1, 1, count)
        kappa_n = np.where(case == 7, on_k + apart, kappa_n)
        beta = np.where(case == 7, on_beta + near, beta)
        # A wheel at the end of its range: Im(z exp(-jα)) = 0 solved for β.
        ends = np.array([w.steering_range for w in steered])[pick, pick % 2]
        ends = np.where(np.isfinite(ends), ends, np.pi)
        c = np.minimum(1.0, 2 - np.abs(np.clip(kappa_n, -2, 2)))
        s = np.clip(kappa_n, -1, 1)
        b = 1j * vehicle.boundary_curvature * w
        sine = s * (b * np.exp(-1j * ends)).imag / np.maximum(c, 1e-9)
        bend = np.arcsin(np.clip(sine, -1, 1))
        beta = np.where(case >= 8, ends - bend + near, beta)
        reach = np.array([wheel.offsets[0] for wheel in steered])[pick]
        if reach.any():
            # The centre of rotation under the wheel, beside its axis: it stands still.
            spot = w + reach * np.exp(1j * rng.uniform(-np.pi, np.pi, count))
            still = np.stack([omega * spot.imag, -omega * spot.real, omega], axis=-1)
            on_k, on_beta, _ = from_twist(still, vehicle.boundary_curvature)
            here = (case == 7) & (rng.random(count) < 0.5)
            kappa_n = np.where(here, on_k + apart, kappa_n)
            beta = np.where(here, on_beta + near, beta)
    line = vehicle.mobility.line_beta
    if line is not None:
        beta = np.where(rng.random(count) < 0.9, line, beta)
    if vehicle.mobility.is_translating:
        kappa_n = np.where(rng.random(count) < 0.9, 0.0, kappa_n)
    return np.clip(kappa_n, -2, 2), beta
