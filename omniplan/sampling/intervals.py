"""Which turns of β a vehicle may make at constant κ_n, without sampling them.

Between two states of SE(2), with position and heading linear, κ_n is constant and β
turns against the heading. Whether all of such a piece is permitted is looked up in
O(log n): in the n intervals of β that are free all over a row of the data sheet, or, if
the vehicle is known and the sheet cannot tell, by the borders at the very κ_n in closed
form. Limits on the speed matter only if one is asked for: they block nothing.

An answer "permitted" is never wrong. What is refused although it is permitted lies next
to a border: within 1e-7 rad if the vehicle is known, within a part of a cell otherwise.

References
----------
spec/omni-curve §3, sound cells; §1, facts 1 and 2.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from configspace import PermissibleSpace
from configspace.grid import edges_of
from configspace.kernels import BLOCKED, FREE
from configspace.limits import SectorRow, rows_of
from configspace.omni_curve import finite, nominal_curvature, together
from configspace.space import require_space
from configspace.topology import part_states, reachable
from configspace.undercarriage import Mobility
from omniplan.sampling import kernels
from omniplan.sampling.slowest import SlowestTable

__all__ = ["PermittedIntervals"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

_ALL_ROUND = 1e9
"""Ends of an interval that is the whole circle, rad."""
_INSIDE = 1e-9
"""Intervals are smaller by this at both ends, rad, which covers rounding."""

_TABLES: WeakKeyDictionary[PermissibleSpace, dict[bool, FloatArray]] = (
    WeakKeyDictionary()
)
"""Tables that have been filled; they go with their spaces."""


@dataclass(frozen=True, eq=False)
class PermittedIntervals:
    """Permitted turns of β per κ_n, made from a space.

    Parameters
    ----------
    space : PermissibleSpace
        Built, so that it knows its vehicle, or read from a data sheet.
    reachable_only : bool
        Whether to refuse what lies for sure in another connected component of the space
        than straight ahead; what is undecided counts as connected, as for `validate`.

    Raises
    ------
    InvalidInput
        If the space is none.

    Examples
    --------
    >>> import configspace
    >>> space = configspace.build_space(
    ...     configspace.load_vehicle("ift-four-steered"), cache=False)
    >>> intervals = PermittedIntervals(space)
    >>> bool(intervals.is_permitted(0.0, -2.7, 2.7))  # wheels turn to ±155° at most
    True
    >>> bool(intervals.is_permitted(0.0, 0.0, 2.8))
    False
    """

    space: PermissibleSpace
    reachable_only: bool = True

    def __post_init__(self) -> None:
        """Refuse anything but a space."""
        require_space(self.space)

    @cached_property
    def table(self) -> FloatArray:
        """The flat table that `omniplan.sampling.kernels` read, read-only."""
        known = _TABLES.setdefault(self.space, {})
        if self.reachable_only not in known:
            table = _filled(self.space, self.reachable_only)
            table.flags.writeable = False
            known[self.reachable_only] = table
        return known[self.reachable_only]

    def is_permitted(
        self,
        kappa_n: npt.ArrayLike,
        beta_0: npt.ArrayLike,
        beta_1: npt.ArrayLike,
        *,
        v_s: npt.ArrayLike = 0.0,
    ) -> BoolArray:
        """Return whether κ_n is permitted at all β from β_0 to β_1.

        Parameters
        ----------
        kappa_n : (...,) float, 1, [-2, 2]
        beta_0, beta_1 : (...,) float, rad
            Not wrapped: β goes from one to the other, which may be more than a turn.
        v_s : (...,) float, m/s
            The speed to drive all of the piece with, negative for driving it backwards;
            0 for any.

        Returns
        -------
        permitted : (...,) bool
            In this representation; (-κ_n, β + π) is another configuration.

        Raises
        ------
        InvalidInput
            If a value is not finite or `kappa_n` is outside [-2, 2].
        """
        kappa_n, beta_0, beta_1 = _checked(kappa_n, beta_0, beta_1)
        kappa_n, beta_0, beta_1, speed = together(
            kappa_n=kappa_n, beta_0=beta_0, beta_1=beta_1, v_s=finite("v_s", v_s, "m/s")
        )
        out = self._permitted(kappa_n, beta_0, beta_1)
        for reverse in (False, True):
            asked = out & (speed < 0 if reverse else speed > 0)
            if asked.any():
                bound = self._slowest.v_max(
                    kappa_n[asked], beta_0[asked], beta_1[asked], reverse
                )
                out[asked] = np.abs(speed[asked]) <= bound
        return out

    def v_max(
        self,
        kappa_n: npt.ArrayLike,
        beta_0: npt.ArrayLike,
        beta_1: npt.ArrayLike,
        *,
        reverse: bool = False,
    ) -> FloatArray:
        """Return a speed that is permitted all over a piece; 0 where it is refused.

        The least v_max of the piece or a little less: it comes from the table, where
        the speed at nodes is rounded down and the β of two rows of nodes do not meet.

        Parameters
        ----------
        kappa_n : (...,) float, 1, [-2, 2]
        beta_0, beta_1 : (...,) float, rad
            As of `is_permitted`.
        reverse : bool
            For v_n < 0 rather than v_n > 0.

        Returns
        -------
        v_max : (...,) float, m/s, ≥ 0

        Raises
        ------
        InvalidInput
            If a value is not finite or `kappa_n` is outside [-2, 2].
        """
        kappa_n, beta_0, beta_1 = _checked(kappa_n, beta_0, beta_1)
        bound = self._slowest.v_max(kappa_n, beta_0, beta_1, reverse)
        permitted = self._permitted(kappa_n, beta_0, beta_1)
        return np.where(permitted, bound, 0.0)

    def permits(self, kappa_n: float, beta_0: float, beta_1: float) -> bool:
        """Return `is_permitted` of one piece; plain numbers in range, not checked."""
        return bool(
            kernels.is_piece_permitted(self.table, kappa_n, beta_0, beta_1 - beta_0)
        )

    def piece_speed(
        self, kappa_n: float, beta_0: float, beta_1: float, *, reverse: bool = False
    ) -> float:
        """Return `v_max` of one piece, m/s; plain numbers in range, not checked."""
        if not self.permits(kappa_n, beta_0, beta_1):
            return 0.0
        return self._slowest.of_piece(kappa_n, beta_0, beta_1, reverse)

    def _permitted(
        self, kappa_n: FloatArray, beta_0: FloatArray, beta_1: FloatArray
    ) -> BoolArray:
        out = np.empty(kappa_n.shape, np.bool_)
        flat = [np.ascontiguousarray(x).ravel() for x in (kappa_n, beta_0, beta_1)]
        kernels.are_pieces_permitted(
            self.table, flat[0], flat[1], flat[2] - flat[1], out.reshape(-1)
        )
        return out

    @cached_property
    def _slowest(self) -> SlowestTable:
        return SlowestTable.of(self.space)


def _checked(
    kappa_n: npt.ArrayLike, beta_0: npt.ArrayLike, beta_1: npt.ArrayLike
) -> tuple[FloatArray, ...]:
    return together(
        kappa_n=nominal_curvature(kappa_n),
        beta_0=finite("beta_0", beta_0, "rad"),
        beta_1=finite("beta_1", beta_1, "rad"),
    )


def _filled(space: PermissibleSpace, reachable_only: bool) -> FloatArray:
    """Return the table: header, intervals free and shut per row, sectors."""
    line = space.line_beta
    state, _, beta = part_states(space)
    shut = state == BLOCKED
    if reachable_only:
        shut = shut | _apart(space, state.shape)
    free = (state == FREE) & ~shut
    if space.is_translating:  # one row, whatever the κ_n within rounding
        free, shut = free[:1], shut[:1]
    rows = len(free)
    runs = [list(_runs(row, beta)) for row in itertools.chain(free, shut)]
    starts = np.cumsum([0] + [2 * len(each) for each in runs])
    sectors = _sectors(space)
    first_index = kernels.HEADER
    first_interval = first_index + 2 * rows + 1
    first_sector = first_interval + int(starts[-1])
    table = np.zeros(first_sector + sectors.size)
    table[kernels.KAPPA_G] = space.kappa_g
    table[kernels.SHAPE] = (
        kernels.LINE if line is not None
        else kernels.TRANSLATING if space.is_translating
        else kernels.PLANE
    )  # fmt: skip
    table[kernels.LINE_BETA] = line or 0.0
    table[kernels.ROWS] = rows
    table[kernels.FREE_INDEX] = first_index
    table[kernels.SHUT_INDEX] = first_index + rows
    table[kernels.FIRST_SECTOR] = first_sector
    table[kernels.SECTORS] = len(sectors)
    table[kernels.KNOWN] = space.vehicle is not None
    table[first_index:first_interval] = first_interval + starts
    ends = [end for each in runs for interval in each for end in interval]
    table[first_interval:first_sector] = ends
    table[first_sector:] = sectors.ravel()
    return table


def _apart(space: PermissibleSpace, shape: tuple[int, ...]) -> BoolArray:
    """Return which parts lie for sure in another component than straight ahead."""
    line = space.line_beta
    mobility = Mobility(complex(*space.header.reference), line, space.is_translating)
    edges = edges_of(mobility, space.grid)
    code = reachable(space.tables.state, *edges, (0.0, line or 0.0))
    if (code == BLOCKED).all():  # straight ahead is blocked: the largest one is meant
        code = reachable(space.tables.state, *edges, None)
    apart = np.repeat(code == BLOCKED, 4, axis=0)
    apart = apart if line is not None else np.repeat(apart, 4, axis=1)
    return np.asarray(apart[: shape[0], : shape[1]])


def _runs(row: BoolArray, beta: FloatArray) -> Iterator[tuple[float, float]]:
    """Yield the intervals of β of a row of parts that are all True, round the seam.

    They start in [-π, π) in rising order; the last one may end beyond π.
    """
    if row.all():
        yield -_ALL_ROUND, _ALL_ROUND
        return
    change = np.flatnonzero(np.diff(np.concatenate([[False], row, [False]])))
    runs = [(float(beta[a]), float(beta[b])) for a, b in change.reshape(-1, 2)]
    if len(runs) > 1 and row[0] and row[-1]:
        _, end = runs.pop(0)
        runs[-1] = (runs[-1][0], end + 2 * math.pi)
    for start, end in runs:
        yield start + _INSIDE, end - _INSIDE


def _sectors(space: PermissibleSpace) -> FloatArray:
    """Return the numbers of all `SectorRow`, (n, 7)."""
    if space.vehicle is None:
        return np.zeros((0, 7))
    _, sectors = rows_of(space.vehicle)
    return np.array([_numbers(row) for row in sectors]).reshape(-1, 7)


def _numbers(row: SectorRow) -> tuple[float, ...]:
    return (
        row.b.real,
        row.b.imag,
        row.middle,
        row.half,
        row.kappa_share,
        row.beta_share,
        row.pole_arm,
    )
