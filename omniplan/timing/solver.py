"""Many pieces of paths for one vehicle as flat arrays, and their fastest profiles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from configspace import Vehicle
from omniplan.timing.kernels import time_jobs
from omniplan.timing.path_motion import PathPiece
from omniplan.timing.rounding import rounded
from omniplan.timing.row_kernels import rows_along
from omniplan.timing.rows import ONE_SIDED, RowKind, TimingRow, row_table, timing_rows

__all__ = ["PieceProfile", "TimingProblem"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

GRID = 500
"""Least number of grid intervals per piece."""
PER_KNOT = 2
"""Least number of grid intervals between two poses of a path."""
LEAST_PACE = 1e-6
"""A wheel's velocity per u̇ counts as this at least."""
MOST_CUTS = 64
"""An interval in which much time is spent is cut into so many at most ..."""
LEAST_CUTS = 3
"""... if one takes so many times the mean at least."""
HALVINGS = 6
"""How often the first and the last interval of a piece are halved."""


@dataclass(frozen=True, eq=False)
class PieceProfile:
    """The fastest way along one piece, in one representation, on its grid."""

    u: FloatArray
    """(n,) m, from the start of the path."""
    x: FloatArray
    """(n,) u̇², (m/s)²."""
    row: IntArray
    """(n,) the row of `TimingProblem.rows` that is used most."""
    share: FloatArray
    """(n,) how much of it is used: 1 but where speeding up turns into slowing down."""
    sigma: int
    """Sign of v_s."""
    stuck: int
    """The first interval that cannot be passed, -1 if there is none."""
    duration: float
    """Duration, s; infinite if there is no way through."""

    @property
    def times(self) -> FloatArray:
        """(n,) s, from the start of the piece."""
        speed = np.sqrt(self.x)
        with np.errstate(divide="ignore"):
            spent = 2 * np.diff(self.u) / (speed[1:] + speed[:-1])
        return np.concatenate([[0.0], np.cumsum(spent)])


class TimingProblem:
    """Pieces of paths for one vehicle, ready to be timed together."""

    def __init__(
        self,
        pieces: Sequence[PathPiece],
        vehicle: Vehicle,
        grid: int = GRID,
        finer: Sequence[IntArray | None] | None = None,
        per_knot: int = PER_KNOT,
    ) -> None:
        """Lay a grid over every piece.

        Parameters
        ----------
        pieces : sequence of PathPiece
        vehicle : Vehicle
        grid : int
            Least number of intervals per piece.
        finer : sequence of (n,) int, ≥ 1, optional
            Of every piece into how many each of its intervals is cut; None: into one.
        per_knot : int
            Least number of intervals between two knots of a piece.
        """
        self.pieces = tuple(pieces)
        self._vehicle, self._grid, self._per_knot = vehicle, grid, per_knot
        speeds = np.concatenate([p.max_speed for p in pieces])
        yaw_rates = np.concatenate([p.max_yaw_rate for p in pieces])
        self._caps = np.stack([speeds, yaw_rates])
        has_caps = bool(np.isfinite(self._caps).any())
        self.rows: tuple[TimingRow, ...] = timing_rows(vehicle, has_caps=has_caps)
        table = row_table(self.rows)
        self._table = (
            table.kind,
            table.point,
            table.turn,
            table.lever,
            table.coupling,
            table.scale,
        )
        self._one_sided = np.array([row.kind in ONE_SIDED for row in self.rows])
        self._position = np.concatenate([p.position for p in pieces], axis=1)
        self._heading = np.concatenate([p.heading for p in pieces], axis=1)
        self._point = np.array([p.point for p in pieces], dtype=np.complex128)
        self._offsets = np.cumsum([0, *(p.u.size - 1 for p in pieces)])
        cuts: Sequence[IntArray | None] = finer or [None] * len(pieces)
        grids = [
            _cut(_grid(p, grid, per_knot), cut)
            for p, cut in zip(pieces, cuts, strict=True)
        ]
        knots, h0, h1 = zip(*grids, strict=True)
        self._knot = np.concatenate(
            [k + offset for k, offset in zip(knots, self._offsets, strict=False)]
        )
        self._h0, self._h1 = np.concatenate(h0), np.concatenate(h1)
        self._first = np.cumsum([0, *(k.size for k in knots)]).astype(np.int64)
        self._u = np.concatenate([self._nodes(k) for k in range(len(pieces))])
        self._most_nodes = int(np.diff(self._first).max()) + 1

    def rounded(self, piece: int, reach: FloatArray, stairs: IntArray) -> TimingProblem:
        """Return the problem of one piece without jumps of its third derivative.

        Parameters
        ----------
        piece : int
        reach : (k - 2,) float, m
        stairs : (k - 2,) int
            How far about every inner knot, and in how many steps, as of
            `omniplan.timing.rounding.rounded`.
        """
        given = rounded(self.pieces[piece], reach, stairs)
        return TimingProblem([given], self._vehicle, self._grid, per_knot=1)

    def refined(self, profiles: Sequence[Sequence[PieceProfile]]) -> TimingProblem:
        """Return the problem on a finer grid where much time is spent in an interval.

        ü is constant over each; where a wheel is near the centre of rotation, a few
        centimetres may take a good part of the whole time.

        Parameters
        ----------
        profiles : sequence of sequences of PieceProfile
            Those of each piece, on the grid as it is.
        """
        finer = [_cuts_of(some, self._grid) for some in profiles]
        if all(cuts is None for cuts in finer):
            return self
        return TimingProblem(
            self.pieces, self._vehicle, self._grid, finer, self._per_knot
        )

    @cached_property
    def _swinging(self) -> tuple[tuple[complex, float], ...]:
        """The wheels whose α̈ counts: where, and how much of a limit it uses, s²."""
        weights = {
            RowKind.STEER_ACCELERATION: lambda row: 1 / row.bound,
            RowKind.BESIDE_RATE: lambda row: (
                (abs(row.lever) + abs(row.coupling)) / row.bound
            ),
        }
        return tuple(
            (row.point, weights[row.kind](row))
            for row in self.rows
            if row.kind in weights
        )

    @property
    def bounds_steering_acceleration(self) -> bool:
        """Whether third derivatives of the samples' splines matter."""
        return bool(self._swinging)

    def farthest_from(self, point: complex) -> float:
        """Return how far from a point of the body the wheels are whose α̈ counts, m."""
        return max((abs(place - point) for place, _ in self._swinging), default=0.0)

    def steering_gain(self, piece: int, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return by how much α̈ is off where poses are, at places u, (n,) each.

        Of splines in time through poses the third derivatives are off by shares of
        ``p'' u̇ u⃛`` and ``θ'' u̇ u⃛``, in the world frame. What that makes of a wheel's
        ``α̈ = Im(g'' ḡ)/|g|² + ...`` is the first, s²/m; the second is ``1 / |g|``, g
        being a wheel's velocity per u̇, s². Both are over the limit on α̈, and the
        largest of any wheel.

        Parameters
        ----------
        u : (n,) float, m
        """
        given = self.pieces[piece]
        knot = np.searchsorted(given.u, u, side="right") - 1
        knot = np.clip(knot, 0, given.u.size - 2)
        h = u - given.u[knot]
        theta = given.poses_at(u)[:, 2]
        a, b, c, _ = given.position[:, knot]
        a_t, b_t, c_t, _ = given.heading[:, knot]
        turned = np.exp(-1j * theta)
        along, bend = (3 * a * h + 2 * b) * h + c, 6 * a * h + 2 * b
        along, bend = along * turned, bend * turned
        spin, spin_up = (3 * a_t * h + 2 * b_t) * h + c_t, 6 * a_t * h + 2 * b_t
        turning, lever = np.zeros(u.shape), np.zeros(u.shape)
        for point, weight in self._swinging:
            arm = 1j * (point - given.point)
            g = along + spin * arm
            size = np.maximum(np.abs(g), LEAST_PACE)
            swing = np.abs(((bend + spin_up * arm) * g.conj()).imag) / size**2
            turning = np.maximum(turning, weight * swing)
            lever = np.maximum(lever, weight / size)
        return turning, lever

    def is_ramp(self, profile: PieceProfile) -> bool:
        """Return whether the bound on |ü| alone holds a profile back somewhere."""
        last = len(self.rows) - 1
        return bool(((profile.row == last) & (profile.share > 1 - 1e-6)).any())

    def nodes(self, piece: int) -> FloatArray:
        """Return the grid of a piece, (n,) m from the start of the path."""
        return self._u[self._first[piece] + piece : self._first[piece + 1] + piece + 1]

    def _nodes(self, piece: int) -> FloatArray:
        part = slice(self._first[piece], self._first[piece + 1])
        start = self.pieces[piece].u[self._knot[part] - self._offsets[piece]]
        last = start[-1:] + self._h1[part][-1:]
        return np.concatenate([start + self._h0[part], last])

    def solve(
        self,
        piece: Sequence[int],
        sigma: Sequence[int],
        *,
        max_change: Sequence[float] | None = None,
        tight: Sequence[FloatArray] | None = None,
    ) -> tuple[PieceProfile, ...]:
        """Return the fastest profile of every job, computed in parallel.

        Parameters
        ----------
        piece : sequence of int
        sigma : sequence of {-1, 1}
        max_change : sequence of float, m/s², optional
            Largest |ü|.
        tight : sequence of (n,) float, ≥ 1, optional
            By how much every limit is made tighter, as if time went that much faster.
        """
        jobs = len(piece)
        size = (jobs, self._most_nodes)
        x, share, duration = np.empty(size), np.empty(size), np.empty(jobs)
        limiting, stuck = np.empty(size, dtype=np.int64), np.empty(jobs, dtype=np.int64)
        weight = np.ones(size)
        for row, values in zip(weight, tight or (), strict=False):
            row[: values.size] = values
        largest = np.full(jobs, np.inf) if max_change is None else np.array(max_change)
        time_jobs(
            self._table,
            self._position,
            self._heading,
            self._point,
            self._caps,
            self._knot,
            self._h0,
            self._h1,
            weight,
            self._first,
            np.array(piece, dtype=np.int64),
            np.array(sigma, dtype=np.float64),
            largest,
            x,
            limiting,
            share,
            stuck,
            duration,
        )
        profiles = []
        for job, (k, sign) in enumerate(zip(piece, sigma, strict=True)):
            u = self.nodes(k)
            n = u.size
            profiles.append(
                PieceProfile(
                    u,
                    x[job, :n],
                    limiting[job, :n],
                    share[job, :n],
                    sign,
                    int(stuck[job]),
                    float(duration[job]),
                )
            )
        return tuple(profiles)

    def coefficients(
        self, piece: int, sigma: int, u: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return a and b of every row ``a ü + b u̇²``, (n, rows), in units of its limit.

        At a knot the polynomial after it counts; of rows that bound u̇ alone b is the
        load and a is 0.

        Parameters
        ----------
        u : (n,) float, m
            From the start of the path, within the piece.
        """
        given = self.pieces[piece]
        knot = np.searchsorted(given.u, u, side="right") - 1
        knot = np.clip(knot, 0, given.u.size - 2)
        a, b = rows_along(
            self._table,
            self._position,
            self._heading,
            given.point,
            self._caps,
            knot + self._offsets[piece],
            u - given.u[knot],
            float(sigma),
        )
        return np.asarray(a), np.asarray(b)

    def slowdowns(
        self,
        piece: int,
        sigma: int,
        u: FloatArray,
        speed: FloatArray,
        change: FloatArray,
    ) -> FloatArray:
        """Return how many times more slowly each place had to be passed, (n,).

        At most 1 where all limits are kept; how fast ü may change for the sake of the
        samples is left aside.

        Parameters
        ----------
        u, speed, change : (n,) m, m/s, m/s²
            u from the start of the path, u̇ and ü there.
        """
        a, b = self.coefficients(piece, sigma, u)
        used = a * change[:, None] + b * speed[:, None] ** 2
        used = np.where(self._one_sided, used, np.abs(used))
        return np.asarray(np.sqrt(np.maximum(used, 0.0).max(axis=1)))


def _cuts_of(profiles: Sequence[PieceProfile], grid: int) -> IntArray | None:
    """Return into how many parts intervals are cut; None where it is not worth it."""
    cuts: IntArray | None = None
    for profile in profiles:
        if profile.stuck >= 0 or not np.isfinite(profile.duration):
            continue
        share = np.diff(profile.times) * grid / profile.duration
        asked = np.clip(np.ceil(share), 1, MOST_CUTS).astype(np.int64)
        cuts = asked if cuts is None else np.maximum(cuts, asked)
    return None if cuts is None or cuts.max() < LEAST_CUTS else cuts


def _cut(
    grid: tuple[IntArray, FloatArray, FloatArray], cuts: IntArray | None
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return a grid with its intervals cut into equal parts."""
    if cuts is None:
        return grid
    knot = np.repeat(grid[0], cuts)
    h0, h1 = np.repeat(grid[1], cuts), np.repeat(grid[2], cuts)
    place = np.arange(knot.size) - np.repeat(np.cumsum(cuts) - cuts, cuts)
    of = np.repeat(cuts, cuts)
    first = h0 + (h1 - h0) * place / of
    last = np.where(place + 1 == of, h1, h0 + (h1 - h0) * (place + 1) / of)
    return knot, first, last


def _grid(
    piece: PathPiece, least: int, per_knot: int
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the polynomial of every grid interval and its ends on it.

    Towards both ends of a piece the intervals halve, as it starts and ends at rest:
    ü is taken as constant over each.
    """
    span = np.diff(piece.u)
    count = np.maximum(np.ceil(least * span / piece.length - 1e-9), per_knot)
    count = count.astype(np.int64)
    knot = np.repeat(np.arange(span.size), count)
    place = np.arange(knot.size) - np.repeat(np.cumsum(count) - count, count)
    step = (span / count)[knot]
    h0 = place * step
    h1 = np.where(place + 1 == count[knot], span[knot], (place + 1) * step)
    shares = 0.5 ** np.arange(HALVINGS, 0, -1)
    first, last = h1[0] * shares, span[-1] - step[-1] * shares[::-1]
    knot = np.concatenate(
        [np.zeros(HALVINGS, np.int64), knot, np.full(HALVINGS, knot[-1])]
    )
    h0 = np.concatenate([[0.0], first, h0[1:], last])
    h1 = np.concatenate([first, h1[:-1], last, h1[-1:]])
    return knot, h0, h1
