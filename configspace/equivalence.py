"""The four representations of one twist, and when two states are the same.

Two of them, R1 and R2, set every wheel alike: they differ by a way through a pole. The
other two, R3 and R4, turn every wheel by π and reverse its rolling. A planner's target
is all four; going from one kind to the other is a way of its own.

References
----------
Connette 2013, sections 4.1.1 and 4.1.2; spec/steered-wheels §3.3.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from configspace.angles import wrap
from configspace.errors import InvalidInput, Problem
from configspace.omni_curve import finite, together
from configspace.spherical import extended_components, spherical_arrays

__all__ = [
    "cross_pole",
    "equivalent",
    "omni_curve_representations",
    "representations",
]

FloatArray = npt.NDArray[np.float64]


def representations(
    rho: npt.ArrayLike, phi: npt.ArrayLike, theta: npt.ArrayLike
) -> FloatArray:
    """Return the four spherical coordinates of one twist.

    Parameters
    ----------
    rho : (...,) float, m/s
    phi, theta : (...,) float, rad

    Returns
    -------
    states : (..., 4, 3) float, m/s, rad, rad
        R1 as given, R2 through the pole, R3 reversed, R4 both; the angles in (-π, π].

    References
    ----------
    Connette 2013, Eq. (4.2), (4.3).

    Examples
    --------
    >>> representations(2.0, 0.0, 0.5 * np.pi)[:, 0]
    array([ 2.,  2., -2., -2.])
    """
    rho, phi, theta = spherical_arrays(rho, phi, theta)
    speeds = np.stack([rho, rho, -rho, -rho], axis=-1)
    phis = wrap(np.stack([phi, phi + np.pi, phi + np.pi, phi], axis=-1))
    thetas = wrap(np.stack([theta, np.pi - theta, -theta, theta - np.pi], axis=-1))
    return np.stack([speeds, phis, thetas], axis=-1)


def omni_curve_representations(
    kappa_n: npt.ArrayLike, beta: npt.ArrayLike, v_s: npt.ArrayLike
) -> FloatArray:
    """Return the four Omni-Curve states of one twist.

    Parameters
    ----------
    kappa_n : (...,) float, 1, [-4, 4]
    beta : (...,) float, rad
    v_s : (...,) float, m/s

    Returns
    -------
    states : (..., 4, 3) float, 1, rad, m/s
        (κ_n, β, v_s) of R1 to R4; β in (-π, π], κ_n in (-4, 4], where beyond ±2 the
        state is past the pole. Of |κ_n| < 2, R1 and R3 stay between the poles.

    References
    ----------
    spec/steered-wheels §3.3.

    Examples
    --------
    >>> omni_curve_representations(1.5, 0.0, 1.0)[:, 0]
    array([ 1.5,  2.5, -1.5, -2.5])
    """
    kappa_n, beta, v_s = _states(kappa_n, beta, v_s)
    beyond, turned = cross_pole(kappa_n, beta)
    kappas = _wrap_curvature(np.stack([kappa_n, beyond, -kappa_n, -beyond], axis=-1))
    betas = np.stack([wrap(beta), turned, turned, wrap(beta)], axis=-1)
    speeds = np.stack([v_s, v_s, -v_s, -v_s], axis=-1)
    return np.stack([kappas, betas, speeds], axis=-1)


def cross_pole(
    kappa_n: npt.ArrayLike, beta: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return the same configuration as reached through the nearer pole.

    Parameters
    ----------
    kappa_n : (...,) float, 1, [-4, 4]
    beta : (...,) float, rad

    Returns
    -------
    kappa_n : (...,) float, 1, (-4, 4]
        ``4 sgn(kappa_n) - kappa_n``.
    beta : (...,) float, rad, (-π, π]
        ``beta + π``.

    References
    ----------
    spec/omni-curve §1, fact 2.

    Examples
    --------
    A way that went through κ_n = 2 arrives here, in coordinates of [-2, 2]:

    >>> kappa_n, beta = cross_pole(2.5, 0.0)
    >>> float(kappa_n), float(beta / np.pi)
    (1.5, 1.0)
    """
    extended_components(kappa_n)
    kappa_n, beta = together(
        kappa_n=finite("kappa_n", kappa_n, "[-4, 4]"), beta=finite("beta", beta, "rad")
    )
    beyond = np.where(kappa_n < 0, -4.0, 4.0) - kappa_n  # sgn(0) = +1
    return _wrap_curvature(beyond), wrap(wrap(beta) + np.pi)


def equivalent(
    a: npt.ArrayLike,
    b: npt.ArrayLike,
    *,
    of: Literal["twist", "configuration"] = "twist",
    tolerance: float = 1e-9,
) -> npt.NDArray[np.bool_]:
    """Return whether two Omni-Curve states are the same motion.

    Parameters
    ----------
    a, b : (..., 3) float, 1, rad, m/s
        (κ_n, β, v_s), κ_n in [-4, 4].
    of : {"twist", "configuration"}
        What must be equal: the twist (all four representations are), or every
        steering angle and rolling speed too (R1 and R2 only). At standstill all
        twists are equal, configurations are not.
    tolerance : float, 1, ≥ 0
        Allowed difference, of directions and relative to the larger |v_s|.

    Returns
    -------
    same : (...,) bool

    Examples
    --------
    Driving forwards, and backwards with all wheels turned:

    >>> equivalent([0.5, 0.0, 1.0], [-0.5, np.pi, -1.0])
    array(True)
    >>> equivalent([0.5, 0.0, 1.0], [-0.5, np.pi, -1.0], of="configuration")
    array(False)
    """
    if of not in ("twist", "configuration"):
        raise InvalidInput(Problem("of", repr(of), "'twist' or 'configuration'"))
    vectors, speeds = [], []
    for name, state in (("a", a), ("b", b)):
        array = finite(name, state, "1, rad and m/s")
        if array.ndim == 0 or array.shape[-1] != 3:
            raise InvalidInput(Problem(name, f"shape {array.shape}", "shape (..., 3)"))
        c, s = extended_components(array[..., 0])
        beta, v_s = array[..., 1], array[..., 2]
        vectors.append(np.stack([c * np.cos(beta), c * np.sin(beta), s], axis=-1))
        speeds.append(v_s)
    scale = tolerance * np.maximum(np.abs(speeds[0]), np.abs(speeds[1]))
    if of == "twist":
        apart = vectors[0] * speeds[0][..., None] - vectors[1] * speeds[1][..., None]
        return np.asarray((np.abs(apart) <= scale[..., None]).all(axis=-1))
    alike = (np.abs(vectors[0] - vectors[1]) <= tolerance).all(axis=-1)
    return np.asarray(alike & (np.abs(speeds[0] - speeds[1]) <= scale))


def _states(
    kappa_n: npt.ArrayLike, beta: npt.ArrayLike, v_s: npt.ArrayLike
) -> tuple[FloatArray, ...]:
    return together(
        kappa_n=finite("kappa_n", kappa_n, "[-4, 4]"),
        beta=finite("beta", beta, "rad"),
        v_s=finite("v_s", v_s, "m/s"),
    )


def _wrap_curvature(kappa_n: FloatArray) -> FloatArray:
    """Return κ_n of (-4, 4]: -4 and 4 are the same, translation backwards in β."""
    return np.where(kappa_n <= -4, 4.0, kappa_n) + 0.0
