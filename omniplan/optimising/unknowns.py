"""The unknowns of a solver in one row, and the motions that they mean."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from omniplan.optimising.setting import Guess, Leg, Setting

__all__ = ["BEGIN", "GIVE", "STATE", "SWING", "H", "Unknowns"]

FloatArray = npt.NDArray[np.float64]

STATE = 9
"""Unknowns per knot: pose and rate; and of the interval that follows:"""
H, GIVE, SWING = 6, 7, 8
"""its duration, by how much limits give way there, and those on α̈ on top."""
SHORTEST, LONGEST = 1e-3, 60.0
"""Durations of an interval, s."""
BEGIN = 1e-2
"""By how much limits give way at the start of a search that lets them."""


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Order and ranges of the unknowns: knots leg by leg, waits, lines."""

    setting: Setting

    def give_of(self, leg: int, interval: int) -> int:
        """Return the number of the unknown by which limits give way in an interval."""
        before = sum(n + 1 for n in self.setting.intervals[:leg])
        return STATE * (before + interval) + GIVE

    def packed(self, guess: Guess) -> FloatArray:
        """Return a motion as a row."""
        columns = []
        for leg in guess.legs:
            table = np.zeros((len(leg.h) + 1, STATE))
            table[:, :3], table[:, 3:6] = leg.poses, leg.rates
            table[:, H] = np.append(leg.h, leg.h[-1])
            table[:, GIVE] = BEGIN
            columns.append(table.ravel())
        return np.concatenate([*columns, guess.waits, guess.lines.ravel()])

    def unpacked(self, x: FloatArray) -> tuple[Guess, FloatArray, FloatArray]:
        """Return the motion of a row, and by how much limits give way, with poses.

        Returns
        -------
        guess : Guess
        give : (n,)
            Of every interval of all legs.
        poses : (n, 3)
            At the starts of the intervals.
        """
        legs, gives, at = [], [], 0
        for n in self.setting.intervals:
            table = x[at : at + STATE * (n + 1)].reshape(n + 1, STATE)
            h, poses = table[:-1, H].copy(), table[:, :3].copy()
            legs.append(Leg(h, poses, table[:, 3:6].copy()))
            gives.append(table[:-1, GIVE])
            at += table.size
        waits = x[at : at + len(legs) - 1]
        lines = x[at + waits.size :].reshape(-1, 2).copy()
        guess = Guess(tuple(legs), tuple(waits.tolist()), lines)
        starts = np.concatenate([leg.poses[:-1] for leg in legs])
        return guess, np.concatenate(gives), starts

    def ranges(self, start: Guess) -> tuple[FloatArray, FloatArray]:
        """Return the bounds on all unknowns: rest at the stops, the ends kept."""
        lows, highs = [], []
        last = len(start.legs) - 1
        for i, leg in enumerate(start.legs):
            low = np.full((len(leg.h) + 1, STATE), -np.inf)
            high = np.full(low.shape, np.inf)
            low[:, H], high[:, H] = SHORTEST, LONGEST
            low[:, [GIVE, SWING]] = 0.0
            if not self.setting.has_swing:
                high[:, SWING] = 0.0
            for row, is_end in ((0, i == 0), (-1, i == last)):
                low[row, 3:6] = high[row, 3:6] = 0.0
                if is_end and self.setting.keep_ends:
                    low[row, :3] = high[row, :3] = leg.poses[row]
            lows.append(low.ravel())
            highs.append(high.ravel())
        free = np.full(start.lines.size, np.inf)
        waits = np.zeros(len(start.waits))
        return (
            np.concatenate([*lows, waits, -free]),
            np.concatenate([*highs, waits + np.inf, free]),
        )
