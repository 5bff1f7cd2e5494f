"""Occupancy maps as map servers write them: a picture and a YAML file.

References
----------
ROS ``map_server`` and ``nav2_map_server``: the value p of a cell is its darkness from
0 to 1, or its brightness if ``negate``; it is occupied above ``occupied_thresh``, free
below ``free_thresh``, unknown between. The origin is the pose of the lower left corner.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import shapely
from PIL import Image

from configspace import InvalidInput, Problem
from configspace.vehicle_io import parse_yaml
from omniplan.obstacles.polygons import Geometries
from omniplan.samples import MAX_VALUE

__all__ = ["MAX_CELLS", "MAX_RECTANGLES", "read_map"]

BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]

MAX_CELLS = 64_000_000
"""Largest number of cells of a map."""
MAX_RECTANGLES = 1_000_000
"""Largest number of rectangles its occupied cells may make: more is noise, not a hall,
and takes gigabytes."""


@dataclass(frozen=True)
class _Header:
    image: Path
    resolution: float
    origin: tuple[float, float, float]
    negate: bool
    occupied: float
    free: float


def read_map(path: Path, *, unknown_is_free: bool) -> Geometries:
    """Return rectangles whose union are the cells a vehicle may not touch.

    Parameters
    ----------
    path : Path
        The YAML file.
    unknown_is_free : bool
        Whether unknown cells are left out.

    Raises
    ------
    InvalidInput
        With every mistake of the YAML file; or if the picture cannot be read, is
        partly transparent, or is too large.
    """
    header = _header(path)
    level, white = _levels(header)
    shade = np.arange(white + 1)
    p = (shade if header.negate else white - shade) / white
    blocks = p > header.occupied if unknown_is_free else ~(p < header.free)
    left, right, top, bottom = runs_of(blocks[level])
    if left.size > MAX_RECTANGLES:
        given = f"{left.size} rectangles of occupied cells"
        allowed = f"at most {MAX_RECTANGLES}; is it a map?"
        raise InvalidInput(Problem("image", given, allowed), f"map {path}")
    size, height = header.resolution, len(level)
    far = max(map(abs, header.origin[:2])) + size * math.hypot(*level.shape)
    if far > MAX_VALUE:
        given = (
            f"{level.shape[1]} × {height} cells of {size:g} m, origin {header.origin}"
        )
        allowed = f"a map within {MAX_VALUE:g} m of the axes"
        raise InvalidInput(Problem("resolution", given, allowed), f"map {path}")
    boxes = shapely.box(
        left * size, (height - bottom) * size, right * size, (height - top) * size
    )
    x, y, yaw = header.origin
    c, s = math.cos(yaw), math.sin(yaw)
    turn, place = np.array([[c, s], [-s, c]]), np.array([x, y])
    return np.asarray(shapely.transform(boxes, lambda xy: xy @ turn + place))


def runs_of(occupied: BoolArray) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Return the runs of occupied cells of rows, equal ones below each other joined.

    Parameters
    ----------
    occupied : (h, w) bool

    Returns
    -------
    left, right, top, bottom : (n,) int
        Columns ``[left, right)`` of the rows ``[top, bottom)``.
    """
    edge = np.diff(occupied.astype(np.int8), axis=1, prepend=0, append=0)
    row, left = np.nonzero(edge == 1)
    _, right = np.nonzero(edge == -1)
    # By columns, then rows: runs that continue one another are neighbours.
    order = np.lexsort((row, right, left))
    row, left, right = row[order], left[order], right[order]
    starts = np.ones(row.size, dtype=bool)
    starts[1:] = (
        (left[1:] != left[:-1]) | (right[1:] != right[:-1]) | (row[1:] != row[:-1] + 1)
    )
    first = np.flatnonzero(starts)
    last = np.append(first[1:], row.size)[: first.size] - 1
    return left[first], right[first], row[first], row[last] + 1


def _header(path: Path) -> _Header:
    """Return what the YAML file says, or raise with all its mistakes."""
    subject = f"map {path}"
    try:
        data = parse_yaml(path.read_text("utf-8"), subject)
    except InvalidInput as error:
        raise InvalidInput(error.problems, subject) from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)[:200]
        problem = Problem("the file", reason, "a readable YAML file")
        raise InvalidInput(problem, subject) from error
    if not isinstance(data, dict):
        allowed = f"a mapping with {', '.join(sorted(set(_CHECKS) - {'mode'}))}"
        raise InvalidInput(Problem("the file", repr(data)[:60], allowed), subject)
    problems = list(_problems(data))
    if problems:
        raise InvalidInput(problems, subject)
    x, y, yaw = data["origin"]
    return _Header(
        path.parent / data["image"],
        float(data["resolution"]),
        (float(x), float(y), float(yaw)),
        bool(data["negate"]),
        float(data["occupied_thresh"]),
        float(data["free_thresh"]),
    )


def _problems(data: dict[Any, Any]) -> Iterator[Problem]:
    """Yield every mistake of the YAML file."""
    for key in sorted(map(str, set(data) - set(_CHECKS))):
        yield Problem(key, "unknown key", f"allowed are {', '.join(sorted(_CHECKS))}")
    wrong = set()
    for key, (is_right, allowed) in _CHECKS.items():
        if key not in data:
            if key != "mode":
                yield Problem(key, "missing", allowed)
        elif not is_right(data[key]):
            wrong.add(key)
            yield Problem(key, repr(data[key])[:60], allowed)
    both = {"free_thresh", "occupied_thresh"}
    if both <= set(data) - wrong and data["free_thresh"] > data["occupied_thresh"]:
        given = f"{data['free_thresh']:g}, occupied_thresh {data['occupied_thresh']:g}"
        yield Problem("free_thresh", given, "at most occupied_thresh")


_PIXELS = {"1", "L", "LA", "P", "PA", "RGB", "RGBA"}
"""Kinds of pixels, as Pillow names them, whose white is known."""


def _is_share(value: object) -> bool:
    return _is_number(value, 0.0, 1.0)


def _is_number(value: object, low: float = -MAX_VALUE, high: float = MAX_VALUE) -> bool:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number and low <= value <= high  # type: ignore[operator]


def _is_pose(value: object) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(map(_is_number, value))


_CHECKS: dict[str, tuple[Callable[[Any], bool], str]] = {
    "image": (
        lambda value: isinstance(value, str) and value != "",
        "the name of a PNG or PGM picture",
    ),
    "resolution": (
        lambda value: _is_number(value, 1e-6, 1e3),
        "metres per cell, 1e-6 to 1000",
    ),
    "origin": (_is_pose, "[x, y, yaw] of the lower left corner, m, m, rad"),
    "negate": (lambda value: value in (0, 1), "0 or 1"),
    "occupied_thresh": (_is_share, "from 0 to 1"),
    "free_thresh": (_is_share, "from 0 to 1"),
    "mode": (lambda value: value == "trinary", "trinary"),
}


def _levels(header: _Header) -> tuple[npt.NDArray[np.integer[Any]], int]:
    """Return the brightness of every cell, (h, w), the top row first, and of white."""
    subject = f"map image {header.image}"
    try:
        with warnings.catch_warnings():
            # The size is checked here, before anything is decoded.
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(header.image) as picture:
                width, height = picture.size
                if width * height > MAX_CELLS:
                    raise _TooLarge(f"{width} × {height} cells")
                return _brightness(picture, header.negate)
    except (_TooLarge, Image.DecompressionBombError) as error:
        problem = Problem("image", str(error)[:200], f"at most {MAX_CELLS} cells")
        raise InvalidInput(problem, subject) from error
    except (_Transparent, _OtherPixels) as error:
        raise InvalidInput(Problem("image", *error.args), subject) from error
    except (OSError, SyntaxError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)[:200]
        problem = Problem("image", reason, "a readable PNG or PGM picture")
        raise InvalidInput(problem, subject) from error


class _TooLarge(Exception):
    """The picture has too many cells."""


class _Transparent(Exception):
    """Map servers disagree on it: some add opacity to the mean, some transparency."""


class _OtherPixels(Exception):
    """Nobody says what is white: numbers of 32 bits, printing colours."""


def _brightness(
    picture: Image.Image, negate: bool
) -> tuple[npt.NDArray[np.integer[Any]], int]:
    """Return the brightness of every cell, of colours the sum, and that of white."""
    # Pillow widens 16 bits of PNG and PGM to 32, scaled to 65535.
    is_wide = picture.mode == "I" and picture.format in ("PNG", "PPM")
    if is_wide or picture.mode.startswith("I;16"):
        return np.asarray(picture).astype(np.uint16), 65535
    if picture.mode not in _PIXELS:
        allowed = f"8 or 16 bits of grey, or colours: {', '.join(sorted(_PIXELS))}"
        raise _OtherPixels(f"pixels of kind {picture.mode}", allowed)
    if picture.mode in ("1", "L"):
        return np.asarray(picture.convert("L")), 255
    colours = np.asarray(picture.convert("RGBA"))
    if (colours[..., 3] < 255).any():
        raise _Transparent("transparent cells", "a picture without alpha")
    # Servers count an opaque alpha as one more white channel. Without it cells are
    # darker: no more are free, but for this.
    if negate and picture.mode in ("LA", "PA", "RGBA"):
        given = "alpha, with negate, which map servers count as brightness"
        raise _Transparent(given, "a picture without alpha")
    return colours[..., :3].sum(axis=-1, dtype=np.uint16), 3 * 255
