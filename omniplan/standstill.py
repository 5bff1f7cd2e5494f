"""Which of its two representations each piece of a motion is driven in.

A piece is what lies between two standstills. Within it the configuration is continuous
and v_s keeps its sign; at a standstill the wheels may be brought into another
configuration, inside the space and in the time there is.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from configspace import PermissibleSpace, wheel_directions
from configspace.angles import wrap
from configspace.omni_curve import components, curvature_of_ratio
from configspace.vehicle import SteerableWheel, Vehicle
from omniplan.judge import judge_for
from omniplan.motion import Intervals, OmniCurveMotion
from omniplan.proof import ROUNDING, Parts, Proof
from omniplan.rows import Judge, Tolerances

__all__ = ["Choice", "Reconfiguration", "choose_configurations"]

FloatArray = npt.NDArray[np.float64]
Configuration = tuple[float, float]

SLOW = 1e4
"""Seconds per leg when a way is judged: so slow that only its shape matters."""
RATE_HALVINGS = 5
"""How finely the time for turning the wheels is added up along a way."""


@dataclass(frozen=True)
class Reconfiguration:
    """Getting from one configuration to another at a standstill."""

    start: Configuration
    """(κ_n, β) before, 1 and rad."""
    goal: Configuration
    """(κ_n, β) after, 1 and rad."""
    time: float
    """Time it takes, s; infinite if no way inside the space was found."""
    wheel: int
    """The wheel that turns furthest, -1 if unknown."""
    turn: float
    """By how much that wheel turns, rad."""


@dataclass(frozen=True)
class Standstill:
    """A stretch at rest between two pieces, and what happens there."""

    t0: float
    t1: float
    change: Reconfiguration


@dataclass(frozen=True)
class Choice:
    """The representation of every piece."""

    signs: tuple[int, ...]
    standstills: tuple[Standstill, ...]
    """Between consecutive pieces."""

    def sign_of(self, spans: Intervals) -> npt.NDArray[np.int64]:
        """Return the representation of each part."""
        cuts = [(stop.t0 + stop.t1) / 2 for stop in self.standstills]
        piece = np.searchsorted(cuts, (spans.t0 + spans.t1) / 2)
        return np.asarray(np.array(self.signs)[piece])


@dataclass(frozen=True)
class _Piece:
    first: int
    last: int


def choose_configurations(
    proof: Proof, judge: Judge, space: PermissibleSpace, tolerances: Tolerances
) -> Choice:
    """Choose representations with the fewest violations, then the shortest waits.

    Parameters
    ----------
    proof : Proof
        Decided.
    judge : Judge
    space : PermissibleSpace
    tolerances : Tolerances
    """
    parts = proof.parts
    pieces = _pieces(parts)
    if len(proof.signs) == 1 or not pieces:
        return Choice((1,), ())
    costs = [
        {
            sign: float(
                (parts.high[sign][p.first : p.last + 1] > 1 + ROUNDING)
                .any(axis=0)
                .sum()
            )
            for sign in proof.signs
        }
        for p in pieces
    ]
    # Only the best representations of a piece can be part of the best sequence that
    # is valid, and looking for ways between configurations is dear.
    costs = [
        {sign: price for sign, price in cost.items() if price == min(cost.values())}
        for cost in costs
    ]
    changer = _Changer(judge, space, tolerances)
    changes = [
        {
            (before, after): changer.change(
                _configuration(parts, a.last, before, judge, at_end=True),
                _configuration(parts, b.first, after, judge, at_end=False),
            )
            for before in before_costs
            for after in after_costs
        }
        for (a, before_costs), (b, after_costs) in itertools.pairwise(
            zip(pieces, costs, strict=True)
        )
    ]
    rests = [
        (float(parts.spans.t1[a.last]), float(parts.spans.t0[b.first]))
        for a, b in itertools.pairwise(pieces)
    ]
    signs = _cheapest(costs, changes, rests)
    standstills = tuple(
        Standstill(*rest, options[before, after])
        for rest, options, before, after in zip(
            rests, changes, signs[:-1], signs[1:], strict=True
        )
    )
    return Choice(signs, standstills)


def _pieces(parts: Parts) -> list[_Piece]:
    """Return the runs of parts on which the vehicle moves."""
    moving = np.flatnonzero(~parts.stands)
    if not moving.size:
        return []
    breaks = np.flatnonzero(np.diff(moving) > 1)
    firsts = moving[np.concatenate([[0], breaks + 1])]
    lasts = moving[np.concatenate([breaks, [moving.size - 1]])]
    return [_Piece(int(a), int(b)) for a, b in zip(firsts, lasts, strict=True)]


def _cheapest(
    costs: list[dict[int, float]],
    changes: list[dict[tuple[int, int], Reconfiguration]],
    rests: list[tuple[float, float]],
) -> tuple[int, ...]:
    """Return the best sequence of representations (dynamic programme)."""
    best: dict[int, tuple[float, tuple[int, ...]]] = {
        sign: (cost, (sign,)) for sign, cost in costs[0].items()
    }
    for cost, options, (t0, t1) in zip(costs[1:], changes, rests, strict=True):
        step: dict[int, tuple[float, tuple[int, ...]]] = {}
        for after in cost:
            candidates = []
            for before, (total, path) in best.items():
                time = options[before, after].time
                price = 0.5 if time > t1 - t0 else 0.0
                # Far below one violation: among equals the wheels turn least.
                price += min(time, 1e3) * 1e-6 + (before != after) * 1e-9
                candidates.append((total + price + cost[after], (*path, after)))
            step[after] = min(candidates, key=_preference)
        best = step
    return min(best.values(), key=_preference)[1]


def _preference(option: tuple[float, tuple[int, ...]]) -> tuple[float, tuple[int, ...]]:
    """Order by cost; among equals driving forwards comes first."""
    cost, path = option
    return cost, tuple(-sign for sign in path)


def _configuration(
    parts: Parts, index: int, sign: int, judge: Judge, *, at_end: bool
) -> Configuration:
    """Return (κ_n, β) at an end of a part in one representation."""
    e = parts.enclosure
    v, omega = (e.v1, e.omega1) if at_end else (e.v0, e.omega0)
    own = sign * float(e.sign[index])
    body = own * (v[index] + 1j * omega[index] * judge.reference)
    q = own * omega[index] / judge.kappa_g
    kappa_n = float(np.clip(curvature_of_ratio(abs(body), q), -2.0, 2.0))
    return kappa_n, float(np.angle(body)) if abs(body) > 0 else 0.0


class _Changer:
    """Finds ways from configuration to configuration at a standstill."""

    def __init__(
        self, judge: Judge, space: PermissibleSpace, tolerances: Tolerances
    ) -> None:
        self._judge, self._space, self._tolerances = judge, space, tolerances

    def change(self, start: Configuration, goal: Configuration) -> Reconfiguration:
        """Return the quickest of a few ways through the space.

        The straight way in both directions of β, the way through pure translation and
        the ways through the poles; a longer way that none of them finds is not looked
        for, so an answer "no way" may be too strict but never too lenient.
        """
        wheel, turn = self._turn(start, goal)
        if abs(turn) <= self._tolerances.alignment:
            return Reconfiguration(start, goal, 0.0, wheel, turn)
        ways = _ways(start, goal)
        time = min(sum(self._leg_time(leg) for leg in way) for way in ways)
        return Reconfiguration(start, goal, time, wheel, turn)

    def _turn(self, start: Configuration, goal: Configuration) -> tuple[int, float]:
        """Return the wheel that must turn furthest, and by how much."""
        vehicle = self._space.vehicle
        if vehicle is None:
            # Without the wheels: the distance of the two motions on the unit scale.
            motions = [_motion_vector(c) for c in (start, goal)]
            return -1, float(np.linalg.norm(motions[0] - motions[1]))
        turns: dict[int, float] = {}
        for i, wheel in enumerate(vehicle.wheels):
            if not isinstance(wheel, SteerableWheel):
                continue
            a, b = (_angle(vehicle, i, wheel, c) for c in (start, goal))
            free = wheel.steering_range_deg is None
            turns[i] = float(wrap(b - a)) if free else b - a
        if not turns:
            return -1, 0.0
        worst = max(turns, key=lambda i: abs(turns[i]))
        return worst, turns[worst]

    def _leg_time(self, leg: list[Configuration]) -> float:
        """Return the time along straight pieces; infinite if they leave the space."""
        t = np.arange(float(len(leg))) * SLOW
        samples = np.array([(kappa_n, beta, 0.0) for kappa_n, beta in leg])
        motion = OmniCurveMotion(t, samples, self._judge.kappa_g, self._judge.reference)
        judge = judge_for(self._space, motion, self._tolerances)
        proof = Proof(motion, judge, self._tolerances)
        proof.decide()
        if (proof.parts.high[1] > 1 + ROUNDING).any():
            return math.inf
        spans = proof.parts.spans
        for _ in range(RATE_HALVINGS):
            spans = spans.halved(np.ones(spans.t0.shape, dtype=bool))
        _, high = judge.utilisation(motion.enclose(spans), 1)
        rates = [row.limit == "STEER_RATE" for row in judge.rows]
        share = high[:, rates].max(axis=1, initial=0.0)
        return float(share @ (spans.t1 - spans.t0))


def _ways(start: Configuration, goal: Configuration) -> list[list[list[Configuration]]]:
    """Return ways from start to goal, each a list of legs.

    Legs are joined where β has no meaning, at a pole.
    """
    (k0, b0), (k1, b1) = start, goal
    short = float(wrap(b1 - b0))
    ways: list[list[list[Configuration]]] = []
    for turn in (short, short - math.copysign(2 * math.pi, short)):
        third = turn / 3  # corners less than half a turn apart
        ways.append(
            [[(k0 + (k1 - k0) * f / 3, b0 + third * f) for f in range(4)]],
        )
        corner = [(0.0, b0 + third * f) for f in range(4)]
        ways.append([_distinct([(k0, b0), *corner, (k1, b0 + turn)])])
    for pole in (2.0, -2.0):
        legs = [_distinct([(k0, b0), (pole, b0)]), _distinct([(pole, b1), (k1, b1)])]
        ways.append([leg for leg in legs if len(leg) > 1])
    return ways


def _distinct(leg: list[Configuration]) -> list[Configuration]:
    """Return the leg without corners that repeat."""
    return [c for i, c in enumerate(leg) if i == 0 or c != leg[i - 1]]


def _angle(vehicle: Vehicle, i: int, wheel: SteerableWheel, at: Configuration) -> float:
    """Return a steering angle, rad, as it stands within the wheel's range."""
    z = complex(wheel_directions(vehicle, *at)[i])
    alpha = math.atan2(z.imag, z.real)
    if wheel.steering_range_deg is None:
        return alpha
    middle = sum(wheel.steering_range) / 2
    return middle + float(wrap(alpha - middle))


def _motion_vector(at: Configuration) -> FloatArray:
    c, s = components(at[0])
    return np.array([c * math.cos(at[1]), c * math.sin(at[1]), s], dtype=np.float64)
