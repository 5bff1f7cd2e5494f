"""`check_twists`: many twists against one space."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from configspace import InvalidInput, PermissibleSpace, Problem
from configspace.space import require_space
from omniplan.batch.lookup import CHUNK, check, check_parallel
from omniplan.batch.settle import Sheet, sheet_of
from omniplan.batch.surface import FLOAT32, Surface, surface_of
from omniplan.judging.rows import Tolerances

__all__ = ["check_twists"]

_LOOKUPS: WeakKeyDictionary[PermissibleSpace, _Lookup] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class _Lookup:
    """What is derived from a space once."""

    surface: Surface
    sheet: Sheet
    point: tuple[float, float, float]
    forms: tuple[Any, Any]
    """See `batch_lookup.check`."""
    guard: float


def check_twists(
    twists: npt.ArrayLike,
    space: PermissibleSpace,
    tolerances: Tolerances | None = None,
) -> npt.NDArray[np.bool_]:
    """Return which twists are permitted, in one wheel configuration or the other.

    A twist is ``(κ_n, β, v_s)`` and ``(-κ_n, β + π, -v_s)`` alike; it is permitted
    where `PermissibleSpace.contains` permits one of them. Only the limits of the space
    count: change rates are those of a trajectory, see `validate`. Standing still is
    permitted.

    A vehicle bound to a line, or one that cannot turn, would permit no measured twist:
    what stands off is taken as slip. It may be as large as `validate` allows, and what
    is left of the twist is what is looked up.

    Parameters
    ----------
    twists : (n, 3) float32 or float64, m/s, m/s, rad/s
        (vx, vy, ω) of the origin of the vehicle file's frame. Other numbers are
        converted to float64; float32 is the quickest.
    space : PermissibleSpace
    tolerances : Tolerances, optional
        ``slip_angle`` and ``slip_speed`` of bound vehicles.

    Returns
    -------
    permitted : (n,) bool

    Raises
    ------
    InvalidInput
        If the shape is another, or a value is not finite; with its row.

    Examples
    --------
    >>> import configspace, omniplan
    >>> space = configspace.build_space(
    ...     configspace.load_vehicle("mecanum"), cache=False)
    >>> omniplan.check_twists([[0.5, 0.5, 0.0], [5.0, 0.0, 0.0], [0, 0, 0]], space)
    array([ True, False,  True])
    """
    rows = _rows(twists)
    tolerances = tolerances or Tolerances()
    require_space(space)
    lookup = _LOOKUPS.get(space)
    if lookup is None:
        lookup = _LOOKUPS[space] = _derive(space)
    surface, sheet = lookup.surface, lookup.sheet
    out = np.empty(len(rows), dtype=np.bool_)
    kernel = check if len(rows) <= CHUNK else check_parallel
    bad = kernel(
        rows.reshape(-1),
        out.view(np.uint8),
        surface.table,
        (surface.scale, surface.side / 2, surface.side, surface.signed, lookup.guard),
        lookup.forms,
        lookup.point,
        (
            int(space.line_beta is not None),
            int(space.is_translating),
            space.line_beta or 0.0,
            math.sin(tolerances.slip_angle),
            tolerances.slip_speed,
        ),
        sheet.tables,
        sheet.loads,
        sheet.sectors,
        sheet.is_exact,
    )
    if bad >= 0:
        given = ", ".join(f"{value}" for value in rows[bad])
        raise InvalidInput(Problem(f"twists[{bad}]", given, "finite numbers"))
    return out


def _rows(twists: npt.ArrayLike) -> npt.NDArray[Any]:
    """Return twists as a contiguous array of float32 or float64."""
    try:
        rows = np.asarray(twists)
        if rows.dtype not in (np.float32, np.float64):
            rows = np.asarray(rows, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidInput(
            Problem("twists", repr(twists)[:60], "numbers in m/s and rad/s")
        ) from error
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise InvalidInput(Problem("twists", f"shape {rows.shape}", "shape (n, 3)"))
    return np.ascontiguousarray(rows)


def _derive(space: PermissibleSpace) -> _Lookup:
    x, y = space.header.reference
    kappa_g = space.kappa_g
    line = space.line_beta or 0.0
    at_k = np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [0.0, 0.0, 1.0 / kappa_g]])
    cos, sin = math.cos(line), math.sin(line)
    along, aside = cos * at_k[0] + sin * at_k[1], cos * at_k[1] - sin * at_k[0]
    if space.is_translating:
        to_plane = np.stack([at_k[0], at_k[1], at_k[2]])
    else:
        to_plane = np.stack([along, at_k[2], aside])
    return _Lookup(
        surface_of(space),
        sheet_of(space),
        (x, y, kappa_g),
        (at_k[:, 2].astype(np.float32), to_plane.astype(np.float32)),
        min(FLOAT32 * (1 + kappa_g * math.hypot(x, y)), 0.5),
    )
