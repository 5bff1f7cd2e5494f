"""The spherical twist: direction of a motion on a sphere, and its speed.

A twist (vx, vy, ω) with ω weighted by a length d is a point of space; its length ρ and
its direction, the longitude φ and the latitude θ, are Connette's spherical twist. With
d = 1/κ_g it is the Omni-Curve state in other clothes: φ = β, and (cos θ, sin θ) is
(c, s) scaled to length 1. Both are regular where the centre of rotation is at infinity.

Which d is a question of purpose. 1/κ_g fits the Omni-Curve-Parameters; with
`energy_length` ρ is the speed of kinetic energy, ``E = m ρ²/2`` for every direction, so
the angle between two directions is one that energy sees.

References
----------
Connette 2013, sections 3.1 and 3.2; spec/steered-wheels §2.2, §2.9, §2.10.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from configspace.angles import wrap
from configspace.errors import InvalidInput, Problem
from configspace.omni_curve import (
    components,
    curvature_of_ratio,
    finite,
    nominal_curvature,
    together,
)

__all__ = [
    "angular_distance",
    "energy_length",
    "from_spherical",
    "omni_curve_to_spherical",
    "sphere_point",
    "spherical_to_omni_curve",
    "to_spherical",
    "translate",
]

FloatArray = npt.NDArray[np.float64]
Triple = tuple[FloatArray, FloatArray, FloatArray]


def to_spherical(twist: npt.ArrayLike, d: float) -> Triple:
    """Return the spherical coordinates of a twist, those with ρ ≥ 0 and |θ| ≤ π/2.

    Parameters
    ----------
    twist : (..., 3) float, m/s, m/s, rad/s
    d : float, m, > 0
        Length that weights ω; 1/κ_g makes φ = β and tan θ = κ_n up to |κ_n| = 1.

    Returns
    -------
    rho : (...,) float, m/s, ≥ 0
    phi : (...,) float, rad, (-π, π]
        0 in pure rotation and at standstill, where it is undefined.
    theta : (...,) float, rad, [-π/2, π/2]
        0 at standstill, where it is undefined.

    Raises
    ------
    InvalidInput
        If a value is not finite, the last axis is not 3 or `d` is not positive.

    References
    ----------
    Connette 2013, Eq. (3.2).

    Examples
    --------
    >>> rho, phi, theta = to_spherical([0.0, 3.0, 2.0], d=2.0)
    >>> float(rho), float(phi / np.pi)
    (5.0, 0.5)
    """
    vx, vy, omega = twist_components(twist)
    q = length_scale(d) * omega
    p = np.hypot(vx, vy)
    phi = np.where(p > 0, wrap(np.arctan2(vy, vx)), 0.0)
    return np.hypot(p, q), phi, np.arctan2(q, p)


def from_spherical(
    rho: npt.ArrayLike, phi: npt.ArrayLike, theta: npt.ArrayLike, d: float
) -> FloatArray:
    """Return the twist of spherical coordinates, of any sign and beyond the poles.

    Parameters
    ----------
    rho : (...,) float, m/s
    phi, theta : (...,) float, rad
    d : float, m, > 0

    Returns
    -------
    twist : (..., 3) float, m/s, m/s, rad/s

    References
    ----------
    Connette 2013, Eq. (3.1).
    """
    rho, phi, theta = spherical_arrays(rho, phi, theta)
    p = rho * np.cos(theta)
    omega = rho * np.sin(theta) / length_scale(d)
    return np.stack([p * np.cos(phi), p * np.sin(phi), omega], axis=-1)


def omni_curve_to_spherical(
    kappa_n: npt.ArrayLike, beta: npt.ArrayLike, v_s: npt.ArrayLike
) -> Triple:
    """Return the spherical coordinates of an Omni-Curve state, for d = 1/κ_g.

    Parameters
    ----------
    kappa_n : (...,) float, 1, [-4, 4]
        Beyond ±2 the state is past the pole: θ past ±π/2 (`cross_pole`).
    beta : (...,) float, rad
    v_s : (...,) float, m/s

    Returns
    -------
    rho : (...,) float, m/s
        With the sign of `v_s`; ``v_s = rho max(|cos theta|, |sin theta|)``.
    phi : (...,) float, rad, (-π, π]
        `beta`.
    theta : (...,) float, rad, (-π, π]
        Increasing and continuously differentiable in `kappa_n`.

    References
    ----------
    spec/steered-wheels §2.10.

    Examples
    --------
    >>> omni_curve_to_spherical([-2.0, 0.0, 1.0, 4.0], 0.0, 1.0)[2] / np.pi
    array([-0.5 ,  0.  ,  0.25,  1.  ])
    """
    c, s = extended_components(kappa_n)
    beta, v_s = finite("beta", beta, "rad"), finite("v_s", v_s, "m/s")
    c, s, beta, v_s = together(kappa_n=c, s=s, beta=beta, v_s=v_s)
    return v_s * np.hypot(c, s), wrap(beta), np.arctan2(s, c)


def spherical_to_omni_curve(
    rho: npt.ArrayLike, phi: npt.ArrayLike, theta: npt.ArrayLike
) -> Triple:
    """Return the Omni-Curve state with the same wheel configuration, for d = 1/κ_g.

    Coordinates past a pole come back through it: β = φ + π there.

    Parameters
    ----------
    rho : (...,) float, m/s
    phi, theta : (...,) float, rad

    Returns
    -------
    kappa_n : (...,) float, 1, [-2, 2]
    beta : (...,) float, rad, (-π, π]
        At κ_n = ±2, where every β is the same configuration, still φ or φ + π.
    v_s : (...,) float, m/s
        With the sign of `rho`.

    References
    ----------
    spec/steered-wheels §2.10; Connette 2013, Eq. (4.27).
    """
    rho, phi, theta = spherical_arrays(rho, phi, theta)
    c, s = np.cos(theta), np.sin(theta)
    beta = wrap(np.where(c < 0, phi + np.pi, phi))
    kappa_n = curvature_of_ratio(np.abs(c), s)
    return kappa_n, beta, rho * np.maximum(np.abs(c), np.abs(s))


def translate(
    rho: npt.ArrayLike,
    phi: npt.ArrayLike,
    theta: npt.ArrayLike,
    offset: complex,
    d: float,
) -> Triple:
    """Return the spherical twist of the same motion, seen from another point.

    Parameters
    ----------
    rho : (...,) float, m/s
    phi, theta : (...,) float, rad
        Also beyond the poles.
    offset : complex, m
        ``x + j y`` of the other point, in the frame of the first, axes parallel. On a
        steering axis φ is that wheel's steering angle (modulo π) and its singular
        point is the pole. The negative offset leads back.
    d : float, m, > 0
        The same for both points.

    Returns
    -------
    rho : (...,) float, m/s
        Sign kept.
    phi : (...,) float, rad, (-π, π]
    theta : (...,) float, rad, [-π/2, π/2]

    References
    ----------
    Connette 2013, Eq. (3.55), (3.57), (3.61).
    """
    rho, phi, theta = spherical_arrays(rho, phi, theta)
    d = length_scale(d)
    turning = np.sin(theta)
    # z = I + j II of the reference.
    z = d * np.cos(theta) * np.exp(1j * phi) + 1j * complex(offset) * turning
    p, q = np.abs(z), d * turning
    direction = np.where(p > 0, wrap(np.angle(z + 0.0)), 0.0)
    return rho * np.hypot(p, q) / d, direction, np.arctan2(q, p)


def energy_length(mass: float, inertia: float) -> float:
    """Return the d with which ρ is the speed of kinetic energy: ``E = m ρ²/2``.

    Parameters
    ----------
    mass : float, kg, > 0
    inertia : float, kg m², > 0
        About the vertical axis through the centre of gravity. The twist must be that of
        the centre of gravity, too: `translate` leads there from K.

    Returns
    -------
    d : float, m
        ``sqrt(I/m)``, the radius of gyration.

    Raises
    ------
    InvalidInput
        If a value is not positive and finite.

    References
    ----------
    Connette 2013, Eq. (5.5), (5.6); spec/steered-wheels §2.2 (b), O-09.

    Examples
    --------
    >>> d = energy_length(mass=100.0, inertia=9.0)
    >>> rho, _, _ = to_spherical([0.3, 0.0, 1.0], d)
    >>> round(float(100.0 * rho**2 / 2), 6), 100 * 0.3**2 / 2 + 9 * 1.0**2 / 2
    (9.0, 9.0)
    """
    values = []
    for name, given, unit in (("mass", mass, "kg"), ("inertia", inertia, "kg m²")):
        value = finite(name, given, unit)
        if value.ndim or value <= 0:
            raise InvalidInput(
                Problem(name, f"{given}", f"one positive number, {unit}")
            )
        values.append(float(value))
    return length_scale(float(np.sqrt(values[1] / values[0])))


def sphere_point(
    kappa_n: npt.ArrayLike, beta: npt.ArrayLike, scale: float = 1.0
) -> FloatArray:
    """Return the point of the unit sphere that is a configuration.

    Every configuration is one point: the poles κ_n = ±2 and β = ±π are no borders, and
    ``(-κ_n, β + π)``, where all wheels are turned by π, is the opposite point.

    Parameters
    ----------
    kappa_n : (...,) float, 1, [-2, 2]
    beta : (...,) float, rad
    scale : float, 1, > 0
        ``d κ_g``; 1 is d = 1/κ_g, ``energy_length(m, I) κ_g`` the metric of energy.

    Returns
    -------
    point : (..., 3) float, 1
        ``(cos θ cos φ, cos θ sin φ, sin θ)``.

    Raises
    ------
    InvalidInput
        If a value is not finite, `kappa_n` is outside [-2, 2] or `scale` not positive.

    References
    ----------
    spec/steered-wheels §2.3, §2.10.
    """
    kappa_n, beta = together(
        kappa_n=nominal_curvature(kappa_n), beta=finite("beta", beta, "rad")
    )
    factor = finite("scale", scale, "1")
    if factor.ndim or factor <= 0:
        raise InvalidInput(Problem("scale", f"{scale}", "one positive number"))
    c, s = components(kappa_n)
    q = s * float(factor)
    size = np.hypot(c, q)
    point = np.stack([c * np.cos(beta), c * np.sin(beta), q], axis=-1)
    return np.asarray(point / size[..., None])


def angular_distance(a: npt.ArrayLike, b: npt.ArrayLike) -> FloatArray:
    """Return the angle between points of the unit sphere, exact for small ones.

    Parameters
    ----------
    a, b : (..., 3) float, 1
        As `sphere_point` returns them.

    Returns
    -------
    angle : (...,) float, rad, [0, π]
    """
    a, b = together(a=finite("a", a, "1"), b=finite("b", b, "1"))
    # Kahan's formula: neither cancels near 0 nor near π.
    apart, along = (np.linalg.norm(x, axis=-1) for x in (a - b, a + b))
    return np.asarray(2 * np.arctan2(apart, along))


def extended_components(kappa_n: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return (c, s) as `components` does, also past the poles, where c < 0."""
    kappa_n = finite("kappa_n", kappa_n, "[-4, 4]")
    size = np.abs(kappa_n)
    if (size > 4).any():
        raise InvalidInput(
            Problem("kappa_n", f"{size.max():g} in size", "must lie in [-4, 4]")
        )
    s = np.minimum(1.0, np.minimum(size, 4.0 - size))
    # Adding 0.0 makes θ = π of -4, as of 4.
    s = np.where(kappa_n < 0, -s, s) + 0.0
    return np.clip(2.0 - size, -1.0, 1.0), s


def spherical_arrays(
    rho: npt.ArrayLike, phi: npt.ArrayLike, theta: npt.ArrayLike
) -> Triple:
    """Return spherical coordinates as arrays of one shape, or raise."""
    rho, phi, theta = together(
        rho=finite("rho", rho, "m/s"),
        phi=finite("phi", phi, "rad"),
        theta=finite("theta", theta, "rad"),
    )
    return rho, phi, theta


def twist_components(twist: npt.ArrayLike) -> Triple:
    """Return the components of a twist, or raise."""
    array = finite("twist", twist, "m/s and rad/s")
    if array.ndim == 0 or array.shape[-1] != 3:
        raise InvalidInput(Problem("twist", f"shape {array.shape}", "shape (..., 3)"))
    return array[..., 0], array[..., 1], array[..., 2]


def length_scale(d: float) -> float:
    """Return the length that weights ω, or raise unless it is positive."""
    value = finite("d", d, "m")
    if value.ndim or value < 1e-300:
        raise InvalidInput(Problem("d", f"{d}", "one positive length, m"))
    return float(value)
