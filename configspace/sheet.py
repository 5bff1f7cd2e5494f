"""What a data sheet consists of: a header and tables, with their versions."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from configspace.grid import Grid
from configspace.vehicle import Vehicle

__all__ = [
    "ALGORITHM_VERSION",
    "FORMAT_VERSION",
    "Sheet",
    "SheetHeader",
    "Tables",
    "fingerprint",
]

FORMAT_VERSION = 2
"""Version of the file format; raise it when the tensors or the header change."""
ALGORITHM_VERSION = 4
"""Version of the numbers; raise it when building gives other tables."""


@dataclass(frozen=True, eq=False)
class Tables:
    """The arrays of a data sheet, read-only.

    d is 1, or 2 where driving backwards has limits of its own; a line-mobile vehicle
    has m = 1 column of cells, one that cannot turn k = 1 row.
    """

    load: npt.NDArray[np.float32]
    """(d, k + 1, m + 1) squared inverse speed at the nodes, (m/s)⁻²; interpolated
    bilinearly it is never too small anywhere."""
    v_lo: npt.NDArray[np.float32]
    """(d, k, m) m/s; v_max is at least this all over the cell."""
    v_hi: npt.NDArray[np.float32]
    """(d, k, m) m/s; v_max is at most this all over the cell."""
    state: npt.NDArray[np.uint8]
    """(k, m) 0 free, 1 blocked, 2 mixed."""
    parts: npt.NDArray[np.uint16]
    """(k, m) which of the 4 × 4 parts of a mixed cell are free: bit 4 i + j for the
    part i-th in κ_n and j-th in β; all bits of a free cell, none of a blocked one."""
    reason: npt.NDArray[np.uint16]
    """(d, k, m) flags of `Reason`."""
    wheel: npt.NDArray[np.int16]
    """(d, k, m) index of the wheel that blocks or binds, -1 for the vehicle."""

    def __post_init__(self) -> None:
        for array in vars(self).values():
            array.flags.writeable = False


@dataclass(frozen=True)
class SheetHeader:
    """What a data sheet says beside its tables."""

    name: str
    description: str
    kappa_g: float
    """Boundary curvature, 1/m."""
    reference: tuple[float, float]
    """K in the vehicle file's frame, m."""
    line_beta: float | None
    """The constant β of a line-mobile vehicle, rad."""
    is_translating: bool
    """Whether only κ_n = 0 is possible, as with a synchro drive."""
    footprint: tuple[tuple[float, float], ...]
    wheel_ids: tuple[str, ...]
    grid: Grid
    fingerprint: str
    """Content hash of vehicle, grid, format and algorithm."""

    @classmethod
    def of(cls, vehicle: Vehicle, grid: Grid) -> SheetHeader:
        """Return the header for a vehicle on a grid."""
        k = vehicle.reference
        return cls(
            name=vehicle.name,
            description=vehicle.description,
            kappa_g=vehicle.boundary_curvature,
            reference=(k.real, k.imag),
            line_beta=vehicle.mobility.line_beta,
            is_translating=vehicle.mobility.is_translating,
            footprint=vehicle.footprint,
            wheel_ids=tuple(wheel.id for wheel in vehicle.wheels),
            grid=grid,
            fingerprint=fingerprint(vehicle, grid),
        )


class Sheet(Protocol):
    """What can be asked how it hangs together: a `PermissibleSpace`, for one."""

    @property
    def header(self) -> SheetHeader:
        """What the tables are of."""
        ...

    @property
    def tables(self) -> Tables:
        """The tables."""
        ...


def fingerprint(vehicle: Vehicle, grid: Grid) -> str:
    """Return the content hash that names a space in the cache."""
    content: dict[str, Any] = {
        "vehicle": vehicle.model_dump(mode="json"),
        "grid": [grid.n_kappa, grid.n_beta],
        "format": FORMAT_VERSION,
        "algorithm": ALGORITHM_VERSION,
    }
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()
