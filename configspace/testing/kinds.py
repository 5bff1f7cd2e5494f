"""The kinds of undercarriage that random vehicles have."""

from __future__ import annotations

from typing import Literal, TypeAlias, get_args

__all__ = ["ALL_KINDS", "VEHICLE_KINDS", "PlainKind", "VehicleKind"]

PlainKind: TypeAlias = Literal[
    "steered", "mixed", "differential", "ackermann", "mecanum", "omni"
]
VehicleKind: TypeAlias = (
    PlainKind
    | Literal["offset", "turntable", "loaded", "guaranteed", "skid", "synchro"]
)

VEHICLE_KINDS: tuple[PlainKind, ...] = get_args(PlainKind)
"""The plain kinds of undercarriage."""
ALL_KINDS: tuple[VehicleKind, ...] = (
    *VEHICLE_KINDS,
    "offset",
    "turntable",
    "loaded",
    "guaranteed",
    "skid",
    "synchro",
)
"""Every kind that `random_vehicle` builds. A loaded one may tip and a guaranteed one
has a singular zone; what they stand on is drawn from the other kinds."""
