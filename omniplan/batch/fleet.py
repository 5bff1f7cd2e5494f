"""Many vehicles as flat tables of rows, for the kernels of `batch_verdicts`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from configspace import PermissibleSpace, Vehicle
from configspace.kernels import BLOCKED, FREE
from configspace.vehicle import (
    SteerableWheel,
)
from omniplan.batch import kinds
from omniplan.batch.lines import Label, lines_of, own_lines_of
from omniplan.judging.rows import Tolerances
from omniplan.judging.vehicle_judge import winds
from omniplan.report import SHAPE_LIMITS

__all__ = ["Fleet", "Label", "fleet_of", "is_connected", "is_plain"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


Codes: TypeAlias = npt.NDArray[np.uint8]
BODY = 9
"""Numbers per vehicle."""


@dataclass(frozen=True, eq=False)
class Fleet:
    """n vehicles; the rows of one follow those of the other."""

    bodies: FloatArray
    """(n, BODY): K in m, κ_g in 1/m, 1 where it has to be chosen which representation
    is driven, 1 where ways of the wheels can be searched for, the constant β of a
    line-mobile vehicle in rad or NaN, the least time per rad of a wheel at rest in
    s/rad, rows and columns of its cells; 0 where all of the space is reached."""
    rows: FloatArray
    """(r, PARAMETERS)."""
    order: IntArray
    """(r, 2): what is told first where several limits are broken: class and, in it,
    where limit and wheel are in the alphabet, as `Report.headline` has it."""
    first: IntArray
    """(n + 1,): first row of every vehicle."""
    own_rows: FloatArray
    """(q, PARAMETERS): those of the vehicles' own Omni-Curve-Parameters."""
    first_own: IntArray
    """(n + 1,): first of them of every vehicle."""
    cells: npt.NDArray[np.uint8]
    """(c,): codes of `reaches`, by rows."""
    first_cell: IntArray
    """(n + 1,): first of them of every vehicle."""
    labels: tuple[Label, ...]
    """(r,)."""

    @property
    def told(self) -> tuple[Label, ...]:
        """All that is told, (2 r + 2,).

        The rows, standstills at which the wheel of a row turns furthest, and those of
        no wheel in particular.
        """
        at_rest = (Label("RECONFIGURATION", x.wheel, "s") for x in self.labels)
        others = Label("UNREACHABLE", "", "1"), Label("RECONFIGURATION", "", "s")
        return (*self.labels, *at_rest, *others)

    @property
    def arrays(self) -> tuple[npt.NDArray[Any], ...]:
        """What `judge_pairs` takes."""
        own = self.own_rows, self.first_own
        cells = self.cells, self.first_cell
        return self.bodies, self.rows, self.order, self.first, *own, *cells

    def content(self, vehicle: int) -> bytes:
        """Return what tells a vehicle from others, names of vehicles aside."""
        rows = slice(self.first[vehicle], self.first[vehicle + 1])
        own = slice(self.first_own[vehicle], self.first_own[vehicle + 1])
        ids = repr(self.labels[rows]).encode()
        cells = slice(self.first_cell[vehicle], self.first_cell[vehicle + 1])
        tables = (
            self.bodies[vehicle], self.rows[rows], self.own_rows[own], self.cells[cells]
        )  # fmt: skip
        return b"".join(bytes(table.tobytes()) for table in tables) + ids

    def picked(self, vehicles: Sequence[int]) -> Fleet:
        """Return only some of the vehicles, in this order."""
        rows, first = _spans(self.first, vehicles)
        own, first_own = _spans(self.first_own, vehicles)
        cells, first_cell = _spans(self.first_cell, vehicles)
        return Fleet(
            self.bodies[vehicles],
            self.rows[rows],
            self.order[rows],
            first,
            self.own_rows[own],
            first_own,
            self.cells[cells],
            first_cell,
            tuple(self.labels[row] for row in rows),
        )


def _spans(first: IntArray, vehicles: Sequence[int]) -> tuple[IntArray, IntArray]:
    """Return the rows of some vehicles, and where those of each begin then."""
    spans = [np.arange(first[v], first[v + 1]) for v in vehicles]
    rows = np.concatenate([np.zeros(0, np.int64), *spans])
    ends = np.cumsum([0, *(span.size for span in spans)])
    return rows, ends.astype(np.int64)


_CONNECTED: WeakKeyDictionary[PermissibleSpace, bool] = WeakKeyDictionary()


def is_plain(space: PermissibleSpace, *, allow_unreachable: bool = False) -> bool:
    """Return whether the kernels know all that `validate` asks of a vehicle.

    Not those known by their data sheet alone, ranges of more than a full turn, wheels
    beside their axis or with shared motors whose acceleration is limited, and spaces in
    which some configurations cannot be reached.

    Parameters
    ----------
    space : PermissibleSpace
    allow_unreachable : bool
        Then it does not matter what can be reached.
    """
    return _has_plain_wheels(space) and (
        allow_unreachable or is_connected(space) or _is_planar(space)
    )


def is_connected(space: PermissibleSpace) -> bool:
    """Return whether all that may be permitted is one piece, by sides of cells."""
    known = _CONNECTED.get(space)
    if known is None:
        known = _CONNECTED[space] = _is_connected(space)
    return known


def _is_planar(space: PermissibleSpace) -> bool:
    """Return whether the kernels can tell what is reached."""
    vehicle = space.vehicle
    steers = vehicle is not None and any(
        isinstance(wheel, SteerableWheel) for wheel in vehicle.wheels
    )
    return steers and space.line_beta is None and not space.is_translating


def _has_plain_wheels(space: PermissibleSpace) -> bool:
    vehicle = space.vehicle
    if vehicle is None:
        return False
    for wheel in vehicle.wheels:
        if not isinstance(wheel, SteerableWheel):
            continue
        least, largest = wheel.steering_range
        if math.isfinite(largest) and winds((largest - least) / 2):
            return False
    return True


def _is_connected(space: PermissibleSpace) -> bool:
    state = space.tables.state
    if not (state == FREE).any():
        return False
    may = state != BLOCKED
    if may.all():
        return True
    parts, count = ndimage.label(may)
    if count > 1 and may.shape[1] > 1:
        joined = may[:, 0] & may[:, -1]  # β = ±π is one line
        for a, b in zip(parts[joined, 0], parts[joined, -1], strict=True):
            if a != b:
                parts[parts == b] = a
                count -= 1
    return bool(count == 1)


def fleet_of(
    vehicles: Sequence[Vehicle],
    tolerances: Tolerances,
    *,
    is_own: bool = False,
    codes: Sequence[Codes | None] = (),
) -> Fleet:
    """Return plain vehicles as flat arrays.

    Parameters
    ----------
    vehicles : sequence of Vehicle
    tolerances : Tolerances
    is_own : bool
        For motions in their own Omni-Curve-Parameters.
    codes : sequence of (rows, columns) uint8 or None, optional
        By vehicle, of `reaches`; None where all of the space is reached.
    """
    rows, own_rows, labels, order = [], [], [], []
    first, first_own, bodies = [0], [0], []
    for vehicle in vehicles:
        own = list(own_lines_of(vehicle, tolerances))
        for label, line in own if is_own else lines_of(vehicle, tolerances):
            labels.append(label)
            rows.append(line)
        order += _order(labels[first[-1] :])
        first.append(len(rows))
        own_rows += [line for _, line in own]
        first_own.append(len(own_rows))
        bodies.append(_body(vehicle, is_own))
    bodies_ = np.array(bodies, dtype=np.float64).reshape(-1, BODY)
    cells, first_cell = _cells(bodies_, codes)
    return Fleet(
        bodies_,
        np.array(rows, dtype=np.float64).reshape(-1, kinds.PARAMETERS),
        np.array(order, dtype=np.int64).reshape(-1, 2),
        np.array(first),
        np.array(own_rows, dtype=np.float64).reshape(-1, kinds.PARAMETERS),
        np.array(first_own),
        cells,
        first_cell,
        tuple(labels),
    )


def _order(labels: Sequence[Label]) -> list[tuple[int, int]]:
    """Return class and place among ties (`Report.headline`) of a vehicle's rows."""
    names = sorted(
        {(label.limit, label.wheel) for label in labels},
        key=lambda name: (not name[1], name),
    )
    limits = (
        *SHAPE_LIMITS,
        *(limit for limit, _ in names if limit not in SHAPE_LIMITS),
    )
    return [
        (
            min(limits.index(label.limit), len(SHAPE_LIMITS)),
            names.index((label.limit, label.wheel)),
        )
        for label in labels
    ]


def _body(vehicle: Vehicle, is_own: bool) -> tuple[float, ...]:
    k, line = vehicle.reference, vehicle.mobility.line_beta
    steered = [wheel for wheel in vehicle.wheels if isinstance(wheel, SteerableWheel)]
    quickest = max((wheel.standing_steering_rate for wheel in steered), default=1.0)
    slows = any(math.isfinite(wheel.standing_steering_rate) for wheel in steered)
    searches = line is None and not vehicle.mobility.is_translating and slows
    return (
        k.real,
        k.imag,
        vehicle.boundary_curvature,
        float(bool(steered) and not is_own),
        float(searches),
        math.nan if line is None else line,
        1 / quickest,
        0.0,
        0.0,
    )


def _cells(bodies: FloatArray, codes: Sequence[Codes | None]) -> tuple[Codes, IntArray]:
    """Return the cells of all vehicles, and where those of each begin."""
    tables, first = [np.zeros(0, np.uint8)], np.zeros(len(bodies) + 1, np.int64)
    for i, table in enumerate(codes):
        if table is not None:
            tables.append(table.ravel())
            bodies[i, 7:9] = table.shape
            first[i + 1] = table.size
    return np.concatenate(tables), np.cumsum(first)
