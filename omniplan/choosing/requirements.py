"""What a planner asks of a vehicle, in physical units, independent of trajectories.

Every requirement is a frozen value with a phrase: ``str`` gives it and
`parse_requirement` reads it, so shell, messages and reports say the same thing.

==============================  =====================================================
phrase                          value
==============================  =====================================================
turn on the spot at 45 deg/s    `TurnOnTheSpot`, about K, to both sides
crab 90 deg at 0.5 m/s          `Crab`, without turning, to both sides
radius 0.8 m at 1 m/s           `Radius` of K's way, at most; to both sides; forwards
speed 1.5 m/s backwards         `Speed` straight on
payload 500 kg                  `Payload`
footprint 1.2 m x 0.8 m         `FitsWithin`, along x and y of the vehicle
no mirroring                    `NoMirroring`, judged on every trajectory
passable backwards              `PassableBackwards`, judged on every trajectory
==============================  =====================================================

Speeds may be left out; then any speed will do. ``forwards`` (the default),
``backwards`` or ``both ways`` may follow a radius or a speed.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, TypeAlias

from configspace import InvalidInput, Problem

__all__ = [
    "Crab",
    "FitsWithin",
    "NoMirroring",
    "PassableBackwards",
    "Payload",
    "Radius",
    "Requirement",
    "Speed",
    "TurnOnTheSpot",
    "Way",
    "parse_requirement",
]

Way: TypeAlias = Literal["forwards", "backwards", "both ways"]
"""``both ways``: forwards and backwards, each."""

WAYS: tuple[Way, ...] = ("forwards", "backwards", "both ways")
PHRASES = (
    "turn on the spot [at W deg/s]",
    "crab A deg [at V m/s]",
    "radius R m [at V m/s] [forwards|backwards|both ways]",
    "speed V m/s [forwards|backwards|both ways]",
    "payload M kg",
    "footprint L m x W m",
    "no mirroring",
    "passable backwards",
)
"""What `parse_requirement` reads."""


@dataclass(frozen=True)
class TurnOnTheSpot:
    """Turning about K, to the left and to the right."""

    rate: float = 0.0
    """|ω|, rad/s; 0: any."""

    def __post_init__(self) -> None:
        _require_angle("turn on the spot: rate", self.rate, 0, 1e3, "deg/s")

    def __str__(self) -> str:
        """Return the phrase."""
        return "turn on the spot" + _at(math.degrees(self.rate), "deg/s")


@dataclass(frozen=True)
class Crab:
    """Moving at an angle to straight ahead without turning, to both sides.

    At exactly this angle: some vehicles are slower in between than at both ends.
    """

    angle: float
    """Between the direction of travel and straight ahead, rad, (0, π]."""
    speed: float = 0.0
    """Of K, m/s; 0: any."""

    def __post_init__(self) -> None:
        _require_angle("crab: angle", self.angle, 1e-6, math.pi, "deg")
        _require("crab: speed", self.speed, 0, 100, "m/s")

    def __str__(self) -> str:
        """Return the phrase."""
        return f"crab {math.degrees(self.angle):.12g} deg" + _at(self.speed, "m/s")


@dataclass(frozen=True)
class Radius:
    """A circle of this radius or a smaller one, to the left and to the right.

    K goes round the circle while the vehicle looks along it (β as straight ahead). Of
    the smaller circles so many are tried as `omniplan.choosing.fitness` has it, evenly
    in κ_n up to turning on the spot; what is permitted only between two of them is a
    no.
    """

    radius: float
    """Of K's way, at most, m, > 0."""
    speed: float = 0.0
    """Of K, m/s; 0: any."""
    way: Way = "forwards"

    def __post_init__(self) -> None:
        _require("radius", self.radius, 1e-6, 1e6, "m")
        _require("radius: speed", self.speed, 0, 100, "m/s")
        _require_way("radius: way", self.way)

    def __str__(self) -> str:
        """Return the phrase."""
        return f"radius {self.radius:.12g} m{_at(self.speed, 'm/s')}{_by(self.way)}"


@dataclass(frozen=True)
class Speed:
    """A speed straight on."""

    speed: float
    """Of K, m/s, > 0."""
    way: Way = "forwards"

    def __post_init__(self) -> None:
        _require("speed", self.speed, 1e-6, 100, "m/s")
        _require_way("speed: way", self.way)

    def __str__(self) -> str:
        """Return the phrase."""
        return f"speed {self.speed:.12g} m/s{_by(self.way)}"


@dataclass(frozen=True)
class Payload:
    """A payload the vehicle must be stated to carry."""

    mass: float
    """kg, > 0."""

    def __post_init__(self) -> None:
        _require("payload: mass", self.mass, 1e-6, 1e7, "kg")

    def __str__(self) -> str:
        """Return the phrase."""
        return f"payload {self.mass:.12g} kg"


@dataclass(frozen=True)
class FitsWithin:
    """A rectangle the footprint must fit into, sides along the vehicle's x and y."""

    length: float
    """Along x, m, > 0."""
    width: float
    """Along y, m, > 0."""

    def __post_init__(self) -> None:
        _require("footprint: length", self.length, 1e-6, 1e3, "m")
        _require("footprint: width", self.width, 1e-6, 1e3, "m")

    def __str__(self) -> str:
        """Return the phrase."""
        return f"footprint {self.length:.12g} m x {self.width:.12g} m"


@dataclass(frozen=True)
class NoMirroring:
    """No wheels that turn round at a standstill of a trajectory.

    Going on in R3 or R4 rather than R1 or R2: at no standstill may the configuration
    after it be nearer to the mirror image of the one before, all steering angles turned
    by π, than to the one before itself. Judged on the configurations that `validate`
    chooses, so it may refuse too much, never too little.

    References
    ----------
    spec/steered-wheels §3.3; spec/omni-curve §1, fact 7.
    """

    def __str__(self) -> str:
        """Return the phrase."""
        return "no mirroring"


@dataclass(frozen=True)
class PassableBackwards:
    """Every trajectory can also be driven from its goal to its start, backwards.

    Through the same poses in the same time, the vehicle looking the same way.
    """

    def __str__(self) -> str:
        """Return the phrase."""
        return "passable backwards"


Requirement: TypeAlias = (
    TurnOnTheSpot
    | Crab
    | Radius
    | Speed
    | Payload
    | FitsWithin
    | NoMirroring
    | PassableBackwards
)
"""Anything a vehicle can be asked for."""

_NUMBER = r"(\d+(?:\.\d*)?(?:e[+-]?\d+)?|\.\d+(?:e[+-]?\d+)?)"
_WAY = rf"(?: ({'|'.join(WAYS)}))?"


def _read(pattern: str) -> re.Pattern[str]:
    return re.compile(pattern.replace("#", _NUMBER))


_READERS: tuple[tuple[re.Pattern[str], Callable[[re.Match[str]], Requirement]], ...] = (
    (
        _read("turn on the spot(?: at # deg/s)?"),
        lambda m: TurnOnTheSpot(math.radians(_value(m[1]))),
    ),
    (
        _read("crab # deg(?: at # m/s)?"),
        lambda m: Crab(math.radians(_value(m[1])), _value(m[2])),
    ),
    (
        _read(f"radius # m(?: at # m/s)?{_WAY}"),
        lambda m: Radius(_value(m[1]), _value(m[2]), _way(m[3])),
    ),
    (
        _read(f"speed # m/s{_WAY}"),
        lambda m: Speed(_value(m[1]), _way(m[2])),
    ),
    (_read("payload # kg"), lambda m: Payload(_value(m[1]))),
    (
        _read("footprint # m x # m"),
        lambda m: FitsWithin(_value(m[1]), _value(m[2])),
    ),
    (_read("no mirroring"), lambda _: NoMirroring()),
    (_read("passable backwards"), lambda _: PassableBackwards()),
)


def parse_requirement(text: str) -> Requirement:
    """Return the requirement that a phrase stands for.

    Parameters
    ----------
    text : str
        Words and numbers with their units, see the module; ``-`` between words, ``°``
        for deg, ``±`` and any spacing will do.

    Raises
    ------
    InvalidInput
        If it is no such phrase, with all that are, or a value is out of range.

    Examples
    --------
    >>> parse_requirement("radius 0.8 m at 1 m/s, both ways")
    Radius(radius=0.8, speed=1.0, way='both ways')
    """
    plain = _plain(text)
    for pattern, value in _READERS:
        match = pattern.fullmatch(plain)
        if match is not None:
            return value(match)
    allowed = f"one of: {'; '.join(PHRASES)}"
    raise InvalidInput(Problem("phrase", repr(text)[:80], allowed))


def _plain(text: str) -> str:
    """Return a phrase in lower case with one space between words and units."""
    text = text.strip().lower().replace("°", " deg").replace("±", " ")
    text = re.sub(r"(?<=[a-z])-(?=[a-z])|,", " ", text)
    text = re.sub(
        r"(?<=[0-9.])(?=deg|m\b|kg|x)|(?<=m)(?=x)|(?<=x)(?=[0-9.])", " ", text
    )
    return re.sub(r"\s*/\s*", "/", re.sub(r"\s+", " ", text)).strip()


def _value(text: str | None) -> float:
    return 0.0 if text is None else float(text)


def _way(text: str | None) -> Way:
    return next((way for way in WAYS if way == text), "forwards")


def _at(value: float, unit: str) -> str:
    return f" at {value:.12g} {unit}" if value else ""


def _by(way: Way) -> str:
    return "" if way == "forwards" else f" {way}"


def _require(where: str, value: float, low: float, high: float, unit: str) -> None:
    if not low <= value <= high:  # nor where it is NaN
        allowed = f"a number from {low:g} to {high:g} {unit}"
        raise InvalidInput(Problem(where, repr(value)[:40], allowed))


def _require_angle(
    where: str, value: float, low: float, high: float, unit: str
) -> None:
    """Raise in degrees, as the phrase has them, unless radians are within bounds."""
    if not low <= value <= high:
        least, most = math.degrees(low), math.degrees(high)
        given = f"{math.degrees(value):.6g} {unit}"
        allowed = f"a number from {least:.3g} to {most:.6g} {unit}"
        raise InvalidInput(Problem(where, given, allowed))


def _require_way(where: str, way: str) -> None:
    if way not in WAYS:
        raise InvalidInput(Problem(where, repr(way)[:40], f"one of {', '.join(WAYS)}"))
