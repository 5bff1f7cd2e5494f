"""Motions through poses: cubic splines, at rest in every stop."""

from __future__ import annotations

import itertools
from functools import cached_property
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from omniplan.judging.swing import (
    Pieces,
    Swing,
    factored,
)
from omniplan.motion.enclosure import Enclosure, Intervals
from omniplan.samples import HEADING_LENGTH
from omniplan.splines import spline

__all__ = ["PoseMotion", "starts_at_rest", "stops_of"]

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
IntArray = npt.NDArray[np.int64]
Number = TypeVar("Number", np.float64, np.complex128)

STOP_TURN = np.radians(60)
"""A path that turns by more than this from sample to sample must stop there."""
REST_SHARE = 0.25
"""A motion that starts at less than this share of its first step's speed starts at
rest."""


def stops_of(samples: FloatArray) -> npt.NDArray[np.bool_]:
    """Return which pose samples are standstills: cusps, corners and dwells.

    Parameters
    ----------
    samples : (n, 3) float, m, m, rad

    Returns
    -------
    is_stop : (n,) bool
    """
    chord = np.diff(samples, axis=0) * [1.0, 1.0, HEADING_LENGTH]
    length = np.linalg.norm(chord, axis=1)
    still = length < 1e-9
    stop = np.zeros(len(samples), dtype=bool)
    stop[:-1] |= still
    stop[1:] |= still
    dot = np.einsum("ij,ij->i", chord[:-1], chord[1:])
    sharp = dot < np.cos(STOP_TURN) * length[:-1] * length[1:]
    stop[1:-1] |= sharp & ~still[:-1] & ~still[1:]
    return stop


def starts_at_rest(
    t: FloatArray, samples: FloatArray, share: float = REST_SHARE
) -> bool:
    """Return whether samples leave their first one from rest.

    The speed there, by the parabola through three samples, is less than a share of that
    of the first step. A spline with a free end would swing backwards before such a
    start.

    Parameters
    ----------
    t : (n,) float, s
    samples : (n, 3) float, m, m, rad
    share : float, (0, 1)
        The smaller, the clearer.
    """
    if len(t) < 3:
        return False
    chord = np.diff(samples[:3], axis=0) * [1.0, 1.0, HEADING_LENGTH]
    first, second = chord / np.diff(t[:3])[:, None]
    at_start = first - (t[1] - t[0]) / (t[2] - t[0]) * (second - first)
    return bool(at_start @ first < share * (first @ first))


class PoseMotion:
    """Cubic splines through poses, at rest in every stop.

    Between two stops position and heading are C²; at a stop they start anew with zero
    speed, as a C² spline through a cusp would swing around it.

    Attributes `t` (n,), the coefficients `position` and `heading` (4, n - 1) of the
    cubics in the time since each sample, highest power first, and the described
    `point` tell all of it.
    """

    rest: npt.NDArray[np.bool_] | None = None
    """(2, n - 1) whether intervals start and end at rest; None: nowhere."""
    is_own = False
    has_rates = True
    interpolation = (
        "C² cubic splines of x, y and heading; at rest at cusps, corners and dwells"
    )

    def __init__(self, t: FloatArray, samples: FloatArray, point: complex) -> None:
        self.t = t
        self.point = point
        self.position = np.zeros((4, len(t) - 1), dtype=complex)
        self.heading = np.zeros((4, len(t) - 1))
        stop = stops_of(samples)
        stop[0] |= starts_at_rest(t, samples)
        stop[-1] |= starts_at_rest(-t[::-1], samples[::-1])
        self.rest = np.stack([stop[:-1], stop[1:]])
        bounds = sorted({0, len(t) - 1, *np.flatnonzero(stop).tolist()})
        for first, last in itertools.pairwise(bounds):
            run = slice(first, last + 1)
            ends = bool(stop[first]), bool(stop[last])
            part = slice(first, last)
            x, y, heading = np.moveaxis(spline(t[run], samples[run], *ends), 2, 0)
            self.position[:, part] = x + 1j * y
            self.heading[:, part] = heading

    @cached_property
    def since(self) -> FloatArray:
        """(n - 1,) s: how long after a rest intervals start, negative before it.

        Of those over which the twist is nearly a multiple of that time: it leaves less
        change, relative to its size, if divided by it. Elsewhere infinite.
        """
        t, middle = self.t, (self.t[1:] + self.t[:-1]) / 2
        h = middle - t[:-1]
        p1, p2 = _first(self.position, h), _second(self.position, h)
        h1, h2 = _first(self.heading, h), _second(self.heading, h)

        def change(rest: FloatArray) -> FloatArray:
            with np.errstate(divide="ignore", invalid="ignore"):
                pull = 1 / (middle - rest)
                left = np.abs(p2 - p1 * pull) + HEADING_LENGTH * np.abs(h2 - h1 * pull)
            return np.where(np.isfinite(left), left, np.inf)

        if self.rest is None:
            return np.full(middle.shape, np.inf)
        before = np.maximum.accumulate(np.where(self.rest[0], t[:-1], -np.inf))
        after = np.minimum.accumulate(np.where(self.rest[1], t[1:], np.inf)[::-1])[::-1]
        after = np.where(np.isfinite(after), after, -np.inf)
        options = np.stack([np.full(middle.shape, -np.inf), before, after])
        least = np.argmin([change(rest) for rest in options], axis=0)
        return np.asarray(t[:-1] - np.take_along_axis(options, least[None], axis=0)[0])

    def intervals(self) -> Intervals:
        """Return the intervals between the samples."""
        return Intervals(np.arange(len(self.t) - 1), self.t[:-1], self.t[1:])

    def poses_at(self, t: FloatArray) -> FloatArray:
        """Return the poses at times t, (n, 3)."""
        knot = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2)
        h = t - self.t[knot]
        p = _value(self.position[:, knot], h)
        return np.stack([p.real, p.imag, _value(self.heading[:, knot], h)], axis=-1)

    def enclose(self, parts: Intervals) -> Enclosure:
        """Return an enclosure of every part."""
        k, dt = parts.knot, parts.t1 - parts.t0
        position, heading = self.position[:, k], self.heading[:, k]
        h = np.stack([parts.t0, parts.t1]) - self.t[k]
        # Both ends at once, (2, m)
        p1, p2 = _first(position, h), _second(position, h)
        h0, h1, h2 = _value(heading, h), _first(heading, h), _second(heading, h)
        turn = np.exp(-1j * h0)
        v = turn * p1 - 1j * h1 * self.point
        v_dot = turn * (p2 - 1j * h1 * p1) - 1j * h2 * self.point
        p1_most, p2_most = np.abs(p1).max(axis=0), np.abs(p2).max(axis=0)
        h1_most, h2_most = np.abs(h1).max(axis=0), np.abs(h2).max(axis=0)
        p3, h3 = 6 * np.abs(position[0]), 6 * np.abs(heading[0])
        # The second derivative is linear, so its ends bound it; the first one bends.
        bent = dt**2 / 8
        p1_most, h1_most = p1_most + bent * p3, h1_most + bent * h3
        # d²/dt² (e^{-jθ} p') = e^{-jθ} (p''' - 2jθ'p'' - jθ''p' - θ'²p')
        turn2 = h2_most + h1_most**2  # of |dᵏ/dtᵏ e^{-jθ}|
        turn3 = h3 + 3 * h1_most * h2_most + h1_most**3
        v_ddot = p3 + 2 * h1_most * p2_most + turn2 * p1_most + h3 * abs(self.point)
        v_dddot = 3 * h1_most * p3 + 3 * turn2 * p2_most + turn3 * p1_most
        one, zero = np.ones_like(dt), np.zeros_like(dt)
        ends = v[0], v[1], h1[0], h1[1], v_dot[0], v_dot[1], h2[0], h2[1]
        bends = v_ddot, h3, v_dddot, zero
        swing = Swing(dt, h, k, self.swinging)
        return Enclosure(dt, *ends, *bends, one, one, one, one, swing)

    def swinging(self) -> Pieces:
        """Return the splines over a factor in which their directions swing evenly."""
        return self._pieces

    @cached_property
    def _pieces(self) -> Pieces:
        span, since = np.diff(self.t), self.since
        if self.rest is not None:
            since = np.where(self.rest.any(axis=0), np.inf, since)
        return Pieces(
            speed=factored(self.position, span, self.rest, since),
            turn=factored(self.heading, span, self.rest, since),
            since=since,
            heading=self.heading,
            point=self.point,
        )


def _value(cubic: npt.NDArray[Number], h: FloatArray) -> npt.NDArray[Number]:
    """Return the values of cubic pieces, (4, m), at h, (..., m)."""
    a, b, c, d = cubic
    values: npt.NDArray[Number] = ((a * h + b) * h + c) * h + d
    return values


def _first(cubic: npt.NDArray[Number], h: FloatArray) -> npt.NDArray[Number]:
    """Return the first derivatives of cubic pieces."""
    a, b, c, _ = cubic
    values: npt.NDArray[Number] = (3 * a * h + 2 * b) * h + c
    return values


def _second(cubic: npt.NDArray[Number], h: FloatArray) -> npt.NDArray[Number]:
    """Return the second derivatives of cubic pieces."""
    a, b, _, _ = cubic
    values: npt.NDArray[Number] = 6 * a * h + 2 * b
    return values
