"""Nearer still: from a proved way near the one given to the closest one around it.

Each knot of a way is compared with the place of the way given that is nearest to it.
After a solve those places, and the obstacles' nearest sides, are others, so it is
repeated, as in iterative closest points (P. Besl, N. McKay, IEEE PAMI 14 (1992)).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from omniplan.optimising.attempts import Attempts
from omniplan.optimising.closest import Aim, Way, closest
from omniplan.optimising.half_planes import Side, sides_of
from omniplan.optimising.limits import Rules
from omniplan.optimising.measure import nearest_on
from omniplan.optimising.warm_start import Course

__all__ = ["MARGINS", "Margin", "polished"]

FloatArray = npt.NDArray[np.float64]

STEPS = 64
"""Intervals of a way."""
FINE = 4
"""Poses per interval in what is returned."""
ROUNDS = 12
"""How often the nearest places are looked for anew, at most."""
ALONG, STIFFER = 0.02, 5.0
"""Weight of a change along the way given, and by how much it grows where a way went too
far along."""
SETTLED = 0.005
"""A change that differs by less than this share is the same."""
LEAST = 1e-4
"""A change below this is none, m."""


@dataclass(frozen=True)
class Margin:
    """What a way keeps from its limits, so that splines through it keep them."""

    spare: float
    """Of steering ranges, rad."""
    calm: float
    """Weight of changes of the twist."""
    room: float
    """From obstacles and bounds beyond the clearance, m."""


MARGINS = (
    Margin(math.radians(0.3), 2e-3, 0.003),
    Margin(math.radians(0.8), 4e-3, 0.006),
    Margin(math.radians(1.6), 1e-2, 0.01),
    Margin(math.radians(3.0), 3e-2, 0.015),
)
"""What is tried in turn, from the closest way to what is proved most easily."""


def polished(
    attempts: Attempts, courses: Sequence[Course], margin: Margin
) -> list[Course] | None:
    """Return the courses closest to the way given around others, None without one.

    Parameters
    ----------
    attempts : Attempts
    courses : sequence of Course
        Near to what is permitted; where they stop they stop still.
    margin : Margin
    """
    found = []
    for i, course in enumerate(courses):
        keep = attempts.task.keep_ends
        keeps = keep or i > 0, keep or i < len(courses) - 1
        near = _Polish(attempts, course, margin, keeps).run()
        if near is None:
            return None
        found.append(near)
    return found


class _Polish:
    """The search for the closest way around one course."""

    def __init__(
        self,
        attempts: Attempts,
        course: Course,
        margin: Margin,
        keeps: tuple[bool, bool],
    ) -> None:
        self._attempts, self._margin, self._keeps = attempts, margin, keeps
        self._rules = attempts.task.rules
        self._scale = np.array([1.0, 1.0, 1 / self._rules.kappa_g])
        self._course = course
        self._sign = _sign(self._start(course), self._rules)

    def run(self) -> Course | None:
        """Return the closest way, looked at place by place and then between as well."""
        way = self._start(self._course)
        if self._attempts.task.surroundings is not None:
            way = self._settled(way, swept=False) or way
        found = self._settled(way, swept=True)
        return None if found is None else self._dense(found)

    def _settled(self, way: Way, *, swept: bool) -> Way | None:
        """Return the way that looking for the nearest places anew does not change."""
        found, along = None, ALONG
        aim = self._aim(way, swept)
        for _ in range(ROUNDS):
            left = self._attempts.time_left
            if left <= 0 or along > 1:
                break
            near = closest(way, replace(aim, along=along), self._rules, left)
            if near is None:
                break
            then = self._aim(near, swept)
            if found is not None and then.scale >= aim.scale:
                along *= STIFFER
                continue
            gain = 1 - then.scale / aim.scale
            way, found, aim = near, near, then
            if 0 <= gain < SETTLED:
                break
        return found

    def _start(self, course: Course) -> Way:
        """Return knots evenly along a course."""
        step = np.linalg.norm(np.diff(course.poses, axis=0) * self._scale, axis=1)
        gone = np.concatenate([[0.0], np.cumsum(step)])
        at = np.linspace(0.0, gone[-1], STEPS + 1)
        poses = np.stack([np.interp(at, gone, p) for p in course.poses.T], axis=-1)
        rates = np.gradient(poses, axis=0)
        turn = np.exp(-1j * poses[:, 2])
        body = (rates[:, 0] + 1j * rates[:, 1]) * turn
        twists = np.stack([body.real, body.imag, rates[:, 2]], axis=-1)
        return Way(poses, twists)

    def _aim(self, way: Way, swept: bool) -> Aim:
        """Return where the knots are to be, by where they are."""
        scaled, given = way.poses * self._scale, self._attempts.way * self._scale
        places, steps = nearest_on(scaled, given)
        size = np.linalg.norm(steps, axis=1, keepdims=True)
        ahead = np.divide(steps, size, out=np.zeros_like(steps), where=size > 0)
        gone = np.linalg.norm(np.diff(scaled, axis=0), axis=1)
        shares = (np.append(gone, 0.0) + np.append(0.0, gone)) / (2 * gone.sum())
        mean = float(shares @ ((scaled - places) ** 2).sum(axis=1))
        return Aim(
            places / self._scale,
            ahead,
            ALONG,
            shares,
            max(math.sqrt(mean), LEAST),
            self._keeps,
            self._sign,
            self._margin.spare,
            self._margin.calm,
            self._sides(way.poses, swept),
        )

    def _sides(self, poses: FloatArray, swept: bool) -> list[Side]:
        task = self._attempts.task
        if task.surroundings is None:
            return []
        place = poses[:, 0] + 1j * poses[:, 1]
        room = task.clearance + self._margin.room
        around, heading = task.surroundings, poses[:, 2]
        return sides_of(place, heading, around, room, task.bounds, swept=swept)

    def _dense(self, way: Way) -> Course:
        """Return the way between the knots as well, as its twists lead it."""
        poses, twists = way.poses, way.twists
        share = np.arange(FINE)[:, None, None] / FINE
        before, after = twists[:-1], twists[1:]
        heading = poses[:-1, 2] + share[..., 0] * before[:, 2]
        heading = heading + share[..., 0] ** 2 / 2 * (after - before)[:, 2]
        gone = np.zeros((FINE, STEPS), dtype=np.complex128)
        for node, weight in zip(*np.polynomial.legendre.leggauss(4), strict=True):
            at = share * (1 + node) / 2
            u = before + at * (after - before)
            turned = poses[:-1, 2] + at[..., 0] * before[:, 2]
            turned = turned + at[..., 0] ** 2 / 2 * (after - before)[:, 2]
            rate = (u[..., 0] + 1j * u[..., 1]) * np.exp(1j * turned)
            gone += weight / 2 * share[..., 0] * rate
        place = poses[:-1, 0] + 1j * poses[:-1, 1] + gone
        table = np.stack([place.real, place.imag, heading], axis=-1)
        rows = table.transpose(1, 0, 2).reshape(-1, 3)
        fine = np.concatenate([rows, poses[-1:]])
        return Course(np.linspace(0.0, self._course.duration, len(fine)), fine)


def _sign(way: Way, rules: Rules) -> int:
    """Return the representation in which wheels are nearest to their ranges."""
    u = way.twists[:, 0] + 1j * way.twists[:, 1]
    if rules.line is not None:
        return 1 if (u * np.exp(-1j * rules.line)).real.sum() >= 0 else -1
    off = {1: 0.0, -1: 0.0}
    for sector in rules.sectors:
        if math.isfinite(sector.half):
            d = u + way.twists[:, 2] * (sector.b / rules.kappa_g)
            for sign in off:
                angle = np.abs(np.angle(sign * d * np.exp(-1j * sector.middle)))
                off[sign] += float(np.maximum(angle - sector.half, 0.0).sum())
    return min(off, key=off.__getitem__)
