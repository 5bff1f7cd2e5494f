"""Whether a piece of a path can be driven at all, however slowly.

The limits of the configuration alone (steering ranges, singular points and zones, slip,
wheels that always point alike) are proved along the whole piece, by the same judges
that `validate` asks, on the motion with constant u̇.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from configspace import PermissibleSpace
from configspace.angles import wrap
from configspace.omni_curve import curvature_of_ratio
from configspace.vehicle import SteerableWheel
from omniplan.choosing.faults import Fault
from omniplan.judging.judge import judge_for
from omniplan.judging.proof import ROUNDING, Proof
from omniplan.judging.rows import Bounds, Judge, Row, Tolerances, WindingWheel
from omniplan.motion import Enclosure
from omniplan.standing.ways import Configuration
from omniplan.timing.path_motion import PathMotion, PathPiece
from omniplan.wording import quantity

__all__ = ["PieceShape", "first_fault", "shape_of"]

BoolArray = npt.NDArray[np.bool_]

RATE = 10.0
"""u̇ of the motion that is judged, m/s: so fast that slip counts relative to speed."""


@dataclass(frozen=True)
class PieceShape:
    """What the geometry of a piece permits."""

    faults: dict[int, Fault | None]
    """Per representation: what forbids it first, None if nothing does."""
    ends: dict[int, tuple[Configuration, Configuration]]
    """Per representation: the configurations at the start and at the end."""


class _ShapeJudge:
    """A judge of the limits that no change of speed mends."""

    def __init__(self, judge: Judge) -> None:
        self._judge = judge
        self._kept = np.array([row.scaling == "none" for row in judge.rows], dtype=bool)
        self.rows: tuple[Row, ...] = tuple(
            row for row, kept in zip(judge.rows, self._kept, strict=True) if kept
        )
        self.kappa_g, self.reference = judge.kappa_g, judge.reference
        self.wheel_ids = judge.wheel_ids
        self.needs_configuration = judge.needs_configuration
        # Windings are followed by `validate`, through the whole of the motion.
        self.winding_wheels: tuple[WindingWheel, ...] = ()

    def utilisation(self, part: Enclosure, sign: int) -> Bounds:
        """Return low and high utilisation of the rows kept, (m, rows)."""
        return self.utilisations(part, (sign,))[sign]

    def utilisations(self, part: Enclosure, signs: Sequence[int]) -> dict[int, Bounds]:
        """Return those of several representations."""
        found = self._judge.utilisations(part, signs)
        return {
            sign: (low[:, self._kept], high[:, self._kept])
            for sign, (low, high) in found.items()
        }


def shape_of(
    piece: PathPiece, space: PermissibleSpace, tolerances: Tolerances
) -> PieceShape:
    """Judge the geometry of a piece in every representation.

    Parameters
    ----------
    piece : PathPiece
    space : PermissibleSpace
        Of a known vehicle.
    tolerances : Tolerances
    """
    motion = PathMotion(piece, RATE)
    judge = _ShapeJudge(judge_for(space, motion, tolerances))
    whole = motion.enclose(motion.intervals())
    signs = (1, -1) if judge.needs_configuration else (1,)
    ends: dict[int, tuple[Configuration, Configuration]] = {
        sign: (
            _configuration(whole, 0, sign, judge, at_end=False),
            _configuration(whole, -1, sign, judge, at_end=True),
        )
        for sign in signs
    }
    faults: dict[int, Fault | None] = dict.fromkeys(signs)
    if not judge.rows:
        return PieceShape(faults, ends)
    proof = Proof(motion, judge, tolerances)
    proof.decide()
    for sign in signs:
        bad = np.asarray((proof.parts.high[sign] > 1 + ROUNDING).any(axis=1))
        if bad.any():
            faults[sign] = _fault(proof, judge, piece, space, sign, bad)
    return PieceShape(faults, ends)


def _fault(
    proof: Proof,
    judge: _ShapeJudge,
    piece: PathPiece,
    space: PermissibleSpace,
    sign: int,
    bad: BoolArray,
) -> Fault:
    """Return what is wrong first; among limits what is proved and worst."""
    parts = proof.parts
    part = int(np.flatnonzero(bad)[0])
    low, high = parts.low[sign][part], parts.high[sign][part]
    column = int(np.lexsort((high, low))[-1])
    row = judge.rows[column]
    e, is_proved = parts.enclosure, bool(low[column] > 1 + ROUNDING)
    at_end = bool(_aside(e, part, 1, row, space) > _aside(e, part, 0, row, space))
    t = float((parts.spans.t1 if at_end else parts.spans.t0)[part])
    u = float(piece.u[0]) + t * RATE
    value = float(low[column] if is_proved else high[column])
    text = _text(row, value, sign, e, part, at_end, space)
    x, y, theta = piece.poses_at(np.array([u]))[0].tolist()
    wheel = judge.wheel_ids[row.wheel] if row.wheel >= 0 else None
    kappa_n, beta = _configuration(e, part, sign, judge, at_end=at_end)
    unproved = "" if is_proved else "cannot be excluded: "
    where = f", κ_n = {kappa_n:+z.3f}, β = {math.degrees(beta):+z.1f}°"
    return Fault(row.limit, wheel, u, (x, y, theta), f"{unproved}{text}{where}")


def _velocity(
    e: Enclosure, part: int, end: int, row: Row, space: PermissibleSpace
) -> complex:
    """Return the velocity of a row's wheel, or of K, at an end of a part."""
    vehicle = space.vehicle
    assert vehicle is not None
    point = vehicle.contacts[row.wheel] if row.wheel >= 0 else vehicle.reference
    v, omega = (e.v1, e.omega1) if end else (e.v0, e.omega0)
    return complex(v[part] + 1j * omega[part] * point)


def _aside(
    e: Enclosure, part: int, end: int, row: Row, space: PermissibleSpace
) -> float:
    """Return how bad an end of a part is, to tell the two apart."""
    v = _velocity(e, part, end, row, space)
    if row.limit == "STEER_RANGE":
        middle, _ = _range(row, space)
        return abs(float(wrap(np.angle(v) - middle)))
    return -abs(v)


def _range(row: Row, space: PermissibleSpace) -> tuple[float, float]:
    """Return middle and half of a steering range, rad."""
    assert space.vehicle is not None
    wheel = space.vehicle.wheels[row.wheel]
    assert isinstance(wheel, SteerableWheel)
    least, largest = wheel.steering_range
    return (least + largest) / 2, (largest - least) / 2


def _text(
    row: Row,
    ratio: float,
    sign: int,
    e: Enclosure,
    part: int,
    at_end: bool,
    space: PermissibleSpace,
) -> str:
    if row.limit == "STEER_RANGE":
        middle, half = _range(row, space)
        v = sign * _velocity(e, part, int(at_end), row, space)
        aside = float(wrap(np.angle(v) - middle))
        stop = quantity(middle + math.copysign(half, aside), "rad")
        allowed = f"at {'most' if aside > 0 else 'least'} {stop}"
        return f"steering angle {quantity(middle + aside, 'rad')}, {allowed}"
    if row.limit == "SINGULAR":
        return "the centre of rotation lies on the wheel"
    if row.limit == "FIXED_WHEEL":
        slip = math.asin(min(ratio * row.bound, 1.0))
        allowed = quantity(math.asin(row.bound), "rad")
        return f"sideways slip {quantity(slip, 'rad')}, at most {allowed}"
    value, bound = (quantity(x, row.unit) for x in (ratio * row.bound, row.bound))
    return f"{value}, at most {bound}"


def _configuration(
    e: Enclosure, part: int, sign: int, judge: _ShapeJudge, *, at_end: bool
) -> Configuration:
    """Return (κ_n, β) at an end of a part in one representation."""
    v, omega = (e.v1, e.omega1) if at_end else (e.v0, e.omega0)
    body = sign * complex(v[part] + 1j * omega[part] * judge.reference)
    q = sign * float(omega[part]) / judge.kappa_g
    kappa_n = float(np.clip(curvature_of_ratio(abs(body), q), -2.0, 2.0))
    return kappa_n, math.atan2(body.imag, body.real) if abs(body) > 0 else 0.0


def first_fault(shapes: Sequence[PieceShape]) -> Fault | None:
    """Return why the first piece that no representation can drive is blocked."""
    for shape in shapes:
        if all(shape.faults.values()):
            # Of the two the one that comes further says more.
            faults = [fault for fault in shape.faults.values() if fault is not None]
            return max(faults, key=lambda fault: fault.u)
    return None
