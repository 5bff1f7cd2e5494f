"""VDA 5050 orders: what is read from them, and what is refused with its JSON path."""

import copy
import json
import math
import re
from collections.abc import Callable
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pytest

from omniplan import InvalidTrajectory, read_trajectories
from omniplan.inputs.route import Tolerance
from omniplan.inputs.vda5050 import path_of_order, read_orders
from omniplan.path import Path

Json = dict[str, Any]
HALF = math.sqrt(0.5)


def node(i: int, x: float, y: float, **more: Any) -> Json:
    position = {"x": x, "y": y, "mapId": "hall", **more}
    return {
        "nodeId": f"n{i}",
        "sequenceId": 2 * i,
        "released": True,
        "nodePosition": position,
        "actions": [],
    }


def edge(i: int, **more: Any) -> Json:
    return {
        "edgeId": f"e{i}",
        "sequenceId": 2 * i + 1,
        "released": True,
        "actions": [],
        **more,
    }


def order(nodes: list[Json], edges: list[Json], **more: Any) -> Json:
    return {
        "headerId": 1,
        "timestamp": "2026-01-01T00:00:00.000Z",
        "version": "3.0.0",
        "manufacturer": "KIT",
        "serialNumber": "0001",
        "orderId": "order-7",
        "orderUpdateId": 0,
        "nodes": nodes,
        "edges": edges,
        **more,
    }


def straight(*points: tuple[float, float], **more: Any) -> Json:
    nodes = [node(i, *point) for i, point in enumerate(points)]
    return order(nodes, [edge(i, **more) for i in range(len(points) - 1)])


ARC: Json = {
    "degree": 2,
    "knotVector": [0, 0, 0, 1, 1, 1],
    "controlPoints": [
        {"x": 2, "y": 0},
        {"x": 3, "y": 0, "weight": HALF},
        {"x": 3, "y": 1, "weight": 1.0},
    ],
}
"""A quarter of a circle about (2, 1), radius 1."""


def with_arc(**more: Any) -> Json:
    """A straight edge, the arc and a straight edge, all tangential."""
    nodes = [node(0, 0, 0), node(1, 2, 0), node(2, 3, 1), node(3, 3, 3)]
    return order(
        nodes, [edge(0), edge(1, trajectory=copy.deepcopy(ARC)), edge(2)], **more
    )


def test_straight_edges_in_a_line_are_driven_without_stops() -> None:
    path = path_of_order(straight((0, 0), (1, 1), (3, 3)))
    assert path.name == "order-7"
    assert path.poses == pytest.approx(
        np.array([[0, 0, math.pi / 4], [1, 1, math.pi / 4], [3, 3, math.pi / 4]])
    )
    assert not path.stops.any()
    assert path.max_speed is None


def test_the_vehicle_turns_on_the_spot_where_the_route_bends() -> None:
    path = path_of_order(straight((0, 0), (1, 0), (1, 2)))
    assert path.poses[path.stops] == pytest.approx(
        np.array([[1, 0, 0], [1, 0, math.pi / 2]])
    )
    assert path.poses[-1] == pytest.approx([1, 2, math.pi / 2])


def test_a_smooth_route_of_lines_and_an_arc_has_no_stops() -> None:
    path = path_of_order(with_arc())
    assert not path.stops.any()
    x, y, theta = path.poses.T
    on_arc = (x > 2 + 1e-9) & (y < 1 - 1e-9)
    assert on_arc.sum() > 5
    assert np.hypot(x - 2, y - 1)[on_arc] == pytest.approx(np.ones(on_arc.sum()))
    assert theta[0] == 0
    assert path.poses[-1] == pytest.approx([3, 3, math.pi / 2])


@pytest.mark.parametrize(
    "keys",
    [("maximumSpeed", "maximumRotationSpeed"), ("maxSpeed", "maxRotationSpeed")],
)
def test_caps_of_an_edge_hold_on_its_pieces(keys: tuple[str, str]) -> None:
    data = with_arc()
    data["edges"][1] |= {keys[0]: 0.3, keys[1]: 0.2}
    path = path_of_order(data)
    assert path.max_speed is not None
    assert path.max_yaw_rate is not None
    middle = (path.poses[1:] + path.poses[:-1]) / 2
    on_arc = (middle[:, 0] > 2) & (middle[:, 1] < 1)
    assert (path.max_speed == np.where(on_arc, 0.3, np.inf)).all()
    assert (path.max_yaw_rate == np.where(on_arc, 0.2, np.inf)).all()


@pytest.mark.parametrize(
    ("more", "headings"),
    [
        ({}, (0.0, math.pi / 2)),
        ({"orientation": None, "orientationType": None}, (0.0, math.pi / 2)),
        ({"orientation": 3.14159265}, (math.pi, 3 * math.pi / 2)),
        ({"orientation": -1.0, "orientationType": "TANGENTIAL"}, (-1, math.pi / 2 - 1)),
        ({"orientation": 0.5, "orientationType": "GLOBAL"}, (0.5, 0.5)),
    ],
)
def test_orientation_is_along_the_edge_or_on_the_map(
    more: Json, headings: tuple[float, float]
) -> None:
    nodes = [node(1, 2, 0), node(2, 3, 1)]
    path = path_of_order(order(nodes, [edge(1, trajectory=ARC, **more)]))
    assert path.poses[[0, -1], 2] == pytest.approx(headings, abs=1e-6)
    assert not path.stops.any()


def test_headings_of_control_points_are_global() -> None:
    arc = copy.deepcopy(ARC)
    for point, heading in zip(arc["controlPoints"], (3.0, -3.0, -2.5), strict=True):
        point["orientation"] = heading
    nodes = [node(1, 2, 0), node(2, 3, 1)]
    path = path_of_order(order(nodes, [edge(1, trajectory=arc, orientation=1.0)]))
    assert path.poses[[0, -1], 2] == pytest.approx([3.0, 2 * math.pi - 2.5])


def test_the_heading_of_a_node_is_taken_on_the_spot() -> None:
    nodes = [
        node(0, 0, 0, theta=math.pi / 2),
        node(1, 1, 0, theta=-1.0),
        node(2, 3, 0, theta=1.0),
    ]
    path = path_of_order(order(nodes, [edge(0), edge(1)]))
    headings = path.poses[path.stops]
    assert path.poses[0] == pytest.approx([0, 0, math.pi / 2])
    assert headings == pytest.approx(
        np.array([[0, 0, 0], [1, 0, 0], [1, 0, -1], [1, 0, 0], [3, 0, 0]]), abs=1e-12
    )
    assert path.poses[-1] == pytest.approx([3, 0, 1])


def test_a_heading_within_the_allowed_deviation_needs_no_turn() -> None:
    nodes = [
        node(i, i, 0, theta=theta, allowedDeviationTheta=0.2)
        for i, theta in enumerate((0.1, -0.15, 0.2))
    ]
    path = path_of_order(order(nodes, [edge(0), edge(1)]))
    assert (path.poses[:, 2] == 0).all()
    assert not path.stops.any()


@pytest.mark.parametrize("blocking", ["HARD", "SOFT"])
@pytest.mark.parametrize("where", ["nodes", "edges"])
def test_the_vehicle_stands_where_an_action_forbids_driving(
    blocking: str, where: str
) -> None:
    data = straight((0, 0), (1, 0), (2, 0))
    data[where][1]["actions"] = [
        {"actionId": "a", "actionType": "pick", "blockingType": blocking}
    ]
    assert path_of_order(data).stops.tolist() == [False, True, False]


@pytest.mark.parametrize("blocking", ["NONE", "SINGLE"])
def test_other_actions_do_not_stop_it(blocking: str) -> None:
    data = straight((0, 0), (1, 0), (2, 0))
    data["nodes"][1]["actions"] = [
        {"actionId": "a", "actionType": "beep", "blockingType": blocking}
    ]
    assert not path_of_order(data).stops.any()


def test_the_horizon_is_read_and_the_base_ends_in_a_stop() -> None:
    data = straight((0, 0), (1, 0), (2, 0))
    data["edges"][1]["released"] = data["nodes"][2]["released"] = False
    path = path_of_order(data)
    assert path.poses[:, 0].tolist() == [0, 1, 2]
    assert path.stops.tolist() == [False, True, False]


def test_nodes_between_trajectories_need_no_position() -> None:
    data = with_arc()
    back = {"controlPoints": [{"x": 3, "y": 1}, {"x": 3, "y": 2}]}
    data["edges"][0]["trajectory"] = {
        "controlPoints": [{"x": 0, "y": 0}, {"x": 2, "y": 0}]
    }
    data["edges"][2]["trajectory"] = back
    for each in data["nodes"]:
        del each["nodePosition"]
    assert path_of_order(data).poses[-1] == pytest.approx([3, 2, math.pi / 2])


def test_a_straight_edge_meets_the_trajectory_beside_it() -> None:
    data = with_arc()
    data["nodes"][1]["nodePosition"] |= {
        "x": 2.2,
        "allowedDeviationXY": {"a": 0.3, "b": 0.1, "theta": 0.0},
    }
    path = path_of_order(data)
    assert not path.stops.any()
    assert path.poses[:, 0].max() == pytest.approx(3)
    data["nodes"][1]["nodePosition"]["allowedDeviationXY"]["theta"] = math.pi / 2
    with pytest.raises(InvalidTrajectory, match=r"outside of nodes\[1\]"):
        path_of_order(data)
    data["version"] = "2.1.0"
    data["nodes"][1]["nodePosition"]["allowedDeviationXY"] = 0.25
    assert (path_of_order(data).poses == path.poses).all()


def test_the_reference_point_and_the_tolerance_are_passed_on() -> None:
    path = path_of_order(with_arc(), reference_point=(0.3, 0.1))
    assert path.reference_point == (0.3, 0.1)
    loose = path_of_order(with_arc(), tolerance=Tolerance(0.05, 0.05))
    assert len(loose.poses) < len(path.poses)


def test_unknown_fields_and_nulls_are_left_alone() -> None:
    data = with_arc(zoneSetId=None, vendor={"a": [1]})
    data["edges"][0] |= {"trajectory": None, "corridor": {"leftWidth": 1}, "x": 1}
    data["edges"][1]["trajectory"]["controlPoints"][0]["weight"] = None
    assert (path_of_order(data).poses == path_of_order(with_arc()).poses).all()


Change = Callable[[Json], Any]


def put(path: str, value: Any) -> Change:
    """Return a change that puts a value, or takes it away for ``...``."""
    *parents, last = re.findall(r"\w+", path)

    def change(data: Json) -> None:
        at: Any = data
        for key in parents:
            at = at[int(key)] if isinstance(at, list) else at[key]
        key = int(last) if isinstance(at, list) else last
        if value is ...:
            del at[key]
        else:
            at[key] = value

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (put("orderId", ...), "orderId: missing"),
        (put("orderId", 7), "orderId: 7; "),
        (put("version", "1.1.0"), "version: '1.1.0'"),
        (put("nodes", ...), "nodes: missing"),
        (put("nodes", "abc"), "nodes: 'abc'"),
        (put("nodes[0].released", ...), "nodes[0].released: missing"),
        (put("nodes[0].released", "yes"), "nodes[0].released: 'yes'"),
        (put("nodes[0].nodePosition.x", "1"), "nodes[0].nodePosition.x: '1'"),
        (put("nodes[0].nodePosition.theta", 7.0), "nodes[0].nodePosition.theta: 7.0"),
        (
            put("nodes[0].nodePosition.allowedDeviationXY", -1.0),
            "nodes[0].nodePosition.allowedDeviationXY: -1.0",
        ),
        (put("nodes[0].nodePosition", ...), "nodes[0].nodePosition: missing; needed"),
        (put("nodes[2].nodePosition.mapId", "up"), "nodes[2].nodePosition.mapId: 'up'"),
        (put("nodes[1].nodePosition.x", 2.5), "0.5 m outside of nodes[1]"),
        (put("nodes[1].sequenceId", 9), "edges[1].sequenceId: 3 between nodes 9 and 4"),
        (put("nodes[1].sequenceId", -2), "nodes[1].sequenceId: -2"),
        (put("nodes[3]", ...), "edges: 3 edges for 3 nodes; 2"),
        (put("edges[2]", ...), "edges: 2 edges for 4 nodes; 3"),
        (put("edges[0].startNodeId", "n9"), "edges[0].startNodeId: 'n9'; 'n0'"),
        (put("edges[0].endNodeId", "n0"), "edges[0].endNodeId: 'n0'; 'n1'"),
        (put("nodes[0].released", False), "nodes[0].released: false; the first node"),
        (put("edges[0].released", False), "released: true; edges[0] before it is not"),
        (put("nodes[3].released", False), "edges[2].released: true; nodes[3], where"),
        (put("edges[0].maximumSpeed", 0.0), "edges[0].maximumSpeed: 0.0"),
        (put("edges[0].orientation", 4.0), "edges[0].orientation: 4.0"),
        (put("edges[0].orientationType", "LOCAL"), "edges[0].orientationType: 'LOCAL'"),
        (
            put("nodes[0].actions", [{"blockingType": "MAYBE"}]),
            "nodes[0].actions[0].blockingType: 'MAYBE'",
        ),
        (put("edges[1].trajectory.degree", 0), "edges[1].trajectory.degree: 0"),
        (put("edges[1].trajectory.degree", 3), "at least 4 for degree 3"),
        (
            put("edges[1].trajectory.knotVector", [0, 0, 0, 1, 1]),
            "edges[1].trajectory.knotVector: 5 knots; 6: 3 control points + degree 2",
        ),
        (
            put("edges[1].trajectory.knotVector[3]", 1.5),
            "edges[1].trajectory.knotVector[3]: 1.5",
        ),
        (
            put("edges[1].trajectory.knotVector", [0, 0, 0, 1, 0.5, 1]),
            "edges[1].trajectory.knotVector[4]: 0.5 after 1; must not decrease",
        ),
        (
            put("edges[1].trajectory.knotVector[1]", -0.1),
            "edges[1].trajectory.knotVector[1]: -0.1",
        ),
        (
            put("edges[1].trajectory.controlPoints[1].weight", 0),
            "edges[1].trajectory.controlPoints[1].weight: 0",
        ),
        (
            put("edges[1].trajectory.controlPoints[1].y", ...),
            "edges[1].trajectory.controlPoints[1].y: missing",
        ),
        (
            put("edges[1].trajectory.controlPoints[1].orientation", 0.5),
            "edges[1].trajectory.controlPoints[0].orientation: missing; all control",
        ),
        (
            put("edges[1].trajectory.controlPoints", []),
            "edges[1].trajectory.controlPoints: 0 points; at least 3",
        ),
        (
            put(
                "edges[2].trajectory",
                {"controlPoints": [{"x": 3, "y": 1.001}, {"x": 3, "y": 3}]},
            ),
            "edges[2].trajectory.controlPoints[0]: begins 0.001 m from the end",
        ),
        (
            put("edges[1].trajectory.controlPoints[2].x", 3.5),
            "edges[1].trajectory.controlPoints[2]: (3.5, 1) is 0.5 m outside",
        ),
    ],
)
def test_mistakes_are_refused_with_their_json_path(
    change: Change, message: str
) -> None:
    data = with_arc()
    change(data)
    with pytest.raises(InvalidTrajectory, match=re.escape(message)):
        path_of_order(data)


def test_nodes_at_one_place_are_refused() -> None:
    with pytest.raises(InvalidTrajectory, match=r"edges\[0\]: 0 m from node to node"):
        path_of_order(straight((1, 1), (1, 1)))


def test_all_mistakes_are_told_at_once() -> None:
    data = with_arc()
    for change in (put("orderId", ...), put("edges[0].edgeId", 3)):
        change(data)
    put("edges[1].trajectory.controlPoints[1].weight", -1)(data)
    with pytest.raises(InvalidTrajectory) as caught:
        path_of_order(data)
    assert len(caught.value.problems) == 3


@pytest.mark.parametrize("data", [None, 3, "order", [], [None], {}, {"nodes": []}])
def test_what_is_no_order_is_refused(data: Any) -> None:
    with pytest.raises(InvalidTrajectory):
        path_of_order(data)


def test_files_hold_one_order_or_many(tmp_path: FilePath) -> None:
    file = tmp_path / "order.json"
    file.write_text("\ufeff" + json.dumps(with_arc()), "utf-8")
    (one,) = read_trajectories(file)
    assert isinstance(one, Path)
    assert (one.poses == path_of_order(with_arc()).poses).all()
    file.write_text(json.dumps([with_arc(), straight((0, 0), (1, 0))]), "utf-8")
    assert [path.length for path in read_orders(file)] == pytest.approx(
        [4 + math.pi / 2, 1], abs=0.01
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "a JSON file"),
        ("{", "a JSON file"),
        ("[]", "no order"),
        ("[" * 100_000, "nested too deeply|a JSON file"),
        (b"\xff\xfe{}", "a JSON file"),
        ('{"nodes": NaN}', "NaN is not a JSON number"),
        ("{}", "orderId: missing"),
        ("[3]", r"file.json\[0\]: order: 3"),
        ('{"type": "FeatureCollection"}', "nodes: missing"),
    ],
)
def test_files_with_mistakes_are_refused_by_name(
    tmp_path: FilePath, text: str | bytes, message: str
) -> None:
    file = tmp_path / "file.json"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InvalidTrajectory, match=message) as caught:
        read_trajectories(file)
    assert "file.json" in str(caught.value)


def test_a_missing_file_is_refused(tmp_path: FilePath) -> None:
    with pytest.raises(InvalidTrajectory, match=r"missing\.json"):
        read_trajectories(tmp_path / "missing.json")
