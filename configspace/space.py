"""The permissible configuration space of one vehicle: its data sheet."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from configspace.angles import wrap
from configspace.boxes import bilinear, box_states, column_of, row_of
from configspace.errors import InvalidInput, Problem
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

__all__ = ["PermissibleSpace", "require_space"]

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
        self,
        kappa_n: npt.ArrayLike,
        beta: npt.ArrayLike,
        *,
        reverse: bool = False,
        reachable_only: bool = False,
    ) -> FloatArray:
        """Return the fastest permitted |v_s|; never more than is permitted.

        Whether a way inside the space leads there is kept apart from the limits: it is
        left out unless `reachable_only` asks for it.

        Parameters
        ----------
        kappa_n : (...,) float, 1, [-2, 2]
        beta : (...,) float, rad
        reverse : bool
            For v_n < 0 rather than v_n > 0.
        reachable_only : bool
            Return 0 also where the configuration lies for sure in another connected
            component than straight ahead, or than the largest one if straight ahead is
            blocked (`is_reachable` asks for proof of the contrary).

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
        if reachable_only:
            v[self._reach[row, column] == BLOCKED] = 0.0
        return v

    def contains(
        self,
        kappa_n: npt.ArrayLike,
        beta: npt.ArrayLike,
        v_s: npt.ArrayLike,
        *,
        reachable_only: bool = False,
    ) -> BoolArray:
        """Return whether configurations are permitted at these speeds.

        Parameters
        ----------
        kappa_n : (...,) float, 1, [-2, 2]
        beta : (...,) float, rad
        v_s : (...,) float, m/s
            Negative for driving the configuration backwards.
        reachable_only : bool
            Return False also where the configuration lies for sure in another connected
            component than straight ahead; see `v_max`.

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
        bound = self.v_max(kappa_n, beta, reachable_only=reachable_only)
        if len(self.tables.load) > 1:
            backwards = self.v_max(
                kappa_n, beta, reverse=True, reachable_only=reachable_only
            )
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
        if apart.any():  # blocked cells are, too, but have a reason of their own
            apart &= self.v_max(kappa_n, beta, reverse=reverse) > 0
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
        """Per cell `FREE` if reached for sure, `BLOCKED` if apart for sure, or `MIXED`.

        The codes of `configspace.topology.reachable`.
        """
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
        return box_states(
            self.header,
            self.tables,
            (kappa_low, kappa_high, beta_low, beta_high),
            self._direction(reverse),
        )

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

    def _locate(
        self, kappa_n: FloatArray, beta: FloatArray
    ) -> tuple[
        npt.NDArray[np.int64], npt.NDArray[np.int64], FloatArray, FloatArray, BoolArray
    ]:
        row, fk = row_of(self.header, kappa_n)
        if self.line_beta is None:
            column, fb = column_of(self.tables.state.shape[1], beta)
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
        return bilinear(self.tables.load[self._direction(reverse)], row, column, fk, fb)


def require_space(given: object, where: str = "space") -> None:
    """Raise InvalidInput unless a value is a space, not a vehicle or its name."""
    if not isinstance(given, PermissibleSpace):
        allowed = "a PermissibleSpace: build_space(load_vehicle(name))"
        raise InvalidInput(Problem(where, type(given).__name__, allowed))
