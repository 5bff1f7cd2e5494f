"""VDA 5050 orders as paths.

The whole route is read, base and horizon. The vehicle stops where the base ends, at
nodes and edges with actions during which it must not drive, and where the direction
of travel or the heading jumps; there it turns on the spot.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path as FilePath
from typing import Literal, NoReturn

import numpy as np
import numpy.typing as npt

from configspace import Problem
from configspace.files import reason_of
from omniplan.errors import InvalidTrajectory
from omniplan.inputs.nurbs import Labels, Nurbs
from omniplan.inputs.route import Line, Route, Tolerance
from omniplan.inputs.vda5050_order import Curve, Order, order_from_data
from omniplan.path import Path
from omniplan.samples import unwrapped

__all__ = ["path_of_order", "read_orders"]

FloatArray = npt.NDArray[np.float64]

NODE_SLACK = 0.01
"""How far a trajectory may miss its node beyond the allowed deviation, m."""
LEAST_EDGE = 1e-5
"""A shorter edge leads nowhere, m."""


def read_orders(
    file: str | FilePath,
    *,
    reference_point: tuple[float, float] = (0.0, 0.0),
    tolerance: Tolerance | None = None,
) -> tuple[Path, ...]:
    """Read a JSON file with one VDA 5050 order or a list of them.

    Parameters
    ----------
    file : str or Path
    reference_point : (float, float), m
        The vehicle's control point, in its file's frame.
    tolerance : Tolerance, optional
        How closely the poses follow the curves.

    Raises
    ------
    InvalidTrajectory
        If the file cannot be read or an order has mistakes; with the JSON path.
    """
    file = FilePath(file)
    try:
        data = json.loads(file.read_text("utf-8-sig"), parse_constant=_no_number)
    except RecursionError as error:
        raise InvalidTrajectory(
            Problem(f"{file}", "nested too deeply", "a JSON file, UTF-8")
        ) from error
    except (OSError, ValueError) as error:
        raise InvalidTrajectory(
            Problem(f"{file}", reason_of(error), "a JSON file, UTF-8")
        ) from error
    orders = data if isinstance(data, list) else [data]
    if not orders:
        raise InvalidTrajectory(Problem(f"{file}", "no order", "at least one"))
    paths = []
    for i, order in enumerate(orders):
        where = f"{file}[{i}]" if isinstance(data, list) else f"{file}"
        try:
            path = path_of_order(
                order, reference_point=reference_point, tolerance=tolerance
            )
        except InvalidTrajectory as error:
            raise InvalidTrajectory(
                error.problems, f"VDA 5050 order {where}"
            ) from error
        paths.append(path)
    return tuple(paths)


def _no_number(text: str) -> NoReturn:
    raise ValueError(f"{text} is not a JSON number")


def path_of_order(
    data: object,
    *,
    reference_point: tuple[float, float] = (0.0, 0.0),
    tolerance: Tolerance | None = None,
) -> Path:
    """Return the path of a VDA 5050 order, named by its ``orderId``.

    Parameters
    ----------
    data : dict
        The order as JSON data, version 2.x or 3.x.
    reference_point : (float, float), m
    tolerance : Tolerance, optional

    Raises
    ------
    InvalidTrajectory
        With every mistake and its JSON path.

    References
    ----------
    VDA 5050, 3.0.0, 7.3.
    """
    order = order_from_data(data)
    tolerance = tolerance or Tolerance()
    route = Route(tolerance)
    for i, way in enumerate(_ways(order, tolerance)):
        if i and _stops_at(order, i):
            route.stop()
        _drive(route, order, i, way)
    last = order.nodes[-1].position
    if last is not None and last.theta is not None:
        route.face(last.theta, complex(last.x, last.y), last.turn or 0.0)
    made = route.sampled()
    return Path.from_poses(
        made.poses,
        name=order.order_id,
        reference_point=reference_point,
        max_speed=made.max_speed,
        max_yaw_rate=made.max_yaw_rate,
        stops=made.stops,
    )


@dataclass(frozen=True, eq=False)
class _Way:
    """The geometry of an edge: a curve, or a straight line between its ends."""

    start: complex
    end: complex
    curve: Nurbs | None
    headings: FloatArray | None
    """(k,) rad: global headings of the control points."""


def _ways(order: Order, tolerance: Tolerance) -> list[_Way]:
    """Return where every edge leads, or raise with all mistakes."""
    problems: list[Problem] = []
    curves: list[tuple[Nurbs, FloatArray | None] | None] = []
    for i, edge in enumerate(order.edges):
        curves.append(None)
        if edge.curve is not None:
            try:
                curves[i] = _curve(edge.curve, f"edges[{i}].trajectory")
            except InvalidTrajectory as error:
                problems.extend(error.problems)
    if problems:
        raise InvalidTrajectory(problems)
    ways = []
    for i, curve in enumerate(curves):
        start, end = (_end(order, curves, i, side) for side in (0, 1))
        if curve is None and abs(end - start) < LEAST_EDGE:
            given = f"{abs(end - start):g} m from node to node"
            problems.append(Problem(f"edges[{i}]", given, "must lead somewhere"))
        if curve is not None:
            problems.extend(_misses(order, i, start, end))
        ways.append(_Way(start, end, *(curve or (None, None))))
    for i, (before, behind) in enumerate(pairwise(ways)):
        gap = abs(behind.start - before.end)
        if gap > tolerance.position:
            given = f"begins {gap:g} m from the end of edges[{i}]"
            allowed = f"at most {tolerance.position:g} m"
            where = f"edges[{i + 1}].trajectory.controlPoints[0]"
            problems.append(Problem(where, given, allowed))
    if problems:
        raise InvalidTrajectory(problems)
    return ways


def _curve(curve: Curve, where: str) -> tuple[Nurbs, FloatArray | None]:
    """Return the NURBS of an edge and the headings of its control points."""
    labels = Labels(
        f"{where}.controlPoints",
        f"{where}.controlPoints[{{}}].weight",
        f"{where}.knotVector",
        f"{where}.degree",
    )
    nurbs = Nurbs.checked(
        np.array([(p.x, p.y) for p in curve.points]).reshape(-1, 2),
        np.array([1.0 if p.weight is None else p.weight for p in curve.points]),
        None if curve.knots is None else np.array(curve.knots),
        1 if curve.degree is None else curve.degree,
        labels,
    )
    given = [p.orientation for p in curve.points if p.orientation is not None]
    if not given:
        return nurbs, None
    if len(given) < len(curve.points):
        missing = [p.orientation for p in curve.points].index(None)
        raise InvalidTrajectory(
            Problem(
                f"{where}.controlPoints[{missing}].orientation",
                "missing",
                "all control points have one, or none has",
            )
        )
    return nurbs, unwrapped(np.array(given))


def _end(
    order: Order,
    curves: Sequence[tuple[Nurbs, FloatArray | None] | None],
    edge: int,
    side: Literal[0, 1],
) -> complex:
    """Return where an edge begins (0) or ends (1).

    A straight edge meets the trajectory beside it; else it ends at the node.
    """
    beside = edge + (1 if side else -1)
    for at, row in ((edge, -side), (beside, side - 1)):
        curve = curves[at] if 0 <= at < len(curves) else None
        if curve is not None:
            x, y = curve[0].points[row]
            return complex(x, y)
    position = order.nodes[edge + side].position
    assert position is not None
    return complex(position.x, position.y)


def _misses(order: Order, edge: int, *ends: complex) -> Iterator[Problem]:
    """Yield the ends of a trajectory that are too far from their nodes."""
    points = order.edges[edge].curve
    assert points is not None
    for side, end in enumerate(ends):
        position = order.nodes[edge + side].position
        excess = 0.0 if position is None else position.excess(end)
        if excess > NODE_SLACK:
            row = side * (len(points.points) - 1)
            yield Problem(
                f"edges[{edge}].trajectory.controlPoints[{row}]",
                f"({end.real:g}, {end.imag:g}) is {excess:g} m outside of "
                f"nodes[{edge + side}] and its allowedDeviationXY",
                f"at most {NODE_SLACK:g} m",
            )


def _drive(route: Route, order: Order, i: int, way: _Way) -> None:
    """Add an edge to the route, and the heading its first node asks for."""
    edge, node = order.edges[i], order.nodes[i].position
    is_global = edge.orientation_type == "GLOBAL"
    orientation = edge.orientation or 0.0
    if way.curve is None:
        course = float(np.angle(way.end - way.start))
        heading = orientation if is_global else course + orientation
        departing = heading
    elif way.headings is not None:
        departing = float(way.headings[0])
    else:
        first = route.spans(way.curve, orientation, is_global)[0]
        departing = float(first.poses(np.zeros(1))[0, 2])
    if node is not None and node.theta is not None:
        route.face(node.theta, way.start, node.turn or 0.0, departing)
    caps = {
        "max_speed": np.inf if edge.max_speed is None else edge.max_speed,
        "max_yaw_rate": np.inf if edge.max_yaw_rate is None else edge.max_yaw_rate,
    }
    if way.curve is None:
        route.add(Line(way.start, way.end, heading), **caps)
        return
    turn = orientation if way.headings is None else way.headings
    try:
        route.follow(way.curve, turn, is_global, **caps)
    except InvalidTrajectory as error:
        raise InvalidTrajectory(error.problems, f"edges[{i}].trajectory") from error


def _stops_at(order: Order, i: int) -> bool:
    """Return whether the vehicle must stand at a node between two edges."""
    node, edge = order.nodes[i], order.edges[i]
    is_end_of_base = node.released and not edge.released
    actions = [*(node.actions or ()), *(edge.actions or ())]
    return is_end_of_base or any(action.stops for action in actions)
