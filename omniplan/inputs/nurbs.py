"""Rational B-splines (NURBS) in the plane and the smooth spans they consist of.

A curve is evaluated in homogeneous coordinates: ``C = A / w`` with the B-splines A of
the weighted control points and w of the weights. Between two knots it is smooth; a
tangent may break at a knot, and inside a span only where the speed ``|C'|`` is zero.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.interpolate import BSpline
from scipy.optimize import minimize_scalar

from configspace import Problem
from configspace.angles import wrap
from omniplan.errors import InvalidTrajectory
from omniplan.samples import MAX_VALUE, locked

__all__ = ["Labels", "Nurbs", "Span", "spans_of", "uniform_knots"]

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

MAX_DEGREE = 15
"""Above this degree rounding spoils the curve, and nobody draws such curves."""
BLUNT = 2e-5
"""Default length within which a tangent that turns far makes a cusp, m."""
SPLIT_TURN = np.radians(30)
"""A tangent that turns by more within such a length is broken."""
NEAR = 1e-5
"""How far beside a place without speed the tangent is taken, share of a span."""


@dataclass(frozen=True)
class Labels:
    """What an input calls the parts of a curve, for its errors."""

    points: str = "control_points"
    weights: str = "weights[{}]"
    knots: str = "knots"
    degree: str = "degree"


@dataclass(frozen=True, eq=False)
class Nurbs:
    """A clamped rational B-spline. Build one with `checked`."""

    points: FloatArray
    """(k, 2) control points, m."""
    weights: FloatArray
    """(k,) > 0."""
    knots: FloatArray
    """(k + degree + 1,) not decreasing; ends of multiplicity degree + 1."""
    degree: int

    @classmethod
    def checked(
        cls,
        points: FloatArray,
        weights: FloatArray | None,
        knots: FloatArray | None,
        degree: int,
        labels: Labels | None = None,
    ) -> Nurbs:
        """Return the curve of checked numbers, or raise.

        Parameters
        ----------
        points : (k, 2) float, m
        weights : (k,) float, > 0, optional
            Default 1.
        knots : (k + degree + 1,) float, optional
            Default uniform, from 0 to 1.
        degree : int, [1, 15]
        labels : Labels, optional

        Raises
        ------
        InvalidTrajectory
            With every mistake and its place.
        """
        labels = labels or Labels()
        k = len(points)
        weights = np.ones(k) if weights is None else weights
        problems = [*_point_problems(points, weights, labels)]
        if not 1 <= degree <= MAX_DEGREE:
            allowed = f"a whole number from 1 to {MAX_DEGREE}"
            problems.append(Problem(labels.degree, f"{degree}", allowed))
        elif k < degree + 1:
            allowed = f"at least {degree + 1} for degree {degree}"
            problems.append(Problem(labels.points, f"{k} points", allowed))
        else:
            knots = uniform_knots(k, degree) if knots is None else knots
            problems.extend(_knot_problems(knots, k, degree, labels.knots))
            if not problems:
                points, weights = locked(points.copy()), locked(weights.copy())
                return cls(points, weights, locked(knots.copy()), degree)
        raise InvalidTrajectory(problems)

    @cached_property
    def _splines(self) -> tuple[BSpline, BSpline]:
        """The homogeneous curve (w x, w y, w) and its derivative."""
        rows = np.column_stack([self.points, np.ones(len(self.points))])
        curve = BSpline(self.knots, rows * self.weights[:, None], self.degree)
        return curve, curve.derivative()

    def at(self, u: FloatArray) -> ComplexArray:
        """Return the points x + j y at parameters u."""
        x, y, w = np.moveaxis(self._splines[0](u), -1, 0)
        return np.asarray((x + 1j * y) / w)

    def derivative(self, u: FloatArray) -> ComplexArray:
        """Return dC/du = (A' - w' C) / w; at a knot that of the span behind it."""
        _, _, w = np.moveaxis(self._splines[0](u), -1, 0)
        dx, dy, dw = np.moveaxis(self._splines[1](u), -1, 0)
        return np.asarray((dx + 1j * dy - dw * self.at(u)) / w)

    def blend(self, values: FloatArray, u: FloatArray) -> FloatArray:
        """Return values of the control points, blended as the points are."""
        blended = BSpline(self.knots, values * self.weights, self.degree)(u)
        return np.asarray(blended / self._splines[0](u)[..., 2])


def uniform_knots(k: int, degree: int) -> FloatArray:
    """Return the clamped, equidistant knots from 0 to 1 of k control points."""
    inner = np.linspace(0.0, 1.0, k - degree + 1)
    return np.concatenate([np.zeros(degree), inner, np.ones(degree)])


def _point_problems(
    points: FloatArray, weights: FloatArray, labels: Labels
) -> Iterator[Problem]:
    if points.ndim != 2 or points.shape[1] != 2 or weights.shape != points.shape[:1]:
        given = f"points of shape {points.shape}, weights of shape {weights.shape}"
        yield Problem(labels.points, given, "shapes (k, 2) and (k,)")
        return
    for row in np.flatnonzero(~(np.abs(points) <= MAX_VALUE).all(axis=1)):
        x, y = points[row]
        allowed = f"must be finite, at most {MAX_VALUE:g} in size"
        yield Problem(f"{labels.points}[{row}]", f"({x:g}, {y:g})", allowed)
    for row in np.flatnonzero(~((weights > 0) & (weights <= MAX_VALUE))):
        allowed = f"must be positive, at most {MAX_VALUE:g}"
        yield Problem(labels.weights.format(row), f"{weights[row]:g}", allowed)
    if (weights > 0).all() and weights.max(initial=1) > MAX_VALUE * weights.min(
        initial=1
    ):
        given = f"weights from {weights.min():g} to {weights.max():g}"
        yield Problem(labels.points, given, f"a ratio of at most {MAX_VALUE:g}")


def _knot_problems(
    knots: FloatArray, k: int, degree: int, label: str
) -> Iterator[Problem]:
    needed = k + degree + 1
    if knots.shape != (needed,):
        given = f"{knots.size} knots"
        allowed = f"{needed}: {k} control points + degree {degree} + 1"
        yield Problem(label, given, allowed)
        return
    wild = np.flatnonzero(~(np.abs(knots) <= MAX_VALUE))
    if wild.size:
        allowed = f"must be finite, at most {MAX_VALUE:g} in size"
        yield Problem(f"{label}[{wild[0]}]", f"{knots[wild[0]]:g}", allowed)
        return
    back = np.flatnonzero(np.diff(knots) < 0)
    if back.size:
        row = int(back[0]) + 1
        given = f"{knots[row]:g} after {knots[row - 1]:g}"
        yield Problem(f"{label}[{row}]", given, "must not decrease")
        return
    values, counts = np.unique(knots, return_counts=True)
    for end, word in ((0, "first"), (-1, "last")):
        if counts[end] != degree + 1:
            given = f"the {word} knot, {values[end]:g}, {counts[end]} times"
            yield Problem(label, given, f"{degree + 1} times: degree + 1 (clamped)")
    for value in values[1:-1][counts[1:-1] > degree]:
        count = int(counts[values == value][0])
        given = f"the inner knot {value:g} {count} times"
        yield Problem(label, given, f"at most {degree} times: the degree")


@dataclass(frozen=True, eq=False)
class Span:
    """A smooth part of a curve with the vehicle's heading along it; w in [0, 1]."""

    curve: Nurbs
    u0: float
    u1: float
    orientation: float | FloatArray
    """rad: heading relative to the tangent or, if global, to the x axis; an array:
    the global heading at every control point."""
    is_global: bool
    clear: tuple[float, float] = (0.0, 1.0)
    """The w between which the tangent is taken: beside a blunt cusp it has none."""

    @property
    def is_straight(self) -> bool:
        """Whether x, y and θ are straight."""
        return self.curve.degree == 1 and not isinstance(self.orientation, np.ndarray)

    def _parameter(self, w: FloatArray) -> FloatArray:
        """Return u, kept off the end: derivatives there belong to the next span."""
        u = self.u0 + np.clip(w, 0.0, 1.0) * (self.u1 - self.u0)
        return np.minimum(u, np.nextafter(self.u1, self.u0))

    def at(self, w: FloatArray) -> ComplexArray:
        """Return the points x + j y."""
        return self.curve.at(self.u0 + np.clip(w, 0.0, 1.0) * (self.u1 - self.u0))

    def velocity(self, w: FloatArray) -> ComplexArray:
        """Return d(x + j y)/dw."""
        u = self._parameter(w)
        return self.curve.derivative(u) * (self.u1 - self.u0)

    def direction(self, w: FloatArray) -> ComplexArray:
        """Return the unit tangent; at an end without speed its limit there."""
        w = np.clip(np.asarray(w, dtype=np.float64), *self.clear)
        tangent = self.velocity(w)
        at_end = (w < NEAR) | (w > 1 - NEAR)
        slow = at_end & (np.abs(tangent) < 1e-3 * self._top_speed)
        if slow.any():
            inward = np.where(w < 0.5, NEAR, -NEAR)
            near, far = (_unit(self.velocity(np.rint(w) + k * inward)) for k in (1, 2))
            tangent = np.where(slow, 2 * near - far, tangent)
        return _unit(tangent)

    def poses(self, w: FloatArray) -> FloatArray:
        """Return (x, y, θ), the heading unwrapped along the span; (m, 3)."""
        w = np.asarray(w, dtype=np.float64)
        u = self.u0 + w * (self.u1 - self.u0)
        point = self.curve.at(u)
        if isinstance(self.orientation, np.ndarray):
            heading = self.curve.blend(self.orientation, u)
        elif self.is_global:
            heading = np.full(w.shape, self.orientation)
        else:
            heading = self._course(w) + self.orientation
        return np.stack([point.real, point.imag, heading], axis=-1)

    def _course(self, w: FloatArray) -> FloatArray:
        """Return the unwrapped angle of the tangent."""
        at, course = self._courses
        near = np.interp(w, at, course)
        return near + wrap(np.angle(self.direction(w)) - near)

    @cached_property
    def _top_speed(self) -> float:
        return float(np.abs(self.velocity(np.linspace(0, 1, 65))).max())

    @cached_property
    def _courses(self) -> tuple[FloatArray, FloatArray]:
        """Places and unwrapped angles of the tangent, close enough to be clear."""
        w = np.linspace(0.0, 1.0, 33)
        for _ in range(48):
            angle = np.angle(self.direction(w))
            step = wrap(np.diff(angle))
            wide = np.flatnonzero(np.abs(step) > 0.5)
            if not wide.size:
                return w, np.concatenate([angle[:1], angle[0] + np.cumsum(step)])
            w = np.insert(w, wide + 1, (w[wide] + w[wide + 1]) / 2)
        x, y = self.curve.points.mean(axis=0)
        raise InvalidTrajectory(
            Problem(f"curve near ({x:g}, {y:g})", "a tangent that jumps", "smooth")
        )


def _unit(values: ComplexArray) -> ComplexArray:
    return np.asarray(values / np.maximum(np.abs(values), 1e-300))


def spans_of(
    curve: Nurbs,
    orientation: float | FloatArray,
    is_global: bool,
    blunt: float = BLUNT,
) -> list[Span]:
    """Return the smooth spans of a curve, cut at knots and at cusps inside.

    Parameters
    ----------
    curve : Nurbs
    orientation : float or (k,) float, rad
        See `Span.orientation`.
    is_global : bool
    blunt : float, m
        A tangent that turns far within this length makes a cusp.
    """
    spans = []
    for u0, u1 in pairwise(np.unique(curve.knots).tolist()):
        width = u1 - u0
        cusps = _cusps(Span(curve, u0, u1, orientation, is_global), blunt)
        cuts = [(u0, 0.0), *((u0 + w * width, z * width) for w, z in cusps), (u1, 0.0)]
        for (a, zone_a), (b, zone_b) in pairwise(cuts):
            clear = zone_a / (b - a), 1 - zone_b / (b - a)
            spans.append(Span(curve, a, b, orientation, is_global, clear))
    return spans


def _cusps(span: Span, blunt: float) -> Iterator[tuple[float, float]]:
    """Yield where the tangent breaks inside, and how far beside it has no meaning."""

    def speed(w: float) -> float:
        return float(np.abs(span.velocity(np.array([w])))[0])

    grid = np.linspace(0.0, 1.0, 32 * span.curve.degree + 1)
    slow = np.abs(span.velocity(grid))
    if not slow.max() > 0:  # coincident control points
        return
    least = np.flatnonzero((slow[1:-1] <= slow[:-2]) & (slow[1:-1] <= slow[2:])) + 1
    for at in least:
        bounds = float(grid[at - 1]), float(grid[at + 1])
        w = minimize_scalar(
            speed, bounds=bounds, method="bounded", options={"xatol": 1e-12}
        ).x
        zone = _reach(span, float(w), blunt)
        before, behind = span.velocity(np.array([w - zone, w + zone]))
        if abs(np.angle(behind * before.conjugate())) > SPLIT_TURN:
            is_sharp = speed(w) < 1e-9 * slow.max()
            yield float(w), 0.0 if is_sharp else zone


def _reach(span: Span, w: float, length: float) -> float:
    """Return how far w may move either way with the point within a length."""
    reach = NEAR
    while reach < 0.01:
        here, *beside = span.at(np.array([w, w - 2 * reach, w + 2 * reach]))
        if max(abs(point - here) for point in beside) > length:
            break
        reach *= 2
    return reach
