"""How far configurations are from what is not permitted.

Distances are angles on the sphere of configurations (`configspace.spherical`): the
angle by which a motion changes its direction, in which neither β = ±π nor the poles
are borders. The table of a space is cut into parts; what is not proved free counts as
blocked, so the true distance is never less than what is said here.

Along a way of length L between two configurations with distances a and b, nothing is
nearer to what is blocked than ``(a + b - L) / 2``: the distance changes by no more than
the way does.

References
----------
spec/steered-wheels §6, item M9.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from configspace.angles import wrap
from configspace.exact import LINE_TOLERANCE
from configspace.kernels import FREE
from configspace.omni_curve import components, finite, nominal_curvature, together
from configspace.space import PermissibleSpace
from configspace.spherical import angular_distance, sphere_point

if TYPE_CHECKING:
    from scipy.spatial import KDTree

__all__ = ["ClearanceMap", "clearance_map", "path_clearance"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class ClearanceMap:
    """Distances within one space; build it once with `clearance_map`."""

    space: PermissibleSpace
    scale: float
    """``d κ_g`` of the metric, see `sphere_point`."""
    free: BoolArray
    """(k, m) which parts of the table are permitted all over."""
    radius: float
    """No point of a part at the border is farther than this from its middle, rad."""
    tree: KDTree | None
    """Middles of the parts at the border that are not free; None if there are none."""

    def __call__(self, kappa_n: npt.ArrayLike, beta: npt.ArrayLike) -> FloatArray:
        """Return how far configurations are at least from the next that is blocked.

        Parameters
        ----------
        kappa_n : (...,) float, 1, [-2, 2]
        beta : (...,) float, rad

        Returns
        -------
        clearance : (...,) float, rad, ≥ 0
            Never more than the true distance, and less than it by 2 times `radius` at
            most where every part that is not free holds something blocked; 0 where the
            configuration is not permitted for sure; infinite where nothing is blocked.
            Of a line-mobile vehicle the distance along its line.

        Raises
        ------
        InvalidInput
            If a value is not finite or `kappa_n` is outside [-2, 2].
        """
        kappa_n, beta = together(
            kappa_n=nominal_curvature(kappa_n), beta=finite("beta", beta, "rad")
        )
        inside = self._is_free(kappa_n, beta)
        if self.tree is None:
            return np.where(inside, np.inf, 0.0)
        points = _points(self.space, kappa_n, beta, self.scale)
        chord, _ = self.tree.query(points)
        angle = 2 * np.arcsin(np.minimum(np.asarray(chord) / 2, 1.0))
        least = np.maximum(angle * (1 - 1e-12) - self.radius, 0.0)
        return np.where(inside, least, 0.0)

    def _is_free(self, kappa_n: FloatArray, beta: FloatArray) -> BoolArray:
        """Return whether the part of the table with a configuration is free."""
        rows, columns = self.free.shape
        row = np.clip(((kappa_n + 2) * (rows / 4)).astype(np.int64), 0, rows - 1)
        turned = np.mod(beta + np.pi, 2 * np.pi) * (columns / (2 * np.pi))
        column = np.clip(turned.astype(np.int64), 0, columns - 1)
        line = self.space.line_beta
        on_line = np.ones(kappa_n.shape, dtype=bool)
        if line is not None:
            column = np.zeros_like(column)
            apart = np.abs(wrap(beta - line)) > LINE_TOLERANCE
            on_line = ~apart | (np.abs(kappa_n) == 2)
        if self.space.is_translating:
            row = np.zeros_like(row)
            on_line = np.abs(kappa_n) <= LINE_TOLERANCE
        return np.asarray(self.free[row, column] & on_line)


def clearance_map(space: PermissibleSpace, d: float | None = None) -> ClearanceMap:
    """Return the map of distances to what is blocked.

    Parameters
    ----------
    space : PermissibleSpace
    d : float, m, > 0, optional
        Length that weights rotation; default 1/κ_g. `energy_length` gives the metric of
        kinetic energy, one d for all a comparable measure for a fleet.

    Examples
    --------
    >>> import configspace
    >>> space = configspace.build_space(
    ...     configspace.load_vehicle("ift-four-steered"), cache=False)
    >>> clearance = configspace.clearance_map(space)
    >>> ahead = clearance(0.0, [0.0, 2.0, 3.0])
    >>> ahead.round(2)
    array([1.23, 0.47, 0.  ])
    """
    from scipy.spatial import KDTree

    from configspace.topology import part_states

    scale = 1.0 if d is None else float(finite("d", d, "m")) * space.kappa_g
    sphere_point(0.0, 0.0, scale)  # raises unless d is positive
    state, kappa, beta = part_states(space)
    free = np.asarray(state == FREE)
    free.flags.writeable = False
    row, column = np.nonzero(_border(space, free))
    if not row.size:
        return ClearanceMap(space, scale, free, 0.0, None)
    middle = (kappa[row] + kappa[row + 1]) / 2, (beta[column] + beta[column + 1]) / 2
    points = _points(space, *middle, scale)
    radius = _radius(kappa, beta, scale, np.unique(row))
    return ClearanceMap(space, scale, free, radius, KDTree(points))


def path_clearance(
    clearance: ClearanceMap, kappa_n: npt.ArrayLike, beta: npt.ArrayLike
) -> float:
    """Return how far a way stays at least from what is blocked.

    Parameters
    ----------
    clearance : ClearanceMap
    kappa_n : (n,) float, 1, [-2, 2]
    beta : (n,) float, rad
        Samples of the way, joined by great circles: the shortest ways between them.

    Returns
    -------
    margin : float, rad, ≥ 0
        Holds between the samples too; 0 where that is not sure.

    Raises
    ------
    InvalidInput
        If a value is not finite or `kappa_n` is outside [-2, 2].
    """
    kappa_n, beta = together(
        kappa_n=nominal_curvature(kappa_n), beta=finite("beta", beta, "rad")
    )
    at = clearance(kappa_n.ravel(), beta.ravel())
    points = _points(clearance.space, kappa_n.ravel(), beta.ravel(), clearance.scale)
    length = angular_distance(points[1:], points[:-1]) * (1 + 1e-12)
    between = np.maximum((at[1:] + at[:-1] - length) / 2, 0.0)
    return float(min(at.min(initial=np.inf), between.min(initial=np.inf)))


def _points(
    space: PermissibleSpace, kappa_n: FloatArray, beta: FloatArray, scale: float
) -> FloatArray:
    """Return points of the sphere; those of a line-mobile vehicle on its line."""
    if space.line_beta is not None:
        beta = np.full(np.shape(kappa_n), space.line_beta)
    return sphere_point(kappa_n, beta, scale)


def _border(space: PermissibleSpace, free: BoolArray) -> BoolArray:
    """Return the parts that are not free and touch a free one, if at a corner only.

    The shortest way out of what is free ends in one of them. At a pole all parts of a
    row touch.
    """
    around = np.pad(free, ((1, 1), (0, 0)))
    if space.line_beta is None:
        around = np.concatenate([around[:, -1:], around, around[:, :1]], axis=1)
    else:
        around = np.pad(around, ((0, 0), (1, 1)))
    rows, columns = free.shape
    near = np.zeros_like(free)
    for i in range(3):
        for j in range(3):
            near |= around[i : i + rows, j : j + columns]
    if space.line_beta is None and not space.is_translating:
        for pole in (0, -1):
            near[pole] |= free[pole].any()
    return np.asarray(near & ~free)


def _radius(
    kappa: FloatArray, beta: FloatArray, scale: float, rows: npt.NDArray[np.int64]
) -> float:
    """Return how far the points of parts in these rows are from their middles, rad.

    No longer than the straight way in (φ, θ): ``ds² = dθ² + cos²θ dφ²``. The middle is
    that of κ_n, not of θ, so the larger part of the row counts.
    """
    c, s = components(kappa)
    theta = np.arctan2(scale * s, c)
    c, s = components((kappa[1:] + kappa[:-1]) / 2)
    middle = np.arctan2(scale * s, c)
    up = np.maximum(theta[1:] - middle, middle - theta[:-1])
    # A row has one sign of κ_n: cos θ is largest at one of its edges.
    wide = np.maximum(np.cos(theta[1:]), np.cos(theta[:-1])) * (beta[1] - beta[0]) / 2
    return float(np.hypot(up, wide)[rows].max() * (1 + 1e-9))
