"""Requirements on how a trajectory is driven."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from configspace import PermissibleSpace
from configspace.omni_curve import components
from omniplan.choosing.requirements import NoMirroring, PassableBackwards, Requirement
from omniplan.choosing.shortfalls import Shortfall
from omniplan.proving import Proved
from omniplan.standing.standstill import Reconfiguration
from omniplan.trajectory import Trajectory
from omniplan.validation import validate
from omniplan.wording import refusal

__all__ = ["backwards", "passage_shortfalls"]


def passage_shortfalls(
    proved: Proved, requirements: Iterable[Requirement], *, allow_unreachable: bool
) -> tuple[Shortfall, ...]:
    """Return what a valid trajectory does not meet of what is asked.

    Parameters
    ----------
    proved : Proved
        Of `omniplan.proving.prove`.
    requirements : iterable of Requirement
        Those that a vehicle alone can meet are passed over.
    allow_unreachable : bool
    """
    found: list[Shortfall] = []
    for asked in requirements:
        if isinstance(asked, NoMirroring):
            found += _mirrorings(proved, asked)
        elif isinstance(asked, PassableBackwards):
            found += _back(proved.trajectory, proved.space, asked, allow_unreachable)
    return tuple(found)


def backwards(trajectory: Trajectory) -> Trajectory:
    """Return the same way from the goal to the start, the motion reversed.

    Parameters
    ----------
    trajectory : Trajectory
    """
    t, samples = trajectory.t, trajectory.samples[::-1].copy()
    if trajectory.form == "twists":
        samples *= -1
    elif trajectory.form == "omni_curve":
        samples[:, 2] *= -1
    times = t[0] + (t[-1] - t[::-1])
    times.flags.writeable = samples.flags.writeable = False
    return replace(trajectory, t=times, samples=samples)


def _mirrorings(proved: Proved, asked: NoMirroring) -> Iterator[Shortfall]:
    for stop in proved.choice.standstills:
        if _is_mirrored(stop.change):
            wheel = stop.change.wheel
            yield Shortfall(
                requirement=str(asked),
                what=f"at the standstill at t = {(stop.t0 + stop.t1) / 2:.2f} s",
                asked=None,
                offered=None,
                unit="",
                limit="RECONFIGURATION",
                wheel=proved.judge.wheel_ids[wheel] if wheel >= 0 else None,
            )


def _is_mirrored(change: Reconfiguration) -> bool:
    """Return whether the goal is nearer to the mirror image of the start than to it."""
    before, after = (
        np.array([c * np.cos(beta), c * np.sin(beta), s])
        for (c, s), beta in (
            (components(kappa_n), beta) for kappa_n, beta in (change.start, change.goal)
        )
    )
    return bool(before @ after < -1e-9)


def _back(
    trajectory: Trajectory,
    space: PermissibleSpace,
    asked: PassableBackwards,
    allow_unreachable: bool,
) -> Iterator[Shortfall]:
    report = validate(backwards(trajectory), space, allow_unreachable=allow_unreachable)
    worst = report.headline
    if worst is not None:
        yield Shortfall(
            requirement=str(asked),
            what=refusal(report),
            asked=None,
            offered=None,
            unit="",
            limit=worst.limit,
            wheel=worst.wheel,
        )
