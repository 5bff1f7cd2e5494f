"""What pictures of plans show, as numbers; no matplotlib here."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from configspace import PermissibleSpace
from configspace.vehicle import Castor, SteerableWheel
from omniplan.plots.data import drive_of
from omniplan.trajectory import Trajectory

__all__ = ["Film", "film_of", "nose_at", "outline_at", "spread_along", "wheels_at"]

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
IntArray = npt.NDArray[np.int64]

NOSE = 0.15
"""Length and width of the triangle that points ahead, as a share of the vehicle's."""
WHEEL = 0.2, 0.07
"""Length and width of a wheel in a picture, as shares of the vehicle's length."""


@dataclass(frozen=True, eq=False)
class Film:
    """A vehicle along a trajectory, at n moments."""

    t: FloatArray
    """(n,) s, from 0 on."""
    outlines: FloatArray
    """(n, m, 2) m: the footprint."""
    wheels: FloatArray
    """(n, wheels, 4, 2) m: what is drawn of each wheel."""
    noses: FloatArray
    """(n, 3, 2) m: a triangle at the front that points ahead."""
    k: FloatArray
    """(n, 2) m: the reference point."""


def film_of(
    trajectory: Trajectory, space: PermissibleSpace, t: npt.ArrayLike | None = None
) -> Film:
    """Return a vehicle along a trajectory.

    Parameters
    ----------
    trajectory : Trajectory
        Of poses.
    space : PermissibleSpace
        With footprint.
    t : (n,) float, s, optional
        Moments since the start; default many.
    """
    drive = drive_of(trajectory, space)
    own = drive.t - drive.t[0]
    at = own if t is None else np.asarray(t, dtype=np.float64)
    poses = _columns(at, own, drive.poses)
    alpha = _columns(at, own, np.nan_to_num(drive.alpha))
    place = (poses[:, 0] + 1j * poses[:, 1])[:, None]
    turn = np.exp(1j * poses[:, 2])[:, None]
    corners = np.asarray(space.header.footprint) @ [1, 1j]
    n = len(at)
    wheels = wheels_at(space, alpha).reshape(n, -1)
    k = turn * complex(*space.header.reference) + place
    return Film(
        at,
        _xy(turn * corners + place),
        _xy(turn * wheels + place).reshape(n, -1, 4, 2),
        _xy(turn * (_nose(space) @ [1, 1j]) + place),
        _xy(k)[:, 0],
    )


def outline_at(pose: tuple[float, float, float], space: PermissibleSpace) -> FloatArray:
    """Return the footprint where K is in a pose, (m, 2) m.

    Parameters
    ----------
    pose : (float, float, float), m, m, rad
    space : PermissibleSpace
        With footprint.
    """
    return _placed(np.asarray(space.header.footprint), pose, space)


def nose_at(pose: tuple[float, float, float], space: PermissibleSpace) -> FloatArray:
    """Return a triangle at the front of the vehicle that points ahead, (3, 2) m.

    Parameters
    ----------
    pose : (float, float, float), m, m, rad
        Of K.
    space : PermissibleSpace
        With footprint.
    """
    return _placed(_nose(space), pose, space)


def _nose(space: PermissibleSpace) -> FloatArray:
    footprint = np.asarray(space.header.footprint)
    (_, y0), (x1, y1) = footprint.min(axis=0), footprint.max(axis=0)
    size, y = NOSE * float(np.ptp(footprint, axis=0).max()), (y0 + y1) / 2
    back = x1 - size
    return np.array([[x1, y], [back, y + size / 2], [back, y - size / 2]])


def _placed(
    points: FloatArray, pose: tuple[float, float, float], space: PermissibleSpace
) -> FloatArray:
    """Return points of the vehicle file's frame where K is in a pose."""
    from_k = (points - np.asarray(space.header.reference)) @ [1, 1j]
    return _xy(from_k * np.exp(1j * pose[2]) + complex(pose[0], pose[1]))


def wheels_at(space: PermissibleSpace, alpha: FloatArray) -> ComplexArray:
    """Return the corners of wheels (n, wheels, 4) in the frame of the vehicle file.

    Parameters
    ----------
    space : PermissibleSpace
    alpha : (n, wheels) float, rad
        Steering angles; of no meaning for wheels that do not steer.
    """
    vehicle = space.vehicle
    if vehicle is None:
        return np.empty((len(alpha), 0, 4), dtype=np.complex128)
    length = float(np.ptp(np.asarray(space.header.footprint), axis=0).max())
    half_length, half_width = (share * length / 2 for share in WHEEL)
    tread = np.array([1 + 1j, -1 + 1j, -1 - 1j, 1 - 1j])
    tread = half_length * tread.real + 1j * half_width * tread.imag
    shown = []
    for i, wheel in enumerate(vehicle.wheels):
        if isinstance(wheel, Castor):
            continue
        if isinstance(wheel, SteerableWheel):
            heading = alpha[:, i]
        else:
            heading = np.full(len(alpha), wheel.heading)
        shown.append(wheel.position + np.exp(1j * heading)[:, None] * tread)
    return np.stack(shown, axis=1)


def spread_along(film: Film, step: float) -> IntArray:
    """Return moments between which no corner moves much farther than a step, m."""
    moved = np.linalg.norm(np.diff(film.outlines, axis=0), axis=-1).max(axis=1)
    way = np.concatenate([[0.0], np.cumsum(moved)])
    n = max(2, int(np.ceil(way[-1] / step)) + 1)
    found = np.searchsorted(way, np.linspace(0.0, way[-1], n))
    return np.unique(np.minimum(found, len(way) - 1)).astype(np.int64)


def _columns(at: FloatArray, t: FloatArray, values: FloatArray) -> FloatArray:
    columns = [np.interp(at, t, column) for column in values.T]
    return np.stack(columns, axis=-1) if columns else np.empty((len(at), 0))


def _xy(z: ComplexArray) -> FloatArray:
    return np.stack([z.real, z.imag], axis=-1)
