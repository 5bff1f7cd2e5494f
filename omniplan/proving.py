"""The proof of one motion for one vehicle: decided, representations chosen, sharpened.

`omniplan.validation` sums it up, `omniplan.trace` tells it part by part.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from configspace import PermissibleSpace
from omniplan.judging.judge import is_own, judge_for
from omniplan.judging.proof import ROUNDING, Parts, Proof, refused
from omniplan.judging.rows import Judge, Tolerances
from omniplan.motion import Motion, motion_of
from omniplan.standing.standstill import Choice, choose_configurations
from omniplan.standing.winding import straddling, wound
from omniplan.trajectory import Trajectory

__all__ = ["Proved", "prove"]

STOP_HALVINGS = 12
"""How finely it is told when a wheel runs into a stop."""
LOOSE = 0.02
"""Where a motion is cut finer, the margin is known to this ..."""
LOOSE_HALVINGS, LOOSE_PARTS = 14, 4000
"""... unless that takes more halvings or parts."""


@dataclass(frozen=True, eq=False)
class Proved:
    """A motion, its parts and the representation that each is driven in."""

    trajectory: Trajectory
    space: PermissibleSpace
    motion: Motion
    judge: Judge
    tolerances: Tolerances
    parts: Parts
    choice: Choice
    proof: Proof
    """Where the parts come from."""

    @property
    def first(self) -> Parts:
        """The intervals between the samples, uncut."""
        return self.proof.first

    @property
    def is_valid(self) -> bool:
        """Whether every limit is proved to hold, and every standstill long enough."""
        choice, parts = self.choice, self.parts
        if choice.apart or any(stop.is_short for stop in choice.standstills):
            return False
        low, high = parts.picked(choice.sign_of(parts.spans))
        return not refused(low, high, self.judge.rows).any()


def prove(
    trajectory: Trajectory,
    space: PermissibleSpace,
    tolerances: Tolerances | None = None,
    *,
    allow_unreachable: bool = False,
    longest: float | None = None,
    max_parts: int | None = None,
    is_sharp: bool = True,
    like: Proved | None = None,
    checkpoint: Callable[[], None] | None = None,
) -> Proved:
    """Return the parts of a trajectory as `validate` judges them.

    Parameters
    ----------
    trajectory : Trajectory
    space : PermissibleSpace
    tolerances : Tolerances, optional
    allow_unreachable : bool
    longest : float, s, optional
        No part is longer than this.
    max_parts : int, optional
        How many more parts than samples there may be; more limits may stay undecided.
    is_sharp : bool
        Whether the margin is to be sharp; without it the verdict comes sooner.
    like : Proved, optional
        Of the same trajectory at another speed: it is cut in the same way to begin
        with, which saves time where only `Proved.is_valid` is asked.
    checkpoint : callable, optional
        Called again and again; what it raises ends the work.
    """
    tolerances = tolerances or Tolerances()
    motion = motion_of(trajectory, is_own=is_own(trajectory, space))
    judge = judge_for(space, motion, tolerances)
    cuts = () if like is None else like.proof.cuts
    proof = Proof(
        motion, judge, tolerances, max_parts, cuts=cuts, checkpoint=checkpoint
    )
    proof.decide()
    proof.separate()
    choice = choose_configurations(
        proof, judge, space, tolerances, allow_unreachable=allow_unreachable
    )
    if is_sharp and like is None:
        proof.sharpen(choice.sign_of)
    if longest is not None:
        proof.refine(lambda parts: parts.spans.t1 - parts.spans.t0 > longest)
        proof.refine(_loose(choice), LOOSE_HALVINGS)
    parts = _followed(proof, choice, judge, tolerances)
    return Proved(trajectory, space, motion, judge, tolerances, parts, choice, proof)


def _followed(
    proof: Proof, choice: Choice, judge: Judge, tolerances: Tolerances
) -> Parts:
    """Return the parts with the followed angles of the wheels that wind.

    Parameters
    ----------
    proof : Proof
        Decided and sharpened; refined where wheels run into their stops.
    choice : Choice
    judge : Judge
    tolerances : Tolerances
    """
    wheels = judge.winding_wheels
    if not choice.anchors:
        return proof.parts
    floor = -1.0 if proof.is_own else tolerances.standstill

    def follow(parts: Parts) -> Parts:
        sign, piece = choice.sign_of(parts.spans), choice.piece_of(parts.spans)
        return wound(parts, judge, sign, piece, choice.anchors, floor)

    proof.refine(lambda parts: straddling(follow(parts), wheels), STOP_HALVINGS)
    return follow(proof.parts)


def _loose(choice: Choice) -> Callable[[Parts], npt.NDArray[np.bool_]]:
    """Return which parts do not tell their margin well."""

    def wanted(parts: Parts) -> npt.NDArray[np.bool_]:
        if len(parts.stands) > LOOSE_PARTS:
            return np.zeros_like(parts.stands)
        low, high = parts.picked(choice.sign_of(parts.spans))
        best, worst = low.max(axis=1, initial=0.0), high.max(axis=1, initial=0.0)
        loose = (worst > best + LOOSE) & (best <= 1 + ROUNDING)
        return np.asarray(loose, dtype=bool)

    return wanted
