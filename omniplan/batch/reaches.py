"""Pieces of motions in another component of the space than straight ahead, in numba.

A piece is continuous, so one cell that is reached for sure decides it. The kernels look
at the ends of their own parts, which are not those of `validate`: where cells that are
apart are near, or a piece breaks limits, it is not clear what `standing.reach` says.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from configspace import PermissibleSpace
from configspace.kernels import BLOCKED, FREE
from omniplan.batch.kernel import kernel
from omniplan.batch.kinds import SIGN
from omniplan.batch.motions import LANES
from omniplan.batch.refine import KEPT
from omniplan.standing.standstill import UNREACHABLE

__all__ = ["LOST", "REACHED", "UNSURE", "codes_of", "component_of", "mark_lost"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

REACHED, UNSURE, LOST = 0, 1, 2
"""What is said of a piece."""
CONNECTED, AWAY, CLOSE, APART = 0, 1, 2, 3
"""Cells: reached for sure; not known, and away from those apart or close to them; apart
for sure, though not blocked."""
MARGIN = 8
"""Cells that are close ..."""
STRIDE = 4
"""... and how far the configurations at the ends of a part may be apart then, cells."""


def codes_of(space: PermissibleSpace) -> npt.NDArray[np.uint8]:
    """Return the code of every cell, (rows, columns).

    Parameters
    ----------
    space : PermissibleSpace
        Of a vehicle that is bound neither to a line nor to translation.
    """
    reach = space._reach
    apart = (reach == BLOCKED) & (space.tables.state != BLOCKED)
    # β = ±π is one line.
    padded = np.pad(apart, ((0, 0), (MARGIN, MARGIN)), mode="wrap")
    size = (2 * MARGIN + 1, 2 * MARGIN + 1)
    close = ndimage.maximum_filter(padded, size, mode="constant")[:, MARGIN:-MARGIN]
    codes = np.where(close, CLOSE, AWAY)
    codes[reach == FREE] = CONNECTED
    codes[apart] = APART
    return codes.astype(np.uint8)


@kernel()
def _cell(
    block: Array, lane: int, at_end: bool, sign: float, vehicle: Array
) -> tuple[int, int]:
    """Return row and column of the configuration at an end of a part."""
    at = 3 if at_end else 0
    w = sign * block[at + 2, lane]
    x = sign * block[at, lane] - w * vehicle[1]
    y = sign * block[at + 1, lane] + w * vehicle[0]
    p, q = math.sqrt(x * x + y * y), abs(w) / vehicle[2]
    kappa_n = 0.0
    if q < p:
        kappa_n = q / p
    elif q > 0.0:
        kappa_n = 2.0 - p / q
    kappa_n = -kappa_n if w < 0 else kappa_n
    beta = (math.atan2(y, x) if p > 0.0 else 0.0) + math.pi
    rows, columns = int(vehicle[7]), int(vehicle[8])
    turn = beta / (2 * math.pi)
    row, column = int((kappa_n + 2) * (rows / 4)), int((turn % 1.0) * columns)
    return min(max(row, 0), rows - 1), min(max(column, 0), columns - 1)


@kernel()
def component_of(
    blocks: Array, knot_of: Array, knots: Array, first: int, last: int, sign: float,
    codes: Array, vehicle: Array,
) -> int:  # fmt: skip
    """Return whether parts first to last - 1 are reached, lost, or neither for sure.

    Parameters
    ----------
    blocks, knot_of, knots
        Of a motion.
    first, last : int
        A piece.
    sign : {-1, 1}
        The representation.
    codes : (cells,) uint8
        By rows.
    vehicle : (BODY,) float
    """
    columns, is_clear, is_lost = int(vehicle[8]), True, False
    before = -1, -1
    for part in range(first, last):
        b, k = part // LANES, part % LANES
        knot = knots[knot_of[b, k]]
        for end in range(2):
            cell = _cell(blocks[b], k, end == 1, sign, vehicle)
            code = codes[cell[0] * columns + cell[1]]
            if code == CONNECTED:
                return REACHED
            # `validate` looks at the ends of knots, too.
            time, at_knot = blocks[b, 15 + end, k], knot[12 + end]
            is_lost |= code == APART and time == at_knot
            is_clear &= code == AWAY
            if before[0] >= 0:
                aside = abs(cell[1] - before[1])
                aside = min(aside, columns - aside)
                is_clear &= abs(cell[0] - before[0]) <= STRIDE and aside <= STRIDE
            before = cell
    if is_lost:
        return LOST
    return REACHED if is_clear else UNSURE


@kernel()
def mark_lost(
    blocks: Array, knot_of: Array, knots: Array, rows: Array, cells: Array,
    vehicle: Array, ends: Array, pieces: int, low: Array, by_piece: Array,
) -> bool:  # fmt: skip
    """Mark pieces in another component of the space, as `choose_configurations` does.

    Among the representations worth a look; False if some of that is not known.
    """
    broken = False
    for r in range(rows.shape[0]):
        broken |= rows[r, SIGN] == 0 and low[r] > KEPT
    for p in range(pieces):
        least = min(by_piece[p, 0, 0], by_piece[p, 1, 0])
        for side in range(2):
            if by_piece[p, side, 0] > least:
                continue
            told = component_of(
                blocks, knot_of, knots, ends[p, 0], ends[p, 1], 1.0 - 2.0 * side, cells,
                vehicle,
            )  # fmt: skip
            if told == LOST and not broken and least == 0:
                by_piece[p, side, 0] = UNREACHABLE
            elif told != REACHED:
                return False
    return True
