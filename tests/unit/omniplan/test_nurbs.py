"""NURBS: the curve, its heading, and the poses that are made of it."""

import itertools
import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from naive_nurbs import blended
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree

from omniplan import InvalidTrajectory
from omniplan.inputs.nurbs import Nurbs, spans_of, uniform_knots
from omniplan.motion import stops_of
from omniplan.path import Path

FloatArray = npt.NDArray[np.float64]

HALF = math.sqrt(0.5)
SQUARE = [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]]
CIRCLE: dict[str, Any] = {
    "control_points": SQUARE,
    "weights": [1, HALF, 1, HALF, 1, HALF, 1, HALF, 1],
    "knots": [0, 0, 0, 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1, 1, 1],
    "degree": 2,
}
"""The unit circle as four rational quadratics: Piegl/Tiller, Ex. 7.2."""
S_CURVE: list[list[float]] = [[0, 0], [2, 0], [1, 1], [3, 1], [4, 3], [6, 2]]
CUSP = [[0, 0], [1, 1], [0, 1], [1, 0]]
"""A cubic with a cusp at u = 1/2, in (0.5, 0.75)."""


def spline_of(path: Path, first: int, last: int) -> Callable[[FloatArray], FloatArray]:
    u = path.parameter[first : last + 1]
    poses = path.poses[first : last + 1]
    ends: Any = "not-a-knot" if len(u) > 3 else "natural"
    spline = CubicSpline(u, poses, bc_type=ends)
    return lambda share: np.asarray(spline(u[0] + share * (u[-1] - u[0])))


def bounds_of(path: Path) -> list[int]:
    stop = path.stops | stops_of(path.poses)
    return sorted({0, len(path.poses) - 1, *np.flatnonzero(stop).tolist()})


def largest_gap(path: Path, curve: FloatArray) -> tuple[float, float]:
    """Return how far the splines are off a dense curve (x, y, θ): m, rad.

    From the nearest point of the curve the foot is found along its tangent.
    """
    tree = cKDTree(curve[:, :2])
    slope = np.gradient(curve, axis=0)
    length = np.hypot(slope[:, 0], slope[:, 1])
    position, heading = [0.0], [0.0]
    for first, last in itertools.pairwise(bounds_of(path)):
        dense = spline_of(path, first, last)(np.linspace(0, 1, 4001))
        at = np.asarray(tree.query(dense[:, :2])[1])
        gap = dense - curve[at]
        tangent = slope[at] / length[at, None]
        along = gap[:, 0] * tangent[:, 0] + gap[:, 1] * tangent[:, 1]
        off = gap[:, 1] * tangent[:, 0] - gap[:, 0] * tangent[:, 1]
        turn = gap[:, 2] - along * tangent[:, 2]
        position.append(float(np.abs(off).max()))
        heading.append(float(np.abs(np.angle(np.exp(1j * turn))).max()))
    return max(position), max(heading)


def dense_curve(
    points: Any, weights: Any, knots: Any, degree: int, n: int = 200_001
) -> tuple[FloatArray, FloatArray]:
    """Return positions (n, 2) and tangents (n,), these by differences."""
    curve = Nurbs.checked(
        np.array(points, dtype=float),
        None if weights is None else np.array(weights, dtype=float),
        None if knots is None else np.array(knots, dtype=float),
        degree,
    )
    p = curve.at(np.linspace(0, 1, n))
    tangent = np.unwrap(np.angle(np.gradient(p, edge_order=2)))
    return np.stack([p.real, p.imag], axis=-1), tangent


def test_the_circle_is_exact() -> None:
    circle = Nurbs.checked(
        np.array(SQUARE, dtype=float),
        np.array(CIRCLE["weights"]),
        np.array(CIRCLE["knots"]),
        2,
    )
    u = np.linspace(0, 1, 1001)
    assert np.abs(np.abs(circle.at(u)) - 1).max() < 1e-15 * 4
    # The tangent stands on the radius.
    radial = (circle.derivative(u) * circle.at(u).conj()).real
    assert np.abs(radial).max() < 1e-12


def test_a_circle_becomes_a_full_turn_without_stops() -> None:
    path = Path.from_nurbs(**CIRCLE)
    assert not path.stops.any()
    assert not stops_of(path.poses).any()
    assert path.poses[0] == pytest.approx([1, 0, math.pi / 2])
    assert path.poses[-1] == pytest.approx([1, 0, 5 * math.pi / 2])
    dense = spline_of(path, 0, len(path.poses) - 1)(np.linspace(0, 1, 10_001))
    angle = np.unwrap(np.arctan2(dense[:, 1], dense[:, 0]))
    assert np.abs(np.hypot(dense[:, 0], dense[:, 1]) - 1).max() < 1e-4
    assert np.abs(dense[:, 2] - angle - math.pi / 2).max() < 1e-4


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-5])
@pytest.mark.parametrize("degree", [2, 3, 5])
def test_the_spline_keeps_to_the_curve(tolerance: float, degree: int) -> None:
    path = Path.from_nurbs(
        S_CURVE,
        [1, 2, 0.5, 1, 3, 1],
        degree=degree,
        orientation=0.3,
        tolerance=tolerance,
        heading_tolerance=tolerance,
    )
    xy, tangent = dense_curve(S_CURVE, [1, 2, 0.5, 1, 3, 1], None, degree)
    curve = np.column_stack([xy, tangent + 0.3])
    position, heading = largest_gap(path, curve)
    spacing = np.hypot(*np.diff(xy, axis=0).T).max()
    assert position <= tolerance + spacing**2
    # Where the curvature jumps, the dense tangents tell no more than a step does.
    assert heading <= tolerance + (spacing if degree == 2 else 1e-6)
    assert not path.stops.any()


def test_a_closer_tolerance_takes_more_poses_and_a_loose_one_few() -> None:
    sizes = [
        len(Path.from_nurbs(S_CURVE, degree=3, tolerance=t, heading_tolerance=t).poses)
        for t in (1e-2, 1e-4, 1e-6)
    ]
    assert sizes == sorted(set(sizes))
    assert sizes[1] < 200


def test_a_straight_curve_needs_its_ends_only() -> None:
    path = Path.from_nurbs([[0, 0], [1, 1]])
    assert path.poses.tolist() == pytest.approx(
        np.array([[0, 0, math.pi / 4], [1, 1, math.pi / 4]])
    )


def test_global_orientation_keeps_the_heading() -> None:
    path = Path.from_nurbs(
        S_CURVE, degree=3, orientation=0.7, orientation_type="GLOBAL"
    )
    assert np.abs(path.poses[:, 2] - 0.7).max() == 0


def test_headings_of_control_points_are_blended_like_the_points() -> None:
    headings = [3.0, -3.0, -2.0, -1.0, 0.0, 1.0]
    weights = [1.0, 2.0, 0.5, 1.0, 3.0, 1.0]
    path = Path.from_nurbs(S_CURVE, weights, degree=3, orientation=headings)
    joined = np.unwrap(headings)
    knots = uniform_knots(6, 3)
    u = np.linspace(0, 1, 2001)
    curve = np.array(
        [
            [
                blended([p[0] for p in S_CURVE], weights, knots.tolist(), 3, at),
                blended([p[1] for p in S_CURVE], weights, knots.tolist(), 3, at),
                blended(joined.tolist(), weights, knots.tolist(), 3, at),
            ]
            for at in u
        ]
    )
    assert path.poses[0, 2] == 3.0
    assert path.poses[-1, 2] == pytest.approx(joined[-1])
    position, heading = largest_gap(path, curve)
    assert position < 1.05e-4
    assert heading < 1.05e-4


def test_a_corner_is_a_stop_and_a_turn_on_the_spot() -> None:
    path = Path.from_nurbs([[0, 0], [1, 0], [1, 1]])
    at = np.flatnonzero(path.stops)
    assert path.poses[at] == pytest.approx(
        np.array([[1, 0, 0], [1, 0, math.pi / 2]]), abs=1e-9
    )


def test_a_corner_under_global_orientation_is_one_stop() -> None:
    path = Path.from_nurbs([[0, 0], [1, 0], [1, 1]], orientation_type="GLOBAL")
    assert path.stops.tolist() == [False, True, False]


def test_a_corner_within_the_tolerance_is_driven_through() -> None:
    bend: list[list[float]] = [[0, 0], [1, 0], [2, 0.04]]
    assert Path.from_nurbs(bend).stops.any()
    loose = Path.from_nurbs(bend, heading_tolerance=0.1, tolerance=0.01)
    assert not loose.stops.any()


@pytest.mark.parametrize("orientation", [0.0, math.pi, -1.0])
def test_at_a_cusp_the_vehicle_stops_and_backs(orientation: float) -> None:
    path = Path.from_nurbs(CUSP, degree=3, orientation=orientation)
    (at,) = np.flatnonzero(path.stops)
    heading = math.pi / 2 + orientation
    assert path.poses[at] == pytest.approx([0.5, 0.75, heading], abs=1e-6)
    # The heading goes on without a jump: what was driven forwards is driven backwards.
    assert np.abs(np.diff(path.poses[:, 2])).max() < 0.4
    into = path.poses[at] - path.poses[at - 1]
    out = path.poses[at + 1] - path.poses[at]
    assert into[:2] @ out[:2] < 0


def test_a_curve_that_goes_straight_back_stops_and_backs() -> None:
    path = Path.from_nurbs([[0, 0], [5, 0], [1, 0]])
    assert path.stops.tolist() == [False, True, False]
    assert (path.poses[:, 2] == 0).all()


def test_full_multiplicity_inside_may_be_smooth_or_a_corner() -> None:
    knots = [0, 0, 0, 0.5, 0.5, 1, 1, 1]
    smooth = Path.from_nurbs([[0, 0], [1, 0], [2, 0], [4, 0], [5, 1]], None, knots, 2)
    assert not smooth.stops.any()
    broken = Path.from_nurbs([[0, 0], [1, 0], [2, 0], [2, 1], [3, 1]], None, knots, 2)
    assert broken.stops.sum() == 2
    assert broken.poses[broken.stops][:, :2].tolist() == [[2, 0], [2, 0]]


def test_coincident_control_points_do_not_stop_a_smooth_curve() -> None:
    path = Path.from_nurbs([[0, 0], [0, 0], [1, 0], [1, 1]], degree=3)
    assert not path.stops.any()
    assert path.poses[0] == pytest.approx([0, 0, 0], abs=1e-6)
    assert path.poses[-1, 2] == pytest.approx(math.pi / 2)


def test_a_line_that_joins_an_arc_keeps_the_tolerance() -> None:
    points: list[list[float]] = [[0, 0], [1, 0], [2, 0], [3, 0], [3, 1]]
    weights = [1, 1, 1, HALF, 1]
    knots = [0, 0, 0, 0.5, 0.5, 1, 1, 1]
    path = Path.from_nurbs(points, weights, knots, 2)
    assert not path.stops.any()
    share = np.linspace(0, 1, 40_001)
    dense = spline_of(path, 0, len(path.poses) - 1)(share)
    straight = dense[:, 0] <= 2
    off = np.where(
        straight,
        np.abs(dense[:, 1]),
        np.abs(np.hypot(dense[:, 0] - 2, dense[:, 1] - 1) - 1),
    )
    tangent = np.where(straight, 0, np.arctan2(dense[:, 0] - 2, 1 - dense[:, 1]))
    assert off.max() < 1e-4
    assert np.abs(dense[:, 2] - tangent).max() < 1e-4


def test_spans_end_at_knots_and_cusps() -> None:
    curve = Nurbs.checked(np.array(CUSP, dtype=float), None, None, 3)
    spans = spans_of(curve, 0.0, False)
    assert [(s.u0, s.u1) for s in spans] == [(0, pytest.approx(0.5)), (spans[0].u1, 1)]


POINTS = [[0, 0], [1, 0], [2, 1], [3, 1]]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"knots": [0, 0, 0, 1, 1, 1]}, "knots: 6 knots; 7: 4 control points + degree"),
        ({"knots": [0, 0, 0, 0.5, 1, 1, 0.9]}, "knots[6]: 0.9 after 1; must not"),
        ({"knots": [0, 0, 0.1, 0.5, 1, 1, 1]}, "the first knot, 0, 2 times; 3 times"),
        ({"knots": [0, 0, 0, 0.5, 0.9, 1, 1]}, "the last knot, 1, 2 times; 3 times"),
        ({"knots": [0, 0, 0, math.nan, 1, 1, 1]}, "knots[3]: nan; must be finite"),
        ({"weights": [1, 0, 1, 1]}, "weights[1]: 0; must be positive"),
        ({"weights": [1, 1, -2, 1]}, "weights[2]: -2; must be positive"),
        ({"weights": [1, 1, math.nan, 1]}, "weights[2]: nan"),
        ({"weights": [1, 1, 1]}, "weights of shape (3,)"),
        ({"weights": [1e-4, 1e4, 1, 1]}, "a ratio of at most 1e+06"),
        ({"degree": 0}, "degree: 0; a whole number from 1 to 15"),
        ({"degree": 4}, "control_points: 4 points; at least 5 for degree 4"),
        ({"degree": 16}, "degree: 16"),
        ({"degree": 2.0}, "degree: 2.0; a whole number"),
        ({"degree": True}, "degree: True; a whole number"),
        (
            {"control_points": [[0, 0], [math.nan, 0], [1, 1]]},
            "control_points[1]: (nan",
        ),
        (
            {"control_points": [[0, 0, 0], [1, 0, 0], [1, 1, 1]]},
            "points of shape (3, 3)",
        ),
        ({"control_points": [[0, 0], [0, 0], [0, 0]]}, "no length"),
        ({"control_points": "abc"}, "must be a number"),
        ({"orientation": [0, 0]}, "one number, or 4"),
        ({"orientation": math.nan}, "orientation: nan"),
        ({"orientation_type": "LOCAL"}, "TANGENTIAL or GLOBAL"),
        ({"tolerance": 0.0}, "tolerance.position: 0.0"),
        ({"heading_tolerance": math.nan}, "tolerance.heading: nan"),
        ({"max_speed": 0.0}, "max_speed: 0; must be positive"),
    ],
)
def test_mistakes_are_refused_with_their_place(
    options: dict[str, Any], message: str
) -> None:
    with pytest.raises(InvalidTrajectory, match=re.escape(message)):
        Path.from_nurbs(**{"control_points": POINTS, "degree": 2, **options})


def test_inner_knots_may_not_break_the_curve() -> None:
    points = [*POINTS, [4, 1], [5, 1]]
    with pytest.raises(InvalidTrajectory, match=r"inner knot 0.5 3 times; at most 2"):
        Path.from_nurbs(points, None, [0, 0, 0, 0.5, 0.5, 0.5, 1, 1, 1], 2)


def test_all_mistakes_are_told_at_once() -> None:
    with pytest.raises(InvalidTrajectory) as caught:
        Path.from_nurbs(POINTS, [0, 1, -1, 1], [0, 0, 0, 1, 1, 1], 2)
    assert len(caught.value.problems) == 3
