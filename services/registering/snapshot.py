"""What a registry knows at one moment, and how it changes."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from configspace.space import PermissibleSpace
from services.registering.store import Record
from services.registering.versions import Version

__all__ = ["Change", "Snapshot", "sheet_bytes"]


@dataclass(frozen=True)
class Change:
    """A vehicle was registered or removed."""

    id: str
    version: Version
    kind: Literal["put", "delete"]
    fingerprint: str
    """Content hash of the data sheet; empty where there is none."""


@dataclass(frozen=True)
class Snapshot:
    """All that a registry knows at one moment; read-only."""

    fleet: Mapping[str, PermissibleSpace]
    """The vehicles by name: first those of the start, then registered ones, sorted."""
    records: Mapping[str, Record]
    """The newest record of every vehicle that was ever registered."""
    problems: Mapping[str, str] = field(default_factory=dict)
    """Why a registered vehicle is not used, by name."""

    def fingerprint(self, name: str) -> str:
        """Return the content hash of a vehicle's data sheet, empty if there is none."""
        space = self.fleet.get(name)
        return "" if space is None else space.header.fingerprint

    @cached_property
    def state(self) -> str:
        """A hash that is equal where all versions are."""
        lines = (f"{r.id} {r.version}\n" for _, r in sorted(self.records.items()))
        return hashlib.sha256("".join(lines).encode()).hexdigest()

    @cached_property
    def n_bytes(self) -> int:
        """What the data sheets of the vehicles take in memory, bytes."""
        return sum(map(sheet_bytes, self.fleet.values()))


def sheet_bytes(space: PermissibleSpace) -> int:
    """Return what the arrays of a data sheet take in memory, bytes."""
    parts = (*vars(space.tables).values(), *vars(space.rates).values())
    return sum(part.nbytes for part in parts if isinstance(part, np.ndarray))
