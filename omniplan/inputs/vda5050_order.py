"""The part of a VDA 5050 order that says where to drive: typed, with its own rules.

Versions 2.x and 3.x; where they name a field differently both names are read. Fields
that say nothing about the motion are left alone, as the standard is extended freely.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Literal, TypeAlias

from pydantic import AliasChoices, BaseModel, ConfigDict, Field, ValidationError

from configspace import Problem
from omniplan.errors import InvalidTrajectory

__all__ = ["ControlPoint", "Curve", "Edge", "Node", "Order", "order_from_data"]

Positive: TypeAlias = Annotated[float, Field(gt=0)]
Angle: TypeAlias = Annotated[float, Field(ge=-3.1416, le=3.1416)]
Index: TypeAlias = Annotated[int, Field(ge=0)]


class _Part(BaseModel):
    model_config = ConfigDict(
        extra="ignore", strict=True, frozen=True, allow_inf_nan=False
    )


class ControlPoint(_Part):
    """A control point; `orientation` (global) is an addition of version 1."""

    x: float
    y: float
    weight: Positive | None = None
    orientation: Angle | None = None


class Curve(_Part):
    """``trajectory``: a NURBS."""

    degree: Annotated[int, Field(ge=1)] | None = None
    knots: list[Annotated[float, Field(ge=0, le=1)]] | None = Field(
        default=None, alias="knotVector"
    )
    points: list[ControlPoint] = Field(alias="controlPoints")


class Ellipse(_Part):
    """``allowedDeviationXY`` of version 3."""

    a: Annotated[float, Field(ge=0)]
    b: Annotated[float, Field(ge=0)]
    theta: float


class Position(_Part):
    """``nodePosition``."""

    x: float
    y: float
    theta: Angle | None = None
    deviation: Annotated[float, Field(ge=0)] | Ellipse | None = Field(
        default=None, alias="allowedDeviationXY"
    )
    turn: Annotated[float, Field(ge=0)] | None = Field(
        default=None, alias="allowedDeviationTheta"
    )
    map_id: str | None = Field(default=None, alias="mapId")

    def excess(self, point: complex) -> float:
        """Return how far a point lies outside of what is allowed, m; 0: within."""
        offset = point - complex(self.x, self.y)
        match self.deviation:
            case Ellipse(a=a, b=b, theta=theta) if a > 0 and b > 0:
                along = offset * complex(math.cos(theta), -math.sin(theta))
                size = math.hypot(along.real / a, along.imag / b)
                return 0.0 if size <= 1 else abs(offset) * (1 - 1 / size)
            case float(radius):
                return max(abs(offset) - radius, 0.0)
            case _:
                return abs(offset)


class Action(_Part):
    """``action``: only whether the vehicle may drive meanwhile."""

    blocking: Literal["NONE", "SINGLE", "SOFT", "HARD"] = Field(alias="blockingType")

    @property
    def stops(self) -> bool:
        """Whether the vehicle must not drive while it acts."""
        return self.blocking in ("SOFT", "HARD")


class Node(_Part):
    """``node``."""

    node_id: str = Field(alias="nodeId")
    sequence_id: Index = Field(alias="sequenceId")
    released: bool
    position: Position | None = Field(default=None, alias="nodePosition")
    actions: list[Action] | None = None


class Edge(_Part):
    """``edge``."""

    edge_id: str = Field(alias="edgeId")
    sequence_id: Index = Field(alias="sequenceId")
    released: bool
    start: str | None = Field(default=None, alias="startNodeId")
    end: str | None = Field(default=None, alias="endNodeId")
    max_speed: Positive | None = Field(
        default=None, validation_alias=AliasChoices("maximumSpeed", "maxSpeed")
    )
    max_yaw_rate: Positive | None = Field(
        default=None,
        validation_alias=AliasChoices("maximumRotationSpeed", "maxRotationSpeed"),
    )
    orientation: Angle | None = None
    orientation_type: Literal["GLOBAL", "TANGENTIAL"] | None = Field(
        default=None, alias="orientationType"
    )
    curve: Curve | None = Field(default=None, alias="trajectory")
    actions: list[Action] | None = None


class Order(_Part):
    """An order; nodes and edges in the order in which they are driven."""

    order_id: Annotated[str, Field(min_length=1, max_length=200)] = Field(
        alias="orderId"
    )
    version: Annotated[str, Field(pattern=r"^[23]\.")] | None = None
    nodes: list[Node]
    edges: list[Edge]


def order_from_data(data: object) -> Order:
    """Return the order that JSON data describes, checked for its own rules.

    Raises
    ------
    InvalidTrajectory
        With every mistake and its JSON path.
    """
    try:
        order = Order.model_validate(data)
    except ValidationError as error:
        raise InvalidTrajectory(
            _problem(dict(each)) for each in error.errors(include_url=False)
        ) from error
    problems = [*_sequence(order), *_releases(order), *_places(order)]
    if problems:
        raise InvalidTrajectory(problems)
    return order


def _problem(error: dict[str, object]) -> Problem:
    """Word one error of pydantic: where, given, allowed."""
    location = error["loc"]
    assert isinstance(location, tuple)
    # Members of a union name themselves after the field.
    named = [part for part in location if part not in ("Ellipse", "constrained-float")]
    parts = (f"[{p}]" if isinstance(p, int) else f".{p}" for p in named)
    where = "".join(parts).lstrip(".") or "order"
    if error["type"] == "missing":
        return Problem(where, "missing", "must be given")
    allowed = str(error["msg"]).removeprefix("Input ")
    return Problem(where, repr(error.get("input"))[:60], allowed)


def _sequence(order: Order) -> Iterator[Problem]:
    """Yield where nodes and edges do not take turns."""
    nodes, edges = order.nodes, order.edges
    if len(nodes) < 2:
        yield Problem("nodes", f"{len(nodes)} node(s)", "at least two, and an edge")
        return
    if len(edges) != len(nodes) - 1:
        given = f"{len(edges)} edges for {len(nodes)} nodes"
        yield Problem("edges", given, f"{len(nodes) - 1}: one from node to node")
        return
    for i, edge in enumerate(edges):
        start, end = nodes[i], nodes[i + 1]
        if not start.sequence_id < edge.sequence_id < end.sequence_id:
            yield Problem(
                f"edges[{i}].sequenceId",
                f"{edge.sequence_id} between nodes {start.sequence_id} and "
                f"{end.sequence_id}",
                "nodes and edges take turns, with rising numbers",
            )
        for key, named, node in (
            ("startNodeId", edge.start, start),
            ("endNodeId", edge.end, end),
        ):
            if named not in (None, node.node_id):
                allowed = f"{node.node_id!r}, the node that stands there"
                yield Problem(f"edges[{i}].{key}", repr(named), allowed)


def _releases(order: Order) -> Iterator[Problem]:
    """Yield what is released behind something that is not."""
    if order.nodes and not order.nodes[0].released:
        yield Problem(
            "nodes[0].released", "false", "the first node belongs to the base"
        )
        return
    open_behind = ""
    for i, node in enumerate(order.nodes):
        steps: list[tuple[str, bool]] = [(f"nodes[{i}]", node.released)]
        if 0 < i <= len(order.edges):
            steps.insert(0, (f"edges[{i - 1}]", order.edges[i - 1].released))
            if order.edges[i - 1].released and not node.released:
                allowed = f"nodes[{i}], where it ends, must be released as well"
                yield Problem(f"edges[{i - 1}].released", "true", allowed)
        for where, released in steps:
            if released and open_behind:
                allowed = f"{open_behind} before it is not: the horizon comes last"
                yield Problem(f"{where}.released", "true", allowed)
                return
            open_behind = open_behind or ("" if released else where)


def _places(order: Order) -> Iterator[Problem]:
    """Yield nodes without a needed position, and changes of the map."""
    maps: dict[str, int] = {}
    for i, node in enumerate(order.nodes):
        beside = order.edges[max(i - 1, 0) : i + 1]
        if node.position is None:
            if any(edge.curve is None for edge in beside):
                allowed = "needed by an edge without a trajectory"
                yield Problem(f"nodes[{i}].nodePosition", "missing", allowed)
        elif node.position.map_id is not None:
            maps.setdefault(node.position.map_id, i)
    for name, i in list(maps.items())[1:]:
        allowed = f"{next(iter(maps))!r}: one order, one map"
        yield Problem(f"nodes[{i}].nodePosition.mapId", repr(name), allowed)
