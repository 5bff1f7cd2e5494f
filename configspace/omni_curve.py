"""Omni-Curve-Parameters and twists: the maps between them, without case split.

The state of a planar motion is (κ_n, β, v_s): the nominal curvature (0 translation,
±1 the vehicle's boundary curvature κ_g, ±2 rotation about K), the side-slip angle and
the scalar speed. ``(κ_n, β, v_s)`` and ``(-κ_n, β + π, -v_s)`` are the same twist but
different wheel configurations; `from_twist` therefore asks for the sign of v_s.

References
----------
Brenner and Colomb 2022, section 2.4 and Eq. of section 3.1; spec/omni-curve §1.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from configspace.angles import wrap
from configspace.errors import InvalidInput, Problem

__all__ = ["components", "from_twist", "to_twist"]

FloatArray = npt.NDArray[np.float64]

POLE = 1e-12
"""c up to which a configuration counts as a pole, where β has no meaning: rounding."""


def finite(name: str, values: npt.ArrayLike, unit: str) -> FloatArray:
    """Return `values` as a float array, or raise `InvalidInput` naming `name`."""
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidInput(
            Problem(name, repr(values)[:60], f"numbers in {unit} are needed")
        ) from error
    bad = ~np.isfinite(array)
    if bad.any():
        first = np.argwhere(bad)[0]
        where = f"{name}[{', '.join(map(str, first))}]" if array.ndim else name
        raise InvalidInput(
            Problem(where, f"{array[tuple(first)]}", f"finite numbers in {unit}")
        )
    return array


def together(**arrays: FloatArray) -> tuple[FloatArray, ...]:
    """Return arrays broadcast against each other, or raise naming their shapes."""
    try:
        return tuple(np.broadcast_arrays(*arrays.values()))
    except ValueError as error:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        problem = Problem(
            ", ".join(arrays), f"shapes {shapes}", "shapes that broadcast"
        )
        raise InvalidInput(problem) from error


def nominal_curvature(kappa_n: npt.ArrayLike) -> FloatArray:
    """Return `kappa_n` as an array, or raise `InvalidInput` outside [-2, 2]."""
    array = finite("kappa_n", kappa_n, "[-2, 2]")
    if (np.abs(array) > 2).any():
        worst = array.flat[int(np.abs(array).argmax())]
        raise InvalidInput(Problem("kappa_n", f"{worst:g}", "must lie in [-2, 2]"))
    return array


def components(kappa_n: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return the translational and the rotational share of a nominal curvature.

    Parameters
    ----------
    kappa_n : (...,) float, 1, [-2, 2]

    Returns
    -------
    c : (...,) float, 1, [0, 1]
        ``vx + j vy = v_s c exp(j beta)``.
    s : (...,) float, 1, [-1, 1]
        ``omega = v_s s kappa_g``. max(c, |s|) is always 1.

    Raises
    ------
    InvalidInput
        If a value is not finite or outside [-2, 2].

    Examples
    --------
    >>> components([0.0, 0.5, 1.5, -2.0])
    (array([1. , 1. , 0.5, 0. ]), array([ 0. ,  0.5,  1. , -1. ]))
    """
    kappa_n = nominal_curvature(kappa_n)
    return np.minimum(1.0, 2.0 - np.abs(kappa_n)), np.clip(kappa_n, -1.0, 1.0)


def to_twist(
    kappa_n: npt.ArrayLike,
    beta: npt.ArrayLike,
    v_s: npt.ArrayLike,
    kappa_g: float,
) -> FloatArray:
    """Return the twist of the reference point K.

    Parameters
    ----------
    kappa_n : (...,) float, 1, [-2, 2]
    beta : (...,) float, rad
    v_s : (...,) float, m/s
    kappa_g : float, 1/m, > 0

    Returns
    -------
    twist : (..., 3) float, m/s, m/s, rad/s
        (vx, vy, omega) in the vehicle frame.

    Raises
    ------
    InvalidInput
        If a value is not finite, `kappa_n` outside [-2, 2] or `kappa_g` not positive.

    References
    ----------
    Brenner and Colomb 2022, section 3.1, second equation.

    Examples
    --------
    >>> to_twist(2.0, 0.0, 1.0, kappa_g=4.0)
    array([0., 0., 4.])
    """
    c, s = components(kappa_n)
    beta = finite("beta", beta, "rad")
    v_s = finite("v_s", v_s, "m/s")
    kappa_g = boundary_curvature(kappa_g)
    c, s, beta, v_s = together(c=c, s=s, beta=beta, v_s=v_s)
    vx, vy = v_s * c * np.cos(beta), v_s * c * np.sin(beta)
    return np.stack([vx, vy, v_s * s * kappa_g], axis=-1)


def from_twist(
    twist: npt.ArrayLike, kappa_g: float, sign: npt.ArrayLike = 1
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the Omni-Curve-Parameters of a twist.

    At κ_n = ±2 every β is the same configuration, at standstill every (κ_n, β) is:
    0 is returned there.

    Parameters
    ----------
    twist : (..., 3) float, m/s, m/s, rad/s
        (vx, vy, omega) of K in the vehicle frame.
    kappa_g : float, 1/m, > 0
    sign : (...,) int, {-1, 1}
        Which of the two representations: the sign of v_s.

    Returns
    -------
    kappa_n : (...,) float, 1, [-2, 2]
    beta : (...,) float, rad, (-π, π]
    v_s : (...,) float, m/s

    Raises
    ------
    InvalidInput
        If a value is not finite, the last axis is not 3 or `sign` is not ±1.

    Examples
    --------
    Driving backwards is v_s < 0 at β = 0, or v_s > 0 at β = π:

    >>> kappa_n, beta, v_s = from_twist([-1.0, 0.0, 0.0], kappa_g=4.0, sign=-1)
    >>> float(beta), float(v_s)
    (0.0, -1.0)
    """
    twist = finite("twist", twist, "m/s and rad/s")
    if twist.ndim == 0 or twist.shape[-1] != 3:
        raise InvalidInput(Problem("twist", f"shape {twist.shape}", "shape (..., 3)"))
    sign = finite("sign", sign, "{-1, 1}")
    if (np.abs(sign) != 1).any():
        raise InvalidInput(Problem("sign", f"{sign}", "must be 1 or -1"))
    kappa_g = boundary_curvature(kappa_g)
    # Adding 0.0 turns -0.0 into 0.0: arctan2(-0.0, -1.0) would be -π.
    vx = sign * twist[..., 0] + 0.0
    vy = sign * twist[..., 1] + 0.0
    q = sign * twist[..., 2] / kappa_g
    p = np.hypot(vx, vy)
    kappa_n = curvature_of_ratio(p, q)
    beta = np.where(p > 0, wrap(np.arctan2(vy, vx)), 0.0)
    return kappa_n, beta, sign * np.maximum(p, np.abs(q))


def curvature_of_ratio(p: npt.ArrayLike, q: npt.ArrayLike) -> FloatArray:
    """Return κ_n of a translation speed p ≥ 0 and a signed rotation speed q = ω/κ_g.

    Increasing in q and, for q > 0, decreasing in p; 0 where both are 0.
    """
    p, q = np.asarray(p, dtype=np.float64), np.asarray(q, dtype=np.float64)
    size = np.abs(q)
    larger = np.maximum(np.maximum(p, size), np.finfo(np.float64).tiny)
    magnitude = np.where(size < p, size / larger, 2.0 - p / larger)
    magnitude = np.where((p == 0) & (size == 0), 0.0, magnitude)
    return np.where(q < 0, -magnitude, magnitude)  # sgn(0) = +1


def boundary_curvature(kappa_g: float) -> float:
    """Return `kappa_g`, or raise `InvalidInput` unless it is finite and positive."""
    value = finite("kappa_g", kappa_g, "1/m")
    if value.ndim or value <= 0:
        raise InvalidInput(Problem("kappa_g", f"{kappa_g}", "one positive number, 1/m"))
    return float(value)
