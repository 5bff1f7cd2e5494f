"""What stands in the hall, as a value."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry import MultiPolygon, Polygon

from configspace import InvalidInput, Problem
from omniplan.obstacles.asked import checked_path
from omniplan.obstacles.maps import read_map
from omniplan.obstacles.meshes import Mesh, shadow
from omniplan.obstacles.polygons import (
    Area,
    Geometries,
    checked_polygon,
    joined,
    rings_of,
)
from omniplan.samples import locked

__all__ = ["Obstacles"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


JOINED = 20_000
"""Pieces of an obstacle that are joined for a drawing, at most."""


def _no_pieces() -> Geometries:
    return locked(np.empty(0, dtype=np.object_))


def _no_owner() -> IntArray:
    return locked(np.empty(0, dtype=np.int64))


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Named areas of the floor that no vehicle may touch; there may be none.

    Build one with `from_polygons`, `from_json`, `from_meshes` or `from_map`, and join
    several with ``a | b``.
    """

    names: tuple[str, ...] = ()
    """Of every obstacle."""
    pieces: Geometries = field(default_factory=_no_pieces)
    """(n,) polygons; the union of those of an obstacle is its area."""
    owner: IntArray = field(default_factory=_no_owner)
    """(n,) index of the obstacle that each piece belongs to, rising."""

    @classmethod
    def from_polygons(cls, polygons: Iterable[Any] | Mapping[str, Any]) -> Obstacles:
        """Return polygons as obstacles.

        Parameters
        ----------
        polygons : iterable or mapping from names
            Each (n, 2) float, m: corners in either direction, in the world frame; or a
            shapely polygon, which may have holes. Without names they are called
            ``obstacle 0``, ``obstacle 1`` and so on.

        Raises
        ------
        InvalidInput
            With every polygon that is empty, crosses itself, or has coordinates that
            are not finite or larger than 1e6 m.

        Examples
        --------
        >>> hall = Obstacles.from_polygons({"pillar": [[1, 0], [2, 0], [2, 1]]})
        >>> hall.names, hall.bounds
        (('pillar',), (1.0, 0.0, 2.0, 1.0))
        """
        if isinstance(polygons, str) or not isinstance(polygons, Iterable):
            allowed = "a list of polygons, or a mapping from names to polygons"
            raise InvalidInput(Problem("obstacles", repr(polygons)[:60], allowed))
        named = dict(polygons) if isinstance(polygons, Mapping) else _numbered(polygons)
        found: list[Geometries] = []
        problems: list[Problem] = []
        for name, polygon in named.items():
            try:
                found.append(_parts(checked_polygon(str(name), polygon)))
            except InvalidInput as error:
                problems += error.problems
        if problems:
            raise InvalidInput(problems, "obstacles")
        return cls._of([str(name) for name in named], found)

    @classmethod
    def from_json(cls, path: str | Path) -> Obstacles:
        """Return the polygons of a JSON file.

        Parameters
        ----------
        path : str or Path
            A list of polygons, or a mapping from names to them. A polygon is a list of
            corners ``[x, y]`` in m, or a mapping of ``exterior`` to such a list and
            ``holes`` to a list of them.

        Raises
        ------
        InvalidInput
            If the file cannot be read or a polygon cannot be used.
        """
        subject = f"obstacle file {path}"
        try:
            text = checked_path(path, "obstacle file").read_text("utf-8")
            data = json.loads(text, object_pairs_hook=_once_each)
        except (OSError, ValueError, RecursionError) as error:
            reason = getattr(error, "strerror", None) or str(error)[:200]
            problem = Problem("the file", reason, "a readable JSON file")
            raise InvalidInput(problem, subject) from error
        if not isinstance(data, list | dict):
            allowed = "a list of polygons, or a mapping from names to polygons"
            raise InvalidInput(Problem("the file", repr(data)[:60], allowed), subject)
        named = data if isinstance(data, dict) else _numbered(data)
        try:
            return cls.from_polygons(
                {name: _with_holes(name, each) for name, each in named.items()}
            )
        except InvalidInput as error:
            raise InvalidInput(error.problems, subject) from error

    @classmethod
    def from_meshes(
        cls, meshes: Iterable[Mesh] | Mapping[str, Mesh], heights: tuple[float, float]
    ) -> Obstacles:
        """Return solids as obstacles: the shadow of what lies between two heights.

        Parameters
        ----------
        meshes : iterable or mapping from names
            ``trimesh.Trimesh`` or whatever has ``vertices`` (n, 3) in m and
            ``faces`` (m, 3); closed, z up, in the world frame.
        heights : (float, float), m
            Lower and upper height of the slab the vehicle and its load drive through.
            A solid that is nowhere between them is no obstacle.

        Raises
        ------
        InvalidInput
            If a mesh is open, turned inside out, or has coordinates that are not
            finite, or the heights are not in order.
        """
        if isinstance(meshes, Mapping):
            named: dict[str, Mesh] = dict(meshes)
        elif not isinstance(meshes, Iterable):
            allowed = "a list of meshes, or a mapping from names to meshes"
            raise InvalidInput(Problem("meshes", type(meshes).__name__, allowed))
        else:
            named = {f"mesh {i}": mesh for i, mesh in enumerate(meshes)}
        shadows = {name: shadow(name, mesh, heights) for name, mesh in named.items()}
        kept = {name: area for name, area in shadows.items() if not area.is_empty}
        return cls._of(list(kept), [_parts(area) for area in kept.values()])

    @classmethod
    def from_map(
        cls, path: str | Path, *, unknown_is_free: bool = False, name: str | None = None
    ) -> Obstacles:
        """Return the occupied cells of an occupancy map as one obstacle.

        Parameters
        ----------
        path : str or Path
            YAML file as map servers write it, with ``image`` (PNG or PGM),
            ``resolution``, ``origin``, ``negate``, ``occupied_thresh``,
            ``free_thresh`` and perhaps ``mode: trinary``.
        unknown_is_free : bool
            Whether a vehicle may drive over cells that are neither occupied nor free.
        name : str, optional
            Default the name of the YAML file.

        Raises
        ------
        InvalidInput
            If a file is missing, a key is wrong, or the map is too large.

        Notes
        -----
        Cells are kept as rectangles without loss: runs of a row, joined with equal runs
        of the rows beside it. A map without occupied cells is an empty value.
        """
        path = checked_path(path, "map")
        rectangles = read_map(path, unknown_is_free=unknown_is_free)
        if not rectangles.size:
            return cls()
        return cls._of([name or path.name], [rectangles])

    @classmethod
    def _of(cls, names: Sequence[str], pieces: Sequence[Geometries]) -> Obstacles:
        if not pieces:
            return cls()
        index = np.arange(len(pieces), dtype=np.int64)
        owner = np.repeat(index, [len(each) for each in pieces])
        return cls(tuple(names), locked(np.concatenate(pieces)), locked(owner))

    def __or__(self, other: Obstacles) -> Obstacles:
        """Return both together."""
        if not isinstance(other, Obstacles):
            return NotImplemented
        owner = np.concatenate([self.owner, other.owner + len(self.names)])
        pieces = np.concatenate([self.pieces, other.pieces])
        return Obstacles(self.names + other.names, locked(pieces), locked(owner))

    def __len__(self) -> int:
        """Return the number of obstacles."""
        return len(self.names)

    @property
    def bounds(self) -> tuple[float, float, float, float] | None:
        """Least x and y, largest x and y, m; None if there is no obstacle."""
        if not self.pieces.size:
            return None
        x0, y0, x1, y1 = shapely.total_bounds(self.pieces).tolist()
        return x0, y0, x1, y1

    @property
    def area(self) -> float:
        """Area that is occupied, m²; where obstacles overlap it counts once."""
        return float(joined(self.pieces).area)

    def rings(self) -> tuple[tuple[FloatArray, ...], ...]:
        """Return the closed rings (n, 2), m, of every obstacle, for drawing.

        Outer rings run counter-clockwise, holes clockwise. The pieces of an obstacle
        are joined unless there are more than `JOINED`.
        """
        ends = np.searchsorted(self.owner, np.arange(len(self.names) + 1))
        owned = (self.pieces[a:b] for a, b in itertools.pairwise(ends.tolist()))
        return tuple(
            rings_of(joined(own) if len(own) <= JOINED else MultiPolygon(own.tolist()))
            for own in owned
        )


def _once_each(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a mapping of a file; of two obstacles of one name none is lost."""
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"the key {twice!r} stands twice")
    return found


def _parts(area: Area) -> Geometries:
    return np.asarray(shapely.get_parts(area), dtype=np.object_)


def _numbered(polygons: Iterable[Any]) -> dict[str, Any]:
    return {f"obstacle {i}": polygon for i, polygon in enumerate(polygons)}


def _with_holes(name: str, given: Any) -> Any:
    """Return the polygon that a mapping of a file describes; all else as it is."""
    if not isinstance(given, dict):
        return given
    unknown = sorted(set(given) - {"exterior", "holes"})
    if unknown or "exterior" not in given:
        allowed = "exterior, and perhaps holes"
        raise InvalidInput(Problem(name, f"keys {sorted(given)}", allowed))
    inner = given.get("holes", [])
    if not isinstance(inner, list):
        raise InvalidInput(
            Problem(f"{name}: holes", repr(inner)[:60], "a list of polygons")
        )
    outer = checked_polygon(f"{name}: exterior", given["exterior"])
    holes = [
        shapely.get_coordinates(checked_polygon(f"{name}: holes[{i}]", hole))
        for i, hole in enumerate(inner)
    ]
    return Polygon(shapely.get_coordinates(outer), holes)
