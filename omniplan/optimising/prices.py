"""What a motion costs: time, jerk or change, and limits that give way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np

from omniplan.optimising.formulas import calm_over, jerk_over
from omniplan.optimising.setting import Guess, Setting
from omniplan.optimising.unknowns import GIVE, SWING, H

__all__ = ["Price"]

PRICE, SWING_PRICE = 100.0, 0.1
"""Of exceeding a limit, or one on α̈, by itself for a second. The first is above what
any limit is worth, so that all are kept where that is possible."""
CHANGE, CHANGE_TIME = 30.0, 3e-3
"""Weights of the mean squared change, over 1/κ_g², and of the relative duration."""
SMOOTH = 1e-2
"""Weight of the squared jerk over that of a way of the same length and time."""
ALONG = 0.02
"""Weight of a change along the way against one across it."""
CALM = 1e-4
"""Weight of calm among motions that are equally fast."""


@dataclass(frozen=True, eq=False)
class Price:
    """The objective of a problem, in a solver's symbols."""

    setting: Setting
    kappa_g: float
    legs: list[Any]
    waits: Any

    def duration(self) -> Any:
        """Return the time that all takes, s."""
        total = casadi.sum1(self.waits)
        for leg in self.legs:
            total += casadi.sum2(leg[H, :-1])
        return total

    def objective(self, reference: Guess | None) -> Any:
        """Return what is to be least; the reference is what is smoothed or changed."""
        duration = self.duration()
        usual = None if reference is None else max(reference.duration, 1e-3)
        given = PRICE * self._given(GIVE, usual)
        given += SWING_PRICE * self._given(SWING, usual)
        if reference is None or usual is None:
            return duration + CALM * self._summed(calm_over(self.kappa_g)) + given
        if self.setting.objective == "smooth":
            weight = SMOOTH * usual**5 / reference.length(1 / self.kappa_g) ** 2
            return weight * self._summed(jerk_over(self.kappa_g)) + given
        return CHANGE * self._change(reference) + CHANGE_TIME * duration / usual + given

    def _change(self, reference: Guess) -> Any:
        """Return the mean squared change, over 1/κ_g².

        Along the way it counts little: that is a matter of time, which is free.
        """
        total: Any = 0.0
        arm = 1 / self.kappa_g
        scale = np.array([1.0, 1.0, arm])
        for leg, meant in zip(self.legs, reference.legs, strict=True):
            off = (leg[:3, :] - meant.poses.T) * casadi.DM(scale)
            ahead = (meant.rates * scale).T
            size = np.linalg.norm(ahead, axis=0)
            ahead = np.divide(ahead, size, out=np.zeros_like(ahead), where=size > 0)
            slid = casadi.sum1(off * ahead)
            square = casadi.sumsqr(off) - (1 - ALONG) * casadi.sumsqr(slid)
            total += square / off.shape[1] / arm**2
        return total

    def _given(self, state: int, usual: float | None) -> Any:
        """Return by how much limits give way, times time, s.

        What is to be repaired may take any time: it must not be short to be cheap.
        """
        if usual is None:
            return sum(casadi.dot(leg[state, :-1], leg[H, :-1]) for leg in self.legs)
        n = sum(self.setting.intervals)
        return sum(casadi.sum2(leg[state, :-1]) for leg in self.legs) * (usual / n)

    def _summed(self, part: Any) -> Any:
        total = 0.0
        for leg in self.legs:
            total += casadi.sum2(part.map(leg.shape[1] - 1)(leg[:, :-1], leg[:, 1:]))
        return total
