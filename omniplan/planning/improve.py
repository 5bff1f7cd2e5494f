"""Making a way quicker: short cuts, judged by travel time.

Two places of a way are picked at random and connected anew, by the quickest moves that
are free. The time for steering at stops counts, so stops vanish where that is quicker.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from omniplan.planning.connect import Chain, Connector, Leg, chain_time
from omniplan.planning.moves import Move
from omniplan.planning.search import Found
from omniplan.planning.task import Pose, Task

__all__ = ["shortened"]

FloatArray = npt.NDArray[np.float64]

STALE = 100
"""After so many trials in vain it is enough."""
TRIED = 3
"""So many connections of two places are checked for collisions."""
GAIN = 1e-3
"""A way is quicker if it saves this, s."""
CUTS = 0.5
"""Share of trials that connect two places; the others shift a joint."""
END = 1 / 3
"""How often a cut begins at the start, or ends at the goal."""
SHIFTS = (-2.0, 0.3)
"""Joints are shifted by 10 to the power of this, m and rad."""
PAIRS = 2
"""So many connections before and after a shifted joint are combined."""
NEAR_JOINT = 0.05
"""Places nearer to the end of a move, as a share of it, are moved there."""


def shortened(
    task: Task, connector: Connector, found: Found, random: np.random.Generator
) -> Found:
    """Return a way that is quicker, or the same.

    Parameters
    ----------
    task : Task
    connector : Connector
    found : Found
    random : numpy.random.Generator
    """
    chain, total, stale = found.chain, found.duration, 0
    while stale < STALE and len(chain) > 1 and not task.budget.is_over:
        stale += 1
        task.budget.check()
        change = _cut if random.random() < CUTS else _shift
        for _, whole, new in itertools.islice(
            sorted(change(connector, chain, random, total - GAIN), key=_first), TRIED
        ):
            if task.are_free(leg[0].move for leg in new):
                chain, stale = whole, 0
                total = chain_time(connector.permits, whole)
                break
    return Found(chain, total, found.at)


Change = tuple[float, Chain, Chain]
"""Time of a way, the way, and what is new of it."""


def _first(change: Change) -> float:
    return change[0]


def _cut(
    connector: Connector, chain: Chain, random: np.random.Generator, below: float
) -> Iterator[Change]:
    """Yield ways that connect two places anew, quicker than a time."""
    spans = np.cumsum([0.0, *(leg[0].duration for leg in chain)])
    first, last = np.sort(random.uniform(0.0, spans[-1], 2)).tolist()
    if random.random() < END:
        first = 0.0
    if random.random() < END:
        last = float(spans[-1])
    i, u = _place(spans, first)
    j, v = _place(spans, last)
    if i == j:
        return
    head = _part(connector, chain[i], 0.0, u)
    tail = _part(connector, chain[j], v, 1.0)
    if head is None or tail is None:
        return
    before, after = (*chain[:i], *head), (*tail, *chain[j + 1 :])
    a, b = _pose_at(chain[i][0].move, u), _pose_at(chain[j][0].move, v)
    for _, middle in connector.thorough(a, b):
        whole = (*before, *middle, *after)
        time = chain_time(connector.permits, whole)
        if time < below:
            yield time, whole, middle


def _shift(
    connector: Connector, chain: Chain, random: np.random.Generator, below: float
) -> Iterator[Change]:
    """Yield ways with one joint moved or turned, quicker than a time."""
    k = int(random.integers(1, len(chain)))
    before, after = chain[k - 1][0].move, chain[k][0].move
    x, y, theta = before.goal.tolist()
    size = 10 ** random.uniform(*SHIFTS)
    kind = random.integers(4)
    if kind in (0, 1):
        x, y = (np.array([x, y]) + random.normal(0.0, size, 2)).tolist()
    if kind in (1, 2):
        theta += float(random.normal(0.0, size))
    if kind == 3:
        theta = float((before.start if random.random() < 1 / 2 else after.goal)[2])
    a, b = _pose_at(before, 0.0), _pose_at(after, 1.0)
    here = (x, y, theta)
    for (_, one), (_, other) in itertools.product(
        connector.thorough(a, here)[:PAIRS], connector.thorough(here, b)[:PAIRS]
    ):
        whole = (*chain[: k - 1], *one, *other, *chain[k + 1 :])
        time = chain_time(connector.permits, whole)
        if time < below:
            yield time, whole, (*one, *other)


def _place(spans: FloatArray, at: float) -> tuple[int, float]:
    """Return the move and the share of it at a time; ends of moves are preferred."""
    i = min(int(np.searchsorted(spans, at, side="right")) - 1, len(spans) - 2)
    u = (at - spans[i]) / max(spans[i + 1] - spans[i], 1e-12)
    if u < NEAR_JOINT:
        return i, 0.0
    return i, (1.0 if u > 1 - NEAR_JOINT else float(u))


def _pose_at(move: Move, u: float) -> Pose:
    x, y, theta = move.poses(np.array([u]))[0].tolist()
    return x, y, theta


def _part(connector: Connector, leg: Leg, u: float, v: float) -> Chain | None:
    """Return the part of a move between two shares; None if rounding forbids it."""
    if u == v:
        return ()
    if (u, v) == (0.0, 1.0):
        return (leg,)
    drives = connector.permits.drives(leg[0].move.part(u, v))
    return (drives,) if drives else None


def moves_of(chain: Chain) -> list[Move]:
    """Return the moves of a chain."""
    return [leg[0].move for leg in chain]
