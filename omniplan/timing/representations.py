"""In which representation every piece of a path is driven, and the waits in between.

At a stop the wheels turn from where a piece leaves them to where the next one takes
them up; the sign of v_s on every piece is chosen for the whole to be fastest.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from configspace import PermissibleSpace
from omniplan.choosing.faults import Fault
from omniplan.judging.judge import judge_for
from omniplan.judging.rows import Tolerances
from omniplan.standing.ways import Changer
from omniplan.timing.path_motion import PathMotion, PathPiece
from omniplan.timing.shape import PieceShape
from omniplan.timing.solver import PieceProfile

__all__ = ["fastest_together"]


def fastest_together(
    pieces: Sequence[PathPiece],
    shapes: Sequence[PieceShape],
    options: Sequence[Mapping[int, PieceProfile]],
    space: PermissibleSpace,
    tolerances: Tolerances,
) -> tuple[list[PieceProfile], list[float]] | Fault:
    """Return the profiles that are fastest together, and the waits between them, s.

    A short dynamic programme; among equals driving forwards comes first. Where the
    wheels find no way from any piece to the next, why not.

    Parameters
    ----------
    pieces : (n,) sequence of PathPiece
    shapes : (n,) sequence of PieceShape
    options : (n,) sequence of mappings
        Of every piece the profile in each representation that it can be driven in.
    space : PermissibleSpace
    tolerances : Tolerances
    """
    # Half the tolerance, as what `validate` measures differs by the sampling.
    tolerances = replace(tolerances, alignment=tolerances.alignment / 2)
    judge = judge_for(space, PathMotion(pieces[0], 1.0), tolerances)
    changer = Changer(judge, space, tolerances)
    best: dict[int, tuple[float, list[int], list[float]]] = {
        sign: (_cost(profile), [sign], []) for sign, profile in options[0].items()
    }
    for i, option in enumerate(options[1:], start=1):
        step: dict[int, tuple[float, list[int], list[float]]] = {}
        for after, profile in option.items():
            found = []
            for before, (total, signs, waits) in best.items():
                change = changer.change(
                    shapes[i - 1].ends[before][1], shapes[i].ends[after][0]
                )
                wait = min(way.time for way in change.ways)
                cost = total + wait + _cost(profile)
                found.append((cost, [*signs, after], [*waits, wait]))
            quickest = min(found, key=lambda some: some[0])
            if math.isfinite(quickest[0]):
                step[after] = quickest
        if not step:
            return _no_way(pieces[i])
        best = step
    _, signs, waits = min(best.values(), key=lambda some: some[0])
    return [option[s] for option, s in zip(options, signs, strict=True)], waits


def _cost(profile: PieceProfile) -> float:
    """Return a profile's duration; among equals driving forwards is preferred."""
    return profile.duration * (1 + 1e-9 * (profile.sigma < 0))


def _no_way(piece: PathPiece) -> Fault:
    u = float(piece.u[0])
    x, y, theta = piece.poses_at(piece.u[:1])[0].tolist()
    text = "at rest the wheels find no way to their new angles inside the space"
    return Fault("RECONFIGURATION", None, u, (x, y, theta), text)
