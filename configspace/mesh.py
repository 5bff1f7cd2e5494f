"""The permissible set as a solid: a closed mesh for viewers, printers and CAD.

The one module of the package that imports trimesh; nothing imports it before a mesh is
wanted.

Axes are x = κ_n [1], y = β [rad], z = v_s [m/s]. The solid is cut open at β = ±π and at
κ_n = ±2: it has walls there though the space goes on (`configspace.topology` joins the
two sides). The mesh consists of as many bodies as the strip so cut has components; two
that touch at a corner only are apart.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import trimesh

from configspace.area import permitted_area
from configspace.errors import InvalidInput, Problem
from configspace.files import reason_of, whole_file
from configspace.kernels import BLOCKED, FREE, MIXED
from configspace.places import (
    Blocks,
    border_on,
    is_permitted,
    kappa_beta,
    speeds,
)

if TYPE_CHECKING:
    from configspace.space import PermissibleSpace

__all__ = ["export", "to_mesh", "to_ribbon"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_SUFFIXES = (".glb", ".ply", ".stl")
_RIBBON_PARTS = 16
"""Parts of a mixed cell of a line-mobile vehicle."""
# One colour for each bit of `Reason`, again from the start if there are more.
_COLOURS = np.array(
    [
        (227, 119, 194, 255),
        (188, 189, 34, 255),
        (31, 119, 180, 255),
        (255, 127, 14, 255),
        (44, 160, 44, 255),
        (148, 103, 189, 255),
        (140, 86, 75, 255),
        (214, 39, 40, 255),
    ],
    dtype=np.uint8,
)
_GREY = np.array((127, 127, 127, 255), dtype=np.uint8)


def to_mesh(
    space: PermissibleSpace, *, max_cells: int = 20_000, parts: int = 4
) -> trimesh.Trimesh:
    """Return {(κ_n, β, v): -v_max⁻ ≤ v ≤ v_max⁺} over the permitted area as a solid.

    Parameters
    ----------
    space : PermissibleSpace
        Not of a line-mobile vehicle or one that cannot turn.
    max_cells : int, at least 32
        A finer table is thinned out to this many cells, but for cells at the border of
        the blocked area: they are always kept.
    parts : int, a multiple of 4, 4 to 64
        Parts along each side of a mixed cell, if the vehicle is known; else 4.

    Returns
    -------
    mesh : trimesh.Trimesh
        Watertight, normals outward. Faces have the colour of the limit that binds, the
        walls are grey.

    Raises
    ------
    InvalidInput
        If the space is a curve, nothing is permitted or a number is out of range.

    Notes
    -----
    A space that does not know its vehicle contributes its free cells and the free parts
    of mixed ones (`configspace.topology.part_states`); the solid lies inside the
    permitted set, over whole faces. Where the vehicle is known, mixed cells are cut
    along the exact border. A permitted part as wide as a cell divided by `parts`
    survives, and so does every free part of the table; a narrower one may fall into
    several bodies. The border is straight between exact points, so it may be off by the
    square of the size of a part. Speeds are never too high where the solid is
    permitted, and too low by the square of the size of a cell.

    A steering range of exactly one turn blocks nothing, so the solid is not cut where
    such a wheel is at its stop; the components of `configspace.topology` are.

    Examples
    --------
    >>> import configspace
    >>> vehicle = configspace.load_vehicle("mecanum")
    >>> grid = configspace.Grid(40, 72)
    >>> mesh = to_mesh(configspace.build_space(vehicle, grid, cache=False))
    >>> mesh.is_watertight, mesh.body_count, mesh.extents.round(2)[:2].tolist()
    (True, 1, [4.0, 6.28])
    """
    if space.line_beta is not None or space.is_translating:
        raise _wrong_kind(space, "its space is a curve", "to_ribbon")
    if max_cells < 32:
        raise InvalidInput(Problem("max_cells", f"{max_cells}", "at least 32"))
    if not (4 <= parts <= 64 and parts % 4 == 0):
        raise InvalidInput(Problem("parts", f"{parts}", "a multiple of 4, 4 to 64"))
    area = permitted_area(space, max_cells, parts if space.vehicle else 4)
    if not len(area.triangles):
        raise _nothing_permitted(space)
    forward, reverse = speeds(space, area.place, area.triangles, area.cell, area.blocks)
    ground = kappa_beta(space, area.place)
    vertices = np.concatenate(
        [np.column_stack([ground, forward]), np.column_stack([ground, -reverse])]
    )
    top, bottom = area.triangles, area.triangles[:, ::-1] + len(ground)
    walls = _walls(area.triangles, len(ground))
    middle = ground[area.triangles].mean(axis=1)
    colours = [_reason_colours(space, middle, reverse=back) for back in (False, True)]
    return trimesh.Trimesh(
        vertices,
        np.concatenate([top, bottom, walls]),
        face_colors=np.concatenate([*colours, np.tile(_GREY, (len(walls), 1))]),
        metadata=_metadata(space),
        process=False,
    )


def to_ribbon(space: PermissibleSpace) -> trimesh.Trimesh:
    """Return {(κ_n, β, v): -v_max⁻ ≤ v ≤ v_max⁺} of a space that is a curve.

    Parameters
    ----------
    space : PermissibleSpace
        Of a line-mobile vehicle, or of one that cannot turn.

    Returns
    -------
    mesh : trimesh.Trimesh
        A flat ribbon over κ_n at the vehicle's constant β, normals towards -β; or over
        β at κ_n = 0, normals towards κ_n = 2.

    Raises
    ------
    InvalidInput
        If the space is a surface or nothing is permitted.
    """
    if space.line_beta is None and not space.is_translating:
        raise _wrong_kind(space, "its space is a surface", "to_mesh")
    place, pieces, cell = _ribbon_pieces(space)
    if not len(pieces):
        raise _nothing_permitted(space)
    state = space.tables.state
    blocks = Blocks.of(state == FREE, state.size)
    forward, reverse = speeds(space, place, pieces, cell, blocks)
    ground = kappa_beta(space, place)
    vertices = np.concatenate(
        [np.column_stack([ground, -reverse]), np.column_stack([ground, forward])]
    )
    a, b = pieces.T
    c, d = b + len(place), a + len(place)
    faces = np.stack([[a, b, c], [a, c, d]]).transpose(2, 0, 1).reshape(-1, 3)
    middle = ground[pieces].mean(axis=1)
    return trimesh.Trimesh(
        vertices,
        faces,
        face_colors=np.repeat(_reason_colours(space, middle, reverse=False), 2, axis=0),
        metadata=_metadata(space),
        process=False,
    )


def export(mesh: trimesh.Trimesh, path: str | Path) -> None:
    """Write a mesh as GLB, STL or PLY, by the suffix.

    Parameters
    ----------
    mesh : trimesh.Trimesh
    path : str or Path
        Ends in ``.glb``, ``.stl`` or ``.ply``. STL has no colours.

    Raises
    ------
    InvalidInput
        If the suffix is another one or the file cannot be written; an older file of
        that name stays as it is.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in _SUFFIXES:
        allowed = f"must end in {', '.join(_SUFFIXES)}"
        raise InvalidInput(Problem("path", str(path), allowed))
    content = io.BytesIO()
    mesh.export(content, file_type=suffix[1:])
    try:
        with whole_file(path) as temporary:
            temporary.write_bytes(content.getvalue())
    except OSError as error:
        raise InvalidInput(
            Problem("path", f"{path}: {reason_of(error)}", "must be writable")
        ) from error


def _walls(triangles: IntArray, below: int) -> IntArray:
    """Return the walls along the border: its sides occur once among the triangles."""
    sides = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1)
    sides = sides.reshape(-1, 2)
    ordered = np.sort(sides, axis=1)
    _, index, count = np.unique(
        ordered[:, 0] * below + ordered[:, 1], return_index=True, return_counts=True
    )
    a, b = sides[index[count == 1]].T
    lower = np.stack([a + below, b + below, b], axis=-1)
    return np.concatenate([lower, np.stack([a + below, b, a], axis=-1)])


def _ribbon_pieces(
    space: PermissibleSpace,
) -> tuple[FloatArray, IntArray, IntArray]:
    """Return permitted pieces of a curve: vertices, the ends of pieces, their cells."""
    state, bits = space.tables.state.ravel(), space.tables.parts.ravel()
    along = 1 if space.is_translating else 0
    n = np.where(state == MIXED, _RIBBON_PARTS, 1)
    cell = np.repeat(np.arange(state.size), n)
    step = np.arange(cell.size) - np.repeat(np.cumsum(n) - n, n)
    bit = step * 4 // n[cell] * (1 if along else 4)
    is_free = (bits[cell] >> bit) & 1 == 1
    low, high = cell + step / n[cell], cell + (step + 1) / n[cell]
    corner = np.unique(np.concatenate([low, high]))
    ends = np.stack([np.searchsorted(corner, x) for x in (low, high)], axis=-1)
    place = np.zeros((corner.size, 2))
    place[:, along] = corner
    permitted = np.zeros(corner.size, dtype=bool)
    if space.vehicle is not None:
        permitted = is_permitted(space, place)
    permitted[ends[is_free]] = True
    inside = permitted[ends] & ((state != BLOCKED)[cell, None])
    if space.vehicle is None:
        inside &= is_free[:, None]
    cut = np.flatnonzero(inside[:, 0] != inside[:, 1])
    outer = inside[cut].argmin(axis=1)
    border = border_on(space, place[ends[cut, 1 - outer]], place[ends[cut, outer]])
    ends[cut, outer] = len(place) + np.arange(cut.size)
    kept = inside.any(axis=1)
    used, pieces = np.unique(ends[kept], return_inverse=True)
    vertices = np.concatenate([place, border])[used]
    return vertices, pieces.reshape(-1, 2).astype(np.int64), cell[kept]


def _reason_colours(
    space: PermissibleSpace, at: FloatArray, *, reverse: bool
) -> npt.NDArray[np.uint8]:
    """Return the colour of the first limit that binds, (n, 4)."""
    why = space.reason(at[:, 0], at[:, 1], reverse=reverse).astype(np.int64)
    bit = np.round(np.log2(np.maximum(why & -why, 1))).astype(np.int64)
    return np.where((why > 0)[:, None], _COLOURS[bit % len(_COLOURS)], _GREY)


def _metadata(space: PermissibleSpace) -> dict[str, str]:
    return {
        "name": space.name,
        "axes": "x: kappa_n [1], y: beta [rad], z: v_s [m/s]",
        "fingerprint": space.header.fingerprint,
    }


def _wrong_kind(space: PermissibleSpace, given: str, other: str) -> InvalidInput:
    return InvalidInput(Problem(f"space of {space.name}", given, f"use {other}"))


def _nothing_permitted(space: PermissibleSpace) -> InvalidInput:
    allowed = "a permitted part is needed; a finer table or more parts may show one"
    return InvalidInput(
        Problem(f"space of {space.name}", "nothing is permitted", allowed)
    )
