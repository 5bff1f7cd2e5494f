"""Solids between two heights, against rays of trimesh and closed forms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import shapely  # noqa: TID251
import trimesh  # noqa: TID251
from trimesh import creation  # noqa: TID251

from configspace import InvalidInput
from omniplan.obstacles import CollisionChecker, Obstacles
from omniplan.obstacles.meshes import shadow

FloatArray = npt.NDArray[np.float64]


def joined(bodies: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    whole = trimesh.util.concatenate(bodies)
    assert isinstance(whole, trimesh.Trimesh)
    return whole


def test_a_box_casts_its_ground_plan() -> None:
    box = creation.box((2.0, 1.0, 3.0))  # z from -1.5 to 1.5
    for heights in ((0.0, 0.5), (-9.0, 9.0), (1.4, 9.0), (-9.0, -1.4), (1.5, 2.0)):
        found = Obstacles.from_meshes({"crate": box}, heights)
        assert found.names == ("crate",)
        assert found.area == pytest.approx(2)
        assert found.bounds == pytest.approx((-1, -0.5, 1, 0.5))
    assert len(Obstacles.from_meshes([box], (2.0, 3.0))) == 0


def test_a_ball_is_cut_at_both_heights() -> None:
    ball = creation.icosphere(subdivisions=4, radius=1.0)
    for low, high, radius in (
        (-2, 2, 1),
        (0.6, 2, 0.8),
        (-2, -0.8, 0.6),
        (0.1, 0.3, 1),
    ):
        largest = math.sqrt(1 - 0.1**2) if (low, high) == (0.1, 0.3) else radius
        area = shadow("ball", ball, (low, high)).area
        assert area == pytest.approx(math.pi * largest**2, rel=1e-2)


def test_a_table_leaves_room_below_its_top() -> None:
    top = creation.box((2, 1, 0.1))
    top.apply_translation([0, 0, 1.0])
    legs = []
    for x, y in ((0.9, 0.4), (-0.9, 0.4), (-0.9, -0.4), (0.9, -0.4)):
        leg = creation.box((0.1, 0.1, 0.95))
        leg.apply_translation([x, y, 0.475])
        legs.append(leg)
    table = joined([top, *legs])
    assert Obstacles.from_meshes([table], (0.0, 0.5)).area == pytest.approx(0.04)
    assert Obstacles.from_meshes([table], (0.0, 1.5)).area == pytest.approx(2.0)


def test_a_hollow_room_is_free_inside() -> None:
    outer = creation.box((10, 10, 4))
    inner = creation.box((9, 9, 3))
    inner.invert()
    room = joined([outer, inner])
    found = Obstacles.from_meshes([room], (-1.0, 0.5))
    assert found.area == pytest.approx(19)
    checker = CollisionChecker([[1, 1], [-1, 1], [-1, -1], [1, -1]], found)
    assert checker.is_free((0, 0, 0))
    assert not checker.is_free((4, 0, 0))
    # Its floor is solid.
    assert Obstacles.from_meshes([room], (-2.0, 0.5)).area == pytest.approx(100)


def test_overlapping_bodies_count_once() -> None:
    one, two = creation.box((2, 2, 2)), creation.box((2, 2, 2))
    two.apply_translation([1, 0, 0])
    both = joined([one, two])
    assert Obstacles.from_meshes([both], (-0.1, 0.1)).area == pytest.approx(6)


@pytest.mark.parametrize("seed", range(6))
def test_random_solids_against_columns_of_points(seed: int) -> None:
    """A column is in the shadow if any of its points is inside, by winding angles."""
    rng = np.random.default_rng(seed)
    mesh = creation.icosphere(subdivisions=2)
    direction = mesh.vertices / np.linalg.norm(mesh.vertices, axis=1)[:, None]
    mesh.vertices = direction * rng.uniform(0.4, 1.2, (len(direction), 1))
    low, high = np.sort(rng.uniform(-0.8, 0.8, 2))
    area = shadow("stone", mesh, (low, high))
    shapely.prepare(area)
    points = rng.uniform(-1.2, 1.2, (60, 2))
    z = np.linspace(low, high, 25)
    near = np.array([area.boundary.distance(shapely.Point(p)) < 0.03 for p in points])
    for (x, y), skip in zip(points, near, strict=True):
        column = np.column_stack([np.full(25, x), np.full(25, y), z])
        inside = (np.abs(_winding(mesh, column)) > 0.5).any()
        shaded = shapely.intersects_xy(area, x, y)
        assert shaded or not inside
        assert skip or inside or not shaded or _grazes(mesh, column)


def _winding(mesh: trimesh.Trimesh, points: FloatArray) -> FloatArray:
    """Return how often the surface winds around points (van Oosterom, Strackee)."""
    a, b, c = (mesh.triangles[None, :, i] - points[:, None] for i in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=-1) for x in (a, b, c))
    top = np.einsum("pfi,pfi->pf", a, np.cross(b, c))
    ab, bc, ca = ((p * q).sum(-1) for p, q in ((a, b), (b, c), (c, a)))
    angle = 2 * np.arctan2(top, la * lb * lc + ab * lc + bc * la + ca * lb)
    return np.asarray(angle.sum(axis=1) / (4 * np.pi))


def _grazes(mesh: trimesh.Trimesh, column: FloatArray) -> bool:
    """Return whether a finer column meets the solid."""
    z = np.linspace(column[0, 2], column[-1, 2], 2000)
    fine = np.column_stack([np.tile(column[0, :2], (2000, 1)), z])
    return bool((np.abs(_winding(mesh, fine)) > 0.5).any())


def test_vertices_at_the_height_and_repeated_corners() -> None:
    ball = creation.icosphere(subdivisions=2)
    heights = np.unique(ball.vertices[:, 2])
    a, b = (ball.vertices[ball.edges[:, i]] for i in (0, 1))
    for high in heights[1:]:
        # The shadow of a convex solid is the hull of its corners and cut edges.
        across = (a[:, 2] < high) & (b[:, 2] > high)
        share = (high - a[across, 2]) / (b[across, 2] - a[across, 2])
        cut = a[across] + share[:, None] * (b[across] - a[across])
        corners = np.concatenate([ball.vertices[ball.vertices[:, 2] <= high], cut])
        hull = shapely.MultiPoint(corners[:, :2]).convex_hull
        area = shadow("ball", ball, (-2.0, float(high)))
        assert area.area == pytest.approx(hull.area, rel=1e-9)
    soup = trimesh.Trimesh(
        ball.triangles.reshape(-1, 3),
        np.arange(3 * len(ball.faces)).reshape(-1, 3),
        process=False,
    )
    assert shadow("soup", soup, (-2, 0.3)).area == pytest.approx(
        shadow("ball", ball, (-2, 0.3)).area
    )


def test_open_and_broken_meshes_are_refused() -> None:
    box = creation.box((2, 1, 3))
    open_box = trimesh.Trimesh(box.vertices, box.faces[:-1], process=False)
    with pytest.raises(
        InvalidInput, match=r"lid: an open mesh: .* one at \("
    ) as caught:
        Obstacles.from_meshes({"lid": open_box}, (0, 1))
    assert "a closed solid" in str(caught.value)
    turned = box.faces.copy()
    turned[0] = turned[0, ::-1]
    with pytest.raises(InvalidInput, match="mesh 0: an open mesh"):
        Obstacles.from_meshes(
            [trimesh.Trimesh(box.vertices, turned, process=False)], (0, 1)
        )
    wrong = box.vertices.copy()
    wrong[2, 1] = np.nan
    with pytest.raises(InvalidInput, match=r"vertex 2 at .*nan.*; finite numbers"):
        Obstacles.from_meshes(
            [trimesh.Trimesh(wrong, box.faces, process=False)], (0, 1)
        )
    with pytest.raises(InvalidInput, match="a mesh without faces"):
        Obstacles.from_meshes([trimesh.Trimesh()], (0, 1))


@pytest.mark.parametrize("heights", [(1, 1), (2, 1), (0, math.inf), (math.nan, 1)])
def test_heights_must_be_in_order(heights: tuple[float, float]) -> None:
    with pytest.raises(InvalidInput, match=r"heights: .*the lower one first"):
        Obstacles.from_meshes([creation.box()], heights)


def test_what_is_no_mesh_is_told() -> None:
    with pytest.raises(InvalidInput, match=r"crate: 5; a trimesh\.Trimesh, or"):
        Obstacles.from_meshes({"crate": 5}, (0.0, 1.0))  # type: ignore[arg-type]


@pytest.mark.parametrize("given", [creation.box((1, 1, 1)), 3, None])
def test_one_mesh_alone_is_told(given: Any) -> None:
    words = rf"meshes: {type(given).__name__}; a list of meshes, or a mapping"
    with pytest.raises(InvalidInput, match=words):
        Obstacles.from_meshes(given, (0, 1))


def turned(body: trimesh.Trimesh) -> trimesh.Trimesh:
    other = body.copy()
    other.invert()
    return other


def test_what_stands_in_a_cavity_stays() -> None:
    house, room = creation.box((10, 10, 10)), creation.box((9, 9, 9))
    machine, drawer = creation.box((1, 1, 1)), creation.box((0.5, 0.5, 0.5))
    inside = [house, turned(room), machine]
    for bodies, area in (
        (inside, 100 - 81 + 1),
        ([*inside, turned(drawer)], 100 - 81 + 1 - 0.25),
        ([turned(drawer), *inside[::-1]], 100 - 81 + 1 - 0.25),
    ):
        found = Obstacles.from_meshes([joined(bodies)], (0.0, 0.2))
        assert found.area == pytest.approx(area)


def test_a_cavity_across_two_solids_is_filled_up() -> None:
    left, right = creation.box((2, 2, 2)), creation.box((2, 2, 2))
    right.apply_translation((1.5, 0, 0))
    hole = turned(creation.box((1.2, 1, 1)))
    hole.apply_translation((0.75, 0, 0))
    found = Obstacles.from_meshes([joined([left, right, hole])], (0.0, 0.2))
    assert found.area == pytest.approx(2 * 3.5)


def test_bodies_turned_inside_out_do_not_vanish() -> None:
    box, small = creation.box((2, 1, 3)), creation.box((1, 0.5, 1))
    away = turned(small)
    away.apply_translation((5, 0, 0))
    shell = joined([box, turned(small)])
    floating = turned(creation.box((0.2, 0.2, 0.2)))
    words = r"crate: faces turned inwards, one at \(.*\), in no solid; a closed solid"
    for mesh in (
        turned(box),
        joined([box, away]),
        turned(shell),
        joined([shell, floating]),
    ):
        with pytest.raises(InvalidInput, match=words):
            Obstacles.from_meshes({"crate": mesh}, (0.0, 0.2))


def test_a_surface_that_overlaps_itself_is_solid_there() -> None:
    """A closed bar that winds twice around, through itself at one place and more."""
    t = np.linspace(0, 4 * np.pi, 200, endpoint=False)
    reach = 2 + np.cos(t / 2)
    middle = np.stack([reach * np.cos(t), reach * np.sin(t), 0 * t], axis=-1)
    along = np.roll(middle, -1, axis=0) - np.roll(middle, 1, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    across = np.stack([-along[:, 1], along[:, 0], 0 * t], axis=-1)
    corner = np.array([[0.3, -0.5], [0.3, 0.5], [-0.3, 0.5], [-0.3, -0.5]])
    vertices = (
        middle[:, None]
        + corner[None, :, :1] * across[:, None]
        + corner[None, :, 1:] * np.array([0.0, 0.0, 1.0])
    ).reshape(-1, 3)
    i, j = (each.ravel() for each in np.indices((200, 4)))
    a, b = 4 * i + j, 4 * i + (j + 1) % 4
    c, d = 4 * ((i + 1) % 200) + j, 4 * ((i + 1) % 200) + (j + 1) % 4
    faces = np.concatenate([np.stack([a, d, c], -1), np.stack([a, b, d], -1)])
    bar = trimesh.Trimesh(vertices, faces, process=False)
    assert bar.is_watertight
    assert bar.volume > 0
    area = shadow("bar", bar, (0.0, 0.2))
    for place in middle:
        assert area.covers(shapely.Point(place[:2]).buffer(0.28))
    expected = shapely.LinearRing(middle[:, :2]).buffer(0.3)
    assert area.symmetric_difference(expected).area < 0.02


class Data:
    """Vertices and faces of a tetrahedron, or what a file made of them."""

    def __init__(self, **changes: Any) -> None:
        self.vertices: Any = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
        self.faces: Any = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
        self.__dict__.update(changes)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"vertices": [[0, 0], [1, 0]]}, r"vertices of shape \(2, 2\), int64; numbers"),
        ({"vertices": [["a", "b", "c"]]}, "vertices of shape"),
        ({"faces": "abc"}, r"faces of shape \(\), <U3; triangles"),
        ({"faces": [[0, 2, 1, 3]]}, r"faces of shape \(1, 4\), int64; triangles"),
        ({"faces": [[0.5, 2, 1]]}, r"faces of shape \(1, 3\), float64; triangles"),
        ({"faces": [[0, 1, 9]]}, r"face 0 of vertices \[0, 1, 9\]; .* from 0 to 3"),
        ({"faces": [[0, 2, 1], [0, 1, -1]]}, r"face 1 of vertices \[0, 1, -1\]"),
        ({"faces": []}, "a mesh without faces"),
        (
            {"vertices": [[0, 0, np.nan], *[[1, 0, 0]] * 3]},
            r"vertex 0 at \(0.0, 0.0, n",
        ),
    ],
)
def test_arrays_that_are_no_triangles_are_told(
    changes: dict[str, Any], words: str
) -> None:
    assert shadow("wedge", Data(), (0.0, 0.5)).area == pytest.approx(0.5)
    with pytest.raises(InvalidInput, match=f"wedge: {words}"):
        Obstacles.from_meshes({"wedge": Data(**changes)}, (0.0, 0.5))


@pytest.mark.parametrize("heights", [None, (1,), ("a", "b"), (0, 1, 2), 1.0])
def test_what_are_no_heights_is_told(heights: Any) -> None:
    with pytest.raises(InvalidInput, match=r"heights: .*; two finite heights"):
        Obstacles.from_meshes([creation.box()], heights)


def stone(rng: np.random.Generator, size: float) -> trimesh.Trimesh:
    mesh: trimesh.Trimesh = creation.icosphere(subdivisions=1)
    mesh.vertices = (
        mesh.vertices * rng.uniform(0.7, 1.0, (len(mesh.vertices), 1)) * size
    )
    return mesh


@pytest.mark.parametrize("seed", range(5))
def test_nested_and_overlapping_stones_against_columns(seed: int) -> None:
    """A shell with a stone in it, and another through its side, in any order."""
    rng = np.random.default_rng(seed)
    shell, room, kernel, other = (stone(rng, size) for size in (2.0, 1.2, 0.5, 0.9))
    kernel.apply_translation(rng.uniform(-0.2, 0.2, 3))
    other.apply_translation([1.5, 0.0, 0.0])
    low, high = np.sort(rng.uniform(-1.0, 1.0, 2))
    bodies = [shell, turned(room), kernel, other]
    mesh = joined([bodies[i] for i in rng.permutation(4)])
    area = shadow("stones", mesh, (low, high))
    z = np.linspace(low, high, 150)

    def is_solid(x: float, y: float) -> bool:
        column = np.column_stack([np.full(150, x), np.full(150, y), z])
        around = [_winding(body, column) > 0.5 for body in (shell, room, kernel, other)]
        return bool(((around[0] & ~around[1]) | around[2] | around[3]).any())

    solid = 0
    for x, y in rng.uniform([-2, -2], [2.4, 2], (30, 2)):
        if area.boundary.distance(shapely.Point(x, y)) < 0.02:
            continue
        assert shapely.intersects_xy(area, x, y) == is_solid(x, y)
        solid += is_solid(x, y)
    assert solid
