"""The nearest way that wheels can follow: a start for a solver, often an answer.

K's way is rolled out from the directions of travel and curvatures that a vehicle has
at even steps. They are what is looked for, so a line-mobile vehicle keeps to its line
exactly, whatever the values; poses off the given way, steering angles beyond their
ranges, places too near an obstacle and the distance from the goal are least squares.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from omniplan.optimising.half_planes import Side, sides_of
from omniplan.optimising.limits import Rules
from omniplan.optimising.separation import Surroundings
from omniplan.optimising.setting import Box
from omniplan.optimising.warm_start import Course

__all__ = ["TRIALS", "Trial", "projected"]

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
AnyArray = npt.NDArray[Any]

STEPS = 48
"""Steps in which a way is rolled out."""
ALONG = 0.1
"""Weight of a change along the way against one across it, by length."""
HEADING = 0.5
"""Weight of a change of the heading: a radian counts so much of 1/κ_g."""
AT_GOAL, OF_LIMITS, NEAR = 30.0, 3.0, 20.0
"""Weights of the distance from the goal, of limits, of places too near: against 1/κ_g
off the way."""
RIPPLE = 0.1
"""Weight of changes of these changes, which splines through the poses exaggerate."""
ROUNDS, STRICTER = 4, 3.0
"""How often obstacles are looked for anew, and limits weigh more than before."""
ON_THE_SPOT = 0.3
"""A way shorter than this share of its turn over κ_g is no way to be rolled out."""
CLOSE = 0.02
"""So near to its goal a way must end to be moved there, over 1/κ_g."""


@dataclass(frozen=True)
class Trial:
    """How a nearest way is looked for."""

    smoothing: float
    """Share of the length over which the given way is smoothed before: the more a way
    turns about, the farther away its nearest permitted one begins."""
    spare: float
    """What steering angles keep from the ends of their ranges, rad."""
    calm: float
    """Weight of changes of curvature and direction from step to step."""


TRIALS = (
    Trial(0.0, math.radians(0.7), 0.03),
    Trial(0.06, math.radians(2.0), 0.1),
    Trial(0.15, math.radians(4.0), 0.2),
    Trial(0.3, math.radians(6.0), 0.5),
)
"""What is tried in turn, from the nearest way to the calmest."""


class _Rollout:
    """The ways of one leg, by curvature and direction of travel at every step."""

    def __init__(self, course: Course, rules: Rules, trial: Trial) -> None:
        self.rules, self.trial = rules, trial
        self.arm = 1 / rules.kappa_g
        place = course.poses[:, 0] + 1j * course.poses[:, 1]
        self.gone = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(place)))])
        self.length = float(self.gone[-1])
        at = np.linspace(0.0, self.length, STEPS + 1)
        self.place = _sampled(at, self.gone, place)
        self.heading = np.interp(at, self.gone, course.poses[:, 2])
        ahead = np.gradient(self.place)
        self.ahead = ahead / np.maximum(np.abs(ahead), 1e-12)
        self.turns = not rules.is_translating
        self.crabs = rules.line is None
        self.sign = 1
        self.sign = min((1, -1), key=self._strain)

    def _strain(self, sign: int) -> float:
        """Return how far the given way is from this representation, rad in all."""
        self.sign = sign
        x = self.start()
        bend, beta, _ = self.controls(x)
        if not self.crabs:
            step = np.diff(self.place)
            middle = (self.heading[1:] + self.heading[:-1]) / 2 + beta[1:]
            return float(-sign * (step * np.exp(-1j * middle)).real.sum())
        return float(sum(row.sum() for row in self.beyond(bend, beta)))

    def start(self) -> FloatArray:
        """Return the unknowns of the given way, smoothed."""
        share = self.trial.smoothing
        place, heading = _smoothed(self.place, share), _smoothed(self.heading, share)
        step = np.diff(place)
        travel = np.unwrap(np.angle(step * self.sign))
        middle = np.arange(STEPS) + 0.5
        travel = np.interp(np.arange(STEPS + 1), middle, travel)
        columns = []
        if self.turns:
            # A vehicle on a line turns as its way does.
            turn = np.gradient(heading if self.crabs else travel)
            columns.append(turn * STEPS * self.arm / np.abs(step).sum())
        if self.crabs:
            beta = travel - heading
            beta -= 2 * math.pi * np.round(np.median(beta) / (2 * math.pi))
            columns.append(beta)
        length = float(np.abs(step).sum()) / max(self.length, 1e-9)
        return np.concatenate([*columns, [length]])

    def controls(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return turn per length over κ_g and β at knots, and a step's length, m."""
        n = STEPS + 1
        none = np.zeros((*x.shape[:-1], n))
        bend = x[..., :n] if self.turns else none
        first = n * self.turns
        line = self.rules.line or 0.0
        beta = x[..., first : first + n] if self.crabs else none + line
        return bend, beta, x[..., -1:] * self.length / STEPS

    def poses(self, x: FloatArray) -> tuple[ComplexArray, FloatArray]:
        """Return places and headings (..., STEPS + 1)."""
        bend, beta, step = self.controls(x)
        bend = bend * self.rules.kappa_g
        turn = (bend[..., 1:] + bend[..., :-1]) / 2 * step
        # Curvature is linear over a step: so much more is turned in its first half.
        early = (bend[..., 1:] - bend[..., :-1]) * step / 12
        start = np.broadcast_to(self.heading[:1], (*x.shape[:-1], 1))
        heading = np.concatenate([start, start + np.cumsum(turn, axis=-1)], axis=-1)
        travel = heading[..., :-1] + turn / 2 - early
        travel = travel + (beta[..., 1:] + beta[..., :-1]) / 2
        # An arc's chord is shorter than the arc.
        chord = step * np.sinc(turn / (2 * math.pi))
        ways = self.sign * chord * np.exp(1j * travel)
        first = np.broadcast_to(self.place[:1], (*x.shape[:-1], 1))
        place = np.concatenate([first, first + np.cumsum(ways, axis=-1)], axis=-1)
        return place, heading

    def residuals(
        self, x: FloatArray, sides: list[Side], weight: float = 1.0
    ) -> FloatArray:
        """Return what is to be small, (..., k); limits weigh as much as told."""
        place, heading = self.poses(x)
        bend, beta, _ = self.controls(x)
        off = (place - self.place) * self.ahead.conj() / self.arm
        turned = HEADING * (heading - self.heading)
        rows = [
            np.concatenate([ALONG * off.real, off.imag, turned], axis=-1)
            / math.sqrt(STEPS),
            AT_GOAL * np.stack([off.real, off.imag, turned / HEADING], -1)[..., -1, :],
            self.trial.calm * np.diff(bend, axis=-1),
            self.trial.calm * np.diff(beta, axis=-1),
            RIPPLE * np.diff(bend, 2, axis=-1),
            RIPPLE * np.diff(beta, 2, axis=-1),
        ]
        rows += [weight * row for row in self.beyond(bend, beta)]
        for side in sides:
            at = place[..., side.step, None]
            corners = at + np.exp(1j * heading[..., side.step, None]) * side.arms
            gap = (corners * np.conj(side.normal)).real.min(axis=-1) - side.least
            rows.append(weight * NEAR * np.maximum(-gap, 0.0)[..., None] / self.arm)
        return np.concatenate(rows, axis=-1)

    def beyond(self, bend: FloatArray, beta: FloatArray) -> list[FloatArray]:
        """Return by how much wheels are beyond their steering ranges."""
        rows = []
        for sector in self.rules.sectors:
            if not math.isfinite(sector.half):
                continue
            arm = sector.b / (1j * self.rules.kappa_g)
            d = np.exp(1j * beta) + self.sign * 1j * bend * self.rules.kappa_g * arm
            angle = np.abs(np.angle(d * np.exp(-1j * sector.middle)))
            half = max(sector.half - self.trial.spare, sector.half / 2)
            rows.append(OF_LIMITS * np.maximum(angle - half, 0.0))
        return rows

    def is_within(self, x: FloatArray) -> bool:
        """Return whether no wheel uses up what it is to spare."""
        bend, beta, _ = self.controls(x)
        worst = max((float(r.max()) for r in self.beyond(bend, beta)), default=0.0)
        return worst < OF_LIMITS * self.trial.spare / 2

    def jacobian(
        self, x: FloatArray, sides: list[Side], weight: float = 1.0
    ) -> FloatArray:
        """Return the derivatives of the residuals by differences, all at once."""
        step = 1e-7
        at = self.residuals(x, sides, weight)
        moved = self.residuals(x + step * np.eye(len(x)), sides, weight)
        return np.ascontiguousarray(((moved - at) / step).T)


def projected(
    course: Course,
    rules: Rules,
    trial: Trial = TRIALS[0],
    surroundings: Surroundings | None = None,
    *,
    room: float = 0.0,
    bounds: Box | None = None,
) -> Course | None:
    """Return the course near another whose wheels keep their steering ranges.

    Parameters
    ----------
    course : Course
        Its ends are kept.
    rules : Rules
    trial : Trial
    surroundings : Surroundings, optional
    room : float, m
        Distance to keep from obstacles and bounds.
    bounds : (x0, y0, x1, y1) float, m, optional

    Returns
    -------
    course : Course or None
        At an even pace but for its ends; None if it is a turn on the spot or the goal
        is not met. It is near to what is permitted, with no promise.
    """
    rollout = _Rollout(course, rules, trial)
    turn = float(np.ptp(course.poses[:, 2]))
    if rollout.length < max(ON_THE_SPOT * turn * rollout.arm, 1e-3):
        return None
    x = rollout.start()
    sides: list[Side] = []
    for k in range(ROUNDS):
        if surroundings is not None:
            place, heading = rollout.poses(x)
            sides = sides_of(place, heading, surroundings, room, bounds)
        found: Any = least_squares(
            rollout.residuals,
            x,
            jac=rollout.jacobian,
            args=(sides, STRICTER**k),
            # MINPACK: the others decompose by LAPACK, whose threads wait for each other
            # for seconds where other work keeps the processors busy
            method="lm",
            ftol=1e-6,
            xtol=1e-6,
            max_nfev=60,
        )
        x = found.x
        if surroundings is None and rollout.is_within(x):
            break
    return _course(rollout, x, course)


def _course(rollout: _Rollout, x: FloatArray, given: Course) -> Course | None:
    """Return the course of a way, its end moved to the goal, from rest to rest."""
    place, heading = rollout.poses(x)
    goal = given.poses[-1]
    off = complex(goal[0], goal[1]) - place[-1]
    turned = float(goal[2]) - heading[-1]
    if max(abs(off), abs(turned) * rollout.arm) > CLOSE * rollout.arm:
        return None
    share = np.linspace(0.0, 1.0, STEPS + 1)
    ease = share * share * (3 - 2 * share)
    place, heading = place + ease * off, heading + ease * turned
    poses = np.stack([place.real, place.imag, heading], axis=-1)
    return Course(np.linspace(0.0, given.duration, STEPS + 1), poses)


def _sampled(at: FloatArray, gone: FloatArray, values: ComplexArray) -> ComplexArray:
    return np.asarray(
        np.interp(at, gone, values.real) + 1j * np.interp(at, gone, values.imag)
    )


def _smoothed(values: AnyArray, share: float) -> AnyArray:
    """Return means over a share of a row; its ends stay."""
    reach = round(share * STEPS / 2)
    if not reach:
        return values
    before = 2 * values[0] - values[reach:0:-1]
    after = 2 * values[-1] - values[-2 : -reach - 2 : -1]
    wide = np.concatenate([before, values, after])
    window = np.ones(2 * reach + 1) / (2 * reach + 1)
    return np.convolve(wide, window, mode="valid")
