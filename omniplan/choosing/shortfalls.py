"""Requirements that are not met, as plain frozen values and in words."""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["Shortfall", "Unfit"]


@dataclass(frozen=True)
class Shortfall:
    """One requirement that a vehicle does not meet."""

    requirement: str
    """Its phrase."""
    what: str
    """The part that is not met, such as ``to the left``; may be empty."""
    asked: float | None
    """What is asked for; None where it is no number."""
    offered: float | None
    """What the vehicle offers; None where it does not say, or where it is no number."""
    unit: str
    """Of both; angles are in rad."""
    limit: str | None
    """What binds or blocks: names of `configspace.Reason` or a violation's limit."""
    wheel: str | None
    """The wheel it belongs to."""

    def __str__(self) -> str:
        """Return one line: requirement, asked, offered, what binds."""
        parts = [self.what] if self.what else []
        if self.asked is not None:
            asked, offered = self._shown()
            parts += [f"{asked} asked", offered]
        if self.limit is not None:
            by = f" of wheel {self.wheel}" if self.wheel else ""
            return f"{self.requirement}: {', '.join(parts)} [{self.limit}{by}]"
        return f"{self.requirement}: {', '.join(parts)}"

    def _shown(self) -> tuple[str, str]:
        """Return asked and offered with their unit, so that they differ."""
        assert self.asked is not None
        if self.offered is None:
            return _quantity(self.asked, self.unit, 4), "the vehicle does not say"
        for digits in (4, 8, 12, 17):
            texts = [
                _quantity(x, self.unit, digits) for x in (self.asked, self.offered)
            ]
            if texts[0] != texts[1] or self.asked == self.offered:
                break
        asked = "any speed" if self.asked == 0 else texts[0]
        return asked, f"{'nothing' if self.offered == 0 else texts[1]} offered"


@dataclass(frozen=True)
class Unfit:
    """A vehicle that does not meet the requirements, and why."""

    vehicle: str
    shortfalls: tuple[Shortfall, ...]
    """At least one."""


def _quantity(value: float, unit: str, digits: int) -> str:
    if unit == "rad":
        return f"{math.degrees(value):.{digits}g}°"
    if unit == "rad/s":
        return f"{math.degrees(value):.{digits}g}°/s"
    return f"{value:.{digits}g} {unit}".rstrip()
