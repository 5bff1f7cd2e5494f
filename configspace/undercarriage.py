"""How freely an undercarriage moves: all over the plane or along a line.

Fixed standard wheels leave only centres of rotation on their axle line; K is moved
onto it, which makes the side-slip angle constant (spec/omni-curve §2).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

__all__ = ["Mobility", "WheelPlace", "impossible_rates", "mobility_of"]

# Wheels within a micrometre and a micro-radian share one axle.
_LENGTH = 1e-6
_ANGLE = 1e-6


@dataclass(frozen=True)
class WheelPlace:
    """What the mobility of a vehicle depends on, per wheel."""

    id: str
    type: str
    position: complex
    heading: float
    driven: bool


@dataclass(frozen=True)
class Mobility:
    """Where K is and which β the vehicle can take."""

    reference: complex
    """K in the file's frame, m."""
    line_beta: float | None
    """The constant β of a line-mobile vehicle, rad; None for any β."""
    is_translating: bool = False
    """Whether only κ_n = 0 is possible, as with a synchro drive."""


def mobility_of(
    wheels: Sequence[WheelPlace], reference: complex, *, synchro: bool = False
) -> Mobility:
    """Return the mobility of a set of wheels.

    Parameters
    ----------
    wheels : sequence of WheelPlace
    reference : complex, m
        K as the file wants it; moved to the axle line of a line-mobile vehicle.
    synchro : bool
        Whether all steered wheels always point alike.

    Raises
    ------
    ValueError
        If the wheels cannot move together; the text says which and why.
    """
    if all(w.type == "castor" for w in wheels):
        raise ValueError("wheels: only castors; at least one other wheel is needed")
    _reject_mecanum_with_driven_wheels(wheels)
    fixed = [w for w in wheels if w.type == "fixed"]
    if synchro:
        _reject_other_than_steered(wheels)
        return Mobility(reference, None, is_translating=True)
    if not fixed:
        return Mobility(reference, None)
    first = fixed[0]
    axle = cmath.exp(1j * (first.heading + math.pi / 2))
    for other in fixed[1:]:
        _reject_second_axle(first, other, axle)
    # The rolling direction nearer to the x axis is forward.
    heading = math.remainder(first.heading, 2 * math.pi)
    if abs(heading) > math.pi / 2 + _ANGLE:
        heading = math.remainder(heading + math.pi, 2 * math.pi)
    along = ((reference - first.position) * axle.conjugate()).real
    foot = first.position + along * axle
    # Keep the file's K to the last bit where it is on the axle already.
    return Mobility(reference if abs(foot - reference) < 1e-12 else foot, heading + 0.0)


def impossible_rates(
    wheels: Sequence[tuple[str, str]],
    synchro: bool,
    kappa_rate: float,
    beta_rate_deg: float,
) -> Iterator[tuple[str, str, str]]:
    """Yield the guaranteed rates that the undercarriage has at no configuration.

    Parameters
    ----------
    wheels : sequence of (id, type)
    synchro : bool
    kappa_rate : float, 1/s
    beta_rate_deg : float, degrees/s

    Yields
    ------
    where, given, allowed : str
    """
    fixed = [name for name, kind in wheels if kind == "fixed"]
    if fixed and beta_rate_deg > 0:
        yield (
            "guaranteed.beta_rate_deg",
            str(beta_rate_deg)[:60],
            f"0 or left out: the fixed wheel {fixed[0]} keeps β constant",
        )
    if synchro and kappa_rate > 0:
        yield (
            "guaranteed.kappa_rate",
            str(kappa_rate)[:60],
            "0 or left out: a synchro drive cannot leave κ_n = 0",
        )


def skid_contacts(
    wheels: Sequence[WheelPlace], effective_track: float
) -> tuple[complex, ...]:
    """Return the contacts of the differential drive that stands for a skid steer.

    Fixed wheels move to one axle through their middle, `effective_track` apart; the
    others stay.

    Raises
    ------
    ValueError
        If there are other driven wheels, or the fixed ones do not form two sides.
    """
    fixed = [w for w in wheels if w.type == "fixed"]
    others = [w for w in wheels if w.type not in {"fixed", "castor"}]
    if others or not fixed:
        raise ValueError(
            "wheels: a skid-steered vehicle has fixed wheels and castors only"
            + (f"; {others[0].id} is {others[0].type}" if others else "")
        )
    along = cmath.exp(1j * fixed[0].heading)
    middle = sum(w.position for w in fixed) / len(fixed)
    contacts = []
    sides = set()
    for wheel in wheels:
        if wheel.type == "castor":
            contacts.append(wheel.position)
            continue
        if abs(math.remainder(wheel.heading - fixed[0].heading, math.pi)) > _ANGLE:
            raise ValueError(
                f"wheels: {wheel.id} does not roll along {fixed[0].id}; the wheels "
                "of a skid-steered vehicle are parallel"
            )
        aside = ((wheel.position - middle) * along.conjugate()).imag
        side = math.copysign(1.0, aside) if abs(aside) > _LENGTH else 0.0
        sides.add(side)
        contacts.append(middle + side * 1j * along * effective_track / 2)
    if sides != {1.0, -1.0}:
        raise ValueError("wheels: a skid-steered vehicle has wheels on two sides")
    return tuple(contacts)


def _reject_other_than_steered(wheels: Sequence[WheelPlace]) -> None:
    steered = [w for w in wheels if w.type in {"steered", "turntable"}]
    others = [w for w in wheels if w.type not in {"steered", "turntable", "castor"}]
    if others or not steered:
        raise ValueError(
            "wheels: a synchro drive has steered wheels and castors only"
            + (f"; {others[0].id} is {others[0].type}" if others else "")
        )


def _reject_second_axle(first: WheelPlace, other: WheelPlace, axle: complex) -> None:
    parallel = abs(math.remainder(other.heading - first.heading, math.pi)) < _ANGLE
    if not parallel:
        raise ValueError(
            f"wheels: the fixed wheels {first.id} and {other.id} have axles that "
            "cross, so the vehicle could only turn about that point; all fixed wheels "
            "must share one axle line"
        )
    apart = ((other.position - first.position) * axle.conjugate()).imag
    if abs(apart) > _LENGTH:
        raise ValueError(
            f"wheels: the fixed wheels {first.id} and {other.id} have parallel axles "
            f"{abs(apart):.4g} m apart, so the vehicle cannot turn; all fixed wheels "
            "must share one axle line"
        )


def _reject_mecanum_with_driven_wheels(wheels: Sequence[WheelPlace]) -> None:
    rollers = [w for w in wheels if w.type in {"mecanum", "omni"}]
    driven = [
        w for w in wheels if w.type in {"steered", "turntable", "fixed"} and w.driven
    ]
    if rollers and driven:
        raise ValueError(
            f"wheels: {rollers[0].id} ({rollers[0].type}) together with the driven "
            f"standard wheel {driven[0].id}; a standard wheel lacks the freedom "
            "of the rollers, so the two cannot be combined"
        )
