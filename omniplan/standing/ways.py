"""Ways from one configuration to another at a standstill."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from configspace import PermissibleSpace, wheel_directions
from configspace.angles import wrap
from configspace.omni_curve import components
from configspace.vehicle import SteerableWheel, Vehicle
from omniplan.judging.judge import judge_for
from omniplan.judging.proof import ROUNDING, Proof
from omniplan.judging.rows import Judge, Tolerances
from omniplan.motion import Intervals, OmniCurveMotion
from omniplan.standing.searched_way import searched_legs, surface_of
from omniplan.standing.turn_time import Turning, rest_to_rest, time_of
from omniplan.standing.winding import Sweep, joined, sweeps_of, unsettled

__all__ = ["Change", "Changer", "Configuration", "Way"]

FloatArray = npt.NDArray[np.float64]
Configuration = tuple[float, float]
"""κ_n, 1, and β, rad."""

SLOW = 1e4
"""Seconds per leg when a way is judged: so slow that only its shape matters."""
RATE_HALVINGS = 5
"""How finely the time for turning the wheels is added up along a way."""


@dataclass(frozen=True)
class Way:
    """One way inside the space."""

    time: float
    """Time it takes, s; infinite if it leaves the space."""
    sweeps: tuple[Sweep, ...]
    """How every winding wheel turns along it."""


@dataclass(frozen=True)
class Change:
    """Getting from one configuration to another."""

    start: Configuration
    goal: Configuration
    wheel: int
    """The wheel that turns furthest, -1 if unknown."""
    turn: float
    """By how much that wheel turns at least, rad."""
    ways: tuple[Way, ...]
    """At least one; only the quickest where no wheel winds."""


class Changer:
    """Finds ways from configuration to configuration at a standstill."""

    def __init__(
        self, judge: Judge, space: PermissibleSpace, tolerances: Tolerances
    ) -> None:
        self._judge, self._space, self._tolerances = judge, space, tolerances

    def change(
        self, start: Configuration, goal: Configuration, rest: float = math.inf
    ) -> Change:
        """Return a few ways through the space.

        The straight way in both directions of β, the way through pure translation and
        the ways through the poles. Where none of them is inside the space or quick
        enough, a way is searched for (`omniplan.standing.transitions`). Each is proved
        by the judge, so an answer "no way" may be too strict but never too lenient.

        Parameters
        ----------
        start, goal : (float, float), 1 and rad
        rest : float, s
            Time there is.
        """
        start, goal = self._on_line(start), self._on_line(goal)
        wheel, turn = self._turn(start, goal)
        if abs(turn) <= self._tolerances.alignment:
            stay = Way(0.0, tuple(self._aligned(start, goal)))
            return Change(start, goal, wheel, turn, (stay,))
        ways: list[Way] = []
        for legs in _ways(start, goal):
            quickest = min((way.time for way in ways), default=math.inf)
            ways.append(self._way(legs, quickest))
        quickest = min(way.time for way in ways)
        if quickest > rest or math.isinf(quickest):
            ways += self._searched(start, goal, quickest, rest)
        if not self._judge.winding_wheels:
            ways = [min(ways, key=lambda way: way.time)]
        return Change(start, goal, wheel, turn, tuple(ways))

    def stays(self, start: Configuration, goal: Configuration) -> bool:
        """Return whether the wheels surely stand alike, however a rest is measured.

        Parameters
        ----------
        start, goal : (float, float), 1 and rad
            Somewhere near the standstill.
        """
        _, turn = self._turn(self._on_line(start), self._on_line(goal))
        return abs(turn) <= self._tolerances.alignment / 2

    def _on_line(self, at: Configuration) -> Configuration:
        """Return what a line-mobile vehicle does of it: it slips, but its β stays."""
        line = self._space.line_beta
        if line is None:
            return at
        for beta in (line, float(wrap(line + math.pi))):
            if abs(float(wrap(at[1] - beta))) <= self._tolerances.slip_angle:
                return at[0], beta
        return at

    def _searched(
        self, start: Configuration, goal: Configuration, known: float, rest: float
    ) -> list[Way]:
        """Return the way by search, if there is one and it may be of use.

        Where a way is known and the wheels cannot possibly turn in the time there is,
        none is.
        """
        if math.isfinite(known) and self._least_time(start, goal) > rest:
            return []
        surface = surface_of(self._space)
        if surface is None:
            return []
        for leg in searched_legs(surface, start, goal):
            way = self._leg(leg)
            if math.isfinite(way.time):
                return [way]
        return []

    def _least_time(self, start: Configuration, goal: Configuration) -> float:
        """Return the time that the wheels need at least, s: each by itself."""
        vehicle, times = self._space.vehicle, [0.0]
        for i, wheel in enumerate(() if vehicle is None else vehicle.wheels):
            if isinstance(wheel, SteerableWheel):
                assert vehicle is not None
                z0, z1 = (
                    complex(wheel_directions(vehicle, *c)[i]) for c in (start, goal)
                )
                turn = np.array(abs(cmath.phase(z1 * z0.conjugate())))
                swing = wheel.max_steering_acceleration_deg
                limit = math.inf if swing is None else math.radians(swing)
                rate = wheel.standing_steering_rate
                times.append(float(rest_to_rest(turn, rate, limit)))
        return max(times)

    def _aligned(self, start: Configuration, goal: Configuration) -> list[Sweep]:
        """Return how the winding wheels turn between what counts as the same."""
        vehicle = self._space.vehicle
        sweeps = []
        for wheel in self._judge.winding_wheels:
            assert vehicle is not None
            z0, z1 = (wheel_directions(vehicle, *c)[wheel.index] for c in (start, goal))
            turn = float(np.angle(z1 * np.conj(z0)))
            start_angle = float(np.angle(z0))
            sweeps.append(Sweep(start_angle, turn, min(turn, 0.0), max(turn, 0.0)))
        return sweeps

    def _turn(self, start: Configuration, goal: Configuration) -> tuple[int, float]:
        """Return the wheel that must turn furthest, and by how much."""
        vehicle = self._space.vehicle
        if vehicle is None:
            # Without the wheels: the distance of the two motions on the unit scale.
            motions = [_motion_vector(c) for c in (start, goal)]
            return -1, float(np.linalg.norm(motions[0] - motions[1]))
        winding = {wheel.index for wheel in self._judge.winding_wheels}
        turns: dict[int, float] = {}
        for i, wheel in enumerate(vehicle.wheels):
            if not isinstance(wheel, SteerableWheel):
                continue
            a, b = (_angle(vehicle, i, wheel, c) for c in (start, goal))
            free = wheel.steering_range_deg is None or i in winding
            turns[i] = float(wrap(b - a)) if free else b - a
        if not turns:
            return -1, 0.0
        worst = max(turns, key=lambda i: abs(turns[i]))
        return worst, turns[worst]

    def _way(self, legs: list[list[Configuration]], known: float = math.inf) -> Way:
        """Return the way along some legs; where no wheel winds only a quicker one."""
        found: list[Way] = []
        is_one_enough = not self._judge.winding_wheels
        for leg in legs:
            found.append(self._leg(leg))
            time = sum(way.time for way in found)
            if is_one_enough and (time >= known or math.isinf(time)):
                return Way(math.inf, ())
        return Way(
            sum(way.time for way in found),
            # At a pole, where legs join, the wheels stand alike for every β.
            tuple(
                joined(way.sweeps[i] for way in found)
                for i in range(len(self._judge.winding_wheels))
            ),
        )

    def _leg(self, leg: list[Configuration]) -> Way:
        """Return the way along straight pieces."""
        t = np.arange(float(len(leg))) * SLOW
        samples = np.array([(kappa_n, beta, 0.0) for kappa_n, beta in leg])
        motion = OmniCurveMotion(t, samples, self._judge.kappa_g, self._judge.reference)
        judge = judge_for(self._space, motion, self._tolerances)
        proof = Proof(motion, judge, self._tolerances)
        proof.decide()
        wheels = judge.winding_wheels
        if (proof.parts.high[1] > 1 + ROUNDING).any():
            return Way(math.inf, (Sweep(0.0),) * len(wheels))
        proof.refine(lambda parts: unsettled(parts, wheels))
        (sweeps,) = sweeps_of(proof.parts, proof.parts.pieces(), wheels)
        spans = proof.parts.spans
        for _ in range(RATE_HALVINGS):
            spans = spans.halved(np.ones(spans.t0.shape, dtype=bool))
        _, high = judge.utilisation(motion.enclose(spans), 1)
        # At v_n = 0 all that wheels beside their axis roll, and all that shared motors
        # give, is for steering.
        rates = [row.limit in {"STEER_RATE", "WHEEL_SPEED"} for row in judge.rows]
        share = high[:, rates].max(axis=1, initial=0.0)
        return Way(time_of(self._turning(motion, spans, share)), sweeps)

    def _turning(
        self, motion: OmniCurveMotion, spans: Intervals, share: FloatArray
    ) -> Turning:
        """Return what a leg asks of the wheels whose steering acceleration is known."""
        directions, vehicle = motion.directions(spans), self._space.vehicle
        ends, slope, bend = [], [], []
        for i, wheel in enumerate(() if vehicle is None else vehicle.wheels):
            limit = getattr(wheel, "max_steering_acceleration_deg", None)
            if limit is None:
                continue
            assert vehicle is not None
            largest = math.radians(limit)
            at_ends, steepest = directions.rates(vehicle.contacts[i])
            _, bent = directions.accelerations(vehicle.contacts[i])
            ends.append(at_ends / largest)
            slope.append(steepest / largest)
            bend.append(bent / largest)
        none = np.zeros((spans.t0.size, 0))
        return Turning(
            spans.t1 - spans.t0,
            share,
            np.stack(ends, axis=-1) if ends else np.stack([none, none]),
            np.stack(slope, axis=-1) if slope else none,
            np.stack(bend, axis=-1) if bend else none,
        )


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
