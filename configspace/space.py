"""The permissible configuration space of one vehicle: its data sheet."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from configspace.angles import wrap
from configspace.exact import LINE_TOLERANCE, exact_reason, exact_v_max
from configspace.grid import Grid, edges_of
from configspace.kernels import BLOCKED, FREE, MIXED
from configspace.limits import Reason
from configspace.omni_curve import finite, nominal_curvature, together
from configspace.rate_cells import CellRates, cell_rate_limits
from configspace.rates import rate_limits
from configspace.sheet import SheetHeader, Tables
from configspace.undercarriage import Mobility
from configspace.vehicle import Vehicle

if TYPE_CHECKING:
    import trimesh

__all__ = ["PermissibleSpace"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class PermissibleSpace:
    """Which (κ_n, β, v_s) a vehicle may take; build it with `build_space`.

    An answer "permitted" is never wrong. Where a cell of the table is mixed, the exact
    formula settles the point if the vehicle is known; without it the cell counts as
    blocked.
    """

    header: SheetHeader
    tables: Tables
    rates: CellRates
    vehicle: Vehicle | None = None
    """The vehicle; None for a space that was read from a data sheet."""

    @property
    def name(self) -> str:
        """Name of the vehicle."""
        return self.header.name

    @property
    def kappa_g(self) -> float:
        """Boundary curvature, 1/m."""
        return self.header.kappa_g

    @property
    def line_beta(self) -> float | None:
        """The constant β of a line-mobile vehicle, rad; None for any β."""
        return self.header.line_beta

    @property
    def is_translating(self) -> bool:
        """Whether only κ_n = 0 is possible."""
        return self.header.is_translating

    @property
    def grid(self) -> Grid:
        """The grid of cells."""
        return self.header.grid

    def v_max(
        self, kappa_n: npt.ArrayLike, beta: npt.ArrayLike, *, reverse: bool = False
    ) -> FloatArray:
        """Return the fastest permitted |v_s|; never more than is permitted.

        Parameters
        ----------
        kappa_n : (...,) float, 1, [-2, 2]
        beta : (...,) float, rad
        reverse : bool
            For v_n < 0 rather than v_n > 0.

        Returns
        -------
        v_max : (...,) float, m/s, ≥ 0
            0 where blocked.

        Raises
        ------
        InvalidInput
            If a value is not finite or `kappa_n` is outside [-2, 2].

        Examples
        --------
        >>> import configspace
        >>> space = configspace.build_space(
        ...     configspace.load_vehicle("ift-four-steered"), cache=False)
        >>> space.v_max([0.0, 1.0, 0.0], [0.0, 0.0, 3.0]).round(3)
        array([1.   , 0.583, 0.   ])
        """
        kappa_n, beta = self._checked(kappa_n, beta)
        row, column, fk, fb, on_line = self._locate(kappa_n, beta)
        load = self._interpolated(row, column, fk, fb, reverse)
        state = self.tables.state[row, column]
        bit = 4 * np.minimum(4 * fk, 3).astype(int) + np.minimum(4 * fb, 3).astype(int)
        free = (self.tables.parts[row, column] >> bit) & 1 == 1
        # 1 / sqrt may round up; one part in 2**50 keeps the promise.
        v = np.where(free & on_line, (1 - 1e-15) / np.sqrt(load), 0.0)
        open_ = (state == MIXED) & ~free & on_line
        if self.vehicle is not None and open_.any():
            v[open_] = exact_v_max(
                self.vehicle, kappa_n[open_], beta[open_], reverse=reverse
            )
        return v

    def contains(
        self, kappa_n: npt.ArrayLike, beta: npt.ArrayLike, v_s: npt.ArrayLike
    ) -> BoolArray:
        """Return whether configurations are permitted at these speeds.

        Parameters
        ----------
        kappa_n : (...,) float, 1, [-2, 2]
        beta : (...,) float, rad
        v_s : (...,) float, m/s
            Negative for driving the configuration backwards.

        Returns
        -------
        permitted : (...,) bool

        Raises
        ------
        InvalidInput
            If a value is not finite or `kappa_n` is outside [-2, 2].
        """
        kappa_n, beta = self._checked(kappa_n, beta)
        kappa_n, beta, v_s = together(
            kappa_n=kappa_n, beta=beta, v_s=finite("v_s", v_s, "m/s")
        )
        bound = self.v_max(kappa_n, beta)
        if len(self.tables.load) > 1:
            backwards = self.v_max(kappa_n, beta, reverse=True)
            bound = np.where(v_s < 0, backwards, bound)
        return np.asarray((np.abs(v_s) <= bound) & (bound > 0))

    def reason(
        self, kappa_n: npt.ArrayLike, beta: npt.ArrayLike, *, reverse: bool = False
    ) -> npt.NDArray[np.uint16]:
        """Return which limits block or bind.

        Parameters
        ----------
        kappa_n : (...,) float, 1, [-2, 2]
        beta : (...,) float, rad
        reverse : bool

        Returns
        -------
        reason : (...,) uint16
            Flags of `Reason`: exact where the vehicle is known, else those of the cell;
            `Reason.UNREACHABLE` is added to what binds in another component.
        """
        return self.explain(kappa_n, beta, reverse=reverse)[0]

    def rate_limits(
        self, kappa_n: npt.ArrayLike, beta: npt.ArrayLike, v_n: npt.ArrayLike
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return how fast each parameter may change while the other two rest.

        Exact where the vehicle is known, else what all of the cell offers at least.

        Parameters
        ----------
        kappa_n : (...,) float, 1, [-2, 2]
        beta : (...,) float, rad
        v_n : (...,) float, 1, [-1, 1]

        Returns
        -------
        kappa_n_dot : (...,) float, 1/s
        beta_dot : (...,) float, rad/s
        v_n_dot : (...,) float, 1/s
            Infinite where no limit bounds it, 0 where the configuration is blocked.

        Raises
        ------
        InvalidInput
            If a value is not finite or `kappa_n` is outside [-2, 2].

        References
        ----------
        Brenner and Colomb 2022, section 4.6; spec/omni-curve §4.
        """
        kappa_n, beta = self._checked(kappa_n, beta)
        kappa_n, beta, v_n = together(
            kappa_n=kappa_n, beta=beta, v_n=finite("v_n", v_n, "[-1, 1]")
        )
        v_max = np.where(
            v_n < 0,
            self.v_max(kappa_n, beta, reverse=True),
            self.v_max(kappa_n, beta),
        )
        if self.vehicle is not None:
            found = rate_limits(self.vehicle, kappa_n, beta, v_n, v_max)
        else:
            row, column = self.rates.locate(kappa_n, beta)
            found = cell_rate_limits(self.rates, row, column, v_n, v_max)
        kappa_n_dot, beta_dot, v_n_dot = (np.where(v_max > 0, x, 0.0) for x in found)
        return kappa_n_dot, beta_dot, v_n_dot

    def to_mesh(self) -> trimesh.Trimesh:
        """Return the permissible set over (κ_n, β, v) as a closed solid.

        A vehicle that is bound to a line or cannot turn gets a flat ribbon. See
        `configspace.mesh`.
        """
        from configspace import mesh

        if self.line_beta is not None or self.is_translating:
            return mesh.to_ribbon(self)
        return mesh.to_mesh(self)

    def explain(
        self, kappa_n: npt.ArrayLike, beta: npt.ArrayLike, *, reverse: bool = False
    ) -> tuple[npt.NDArray[np.uint16], npt.NDArray[np.int16]]:
        """Return which limits block or bind, and the index of the wheel (-1: none).

        Parameters
        ----------
        kappa_n : (...,) float, 1, [-2, 2]
        beta : (...,) float, rad
        reverse : bool

        Returns
        -------
        reason : (...,) uint16
        wheel : (...,) int16
        """
        kappa_n, beta = self._checked(kappa_n, beta)
        row, column, _, _, on_line = self._locate(kappa_n, beta)
        apart = (self._reach[row, column] == BLOCKED) & on_line
        apart &= self.tables.state[row, column] == FREE
        extra = np.where(apart, np.uint16(Reason.UNREACHABLE), np.uint16(0))
        if self.vehicle is not None:
            why, who = exact_reason(self.vehicle, kappa_n, beta, reverse=reverse)
            return why | extra, who
        direction = self._direction(reverse)
        why = self.tables.reason[direction, row, column] | extra
        who = self.tables.wheel[direction, row, column]
        off = Reason.PARALLEL_WHEELS if self.is_translating else Reason.FIXED_WHEEL
        return (
            np.where(on_line, why, np.uint16(off)),
            np.where(on_line, who, np.int16(-1)),
        )

    def is_reachable(self, kappa_n: npt.ArrayLike, beta: npt.ArrayLike) -> BoolArray:
        """Return where configurations are permitted and connected with straight ahead.

        Proved by free cells, so an answer may be False next to a blocked area. Where
        straight ahead is blocked itself, the largest component is meant.

        Parameters
        ----------
        kappa_n : (...,) float, 1, [-2, 2]
        beta : (...,) float, rad
        """
        kappa_n, beta = self._checked(kappa_n, beta)
        row, column, _, _, on_line = self._locate(kappa_n, beta)
        return np.asarray((self._reach[row, column] == FREE) & on_line)

    @cached_property
    def _reach(self) -> npt.NDArray[np.uint8]:
        """Codes of `configspace.topology.reachable` per cell."""
        from configspace.topology import reachable

        line = self.line_beta
        mobility = Mobility(complex(*self.header.reference), line, self.is_translating)
        edges = edges_of(mobility, self.grid)
        code = reachable(self.tables.state, *edges, (0.0, line or 0.0))
        if (code == BLOCKED).all():  # straight ahead is blocked
            code = reachable(self.tables.state, *edges, None)
        return code

    def box(
        self,
        kappa_low: FloatArray,
        kappa_high: FloatArray,
        beta_low: FloatArray,
        beta_high: FloatArray,
        *,
        reverse: bool = False,
    ) -> tuple[npt.NDArray[np.uint8], FloatArray]:
        """Return what the table says of whole boxes in the (κ_n, β) plane.

        Only boxes of at most two cells by two, or of at most two rows over all β, are
        looked at closely; anything larger is `MIXED`, to be divided by the caller.

        Parameters
        ----------
        kappa_low, kappa_high : (n,) float, 1, [-2, 2]
        beta_low, beta_high : (n,) float, rad
            ``beta_low ≤ beta_high``, not wrapped; anything else is `MIXED`. Ignored for
            a line-mobile vehicle, whose caller has made sure that β is the constant.
        reverse : bool

        Returns
        -------
        state : (n,) uint8
            `FREE` or `BLOCKED` hold all over the box.
        v_low : (n,) float, m/s
            v_max is at least this all over the box where it is `FREE`.
        """
        load = self.tables.load[self._direction(reverse)]
        state = self.tables.state
        columns = state.shape[1]
        sound = (kappa_low >= -2) & (kappa_low <= kappa_high) & (kappa_high <= 2)
        sound &= beta_low <= beta_high
        kappa_low, kappa_high = (
            np.where(sound, k, 0.0) for k in (kappa_low, kappa_high)
        )
        beta_low, beta_high = (np.where(sound, b, 0.0) for b in (beta_low, beta_high))
        k0, f0 = self._row(kappa_low)
        k1, f1 = self._row(kappa_high)
        if self.is_translating:
            sound &= (kappa_low >= -LINE_TOLERANCE) & (kappa_high <= LINE_TOLERANCE)
        if columns == 1:
            m0, g0 = np.zeros_like(k0), np.zeros_like(f0)
            m1, g1 = m0, g0
        else:
            m0, g0 = self._column(beta_low)
            step = 2 * np.pi / columns
            reach = g0 + (beta_high - beta_low) / step * (1 + 1e-12)
            m1 = m0 + np.floor(reach).astype(np.int64)
            g1 = reach - np.floor(reach)
        near = (k1 - k0 <= 1) & (m1 - m0 <= 1)
        left, right = m0 % columns, m1 % columns
        corners = ((k0, left), (k0, right), (k1, left), (k1, right))
        all_free = np.all([state[at] == FREE for at in corners], axis=0)
        all_blocked = np.all([state[at] == BLOCKED for at in corners], axis=0)
        all_free |= self._parts_free(k0 + f0, k1 + f1, m0 + g0, m1 + g1)
        # A bilinear function is largest at a corner of a box; an edge between two
        # cells divides the box, so it counts as a corner from either side.
        over_k, over_m = (k1 > k0).astype(float), (m1 > m0).astype(float)
        rows_at = ((k0, f0), (k0, np.where(k1 > k0, over_k, f1)), (k1, f1))
        columns_at = ((left, g0), (left, np.where(m1 > m0, over_m, g1)), (right, g1))
        worst = np.max(
            [
                _bilinear(load, row, column, x, y)
                for row, x in rows_at
                for column, y in columns_at
            ],
            axis=0,
        )
        # A box over all β, as at the poles: whole rows of cells.
        ring = (k1 - k0 <= 1) & ~near
        row_free = (state == FREE).all(axis=1)
        all_free = np.where(ring, row_free[k0] & row_free[k1], all_free & near)
        ring_load = load.max(axis=1)
        at_ring = [(1 - f) * ring_load[k] + f * ring_load[k + 1] for k, f in rows_at]
        worst = np.where(ring, np.max(at_ring, axis=0), worst)
        answer = np.full(k0.shape, MIXED, np.uint8)
        answer[all_free & sound] = FREE
        answer[all_blocked & near & sound] = BLOCKED
        return answer, (1 - 1e-14) / np.sqrt(worst)

    def save(self, path: str | Path) -> None:
        """Write the data sheet; it can be used without the vehicle.

        Raises
        ------
        CacheError
            If the file cannot be written; an older file of that name stays as it is.
        """
        from configspace.storage import save_space

        save_space(self, Path(path))

    def _checked(
        self, kappa_n: npt.ArrayLike, beta: npt.ArrayLike
    ) -> tuple[FloatArray, FloatArray]:
        kappa_n, beta = together(
            kappa_n=nominal_curvature(kappa_n), beta=finite("beta", beta, "rad")
        )
        if (np.abs(beta) > np.pi).any():
            beta = wrap(beta)
        return kappa_n, beta

    def _direction(self, reverse: bool) -> Literal[0, 1]:
        return 1 if reverse and len(self.tables.load) > 1 else 0

    def _parts_free(
        self,
        k_low: FloatArray,
        k_high: FloatArray,
        m_low: FloatArray,
        m_high: FloatArray,
    ) -> BoolArray:
        """Return whether boxes lie in two by two free parts of cells at most.

        The boxes are given in cells, β not wrapped.
        """
        rows, columns = self.tables.state.shape
        ends = [
            np.floor(4 * x).astype(np.int64) for x in (k_low, k_high, m_low, m_high)
        ]
        i0, i1 = (np.minimum(x, 4 * rows - 1) for x in ends[:2])
        j0, j1 = ends[2:] if columns > 1 else (np.minimum(x, 3) for x in ends[2:])
        free = (i1 - i0 <= 1) & (j1 - j0 <= 1)
        for i in (i0, i1):
            for j in (j0, j1):
                parts = self.tables.parts[i // 4, (j // 4) % columns]
                free = free & ((parts >> (4 * (i % 4) + j % 4)) & 1 == 1)
        return np.asarray(free)

    def _row(self, kappa_n: FloatArray) -> tuple[npt.NDArray[np.int64], FloatArray]:
        """Return the row of cells and the place within it, 0 to 1."""
        if self.is_translating:
            return np.zeros(kappa_n.shape, np.int64), np.zeros(kappa_n.shape)
        position = (kappa_n + 2) * (self.grid.n_kappa / 4)
        row = np.clip(position.astype(np.int64), 0, self.grid.n_kappa - 1)
        return row, position - row

    def _column(self, beta: FloatArray) -> tuple[npt.NDArray[np.int64], FloatArray]:
        """Return the column of cells and the place within it, 0 to 1."""
        columns = self.tables.state.shape[1]
        position = np.mod(beta + np.pi, 2 * np.pi) * (columns / (2 * np.pi))
        column = np.clip(position.astype(np.int64), 0, columns - 1)
        return column, np.clip(position - column, 0.0, 1.0)

    def _locate(
        self, kappa_n: FloatArray, beta: FloatArray
    ) -> tuple[
        npt.NDArray[np.int64], npt.NDArray[np.int64], FloatArray, FloatArray, BoolArray
    ]:
        row, fk = self._row(kappa_n)
        if self.line_beta is None:
            column, fb = self._column(beta)
            on_line = np.ones(row.shape, dtype=bool)
            if self.is_translating:
                on_line = np.abs(kappa_n) <= LINE_TOLERANCE
            return row, column, fk, fb, on_line
        pole = np.abs(kappa_n) == 2  # rotation about K: β has no meaning
        on_line = (np.abs(wrap(beta - self.line_beta)) <= LINE_TOLERANCE) | pole
        return row, np.zeros_like(row), fk, np.zeros_like(fk), on_line

    def _interpolated(
        self,
        row: npt.NDArray[np.int64],
        column: npt.NDArray[np.int64],
        fk: FloatArray,
        fb: FloatArray,
        reverse: bool,
    ) -> FloatArray:
        return _bilinear(
            self.tables.load[self._direction(reverse)], row, column, fk, fb
        )


def _bilinear(
    nodes: npt.NDArray[np.float32],
    row: npt.NDArray[np.int64],
    column: npt.NDArray[np.int64],
    fk: FloatArray,
    fb: FloatArray,
) -> FloatArray:
    """Return nodes interpolated bilinearly within their cells."""
    below = (1 - fb) * nodes[row, column] + fb * nodes[row, column + 1]
    above = (1 - fb) * nodes[row + 1, column] + fb * nodes[row + 1, column + 1]
    return np.asarray((1 - fk) * below + fk * above, dtype=np.float64)
