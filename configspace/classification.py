"""What kind of undercarriage a vehicle has, by the ranks of its no-slip conditions.

The degree of mobility δ_m counts the motions open at once, without steering; the
degree of steerability δ_s counts what steering adds; their sum δ_M is the
manoeuvrability. This is kinematics: it says what the wheels allow, not whether motors
can bring it about.

References
----------
Campion, Bastin and D'Andréa-Novel 1996; Connette 2013, section 2.2.2 and appendix C.2;
spec/steered-wheels §1.6, where the printed formula of δ_s is corrected.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from configspace.constraints import (
    is_kind,
    is_standard,
    no_slip_rows,
    steering_residual,
)
from configspace.omni_curve import finite
from configspace.vehicle import FixedWheel, Vehicle

__all__ = ["Classification", "classify", "configuration_rank", "is_admissible"]

FloatArray = npt.NDArray[np.float64]

# Axle lines that agree to this, in rad or relative to the vehicle's size, are one.
_SAME_AXLE = 1e-6


@dataclass(frozen=True)
class Classification:
    """Degrees of freedom of an undercarriage, and what they mean for its motion."""

    delta_m: int
    """Degree of mobility δ_m: dimension of the twists open at once."""
    delta_s: int
    """Degree of steerability δ_s: independent steering directions."""
    name: str
    """The type's usual name."""
    rule: str
    """Where the centre of rotation (ICR) may be and how it may move."""

    @property
    def delta_M(self) -> int:
        """Degree of manoeuvrability, δ_m + δ_s."""
        return self.delta_m + self.delta_s

    @property
    def degrees(self) -> tuple[int, int, int]:
        """(δ_m, δ_s, δ_M)."""
        return (self.delta_m, self.delta_s, self.delta_M)


# Connette 2013, Table 2.4 and appendix C.2.
_TYPES: dict[tuple[int, int], tuple[str, str]] = {
    (1, 1): (
        "Ackermann or tricycle",
        "the ICR is on the axle line of the fixed wheels and moves along it "
        "continuously",
    ),
    (2, 0): (
        "differential drive",
        "the ICR is on the axle line of the fixed wheels and may jump along it",
    ),
    (1, 2): (
        "quasi-omnidirectional, all standard wheels steered",
        "the ICR may be anywhere, at infinity too, and moves continuously",
    ),
    (2, 1): (
        "quasi-omnidirectional, one steered axle",
        "the ICR may be anywhere; it may jump along the axle line of the steered "
        "wheel, the line itself moves continuously",
    ),
    (3, 0): (
        "omnidirectional",
        "the ICR may be anywhere and may jump",
    ),
}
_SYNCHRO = (
    "synchro drive",
    "the ICR is at infinity: the vehicle translates without turning, and the "
    "direction moves continuously",
)
_SKID = (
    "skid steer, as a differential drive with an effective track",
    "the ICR is on the axle line of the effective track and may jump along it; the "
    "wheels slip wherever the vehicle turns",
)


def classify(vehicle: Vehicle) -> Classification:
    """Return the type of an undercarriage.

    With C_f the no-slip rows of the fixed wheels and C those of all standard wheels, at
    a generic configuration with one centre of rotation: ``δ_m = 3 - rank C`` and
    ``δ_s = rank C - rank C_f``.

    A synchro drive is (1, 1): its parallel axles have rank C = 2, so δ_m = 1, but the
    angles that its one steering motor can set are a curve (all α alike), not the
    surface of all centres, so δ_s = 1 and not 2. Its centre is always at infinity.

    Parameters
    ----------
    vehicle : Vehicle

    Returns
    -------
    classification : Classification

    References
    ----------
    Connette 2013, Eq. (2.19), (2.21), Table 2.4; (2.20) as corrected.

    Examples
    --------
    >>> from configspace import load_vehicle
    >>> classify(load_vehicle("differential")).degrees
    (2, 0, 2)
    >>> classify(load_vehicle("ift-four-steered")).degrees
    (1, 2, 3)
    """
    if vehicle.mobility.is_translating:
        return Classification(1, 1, *_SYNCHRO)
    rows = np.stack([_generic_rows(vehicle, centre) for centre in _centres(vehicle)])
    rank = int(_rank(rows, _size(vehicle), _SAME_AXLE).max())
    fixed = int(vehicle.mobility.line_beta is not None)  # all share one axle line
    delta_m, delta_s = 3 - rank, rank - fixed
    name, rule = _TYPES[delta_m, delta_s]
    if vehicle.skid_steer is not None:
        name, rule = _SKID
    return Classification(delta_m, delta_s, name, rule)


def configuration_rank(
    vehicle: Vehicle, alpha: npt.ArrayLike, tolerance: float = 1e-6
) -> npt.NDArray[np.int_]:
    """Return the rank of the no-slip conditions at given steering angles.

    Parameters
    ----------
    vehicle : Vehicle
        With n wheels.
    alpha : (..., n) float, rad
        Steering angles; read for wheels that steer only.
    tolerance : float, 1, ≥ 0
        Singular values up to this count as 0; about a steering error in rad.

    Returns
    -------
    rank : (...,) int, 0 to 3
        3: the wheels block one another; otherwise 3 - rank motions are open.

    References
    ----------
    Connette 2013, Eq. (2.19).
    """
    rows = no_slip_rows(vehicle, alpha)
    size = 1 / vehicle.boundary_curvature
    return _rank(rows, size, float(finite("tolerance", tolerance, "1")))


def is_admissible(
    vehicle: Vehicle, alpha: npt.ArrayLike, tolerance: float = 1e-6
) -> npt.NDArray[np.bool_]:
    """Return whether the vehicle can move at given steering angles.

    It can if all axle lines meet in one point or are parallel.

    Parameters
    ----------
    vehicle : Vehicle
        With n wheels.
    alpha : (..., n) float, rad
    tolerance : float, 1, ≥ 0
        As of `configuration_rank`; measured angles need their noise.

    Returns
    -------
    admissible : (...,) bool
    """
    tolerance = float(finite("tolerance", tolerance, "1"))
    return np.asarray(steering_residual(vehicle, alpha) <= tolerance)


def _rank(rows: FloatArray, size: float, tolerance: float) -> npt.NDArray[np.int_]:
    """Return the rank of rows (..., m, 3), with levers measured in `size`, m."""
    if not rows.shape[-2]:
        return np.zeros(rows.shape[:-2], dtype=np.int_)
    values = np.linalg.svd(rows * [1.0, 1.0, 1 / size], compute_uv=False)
    return np.asarray((values > tolerance).sum(axis=-1))


def _size(vehicle: Vehicle) -> float:
    """Return the distance of the farthest wheel from K, m; 1 if all are there."""
    return max(abs(w - vehicle.reference) for w in vehicle.contacts) or 1.0


def _centres(vehicle: Vehicle) -> list[complex]:
    """Return centres of rotation in no special place, relative to K, m.

    Those of a line-mobile vehicle are on its axle line. Several, because any one may
    be in line with two wheels, whose axles then agree; none is on a wheel.
    """
    size = _size(vehicle)
    line = vehicle.mobility.line_beta
    if line is None:
        turns = np.exp(2.399963j * np.arange(1, 9))  # the golden angle
        places = size * np.linspace(0.41, 1.73, 8) * turns
    else:
        shares = np.array([-3.3, -1.9, -0.83, -0.31, 0.27, 0.71, 1.57, 2.9])
        places = size * shares * 1j * np.exp(1j * line)
    w = np.array(vehicle.contacts) - vehicle.reference
    room = np.abs(places[:, None] - w).min(axis=-1)
    return [complex(place) for place in places[np.argsort(-room)[:4]]]


def _generic_rows(vehicle: Vehicle, centre: complex) -> FloatArray:
    """Return C_1S with every steered axle through `centre`, and one fixed wheel.

    The others share its axle line, up to what rounding in the file may hide.
    """
    w = np.array(vehicle.contacts) - vehicle.reference
    rows = no_slip_rows(vehicle, np.angle(1j * (w - centre)))
    fixed = is_kind(vehicle, FixedWheel)[is_standard(vehicle)]
    kept: FloatArray = rows[~fixed | (np.cumsum(fixed) == 1)]
    return kept
