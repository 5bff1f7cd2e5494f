"""The permissible set as a solid or a ribbon, and its files."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import trimesh

from configspace import (
    Grid,
    InvalidInput,
    PermissibleSpace,
    Vehicle,
    build_space,
    dump_space,
    exact_v_max,
    load_vehicle,
    parse_space,
    vehicle_from_data,
)
from configspace.mesh import export, to_mesh, to_ribbon
from configspace.topology import components, part_states

GRID = Grid(80, 144)


def space_on(vehicle: Vehicle, grid: Grid = GRID) -> PermissibleSpace:
    return build_space(vehicle, grid, cache=False)


def sheet_of(space: PermissibleSpace) -> PermissibleSpace:
    return parse_space(dump_space(space))


def four_steered(
    steering_range: tuple[float, float], **limits: float | None
) -> Vehicle:
    data = load_vehicle("ift-four-steered").model_dump(mode="json", exclude_none=True)
    for wheel in data["wheels"]:
        wheel["steering_range_deg"] = steering_range
    data["limits"] = {**data["limits"], **limits}
    return vehicle_from_data(data)


def volume(vehicle: Vehicle) -> float:
    """Return the integral of both v_max by the midpoint rule, without any table."""
    kappa = (np.arange(800) + 0.5) / 200 - 2
    beta = ((np.arange(1440) + 0.5) / 720 - 1) * np.pi
    sides = [
        exact_v_max(vehicle, kappa[:, None], beta, reverse=reverse)
        for reverse in (False, True)
    ]
    return float(sum(side.mean() for side in sides) * 8 * np.pi)


def assert_solid(mesh: trimesh.Trimesh) -> None:
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.nondegenerate_faces().all()
    assert mesh.volume > 0
    for body in mesh.split():
        assert body.volume > 0


@pytest.fixture(scope="module")
def ift() -> PermissibleSpace:
    return space_on(load_vehicle("ift-four-steered"))


@pytest.mark.parametrize("name", ["ift-four-steered", "mecanum", "ift-three-steered"])
def test_the_volume_comes_closer_with_the_square_of_the_cells(name: str) -> None:
    vehicle = load_vehicle(name)
    truth = volume(vehicle)
    errors = []
    for factor in (1, 2, 4):
        mesh = to_mesh(space_on(vehicle, Grid(40 * factor, 72 * factor)))
        assert_solid(mesh)
        errors.append(1 - mesh.volume / truth)
        assert abs(errors[-1]) < 0.008 / factor**2 + 1e-3 * (factor == 4)
    assert errors[0] > 0


@pytest.mark.parametrize("name", ["ift-four-steered", "ift-three-steered"])
def test_a_sheet_gives_less_and_comes_closer_with_the_cells(name: str) -> None:
    vehicle = load_vehicle(name)
    truth = volume(vehicle)
    for factor in (1, 2):
        space = space_on(vehicle, Grid(40 * factor, 72 * factor))
        mesh = to_mesh(sheet_of(space))
        assert_solid(mesh)
        assert truth * (1 - 0.06 / factor) < mesh.volume < to_mesh(space).volume


def test_a_mesh_reaches_from_pole_to_pole_and_once_around(
    ift: PermissibleSpace,
) -> None:
    low, high = to_mesh(ift).bounds
    assert low[:2] == pytest.approx([-2, -np.pi])
    assert high[:2] == pytest.approx([2, np.pi])
    assert -low[2] == high[2] == pytest.approx(1, rel=1e-3)


def test_the_top_is_v_max_and_the_bottom_that_of_driving_backwards() -> None:
    vehicle = four_steered((-155, 155), max_reverse_speed=0.3)
    space = space_on(vehicle)
    assert len(space.tables.load) == 2
    mesh = to_mesh(space)
    assert_solid(mesh)
    assert mesh.volume == pytest.approx(volume(vehicle), rel=1e-3)
    kappa, beta, v = mesh.vertices.T
    for reverse in (False, True):
        on = (v < 0) == reverse
        truth = exact_v_max(vehicle, kappa[on], beta[on], reverse=reverse)
        inside = truth > 0
        assert inside.mean() > 0.9
        assert (np.abs(v[on]) <= truth)[inside].all()
        assert np.abs(v[on])[inside] == pytest.approx(truth[inside], rel=1e-2)
    assert v[np.abs(kappa) < 1].min() >= -0.3  # K's speed is c v_s: more beyond


def test_the_walls_stand_on_the_border(ift: PermissibleSpace) -> None:
    vehicle = load_vehicle("ift-four-steered")
    mesh = to_mesh(ift)
    walls = mesh.faces[np.abs(mesh.face_normals[:, 2]) < 1e-9]
    kappa, beta, _ = mesh.vertices[np.unique(walls)].T
    inner = (np.abs(kappa) < 2) & (np.abs(beta) < np.pi)
    steps = np.array([[-1, 0], [1, 0], [0, -1], [0, 1]]) * 2e-4
    near = np.stack([kappa, beta], axis=-1)[inner][:, None] + steps
    blocked = exact_v_max(vehicle, near[..., 0], near[..., 1]) == 0
    assert inner.sum() > 200
    assert blocked.any(axis=1).all()


@pytest.mark.parametrize("max_cells", [64, 1000, 5000, 10**9])
def test_a_thinned_mesh_keeps_the_border(ift: PermissibleSpace, max_cells: int) -> None:
    full = to_mesh(ift, max_cells=10**9)
    mesh = to_mesh(ift, max_cells=max_cells)
    assert_solid(mesh)

    def ground(m: trimesh.Trimesh) -> float:
        up = m.face_normals[:, 2] > 1e-9
        a, b, c = np.moveaxis(m.vertices[m.faces[up]][..., :2], 1, 0)
        (x0, y0), (x1, y1) = (b - a).T, (c - a).T
        return float((x0 * y1 - x1 * y0).sum() / 2)

    assert ground(mesh) == pytest.approx(ground(full), rel=1e-12)
    assert len(mesh.faces) <= len(full.faces)
    assert mesh.volume <= full.volume * (1 + 1e-9)
    assert mesh.volume > full.volume * (1 - 20 / min(max_cells, 11520))


def test_slivers_narrower_than_a_cell_survive() -> None:
    vehicle = four_steered((-1.0, 1.0))
    space = space_on(vehicle, Grid(40, 72))
    assert not (space.tables.state == 0).any()  # no cell is free all over
    mesh = to_mesh(space, parts=32)
    assert_solid(mesh)
    assert mesh.body_count == 1
    low, high = mesh.bounds
    assert low[0] < 0 < high[0] < 0.02
    assert high[1] == pytest.approx(np.radians(1.0), rel=1e-3)
    fine = to_mesh(space_on(vehicle, Grid(1280, 2304)))
    assert mesh.volume == pytest.approx(fine.volume, rel=0.15)


@pytest.mark.parametrize(
    "name", ["ift-four-steered", "rover-mirrored-stops", "mpo-700"]
)
def test_a_sheet_has_as_many_bodies_as_certain_components(name: str) -> None:
    space = sheet_of(space_on(load_vehicle(name)))
    bodies = to_mesh(space).split()
    assert len(bodies) == components(part_states(space)[0], line=True).max()


def test_a_space_in_two_components_gives_two_bodies() -> None:
    vehicle = four_steered((60, 200))
    space = space_on(vehicle)
    # Cut open at β = ±π.
    assert components(space.tables.state).max() == 1
    cut = components(space.tables.state, line=True).max()
    assert to_mesh(space).body_count == to_mesh(sheet_of(space)).body_count == cut


def test_faces_are_coloured_by_what_binds_and_walls_are_grey() -> None:
    mesh = to_mesh(space_on(load_vehicle("ift-four-steered"), Grid(40, 72)))
    colours = mesh.visual.face_colors  # type: ignore[union-attr]
    grey = (colours[:, :3] == 127).all(axis=1)
    assert (grey == (np.abs(mesh.face_normals[:, 2]) < 1e-9)).all()


@pytest.mark.parametrize("name", ["differential", "ackermann", "tricycle"])
def test_the_area_of_a_ribbon_is_the_integral(name: str) -> None:
    vehicle = load_vehicle(name)
    space = space_on(vehicle)
    kappa = (np.arange(200_000) + 0.5) / 50_000 - 2
    beta = np.full_like(kappa, space.line_beta)
    sides = [
        exact_v_max(vehicle, kappa, beta, reverse=reverse) for reverse in (False, True)
    ]
    truth = float(sum(side.mean() for side in sides) * 4)
    mesh = to_ribbon(space)
    assert mesh.area == pytest.approx(truth, rel=3e-4)
    assert mesh.area <= truth * (1 + 1e-5)
    assert (mesh.vertices[:, 1] == space.line_beta).all()
    assert mesh.face_normals == pytest.approx(np.tile([0, -1, 0], (len(mesh.faces), 1)))
    assert to_ribbon(sheet_of(space)).area == pytest.approx(truth, rel=0.02)
    assert to_ribbon(sheet_of(space)).area <= mesh.area * (1 + 1e-12)


def test_the_ribbon_of_a_vehicle_that_cannot_turn_lies_over_beta() -> None:
    space = space_on(load_vehicle("synchro-drive"))
    mesh = to_ribbon(space)
    low, high = mesh.bounds
    assert low[0] == high[0] == 0
    assert [low[1], high[1]] == pytest.approx([-np.pi, np.pi])
    v_max = space.v_max(0.0, 0.3) + space.v_max(0.0, 0.3, reverse=True)
    assert mesh.area == pytest.approx(2 * np.pi * v_max, rel=1e-3)
    assert (mesh.face_normals[:, 0] > 0.99).all()


@pytest.mark.parametrize("suffix", [".glb", ".stl", ".ply", ".PLY"])
def test_files_hold_the_same_solid(
    ift: PermissibleSpace, tmp_path: Path, suffix: str
) -> None:
    mesh = to_mesh(ift, max_cells=1000)
    path = tmp_path / f"space{suffix}"
    path.write_text("older")
    export(mesh, path)
    back = trimesh.load_mesh(path)
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]
    assert back.is_watertight
    assert back.volume == pytest.approx(mesh.volume, rel=1e-5)
    assert back.bounds == pytest.approx(mesh.bounds, abs=1e-5)
    if suffix != ".stl":
        colours = back.visual.vertex_colors  # type: ignore[union-attr]
        assert len(np.unique(colours, axis=0)) > 1


@pytest.mark.parametrize("name", ["space", "space.obj", "space.glb.txt"])
def test_an_unknown_suffix_is_refused(
    ift: PermissibleSpace, tmp_path: Path, name: str
) -> None:
    mesh = to_mesh(ift, max_cells=64)
    with pytest.raises(InvalidInput, match=r"must end in \.glb, \.ply, \.stl"):
        export(mesh, tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_a_file_that_cannot_be_written_leaves_nothing_behind(
    ift: PermissibleSpace, tmp_path: Path
) -> None:
    mesh = to_mesh(ift, max_cells=64)
    (tmp_path / "taken.stl").mkdir()
    for path in (tmp_path / "missing" / "x.stl", tmp_path / "taken.stl"):
        with pytest.raises(InvalidInput, match="must be writable"):
            export(mesh, path)
    assert [entry.name for entry in tmp_path.iterdir()] == ["taken.stl"]


@pytest.mark.parametrize(
    ("make", "name", "message"),
    [
        (to_mesh, "differential", "use to_ribbon"),
        (to_mesh, "synchro-drive", "use to_ribbon"),
        (to_ribbon, "mecanum", "use to_mesh"),
    ],
)
def test_the_wrong_kind_of_space_is_refused(
    make: Callable[[PermissibleSpace], trimesh.Trimesh], name: str, message: str
) -> None:
    with pytest.raises(InvalidInput, match=message):
        make(space_on(load_vehicle(name), Grid(40, 72)))


@pytest.mark.parametrize(
    "numbers", [{"max_cells": 31}, {"parts": 3}, {"parts": 6}, {"parts": 68}]
)
def test_numbers_out_of_range_are_refused(
    ift: PermissibleSpace, numbers: dict[str, int]
) -> None:
    with pytest.raises(InvalidInput, match=next(iter(numbers))):
        to_mesh(ift, **numbers)


def test_a_space_without_a_permitted_part_is_refused() -> None:
    space = sheet_of(space_on(four_steered((-0.1, 0.1)), Grid(16, 24)))
    with pytest.raises(InvalidInput, match="nothing is permitted"):
        to_mesh(space)


def test_the_space_is_not_changed(ift: PermissibleSpace) -> None:
    before = dump_space(ift)
    to_mesh(ift)
    assert dump_space(ift) == before


def faces_up(mesh: trimesh.Trimesh) -> npt.NDArray[np.int64]:
    return np.asarray(mesh.faces[mesh.face_normals[:, 2] > 1e-9])


def test_tops_of_a_plain_space_are_two_triangles_per_cell() -> None:
    mesh = to_mesh(space_on(load_vehicle("mecanum"), Grid(16, 24)))
    assert len(faces_up(mesh)) == 2 * 16 * 24
