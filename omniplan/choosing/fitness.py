"""Whether a vehicle meets requirements, and by how much it falls short.

Every motion that is asked for is a twist of K. It has two representations; one that is
permitted at the speed asked for, and not for sure in another component than straight
ahead, is enough. Where the vehicle is known its exact formulas answer, else the table
of its data sheet, which never promises too much.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from pydantic import TypeAdapter

from configspace import (
    InvalidInput,
    PermissibleSpace,
    Problem,
    Reason,
    exact_v_max,
    from_twist,
)
from configspace.omni_curve import components
from configspace.space import require_space
from omniplan.choosing.requirements import (
    WAYS,
    Crab,
    FitsWithin,
    NoMirroring,
    PassableBackwards,
    Payload,
    Radius,
    Requirement,
    Speed,
    TurnOnTheSpot,
    Way,
    parse_requirement,
)
from omniplan.choosing.shortfalls import Shortfall, Unfit

__all__ = [
    "FleetEntry",
    "FleetVehicle",
    "Suitability",
    "fleet_of",
    "requirements_of",
    "shortfalls",
    "suitable",
]

FloatArray = npt.NDArray[np.float64]

TIGHTER = 200
"""So many curves are tried that are as tight as one asked for, or tighter."""
ROUNDING = 1e-12
"""A demand counts as met up to this relative excess: the rounding of float64."""


@dataclass(frozen=True)
class FleetVehicle:
    """One vehicle of a fleet; those of one type share a space."""

    id: str
    """Its name within the fleet."""
    space: PermissibleSpace
    max_payload: float | None = None
    """kg; None: as its vehicle file says."""

    def __post_init__(self) -> None:
        require_space(self.space, f"fleet: {self.id}")
        if not 0 < len(self.id) <= 200:
            allowed = "a text of 1 to 200 characters"
            raise InvalidInput(Problem("fleet: id", repr(self.id)[:60], allowed))
        if self.max_payload is not None and not 0 < self.max_payload < math.inf:
            where, given = f"fleet: {self.id}: max_payload", f"{self.max_payload}"
            raise InvalidInput(Problem(where, given, "a positive mass in kg"))


FleetEntry: TypeAlias = PermissibleSpace | tuple[str, PermissibleSpace] | FleetVehicle
"""How a vehicle of a fleet may be given; a space alone has the name of its vehicle."""


@dataclass(frozen=True)
class Suitability:
    """Which vehicles of a fleet meet requirements."""

    suitable: tuple[str, ...]
    """In the order of the fleet."""
    unfit: tuple[Unfit, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return the answer as plain data (JSON types only)."""
        data: dict[str, Any] = _SUITABILITY.dump_python(self, mode="json")
        return data


_SUITABILITY: TypeAdapter[Suitability] = TypeAdapter(Suitability)


def suitable(
    fleet: Iterable[FleetEntry],
    requirements: Iterable[Requirement | str],
    *,
    allow_unreachable: bool = False,
) -> Suitability:
    """Return which vehicles meet all requirements, whatever they are to drive.

    Parameters
    ----------
    fleet : iterable of FleetEntry
        Spaces, pairs of name and space or `FleetVehicle`; names must differ.
    requirements : iterable of Requirement or str
        Values of `omniplan.choosing.requirements` or their phrases. `NoMirroring` and
        `PassableBackwards` are about trajectories; every vehicle meets them here.
    allow_unreachable : bool
        Count motions that no way inside the space leads to from straight ahead; as for
        `validate`.

    Returns
    -------
    Suitability

    Raises
    ------
    InvalidInput
        If the fleet is empty, names repeat or a phrase cannot be read.

    References
    ----------
    spec/omni-curve §5, selection.

    Examples
    --------
    >>> import configspace, omniplan
    >>> fleet = [configspace.build_space(configspace.load_vehicle(name), cache=False)
    ...          for name in ("mecanum", "differential")]
    >>> answer = omniplan.suitable(fleet, ["crab 90 deg at 0.5 m/s"])
    >>> answer.suitable
    ('mecanum',)
    >>> print(answer.unfit[0].shortfalls[0])
    crab 90 deg at 0.5 m/s: to the left, 0.5 m/s asked, nothing offered [FIXED_WHEEL]
    """
    asked = requirements_of(requirements)
    found = [
        (vehicle, shortfalls(vehicle, asked, allow_unreachable=allow_unreachable))
        for vehicle in fleet_of(fleet)
    ]
    return Suitability(
        suitable=tuple(vehicle.id for vehicle, short in found if not short),
        unfit=tuple(Unfit(vehicle.id, short) for vehicle, short in found if short),
    )


def fleet_of(fleet: Iterable[FleetEntry]) -> tuple[FleetVehicle, ...]:
    """Return the vehicles of a fleet; InvalidInput if it is empty or names repeat."""
    if isinstance(fleet, PermissibleSpace):
        raise InvalidInput(Problem("fleet", "one PermissibleSpace", "a list of them"))
    vehicles = tuple(map(_fleet_vehicle, fleet))
    if not vehicles:
        raise InvalidInput(Problem("fleet", "empty", "at least one vehicle"))
    seen: set[str] = set()
    for vehicle in vehicles:
        if vehicle.id in seen:
            allowed = "names must differ; pairs (name, space) give vehicles their own"
            raise InvalidInput(Problem("fleet", f"{vehicle.id} twice", allowed))
        seen.add(vehicle.id)
    return vehicles


def _fleet_vehicle(entry: FleetEntry) -> FleetVehicle:
    if isinstance(entry, PermissibleSpace):
        return FleetVehicle(entry.name, entry)
    if isinstance(entry, tuple):
        return FleetVehicle(*entry)
    if not isinstance(entry, FleetVehicle):
        require_space(entry, "fleet")
    return entry


def requirements_of(
    requirements: Iterable[Requirement | str],
) -> tuple[Requirement, ...]:
    """Return requirements, phrases read; InvalidInput names all that are none."""
    found: list[Requirement] = []
    problems: list[Problem] = []
    for i, given in enumerate(requirements):
        try:
            found.append(parse_requirement(given) if isinstance(given, str) else given)
        except InvalidInput as error:
            problems += [
                Problem(f"requirements[{i}], {p.where}", p.given, p.allowed)
                for p in error.problems
            ]
    if problems:
        raise InvalidInput(problems)
    return tuple(found)


def shortfalls(
    vehicle: FleetVehicle,
    requirements: Iterable[Requirement],
    *,
    allow_unreachable: bool = False,
) -> tuple[Shortfall, ...]:
    """Return what a vehicle does not meet of what is asked of it alone.

    Parameters
    ----------
    vehicle : FleetVehicle
    requirements : iterable of Requirement
    allow_unreachable : bool
    """
    return tuple(
        short
        for requirement in requirements
        for short in _judged(vehicle, requirement, allow_unreachable)
    )


def _judged(
    vehicle: FleetVehicle, requirement: Requirement, allow_unreachable: bool
) -> Iterator[Shortfall]:
    match requirement:
        case Payload():
            yield from _payload(vehicle, requirement)
        case FitsWithin():
            yield from _footprint(vehicle.space, requirement)
        case NoMirroring() | PassableBackwards():
            return
        case _:
            for motion in _motions(requirement, vehicle.space):
                yield from _driven(
                    vehicle.space, requirement, motion, allow_unreachable
                )


def _payload(vehicle: FleetVehicle, asked: Payload) -> Iterator[Shortfall]:
    offered = vehicle.max_payload
    if offered is None and vehicle.space.vehicle is not None:
        offered = vehicle.space.vehicle.max_payload
    if offered is None or offered < asked.mass * (1 - ROUNDING):
        yield Shortfall(str(asked), "", asked.mass, offered, "kg", None, None)


def _footprint(space: PermissibleSpace, asked: FitsWithin) -> Iterator[Shortfall]:
    corners = space.header.footprint
    for axis, what, most in ((0, "length", asked.length), (1, "width", asked.width)):
        along = [corner[axis] for corner in corners]
        size = max(along) - min(along) if along else None
        if size is None or size > most * (1 + ROUNDING):
            yield Shortfall(str(asked), what, most, size, "m", None, None)


@dataclass(frozen=True)
class _Motion:
    """One twist of K that is asked for."""

    what: str
    twist: tuple[float, float, float]
    """(vx, vy, ω), m/s, m/s, rad/s; of any size where any speed will do."""
    asked: float
    """The speed that is asked for, 0: any."""
    unit: str
    or_tighter: bool = False
    """Whether any curve that is at least as tight will do."""


_SIDES = (("to the left", 1), ("to the right", -1))
_SIGNS: tuple[tuple[Way, int], ...] = (("forwards", 1), ("backwards", -1))


def _motions(
    asked: TurnOnTheSpot | Crab | Radius | Speed, space: PermissibleSpace
) -> Iterator[_Motion]:
    """Yield every motion that a requirement asks for."""
    ahead = space.line_beta or 0.0
    if isinstance(asked, TurnOnTheSpot):
        for side, sign in _SIDES:
            twist = (0.0, 0.0, sign * (asked.rate or 1.0))
            yield _Motion(side, twist, asked.rate, "rad/s")
    elif isinstance(asked, Crab):
        for side, sign in _SIDES:
            v = cmath.rect(asked.speed or 1.0, ahead + sign * asked.angle)
            yield _Motion(side, (v.real, v.imag, 0.0), asked.speed, "m/s")
    else:
        for way, direction in _SIGNS:
            if asked.way not in (way, WAYS[2]):
                continue
            v = cmath.rect(asked.speed or 1.0, ahead) * direction
            if isinstance(asked, Speed):
                yield _Motion(way, (v.real, v.imag, 0.0), asked.speed, "m/s")
                continue
            for side, sign in _SIDES:
                # The centre of the circle lies on that side of the vehicle.
                omega = sign * direction * abs(v) / asked.radius
                what = f"{way}, centre {side}"
                twist = (v.real, v.imag, omega)
                yield _Motion(what, twist, asked.speed, "m/s", or_tighter=True)


def _driven(
    space: PermissibleSpace,
    requirement: Requirement,
    motion: _Motion,
    allow_unreachable: bool,
) -> Iterator[Shortfall]:
    """Yield that a motion cannot be driven in either representation."""
    found = []
    for sign in (1, -1):
        kappa_n, beta, v_s = (
            float(x) for x in from_twist(motion.twist, space.kappa_g, sign)
        )
        curves = _curves(kappa_n) if motion.or_tighter else np.array([kappa_n])
        bounds = _v_max(space, curves, beta, v_s < 0, allow_unreachable)
        if motion.or_tighter:  # the tighter the curve, the less of v_s is K's speed
            bounds *= components(curves)[0] / components(kappa_n)[0]
        share = float((bounds / abs(v_s)).max())
        if share > 0 and share >= (1 - ROUNDING) * (motion.asked > 0):
            return
        why, who = space.explain(kappa_n, beta, reverse=v_s < 0)
        # Of two that are blocked alike: what no way leads to, then what looks ahead.
        apart = bool(why & Reason.UNREACHABLE)
        off = abs(cmath.phase(cmath.rect(1, beta - (space.line_beta or 0.0))))
        found.append(((share, apart, -off), int(why), int(who)))
    (share, _, _), reason, wheel = max(found)
    limits = [flag.name or "" for flag in Reason(reason)]
    yield Shortfall(
        requirement=str(requirement),
        what=motion.what,
        asked=motion.asked,
        offered=share * motion.asked,
        unit=motion.unit,
        limit=", ".join(limits) or "BLOCKED",
        wheel=space.header.wheel_ids[wheel] if wheel >= 0 else None,
    )


def _curves(kappa_n: float) -> FloatArray:
    """Return this κ_n and tighter ones, (TIGHTER,), without turning on the spot."""
    return np.linspace(kappa_n, math.copysign(2.0, kappa_n), TIGHTER + 1)[:-1]


def _v_max(
    space: PermissibleSpace,
    kappa_n: FloatArray,
    beta: float,
    reverse: bool,
    allow_unreachable: bool,
) -> FloatArray:
    """Return v_max at (κ_n, β), exact where the vehicle is known, (n,) m/s."""
    reachable_only = not allow_unreachable
    betas = np.full(kappa_n.shape, beta)
    found = np.array(
        space.v_max(kappa_n, betas, reverse=reverse, reachable_only=reachable_only),
        dtype=np.float64,
    )
    if space.vehicle is not None and (free := found > 0).any():
        exact = exact_v_max(space.vehicle, kappa_n[free], betas[free], reverse=reverse)
        found[free] = exact
    return found
