"""Cubic splines of poses between two knots, in formulas for a solver.

A motion is what `omniplan.Trajectory` makes of poses: C² cubic splines of x, y and θ in
time. So what the solver finds is the trajectory itself, with no discretisation
between; only how densely its limits are looked at is a matter of choice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from omniplan.optimising.limits import Functions, Number, Pair, Twist

__all__ = ["Cubic", "Rest", "corners", "twists_at"]

Rest: TypeAlias = Literal["none", "start", "end"]
"""Where an interval is at rest; an interval at rest at both ends does not occur."""


@dataclass(frozen=True)
class Cubic:
    """Cubics of x, y, θ over one interval, by values and rates at its ends."""

    start: Sequence[Number]
    """(x, y, θ), m, m, rad."""
    end: Sequence[Number]
    start_rate: Sequence[Number]
    """(ẋ, ẏ, θ̇), m/s, m/s, rad/s."""
    end_rate: Sequence[Number]
    h: Number
    """Duration, s."""

    def bends(self) -> tuple[list[Number], list[Number]]:
        """Return the second derivatives at both ends, each times the duration."""
        first, last = [], []
        for p0, p1, v0, v1 in zip(
            self.start, self.end, self.start_rate, self.end_rate, strict=True
        ):
            rise = 6 * (p1 - p0) / self.h
            first.append(rise - 4 * v0 - 2 * v1)
            last.append(2 * v0 + 4 * v1 - rise)
        return first, last

    def at(self, share: float) -> list[list[Number]]:
        """Return value and three derivatives at a share of the interval, (4, 3)."""
        first, last = self.bends()
        t = share * self.h
        rows: list[list[Number]] = [[], [], [], []]
        for p0, v0, a0, a1 in zip(
            self.start, self.start_rate, first, last, strict=True
        ):
            b0, jerk = a0 / self.h, (a1 - a0) / (self.h * self.h)
            rows[0].append(p0 + t * (v0 + t * (b0 / 2 + t * jerk / 6)))
            rows[1].append(v0 + t * (b0 + t * jerk / 2))
            rows[2].append(b0 + t * jerk)
            rows[3].append(jerk)
        return rows


def twists_at(
    cubic: Cubic, share: float, rest: Rest, f: Functions
) -> tuple[list[Number], Twist, Twist]:
    """Return pose, twist and direction at a share of an interval.

    The direction is the twist; in an interval with an end at rest it is the twist over
    the time to that end, so that it is not zero there.
    """
    pose, v, a, jerk = cubic.at(share)
    s, c = f.sin(pose[2]), f.cos(pose[2])
    spin = (v[2], a[2])
    twist = _in_body(v, a, jerk, spin, s, c)
    if rest == "none":
        return pose, twist, twist
    ahead = 1.0 if rest == "start" else -1.0
    since = (share if rest == "start" else 1 - share) * cubic.h
    end = cubic.at(0.0 if rest == "start" else 1.0)
    # v = a t + j t²/2, t counted from the end at rest: over |t| that is
    q = [ahead * a0 + since * j / 2 for a0, j in zip(end[2], jerk, strict=True)]
    q1 = [ahead * j / 2 for j in jerk]
    return pose, twist, _in_body(q, q1, [0.0, 0.0, 0.0], spin, s, c)


def _in_body(
    v: Sequence[Number],
    a: Sequence[Number],
    jerk: Sequence[Number],
    spin: tuple[Number, Number],
    s: Number,
    c: Number,
) -> Twist:
    """Return a velocity of the world, with derivatives, as seen from the body.

    ``d/dt e^{-jθ} q = e^{-jθ} (q' - jωq)`` and
    ``d²/dt² e^{-jθ} q = e^{-jθ} (q'' - 2jωq' - j ω̇ q - ω² q)``.
    """
    omega, turn = spin
    first = (a[0] + omega * v[1], a[1] - omega * v[0])
    second = (
        jerk[0] + 2 * omega * a[1] + turn * v[1] - omega * omega * v[0],
        jerk[1] - 2 * omega * a[0] - turn * v[0] - omega * omega * v[1],
    )
    pairs = [
        Pair(c * x + s * y, c * y - s * x) for x, y in ((v[0], v[1]), first, second)
    ]
    return Twist((pairs[0], pairs[1], pairs[2]), (v[2], a[2], jerk[2]))


def corners(
    pose: Sequence[Number], arms: Sequence[complex], f: Functions
) -> list[Pair]:
    """Return where points of the body are in the world, m.

    Parameters
    ----------
    pose : (x, y, θ) of K
    arms : sequence of complex, m
        From K, in the body frame.
    f : Functions
    """
    s, c = f.sin(pose[2]), f.cos(pose[2])
    return [
        Pair(pose[0] + c * w.real - s * w.imag, pose[1] + s * w.real + c * w.imag)
        for w in arms
    ]
