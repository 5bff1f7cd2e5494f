"""Meshes of random vehicles: closed, and inside the permitted set."""

import numpy as np
import pytest
import trimesh

from configspace import (
    Grid,
    InvalidInput,
    PermissibleSpace,
    build_space,
    catalog,
    dump_space,
    exact_v_max,
    load_vehicle,
    parse_space,
)
from configspace.mesh import to_mesh, to_ribbon
from configspace.testing import random_vehicle
from configspace.topology import components, part_states
from configspace.vehicle import Vehicle


def random_mesh(
    rng: np.random.Generator, space: PermissibleSpace
) -> trimesh.Trimesh | None:
    max_cells = int(rng.choice([64, 500, 3000, 10**6]))
    try:
        return to_mesh(space, max_cells=max_cells)
    except InvalidInput:
        return None


def assert_closed(mesh: trimesh.Trimesh) -> None:
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.nondegenerate_faces().all()
    assert mesh.volume > 0


def assert_inside(
    rng: np.random.Generator, mesh: trimesh.Trimesh, vehicle: Vehicle, known: bool
) -> None:
    """Sample the faces; where the vehicle is known the border may be cut short."""
    for up, reverse in ((1, False), (-1, True)):
        faces = mesh.faces[up * mesh.face_normals[:, 2] > 1e-9]
        picked = faces[rng.integers(0, len(faces), 2000)]
        weights = rng.dirichlet([0.5] * 3, 2000)
        kappa, beta, v = (mesh.vertices[picked] * weights[..., None]).sum(axis=1).T
        kappa = np.clip(kappa, -2, 2)
        truth = exact_v_max(vehicle, kappa, beta, reverse=reverse)
        inside = truth > 0
        assert (np.abs(v) <= truth * (1 + 1e-12))[inside].all()
        if not known:
            assert inside.all()


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", ["steered", "mixed", "mecanum", "omni"])
def test_random_solids_are_closed_and_inside(seed: int, kind: str) -> None:
    rng = np.random.default_rng([seed, len(kind), ord(kind[1])])
    made = 0
    for _ in range(8):
        vehicle = random_vehicle(rng, kind)  # type: ignore[arg-type]
        grid = Grid(4 * int(rng.integers(4, 20)), int(rng.integers(24, 120)))
        space = build_space(vehicle, grid, cache=False)
        sheet = parse_space(dump_space(space))
        for one in (space, sheet):
            mesh = random_mesh(rng, one)
            if mesh is None:
                continue
            made += 1
            assert_closed(mesh)
            assert_inside(rng, mesh, vehicle, one.vehicle is not None)
            if one is sheet:
                state, _, _ = part_states(sheet)
                assert mesh.body_count == components(state, line=True).max()
    assert made >= 8


@pytest.mark.parametrize("name", catalog())
def test_every_vehicle_of_the_catalogue_has_a_mesh(name: str) -> None:
    vehicle = load_vehicle(name)
    space = build_space(vehicle, Grid(40, 72), cache=False)
    if space.line_beta is not None or space.is_translating:
        assert to_ribbon(space).area > 0
        return
    mesh = to_mesh(space)
    assert_closed(mesh)
    assert_inside(np.random.default_rng(1), mesh, vehicle, known=True)
